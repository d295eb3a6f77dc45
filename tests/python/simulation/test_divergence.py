"""Games that diverge: when they do is confirmed by SciPy's exponentials of gains that another solver found."""

import json
import math
from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
import pytest

import tadcore
from oracle.model import paper_cases
from oracle.network import adjacency, distances
from oracle.stepping import Gains, transition
from tadcore import plotting
from tadcore.game import Divergence
from tadcore.game.divergence import SIZE
from tadcore.game.sound import until_divergence


def unstable(weight=0.3, **changes):
    """Full sight would hold these games together; limited sight lets them go."""
    return tadcore.scenarios.load("paper-i2").replace({"attacker.control_weight": weight, **changes})


def sizes(positions):
    """The largest distance to the attacker at every instant, over the largest distance at the start."""
    to_attacker = np.linalg.norm(positions[:, :-1] - positions[:, -1:], axis=-1).max(axis=1)
    return to_attacker / distances(positions[0]).max()


def moved(sc, change):
    """The scenario with `change` applied to every position."""
    places = dict(zip(sc.players, sc.positions, strict=True))
    return sc.replace({f"{player}.position": tuple(change(at)) for player, at in places.items()})


def scaled(sc, factor):
    """The scenario with all lengths times `factor`."""
    sight = dict(zip(sc.constrained, factor * sc.visibility_radii, strict=True))
    reach = dict(zip((*sc.players[: sc.n], "attacker"), factor * sc.capture_radii, strict=True))
    radii = {f"{player}.visibility_radius": radius for player, radius in sight.items()}
    radii |= {f"{player}.capture_radius": radius for player, radius in reach.items()}
    places = {f"{player}.position": tuple(factor * at) for player, at in zip(sc.players, sc.positions, strict=True)}
    return sc.replace(radii | places)


@pytest.mark.parametrize("weight", [0.3, pytest.param(0.31, marks=pytest.mark.heavy)])
def test_the_instant_is_that_of_another_solver_and_scipys_exponentials(weight):
    sc = unstable(weight)
    run = tadcore.simulate(sc)
    case = next(case for case in paper_cases() if case.name == "I2 near target")
    game, start = replace(case.game, r_a=weight), case.start
    assert np.array_equal(start.positions, sc.positions)
    gains, positions, k = Gains(game, few=0, many=1), np.array(start.positions), 0
    scale = distances(positions).max()
    while distances(positions)[-1].max() <= 1000 * scale:
        _, rows = gains.loop(k, adjacency(positions, start.zeta))
        after = transition(rows, game.step) @ np.vstack([positions[:-1] - positions[-1], positions[-1]])
        positions, k = np.vstack([after[:-1] + after[-1], after[-1]]), k + 1
    assert run.diverged.time == pytest.approx(k * game.step, abs=1e-9)
    assert k > 100
    assert np.allclose(run.position[k], positions, rtol=1e-7, atol=0)


@pytest.mark.parametrize("weight", [0.3, 0.32, 0.34, 0.36, 0.38, 0.4])
def test_instant_and_size_are_those_of_the_record(weight):
    run = tadcore.simulate(unstable(weight))
    size = sizes(run.position)
    beyond = np.flatnonzero(size > SIZE)
    assert (run.diverged is None) == (beyond.size == 0) == (weight == 0.4)
    assert run.converged == (weight == 0.4)
    if beyond.size:
        assert run.diverged.time == run.times[beyond[0]]
        assert run.diverged.size == pytest.approx(size.max(), rel=1e-9)
        assert run.outcome.diverged
        assert all(np.isfinite(x).all() for x in (run.position, run.control, run.theta, list(run.costs.values())))
    batch = tadcore.simulate_batch(run.scenario, [run.scenario.positions] * 3)
    assert batch.diverged.tolist() == [run.diverged is not None] * 3
    assert batch.diverged.dtype == np.bool_
    assert [(o, o.diverged) for o in batch] == [(run.outcome, run.outcome.diverged)] * 3


