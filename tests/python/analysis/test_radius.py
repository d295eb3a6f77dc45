"""The value of a radius: against separate batches, and breakpoints against the distances in recorded runs."""

from dataclasses import dataclass, field

import numpy as np
import pytest
from scipy import stats

import tadcore
from tadcore import ScenarioError, radius_curve
from tadcore.sampling import Disk
from tadcore.statistics import paired, probabilities, proportion_interval
from tadcore.statistics.intervals import ends

RADII = np.array([0.3, 0.8, 1.3, 1.8, 2.25, 2.8])


@pytest.fixture(scope="module")
def sc():
    return tadcore.scenarios.load("paper-i1")


@pytest.fixture(scope="module")
def positions(sc):
    return sc.positions + np.random.default_rng(5).uniform(-1, 1, (60, 5, 2))


@pytest.fixture(scope="module")
def curve(sc, positions):
    return radius_curve(sc, positions, player="d2", radii=RADII, refine=True)


def started(sc, positions, **changes):
    team = {f"defenders[{i}].position": at for i, at in enumerate(positions[:-2])}
    return sc.replace({**team, "target.position": positions[-2], "attacker.position": positions[-1], **changes})


def test_every_radius_is_a_batch_of_its_own(sc, positions, curve):
    for r, radius in enumerate(RADII):
        batch = tadcore.simulate_batch(sc.replace({"defenders[1].visibility_radius": radius}), positions)
        assert np.array_equal(curve.kind[r], batch.kind)
        assert np.array_equal(curve.defender[r], batch.defender)
        alone = probabilities(batch.kind, batch.defender, 3)
        assert curve.names == alone.names
        assert np.array_equal(curve.estimate[:, r], alone.estimate)
        assert np.array_equal(curve.low[:, r], alone.low)
        assert np.array_equal(curve.high[:, r], alone.high)
        wide = proportion_interval(alone.count, 60, level=1 - 0.05 / len(RADII), method="exact")
        assert np.array_equal((curve.band_low[:, r], curve.band_high[:, r]), wide)
    assert ((curve.band_low <= curve.low) & (curve.high <= curve.band_high)).all()
    assert np.ptp(curve.estimate[2]) > 0.1


def test_the_smallest_radius_is_the_first_whose_band_reaches(curve):
    for outcome, row in (("intercepted", 2), ("captured", 1)):
        for least in (0.05, 0.2, 0.5, 0.9):
            found = curve.smallest(least, outcome)
            reaching = [r for r, low in zip(RADII, curve.band_low[row], strict=True) if low >= least]
            assert found.radius == (reaching[0] if reaching else None)
            assert found.best == RADII[curve.estimate[row].argmax()]
            shown = list(RADII).index(found.radius if reaching else found.best)
            assert (found.low, found.high) == (curve.band_low[row, shown], curve.band_high[row, shown])
    assert repr(curve.smallest(0.99)).startswith("none reaches 0.99; the best is ")
    with pytest.raises(ScenarioError, match="at_least"):
        curve.smallest(1.0)
    with pytest.raises(ScenarioError, match="one of timeout"):
        curve.smallest(0.5, "d9")


def test_differences_and_slopes_are_paired(curve):
    assert curve.reference == 2.25
    base = list(RADII).index(2.25)
    for r in range(len(RADII)):
        against = paired(curve.kind[r], curve.defender[r], curve.kind[base], curve.defender[base], 3)
        found = (curve.difference[:, r], curve.difference_low[:, r], curve.difference_high[:, r])
        assert np.array_equal(found, (against.difference, against.low, against.high))
    for r, width in enumerate(np.diff(RADII)):
        step = paired(curve.kind[r + 1], curve.defender[r + 1], curve.kind[r], curve.defender[r], 3)
        found = (curve.slope[:, r], curve.slope_low[:, r], curve.slope_high[:, r])
        assert np.array_equal(found, (step.difference / width, step.low / width, step.high / width))


def test_pairs_know_more_than_two_separate_studies(curve):
    """The reason for common random numbers: a slope's interval is narrower than one that ignores the pairing."""
    one = curve.high[2, 3] - curve.low[2, 3], curve.high[2, 4] - curve.low[2, 4]
    assert curve.slope_high[2, 3] - curve.slope_low[2, 3] < np.hypot(*one) / (RADII[4] - RADII[3])


