"""The figures of a run as methods; `tadcore.plotting` draws them, and is imported when one is asked for."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from tadcore.game.recorded import Recorded


class Plots:
    """Figures of one run; every method is the function of that name in `tadcore.plotting`, which says more."""

    def __init__(self, run: Recorded) -> None:
        self._run = run

    def trajectories(
        self,
        ax: Axes | None = None,
        *,
        full: Recorded | None = None,
        names: tuple[str, str] = ("limited observations", "full observation"),
        edge_markers: bool = True,
        capture_discs: bool = True,
        title: bool = True,
        zoom: bool = True,
    ) -> Axes:
        """Paths in the plane or in space, with capture discs and a mark where an edge forms."""
        from tadcore.plotting import trajectories

        return trajectories(
            self._run,
            ax,
            full=full,
            names=names,
            edge_markers=edge_markers,
            capture_discs=capture_discs,
            title=title,
            zoom=zoom,
        )

    def network(
        self, axes: Axes | NDArray[Any] | None = None, *, max_panels: int = 12, columns: int = 3
    ) -> Axes | NDArray[Any]:
        """The visibility graph, one panel for each interval, the new edge emphasised."""
        from tadcore.plotting import network

        return network(self._run, axes, max_panels=max_panels, columns=columns)

    def controls(
        self, axis: str = "x", *, players: Sequence[str] | None = None, ax: Axes | None = None, changes: bool = True
    ) -> Axes:
        """Controls along one axis, with dashed verticals at network changes."""
        from tadcore.plotting import controls

        return controls(self._run, axis, players=players, ax=ax, changes=changes)

    def distances(self, *, ax: Axes | None = None, changes: bool = True) -> Axes:
        """Distances to the attacker, with capture and visibility radii."""
        from tadcore.plotting import distances

        return distances(self._run, ax=ax, changes=changes)

    def visibility(self, *, ax: Axes | None = None, changes: bool = True) -> Axes:
        """A raster of who sees whom, edge by time."""
        from tadcore.plotting import visibility

        return visibility(self._run, ax=ax, changes=changes)

    def gains(
        self, axes: Axes | NDArray[Any] | None = None, *, columns: int = 1, changes: bool = True
    ) -> Axes | NDArray[Any]:
        """The rows of the feedback over time, one panel for each player with limited sight."""
        from tadcore.plotting import gains

        return gains(self._run, axes, columns=columns, changes=changes)

    def theta(self, *, ax: Axes | None = None, changes: bool = True) -> Axes:
        """The synthesis objective and the terms that make it up."""
        from tadcore.plotting import theta

        return theta(self._run, ax=ax, changes=changes)

    def __repr__(self) -> str:
        return ", ".join(f"{name}()" for name in vars(type(self)) if not name.startswith("_"))
