"""Proved bounds on Θ at every instant of a run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tadcore._shared.arrays import Floats
from tadcore._shared.progress import bar
from tadcore.game.recorded import scalar_gains
from tadcore.simulation.run import Run
from tadcore.verification.oracle.criterion import held
from tadcore.verification.oracle.matrices import matrices_of
from tadcore.verification.oracle.objective import FullObjective

from .bounds import ThetaBound, prove_theta
from .proof import Proof
from .second_order import largest_group

MOST = 9
"""Unknowns that do not decouple: with more an instant takes many seconds."""


@dataclass(frozen=True)
class AlongRun:
    """The proved bounds of a run.

    Attributes
    ----------
    bounds : dict of int to ThetaBound
        By instant; those not tried are left out.
    instants : int
        Instants at which gains were chosen.
    """

    bounds: dict[int, ThetaBound]
    instants: int

    @property
    def proved(self) -> int:
        """Instants whose gains are proved to have the lowest Θ among scalar gains, to 1e-6."""
        return sum(b.proved and b.tight for b in self.bounds.values())

    @property
    def share(self) -> float:
        """That over all instants, those not tried included."""
        return self.proved / self.instants

    @property
    def words(self) -> str:
        """What was proved, what was not and what was not tried."""
        tried = len(self.bounds)
        return (
            f"share of instants whose Θ is proved to be the lowest among scalar gains, to 1e-6: {self.proved} of "
            f"{self.instants}, {tried - self.proved} open, {self.instants - tried} not tried (more than {MOST} "
            "unknowns that do not decouple, or rows that are held at the equilibrium)"
        )


def bound_along(run: Run, values: Floats, *, progress: bool = True) -> AlongRun:
    """Bound Θ at every instant of a run, each proof beginning at the one before of the same network.

    Parameters
    ----------
    run : Run
        The run.
    values : ndarray, shape (parties, K + 1, N, N)
        The scenario's value matrices.
    progress : bool
        Whether to show a bar where standard error is a terminal.
    """
    sc, m = run.scenario, matrices_of(run.scenario)
    length = len(run.times) - 1
    groups: dict[bytes, int] = {}
    near: dict[bytes, Proof | None] = {}
    found = {}
    for k in bar(range(length), "bounding Θ", show=progress, total=length):
        adjacency = np.asarray(run.adjacency[k])
        network = adjacency.tobytes()
        objective = FullObjective(sc, m, values[:, k], adjacency, dim=1)
        if network not in groups:
            groups[network] = largest_group(objective)
        # Θ over all rows may lie below that under the team criterion, and proves nothing of it.
        if groups[network] <= MOST and not held(sc, adjacency).any():
            found[k] = prove_theta(objective, scalar_gains(run)[k], near.get(network), deep=True)
            near[network] = found[k].proof
    return AlongRun(found, length)
