"""What a figure starts from: axes of its own where none are given, and a legend above them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tadcore._shared.arrays import as_index
from tadcore.errors import ScenarioError

from .style import COLUMN, PAGE

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.legend import Legend

_WIDTH = 0.825  # of the figure, that a legend above may take
_for_files: ContextVar[bool] = ContextVar("_for_files", default=False)


@contextmanager
def for_files() -> Iterator[None]:
    """Figures made in the block are for files only: they need no display, whatever backend the user has chosen.

    They are unknown to pyplot, so none has to be closed, and the user's backend is neither loaded nor changed.
    """
    before = _for_files.set(True)
    try:
        yield
    finally:
        _for_files.reset(before)


def new_figure(width: float, height: float) -> Figure:
    """A new figure of this size in inches: one of pyplot's, or where it is `for_files` one of nobody's."""
    if not _for_files.get():
        import matplotlib.pyplot as plt

        return plt.figure(figsize=(width, height), layout="constrained")
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def root_figure(ax: Axes) -> Figure:
    """The figure that the axes are in, and not a part of it."""
    part: Any = ax.get_figure()
    root: Figure = part.figure
    return root


def as_run(run: object, field: str = "run") -> None:
    """Refuse what is no recorded run, before anything of a figure is made."""
    if not all(hasattr(run, name) for name in ("scenario", "times", "position", "network_changes")):
        raise ScenarioError(field, run, "a Run, as tadcore.simulate returns it")


def as_axes(ax: object, field: str = "ax") -> Axes:
    """Refuse what are no axes of Matplotlib."""
    from matplotlib.axes import Axes

    if isinstance(ax, Axes):
        return ax
    one = ": one of the array" if isinstance(ax, np.ndarray | list | tuple) else ""
    raise ScenarioError(field, ax, f"axes of Matplotlib, as plt.subplots returns them{one}")


def as_panels(axes: Any) -> list[Axes]:
    """The axes of an array of them, row by row; refuse what holds anything else."""
    return [as_axes(ax, "axes") for ax in np.asarray(axes, dtype=object).ravel()]


def new_axes(ax: Axes | None, width: float, height: float, *, projection: str | None = None) -> Axes:
    """Return ``ax``, or the axes of a new figure of this size in inches."""
    if ax is not None:
        return as_axes(ax)
    return new_figure(width, height).add_subplot(projection=projection)


def new_panels(
    count: int, columns: int, *, page_from: int, row: float, rest: float, square: bool = False, **options: Any
) -> NDArray[Any]:
    """Return the axes of a new figure of ``count`` panels, in rows of ``columns``.

    The figure is one column wide, two from ``page_from`` panels in a row on. Its height in inches is ``rest`` and
    ``row`` for each row of panels; with ``square`` a row is as much higher as its panels are wide.
    """
    columns = max(min(as_index("columns", columns, 1000, least=1), count), 1)
    rows = max(-(-count // columns), 1)
    width = PAGE if columns >= page_from else COLUMN
    height = rest + rows * (row + (width / columns if square else 0.0))
    figure = new_figure(width, height)
    return np.asarray(figure.subplots(rows, columns, squeeze=False, **options), dtype=object)


def colour_bar(ax: Axes, image: Any, label: str) -> None:
    """The colours of an image, beside its axes and as tall as they are, whatever their aspect."""
    bar = ax.inset_axes((1.03, 0.0, 0.045, 1.0))
    bar.figure.colorbar(image, cax=bar, label=label)


def above(ax: Axes, handles: Sequence[Any], *, columns: int | None = None, **options: Any) -> Legend:
    """A legend above the axes, where it covers nothing: in one row, or in as many as its share of the width needs."""
    settings: dict[str, Any] = {
        "loc": "lower center",
        "bbox_to_anchor": (0.5, 1.0),
        "frameon": False,
        "columnspacing": 0.9,
        "handlelength": 1.7,
        "handletextpad": 0.4,
        "borderaxespad": 0.2,
    }
    most, figure = columns or len(handles), root_figure(ax)
    place = ax.get_subplotspec()
    share = len(place.colspan) / place.get_gridspec().ncols if place is not None else 1.0
    for rows in range(-(-len(handles) // most), len(handles) + 1):
        legend = ax.legend(handles=list(handles), ncols=-(-len(handles) // rows), **{**settings, **options})
        # one that is wider takes its width from the axes: it is centred on them, and they stand right of the middle
        if legend.get_window_extent().width <= _WIDTH * share * figure.bbox.width:
            break
    return legend
