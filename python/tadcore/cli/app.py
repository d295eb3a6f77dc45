# ruff: noqa: D301 (the help texts mark blocks that keep their lines with a backspace character)
"""The command line: simulate a scenario, verify the theorems on it, reproduce the paper, list and check scenarios.

Exit codes: 0 done; 1 the game has no equilibrium, or a check failed; 2 bad input.
"""

from __future__ import annotations

import difflib
import io
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tadcore import scenarios as bundled
from tadcore.errors import MISSING, ScenarioError, StoreError, TadcoreError

from .explore import add_explore
from .maps import draw_map, write_report
from .study import study
from .terminal import complain, say
from .verify import register as add_verify

if TYPE_CHECKING:
    from tadcore.scenario.model import Scenario

__all__ = ["app", "main"]

_FAILED, _BAD_INPUT = 1, 2

app = typer.Typer(
    name="tadcore",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)

Source = Annotated[str, typer.Argument(metavar="SCENARIO", help="A TOML file, or the name of a bundled scenario.")]


def _show_version(wanted: bool) -> None:
    if wanted:
        from tadcore import __version__

        say(f"tadcore {__version__}")
        raise typer.Exit


@app.callback(
    epilog="Exit codes: 0 done; 1 the game has no equilibrium, or a check failed; 2 bad input.",
)
def _top(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version and exit.", callback=_show_version, is_eager=True)
    ] = False,
) -> None:
    """Target-attacker-defender games with limited observations.

    A scenario is a TOML file, or the name of a bundled one. To begin:

    \b
      tadcore scenarios
      tadcore simulate paper-i1
      tadcore scenarios paper-i1 > my.toml
      tadcore simulate my.toml --out run
    """


@app.command(short_help="Play a scenario and print how it ends.")
def simulate(
    scenario: Source,
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Write run.nc, scenario.toml and summary.json there."),
    ] = None,
    plot: Annotated[bool, typer.Option("--plot", help="Draw the run: into DIR, or in windows.")] = False,
) -> None:
    """Play a scenario: print how it ends and when the network changes.

    \b
      tadcore simulate my.toml
      tadcore simulate paper-i1 --out run
      tadcore simulate my.toml --out run --plot

    With --out, DIR receives the whole record: run.nc (netCDF, for xarray), scenario.toml and summary.json; with
    --plot also the figures, as PNG and PDF.
    """
    sc = load_scenario(scenario)
    _usable(out)
    if plot and out is None and not _has_windows():
        raise ScenarioError("--plot", "no display to draw on", "given together with --out DIR here")
    from tadcore.simulation.run import simulate as play

    run = play(sc)
    for line in _lines(run):
        say(line)
    if out is not None:
        run.save(out)
    if plot:
        _draw(run, out)
    if out is not None:
        say(f"written to {out}")
    if not run.converged:
        complain(f"the gains of {run.unconverged} instants did not converge")
        raise typer.Exit(_FAILED)


@app.command(short_help="Compute the paper's eight runs.")
def reproduce(
    out: Annotated[Path, typer.Option(metavar="DIR", help="Where tables and figures go.")] = Path("out/paper"),
    figures: Annotated[bool, typer.Option(help="Draw the figures too.")] = True,
) -> None:
    """Compute the eight runs of the paper's section VI, beside what is printed there.

    Exits with 1 if a number of interaction I1 is off. For interaction I2 both columns are shown: the parameters
    printed in the paper do not give the times printed in it.
    """
    from tadcore.reproduce.paper import reproduce as all_runs

    _usable(out)
    report = all_runs(out, figures=figures)
    if not report.ok:
        complain("a computed number differs from the paper's where it must not")
        raise typer.Exit(_FAILED)


@app.command(short_help="List the bundled scenarios.")
def scenarios(
    name: Annotated[str | None, typer.Argument(metavar="[NAME]", help="Print this one as TOML.")] = None,
) -> None:
    """List the bundled scenarios, or print one as TOML.

    \b
      tadcore scenarios
      tadcore scenarios paper-i1 > my.toml
    """
    if name is not None:
        typer.echo(bundled.text(name), nl=False)
        return
    for known in bundled.names():
        say(known)
        say(bundled.summary(known), indent=4)


