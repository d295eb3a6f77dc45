"""Figures of studies: what they show, that they come back in the axes given, and that they read in grey."""

import contextlib
import copy
from itertools import combinations

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from scipy import stats

import tadcore
from tadcore import plotting, statistics
from tadcore.analysis.sensitivities import sobol
from tadcore.plotting.study.shares import range_edges
from tadcore.plotting.tools.outcomes import input_label, outcome_look


@pytest.fixture(scope="module", autouse=True)
def _agg():
    before = mpl.get_backend()
    mpl.use("Agg")
    yield
    mpl.use(before)


class Result:
    """The part of a study's result that figures read."""

    def __init__(self, sc, trials):
        rng = np.random.default_rng(12)
        positions = rng.uniform(-3, 3, (trials, 5, 2))
        batch = tadcore.simulate_batch(sc, positions)
        self.scenario, self.trials, self.seed = sc, trials, 1
        self.kind, self.defender, self.time = batch.kind, batch.defender, batch.time
        self.inputs = {
            "attacker.position.x": positions[:, 4, 0],
            "target.position.y": positions[:, 3, 1],
            "defenders.1.visibility_radius": rng.choice([0.5, 1.0, np.inf], trials),
            "defenders.0.capture_radius": np.full(trials, 0.1),
        }
        self.positions = positions


@pytest.fixture(scope="module")
def sc():
    return tadcore.scenarios.load("paper-i1")


@pytest.fixture(scope="module")
def result(sc):
    return Result(sc, 150)


@pytest.fixture(scope="module")
def said(sc, result):
    """One of everything that can be drawn."""
    narrow = tadcore.simulate_batch(sc, result.positions, visibility_radii=[5, 0.7, 1.25])
    distributions = {name: stats.uniform(0, 1) for name in ("attacker.position.x", "defenders.0.capture_radius", "u")}
    return {
        "probabilities": statistics.probabilities(result.kind, result.defender, 3),
        "incidence": statistics.incidence(result.kind, result.defender, result.time, horizon=6, step=0.005, n=3),
        "comparison": statistics.paired(result.kind, result.defender, narrow.kind, narrow.defender, 3),
        "radius": tadcore.radius_curve(sc, result.positions[:60], player="d2", radii=np.linspace(0.2, 3, 6)),
        "radii": tadcore.radius_curve(sc, result.positions[:60], player=["d1", "d3"], radii=np.linspace(0.2, 3, 6)),
        "sensitivity": sobol(
            lambda x: np.array([x[0] + 0.1 * x[1], 0 * x[0]]), distributions, ["time", "d1"], points=32, resamples=20
        ),
        "map": tadcore.outcome_map(sc, x=(-3, 3, 25), y=(-3, 3, 21)),
        "result": result,
    }


DRAWN = {
    "probabilities": lambda said, ax: plotting.outcome_probabilities(said["probabilities"], ax),
    "incidence": lambda said, ax: plotting.incidence(said["incidence"], ax),
    "incidence apart": lambda said, ax: plotting.incidence(said["incidence"], ax, stacked=False),
    "comparison": lambda said, ax: plotting.comparison(said["comparison"], ax),
    "radius": lambda said, ax: plotting.radius_curve(said["radius"], ax),
    "radii": lambda said, ax: plotting.radius_curves(said["radii"], ax),
    "radius difference": lambda said, ax: plotting.radius_curve(said["radius"], ax, quantity="difference"),
    "radius slope": lambda said, ax: plotting.radius_curve(said["radius"], ax, quantity="slope", outcomes=["d1", "d2"]),
    "sensitivity": lambda said, ax: plotting.sensitivity(said["sensitivity"], ax=ax),
    "map": lambda said, ax: plotting.outcome_map(said["map"], ax),
    "map of time": lambda said, ax: plotting.outcome_map(said["map"], ax, quantity="time"),
    "shares": lambda said, ax: plotting.outcomes_by_input(said["result"], "attacker.position.x", ax),
}


def agg_figure(width=plotting.COLUMN, height=3.0):
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure, figure.add_subplot()


