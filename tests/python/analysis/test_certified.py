"""Certified maps: no start contradicts a proof, boxes cover the region once, what is not covered is refused by name."""

import matplotlib.pyplot as plt
import numpy as np
import pytest

import tadcore
from tadcore import ScenarioError, certified_map, load_certified_map
from tadcore.cli.app import main

pytestmark = pytest.mark.usefixtures("agg")
REGION = {"x": (-3, 3), "y": (-3, 3)}
LIMITED = tadcore.scenarios.load("paper-i1").replace({"horizon": 2.0, "step": 0.02})
FULL = LIMITED.replace({"d*.visibility_radius": float("inf")})
TEAM = tadcore.scenarios.load("paper-i2").replace({"horizon": 1.0, "step": 0.02})


@pytest.fixture(scope="module")
def found():
    return certified_map(FULL, **REGION, resolution=0.03)


def starts_in(found, count, seed=1):
    """All corners of proved boxes, then random starts in them and on their rims, with what was proved of each."""
    data, draws = found.dataset, np.random.default_rng(seed)
    proved = np.flatnonzero(data["kind"].values >= 0)
    which = np.concatenate([np.repeat(proved, 4), draws.choice(proved, size=count)])
    part = np.concatenate([np.tile([[0, 0], [0, 1], [1, 0], [1, 1]], (len(proved), 1)), draws.random((count, 2))])
    rim = (np.arange(len(part)) >= 4 * len(proved)) & (draws.random(len(part)) < 0.3)
    part[rim, 0] = np.round(part[rim, 0])
    low, high = (np.column_stack([data[f"{axis}_{end}"].values[which] for axis in "xy"]) for end in ("low", "high"))
    points = np.where(part == 1.0, high, np.clip(low + part * (high - low), low, high))
    return points, data["kind"].values[which], data["defender"].values[which]


def contradictions(found, count, seed=1):
    """How many starts in proved boxes end otherwise, or diverge."""
    points, kind, defender = starts_in(found, count, seed)
    sc = found.scenario
    positions = np.repeat(sc.positions[np.newaxis], len(points), axis=0)
    positions[:, sc.players.index(found.player)] = points
    batch = tadcore.simulate_batch(sc, positions)
    return int(np.count_nonzero((batch.kind != kind) | (batch.defender != defender) | batch.diverged))


def test_no_start_contradicts_a_proof(found):
    assert found.proved > 0.95
    assert contradictions(found, 50_000) == 0


def test_nearly_all_of_full_sight_is_proved_unasked():
    whole = certified_map(tadcore.scenarios.load("paper-i1-full"), x=(-3, 3), y=(-3, 3))
    assert whole.proved > 0.995
    assert contradictions(whole, 100_000) == 0


@pytest.mark.parametrize(
    ("sc", "player", "least"), [(LIMITED, "attacker", 0.1), (LIMITED, "d2", 0.1), (TEAM, "target", 0.02)]
)
def test_no_start_contradicts_a_proof_where_sight_is_limited(sc, player, least):
    found = certified_map(sc, player, **REGION, resolution=0.09, budget=1_400)
    assert found.proved > least
    assert contradictions(found, 10_000) == 0


def test_a_planted_error_is_found(found):
    """The proof of one game, held against another of which one weight differs by a thousandth."""
    other = FULL.replace({"attacker.control_weight": 0.8008})
    assert contradictions(tadcore.CertifiedMap(other, found.player, found.dataset), 40_000) > 0


def test_boxes_cover_the_region_once(found):
    data = found.dataset
    assert found.extent == (-3.0, 3.0, -3.0, 3.0)
    assert found.areas.sum() == pytest.approx(36.0, rel=1e-12)
    assert sum(found.shares().values()) == pytest.approx(1.0, rel=1e-12)
    draws = np.random.default_rng(3).uniform(-3, 3, size=(300, 2))
    inside = [
        (data["x_low"].values <= x)
        & (x < data["x_high"].values)
        & (data["y_low"].values <= y)
        & (y < data["y_high"].values)
        for x, y in draws
    ]
    assert [int(row.sum()) for row in inside] == [1] * 300
    boxes = np.array([np.flatnonzero(row)[0] for row in inside])
    kind, defender = found.at(draws)
    np.testing.assert_array_equal(kind, data["kind"].values[boxes])
    np.testing.assert_array_equal(defender, np.where(kind == 2, data["defender"].values[boxes], -1))
    corners = np.array([[-3, -3], [3, 3], [-3, 3], [3, -3]])
    assert found.at(corners)[0].shape == (4,)


