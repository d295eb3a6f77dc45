"""Where to place a player: every place is a batch of its own, and the answer of a search is played again, afresh."""

import matplotlib as mpl
import numpy as np
import pytest
from scipy.stats import beta, norm

import tadcore
from tadcore import ScenarioError, best_start, probability_map
from tadcore.analysis import placement, probabilities
from tadcore.sampling import Box, Disk


@pytest.fixture(scope="module")
def study():
    sc = tadcore.scenarios.load("paper-i1")
    vary = {"attacker.position": Disk([-2, 2], 1.0), "d1.visibility_radius": Box(1.0, 4.0)}
    return tadcore.Study(sc, vary, trials=150, seed=11)


@pytest.fixture(scope="module")
def found(study):
    return probability_map(study, "d3", x=(-2, 1, 4), y=(-1, 2, 3))


def played(study, player, place, **changes):
    """The same study with the player's start replaced, through `Study.run`."""
    sc = study.scenario
    field = f"defenders.{int(player[1:]) - 1}" if player[0] == "d" else player
    return study.replace(sc=sc.replace({f"{field}.position": place}), **changes).run()


def ends(count, trials, level):
    """Clopper and Pearson's interval from quantiles of the beta distribution."""
    tail = (1 - level) / 2
    low = 0.0 if count == 0 else beta.ppf(tail, count, trials - count + 1)
    return low, 1.0 if count == trials else beta.isf(tail, count + 1, trials - count)


def test_every_place_is_a_study_of_its_own(study, found):
    assert found.dataset["estimate"].dims == ("outcome", "y", "x")
    for x in found.dataset["x"].values:
        for y in found.dataset["y"].values:
            alone = played(study, "d3", (x, y)).probabilities()
            here = found.dataset.sel(x=x, y=y)
            assert here["outcome"].values.tolist() == list(alone.names)
            assert np.array_equal(here["count"], alone.count)
            assert np.array_equal(here["estimate"], alone.estimate)
    assert np.ptp(found.dataset["estimate"].sel(outcome="intercepted").values) > 0.1


def test_intervals_are_exact_and_bands_hold_at_all_places(found):
    for count, low, high, band_low, band_high in zip(
        *(found.dataset[name].values.ravel() for name in ("count", "low", "high", "band_low", "band_high")), strict=True
    ):
        assert (low, high) == pytest.approx(ends(count, 150, 0.95), abs=1e-12)
        assert (band_low, band_high) == pytest.approx(ends(count, 150, 1 - 0.05 / 12), abs=1e-12)


def test_blocks_change_nothing(study, found, monkeypatch):
    monkeypatch.setattr(probabilities, "BLOCK", 1)
    assert probability_map(study, "d3", x=(-2, 1, 4), y=(-1, 2, 3), threads=1).dataset.identical(found.dataset)


def test_a_played_study_gives_the_same_map(study, found):
    assert probability_map(study.run(), "d3", x=(-2, 1, 4), y=(-1, 2, 3)).dataset.identical(found.dataset)


def test_the_grid_takes_the_place_of_what_the_study_varies(study, found):
    varied = study.replace(vary={**study.vary, "d3.position": Disk([0, 0], 0.5)})
    again = probability_map(varied, "d3", x=(-2, 1, 4), y=(-1, 2, 3))
    assert np.array_equal(again.dataset["count"], found.dataset["count"])


def test_in_space_the_grid_is_a_plane_at_a_height():
    flat = tadcore.scenarios.load("paper-i1")
    players = [*(f"defenders.{i}" for i in range(3)), "target", "attacker"]
    lifted = flat.replace({f"{p}.position": (*at, 0.0) for p, at in zip(players, flat.positions, strict=True)})
    study = tadcore.Study(lifted, {"attacker.position": Disk([-2, 2, 0], 1.0)}, trials=40, seed=2)
    found = probability_map(study, "target", x=(0, 1, 2), y=(0, 1, 2), z=0.5)
    assert found.dataset.attrs["z"] == 0.5
    alone = played(study, "target", (1.0, 0.0, 0.5)).probabilities()
    assert np.array_equal(found.dataset["count"].sel(x=1.0, y=0.0), alone.count)
    best = best_start(study, "d2", x=(-1, 1), y=(-1, 1), z=(-0.5, 0.5), evaluations=24)
    assert len(best.position) == 3
    with pytest.raises(ScenarioError, match="z"):
        best_start(study, "d2", x=(-1, 1), y=(-1, 1))


