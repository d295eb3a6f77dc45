"""`Recorded` says what figures and the analysis of a run take: a record with these members and no others will do."""

from types import SimpleNamespace

import matplotlib.pyplot as plt
import pytest
import xarray as xr

from tadcore import plotting
from tadcore.game import Recorded
from tadcore.game.chattering import chatter
from tadcore.game.externality import control_jumps

MEMBERS = [name for name in vars(Recorded) if not name.startswith("_")]


@pytest.fixture(scope="module")
def bare(runs):
    """The members that are declared, taken from a run."""
    return SimpleNamespace(**{name: getattr(runs["paper-i1"], name) for name in MEMBERS})


def test_a_run_is_examined_by_what_is_declared(runs, bare):
    assert chatter(bare) == runs["paper-i1"].chattering
    xr.testing.assert_identical(control_jumps(bare), control_jumps(runs["paper-i1"]))


@pytest.mark.parametrize("name", ["trajectories", "controls", "distances", "theta", "visibility", "externality"])
def test_a_figure_needs_no_more_than_what_is_declared(bare, agg, name):
    ax = getattr(plotting, name)(bare)
    assert ax.has_data()
    plt.close(ax.figure)


def test_panels_comparisons_and_animations_need_no_more(bare, agg):
    assert all(ax.patches for ax in plotting.network(bare).flat)
    assert all(ax.lines for ax in plotting.gains(bare).flat)
    assert plotting.compare(bare, bare).has_data()
    assert plotting.Animation(bare, seconds=0.1).figure().axes
    plt.close("all")
