"""The checks of Theorems thm1 and thm2 on a run; `tadcore.verification.oracle.adapted` has the statements."""

from __future__ import annotations

import numpy as np

from tadcore._shared.arrays import Floats
from tadcore.simulation.play import simulate
from tadcore.simulation.run import Run
from tadcore.verification.checks.steps import refined
from tadcore.verification.oracle.adapted import Adapted
from tadcore.verification.oracle.draws import generator
from tadcore.verification.oracle.matrices import FeedbackSolution
from tadcore.verification.report import Check, Claim, Measurement, VerificationReport, number

_IDENTITY = 1e-10
_REMEDY = "the values P(t) do not belong to this game, or the step is too long for the quadrature (‖C‖δ > 1)"


def check_nafne(
    run: Run, equilibrium: FeedbackSolution | None = None, *, deviations: int = 2, seed: int = 0
) -> VerificationReport:
    """Check that the run's strategies are a network-adapted Nash equilibrium for the indices J^Ad.

    Parameters
    ----------
    run : Run
        The run, of at least one step.
    equilibrium : Equilibrium, optional
        The Riccati solution that the indices are built from; the scenario's by default.
    deviations : int
        Random admissible deviations of each player.
    seed : int
        Key of the deviations.

    Returns
    -------
    VerificationReport
        For each index J^Ad = V(0) at the equilibrium and the identity of the run as played; for each player the
        identity of its random deviations, and that none of them gains.
    """
    theorem, identity = ("thm:thm1", "eq:Jbseq") if run.scenario.interaction == "I1" else ("thm:thm2", "eq:j_zsg")
    try:
        adapted = Adapted(run, equilibrium)
    except ArithmeticError as error:
        failed = Check("nafne.value", np.inf, _IDENTITY, False, _REMEDY, theorem, str(error))
        return VerificationReport("network-adapted equilibrium", (failed,))
    checks, notes, measured = [], [], []
    for index in adapted.index(sampled=False):
        name = f"nafne.value.{index.party}"
        claim = Claim(name, _IDENTITY, _REMEDY, theorem)
        where = f"V(0) = {number(index.initial)}"
        checks.append(claim.judge(index.error, where, doubt=index.doubt, converged=index.converged))
    for index in adapted.index(sampled=True):
        name = f"nafne.as_played.{index.party}"
        gap = index.value - index.initial
        claim = Claim(name, _IDENTITY, _REMEDY, identity)
        where = f"J^Ad - V(0) = {number(gap, '.3g')}"
        checks.append(claim.judge(index.error, where, doubt=index.doubt, converged=index.converged))
        measured.append(Measurement(f"nafne.gap.{index.party}", gap, "J^Ad as played minus V(0): frozen feedback"))
    for player, label in enumerate(run.scenario.players):
        largest, gain, resolved, doubt = 0.0, -np.inf, True, 0.0
        party, sign = adapted.party_of(player)
        for draw in range(deviations):
            rng = generator(seed, player * 2**32 + draw)
            deviation = adapted.random_deviation(player, rng)
            if deviation is None:
                notes.append(f"{label} sees nobody in this run and can only stand still: it has no deviation")
                break
            index = adapted.index(sampled=False, deviation=deviation)[party]
            largest = float(np.maximum(largest, index.error))  # nan stays
            resolved &= index.converged
            doubt = max(doubt, index.doubt)
            gain = float(np.maximum(gain, -sign * (index.value - index.initial) / max(index.scale, 1e-300)))
        else:
            if deviations:
                claim = Claim(f"nafne.deviation.{label}", _IDENTITY, _REMEDY, identity)
                checks.append(claim.judge(largest, doubt=doubt, converged=resolved))
                remedy = f"{label} gains by deviating: the strategies are no equilibrium for J^Ad"
                claim = Claim(f"nafne.gain.{label}", _IDENTITY, remedy, theorem)
                checks.append(claim.judge(gain, doubt=doubt, converged=resolved))
    for name, size in _sizes(adapted).items():
        measured.append(Measurement(f"nafne.{name}", size, "largest Frobenius norm along the run, reduced"))
    return VerificationReport("network-adapted equilibrium", tuple(checks), tuple(measured), tuple(notes))


def _sizes(adapted: Adapted) -> dict[str, float]:
    """Largest Frobenius norms of S and ΔQ^Ad along the run."""
    weights, n = adapted.weights_on_grid, adapted.sc.n
    if adapted.sc.interaction == "I1":
        parts = dict(zip(("dQ_d", "dQ_tau", "dQ_a"), weights.dQ, strict=True)) | {"S1": weights.S}
    else:
        parts = {"dQ": weights.dQ[0], "S2": weights.S[:, :n], "S3": weights.S[:, n:]}
    return {name: float(np.linalg.norm(part, axis=(1, 2)).max()) for name, part in parts.items()}


def sampling_gap(adapted: Adapted) -> dict[str, float]:
    """J^Ad of the run as played minus V(0), by index: what freezing the feedback over δ costs."""
    return {index.party: index.value - index.initial for index in adapted.index(sampled=True)}


def gap_order(run: Run, *, halvings: int = 3) -> dict[str, tuple[Floats, Floats]]:
    """The order in δ of the gap between the indices as played and V(0).

    Parameters
    ----------
    run : Run
        A run; its scenario is played again with δ/2, δ/4, …, each up to the end of its own game.
    halvings : int
        How many times δ is halved.

    Returns
    -------
    dict of str to (ndarray, ndarray)
        By index the gaps, shape (halvings + 1,), and the observed orders log₂(gap(δ) / gap(δ/2)), shape (halvings,).
    """
    finer = refined(run.scenario, halvings)[1:]
    gaps = [sampling_gap(Adapted(played)) for played in (run, *map(simulate, finer))]
    series = {party: np.array([gap[party] for gap in gaps]) for party in gaps[0]}
    with np.errstate(divide="ignore", invalid="ignore"):
        return {party: (gap, np.log2(np.abs(gap[:-1] / gap[1:]))) for party, gap in series.items()}
