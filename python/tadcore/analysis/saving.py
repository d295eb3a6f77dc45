"""A map of one player's start as a file: its data or its figure."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from tadcore._shared.files import as_path, destination, write_whole
from tadcore._shared.netcdf import SUFFIX, netcdf
from tadcore.errors import ScenarioError

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes

_FIGURES = {".png", ".pdf", ".svg"}


class Drawable(Protocol):
    """A map with its data and its figure."""

    @property
    def dataset(self) -> xarray.Dataset:
        """The data."""

    def plot(self, ax: Axes | None = None, **options: Any) -> Axes:
        """Draw it."""


def save(found: Drawable, path: str | os.PathLike[str], options: Mapping[str, Any]) -> Path:
    """Write the data or the figure, as the file name says, whole or not at all; ``options`` go to ``plot``."""
    target = as_path("path", path)
    check_destination("path", target)
    target.parent.mkdir(parents=True, exist_ok=True)
    if target.suffix == SUFFIX:
        write_whole(target, netcdf(found.dataset))
        return target
    from tadcore import plotting
    from tadcore.plotting.tools.axes import for_files, root_figure

    with for_files(), plotting.style():
        plotting.save(root_figure(found.plot(**options)), target.with_suffix(""), formats=[target.suffix[1:]])
    return target


def check_destination(field: str, path: Path) -> None:
    """Refuse a file name that tells nothing of what to write, and a place that cannot be written."""
    if path.suffix not in _FIGURES | {SUFFIX}:
        kinds = ", ".join(sorted(_FIGURES))
        raise ScenarioError(field, str(path), f"the name of a figure ({kinds}) or of data ({SUFFIX})")
    destination(path)