@pytest.mark.parametrize("name", DRAWN)
@pytest.mark.parametrize("width", [plotting.COLUMN, plotting.PAGE])
def test_a_figure_fits_the_axes_given(said, name, width):
    """Nothing printed is cut off at the edge, and tick labels, titles and legends keep apart."""
    figure, ax = agg_figure(width)
    with plotting.style():
        assert DRAWN[name](said, ax) is ax
        figure.draw_without_rendering()
        renderer = figure.canvas.get_renderer()
        sheet = figure.bbox.padded(1.0)
        for axis in (ax.xaxis, ax.yaxis):
            boxes = [label.get_window_extent(renderer) for label in axis.get_ticklabels() if label.get_text()]
            inside = [box for box in boxes if ax.bbox.padded(2.0).overlaps(box) or sheet.overlaps(box)]
            assert not any(a.overlaps(b) for a, b in combinations(inside, 2))
            label = axis.label.get_window_extent(renderer)
            assert axis.label.get_text() == "" or (
                sheet.x0 <= label.x0 and label.x1 <= sheet.x1 and label.y0 >= sheet.y0
            )
        legend = ax.get_legend()
        if legend is not None:
            box = legend.get_window_extent(renderer)
            assert sheet.x0 <= box.x0
            assert box.x1 <= sheet.x1
            assert box.y1 <= sheet.y1
        for text in ax.texts:
            box = mpl.text.Text.get_window_extent(text, renderer)
            assert sheet.x0 <= box.x0, text
            assert box.x1 <= sheet.x1, text


@pytest.mark.parametrize("name", DRAWN)
def test_new_axes_are_made_and_no_setting_changes(said, name):
    import matplotlib.pyplot as plt

    before = copy.deepcopy(dict(mpl.rcParams))
    figure = DRAWN[name](said, None).figure
    figure.draw_without_rendering()
    assert figure.get_size_inches()[0] == pytest.approx(plotting.COLUMN)
    assert dict(mpl.rcParams) == before
    plt.close(figure)


def grey(colour):
    """Lightness L* of a colour, 0 black to 100 white."""
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in mpl.colors.to_rgb(colour)]
    luminance = float(np.dot([0.2126, 0.7152, 0.0722], linear))
    return 116 * np.cbrt(luminance) - 16


def test_outcomes_differ_without_colour():
    names = ["timeout", "captured", "d1", "d2", "d3", "d4"]
    looks = [outcome_look(name) for name in names]
    for (a, one), (b, other) in combinations(zip(names, looks, strict=True), 2):
        apart = abs(grey(one.fill) - grey(other.fill))
        assert apart > 12 or one.hatch != other.hatch, f"{a} and {b} look the same in grey"
        assert one.marker != other.marker
        assert one.dashes != other.dashes
    assert outcome_look("d2").label == "by $d_{2}$"


def test_bars_are_as_long_as_the_probabilities(said):
    found = said["probabilities"]
    ax = plotting.outcome_probabilities(found, agg_figure()[1])
    assert [bar.get_width() for bar in ax.patches] == pytest.approx(found.estimate.tolist())
    assert [t.get_text() for t in ax.get_yticklabels()][:3] == ["timeout", "captured", "intercepted"]
    intervals = [line.get_xdata() for line in ax.lines[:6]]
    assert np.array_equal(intervals, np.column_stack([found.low, found.high]))


def test_the_stack_of_incidence_ends_in_the_share_that_ended(said):
    found = said["incidence"]
    ax = plotting.incidence(found, agg_figure()[1])
    tops = [line.get_ydata()[-1] for line in ax.lines[:4]]
    assert tops == pytest.approx(np.cumsum([found["d1"][-1], found["d2"][-1], found["d3"][-1], found["captured"][-1]]))
    assert tops[-1] == pytest.approx(1 - found["timeout"][-1])
    shown = [f"by $d_{{{i}}}$" for i in (1, 2, 3)] + ["captured", "95 % band of interception"]
    assert [t.get_text() for t in ax.get_legend().get_texts()] == shown
    bare = plotting.incidence(found, agg_figure()[1], bands=False)
    assert len(bare.lines) == 4


@pytest.mark.parametrize("styled", [False, True])
def test_a_legend_above_leaves_the_axes_their_width(styled):
    found = tadcore.outcome_map(tadcore.scenarios.load("paper-i1"), x=(-3, 3, 13), y=(-2, 4, 13))
    with plotting.style() if styled else contextlib.nullcontext():
        ax = found.plot()
        ax.figure.draw_without_rendering()
    legend, figure = ax.get_legend().get_window_extent(), ax.figure.bbox
    assert len(ax.get_legend().get_texts()) == 5
    assert legend.width <= figure.width
    assert ax.bbox.width > 0.6 * figure.width


