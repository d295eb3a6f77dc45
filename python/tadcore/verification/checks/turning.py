"""Scalar gains against gains that turn, in the plane: how much lower Θ can be, and whether the outcome depends on it.

A block aI + bJ, J a quarter turn, acts on the plane as the complex number a + ib, so with z_j = x_j + iy_j the closed
loop is ż = Cz with C complex, N × N. Θ of such blocks is even in the mirror image, the conjugate: where a minimum turns
there are two, and of them the one is taken whose first imaginary part that is not zero is positive, or its mirror
image. What a search finds is an upper bound on the minimum among such blocks: a gap that is found exists, that none is
found is no proof. Where `Gains.certified_blocks` holds there is none, and no search is made.
"""

from __future__ import annotations

from dataclasses import dataclass

from tadcore._shared.arrays import as_flag
from tadcore._shared.calls import public
from tadcore._shared.html import as_html
from tadcore._shared.progress import bar
from tadcore.errors import ScenarioError
from tadcore.game.outcome import Outcome
from tadcore.game.synthesis import synthesize
from tadcore.scenarios.given import ScenarioLike, as_scenario
from tadcore.simulation.play import simulate
from tadcore.simulation.run import Run
from tadcore.verification.report import Measurement, VerificationReport

LOWER = 1e-6
"""How much lower, relatively, Θ must be in blocks that turn to count."""


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
    scalar, turning, mirror : Outcome
        The ends of the game with scalar gains, with turning gains and with their mirror images.
    """

    instants: int
    covered: int
    lower: int
    widest: float
    at: float
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
        return f"lower at {self.lower} of {self.instants} instants, by up to {self.widest:.3g} of Θ{where}"

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
def turning_study(sc: ScenarioLike, *, progress: bool = True) -> TurningStudy:
    """Compare scalar gains with gains that turn along a game in the plane, and play it with either.

    Parameters
    ----------
    sc : Scenario, path or name
        The game.
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
        The game is not one of the plane.
    """
    return compare_turning(simulate(as_scenario(sc)), progress=progress)


def compare_turning(run: Run, *, progress: bool = True) -> TurningStudy:
    """The same for a run with scalar gains that is at hand."""
    sc = run.scenario
    if sc.dim != 2:
        raise ScenarioError("sc", f"a game in {sc.dim} dimensions", "one in the plane: only there do gains turn")
    covered = lower = 0
    widest, at = 0.0, float("nan")
    instants = len(run.times) - 1
    for k in bar(range(instants), "comparing", show=as_flag("progress", progress), total=instants):
        gains = synthesize(sc, step=k, adjacency=run.adjacency[k], gains="turning")
        covered += gains.certified_blocks
        gap = 1.0 - gains.theta / run.theta[k] if gains.turns else 0.0
        lower += gap > LOWER
        if gap > max(widest, LOWER):
            widest, at = gap, float(run.times[k])
    ends = [
        simulate(sc, gains="turning", mirror=mirror, seed=run.seed, trial=run.trial).outcome for mirror in (False, True)
    ]
    return TurningStudy(instants, covered, lower, widest, at, run.outcome, *ends)


def check_turning(run: Run) -> VerificationReport:
    """Measure how much lower Θ is in gains that turn along a run, and say whether its outcome depends on them.

    Nothing is accepted or not: the scalar gains are a choice.
    """
    if run.scenario.dim != 2:
        return VerificationReport("turning", (), notes=("turning: gains turn in the plane alone",))
    study = compare_turning(run, progress=False)
    share = study.covered / study.instants
    covered = Measurement(
        "turning.covered", share, "share of instants at which it is proved that no blocks have a lower Θ"
    )
    gap = Measurement("turning.gap", study.widest, f"largest gap of Θ to gains that turn, over Θ; {study.found}")
    ends = f"turning {study.turning}, mirror image {study.mirror}"
    depends = f"turning: the outcome {'depends' if study.depends else 'does not depend'} on the choice of gains: {ends}"
    return VerificationReport("turning", (), (covered, gap), (depends,))
