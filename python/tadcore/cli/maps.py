# ruff: noqa: D301 (the help texts mark blocks that keep their lines with a backspace character)
"""The ``map`` and ``report`` commands: pictures of many games."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer

from tadcore._shared.shares import share
from tadcore.errors import ScenarioError
from tadcore.scenario.model import Scenario

from .options import Changes, Json, Progress, Quiet, Source, Threads, naming, read, writable
from .terminal import emit, hush, hushed, say

MOST_PLACES = 100_000
"""Places along one axis of a map."""
MOST_BOXES = 10**9
"""Boxes of a certified map."""


def draw_map(
    scenario: Source,
    out: Annotated[Path, typer.Option(metavar="FILE", help="Figure (.png, .pdf, .svg) or data (.nc) to write.")],
    changes: Changes = None,
    player: Annotated[
        str, typer.Option(metavar="NAME", help="Whose start: d1, d2, …, target or attacker.")
    ] = "attacker",
    x: Annotated[tuple[float, float], typer.Option(metavar="LOW HIGH", help="Range of x.")] = (-5.0, 5.0),
    y: Annotated[tuple[float, float], typer.Option(metavar="LOW HIGH", help="Range of y.")] = (-5.0, 5.0),
    z: Annotated[float | None, typer.Option(metavar="HEIGHT", help="In space: the plane of the map.")] = None,
    size: Annotated[
        int, typer.Option(metavar="N", min=1, max=MOST_PLACES, help="Places along x; along y in proportion.")
    ] = 400,
    certified: Annotated[
        bool,
        typer.Option(
            "--certified", help="Prove the outcomes, box by box, instead of sampling them; --size is the finest."
        ),
    ] = False,
    budget: Annotated[
        int, typer.Option(metavar="N", min=1, max=MOST_BOXES, help="With --certified: boxes to look at, at most.")
    ] = 200_000,
    time: Annotated[bool, typer.Option("--time", help="Draw when the game ends, not how.")] = False,
    threads: Threads = None,
    progress: Progress = True,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Draw how the game ends for every place where one player could have started.

    \b
      tadcore map paper-i1 --out map.png
      tadcore map my.toml --player d2 --x -3 3 --y -3 3 --size 800 --out map.pdf
      tadcore map my.toml --out map.nc
      tadcore map paper-i1-full --certified --size 1024 --out proof.png

    The other players start where the scenario has them.
    """
    from tadcore.analysis.maps import outcome_map
    from tadcore.analysis.saving import check_destination

    hush(quiet or as_json)
    check_destination("--out", out)
    writable("--out", out)
    sc = read(scenario, changes)
    if certified:
        _certify(sc, player, x, y, z, size, budget, out, as_json=as_json, time=time, threads=threads, progress=progress)
        return
    grid = {"x": (*x, size), "y": (*y, _rows(x, y, size))}
    if size == 1 and (x[0] != x[1] or y[0] != y[1]):
        raise ScenarioError("--size", size, "at least 2 for a range")
    with naming(player=player, x=x, y=y, z=z, threads=threads):
        found = outcome_map(sc, player, **grid, z=z, threads=threads, progress=progress and not hushed())
    found.save(out, **({"quantity": "time"} if time else {}))
    total = found.dataset["kind"].size
    say(f"{total:,} places for the start of {player}")
    for name, count in found.counts().items():
        say(f"{name:<12} {count:>12,}  {share(count / total)}", indent=2)
    say(f"written to {out}")
    if as_json:
        emit({"player": found.player, "places": total, "counts": found.counts(), "file": str(out)})


def _certify(
    sc: Scenario,
    player: str,
    x: tuple[float, float],
    y: tuple[float, float],
    z: float | None,
    size: int,
    budget: int,
    out: Path,
    *,
    as_json: bool,
    time: bool,
    threads: int | None,
    progress: bool,
) -> None:
    """Prove the outcomes instead, box by box."""
    from tadcore.analysis.certified import certified_map

    for option, given in (("--time", time), ("--z", z is not None)):
        if given:
            raise ScenarioError(
                option, "given", "left out with --certified: outcomes in the plane are proved, no times"
            )
    least = max(abs(x[1] - x[0]), abs(y[1] - y[0])) / size
    show = progress and not hushed()
    found = certified_map(sc, player, x=x, y=y, resolution=least, budget=budget, threads=threads, progress=show)
    found.save(out)
    boxes = found.dataset.sizes["box"]
    say(f"{boxes:,} boxes for the start of {found.player}; {share(100.0 * found.proved, 2)} % of the area proved")
    for name, (low, high) in found.bounds().items():
        say(f"{name:<12} between {share(low)} and {share(high)} of the area", indent=2)
    say(f"written to {out}")
    if as_json:
        emit(
            {
                "player": found.player,
                "boxes": boxes,
                "proved": found.proved,
                "shares": found.shares(),
                "bounds": {name: list(pair) for name, pair in found.bounds().items()},
                "file": str(out),
            }
        )


def _rows(x: tuple[float, float], y: tuple[float, float], size: int) -> int:
    """Places along y for as many along x, in proportion; ranges that are none are left to the map to refuse."""
    wide, high = x[1] - x[0], y[1] - y[0]
    if not (math.isfinite(wide) and math.isfinite(high) and wide > 0.0 and high > 0.0):
        return size
    rows = (size - 1) * high / wide
    if not rows < MOST_PLACES:
        raise ScenarioError("--y", y, f"a range on which --size {size} leaves at most {MOST_PLACES:,} places")
    return max(round(rows), 1) + 1


def write_report(
    folder: Annotated[str, typer.Argument(metavar="DIR", help="The store of a study, a folder or a URL.")],
    out: Annotated[Path, typer.Option(metavar="FILE", help="The page to write.")] = Path("report.html"),
    title: Annotated[str, typer.Option(metavar="TEXT", help="What to call the study.")] = "",
    level: Annotated[
        float | None,
        typer.Option(metavar="SHARE", help="Confidence level of intervals and bands; 0.95, or the stopping rule's."),
    ] = None,
) -> None:
    """Write a study as one HTML page: tables, figures and provenance.

    \b
      tadcore study my-study.toml --store out
      tadcore report out --out my-study.html
    """
    from tadcore.report import report
    from tadcore.study.study import StudyResult

    writable("--out", out)
    result = StudyResult.load(folder)
    with naming(level=level):
        report(result, out, title=title, level=level)
    say(f"{result.trials:,} trials; written to {out}")
