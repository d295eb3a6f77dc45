"""The explorer: what the page shows, and what a drag, a slider or a button does."""

import base64
import math

import numpy as np
import pytest

import tadcore

bokeh = pytest.importorskip("bokeh")

from bokeh.document import Document  # noqa: E402
from bokeh.models import PointDrawTool  # noqa: E402

from tadcore.explorer import Desk, Explorer, Page  # noqa: E402
from tadcore.explorer.pointer import Pointer  # noqa: E402


@pytest.fixture
def page():
    return Page(Explorer(tadcore.scenarios.load("paper-i1")))


def paths_of(page):
    data = page.sources["paths"].data
    return {p: np.column_stack([x, y]) for p, x, y in zip(data["player"], data["x"], data["y"], strict=True)}


def test_a_page_shows_the_run_it_stands_for(page):
    run = tadcore.simulate(tadcore.scenarios.load("paper-i1"))
    assert page.status.text == f"<b>{run.outcome}</b>"
    for p, player in enumerate(run.scenario.players):
        path = paths_of(page)[player]
        np.testing.assert_array_equal(path[[0, -1]], run.position[[0, -1], p])
    seconds = {}
    bars = page.sources["bars"].data
    for edge, left, right in zip(bars["edge"], bars["left"], bars["right"], strict=True):
        seconds[edge] = seconds.get(edge, 0.0) + right - left
    assert seconds["d2 → a"] == pytest.approx(run.adjacency[:-1, 1, 1].sum() * 0.005)
    assert seconds["d3 → τ"] == pytest.approx(run.adjacency[:-1, 2, 3].sum() * 0.005)
    controls = page.sources["controls"].data
    assert controls["attacker"][0] == pytest.approx(np.linalg.norm(run.control[0, -1]))
    assert page.time.end == run.outcome.time


def test_dragging_a_start_plays_the_game_from_there(page):
    page.grab(1.02, 1.49)  # d2 stands at (1, 1.5)
    before = page.sources["starts"].data
    for x, y in ((1.2, 1.2), (1.5, 0.5), (1.75, -0.5)):
        page.drag(x, y)
        moved = tadcore.scenarios.load("paper-i1").replace({"defenders[1].position": (x, y)})
        coarse = tadcore.simulate(moved.replace({"step": 0.04}))
        assert page.status.text == f"<b>{coarse.outcome}</b> (a preview in steps of 0.04)"
        np.testing.assert_array_equal(paths_of(page)["d2"][-1], coarse.position[-1, 1])
        page.pause()
        expected = tadcore.simulate(moved)
        assert page.status.text == f"<b>{expected.outcome}</b>"
        np.testing.assert_array_equal(paths_of(page)["d2"][-1], expected.position[-1, 1])
    assert page.sources["starts"].data is before, "the browser moves what it drags"
    page.drop()
    starts = page.sources["starts"].data
    assert (starts["x"][1], starts["y"][1]) == (1.75, -0.5)


def test_dragging_the_rim_changes_the_radius(page):
    page.time.value = 0.0
    handles = page.sources["handles"].data
    i = handles["player"].index("d3")
    assert math.hypot(handles["x"][i] + 1.0, handles["y"][i]) == pytest.approx(1.25)
    page.grab(handles["x"][i], handles["y"][i])
    page.drag(-1.0, 2.5)
    page.drop()
    assert page.explorer.scenario.defenders[2].visibility_radius == 2.5
    assert page.radii.zeta["d3"][0].value == 2.5
    discs = page.sources["discs"].data
    assert discs["r"][discs["player"].index("d3")] == 2.5


def test_a_drag_that_holds_nothing_changes_nothing(page):
    before = page.explorer.run
    page.grab(-2.0, -1.5)
    page.drag(0.0, 0.0)
    assert page.explorer.run is before


