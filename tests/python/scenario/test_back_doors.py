"""Every way that pydantic has of making or changing a model: what comes out is valid, or it is refused by name."""

import copy
import pickle

import pytest

import tadcore
from tadcore import Attacker, Scenario, ScenarioError

GOOD = tadcore.scenarios.load("paper-i1")
DATA = GOOD.model_dump()
BAD = {**DATA, "horizon": -1.0}
MORE = {**DATA, "foo": 1}
REST = {key: value for key, value in DATA.items() if key != "horizon"}

pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning")  # of the ways that pydantic has given up


def text(data):
    return GOOD.model_dump_json()[:-1] + "".join(f', "{key}": 1' for key in data if key not in DATA) + "}"


@pytest.mark.parametrize(
    "make",
    [
        lambda: GOOD.copy(update={"horizon": -1.0}),
        lambda: GOOD.model_copy(update={"horizon": -1.0}),
        lambda: GOOD.model_copy(update={"horizon": -1.0}, deep=True),
        lambda: GOOD.attacker.copy(update={"control_weight": -1.0}),
        lambda: Scenario.model_construct(**BAD),
        lambda: Scenario.model_construct({"horizon"}, **BAD),
        lambda: Scenario.construct(**BAD),
        lambda: Attacker.model_construct(position=(0.0, 0.0)),
        lambda: Scenario.parse_obj(BAD),
        lambda: Scenario.validate(BAD),
        lambda: Scenario.model_validate(BAD, strict=True),
        lambda: Scenario.model_validate(BAD, context={"rules": None}),
        lambda: Scenario.model_validate(type("Given", (), BAD)(), from_attributes=True),
        lambda: Scenario.model_validate_json(GOOD.model_dump_json().replace("6.0", "-6.0")),
        lambda: Scenario.parse_raw(GOOD.model_dump_json().replace("6.0", "-6.0")),
        lambda: GOOD.replace({"horizon": -1.0}),
        lambda: GOOD.copy(update={"foo": 1}),
        lambda: GOOD.model_copy(update={"foo": 1}),
        lambda: Scenario.model_construct(**MORE),
        lambda: Scenario.model_validate(MORE),
        lambda: Scenario.model_validate(MORE, extra="forbid"),
        lambda: Scenario.model_validate_json(text(MORE)),
    ],
)
def test_what_breaks_a_rule_is_refused(make):
    with pytest.raises(ScenarioError):
        make()


@pytest.mark.parametrize("extra", ["allow", "ignore", "anything", 5])
def test_no_option_lets_an_unknown_field_in(extra):
    for validate, given in (
        (Scenario.model_validate, MORE),
        (Scenario.model_validate_json, text(MORE)),
        (Scenario.model_validate_strings, MORE),
        (Attacker.model_validate, {**DATA["attacker"], "foo": 1}),
    ):
        with pytest.raises(ScenarioError, match=r"^extra: got .*, must be left out"):
            validate(given, extra=extra)


@pytest.mark.parametrize(
    "make",
    [
        lambda: GOOD.copy(),
        lambda: GOOD.copy(deep=True),
        lambda: GOOD.model_copy(update={}),
        lambda: copy.copy(GOOD),
        lambda: copy.deepcopy(GOOD),
        lambda: pickle.loads(pickle.dumps(GOOD)),
        lambda: Scenario.model_construct(**DATA),
        lambda: Scenario.model_validate(DATA, strict=True),
        lambda: Scenario.model_validate(GOOD, context={}),
        lambda: Scenario.model_validate(type("Given", (), DATA)(), from_attributes=True),
        lambda: GOOD.copy(update={"horizon": 6.0}),
    ],
)
def test_what_breaks_none_is_the_same_scenario(make):
    made = make()
    assert made == GOOD
    assert hash(made) == hash(GOOD)
    assert made.to_toml() == GOOD.to_toml()


