"""Incidence curves and paired comparisons, against counting by hand, optimisation and simulation."""

import math
from dataclasses import dataclass, field

import numpy as np
import pytest
from scipy import optimize, stats

import tadcore
from tadcore import ScenarioError
from tadcore.statistics import compare, difference_interval, incidence, paired

RNG = np.random.Generator(np.random.Philox(3))
M = 400
KIND = RNG.integers(0, 3, M)
DEFENDER = np.where(KIND == 2, RNG.integers(0, 2, M), -1)
STEP, HORIZON = 0.1, 1.2
TIME = np.where(KIND == 0, HORIZON, RNG.integers(1, 12, M) * STEP)


def curves(**changes):
    options = {"horizon": HORIZON, "step": STEP, "n": 2, **changes}
    return incidence(KIND, DEFENDER, options.pop("time", TIME), **options)


def test_incidence_counts_every_end_at_its_instant():
    found = curves()
    assert found.times == pytest.approx(np.arange(13) * STEP)
    for k in range(13):
        by_then = np.rint(TIME / STEP) <= k
        for name, ended in [
            ("timeout", KIND == 0),
            ("captured", KIND == 1),
            ("intercepted", KIND == 2),
            ("d1", DEFENDER == 0),
            ("d2", DEFENDER == 1),
        ]:
            assert found[name][k] == np.count_nonzero(ended & by_then) / M
        assert found.running[k] == pytest.approx(np.count_nonzero(~by_then) / M, abs=1e-12)
    assert found["timeout"][:-1].max() == 0.0
    assert found.to_pandas()["d1", "estimate"].iloc[-1] == found["d1"][-1]


def test_incidence_of_real_games_ends_in_the_outcome_shares():
    sc = tadcore.scenarios.load("paper-i1")
    rng = np.random.default_rng(1)
    batch = tadcore.simulate_batch(sc, sc.positions + rng.uniform(-0.5, 0.5, (60, 5, 2)))
    found = incidence(batch.kind, batch.defender, batch.time, horizon=sc.horizon, step=sc.step, n=sc.n)
    assert found.estimate[:3, -1] * 60 == pytest.approx(list(batch.counts().values()))
    assert found.running[-1] == pytest.approx(0.0, abs=1e-12)


def test_the_band_is_kolmogorov_s():
    found = curves(level=0.9)
    assert stats.kstwo.sf(found.half_width, M) == pytest.approx(0.1, rel=1e-5)
    inside = (found.low > 0) & (found.high < 1)
    assert found.high[inside] - found.low[inside] == pytest.approx(2 * found.half_width)
    assert ((found.low >= 0) & (found.high <= 1)).all()
    assert stats.kstwo.sf(curves(level=0.9, jointly=True).half_width, M) == pytest.approx(0.1 / 5, rel=1e-5)


@pytest.mark.parametrize("level", [0.5, 0.95, 1 - 2e-5, 1 - 1e-8, 1 - 1e-12, 1 - 2**-53])
def test_the_band_is_never_too_narrow(level):
    """The law itself, at levels where its quantiles in SciPy are too small."""
    for trials in (1, 400, 100_000):
        found = incidence([1] * trials, [-1] * trials, [1.0] * trials, horizon=1.0, step=1.0, n=1, level=level)
        half = found.half_width
        assert half == 1.0 or stats.kstwo.sf(half, trials) <= (1 - level) * 1.001
        assert half <= math.sqrt(math.log(2 / (1 - level)) / (2 * trials)) + 1e-12


def test_bands_hold_everywhere_at_once_on_a_grid():
    """200 studies of 100 trials: the truth leaves the band somewhere in at most 10 %, plus 4 standard errors."""
    truth = np.cumsum(np.full(11, 0.05))
    rng, missed, studies = np.random.Generator(np.random.Philox(11)), 0, 200
    for _ in range(studies):
        at = np.searchsorted(truth, rng.random(100))
        codes = np.where(at < 11, 1, 0)
        times = np.where(at < 11, at + 1.0, 12.0) * STEP
        found = incidence(codes, np.full(100, -1), times, horizon=1.2, step=STEP, n=1, level=0.9)
        missed += bool(((found.low[1, 1:12] > truth) | (found.high[1, 1:12] < truth)).any())
    assert missed / studies <= 0.1 + 4 * math.sqrt(0.09 / studies)


