"""What cannot be measured is undecided: never a failure, never NaN, never a raw error, and soon."""

import dataclasses
import json
import math
import time

import numpy as np
import pytest
from scipy.linalg import expm

import tadcore
from tadcore import verification as v
from tadcore.cli import app as cli
from tadcore.verification.oracle.matrices import matrices_of
from tadcore.verification.oracle.objective import FullObjective
from tadcore.verification.oracle.optimality import optimality
from tadcore.verification.oracle.sampled_data import sampled_steps

STIFF = {
    "one step": ("paper-i1", {"attacker.control_weight": 1e-12, "horizon": 1e-6, "step": 1e-6}),
    "a hundred steps": ("paper-i1", {"attacker.control_weight": 1e-12, "horizon": 1e-6, "step": 1e-8}),
    "no solution": ("paper-i1", {"attacker.control_weight": 1e-12}),
    "stiff steps": ("paper-i1", {"attacker.control_weight": 1e-5, "step": 1.0}),
    "cheap defenders": ("paper-i1", {"d1.control_weight": 1e-9, "horizon": 1e-3, "step": 1e-4}),
}


def in_words(report):
    """Everything that a report says."""
    return "\n".join([repr(report), json.dumps(report.to_dict(), allow_nan=False, ensure_ascii=False)])


@pytest.mark.parametrize("name", STIFF)
def test_a_stiff_game_is_undecided_and_soon(name):
    scenario, changes = STIFF[name]
    sc = tadcore.scenarios.load(scenario).replace(changes)
    begun = time.perf_counter()
    report = tadcore.verify(sc)
    assert time.perf_counter() - begun < 15.0
    assert report.status == "undecided", report
    assert report.undecided
    assert not report.failures
    assert not any(math.isnan(check.value) for check in report)
    assert "nan" not in in_words(report)
    assert "NOT CONVERGED" in repr(report)
    assert "FAILED" not in repr(report)
    with pytest.raises(tadcore.VerificationError, match="not converged"):
        report.require_ok()


def test_a_diverging_game_is_undecided():
    sc = tadcore.scenarios.load("paper-i2").replace({"attacker.control_weight": 0.3})
    report = tadcore.verify(sc, deviations=1, instants=2)
    assert report.status == "undecided", report
    assert "nan" not in in_words(report)
    assert all(math.isfinite(measured.value) for measured in report.measurements)


def test_a_fault_in_an_undecided_game_is_not_hidden():
    """What does not read P(t) decides, whether or not P(t) can be followed."""
    run = tadcore.simulate(tadcore.scenarios.load("paper-i2").replace({"attacker.control_weight": 0.3}))
    late = run.times.copy()
    late[3] += 1e-9
    report = tadcore.verify(dataclasses.replace(run, times=late))
    assert [check.name for check in report.failures] == ["record.times"]


def test_nan_is_no_measurement():
    check = v.Check("a", math.nan, 1.0, True, "do this", "eq:x")
    assert (check.status, check.value, check.converged, check.measured) == ("undecided", math.inf, False, False)
    report = v.VerificationReport("t", (check,), (v.Measurement("m", math.nan, "a mean"),))
    assert report.status == "undecided"
    assert report.measurements == ()
    assert report.notes == ("m could not be measured (a mean)",)
    assert report.to_dict()["checks"][0]["value"] is None
    assert "nan" not in in_words(report)
    with pytest.raises(tadcore.VerificationError, match="could not be measured"):
        report.require_ok()


def test_a_failure_outweighs_what_is_undecided():
    wrong = v.Check("b", 2.0, 1.0, True, "do this", "eq:x")
    vague = v.Check("a", 2.0, 1.0, False, "", "eq:x")
    fine = v.Check("c", 0.5, 1.0, True, "", "eq:x")
    assert v.VerificationReport("t", (vague, wrong, fine)).status == "failed"
    assert v.VerificationReport("t", (vague, fine)).status == "undecided"
    assert v.VerificationReport("t", (fine,)).status == "passed"
    with pytest.raises(tadcore.VerificationError, match="b: not accepted"):
        v.VerificationReport("t", (vague, wrong)).require_ok()


