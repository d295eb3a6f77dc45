"""Rare events against another code: subset sampling by OpenTURNS, of the same event, on functions of its own.

Of the event that the closed form is known of, and of the paper's game under full sight, whose starts the oracle plays
by the exponentials of its own Riccati solution: nothing of the library is in what OpenTURNS samples.
"""

import math
import warnings
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

import tadcore
from oracle.model import paper_cases
from oracle.riccati import equilibrium, feedback
from oracle.stepping import transition
from tadcore.sampling import Gaussian

with warnings.catch_warnings():  # what SWIG's types lack on later Pythons
    warnings.simplefilter("ignore", DeprecationWarning)
    ot = pytest.importorskip("openturns")

LEVEL = 0.99
STEP = 0.02


def subset(function, points, runs):
    """Student's interval of P(function(u) ≥ 0), u standard normal, from so many runs of subset sampling."""
    dim = function.getInputDimension()
    vector = ot.CompositeRandomVector(function, ot.RandomVector(ot.Normal(dim)))
    found = []
    for seed in range(runs):
        ot.RandomGenerator.SetSeed(seed)
        algorithm = ot.SubsetSampling(ot.ThresholdEvent(vector, ot.GreaterOrEqual(), 0.0))
        algorithm.setBlockSize(points)
        algorithm.setMaximumOuterSampling(1)
        algorithm.setConditionalProbability(0.1)
        algorithm.setMaximumCoefficientOfVariation(-1.0)
        algorithm.run()
        found.append(algorithm.getResult().getProbabilityEstimate())
    half = stats.t.ppf(0.5 + LEVEL / 2.0, runs - 1) * np.std(found, ddof=1) / math.sqrt(runs)
    return float(np.mean(found) - half), float(np.mean(found) + half)


def meet(one, other):
    """Whether two intervals have a number in common."""
    return max(one[0], other[0]) <= min(one[1], other[1])


def capture(spread):
    """The probability that an attacker who starts normally around (3, 0), and stays, is within 0.5 of the target."""
    return float(stats.ncx2.cdf((0.5 / spread) ** 2, 2, (3.0 / spread) ** 2))


def test_of_a_known_probability_both_intervals_hold_it():
    def by_openturns(spread):
        reach = f"0.5 - sqrt((3 + {spread} * x)^2 + ({spread} * y)^2)"
        return subset(ot.SymbolicFunction(["x", "y"], [reach]), 5_000, 30)

    sc = tadcore.Scenario(
        interaction="I1",
        horizon=0.01,
        step=0.01,
        attacker={"position": [3.0, 0.0], "control_weight": 1e30, "capture_radius": 0.5},
        target={"position": [0.0, 0.0], "control_weight": 1e30},
        defenders=[{"position": [50.0, 50.0], "control_weight": 1e30, "capture_radius": 0.5}],
    )
    study = tadcore.Study(sc, {"attacker.position": Gaussian([3.0, 0.0], 0.6)}, trials=1, seed=8)
    ours, theirs, truth = tadcore.rare(study, error=0.05, level=LEVEL).interval, by_openturns(0.6), capture(0.6)
    assert 1e-6 < truth < 1e-4
    assert ours[0] < truth < ours[1]
    assert theirs[0] < truth < theirs[1]
    assert meet(ours, theirs)
    # Narrow enough to tell a spread apart that is a little larger.
    assert not meet(ours, by_openturns(0.63))
    assert not theirs[0] < capture(0.63) < theirs[1]


class Games:
    """How near starts of the paper's game I1 under full sight come to an interception before a capture."""

    def __init__(self):
        case = paper_cases()[0]
        self.game, self.start = replace(case.game, step=STEP), case.start
        P = equilibrium(self.game)
        self.steps = [transition(feedback(self.game, P[k]), STEP)[:-1, :-1] for k in range(self.game.steps)]

    def __call__(self, positions):
        """Scores of games: the largest over instants of what is least of being near the attacker and uncaptured."""
        z = positions[:, :-1] - positions[:, -1:]
        sigma, n = self.start.sigma, self.game.n
        score, free = np.full(len(z), -np.inf), np.full(len(z), np.inf)
        for step in [*self.steps, None]:
            far = np.sqrt(z[..., 0] ** 2 + z[..., 1] ** 2)
            score = np.maximum(score, np.minimum((sigma[:n] - far[:, :n]).max(axis=1), free))
            free = np.minimum(free, far[:, n] - sigma[n])
            z = z if step is None else step @ z
        return score

    def around(self, spread):
        """The same as a function of standard normal numbers, for OpenTURNS."""

        def scores(u):
            u = np.asarray(u).reshape(-1, *self.start.positions.shape)
            return self(self.start.positions + spread * u)[:, None]

        return ot.PythonFunction(self.start.positions.size, 1, func_sample=scores)


def test_of_the_papers_game_both_intervals_agree():
    """Of the paper's game some 1e-4, in which crude runs of the oracle's games are seen, too."""
    games, spread = Games(), 0.036
    sc = tadcore.scenarios.load("paper-i1-full").replace({"step": STEP})
    starts = zip(sc.players, sc.positions, strict=True)
    study = tadcore.Study(sc, {f"{p}.position": Gaussian(at, spread) for p, at in starts}, trials=1, seed=1)
    ours = tadcore.rare(study, "intercepted", error=0.1, level=LEVEL).interval
    theirs = subset(games.around(spread), 2_000, 20)
    assert meet(ours, theirs), (ours, theirs)
    assert not meet(ours, subset(games.around(0.04), 2_000, 20))
    trials = 100_000
    u = np.random.default_rng(6).standard_normal((trials, *sc.positions.shape))
    count = int(np.count_nonzero(games(sc.positions + spread * u) >= 0.0))
    low, high = (stats.beta.ppf(q, count + s, trials - count + 1 - s) for q, s in ((0.005, 0), (0.995, 1)))
    assert count > 5
    assert meet((low, high), ours)
    assert meet((low, high), theirs)
