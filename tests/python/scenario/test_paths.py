"""One grammar of paths, wherever a quantity is named."""

import numpy as np
import pytest

import tadcore
from tadcore import ScenarioError
from tadcore.sampling import Box
from tadcore.scenario.paths import ByPath, beyond, expand, is_owner, label, normal, short

SC = tadcore.scenarios.load("paper-i1")

SAME = {
    "defenders.0.visibility_radius": ("d1.visibility_radius", "defenders[0].visibility_radius"),
    "defenders.1.position.y": ("d2.position.y", "defenders[1].position[1]", "defenders.1.position.1", "d2.position[1]"),
    "defenders.*.capture_radius": ("d*.capture_radius", "defenders[*].capture_radius"),
    "defenders.11.control_weight": ("d12.control_weight",),
    "*.position": (),
    "attacker.position.x": ("attacker.position[0]",),
    "horizon": (),
}


@pytest.mark.parametrize(("form", "others"), SAME.items())
def test_every_spelling_has_one_normal_form(form, others):
    assert {normal(path) for path in (form, *others)} == {form}
    assert normal(short(form)) == form


@pytest.mark.parametrize(
    "path", ["d0.position", "drag.position", "dx", "d1x.position", "d01.position", "d1234567890.position"]
)
def test_what_only_looks_like_a_defender_stays_as_it_is(path):
    assert normal(path) == path


def test_labels_and_owners():
    assert [label(player) for player in ("d2", "defenders[1]", "defenders.1", "target", 3)] == ["d2"] * 3 + [
        "target",
        3,
    ]
    assert all(map(is_owner, ("attacker", "target", "d3", "defenders[0]", "defenders.*", "d*", "*")))
    assert not any(map(is_owner, ("d0", "attacker.position", "horizon", "defend")))


def test_wildcards_mean_all_that_have_the_field():
    assert expand("*.visibility_radius", SC.paths) == [f"defenders.{i}.visibility_radius" for i in range(3)]
    i2 = tadcore.scenarios.load("paper-i2")
    assert expand("*.visibility_radius", i2.paths)[0] == "target.visibility_radius"
    assert len(expand("*.position", SC.paths)) == SC.n + 2
    assert expand("d*.step", SC.paths) == []


@pytest.mark.parametrize("owner", ["d1", "defenders[0]", "defenders.0"])
def test_everything_that_takes_a_path_takes_every_spelling(owner):
    path = f"{owner}.visibility_radius"
    assert SC.replace({path: 2.0}).visibility_radii[0] == 2.0
    study = tadcore.Study(SC, {path: [1.0, 2.0]}, trials=4)
    assert study.columns == ("defenders.0.visibility_radius",)
    swept = tadcore.sweep(tadcore.Study(SC, {"attacker.position": Box(-1, 1)}, trials=2), {path: [1.0, 2.0]})
    assert "defenders.0.visibility_radius" in swept.to_xarray().sizes
    curve = tadcore.radius_curve(SC, [SC.positions], player=owner, radii=[1.0, 2.0])
    assert curve.player == "d1"
    assert tadcore.outcome_map(SC, owner, x=(0, 1, 2), y=(0, 1, 2)).player == "d1"


def test_wildcards_replace_every_field_they_mean():
    assert np.isinf(SC.replace({"d*.visibility_radius": np.inf}).visibility_radii).all()
    assert (SC.replace({"*.position[1]": 0.5}).positions[:, 1] == 0.5).all()
    with pytest.raises(ScenarioError, match=r'set once only: "d\*\.capture_radius" sets it too'):
        SC.replace({"d*.capture_radius": 0.2, "d1.capture_radius": 0.3})
    with pytest.raises(ScenarioError, match="that some player of this game has"):
        SC.replace({"*.evasiveness": 1.0})


@pytest.mark.parametrize("path", ["d0.position", "d4.position", "defenders[3].position", "defenders.3.position"])
def test_a_defender_that_is_not_there_is_said_to_be_none(path):
    assert beyond(SC.n, path) == "the path of a defender of this game, which has 3 defenders, d1 to d3"
    with pytest.raises(ScenarioError, match="which has 3 defenders, d1 to d3"):
        SC.replace({path: (0.0, 0.0)})


def test_inputs_by_any_spelling_are_the_same_games():
    from tadcore.simulation.starts import rows_of

    rows = [rows_of(SC, {path: [1.5, 2.5]}, 2) for path in ("d2.visibility_radius", "defenders[1].visibility_radius")]
    assert (rows[0].visibility_radii == rows[1].visibility_radii).all()
    assert rows[0].visibility_radii[:, 1].tolist() == [1.5, 2.5]


def test_a_dict_by_path_finds_every_spelling_in_every_way():
    found = ByPath({"defenders.0.visibility_radius": 2.0, "attacker.position.x": None})
    for spelling in ("d1.visibility_radius", "defenders[0].visibility_radius", "defenders.0.visibility_radius"):
        assert spelling in found
        assert found[spelling] == found.get(spelling) == found.get(spelling, 7.0) == 2.0
    assert found.get("attacker.position.x", 7.0) is None
    for stranger in ("d2.visibility_radius", 5, None):
        assert stranger not in found
        assert (found.get(stranger), found.get(stranger, 7.0)) == (None, 7.0)
        with pytest.raises(KeyError):
            found[stranger]
