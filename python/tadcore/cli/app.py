# ruff: noqa: D301 (the help text marks a block that keeps its lines with a backspace character)
"""The command line: its commands, its exit codes, and how errors are printed.

Exit codes: 0 done; 1 the game has no equilibrium or diverges, or a check failed; 2 bad input; 3 no check failed, but
some could not be decided.
"""

from __future__ import annotations

import io
import sys
from collections.abc import Sequence
from typing import Annotated

import typer

from tadcore.errors import ScenarioError, StoreError, TadcoreError

from .best import best_radii, best_start
from .explore import explore
from .many import curve, sweep
from .maps import draw_map, write_report
from .options import FAILED, set_backend_aside
from .paper import reproduce
from .pictures import animate, compare
from .rare import rare
from .runs import scenarios, simulate, validate
from .store import store
from .study import study
from .terminal import complain, hush, say
from .verify import verify

_BAD_INPUT = 2

app = typer.Typer(
    name="tadcore",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _show_version(wanted: bool) -> None:
    if wanted:
        from tadcore import _core

        say(f"tadcore {_core.__version__}")
        raise typer.Exit


@app.callback(
    epilog="Exit codes: 0 done; 1 the game has no equilibrium or diverges, or a check failed; 2 bad input; 3 no check "
    "failed, but some could not be decided.",
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


for name, command, summary in (
    ("simulate", simulate, "Play a scenario and print how it ends."),
    ("reproduce", reproduce, "Compute the paper's eight runs."),
    ("scenarios", scenarios, "List the bundled scenarios."),
    ("validate", validate, "Check a scenario file."),
    ("study", study, "Play many games from a study file."),
    ("map", draw_map, "Draw the outcome over one player's start."),
    ("report", write_report, "Write a finished study as an HTML page."),
    ("curve", curve, "Play a study at many radii."),
    ("best-start", best_start, "Search where to place a player."),
    ("best-radii", best_radii, "Search how to share a sum of radii."),
    ("sweep", sweep, "Run a study at every point of a grid."),
    ("rare", rare, "Estimate the probability of a rare outcome."),
    ("compare", compare, "Lay two runs over one another."),
    ("animate", animate, "Write a run as moving pictures."),
    ("explore", explore, "Drag players and radii on a page in the browser."),
    ("verify", verify, "Check the paper's theorems on a scenario."),
):
    app.command(name=name, short_help=summary)(command)
app.add_typer(store, name="store", short_help="Look after the folder of a study.")


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line; leaves with one of the exit codes above."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal without Greek letters still gets its answer
    hush(False)
    if arguments is None:
        set_backend_aside()
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
        sys.exit(FAILED)
    except MemoryError as error:
        complain(f"there is no memory for this: {error}" if str(error) else "there is no memory for this")
        sys.exit(FAILED)
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        complain(f"{where}{error.strerror or error}")
        sys.exit(_BAD_INPUT)
