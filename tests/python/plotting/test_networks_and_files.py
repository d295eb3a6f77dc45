"""Figures of the network and the gains, two runs overlaid, the magnified end, and what a file holds."""

import inspect
import shutil
import subprocess

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import same_color
from matplotlib.figure import Figure

import tadcore
from tadcore import plotting
from tadcore.plotting.tools.style import look

pytestmark = pytest.mark.usefixtures("agg")


@pytest.fixture(scope="module")
def wide():
    """Six defenders: 42 edges are possible, most of them never form."""
    data = tadcore.scenarios.load("paper-i1").model_dump()
    one = data["defenders"][0]
    data |= {"horizon": 1.0, "step": 0.01}
    data["defenders"] = [{**one, "position": (3.0 * i, -3.0), "visibility_radius": 3.1 if i else 5.0} for i in range(6)]
    return tadcore.simulate(tadcore.Scenario.model_validate(data))


def sheet(width=plotting.COLUMN, height=3.0):
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def test_every_figure_is_a_method_of_the_run(runs):
    import matplotlib.pyplot as plt

    names = ("trajectories", "network", "controls", "distances", "visibility", "gains", "theta")
    plots = runs["paper-i2"].plot
    assert all(f"{name}()" in repr(plots) for name in names)
    for name in names:
        method, function = (inspect.signature(getattr(home, name)) for home in (plots, plotting))
        given = list(function.parameters.values())[1:]
        assert [(p.name, p.kind, p.default) for p in method.parameters.values()] == [
            (p.name, p.kind, p.default) for p in given
        ]
        axes = getattr(plots, name)()
        assert np.asarray(axes, dtype=object).ravel()[0].figure is not None
    plt.close("all")


def test_a_game_over_at_once_still_has_figures():
    import matplotlib.pyplot as plt

    run = tadcore.simulate(tadcore.scenarios.load("paper-i1").replace({"attacker.position": (0.05, 0.0)}))
    assert run.outcome.time == 0
    for name in ("trajectories", "network", "controls", "distances", "visibility", "gains", "theta"):
        panels = np.asarray(getattr(run.plot, name)(), dtype=object).ravel()
        panels[0].figure.canvas.draw()
    (panel,) = run.plot.network().ravel()
    assert [text.get_text() for text in panel.texts] == ["over at $t=0$"]
    assert len(run.animate(seconds=0.5, fps=4).figure().axes) == 2
    plt.close("all")


@pytest.mark.parametrize("name", ["paper-i1", "paper-i2-wide"])
def test_bars_last_as_long_as_their_edge(runs, name):
    run = runs[name]
    ax = sheet().add_subplot()
    assert plotting.visibility(run, ax=ax) is ax
    seen = run.adjacency[:-1].sum(axis=0) * run.scenario.step
    players = run.scenario.players
    rows = iter(ax.collections)
    for i, observer in enumerate(run.scenario.constrained):
        for j, other in enumerate(players):
            if other == observer:
                continue
            bars = next(rows)
            long = sum(path.vertices[:, 0].max() - path.vertices[:, 0].min() for path in bars.get_paths())
            column = i if other == "attacker" else j
            assert long == pytest.approx(seen[i, column], abs=1e-9), (observer, other)
            if long:
                assert same_color(bars.get_facecolor()[0], look(observer).colour)
    assert [label.get_text() for label in ax.get_yticklabels()][:2] == [r"$d_{1}\to d_{2}$", r"$d_{1}\to d_{3}$"]


def test_a_large_network_shows_the_edges_that_form(wide):
    ax = plotting.visibility(wide, ax=sheet(height=1.2).add_subplot())
    ever = wide.adjacency[:-1].any(axis=0).sum()
    assert 1 < ever < 42
    assert len(ax.collections) >= ever
    labels = [label.get_text() for label in ax.get_yticklabels()]
    assert all("to" not in label for label in labels), "too low for a name per row"
    assert any(f"{42 - ever} edges never form" in text.get_text() for text in ax.texts)
    ax.figure.canvas.draw()


@pytest.mark.parametrize("name", ["paper-i1", "paper-i2"])
def test_gain_curves_give_the_controls(runs, name):
    run = runs[name]
    figure = sheet(height=4.0)
    m = len(run.scenario.constrained)
    axes = figure.subplots(m + 1, 1)
    assert plotting.gains(run, axes, changes=False) is axes
    assert [ax.axison for ax in axes] == [True] * m + [False]
    z = run.position[:, :-1] - run.position[:, -1:]
    for i, ax in enumerate(axes[:m]):
        rows = np.column_stack([line.get_ydata() for line in ax.lines[: z.shape[1]]])
        np.testing.assert_allclose(np.einsum("tj,tjx->tx", rows, z), run.control[:, i], atol=1e-10)
        assert [line.get_color() for line in ax.lines[: z.shape[1]]] == [
            look(p).colour for p in run.scenario.players[:-1]
        ]
    figure.canvas.draw()