def test_the_instant_does_not_depend_on_units_place_or_direction():
    sc = unstable()
    base = tadcore.simulate(sc).diverged
    for factor in (2.0**-40, 0.125, 1024.0, 2.0**60):
        assert tadcore.simulate(scaled(sc, factor)).diverged == base  # powers of two round nothing
    turn = np.array([[0.6, -0.8], [0.8, 0.6]])
    for other in (
        scaled(sc, 1e5),
        scaled(sc, 3e-7),
        moved(sc, lambda at: turn @ at),
        moved(sc, lambda at: at * [1, -1]),
        moved(sc, lambda at: at + np.array([7.0, -11.0])),
    ):
        assert tadcore.simulate(other).diverged.time == base.time


@pytest.mark.parametrize(
    "places", [{"d1": (5e4, 0.0)}, {"d1": (50.0, 0.0), "target": (-50.0, 0.0)}, {"d1": (0.0, 7.0), "d2": (0.0, -7.0)}]
)
def test_the_largest_distance_between_any_two_sets_the_scale(places):
    """Whoever they are: the attacker is between the two, or is one of them."""
    run = tadcore.simulate(unstable(**{f"{player}.position": place for player, place in places.items()}))
    size = sizes(run.position)
    assert run.diverged.time == run.times[np.argmax(size > SIZE)]
    assert run.diverged.size == pytest.approx(size.max(), rel=1e-12)


def test_a_run_that_diverged_says_so_wherever_it_speaks(tmp_path):
    run = tadcore.simulate(unstable())
    assert isinstance(run.diverged, Divergence)
    assert "DIVERGES at t = 0.725" in repr(run)
    assert str(run.outcome) == "time runs out at t = 6, after the game diverged"
    assert str(run.diverged).startswith("diverges at t = 0.725, up to 1.3e+30 times")
    changes = [change.time for change in run.network_changes]
    later = sum(t >= run.diverged.time for t in changes)
    assert run.changes_after_divergence == later > 100
    assert f"{len(changes) - 1 - later} network changes and {later} after it diverged" in repr(run)
    assert all(c.end < run.diverged.time for c in run.chattering)
    run.save(tmp_path)
    said = json.loads((tmp_path / "summary.json").read_text())
    assert said["diverged"]["time"] == run.diverged.time
    assert said["diverged"]["size"] == run.diverged.size
    assert said["converged"] is False
    assert said["network_changes_after_divergence"] == later
    assert run.dataset.attrs["diverged_time"] == run.diverged.time


def test_a_run_that_does_not_diverge_is_silent(tmp_path):
    run = tadcore.simulate(tadcore.scenarios.load("paper-i2"))
    assert run.diverged is None
    assert run.changes_after_divergence == 0
    assert "diverge" not in repr(run).lower() + str(run.outcome)
    run.save(tmp_path)
    assert json.loads((tmp_path / "summary.json").read_text())["diverged"] is None
    assert not any("diverged" in name for name in run.dataset.attrs)


@pytest.mark.parametrize("horizon", [40.0, 60.0])
def test_where_the_numbers_end_the_record_stops_and_the_batch_does_not(horizon):
    """Beyond 1e120 a cost is no double: the record stops before, and whoever is left times out at T, diverged."""
    sc = unstable(horizon=horizon)
    run = tadcore.simulate(sc)
    assert (run.outcome.kind, run.outcome.time, run.outcome.diverged) == ("timeout", horizon, True)
    assert run.times[-1] < horizon
    assert np.abs(run.position[-1]).max() > 1e115
    for numbers in (run.position, run.control, run.gains, run.theta, list(run.costs.values()), run.diverged.size):
        assert np.isfinite(numbers).all()
    assert len({len(x) for x in (run.times, run.position, run.control, run.adjacency, run.gains, run.theta)}) == 1
    assert run.diverged.time < run.times[-1]
    # A trial beside it that does not diverge: all in full sight.
    sight = np.stack([sc.visibility_radii, np.full(4, math.inf)])
    batch = tadcore.simulate_batch(sc, [sc.positions] * 2, sight)
    assert batch.diverged.tolist() == [True, False]
    assert batch[0] == run.outcome
    assert batch[1] == tadcore.simulate(sc.replace({"*.visibility_radius": math.inf})).outcome
    assert batch.counts()["diverged"] == 1
    assert sum(batch.counts().values()) == 2


