"""What statistics say after a rule stopped a study: coverage computed exactly, by enumeration, not by simulation."""

import math
import shutil
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import special, stats

import tadcore
from study_cases import resealed
from tadcore import HalfWidth, ScenarioError, StoreError
from tadcore.analysis import radius_curve
from tadcore.cli.app import main
from tadcore.report import report
from tadcore.sampling import Disk
from tadcore.sampling.design import CHUNK
from tadcore.statistics import (
    Stopping,
    compare,
    difference_interval,
    incidence,
    mixture_interval,
    paired,
    probabilities,
    proportion_interval,
)
from tadcore.statistics.intervals import ends
from tadcore.study.manifest import MANIFEST, Manifest


def misses(p, look, most, decide, covers):
    """Exact probability that the interval at the stop misses p: looks every ``look`` trials, at most ``most`` of them.

    ``decide(s, t)`` tells whether to stop, ``covers(s, t)`` whether the interval holds p, both for arrays of counts.
    """
    mass, missed = np.array([1.0]), 0.0
    for j in range(1, most + 1):
        mass = np.convolve(mass, stats.binom.pmf(np.arange(look + 1), look, p))
        s, t = np.arange(len(mass)), j * look
        over = decide(s, t) | (j == most)
        missed += mass[over & ~covers(s, t)].sum()
        mass = np.where(over, 0.0, mass)
    return missed


def narrow(width):
    def decide(s, t):
        low, high = ends(s, t, 0.05, "wilson")
        return high - low <= width

    return decide


def unlucky(p):
    """The worst that somebody can do who looks: stop when the ordinary interval misses."""

    def decide(s, t):
        low, high = ends(s, t, 0.05, "wilson")
        return (low > p) | (high < p)

    return decide


@pytest.mark.parametrize("p", [1e-4, 0.01, 0.1, 0.3, 0.5, 0.9])
@pytest.mark.parametrize(("look", "most"), [(1, 60), (7, 40), (40, 15)])
def test_a_sequence_holds_whoever_stops(p, look, most):
    def holds(method):
        def covers(s, t):
            low, high = ends(s, t, 0.05, method)
            return (low <= p) & (p <= high)

        return covers

    for decide in (narrow(0.2), unlucky(p)):
        assert misses(p, look, most, decide, holds("sequence")) <= 0.05
    if p >= 0.1:  # what an ordinary interval does there
        assert misses(p, look, most, unlucky(p), holds("wilson")) > 0.15


class Rule:
    """A rule of a user: stops at once, knows nothing of intervals."""

    def satisfied(self, counts, trials):
        return True


def study_of(trials, **changes):
    sc = tadcore.scenarios.load("paper-i1").replace({"horizon": 1.5, "step": 0.05, **changes})
    return tadcore.Study(sc, {"attacker.position": Disk([-2.0, 2.0], 0.5)}, trials=trials, seed=7)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("stopped") / "store"


@pytest.fixture(scope="module")
def stopped(folder):
    return study_of(4 * CHUNK).run(until=HalfWidth(0.02), store=folder)


@pytest.fixture(scope="module")
def full(folder):
    return study_of(CHUNK).run()


def test_the_table_has_the_rule_s_own_intervals(stopped, folder):
    assert stopped.trials == CHUNK
    rule = HalfWidth(0.02)
    for result in (stopped, tadcore.load_study(folder)):
        assert result.stopping == Stopping("HalfWidth(width=0.02, level=0.95)", 0.95, True, CHUNK)
        found = result.probabilities()
        assert found.method == "sequence"
        own = rule.intervals(result.counts(), result.trials)
        for i, name in enumerate(found.names):
            low, high = own.get(name) or mixture_interval(int(found.count[i]), CHUNK, (1 - 0.95) / 3)
            assert (found.low[i], found.high[i]) == (low, high)
        assert repr(found).splitlines()[0] == f"{CHUNK:,} trials, stopped by HalfWidth(width=0.02, level=0.95)"
        assert "95 % (sequence)" in repr(found)
        assert repr(result).endswith("stopped by HalfWidth(width=0.02, level=0.95))")


def test_another_level_is_another_sequence(stopped):
    found = stopped.probabilities(level=0.999)
    assert found.level == 0.999
    own = HalfWidth(0.02, level=0.999).intervals(stopped.counts(), stopped.trials)
    assert [found[name][1:] for name in own] == list(own.values())


def test_what_holds_for_a_fixed_number_is_refused(stopped):
    for method in ("wilson", "exact"):
        with pytest.raises(ScenarioError, match=r"method: got .* stopped by HalfWidth"):
            stopped.probabilities(method=method)


