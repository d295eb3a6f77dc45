"""Which inputs decide the outcome of a game: Sobol' indices over games played at drawn points."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from tadcore._core import simulate_games
from tadcore._shared.arrays import Floats, as_flag
from tadcore._shared.calls import public
from tadcore._shared.progress import pieces
from tadcore._shared.text import one_of
from tadcore.errors import MISSING, ScenarioError
from tadcore.game.outcome import NO_EQUILIBRIUM, UNPLAYED
from tadcore.sampling.adapters import as_sampler
from tadcore.sampling.base import Block, Sampler
from tadcore.scenario.model import Scenario
from tadcore.scenario.numbers import game_quantities_of, games_of
from tadcore.scenario.paths import normal
from tadcore.scenario.quantities import Quantity, component, core_setups, setups
from tadcore.scenarios.given import ScenarioLike, as_scenario
from tadcore.simulation.batch import simulate_batch
from tadcore.statistics.outcomes import indicators, outcome_names
from tadcore.statistics.sobol import Distribution, Joint, Sensitivity, sobol
from tadcore.study.study import Study
from tadcore.study.vary import quantities

from .replays import refuse_random

_PIECE = 2**9  # games of their own between two words of progress
_LOWEST, _HIGHEST = 2.0**-54, 1.0 - 2.0**-53  # samplers take points of the open unit cube


@public
def sensitivity(
    sc: ScenarioLike | Study,
    inputs: Mapping[str, Any] | None = None,
    *,
    points: int = 1024,
    seed: int = 0,
    outputs: Sequence[str] = ("intercepted", "captured", "time"),
    level: float = 0.95,
    resamples: int = 500,
    threads: int | None = None,
    progress: bool = False,
) -> Sensitivity:
    """Play games at n (d + 2) points and say which inputs decide their outcomes.

    Where a weight, λ, γ, the horizon or the step is among the inputs, every point is a game of its own, as in a study
    that varies it (`tadcore.Study`).

    Parameters
    ----------
    sc : Scenario, path, name or Study
        What holds where nothing varies; or a study, whose varied quantities are the inputs.
    inputs : mapping of str to distribution
        Not with a study. Independent inputs: paths of numbers and how they are distributed, such as
        ``"attacker.position.x"`` or ``"d1.visibility_radius"`` with anything that has a ``ppf``, or a sampler, as a
        study takes them. A position that is drawn as a whole is one input.
    points : int
        n, a power of 2.
    seed : int
        Of the points and of the bootstrap.
    outputs : sequence of str
        Outcomes, ``"timeout"``, ``"captured"``, ``"intercepted"``, ``"d1"`` …, ``"diverged"`` and
        ``"no_equilibrium"``, and ``"time"``, when the game ends; the end of a game that diverged is a timeout as a
        rule, at T.
    level : float
        Confidence level of each interval.
    resamples : int
        Bootstrap resamples. With fewer than 2 / (1 - level) - 1 there are no such percentiles, and every interval is
        [0, 1].
    threads : int, optional
        Worker threads; all cores by default.
    progress : bool
        Whether to show a bar over the games, where a terminal or a notebook watches.

    Returns
    -------
    Sensitivity
        First-order and total indices; it prints as a table.

    Raises
    ------
    ScenarioError
        A name is not one of a number of the game, a drawn value breaks a rule, or an option does; or the game is one of
        chance, with failures or disturbances.
    NoEquilibriumError
        The game has no equilibrium on [0, T].
    """
    if isinstance(sc, Study):
        if inputs is not None:
            raise ScenarioError("inputs", inputs, "left out: a study brings what it varies")
        game, inputs = sc.scenario, sc.vary
    else:
        game = as_scenario(sc)
    refuse_random(game, "sensitivity", "Sobol' indices are of a function of the inputs alone")
    if not isinstance(inputs, Mapping):
        given = MISSING if inputs is None else inputs
        raise ScenarioError("inputs", given, "a mapping of names of numbers to distributions")
    known = (*outcome_names(game.n, diverged=True), NO_EQUILIBRIUM, "time")
    if isinstance(outputs, str) or not isinstance(outputs, Iterable):
        raise ScenarioError("outputs", outputs, f"a sequence of names, each one of {', '.join(known)}")
    wanted = tuple(outputs)
    for output in wanted:
        one_of("outputs", output, known)
    varied, drawn = _inputs(game, inputs)
    show = as_flag("progress", progress)

    def play(x: Floats) -> Floats:
        found = _events(game, varied, np.ascontiguousarray(x.T), threads, show=show)
        return found[[known.index(output) for output in wanted]]

    return sobol(play, drawn, wanted, points=points, seed=seed, level=level, resamples=resamples)


def _inputs(sc: Scenario, inputs: Mapping[str, Any]) -> tuple[tuple[Quantity, ...], dict[str, Distribution | Joint]]:
    """The quantities that the inputs mean, and how each is drawn, by its name."""
    varied: list[Quantity] = []
    drawn: dict[str, Distribution | Joint] = {}
    taken: dict[str, str] = {}
    for name, given in inputs.items():
        by_ppf = callable(getattr(given, "ppf", None)) and not isinstance(given, Sampler)
        found = [component(sc, name)] if by_ppf and name not in game_quantities_of(sc) else None
        sampler = given if isinstance(given, Sampler) else as_sampler(f"inputs[{name!r}]", given)
        for quantity, own in [(q, sampler) for q in found] if found else quantities(sc, {name: given}):
            if quantity.path in taken:
                rule = f"named once only: {taken[quantity.path]!r} is the same number"
                raise ScenarioError(f"inputs[{name!r}]", name, rule)
            taken[quantity.path] = name
            if not own.by_points:
                raise ScenarioError(f"inputs[{name!r}]", given, "a sampler with quantiles")
            label = name if found or quantity.path == normal(name) else quantity.path
            varied.append(quantity)
            drawn[label] = given if by_ppf and quantity.components == 1 else _joint(own, quantity.components)
    return tuple(varied), drawn


def _joint(sampler: Sampler, components: int) -> Joint:
    def draw(points: Floats) -> Floats:
        inside = np.clip(points, _LOWEST, _HIGHEST)
        return sampler.draw(Block(inside, np.random.default_rng(0), 0), components)

    return Joint(sampler.coordinates(components), draw)


def _events(sc: Scenario, varied: tuple[Quantity, ...], values: Floats, threads: int | None, *, show: bool) -> Floats:
    """Whether each trial ended in each outcome, last without an equilibrium, and when it ended."""
    if not any(quantity.of_game for quantity in varied):
        batch = simulate_batch(sc, *setups(sc, varied, values), threads=threads, progress=show)
        kind, defender, time, diverged = batch.kind, batch.defender, batch.time, batch.diverged
    else:
        rows, numbers = core_setups(sc, varied, values), games_of(sc, varied, values)
        found = [
            simulate_games(
                sc.interaction,
                numbers[some],
                *(array if len(array) == 1 else array[some] for array in rows),
                threads=threads,
            )
            for some in pieces(len(numbers), _PIECE, "games", show=show)
        ]
        kind, defender, time, _, diverged, _ = (np.concatenate(column) for column in zip(*found, strict=True))
    played = kind != UNPLAYED
    events = indicators(np.where(played, kind, 0), defender, sc.n, diverged)
    return np.asarray(np.vstack([events & played, ~played, time]), dtype=np.float64)
