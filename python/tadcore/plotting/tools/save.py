"""Writing figures to disk."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib as mpl

from tadcore._shared.calls import public
from tadcore._shared.files import as_path, written

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_ENGINES = ("xelatex", "lualatex", "pdflatex")
_UNDATED: dict[str, Any] = {"pdf": {"metadata": {"CreationDate": None}}, "svg": {"metadata": {"Date": None}}}


@public
def save(
    fig: Figure, stem: str | os.PathLike[str], *, formats: Iterable[str] = ("png", "pdf"), dpi: float = 300
) -> list[Path]:
    r"""Write ``fig`` once per format, next to one another, with embedded TrueType fonts.

    Each file is written under a temporary name and then renamed, so a reader never sees half of one, and the same
    figure gives the same bytes: no date is written.

    Parameters
    ----------
    fig : Figure
        The figure.
    stem : path
        The file name without its suffix; the folder is made if it is missing.
    formats : iterable of str
        What to write: "png", "pdf", "svg", "ps" or "pgf". A PGF file is for ``\input`` in a LaTeX document that loads
        ``pgf`` and ``amssymb``; writing one asks LaTeX for the widths of its text, so a LaTeX must be installed.
    dpi : float
        Dots per inch of a raster.

    Returns
    -------
    list of Path
        The files written, in the order of ``formats``.

    Raises
    ------
    RuntimeError
        PGF is asked for and there is no LaTeX. Nothing is written then.
    """
    formats = tuple(formats)
    settings: Any = {"pdf.fonttype": 42, "ps.fonttype": 42, "svg.hashsalt": "tadcore"}
    if "pgf" in formats:
        settings |= {"pgf.texsystem": _engine(), "pgf.preamble": r"\usepackage{amssymb}", "pgf.rcfonts": False}
    base = as_path("stem", stem)
    base.parent.mkdir(parents=True, exist_ok=True)
    files = []
    with mpl.rc_context(settings):
        for kind in formats:
            target = base.with_name(f"{base.name}.{kind}")
            with written(target) as partial:
                fig.savefig(partial, format=kind, dpi=dpi, **_UNDATED.get(kind, {}))
            files.append(target)
    return files


def _engine() -> str:
    """Return the LaTeX that is installed."""
    for engine in _ENGINES:
        if shutil.which(engine):
            return engine
    raise RuntimeError(f"a PGF figure needs LaTeX to measure its text, and none of {', '.join(_ENGINES)} is installed")
