"""What somebody who wrote a wrong path is told: of the player that was meant, and never of another."""

import pickle
import re

import numpy as np
import pytest

import tadcore
from tadcore import ScenarioError, Study, sampling
from tadcore.scenario.hints import hint, wildcards
from tadcore.scenario.quantities import quantities_of

SC = tadcore.scenarios.load("paper-i1").replace({"horizon": 0.5, "step": 0.05})


@pytest.mark.parametrize(
    ("path", "meant"),
    [
        ("d1.visibilty_radius", "d1.visibility_radius"),
        ("d2.visibility-radius", "d2.visibility_radius"),
        ("defenders[0].visibilityradius", "d1.visibility_radius"),
        ("defenders.1.visibilty_radius", "d2.visibility_radius"),
        ("defender.0.position", "d1.position"),
        ("defender1.position", "d1.position"),
        ("defender[2].position", "d3.position"),
        ("defenders[1.position", "d2.position"),
        ("D1.position", "d1.position"),
        ("d02.position", "d2.position"),
        ("defenders.-1.position", "d3.position"),
        ("defenders[-3].position", "d1.position"),
        (" d1.position", "d1.position"),
        ("d1_visibility_radius", "d1.visibility_radius"),
        ("d.visibility_radius", "d*.visibility_radius"),
        ("d*.positon", "d*.position"),
        ("visibility_radius", "d*.visibility_radius"),
        ("position", "*.position"),
        ("*.positon", "*.position"),
        ("attaker.position", "attacker.position"),
        ("Attacker.position", "attacker.position"),
        ("attacker.positon", "attacker.position"),
        ("attacker.capture_radius.x", "attacker.capture_radius"),
        ("targt.position.x", "target.position.x"),
    ],
)
def test_the_path_that_was_meant_is_named(path, meant):
    for names in (quantities_of(SC), [*quantities_of(SC), *SC.paths]):
        assert hint(path, wildcards(names)) == f"did you mean {meant}?"
    with pytest.raises(ScenarioError, match=re.escape(f"did you mean {meant}?")):
        Study(SC, vary={path: sampling.Box(1, 2)}, trials=1)


def test_what_a_player_has_is_listed():
    names = wildcards(quantities_of(SC))
    assert hint("attacker.visibility_radius", names) == "attacker has position, position.x, position.y, capture_radius"
    assert hint("target.capture_radius", names) == "target has position, position.x, position.y"
    assert hint("d2", names) == "d2 has position, position.x, position.y, visibility_radius, capture_radius"
    assert hint("d3.position.z", names) == "the coordinates of d3.position are x, y"


@pytest.mark.parametrize(
    "path", ["", "x", "distance", "d9.position", "defenders.7.position", "x" * 10_000, "." * 100, "\ud800"]
)
def test_nothing_is_made_up(path):
    assert hint(path, wildcards(quantities_of(SC))) == ""


def test_every_slip_of_a_letter_leads_to_the_same_player():
    """One letter left out, doubled or exchanged with its neighbour, at every place of every path."""
    names = list(quantities_of(SC))
    for name in names:
        for path in (name, tadcore.scenario.paths.short(name)):
            owner = tadcore.scenario.paths.short(name).partition(".")[0]
            start = len(path.partition("position")[0].partition("visib")[0].partition("capt")[0])
            for i in range(start + 1, len(path)):
                slips = {path[:i] + path[i + 1 :], path[:i] + path[i] + path[i:]}
                slips.add(path[: i - 1] + path[i] + path[i - 1] + path[i + 1 :] if i > start + 1 else path)
                for slip in slips - {path}:
                    if tadcore.scenario.paths.normal(slip) not in names:
                        said = hint(slip, wildcards(names))
                        assert owner in said, (slip, said)
                        assert not re.search(rf"\\b(?!{owner}\\b)(d\\d|attacker|target)\\b", said), (slip, said)


def test_replace_tells_what_was_meant():
    for path, meant in (
        ("attaker.position", "attacker.position"),
        ("D2.position", "d2.position"),
        ("d*.positon", "d*.position"),
    ):
        with pytest.raises(ScenarioError, match=re.escape(f"did you mean {meant}?")):
            SC.replace({path: (0.0, 0.0)})


def test_what_a_study_drew_is_found_by_any_spelling():
    result = Study(
        SC, vary={"d1.visibility_radius": sampling.Box(1, 2), "attacker.position": sampling.Box(-1, 1)}, trials=5
    ).run()
    for inputs in (result.inputs, pickle.loads(pickle.dumps(result)).inputs):
        wanted = inputs["defenders.0.visibility_radius"]
        for path in ("d1.visibility_radius", "defenders[0].visibility_radius"):
            assert path in inputs
            np.testing.assert_array_equal(inputs[path], wanted)
        np.testing.assert_array_equal(inputs["attacker.position[1]"], inputs["attacker.position.y"])
        with pytest.raises(
            KeyError, match=r"d2\.visibility_radius; there is attacker\.position\.x, .*d1\.visibility_radius"
        ):
            inputs["d2.visibility_radius"]
        for key in (0, None, ("d1",)):
            assert key not in inputs
            with pytest.raises(KeyError):
                inputs[key]
    tadcore.plotting.outcomes_by_input(result, "d1.visibility_radius")


def test_a_sweep_is_read_by_the_names_that_people_write(tmp_path):
    """The first defender is d1 in one form and number 0 in the other: neither may be taken for the second."""
    study = Study(SC, vary={"attacker.position": sampling.Box(-3, 3)}, trials=40)
    grid = {"d1.visibility_radius": [0.5, 5.0], "d2.visibility_radius": [0.25, 2.5, 3.0], "horizon": [0.5, 1.0]}
    found = tadcore.sweep(study, grid).to_xarray()
    assert found["count"].dims == (
        "defenders.0.visibility_radius",
        "defenders.1.visibility_radius",
        "horizon",
        "outcome",
    )
    np.testing.assert_array_equal(found["d1.visibility_radius"], [0.5, 5.0])
    np.testing.assert_array_equal(found["d2.visibility_radius"], [0.25, 2.5, 3.0])
    here = found.sel({"d1.visibility_radius": 5.0, "d2.visibility_radius": 2.5, "horizon": 1.0})
    there = found.isel({"defenders.0.visibility_radius": 1, "defenders.1.visibility_radius": 1, "horizon": 1})
    np.testing.assert_array_equal(here["count"], there["count"])
    found.to_netcdf(tmp_path / "sweep.nc", engine="scipy")
