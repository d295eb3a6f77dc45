"""The counts of a record: rows proved optimal, iterations, and rows short of the tolerance."""

from __future__ import annotations

import dataclasses

import numpy as np

from tadcore.errors import TadcoreError
from tadcore.game.synthesis import synthesize
from tadcore.simulation.play import simulate
from tadcore.simulation.run import Run
from tadcore.verification.oracle.criterion import chosen
from tadcore.verification.oracle.optimality import CRITICAL, Optimality
from tadcore.verification.report import Check

from .claims import RECORD
from .ending import TINY

_EDGE = 1e-9
"""Relative eigenvalue within which rounding decides whether a form is positive semidefinite."""


def check_certified(run: Run, found: Optimality) -> Check:
    """By how many rows the recorded number of proofs is off, beyond those that rounding decides."""
    unknown = np.isnan(found.certificate)
    blind = ~chosen(run.scenario, run.adjacency).any(axis=(1, 2))  # nothing to choose: proved
    proved = int(np.sum(((found.gradient <= CRITICAL) & (found.certificate > _EDGE)) | blind))
    possible = int(np.sum(unknown | (found.certificate >= -_EDGE)))
    off = max(proved - run.certified, run.certified - possible, 0)
    between = f"{proved}" if proved == possible else f"{proved} to {possible}"
    detail = f"{run.certified} recorded, {between} of {len(run.times)} found"
    if unknown.any():
        detail += f"; {int(unknown.sum())} forms are too large to be decomposed"
    return RECORD["record.certified"].judge(float(off), detail)


def check_synthesis(run: Run) -> Check:
    """How far the gains are from the library's own synthesis, and by how much its counts are off."""
    claim = RECORD["record.synthesis"]
    try:
        again = simulate(run.scenario, seed=run.seed, trial=run.trial)
        if not np.array_equal(again.adjacency, run.adjacency):  # another path: ask row by row
            again = _row_by_row(run)
    except (ArithmeticError, TadcoreError) as error:
        return claim.judge(np.inf, str(error), converged=False)
    off = np.abs(again.gains - run.gains).max(axis=(1, 2)) / np.maximum(np.abs(again.gains).max(axis=(1, 2)), TINY)
    k = int(np.argmax(off))
    worst, where = float(off[k]), f"gains at t = {run.times[k]:.6g}"
    for name in ("iterations", "unconverged", "certified", "passes"):
        found, recorded = getattr(again, name), getattr(run, name)
        if found != recorded:
            worst, where = max(worst, 1.0), f"{name}: {recorded} recorded, {found} found"
    return claim.judge(worst, where)


def _row_by_row(run: Run) -> Run:
    """The run with the gains and counts of `synthesize` at its instants and networks."""
    rows = [synthesize(run.scenario, step=k, adjacency=network) for k, network in enumerate(run.adjacency)]
    return dataclasses.replace(
        run,
        gains=np.stack([gains.rows for gains in rows]),
        iterations=sum(gains.iterations for gains in rows),
        unconverged=sum(not gains.converged for gains in rows),
        certified=sum(gains.certified for gains in rows),
    )
