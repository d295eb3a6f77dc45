"""Degenerate input to every statistic: a right number, or an error that names the field; no NaN, no raw error."""

import math
import warnings

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy import stats

import tadcore
from tadcore import HalfWidth, ScenarioError, plotting, radius_curve
from tadcore.analysis import sensitivity, sobol
from tadcore.sampling import Disk
from tadcore.statistics import (
    difference_interval,
    incidence,
    mixture_interval,
    paired,
    probabilities,
    proportion_interval,
)

LEVELS = st.one_of(
    st.sampled_from([1 - 2**-53, 1 - 1e-16, 1 - 1e-12, 0.999, 0.95, 0.5, 0.01, 1e-16, 1e-300, 5e-324]),
    st.floats(0, 1, exclude_min=True, exclude_max=True),
)
NO_LEVEL = [0, 1, 0.0, 1.0, -0.5, 2, math.nan, math.inf, -math.inf, "0.95", None, True, 0.95j, [0.95], np.array([0.95])]
TRIALS = st.one_of(st.integers(1, 5), st.sampled_from([1, 2, 100, 2**20, 10**9, 2**40]), st.integers(1, 2**40))


def raised(action):
    """Warnings are errors here: a NaN on the way is one."""
    with warnings.catch_warnings(), np.errstate(all="raise", under="ignore"):
        warnings.simplefilter("error")
        return action()


@settings(deadline=None, max_examples=300)
@given(trials=TRIALS, part=st.floats(0, 1), level=LEVELS, method=st.sampled_from(["wilson", "exact", "sequence"]))
def test_proportions(trials, part, level, method):
    count = round(part * trials)
    low, high = raised(lambda: proportion_interval([0, count, trials], trials, level=level, method=method))
    assert (low >= 0).all()
    assert (high <= 1).all()
    p = np.array([0, count, trials]) / trials
    slack = 1e-12 * p
    assert (low <= p + slack).all()
    assert (p <= high + slack).all()
    assert (low[0], high[-1]) == (0.0, 1.0)


@settings(deadline=None, max_examples=300)
@given(
    trials=TRIALS, one=st.floats(0, 1), two=st.floats(0, 1), level=LEVELS, method=st.sampled_from(["score", "sequence"])
)
def test_differences(trials, one, two, level, method):
    b = round(one * trials)
    c = round(two * (trials - b))
    low, high = raised(lambda: difference_interval(b, c, trials, level=level, method=method))
    assert -1 <= low <= high <= 1
    assert low - 1e-14 <= (b - c) / trials <= high + 1e-14
    mirrored = difference_interval(c, b, trials, level=level, method=method)
    assert (float(low), float(high)) == (-float(mirrored[1]), -float(mirrored[0]))


@settings(deadline=None)
@given(
    kind=st.lists(st.sampled_from([0, 1, 2]), min_size=1, max_size=6), level=LEVELS, jointly=st.booleans(),
    looks=st.sampled_from([0, 1, 2, 2**32]),
)  # fmt: skip
def test_tables_of_a_few_trials(kind, level, jointly, looks):
    who = [0 if code == 2 else -1 for code in kind]
    for method in ("wilson", "exact", "sequence"):
        found = raised(lambda method=method: probabilities(kind, who, 1, level=level, method=method))
        assert np.isfinite([found.low, found.high]).all()
        assert "nan" not in repr(found)
        assert len(found.to_pandas()) == 4
    times = np.ones(len(kind))
    curves = raised(
        lambda: incidence(kind, who, times, horizon=1.0, step=0.5, n=1, level=level, jointly=jointly, looks=looks)
    )
    assert np.isfinite([curves.low, curves.high]).all()
    assert 0.0 < curves.half_width <= 1.0
    assert "nan" not in repr(curves)
    both = raised(lambda: paired(kind, who, kind[::-1], who[::-1], 1, level=level))
    assert np.isfinite([both.low, both.high, both.p_value]).all()
    assert "nan" not in repr(both)