def test_a_breakpoint_is_a_distance_of_the_run_below_it(sc, positions, curve):
    """Just below the breakpoint, the nearest player that d2 does not yet see is exactly that far at some instant."""
    found = curve.breakpoints
    assert len(found) > 10
    for b in range(len(found)):
        radius = found.radius[b]
        below = radius - 2 * found.tolerance
        run = tadcore.simulate(started(sc, positions[found.trial[b]], **{"defenders[1].visibility_radius": below}))
        distance = np.linalg.norm(run.position[:-1] - run.position[:-1, 1:2], axis=-1)
        assert distance[distance > below].min() == pytest.approx(radius, abs=3 * found.tolerance)
        assert (run.outcome.kind, run.outcome.defender) == outcome(found.kind_before[b], found.defender_before[b])
        at = tadcore.simulate(started(sc, positions[found.trial[b]], **{"defenders[1].visibility_radius": radius}))
        assert (at.outcome.kind, at.outcome.defender) == outcome(found.kind_after[b], found.defender_after[b])


def outcome(kind, defender):
    made = tadcore.Outcome.of(int(kind), int(defender), 0.0)
    return made.kind, made.defender


def test_breakpoints_lead_from_each_outcome_to_the_next(curve):
    found = curve.breakpoints
    assert np.array_equal(np.lexsort((found.radius, found.trial)), np.arange(len(found)))
    for i in range(60):
        state = (curve.kind[0, i], curve.defender[0, i])
        mine = found.trial == i
        for r in range(1, len(RADII)):
            for b in np.flatnonzero(mine & (found.radius > RADII[r - 1]) & (found.radius <= RADII[r])):
                assert (found.kind_before[b], found.defender_before[b]) == state
                state = (found.kind_after[b], found.defender_after[b])
            assert state == (curve.kind[r, i], curve.defender[r, i])


def test_seeing_further_may_lose_the_game(curve):
    """Why no monotone curve is assumed: some trial is intercepted at a radius, and no longer at a larger one."""
    intercepted = curve.kind == 2
    assert (intercepted[:-1] & ~intercepted[1:]).any()


def test_a_larger_reach_ends_games_where_the_distance_says(sc, positions):
    few = positions[:12]
    curve = radius_curve(sc, few, player="d1", kind="capture", radii=[0.05, 0.3, 0.6], refine=True, threads=1)
    assert (curve.radius, curve.reference) == ("capture", 0.1)
    found = curve.breakpoints
    assert len(found)
    for b in range(len(found)):
        run = tadcore.simulate(started(sc, few[found.trial[b]], **{"defenders[0].capture_radius": found.radius[b]}))
        assert (run.outcome.kind, run.outcome.defender) == ("intercepted", 0)
        gap = np.linalg.norm(run.position[-1, 0] - run.position[-1, -1])
        assert gap == pytest.approx(found.radius[b], abs=2 * found.tolerance)
    # reach alone changes no trajectory, so here more of it never hurts
    assert (np.diff((curve.defender == 0).astype(int), axis=0) >= 0).all()


@dataclass
class Result:
    """The part of a study's result that the curve reads."""

    scenario: tadcore.Scenario
    inputs: dict[str, np.ndarray] = field(default_factory=dict)
    trials: int = 20
    seed: int = 0


def test_a_study_brings_its_own_starts(sc):
    rng = np.random.default_rng(9)
    inputs = {
        "attacker.position.y": rng.uniform(1, 3, 20),
        "defenders.2.visibility_radius": rng.uniform(0.5, 3, 20),
        "defenders.0.capture_radius": rng.uniform(0.05, 0.2, 20),
    }
    curve = radius_curve(Result(sc, inputs), player="d2", radii=[1.0, 2.0], reference=1.0)
    for i in range(20):
        changed = sc.replace(
            {
                "attacker.position": (sc.attacker.position[0], inputs["attacker.position.y"][i]),
                "defenders[2].visibility_radius": inputs["defenders.2.visibility_radius"][i],
                "defenders[0].capture_radius": inputs["defenders.0.capture_radius"][i],
                "defenders[1].visibility_radius": 2.0,
            }
        )
        alone = tadcore.simulate(changed).outcome
        assert outcome(curve.kind[1, i], curve.defender[1, i]) == (alone.kind, alone.defender)
    assert np.array_equal(curve.difference[:, 0], np.zeros(6))
    with pytest.raises(ScenarioError, match=r"radii\[0\].*capture radius"):
        radius_curve(Result(sc, inputs), player="d1", radii=[inputs["defenders.0.capture_radius"].max(), 1.0])
    low = inputs["defenders.2.visibility_radius"].min()
    with pytest.raises(ScenarioError, match=r"radii\[1\].*visibility radius"):
        radius_curve(Result(sc, inputs), player="d3", kind="capture", radii=[0.1, low])
    with pytest.raises(ScenarioError, match="positions"):
        radius_curve(Result(sc, inputs), [sc.positions], radii=[1.0])
    for name in ("attacker.position.z", "defenders.3.visibility_radius", "target.visibility_radius", "horizon"):
        with pytest.raises(ScenarioError, match="input"):
            radius_curve(Result(sc, {name: np.ones(20)}), radii=[1.0])


