"""Every check passes on the paper's runs, and fails on something broken."""

import dataclasses
import json
import pickle
from types import SimpleNamespace

import numpy as np
import pytest

import tadcore
from tadcore import verification as v
from tadcore.cli import app as cli


@pytest.fixture(scope="module")
def run():
    return tadcore.simulate(tadcore.scenarios.load("paper-i1"))


@pytest.fixture(scope="module")
def run2():
    return tadcore.simulate(tadcore.scenarios.load("paper-i2"))


def solution(sc, **changes):
    """The equilibrium as plain data, some of it replaced."""
    eq = tadcore.solve_equilibrium(sc)
    base = {"times": eq.times, "P": dict(eq.P), "feedback": dict(eq.feedback)}
    return SimpleNamespace(**(base | changes))


@pytest.mark.parametrize("name", tadcore.scenarios.names())
def test_the_runs_of_the_paper_are_accepted(name):
    report = tadcore.verify(tadcore.scenarios.load(name), deviations=1, instants=6)
    assert report.ok, report
    assert report.require_ok() is report
    assert report.converged
    assert report.accepted
    assert not report.failures
    rooms = {check.name.split(".")[0] for check in report}
    assert rooms >= {"fne", "record", "nafne", "consistency", "gains"}


def test_a_run_is_verified_as_recorded(run):
    assert tadcore.verify(run, deviations=0, instants=1).ok
    late = run.control.copy()
    late[100, 1, 0] += 1e-6
    broken = tadcore.verify(dataclasses.replace(run, control=late), deviations=0, instants=1)
    assert [check.name for check in broken.failures] == ["record.control"]
    assert "d2 at t = 0.5" in broken["record.control"].detail


# ---- fne


@pytest.mark.parametrize("group", ["defenders", "target", "attacker"])
def test_a_wrong_p_is_found(run, group):
    sc = run.scenario
    P = dict(tadcore.solve_equilibrium(sc).P)
    P[group] = P[group].copy()
    P[group][400, 0, 0] += 1e-8 * np.abs(P[group]).max()
    broken = v.check_equilibrium(sc, solution(sc, P=P))
    assert not broken[f"fne.riccati.{group}"].accepted
    assert broken[f"fne.riccati.{group}"].detail in ("t = 1.995", "t = 2")
    P[group][-1] *= 1.0 + 1e-9
    assert not v.check_equilibrium(sc, solution(sc, P=P))["fne.terminal"].accepted


@pytest.mark.parametrize("name", ["paper-i1", "paper-i2"])
@pytest.mark.parametrize("player", ["d2", "target", "attacker"])
def test_a_wrong_feedback_is_found_and_leaves_a_regret(name, player):
    sc = tadcore.scenarios.load(name).replace(step=0.02)
    feedback = dict(tadcore.solve_equilibrium(sc).feedback)
    feedback[player] = 1.02 * feedback[player]
    broken = v.check_equilibrium(sc, solution(sc, feedback=feedback))
    assert not broken["fne.feedback"].accepted
    party = player if sc.interaction == "I1" and player != "d2" else "defenders" if sc.interaction == "I1" else "team"
    party = "attacker" if player == "attacker" else party
    check = broken[f"fne.regret.{party}"]
    assert check.converged
    assert not check.accepted
    assert check.value < 0.1


def test_who_can_win_without_bound_has_an_infinite_regret():
    sc = tadcore.scenarios.load("paper-i1").replace(step=0.05)
    still = np.zeros((sc.steps + 1, sc.n + 2, sc.n + 1))
    found = {response.party: response for response in v.best_responses(sc, still)}
    assert found["target"].best == -np.inf  # nobody follows it, and its reward grows faster than its effort
    assert found["target"].converged
    report = v.check_equilibrium(
        sc, solution(sc, feedback=dict(zip(sc.players, np.moveaxis(still, 1, 0), strict=True)))
    )
    assert report["fne.regret.target"].value == np.inf


def test_a_grid_too_coarse_to_play_between_is_not_converged():
    sc = tadcore.scenarios.load("paper-i1").replace(step=1.0)
    coarse = v.check_equilibrium(sc, tadcore.solve_equilibrium(sc))
    assert not coarse["fne.regret.target"].converged
    with pytest.raises(tadcore.VerificationError, match="not converged"):
        coarse.require_ok()
    assert v.check_equilibrium(sc).ok  # without a given solution, a finer one is made


# ---- record


def broken_record(run, **changes):
    return v.check_record(dataclasses.replace(run, **changes), tadcore.solve_equilibrium(run.scenario))


