"""The explorer: what a drag does on the server, and the page in a real browser where there is one."""

import base64
import contextlib
import math
import os
import re
import shutil
import socket
import subprocess
import sys
import urllib.request
from pathlib import Path

import numpy as np
import pytest

import tadcore

bokeh = pytest.importorskip("bokeh")

from bokeh.document import Document  # noqa: E402
from bokeh.models import PointDrawTool  # noqa: E402

from tadcore.cli.app import main  # noqa: E402
from tadcore.explorer import Desk, Explorer, Page  # noqa: E402
from tadcore.explorer.pointer import Pointer  # noqa: E402

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")


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


def start(*options):
    """Start ``tadcore explore`` as a user does."""
    code = f"from tadcore.cli import main; main({['explore', 'paper-i1', '--no-browser', *options]!r})"
    environment = {**os.environ, "PYTHONPATH": str(Path(tadcore.__file__).parents[1])}
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    return subprocess.Popen([sys.executable, "-c", code], env=environment, **pipes)


@pytest.fixture
def address():
    running = start()
    try:
        yield re.search(r"http://\S+/", running.stdout.readline())[0]
    finally:
        running.terminate()
        running.communicate(timeout=10)


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


def ask(port, *lines):
    """The answer to bare lines of HTTP: its first line, and all of it."""
    with socket.create_connection(("127.0.0.1", port), timeout=20) as connection:
        connection.sendall("\r\n".join([*lines, "Connection: close", "", ""]).encode())
        answer = b""
        with contextlib.suppress(TimeoutError):
            while part := connection.recv(65536):
                answer += part
                head, _, body = answer.partition(b"\r\n\r\n")
                length = re.search(rb"(?i)^content-length: (\d+)", head, re.MULTILINE)
                if b" 101 " in head or (length and len(body) >= int(length[1])):
                    break  # after a refused upgrade the server may leave the connection open
    return answer.split(b"\r\n")[0].decode(), answer.decode("utf-8", "replace")


def test_only_this_machine_is_answered(address):
    """Another site's name may lead here, and a program may say nothing of where it comes from."""
    port = int(address.rsplit(":", 1)[1].strip("/"))
    for host in (f"localhost:{port}", f"127.0.0.1:{port}", f"LOCALHOST:{port}"):
        first, page = ask(port, "GET / HTTP/1.1", f"Host: {host}")
        assert "200" in first
    token = re.search(r'"token":"([^"]+)"', page)[1]
    hosts = (
        "evil.example",
        f"evil.example:{port}",
        "localhost",
        f"localhost.evil.example:{port}",
        f"localhost:{port + 1}",
        "",
    )
    for host in hosts:
        for path in ("/", "/autoload.js?bokeh-autoload-element=1", "/ws", "/metadata", "/static/js/bokeh.min.js"):
            first, page = ask(port, f"GET {path} HTTP/1.1", f"Host: {host}")
            assert "403" in first or "400" in first, (host, path)
            assert "token" not in page
    first, page = ask(port, "GET / HTTP/1.1", f"Host: localhost:{port}", "Origin: http://evil.example")
    assert "403" in first
    assert "token" not in page
    upgrade = (
        "GET /ws HTTP/1.1",
        "Upgrade: websocket",
        "Connection: Upgrade",
        "Sec-WebSocket-Version: 13",
        "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==",
        f"Sec-WebSocket-Protocol: bokeh, {token}",
    )
    here = f"localhost:{port}"
    for lines, wanted in (
        ((f"Host: {here}", f"Origin: http://{here}"), "101"),
        ((f"Host: 127.0.0.1:{port}", f"Origin: http://127.0.0.1:{port}"), "101"),
        ((f"Host: {here}",), "403"),
        ((f"Host: {here}", "Origin: http://evil.example"), "403"),
        ((f"Host: {here}", "Origin: null"), "403"),
        ((f"Host: {here}", f"Origin: https://{here}"), "403"),
        ((f"Host: evil.example:{port}", f"Origin: http://evil.example:{port}"), "403"),
    ):
        assert wanted in ask(port, *upgrade, *lines)[0], lines


@pytest.fixture
def view(address):
    """The page in a real browser, in which no script may fail."""
    api = pytest.importorskip("playwright.sync_api")
    with api.sync_playwright() as play:
        browser = play.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        opened = browser.new_page(viewport={"width": 1340, "height": 900})
        trouble = []
        opened.on("pageerror", lambda error: trouble.append(str(error)))
        opened.goto(address)
        yield opened
        browser.close()
    assert trouble == []