@app.command(short_help="Check a scenario file.")
def validate(
    file: Annotated[str, typer.Argument(metavar="FILE", help="A TOML file, or the name of a bundled scenario.")],
) -> None:
    """Check a scenario file without playing it.

    Every field that breaks a rule is named, with what was found and what it must be.
    """
    sc = load_scenario(file)
    say(f"{file}: valid")
    for line in sc.describe().splitlines():
        say(line, indent=2)


app.command(short_help="Play many games from a study file.")(study)
app.command(name="map", short_help="Draw the outcome over one player's start.")(draw_map)
app.command(name="report", short_help="Write a finished study as an HTML page.")(write_report)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line; leaves with one of the exit codes above."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal without Greek letters still gets its answer
    try:
        app(args=None if arguments is None else list(arguments), prog_name="tadcore")
    except ScenarioError as error:
        complain("\n".join([str(error), *getattr(error, "__notes__", ())]))
        sys.exit(_BAD_INPUT)
    except StoreError as error:
        complain(str(error))
        sys.exit(_BAD_INPUT)
    except TadcoreError as error:
        complain(str(error))
        sys.exit(_FAILED)
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        complain(f"{where}{error.strerror or error}")
        sys.exit(_BAD_INPUT)


def load_scenario(source: str) -> Scenario:
    """A scenario from a file, or else the bundled one of that name."""
    from tadcore.scenario.model import Scenario

    path = Path(source)
    if "\0" not in source and not path.exists():
        if source in bundled.names():
            return bundled.load(source)
        close = difflib.get_close_matches(source, bundled.names(), n=1, cutoff=0.5)
        hint = f"; did you mean {close[0]}?" if close else ""
        raise ScenarioError(source, MISSING, f"a file, or the name of a bundled scenario{hint}")
    try:
        return Scenario.from_toml(path)
    except ScenarioError as error:
        if not error.field.startswith(source):
            error.add_note(f"(in {source})")
        raise


def _usable(out: Path | None) -> None:
    """Refuse a destination that cannot be a folder before anything is computed."""
    if out is not None:
        try:
            out.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ScenarioError("--out", str(out), f"a folder that can be written ({error.strerror})") from None


def _lines(run: Any, most: int = 20) -> list[str]:
    """The outcome, then one line for each change of the network."""
    changes = run.network_changes
    lines = [str(run.outcome), "network:"]
    for change in changes[:most]:
        edges = [f"+{p}→{q}" for p, q in change.added] + [f"-{p}→{q}" for p, q in change.removed]
        lines.append(f"  t = {change.time:<8.10g} {'  '.join(edges) or 'no edges'}")
    if len(changes) > most:
        lines.append(f"  … and {len(changes) - most} more changes")
    costs = ", ".join(f"{group} {value:.6g}" for group, value in run.costs.items())
    return [*lines, f"costs J: {costs}"]


def _has_windows() -> bool:
    import matplotlib as mpl

    return str(mpl.get_backend()).lower() not in {"agg", "cairo", "pdf", "pgf", "ps", "svg", "template"}


def _draw(run: Any, out: Path | None) -> None:
    """The figures of one run: saved into a folder, or shown."""
    import matplotlib.pyplot as plt

    from tadcore import plotting

    with plotting.style():
        drawn = {"trajectories": run.plot.trajectories(), "network": run.plot.network()}
        drawn |= {f"control-{axis}": run.plot.controls(axis=axis) for axis in "xyz"[: run.scenario.dim]}
        drawn |= {name: getattr(run.plot, name)() for name in ("distances", "visibility", "gains", "theta")}
        figures = {name: (axes if hasattr(axes, "figure") else axes.flat[0]).figure for name, axes in drawn.items()}
        if out is None:
            plt.show()
        for name, figure in figures.items():
            if out is not None:
                plotting.save(figure, out / name)
            plt.close(figure)


# These commands take the loader, which is defined only now.
add_explore(app, load_scenario)
add_verify(app, load_scenario)