def test_the_best_place_of_a_grid_carries_its_band(found):
    best = found.best("captured")
    at = found.dataset.sel(outcome="captured", x=best["x"], y=best["y"])
    assert best["estimate"] == found.dataset["estimate"].sel(outcome="captured").max() == at["estimate"]
    assert (best["low"], best["high"]) == (at["band_low"], at["band_high"])
    with pytest.raises(ScenarioError, match="must be one of timeout"):
        found.best("won")


def test_a_best_start_is_judged_by_fresh_trials(study):
    best = best_start(study, "d3", x=(-3, 3), y=(-3, 3), outcome="d3", evaluations=120)
    fresh = played(study, "d3", best.position, seed=12)
    hits = fresh.probabilities().count[5]
    assert best.estimate == hits / 150
    assert (best.low, best.high) == pytest.approx(ends(hits, 150, 0.95), abs=1e-12)
    own = study.replace(seed=12).run()
    assert best.own == own.probabilities()["d3"][0]
    assert best.gain == pytest.approx(best.estimate - best.own)
    assert best.gain_low <= best.gain <= best.gain_high
    assert best.searched == played(study, "d3", best.position).probabilities()["d3"][0]
    assert best.searched >= played(study, "d3", study.scenario.positions[2]).probabilities()["d3"][0]
    assert 120 <= best.evaluations < 150
    assert repr(best) == repr(best_start(study, "d3", x=(-3, 3), y=(-3, 3), outcome="d3", evaluations=120, threads=1))


def test_the_search_finds_what_a_grid_finds(study):
    grid = probability_map(study, "d3", x=(-3, 3, 25), y=(-3, 3, 25)).best("captured")
    best = best_start(study, "d3", x=(-3, 3), y=(-3, 3), outcome="captured", evaluations=600)
    assert best.searched >= grid["estimate"]


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"player": "d4"}, "player"),
        ({"x": (1, -1)}, "x"),
        ({"x": (0, np.inf)}, "x"),
        ({"y": 3}, "y"),
        ({"z": (0, 1)}, "z"),
        ({"outcome": "d9"}, "outcome"),
        ({"evaluations": 3}, "evaluations"),
        ({"seed": 11}, "seed"),
        ({"level": 1.0}, "level"),
    ],
)
def test_bad_questions_are_refused_by_name(study, wrong, said):
    given = {"player": "d3", "x": (-1, 1), "y": (-1, 1), **wrong}
    with pytest.raises(ScenarioError) as refused:
        best_start(study, given.pop("player"), **given)
    assert refused.value.field == said


def test_a_played_study_cannot_be_searched(study):
    with pytest.raises(ScenarioError, match="study"):
        best_start(study.run(), "d3", x=(-1, 1), y=(-1, 1))


def test_the_figure_shows_the_outcome_asked_for(found):
    before = mpl.get_backend()
    mpl.use("Agg")
    try:
        ax = found.plot(outcome="captured", quantity="low", best=False)
        shown = ax.images[0].get_array()
        assert np.array_equal(shown, found.dataset["low"].sel(outcome="captured"))
        assert ax.get_xlabel() == "$x_{d_{3}}(0)$"
        with pytest.raises(ValueError, match="no quantity"):
            found.plot(quantity="mean")
        with pytest.raises(ValueError, match="no outcome"):
            found.plot(outcome="d9")
    finally:
        mpl.use(before)


def test_the_fresh_draws_are_checked_before_the_search(study, monkeypatch):
    """The study's own draws are games, those of the fresh seed are not."""
    vary = {"d1.visibility_radius": norm(1.0, 0.25)}

    def least(seed):
        drawn = study.replace(vary=vary, trials=2000, seed=seed).inputs()
        return drawn["defenders.0.visibility_radius"].min()

    own = next(seed for seed in range(1000) if least(seed) > 0.1)
    fresh = next(seed for seed in range(1000) if least(seed) <= 0.1)
    monkeypatch.setattr(placement.Placed, "events", lambda *_, **__: pytest.fail("a game was played"))
    with pytest.raises(ScenarioError, match=r"visibility_radius, trial [\d,]+: got"):
        best_start(study.replace(vary=vary, trials=2000, seed=own), "d3", x=(-2, 1), y=(-1, 2), seed=fresh)
