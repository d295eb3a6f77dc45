"""What depends on δ: the outcome, its time, the network changes, and edges that chatter.

Termination, network and gains are looked at on the grid, so every time in a result is a multiple of δ. A crossing of a
capture radius lies up to a step before it; one that is left again before the next instant is a pass, which changes the
outcome of the continuous game and at a smaller step that of the sampled one (`tadcore.simulation.Pass`). And where the
control with an edge drives two players apart and the control without it brings them back, the edge flips at almost
every instant: a sliding mode of the continuous game. `tadcore.verification.play_by_events` follows both in continuous
time.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from tadcore._shared.arrays import as_index
from tadcore.game.chattering import Chatter, chatter
from tadcore.game.outcome import Outcome
from tadcore.game.passes import Pass
from tadcore.scenario.model import Scenario
from tadcore.scenarios.given import ScenarioLike, as_scenario
from tadcore.simulation.batch import simulate_batch
from tadcore.simulation.play import simulate
from tadcore.simulation.run import Run
from tadcore.verification.report import Check, Measurement, VerificationReport

_SHOWN = 5


@dataclass(frozen=True)
class StepStudy:
    """One scenario at δ, δ/2, δ/4, ….

    Attributes
    ----------
    steps : tuple of float
        The steps.
    outcomes : tuple of Outcome
        How the game ended with each.
    changes : tuple of int
        Network changes after the first network, with each.
    chatter : tuple of tuple of Chatter
        The stretches of chattering, with each.
    passes : tuple of tuple of Pass
        Capture radii entered between two instants, with each.
    """

    steps: tuple[float, ...]
    outcomes: tuple[Outcome, ...]
    changes: tuple[int, ...]
    chatter: tuple[tuple[Chatter, ...], ...]
    passes: tuple[tuple[Pass, ...], ...]

    @property
    def stable(self) -> bool:
        """Whether the same side wins, by the same defender, at every step, and its time moves by at most a step.

        Not where a capture radius is entered between two instants: at another step the game can end there.
        """
        ends = {(outcome.kind, outcome.defender) for outcome in self.outcomes}
        moves = [abs(b.time - a.time) for a, b in zip(self.outcomes, self.outcomes[1:], strict=False)]
        return (
            not any(self.passes)
            and len(ends) == 1
            and all(m <= 1.01 * d for m, d in zip(moves, self.steps, strict=False))
        )

    def __repr__(self) -> str:
        lines = [f"StepStudy: {'stable' if self.stable else 'NOT stable'} under refinement"]
        rows = zip(self.steps, self.outcomes, self.changes, self.chatter, self.passes, strict=True)
        for step, outcome, changes, found, passed in rows:
            loud = f", {len(found)} stretches of chatter" if found else ""
            lines.append(f"  δ = {step:<10.6g} {outcome}; {changes} network changes{loud}")
            lines += [f"    {each}" for each in passed[:_SHOWN]]
            lines += [f"    and {len(passed) - _SHOWN} times more"] if len(passed) > _SHOWN else []
        return "\n".join(lines)


@dataclass(frozen=True)
class Refinement:
    """How many of many games end otherwise with half the step.

    Attributes
    ----------
    steps : tuple of float
        δ, δ/2, ….
    changed : tuple of float
        Share of the games whose kind of ending or winner differs between one step and the next, one fewer than steps.
    moved : tuple of float
        Largest difference of the termination time among the others.
    undecided : ndarray of int
        Rows of the games that changed in any refinement.
    """

    steps: tuple[float, ...]
    changed: tuple[float, ...]
    moved: tuple[float, ...]
    undecided: np.ndarray


def refined(sc: ScenarioLike, halvings: int, *, least: int = 0) -> list[Scenario]:
    """The scenario at δ, δ/2, δ/4, …: ``halvings`` + 1 of them."""
    sc = as_scenario(sc)
    count = as_index("halvings", halvings, 20, least=least)
    return [sc, *(sc.replace(step=sc.horizon / (sc.steps * 2**i)) for i in range(1, count + 1))]


def step_study(sc: ScenarioLike, *, halvings: int = 2) -> StepStudy:
    """Play a scenario at δ, δ/2, δ/4, ….

    Parameters
    ----------
    sc : Scenario, path or name
        The scenario; its step is the first. With failures or disturbances another step draws others, so the outcomes
        differ by chance too.
    halvings : int
        How many times the step is halved.

    Returns
    -------
    StepStudy
        Outcome, network changes and chattering with each step.
    """
    runs = [simulate(finer) for finer in refined(sc, halvings)]
    return StepStudy(
        steps=tuple(run.scenario.step for run in runs),
        outcomes=tuple(run.outcome for run in runs),
        changes=tuple(max(len(run.network_changes) - 1, 0) for run in runs),
        chatter=tuple(chatter(run) for run in runs),
        passes=tuple(run.passes for run in runs),
    )


def refine_batch(
    sc: ScenarioLike, positions: ArrayLike, *, halvings: int = 2, threads: int | None = None
) -> Refinement:
    """Play many games at δ, δ/2, δ/4, … and count those that end otherwise.

    Parameters
    ----------
    sc : Scenario, path or name
        The game.
    positions : array_like, shape (M, n + 2, dim)
        Initial positions, as in `tadcore.simulate_batch`; M is at least one.
    halvings : int
        How many times the step is halved.
    threads : int, optional
        Worker threads; all cores by default.

    Returns
    -------
    Refinement
        Shares and times, and which games change.
    """
    scenarios = refined(sc, halvings, least=1)
    batches = [simulate_batch(finer, positions, threads=threads) for finer in scenarios]
    changed, moved = [], []
    undecided = np.zeros(len(batches[0]), dtype=bool)
    for one, other in itertools.pairwise(batches):
        differs = (one.kind != other.kind) | (one.defender != other.defender)
        changed.append(float(differs.mean()))
        moved.append(float(np.abs(one.time - other.time)[~differs].max(initial=0.0)))
        undecided |= differs
    steps = tuple(finer.step for finer in scenarios)
    return Refinement(steps, tuple(changed), tuple(moved), np.flatnonzero(undecided))


def check_steps(run: Run) -> VerificationReport:
    """Check that the outcome of a run survives δ/2 and δ/4 and no pass contradicts it, and report its chattering.

    Parameters
    ----------
    run : Run
        The run; its scenario is played again with the smaller steps.

    Returns
    -------
    VerificationReport
        Whether the same side wins by the same defender, how far the termination time moves, and where edges chatter.
    """
    study = step_study(run.scenario)
    ends = {(outcome.kind, outcome.defender) for outcome in study.outcomes}
    # With each step the continuous game ends at the first pass, where there is one.
    firsts = [passed[0] for passed in study.passes if passed]
    ends |= {("captured" if first.defender is None else "intercepted", first.defender) for first in firsts}
    remedy = "the outcome depends on δ: take a smaller step, or play_by_events for the continuous game"
    detail = ", ".join(f"{outcome.time:.6g}" for outcome in study.outcomes)
    detail += f"; {firsts[0]}" if firsts else ""
    check = Check("steps.outcome", float(len(ends) - 1), 0.0, True, remedy, "sec:simulations, δ", f"ends at {detail}")
    loud = chatter(run)
    notes = tuple(
        f"{c.edge[0]}→{c.edge[1]} chatters from t = {c.start:.6g} to {c.end:.6g}: {c.flips} flips, a sliding mode"
        for c in loud[:_SHOWN]
    )
    if len(loud) > _SHOWN:
        notes += (f"{len(loud) - _SHOWN} more stretches of chattering",)
    measured = (
        Measurement("steps.chatter", float(sum(c.flips for c in loud)), "flips within stretches of chattering"),
    )
    return VerificationReport("step study", (check,), measured, notes)
