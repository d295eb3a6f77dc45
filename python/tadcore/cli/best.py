# ruff: noqa: D301 (the help texts mark blocks that keep their lines with a backspace character)
"""The commands ``best-start`` and ``best-radii``: searches for what makes an outcome most probable."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated, Any

import typer

from tadcore._shared.shares import estimate, percent

from .options import File, Json, Progress, Quiet, Threads, naming, read_study
from .terminal import emit, hush, hushed, say

Outcome = Annotated[
    str, typer.Option(metavar="NAME", help="What to make probable: intercepted, captured, timeout, d1, d2, ….")
]
Evaluations = Annotated[int, typer.Option(metavar="N", help="About how many to play, at least 20.")]
Range = tuple[float, float]


def best_start(
    file: File,
    x: Annotated[Range, typer.Option(metavar="LOW HIGH", help="Range of x.")],
    y: Annotated[Range, typer.Option(metavar="LOW HIGH", help="Range of y.")],
    z: Annotated[Range | None, typer.Option(metavar="LOW HIGH", help="In space: range of z.")] = None,
    player: Annotated[str, typer.Option(metavar="NAME", help="Whom to place: d1, d2, …, target or attacker.")] = "d1",
    outcome: Outcome = "intercepted",
    evaluations: Evaluations = 600,
    threads: Threads = None,
    progress: Progress = True,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Search for the start of one player at which an outcome is most probable.

    \b
      tadcore best-start my-study.toml --player d3 --x -2 2 --y -2 2

    All places are played with the trials of the study; the probability is then that of fresh trials. It is a search:
    another place may be better.
    """
    hush(quiet or as_json)
    from tadcore.analysis.placement import best_start as search

    options: dict[str, Any] = {"x": x, "y": y, "z": z, "outcome": outcome, "evaluations": evaluations}
    options |= {"threads": threads, "progress": progress and not hushed()}
    wanted = read_study(file)
    with naming(player=player, **options):
        found = search(wanted, player, **options)
    say(f"{found.player} at ({', '.join(f'{value:.4g}' for value in found.position)}), of {found.evaluations:,} places")
    _print(found, "where the scenario has it")
    if as_json:
        emit(asdict(found))


def best_radii(
    file: File,
    total: Annotated[float, typer.Option(metavar="SUM", help="The sum of the defenders' visibility radii.")],
    outcome: Outcome = "intercepted",
    evaluations: Evaluations = 600,
    threads: Threads = None,
    progress: Progress = True,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Search for visibility radii of given sum with which an outcome is most probable.

    \b
      tadcore best-radii my-study.toml --total 8.5

    All ways to share the sum are played with the trials of the study; the probability is then that of fresh trials. It
    is a search: other radii may be better.
    """
    hush(quiet or as_json)
    from tadcore.analysis.budget import best_radii as search

    options: dict[str, Any] = {"outcome": outcome, "evaluations": evaluations, "threads": threads}
    options["progress"] = progress and not hushed()
    wanted = read_study(file)
    with naming(total=total, **options):
        found = search(wanted, total, **options)
    shared = ", ".join(f"{player} {radius:.4g}" for player, radius in found.radii.items())
    say(f"{shared}; {found.total:g} in all, of {found.evaluations:,} ways to share it")
    _print(found, "with equal radii of the same sum")
    if as_json:
        emit(asdict(found))


def _print(found: Any, beside: str) -> None:
    """The probability on fresh trials, and what was gained."""
    share = " ".join(estimate(found.estimate, found.low, found.high))
    gain = " ".join(estimate(found.gain, found.gain_low, found.gain_high, sign=True))
    say(f"P({found.outcome}) = {share} on {found.trials:,} fresh trials", indent=2)
    say(f"{beside}: {estimate(found.own, found.own, found.own)[0]}; gained {gain}", indent=2)
    say(f"intervals: {percent(found.level)}", indent=2)
