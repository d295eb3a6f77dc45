"""Batches: the same outcomes as single runs, radii in every shape, bad rows refused."""

import math

import numpy as np
import pytest

import tadcore
from tadcore import Outcome, OutcomeKind, ScenarioError


@pytest.fixture
def sc():
    return tadcore.scenarios.load("paper-i1")


@pytest.fixture
def team():
    return tadcore.scenarios.load("paper-i2")


def starts(sc, games, seed=0):
    rng = np.random.default_rng(seed)
    return sc.positions + rng.uniform(-0.5, 0.5, (games, sc.n + 2, sc.dim))


@pytest.mark.parametrize("name", ["paper-i1", "paper-i1-suicidal", "paper-i2"])
def test_a_batch_is_its_single_runs(name):
    sc = tadcore.scenarios.load(name)
    positions = starts(sc, 5)
    batch = tadcore.simulate_batch(sc, positions)
    assert (batch.kind.dtype, batch.defender.dtype, batch.time.dtype) == (np.int8, np.int32, np.float64)
    for i, at in enumerate(positions):
        changes = {f"defenders[{j}].position": at[j] for j in range(sc.n)}
        one = tadcore.simulate(sc.replace({**changes, "target.position": at[-2], "attacker.position": at[-1]}))
        assert batch[i] == one.outcome
    assert sum(batch.counts().values()) == len(batch) == len(list(batch)) == 5


def test_a_batch_reads_well(sc):
    batch = tadcore.simulate_batch(sc, [sc.positions, sc.positions + 1.0], threads=1)
    assert repr(batch) == "Batch(2 games: 0 timeout, 0 captured, 2 intercepted)"
    assert batch[1] == Outcome("intercepted", 0, batch.time[1])
    assert len(batch[:1]) == 1
    assert batch.kind.tolist() == [OutcomeKind.INTERCEPTED] * 2
    with pytest.raises(IndexError):
        batch[2]


def test_no_games_is_a_batch_of_none(sc):
    batch = tadcore.simulate_batch(sc, np.empty((0, 5, 2)))
    assert len(batch) == 0
    assert batch.counts() == {"timeout": 0, "captured": 0, "intercepted": 0}


def test_radii_of_one_row_serve_all_games(sc):
    positions = np.stack([sc.positions] * 3)
    wide = np.full(3, np.inf)
    full = tadcore.simulate_batch(sc, positions, wide)
    assert full.time == pytest.approx([2.66] * 3, abs=1e-9)
    rows = np.array([[5, 2.25, 1.25], [np.inf] * 3, [5, 2.25, 1.25]])
    mixed = tadcore.simulate_batch(sc, positions, rows)
    assert mixed.time == pytest.approx([1.395, 2.66, 1.395], abs=1e-9)
    with_target = np.column_stack([rows, np.full(3, np.inf)])
    assert np.array_equal(tadcore.simulate_batch(sc, positions, with_target).time, mixed.time)
    assert np.array_equal(tadcore.simulate_batch(sc, positions, [np.inf] * 4).time, full.time)
    large = tadcore.simulate_batch(sc, positions, capture_radii=[[0.1] * 4, [0.1, 0.1, 0.1, 3.0], [4.0, 0.1, 0.1, 3.0]])
    assert [o.kind for o in large] == ["intercepted", "captured", "intercepted"]
    assert large.time.tolist()[1:] == [0.0, 0.0]
    assert large.defender.tolist() == [0, -1, 0]


def test_space_and_plane_are_one_code(sc):
    flat = starts(sc, 3)
    raised = np.concatenate([flat, np.full((3, 5, 1), 0.7)], axis=-1)
    lifted = sc.replace(
        {
            "attacker.position": (-2, 2, 1),
            "target.position": (0, 1, 0),
            **{f"defenders[{i}].position": (i, 0, 0) for i in range(3)},
        }
    )
    plane, space = tadcore.simulate_batch(sc, flat), tadcore.simulate_batch(lifted, raised)
    assert np.array_equal(plane.kind, space.kind)
    assert np.allclose(plane.time, space.time, rtol=0, atol=1e-9)


def edited(sc, where, value, games=20):
    positions = np.stack([sc.positions] * games)
    positions[where] = value
    return positions


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_bad_position_is_refused_by_its_index(sc, value):
    with pytest.raises(ScenarioError) as caught:
        tadcore.simulate_batch(sc, edited(sc, (17, 2, 0), value))
    assert caught.value.field == "positions[17, 2, 0]"
    assert caught.value.rule == "a finite number"
    assert str(value) in str(caught.value)


def test_many_bad_rows_are_counted(sc):
    with pytest.raises(ScenarioError) as caught:
        tadcore.simulate_batch(sc, np.full((100, 5, 2), np.nan))
    assert caught.value.errors[0].field == "positions[0, 0, 0]"
    assert len(caught.value.errors) == 21
    assert "980 more such entries" in str(caught.value)


