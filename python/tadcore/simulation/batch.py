"""Many games with the same weights, outcomes only."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tadcore._shared.arrays import Floats, as_flag, as_positions, as_seed, as_threads, as_trial
from tadcore._shared.calls import public
from tadcore._shared.html import as_html
from tadcore._shared.progress import pieces
from tadcore.errors import ScenarioError
from tadcore.game.compiled import core_world, game_of
from tadcore.game.outcome import Outcome, ending_codes, ending_names, kind_counts
from tadcore.scenarios.given import ScenarioLike, as_scenario

from .rules import capture_rows, refuse_between, refuse_mismatched, visibility_rows
from .termination import Termination, as_termination

if TYPE_CHECKING:
    from collections.abc import Iterator

    import pandas


_PIECE = 2**16  # games between two words of progress


@dataclass(frozen=True, eq=False, repr=False)
class Batch:
    """Outcomes of M games, in the order of the positions given; made by `simulate_batch`.

    ``len(batch)`` is M, and ``batch[i]`` is the `Outcome` of game i.

    Attributes
    ----------
    kind : ndarray of int8, shape (M,)
        Codes of `OutcomeKind`.
    defender : ndarray of int32, shape (M,)
        The intercepting defender, 0-based; -1 where none intercepted.
    time : ndarray of float64, shape (M,)
        The instant of the end.
    diverged : ndarray of bool, shape (M,)
        Whether the game diverged before its end or at it (`tadcore.game.Divergence`): what follows is played by the
        same rules, but ``kind`` and ``time`` say nothing of a pursuit then. Statistics count such games apart.
    passed : ndarray of bool, shape (M,), or None
        Whether a capture radius was entered between two instants, before the one that ended the game: with continuous
        termination the game would end there. Not looked for after a divergence. None where that was not asked for.
    n : int
        Number of defenders.
    scores : ndarray of float64, shape (M, n + 3), or None
        How far each game was from every outcome, in the order timeout, captured, intercepted, d1 … dn: at least 0
        exactly where the game ended so and did not diverge before. Lengths: the least change of the distances in
        question that would have decided it otherwise. None where that was not asked for.
    """

    kind: NDArray[np.int8]
    defender: NDArray[np.int32]
    time: Floats
    diverged: NDArray[np.bool_]
    passed: NDArray[np.bool_] | None = None
    n: int = 0
    scores: Floats | None = None

    def to_pandas(self) -> pandas.DataFrame:
        """One row for each game: ``outcome``, a categorical as in a study's table, and the arrays."""
        import pandas

        codes = ending_codes(self.kind, self.defender, self.diverged, self.n)
        columns = {"kind": self.kind, "defender": self.defender, "time": self.time, "diverged": self.diverged}
        columns |= {} if self.passed is None else {"passed": self.passed}
        return pandas.DataFrame({"outcome": pandas.Categorical.from_codes(codes, ending_names(self.n)), **columns})

    def _repr_html_(self) -> str:
        rows = [[name, f"{count:,}", ""] for name, count in self.counts().items()]
        return as_html(f"{len(self):,} games", ["outcome", "count", ""], rows)

    def counts(self) -> dict[str, int]:
        """How many games ended in each way; those that diverged, if any, are counted as ``"diverged"`` alone."""
        return kind_counts(self.kind, self.diverged)

    def __len__(self) -> int:
        return len(self.kind)

    @overload
    def __getitem__(self, index: int) -> Outcome: ...
    @overload
    def __getitem__(self, index: slice) -> Batch: ...
    def __getitem__(self, index: int | slice) -> Outcome | Batch:
        if isinstance(index, slice):
            passed = None if self.passed is None else self.passed[index]
            scores = None if self.scores is None else self.scores[index]
            ends = self.kind[index], self.defender[index], self.time[index], self.diverged[index]
            return Batch(*ends, passed, self.n, scores)
        end = int(self.kind[index]), int(self.defender[index]), float(self.time[index])
        return Outcome.of(*end, diverged=bool(self.diverged[index]))

    def __iter__(self) -> Iterator[Outcome]:
        return (self[i] for i in range(len(self)))

    def __repr__(self) -> str:
        counts = ", ".join(f"{count:,} {name}" for name, count in self.counts().items())
        many = 0 if self.passed is None else int(np.count_nonzero(self.passed))
        passed = f"; {many:,} passed within a capture radius between two instants" if many else ""
        return f"Batch({len(self):,} games: {counts}{passed})"