@pytest.mark.parametrize(
    ("time", "field"),
    [
        (np.where(np.arange(M) == 7, 0.25, TIME), "time[7]"),
        (np.where(np.arange(M) == 7, 1.3, TIME), "time[7]"),
        (np.where(np.arange(M) == 7, -0.1, TIME), "time[7]"),
        (np.where(np.arange(M) == 7, np.nan, TIME), "time[7]"),
        (TIME[1:], "time"),
    ],
)
def test_times_off_the_grid_are_refused(time, field):
    with pytest.raises(ScenarioError) as caught:
        curves(time=time)
    assert caught.value.field == field


def test_a_step_that_does_not_divide_is_refused():
    for step in (0.07, 0.0, -0.1, math.nan):
        with pytest.raises(ScenarioError, match="divisor of the horizon"):
            curves(step=step)


def log_likelihood(delta, q, b, c, trials):
    """Of b, c and the rest, where q is the probability of "in B only" and q + Δ that of "in A only"."""
    return sum(
        count * math.log(p) for count, p in [(b, q + delta), (c, q), (trials - b - c, 1 - 2 * q - delta)] if count
    )


@pytest.mark.parametrize(("b", "c", "trials"), [(12, 4, 50), (1, 30, 60), (5, 5, 20), (9, 3, 12), (40, 17, 10_000)])
def test_the_ends_are_where_the_score_test_turns(b, c, trials):
    z = stats.norm.ppf(0.975)
    low, high = difference_interval(b, c, trials)
    assert low < (b - c) / trials < high
    for end in (float(low), float(high)):
        room = (max(0.0, -end) + 1e-12, (1 - end) / 2 - 1e-12)
        best = optimize.minimize_scalar(
            lambda q, d=end: -log_likelihood(d, q, b, c, trials),
            bounds=room,
            method="bounded",
            options={"xatol": 1e-12},
        ).x
        variance = trials * (2 * best + end * (1 - end))
        assert abs(b - c - trials * end) / math.sqrt(variance) == pytest.approx(z, rel=1e-4)


def test_the_interval_is_symmetric_and_stays_within_reach():
    low, high = difference_interval([0, 30, 0, 7, 3], [0, 0, 30, 3, 7], 30)
    z2 = stats.norm.ppf(0.975) ** 2
    assert (low[0], high[0]) == pytest.approx((-z2 / (30 + z2), z2 / (30 + z2)))
    assert (low[1], high[1]) == pytest.approx(((30 - z2) / (30 + z2), 1.0))
    assert (low[2], high[2]) == pytest.approx((-1.0, (z2 - 30) / (30 + z2)))
    assert (low[3], high[3]) == pytest.approx((-high[4], -low[4]))
    with pytest.raises(ScenarioError, match="at most 30"):
        difference_interval(20, 11, 30)


def test_zero_is_inside_exactly_where_mcnemar_s_test_does_not_reject():
    b, c = (counts.ravel() for counts in np.meshgrid(np.arange(13), np.arange(13)))
    low, high = difference_interval(b, c, 40)
    with np.errstate(invalid="ignore"):
        statistic = np.abs(b - c) / np.sqrt(b + c)
    accepted = ~(statistic > stats.norm.ppf(0.975))
    assert np.array_equal((low <= 0) & (high >= 0), accepted)


