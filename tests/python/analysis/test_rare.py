"""Rare events against closed forms, crude Monte Carlo and themselves; what is refused."""

import math

import numpy as np
import pytest
from scipy import stats

import tadcore
from tadcore import ScenarioError
from tadcore.analysis import splitting
from tadcore.analysis.rarity import summary
from tadcore.sampling import Annulus, Box, Choice, Cycle, Disk, Gaussian

FAR = [50.0, 50.0]


def still(*defenders, target=(0.0, 0.0), interaction="I1", **changes):
    """A game of one step in which weights of 1e30 let nobody move."""
    sc = tadcore.Scenario(
        interaction=interaction,
        horizon=0.01,
        step=0.01,
        attacker={"position": [3.0, 0.0], "control_weight": 1e30, "capture_radius": 0.5},
        target={"position": list(target), "control_weight": 1e30},
        defenders=[{"position": list(at), "control_weight": 1e30, "capture_radius": 0.5} for at in defenders or [FAR]],
    )
    return sc.replace(changes) if changes else sc


def within(mean, spread, radius):
    """P(‖x‖ ≤ radius) of a normal x in the plane."""
    return float(stats.ncx2.cdf((radius / spread) ** 2, 2, np.dot(mean, mean) / spread**2))


def around(sc, spread, seed=1):
    """Every player starts normally around its place."""
    starts = zip(sc.players, sc.positions, strict=True)
    return tadcore.Study(sc, {f"{player}.position": Gaussian(at, spread) for player, at in starts}, trials=1, seed=seed)


def agrees(found, truth):
    """Within four of the standard errors that are shown, and the error is what was asked for."""
    assert found.error < 0.15
    assert abs(found.probability - truth) < 4.0 * found.error * truth, (found, truth)


def test_a_capture_of_known_probability():
    """1.2e-8: where the attacker starts decides, by a non-central chi-squared law."""
    study = tadcore.Study(still(), {"attacker.position": Gaussian([3.0, 0.0], 0.45)}, trials=1, seed=3)
    truth = within([3.0, 0.0], 0.45, 0.5)
    assert 5e-9 < truth < 2e-8
    found = tadcore.rare(study, error=0.1)
    agrees(found, truth)
    assert found.runs <= 300_000
    assert found.interval[0] < found.probability < found.interval[1]
    assert found.crude_runs == pytest.approx((1 - found.probability) / (found.probability * found.error**2))
    assert found.event == "captured"
    assert len(found.replications) >= 20
    assert found.probability == pytest.approx(np.prod(found.rates, axis=1).mean(), rel=1e-12)


def test_the_nearest_of_two_defenders_and_their_shares():
    """Both are equally likely to have the attacker within reach, far from one another; they share alike."""
    sc = still([3.0, 4.0], [3.0, -4.0], target=(-50.0, 0.0))
    study = tadcore.Study(sc, {"attacker.position": Gaussian([3.0, 0.0], 0.8)}, trials=1, seed=2)
    one = within([0.0, 4.0], 0.8, 0.5)
    assert 1e-6 < one < 1e-4
    found = tadcore.rare(study, "intercepted", error=0.08)
    agrees(found, 2 * one)
    assert found.shares["d1"] == pytest.approx(0.5, abs=0.15)
    assert sum(found.shares.values()) == pytest.approx(1.0)
    agrees(tadcore.rare(study, "d2"), one)


def test_a_timeout_that_is_rare():
    """The attacker stands on the target unless it starts far off: P = exp(-r²/2s²)."""
    study = tadcore.Study(still(), {"attacker.position": Gaussian([0.0, 0.0], 0.1)}, trials=1, seed=5)
    agrees(tadcore.rare(study, "timeout"), math.exp(-0.5 * (0.5 / 0.1) ** 2))


def test_radii_and_other_laws():
    """A radius of a gamma law, far in its upper tail; then a coordinate that is uniform, and a disk."""
    radius = stats.gamma(2.0, scale=0.13)
    study = tadcore.Study(still(), {"attacker.capture_radius": radius}, trials=1, seed=4)
    agrees(tadcore.rare(study), float(radius.sf(3.0)))
    box = tadcore.Study(still(), {"attacker.position.x": Box(0.49999, 3.0)}, trials=1, seed=4)
    agrees(tadcore.rare(box), 0.00001 / 2.50001)
    disk = tadcore.Study(still(), {"attacker.position": Disk([0.0, 0.0], 500.0)}, trials=1, seed=4)
    agrees(tadcore.rare(disk), 1e-6)


