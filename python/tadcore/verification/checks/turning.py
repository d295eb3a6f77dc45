"""Scalar gains against gains that turn, in the plane: how much lower Θ can be, and whether the outcome depends on it.

A block aI + bJ, J a quarter turn, acts on the plane as the complex number a + ib, so with z_j = x_j + iy_j the closed
loop is ż = Cz with C complex, N × N. Θ of such blocks is even in the mirror image, the conjugate: where a minimum turns
there are two, and of them the one is taken whose first imaginary part that is not zero is positive, or its mirror
image. What descents find is an upper bound on the minimum among such blocks: a gap that is found exists, that none is
found is no proof. Where `Gains.certified_blocks` holds there is none, and no descent is made.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.optimize import minimize

from tadcore._shared.arrays import Floats, as_flag, as_index
from tadcore._shared.calls import public
from tadcore._shared.html import as_html
from tadcore._shared.progress import bar
from tadcore.errors import ScenarioError
from tadcore.game.equilibrium import solve_equilibrium
from tadcore.game.outcome import Outcome
from tadcore.game.synthesis import synthesize
from tadcore.scenario.model import Scenario
from tadcore.scenarios.given import ScenarioLike, as_scenario
from tadcore.simulation.play import simulate
from tadcore.simulation.run import Run
from tadcore.verification.oracle.draws import as_seed, generator
from tadcore.verification.oracle.matrices import matrices_of
from tadcore.verification.oracle.objective import FullObjective
from tadcore.verification.report import Measurement, VerificationReport

Complexes: TypeAlias = NDArray[np.complex128]

LOWER = 1e-6
"""How much lower, relatively, Θ must be in blocks that turn to count."""
_TURN = np.array([[0.0, -1.0], [1.0, 0.0]])
_MOST = 10**6


@dataclass(frozen=True, repr=False)
class TurningStudy:
    """What `turning_study` found.

    Attributes
    ----------
    instants : int
        Instants of the game with scalar gains.
    covered : int
        Of these, those at which `Gains.certified_blocks` proves that no blocks are lower.
    lower : int
        Those at which blocks that turn were found with a Θ lower by more than 1e-6 of it.
    widest, at : float
        The largest gap, relative to Θ of the scalars, and its instant; 0 and nan where there is none.
    starts : int
        Descents at each instant that is not covered.
    scalar, turning, mirror : Outcome
        The ends of the game with scalar gains, with turning gains and with their mirror images.
    """

    instants: int
    covered: int
    lower: int
    widest: float
    at: float
    starts: int
    scalar: Outcome
    turning: Outcome
    mirror: Outcome

    @property
    def depends(self) -> bool:
        """Whether who wins, or which defender intercepts, depends on the choice of gains."""
        ends = {(end.kind, end.defender) for end in (self.scalar, self.turning, self.mirror)}
        return len(ends) > 1

    def lines(self) -> list[str]:
        """The result as text."""
        verdict = "depends on the choice" if self.depends else "does not depend on the choice"
        rows = [f"  {name:<8} {value}" for name, value in self._rows()]
        return [f"Scalar and turning gains: the outcome {verdict}", *rows]

    @property
    def found(self) -> str:
        """Where turning gains are lower, in words."""
        where = f", at t = {self.at:.6g}" if self.lower else ""
        searched = f"{self.starts} descents at each of the {self.instants - self.covered} that are not covered"
        return f"lower at {self.lower} of {self.instants} instants, by up to {self.widest:.3g} of Θ{where} ({searched})"

    def _rows(self) -> list[tuple[str, str]]:
        return [
            ("covered", f"{self.covered} of {self.instants} instants: it is proved that no blocks have a lower Θ"),
            ("turning", self.found),
            ("scalar", str(self.scalar)),
            ("turning", str(self.turning)),
            ("mirror", str(self.mirror)),
        ]

    def __repr__(self) -> str:
        return "\n".join(self.lines())

    def _repr_html_(self) -> str:
        return as_html(self.lines()[0], ["", ""], [list(row) for row in self._rows()])


@public
def turning_study(sc: ScenarioLike, *, starts: int = 4, seed: int = 0, progress: bool = True) -> TurningStudy:
    """Compare scalar gains with gains that turn along a game in the plane, and play it with either.

    Parameters
    ----------
    sc : Scenario, path or name
        The game.
    starts : int
        Descents in turning gains at each (instant, network) that no certificate covers.
    seed : int
        Key of the starting points.
    progress : bool
        Whether to show a bar where standard error is a terminal.

    Returns
    -------
    TurningStudy
        The gaps along the game and the three outcomes.

    Raises
    ------
    NoEquilibriumError
        The game has no equilibrium on [0, T].
    ScenarioError
        The game is not one of the plane, or has a receding horizon, the team criterion or failures.
    """
    sc = as_scenario(sc)
    if sc.is_variant or sc.is_random:
        raise ScenarioError("sc", "a variant of the paper's game", "one with its feedback, criterion and no failures")
    return compare_turning(simulate(sc), starts=starts, seed=seed, progress=progress)


def compare_turning(run: Run, *, starts: int = 4, seed: int = 0, progress: bool = True) -> TurningStudy:
    """The same for a run with scalar gains that is at hand."""
    sc = run.scenario
    starts, seed = as_index("starts", starts, _MOST, least=1), as_seed(seed)
    if sc.dim != 2:
        raise ScenarioError("sc", f"a game in {sc.dim} dimensions", "one in the plane: only there do gains turn")
    search = _Search(sc, starts, seed)
    covered = lower = 0
    widest, at = 0.0, float("nan")
    instants = len(run.times) - 1
    for k in bar(range(instants), "comparing", show=as_flag("progress", progress), total=instants):
        found = search.at(k, np.asarray(run.adjacency[k]))
        covered += found.covered
        lower += found.gap > LOWER
        if found.gap > max(widest, LOWER):
            widest, at = found.gap, float(run.times[k])
    turned = [play_turning(sc, search, mirror=mirror) if lower else run.outcome for mirror in (False, True)]
    return TurningStudy(instants, covered, lower, widest, at, starts, run.outcome, *turned)


def check_turning(run: Run, *, starts: int, seed: int) -> VerificationReport:
    """Measure how much lower Θ is in gains that turn along a run, and say whether its outcome depends on them.

    Nothing is accepted or not: the scalar gains are a choice.
    """
    if run.scenario.dim != 2 or run.scenario.is_random:
        return VerificationReport("turning", (), notes=("turning: gains turn in the plane, and nothing may be random",))
    study = compare_turning(run, starts=starts, seed=seed)
    share = study.covered / study.instants
    covered = Measurement(
        "turning.covered", share, "share of instants at which it is proved that no blocks have a lower Θ"
    )
    gap = Measurement("turning.gap", study.widest, f"largest gap of Θ to gains that turn, over Θ; {study.found}")
    ends = f"turning {study.turning}, mirror image {study.mirror}"
    depends = f"turning: the outcome {'depends' if study.depends else 'does not depend'} on the choice of gains: {ends}"
    return VerificationReport("turning", (), (covered, gap), (depends,))


@dataclass(frozen=True)
class _Found:
    """Gain rows (m, N), complex where they turn; whether blocks are covered; by how much Θ is lower."""

    rows: Complexes
    covered: bool
    gap: float


class _Search:
    """The lowest Θ among turning gains, by (instant, network)."""

    def __init__(self, sc: Scenario, starts: int, seed: int) -> None:
        self.sc, self.starts, self.seed = sc, starts, seed
        self.m = matrices_of(sc)
        self.values = self.m.values(solve_equilibrium(sc).P)
        self._known: dict[tuple[int, bytes], _Found] = {}

    def at(self, k: int, adjacency: NDArray[np.bool_]) -> _Found:
        """The turning gains of t_k under a network: the scalar ones where nothing lower is found."""
        key = k, adjacency.tobytes()
        if key not in self._known:
            self._known[key] = self._find(k, adjacency)
        return self._known[key]

    def _find(self, k: int, adjacency: NDArray[np.bool_]) -> _Found:
        gains = synthesize(self.sc, step=k, adjacency=adjacency)
        scalars = _Found(gains.rows.astype(complex), gains.certified_blocks, 0.0)
        if gains.certified_blocks or not adjacency.any():
            return scalars
        objective = FullObjective(self.sc, self.m, self.values[:, k], adjacency)
        theta, x = lowest_turning(objective, gains.rows, self.starts, generator(self.seed, k))
        gap = 1.0 - theta / gains.theta if gains.theta > 0.0 else 0.0
        if gap <= LOWER:
            return scalars
        rows = np.zeros(gains.rows.shape, dtype=complex)
        for (i, j), gain in zip(objective.seen.tolist(), x.tolist(), strict=True):
            rows[i, j] += gain
            if i != j:
                rows[i, i] -= gain
        return _Found(rows, False, gap)


def lowest_turning(
    objective: FullObjective, rows: Floats, starts: int, rng: np.random.Generator
) -> tuple[float, Complexes]:
    """The lowest Θ that BFGS finds in blocks aI + bJ, and a + ib by player seen, of two mirror images the first.

    Parameters
    ----------
    objective : FullObjective
        Θ in blocks of 2 × 2.
    rows : ndarray, shape (m, N)
        Scalar gains: every other descent begins there, with random b.
    starts : int
        Descents.
    rng : Generator
        Of the starting points.
    """
    scalars = objective.blocks(rows)[::4]
    basis = np.kron(np.eye(len(scalars)), np.array([np.eye(2).ravel(), _TURN.ravel()]))
    size = max(float(np.abs(scalars).max()), 0.3)
    best, found = np.inf, np.zeros(len(basis))

    def theta(y: Floats) -> tuple[float, Any]:
        return objective.theta(y @ basis), basis @ objective.gradient(y @ basis)

    for start in range(starts):
        y = rng.normal(scale=size, size=len(basis))
        if start % 2 == 0:
            y[::2] = scalars
        end = minimize(theta, y, jac=True, method="BFGS", options={"gtol": 1e-10})
        if end.fun < best:
            best, found = float(end.fun), end.x
    gains = found[::2] + 1j * found[1::2]
    turned = np.flatnonzero(np.abs(gains.imag) > 1e-8 * np.abs(gains).max())
    if len(turned) and gains.imag[turned[0]] < 0.0:
        gains = gains.conj()
    return best, gains


def play_turning(sc: Scenario, search: _Search, *, mirror: bool) -> Outcome:
    """The end of a game in the plane whose limited players use turning gains, or their mirror images."""
    n, m = sc.n, search.m
    places = np.array([*(d.position for d in sc.defenders), sc.target.position, sc.attacker.position])
    z = places[:-1, 0] - places[-1, 0] + 1j * (places[:-1, 1] - places[-1, 1])
    caught = np.array([d.capture_radius for d in sc.defenders])
    sight = [d.visibility_radius for d in sc.defenders]
    zeta = np.array([*sight, *([sc.target.visibility_radius] if sc.interaction == "I2" else [])], dtype=float)
    own = np.eye(n + 1, dtype=bool)[: len(zeta)]
    delta = sc.horizon / sc.steps
    for k in range(sc.steps + 1):
        time = k * delta
        near = np.abs(z[:n])
        reached = np.flatnonzero(near <= caught)
        if len(reached):
            return Outcome("intercepted", int(reached[np.argmin(near[reached])]), time)
        if abs(z[n]) <= sc.attacker.capture_radius:
            return Outcome("captured", None, time)
        if k == sc.steps:
            break
        distance = np.where(own, np.abs(z)[None, :], np.abs(z[None, :] - z[: len(zeta), None]))
        found = search.at(k, distance <= zeta[:, None]).rows
        rows = m.rows(search.values[:, k]).astype(complex)
        rows[: len(zeta)] = found.conj() if mirror else found
        z = expm(delta * (m.B @ rows)) @ z
    return Outcome("timeout", None, sc.horizon)
