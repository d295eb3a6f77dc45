"""The tables of failures, links and disturbances: what they accept, how they are written, what they mean together."""

import json
import math
import pickle
import re
import tomllib

import numpy as np
import pytest
from hypothesis import given, strategies as st

import tadcore
from tadcore import Scenario, ScenarioError
from tadcore.scenario import worlds

I1, I2 = (tadcore.scenarios.load(name) for name in ("paper-i1", "paper-i2"))
ALONE = I1.replace(defenders=[I1.defenders[0].model_dump()])
INF = math.inf

mean_time = st.floats(1e-3, 1e3) | st.just(INF)
size = st.floats(0.0, 10.0)


@st.composite
def world_changes(draw, sc=I2):
    """Changes that give a valid world, common and of single players."""
    found = {}
    owners = ["", *(f"d{i + 1}." for i in range(sc.n)), "target."]
    for owner in draw(st.lists(st.sampled_from(owners), unique=True)):
        for first, then in (worlds.SENSORS, worlds.DETECTIONS):
            if draw(st.booleans()):
                found[f"{owner}sensing.{first}"] = draw(mean_time)
                if draw(st.booleans()):
                    found[f"{owner}sensing.{then}"] = draw(mean_time)
                if draw(st.booleans()):
                    found[f"{owner}sensing.begin"] = draw(st.sampled_from(["up", "stationary"]))
        if draw(st.booleans()):
            found[f"{owner}communication.radius"] = draw(st.floats(0.1, 10.0) | st.just(INF))
            if draw(st.booleans()):
                found[f"{owner}communication.mean_time_up"] = draw(mean_time)
                if draw(st.booleans()):
                    found[f"{owner}communication.mean_time_down"] = draw(mean_time)
    if any(path.endswith("communication.radius") for path in found):
        if draw(st.booleans()):
            found["communication.relays"] = draw(st.integers(0, 5))
        if draw(st.booleans()):
            found["communication.frame"] = draw(st.sampled_from(["relative", "common"]))
    for path in draw(st.lists(st.sampled_from(["disturbance.defenders", "attacker.disturbance", "d2.disturbance"]))):
        found[path] = draw(size)
    return found


@given(world_changes())
def test_a_world_survives_every_form_it_is_written_in(changes):
    sc = I2.replace(changes)
    assert Scenario.from_toml_string(sc.to_toml()) == sc
    assert Scenario.model_validate(sc.model_dump()) == sc
    assert Scenario.model_validate_json(sc.model_dump_json()) == sc
    assert Scenario(**sc.model_dump()) == sc
    assert pickle.loads(pickle.dumps(sc)) == sc
    assert sc.replace() == sc.model_copy(deep=True) == sc
    assert Scenario.from_toml_string(sc.to_toml()).to_toml() == sc.to_toml()
    assert "None" not in repr(sc.model_dump())
    assert all(isinstance(line, str) for line in sc.describe().splitlines())


def test_a_scenario_without_them_is_written_as_before():
    tables = {"sensing", "communication", "disturbance"}
    for sc in (I1, I2):
        written = tomllib.loads(sc.to_toml())
        assert not tables & written.keys()
        assert not tables & (written["attacker"].keys() | written["target"].keys() | written["defenders"][0].keys())
        assert not tables & sc.model_dump().keys()
        assert not tables & json.loads(sc.attacker.model_dump_json()).keys()
        assert not re.search("None|sensing|disturbance", f"{sc!r}{sc.attacker!r}{sc.target!r}{sc.defenders!r}")
        assert (sc.world, sc.is_random) == (None, False)


