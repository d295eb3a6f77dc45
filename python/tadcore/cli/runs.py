# ruff: noqa: D301 (the help texts mark blocks that keep their lines with a backspace character)
"""Commands around one scenario: ``simulate``, ``scenarios`` and ``validate``."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import typer

from tadcore import scenarios as bundled
from tadcore._shared.files import destination
from tadcore.errors import ScenarioError
from tadcore.scenario import worlds

from .options import FAILED, Changes, Json, Quiet, Source, has_windows, naming, read, usable
from .terminal import complain, emit, hush, say, sign_of_life, spill

if TYPE_CHECKING:
    from tadcore.game.synthesis import GainKind


def simulate(
    scenario: Source,
    changes: Changes = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Write run.nc, scenario.toml and summary.json there; or one file, FILE.nc."),
    ] = None,
    plot: Annotated[bool, typer.Option("--plot", help="Draw the run: into DIR, or in windows.")] = False,
    termination: Annotated[
        str,
        typer.Option(metavar="WHEN", help="sampled: at an instant of the grid; continuous: at the crossing itself."),
    ] = "sampled",
    seed: Annotated[int, typer.Option(help="What failures and disturbances are drawn from, with --trial.")] = 0,
    trial: Annotated[int, typer.Option(help="The trial of a study with that seed.")] = 0,
    gains: Annotated[
        str, typer.Option(metavar="KIND", help="scalar; or turning: blocks aI + bJ of lowest Θ, in the plane.")
    ] = "scalar",
    mirror: Annotated[bool, typer.Option("--mirror", help="The mirror images of turning gains.")] = False,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Play a scenario: print how it ends and when the network changes.

    \b
      tadcore simulate my.toml
      tadcore simulate paper-i1 --out run
      tadcore simulate my.toml --out run --plot
      tadcore simulate paper-i1 --set 'd*.visibility_radius=inf'

    With --out, DIR receives the whole record: run.nc (netCDF, for xarray), scenario.toml and summary.json; with
    --plot also the figures, as PNG and PDF. A name that ends in .nc is that file alone.
    """
    hush(quiet or as_json)
    sc = read(scenario, changes)
    if out is not None and out.suffix.lower() == ".nc":
        if plot:
            raise ScenarioError("--out", str(out), "a folder, into which --plot draws")
        destination(out)
    else:
        usable(out)
    if plot and out is None and not has_windows():
        raise ScenarioError("--plot", "no display to draw on", "given together with --out DIR here")
    from tadcore.simulation.files import summary_of
    from tadcore.simulation.play import simulate as play
    from tadcore.simulation.termination import as_termination

    with naming(termination=termination, seed=seed, trial=trial, gains=gains, mirror=mirror):
        when = as_termination(termination)
        run = play(sc, termination=when, seed=seed, trial=trial, gains=cast("GainKind", gains), mirror=mirror)
    for line in _lines(run):
        say(line)
    if out is not None:
        run.save(out)
    if plot:
        sign_of_life("drawing")
        _draw(run, out)
    if out is not None:
        say(f"written to {out}")
    if as_json:
        emit(summary_of(run))
    if run.diverged is not None:
        complain(f"the game {run.diverged}; how it ends says nothing of a pursuit")
        raise typer.Exit(FAILED)
    if not run.converged:
        complain(f"the gains of {run.unconverged} instants did not converge")
        raise typer.Exit(FAILED)


def scenarios(
    name: Annotated[str | None, typer.Argument(metavar="[NAME]", help="Print this one as TOML.")] = None,
) -> None:
    """List the bundled scenarios, or print one as TOML.

    \b
      tadcore scenarios
      tadcore scenarios paper-i1 > my.toml
    """
    if name is not None:
        spill(bundled.text(name))
        return
    for known in bundled.names():
        say(known)
        say(bundled.summary(known), indent=4)


def validate(
    scenario: Source,
    changes: Changes = None,
    equilibrium: Annotated[
        bool, typer.Option("--equilibrium", help="Leave with 1 where the game has no equilibrium on [0, T].")
    ] = False,
    quiet: Quiet = False,
) -> None:
    """Check a scenario file without playing it, and say whether its game has an equilibrium.

    Every field that breaks a rule is named, with what was found and what it must be.
    """
    from tadcore.errors import NoEquilibriumError, OutOfMemoryError
    from tadcore.game.equilibrium import solve_equilibrium

    hush(quiet)
    sc = read(scenario, changes)
    try:
        solve_equilibrium(sc)
        found = ""
    except NoEquilibriumError as error:
        longest = f"longest horizon {error.longest_horizon:g}" if error.longest_horizon else "none for one step either"
        found = f"; no equilibrium on [0, {sc.horizon:g}]: {longest}"
    except OutOfMemoryError:
        found = "; too large to say whether there is an equilibrium"
    say(f"{scenario}: valid{found}")
    for line in sc.describe().splitlines():
        say(line, indent=2)
    if equilibrium and found:
        complain(f"{scenario}{found}".replace("; ", ": ", 1))
        raise typer.Exit(FAILED)


def _lines(run: Any, most: int = 20) -> list[str]:
    """The outcome, then one line for each change of the network."""
    changes = run.network_changes
    passes = [f"between instants: {each}" for each in run.passes[:most]]
    passes += [f"  … and {len(run.passes) - most} more passes"] if len(run.passes) > most else []
    lost = [] if run.diverged is None else [f"the game {run.diverged}"]
    drawn = [f"seed {run.seed}, trial {run.trial}"] if run.scenario.is_random else []
    around = [*worlds.describe(run.scenario)[: -1 if drawn else None], *drawn]
    turning = [run.variant] if run.turning else []
    lines = [str(run.outcome), *turning, *lost, *passes, *around, "network:"]
    for change in changes[:most]:
        edges = [f"+{p}→{q}" for p, q in change.added] + [f"-{p}→{q}" for p, q in change.removed]
        lines.append(f"  t = {change.time:<8.10g} {'  '.join(edges) or 'no edges'}")
    if len(changes) > most:
        lines.append(f"  … and {len(changes) - most} more changes")
    costs = ", ".join(f"{group} {value:.6g}" for group, value in run.costs.items())
    return [*lines, f"costs J: {costs}"]


def _draw(run: Any, out: Path | None) -> None:
    """The figures of one run: saved into a folder, or shown."""
    from tadcore import plotting
    from tadcore.plotting.tools.axes import for_files

    with contextlib.nullcontext() if out is None else for_files(), plotting.style():
        drawn = {"trajectories": run.plot.trajectories(), "network": run.plot.network()}
        drawn |= {f"control-{axis}": run.plot.controls(axis=axis) for axis in "xyz"[: run.scenario.dim]}
        drawn |= {name: getattr(run.plot, name)() for name in ("distances", "visibility", "gains", "theta")}
        figures = {name: (axes if hasattr(axes, "figure") else axes.flat[0]).figure for name, axes in drawn.items()}
        if out is not None:
            for name, figure in figures.items():
                plotting.save(figure, out / name)
            return
        import matplotlib.pyplot as plt

        plt.show()
        for figure in figures.values():
            plt.close(figure)
