"""Writing figures to disk."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING
from uuid import uuid4

import matplotlib as mpl

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_DATE = {"png": None, "pdf": {"CreationDate": None}, "svg": {"Date": None}}


def save(
    fig: Figure, stem: str | os.PathLike[str], *, formats: Iterable[str] = ("png", "pdf"), dpi: float = 300
) -> list[Path]:
    """Write ``fig`` once per format, next to one another, with embedded TrueType fonts.

    Each file is written under a temporary name and then renamed, so a reader never sees half of one, and the same
    figure gives the same bytes: no date is written.

    Parameters
    ----------
    fig : Figure
        The figure.
    stem : path
        The file name without its suffix; the folder is made if it is missing.
    formats : iterable of str
        What to write: "png", "pdf", "svg", "ps" or "pgf".
    dpi : float
        Dots per inch of a raster.

    Returns
    -------
    list of Path
        The files written, in the order of ``formats``.
    """
    base = Path(stem)
    base.parent.mkdir(parents=True, exist_ok=True)
    written = []
    with mpl.rc_context({"pdf.fonttype": 42, "ps.fonttype": 42, "svg.hashsalt": "tadcore"}):
        for kind in formats:
            target = base.with_name(f"{base.name}.{kind}")
            temporary = base.with_name(f".{base.name}-{uuid4().hex}.{kind}")
            try:
                fig.savefig(temporary, format=kind, dpi=dpi, metadata=_DATE.get(kind))
                temporary.replace(target)
            finally:
                temporary.unlink(missing_ok=True)
            written.append(target)
    return written