@public
def simulate_batch(
    sc: ScenarioLike,
    positions: ArrayLike,
    visibility_radii: ArrayLike | None = None,
    capture_radii: ArrayLike | None = None,
    threads: int | None = None,
    *,
    termination: Termination = "sampled",
    passes: bool = False,
    scores: bool = False,
    seed: int = 0,
    first_trial: int = 0,
    progress: bool = False,
) -> Batch:
    """Play M games that share the scenario's weights, horizon and step.

    Every row is checked before anything runs, and the outcomes are bitwise reproducible for any number of threads.

    Parameters
    ----------
    sc : Scenario, path or name
        The game; its positions are not used, its radii where none are given here.
    positions : array_like, shape (M, n + 2, dim)
        Initial positions, players ordered d1 … dn, target, attacker.
    visibility_radii : array_like, shape (M, m) or (m,), optional
        ζ of the m players with limited sight: d1 … dn, and in I2 the target; inf for unlimited. In I1 a further
        column for the target is accepted where it is inf throughout.
    capture_radii : array_like, shape (M, n + 1) or (n + 1,), optional
        σ, ordered d1 … dn, attacker.
    threads : int, optional
        Worker threads; all cores by default.
    termination : {"sampled", "continuous"}
        When a game ends: at an instant of the grid, or at the crossing of a capture radius itself; see
        `tadcore.simulate`.
    passes : bool
        Whether to look for games that enter a capture radius between two instants: `Batch.passed`.
    scores : bool
        Whether to say how far each game was from every outcome: `Batch.scores`. Every game is then played on to the
        horizon, past its end; the outcomes are the same.
    seed, first_trial : int
        What failures and disturbances are drawn from: row r is trial ``first_trial + r``, and has the course that
        ``simulate(sc, seed=seed, trial=first_trial + r)`` has. Without any they change nothing.
    progress : bool
        Whether to show a bar with the rate and the time left, where a terminal or a notebook watches.

    Returns
    -------
    Batch
        ``kind``, ``defender``, ``time``, ``diverged`` and, where asked for, ``passed`` and ``scores``, each of length
        M.

    Raises
    ------
    ScenarioError
        A shape or an entry breaks a rule, or ``termination`` is neither of the two; the field is named as in
        ``positions[17, 2, 0]``. Continuous termination or passes are asked for, and players are disturbed, or scores
        are asked for too.
    NoEquilibriumError
        The game has no equilibrium on [0, T].

    Examples
    --------
    >>> import tadcore
    >>> sc = tadcore.scenarios.load("paper-i1")
    >>> batch = tadcore.simulate_batch(sc, [sc.positions, sc.positions + 1.0])
    >>> print(batch[1])
    d1 intercepts the attacker at t = 1.395
    """
    sc = as_scenario(sc)
    starts = as_positions(positions, (sc.n + 2, sc.dim), rows=True)
    sight = visibility_rows(sc, visibility_radii, len(starts))
    capture = capture_rows(sc, capture_radii, len(starts))
    refuse_mismatched(sc, starts, sight, capture)
    key, first = as_seed(seed), as_trial("first_trial", first_trial)
    as_trial("first_trial", first + max(len(starts) - 1, 0))
    workers = as_threads(threads)
    ending, looking = as_termination(termination), as_flag("passes", passes)
    game = game_of(sc)
    refuse_between(sc, ending, passes=looking)
    world = core_world(sc)
    scored = as_flag("scores", scores)
    if scored:
        _refuse_scores(ending, passes=looking)

    def play(rows: slice) -> tuple[NDArray[Any], ...]:
        reach, near = (radii if len(radii) == 1 else radii[rows] for radii in (sight, capture))
        chance: dict[str, Any] = {"world": world, "seed": key, "first_trial": first + rows.start}
        if scored:
            return game.score_batch(starts[rows], reach, near, threads=workers, **chance)
        options: dict[str, Any] = {"continuous": ending == "continuous", "passes": looking}
        return game.simulate_batch(starts[rows], reach, near, threads=workers, **options, **chance)

    played = [play(rows) for rows in pieces(len(starts), _PIECE, "games", show=as_flag("progress", progress))]
    ends = [array if len(played) == 1 else np.concatenate([p[i] for p in played]) for i, array in enumerate(played[0])]
    kind, defender, time, diverged, more = ends
    passed = more if looking and not scored else None
    return Batch(kind, defender, time, diverged, passed, sc.n, more if scored else None)


def _refuse_scores(termination: Termination, *, passes: bool) -> None:
    """Refuse what depends on the motion between two instants: scores are of the instants of the grid."""
    rule = "with scores, which compare distances at the instants of the grid"
    if termination == "continuous":
        raise ScenarioError("termination", termination, f'"sampled" {rule}')
    if passes:
        raise ScenarioError("passes", passes, f"left out {rule}")