def test_a_comparison_fills_what_is_sure(said):
    found = said["comparison"]
    ax = plotting.comparison(found, agg_figure()[1], names=("wide", "narrow"))
    marks = [line for line in ax.lines if len(line.get_xdata()) == 1]
    assert [mark.get_xdata()[0] for mark in marks] == pytest.approx(found.difference.tolist())
    sure = (found.low > 0) | (found.high < 0)
    assert [mark.get_markerfacecolor() != "white" for mark in marks] == sure.tolist()
    assert ax.get_xlabel() == "$P$(wide) − $P$(narrow)"


def test_radii_of_several_players_are_a_line_each(said):
    curves = said["radii"]
    ax = plotting.radius_curves(curves, agg_figure()[1], outcome="captured")
    drawn = [line for line in ax.lines if len(line.get_xdata()) == 6]
    assert [line.get_ydata().tolist() for line in drawn] == [each.estimate[1].tolist() for each in curves]
    with pytest.raises(ValueError, match="no outcome 'won'"):
        plotting.radius_curves(curves, outcome="won")


def test_a_radius_curve_shows_what_it_is_asked_for(said):
    curve = said["radius"]
    ax = plotting.radius_curve(curve, agg_figure()[1], outcomes=["intercepted"])
    assert np.array_equal(ax.lines[0].get_xydata(), np.column_stack([curve.radii, curve.estimate[2]]))
    assert ax.get_xlabel() == r"$\zeta_{d_{2}}$"
    slope = plotting.radius_curve(curve, agg_figure()[1], outcomes=["captured"], quantity="slope")
    middles = (curve.radii[1:] + curve.radii[:-1]) / 2
    assert np.array_equal(slope.lines[0].get_xydata(), np.column_stack([middles, curve.slope[1]]))
    with pytest.raises(ValueError, match="no quantity 'loss'"):
        plotting.radius_curve(curve, agg_figure()[1], quantity="loss")
    with pytest.raises(ValueError, match="no outcome 'd9'"):
        plotting.radius_curve(curve, agg_figure()[1], outcomes=["d9"])


def test_inputs_are_ordered_by_their_total(said):
    ax = plotting.sensitivity(said["sensitivity"], "time", agg_figure()[1])
    labels = [label.get_text() for label in ax.get_yticklabels()]
    assert labels == ["$x_{a}(0)$", r"$\sigma_{d_{1}}$", "u"]
    assert [t.get_text() for t in ax.get_legend().get_texts()] == ["first order", "total"]
    with pytest.raises(ValueError, match="never varied"):
        plotting.sensitivity(said["sensitivity"], "d1", agg_figure()[1])
    with pytest.raises(ValueError, match="no output 'd2'"):
        plotting.sensitivity(said["sensitivity"], "d2", agg_figure()[1])
    assert input_label("target.visibility_radius") == r"$\zeta_{\tau}$"
    assert input_label("wind.speed") == "wind.speed"


def test_a_map_is_coloured_by_its_outcomes(said):
    found = said["map"]
    ax = plotting.outcome_map(found, agg_figure()[1])
    picture = np.asarray(ax.images[0].get_array())
    for j, i in [(0, 0), (10, 12), (20, 3), (5, 24)]:
        kind, defender = int(found.dataset["kind"][j, i]), int(found.dataset["defender"][j, i])
        name = f"d{defender + 1}" if kind == 2 else ("timeout", "captured")[kind]
        assert picture[j, i] == pytest.approx(outcome_look(name).fill, abs=0.01)
    # each cell is centred on its place
    left, right, bottom, top = ax.images[0].get_extent()
    assert (left, right) == pytest.approx((-3.125, 3.125))
    assert (bottom, top) == pytest.approx((-3.15, 3.15))
    circles = sorted(p.get_radius() for p in ax.patches if isinstance(p, mpl.patches.Circle))
    assert circles == [0.1, 0.1, 0.1, 1.25, 1.25, 2.25, 2.25, 5.0, 5.0]
    bare = plotting.outcome_map(found, agg_figure()[1], radii=False, legend=False)
    assert not [p for p in bare.patches if isinstance(p, mpl.patches.Circle)]
    assert bare.get_legend() is None
    with pytest.raises(ValueError, match="no quantity"):
        plotting.outcome_map(found, agg_figure()[1], quantity="kind")


def test_a_map_of_one_line_is_drawn(sc):
    figure, ax = agg_figure()
    plotting.outcome_map(tadcore.outcome_map(sc, x=(-3, 3, 7), y=(1, 1, 1)), ax)
    figure.draw_without_rendering()
    assert ax.images[0].get_extent()[2:] == pytest.approx([0.5, 1.5])


