"""Outcome probabilities and the precision rule, against the definitions of their intervals and by simulation."""

import math

import numpy as np
import pytest
from scipy import integrate, stats

from tadcore import ScenarioError, statistics
from tadcore.statistics import HalfWidth, mixture_interval, probabilities, proportion_interval

KIND = np.array([0] * 3 + [1] * 10 + [2] * 27)
DEFENDER = np.array([-1] * 13 + [0] * 20 + [2] * 7)


def test_counts_and_shares():
    found = probabilities(KIND, DEFENDER, 3)
    assert found.names == ("timeout", "captured", "intercepted", "d1", "d2", "d3")
    assert found.count.tolist() == [3, 10, 27, 20, 0, 7]
    assert found.estimate == pytest.approx([0.075, 0.25, 0.675, 0.5, 0.0, 0.175])
    assert found["d1"][0] == 0.5
    assert found.to_pandas().loc["captured", "count"] == 10
    lines = repr(found).splitlines()
    assert lines[0] == "40 trials"
    assert lines[4].split()[:3] == ["intercepted", "27", "0.6750"]


@pytest.mark.parametrize("level", [0.5, 0.95, 0.999])
@pytest.mark.parametrize(("count", "trials"), [(0, 10), (1, 10), (7, 10), (10, 10), (333, 1000), (5, 100_000)])
def test_wilson_ends_are_where_the_score_test_turns(count, trials, level):
    low, high = (float(end) for end in proportion_interval(count, trials, level=level))
    z = stats.norm.ppf(0.5 + level / 2)
    for end, edge in ((low, 0), (high, trials)):
        if count == edge:
            assert end == edge / trials
        else:
            assert abs(count / trials - end) == pytest.approx(z * math.sqrt(end * (1 - end) / trials), rel=1e-9)


@pytest.mark.parametrize(("count", "trials"), [(0, 10), (1, 10), (7, 10), (10, 10), (333, 1000)])
def test_exact_ends_are_where_the_binomial_tails_turn(count, trials):
    low, high = (float(end) for end in proportion_interval(count, trials, level=0.9, method="exact"))
    assert low == 0.0 if count == 0 else stats.binom.sf(count - 1, trials, low) == pytest.approx(0.05, rel=1e-6)
    assert high == 1.0 if count == trials else stats.binom.cdf(count, trials, high) == pytest.approx(0.05, rel=1e-6)


@pytest.mark.parametrize("trials", [10, 40, 200, 1_000])
def test_wilson_s_coverage_falls_to_83_percent_and_no_further(trials):
    """Exact: between two ends of intervals the coverage rises, then falls, so the worst p is beside an end."""
    counts = np.arange(trials + 1)
    low, high = proportion_interval(counts, trials)
    worst = {}
    for p in (*(low[1:] * (1 - 1e-9)), *(high[:-1] * (1 + 1e-9))):
        worst[p] = stats.binom.pmf(counts, trials, p)[(low <= p) & (p <= high)].sum()
    p = min(worst, key=worst.get)
    assert 0.83 < worst[p] < 0.845
    assert trials * min(p, 1 - p) == pytest.approx(0.18, abs=0.005)


@pytest.mark.parametrize("count", [1, 30, 1_000])
def test_exact_ends_of_a_billion_trials_are_those_of_poisson_s_law(count):
    """The limit of many trials, by the gamma distribution; the inverse of the beta distribution in SciPy fails here."""
    low, high = proportion_interval(count, 10**9, level=0.95, method="exact")
    assert low * 1e9 == pytest.approx(stats.gamma.ppf(0.025, count), rel=1e-5)
    assert high * 1e9 == pytest.approx(stats.gamma.isf(0.025, count + 1), rel=1e-5)


def test_the_coverage_of_the_exact_interval_is_never_below_its_level():
    trials, counts = 30, np.arange(31)
    low, high = proportion_interval(counts, trials, level=0.9, method="exact")
    for p in np.linspace(0.01, 0.99, 99):
        assert stats.binom.pmf(counts, trials, p)[(low <= p) & (p <= high)].sum() >= 0.9 - 1e-12


@pytest.mark.parametrize(
    ("arguments", "field"),
    [
        (([], [], 3), "kind"),
        (([2], [0, 1], 3), "kind"),
        (([3], [-1], 3), "kind[0]"),
        (([1, 2], [-1, -1], 3), "defender[1]"),
        (([1, 2], [-1, 3], 3), "defender[1]"),
        (([1, 2], [0, 1], 3), "defender[0]"),
        (([1.0], [-1], 3), "kind"),
        (([1], [-1], 0), "n"),
    ],
)
def test_outcomes_that_do_not_fit_are_refused(arguments, field):
    with pytest.raises(ScenarioError) as caught:
        probabilities(*arguments)
    assert caught.value.field == field


