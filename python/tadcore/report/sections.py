"""The sections of a page, each with its tables and figures."""

from __future__ import annotations

import base64
import io
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np

from tadcore import plotting, statistics
from tadcore._shared.arrays import Floats
from tadcore._shared.shares import percent
from tadcore.game.outcome import NO_EQUILIBRIUM, UNPLAYED
from tadcore.plotting.tools.axes import for_files
from tadcore.scenario.paths import short
from tadcore.scenario.provenance import provenance
from tadcore.statistics import Incidence
from tadcore.statistics.outcomes import diverged_of, indicators, is_defender
from tadcore.statistics.stopping import stopping_of

from .parts import Code, Picture, Reported, Row, Section, Table, shown

_INTERVALS = {"wilson": "Wilson intervals", "exact": "exact intervals", "sequence": "confidence sequences"}
_DPI = 220
_EXAMPLES = 5
_LEAST_IN_A_PLANE = 200  # trials; fewer would fill too few cells
_MOST_INPUTS = 12  # panels of shares by input; the table of inputs lists all of them


def notes(result: Reported) -> list[str]:
    """What a reader must know before the numbers: a study cut off, or a design that is no random one."""
    found = []
    asked, design = result.study.trials, result.study.design
    stopping = stopping_of(result)
    if stopping is not None:
        found.append(
            f"The study was {stopping}, which was asked after every {stopping.chunk:,} trials: {result.trials:,} of "
            f"{asked:,} trials are there. Intervals are those of confidence sequences, and bands hold at every time "
            "the rule was asked; those of a fixed number of trials would not."
        )
    elif result.trials < asked:
        found.append(
            f"{result.trials:,} of {asked:,} trials are there: the study was stopped or cut off before its end."
        )
    tally = getattr(result, "tally", None)
    lost = diverged_of(result) if tally is None else tally.count[tally.diverged]
    if lost is not None and lost.any():
        found.append(
            f"{int(lost.sum()):,} of {result.trials:,} trials diverged: the players parted without bound, by more than "
            "1000 times the size of their start. They are counted as diverged alone, however they then ended."
        )
    if design != "random":
        found.append(
            f"The trials follow a {design} design, which is more even than independent draws. Intervals and bands "
            "below are those of independent draws, so as a rule they are wider than they need be."
        )
    return found


def outcomes(result: Reported, level: float | None) -> Section:
    """The probability of each outcome."""
    found = statistics.probabilities_of(result, level=level)
    rows = [_row(name, cells) for name, *cells in found.rows()]
    share = percent(found.level)
    named = _INTERVALS[found.method]
    return Section(
        "Outcome probabilities",
        tables=[Table(f"Outcomes, with {share} {named}", ["outcome", "trials", "share", share], rows)],
        figures=[_picture(f"Outcome probabilities with {share} {named}.", plotting.outcome_probabilities, found)],
    )


def times(result: Reported, level: float | None) -> Section:
    """The times at which each outcome occurs."""
    found = statistics.incidence_of(result, level=level)
    rows = [_row(name, [f"{t:.6g}" for t in values]) for name, values in _quartiles(result, found)]
    return Section(
        "Termination times",
        tables=[
            Table(
                "Quantiles of the time",
                ["outcome", "first", "lower quartile", "median", "upper quartile", "last"],
                rows,
            )
        ],
        figures=[
            _picture("Cumulative incidence, stacked; above the areas the games still run.", plotting.incidence, found),
            _picture(
                f"The same curves, each from zero; every {percent(found.level)} band holds at all times at once.",
                lambda curves: plotting.incidence(curves, stacked=False),
                found,
            ),
        ],
    )


def inputs(result: Reported) -> Section:
    """What varies, and how the outcomes depend on it."""
    samplers = [Row(path, [repr(sampler)]) for path, sampler in result.study.vary.items()]
    tables = [Table("Samplers", ["path", "drawn from"], samplers, text=True)]
    few = shown(result)
    if few is None:
        return Section("Inputs", paragraphs=["The study keeps counts alone, and no single trial."], tables=tables)
    rows = [
        Row(name, [f"{cell:.6g}" for cell in (values.min(), _median(values), values.max())])
        for name, values in few.inputs.items()
    ]
    named = list(few.inputs)[:_MOST_INPUTS]
    varying = [name for name in named if len(np.unique(few.inputs[name][np.isfinite(few.inputs[name])])) > 1]
    figures = []
    paragraphs = [] if few is result else [f"Values and figures are those of the first {few.trials:,} trials."]
    if (few.kind == UNPLAYED).any():
        paragraphs.append("Shares by input are not drawn: some trials have no equilibrium, and were not played.")
    elif varying and few.trials >= 10:
        more = f" (the first {len(named)} of {len(few.inputs)})" if len(named) < len(few.inputs) else ""
        caption = f"Shares of the outcomes where each input is in one of ten equally filled ranges{more}."
        figures.append(_picture(caption, lambda r: plotting.outcomes_by_inputs(r, varying), few, wide=True))
        figures += _planes(few, varying)
    return Section(
        "Inputs",
        paragraphs=paragraphs,
        tables=[*tables, Table("Values drawn", ["input", "least", "median", "largest"], rows)],
        figures=figures,
    )