def test_bounds_hold_what_a_million_starts_would_say(found):
    draws = np.random.default_rng(7).uniform(-3, 3, size=(20_000, 2))
    positions = np.repeat(FULL.positions[np.newaxis], len(draws), axis=0)
    positions[:, -1] = draws
    batch = tadcore.simulate_batch(FULL, positions)
    bounds = found.bounds()
    assert list(bounds) == ["timeout", "captured", "d1", "d2", "d3", "intercepted"]
    for name, where in {
        "captured": batch.kind == 1,
        "intercepted": batch.kind == 2,
        "d2": (batch.kind == 2) & (batch.defender == 1),
    }.items():
        low, high = bounds[name]
        error = 4.0 * np.sqrt(where.mean() * (1 - where.mean()) / len(draws))
        assert low - error <= where.mean() <= high + error
        assert 0 <= low <= high <= 1
        assert high - low == pytest.approx(1 - found.proved, abs=1e-9)


def test_threads_and_pieces_change_nothing(monkeypatch):
    one = certified_map(LIMITED, **REGION, resolution=0.1, budget=700, threads=1)
    monkeypatch.setattr("tadcore.analysis.certified._TOGETHER", 100)
    assert one.dataset.identical(certified_map(LIMITED, **REGION, resolution=0.1, budget=700, threads=3).dataset)


def test_a_budget_is_kept_and_told():
    found = certified_map(LIMITED, **REGION, resolution=0.01, budget=500)
    assert found.dataset.attrs["boxes_looked_at"] == 500
    assert found.shares()["budget"] > 0
    assert "past the budget" in repr(found)


def test_saved_and_read_back(found, tmp_path):
    found.save(tmp_path / "map.nc")
    again = load_certified_map(tmp_path / "map.nc")
    assert (again.scenario, again.player) == (found.scenario, found.player)
    for name in found.dataset:
        np.testing.assert_array_equal(again.dataset[name].values, found.dataset[name].values)
    assert repr(again) == repr(found)
    assert again.bounds() == found.bounds()
    bad = found.dataset.assign(x_low=found.dataset["x_low"] + 1e-3)
    (tmp_path / "bad.nc").write_bytes(bytes(bad.to_netcdf(engine="scipy", format="NETCDF3_64BIT")))
    for name, words in [("bad.nc", "damaged"), ("none.nc", "No such file")]:
        with pytest.raises(ScenarioError, match=words):
            load_certified_map(tmp_path / name)
    (tmp_path / "text.nc").write_text("no map")
    with pytest.raises(ScenarioError, match="another kind"):
        load_certified_map(tmp_path / "text.nc")


def test_drawn(tmp_path):
    found = certified_map(FULL, **REGION, resolution=0.1)
    ax = found.plot()
    words = [text.get_text() for text in ax.figure.legends[0].get_texts()] if ax.figure.legends else []
    words += [text.get_text() for text in ax.get_legend().get_texts()] if ax.get_legend() else []
    assert "undecided" in words
    plt.close(ax.figure)
    found.save(tmp_path / "map.png")
    assert (tmp_path / "map.png").read_bytes().startswith(b"\x89PNG")
    assert "<img" in found._repr_html_()


@pytest.mark.parametrize(
    ("change", "given", "words"),
    [
        ({"sensing.mean_time_to_failure": 0.5}, {}, "failures"),
        ({}, {"player": "d9"}, "player"),
        ({}, {"x": (1, 1)}, "x: got"),
        ({}, {"y": (0, float("nan"))}, "y: got"),
        ({}, {"resolution": 0.0}, "resolution"),
        ({}, {"resolution": "fine"}, "resolution"),
        ({}, {"budget": 0}, "budget"),
        ({}, {"threads": 0}, "threads"),
    ],
)
def test_what_is_not_covered_is_refused_by_name(change, given, words):
    with pytest.raises(ScenarioError, match=words):
        certified_map(LIMITED.replace(change), **(REGION | given))


def test_space_is_refused():
    places = {f"defenders[{i}].position": (*d.position, 0) for i, d in enumerate(LIMITED.defenders)}
    lifted = LIMITED.replace({"attacker.position": (-2, 2, 0), "target.position": (0, 1, 0), **places})
    with pytest.raises(ScenarioError, match="in the plane"):
        certified_map(lifted)


@pytest.mark.parametrize("points", [[[9.0, 0.0]], [1.0, 2.0], [[np.nan, 0.0]]])
def test_points_elsewhere_are_refused(found, points):
    with pytest.raises(ScenarioError, match="points"):
        found.at(points)


def test_on_the_command_line(tmp_path, capsys):
    out = tmp_path / "map.nc"
    arguments = [
        "map",
        "paper-i1-full",
        "--set",
        "horizon=1.0",
        "--set",
        "step=0.05",
        "--x",
        "-3",
        "3",
        "--y",
        "-3",
        "3",
    ]
    with pytest.raises(SystemExit) as end:
        main([*arguments, "--certified", "--size", "64", "--out", str(out)])
    assert end.value.code == 0
    said = capsys.readouterr()
    assert "% of the area proved" in said.out + said.err
    assert load_certified_map(out).proved > 0.8
    with pytest.raises(SystemExit) as end:
        main([*arguments, "--certified", "--time", "--out", str(out)])
    assert end.value.code == 2
