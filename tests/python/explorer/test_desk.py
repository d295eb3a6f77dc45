"""The explorer's choice of scenarios, its keys, its sliders of weights and its play button."""

import base64
import math

import numpy as np
import pytest

import tadcore

pytest.importorskip("bokeh")

from bokeh.document import Document

from tadcore.explorer import Desk, Explorer, Page

COARSE = {"step": 0.04}


@pytest.fixture
def desk():
    made = Desk(Explorer(tadcore.scenarios.load("paper-i1")))
    made.add_to(Document())
    return made


def shows(page, sc):
    """Whether the page shows the game of a scenario."""
    expected = tadcore.simulate(sc)
    assert page.explorer.scenario == sc
    assert page.status.text == f"<b>{expected.outcome}</b>"
    np.testing.assert_array_equal(page.explorer.run.position, expected.position)
    return expected


def send(desk, name, data):
    desk.read(name, base64.b64encode(data).decode())


def test_bundled_scenarios_are_chosen(desk):
    assert desk.names.value == "paper-i1"
    assert [name for name, _ in desk.names.options] == list(tadcore.scenarios.names())
    first = desk.page
    desk.names.value = "paper-i2-wide"
    assert desk.page is not first
    shows(desk.page, tadcore.scenarios.load("paper-i2-wide"))
    names = {model.name for model in desk.document.models if model.name}
    assert {"arena", "status", "scenario", "keys"} <= names
    assert len(list(desk.document.select({"name": "arena"}))) == 1, "the old page is gone"
    first.playback.tick()  # a clock that ticks once more
    first.pause()


def test_a_file_is_shown_or_refused_in_words(desk):
    mine = tadcore.scenarios.load("paper-i1").replace({"defenders": [{"position": (0.5, 0.5), "control_weight": 1.0,
                                                                      "capture_radius": 0.1}]})  # fmt: skip
    send(desk, "mine.toml", mine.to_toml().encode())
    shows(desk.page, mine)
    assert (desk.names.value, desk.names.options[0]) == ("(as given)", ("(as given)", "mine.toml"))
    there = desk.page
    for data, words in (
        (mine.to_toml().replace("control_weight = 1.0", "control_weight = -1.0").encode(), "positive"),
        (b"interaction = ", "bad.toml"),
        (b"\xff\xfe", "a text in UTF-8"),
        (b"#" * 1_000_001, "at most 1,000,000 bytes"),
        (
            tadcore.scenarios.load("paper-i2").replace({"attacker.control_weight": 5.0}).to_toml().encode(),
            "no feedback Nash equilibrium",
        ),
    ):
        send(desk, "bad.toml", data)
        assert words in desk.page.status.text
        assert desk.page is there
    desk.names.value = "paper-i1-full"
    shows(desk.page, tadcore.scenarios.load("paper-i1-full"))
    desk.names.value = "(as given)"
    shows(desk.page, mine)


def test_a_scenario_of_ones_own_can_be_returned_to():
    own = tadcore.scenarios.load("paper-i1").replace({"attacker.position": (-1.5, 2.0)})
    desk = Desk(Explorer(own))
    assert desk.names.value == "(as given)"
    desk.names.value = "paper-i1"
    desk.names.value = "(as given)"
    shows(desk.page, own)


def press(desk, key, shift=False):
    desk.keys.source.data = {"key": [key], "shift": [shift], "n": [0]}


def test_arrows_move_the_chosen_player(desk):
    page = desk.page
    assert page.sources["chosen"].data == {"x": [-2.0], "y": [2.0]}
    for key, shift in (("ArrowRight", False), ("ArrowUp", False), ("ArrowDown", True), ("ArrowLeft", True)):
        press(desk, key, shift)
    assert page.explorer.preview
    page.pause()
    there = tadcore.scenarios.load("paper-i1").replace({"attacker.position": (-2.45, 1.55)})
    shows(page, there)
    assert page.sources["chosen"].data == {"x": [-2.45], "y": [1.55]}
    press(desk, "n")
    assert (page.chosen.value, page.explorer.chosen) == ("d1", "d1")
    page.chosen.value = "d3"
    press(desk, "ArrowUp")
    page.pause()
    shows(page, there.replace({"d3.position": (-1.0, 0.05)}))
    press(desk, "q")  # means nothing
    page._tap(1.0, 1.5)
    assert page.explorer.chosen == "d2"
    page.drag(0.0, 0.0)  # a tap holds nothing
    assert page.explorer.scenario.defenders[1].position == (1.0, 1.5)


def test_the_run_is_played(desk):
    page = desk.page
    end = page.explorer.run.outcome.time
    assert page.explorer.time == end
    press(desk, " ")
    assert page.playback.button.active
    assert page.explorer.time == 0.0, "from the beginning, if it stands at the end"
    page._forward(0.5)
    assert page.explorer.time == page.time.value == end / 2
    now = page.sources["now"].data
    np.testing.assert_array_equal(np.column_stack([now["x"], now["y"]]), page.explorer.run.position[page.explorer.k])
    press(desk, " ")
    assert not page.playback.button.active
    press(desk, " ")
    assert page.explorer.time == end / 2, "it goes on from where it was"
    page.playback._last -= 60.0  # seconds
    page.playback.tick()
    assert page.explorer.time == end
    assert not page.playback.button.active


def test_weights_are_those_of_the_chosen_player():
    page = Page(Explorer(tadcore.scenarios.load("paper-i1").replace(COARSE)))
    sc = page.explorer.scenario
    assert set(page.weights.fields) == {
        f"attacker.{name}" for name in ("control_weight", "target_running_weight", "target_terminal_weight", "evasion")
    }
    page.weights.fields["attacker.evasion"].value = 0.0
    sc = sc.replace({"attacker.evasion": 0.0})
    shows(page, sc)
    page.chosen.value = "d2"
    assert len(page.weights.fields) == 5
    page.weights.fields["d2.evasion_running_weight"].value = 2.5
    sc = sc.replace({"d2.evasion_running_weight": 2.5})
    shows(page, sc)
    page.weights.horizon.value = 3.1999999  # of a slider
    sc = sc.replace({"horizon": 3.2})
    assert math.isclose(page.explorer.scenario.horizon, 3.2)
    page.weights.gamma[3].value = 1.0
    shows(page, sc.replace({"synthesis_weights": (0.25, 0.25, 0.25, 1.0)}))
    page.chosen.value = "attacker"
    assert page.weights.fields["attacker.evasion"].value == 0.0


def test_a_weight_that_is_refused_goes_back():
    page = Page(Explorer(tadcore.scenarios.load("paper-i2").replace(COARSE)))
    before = page.explorer.scenario
    assert "attacker.evasion" not in page.weights.fields
    page.weights.fields["attacker.control_weight"].value = 5.0
    assert "no feedback Nash equilibrium on [0, 6]" in page.status.text
    assert page.explorer.scenario == before
    assert page.weights.fields["attacker.control_weight"].value == before.attacker.control_weight
    for slider in page.weights.gamma:
        slider.value = 0.0
    assert "positive in at least one entry" in page.status.text
    assert page.weights.gamma[-1].value == page.explorer.scenario.synthesis_weights[-1] > 0.0


def test_histories_have_a_legend(desk):
    legend = desk.page.plots[2].legend[0]
    assert [item.label.value for item in legend.items] == ["d1", "d2", "d3", "τ", "a"]
    dashes = [tuple(item.renderers[0].glyph.line_dash) for item in legend.items]
    assert len(set(dashes)) == 5, "not by colour alone"