def test_a_rule_that_was_asked_in_vain_decided_as_well(tmp_path):
    rule = HalfWidth(0.001, level=0.9)
    result = study_of(200).run(until=rule, store=tmp_path / "store")
    for one in (result, tadcore.load_study(tmp_path / "store")):
        found = one.probabilities()
        assert (found.method, found.level, found.rule) == ("sequence", 0.9, f"not stopped by {rule!r}")
    again = study_of(200).run(store=tmp_path / "store")  # the number of trials is fixed now
    assert again.stopping is None
    assert again.probabilities().method == tadcore.load_study(tmp_path / "store").probabilities().method == "wilson"


def test_a_rule_of_a_user_is_named_by_its_class(tmp_path):
    result = study_of(100).run(until=Rule(), store=tmp_path / "store")
    assert result.stopping == Stopping("Rule", 0.95, True, CHUNK)
    assert tadcore.load_study(tmp_path / "store").stopping == result.stopping
    found = result.probabilities()
    assert found["captured"][1:] == mixture_interval(int(found.count[1]), 100, (1 - 0.95) / 3)


def test_a_study_without_a_rule_is_as_before(full):
    assert full.stopping is None
    found = full.probabilities()
    low, high = proportion_interval(found.count, CHUNK)
    assert (found.method, found.rule) == ("wilson", "")
    assert np.array_equal((found.low, found.high), (low, high))


def test_a_design_that_is_not_random_says_so():
    found = study_of(64).replace(design="sobol").run().probabilities()
    assert repr(found).splitlines()[0] == "64 trials, sobol design: intervals are those of independent draws"


def test_bands_of_incidence_hold_at_every_look(stopped, full):
    found, plain = stopped.incidence(), full.incidence()
    assert stats.kstwo.sf(found.half_width, CHUNK) == pytest.approx(0.05 / 2, rel=1e-6)  # the first look
    assert stats.kstwo.sf(plain.half_width, CHUNK) == pytest.approx(0.05, rel=1e-6)
    assert "stopped by" in repr(found)
    assert sum(1 / (j * (j + 1)) for j in range(1, 100_000)) < 1
    many = incidence([0, 1], [-1, -1], [1.0, 0.5], horizon=1.0, step=0.5, n=1, looks=9)
    assert stats.kstwo.sf(many.half_width, 2) == pytest.approx(0.05 / 90, rel=1e-6)


def test_comparisons_and_curves_use_sequences(stopped, full):
    other = study_of(CHUNK, **{"defenders[0].visibility_radius": 1.0}).run()
    found = compare(stopped, other)
    assert found.method == "sequence"
    assert "A stopped by HalfWidth" in repr(found)
    want = difference_interval(found.only_a, found.only_b, CHUNK, method="sequence")
    assert np.array_equal((found.low, found.high), want)
    fixed = compare(full, other)
    assert (fixed.method, fixed.rule) == ("score", "")
    assert ((found.low <= fixed.low) & (fixed.high <= found.high)).all()
    with pytest.raises(ScenarioError, match="method"):
        paired([1], [-1], [1], [-1], 1, method="wald")

    curve = radius_curve(stopped, player="d1", radii=[1.0, 2.0], reference=1.0)
    base = round(float(curve.estimate[2, 0]) * CHUNK)
    assert (curve.low[2, 0], curve.high[2, 0]) == mixture_interval(base, CHUNK, 1 - 0.95)
    assert (curve.band_low[2, 0], curve.band_high[2, 0]) == pytest.approx(mixture_interval(base, CHUNK, 0.025))
    assert curve.to_xarray().attrs["rule"] == curve.rule == str(stopped.stopping)
    plain = radius_curve(full, player="d1", radii=[1.0, 2.0], reference=1.0)
    assert "rule" not in plain.to_xarray().attrs
    assert (curve.difference_high[2, 1] - curve.difference_low[2, 1]) > (
        plain.difference_high[2, 1] - plain.difference_low[2, 1]
    )


def test_the_page_and_the_command_say_it(stopped, folder, tmp_path, capsys):
    text = report(stopped, tmp_path / "page.html").read_text(encoding="utf-8")
    assert "stopped by HalfWidth(width=0.02, level=0.95)" in text
    assert "Outcomes, with 95 % confidence sequences" in text
    assert "Wilson" not in text
    for _, _, share, interval in stopped.probabilities().rows():
        assert share in text
        assert interval in text
    with pytest.raises(SystemExit):
        main(["report", str(folder), "--out", str(tmp_path / "other.html")])
    assert (tmp_path / "other.html").read_bytes() == (tmp_path / "page.html").read_bytes()