def test_the_form_of_the_issue_is_read():
    text = I1.to_toml().replace(
        "[attacker]",
        """[sensing]
mean_time_to_failure = 3.0
mean_time_to_repair = 0.2
mean_time_detected = 1.0
mean_time_missed = 0.05
begin = "up"

[communication]
radius = 2.0
relays = 2
frame = "relative"
mean_time_up = 5.0
mean_time_down = 0.5

[disturbance]
defenders = 0.05

[attacker]""",
    )
    world = Scenario.from_toml_string(text).world
    assert world.mean_time_to_failure.tolist() == [3.0] * 3
    assert world.mean_time_missed.tolist() == [0.05] * 3
    assert world.link_radius.tolist() == [2.0] * 3
    assert (world.relays, world.common_frame, world.link_stationary) == (2, False, False)
    assert world.disturbance.tolist() == [0.05] * 3 + [0.0] * 2
    assert (world.fails, world.talks, world.shakes, world.is_random) == (True,) * 4


def test_a_players_own_table_goes_before_the_common_one_field_by_field():
    sc = I2.replace(
        {
            "sensing.mean_time_to_failure": 3.0,
            "sensing.mean_time_to_repair": 0.2,
            "d1.sensing.mean_time_to_failure": INF,
            "d2.sensing.begin": "stationary",
            "target.sensing.mean_time_to_repair": 0.7,
            "d3.sensing.mean_time_detected": 2.0,
            "d2.communication.radius": INF,
            "target.communication.radius": 1.5,
            "target.communication.mean_time_up": 4.0,
            "disturbance": {"defenders": 0.1, "attacker": 0.2},
            "d1.disturbance": 0.0,
            "target.disturbance": 0.3,
        }
    )
    world = sc.world
    assert world.mean_time_to_failure.tolist() == [INF, 3, 3, 3]
    assert world.mean_time_to_repair.tolist() == [0.2, 0.2, 0.2, 0.7]
    assert world.mean_time_detected.tolist() == [INF, INF, 2.0, INF]
    assert world.mean_time_missed.tolist() == [INF] * 4
    assert world.stationary.tolist() == [False, True, False, False]
    assert np.array_equal(world.link_radius, [math.nan, INF, math.nan, 1.5], equal_nan=True)
    assert world.link_mean_time_up.tolist() == [INF, INF, INF, 4.0]
    assert world.disturbance.tolist() == [0.0, 0.1, 0.1, 0.3, 0.2]
    assert (world.relays, world.common_frame) == (None, False)


def test_paths_and_wildcards_name_them():
    assert "defenders.0.sensing.mean_time_to_failure" in I1.paths
    assert "target.sensing.begin" in I2.paths
    assert "target.sensing.begin" not in I1.paths
    assert "disturbance.attacker" in I1.paths
    assert not [path for path in ALONE.paths if "communication" in path]
    wide = I1.replace({"*.disturbance": 0.1, "d*.sensing.mean_time_detected": 2.0})
    assert wide.world.disturbance.tolist() == [0.1] * 5
    assert wide.world.mean_time_detected.tolist() == [2.0] * 3
    assert wide.replace({"d2.disturbance": None}).world.disturbance.tolist() == [0.1, 0, 0.1, 0.1, 0.1]
    assert wide.replace({"d1.sensing": None}).world.mean_time_detected.tolist() == [INF, 2.0, 2.0]
    off = {"*.disturbance": None, "d*.sensing": None}
    assert wide.replace(off) == I1
    assert wide.replace(off).to_toml() == I1.to_toml()
    with pytest.raises(ScenarioError, match="set once only"):
        I1.replace({"d*.disturbance": 0.1, "d1.disturbance": 0.2})


def test_nothing_that_can_happen_is_no_world():
    for changes in (
        {"sensing.mean_time_to_failure": INF, "sensing.begin": "stationary"},
        {"disturbance.attacker": 0.0},
        {"d1.sensing": {"mean_time_detected": INF, "mean_time_missed": 0.1}},
    ):
        sc = I1.replace(changes)
        assert sc != I1
        assert sc.world is None
        assert sc.describe() == I1.describe()
    links = I1.replace({"communication.radius": 2.0})
    assert links.world is not None
    assert not links.is_random
    assert links.replace({"communication.mean_time_up": 2.0}).is_random