@pytest.mark.parametrize("level", NO_LEVEL)
def test_what_is_no_level_is_named(level):
    sc = tadcore.scenarios.load("paper-i1")
    for action in (
        lambda: probabilities([1], [-1], 1, level=level),
        lambda: proportion_interval(1, 2, level=level),
        lambda: difference_interval(1, 0, 2, level=level),
        lambda: paired([1], [-1], [1], [-1], 1, level=level),
        lambda: incidence([1], [-1], [1.0], horizon=1.0, step=0.5, n=1, level=level),
        lambda: HalfWidth(0.1, level=level),
        lambda: sobol(lambda x: x, {"a": stats.norm()}, ["y"], points=4, level=level),
        *([lambda: radius_curve(sc, [sc.positions], radii=[1.0], level=level)] if level is not None else []),
    ):
        with pytest.raises(ScenarioError) as caught:
            action()
        assert caught.value.field == "level"


@pytest.mark.parametrize(
    ("action", "field"),
    [
        (lambda: probabilities([], [], 1), "kind"),
        (lambda: probabilities([[1]], [[-1]], 1), "kind"),
        (lambda: probabilities([math.nan], [-1], 1), "kind"),
        (lambda: probabilities(["1"], [-1], 1), "kind"),
        (lambda: probabilities([[1], [1, 2]], [-1], 1), "kind"),
        (lambda: probabilities(None, None, 1), "kind"),
        (lambda: probabilities([1], [-1], 1.0), "n"),
        (lambda: probabilities([1], [-1], None), "n"),
        (lambda: paired([], [], [], [], 1), "kind"),
        (lambda: paired([1], [-1], [1, 1], [-1, -1], 1), "kind_b"),
        (lambda: proportion_interval(1.5, 2), "count"),
        (lambda: proportion_interval(math.nan, 2), "count"),
        (lambda: proportion_interval([1, [2]], 2), "count"),
        (lambda: proportion_interval(3, 2), "count"),
        (lambda: proportion_interval(-1, 2), "count"),
        (lambda: proportion_interval(0, 0), "trials"),
        (lambda: proportion_interval(0, math.inf), "trials"),
        (lambda: proportion_interval(0, 2**41), "trials"),
        (lambda: difference_interval(0, 0, 0), "trials"),
        (lambda: difference_interval(1, 1, 1), "only_a"),
        (lambda: difference_interval(-1, 0, 1), "only_a"),
        (lambda: difference_interval(0.5, 0, 1), "only_a"),
        (lambda: difference_interval([1, 2], [1, 2, 3], 9), "only_b"),
        (lambda: mixture_interval(1, 2, 0.0), "error"),
        (lambda: mixture_interval(1, 2, math.nan), "error"),
        (lambda: mixture_interval(1, 2, 1.5), "error"),
        (lambda: mixture_interval(3, 2, 0.05), "successes"),
        (lambda: mixture_interval(-1, 2, 0.05), "successes"),
        (lambda: mixture_interval(0, -1, 0.05), "trials"),
        (lambda: incidence([1], [-1], [1.0], horizon=math.inf, step=0.5, n=1), "horizon"),
        (lambda: incidence([1], [-1], [1.0], horizon=math.nan, step=0.5, n=1), "horizon"),
        (lambda: incidence([1], [-1], [1.0], horizon=1.0, step="0.5", n=1), "step"),
        (lambda: incidence([1], [-1], [1.0], horizon=None, step=0.5, n=1), "horizon"),
        (lambda: incidence([1], [-1], [1.0], horizon=1e300, step=1e-300, n=1), "step"),
        (lambda: incidence([1], [-1], [1.0], horizon=1.0, step=1e-12, n=1), "step"),
        (lambda: incidence([1], [-1], [1.0], horizon=1.0, step=0.5, n=1, looks=-1), "looks"),
        (lambda: HalfWidth(0.1).intervals({"a": 1}, -1), "trials"),
        (lambda: HalfWidth(0.1).intervals({"a": 0.5}, 1), "counts['a']"),
    ],
)  # fmt: skip
def test_what_is_no_data_is_named(action, field):
    with pytest.raises(ScenarioError) as caught:
        action()
    assert (caught.value.field or "").startswith(field) or any(e.field.startswith(field) for e in caught.value.errors)