def test_a_wrong_record_is_found(run):
    gains, position, adjacency = run.gains.copy(), run.position.copy(), run.adjacency.copy()
    gains[50:60] *= 1.0 + 1e-6
    assert not broken_record(run, gains=gains)["record.motion"].accepted
    assert not broken_record(run, gains=gains)["record.theta"].accepted
    position[70, 1] += 1e-7
    moved = broken_record(run, position=position)["record.motion"]
    assert not moved.accepted
    assert moved.detail == "t = 0.35"
    adjacency[10, 2, 0] ^= True
    assert not broken_record(run, adjacency=adjacency)["record.network"].accepted
    assert not broken_record(run, theta_terms=run.theta_terms * (1 + 1e-8))["record.theta"].accepted


def test_a_gain_on_someone_out_of_sight_is_found(run):
    k, i, j = np.argwhere(~run.adjacency[:-1])[0]
    gains = run.gains.copy()
    gains[k, i, j] += 1e-8
    assert not broken_record(run, gains=gains)["record.admissible"].accepted
    k, i = np.argwhere(~run.adjacency[:-1].diagonal(axis1=1, axis2=2))[0]  # does not see the attacker
    gains = run.gains.copy()
    gains[k, i, i] += 1e-8
    assert not broken_record(run, gains=gains)["record.admissible"].accepted


# ---- nafne


@pytest.mark.parametrize("which", ["run", "run2"])
def test_indices_of_another_game_are_found(which, request):
    run = request.getfixturevalue(which)
    sc = run.scenario
    other = tadcore.solve_equilibrium(sc.replace({"target.control_weight": 1.2001}))
    report = v.check_nafne(run, other, deviations=1)
    failed = {check.name for check in report.failures}
    parties = ["defenders", "target", "attacker"] if sc.interaction == "I1" else ["team"]
    for party in parties:
        assert {f"nafne.value.{party}", f"nafne.as_played.{party}"} <= failed
    assert {"nafne.deviation.attacker", "nafne.deviation.target", "nafne.deviation.d1"} <= failed


def test_a_profile_from_which_someone_gains_is_found(run):
    """Values of half the size: the feedback built on them is beaten."""
    eq = tadcore.solve_equilibrium(run.scenario)
    halved = solution(run.scenario, P={name: 0.5 * P for name, P in eq.P.items()})
    report = v.check_nafne(run, halved, deviations=4)
    gains = {check.name: check for check in report if check.name.startswith("nafne.gain.")}
    assert gains
    assert any(not check.accepted for check in gains.values())


def test_values_that_escape_are_reported_not_raised(run):
    for factor in (1e9, -1e9):  # the states overflow; the Riccati equation escapes inside a step
        P = {name: factor * P for name, P in tadcore.solve_equilibrium(run.scenario).P.items()}
        report = v.check_nafne(run, solution(run.scenario, P=P))
        assert not report.accepted
        assert not report.converged


def test_who_sees_nobody_has_no_deviation(run2):
    report = v.check_nafne(run2, deviations=1)
    assert any(note.startswith("d3 sees nobody") for note in report.notes)
    assert "nafne.deviation.d3" not in {check.name for check in report}


def test_a_stiff_step_is_cut_and_one_too_long_is_not_converged(monkeypatch):
    sc = tadcore.scenarios.load("paper-i1").replace(step=1.0)
    report = v.check_nafne(tadcore.simulate(sc), deviations=1)
    assert report.ok, report
    monkeypatch.setattr(v.oracle.adapted, "_PIECES", 1)
    report = v.check_nafne(tadcore.simulate(sc), deviations=1)
    assert not report.converged
    with pytest.raises(tadcore.VerificationError):
        report.require_ok()


# ---- consistency


def test_inconsistent_gains_are_found(run):
    eq = tadcore.solve_equilibrium(run.scenario)
    k = int(np.flatnonzero(run.adjacency[:-1].all(axis=(1, 2)))[3])
    for field, name in (("gains", "gains"), ("control", "control"), ("theta", "theta")):
        values = getattr(run, field).copy()
        values[k] += 1e-6
        broken = v.check_consistency(dataclasses.replace(run, **{field: values}), eq)
        assert [check.name for check in broken.failures] == [f"consistency.run.{name}"]
    other = tadcore.solve_equilibrium(run.scenario.replace({"target.control_weight": 1.3}))
    assert not v.check_consistency(run, other)["consistency.synthesis"].accepted


def test_a_synthesis_that_misses_zero_is_found(run, monkeypatch):
    real = v.checks.consistency.synthesize

    def worse(sc, **options):
        return dataclasses.replace(real(sc, **options), theta=1e-9)

    monkeypatch.setattr(v.checks.consistency, "synthesize", worse)
    report = v.check_consistency(run, tadcore.solve_equilibrium(run.scenario))
    assert not report["consistency.theta"].accepted


