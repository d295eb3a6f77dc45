"""The explorer's sliders of links and mean times: each plays the scenario that it says."""

import math

import numpy as np
import pytest

import tadcore

pytest.importorskip("bokeh")

from tadcore.explorer import Explorer, Page
from tadcore.explorer.surroundings import RADIUS, surroundings_of, tables_of

COARSE = {"step": 0.04}


def page_of(changes=None):
    return Page(Explorer(tadcore.scenarios.load("paper-i1").replace(COARSE | (changes or {}))))


def plays(page, changes, trial=0):
    """Whether the page shows what the scenario with these changes plays."""
    expected = tadcore.simulate(tadcore.scenarios.load("paper-i1").replace(COARSE | changes), trial=trial)
    np.testing.assert_array_equal(page.explorer.run.position, expected.position)
    np.testing.assert_array_equal(page.explorer.run.adjacency, expected.adjacency)
    assert str(expected.outcome) in page.status.text
    assert surroundings_of(page.explorer.scenario) == surroundings_of(expected.scenario)
    return expected


def test_links_are_switched_on_stretched_and_off():
    page = page_of()
    slider, switch = page.around.sliders[RADIUS]
    assert (slider.value, switch.active, page.trial.visible) == (0.0, False, False)
    slider.value = 2.0
    assert plays(page, {RADIUS: 2.0}).relayed.any()
    switch.active = True
    plays(page, {RADIUS: math.inf})
    assert slider.disabled
    switch.active = False
    slider.value = 0.0
    plays(page, {})
    assert page.explorer.scenario.communication is None


def test_mean_times_are_chosen_and_trials_drawn():
    page = page_of()
    for path, value in (("sensing.mean_time_to_repair", 0.2), ("sensing.mean_time_to_failure", 0.5)):
        slider, switch = page.around.sliders[path]
        assert switch.active
        switch.active = False
        slider.value = value
    changes = {"sensing": {"mean_time_to_failure": 0.5, "mean_time_to_repair": 0.2}}
    first = plays(page, changes)
    assert first.sensor_outages
    assert page.trial.visible
    page.trial.value = 3
    assert not np.array_equal(plays(page, changes, trial=3).adjacency, first.adjacency)
    # A link's mean times say nothing without a link, and are there as soon as there is one.
    for path, value in (("communication.mean_time_up", 0.3), (RADIUS, 2.0)):
        slider, switch = page.around.sliders[path]
        switch.active = False
        slider.value = value
    plays(page, changes | {"communication": {"radius": 2.0, "mean_time_up": 0.3}}, trial=3)
    page.around.sliders["sensing.mean_time_to_failure"][1].active = True
    page.around.sliders["communication.mean_time_up"][1].active = True
    plays(page, {RADIUS: 2.0})
    assert not page.trial.visible


def test_sliders_begin_at_what_the_scenario_says_and_keep_the_rest():
    given = {
        "communication": {"radius": 15.0, "relays": 1, "frame": "common", "mean_time_up": 0.4, "begin": "stationary"},
        "sensing": {"mean_time_detected": 0.7, "mean_time_missed": 0.003},
        "d1.communication.radius": 0.5,
    }
    page = page_of(given)
    values = {path: math.inf if s[1].active else s[0].value for path, s in page.around.sliders.items()}
    assert values == surroundings_of(page.explorer.scenario)
    assert page.around.sliders[RADIUS][0].end == 15.0
    sc = page.explorer.scenario
    assert sc.replace(tables_of(sc, values)) == sc
    page.around.sliders[RADIUS][0].value = 1.5
    plays(page, given | {"communication": given["communication"] | {"radius": 1.5}})
    assert page.explorer.scenario.communication.relays == 1
    assert page.explorer.scenario.defenders[0].communication.radius == 0.5


def test_what_is_refused_goes_back_and_a_team_of_one_has_no_links():
    page = page_of({"d1.communication": {"mean_time_up": 1.0}, RADIUS: 1.0})
    page.around.sliders[RADIUS][0].value = 0.0  # d1's own mean time would say nothing
    assert "mean_time_up" in page.status.text
    assert page.around.sliders[RADIUS][0].value == page.explorer.scenario.communication.radius == 1.0
    sc = tadcore.scenarios.load("paper-i1")
    alone = sc.replace({"defenders": [sc.defenders[0].model_dump(exclude_unset=True)]} | COARSE)
    assert not [path for path in Page(Explorer(alone)).around.sliders if path.startswith("communication")]