def test_the_coverage_of_the_paired_interval_is_near_its_level():
    """All tables of 40 trials, weighed by their probability: between 93 % and 98 % for a level of 95 %."""
    counts = [(b, c) for b in range(41) for c in range(41 - b)]
    low, high = difference_interval(*zip(*counts, strict=True), 40)
    for p, q in [(0.1, 0.1), (0.2, 0.05), (0.3, 0.25)]:
        weights = stats.multinomial.pmf([(b, c, 40 - b - c) for b, c in counts], 40, [p, q, 1 - p - q])
        assert 0.93 <= weights[(low <= p - q) & (p - q <= high)].sum() <= 0.98


@dataclass
class Result:
    """The part of a study's result that statistics read."""

    scenario: tadcore.Scenario
    kind: np.ndarray
    defender: np.ndarray
    time: np.ndarray
    seed: int = 1
    inputs: dict[str, np.ndarray] = field(default_factory=dict)

    @property
    def trials(self):
        return len(self.kind)


@pytest.fixture(scope="module")
def pair():
    """A hundred starts of the paper's game, played with d2 seeing 2.25 far, then 0.5 far."""
    sc = tadcore.scenarios.load("paper-i1")
    positions = sc.positions + np.random.default_rng(2).uniform(-1, 1, (100, 5, 2))
    inputs = {"attacker.position.x": positions[:, 4, 0].copy()}
    results = []
    for radius in (2.25, 0.5):
        changed = sc.replace({"defenders[1].visibility_radius": radius})
        batch = tadcore.simulate_batch(changed, positions)
        results.append(Result(changed, batch.kind, batch.defender, batch.time, inputs=dict(inputs)))
    return results


def test_a_comparison_counts_pairs(pair):
    a, b = pair
    found = compare(a, b)
    assert found.flipped.size > 0
    assert found.flipped.tolist() == [i for i in range(100) if a.kind[i] != b.kind[i]]
    both = [i for i in range(100) if a.kind[i] == b.kind[i] == 2 and a.defender[i] != b.defender[i]]
    assert found.redirected.tolist() == both
    for i in range(3):
        for j in range(3):
            assert found.transitions[i, j] == sum((a.kind == i) & (b.kind == j))
        assert found.difference[i] == pytest.approx((a.kind == i).mean() - (b.kind == i).mean())
        x, y = found.only_a[i], found.only_b[i]
        tail = stats.binom.cdf(min(x, y), x + y, 0.5)
        assert found.p_value[i] == pytest.approx(min(1.0, 2 * tail))
    assert ((found.low <= found.difference) & (found.difference <= found.high)).all()
    assert repr(found).startswith(f"100 trials, {found.flipped.size} flipped\noutcome ")
    assert found.to_pandas().shape == (6, 6)


def test_comparing_a_study_with_itself_finds_nothing(pair):
    found = compare(pair[0], pair[0])
    assert found.flipped.size == found.redirected.size == 0
    assert np.array_equal(found.difference, np.zeros(6))
    assert np.array_equal(found.p_value, np.ones(6))
    assert (found.low < 0).all()
    assert (found.high > 0).all()


def test_studies_without_common_random_numbers_are_refused(pair):
    a, b = pair
    shorter = Result(b.scenario, b.kind[1:], b.defender[1:], b.time[1:], inputs={"attacker.position.x": np.zeros(99)})
    moved = {"attacker.position.x": b.inputs["attacker.position.x"] + (np.arange(100) == 40)}
    cases = [
        (Result(b.scenario, b.kind, b.defender, b.time, seed=2, inputs=b.inputs), "b.seed"),
        (shorter, "b.trials"),
        (Result(b.scenario, b.kind, b.defender, b.time), "b.vary"),
        (Result(b.scenario, b.kind, b.defender, b.time, inputs=moved), "b.inputs['attacker.position.x'][40]"),
    ]
    for other, name in cases:
        with pytest.raises(ScenarioError) as caught:
            compare(a, other)
        assert caught.value.field == name
    with pytest.raises(ScenarioError, match="kind_b"):
        paired(a.kind, a.defender, b.kind[1:], b.defender[1:], 3)
