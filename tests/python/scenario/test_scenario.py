"""The scenario: fields and defaults, every way in and out, copies."""

import json
import math
import pickle
import tomllib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, strategies as st

from tadcore import Attacker, Defender, Scenario, ScenarioError, Target, scenarios


def table(interaction="I1", **changes):
    """A valid scenario of one defender as a dict."""
    return {
        "interaction": interaction,
        "horizon": 6.0,
        "attacker": {"position": [-2.0, 2.0], "control_weight": 0.8, "capture_radius": 0.1},
        "target": {"position": [0.0, 1.0], "control_weight": 1.2},
        "defenders": [{"position": [0.0, 0.0], "control_weight": 1.0, "capture_radius": 0.1}],
        **changes,
    }


positive = st.floats(1e-6, 1e6)
coordinate = st.floats(-1e6, 1e6)
fraction = st.floats(0.0, 1.0)


@st.composite
def any_scenario(draw):
    interaction = draw(st.sampled_from(["I1", "I2"]))
    dim = draw(st.sampled_from([2, 3]))
    position = st.lists(coordinate, min_size=dim, max_size=dim)

    def part(required, optional):
        chosen = {name: draw(kind) for name, kind in required.items()}
        return chosen | {name: draw(kind) for name, kind in optional.items() if draw(st.booleans())}

    first = interaction == "I1"
    own = {"running_weight": positive, "terminal_weight": positive} if first else {}
    player = {"position": position, "control_weight": positive}
    capture = {"capture_radius": st.floats(1e-6, 0.5)}
    sight = {"visibility_radius": st.floats(0.6, 1e6) | st.just(math.inf)}
    evading = {"evasion_running_weight": positive, "evasion_terminal_weight": positive}
    seeking = {"target_running_weight": positive, "target_terminal_weight": positive}
    team = [part(player | capture, own | evading | sight) for _ in range(draw(st.integers(1, 4)))]
    step = draw(st.floats(1e-3, 1.0))
    top = {"interaction": interaction, "horizon": step * draw(st.integers(1, 1000)), "step": step}
    if draw(st.booleans()):
        terms = 4 if first else 3
        top["synthesis_weights"] = draw(st.lists(fraction, min_size=terms, max_size=terms).filter(any))
    return Scenario(
        **top,
        attacker=part(player | capture, seeking | ({"evasion": fraction} if first else {})),
        target=part(player, own if first else sight),
        defenders=team,
    )


@given(any_scenario())
def test_a_scenario_survives_every_form_it_is_written_in(sc):
    assert Scenario.from_toml_string(sc.to_toml()) == sc
    assert Scenario.model_validate(sc.model_dump()) == sc
    assert Scenario.model_validate_json(sc.model_dump_json()) == sc
    assert Scenario.model_validate(sc) == sc
    assert pickle.loads(pickle.dumps(sc)) == sc
    assert sc.model_copy() == sc
    assert sc.model_copy(deep=True) == sc
    assert sc.replace() == sc
    assert hash(sc) == hash(Scenario.from_toml_string(sc.to_toml()))
    assert Scenario.from_toml_string(sc.to_toml()).to_toml() == sc.to_toml()


def test_defaults_are_those_of_the_design():
    one, two = Scenario(**table("I1")), Scenario(**table("I2"))
    assert one.step == 0.005
    assert one.synthesis_weights == (0.25,) * 4
    assert two.synthesis_weights == (1 / 3,) * 3
    assert one.attacker.evasion == one.attacker.target_running_weight == one.attacker.target_terminal_weight == 1.0
    assert one.target.running_weight == one.target.terminal_weight == 1.0
    assert two.target.visibility_radius == math.inf
    d = one.defenders[0]
    assert d.visibility_radius == math.inf
    assert d.running_weight == d.terminal_weight == d.evasion_running_weight == d.evasion_terminal_weight == 1.0


