# ruff: noqa: D301 (the help text marks a block that keeps its lines with a backspace character)
"""The ``rare`` command: the probability of a rare outcome of a study."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from .options import File, Json, Progress, Quiet, Threads, naming, read_study
from .terminal import emit, hush, hushed, say


def rare(
    file: File,
    event: Annotated[
        str, typer.Option(metavar="NAME", help="captured, intercepted, d1, d2, …, or timeout.")
    ] = "captured",
    error: Annotated[float, typer.Option(metavar="X", help="Relative standard error to aim at.")] = 0.1,
    level: Annotated[float, typer.Option(metavar="X", help="Confidence level of the interval.")] = 0.95,
    threads: Threads = None,
    progress: Progress = True,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Estimate the probability of a rare outcome of a study, by multilevel splitting.

    \b
      tadcore rare my-study.toml --event captured
      tadcore rare my-study.toml --event d2 --error 0.05 --json

    Every sampler of the study must have quantiles. Above 1e-3 use tadcore study.
    """
    hush(quiet or as_json)
    from tadcore.analysis.rare_events import rare as estimate

    wanted = read_study(file)
    options: dict[str, Any] = {"event": event, "error": error, "level": level, "threads": threads}
    with naming(**options):
        found = estimate(wanted, **options, progress=progress and not hushed())
    for part in found.lines():
        say(part)
    if as_json:
        emit(found.to_dict())