@pytest.mark.parametrize(
    "positions",
    [
        np.zeros((5, 2)),
        np.zeros((3, 4, 2)),
        np.zeros((3, 5, 3)),
        np.zeros((1, 3, 5, 2)),
        np.zeros(3),
        0.0,
        None,
        "abc",
        [[[0, 0]] * 5, [[0, 0]] * 4],
        np.zeros((3, 5, 2), dtype=bool),
        np.zeros((3, 5, 2), dtype=complex),
        np.full((3, 5, 2), "1"),
        [],
    ],
)
def test_what_are_no_positions(sc, positions):
    with pytest.raises(ScenarioError, match=r"^positions: got .*of shape \(M, 5, 2\)"):
        tadcore.simulate_batch(sc, positions)


@pytest.mark.parametrize(
    ("name", "value", "field", "rule"),
    [
        ("visibility_radii", [5, -1, 1], "visibility_radii[1]", "a positive number, or inf"),
        ("visibility_radii", [5, 0, 1], "visibility_radii[1]", "a positive number, or inf"),
        ("visibility_radii", [5, math.nan, 1], "visibility_radii[1]", "a positive number, or inf"),
        ("visibility_radii", [[5, 2, 1], [5, 2, math.nan]], "visibility_radii[1, 2]", "a positive number"),
        ("visibility_radii", [5, 2], "visibility_radii", "of shape (3,) or (2, 3)"),
        ("visibility_radii", [[5, 2, 1]], "visibility_radii", "of shape (3,) or (2, 3)"),
        ("visibility_radii", [5, 2, 1, 3], "visibility_radii", "inf in the target's"),
        ("visibility_radii", 5.0, "visibility_radii", "of shape (3,) or (2, 3)"),
        ("visibility_radii", ["5", "2", "1"], "visibility_radii", "numbers"),
        ("visibility_radii", [5, 0.05, 1], "visibility_radii[0, 1]", "larger than the defender's capture radius"),
        ("visibility_radii", [[5, 2, 1], [5, 2, 0.1]], "visibility_radii[1, 2]", "larger than the defender's"),
        ("capture_radii", [0.1, 0.1, 0.1], "capture_radii", "of shape (4,) or (2, 4)"),
        ("capture_radii", [0.1, 0.1, 0.1, math.inf], "capture_radii[3]", "a positive finite number"),
        ("capture_radii", [0.1, -0.1, 0.1, 0.1], "capture_radii[1]", "a positive finite number"),
        ("capture_radii", [[0.1] * 4, [0.1, 0.1, 0.1, 0.0]], "capture_radii[1, 3]", "a positive finite number"),
        ("capture_radii", [0.1, 3.0, 0.1, 0.1], "visibility_radii[0, 1]", "larger than the defender's"),
        ("threads", 0, "threads", "a whole number"),
        ("threads", -1, "threads", "a whole number"),
        ("threads", 1.0, "threads", "a whole number"),
        ("threads", True, "threads", "a whole number"),
    ],
)
def test_bad_radii_and_threads_are_refused(sc, name, value, field, rule):
    with pytest.raises(ScenarioError) as caught:
        tadcore.simulate_batch(sc, [sc.positions] * 2, **{name: value})
    assert caught.value.field == field
    assert rule in caught.value.rule


def test_the_target_of_i2_brings_its_own_radius(team):
    batch = tadcore.simulate_batch(team, [team.positions] * 2, [[5, 3, 0.3, 2.5], [5, 3, 0.3, 10]])
    assert [o.kind for o in batch] == ["intercepted", "captured"]
    assert batch.time == pytest.approx([3.54, 3.925], abs=1e-9)
    with pytest.raises(ScenarioError, match="of shape"):
        tadcore.simulate_batch(team, [team.positions], [5, 3, 0.3])


def test_nothing_that_was_given_is_changed(sc):
    positions = np.asfortranarray(starts(sc, 4))
    radii = np.array([5.0, 2.25, 1.25])
    before = positions.copy()
    tadcore.simulate_batch(sc, positions, radii)
    assert np.array_equal(positions, before)
    assert radii.tolist() == [5.0, 2.25, 1.25]
    assert len(tadcore.simulate_batch(sc, positions.astype(np.float32))) == 4


@pytest.mark.parametrize("scores", [False, True])
def test_progress_changes_nothing(sc, scores, monkeypatch, capsys):
    """In pieces a batch is bitwise the same; nothing is written where no terminal watches."""
    monkeypatch.setattr("tadcore.simulation.batch._PIECE", 7)
    shaken = sc.replace({"disturbance": {"defenders": 0.05}})
    positions = starts(sc, 40)
    sight = np.random.default_rng(3).uniform(1.0, 5.0, (40, 3))
    for game in (sc,) if scores else (sc, shaken):
        for radii in (None, sight):
            whole = tadcore.simulate_batch(game, positions, radii, seed=5, first_trial=11, scores=scores)
            shown = tadcore.simulate_batch(game, positions, radii, seed=5, first_trial=11, scores=scores, progress=True)
            for name in ("kind", "defender", "time", "diverged", "scores"):
                np.testing.assert_array_equal(getattr(whole, name), getattr(shown, name))
    assert capsys.readouterr().err == ""