@pytest.mark.parametrize("threads", [1, 2])
def test_a_batch_is_its_single_runs_on_every_row(threads):
    sc = unstable(0.48, step=0.02)
    rng = np.random.default_rng(3)
    starts = rng.uniform(-3, 3, (60, sc.n + 2, 2))
    batch = tadcore.simulate_batch(sc, starts, threads=threads)
    assert 5 < batch.diverged.sum() < 55
    for i, at in enumerate(starts):
        run = tadcore.simulate(sc.replace({f"{p}.position": tuple(x) for p, x in zip(sc.players, at, strict=True)}))
        assert (batch[i], batch[i].diverged) == (run.outcome, run.diverged is not None)
        assert batch.diverged[i] == (sizes(run.position).max() > 1000)
    assert batch[3:9].diverged.tolist() == batch.diverged[3:9].tolist()
    sound = batch.kind[~batch.diverged]
    assert batch.counts() == {
        "timeout": (sound == 0).sum(),
        "captured": (sound == 1).sum(),
        "intercepted": (sound == 2).sum(),
        "diverged": batch.diverged.sum(),
    }
    assert f"{batch.diverged.sum()} diverged" in repr(batch)


def test_games_in_full_sight_do_not_diverge():
    sc = unstable(0.3, **{"*.visibility_radius": math.inf})
    rng = np.random.default_rng(4)
    batch = tadcore.simulate_batch(sc.replace({"step": 0.02}), rng.uniform(-3, 3, (500, sc.n + 2, 2)))
    assert not batch.diverged.any()
    assert "diverged" not in batch.counts()


def test_a_saved_run_comes_back_with_its_divergence(tmp_path):
    for weight in (0.3, 0.6):
        run = tadcore.simulate(unstable(weight))
        run.save(tmp_path / "run.nc")
        back = tadcore.load_run(tmp_path / "run.nc")
        assert (back.diverged, back.outcome, back.outcome.diverged) == (run.diverged, run.outcome, run.outcome.diverged)
        assert repr(back) == repr(run)


FIGURES = ["trajectories", "controls", "distances", "visibility", "theta"]


@pytest.mark.parametrize("name", FIGURES)
def test_figures_end_where_the_game_diverges_and_say_so(name, agg):
    run = tadcore.simulate(unstable(0.38))
    ax = getattr(run.plot, name)()
    words = [ax.get_title(), ax.get_xlabel(), *(text.get_text() for text in ax.texts)]
    assert any("diverge" in word and "5.1" in word for word in words), words
    if name != "trajectories":
        assert ax.get_xlim()[1] == pytest.approx(run.diverged.time)
    drawn = np.concatenate([np.asarray(line.get_ydata(), dtype=float) for line in ax.get_lines()])
    assert np.nanmax(np.abs(drawn)) < 1e5


def test_panels_comparisons_and_animations_end_there_too(agg):
    run, calm = tadcore.simulate(unstable(0.38)), tadcore.simulate(unstable(0.6))
    gains = run.plot.gains()
    assert gains.flat[-1].get_xlabel() == "time $t$, up to the divergence at 5.1"
    assert gains.flat[0].get_xlim()[1] == pytest.approx(5.1)
    panels = run.plot.network()
    assert any("diverges at $t=5.1$" in text.get_text() for ax in panels.flat for text in ax.texts)
    both = plotting.compare(run, calm, what="distances")
    assert both.get_xlim()[1] == pytest.approx(5.1)
    assert "divergence at 5.1" in both.get_xlabel()
    pair = plotting.compare(run, calm)
    assert any("diverges at $t=5.1$" in text.get_text() for text in pair.texts)
    moving = run.animate(seconds=0.1)
    assert moving.run.times[-1] == pytest.approx(5.1)
    assert any("diverges" in text.get_text() for text in moving.figure().texts)
    plt.close("all")


