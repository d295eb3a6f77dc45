"""The figures of a run as methods; `tadcore.plotting` draws them, and is imported when one is asked for."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .simulation import Run


class Plots:
    """Figures of one run; every method forwards to the function of that name in `tadcore.plotting`."""

    def __init__(self, run: Run) -> None:
        self._run = run

    def trajectories(self, *arguments: Any, **options: Any) -> Any:
        """Paths in the plane or in space, with capture discs and a mark where a link forms."""
        return self._draw("trajectories", arguments, options)

    def network(self, *arguments: Any, **options: Any) -> Any:
        """The visibility graph, one panel for each interval, the new edge emphasised."""
        return self._draw("network", arguments, options)

    def controls(self, *arguments: Any, **options: Any) -> Any:
        """Controls along one axis, with dashed verticals at network changes."""
        return self._draw("controls", arguments, options)

    def distances(self, *arguments: Any, **options: Any) -> Any:
        """Distances to the attacker, with capture and visibility radii."""
        return self._draw("distances", arguments, options)

    def visibility(self, *arguments: Any, **options: Any) -> Any:
        """A raster of who sees whom, edge by time."""
        return self._draw("visibility", arguments, options)

    def gains(self, *arguments: Any, **options: Any) -> Any:
        """The rows of the feedback over time, one panel for each player with limited sight."""
        return self._draw("gains", arguments, options)

    def theta(self, *arguments: Any, **options: Any) -> Any:
        """The synthesis objective and the terms that make it up."""
        return self._draw("theta", arguments, options)

    def _draw(self, name: str, arguments: tuple[Any, ...], options: dict[str, Any]) -> Any:
        return getattr(import_module("tadcore.plotting"), name)(self._run, *arguments, **options)

    def __repr__(self) -> str:
        return ", ".join(f"{name}()" for name in vars(type(self)) if not name.startswith("_"))
