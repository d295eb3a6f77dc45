"""What a study is: a scenario, what varies, how many trials, and how they are drawn."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from tadcore._shared.arrays import Floats, as_flag, as_index, as_seed
from tadcore._shared.calls import public
from tadcore._shared.threads import in_order
from tadcore.errors import ScenarioError
from tadcore.sampling.adapters import as_sampler
from tadcore.sampling.base import Sampler
from tadcore.sampling.design import CHUNK, DESIGNS, Design
from tadcore.scenario.model import Scenario
from tadcore.scenario.paths import normal
from tadcore.scenario.quantities import Quantity
from tadcore.scenarios.given import ScenarioLike, as_scenario
from tadcore.simulation.rules import refuse_between
from tadcore.simulation.termination import Termination, as_termination

from .keeping import Keep, as_keep
from .manifest import Manifest
from .plan import Plan
from .task import rows_of_chunks

_MOST_TRIALS = 2**32  # points of the Sobol' sequence


class Definition:
    """The scenario, what varies, how many trials and how they are drawn; `Study` has the parameters."""

    @public
    def __init__(
        self,
        sc: ScenarioLike,
        vary: Mapping[str, Any],
        *,
        trials: int,
        seed: int = 0,
        design: Design = "random",
        termination: Termination = "sampled",
        passes: bool = False,
        keep: Keep = "all",
    ) -> None:
        sc = as_scenario(sc)
        if not isinstance(vary, Mapping) or not (vary or sc.is_random):
            example = 'such as {"attacker.position": Box([-3, -3], [3, 3])}'
            alone = "; it may be empty where something fails at random or is disturbed"
            raise ScenarioError("vary", vary, f"a mapping of at least one path to a sampler, {example}{alone}")
        if not isinstance(design, str) or design not in DESIGNS:
            raise ScenarioError("design", design, " or ".join(f'"{name}"' for name in DESIGNS))
        self.trials = as_index("trials", trials, _MOST_TRIALS, least=1)
        samplers: dict[str, Sampler] = {}
        for path, value in vary.items():
            name = normal(path, "vary")
            if name in samplers:
                raise ScenarioError(f'vary["{path}"]', value, f"given once only: {name} is there already")
            samplers[name] = as_sampler(f'vary["{path}"]', value)
        self._keep = as_keep(keep)
        key = as_seed(seed)
        ending, looking = as_termination(termination), as_flag("passes", passes)
        refuse_between(sc, ending, passes=looking)
        self.plan = Plan(sc, samplers, key, design, ending, looking)
        for quantity, sampler in self.plan.varied:
            if design != "random" and not sampler.by_points:
                rule = f'a sampler with quantiles in the {design} design; this one needs design="random"'
                raise ScenarioError(f'vary["{quantity.path}"]', sampler, rule)

    @property
    def scenario(self) -> Scenario:
        """The scenario around which the inputs vary."""
        return self.plan.scenario

    @property
    def vary(self) -> Mapping[str, Sampler]:
        """The sampler of every path."""
        return MappingProxyType(self.plan.vary)

    @property
    def seed(self) -> int:
        """The seed."""
        return self.plan.seed

    @property
    def design(self) -> Design:
        """The design of the draws."""
        return self.plan.design

    @property
    def termination(self) -> Termination:
        """When a game ends."""
        return self.plan.termination

    @property
    def passes(self) -> bool:
        """Whether passes within a capture radius are looked for."""
        return self.plan.passes

    @property
    def keep(self) -> Keep:
        """What `Study.run` keeps of every trial, unless it is told."""
        return self._keep

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """What varies, wildcards expanded."""
        return self.plan.quantities

    @property
    def games(self) -> tuple[str, ...]:
        """What varies and makes every trial a game of its own; empty where all trials share one."""
        return self.plan.games

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the inputs, one for each varied component."""
        return self.plan.columns

    def inputs(self, trials: int | None = None) -> dict[str, Floats]:
        """Draw without playing: the inputs of the first trials, all of them by default, by the name of the column.

        Parameters
        ----------
        trials : int, optional
            How many.
        """
        wanted = self.trials if trials is None else as_index("trials", trials, self.trials, least=1)
        drawn = list(in_order(self._drawn, enumerate(rows_of_chunks(wanted)), None))
        return dict(zip(self.columns, np.ascontiguousarray(np.concatenate(drawn).T), strict=True))

    def draw(self, trial: int) -> Floats:
        """The inputs of one trial, shape (1, columns)."""
        return self.plan.draw(trial // CHUNK)[trial % CHUNK :][:1]

    def _drawn(self, job: tuple[int, int]) -> Floats:
        return self.plan.draw(*job)

    def check(self, *, progress: bool = False) -> None:
        """Draw every trial without playing, as `run` does before anything else; a million take 0.1 s.

        Parameters
        ----------
        progress : bool
            Show a bar in a terminal or a notebook.

        Raises
        ------
        ScenarioError
            A draw is no game: the path, the trial and the value are named.
        """
        self.plan.check_ahead(self.trials, progress=progress)

    def manifest(self, keep: Keep) -> Manifest:
        """What a store of the study says about itself."""
        return Manifest(
            scenario=self.scenario.to_toml(),
            vary={path: sampler.table() for path, sampler in self.vary.items()},
            seed=self.seed,
            design=self.design,
            trials=self.trials,
            columns=self.columns,
            termination=self.termination,
            passes=self.passes,
            keep=keep,
        )

    def __repr__(self) -> str:
        varied = ", ".join(f"{path} ({type(sampler).__name__})" for path, sampler in self.vary.items())
        paths = f"vary {varied}" if varied else "from one start"
        own = f"; {self.games[0]} varies, so every trial is a game of its own" if self.games else ""
        return f"Study({self.trials:,} trials of {self.scenario!r}, {self.design}, seed {self.seed}, {paths}{own})"