UNIT = {"a": stats.uniform()}


def step_at(edge):
    return lambda x: (x[:1] > edge) * 1.0


@settings(deadline=None, max_examples=60)
@given(
    points=st.sampled_from([2, 4, 16, 64]),
    resamples=st.sampled_from([1, 2, 39, 60]),
    level=LEVELS,
    edge=st.sampled_from([0.0, 0.02, 0.5, 0.98, 1.0]),
    inputs=st.integers(1, 3),
    outputs=st.integers(1, 2),
)
def test_indices_of_few_points_rare_outcomes_and_few_resamples(points, resamples, level, edge, inputs, outputs):
    names = {f"x{i}": stats.uniform() for i in range(inputs)}
    rows = [step_at(edge), lambda x: x[:1]][:outputs]
    found = raised(
        lambda: sobol(
            lambda x: np.vstack([row(x) for row in rows]), names, [f"y{o}" for o in range(outputs)],
            points=points, resamples=resamples, level=level, seed=3,
        )
    )  # fmt: skip
    assert found.first.shape == found.total_high.shape == (outputs, inputs)
    constant = np.isnan(found.total)
    for part in (found.first, found.first_low, found.first_high, found.total_low, found.total_high):
        assert np.array_equal(np.isnan(part), constant)
    assert np.array_equal(constant[:, 0], found.variance == 0.0)
    for low, high in ((found.first_low, found.first_high), (found.total_low, found.total_high)):
        assert (low[~constant] <= high[~constant]).all()
        if 2.0 / (1.0 - level) > resamples + 2:  # no such percentile: the whole range
            assert (low[~constant] <= 0).all()
            assert (high[~constant] >= 1).all()
    assert "nan" not in repr(found)


def test_one_input_and_one_output():
    found = sobol(lambda x: x[:1], UNIT, ["y"], points=256, seed=1)
    assert found.first[0, 0] == pytest.approx(1.0, abs=0.02)
    assert found.total[0, 0] == pytest.approx(1.0, abs=0.02)
    sc = tadcore.scenarios.load("paper-i1")
    played = sensitivity(sc, {"attacker.position.x": stats.uniform(-3, 6)}, points=16, outputs=["intercepted"])
    assert played.first.shape == (1, 1)


def test_the_estimators_are_scipy_s():
    rng = np.random.default_rng(2)
    values = {"f_A": rng.normal(size=(2, 64)), "f_B": rng.normal(size=(2, 64)), "f_AB": rng.normal(size=(3, 2, 64))}
    f = np.concatenate([values["f_A"][:, None], values["f_B"][:, None], np.moveaxis(values["f_AB"], 0, 1)], axis=1)
    calls = iter([f.transpose(0, 1, 2).reshape(2, -1)])
    names = {f"x{i}": stats.uniform() for i in range(3)}
    found = sobol(lambda x: next(calls), names, ["y", "z"], points=64, resamples=1)
    want = stats.sobol_indices(func=values, n=64)
    assert found.first == pytest.approx(want.first_order, rel=1e-12)
    assert found.total == pytest.approx(want.total_order, rel=1e-12)


def test_a_rare_outcome_that_vanishes_in_resamples_widens_the_interval():
    """Two of 32 points differ: some 13 % of the resamples miss both, and say nothing of the index."""
    points = iter([np.array([[0.0] * 31 + [1.0] + [0.0] * 31 + [1.0] + [0.0] * 32])])
    found = sobol(lambda x: next(points), UNIT, ["y"], points=32, seed=2, level=0.8)
    assert found.total_low[0, 0] == pytest.approx(0.0, abs=1e-12)
    assert found.total_high[0, 0] >= 1.0


