"""Which inputs decide the outcome of a game: Sobol' indices over games played at drawn points."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from tadcore._shared.arrays import Floats
from tadcore._shared.calls import public
from tadcore._shared.text import one_of
from tadcore.errors import ScenarioError
from tadcore.scenario.quantities import component
from tadcore.scenarios.given import ScenarioLike, as_scenario
from tadcore.simulation.batch import simulate_batch
from tadcore.simulation.starts import rows_of
from tadcore.statistics.outcomes import indicators, outcome_names
from tadcore.statistics.sobol import Distribution, Sensitivity, sobol


@public
def sensitivity(
    sc: ScenarioLike,
    inputs: Mapping[str, Distribution],
    *,
    points: int = 1024,
    seed: int = 0,
    outputs: Sequence[str] = ("intercepted", "captured", "time"),
    level: float = 0.95,
    resamples: int = 500,
    threads: int | None = None,
) -> Sensitivity:
    """Play games at n (d + 2) points and say which inputs decide their outcomes.

    Parameters
    ----------
    sc : Scenario, path or name
        What holds where nothing varies.
    inputs : mapping of str to distribution
        Independent distributions of single numbers, by name: ``"attacker.position.x"``,
        ``"d1.visibility_radius"``, ``"target.position.y"``, …; anything with a ``ppf``.
    points : int
        n, a power of 2.
    seed : int
        Of the points and of the bootstrap.
    outputs : sequence of str
        Outcomes, ``"timeout"``, ``"captured"``, ``"intercepted"``, ``"d1"`` … and ``"diverged"``, and ``"time"``, when
        the game ends; the end of a game that diverged is a timeout as a rule, at T.
    level : float
        Confidence level of each interval.
    resamples : int
        Bootstrap resamples. With fewer than 2 / (1 - level) - 1 there are no such percentiles, and every interval is
        [0, 1].
    threads : int, optional
        Worker threads; all cores by default.

    Returns
    -------
    Sensitivity
        First-order and total indices; it prints as a table.

    Raises
    ------
    ScenarioError
        A name is not one of a number that may vary within one game, a drawn value breaks a rule, or an option does.
    NoEquilibriumError
        The game has no equilibrium on [0, T].
    """
    sc = as_scenario(sc)
    if not isinstance(inputs, Mapping):
        raise ScenarioError("inputs", inputs, "a mapping of names of numbers to distributions")
    known = (*outcome_names(sc.n, diverged=True), "time")
    if isinstance(outputs, str) or not isinstance(outputs, Iterable):
        raise ScenarioError("outputs", outputs, f"a sequence of names, each one of {', '.join(known)}")
    wanted = tuple(outputs)
    for output in wanted:
        one_of("outputs", output, known)
    taken: dict[str, str] = {}
    for name in inputs:
        path = component(sc, name).path
        if path in taken:
            raise ScenarioError(f"inputs[{name!r}]", name, f"named once only: {taken[path]!r} is the same number")
        taken[path] = name

    def play(x: Floats) -> Floats:
        rows = rows_of(sc, dict(zip(inputs, x, strict=True)), x.shape[1])
        batch = simulate_batch(sc, rows.positions, rows.visibility_radii, rows.capture_radii, threads=threads)
        found = np.vstack([indicators(batch.kind, batch.defender, sc.n, batch.diverged), batch.time])
        return np.asarray(found[[known.index(output) for output in wanted]], dtype=np.float64)

    return sobol(play, inputs, wanted, points=points, seed=seed, level=level, resamples=resamples)
