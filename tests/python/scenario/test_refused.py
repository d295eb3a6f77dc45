"""Everything that cannot be accepted, and the words it is answered with."""

import json
import math
import pickle

import numpy as np
import pytest
import tomli_w
from pydantic import BaseModel, ValidationError

from tadcore import Attacker, Defender, Scenario, ScenarioError

GOOD_I1 = """\
interaction = "I1"
horizon = 6.0

[attacker]
position = [-2.0, 2.0]
control_weight = 0.8
capture_radius = 0.1

[target]
position = [0.0, 1.0]
control_weight = 1.2

[[defenders]]
position = [0.0, 0.0]
control_weight = 1.0
capture_radius = 0.1

[[defenders]]
position = [1.0, 1.5]
control_weight = 1.0
capture_radius = 0.1
visibility_radius = 2.25
"""
GOOD_I2 = GOOD_I1.replace('"I1"', '"I2"')


def top(line):
    return GOOD_I1.replace("horizon = 6.0", f"horizon = 6.0\n{line}")


def swap(old, new, text=GOOD_I1, count=1):
    assert old in text
    return text.replace(old, new, count)


def last(line):
    return GOOD_I1 + line + "\n"


D = "[[defenders]]\nposition = [0.0, 0.0]\ncontrol_weight = 1.0\ncapture_radius = 0.1\n"

