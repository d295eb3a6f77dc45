"""Figures of runs: what they return, what they leave alone, and that nothing printed overlaps."""

import contextlib
import copy
from itertools import combinations

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d import Axes3D

import tadcore
from tadcore import plotting
from tadcore.plotting.tools.ends import spread
from tadcore.plotting.tools.style import edge_text, look
from tadcore.reproduce import figures as paper

pytestmark = pytest.mark.usefixtures("agg")


@pytest.fixture(scope="module")
def restless():
    """A run whose network flips at almost every instant for a while."""
    places = np.random.default_rng(3).uniform(-2, 2, (5, 2)).tolist()
    names = [*(f"defenders[{i}].position" for i in range(3)), "target.position", "attacker.position"]
    run = tadcore.simulate(tadcore.scenarios.load("paper-i1").replace(dict(zip(names, places, strict=True))))
    assert len(run.network_changes) > 2 * plotting.MAX_VERTICALS
    return run


@pytest.fixture(scope="module")
def spatial():
    plane = tadcore.scenarios.load("paper-i1").model_dump()
    heights = iter((0.0, 0.5, -0.3, 0.2, 0.8))
    for part in (*plane["defenders"], plane["target"], plane["attacker"]):
        part["position"] = [*part["position"], next(heights)]
    return tadcore.simulate(tadcore.Scenario.model_validate(plane))


def drawn(figure):
    figure.canvas.draw()
    return figure.canvas.get_renderer()


def agg_figure(width=plotting.COLUMN, height=3.0, **subplot):
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure, figure.add_subplot(**subplot)


ONE_AXES = {
    "trajectories": lambda run, ax: plotting.trajectories(run, ax),
    "controls": lambda run, ax: plotting.controls(run, "y", ax=ax),
    "distances": lambda run, ax: plotting.distances(run, ax=ax),
    "theta": lambda run, ax: plotting.theta(run, ax=ax),
}


@pytest.mark.parametrize("name", ONE_AXES)
@pytest.mark.parametrize("case", ["paper-i1", "paper-i1-full", "paper-i2"])
def test_a_figure_comes_back_in_the_axes_given(runs, name, case):
    figure, ax = agg_figure()
    assert ONE_AXES[name](runs[case], ax) is ax
    drawn(figure)


@pytest.mark.parametrize("name", ["trajectories", "controls", "distances", "theta", "network"])
def test_new_axes_are_made_and_no_setting_changes(runs, name):
    import matplotlib.pyplot as plt

    before = copy.deepcopy(dict(mpl.rcParams))
    axes = getattr(plotting, name)(runs["paper-i1"])
    figure = np.asarray(axes, dtype=object).ravel()[0].figure
    drawn(figure)
    assert figure.get_size_inches()[0] == pytest.approx(plotting.COLUMN)
    assert dict(mpl.rcParams) == before
    plt.close(figure)


def test_the_style_ends_with_its_block():
    before = copy.deepcopy(dict(mpl.rcParams))
    with plotting.style():
        assert mpl.rcParams["mathtext.fontset"] == "stix"
    assert dict(mpl.rcParams) == before


def test_what_a_backend_switches_on_in_the_block_stays_on():
    before = mpl.is_interactive()
    try:
        mpl.interactive(False)
        with plotting.style():
            mpl.interactive(True)  # as a notebook's does when the first figure loads it
        assert mpl.is_interactive()
    finally:
        mpl.interactive(before)


def test_network_fills_the_axes_given_and_switches_the_others_off(runs):
    figure = Figure()
    axes = figure.subplots(2, 4)
    assert plotting.network(runs["paper-i1"], axes) is axes
    assert [ax.axison for ax in axes.ravel()] == [True] * 6 + [False] * 2
    titles = [ax.get_title() for ax in axes.ravel()[:6]]
    assert titles[0] == r"$t\in[0,\,0.16)$"
    assert titles[-1] == r"$t\in[0.96,\,1.395]$"


def test_network_says_what_it_leaves_out(restless):
    axes = plotting.network(restless, max_panels=4)
    assert axes.size >= 4
    notes = [text.get_text() for ax in axes.ravel() for text in ax.texts if text.get_text().startswith("and ")]
    assert notes == [f"and {len(restless.network_changes) - 4} more"]
    axes.flat[0].figure.clear()


@pytest.mark.parametrize("styled", [False, True])
def test_network_titles_keep_apart(runs, styled):
    with plotting.style() if styled else contextlib.nullcontext():
        axes = plotting.network(runs["paper-i1"])
        figure = axes.flat[0].figure
        renderer = drawn(figure)
        boxes = [ax.title.get_window_extent(renderer) for ax in axes.ravel()]
    assert not any(a.overlaps(b) for a, b in combinations(boxes, 2))
    assert all(figure.bbox.x0 <= box.x0 and box.x1 <= figure.bbox.x1 for box in boxes)