# ---- the command


def test_exit_codes(tmp_path, capsys):
    out = tmp_path / "report.json"
    stiff = ["--set", "attacker.control_weight=1e-12", "--set", "horizon=1e-6", "--set", "step=1e-6"]
    with pytest.raises(SystemExit) as left:
        cli.main(["verify", "paper-i1", *stiff, "--out", str(out)])
    assert left.value.code == 3
    said = capsys.readouterr()
    assert "could not be decided" in said.err
    data = json.loads(out.read_text(encoding="utf-8"))
    assert data["status"] == "undecided"
    assert {check["status"] for check in data["checks"]} == {"undecided"}
    with pytest.raises(SystemExit) as left:
        cli.main(["verify", "--help"])
    assert left.value.code == 0
    assert "3 none failed" in " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize("seed", [2**64, 10**30, -1])
def test_a_seed_beyond_the_generator_is_refused(seed, capsys):
    with pytest.raises(SystemExit) as left:
        cli.main(["verify", "paper-i1", "--seed", str(seed)])
    assert left.value.code == 2
    assert "seed" in capsys.readouterr().err
    with pytest.raises(
        tadcore.ScenarioError, match=r"seed: got .*must be a whole number in \[0, 18446744073709551615\]"
    ):
        tadcore.verify(tadcore.scenarios.load("paper-i1"), seed=seed)


def test_the_largest_seed_is_accepted():
    run = tadcore.simulate(tadcore.scenarios.load("paper-i1"))
    assert tadcore.verify(run, deviations=1, instants=1, seed=2**64 - 1).ok


@pytest.mark.parametrize("name", ["deviations", "instants", "starts", "seed"])
@pytest.mark.parametrize("value", [-1, 1.5, True, "2", None, 2**70])
def test_counts_are_checked(name, value):
    with pytest.raises(tadcore.ScenarioError, match=f"{name}: got"):
        tadcore.verify(tadcore.scenarios.load("paper-i1"), **{name: value})


# ---- what the checks are computed with


@pytest.mark.parametrize("stiffness", [0.0, 0.3, 20.0])
def test_a_frozen_step_is_that_of_scipy(stiffness):
    """Van Loan's block exponential gives both the transition and the Gramian."""
    rng = np.random.default_rng(5)
    C = rng.normal(size=(3, 4, 4))
    C *= stiffness / np.abs(C).sum(axis=-1).max()
    W = rng.normal(size=(2, len(C), 4, 4))
    W = W + np.swapaxes(W, -1, -2)
    transition, gramian = sampled_steps(C, 0.5, W)
    for (w, k), weight in zip(np.ndindex(2, len(C)), W.reshape(-1, 4, 4), strict=True):
        block = expm(0.5 * np.block([[-C[k].T, weight], [np.zeros((4, 4)), C[k]]]))
        exact = block[4:, 4:].T @ block[:4, 4:]
        assert np.allclose(transition[k], block[4:, 4:], rtol=1e-10, atol=1e-13 * np.abs(block).max())
        assert np.allclose(gramian[w, k], exact, rtol=1e-10, atol=1e-12 * np.abs(exact).max())


def test_a_very_stiff_step_has_a_closed_form():
    """C and W diagonal: ∫ exp(2cs) ds, where a block exponential overflows."""
    rates = -np.geomspace(1.0, 1e9, 5)
    transition, gramian = sampled_steps(np.diag(rates)[None], 1.0, np.eye(5)[None, None])
    assert np.allclose(np.diag(transition[0]), np.exp(rates), rtol=1e-6)
    assert np.allclose(np.diag(gramian[0, 0]), np.expm1(2.0 * rates) / (2.0 * rates), rtol=1e-6)