REFUSED = [
    (I1, {"sensing.mean_time_to_failure": 0.0}, "sensing.mean_time_to_failure", "a mean time between"),
    (I1, {"sensing.mean_time_to_failure": math.nan}, "sensing.mean_time_to_failure", "a mean time between"),
    (I1, {"d1.sensing.mean_time_detected": -1}, "defenders[0].sensing.mean_time_detected", "a mean time between"),
    (I1, {"sensing.mean_time_to_failure": "1"}, "sensing.mean_time_to_failure", "a mean time between"),
    (I1, {"sensing.mean_time_to_repair": 1.0}, "sensing.mean_time_to_repair", "mean_time_to_failure is not given"),
    (I1, {"d2.sensing.mean_time_missed": 1.0}, "defenders[1].sensing.mean_time_missed", "mean_time_detected is not"),
    (I1, {"sensing.begin": "stationary"}, "sensing.begin", "neither mean_time_to_failure nor mean_time_detected"),
    (I1, {"sensing": {"mean_time_to_failure": 1.0, "begin": "down"}}, "sensing.begin", '"up" or "stationary"'),
    (I1, {"sensing": {}}, "sensing", "a table with some of its fields"),
    (I1, {"d3.sensing": {}}, "defenders[2].sensing", "a table with some of its fields"),
    (I1, {"sensing": 3}, "sensing", "a table of fields"),
    (I1, {"sensing.mean_time_to_falure": 1}, "sensing.mean_time_to_falure", "did you mean mean_time_to_failure?"),
    (I1, {"d1.mean_time_detected": 1}, "defenders[0].mean_time_detected", "did you mean sensing.mean_time_detected?"),
    (I1, {"mean_time_detected": 1}, "mean_time_detected", "did you mean sensing.mean_time_detected?"),
    (I1, {"sensng.begin": "up"}, "sensng.begin", "did you mean sensing.begin?"),
    (I1, {"target.sensing.mean_time_to_failure": 1}, "target.sensing", "it belongs to interaction I2"),
    (I1, {"target.communication.radius": 1}, "target.communication", "it belongs to interaction I2"),
    (I1, {"attacker.sensing.begin": "up"}, "attacker.sensing.begin", "a field that exists"),
    (I1, {"communication.radius": 0.0}, "communication.radius", "inf for links at any distance"),
    (I1, {"communication.radius": -INF}, "communication.radius", "inf for links at any distance"),
    (I1, {"communication.radius": 1e-14}, "communication.radius", "of the largest distance from the attacker"),
    (I1, {"communication": {"radius": 1, "relays": -1}}, "communication.relays", "a whole number from 0"),
    (I1, {"communication": {"radius": 1, "relays": 1.0}}, "communication.relays", "a whole number from 0"),
    (I1, {"communication": {"radius": 1, "relays": True}}, "communication.relays", "a whole number from 0"),
    (I1, {"communication.relays": 1}, "communication.relays", "nobody is heard"),
    (I1, {"communication.frame": "common"}, "communication.frame", "nobody is heard"),
    (I1, {"communication.mean_time_up": 1.0}, "communication.mean_time_up", "nobody is heard"),
    (I1, {"communication": {"radius": 1, "mean_time_down": 1}}, "communication.mean_time_down", "mean_time_up is not"),
    (I1, {"communication": {"radius": 1, "begin": "up"}}, "communication.begin", "mean_time_up is not"),
    (I1, {"d1.communication.relays": 1}, "defenders[0].communication.relays", "no such field"),
    (ALONE, {"communication.radius": 1.0}, "communication", "d1 is the only player with limited sight"),
    (ALONE, {"d1.communication.radius": 1.0}, "defenders[0].communication", "has nobody to hear"),
    (I1, {"disturbance.attacker": -0.1}, "disturbance.attacker", "a number between 0 and 1e100"),
    (I1, {"disturbance.attacker": INF}, "disturbance.attacker", "a number between 0 and 1e100"),
    (I1, {"d1.disturbance": math.nan}, "defenders[0].disturbance", "a number between 0 and 1e100"),
    (I1, {"disturbance.defender": 0.1}, "disturbance.defender", "did you mean defenders?"),
    (I1, {"disturbance": 0.1}, "disturbance", "a table of fields"),
]