def test_what_breaks_a_rule_is_said_and_the_game_stands(page):
    before = page.explorer.run
    assert page.change(lambda: page.explorer.see("d3", 0.05)) is False
    assert "visibility_radius: got 0.05, must be larger than the capture radius (0.1)" in page.status.text
    assert page.explorer.run is before
    assert page.change(lambda: page.explorer.capture("attacker", 0.2)) is True
    assert page.explorer.scenario.attacker.capture_radius == 0.2


def test_the_time_slider_moves_everyone(page):
    run = page.explorer.run
    page.time.value = 0.49
    k = round(0.49 / 0.005)
    now = page.sources["now"].data
    np.testing.assert_array_equal(np.column_stack([now["x"], now["y"]]), run.position[k])
    assert page.sources["sight"].data["player"].count("d2") == run.adjacency[k, 1].sum() == 4
    assert [mark.location for mark in page.feed.marks] == [run.times[k]] * 3


def test_switching_a_limit_off(page):
    slider, switch = page.radii.zeta["d2"]
    switch.active = True
    assert math.isinf(page.explorer.scenario.defenders[1].visibility_radius)
    assert slider.disabled
    assert "d2" not in page.sources["discs"].data["player"]
    switch.active = False
    assert page.explorer.scenario.defenders[1].visibility_radius == 2.25
    slider.value = 3.0
    assert page.explorer.scenario.defenders[1].visibility_radius == 3.0
    page.radii.sigma["d1"].value = 0.3
    assert page.explorer.scenario.capture_radii[0] == 0.3


def test_exports_are_what_is_on_the_page(page):
    def sent():
        (name,), (href,) = page.download.data["name"], page.download.data["href"]
        return name, base64.b64decode(href.partition("base64,")[2])

    page.explorer.move("target", 0.3, 0.7)
    page.save_toml()
    name, data = sent()
    assert name == "scenario.toml"
    assert tadcore.Scenario.from_toml_string(data.decode()) == page.explorer.scenario
    page.save_png()
    name, data = sent()
    assert (name, data[:8]) == ("trajectories.png", b"\x89PNG\r\n\x1a\n")


def test_a_document_holds_the_tool_that_drags(page):
    document = Document()
    desk = Desk(page.explorer)
    desk.add_to(document)
    page = desk.page
    (tool,) = document.select({"type": PointDrawTool})
    assert {renderer.data_source for renderer in tool.renderers} == {page.sources["starts"], page.sources["handles"]}
    assert document.title == "tadcore explorer"
    assert document.get_model_by_id(page.download.id) is page.download, "without it no file is ever sent"


@pytest.mark.parametrize("name", ["paper-i2", "paper-i1-full"])
def test_every_kind_of_game_has_a_page(name):
    desk = Desk(Explorer(tadcore.scenarios.load(name)))
    desk.add_to(Document())
    page = desk.page
    assert str(page.explorer.run.outcome) in page.status.text
    assert set(page.radii.zeta) == set(page.explorer.scenario.constrained)


def test_little_is_sent_for_a_drag(page):
    """The work behind one picture, counted: the run, and so many numbers to the browser."""
    page.grab(0.0, 0.0)
    page.drag(0.1, 0.1)
    numbers = sum(
        len(cell) if isinstance(cell, list) else 1
        for source in page.sources.values() for column in source.data.values() for cell in column
    )  # fmt: skip
    assert numbers < 10_000


def test_what_is_dropped_is_the_game_itself(page):
    page.grab(0.0, 0.0)
    page.drag(-0.7, 0.4)
    assert page.explorer.preview
    page.drop()
    expected = tadcore.simulate(tadcore.scenarios.load("paper-i1").replace({"defenders[0].position": (-0.7, 0.4)}))
    assert page.status.text == f"<b>{expected.outcome}</b>"
    np.testing.assert_array_equal(page.explorer.run.position, expected.position)


