"""The explorer as it is served: to this machine alone, in a real browser, and by the command."""

import contextlib
import os
import re
import shutil
import socket
import subprocess
import sys
import urllib.request
from pathlib import Path

import pytest

import tadcore
from tadcore.cli.app import main

pytest.importorskip("bokeh")

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")


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
