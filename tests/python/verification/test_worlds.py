"""`verify` on games with failures, reports and disturbances, and records of them spoilt on purpose."""

import dataclasses

import numpy as np
import pytest

import tadcore
from tadcore import verification as v
from tadcore.verification.checks.claims import AROUND, RECORD

FAILS = {"sensing": {"mean_time_to_failure": 0.5, "mean_time_to_repair": 0.2, "mean_time_detected": 0.6}}
TALKS = {
    "communication": {"radius": 2.0, "relays": 1, "mean_time_up": 0.5, "mean_time_down": 0.2, "begin": "stationary"}
}
SHAKES = {"*.disturbance": 0.05}
NAMES = ("paper-i1", "paper-i2")


@pytest.fixture(scope="module", params=NAMES)
def run(request):
    return tadcore.simulate(tadcore.scenarios.load(request.param).replace(FAILS | TALKS | SHAKES), seed=7, trial=3)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("changes", [FAILS, TALKS, SHAKES, FAILS | TALKS, {"communication.radius": 1.5}])
def test_verify_accepts_such_runs(name, changes):
    sc = tadcore.scenarios.load(name).replace(changes)
    report = v.verify(tadcore.simulate(sc, seed=3, trial=1), deviations=1, instants=3)
    assert report.status == "passed", report
    assert {check.name for check in report if check.name.startswith("record.")} == (
        RECORD.keys() - {"record.network"} | AROUND.keys()
    )


def refused(run, check, course=(), **changes):
    """The failures of a spoilt record; the first of them is `check`."""
    spoilt = dataclasses.replace(run, course=dataclasses.replace(run.course, **dict(course)), **changes)
    report = v.check_record(spoilt, tadcore.solve_equilibrium(spoilt.scenario))
    failures = [found.name for found in report.failures]
    assert failures, "accepted"
    assert failures[0] == check, report
    return failures


def flipped(array, where):
    copy = array.copy()
    copy[where] ^= True
    return copy


def test_the_record_itself_is_accepted(run):
    assert v.check_record(run, tadcore.solve_equilibrium(run.scenario)).status == "passed"
    assert run.relayed.any()
    assert run.sensor_outages


@pytest.mark.parametrize("key", [{"trial": 4}, {"seed": 8}, {"trial": 3 + 2**32}])
def test_the_draws_of_another_trial(run, key):
    assert "record.displacement" in refused(run, "record.failures", key)


@pytest.mark.parametrize(
    "changes",
    [
        {"sensing.mean_time_to_failure": 0.3},
        {"sensing.mean_time_to_repair": 0.3},
        {"sensing.mean_time_detected": 0.3},
        {"d1.sensing.begin": "stationary"},
    ],
)
def test_other_mean_times(run, changes):
    other = tadcore.simulate(run.scenario.replace(changes), seed=7, trial=3)
    assert "record.failures" in refused(dataclasses.replace(other, scenario=run.scenario), "record.failures")


def test_a_wrong_mask(run):
    """A sensor that has failed and goes on to see, and one that works and does not."""
    course = run.course
    seen = course.seen | ~course.sensor_up[:, :, None]
    refused(run, "record.seen", {"seen": seen, "sensor_up": course.sensor_up})
    k, i, j = np.argwhere(course.seen[:-1])[0]
    refused(run, "record.seen", {"seen": flipped(course.seen, (k, i, j))})
    assert "record.failures" in refused(run, "record.failures", {"sensor_up": flipped(course.sensor_up, (5, 1))})
    refused(run, "record.failures", {"edge_up": flipped(course.edge_up, (9, 1, 2))})


def test_a_wrong_relay(run):
    """What a player would use who was told more, less, or nothing; whom it hears, wrongly."""
    refused(run, "record.relay", adjacency=run.seen)
    k, i, _ = np.argwhere(run.relayed[:-1])[0]
    refused(run, "record.relay", adjacency=flipped(run.adjacency, (k, i)))
    k, i, j = np.argwhere(run.course.heard[:-1])[0]
    refused(run, "record.contacts", {"heard": flipped(run.course.heard, (k, i, j))})
    assert "record.relay" in refused(run, "record.contacts", {"heard": np.zeros_like(run.course.heard)})


@pytest.mark.parametrize("changes", [{"communication.relays": 0}, {"communication.frame": "common"}])
def test_another_rule_of_reports(run, changes):
    other = tadcore.simulate(run.scenario.replace(changes), seed=7, trial=3)
    assert not np.array_equal(other.adjacency, run.adjacency[: len(other.adjacency)])
    refused(dataclasses.replace(other, scenario=run.scenario), "record.relay")


def test_another_radius_of_links(run):
    other = tadcore.simulate(run.scenario.replace({"communication.radius": 1.0}), seed=7, trial=3)
    refused(dataclasses.replace(other, scenario=run.scenario), "record.contacts")


def test_a_wrong_displacement(run):
    displacement = run.course.displacement
    refused(run, "record.displacement", {"displacement": 1.001 * displacement})
    assert "record.motion" in refused(run, "record.displacement", {"displacement": 0 * displacement})
    other = tadcore.simulate(run.scenario.replace({"*.disturbance": 0.06}), seed=7, trial=3)
    refused(dataclasses.replace(other, scenario=run.scenario), "record.displacement")
    drifted = run.position.copy()
    drifted[1:] += 1e-6
    refused(run, "record.attacker", position=drifted)


def test_a_course_that_is_not_whole(run):
    for course in (None, dataclasses.replace(run.course, seen=run.course.seen[:-1])):
        report = v.check_record(dataclasses.replace(run, course=course), tadcore.solve_equilibrium(run.scenario))
        assert [found.name for found in report.failures] == ["record.arrays"]
    plain = tadcore.simulate(tadcore.scenarios.load("paper-i1"))
    report = v.check_record(dataclasses.replace(plain, course=run.course), tadcore.solve_equilibrium(plain.scenario))
    assert [found.name for found in report.failures] == ["record.arrays"]
