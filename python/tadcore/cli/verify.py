# ruff: noqa: D301 (the help text marks a block that keeps its lines with a backspace character)
"""``tadcore verify``: every check of `tadcore.verify` on a scenario, printed and, if asked for, written as JSON."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Literal, cast

import typer

from tadcore._shared.files import write_whole

from .options import FAILED, UNDECIDED, Changes, Json, Quiet, Source, read, writable
from .terminal import complain, emit, hush, say

_MOST = 1_000_000


def verify(
    scenario: Source,
    changes: Changes = None,
    deviations: Annotated[int, typer.Option(min=0, max=_MOST, help="Random deviations of each player.")] = 2,
    starts: Annotated[
        int, typer.Option(min=0, max=_MOST, help="Random starts of the synthesis at chosen instants.")
    ] = 0,
    seed: Annotated[int, typer.Option(min=0, max=2**64 - 1, help="Key of everything random.")] = 0,
    bound: Annotated[
        int,
        typer.Option(
            min=0, max=2, help="Bound Θ from below: 1 at chosen instants, with Clarabel; 2 at every instant, proved."
        ),
    ] = 0,
    turning: Annotated[
        bool, typer.Option("--turning", help="Measure the gap of gains that turn at each instant, and play with them.")
    ] = False,
    out: Annotated[Path | None, typer.Option(metavar="FILE", help="Write the report there, as JSON.")] = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Check the paper's theorems on a scenario: equilibrium, indices, consistency, gains, geometry.

    \b
      tadcore verify paper-i1
      tadcore verify my.toml --starts 5 --out report.json
      tadcore verify my.toml --bound 2

    Every check is printed with its measured value, its bound and where in the paper it comes from. Exit codes: 0 all
    pass; 1 a check failed; 3 none failed, but some are not converged, so that nothing is decided.
    """
    from tadcore.verification import verify as check

    hush(quiet or as_json)
    writable("--out", out)
    order = cast("Literal[0, 1, 2]", bound)
    game = read(scenario, changes)
    report = check(game, deviations=deviations, starts=starts, seed=seed, bound=order, turning=turning)
    if out is not None:
        write_whole(out, json.dumps(report.to_dict(), indent=2, allow_nan=False) + "\n")
    for line in report.lines():
        say(line)
    if as_json:
        emit(report.to_dict())
    if report.failures:
        complain(f"{len(report.failures)} of {len(report)} checks do not pass")
        raise typer.Exit(FAILED)
    if report.undecided:
        complain(f"{len(report.undecided)} of {len(report)} checks could not be decided; the others pass")
        raise typer.Exit(UNDECIDED)