def test_a_preview_has_a_grid_of_its_own_where_there_is_one():
    prime = tadcore.scenarios.load("paper-i1").replace({"horizon": 0.505, "step": 0.005})  # 101 steps
    explorer = Explorer(prime)
    explorer.move("d1", 0.1, 0.1, preview=True)
    assert not explorer.preview, "the game itself was played"
    assert Explorer(prime.replace({"horizon": 0.55})).coarse_step == 0.025


def test_waiting_movements_become_one():
    asked, later = [], []

    class Clock:
        def add_timeout_callback(self, action, milliseconds):
            later.append(action)
            return action

        def remove_timeout_callback(self, action):
            later.remove(action)

    pointer = Pointer(lambda x, y: asked.append((x, y)), lambda: asked.append("rest"))
    pointer.document = Clock()
    for x in range(5):
        pointer.moved(float(x), 0.0)
    assert asked == []
    later.pop()()
    assert asked == [(4.0, 0.0)]
    pointer.moved(5.0, 0.0)  # before it rests
    assert len(later) == 1
    later.pop()()
    later.pop()()
    assert asked == [(4.0, 0.0), (5.0, 0.0), "rest"]


@pytest.fixture
def space():
    data = tadcore.scenarios.load("paper-i1").model_dump()
    for part, z in zip((*data["defenders"], data["target"], data["attacker"]), (0, 0.5, -0.3, 0.2, 0.8), strict=True):
        part["position"] = (*part["position"], z)
    return Page(Explorer(tadcore.Scenario.model_validate(data)))


def test_a_game_in_space_is_seen_along_each_axis(space):
    assert space.planes.labels == ["xy", "xz", "yz"]
    assert space.planes.visible
    run = space.explorer.run
    for i, axes in enumerate(([0, 1], [0, 2], [1, 2])):
        space.planes.active = i
        for p, player in enumerate(run.scenario.players):
            np.testing.assert_array_equal(paths_of(space)[player][-1], run.position[-1, p, axes])
        assert [space.arena.xaxis[0].axis_label, space.arena.yaxis[0].axis_label] == ["xyz"[axis] for axis in axes]
    space.grab(1.5, 0.5)  # d2 in the plane yz
    space.drag(1.25, -0.5)
    space.drop()
    assert space.explorer.scenario.defenders[1].position == (1.0, 1.25, -0.5), "x stays"
    centre = space.explorer.positions[2]
    space.explorer.stretch("d3", 2.0, 0.0)
    expected = math.hypot(2.0 - centre[1], 0.0 - centre[2])
    assert space.explorer.scenario.defenders[2].visibility_radius == pytest.approx(expected, abs=1e-4)
    assert space.explorer.png()[:4] == b"\x89PNG"


def test_one_component_of_the_controls_is_traced(page):
    page.traces.active = 2
    run = page.explorer.run
    assert page.traces.labels == ["speed", "x", "y"]
    assert page.sources["controls"].data["d3"][0] == run.control[0, 2, 1]
    assert not page.planes.visible


def test_no_such_player_or_plane():
    explorer = Explorer(tadcore.scenarios.load("paper-i1"))
    with pytest.raises(tadcore.ScenarioError, match="player: got 'd9'"):
        explorer.move("d9", 0.0, 0.0)
    with pytest.raises(tadcore.ScenarioError, match="plane: got 'xz', must be one of xy"):
        explorer.project("xz")


def test_a_refused_slider_goes_back_to_what_is_played(page):
    slider, switch = page.radii.zeta["d3"]
    own = slider.value
    slider.value = 0.1
    assert "visibility_radius: got 0.1, must be larger than the capture radius" in page.status.text
    assert slider.value == own == page.explorer.scenario.defenders[2].visibility_radius
    assert not switch.active
    capture = page.radii.sigma["d3"]
    own = capture.value
    capture.value = 0.6 if own != 0.6 else 0.59
    played = page.explorer.scenario.defenders[2]
    assert capture.value == played.capture_radius
    page.radii.sigma["d1"].value = 0.3
    assert page.explorer.scenario.defenders[0].capture_radius == 0.3, "and is of use again"
