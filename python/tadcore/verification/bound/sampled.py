"""How much of a game's gain table is proved: entries that games visit, sampled and proved one by one."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from tadcore._shared.arrays import Floats, as_index
from tadcore._shared.calls import public
from tadcore._shared.html import as_html, line
from tadcore._shared.progress import bar
from tadcore.errors import ScenarioError
from tadcore.game.equilibrium import solve_equilibrium
from tadcore.game.synthesis import synthesize
from tadcore.scenario.model import Scenario
from tadcore.scenarios.given import ScenarioLike, as_scenario
from tadcore.simulation.play import simulate
from tadcore.statistics.intervals import proportion_interval
from tadcore.verification.oracle.draws import generator
from tadcore.verification.oracle.matrices import matrices_of
from tadcore.verification.oracle.objective import FullObjective

from .along import MOST
from .bounds import ThetaBound, prove_theta
from .proof import Proof
from .second_order import largest_group

_MOST_TRIALS = 10**6
_GAMES = 2**63
"""Draws from here on place the players of a game; draw 0 picks the entries."""


@dataclass(frozen=True)
class Missed:
    """An entry whose gains are not the lowest: a fault of the search.

    Attributes
    ----------
    step : int
        k of the instant.
    adjacency : tuple of tuple of int
        𝒜.
    bound : ThetaBound
        Both values of Θ, the rows of the lower one and the proof.
    """

    step: int
    adjacency: tuple[tuple[int, ...], ...]
    bound: ThetaBound


@dataclass(frozen=True, repr=False)
class TableProof:
    """What `prove_table` proved.

    Attributes
    ----------
    title : str
        The game.
    trials : int
        Games that were played.
    visited : int
        Entries (instant, network) that they passed, each counted once.
    entries : int
        Entries sampled from these, uniformly and without replacement.
    not_tried : int
        Of the sampled ones, those with more than ``most`` unknowns that do not decouple.
    proved : int
        Of the others, those whose gains are proved to have the lowest Θ among scalar gains, to 1e-6.
    certified : int
        Of the proved ones, those with `Gains.certified`.
    missed : tuple of Missed
        Entries with a lower Θ than that of the gains.
    most, level : int, float
        As asked for.
    """

    title: str
    trials: int
    visited: int
    entries: int
    not_tried: int
    proved: int
    certified: int
    missed: tuple[Missed, ...] = field(repr=False)
    most: int
    level: float

    @property
    def tried(self) -> int:
        """Sampled entries of which a proof was tried."""
        return self.entries - self.not_tried

    @property
    def open(self) -> int:
        """Entries that were tried, and neither proved nor found to be missed."""
        return self.tried - self.proved - len(self.missed)

    @property
    def interval(self) -> tuple[float, float]:
        """Clopper and Pearson's interval for the share of entries, among those small enough, that are not proved.

        The upper end bounds the share that is not global: of all entries that the games visited, and with at most
        ``most`` unknowns that do not decouple. A sample without replacement makes it hold the more.
        """
        if self.tried == 0:
            return 0.0, 1.0
        if self.entries == self.visited:
            share = 1.0 - self.proved / self.tried
            return share, share
        low, high = proportion_interval(self.tried - self.proved, self.tried, level=self.level, method="exact")
        return float(low), float(high)

    def lines(self) -> list[str]:
        """The result as text."""
        rows = [f"  {name:<12}{value:>9}  {what}" for name, value, what in self._rows()]
        return [f"{self.title}: {self._verdict()}", *rows]

    def _verdict(self) -> str:
        if self.tried == 0:
            return "nothing tried"
        whole = self.entries == self.visited
        words = "all of them sampled" if whole else f"{100.0 * self.level:.4g} % confidence"
        share = f"at most {100.0 * self.interval[1]:.3g} % of the visited entries"
        return f"{share} with at most {self.most} unknowns are not proved to be global ({words})"

    def _rows(self) -> list[tuple[str, str, str]]:
        return [
            ("games", f"{self.trials:,}", "played from random starts"),
            ("visited", f"{self.visited:,}", "entries (instant, network)"),
            ("sampled", f"{self.entries:,}", "of these"),
            ("not tried", f"{self.not_tried:,}", f"more than {self.most} unknowns that do not decouple"),
            (
                "proved",
                f"{self.proved:,}",
                f"lowest Θ among scalar gains, to 1e-6; {self.certified:,} of them certified",
            ),
            ("missed", f"{len(self.missed):,}", "a lower Θ was found"),
            ("open", f"{self.open:,}", "neither"),
        ]

    def __repr__(self) -> str:
        return "\n".join(self.lines())

    def _repr_html_(self) -> str:
        notes = [line(f"missed at k = {m.step}: 𝒜 = {m.adjacency}, {m.bound!r}") for m in self.missed]
        return as_html(self.lines()[0], ["entries", "count", ""], [list(row) for row in self._rows()], *notes)


@public
def prove_table(
    sc: ScenarioLike,
    *,
    trials: int = 200,
    entries: int = 1000,
    half_width: float = 3.0,
    most: int = MOST,
    level: float = 0.95,
    seed: int = 0,
    progress: bool = True,
) -> TableProof:
    """Prove sampled entries of a game's gain table, and bound the share that is not proved.

    `trials` games are played with every player's start uniform in a cube; of the entries (instant, network) that they
    visit `entries` are drawn, and each is proved, or not, by `theta_bound` of order two.

    Parameters
    ----------
    sc : Scenario, path or name
        The game; its starts do not matter.
    trials : int
        Games.
    entries : int
        Entries to prove; all that are visited, where these are fewer.
    half_width : float
        The cube is [-half_width, half_width]^dim, in the unit of positions.
    most : int
        Unknowns that do not decouple, at most 14: entries with more are not tried. Seconds each at 9.
    level : float
        Confidence level of the interval.
    seed : int
        Key of the starts and of the sample.
    progress : bool
        Whether to show a bar where standard error is a terminal.

    Returns
    -------
    TableProof
        The counts, the interval and the entries at which the search missed a lower Θ.

    Raises
    ------
    NoEquilibriumError
        The game has no equilibrium on [0, T].
    ScenarioError
        An argument is out of its range, or the game is not the paper's: a receding horizon, the team criterion, or
        random failures.

    Examples
    --------
    >>> import tadcore
    >>> proof = tadcore.verification.prove_table("paper-i1", trials=2, entries=10, most=4, progress=False)
    >>> proof.missed
    ()
    """
    sc = as_scenario(sc)
    trials = as_index("trials", trials, _MOST_TRIALS, least=1)
    entries = as_index("entries", entries, _MOST_TRIALS, least=1)
    most = as_index("most", most, 14, least=1)
    if sc.is_variant or sc.is_random:
        raise ScenarioError("sc", "a variant of the paper's game", "one with its feedback, criterion and no failures")
    if not (isinstance(half_width, int | float) and 0.0 < half_width < 1e6):
        raise ScenarioError("half_width", half_width, "a number in (0, 1e6)")
    proportion_interval(0, 1, level=level)  # refuses a bad level before any work
    visited = _visited(sc, trials, float(half_width), seed, progress)
    chosen = generator(seed, 0).permutation(len(visited))[:entries]
    sample = sorted((visited[i] for i in chosen.tolist()), key=lambda entry: (entry[1], entry[0]))
    values = matrices_of(sc).values(solve_equilibrium(sc).P)
    found = list(_proofs(sc, sample, values, most, progress))
    tried = [(k, seen, certified, bound) for k, seen, certified, bound in found if bound is not None]
    missed = tuple(
        Missed(k, tuple(map(tuple, seen.astype(int).tolist())), bound)
        for k, seen, _, bound in tried
        if bound.lower is not None and not bound.tight
    )
    proved = [certified for _, _, certified, bound in tried if bound.proved and bound.tight]
    title = f"{sc.interaction}, {sc.n} defenders"
    return TableProof(
        title=title,
        trials=trials,
        visited=len(visited),
        entries=len(sample),
        not_tried=len(found) - len(tried),
        proved=len(proved),
        certified=sum(proved),
        missed=missed,
        most=most,
        level=float(level),
    )


def _visited(sc: Scenario, trials: int, half_width: float, seed: int, progress: bool) -> list[tuple[int, bytes]]:
    """The entries that games from random starts pass, in a fixed order."""
    names = [*(f"defenders[{i}]" for i in range(sc.n)), "target", "attacker"]
    found: set[tuple[int, bytes]] = set()
    for trial in bar(range(trials), "playing", show=progress, total=trials):
        starts = generator(seed, _GAMES + trial).uniform(-half_width, half_width, (len(names), sc.dim)).tolist()
        run = simulate(sc.replace({f"{name}.position": at for name, at in zip(names, starts, strict=True)}))
        found.update((k, seen.tobytes()) for k, seen in enumerate(np.asarray(run.adjacency[:-1])))
    return sorted(found)


def _proofs(
    sc: Scenario, sample: list[tuple[int, bytes]], values: Floats, most: int, progress: bool
) -> Iterator[tuple[int, np.ndarray[tuple[int, ...], np.dtype[np.bool_]], bool, ThetaBound | None]]:
    """Step, 𝒜, whether certified, and the bound of each entry; None where it was not tried."""
    m, shape = matrices_of(sc), (len(sc.constrained), sc.n + 1)
    near: tuple[bytes, Proof | None] = (b"", None)
    for k, network in bar(sample, "proving", show=progress, total=len(sample)):
        seen = np.frombuffer(network, dtype=np.bool_).reshape(shape)
        objective = FullObjective(sc, m, values[:, k], seen, dim=1)
        if largest_group(objective) > most:
            yield k, seen, False, None
            continue
        gains = synthesize(sc, step=k, adjacency=seen)
        bound = prove_theta(objective, gains.rows, near[1] if near[0] == network else None, deep=True)
        near = (network, bound.proof)
        yield k, seen, gains.certified, bound
