"""The share of the start: an identity, its interval's coverage by enumeration, and its ends."""

import math

import numpy as np
import pytest
from scipy.stats import multinomial

from tadcore import ScenarioError
from tadcore.statistics.starts import start_share_of


def law(p, rho):
    """Probabilities of both, one, none."""
    spread = p * (1 - p)
    return [p**2 + rho * spread, 2 * spread * (1 - rho), (1 - p) ** 2 + rho * spread]


@pytest.mark.parametrize(("p", "rho"), [(0.5, 0.3), (0.3, 0.7), (0.7, 0.05), (0.6, 0.9)])
def test_the_interval_covers_as_often_as_it_says(p, rho):
    """Every table of 60 starts, weighed by its probability."""
    starts, covered, mean = 60, 0.0, 0.0
    for both in range(starts + 1):
        for one in range(starts + 1 - both):
            weight = multinomial.pmf([both, one, starts - both - one], starts, law(p, rho))
            if weight > 1e-9:
                found = start_share_of(both, one, starts - both - one)
                covered += weight * (found.low <= rho <= found.high)
                mean += weight * (0.0 if math.isnan(found.share) else found.share)
    assert 0.92 <= covered <= 1.0
    assert mean == pytest.approx(rho, abs=0.05)


def test_it_is_the_covariance_over_the_variance():
    rng = np.random.default_rng(3)
    own = rng.beta(0.6, 0.9, 200_000)  # P(outcome) of each start
    pairs = rng.random((2, own.size)) < own
    found = start_share_of(*(int(np.sum(pairs.sum(axis=0) == k)) for k in (2, 1, 0)))
    assert found.share == pytest.approx(own.var() / (own.mean() * (1 - own.mean())), abs=0.01)
    assert found.low < found.share < found.high
    assert found.share == pytest.approx(np.corrcoef(pairs)[0, 1], abs=0.005)
    assert found.probability == pytest.approx(pairs.mean())
    assert found.starts == own.size


def test_ends():
    alike = start_share_of(40, 0, 60)
    assert (alike.share, alike.high) == (1.0, 1.0)
    assert 0.8 < alike.low < 1.0
    assert alike.trials_per_start() == 1.0
    apart = start_share_of(20, 60, 20)  # fewer pairs alike than by chance
    assert (apart.share, apart.low) == (0.0, 0.0)
    assert apart.trials_per_start() == math.inf
    unknown = start_share_of(0, 0, 30)
    assert math.isnan(unknown.share)
    assert (unknown.low, unknown.high) == (0.0, 1.0)
    assert math.isnan(unknown.trials_per_start())
    half = start_share_of(35, 30, 35)
    assert half.trials_per_start(cost=16.0) == pytest.approx(4 * math.sqrt((1 - half.share) / half.share))
    assert "of the variance of P(" in repr(half)
    for bad in ((-1, 0, 1), (0, 0, 0), (1.0, 1, 1)):
        with pytest.raises(ScenarioError):
            start_share_of(*bad)
    with pytest.raises(ScenarioError, match="level"):
        start_share_of(1, 1, 1, level=1.0)