def test_the_target_of_i2_and_the_attacker_have_radii_of_their_own():
    team = tadcore.scenarios.load("paper-i2")
    seen = radius_curve(team, [team.positions], player="target", radii=[2.5, 10, np.inf])
    assert seen.kind[:, 0].tolist()[:2] == [2, 1]
    assert seen.to_xarray()["slope"].sizes == {"outcome": 6, "interval": 2}
    reach = radius_curve(team, [team.positions], player="attacker", kind="capture", radii=[0.1, 5.0])
    assert reach.kind[1, 0] == 1
    assert repr(reach).startswith("RadiusCurve(capture of attacker at 2 radii in [0.1, 5], 1 trials:")


@pytest.mark.parametrize(
    ("options", "name"),
    [
        ({"radii": []}, "radii"),
        ({"radii": 1.0}, "radii"),
        ({"radii": [2.0, 1.0]}, "radii"),
        ({"radii": [1.0, -1.0]}, "radii[1]"),
        ({"radii": [1.0, np.nan]}, "radii[1]"),
        ({"radii": [0.1, 1.0]}, "radii[0]"),
        ({"radii": ["1"]}, "radii"),
        ({"radii": [1.0], "reference": 0.0}, "reference"),
        ({"radii": [1.0], "player": "d4"}, "player"),
        ({"radii": [1.0], "player": "target"}, "player"),
        ({"radii": [1.0], "player": "attacker"}, "player"),
        ({"radii": [1.0], "kind": "sight"}, "kind"),
        ({"radii": [0.1, 5.0], "kind": "capture"}, "radii[1]"),
        ({"radii": [0.1, np.inf], "kind": "capture"}, "radii[1]"),
        ({"radii": [1.0], "level": 1.0}, "level"),
        ({"radii": [1.0, 2.0], "refine": True, "tolerance": 0.0}, "tolerance"),
    ],
)
def test_what_cannot_be_played_is_refused(sc, options, name):
    with pytest.raises(ScenarioError) as caught:
        radius_curve(sc, [sc.positions], **{"player": "d1", **options})
    assert caught.value.field == name


def test_starts_are_needed(sc):
    with pytest.raises(ScenarioError, match="positions: got nothing"):
        radius_curve(sc, radii=[1.0])
    with pytest.raises(ScenarioError, match="at least one start"):
        radius_curve(sc, np.empty((0, 5, 2)), radii=[1.0])


@pytest.mark.parametrize(
    ("trials", "radii", "level"), [(1_000, 21, 0.95), (1_000, 1, 0.95), (60, 5, 0.9), (40, 3, 0.5)]
)
def test_a_band_holds_at_all_radii_for_every_probability(trials, radii, level):
    """Exact: the binomial probability that one radius misses is at most 1 / R of 1 - level, at tiny p too."""
    low, high = band_of(np.arange(trials + 1), trials, radii, level)
    tiny, even = np.geomspace(1e-9, 0.5, 400), np.linspace(0.005, 0.5, 100)
    for p in [*tiny, *even, *(1 - tiny), *(1 - even)]:
        missed = stats.binom.pmf(np.arange(trials + 1), trials, p)[(low > p) | (p > high)].sum()
        assert missed <= (1 - level) / radii * (1 + 1e-9)


def band_of(counts, trials, radii, level):
    """The band that `radius_curve` makes of counts, through games whose outcomes were replaced by them."""
    return ends(counts, trials, (1 - level) / radii, "exact")


def test_the_band_of_a_curve_is_that_band(curve):
    found = band_of(np.rint(curve.estimate * 60).astype(int), 60, len(RADII), 0.95)
    assert np.allclose((curve.band_low, curve.band_high), found, rtol=1e-12, atol=1e-15)


def test_wilson_s_intervals_would_not_hold_there():
    """Why the band is an exact one: at a rare outcome a single radius misses 36 times as often as its share."""
    counts, p = np.arange(1001), 8.94e-5
    low, high = proportion_interval(counts, 1000, level=1 - 0.05 / 21)
    missed = stats.binom.pmf(counts, 1000, p)[(low > p) | (p > high)].sum()
    assert missed == pytest.approx(0.086, abs=0.001)


def test_a_study_need_not_be_played_first(sc):
    study = tadcore.Study(sc, {"attacker.position": Disk([-2, 2], 1.0)}, trials=40, seed=3)
    fresh, played = (radius_curve(source, player="d1", radii=[1.0, 5.0]) for source in (study, study.run()))
    assert np.array_equal(fresh.kind, played.kind)


