"""Remark networkexternality: the synthesis as a protocol between the players.

The gradient of Θ in a player's own gain (eq:errgradient) needs the joint rows K𝓘 of the team, and nothing else of the
others: not their gain and not their row of 𝒜 apart. So each player keeps its own K_i and [𝒜]_i to itself, sends its
row g_i = K_i𝓘_i of N numbers, and descends Θ in its own block with the rows it has heard. What the players share from
the start is the game and the clock, that is P(t).

A round gives each player a turn: read the mailbox, take one step, and send the row if it moved. With ``delay`` = d a
row sent in round s is read from round s + d on, and everyone steps on what it has: rows are then up to d rounds old.
A player that no longer moves tries its row reversed, on its own, and takes it where that ends lower: many minima differ
by the sign of a row. The protocol ends when nobody has moved for d + 1 rounds. Under the team criterion a player that
knows everything sends its row of the equilibrium, and stays there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tadcore._shared.arrays import Floats, as_adjacency, as_index
from tadcore.errors import ScenarioError
from tadcore.game.changes import changed_rows
from tadcore.game.equilibrium import solve_equilibrium
from tadcore.game.network import VisibilityNetwork
from tadcore.game.synthesis import synthesize
from tadcore.scenario.model import Scenario
from tadcore.scenarios.given import ScenarioLike, as_scenario
from tadcore.simulation.run import Run
from tadcore.verification.oracle.criterion import held
from tadcore.verification.oracle.matrices import Matrices, matrices_of
from tadcore.verification.oracle.objective import FullObjective
from tadcore.verification.report import Check, Measurement, VerificationReport

_OPTIMUM = 1e-8
_SILENT = 1e-10
_SHOWN = 3
_LEAP_STEPS = 30
_FIVE = np.array([-1.0, -0.5, 0.0, 0.5, 1.0])
_THROUGH_FIVE = np.linalg.inv(np.vander(_FIVE, increasing=True))


@dataclass(frozen=True, eq=False)
class Decentralised:
    """What the protocol reached, and at what price.

    Attributes
    ----------
    rows : ndarray, shape (m, N)
        The joint rows.
    theta : float
        Θ of them, in reduced norms.
    central : float
        Θ of the central synthesis.
    gap : float
        (theta - central) relative to central, or to 1e-10 of Θ at rest where that is larger.
    distance : float
        The largest difference of rows from the central ones, relative to the largest entry of those.
    rounds : int
        Rounds until silence.
    messages : int
        Rows sent, one for each receiver.
    scalars : int
        Numbers sent, N for each message.
    staleness : int
        The most rounds that a player stepped on a row after it had been replaced; at most the delay.
    converged : bool
        Whether the protocol ended in silence within the rounds allowed.
    history : ndarray, shape (rounds + 1,)
        Θ at the start and after every round.
    """

    rows: Floats
    theta: float
    central: float
    gap: float
    distance: float
    rounds: int
    messages: int
    scalars: int
    staleness: int
    converged: bool
    history: Floats

    def __repr__(self) -> str:
        state = "silent" if self.converged else "still talking"
        return (
            f"Decentralised(Θ={self.theta:.6g}, {self.gap:.1e} above the central one, {state} after {self.rounds} "
            f"rounds, {self.messages:,} messages, {self.scalars:,} numbers, rows up to {self.staleness} rounds old)"
        )


class _Player:
    """One player: its own gain and row of 𝒜, and the rows it has heard of the others."""

    def __init__(self, sc: Scenario, m: Matrices, values: Floats, i: int, sees: NDArray[np.bool_]) -> None:
        alone = np.zeros((len(sc.constrained), m.size), dtype=bool)
        alone[i] = sees  # of the others' sight it knows nothing
        self.i = i
        self.objective = FullObjective(sc, m, values, alone, dim=1)
        shape = (len(alone), m.size)
        self.basis = self.objective.rows(np.eye(self.objective.unknowns))
        wanted = -self.objective.BP[0][i] / m.r[i] * (1.0 if self.objective.first else -1.0)
        self.x = np.linalg.lstsq(self.basis[:, i].T, wanted, rcond=None)[0] if sees.any() else np.zeros(0)
        self.fixed = m.rows(values)[i] if held(sc, sees) else None
        self.heard = np.zeros(shape)

    @property
    def row(self) -> Floats:
        """g_i, what is sent."""
        own: Floats = self.objective.rows(self.x)[self.i] if self.fixed is None else self.fixed
        return own

    def step(self, method: str, damping: float) -> bool:
        """One step on what has been heard; whether the row moved."""
        if not self.x.size or self.fixed is not None:
            return False
        f = self.objective
        others = self.heard.copy()
        others[self.i] = 0.0
        G = others + f.rows(self.x)
        slope = f.pull(f.inner(G))
        if np.linalg.norm(slope) <= _SILENT * self._scale(G):
            return self._leap(others)
        if method == "newton":
            step = self._newton(others)
        else:
            step = -_lowest(lambda t: f.theta_of(G - t * f.rows(slope))) * slope
        self.x = self.x + damping * step
        return bool(step.any())

    def _leap(self, others: Floats) -> bool:
        """From rest, the same row reversed: taken where its own descent ends lower."""
        f, here = self.objective, self.x
        rested = f.theta_of(others + f.rows(here))
        self.x = -here
        for _ in range(_LEAP_STEPS):
            self.x, before = self.x + self._newton(others), self.x
            if np.abs(self.x - before).max() <= 1e-9 * np.abs(self.x).max():
                break
        if f.theta_of(others + f.rows(self.x)) < rested * (1.0 - 1e-9):
            return True
        self.x = here
        return False

    def _newton(self, others: Floats) -> Floats:
        """The step of an exact line search along the own block's Newton direction."""
        f = self.objective
        G = others + f.rows(self.x)
        spectrum, basis = np.linalg.eigh(f.curve(G, np.eye(f.unknowns)))
        bounded = np.maximum(np.abs(spectrum), 1e-8 * np.abs(spectrum).max())
        direction = -basis @ ((basis.T @ f.pull(f.inner(G))) / bounded)
        step: Floats = _lowest(lambda t: f.theta_of(G + t * f.rows(direction))) * direction
        return step

    def _scale(self, G: Floats) -> float:
        f = self.objective
        return f.gradient_scale(self.x) + 4.0 * float(f.gamma[0]) * float(np.linalg.norm(f.R * G)) ** 3