@pytest.mark.parametrize("option", ["include", "exclude"])
def test_a_copy_has_every_field(option):
    with pytest.raises(ScenarioError, match=rf"^{option}: got .*, must be left out: a copy has every field"):
        GOOD.copy(**{option: {"horizon"}})


@pytest.mark.parametrize("given", [5, "horizon", [("horizon", 1.0)], None.__class__, 1.5, {5: 1.0}, {None: 1}])
def test_changes_are_a_mapping_of_paths(given):
    for change in (GOOD.replace, lambda given: GOOD.model_copy(update=given), lambda given: GOOD.copy(update=given)):
        with pytest.raises(ScenarioError, match=r"must be (a dict of paths and values|named by a path)"):
            change(given)


@pytest.mark.parametrize("name", ["horizon", "foo", "_hidden", "n", "__dict__", "__pydantic_fields_set__"])
def test_nothing_is_set_or_deleted(name):
    for model in (GOOD, GOOD.attacker):
        before = model.model_dump()
        with pytest.raises(ScenarioError, match="must be left as it is: scenarios are immutable"):
            setattr(model, name, 1.0)
        with pytest.raises(ScenarioError, match="must be left as it is: scenarios are immutable"):
            delattr(model, name)
        assert model.model_dump() == before


def forced(change):
    given = copy.deepcopy(GOOD)
    change(given)
    return given


TAMPERED = [
    lambda sc: sc.__dict__.update(horizon=-1.0),
    lambda sc: object.__setattr__(sc, "step", 0.7),
    lambda sc: object.__setattr__(sc.attacker, "control_weight", -2.0),
    lambda sc: sc.__dict__.update(defenders=()),
    lambda sc: sc.__dict__.pop("target"),
    lambda sc: sc.defenders[0].__dict__.update(visibility_radius=0.01),
    lambda sc: sc.__dict__.update(synthesis_weights=(float("nan"),) * 4),
]


RESHAPED = [
    lambda sc: sc.__dict__.update(defenders=list(sc.defenders)),
    lambda sc: sc.__dict__.update(attacker=sc.attacker.model_dump()),
]


@pytest.mark.parametrize("change", TAMPERED + RESHAPED)
def test_a_scenario_that_was_forced_is_refused_where_it_is_used(change):
    """Python lets anybody write into any object; nothing is computed from what is no game."""
    uses = [
        tadcore.simulate,
        tadcore.solve_equilibrium,
        lambda sc: tadcore.simulate_batch(sc, [GOOD.positions]),
        lambda sc: tadcore.synthesize(sc, step=0, adjacency=[[1] * 4] * 3),
        lambda sc: tadcore.outcome_map(sc, x=(0, 1, 2), y=(0, 1, 2)),
        lambda sc: tadcore.Study(sc, vary={"attacker.position": [[0.0, 1.0]]}, trials=2).run(),
        tadcore.VisibilityNetwork.from_positions,
        tadcore.verify,
    ]
    for use in uses:
        with pytest.raises(ScenarioError):
            use(forced(change))


@pytest.mark.parametrize("change", TAMPERED)
def test_a_forged_pickle_is_refused(change):
    with pytest.raises(ScenarioError):
        pickle.loads(pickle.dumps(forced(change)))


@pytest.mark.parametrize("state", [None, 5, {}, [], {"__dict__": 5}, {"__dict__": BAD}])
def test_the_state_of_a_pickle_is_checked(state):
    made = Scenario.__new__(Scenario)
    with pytest.raises(ScenarioError):
        made.__setstate__(state)


def test_plain_tables_in_a_pickle_become_players():
    made = Scenario.__new__(Scenario)
    made.__setstate__({**GOOD.__getstate__(), "__dict__": DATA})
    assert made == GOOD
    assert isinstance(made.attacker, Attacker)


def test_what_was_never_made_is_refused():
    with pytest.raises(ScenarioError, match="got 'a Scenario without fields', must be a Scenario"):
        tadcore.simulate(Scenario.__new__(Scenario))