@pytest.mark.parametrize(
    ("sampler", "law"),
    [
        (Gaussian(2.0, 0.5), stats.norm(2.0, 0.5)),
        (Box(1.0, 3.0), stats.uniform(1.0, 2.0)),
        (stats.gamma(2.0, scale=0.3), stats.gamma(2.0, scale=0.3)),
    ],
)
def test_quantiles_reach_far_into_both_tails(sampler, law):
    from tadcore.sampling.adapters import as_sampler

    normal = np.linspace(-9.0, 9.0, 37)[:, None]
    values = as_sampler("x", sampler).from_normal(normal, 1)[:, 0]
    lower, upper = normal[:, 0] < 0.0, normal[:, 0] > 0.0
    far = 1e-16 if isinstance(sampler, Box) else 0.0  # of a number near 3 no smaller part is left
    assert law.cdf(values[lower]) == pytest.approx(stats.norm.cdf(normal[lower, 0]), rel=1e-6, abs=far)
    assert law.sf(values[upper]) == pytest.approx(stats.norm.sf(normal[upper, 0]), rel=1e-6, abs=2 * far)


def test_a_covariance_is_kept():
    normal = np.random.default_rng(0).standard_normal((50_000, 2))
    cov = np.array([[2.0, 0.9], [0.9, 1.0]])
    values = Gaussian([1.0, -1.0], cov=cov).from_normal(normal, 2)
    assert np.cov(values.T) == pytest.approx(cov, abs=0.05)
    assert values.mean(axis=0) == pytest.approx([1.0, -1.0], abs=0.03)


@pytest.mark.parametrize("limited", [False, True])
def test_against_crude_monte_carlo(limited):
    """Of the paper's games, in full and in limited sight, some 1e-4."""
    name, event, spread = ("paper-i1", "d3", 0.1) if limited else ("paper-i1-full", "intercepted", 0.036)
    study = around(tadcore.scenarios.load(name).replace({"step": 0.02}), spread)
    trials = 400_000
    crude = study.replace(trials=trials).run(keep="counts").probabilities()
    count = int(crude.count[crude.names.index(event)])
    assert 30 < count < 400
    found = tadcore.rare(study, event)
    apart = found.probability - count / trials
    assert abs(apart) < 4.0 * math.hypot(found.error * found.probability, math.sqrt(count) / trials), (found, count)


def test_replications_are_unbiased_and_intervals_cover():
    """4,000 replications of few points, on fixed levels: at P = 1e-4 their mean is P."""
    wanted, dim = 3.719016485455709, 3
    assert stats.norm.sf(wanted) == pytest.approx(1e-4)

    def score(u):
        return u.sum(axis=1) / math.sqrt(dim) - wanted, np.zeros(len(u), dtype=np.int64)

    levels = np.array([*(stats.norm.isf(0.1**i) - wanted for i in (1, 2, 3)), splitting.LAST])
    ladder = splitting.Ladder(levels, np.array([0.8, 0.6, 0.5]), np.array([10, 10, 10]), 0.0, 0.0)
    rngs = [np.random.default_rng([9, r]) for r in range(4_000)]
    moves = splitting.climb(score, dim, ladder, rngs, 200)
    while True:
        try:
            next(moves)
        except StopIteration as stop:
            found = stop.value
            break
    estimates = found.estimates
    mean, _, error = summary(estimates, 0.95)
    assert error < 0.015
    assert abs(mean - 1e-4) < 4.0 * error * mean
    assert found.rates.mean(axis=0) == pytest.approx([0.1] * 4, rel=0.03)
    intervals = [summary(part, 0.95)[1] for part in estimates.reshape(200, 20)]
    held = sum(low <= 1e-4 <= high for low, high in intervals)
    assert stats.binom.ppf(1e-4, 200, 0.92) <= held


def test_any_threads_and_any_call_give_the_same():
    study = around(tadcore.scenarios.load("paper-i1-full").replace({"step": 0.05}), 0.03)
    one, two = (tadcore.rare(study, "intercepted", error=0.3, threads=t) for t in (1, 2))
    assert one.to_dict() == two.to_dict()
    other = tadcore.rare(study.replace(seed=2), "intercepted", error=0.3)
    assert other.probability != one.probability
    # Neither the trials nor the design of the study play a part.
    assert tadcore.rare(study.replace(trials=77, design="sobol"), "intercepted", error=0.3).to_dict() == one.to_dict()


