"""The page itself: its sections, laid out by a template and written as one file."""

from __future__ import annotations

import inspect
import os
from pathlib import Path

from tadcore._shared.calls import public
from tadcore._shared.files import as_path, destination, write_whole
from tadcore.errors import ScenarioError
from tadcore.scenario.provenance import provenance

from .parts import Reported
from .sections import examples, inputs, notes, origin, outcomes, times


@public
def report(result: Reported, out: str | os.PathLike[str], *, title: str = "", level: float | None = None) -> Path:
    """Write a study as an HTML page.

    Parameters
    ----------
    result : StudyResult
        The study, finished or cut off.
    out : path
        The file to write, whole or not at all; folders on the way are made.
    title : str
        What to call the study.
    level : float, optional
        Confidence level of intervals and bands; 0.95, or that of the rule that was asked when to stop.

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

    if any(inspect.getattr_static(result, name, None) is None for name in ("scenario", "study", "kind")):
        raise ScenarioError("result", result, "a StudyResult, as Study.run and load_study return it")
    if not isinstance(title, str) or not title.isprintable():
        raise ScenarioError("title", title, "one line of text")
    target = as_path("out", out)
    if target.is_dir():
        raise ScenarioError("out", str(out), "a file to write, not a folder")
    destination(target)
    sc = result.scenario
    loader = PackageLoader("tadcore.report")
    pages = Environment(loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True)
    html = pages.get_template("report.html").render(
        title=title or f"A study of {result.trials:,} games",
        lead=" · ".join(sc.describe().splitlines()[:2]),
        version=provenance(sc)["tadcore_version"],
        notes=notes(result),
        sections=[outcomes(result, level), times(result, level), inputs(result), examples(result), origin(result)],
    )
    target.parent.mkdir(parents=True, exist_ok=True)
    write_whole(target, html)
    return target