def test_several_players_have_a_curve_each_and_bands_for_all(sc, positions, curve):
    both = radius_curve(sc, positions, player=["d2", "defenders[0]"], radii=RADII)
    assert both.players == ("d2", "d1")
    assert [each.player for each in both] == ["d2", "d1"]
    alone = radius_curve(sc, positions, player="d1", radii=RADII)
    for found, one in ((both["d2"], curve), (both["defenders[0]"], alone)):
        for name in ("estimate", "low", "high", "difference_low", "slope_high", "kind", "reference"):
            assert np.array_equal(getattr(found, name), getattr(one, name)), name
        count = np.rint(one.estimate * 60).astype(int)
        wide = proportion_interval(count, 60, level=1 - 0.05 / (2 * len(RADII)), method="exact")
        assert np.array_equal((found.band_low, found.band_high), wide)
    made = both.to_xarray()
    assert made["reference"].values.tolist() == sc.visibility_radii[[1, 0]].tolist()
    assert np.array_equal(made["band_low"].sel(player="d1"), both["d1"].band_low)
    assert both.smallest(0.2)["d1"].radius == both["d1"].smallest(0.2).radius
    assert "d1" in repr(both)
    assert "at all radii of all players at once" in both._repr_html_()


@pytest.mark.parametrize(
    ("player", "said"),
    [
        ([], "a player such as"),
        (["d1", 2], "a player such as"),
        (["d1", "defenders[0]"], "players that are named once each"),
        (["d1", "d9"], "one that has a visibility radius: d1, d2, d3"),
        (3, "a player such as"),
    ],
)
def test_players_that_are_none_are_refused(sc, positions, player, said):
    with pytest.raises(ScenarioError, match=said):
        radius_curve(sc, positions, player=player, radii=RADII)
    both = radius_curve(sc, positions[:2], player=["d1"], radii=[1.0])
    with pytest.raises(ScenarioError, match="one of d1"):
        both["d2"]


def test_all_defenders_share_a_radius(sc, positions):
    radii = [0.8, 2.25, float("inf")]
    curve = radius_curve(sc, positions, player="defenders[*]", radii=radii)
    own = tadcore.simulate_batch(sc, positions)
    for r, radius in enumerate(radii):
        batch = tadcore.simulate_batch(sc.replace({"d*.visibility_radius": radius}), positions)
        assert np.array_equal(curve.kind[r], batch.kind)
        assert np.array_equal(curve.defender[r], batch.defender)
        against = paired(batch.kind, batch.defender, own.kind, own.defender, 3)
        assert np.array_equal(curve.difference[:, r], against.difference)
    assert (curve.player, np.isnan(curve.reference)) == ("d*", True)
    assert "visibility of d*" in repr(curve)
    assert np.ptp(curve.estimate[2]) > 0.1
    equal = radius_curve(sc, positions, player="d*", radii=[0.05, 0.2], kind="capture")
    assert equal.reference == 0.1
    batch = tadcore.simulate_batch(sc.replace({"d*.capture_radius": 0.2}), positions)
    assert np.array_equal(equal.kind[1], batch.kind)
    both = radius_curve(sc, positions, player=["d1", "d*"], radii=[0.8, 2.0])
    assert both.players == ("d1", "d*")
    assert both["d*"].band_low[2, 0] <= curve.band_low[2, 0], "four places instead of three"


def test_radii_of_a_team_obey_the_rule_of_every_defender(sc, positions):
    wide = sc.replace({"d2.capture_radius": 0.5})
    with pytest.raises(ScenarioError, match=r"larger than every defender's capture radius \(0.5\)"):
        radius_curve(wide, positions, player="d*", radii=[0.4, 1.0])
    with pytest.raises(ScenarioError, match=r"smaller than every defender's visibility radius \(1.25\)"):
        radius_curve(wide, positions, player="d*", radii=[0.4, 1.5], kind="capture")
    with pytest.raises(ScenarioError, match=r"d1, d2, d3; or d\* for all defenders together"):
        radius_curve(sc, positions, player="d4", radii=[1.0])


def test_breakpoints_of_a_team(sc, positions):
    curve = radius_curve(sc, positions[:20], player="d*", radii=[0.8, 1.6, 2.4], refine=True, tolerance=1e-7)
    found = curve.breakpoints
    assert len(found) > 0
    for i in range(0, len(found), 3):
        at = positions[found.trial[i] : found.trial[i] + 1]
        ended = [
            tadcore.simulate_batch(sc.replace({"d*.visibility_radius": radius}), at)
            for radius in (found.radius[i] - 2e-7, found.radius[i])
        ]
        assert [batch.kind[0] for batch in ended] == [found.kind_before[i], found.kind_after[i]]
        assert [batch.defender[0] for batch in ended] == [found.defender_before[i], found.defender_after[i]]