@pytest.mark.parametrize(("sc", "changes", "field", "words"), REFUSED, ids=[str(case[1]) for case in REFUSED])
def test_what_cannot_be_or_does_nothing_is_refused_by_name(sc, changes, field, words):
    with pytest.raises(ScenarioError) as caught:
        sc.replace(changes)
    assert caught.value.field == field
    assert words in str(caught.value)


def test_a_change_of_interaction_leaves_the_targets_tables_behind():
    two = I2.replace({"target.sensing.mean_time_to_failure": 1.0, "target.disturbance": 0.1})
    one = two.replace(interaction="I1")
    assert one.target.sensing is None
    assert one.target.disturbance == 0.1


def test_a_description_says_what_surrounds_the_game():
    sc = I1.replace(
        {
            "sensing": {"mean_time_to_failure": 3.0, "mean_time_to_repair": 0.2},
            "d2.sensing.mean_time_detected": 1.0,
            "d2.sensing.begin": "stationary",
            "communication": {"radius": 2.0, "relays": 1, "mean_time_up": 5.0, "begin": "stationary"},
            "d3.communication.radius": INF,
            "attacker.disturbance": 0.05,
        }
    )
    lines = sc.describe().splitlines()[len(I1.describe().splitlines()) :]
    assert lines == [
        "d1, d3: sensor fails after 3 on average, works again after 0.2",
        "d2: sensor fails after 3 on average, works again after 0.2; a player in range is lost after 1 on average, "
        "for good; stationary from the start",
        "d1, d2: heard within 2; a link fails after 5 on average, for good",
        "d3: heard at any distance; a link fails after 5 on average, for good",
        "reports: what is seen; passed on at most 1 times; links stationary from the start",
        "attacker: disturbed, ς = 0.05",
        "random: a game depends on seed and trial too",
    ]
    free = I1.replace({"d1.communication.radius": 1.0, "communication.frame": "common"}).describe()
    assert "d2, d3: heard by nobody" in free
    assert "reports: what is seen, and the own place in a common frame; passed on by any number" in free
    assert "random" not in free


def test_feedback_and_criterion():
    sc = I1.replace({"feedback": "receding", "prediction_horizon": 2.0, "criterion": "component"})
    assert Scenario.from_toml_string(sc.to_toml()) == sc
    assert "receding horizon: P is that at the beginning of T_h = 2 throughout" in sc.describe()
    assert "team criterion: whoever knows everything plays its row of the equilibrium" in sc.describe()
    assert not {"feedback", "prediction_horizon", "criterion"} & tomllib.loads(I1.to_toml()).keys()
    assert sc.replace({"feedback": None, "prediction_horizon": None, "criterion": None}).to_toml() == I1.to_toml()
    assert I1.replace(criterion="paper").describe() == I1.replace(feedback="finite").describe() == I1.describe()
    for changes, field, words in (
        ({"feedback": "receding"}, "prediction_horizon", "must be given"),
        ({"prediction_horizon": 2.0}, "prediction_horizon", 'feedback is not "receding"'),
        ({"feedback": "receding", "prediction_horizon": 0.0}, "prediction_horizon", "a positive finite number"),
        ({"feedback": "infinite"}, "feedback", '"finite" or "receding"'),
        ({"criterion": "team"}, "criterion", '"paper" or "component"'),
    ):
        with pytest.raises(ScenarioError) as caught:
            I1.replace(changes)
        assert caught.value.field == field
        assert words in str(caught.value)
    with pytest.raises(ScenarioError, match="d1 is the only player with limited sight"):
        ALONE.replace(criterion="component")
