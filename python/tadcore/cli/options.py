"""What commands share: their options, what is read for them, and where they write."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tadcore import scenarios as bundled
from tadcore._shared.files import destination
from tadcore._shared.text import similar
from tadcore._shared.toml import STDIN, parse_toml, read_stdin
from tadcore.errors import ScenarioError
from tadcore.scenario.model import Scenario

if TYPE_CHECKING:
    from tadcore.study.study import Study

FAILED = 1
"""The exit code of a game without an equilibrium, of one that diverges, and of a check that failed."""

UNDECIDED = 3
"""The exit code of a verification in which nothing failed and something could not be decided."""

_set_aside: list[str] = []

Source = Annotated[
    str,
    typer.Argument(metavar="SCENARIO", help="A TOML file, - for standard input, or the name of a bundled scenario."),
]
Changes = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="PATH=VALUE", help="Change a field, such as d1.visibility_radius=2; repeatable."),
]

File = Annotated[str, typer.Argument(metavar="STUDY.toml", help="The study file, or - for standard input.")]
Threads = Annotated[int | None, typer.Option(metavar="N", help="Threads; all cores by default.")]
Progress = Annotated[bool, typer.Option(help="Show a progress bar, where a terminal watches.")]
Json = Annotated[bool, typer.Option("--json", help="Print the result as JSON, and nothing else on standard output.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print errors only.")]


def read(source: str, changes: list[str] | None) -> Scenario:
    """The scenario with the changes made; a value is written as in TOML."""
    found: dict[str, object] = {}
    for change in changes or ():
        path, equals, value = change.partition("=")
        if not equals:
            raise ScenarioError("--set", change, "PATH=VALUE, such as d1.visibility_radius=2")
        found[path.strip()] = parse_toml(f"value = {value}", f"--set {path}")["value"]
    if source == STDIN:
        sc = Scenario.from_toml_string(read_stdin(), name="standard input")
    else:
        _refuse_what_is_not_there(source)
        sc = bundled.find(source)
    return sc.replace(found) if found else sc


def _refuse_what_is_not_there(source: str) -> None:
    """Say in plain words that there is no such file; what else may be wrong with it, its reader says."""
    if "\0" in source or source in bundled.names():
        return
    try:
        os.lstat(source)
    except FileNotFoundError:
        hint = similar(source, bundled.names(), cutoff=0.5)
        words = f"there is no such file, and no bundled scenario of that name{hint and f'; {hint}'}"
        raise FileNotFoundError(errno.ENOENT, words, source) from None
    except OSError:
        return


def read_study(file: str) -> Study:
    """The study of a file, or of standard input."""
    from tadcore.study.study import Study

    return Study.from_toml_string(read_stdin(), name="standard input") if file == STDIN else Study.from_toml(file)


@contextmanager
def naming(**options: object) -> Iterator[None]:
    """Let an error about an argument name the option, and what was given to it, by the name of the argument."""
    try:
        yield
    except ScenarioError as error:
        if error.field not in options or len(error.errors) > 1:
            raise
        rule = error.rule.replace("(low, high, count)", "LOW HIGH")
        raise ScenarioError(f"--{error.field.replace('_', '-')}", options[error.field], rule) from None


def usable(out: Path | None) -> None:
    """Refuse a destination that cannot be a folder before anything is computed."""
    if out is not None:
        try:
            out.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ScenarioError("--out", str(out), f"a folder that can be written ({error.strerror})") from None


def writable(option: str, out: Path | None) -> None:
    """Refuse the name of a file that cannot be written before anything is computed."""
    if out is not None:
        try:
            destination(out)
        except OSError as error:
            raise ScenarioError(option, str(out), f"a file that can be written ({error.strerror})") from None


def named_for(out: Path | None, known: tuple[str, ...]) -> None:
    """Refuse, before anything is played, a name that tells nothing of what to write, and a place that is none."""
    if out is not None and out.suffix.lower() not in known:
        raise ScenarioError("--out", str(out), f"a name that ends in {', '.join(known)}")
    writable("--out", out)


def set_backend_aside() -> None:
    """Let matplotlib not look for the backend of MPLBACKEND, which may be one of another Python: files need none."""
    backend = os.environ.pop("MPLBACKEND", None)
    if backend:
        _set_aside.append(backend)


def has_windows() -> bool:
    """Whether a figure of the user's backend opens somewhere; what it is may need a display, or be a notebook's."""
    import matplotlib as mpl
    import matplotlib.pyplot as plt

    try:
        for backend in _set_aside:
            mpl.use(backend)
        probe = plt.figure()
    except Exception:  # there is no such backend, or no display; a toolkit raises its own error
        return False
    plt.close(probe)
    framework = getattr(probe.canvas, "required_interactive_framework", None)
    return framework is not None or str(plt.get_backend()).lower() == "webagg"