def _lowest(value: Callable[[float], float]) -> float:
    """The minimiser along a line of a polynomial of degree four, from five values; 0 where nothing is lower."""
    quartic = _THROUGH_FIVE @ [value(1.0 + float(s)) for s in _FIVE]  # in t - 1, where the minimum of most lies
    slope = quartic[1:] * np.arange(1.0, 5.0)
    roots = 1.0 + np.roots(slope[::-1]) if np.isfinite(slope).all() else np.zeros(0)
    real = roots[np.abs(roots.imag) <= 1e-9 * (1.0 + np.abs(roots))].real
    real = real[real > 0.0]
    if not len(real):
        return 0.0
    return float(real.min())


def decentralise(
    sc: ScenarioLike,
    *,
    step: int,
    adjacency: ArrayLike | VisibilityNetwork,
    method: Literal["newton", "gradient"] = "newton",
    delay: int = 0,
    max_rounds: int = 1000,
) -> Decentralised:
    """Let the players find their gains at one instant by exchanging rows.

    Parameters
    ----------
    sc : Scenario, path or name
        The game.
    step : int
        k of the instant t_k, 0 … K.
    adjacency : array_like, shape (m, N), or VisibilityNetwork
        𝒜; each player is told its own row only.
    method : {"newton", "gradient"}
        Whether a player scales its gradient by the curvature of its own block. The step length is in either case the
        exact minimiser along the line, up to the damping that a delay needs.
    delay : int
        Rounds that a message travels.
    max_rounds : int
        Stop after this many rounds; the result then says that it has not converged.

    Returns
    -------
    Decentralised
        The rows reached, beside the central synthesis, and the counts.

    Raises
    ------
    ScenarioError
        The instant is not on the grid, the adjacency is not one, or an option is not one of its values.
    NoEquilibriumError
        The game has no equilibrium on [0, T].
    """
    sc = as_scenario(sc)
    seen = as_adjacency(adjacency, (len(sc.constrained), sc.n + 1))
    k = as_index("step", step, sc.steps)
    delay = as_index("delay", delay, 1000)
    max_rounds = as_index("max_rounds", max_rounds, 10**7, least=1)
    if method not in ("newton", "gradient"):
        raise ScenarioError("method", method, '"newton" or "gradient"')
    m = matrices_of(sc)
    values = m.values(solve_equilibrium(sc).P)[:, k]
    team = [_Player(sc, m, values, i, row) for i, row in enumerate(seen)]
    judge = FullObjective(sc, m, values, seen, dim=1)
    count = len(team)
    damping = 1.0 if delay == 0 else 1.0 / (count * (1 + delay))
    sent: list[list[tuple[int, Floats]]] = [[(0, player.row)] for player in team]
    messages = count * (count - 1)
    history = [judge.theta_of(np.stack([player.row for player in team]))]
    quiet = staleness = rounds = 0
    while rounds < max_rounds and quiet <= delay:
        rounds += 1
        moved = False
        for player in team:
            for j in range(count):
                arrived = [message for message in sent[j] if message[0] + delay <= rounds or message[0] == 0]
                player.heard[j] = arrived[-1][1]
                missed = [message[0] for message in sent[j] if message[0] > arrived[-1][0]]
                if j != player.i and missed:
                    staleness = max(staleness, rounds - missed[0] + 1)
            if player.step(method, damping):
                moved = True
                sent[player.i] = [*sent[player.i][-delay - 1 :], (rounds, player.row)]
                messages += count - 1
        quiet = 0 if moved else quiet + 1
        history.append(judge.theta_of(np.stack([player.row for player in team])))
    rows = np.stack([player.row for player in team])
    central = synthesize(sc, step=k, adjacency=seen)
    least = max(central.theta, 1e-10 * judge.theta_of(0.0 * rows), 1e-300)
    return Decentralised(
        rows=rows,
        theta=history[-1],
        central=central.theta,
        gap=(history[-1] - central.theta) / least,
        distance=float(np.abs(rows - central.rows).max()) / max(float(np.abs(central.rows).max()), 1e-300),
        rounds=rounds,
        messages=messages,
        scalars=messages * m.size,
        staleness=staleness,
        converged=quiet > delay,
        history=np.array(history),
    )


