"""The figures of a run as methods."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import TYPE_CHECKING, Concatenate, ParamSpec, TypeVar

from .gains import gains
from .network import network
from .raster import visibility
from .series import controls, distances, theta
from .trajectories import trajectories

if TYPE_CHECKING:
    from tadcore.game.recorded import Recorded

P = ParamSpec("P")
Drawn = TypeVar("Drawn")


def method(draw: Callable[Concatenate[Recorded, P], Drawn]) -> Callable[Concatenate[Plots, P], Drawn]:
    """Make a method of a figure: its first argument is the run."""

    @wraps(draw)
    def on_run(self: Plots, /, *args: P.args, **options: P.kwargs) -> Drawn:
        return draw(self.run, *args, **options)

    return on_run


class Plots:
    """Figures of one run; every method is the function of that name in `tadcore.plotting`."""

    def __init__(self, run: Recorded) -> None:
        self.run = run

    trajectories = method(trajectories)
    network = method(network)
    controls = method(controls)
    distances = method(distances)
    visibility = method(visibility)
    gains = method(gains)
    theta = method(theta)

    def __repr__(self) -> str:
        return ", ".join(f"{name}()" for name, value in vars(type(self)).items() if hasattr(value, "__wrapped__"))
