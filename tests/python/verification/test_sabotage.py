"""Records spoilt on purpose, one thing at a time: each is refused, by the check that names the cause.

Some are the library's own record of another game, presented as a record of this one: what a simulator would give that
reads a wrong number. The others have one array or count changed.
"""

import dataclasses
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import tadcore
from tadcore import verification as v
from tadcore.game import Divergence
from tadcore.game.outcome import Outcome
from tadcore.verification.checks.claims import AROUND, RECORD

RECORD_ARRAYS = ("times", "position", "control", "adjacency", "gains", "theta", "theta_terms")

NAMES = ("paper-i1", "paper-i2", "paper-i1-suicidal")


@pytest.fixture(scope="module", params=NAMES)
def run(request):
    return tadcore.simulate(tadcore.scenarios.load(request.param))


def refused(run, check, **changes):
    """The failures of a spoilt record; the first of them is `check`, which says what to do."""
    spoilt = dataclasses.replace(run, **changes)
    report = v.check_record(spoilt, tadcore.solve_equilibrium(spoilt.scenario))
    failures = [found.name for found in report.failures]
    assert failures, f"accepted: {changes.keys()}"
    assert failures[0] == check, report
    assert report.status == "failed"
    assert report[check].remedy == RECORD[check].remedy
    with pytest.raises(tadcore.VerificationError) as caught:
        report.require_ok()
    assert RECORD[check].remedy in str(caught.value)
    return failures


def played_instead(run, **paths):
    """The record of another scenario as one of this scenario."""
    other = tadcore.simulate(run.scenario.replace(paths))
    return dataclasses.replace(other, scenario=run.scenario)


def changed(array, where, by):
    """A copy with one entry, or several, moved by a share of the array's size."""
    copy = array.copy()
    copy[where] += by * max(float(np.abs(array).max()), 1.0)
    return copy


def test_the_record_itself_is_accepted(run):
    report = v.check_record(run, tadcore.solve_equilibrium(run.scenario))
    assert report.status == "passed", report
    assert [check.name for check in report] == [*(name for name in RECORD)]


# ---- a simulator that reads a wrong number


def catcher(run):
    """The player whose radius decides the end."""
    i = run.outcome.defender
    return "attacker" if i is None else f"d{i + 1}"


def test_a_smaller_capture_radius_ends_too_late(run):
    other = played_instead(run, **{f"{catcher(run)}.capture_radius": 0.02})
    assert len(other.times) > len(run.times)
    refused(other, "record.outcome")


def test_a_larger_capture_radius_ends_too_early(run):
    i = run.outcome.defender
    radius = run.scenario.capture_radii[run.scenario.n if i is None else i]
    other = played_instead(run, **{f"{catcher(run)}.capture_radius": 1.3 * radius})
    assert len(other.times) < len(run.times)
    refused(other, "record.outcome")


def test_a_radius_of_another_player_changes_nothing_and_is_no_fault(run):
    """σ of a player that comes near nobody: the same record, and accepted."""
    i = run.outcome.defender
    idle = "attacker" if i is not None else "d3"
    other = played_instead(run, **{f"{idle}.capture_radius": 0.01})
    assert np.array_equal(other.position, run.position)
    assert v.check_record(other, tadcore.solve_equilibrium(run.scenario)).ok


def test_a_wrong_start(run):
    other = played_instead(run, **{"d2.position.x": float(run.position[0, 1, 0]) + 1e-9})
    assert "record.start" in refused(other, "record.start")


def test_a_wrong_visibility_radius(run):
    sight = np.linalg.norm(run.position[:-1, 0] - run.position[:-1, 1], axis=1)
    radius = float(sight[0]) * (0.9 if sight[0] < run.scenario.visibility_radii[0] else 1.1)
    other = played_instead(run, **{"d1.visibility_radius": max(radius, 0.2)})
    refused(other, "record.network")