def _quartiles(result: Reported, found: Incidence) -> Iterator[tuple[str, Any]]:
    """The smallest, the quartiles and the largest of the times of every outcome that occurred.

    They are NumPy's "lower" quantiles; where trials are many, or are not kept, at the steps at which they are counted.
    """
    shares = np.array([0, 0.25, 0.5, 0.75, 1])
    if shown(result) is result and NO_EQUILIBRIUM not in found.names:
        events = indicators(result.kind, result.defender, result.scenario.n, diverged_of(result))
        for name, ended in zip(found.names, events, strict=True):
            if ended.any():
                yield name, np.quantile(result.time[ended], shares, method="lower")
        return
    for name, ended in zip(found.names, np.rint(found.estimate * found.trials), strict=True):
        if ended[-1] and name != NO_EQUILIBRIUM:
            yield name, found.times[np.searchsorted(ended, np.floor(shares * (ended[-1] - 1)), side="right")]


def _planes(result: Reported, varying: list[str]) -> list[Picture]:
    """The share of interceptions over the plane of every start that varies."""
    figures = []
    for x in varying:
        y = f"{x[:-1]}y"
        if x.endswith(".position.x") and y in varying and result.trials >= _LEAST_IN_A_PLANE:
            caption = (
                f"Share of interceptions by {short(x.removesuffix('.x'))}; cells of fewer than five trials are empty."
            )
            figures.append(_picture(caption, partial(plotting.outcomes_over, x=x, y=y), result))
    return figures


def _row(name: str, cells: list[str]) -> Row:
    """One outcome's row; a defender's belongs to that of interception."""
    part = is_defender(name)
    return Row(f"by {name}" if part else name, cells, part)


def _median(values: Floats) -> float:
    return float(np.quantile(values, 0.5, method="lower"))  # infinite radii have a median, but no mean of two


def examples(result: Reported) -> Section:
    """A few trials of each outcome, to be played again."""
    few, n = shown(result), result.scenario.n
    if few is None:
        return Section("Example trials", paragraphs=["The study keeps counts alone, and no single trial."])
    lost = diverged_of(few)
    names = statistics.outcome_names(n, diverged=lost is not None)
    played = few.kind != UNPLAYED
    events = indicators(np.where(played, few.kind, 0), few.defender, n, lost) & played
    rows = []
    for name, ended in [*zip(names, events, strict=True), (NO_EQUILIBRIUM, ~played)]:
        first = np.flatnonzero(ended)[:_EXAMPLES]
        if name != "intercepted" and first.size:
            rows.append(_row(name, [", ".join(map(str, first))]))
    return Section(
        "Example trials",
        paragraphs=["result.replay(trial) plays one of them again and records everything."],
        tables=[Table("The first trials of each outcome, numbered from 0", ["outcome", "trials"], rows, text=True)],
    )


def origin(result: Reported) -> Section:
    """What is needed to run the study again."""
    facts = provenance(result.scenario)
    rows = [
        Row("tadcore", [facts["tadcore_version"]]),
        Row("scenario (SHA-256)", [facts["scenario_sha256"]]),
        Row("seed", [str(result.seed)]),
        Row("design", [result.study.design]),
        Row("trials", [f"{result.trials:,} of {result.study.trials:,}"]),
    ]
    return Section(
        "Provenance",
        tables=[Table("What was run", ["", ""], rows, text=True)],
        code=[Code("The scenario", facts["scenario"]), Code("In words", result.scenario.describe())],
    )


def _picture(caption: str, draw: Callable[[Any], Any], what: Any, *, wide: bool = False) -> Picture:
    """Draw one figure in the style of the package, as a PNG: hatches and curves of many steps make vectors large."""
    stream = io.BytesIO()
    with for_files(), plotting.style():
        figure: Any = np.asarray(draw(what), dtype=object).flat[0].figure
        figure.savefig(stream, format="png", dpi=_DPI)
    return Picture(caption, base64.b64encode(stream.getvalue()).decode("ascii"), wide)
