# ruff: noqa: D301 (the help texts mark blocks that keep their lines with a backspace character)
"""The ``study`` command: a study from a TOML file, kept in a folder."""

from __future__ import annotations

import enum
from pathlib import Path
from typing import Annotated, Any

import typer

from tadcore._shared.shares import percent
from tadcore.errors import ScenarioError

from .options import File, Json, Progress, Quiet, Threads, naming, read_study
from .terminal import complain, emit, hush, hushed, say

_INTERRUPTED = 130


class Keeping(enum.StrEnum):
    """What a study keeps of every trial."""

    ALL = "all"
    OUTCOMES = "outcomes"
    COUNTS = "counts"


def study(
    file: File,
    store: Annotated[
        str, typer.Option(metavar="DIR", help="Where finished chunks are kept, a folder or a URL; continued if there.")
    ],
    threads: Threads = None,
    table: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Keep the game's table of gains there: read before, written after."),
    ] = None,
    keep: Annotated[
        Keeping | None,
        typer.Option(help="What is kept of every trial; by default what the study file says, or all."),
    ] = None,
    part: Annotated[
        str | None,
        typer.Option(metavar="I/N", help="Play part I, from 1, of N into DIR, to be merged with the others."),
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Only continue a study that DIR holds already.")] = False,
    progress: Progress = True,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Play a study, and keep its outcomes in a folder as Parquet.

    \b
      tadcore study my-study.toml --store out
      tadcore study my-study.toml --store out --threads 4 --no-progress
      tadcore study my-study.toml --store out --table paper-i1.table
      tadcore study my-study.toml --store out --keep counts
      tadcore study my-study.toml --store s3://bucket/out
      tadcore study my-study.toml --store out --part 3/100

    Run again, it resumes from what DIR holds. A study file:

    \b
      scenario = "paper-i1"
      trials = 100_000
      seed = 7
      design = "sobol"
      [vary]
      "attacker.position" = { box = [[-3, -3], [3, 3]] }
      "d1.visibility_radius" = { scipy = "uniform", loc = 1, scale = 4 }

    Samplers: box, disk, annulus, gaussian, values, cycle, scipy. Designs: random, sobol, latin.
    """
    from tadcore.statistics.outcomes import excluding
    from tadcore.study.manifest import Manifest
    from tadcore.study.part import as_part, place_of
    from tadcore.study.where import as_place

    hush(quiet or as_json)
    wanted = read_study(file)
    which = None if part is None else as_part(_numbers(part))
    if resume:
        Manifest.read(place_of(which, as_place("--store", store)))
    options: dict[str, Any] = {
        "progress": progress and not hushed(),
        "store": store,
        "threads": threads,
        "table": table,
    }
    options |= {"keep": None if keep is None else keep.value, "part": which}
    try:
        with naming(**options):
            result = wanted.run(**options)
    except KeyboardInterrupt:
        complain(f"interrupted; what was finished is in {store}, and the same command resumes from there")
        raise typer.Exit(_INTERRUPTED) from None
    if which is not None:
        say(f"{result!r}")
        say(f"written to {store}; tadcore store merge {store} makes one store of all parts")
        if as_json:
            emit({"trials": result.trials, "part": list(which), "store": store})
        return
    found = result.probabilities()
    say(f"{result.trials:,} trials")
    for i in excluding(found.names):
        name, count, share, interval = found.rows()[i]
        say(f"{name:<12} {count:>12}  {share} {interval}", indent=2)
    say(f"intervals: {percent(found.level)} ({found.method})", indent=2)
    say(f"written to {store}")
    if as_json:
        rows = zip(found.names, found.count, found.estimate, found.low, found.high, strict=True)
        names = ("count", "estimate", "low", "high")
        outcomes = {row[0]: dict(zip(names, (int(row[1]), *map(float, row[2:])), strict=True)) for row in rows}
        about = {"level": found.level, "method": found.method, "rule": found.rule, "store": store}
        emit({"trials": result.trials, "seed": wanted.seed, "outcomes": outcomes, **about})


def _numbers(text: str) -> tuple[int, int]:
    """I/N as two numbers."""
    i, slash, n = text.partition("/")
    if not (slash and i.isdecimal() and n.isdecimal()):
        raise ScenarioError("--part", text, "I/N, such as 3/100: part 3, from 1, of 100")
    return int(i), int(n)