def test_arrays_follow_the_order_d1_to_dn_target_attacker():
    sc = scenarios.load("paper-i1")
    assert sc.players == ("d1", "d2", "d3", "target", "attacker")
    assert sc.positions.tolist() == [[0, 0], [1, 1.5], [-1, 0], [0, 1], [-2, 2]]
    assert sc.visibility_radii.tolist() == [5, 2.25, 1.25]
    assert sc.capture_radii.tolist() == [0.1] * 4
    assert (sc.n, sc.dim, sc.steps, sc.constrained) == (3, 2, 1200, ("d1", "d2", "d3"))
    two = scenarios.load("paper-i2")
    assert two.visibility_radii.tolist() == [5, 3, 0.3, 2.5]
    assert two.constrained == ("d1", "d2", "d3", "target")


def test_numpy_values_are_taken_as_numbers():
    sc = Scenario(
        interaction="I1",
        horizon=np.float32(6),
        step=np.int64(1),
        attacker=Attacker(position=np.array([1, 2]), control_weight=1, capture_radius=np.float64(0.1)),
        target=Target(position=(np.float32(0.5), 1), control_weight=np.array(2.0)[()]),
        defenders=(Defender(position=np.zeros(2), control_weight=1, capture_radius=0.1),),
    )
    assert sc.target.position == (0.5, 1.0)
    assert type(sc.horizon) is type(sc.attacker.position[0]) is float


def test_many_defenders_and_space():
    sc = Scenario(
        **table(
            attacker={"position": [0, 0, 5], "control_weight": 1, "capture_radius": 0.1},
            target={"position": [0, 0, 0], "control_weight": 1},
            defenders=[{"position": [i, 1, 2], "control_weight": 1, "capture_radius": 0.1} for i in range(300)],
        )
    )
    assert sc.positions.shape == (302, 3)
    assert Scenario.from_toml_string(sc.to_toml()) == sc


def test_a_scenario_cannot_be_changed():
    sc = Scenario(**table())
    with pytest.raises(ScenarioError, match=r"^horizon: .*immutable"):
        sc.horizon = 3.0
    with pytest.raises(ScenarioError, match=r"^attacker\.evasion: .*immutable"):
        sc.attacker.evasion = 0.0
    sc.positions[0] = 99.0
    assert sc.positions[0].tolist() == [0.0, 0.0]


def test_copies_are_checked_like_everything_else():
    sc = scenarios.load("paper-i1")
    wider = sc.replace({"defenders[1].visibility_radius": 4.0, "attacker.position": (9, 9)}, horizon=3.0)
    assert wider.visibility_radii.tolist() == [5.0, 4.0, 1.25]
    assert wider.horizon == 3.0
    assert wider.attacker.position == (9.0, 9.0)
    assert sc.horizon == 6.0
    assert sc.replace({"target.position[1]": 7}).target.position == (0.0, 7.0)
    for change, field in [
        ({"horizon": -1}, "horizon"),
        ({"defenders[1].visibility_radius": 0.05}, "defenders[1].visibility_radius"),
        ({"defenders[3].position": (0, 0)}, "defenders[3].position"),
        ({"defenders.position": (0, 0)}, "defenders.position"),
        ({"horizon.x": 1}, "horizon.x"),
        ({"attacker.colour": 1}, "attacker.colour"),
        ({"a b": 1}, "a b"),
    ]:
        with pytest.raises(ScenarioError) as caught:
            sc.replace(change)
        assert caught.value.field == field
    with pytest.raises(ScenarioError, match="horizon"):
        sc.model_copy(update={"horizon": math.nan})


def test_a_change_of_interaction_leaves_foreign_fields_behind():
    two = scenarios.load("paper-i1").replace(interaction="I2")
    assert two.synthesis_weights == (1 / 3,) * 3
    assert two.target.visibility_radius == math.inf
    assert "evasion =" not in two.to_toml()
    assert two.replace(interaction="I1").synthesis_weights == (0.25,) * 4


def test_invalid_parts_are_not_smuggled_in():
    crooked = scenarios.load("paper-i1").attacker
    crooked.__dict__.update(position=(math.nan, 0.0), control_weight=-1.0)
    with pytest.raises(ScenarioError) as caught:
        Scenario(**table(attacker=crooked))
    assert [e.field for e in caught.value.errors] == ["attacker.position[0]", "attacker.control_weight"]


