# ruff: noqa: D301 (the help texts mark blocks that keep their lines with a backspace character)
"""The commands ``curve`` and ``sweep``: a study at many radii, and at every point of a grid of games."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer

from tadcore._shared.files import write_whole
from tadcore._shared.netcdf import SUFFIX, netcdf
from tadcore._shared.shares import estimate, percent, share
from tadcore._shared.toml import parse_toml
from tadcore.errors import ScenarioError

from .options import File, Progress, Quiet, named_for, naming, read_study
from .terminal import hush, hushed, say, sign_of_life

if TYPE_CHECKING:
    from tadcore.statistics.radius import RadiusCurve

_MOST_RADII = 100_000


def curve(
    file: File,
    radii: Annotated[tuple[float, float, int], typer.Option(metavar="LOW HIGH N", help="N radii from LOW to HIGH.")],
    player: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME", help="Whose: d1, d2, …; d* for all defenders; target, attacker. Repeatable; d1 by default."
        ),
    ] = None,
    kind: Annotated[str, typer.Option(metavar="KIND", help="visibility or capture.")] = "visibility",
    at_least: Annotated[
        float | None,
        typer.Option("--at-least", metavar="P", help="Say at which radius P(intercepted) is surely P or more."),
    ] = None,
    out: Annotated[Path | None, typer.Option(metavar="FILE", help="Figure (.png, .pdf, .svg) or data (.nc).")] = None,
    progress: Progress = True,
    quiet: Quiet = False,
) -> None:
    """Play the trials of a study at many radii, and print the outcome probabilities.

    \b
      tadcore curve my-study.toml --player d1 --radii 0.5 6 12
      tadcore curve my-study.toml --player d1 --player d2 --radii 0.5 6 12
      tadcore curve my-study.toml --player 'd*' --radii 0.5 6 12 --at-least 0.9
      tadcore curve my-study.toml --radii 0.5 6 40 --out curve.pdf

    Only the radius of one player changes at a time, or with d* that of all defenders together. Intervals hold at all
    radii of all players at once.
    """
    hush(quiet)
    named_for(out, (".png", ".pdf", ".svg", SUFFIX))
    from tadcore.analysis.radius import radius_curve
    from tadcore.analysis.replays import TEAM
    from tadcore.statistics.radius import RadiusCurve

    if not 1 <= radii[2] <= _MOST_RADII:
        raise ScenarioError("--radii", radii, f"LOW HIGH N, with N from 1 to {_MOST_RADII:,}")
    with np.errstate(all="ignore"):  # ends that are none are left to the curve to refuse
        grid = np.linspace(*radii)
    players = player or ["d1"]
    options: dict[str, Any] = {"radii": grid, "kind": kind, "progress": progress and not hushed()}
    options["player"] = players[0] if len(players) == 1 else players
    wanted = read_study(file)
    with naming(**options | {"radii": radii}):
        found = radius_curve(wanted, **options)
    curves = [found] if isinstance(found, RadiusCurve) else list(found)
    with naming(at_least=at_least):
        smallest = [None if at_least is None else curve.smallest(at_least) for curve in curves]
    about = f"{curves[0].trials:,} trials at each; {percent(curves[0].level)} intervals, all at once"
    say(f"{kind} radius, {about}")
    for curve, least in zip(curves, smallest, strict=True):
        say(f"of {'all defenders' if curve.player == TEAM else curve.player}")
        _table(curve)
        if least is not None:
            shown = f"P({least.outcome}) = {' '.join(estimate(least.estimate, least.low, least.high))}"
            which = f"none; the best is {least.best:g}" if least.radius is None else f"{least.radius:g}"
            say(f"smallest for {share(least.at_least, 2)}: {which}", indent=2)
            say(f"there {shown}", indent=2)
    if out is None:
        return
    if out.suffix.lower() == SUFFIX:
        write_whole(out, netcdf(found.to_xarray()))
    else:
        from tadcore import plotting
        from tadcore.plotting.tools.axes import for_files, root_figure

        sign_of_life("drawing")
        with for_files(), plotting.style():
            ax = plotting.radius_curve(found) if isinstance(found, RadiusCurve) else plotting.radius_curves(found)
            plotting.save(root_figure(ax), out.with_suffix(""), formats=[out.suffix[1:]])
    say(f"written to {out}")


def _table(curve: RadiusCurve) -> None:
    """Print the probabilities of what excludes one another, a row for each radius, within 80 columns."""
    from tadcore.statistics.outcomes import excluding

    shown = excluding(curve.names)
    say(f"{'radius':<8} {' '.join(f'{curve.names[i]:<22}' for i in shown)}".rstrip(), indent=2)
    for r, radius in enumerate(curve.radii):
        ends = ([float(part[i, r]) for part in (curve.estimate, curve.band_low, curve.band_high)] for i in shown)
        cells = [f"{' '.join(estimate(*each, least=3)):<22}" for each in ends]
        say(f"{radius:<8.6g} {' '.join(cells)}".rstrip(), indent=2)


def sweep(
    file: File,
    over: Annotated[
        list[str], typer.Option(metavar="PATH=VALUES", help="A field and its values, as an array of TOML; repeatable.")
    ],
    out: Annotated[Path | None, typer.Option(metavar="FILE.nc", help="Write outcomes over the grid there.")] = None,
    store: Annotated[Path | None, typer.Option(metavar="DIR", help="Keep every cell there, and resume.")] = None,
    progress: Progress = True,
    quiet: Quiet = False,
) -> None:
    """Run a study at every point of a grid of games, and print the outcome probabilities of every cell.

    \b
      tadcore sweep my-study.toml --over 'attacker.control_weight=[0.4, 0.8, 1.6]'
      tadcore sweep my-study.toml --over 'horizon=[2, 4, 6]' --out swept.nc

    The draws are the same in every cell. A cell without an equilibrium says so.
    """
    hush(quiet)
    named_for(out, (SUFFIX,))
    from tadcore.analysis.sweeps import sweep as run
    from tadcore.statistics.outcomes import excluding

    grid: dict[str, Any] = {}
    for one in over:
        path, equals, values = one.partition("=")
        if not equals:
            raise ScenarioError("--over", one, "PATH=VALUES, such as horizon=[2, 4, 6]")
        grid[path.strip()] = parse_toml(f"value = {values}", f"--over {path}")["value"]
    found = run(read_study(file), grid, progress=progress and not hushed(), store=store)
    for cell in found.cells:
        say(", ".join(f"{path} = {value}" for path, value in cell.values.items()))
        if cell.result is None:
            say(f"no equilibrium: it escapes {cell.escape_time:.6g} before T", indent=2)
            continue
        shares = cell.result.probabilities()
        for i in excluding(shares.names):
            name, count, share, interval = shares.rows()[i]
            say(f"{name:<12} {count:>12}  {share} {interval}", indent=2)
    if out is not None:
        write_whole(out, netcdf(_plain(found.to_xarray())))
        say(f"written to {out}")


def _plain(made: Any) -> Any:
    """The dataset with one coordinate for each dimension, which files can have."""
    return made.drop_vars([name for name in made.coords if name not in made.dims and name != "status"])
