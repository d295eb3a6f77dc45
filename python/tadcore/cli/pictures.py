# ruff: noqa: D301 (the help texts mark blocks that keep their lines with a backspace character)
"""The commands ``compare`` and ``animate``: figures of runs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .options import Changes, Quiet, Source, named_for, read
from .terminal import hush, hushed, say, sign_of_life

_FIGURES = (".png", ".pdf", ".svg")
_FILMS = (".gif", ".mp4", ".html")


def compare(
    scenario: Source,
    other: Annotated[str, typer.Argument(metavar="OTHER", help="The second one, drawn dashed.")],
    out: Annotated[Path, typer.Option(metavar="FILE", help="The figure: .png, .pdf or .svg.")],
    changes: Changes = None,
    what: Annotated[str, typer.Option(metavar="WHAT", help="trajectories, controls or distances.")] = "trajectories",
    quiet: Quiet = False,
) -> None:
    """Play two scenarios of the same players, and draw the two runs over one another.

    \b
      tadcore compare paper-i1 paper-i1-full --out both.pdf
      tadcore compare my.toml my.toml --set d1.visibility_radius=1 --out both.png

    Changes by --set are made to the first scenario only.
    """
    hush(quiet)
    named_for(out, _FIGURES)
    runs_of = read(scenario, changes), read(other, None)
    from tadcore import plotting
    from tadcore.plotting.tools.axes import for_files, root_figure
    from tadcore.simulation.play import simulate

    first, second = (simulate(sc) for sc in runs_of)
    say(f"{scenario}: {first.outcome}")
    say(f"{other}: {second.outcome}")
    sign_of_life("drawing")
    with for_files(), plotting.style():
        ax = plotting.compare(first, second, what=what)  # type: ignore[arg-type]  # it refuses what it does not know
        plotting.save(root_figure(ax), out.with_suffix(""), formats=[out.suffix[1:]])
    say(f"written to {out}")


def animate(
    scenario: Source,
    out: Annotated[Path, typer.Option(metavar="FILE", help="The pictures: .gif, .html, or .mp4, which needs ffmpeg.")],
    changes: Changes = None,
    seconds: Annotated[float, typer.Option(help="How long the game takes on the screen.")] = 8.0,
    fps: Annotated[float, typer.Option(help="Pictures in a second.")] = 20.0,
    quiet: Quiet = False,
) -> None:
    """Play a scenario, and write the run as moving pictures.

    \b
      tadcore animate paper-i1 --out run.gif
      tadcore animate my.toml --out run.html --seconds 5
    """
    hush(quiet)
    named_for(out, _FILMS)
    sc = read(scenario, changes)
    from tadcore.simulation.play import simulate

    run = simulate(sc)
    say(str(run.outcome))
    run.animate(seconds=seconds, fps=fps).save(out, progress=not hushed())
    say(f"written to {out}")
