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
    from tadcore.analysis import replications

    monkeypatch.setattr(replications, "AIM", 3.0)
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
        (
            study({"attacker.position": Cycle([[3.0, 0.0]])}, sc.replace({"d1.disturbance": 0.1})),
            "a sampler that draws",
        ),
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


def walk(b, size, **changes):
    """An attacker that is shaken, of whom a disk as large as a half-plane is b away: 40 steps of 0.01."""
    wide = 1e5
    sc = tadcore.Scenario(
        interaction="I1",
        horizon=0.4,
        step=0.01,
        attacker={"position": [0.0, 0.0], "control_weight": 1e30, "capture_radius": wide, "disturbance": size},
        target={"position": [wide + b, 0.0], "control_weight": 1e30},
        defenders=[{"position": [-wide, 0.0], "control_weight": 1e30, "capture_radius": 0.5}],
    )
    return sc.replace(changes) if changes else sc


def first_passage(b, spread, steps):
    """P(a walk of so many normal steps reaches b), by Gauss-Legendre quadrature of its density below b."""
    nodes, weights = np.polynomial.legendre.leggauss(800)
    low = b - 14.0 * spread * math.sqrt(steps)
    x, w = low + (nodes + 1.0) / 2.0 * (b - low), weights * (b - low) / 2.0
    kernel = stats.norm.pdf(x[:, None], x[None, :], spread)
    density, out = stats.norm.pdf(x, 0.0, spread), stats.norm.sf(b / spread)
    for _ in range(steps - 1):
        out += np.sum(w * density * stats.norm.sf((b - x) / spread))
        density = kernel @ (w * density)
    return float(out)


def finished(moves):
    while True:
        try:
            next(moves)
        except StopIteration as stop:
            return stop.value


def test_split_paths_are_unbiased_for_a_random_walk():
    """400 replications of 200 paths, against a quadrature: P = 2.8e-5."""
    from tadcore.analysis.path_splitting import PathSearch

    truth = first_passage(2.6, 0.1, 40)
    assert truth == pytest.approx(2.798e-5, rel=1e-3)
    study = tadcore.Study(walk(2.6, 1.0), {}, trials=1, seed=11)
    search = PathSearch(study, "captured", 0.1, None)
    estimates = finished(search.group(range(1, 401), 200)).estimates
    mean, _, error = summary(estimates, 0.95)
    assert error < 0.08
    assert abs(mean - truth) < 4.0 * error * truth, (mean, truth, error)
    agrees(tadcore.rare(study, error=0.1), truth)


def test_starts_and_paths_are_both_random():
    """The start is normal too: the walk's first step is that much longer."""
    study = tadcore.Study(walk(3.0, 1.0), {"attacker.position.x": Gaussian(0.0, 0.3)}, trials=1, seed=12)
    nodes, weights = np.polynomial.hermite_e.hermegauss(60)
    parts = [first_passage(3.0 - 0.3 * x, 0.1, 40) if 0.3 * x < 2.5 else 1.0 for x in nodes]
    truth = float(np.dot(weights, parts) / weights.sum())
    assert 1e-6 < truth < 1e-4
    found = tadcore.rare(study, error=0.1)
    agrees(found, truth)
    # Paths have no levels in common, so there is no table of them.
    page = found._repr_html_()
    assert "P(captured) = " in page
    assert "<table" not in page
    assert found.to_dict()["rates"] == found.to_dict()["levels"] == []


@pytest.mark.parametrize(
    ("changes", "event"),
    [
        ({"attacker.disturbance": 0.03}, "captured"),
        ({"d*.sensing": {"mean_time_to_failure": 300.0}, "d*.disturbance": 0.02}, "d3"),
        ({"d*.sensing": {"mean_time_detected": 5.0, "mean_time_missed": 0.1}, "attacker.disturbance": 0.02}, "d2"),
    ],
)
def test_split_paths_against_crude_monte_carlo(changes, event):
    """200 replications of 500 paths each, with failures, in limited sight: their mean is the crude estimate."""
    from tadcore.analysis.path_splitting import PathSearch

    sc = tadcore.scenarios.load("paper-i1").replace({"step": 0.02, **changes})
    study = tadcore.Study(sc, {}, trials=300_000, seed=3)
    crude = study.run(keep="counts").probabilities()
    count = int(crude.count[crude.names.index(event)])
    assert 20 < count < 1000, count
    found = finished(PathSearch(study, event, 0.1, None).group(range(1, 201), 500))
    mean, _, error = summary(found.estimates, 0.95)
    assert error < 0.3
    apart = math.hypot(error * mean, math.sqrt(count) / 300_000)
    assert abs(mean - count / 300_000) < 4.0 * apart, (mean, error, count)


def test_where_splitting_paths_does_not_pay_it_is_said():
    """A failure that decides is not approached, and a start too near to an end leaves nothing to climb."""
    sc = tadcore.scenarios.load("paper-i1").replace({"step": 0.02})
    failing = sc.replace({"d*.sensing": {"mean_time_to_failure": 300.0}, "d*.disturbance": 0.02})
    with pytest.raises(ScenarioError, match=r"for which splitting pays.* crude Monte Carlo \d|paths lead to"):
        tadcore.rare(tadcore.Study(failing, {}, trials=1, seed=1), "d3", error=0.2)
    sc = sc.replace({"attacker.disturbance": 0.02})
    with pytest.raises(ScenarioError, match=r"most replications of 800 paths died out|splitting pays"):
        tadcore.rare(tadcore.Study(sc, {}, trials=1, seed=1))
    with pytest.raises(ScenarioError, match="an outcome that comes at an instant"):
        tadcore.rare(tadcore.Study(sc, {}, trials=1, seed=1), "timeout")


def test_links_without_failures_are_part_of_the_game():
    """Who is told of the attacker intercepts it: the scores are those of a batch of the same scenario."""
    from tadcore.analysis.normal import NormalInputs

    sc = tadcore.scenarios.load("paper-i1").replace({"step": 0.02, "d*.communication": {"radius": 9.0}})
    assert not sc.is_random
    study = around(sc, 0.3)
    inputs = NormalInputs(study, "captured", None)
    normal = np.random.default_rng(1).standard_normal((200, inputs.dim))
    drawn = inputs.inputs(normal)
    order = [
        study.columns.index(f"{q}.position.x")
        for q in ("defenders.0", "defenders.1", "defenders.2", "target", "attacker")
    ]
    positions = np.stack([drawn[:, [i, i + 1]] for i in order], axis=1)
    batch = tadcore.simulate_batch(sc, positions, scores=True)
    plain = tadcore.simulate_batch(sc.replace({"d*.communication": None}), positions, scores=True)
    assert np.array_equal(inputs(normal)[0], batch.scores[:, 1])
    assert not np.array_equal(batch.scores, plain.scores)