@pytest.mark.parametrize(("factors", "inputs"), [(1, 2), (2, 2), (3, 3)])
@pytest.mark.parametrize(("chance", "points"), [(0.02, 512), (0.25, 256)])
def test_intervals_of_events_hold_or_say_nothing(factors, inputs, chance, points):
    """An event of independent inputs, all below r: its indices have closed forms. Rare ones get the whole range."""
    r = chance ** (1 / factors)
    names = {f"x{i}": stats.uniform() for i in range(inputs)}
    variance = chance * (1 - chance)
    first = [(chance**2 / r - chance**2) / variance if i < factors else 0.0 for i in range(inputs)]
    total = [1 - (r ** (factors + 1) - chance**2) / variance if i < factors else 0.0 for i in range(inputs)]
    missed, repetitions = np.zeros((2, inputs)), 20
    for seed in range(repetitions):
        found = sobol(
            lambda x: (x[:factors] < r).all(axis=0)[np.newaxis] * 1.0,
            names,
            ["y"],
            points=points,
            seed=seed,
            resamples=100,
        )
        if chance < 0.1:
            assert (found.first_low <= 0).all()
            assert (found.total_high >= 1).all()
        missed[0] += (found.first_low[0] > np.add(first, 1e-9)) | (found.first_high[0] < np.subtract(first, 1e-9))
        missed[1] += (found.total_low[0] > np.add(total, 1e-9)) | (found.total_high[0] < np.subtract(total, 1e-9))
    assert (missed / repetitions <= 0.05 + 3 * math.sqrt(0.05 * 0.95 / repetitions)).all()


class Odd:
    """A distribution whose inverse is not one."""

    def __init__(self, found):
        self.found = found

    def ppf(self, q):
        return self.found(q)


@pytest.mark.parametrize(
    ("function", "inputs", "outputs", "field"),
    [
        (lambda x: x[:1] * np.nan, UNIT, ["y"], "function"),
        (lambda x: x[:1] * np.inf, UNIT, ["y"], "function"),
        (lambda x: x[0], UNIT, ["y"], "function"),
        (lambda x: [["a"]], UNIT, ["y"], "function"),
        (lambda x: x[:1], {"a": Odd(lambda q: q * np.nan)}, ["y"], "inputs['a']"),
        (lambda x: x[:1], {"a": Odd(lambda q: 1.0)}, ["y"], "inputs['a']"),
        (lambda x: x[:1], {"a": Odd(lambda q: "x")}, ["y"], "inputs['a']"),
        (lambda x: x[:1], {"a": 3.0}, ["y"], "inputs['a']"),
        (lambda x: x[:1], {}, ["y"], "inputs"),
        (lambda x: x[:1], UNIT, [], "outputs"),
    ],
)
def test_what_gives_no_indices_is_named(function, inputs, outputs, field):
    with pytest.raises(ScenarioError) as caught:
        sobol(function, inputs, outputs, points=8, resamples=2)
    assert caught.value.field.startswith(field)


INF = math.inf


@pytest.mark.parametrize(
    ("radii", "field"),
    [
        ([INF, INF], "radii"), ([1.0, 1.0], "radii"), ([1.0, INF, INF], "radii"), ([INF, 1.0], "radii"),
        ([2.0, 1.0], "radii"), ([], "radii"), ([[1.0, 2.0]], "radii"), ([math.nan, 1.0], "radii"),
        ([-INF, 1.0], "radii"), (None, "radii"), ("12", "radii"), ([1.0, [2.0]], "radii"),
    ],
)  # fmt: skip
def test_radii_that_do_not_increase_are_named(radii, field):
    sc = tadcore.scenarios.load("paper-i1")
    with pytest.raises(ScenarioError) as caught:
        radius_curve(sc, [sc.positions], radii=radii)
    assert caught.value.field.startswith(field)


