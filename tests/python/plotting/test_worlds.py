"""Figures of games with failures, reports and disturbances: told apart from seen, failed sensors, which world it is."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.colors import to_rgba

import tadcore
from tadcore import plotting
from tadcore.plotting.motion.frames import Frame
from tadcore.plotting.motion.scene import Scene

pytestmark = pytest.mark.usefixtures("agg")

CHANGES = {
    "sensing": {"mean_time_to_failure": 0.3, "mean_time_to_repair": 0.2},
    "communication.radius": 2.0,
    "attacker.disturbance": 0.02,
}
WORDS = "failures, reports, disturbances, seed 7, trial 3"


@pytest.fixture(scope="module")
def run():
    run = tadcore.simulate(tadcore.scenarios.load("paper-i1").replace(CHANGES), seed=7, trial=3)
    assert run.relayed.any()
    assert run.sensor_outages
    return run


def words_of(figure):
    return " ".join(text.get_text() for text in figure.findobj(plt.Text))


@pytest.mark.parametrize("name", ["trajectories", "visibility", "network"])
def test_figures_say_which_world_it_is(run, runs, name):
    for drawn, there in ((run, True), (runs["paper-i1"], False)):
        axes = getattr(plotting, name)(drawn)
        figure = np.asarray(axes, dtype=object).flat[0].figure
        assert (WORDS in words_of(figure)) is there


def bars(ax, face):
    """Rectangles of all bars with a face of that colour (or any other), as (left, right, row)."""
    found = []
    for collection in ax.collections:
        if not hasattr(collection, "get_paths") or not len(collection.get_facecolor()):
            continue
        if (tuple(collection.get_facecolor()[0]) == to_rgba(face)) is True:
            for path in collection.get_paths():
                low, high = path.vertices.min(axis=0), path.vertices.max(axis=0)
                found.append((low[0], high[0], round((low[1] + high[1]) / 2, 6)))
    return found


def test_the_raster_draws_told_edges_hollow_and_failed_sensors_grey(run):
    ax = plotting.visibility(run)
    sc, attacker = run.scenario, run.scenario.n + 1
    rows = [(p, q) for p in sc.constrained for q in sc.players if q != p]
    expected = set()
    for i, j in np.argwhere(run.relayed[:-1].any(axis=0)):
        row = rows.index((sc.players[i], sc.players[attacker if i == j else j]))
        states = np.concatenate([[0], run.relayed[:-1, i, j].astype(int), [0]])
        first, last = np.flatnonzero(np.diff(states) > 0), np.flatnonzero(np.diff(states) < 0)
        expected |= {(run.times[a], run.times[b], row) for a, b in zip(first, last, strict=True)}
    assert {(a, b, int(row)) for a, b, row in bars(ax, "white")} == expected
    grey = bars(ax, "0.82")
    assert {(a, b) for a, b, _ in grey} == {(o.start, o.end) for o in run.sensor_outages}
    assert "hollow: told by others; grey: the sensor has failed" in words_of(ax.figure)
    plain = plotting.visibility(tadcore.simulate(tadcore.scenarios.load("paper-i1")))
    assert not bars(plain, "white")
    assert not bars(plain, "0.82")


def test_panels_draw_told_edges_dashed_and_failed_players_grey(run):
    axes = plotting.network(run, max_panels=40)
    for panel, interval in zip(axes.flat, run.intervals(), strict=False):
        k = int(np.searchsorted(run.times, interval.start))
        solid = sum(patch.get_linestyle() in ("-", "solid") for patch in panel.patches)
        told = int(run.relayed[k].sum())
        seen = int((run.adjacency[k] & ~run.relayed[k]).sum())
        assert solid == seen
        assert told + seen == len(interval.edges)
        grey = {t.get_text() for t in panel.texts if t.get_bbox_patch() and t.get_bbox_patch().get_facecolor()[0] < 0.9}
        failed = {f"$d_{{{i + 1}}}$" for i in np.flatnonzero(~run.course.sensor_up[k])}
        assert grey == failed


def test_an_animation_crosses_a_failed_sensor_out_and_hides_its_disc(run):
    scene = Scene(run, 7.2)
    outage = run.sensor_outages[0]
    p = run.scenario.constrained.index(outage.player)
    inside = int(np.searchsorted(run.times, outage.start)) + 1
    mover = scene._movers[p]
    scene.show(Frame(inside))
    assert mover["failure"].get_xydata().tolist() == [run.position[inside, p].tolist()]
    assert np.ptp(mover["sight"].get_xydata(), axis=0).max() == 0.0
    works = int(np.flatnonzero(run.course.sensor_up[:, p])[0])
    scene.show(Frame(works))
    assert mover["failure"].get_xydata().size == 0
    assert np.ptp(mover["sight"].get_xydata(), axis=0).max() > 1.0
    assert WORDS in words_of(scene.figure)
    assert scene._graph.get_title() == "who sees, or is told of, whom"
    attacker = scene._movers[-1]
    assert attacker["failure"].get_xydata().size == 0


def test_games_in_space_are_animated_too(run):
    space = run.scenario.replace(
        {f"{p}.position": [*x, 0.1] for p, x in zip(run.scenario.players, run.scenario.positions.tolist(), strict=True)}
    )
    played = tadcore.simulate(space, seed=7, trial=3)
    assert played.animate(seconds=0.2).figure().axes
    assert plotting.trajectories(played).has_data()