def test_network_panels_carry_each_edge_once(runs):
    from matplotlib.patches import FancyArrowPatch

    axes = plotting.network(runs["paper-i1"])
    edges = np.cumsum([len(added) - len(removed) for _, added, removed in runs["paper-i1"].network_changes])
    arrows = [sum(isinstance(p, FancyArrowPatch) for p in ax.patches) for ax in axes.ravel()]
    assert arrows == edges.tolist()
    thick = [sum(isinstance(p, FancyArrowPatch) and p.get_linewidth() > 1.5 for p in ax.patches) for ax in axes.ravel()]
    assert thick == [0, 1, 1, 1, 1, 1]


def test_controls_mark_every_network_change(runs):
    ax = plotting.controls(runs["paper-i1"], ax=agg_figure()[1])
    verticals = sorted(line.get_xdata()[0] for line in ax.lines if len(line.get_xdata()) == 2)
    assert verticals == pytest.approx([0.16, 0.49, 0.575, 0.915, 0.96])
    assert plotting.controls(runs["paper-i1"], ax=agg_figure()[1], changes=False).lines[3:] == []


def test_controls_of_chosen_players(runs):
    ax = plotting.controls(runs["paper-i2"], "y", players=["target", "attacker"], ax=agg_figure()[1], changes=False)
    assert len(ax.lines) == 2
    assert len(plotting.controls(runs["paper-i2"], players="d2", ax=agg_figure()[1], changes=False).lines) == 1
    with pytest.raises(ValueError, match="players: got 'd9', must be one of d1, d2, d3"):
        plotting.controls(runs["paper-i2"], players=["d9"], ax=agg_figure()[1])
    with pytest.raises(ValueError, match="axis: got 'z', must be one of x, y"):
        plotting.controls(runs["paper-i2"], "z", ax=agg_figure()[1])
    with pytest.raises(ValueError, match="axis: got 'z', must be one of x, y"):
        plotting.compare(runs["paper-i2"], runs["paper-i2"], what="controls", axis="z", ax=agg_figure()[1])


def test_theta_of_a_game_seen_whole_is_zero_not_rounding(runs):
    ax = plotting.theta(runs["paper-i1-full"], ax=agg_figure()[1])
    assert ax.get_yscale() == "linear"
    assert np.all(ax.lines[0].get_ydata() == 0)
    assert "everyone sees everyone" in ax.texts[0].get_text()
    limited = plotting.theta(runs["paper-i1"], ax=agg_figure()[1])
    assert [t.get_text() for t in limited.texts] == [r"$\Theta=0$"]
    assert np.nanmin(limited.lines[0].get_ydata()) > 1e-6


@pytest.mark.parametrize("case", ["paper-i1", "paper-i2"])
@pytest.mark.parametrize("styled", [False, True])
def test_the_legend_of_theta_leaves_the_axes_their_width(runs, case, styled):
    with plotting.style() if styled else contextlib.nullcontext():
        ax = plotting.theta(runs[case])
        drawn(ax.figure)
    width, legend = ax.bbox.width, ax.get_legend().get_window_extent()
    assert ax.figure.bbox.x0 <= legend.x0
    assert legend.x1 <= ax.figure.bbox.x1
    ax.get_legend().remove()
    drawn(ax.figure)
    assert width > 0.9 * ax.bbox.width
    ax.figure.clear()


def test_a_restless_network_is_thinned_and_says_so(restless):
    figure, ax = agg_figure()
    plotting.controls(restless, ax=ax)
    assert any("ticks at the foot" in text.get_text() for text in ax.texts)
    assert_labels_apart(figure)
    figure, ax = agg_figure()
    plotting.trajectories(restless, ax)
    drawn(figure)
    arrows = [text for text in ax.texts if r"\to" in text.get_text() or "nrightarrow" in text.get_text()]
    assert 0 < len(arrows) <= plotting.MAX_EDGE_LABELS
    assert any(f"{len(restless.network_changes) - 1} network changes" in text.get_text() for text in ax.texts)
    assert_labels_apart(figure)


def test_a_game_in_space_is_drawn_in_space(spatial):
    figure, ax = agg_figure(projection="3d")
    assert plotting.trajectories(spatial, ax) is ax
    drawn(figure)
    made = plotting.trajectories(spatial)
    assert isinstance(made, Axes3D)
    made.figure.clear()
    with pytest.raises(ValueError, match="3 dimensions needs 3-D axes"):
        plotting.trajectories(spatial, agg_figure()[1])
    assert plotting.controls(spatial, "z", ax=agg_figure()[1]) is not None


def test_a_plane_game_is_refused_in_space(runs):
    with pytest.raises(ValueError, match="2 dimensions needs 2-D axes"):
        plotting.trajectories(runs["paper-i1"], agg_figure(projection="3d")[1])