@pytest.mark.parametrize("path", ["target.control_weight", "attacker.control_weight", "d1.control_weight"])
def test_a_wrong_weight(run, path):
    other = played_instead(run, **{path: 1.37})
    if run.scenario.attacker.evasion == 0.0 and path.startswith("d"):  # the feedback of the others is the same
        failures = refused(other, "record.theta")
    else:
        failures = refused(other, "record.motion")
        assert "record.control" in failures
    assert "record.costs" in failures


def test_wrong_weights_of_the_synthesis(run):
    gamma = (0.4, 0.2, 0.2, 0.2) if run.scenario.interaction == "I1" else (0.5, 0.25, 0.25)
    other = played_instead(run, synthesis_weights=gamma)
    if not run.adjacency.all():
        assert "record.synthesis" in refused(other, "record.theta")


def test_another_step(run):
    other = played_instead(run, step=run.scenario.step / 2.0)
    report = v.check_record(other, tadcore.solve_equilibrium(run.scenario))
    assert report.status == "failed"
    assert report.failures[0].name in ("record.arrays", "record.times")


# ---- the end


@pytest.mark.parametrize("kind", ["captured", "timeout", "intercepted", "escaped"])
@pytest.mark.parametrize("defender", [None, 0, 1, 2, 7, -1])
def test_another_end(run, kind, defender):
    outcome = Outcome(kind, defender, run.outcome.time)
    if outcome != run.outcome:
        refused(run, "record.outcome", outcome=outcome)


@pytest.mark.parametrize("steps", [-1, 1, 1e-9])
def test_an_end_at_another_time(run, steps):
    late = dataclasses.replace(run.outcome, time=run.outcome.time + steps * run.scenario.step)
    refused(run, "record.outcome", outcome=late)


def cut(run, rows, **changes):
    """The first rows of every array."""
    arrays = ("times", "position", "control", "adjacency", "gains", "theta", "theta_terms")
    return {name: getattr(run, name)[:rows] for name in arrays} | changes


def test_a_record_cut_short(run):
    counts = {"certified": min(run.certified, len(run.times) - 5)}
    refused(run, "record.outcome", **cut(run, -5, **counts))
    early = dataclasses.replace(run.outcome, time=float(run.times[-6]))
    failures = refused(run, "record.outcome", **cut(run, -5, outcome=early, **counts))
    assert "record.costs" in failures