def test_a_file_appears_whole_and_alone(tmp_path):
    sc = scenarios.load("paper-i2")
    place = tmp_path / "my.toml"
    place.write_text("old", encoding="utf-8")
    assert sc.to_toml(place) == place.read_text(encoding="utf-8")
    assert Scenario.from_toml(place) == Scenario.from_toml(str(place)) == sc
    assert [p.name for p in tmp_path.iterdir()] == ["my.toml"]
    with pytest.raises(OSError, match="nowhere"):
        sc.to_toml(tmp_path / "nowhere" / "my.toml")


def test_a_byte_order_mark_is_no_obstacle(tmp_path):
    place = tmp_path / "my.toml"
    place.write_text("\ufeff" + scenarios.text("paper-i1"), encoding="utf-8")
    assert Scenario.from_toml(place) == scenarios.load("paper-i1")


def test_only_fields_of_the_interaction_are_written():
    one = tomllib.loads(scenarios.load("paper-i1").to_toml())
    two = tomllib.loads(scenarios.load("paper-i2").to_toml())
    assert "visibility_radius" not in one["target"]
    assert "evasion" in one["attacker"]
    assert "evasion" not in two["attacker"]
    assert two["target"].keys() == {"position", "control_weight", "visibility_radius"}
    assert all("running_weight" not in d for d in two["defenders"])
    assert tomllib.loads(Scenario(**table("I2")).to_toml())["target"]["visibility_radius"] == math.inf


@pytest.mark.parametrize("mode", ["validation", "serialization"])
def test_the_json_schema_names_every_field_and_bound(mode):
    schema = Scenario.model_json_schema(mode=mode)
    json.dumps(schema)
    if mode == "validation":
        assert schema["properties"]["defenders"]["minItems"] == 1
        assert set(schema["required"]) == {"interaction", "horizon", "attacker", "target", "defenders"}
        assert schema["properties"]["interaction"]["enum"] == ["I1", "I2"]
        assert schema["properties"]["horizon"]["exclusiveMinimum"] == 0.0
        assert schema["$defs"]["Attacker"]["properties"]["evasion"]["maximum"] == 1.0
        assert schema["additionalProperties"] is False


def test_repr_and_description_are_short():
    sc = scenarios.load("paper-i1")
    assert repr(sc) == "Scenario(I1, 3 defenders, dim=2, T=6, δ=0.005)"
    assert len(sc.describe().splitlines()) == 2 + 5
    assert "d2       at (1, 1.5), visibility radius 2.25, captures within 0.1" in sc.describe()


def test_the_bundled_scenarios_are_the_eight_runs():
    cases = json.loads((Path(__file__).parents[2] / "reference" / "paper_scenarios.json").read_text("utf-8"))
    assert scenarios.names() == tuple(cases["runs"])
    for name, run in cases["runs"].items():
        sc, common = scenarios.load(name), cases[run["interaction"]]
        assert sc.interaction == run["interaction"]
        assert sc.positions.tolist() == common["positions"]
        assert [d.control_weight for d in sc.defenders] == [1.0] * 3
        assert (sc.target.control_weight, sc.attacker.control_weight) == (1.2, 0.8)
        assert (sc.horizon, sc.step) == (6.0, 0.005)
        assert sc.capture_radii.tolist() == [0.1] * 4
        m = len(sc.constrained)
        assert sc.visibility_radii.tolist() == run.get("visibility_radii", [math.inf] * m)
        assert sc.attacker.evasion == run.get("evasion", 1.0)
        assert scenarios.summary(name).startswith(sc.interaction)
        assert "Singh and Reddy" in scenarios.text(name)


def test_an_unknown_bundled_name_suggests_the_nearest():
    with pytest.raises(ScenarioError, match=r"did you mean paper-i1"):
        scenarios.load("paper-1")
    with pytest.raises(ScenarioError, match=r"the names are paper-i1, "):
        scenarios.load("xyzzy")