@pytest.mark.parametrize("name", ["paper-i1", "paper-i2"])
def test_gradients_and_certificates_of_a_record_are_those_of_the_objective(name):
    """Row by row: the gradient by `FullObjective`; the form by differences of Θ's quadratic bound."""
    sc = tadcore.scenarios.load(name).replace({"d2.control_weight": 1.4, "step": 0.02})
    run = tadcore.simulate(sc)
    m = matrices_of(sc)
    values = m.values(tadcore.solve_equilibrium(sc).P)[:, : len(run.times)]
    rng = np.random.default_rng(2)
    gains = run.gains * (1.0 + 0.1 * rng.normal(size=(len(run.times), 1, 1)))
    found = optimality(sc, m, values, run.adjacency, gains)
    for k in range(0, len(run.times), 7):
        f = FullObjective(sc, m, values[:, k], run.adjacency[k], dim=1)
        if not f.unknowns:
            assert (found.gradient[k], found.certificate[k]) == (0.0, 0.0)
            continue
        x = f.blocks(gains[k])
        slope = np.linalg.norm(f.gradient(x)) / f.gradient_scale(x)
        assert found.gradient[k] == pytest.approx(slope, rel=1e-9)
        # Θ less γ₁‖X‖², plus its linear bound 2γ₁⟨X*, X⟩: a quadratic, whose Hessian is the form
        X = f.errors(f.rows(x))[1][0]

        def bound(y, f=f, X=X):
            other = f.errors(f.rows(y))[1][0]
            return f.theta(y) - f.gamma[0] * np.sum(other * other) + 2.0 * f.gamma[0] * np.sum(X * other)

        eye = np.eye(f.unknowns)
        form = [[bound(x + a + b) - bound(x + a) - bound(x + b) + bound(x) for a in eye] for b in eye]
        spectrum = np.linalg.eigvalsh(form)
        quadratic = f.rows(x).T @ (f.R * f.rows(x))
        cancels = 4.0 * f.gamma[0] * f.R.max() * (np.linalg.norm(quadratic) + np.linalg.norm(f.constant))
        assert found.certificate[k] == pytest.approx(spectrum[0] / max(np.abs(spectrum).max(), cancels), abs=1e-9)


# ---- rounding that verify causes itself


@pytest.mark.parametrize(
    ("name", "shift"), [("paper-i1", 0.0), ("paper-i1", 1e7), ("paper-i1", 1e12), ("paper-i1-suicidal", 1e7)]
)
def test_a_game_far_from_the_origin_fails_nothing(name, shift):
    """There positions are stored to 1e-16 of their size, and a game that is turned starts elsewhere by as much."""
    sc = tadcore.scenarios.load(name).replace({"step": 0.02})
    away = sc.replace(
        {f"{player}.position": (at + shift).tolist() for player, at in zip(sc.players, sc.positions, strict=True)}
    )
    report = tadcore.verify(away, deviations=1, instants=2)
    assert not report.failures, report
    assert report.ok or shift
    turned = report["geometry.rotation"]
    assert turned.ok or turned.value > 1e-8


@pytest.mark.parametrize("step", [0.05, 0.5, 1.0])
def test_the_quadrature_of_the_indices_errs_by_less_than_it_says(step):
    """The identities are exact: what is left of them is the quadrature's, and rounding."""
    adapted = v.Adapted(tadcore.simulate(tadcore.scenarios.load("paper-i1").replace(step=step)))
    for pieces in (adapted.pieces, max(adapted.pieces // 4, 1), 1):
        adapted.pieces, adapted.step = pieces, step / pieces
        adapted.steps = adapted.length * pieces
        for cached in ("weights", "profile", "played"):
            adapted.__dict__.pop(cached, None)
        adapted.inside = adapted._values_inside()
        for index in adapted.index(sampled=False):
            assert index.error <= index.doubt or not index.converged


def test_a_protocol_at_the_optimum_that_rounding_keeps_from_silence(monkeypatch):
    run = tadcore.simulate(tadcore.scenarios.load("paper-i1"))
    real = v.checks.decentral.decentralise
    for gap, status in ((1e-15, "passed"), (1e-3, "undecided")):

        def talking(*args, gap=gap, **options):
            return dataclasses.replace(real(*args, **options), converged=False, gap=gap)

        monkeypatch.setattr(v.checks.decentral, "decentralise", talking)
        assert v.check_decentral(run).status == status
