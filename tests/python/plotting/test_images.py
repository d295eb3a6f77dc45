"""Pictures compared with stored ones: what no assertion on artists would notice.

Two releases of FreeType draw and measure letters differently, and such a difference is larger than a lost line. So
letters, and what is placed by their size, are left out of the pictures, and the words are compared as words. The last
test measures what the tolerance catches.

``make images`` makes the stored pictures and words again, and draws the same with letters into ``out/images``: look at
every one that changed before it is committed.
"""

import json
from pathlib import Path

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.testing.compare import calculate_rms
from matplotlib.text import Text
from matplotlib.transforms import IdentityTransform

import tadcore
from tadcore import plotting, statistics

TOLERANCE = 0.3
"""Root mean square difference in levels of 0 to 255 that still is the same picture."""
DPI = 100


@pytest.fixture(scope="module")
def shown(runs):
    """One of everything that is drawn, none of it drawn at random."""
    sc = tadcore.scenarios.load("paper-i1")
    data = sc.model_dump()
    for part, height in zip(
        (*data["defenders"], data["target"], data["attacker"]), (0, 0.5, -0.3, 0.2, 0.8), strict=True
    ):
        part["position"] = [*part["position"], height]
    rng = np.random.default_rng(12)
    starts = rng.uniform(-3, 3, (120, 5, 2))
    batch = tadcore.simulate_batch(sc, starts)
    return {
        "run": runs["paper-i1"],
        "full": runs["paper-i1-full"],
        "space": tadcore.simulate(tadcore.Scenario.model_validate(data)),
        "map": tadcore.outcome_map(sc, x=(-3, 3, 21), y=(-3, 3, 21)),
        "incidence": statistics.incidence(batch.kind, batch.defender, batch.time, horizon=6, step=0.005, n=3),
        "radius": tadcore.radius_curve(sc, starts[:30], player="d2", radii=np.linspace(0.2, 3, 8)),
    }


PICTURES = {
    "trajectories": lambda shown, ax: plotting.trajectories(shown["run"], ax),
    "trajectories-crowded": lambda shown, ax: plotting.trajectories(shown["full"], ax),
    "trajectories-space": lambda shown, ax: plotting.trajectories(shown["space"], ax),
    "network": lambda shown, axes: plotting.network(shown["run"], axes),
    "controls": lambda shown, ax: plotting.controls(shown["run"], ax=ax),
    "distances": lambda shown, ax: plotting.distances(shown["run"], ax=ax),
    "theta": lambda shown, ax: plotting.theta(shown["run"], ax=ax),
    "visibility": lambda shown, ax: plotting.visibility(shown["run"], ax=ax),
    "gains": lambda shown, axes: plotting.gains(shown["run"], axes),
    "compare": lambda shown, ax: plotting.compare(shown["run"], shown["full"], ax=ax),
    "compare-controls": lambda shown, ax: plotting.compare(shown["run"], shown["full"], what="controls", ax=ax),
    "outcome-map": lambda shown, ax: plotting.outcome_map(shown["map"], ax),
    "incidence": lambda shown, ax: plotting.incidence(shown["incidence"], ax),
    "radius-curve": lambda shown, ax: plotting.radius_curve(shown["radius"], ax),
}
PANELS = {"network": (2, 3), "gains": (3, 1)}


def draw(name, shown):
    """A picture one column wide, in the journal's style, with axes of a fixed size."""
    figure = Figure(figsize=(plotting.COLUMN, 2.6), dpi=DPI)
    FigureCanvasAgg(figure)
    with plotting.style():
        if name in PANELS:
            axes = figure.subplots(*PANELS[name], squeeze=False)
        else:
            axes = figure.add_subplot(projection="3d" if name == "trajectories-space" else None)
        figure.subplots_adjust(left=0.15, right=0.86, bottom=0.16, top=0.86, hspace=0.4)
        if name == "outcome-map":  # a cell is 10 dots: nothing is left to rounding
            axes.set_position((60 / 350, 30 / 260, 210 / 350, 210 / 260))
        PICTURES[name](shown, axes)
        figure.canvas.draw()  # ticks take their font when they are first drawn
    return figure


def words(figure):
    """Every word that is printed, in alphabetical order."""
    return sorted(text.get_text() for text in figure.findobj(Text) if text.get_visible() and text.get_text().strip())


def without_letters(figure):
    """Hide the letters and what their size moves: legends, leaders of labels, discs around names."""
    for artist in figure.findobj(lambda artist: isinstance(artist, Text | Legend)):
        artist.set_visible(False)
    for line in figure.findobj(Line2D):
        if isinstance(line.get_transform(), IdentityTransform):
            line.set_visible(False)
    return figure


@pytest.fixture(scope="module")
def drawn(shown):
    """Every picture, and its words while they can be seen."""
    figures = {name: draw(name, shown) for name in PICTURES}
    return {name: (figure, words(figure)) for name, figure in figures.items()}


@pytest.mark.mpl_image_compare(
    baseline_dir="baseline",
    style="default",
    tolerance=TOLERANCE,
    savefig_kwargs={"dpi": DPI, "metadata": {"Software": None}},
)
@pytest.mark.parametrize("name", PICTURES)
def test_a_picture_is_the_stored_one(drawn, name):
    return without_letters(drawn[name][0])


def test_words_are_the_stored_ones(shown, drawn, request):
    """With ``--mpl-generate-path``, as in ``make images``, they are stored instead, and pictures with letters drawn."""
    stored = Path(__file__).parent / "baseline" / "words.json"
    printed = {name: printed for name, (_, printed) in drawn.items()}
    if request.config.getoption("--mpl-generate-path") is None:
        assert printed == json.loads(stored.read_text(encoding="utf-8"))
        return
    stored.write_text(json.dumps(printed, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    for name in PICTURES:
        plotting.save(draw(name, shown), Path("out/images") / name, formats=["png"], dpi=200)
    pytest.skip("words stored; pictures with letters are in out/images")


@pytest.mark.parametrize("name", ["trajectories", "controls", "theta", "compare-controls"])
def test_a_lost_line_is_another_picture(shown, name):
    def levels():
        figure.canvas.draw()
        return np.asarray(figure.canvas.buffer_rgba())[..., :3].astype(np.int16)

    figure = without_letters(draw(name, shown))
    whole = levels()
    (ax,) = figure.axes
    for line in [line for line in ax.lines if line.get_visible()]:
        line.set_visible(False)
        assert calculate_rms(whole, levels()) > TOLERANCE, line
        line.set_visible(True)
    assert calculate_rms(whole, levels()) == 0
