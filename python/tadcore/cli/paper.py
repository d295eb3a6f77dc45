"""The command ``tadcore reproduce``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .options import FAILED, usable
from .terminal import complain


def reproduce(
    out: Annotated[Path, typer.Option(metavar="DIR", help="Where tables and figures go.")] = Path("out/paper"),
    figures: Annotated[bool, typer.Option(help="Draw the figures too.")] = True,
) -> None:
    """Compute the eight runs of the paper's section VI, beside what is printed there.

    Exits with 1 if a number of interaction I1 is off. For interaction I2 both columns are shown: the parameters
    printed in the paper do not give the times printed in it.
    """
    from tadcore.reproduce.paper import reproduce as all_runs

    usable(out)
    report = all_runs(out, figures=figures)
    if not report.ok:
        complain("a computed number differs from the paper's where it must not")
        raise typer.Exit(FAILED)