def check_decentral(run: Run) -> VerificationReport:
    """Check that the protocol reaches the central optimum under networks of a run.

    Parameters
    ----------
    run : Run
        The run; the first instants of up to three of its networks are taken.

    Returns
    -------
    VerificationReport
        The largest gap to the central Θ, and the messages it took. The protocol is a local descent: where the central
        minimum lies in another basin than the canonical start's, a note says so.
    """
    length = len(run.times) - 1
    first = np.concatenate([[0], changed_rows(run.adjacency[:length])]).astype(int)
    chosen = first[np.unique(np.linspace(0, len(first) - 1, _SHOWN).astype(int))]
    worst, scalars, rounds, silent = 0.0, 0, 0, True
    notes = []
    for k in chosen.tolist():
        sc, network = run.scenario, run.adjacency[k]
        # searched for at this instant alone: between two anchors minima are followed, and say nothing of their basin
        if synthesize(sc, step=k, adjacency=network, method="restarts").start != "canonical":
            notes.append(f"t = {run.times[k]:.6g}: the minimum is in another basin, which no local protocol reaches")
            continue
        found = decentralise(sc, step=k, adjacency=network)
        worst, scalars, rounds = max(worst, found.gap), max(scalars, found.scalars), max(rounds, found.rounds)
        silent &= found.converged
    remedy = "the players' own descent stops elsewhere than the central one: another basin, or too few rounds"
    detail = f"{len(chosen) - len(notes)} networks, up to {rounds} rounds"
    # who has reached the optimum may go on talking of its last digits: rounding keeps some from silence
    decided = silent or worst <= _OPTIMUM
    checks = (Check("decentral.gap", worst, _OPTIMUM, decided, remedy, "rem:networkexternality", detail),)
    measured = (Measurement("decentral.scalars", float(scalars), "most numbers sent at one instant"),)
    return VerificationReport("decentralised synthesis", checks, measured, tuple(notes))
