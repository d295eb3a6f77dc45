"""Theorems thm1 and thm2 along a run: the indices for which the play is a Nash equilibrium.

The theorems are statements in continuous time about a gain K(t), here the run's own, constant on every step, and about
P(t), the attacker's and (in I1) the target's feedback, which vary inside a step. With γ the theorem's profile and any
controls u, eq:Jbseq to eq:Jcseq say that

    J^Ad_p(u) = ½z₀ᵀP_p(0)z₀ + ½∫(‖u_p - γ_p‖²_{R_p} + 2Σ_{j≠p} zᵀP_pB_j(u_j - γ_j))dt,                        (I1)

and eq:j_zsg that J^Ad(u) = ½z₀ᵀP(0)z₀ + ½∫(‖u_a - γ_a‖²_{R_a} - ‖u_dτ - γ_dτ‖²_{R_dτ})dt. (I2)

What is exact and what is of the order of δ:

- exact in continuous time (checked to quadrature error): with everyone at γ, J^Ad = V(0); with one player at any other
  admissible feedback, J^Ad of that player's side exceeds V(0) by ½∫‖u - γ‖²_R; and for the run as played, the
  identities above with all their terms.
- of the order of δ: the run freezes the attacker's and the target's feedback over a step, so J^Ad of the run as played
  differs from V(0), by ½∫2zᵀP_pB_j(u_j - γ_j) in I1 (first order) and ½∫‖u_a - γ_a‖² in I2 (second order);
  `tadcore.verification.sampling_gap` measures it and `gap_order` its order.

The indices are taken up to the instant t_L at which the run ends, with terminal weight P(t_L), the value of what is
left: P(T) = F where it ends at T.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tadcore._shared.arrays import Floats
from tadcore.errors import ScenarioError
from tadcore.game.equilibrium import solve_equilibrium
from tadcore.game.recorded import scalar_gains
from tadcore.simulation.run import Run

from .flow import integral, propagate, riccati_within
from .indices import AdaptedWeights, adapted_weights, integrands
from .matrices import FeedbackSolution, Matrices, matrices_of

_PIECES = 64
_WHOLE = 1e-7
"""How far the quadrature may be off where ‖C‖δ = 1, a hundred times what was seen: P varies faster than the state."""
_ROUNDING = 1e-12


@dataclass(frozen=True)
class Index:
    """One index J^Ad along one play.

    Attributes
    ----------
    party : str
        Whose index: ``"defenders"``, ``"target"``, ``"attacker"`` in I1; ``"team"`` in I2, the one J^Ad.
    value : float
        J^Ad.
    initial : float
        V(0) = ½z₀ᵀP(0)z₀.
    deviation : float
        The integral on the right of the identity.
    scale : float
        ½∫|integrand| and the terminal term: what rounding is relative to.
    converged : bool
        Whether the steps are short enough for the quadrature, ‖C‖δ ≤ 1 throughout, and nothing overflows.
    doubt : float
        How far the quadrature may be off, relative to `scale`.
    """

    party: str
    value: float
    initial: float
    deviation: float
    scale: float
    converged: bool
    doubt: float

    @property
    def error(self) -> float:
        r""":math:`|J^{\mathrm{Ad}} - V(0) - \text{deviation}|` relative to `scale`."""
        return abs(self.value - self.initial - self.deviation) / max(self.scale, 1e-300)


@dataclass(frozen=True, eq=False)
class Deviation:
    """A player's other feedback: γ plus ΔK 𝓘 z with 2 × 2 (in space 3 × 3) blocks.

    Attributes
    ----------
    player : int
        Row in d1 … dn, target, attacker.
    gain : ndarray, shape (L, dim, N, dim)
        ΔK𝓘 on every step: the control is added ``gain[k] · z``.
    """

    player: int
    gain: Floats


class Adapted:
    """A run, its gains and its Riccati solution in continuous time.

    Parameters
    ----------
    run : Run
        The run; it must have at least one step.
    equilibrium : Equilibrium, optional
        The Riccati solution that the indices are built from; the scenario's by default.

    Raises
    ------
    ScenarioError
        The run ends at t = 0: nothing was played.
    ArithmeticError
        The Riccati equation cannot be followed inside a step from the values given, or a step is too stiff for it.
    """

    def __init__(self, run: Run, equilibrium: FeedbackSolution | None = None) -> None:
        sc = run.scenario
        self.run, self.sc = run, sc
        self.length = len(run.times) - 1
        if self.length < 1:
            raise ScenarioError("run", f"{self.length} steps", "a game that is not over at t = 0")
        self.m: Matrices = matrices_of(sc)
        eq = solve_equilibrium(sc) if equilibrium is None else equilibrium
        self.grid = self.m.values(eq.P)[:, : self.length + 1]
        self.gains = scalar_gains(run)[: self.length]
        self.start = run.position[0, :-1] - run.position[0, -1]
        # a stiff step is cut into pieces, each with its own nodes
        stiff = float(np.abs(self.m.B @ self._held()).sum(axis=-1).max()) * sc.horizon / sc.steps
        if not stiff <= _PIECES:  # no piece would be short enough: say so before computing any
            raise ArithmeticError(f"‖C‖δ = {stiff:.2g} where {_PIECES} pieces of a step can follow {_PIECES}")
        self.pieces = int(np.clip(np.ceil(8.0 * stiff), 1, _PIECES))
        self.step = sc.horizon / sc.steps / self.pieces
        self.steps = self.length * self.pieces
        self.inside = self._values_inside()

    def _values_inside(self) -> Floats:
        """P at every node, shape (parties, L · pieces, q, N, N)."""
        right, found = self.grid[:, 1:], []
        for _ in range(self.pieces):
            inside = riccati_within(self.m, right, self.step)
            if inside is None:
                raise ArithmeticError(
                    "the Riccati equation cannot be followed inside a step: too stiff, or it escapes from P given"
                )
            found.append(inside[0])
            right = inside[1]
        by_piece = np.stack(found[::-1], axis=2)
        return by_piece.reshape(len(by_piece), self.steps, *by_piece.shape[3:])

    def _held(self) -> Floats:
        """Rows in force over every step, shape (L, n + 2, N)."""
        rows = self.m.rows(self.grid[:, : self.length])
        rows[:, : self.gains.shape[1]] = self.gains
        return rows

    @cached_property
    def weights(self) -> AdaptedWeights:
        """S and ΔQ^Ad at every Gauss node, shapes (L · pieces, q, m, N) and (indices, L · pieces, q, N, N)."""
        gains = np.repeat(self.gains, self.pieces, axis=0)[:, None]
        G = np.broadcast_to(gains, (*self.inside.shape[1:3], *self.gains.shape[1:]))
        return adapted_weights(self.sc, self.m, self.inside, G)

    @cached_property
    def weights_on_grid(self) -> AdaptedWeights:
        """S and ΔQ^Ad at t_0 … t_{L-1}."""
        return adapted_weights(self.sc, self.m, self.grid[:, : self.length], self.gains)

    @cached_property
    def profile(self) -> Floats:
        """Rows of γ at every node, shape (L · pieces, q, n + 2, N): the run's gains, and P(t) for the others."""
        rows = self.m.rows(self.inside)
        rows[:, :, : self.gains.shape[1]] = np.repeat(self.gains, self.pieces, axis=0)[:, None]
        return rows

    @cached_property
    def played(self) -> Floats:
        """Rows in force in the run, shape (L · pieces, 1, n + 2, N): everything held from the step's start."""
        held: Floats = np.repeat(self._held(), self.pieces, axis=0)[:, None]
        return held

    def states(self, rows: Floats, deviation: Deviation | None = None) -> tuple[Floats, Floats]:
        """The state at nodes and at the L + 1 instants under rows of shape (L · pieces, 1 or q, n + 2, N)."""
        q, size, dim = self.inside.shape[2], self.m.size, self.sc.dim
        added = None if deviation is None else np.repeat(deviation.gain, self.pieces, axis=0)

        def loop(part: slice) -> Floats:
            C = np.broadcast_to(self.m.B @ rows[part], (len(rows[part]), q, size, size))
            if deviation is None or added is None:
                return C
            full = np.einsum("kqij,ab->kqiajb", C, np.eye(dim)).copy()
            through = self.m.B[:, deviation.player]
            full += np.einsum("i,kajb->kiajb", through, added[part])[:, None]
            joint: Floats = full.reshape(len(C), q, size * dim, size * dim)
            return joint

        start = self.start if deviation is None else self.start.reshape(-1, 1)
        nodes, ends = propagate(loop, self.steps, start, self.step)
        return nodes.reshape(self.steps, q, size, dim), ends[:: self.pieces].reshape(self.length + 1, size, dim)

    def _fastest(self, rows: Floats, deviation: Deviation | None) -> float:
        """‖C‖δ of the stiffest piece."""
        largest = np.abs(self.m.B @ rows).sum(axis=-1).max(axis=(1, 2))
        if deviation is not None:
            largest = largest + np.repeat(np.abs(deviation.gain).sum(axis=(2, 3)).max(axis=1), self.pieces)
        return float(largest.max()) * self.step

    def index(self, *, sampled: bool, deviation: Deviation | None = None) -> tuple[Index, ...]:
        """J^Ad and the right side of its identity for one play.

        Parameters
        ----------
        sampled : bool
            Whether the attacker's and the target's feedback is held on every step, as in the run, or follows P(t).
        deviation : Deviation, optional
            What one player adds to its control.

        Returns
        -------
        tuple of Index
            One for each index of the theorem.
        """
        with np.errstate(over="ignore", invalid="ignore"):  # what overflows is inf or nan in the result
            return self._index(self.played if sampled else self.profile, deviation)

    def _index(self, rows: Floats, deviation: Deviation | None) -> tuple[Index, ...]:
        z, ends = self.states(rows, deviation)
        u = rows @ z
        if deviation is not None:
            u[:, :, deviation.player] += np.einsum("kajb,kqjb->kqa", np.repeat(deviation.gain, self.pieces, axis=0), z)
        off = u - self.profile @ z
        inside = integrands(self.sc, self.m, self.weights, z, u)
        zero_sum = self.sc.interaction == "I2"
        value_of = self.grid[1:] if zero_sum else self.grid
        size = self.m.r * np.sum(off * off, axis=-1)
        fastest = self._fastest(rows, deviation)
        # of order 10; rounding is what remains at the pieces that are aimed at
        doubt = max(_WHOLE * fastest**10, _ROUNDING)
        found = []
        for p, twice in enumerate(inside):
            name = self.m.parties[p]
            if zero_sum:
                right = size[..., -1] - size[..., :-1].sum(axis=-1)
            else:
                own = self.m.members[p]
                others = np.ones(len(self.m.r), dtype=bool)
                others[own] = False
                pull = (self.inside[p] @ self.m.B[:, others]).swapaxes(-1, -2) @ z
                right = size[..., own].sum(axis=-1) + 2.0 * np.sum(pull * off[..., others, :], axis=(-1, -2))
            last = 0.5 * float(np.sum(ends[-1] * (value_of[p][-1] @ ends[-1])))
            first = 0.5 * float(np.sum(ends[0] * (value_of[p][0] @ ends[0])))
            scale = abs(last) + abs(first) + 0.5 * integral(np.abs(twice), self.step)
            value = last + 0.5 * integral(twice, self.step)
            deviated = 0.5 * integral(right, self.step)
            finite = bool(np.isfinite([value, first, deviated, scale]).all())  # what overflows decides nothing
            found.append(Index(name, value, first, deviated, scale, fastest <= 1.0 and finite, doubt))
        return tuple(found)

    def party_of(self, player: int) -> tuple[int, float]:
        """The index that a player deviates against, and the sign with which a deviation moves it: +1 up, -1 down."""
        if self.sc.interaction == "I2":
            return 0, (1.0 if player == len(self.m.r) - 1 else -1.0)
        return next(p for p, own in enumerate(self.m.members) if own.start <= player < own.stop), 1.0

    def random_deviation(self, player: int, rng: np.random.Generator, *, size: float = 0.3) -> Deviation | None:
        """Draw an admissible deviation of a player, smooth in time under one network.

        Parameters
        ----------
        player : int
            Row in d1 … dn, target, attacker.
        rng : numpy.random.Generator
            The source of randomness.
        size : float
            Size of its gains, relative to the largest of the run's feedback.

        Returns
        -------
        Deviation or None
            ΔK 𝓘 with random blocks; None where the player sees nobody in the whole run.
        """
        dim, N = self.sc.dim, self.m.size
        reach = size * float(np.abs(self.played).max())
        base, swing = rng.normal(scale=reach, size=(2, dim, N, dim))
        phase = rng.uniform(0.0, 2.0 * np.pi) + 4.0 * np.pi * self.run.times[: self.length] / self.sc.horizon
        K = base + np.cos(phase)[:, None, None, None] * swing
        if player < self.gains.shape[1]:
            sees = self.run.adjacency[: self.length, player]
            if not sees.any():
                return None
            K = K * sees[:, None, :, None]
            own = K[:, :, player].copy()  # the block on z_i itself, for the attacker it sees
            K[:, :, player] = 2.0 * own - K.sum(axis=2)  # each z_j - z_i takes its block from z_i
        return Deviation(player, K)