def test_options_are_checked():
    for level in (0.0, 1.0, math.nan, "0.95", True):
        with pytest.raises(ScenarioError, match="level"):
            probabilities(KIND, DEFENDER, 3, level=level)
    with pytest.raises(ScenarioError, match="method"):
        probabilities(KIND, DEFENDER, 3, method="wald")
    for width in (0.0, 0.5, -0.1, math.nan, None, True):
        with pytest.raises(ScenarioError, match="width"):
            HalfWidth(width)
    with pytest.raises(ScenarioError, match="counts"):
        HalfWidth(0.1).intervals({}, 10)
    with pytest.raises(ScenarioError, match="counts"):
        HalfWidth(0.1).intervals({"captured": 11}, 10)
    for counts in ([1, 2], [[1, 2, 3]], [0.5, 1.5, 2.0], 3):
        with pytest.raises(ScenarioError, match="counts"):
            HalfWidth(0.1).intervals(counts, 10)


@pytest.mark.parametrize(
    ("successes", "trials"), [(0, 1), (1, 1), (0, 50), (50, 50), (3, 50), (700, 1000), (1, 10**6), (499_999, 10**6)]
)
def test_the_mixture_interval_is_what_the_martingale_has_not_refuted(successes, trials):
    """Robbins: with a uniform mixture, p is in the interval where (t + 1) binom.pmf(s; t, p) > α."""
    error = 0.05
    low, high = mixture_interval(successes, trials, error)
    grid = np.linspace(max(low - 0.01, 0.0), min(high + 0.01, 1.0), 200_001)
    kept = grid[(trials + 1) * stats.binom.pmf(successes, trials, grid) > error]
    assert (kept[0], kept[-1]) == pytest.approx((low, high), abs=2 * (grid[1] - grid[0]))
    assert low <= successes / trials <= high


def test_the_mixture_is_the_integral_it_claims_to_be():
    successes, trials, error = 12, 40, 0.02
    for end in mixture_interval(successes, trials, error):
        ratio = integrate.quad(lambda q, p=end: (q / p) ** 12 * ((1 - q) / (1 - p)) ** 28, 0, 1, epsabs=0)[0]
        assert ratio == pytest.approx(1 / error, rel=1e-7)


def test_before_the_first_trial_nothing_is_known():
    assert HalfWidth(0.1).intervals({"captured": 0}, 0) == {"captured": (0.0, 1.0)}
    assert not HalfWidth(0.49).satisfied({"captured": 0}, 0)


def test_the_error_is_shared_between_the_outcomes():
    counts = {"timeout": 10, "captured": 60, "intercepted": 130}
    found = HalfWidth(0.1, level=0.94).intervals(counts, 200)
    assert found == {name: mixture_interval(count, 200, (1 - 0.94) / 3) for name, count in counts.items()}
    assert HalfWidth(0.1, level=0.94).intervals(np.array([10, 60, 130]), 200) == found
    widest = max(high - low for low, high in found.values())
    assert HalfWidth(widest / 2 + 1e-12, level=0.94).satisfied(counts, 200)
    assert not HalfWidth(widest / 2 - 1e-12, level=0.94).satisfied(counts, 200)


@pytest.mark.parametrize("p", [0.02, 0.3, 0.5])
def test_coverage_under_continuous_looking(p):
    """Look after each of 1,000 trials in 2,000 studies: at most 10 % may ever miss, plus 4 standard errors."""
    level, studies, trials = 0.9, 2_000, 1_000
    rng = np.random.Generator(np.random.Philox(20_240_117))
    successes = (rng.random((studies, trials)) < p).cumsum(axis=1)
    t = np.arange(1, trials + 1)
    refuted = (t + 1) * stats.binom.pmf(successes, t, p) <= 1 - level
    ever = refuted.any(axis=1).mean()
    assert ever <= (1 - level) + 4 * math.sqrt(level * (1 - level) / studies)
    # the rule agrees with that criterion: whether p lies in its interval at moments of every kind
    for i, k in zip(rng.integers(0, studies, 200), rng.integers(0, trials, 200), strict=True):
        (low, high), = HalfWidth(0.1, level).intervals({"x": int(successes[i, k])}, int(t[k])).values()  # fmt: skip
        assert (low < p < high) == (not refuted[i, k])
    # an ordinary interval, looked at as often, misses far more often than it says: that is why the rule exists
    score = np.abs(successes - t * p) > stats.norm.ppf(0.95) * np.sqrt(t * p * (1 - p))
    assert score[:, 20:].any(axis=1).mean() > 0.3


def test_stopping_by_the_rule_keeps_its_promise():
    """Three outcomes, a look every 50 trials, stop when narrow: all final intervals hold in 90 % of studies."""
    truth = np.array([0.1, 0.3, 0.6])
    rule, studies = HalfWidth(0.12, level=0.9), 300
    rng = np.random.Generator(np.random.Philox(7))
    held = 0
    for _ in range(studies):
        counts, trials = np.zeros(3, dtype=int), 0
        while not rule.satisfied(counts, trials):
            counts += rng.multinomial(50, truth)
            trials += 50
        final = rule.intervals(counts, trials).values()
        held += all(low <= p <= high for (low, high), p in zip(final, truth, strict=True))
    assert held / studies >= 0.9 - 4 * math.sqrt(0.09 / studies)


def test_outcome_counts_are_plain_numbers():
    assert statistics.outcome_counts(KIND, DEFENDER, 3) == {
        "timeout": 3,
        "captured": 10,
        "intercepted": 27,
        "d1": 20,
        "d2": 0,
        "d3": 7,
    }