@pytest.mark.parametrize("name", ["times", "position", "control", "adjacency", "gains", "theta", "theta_terms"])
def test_one_array_cut_short_or_of_another_kind(run, name):
    whole = getattr(run, name)
    for spoilt in (whole[:-1], whole[:0], whole[..., None], whole.tolist(), None, whole.astype(np.float32)):
        report = v.check_record(dataclasses.replace(run, **{name: spoilt}), None)
        assert [check.name for check in report.failures] == ["record.arrays"]
        with pytest.raises(tadcore.VerificationError, match=r"record\.arrays: not accepted"):
            report.require_ok()
    if whole.dtype == np.float64:
        for bad in (np.nan, np.inf):
            spoilt = whole.copy()
            spoilt[len(whole) // 2] = bad
            report = v.check_record(dataclasses.replace(run, **{name: spoilt}), None)
            assert [check.name for check in report.failures] == ["record.arrays"]
            assert f"{name} is not finite in row {len(whole) // 2}" in report["record.arrays"].detail


# ---- time, motion, controls


@pytest.mark.parametrize("row", [0, 1, 100, -1])
@pytest.mark.parametrize("by", [1e-12, -1e-3, 0.005, np.nextafter])
def test_a_time_stamp_shifted(run, row, by):
    times = run.times.copy()
    times[row] = by(times[row], np.inf) if callable(by) else times[row] + by
    assert refused(run, "record.times", times=times)[:1] == ["record.times"]


def drift(run, players, rate):
    """Positions that drift along the line from the attacker to the target."""
    along = run.position[0, -2] - run.position[0, -1]
    position = run.position.copy()
    position[:, players] += rate * run.times[:, None, None] * along / np.linalg.norm(along)
    return position


@pytest.mark.parametrize("rate", [1e-6, -0.01])
def test_a_drift_of_everyone_along_the_line(run, rate):
    """No distance changes: only the attacker's own path tells."""
    assert refused(run, "record.attacker", position=drift(run, slice(None), rate)) == ["record.attacker"]


@pytest.mark.parametrize("player", range(5))
def test_a_drift_of_one_player(run, player):
    failures = refused(run, "record.motion", position=drift(run, [player], 1e-5))
    assert "record.attacker" in failures or player != 4


@pytest.mark.parametrize("row", [1, 50, -2])
def test_one_position(run, row):
    for player in range(5):
        refused(run, "record.motion", position=changed(run.position, (row, player, 1), 1e-9))


@pytest.mark.parametrize("row", [0, 50, -2])
def test_one_entry_of_a_control(run, row):
    for player in range(5):
        control = changed(run.control, (row, player, 0), 1e-9)
        assert refused(run, "record.control", control=control) == ["record.control"]


# ---- network, gains, Θ


@pytest.mark.parametrize("row", [0, 50, -2])
def test_an_edge_that_is_not_there_or_missing(run, row):
    for i, j in ((0, 0), (1, 2), (2, 3)):
        adjacency = run.adjacency.copy()
        adjacency[row, i, j] ^= True
        refused(run, "record.network", adjacency=adjacency)


def test_a_network_change_that_is_missing(run):
    changes = np.flatnonzero((run.adjacency[1:-1] != run.adjacency[:-2]).any(axis=(1, 2))) + 1
    for k in changes:
        adjacency = run.adjacency.copy()
        adjacency[k] = adjacency[k - 1]  # one step late
        refused(run, "record.network", adjacency=adjacency)
    refused(run, "record.network", adjacency=np.broadcast_to(~run.adjacency[:1], run.adjacency.shape).copy())


def test_gains(run):
    """A gain on somebody in sight; of who does not see the attacker the row no longer sums to zero."""
    for k, i, j in np.argwhere(run.adjacency[:-1] & (np.abs(run.gains[:-1]) > 1e-3))[40:400:40]:
        gains = changed(run.gains, (k, i, j), 1e-7)
        failures = refused(run, "record.motion" if run.adjacency[k, i, i] else "record.admissible", gains=gains)
        assert "record.synthesis" in failures


@pytest.mark.parametrize("row", [0, 50, -2])
def test_theta_and_its_terms(run, row):
    assert refused(run, "record.theta", theta=changed(run.theta, row, 1e-8)) == ["record.theta"]
    for term in range(run.theta_terms.shape[1]):
        terms = changed(run.theta_terms, (row, term), 1e-8)
        assert refused(run, "record.theta", theta_terms=terms) == ["record.theta"]


# ---- costs


def test_costs(run):
    costs = run.costs
    first = next(iter(costs))
    for spoilt in (
        dict.fromkeys(costs, 0.0),
        {name: -value for name, value in costs.items()},
        costs | {first: costs[first] * (1.0 + 1e-9)},
        costs | {first: np.nan},
        costs | {first: np.inf},
        {},
        costs | {"spectators": 1.0},
        {name: value for name, value in costs.items() if name != first},
        None,
        {name: str(value) for name, value in costs.items()},
    ):
        assert refused(run, "record.costs", costs=spoilt) == ["record.costs"]
    if len(costs) == 3:
        swapped = costs | {"target": costs["attacker"], "attacker": costs["target"]}
        assert refused(run, "record.costs", costs=swapped) == ["record.costs"]


# ---- the last row and the counts


@pytest.mark.parametrize("name", ["control", "gains", "theta", "theta_terms"])
def test_the_last_row(run, name):
    array = getattr(run, name)
    entry = (-1, *(0 for _ in array.shape[1:]))
    for spoilt in (changed(array, entry, 1e-6), np.concatenate([array[:-1], 0.0 * array[-1:] + 0.1])):
        assert refused(run, "record.last_row", **{name: spoilt})[0] == "record.last_row"


def test_the_network_of_the_last_row(run):
    adjacency = run.adjacency.copy()
    adjacency[-1, 0, 1] ^= True
    refused(run, "record.last_row", adjacency=adjacency)


def test_the_number_of_proofs(run):
    rows = len(run.times)
    for count in {0, run.certified - 1, run.certified + 1, rows} - {run.certified, rows + 1, -1}:
        assert refused(run, "record.certified", certified=count) == ["record.certified", "record.synthesis"]
    refused(run, "record.arrays", certified=rows + 1)
    refused(run, "record.arrays", certified=True)


def test_the_counts_of_the_solver(run):
    refused(run, "record.synthesis", iterations=run.iterations + 1)
    refused(run, "record.synthesis", unconverged=1)
    refused(run, "record.arrays", iterations=-1)
    refused(run, "record.arrays", iterations=None)


def with_failures(run):
    """The scenario of a run with sensors that fail."""
    return run.scenario.replace({"sensing.mean_time_to_failure": 0.5})


@pytest.mark.parametrize("field", [f.name for f in dataclasses.fields(tadcore.Run)])
def test_nothing_that_a_run_carries_is_left_unchecked(run, field):
    """A field that is added to the record needs a check, and a line here."""
    found = getattr(run, field)
    if field == "scenario":
        other = found.replace({"horizon": found.horizon + 10 * found.step})
    elif field == "course":  # tests/python/verification/test_worlds.py spoils what is in it
        other = tadcore.simulate(with_failures(run), seed=1).course
    elif field == "outcome":
        other = dataclasses.replace(found, time=0.5 * found.time)
    elif field in ("hysteresis", "dwell"):
        with pytest.raises(tadcore.ScenarioError, match=field):
            tadcore.verify(dataclasses.replace(run, **{field: 0.1}))
        return
    elif field == "termination":
        with pytest.raises(tadcore.ScenarioError, match="continuous"):
            tadcore.verify(dataclasses.replace(run, termination="continuous"))
        return
    elif field in ("turning", "mirror"):
        with pytest.raises(tadcore.ScenarioError, match="turning gains"):
            tadcore.verify(dataclasses.replace(run, **{field: True}))
        return
    elif field == "passes":
        other = (*found, "d1 passes at t = 0")
    elif field == "adjacency":
        other = ~found
    elif field == "diverged":
        other = Divergence(float(run.times[-1]), 2e3)
    elif field == "costs":
        other = {name: 2.0 * cost for name, cost in found.items()}
    else:
        other = found + 1
    spoilt = dataclasses.replace(run, **{field: other})
    assert v.check_record(spoilt, tadcore.solve_equilibrium(spoilt.scenario)).status == "failed"


# ---- a game that is over at once


def test_a_game_over_at_once_is_checked_too():
    sc = tadcore.scenarios.load("paper-i1").replace({"d1.position": [-2.0, 2.0]})
    run = tadcore.simulate(sc)
    assert len(run.times) == 1
    assert tadcore.verify(run).ok
    refused(run, "record.outcome", outcome=Outcome("captured", None, 0.0))
    refused(run, "record.costs", costs=dict.fromkeys(run.costs, 0.0))
    refused(run, "record.network", adjacency=~run.adjacency)
    refused(run, "record.start", position=run.position + 1.0)
    refused(run, "record.last_row", control=0.0 * run.control)
    refused(run, "record.times", times=run.times + 1.0)
    assert not tadcore.verify(dataclasses.replace(run, theta=run.theta + 1.0)).ok


# ---- whole reports


def test_the_whole_report_refuses_and_names_the_cause(run):
    spoilt = dataclasses.replace(run, position=drift(run, slice(None), 0.01))
    report = tadcore.verify(spoilt, deviations=0, instants=1)
    assert report.status == "failed"
    assert "record.attacker" in {check.name for check in report.failures}
    assert RECORD["record.attacker"].remedy in repr(report)


@pytest.mark.parametrize(("field", "check"), [("P", "fne.riccati"), ("feedback", "fne.feedback")])
@pytest.mark.parametrize("row", [0, 217, -2])
def test_one_wrong_row_of_the_equilibrium(run, field, check, row, monkeypatch):
    """P at one node, or one row of the feedback, also beyond the end of the run."""
    eq = tadcore.solve_equilibrium(run.scenario)
    parts = {"times": eq.times, "P": dict(eq.P), "feedback": dict(eq.feedback)}
    name, array = next(iter(parts[field].items()))
    parts[field][name] = changed(array, (row, *(0 for _ in array.shape[1:])), 1e-8)
    spoilt = SimpleNamespace(**parts)
    report = v.check_equilibrium(run.scenario, spoilt)
    assert report.failures[0].name.startswith(check), report
    monkeypatch.setattr(v.every_check, "solve_equilibrium", lambda _: spoilt)
    whole = tadcore.verify(run, deviations=0, instants=1)
    assert whole.failures[0].name.startswith(check)


def test_a_record_that_is_not_whole_ends_the_report(run):
    report = tadcore.verify(dataclasses.replace(run, times=run.times[:-1]))
    assert [check.name for check in report.failures] == ["record.arrays"]
    assert "position has shape" in report["record.arrays"].detail
    assert "not whole" in report.notes[-1]


def test_the_table_in_the_documentation_is_that_of_the_claims():
    page = (Path(__file__).parents[3] / "docs" / "verification.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `(record\.\w+)` \| (\S+) \| (.*) \|$", page, flags=re.MULTILINE)
    assert rows == [(name, f"{claim.bound:g}", claim.remedy) for name, claim in (RECORD | AROUND).items()]


# ---- a divergence that is hidden, invented, or told otherwise


def test_a_divergence_is_recomputed(run):
    refused(run, "record.divergence", diverged=Divergence(float(run.times[-1]), 2e3))
    lost = tadcore.simulate(tadcore.scenarios.load("paper-i2").replace({"attacker.control_weight": 0.38}))
    equilibrium = tadcore.solve_equilibrium(lost.scenario)
    assert v.check_record(lost, equilibrium)["record.divergence"].status == "passed"
    k = int(np.searchsorted(lost.times, lost.diverged.time))
    size = lost.diverged.size
    for other in (
        None,
        Divergence(float(lost.times[k - 1]), size),
        Divergence(float(lost.times[k + 1]), size),
        Divergence(lost.diverged.time, size * (1 + 1e-6)),
        Divergence(lost.diverged.time + 1e-4, size),
    ):
        refused(lost, "record.divergence", diverged=other)


def test_an_invented_divergence_does_not_excuse_a_record_that_is_cut_short(run):
    half = {name: getattr(run, name)[:100] for name in RECORD_ARRAYS} | {"certified": 100}
    invented = dataclasses.replace(run, **half, diverged=Divergence(float(run.times[20]), 1e125))
    report = v.verify(invented)
    assert report.status == "failed"
    assert [check.name for check in report.failures] == ["record.divergence"]
    unstable = {"attacker.control_weight": 0.3, "horizon": 40.0, "step": 0.05}
    lost = tadcore.simulate(tadcore.scenarios.load("paper-i2").replace(unstable))
    assert lost.times[-1] < lost.outcome.time
    report = v.verify(lost)
    assert report.status == "undecided"
    assert [check.name for check in report.undecided] == ["play"]
    for name, field, change in (
        ("record.start", "position", lambda x: x + 1e-6 * (np.arange(len(x)) == 0)[:, None, None]),
        ("record.times", "times", lambda t: t * (1.0 + 1e-15)),
        ("record.network", "adjacency", lambda seen: seen ^ (np.arange(len(seen)) == 9)[:, None, None]),
    ):
        spoilt = dataclasses.replace(lost, **{field: change(getattr(lost, field))})
        assert name in [check.name for check in v.verify(spoilt).failures]
    told = dataclasses.replace(lost, diverged=dataclasses.replace(lost.diverged, size=1e9))
    assert [check.name for check in v.verify(told).failures] == ["record.divergence"]