@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium")
@pytest.mark.filterwarnings("ignore::ResourceWarning")
def test_in_a_real_browser(view, tmp_path):
    view.get_by_text("d1 intercepts the attacker at t = 1.395").wait_for(timeout=20_000)
    view.wait_for_function("Bokeh.documents.length > 0 && Bokeh.documents[0].is_idle")
    spot = """([x, y]) => {
        const plot = Bokeh.index.find_one(Bokeh.documents[0].get_model_by_name('arena'));
        const box = plot.el.getBoundingClientRect();
        return [box.x + plot.frame.x_scale.compute(x), box.y + plot.frame.y_scale.compute(y)];
    }"""
    x, y = view.evaluate(spot, [1.0, 1.5])
    to_x, to_y = view.evaluate(spot, [1.5, -0.5])
    view.mouse.move(x, y)
    view.mouse.down()
    view.mouse.move((x + to_x) / 2, (y + to_y) / 2, steps=5)
    view.mouse.move(to_x, to_y, steps=5)
    said = "Bokeh.documents[0].get_model_by_name('status').text"
    there = tadcore.scenarios.load("paper-i1").replace({"defenders[1].position": (1.5, -0.5)})
    expected = f"<b>{tadcore.simulate(there).outcome}</b>"
    view.wait_for_function(f"{said} === '{expected}'", timeout=20_000)
    during = view.evaluate(said)
    view.mouse.up()
    with view.expect_download() as caught:
        view.get_by_text("Scenario as TOML").click()
    caught.value.save_as(tmp_path / "mine.toml")
    moved = tadcore.Scenario.from_toml(tmp_path / "mine.toml")
    assert moved.defenders[1].position == pytest.approx((1.5, -0.5), abs=0.02)
    assert str(tadcore.simulate(moved).outcome) in during, "the outcome is there before the mouse is let go"
    assert "d1 intercepts the attacker at t = 1.395" not in during


def read(view, name, wanted):
    """Wait until a text is as wanted; of the last page, since the browser remembers those that were left."""
    text = f"[...Bokeh.documents[0]._all_models.values()].filter((model) => model.name == '{name}').at(-1).text"
    view.wait_for_function(f"new RegExp({wanted!r}).test({text})", timeout=30_000)


@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium")
@pytest.mark.filterwarnings("ignore::ResourceWarning")
def test_keys_maps_files_and_narrow_windows_in_a_real_browser(view, tmp_path):
    start = tadcore.scenarios.load("paper-i1")
    view.wait_for_function("window.Bokeh && Bokeh.documents.length > 0 && Bokeh.documents[0].is_idle")
    for key in ("ArrowRight", "ArrowRight", "Shift+ArrowDown"):
        view.keyboard.press(key)
    moved = tadcore.simulate(start.replace({"attacker.position": (-1.9, 1.5)})).outcome
    read(view, "status", f"^<b>{moved}</b>$")
    view.keyboard.press("n")
    view.keyboard.press("ArrowUp")
    moved = tadcore.simulate(start.replace({"attacker.position": (-1.9, 1.5), "d1.position": (0.0, 0.05)})).outcome
    read(view, "status", f"^<b>{moved}</b>$")
    time = "Bokeh.documents[0].get_model_by_name('play').active"
    view.keyboard.press(" ")
    view.wait_for_function(time)
    view.keyboard.press(" ")
    view.wait_for_function(f"!{time}")
    view.get_by_text("outcome map", exact=True).click()
    read(view, "map", r"^by the start of d1: .*by d\d$")
    view.keyboard.press(" ")  # what was clicked does not keep the space bar
    view.wait_for_function(time)
    view.keyboard.press(" ")
    chooser = view.locator("select").nth(1)
    chooser.click()
    chooser.select_option("d3")  # nor does a list keep the arrows
    view.keyboard.press("ArrowUp")
    moved = {"attacker.position": (-1.9, 1.5), "d1.position": (0.0, 0.05), "d3.position": (-1.0, 0.05)}
    read(view, "status", f"^<b>{tadcore.simulate(start.replace(moved)).outcome}</b>$")
    chooser.focus()
    view.keyboard.press("Home")  # but with the keyboard it does
    read(view, "map", r"^by the start of d1: ")
    view.get_by_text("certified map", exact=True).click()
    read(view, "map", r"proved: \d+\.\d % of the area so far$")
    view.get_by_text("certified map", exact=True).click()
    read(view, "map", r"^by the start of d1: .*by d\d$")
    mine = tmp_path / "mine.toml"
    given = start.replace({"horizon": 1.0})
    for text, said in (
        (given.to_toml(), f"^<b>{tadcore.simulate(given).outcome}</b>$"),
        (given.to_toml().replace("horizon = 1.0", "horizon = -1.0"), "horizon: got -1.0, must be"),
    ):
        mine.write_text(text, encoding="utf-8")
        view.locator("input[type=file]").set_input_files(mine)
        read(view, "status", said)
    view.set_viewport_size({"width": 420, "height": 900})
    view.wait_for_function("document.documentElement.scrollWidth <= 421")


def test_the_page_is_served_to_this_machine(address):
    with urllib.request.urlopen(address, timeout=20) as answer:
        assert answer.status == 200
        assert "<title>tadcore explorer</title>" in answer.read().decode()
    port = int(address.rstrip("/").rpartition(":")[2])
    with socket.socket() as elsewhere:  # another address of this machine: only 127.0.0.1 listens
        elsewhere.settimeout(2)
        assert elsewhere.connect_ex(("127.0.0.2", port)) != 0
    second = start("--port", str(port))
    said = second.communicate(timeout=60)[1]
    assert second.returncode == 2
    assert said.startswith("error: ")
    assert "in use" in said


def test_the_command_says_what_it_needs(monkeypatch, capsys):
    monkeypatch.setattr("tadcore.cli.explore.find_spec", lambda name: None)
    with pytest.raises(SystemExit) as left:
        main(["explore"])
    assert left.value.code == 2
    assert "pip install 'tadcore[explore]'" in capsys.readouterr().err
    with pytest.raises(SystemExit) as left:
        main(["explore", "--help"])
    assert left.value.code in (0, None)
    assert "tadcore explore my.toml" in capsys.readouterr().out