def test_the_terms_of_theta_over_time(run):
    distance = v.index_distance(run)
    assert dict(distance.sizes) == {"time": 280, "name": 4}
    limited = ~distance.everyone.values
    assert np.allclose(distance.share.values[limited].sum(axis=1), 1.0)
    assert distance.theta.values[~limited].max() < 1e-25
    assert distance.everyone.sel(time=0.96, method="nearest").item()


# ---- gains


def test_gains_that_are_no_minimum_are_found(run):
    eq = tadcore.solve_equilibrium(run.scenario)
    off = run.gains.copy()
    off[40] *= 1.0 + 1e-7
    report = v.check_gains(dataclasses.replace(run, gains=off), eq, instants=1)
    assert [check.name for check in report.failures] == ["gains.gradient"]
    assert report["gains.gradient"].detail == "t = 0.2"
    off[0] *= 1.05
    worse = v.check_gains(dataclasses.replace(run, gains=off), eq, instants=1, starts=2)
    assert not worse["gains.multistart"].accepted
    assert not v.check_gains(dataclasses.replace(run, unconverged=2), eq, instants=1)["gains.solver"].accepted


def test_a_saddle_is_found():
    """With γ on ΔQ_d alone, standing still is a critical point of Θ₁ and its highest."""
    sc = tadcore.scenarios.load("paper-i1").replace(synthesis_weights=(1, 0, 0, 0))
    run = tadcore.simulate(sc)
    still = dataclasses.replace(run, gains=np.zeros_like(run.gains))
    report = v.check_gains(still, tadcore.solve_equilibrium(sc), instants=3)
    assert report["gains.gradient"].accepted
    assert not report["gains.curvature"].accepted


def test_rates_of_the_certificate():
    sc = tadcore.scenarios.load("paper-i2").replace(step=0.05)
    rates = v.certificate_rates(sc, trials=12, starts=1, seed=3)
    assert rates.trials == rates.converged == rates.curved == sum(rates.starts.values()) == 12
    assert 0 < rates.certified < 12
    assert rates.beaten == rates.beaten_certified == 0
    assert rates == v.certificate_rates(sc, trials=12, starts=1, seed=3)


# ---- the report and the command


def test_the_report_reads_and_serialises(run):
    report = tadcore.verify(run, deviations=1, instants=1)
    data = json.loads(json.dumps(report.to_dict(), allow_nan=False))
    assert data["ok"]
    assert len(data["checks"]) == len(report)
    assert "thm:thm1" in repr(report)
    assert "37 of" not in report.title
    failed = v.Check("a.b", np.inf, 1.0, True, "do this", "eq:x")
    assert v.VerificationReport("t", (failed,)).to_dict()["checks"][0]["value"] == "inf"
    with pytest.raises(tadcore.VerificationError, match=r"a\.b: not accepted, measured inf .* do this") as caught:
        v.VerificationReport("t", (failed,)).require_ok()
    assert pickle.loads(pickle.dumps(caught.value)).check == "a.b"
    assert isinstance(caught.value, tadcore.TadcoreError)
    assert not v.Check("a", np.nan, 1.0, True, "", "").accepted
    with pytest.raises(KeyError):
        report["no.such"]


def test_other_things_are_refused():
    with pytest.raises(tadcore.ScenarioError, match="scenario: got 5, must be a Scenario, the path of a TOML file"):
        tadcore.verify(5)


def test_a_game_that_is_over_at_once(run):
    sc = run.scenario.replace({"defenders[0].position": [-2.0, 2.0]})
    report = tadcore.verify(sc)
    assert report.ok
    assert "over at t = 0" in report.notes[0]


def test_the_command(tmp_path, capsys, monkeypatch):
    out = tmp_path / "report.json"
    cli.app(["verify", "paper-i1", "--deviations", "1", "--out", str(out)], standalone_mode=False)
    assert "accepted" in capsys.readouterr().out
    assert json.loads(out.read_text())["ok"]
    failed = v.VerificationReport("t", (v.Check("a.b", 2.0, 1.0, True, "do this", "eq:x"),))
    monkeypatch.setattr(v, "verify", lambda *_, **__: failed)
    with pytest.raises(SystemExit) as exit_:
        cli.main(["verify", "paper-i1"])
    assert exit_.value.code == 1
    said = capsys.readouterr()
    assert "do this" in said.out
    assert "1 of 1 checks do not pass" in said.err
    with pytest.raises(SystemExit) as exit_:
        cli.main(["verify", "nowhere.toml"])
    assert exit_.value.code == 2
