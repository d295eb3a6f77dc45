"""A study as one page: tables, figures and provenance in a single HTML file that needs nothing beside it."""

from __future__ import annotations

import base64
import io
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from tadcore._shared.arrays import Floats

from . import statistics
from ._shared.files import write_whole
from .errors import ScenarioError
from .scenario.provenance import provenance
from .statistics import TrialOutcomes
from .statistics.outcomes import indicators

__all__ = ["report"]

_DPI = 220
_EXAMPLES = 5
_MOST_INPUTS = 12  # panels of shares by input; the table of inputs lists all of them


class Asked(Protocol):
    """What a study says of itself; `tadcore.Study` does."""

    @property
    def vary(self) -> Mapping[str, Any]:
        """The sampler of every path."""

    @property
    def trials(self) -> int:
        """How many trials were asked for."""

    @property
    def design(self) -> str:
        """How the trials are spread: ``"random"``, ``"sobol"`` or ``"latin"``."""


class Reported(TrialOutcomes, Protocol):
    """A result that knows its study; `tadcore.StudyResult` does."""

    @property
    def study(self) -> Asked:
        """What was asked for."""


@dataclass(frozen=True)
class Row:
    """A row of a table; a part belongs to the row above it."""

    name: str
    cells: Sequence[str]
    part: bool = False


@dataclass(frozen=True)
class Table:
    """A table with its caption; ``text`` where its cells are words."""

    caption: str
    head: Sequence[str]
    rows: Sequence[Row]
    text: bool = False


@dataclass(frozen=True)
class Picture:
    """A figure as base64 of a PNG."""

    caption: str
    data: str
    wide: bool = False


@dataclass(frozen=True)
class Code:
    """A text to unfold."""

    title: str
    body: str


@dataclass(frozen=True)
class Section:
    """A part of the page."""

    title: str
    paragraphs: Sequence[str] = ()
    tables: Sequence[Table] = ()
    figures: Sequence[Picture] = ()
    code: Sequence[Code] = field(default_factory=tuple)


def report(result: Reported, out: str | os.PathLike[str], *, title: str = "", level: float = 0.95) -> Path:
    """Write a study as an HTML page.

    Parameters
    ----------
    result : StudyResult
        The study, finished or cut off.
    out : path
        The file to write, whole or not at all; folders on the way are made.
    title : str
        What to call the study.
    level : float
        Confidence level of intervals and bands.

    Returns
    -------
    Path
        The file. The same result gives the same bytes.

    Raises
    ------
    ScenarioError
        There is no trial to report, or ``out`` is a folder.
    """
    from jinja2 import Environment, PackageLoader, StrictUndefined

    target = Path(out)
    if target.is_dir():
        raise ScenarioError("out", str(out), "a file to write, not a folder")
    sc = result.scenario
    pages = Environment(loader=PackageLoader("tadcore"), autoescape=True, undefined=StrictUndefined, trim_blocks=True)
    html = pages.get_template("report.html").render(
        title=title or f"A study of {result.trials:,} games",
        lead=" · ".join(sc.describe().splitlines()[:2]),
        version=provenance(sc)["tadcore_version"],
        notes=_notes(result),
        sections=[
            _outcomes(result, level),
            _times(result, level),
            _inputs(result),
            _examples(result),
            _provenance(result),
        ],
    )
    target.parent.mkdir(parents=True, exist_ok=True)
    write_whole(target, html)
    return target


def _notes(result: Reported) -> list[str]:
    notes = []
    asked, design = result.study.trials, result.study.design
    if result.trials < asked:
        notes.append(
            f"{result.trials:,} of {asked:,} trials are there: the study was stopped or cut off before its end."
        )
    if design != "random":
        notes.append(
            f"The trials follow a {design} design, which is more even than independent draws. Intervals and bands "
            "below are those of independent draws, so as a rule they are wider than they need be."
        )
    return notes


def _outcomes(result: Reported, level: float) -> Section:
    from . import plotting

    found = statistics.probabilities(result.kind, result.defender, result.scenario.n, level=level)
    rows = [
        Row(
            f"by {name}" if name.startswith("d") else name,
            [f"{count:,}", f"{p:.4f}", f"{low:.4f} – {high:.4f}"],
            part=name.startswith("d"),
        )
        for name, count, p, low, high in zip(
            found.names, found.count, found.estimate, found.low, found.high, strict=True
        )
    ]
    percent = f"{100 * level:g} %"
    return Section(
        "How the games end",
        tables=[Table(f"Outcomes, with {percent} Wilson intervals", ["outcome", "trials", "share", percent], rows)],
        figures=[_picture(f"Outcome probabilities with {percent} intervals.", plotting.outcome_probabilities, found)],
    )