def test_a_run_that_does_not_diverge_is_drawn_as_it_is():
    run = tadcore.simulate(unstable(0.6))
    assert until_divergence(run) is run


LATE = tadcore.Scenario.model_validate(
    {
        "interaction": "I2",
        "horizon": 7.322199828103176,
        "step": 0.06153109099246366,
        "attacker": {
            "position": [-1.6058244107424242, 0.0],
            "control_weight": 1.8451960502805542,
            "capture_radius": 0.05,
            "target_running_weight": 0.4873418398085757,
        },
        "target": {
            "position": [0.8399375163683034, 0.0],
            "control_weight": 1.9487901700418313,
            "visibility_radius": 1.0,
        },
        "defenders": [
            {
                "position": [at, 0.0],
                "control_weight": effort,
                "capture_radius": 0.05,
                "visibility_radius": sight,
                "evasion_running_weight": evasion,
            }
            for at, effort, sight, evasion in (
                (-1.1873359767883636, 0.6502409652557672, 1.0, 3.403277978552436),
                (0.5659481333498708, 2.97213185006851, math.inf, 1.858365931922464),
                (0.5667500143437075, 6.304072142336774, 0.5, 0.3431516922042831),
                (-0.7177403658168426, 1.0619288132644342, 0.5, 0.667291833265668),
            )
        ],
    }
)
"""On a line, where the attacker and d2 run through each other after the game has diverged."""


def test_passes_after_a_divergence_are_not_listed():
    run = tadcore.simulate(LATE)
    apart = run.position[:, 1, 0] - run.position[:, -1, 0]
    crossed = np.flatnonzero(apart[1:] * apart[:-1] < 0)
    assert run.times[crossed].min() > run.diverged.time  # the only times at which anybody runs through d2
    assert np.abs(apart).min() > 0.05
    assert run.passes == ()
    batch = tadcore.simulate_batch(LATE, [LATE.positions] * 3, passes=True)
    assert batch.passed.tolist() == [False] * 3
    assert batch.diverged.all()


def test_breakpoints_tell_divergence_from_every_other_end():
    sc = unstable(0.34)
    starts = np.repeat([sc.positions], 60, 0) + np.random.default_rng(1).normal(scale=0.3, size=(60, 5, 2))
    radii = np.linspace(0.6, 6.0, 7)
    curve = tadcore.radius_curve(sc, starts, player="d1", radii=radii, refine=True, tolerance=1e-6)
    found = curve.breakpoints
    marked = found.diverged_before | found.diverged_after
    assert marked.any()
    assert "into or out of a divergence" in repr(found)
    for i in np.flatnonzero(marked)[:6]:
        below, at = (
            tadcore.simulate_batch(
                sc, starts[found.trial[i] : found.trial[i] + 1], [radius, *sc.visibility_radii[1:].tolist()]
            )
            for radius in (found.radius[i] - 2e-6, found.radius[i])
        )
        assert (below.diverged[0], at.diverged[0]) == (found.diverged_before[i], found.diverged_after[i])
        for lost, batch, kind in (
            (found.diverged_before[i], below, found.kind_before[i]),
            (found.diverged_after[i], at, found.kind_after[i]),
        ):
            assert kind == (0 if lost else batch.kind[0])
    assert not ((found.diverged_before & found.diverged_after).any())


def test_a_map_of_times_draws_what_diverges_apart(agg):
    found = tadcore.outcome_map(unstable(0.34), x=(-3, 3, 31), y=(-2, 4, 31))
    lost = found.dataset["diverged"].values
    assert lost.any()
    assert not lost.all()
    ax = found.plot(quantity="time")
    shown = ax.images[-1].get_array()
    assert np.array_equal(np.ma.getmaskarray(shown) | np.isnan(np.ma.getdata(shown)), lost)
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["diverged"]
    ax.figure.canvas.draw()
    plt.close("all")