# (what the file says, the field that is named, words of the message)
HOSTILE = {
    "empty": ("", "interaction", ["got nothing", "must be given"]),
    "only a comment": ("# nothing here\n", "interaction", ["got nothing"]),
    "not toml": ("horizon = = 6\n", "my.toml, line 1", ["'horizon = = 6'", "valid TOML"]),
    "cut off": (GOOD_I1 + "[[defenders", "my.toml, at the end", ["valid TOML"]),
    "twice": (top("horizon = 5.0"), "my.toml, line 3", ["valid TOML", "overwrite"]),
    "json": ('{"interaction": "I1"}', "my.toml, line 1", ["valid TOML"]),
    "huge integer": (swap("6.0", "1" * 5000), "my.toml", ["valid TOML", "too many digits"]),
    "deep nesting": ("a = " + "[" * 50_000, "my.toml", ["valid TOML", "nested too deeply"]),
    "unknown field": (top("colour = 3"), "colour", ["got 3", "left out", "no such field"]),
    "misspelt field": (top("synthesis_weight = [1, 0, 0, 0]"), "synthesis_weight", ["did you mean synthesis_weights?"]),
    "unknown in a part": (last("zeta = 3"), "defenders[1].zeta", ["left out", "the fields are position, "]),
    "misspelt in a part": (swap("[0.0, 1.0]", "[0.0, 1.0]\npositon = [1, 1]"), "target.positon", ["mean position?"]),
    "no interaction": (swap('interaction = "I1"', ""), "interaction", ["got nothing", "must be given"]),
    "lower case": (swap('"I1"', '"i1"'), "interaction", ["got 'i1'", '"I1" or "I2"']),
    "third interaction": (swap('"I1"', '"I3"'), "interaction", ['"I1" or "I2"']),
    "interaction a number": (swap('"I1"', "1"), "interaction", ["got 1", '"I1" or "I2"']),
    "no horizon": (swap("horizon = 6.0", ""), "horizon", ["got nothing", "T, the duration"]),
    "horizon a string": (swap("6.0", '"6.0"'), "horizon", ["got '6.0'", "a positive finite number"]),
    "horizon a bool": (swap("6.0", "true"), "horizon", ["got True", "a positive finite number"]),
    "horizon a date": (swap("6.0", "2024-01-01"), "horizon", ["a positive finite number"]),
    "horizon a list": (swap("6.0", "[6.0]"), "horizon", ["got [6.0]"]),
    "horizon zero": (swap("6.0", "0.0"), "horizon", ["got 0.0"]),
    "horizon negative": (swap("6.0", "-6.0"), "horizon", ["got -6.0"]),
    "horizon infinite": (swap("6.0", "inf"), "horizon", ["got inf", "finite"]),
    "horizon nan": (swap("6.0", "nan"), "horizon", ["got nan"]),
    "horizon past a float": (swap("6.0", "1" + "0" * 400), "horizon", ["a positive finite number"]),
    "step zero": (top("step = 0"), "step", ["got 0", "a positive finite number"]),
    "step does not divide": (top("step = 0.007"), "step", ["got 0.007", "a divisor of the horizon (6.0)"]),
    "step past the horizon": (top("step = 7.0"), "step", ["got 7.0", "a divisor of the horizon"]),
    "step far too fine": (top("step = 1e-7"), "step", ["at least the horizon (6.0) over 10,000,000"]),
    "step subnormal": (top("step = 5e-324"), "step", ["at least the horizon"]),
    "no attacker": (swap("[attacker]", "[spare]"), "attacker", ["got nothing", "the [attacker] table"]),
    "attacker a number": (
        "attacker = 3\n" + GOOD_I1[: GOOD_I1.index("[attacker]")] + GOOD_I1[GOOD_I1.index("[target]") :],
        "attacker",
        ["got 3", "a table of fields"],
    ),
    "attacker a list": (swap("[attacker]", "[[attacker]]"), "attacker", ["a table of fields"]),
    "no position": (swap("position = [-2.0, 2.0]\n", ""), "attacker.position", ["got nothing", "X_a(0)"]),
    "position a number": (swap("[-2.0, 2.0]", "2.0"), "attacker.position", ["got 2.0", "2 or 3 finite numbers"]),
    "position of one": (swap("[-2.0, 2.0]", "[2.0]"), "attacker.position", ["got [2.0]"]),
    "position of four": (swap("[-2.0, 2.0]", "[1, 2, 3, 4]"), "attacker.position", ["2 or 3 finite numbers"]),
    "position a table": (swap("[-2.0, 2.0]", "{x = 1, y = 2}"), "attacker.position", ["2 or 3 finite numbers"]),
    "position a string": (swap("[-2.0, 2.0]", '"ab"'), "attacker.position", ["got 'ab'"]),
    "coordinate a string": (swap("[-2.0, 2.0]", '[1.0, "2"]'), "attacker.position[1]", ["got '2'", "a finite number"]),
    "coordinate infinite": (swap("[-2.0, 2.0]", "[inf, 2.0]"), "attacker.position[0]", ["got inf"]),
    "coordinate nan": (swap("[1.0, 1.5]", "[1.0, nan]"), "defenders[1].position[1]", ["got nan", "a finite number"]),
    "coordinate a list": (swap("[1.0, 1.5]", "[[1.0], 1.5]"), "defenders[1].position[0]", ["got [1.0]"]),
    "attacker in space": (swap("[-2.0, 2.0]", "[-2.0, 2.0, 0.0]"), "target.position", ["a list of 3 numbers"]),
    "one defender in space": (
        swap("[1.0, 1.5]", "[1.0, 1.5, 0.0]"),
        "defenders[1].position",
        ["a list of 2 numbers, as attacker.position is"],
    ),
    "weight zero": (swap("control_weight = 0.8", "control_weight = 0"), "attacker.control_weight", ["got 0"]),
    "weight negative": (last("running_weight = -1.0"), "defenders[1].running_weight", ["got -1.0"]),
    "weight infinite": (last("terminal_weight = inf"), "defenders[1].terminal_weight", ["finite"]),
    "evasion weight zero": (last("evasion_terminal_weight = 0.0"), "defenders[1].evasion_terminal_weight", ["got 0.0"]),
    "weight a string": (swap("control_weight = 1.2", 'control_weight = "heavy"'), "target.control_weight", ["'heavy'"]),
    "capture radius infinite": (swap("capture_radius = 0.1", "capture_radius = inf"), "attacker.capture_radius", []),
    "capture radius zero": (last("").replace("0.1\nvis", "0\nvis"), "defenders[1].capture_radius", ["got 0"]),
    "visibility zero": (swap("2.25", "0.0"), "defenders[1].visibility_radius", ["a positive number, or inf"]),
    "visibility nan": (swap("2.25", "nan"), "defenders[1].visibility_radius", ["got nan"]),
    "visibility negative": (swap("2.25", "-inf"), "defenders[1].visibility_radius", ["got -inf"]),
    "visibility a word": (swap("2.25", '"inf"'), "defenders[1].visibility_radius", ["got 'inf'"]),
    "captures farther than it sees": (
        swap("2.25", "0.05"),
        "defenders[1].visibility_radius",
        ["got 0.05", "larger than the capture radius (0.1)"],
    ),
    "captures as far as it sees": (swap("2.25", "0.1"), "defenders[1].visibility_radius", ["larger than"]),
    "evasion past one": (swap("0.1", "0.1\nevasion = 1.5"), "attacker.evasion", ["got 1.5", "a number in [0, 1]"]),
    "evasion negative": (swap("0.1", "0.1\nevasion = -0.1"), "attacker.evasion", ["a number in [0, 1]"]),
    "evasion a bool": (swap("0.1", "0.1\nevasion = true"), "attacker.evasion", ["got True"]),
    "no defenders": (GOOD_I1[: GOOD_I1.index("[[")], "defenders", ["got nothing", "[[defenders]] table"]),
    "defenders empty": (
        top("defenders = []")[: top("defenders = []").index("[[")],
        "defenders",
        ["got []", "a list of at least one defender"],
    ),
    "defenders a table": (
        GOOD_I1[: GOOD_I1.index("[[")] + D.replace("[[", "[").replace("]]", "]"),
        "defenders",
        ["a list of at least one defender"],
    ),
    "a defender a number": (
        top("defenders = [3]")[: top("defenders = [3]").index("[[")],
        "defenders[0]",
        ["got 3", "a table of fields"],
    ),
    "gamma a number": (top("synthesis_weights = 1.0"), "synthesis_weights", ["a list of 4 (I1) or 3 (I2) numbers"]),
    "gamma of two": (top("synthesis_weights = [1.0, 1.0]"), "synthesis_weights", ["a list of 4 (I1) or 3 (I2)"]),
    "gamma of three in I1": (top("synthesis_weights = [1.0, 1.0, 1.0]"), "synthesis_weights", ["a list of 4 numbers"]),
    "gamma past one": (top("synthesis_weights = [0, 0, 2, 0]"), "synthesis_weights[2]", ["got 2", "in [0, 1]"]),
    "gamma all zero": (top("synthesis_weights = [0, 0, 0, 0]"), "synthesis_weights", ["positive in at least one"]),
    "gamma of four in I2": (
        swap("6.0", "6.0\nsynthesis_weights = [1, 1, 1, 1]", GOOD_I2),
        "synthesis_weights",
        ["a list of 3 numbers in interaction I2"],
    ),
    "evasion in I2": (
        swap("capture_radius = 0.1", "capture_radius = 0.1\nevasion = 1.0", GOOD_I2),
        "attacker.evasion",
        ["left out", "it belongs to interaction I1, and this is I2"],
    ),
    "target weight in I2": (
        swap("control_weight = 1.2", "control_weight = 1.2\nrunning_weight = 1.0", GOOD_I2),
        "target.running_weight",
        ["it belongs to interaction I1"],
    ),
    "target terminal weight in I2": (
        swap("control_weight = 1.2", "control_weight = 1.2\nterminal_weight = 1.0", GOOD_I2),
        "target.terminal_weight",
        ["it belongs to interaction I1"],
    ),
    "defender weight in I2": (GOOD_I2 + "running_weight = 1.0", "defenders[1].running_weight", ["interaction I1"]),
    "defender terminal weight in I2": (GOOD_I2 + "terminal_weight = 1.0", "defenders[1].terminal_weight", ["I1"]),
    "target sight in I1": (
        swap("control_weight = 1.2", "control_weight = 1.2\nvisibility_radius = 3.0"),
        "target.visibility_radius",
        ["it belongs to interaction I2, and this is I1"],
    ),
    "target sight in I1, even unlimited": (
        swap("control_weight = 1.2", "control_weight = 1.2\nvisibility_radius = inf"),
        "target.visibility_radius",
        ["it belongs to interaction I2"],
    ),
    "attacker sight": (
        swap("0.1", "0.1\nvisibility_radius = 3.0"),
        "attacker.visibility_radius",
        ["left out: there is no such field"],
    ),
    "target capture": (
        swap("control_weight = 1.2", "control_weight = 1.2\ncapture_radius = 1.0"),
        "target.capture_radius",
        ["there is no such field"],
    ),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_a_hostile_file_is_answered_in_words(name, tmp_path):
    text, field, words = HOSTILE[name]
    place = tmp_path / "my.toml"
    place.write_text(text, encoding="utf-8")
    with pytest.raises(ScenarioError) as by_text:
        Scenario.from_toml_string(text, name="my.toml")
    with pytest.raises(ScenarioError) as by_file:
        Scenario.from_toml(place)
    message = str(by_text.value)
    assert field in [error.field for error in by_text.value.errors]
    assert all(word in message for word in words), message
    assert len(by_file.value.errors) == len(by_text.value.errors)
    assert "pydantic" not in message.lower()
    assert "http" not in message
    assert all(len(line) < 400 for line in message.splitlines())


def test_the_good_files_are_good():
    assert Scenario.from_toml_string(GOOD_I1).n == Scenario.from_toml_string(GOOD_I2).n == 2


@pytest.mark.parametrize("content", [b"\xff\xfe\x00", b"horizon = \xe9\n"])
def test_a_file_that_is_not_text(tmp_path, content):
    place = tmp_path / "my.toml"
    place.write_bytes(content)
    with pytest.raises(ScenarioError, match="must be text in UTF-8"):
        Scenario.from_toml(place)


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(ScenarioError, match=r"gone\.toml: got nothing, must be a file that exists"):
        Scenario.from_toml(tmp_path / "gone.toml")
    with pytest.raises(ScenarioError, match="got 'a folder', must be a file"):
        Scenario.from_toml(tmp_path)
    with pytest.raises(ScenarioError, match="must be a path"):
        Scenario.from_toml("a\0b")


def test_several_errors_come_together():
    text = swap("[1.0, 1.5]", '[nan, "x"]').replace("control_weight = 0.8", "control_weight = -1")
    with pytest.raises(ScenarioError) as caught:
        Scenario.from_toml_string(text)
    fields = [error.field for error in caught.value.errors]
    assert fields == ["attacker.control_weight", "defenders[1].position[0]", "defenders[1].position[1]"]
    assert (caught.value.field, caught.value.value) == ("attacker.control_weight", -1)
    assert caught.value.rule == "a positive finite number"
    assert str(caught.value).startswith("3 fields cannot be accepted:\n  attacker.control_weight: got -1, must be")
    again = pickle.loads(pickle.dumps(caught.value))
    assert str(again) == str(caught.value)
    assert [error.field for error in again.errors] == fields


@pytest.mark.parametrize(
    "enter",
    [
        lambda data: Scenario(**data),
        Scenario.model_validate,
        lambda data: Scenario.model_validate_json(json.dumps(data)),
        lambda data: Scenario.from_toml_string(tomli_w.dumps(data)),
    ],
    ids=["constructor", "model_validate", "model_validate_json", "from_toml_string"],
)
def test_every_entry_raises_the_same_error(enter):
    data = {
        "interaction": "I1",
        "horizon": "6",
        "attacker": {"position": [0, 0], "control_weight": "1", "capture_radius": "1"},
        "target": {"position": [0, 0], "control_weight": "1"},
        "defenders": [{"position": [0, 0], "control_weight": "1", "capture_radius": "1"}],
    }
    with pytest.raises(ScenarioError, match="horizon: got '6', must be a positive finite number") as caught:
        enter(data)
    assert isinstance(caught.value, ValueError)
    assert len(caught.value.errors) == 6


def test_strings_are_not_numbers_even_where_pydantic_reads_strings():
    with pytest.raises(ScenarioError, match="horizon: got '6', must be a positive finite number"):
        Scenario.model_validate_strings({"interaction": "I1", "horizon": "6"})


def test_a_part_alone_names_itself():
    with pytest.raises(ScenarioError, match=r"^attacker\.position\[1\]: got inf, must be a finite number$"):
        Attacker(position=(0, math.inf), control_weight=1, capture_radius=1)
    with pytest.raises(ScenarioError, match=r"^defender\.capture_radius: got nothing"):
        Defender(position=(0, 0), control_weight=1)
    with pytest.raises(ScenarioError, match=r"^attacker\.colour: got 'red', must be left out"):
        Attacker(position=(0, 0), control_weight=1, capture_radius=1, colour="red")


@pytest.mark.parametrize(
    "position",
    [np.zeros((2, 2)), np.zeros(4), np.array(["a", "b"]), np.array([True, False]), {0.0, 1.0}, b"ab", None, 1j],
)
def test_what_is_no_position(position):
    with pytest.raises(ScenarioError, match=r"attacker\.position"):
        Attacker(position=position, control_weight=1, capture_radius=1)


def test_a_value_is_never_printed_at_length():
    with pytest.raises(ScenarioError, match="got an integer of 5000 digits"):
        Attacker(position=(0, 0), control_weight=1, capture_radius=10**5000)
    with pytest.raises(ScenarioError) as caught:
        Attacker(position=np.zeros(1_000_000), control_weight="x" * 100_000, capture_radius=10**5000)
    assert len(str(caught.value)) < 1000


@pytest.mark.parametrize("data", [None, 3, "I1", [], [("horizon", 6)]])
def test_what_is_no_table(data):
    with pytest.raises(ScenarioError, match=r"^scenario: got .*, must be a table of fields"):
        Scenario.model_validate(data)


def test_inside_a_foreign_model_pydantic_reports_in_its_own_way():
    class Study(BaseModel):
        scenario: Scenario

    with pytest.raises(ValidationError, match="must be a positive finite number"):
        Study.model_validate({"scenario": {"horizon": -1}})