def test_shares_are_those_of_the_trials_in_each_range(result):
    x = result.inputs["attacker.position.x"]
    ax = plotting.outcomes_by_input(result, "attacker.position.x", agg_figure()[1], ranges=3)
    edges = ax.lines[0].get_xdata()
    assert len(edges) == 4
    assert (edges[0], edges[-1]) == (x.min(), x.max())
    first = x < edges[1]
    assert 40 <= np.count_nonzero(first) <= 60
    assert ax.lines[0].get_ydata()[0] == np.mean(result.defender[first] == 0)
    assert ax.lines[-1].get_ydata() == pytest.approx(np.ones(4))
    with pytest.raises(ValueError, match="no two finite values"):
        plotting.outcomes_by_input(result, "defenders.0.capture_radius", agg_figure()[1])
    with pytest.raises(ValueError, match="no input"):
        plotting.outcomes_by_input(result, "attacker.position.z", agg_figure()[1])


def test_values_that_repeat_get_a_range_each(result):
    assert range_edges(np.array([2.0, 1.0, 1.0, 4.0]), 5).tolist() == [0.5, 1.5, 3.0, 5.0]
    rng = np.random.default_rng(0)
    for values in (rng.integers(0, 30, 100).astype(float), np.repeat([0.0, 1.0, 2.0, 3.0], [97, 1, 1, 1])):
        edges = range_edges(values, 3)
        assert (np.diff(edges) > 0).all()
        assert (np.histogram(values, edges)[0] > 0).all()
    ax = plotting.outcomes_by_input(result, "defenders.1.visibility_radius", agg_figure()[1])
    assert ax.lines[0].get_xdata().tolist() == [0.25, 0.75, 1.25]


def test_panels_share_one_legend(result):
    import matplotlib.pyplot as plt

    names = list(result.inputs)[:3]
    axes = plotting.outcomes_by_inputs(result, names)
    figure = axes.flat[0].figure
    assert figure.get_size_inches()[0] == pytest.approx(plotting.PAGE)
    assert len(figure.legends) == 1
    assert [ax.get_legend() for ax in axes.flat] == [None] * 3
    plt.close(figure)
    four = Figure().subplots(2, 2)
    assert plotting.outcomes_by_inputs(result, names, four) is four
    assert [ax.axison for ax in four.flat] == [True, True, True, False]
    with pytest.raises(ValueError, match="need as many axes"):
        plotting.outcomes_by_inputs(result, names, Figure().subplots(1, 2))


def test_shares_over_two_inputs_are_counts_of_cells(sc):
    result = Result(sc, 400)
    ax = plotting.outcomes_over(result, "attacker.position.x", "target.position.y", outcome="captured", cells=4)
    mesh = ax.collections[0]
    shown = np.ma.filled(mesh.get_array(), np.nan)
    x, y = result.inputs["attacker.position.x"], result.inputs["target.position.y"]
    edges = [np.linspace(values.min(), values.max(), 5) for values in (x, y)]
    filled = 0
    for row in range(4):
        for column in range(4):
            right = x <= edges[0][column + 1] if column == 3 else x < edges[0][column + 1]
            under = y <= edges[1][row + 1] if row == 3 else y < edges[1][row + 1]
            inside = (x >= edges[0][column]) & right & (y >= edges[1][row]) & under
            assert inside.sum() >= 5
            assert shown[row, column] == pytest.approx(np.mean(result.kind[inside] == 1))
            filled += inside.sum()
    assert filled == 400


def test_cells_of_few_trials_stay_empty(result):
    ax = plotting.outcomes_over(result, "attacker.position.x", "target.position.y", cells=12, least=3)
    shown = np.ma.filled(ax.collections[0].get_array(), np.nan)
    assert np.isnan(shown).any()
    assert np.isfinite(shown).any()


@pytest.mark.parametrize(
    ("x", "y", "outcome", "said"),
    [
        ("attacker.position.z", "target.position.y", "captured", "no input"),
        ("attacker.position.x", "defenders.0.capture_radius", "captured", "no two finite values"),
        ("attacker.position.x", "target.position.y", "d7", "no outcome"),
    ],
)
def test_shares_over_what_is_not_there_are_refused(result, x, y, outcome, said):
    with pytest.raises(ValueError, match=said):
        plotting.outcomes_over(result, x, y, outcome=outcome)