@pytest.mark.parametrize("reference", [math.nan, -1.0, 0.0, [1.0, 2.0], "1", True])
def test_references_are_checked(reference):
    sc = tadcore.scenarios.load("paper-i1")
    with pytest.raises(ScenarioError) as caught:
        radius_curve(sc, [sc.positions], radii=[1.0], reference=reference)
    assert caught.value.field.startswith("reference")


@pytest.mark.parametrize("radii", [[1.0], [INF], [1.0, INF], [1.0, np.nextafter(1.0, 2.0)]])
@pytest.mark.parametrize("level", [0.95, 1 - 1e-16, 1e-300])
def test_curves_of_one_trial(radii, level):
    sc = tadcore.scenarios.load("paper-i1")
    curve = raised(lambda: radius_curve(sc, [sc.positions], radii=radii, level=level, refine=INF not in radii))
    for name in ("estimate", "low", "high", "band_low", "band_high", "difference_low", "difference_high", "slope_high"):
        assert np.isfinite(getattr(curve, name)).all()
    assert "nan" not in repr(curve)
    assert curve.slope.shape == (6, len(radii) - 1)


@pytest.mark.parametrize("tolerance", [0.0, -1.0, INF, math.nan, "x", None, True])
def test_tolerances_are_checked(tolerance):
    sc = tadcore.scenarios.load("paper-i1")
    with pytest.raises(ScenarioError, match="tolerance"):
        radius_curve(sc, [sc.positions], radii=[1.0, 2.0], refine=True, tolerance=tolerance)


@pytest.mark.parametrize(
    ("options", "field"),
    [
        ({"outputs": "time"}, "outputs"),
        ({"outputs": 5}, "outputs"),
        ({"outputs": [["time"]]}, "outputs"),
        ({"inputs": dict.fromkeys(("d1.visibility_radius", "defenders[0].visibility_radius"), stats.uniform(1, 1))},
         "inputs['defenders[0].visibility_radius']"),
        ({"inputs": {"attacker.position.x": stats.uniform(0, 0)}}, "inputs['attacker.position.x']"),
    ],
)  # fmt: skip
def test_inputs_and_outputs_of_games_are_checked(options, field):
    sc = tadcore.scenarios.load("paper-i1")
    with pytest.raises(ScenarioError) as caught:
        sensitivity(sc, **{"inputs": {"attacker.position.x": stats.uniform(-3, 6)}, "points": 4, **options})
    assert caught.value.field == field


@pytest.mark.parametrize("level", [1 - 1e-16, 0.95, 1e-300])
def test_figures_of_one_trial_are_drawn_or_refused(level):
    mpl.use("Agg")
    sc = tadcore.scenarios.load("paper-i1").replace({"horizon": 1.0, "step": 0.05})
    one = tadcore.Study(sc, {"attacker.position": Disk([-2, 2], 0.5)}, trials=1, seed=1).run()
    curves = {
        radii: radius_curve(sc, [sc.positions], radii=radii, level=level) for radii in [(1.0,), (INF,), (1.0, 2.0)]
    }
    drawn = [
        lambda: plotting.outcome_probabilities(one.probabilities(level=level)),
        lambda: plotting.incidence(one.incidence(level=level)),
        lambda: plotting.incidence(one.incidence(level=level), stacked=False),
        lambda: plotting.comparison(one.compare(one, level=level)),
        *(
            lambda q=q: plotting.radius_curve(curves[1.0, 2.0], quantity=q)
            for q in ("probability", "difference", "slope")
        ),
        *(lambda q=q: plotting.radius_curve(curves[(1.0,)], quantity=q) for q in ("probability", "difference")),
    ]
    for draw in drawn:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            figure = draw().figure
            figure.canvas.draw()
            plt.close(figure)
    for radii, quantity in (((INF,), "probability"), ((INF,), "slope"), ((1.0,), "slope")):
        with pytest.raises(ValueError, match="finite radi"):
            plotting.radius_curve(curves[radii], quantity=quantity)
