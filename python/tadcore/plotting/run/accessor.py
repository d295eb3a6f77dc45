"""The figures of a run as methods; a figure's module, and Matplotlib with it, is loaded when one is asked for."""

from __future__ import annotations

from types import MethodType
from typing import TYPE_CHECKING, Any

from tadcore import plotting
from tadcore.game.recorded import Recorded

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Concatenate, ParamSpec, TypeVar

    P = ParamSpec("P")
    Drawn = TypeVar("Drawn")

    def method(draw: Callable[Concatenate[Recorded, P], Drawn]) -> Callable[Concatenate[Plots, P], Drawn]:
        """Type a figure's function as a method: its first argument is the run."""


FIGURES = ("trajectories", "network", "controls", "distances", "visibility", "gains", "theta")


class Plots:
    """Figures of one run; every method is the function of that name in `tadcore.plotting`."""

    def __init__(self, run: Recorded) -> None:
        self._run = run

    if TYPE_CHECKING:
        trajectories = method(plotting.trajectories)
        network = method(plotting.network)
        controls = method(plotting.controls)
        distances = method(plotting.distances)
        visibility = method(plotting.visibility)
        gains = method(plotting.gains)
        theta = method(plotting.theta)
    else:

        def __getattr__(self, name: str) -> Any:
            if name not in FIGURES:
                raise AttributeError(f"no figure {name!r}; one of {', '.join(FIGURES)}", name=name, obj=self)
            return MethodType(getattr(plotting, name), self._run)

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *FIGURES]

    def __repr__(self) -> str:
        return ", ".join(f"{name}()" for name in FIGURES)
