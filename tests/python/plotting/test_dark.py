"""On a dark ground every line, mark and letter stands out, and on a light one nothing changes."""

import contextlib

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.lines import Line2D
from matplotlib.text import Text

import tadcore
from tadcore import plotting
from tadcore.plotting.tools.ground import ink, paper
from tadcore.plotting.tools.style import look
from tadcore.sampling import Disk

pytestmark = pytest.mark.usefixtures("agg")


@pytest.fixture(scope="module")
def drawn():
    sc = tadcore.scenarios.load("paper-i1")
    run = tadcore.simulate(sc)
    study = tadcore.Study(sc, {"attacker.position": Disk([-2, 2], 1.0)}, trials=40, seed=7)
    curve = tadcore.radius_curve(study, player=["d1", "d2"], radii=[0.5, 1.0, 2.0])
    return {
        "trajectories": run.plot.trajectories,
        "distances": run.plot.distances,
        "network": lambda: np.ravel(run.plot.network(max_panels=3))[0],
        "theta": run.plot.theta,
        "gains": lambda: np.ravel(run.plot.gains())[0],
        "visibility": run.plot.visibility,
        "curve": lambda: plotting.radius_curve(curve["d1"]),
        "curves": lambda: plotting.radius_curves(curve),
    }


NAMES = ["trajectories", "distances", "network", "theta", "gains", "visibility", "curve", "curves"]


def luminance(colour):
    """Relative luminance as the Web Content Accessibility Guidelines define it."""
    c = np.array(to_rgb(colour))
    return float(np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4) @ [0.2126, 0.7152, 0.0722])


def contrast(a, b):
    low, high = sorted([luminance(a), luminance(b)])
    return (high + 0.05) / (low + 0.05)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("how", ["ours", "matplotlib"])
def test_lines_and_letters_stand_out(drawn, name, how):
    with plotting.style(dark=True) if how == "ours" else mpl.style.context("dark_background"):
        figure = drawn[name]().figure
        figure.draw_without_rendering()
        for ax in figure.axes:
            ground = ax.get_facecolor()
            for line in ax.findobj(Line2D):
                if line.get_visible() and len(line.get_xdata()) and line.get_linestyle() != "None":
                    assert contrast(line.get_color(), ground) > 1.8, (line, line.get_color())
            for text in ax.findobj(Text):
                if text.get_text().strip():
                    box = text.get_bbox_patch()
                    behind = ground if box is None else box.get_facecolor()
                    assert contrast(text.get_color(), behind) > 2.5, text


def test_a_light_ground_is_as_it_was():
    for style in (contextlib.nullcontext(), plotting.style()):
        with style:
            assert (ink(), ink(0.35), paper(), look("target").colour) == ("#000000", "0.35", "white", "#000000")
    with plotting.style(dark=True):
        assert (ink(), ink(0.35), look("target").colour) == ("#ffffff", "0.65", "#ffffff")
        assert luminance(paper()) < 0.02


def test_dark_is_a_flag():
    with (
        pytest.raises(tadcore.ScenarioError, match="dark: got 'yes', must be True or False"),
        plotting.style(dark="yes"),
    ):
        pass