def multinomial_likelihood(delta, b, c, rest):
    """Largest log-likelihood of (b, c, rest) where p_b - p_c = Δ, by a fine search."""
    q = np.linspace(max(0.0, -delta), (1.0 - delta) / 2.0, 400_001)
    sure = np.maximum(np.array([q + delta, q, 1 - 2 * q - delta]), 0.0)  # rounding at the ends of the range
    return special.xlogy(np.array([[b], [c], [rest]]), sure).sum(axis=0).max()


@pytest.mark.parametrize(
    ("b", "c", "trials"), [(12, 4, 50), (0, 0, 20), (5, 5, 10), (1, 30, 60), (0, 9, 9), (3, 0, 40)]
)
def test_a_difference_s_sequence_is_what_the_mixture_has_not_refuted(b, c, trials):
    rest, error = trials - b - c, 0.05
    mixture = math.lgamma(b + 1) + math.lgamma(c + 1) + math.lgamma(rest + 1) + math.log(2) - math.lgamma(trials + 3)
    low, high = (float(end) for end in difference_interval(b, c, trials, level=1 - error, method="sequence"))
    assert low <= (b - c) / trials <= high
    for end in (low, high):
        if abs(end) < 1.0:
            assert mixture - multinomial_likelihood(end, b, c, rest) == pytest.approx(-math.log(error), abs=1e-6)


@pytest.mark.parametrize(("p_b", "p_c"), [(0.05, 0.05), (0.3, 0.1), (0.01, 0.0)])
def test_a_difference_s_sequence_holds_whoever_stops(p_b, p_c):
    """Exact, over all paths of 30 trials: somebody who stops at the first miss finds one in at most 10 %."""
    most, delta, level = 30, p_b - p_c, 0.9
    reached = {"sequence": 0.0, "score": 0.0}
    for method in reached:
        mass = np.zeros((most + 2, most + 2))
        mass[0, 0] = 1.0
        for t in range(1, most + 1):
            grown = (1 - p_b - p_c) * mass
            grown[1:] += p_b * mass[:-1]
            grown[:, 1:] += p_c * mass[:, :-1]
            b, c = np.nonzero(grown > 0)
            low, high = difference_interval(b, c, t, level=level, method=method)
            out = (low > delta) | (high < delta)
            reached[method] += grown[b[out], c[out]].sum()
            grown[b[out], c[out]] = 0.0
            mass = grown
    assert reached["sequence"] <= 1 - level
    if p_c:
        assert reached["score"] > reached["sequence"]


def test_p_values_of_a_sequence_hold_whoever_stops():
    """Under no difference the pairs that differ are fair coins: p ≤ 0.05 is ever reached in at most 5 %, exactly."""
    mass, ever = np.array([1.0]), 0.0
    for k in range(1, 400):
        mass = np.convolve(mass, [0.5, 0.5])
        b = np.arange(k + 1)
        p = np.array([p_of(int(i), int(k - i)) if mass[i] > 0 else 1.0 for i in b]) if k < 40 else p_many(b, k)
        ever += mass[p <= 0.05].sum()
        mass = np.where(p <= 0.05, 0.0, mass)
    assert 0.01 < ever <= 0.05


def p_of(b, c):
    kinds = [1] * b + [2] * c
    other = [2] * b + [1] * c
    who = [-1 if kind == 1 else 0 for kind in kinds], [-1 if kind == 1 else 0 for kind in other]
    return paired(kinds, who[0], other, who[1], 1, method="sequence").p_value[1]


def p_many(b, k):
    return np.minimum(np.exp(-special.betaln(b + 1, k - b + 1) - k * math.log(2)), 1.0)


def test_a_result_without_the_attribute_was_fixed():
    plain = SimpleNamespace(kind=[1], defender=[-1], scenario=SimpleNamespace(n=1))
    assert tadcore.statistics.probabilities_of(plain).low == pytest.approx(probabilities([1], [-1], 1).low)


@pytest.mark.parametrize(
    "rule",
    [None, 3, {}, {"rule": 3, "level": 0.9}, {"rule": "R"}, {"rule": "R", "level": 2}, {"rule": "R", "level": "0.9"}],
)
def test_a_manifest_with_no_rule_in_its_place_is_named(folder, tmp_path, rule):
    store = tmp_path / "store"
    shutil.copytree(folder, store)
    resealed(store, rule=rule)
    with pytest.raises(StoreError, match="manifest"):
        tadcore.load_study(store)


def test_a_store_of_a_study_that_was_stopped_without_naming_the_rule(folder, tmp_path):
    store = tmp_path / "store"
    shutil.copytree(folder, store)
    (store / MANIFEST).write_text(replace(Manifest.read(store), rule=None).to_json(), encoding="utf-8")
    assert tadcore.load_study(store).probabilities().rule == "stopped by a rule"