def labels_of(ax, renderer):
    texts = [t for t in ax.texts if t.get_visible() and t.get_text()]
    return [(t.get_text(), mpl.text.Text.get_window_extent(t, renderer)) for t in texts]


def assert_labels_apart(figure):
    renderer = drawn(figure)
    sheet = figure.bbox
    for ax in figure.axes:
        boxes = labels_of(ax, renderer)
        title = ax.title.get_window_extent(renderer)
        if ax.title.get_text():
            boxes.append((ax.title.get_text(), title))
        if ax.get_legend() is not None:
            boxes.append(("legend", ax.get_legend().get_window_extent(renderer)))
        for (name, box), (other, against) in combinations(boxes, 2):
            assert not box.overlaps(against), f"{name} overlaps {other}"
        for name, box in boxes:
            within = sheet.x0 <= box.x0 and box.x1 <= sheet.x1 and sheet.y0 <= box.y0 and box.y1 <= sheet.y1
            assert within, f"{name} is cut off"


@pytest.mark.parametrize("name", paper.FIGURES)
@pytest.mark.parametrize("dpi", [100, 300])
def test_labels_of_the_paper_figures_do_not_overlap(runs, name, dpi):
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    with plotting.style():
        figure = paper.FIGURES[name](runs)
        figure.set_dpi(dpi)
        FigureCanvasAgg(figure)
        assert_labels_apart(figure)


@pytest.mark.parametrize("width", [plotting.COLUMN, plotting.PAGE])
@pytest.mark.parametrize("case", ["paper-i1", "paper-i1-suicidal", "paper-i2", "paper-i2-wide"])
def test_labels_stay_apart_at_both_widths(runs, case, width):
    figure, ax = agg_figure(width, 0.8 * width)
    plotting.trajectories(runs[case], ax)
    assert_labels_apart(figure)
    figure.set_size_inches(0.8 * width, 0.7 * width)
    assert_labels_apart(figure)


def test_labels_keep_off_markers(runs):
    figure, ax = agg_figure()
    plotting.trajectories(runs["paper-i1"], ax)
    renderer = drawn(figure)
    ends = runs["paper-i1"].dataset["position"].isel(time=[0, -1]).values.reshape(-1, 2)
    for name, box in labels_of(ax, renderer):
        inside = box.count_contains(ax.transData.transform(ends))
        assert inside == 0, f"{name} covers a marker"


def test_players_differ_in_more_than_colour():
    shown = [look(p) for p in ("d1", "d2", "d3", "d4", "d5", "target", "attacker")]
    for part in ("colour", "marker", "dashes"):
        assert len({str(getattr(it, part)) for it in shown}) == len(shown)
    assert look("d12").symbol == "$d_{12}$"
    assert edge_text("d2", ["attacker"]) == r"$d_{2}\to a$"
    assert edge_text("d3", ["d1", "target"], lost=True) == r"$d_{3}\nrightarrow d_{1},\,\tau$"


def test_spread_moves_as_little_as_it_must():
    heights = np.full(3, 2.0)
    assert spread(np.array([1.0, 5.0, 9.0]), heights, 0, 10) == pytest.approx([1, 5, 9])
    assert spread(np.array([5.0, 5.0, 9.0]), heights, 0, 10) == pytest.approx([4, 6, 9])
    assert spread(np.array([0.0, 0.0, 0.0]), heights, 0, 10) == pytest.approx([1, 3, 5])
    assert spread(np.array([10.0, 10.0]), heights[:2], 0, 10) == pytest.approx([7, 9])


def test_saved_files_are_whole_repeatable_and_embed_their_fonts(runs, tmp_path):
    def make(folder):
        with plotting.style():
            return plotting.save(paper.FIGURES["fig-i1-trajectories-limited"](runs), folder / "figure")

    first, second = make(tmp_path / "a"), make(tmp_path / "b")
    assert [f.name for f in first] == ["figure.png", "figure.pdf"]
    assert [f.read_bytes() for f in first] == [f.read_bytes() for f in second]
    assert sorted(f.name for f in (tmp_path / "a").iterdir()) == ["figure.pdf", "figure.png"]
    assert first[0].read_bytes().startswith(b"\x89PNG")
    pdf = first[1].read_bytes()
    assert b"/Type3" not in pdf
    assert b"/FontFile2" in pdf
    assert mpl.rcParams["pdf.fonttype"] == mpl.rcParamsDefault["pdf.fonttype"]
    width = int.from_bytes(first[0].read_bytes()[16:20], "big")
    assert width == pytest.approx(300 * plotting.COLUMN, abs=1)


def test_a_save_that_fails_leaves_nothing(tmp_path):
    figure = Figure()
    figure.add_subplot().set_title("$\\unknowncommand$")
    with pytest.raises(ValueError):
        plotting.save(figure, tmp_path / "bad")
    assert list(tmp_path.iterdir()) == []