@pytest.mark.parametrize("what", ["trajectories", "controls", "distances"])
def test_full_observation_is_dashed_whichever_comes_first(runs, what):
    limited, full = runs["paper-i1"], runs["paper-i1-full"]
    drawn = []
    for pair in ((limited, full), (full, limited)):
        ax = plotting.compare(*pair, what=what, ax=sheet().add_subplot())
        ax.figure.canvas.draw()
        assert [text.get_text() for text in ax.get_legend().get_texts()] == ["limited observations", "full observation"]
        lengths = {line.get_linestyle(): len(line.get_xdata()) for line in ax.lines if len(line.get_xdata()) > 50}
        drawn.append(lengths)
        assert lengths == {"-": len(limited.times), "--": len(full.times)}
    assert drawn[0] == drawn[1]


def test_runs_that_see_alike_are_named_by_their_ends(runs):
    ax = plotting.compare(runs["paper-i2"], runs["paper-i2-far"], ax=sheet().add_subplot())
    names = [text.get_text() for text in ax.get_legend().get_texts()]
    assert names == ["$d_{1}$ intercepts $a$ at $t=3.54$", r"$a$ captures $\tau$ at $t=3.925$"]
    legend, page = ax.get_legend(), ax.figure.bbox
    ax.figure.canvas.draw()
    assert page.x0 <= legend.get_window_extent().x0 < legend.get_window_extent().x1 <= page.x1
    ax = plotting.compare(runs["paper-i2"], runs["paper-i2-far"], names=("near", "far"), ax=sheet().add_subplot())
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["near", "far"]


def test_what_cannot_be_compared_is_refused(runs, wide):
    with pytest.raises(ValueError, match="one of the same players: d1, d2, d3, target, attacker"):
        plotting.compare(runs["paper-i1"], wide)
    with pytest.raises(ValueError, match="what: got 'paths', must be"):
        plotting.compare(runs["paper-i1"], runs["paper-i1-full"], what="paths")


def test_a_crowded_end_is_magnified_where_nothing_is_drawn(runs):
    run = runs["paper-i1-full"]
    with plotting.style():
        ax = plotting.trajectories(run, sheet().add_subplot())
        ax.figure.canvas.draw()
    (inset,) = ax.child_axes
    box = inset.get_window_extent()
    assert box.count_contains(ax.transData.transform(run.position.reshape(-1, 2))) == 0
    low, high = np.array([inset.get_xlim(), inset.get_ylim()]).T
    caught = run.position[-1, [-2, -1]]  # the captured target and the attacker
    assert ((caught > low) & (caught < high)).all()
    scale = box.width / (high[0] - low[0]) / (ax.bbox.width / np.ptp(ax.get_xlim()))
    assert scale > 1.4
    assert ax.get_window_extent().contains(*box.min)
    assert ax.get_window_extent().contains(*box.max)


def test_an_open_end_is_not(runs):
    assert plotting.trajectories(runs["paper-i1"], sheet().add_subplot()).child_axes == []
    assert plotting.trajectories(runs["paper-i1-full"], sheet().add_subplot(), zoom=False).child_axes == []


def test_a_start_under_an_edge_mark_shows_around_it(runs):
    def hollow(ax):
        white = [line for line in ax.lines if line.get_markerfacecolor() == "white"]
        return {line.get_marker(): line.get_markersize() for line in white}

    run = runs["paper-i2-wide"]  # d3 sees the attacker almost where it started
    marked = hollow(plotting.trajectories(run, sheet().add_subplot()))
    bare = hollow(plotting.trajectories(run, sheet().add_subplot(), edge_markers=False))
    larger = {marker for marker in marked if marked[marker] > 1.5 * bare[marker]}
    assert larger == {look("d3").marker}


def test_without_latex_a_pgf_says_what_it_needs(tmp_path, monkeypatch):
    monkeypatch.setattr(shutil, "which", lambda name: None)
    with pytest.raises(RuntimeError, match="PGF figure needs LaTeX"):
        plotting.save(Figure(), tmp_path / "figure", formats=("png", "pgf"))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(shutil.which("xelatex") is None, reason="no LaTeX to compile with")
def test_a_pgf_compiles(runs, tmp_path):
    ax = plotting.trajectories(runs["paper-i2-wide"], sheet(plotting.PAGE, 4.0).add_subplot())
    (file,) = plotting.save(ax.figure, tmp_path / "figure", formats=["pgf"])
    text = file.read_text(encoding="utf-8")
    assert r"\nrightarrow" in text
    document = (
        r"\documentclass{article}\usepackage{pgf,amssymb}\def\mathdefault#1{#1}"
        r"\begin{document}\input{figure.pgf}\end{document}"
    )
    (tmp_path / "page.tex").write_text(document, encoding="utf-8")
    command = ["xelatex", "-interaction=batchmode", "-halt-on-error", "page.tex"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, (tmp_path / "page.log").read_text(encoding="utf-8", errors="replace")[-2000:]


def test_an_svg_keeps_its_size_and_repeats(runs, tmp_path):
    def make(stem):
        ax = plotting.visibility(runs["paper-i1"], ax=sheet(height=2.0).add_subplot())
        return plotting.save(ax.figure, tmp_path / stem, formats=["svg"])[0].read_text(encoding="utf-8")

    first, second = make("a"), make("b")
    assert first == second
    assert f'width="{72 * plotting.COLUMN:.0f}pt" height="144pt"' in first