def _times(result: Reported, level: float) -> Section:
    from . import plotting

    sc = result.scenario
    found = statistics.incidence(
        result.kind, result.defender, result.time, horizon=sc.horizon, step=sc.step, n=sc.n, level=level
    )
    rows = []
    for name, ended in zip(found.names, indicators(result.kind, result.defender, sc.n), strict=True):
        if ended.any():
            cells = [f"{t:.6g}" for t in np.quantile(result.time[ended], [0, 0.25, 0.5, 0.75, 1], method="lower")]
            rows.append(Row(f"by {name}" if name.startswith("d") else name, cells, part=name.startswith("d")))
    percent = f"{100 * level:g} %"
    return Section(
        "When they end",
        tables=[Table("Instants of the end", ["outcome", "first", "quarter", "median", "3 quarters", "last"], rows)],
        figures=[
            _picture("Cumulative incidence, stacked; above the areas the games still run.", plotting.incidence, found),
            _picture(
                f"The same curves, each from zero; every {percent} band holds at all times at once.",
                lambda curves: plotting.incidence(curves, stacked=False),
                found,
            ),
        ],
    )


def _inputs(result: Reported) -> Section:
    from . import plotting

    rows = [
        Row(name, [f"{cell:.6g}" for cell in (values.min(), _median(values), values.max())])
        for name, values in result.inputs.items()
    ]
    samplers = [Row(path, [repr(sampler)]) for path, sampler in result.study.vary.items()]
    shown = list(result.inputs)[:_MOST_INPUTS]
    varying = [name for name in shown if len(np.unique(result.inputs[name][np.isfinite(result.inputs[name])])) > 1]
    figures = []
    if varying and result.trials >= 10:
        more = f" (the first {len(shown)} of {len(result.inputs)})" if len(shown) < len(result.inputs) else ""
        caption = f"Shares of the outcomes where each input is in one of ten equally filled ranges{more}."
        figures.append(_picture(caption, lambda r: plotting.outcomes_by_inputs(r, varying), result, wide=True))
    return Section(
        "What varies",
        tables=[
            Table("Samplers", ["path", "drawn from"], samplers, text=True),
            Table("Values drawn", ["input", "least", "median", "largest"], rows),
        ],
        figures=figures,
    )


def _median(values: Floats) -> float:
    return float(np.quantile(values, 0.5, method="lower"))  # infinite radii have a median, but no mean of two


def _examples(result: Reported) -> Section:
    rows = []
    for name, ended in zip(
        statistics.outcome_names(result.scenario.n),
        indicators(result.kind, result.defender, result.scenario.n),
        strict=True,
    ):
        first = np.flatnonzero(ended)[:_EXAMPLES]
        if name != "intercepted" and first.size:
            rows.append(Row(f"by {name}" if name.startswith("d") else name, [", ".join(map(str, first))]))
    return Section(
        "Trials to look at",
        paragraphs=["result.replay(trial) plays one of them again and records everything."],
        tables=[Table("The first trials of each outcome, numbered from 0", ["outcome", "trials"], rows, text=True)],
    )


def _provenance(result: Reported) -> Section:
    facts = provenance(result.scenario)
    rows = [
        Row("tadcore", [facts["tadcore_version"]]),
        Row("scenario (SHA-256)", [facts["scenario_sha256"]]),
        Row("seed", [str(result.seed)]),
        Row("design", [result.study.design]),
        Row("trials", [f"{result.trials:,} of {result.study.trials:,}"]),
    ]
    return Section(
        "Where this comes from",
        tables=[Table("Provenance", ["", ""], rows, text=True)],
        code=[Code("The scenario", facts["scenario"]), Code("In words", result.scenario.describe())],
    )


def _picture(caption: str, draw: Callable[[Any], Any], what: Any, *, wide: bool = False) -> Picture:
    """Draw one figure in the house style, as a PNG: hatches and curves of many steps make vectors large."""
    import matplotlib.pyplot as plt

    from . import plotting

    stream = io.BytesIO()
    with plotting.style():
        figure: Any = np.asarray(draw(what), dtype=object).flat[0].figure
        figure.savefig(stream, format="png", dpi=_DPI)
        plt.close(figure)
    return Picture(caption, base64.b64encode(stream.getvalue()).decode("ascii"), wide)