def test_more_replications_where_the_first_spread_too_much(monkeypatch):
    from tadcore.analysis import rare_events

    monkeypatch.setattr(rare_events, "_AIM", 3.0)
    study = tadcore.Study(still(), {"attacker.position": Gaussian([3.0, 0.0], 0.6)}, trials=1, seed=1)
    found = tadcore.rare(study, error=0.05)
    assert len(found.replications) > 20
    assert found.error < 0.1
    first = tadcore.rare(study, error=0.5)
    assert len(first.replications) == 20


def test_what_is_not_rare_is_refused_with_the_crude_estimate():
    study = tadcore.Study(still(), {"attacker.position": Gaussian([3.0, 0.0], 2.0)}, trials=1, seed=1)
    truth = within([3.0, 0.0], 2.0, 0.5)
    with pytest.raises(ScenarioError, match=r"rarer than 0\.001") as caught:
        tadcore.rare(study)
    text = str(caught.value)
    count = int(text.partition(" of 10,000")[0].rpartition(" ")[2].replace(",", ""))
    assert abs(count - 10_000 * truth) < 5 * math.sqrt(10_000 * truth)
    assert "Study.run()" in text


def test_what_cannot_come_is_refused():
    study = tadcore.Study(still(), {"attacker.position": Gaussian([3.0, 0.0], 0.1)}, trials=1)
    with pytest.raises(ScenarioError, match="one that can come"):
        tadcore.rare(study)
    study = tadcore.Study(still(), {"attacker.position": Box([2.0, 2.0], [3.0, 3.0])}, trials=1)
    with pytest.raises(ScenarioError, match=r"one that (can come|scores lead to)"):
        tadcore.rare(study)
    # Four places, each as far from the target as any other.
    places = [[3.0, 0.0], [0.0, 3.0], [-3.0, 0.0], [0.0, -3.0]]
    with pytest.raises(ScenarioError, match="equally far"):
        tadcore.rare(tadcore.Study(still(), {"attacker.position": Choice(places)}, trials=1))


def test_what_is_refused_by_name():
    sc = still()

    def study(vary, sc=sc, **more):
        return tadcore.Study(sc, vary, trials=1, **more)

    normal = {"attacker.position": Gaussian([3.0, 0.0], 0.5)}
    cases = [
        (study({"attacker.position": lambda rng, size: rng.normal(size=(size, 2))}), "quantiles"),
        (study({"attacker.position": Cycle([[3.0, 0.0]])}), "quantiles"),
        (study({"attacker.control_weight": Box(1.0, 2.0)}), "attacker.control_weight"),
        (study(normal, sc.replace({"d1.disturbance": 0.1})), "without failures and disturbances"),
        (study(normal, termination="continuous"), "sampled"),
    ]
    for given, words in cases:
        with pytest.raises(ScenarioError, match=words):
            tadcore.rare(given)
    with pytest.raises(ScenarioError, match=r"a draw of attacker\.capture_radius.*truncate"):
        tadcore.rare(study({"attacker.capture_radius": Gaussian(0.5, 0.2)}))
    for name, bad in {"event": "capture", "error": 0.0, "level": 1.0, "threads": 0}.items():
        with pytest.raises(ScenarioError, match=name):
            tadcore.rare(study(normal), **{name: bad})
    with pytest.raises(ScenarioError, match="error"):
        tadcore.rare(study(normal), error=True)
    with pytest.raises(ScenarioError, match=r"tadcore\.Study"):
        tadcore.rare(sc)


def test_a_result_reads_well():
    study = tadcore.Study(still([3.0, 4.0]), {"attacker.position": Gaussian([3.0, 0.0], 0.8)}, trials=1, seed=2)
    found = tadcore.rare(study, "intercepted", error=0.3)
    text = repr(found)
    for words in ("P(intercepted) = ", "(95 %)", "by d1 100.0%", "20 replications", "crude Monte Carlo would need"):
        assert words in text
    page = found._repr_html_()
    assert page.count("<tr>") == len(found.levels) + 1
    told = found.to_dict()
    assert told["levels"][-1] == -5e-324
    assert len(told["rates"]) == len(told["levels"])


def test_annuli_climb_too():
    study = tadcore.Study(still(), {"attacker.position": Annulus([0.0, 0.0], 0.4999, 20.0)}, trials=1, seed=4)
    agrees(tadcore.rare(study), (0.5**2 - 0.4999**2) / (20.0**2 - 0.4999**2))
