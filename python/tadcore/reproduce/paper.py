"""The paper's section VI, computed, compared and drawn.

Eight runs are bundled as scenarios. Each is played; its outcome, its time and the instants at which its network changes
are set beside the printed ones (`tadcore.reproduce.published`), statements that the text makes about the runs are
checked, and every figure of the section is drawn. Nothing computed is stored: every number comes from a run made now.
"""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Iterator, Mapping
from itertools import zip_longest
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tadcore import _core, scenarios
from tadcore._shared.console import console as terminal
from tadcore._shared.files import as_path, write_whole
from tadcore._shared.progress import bar
from tadcore.simulation.play import simulate
from tadcore.simulation.run import Run

from .comparison import Report, Row
from .published import PUBLISHED, Published

if TYPE_CHECKING:
    from rich.console import Console


_SAME_INSTANT = 1e-9
_ROUNDING = 1e-9
"""How far from exact a statement may be, where the quantities are of order one."""


def reproduce(out: str | os.PathLike[str], *, figures: bool = True, console: Console | None = None) -> Report:
    """Play the paper's eight runs, print how they compare, and write the report and the figures.

    Parameters
    ----------
    out : path
        The folder to write into; made if it is missing, other files in it are left alone. Everything is prepared
        elsewhere first and copied there at the end, each file whole; a call interrupted before that leaves ``out`` as
        it was.
    figures : bool
        Whether to draw the figures, each as PNG and PDF.
    console : rich.console.Console, optional
        Where to print; the terminal by default.

    Returns
    -------
    Report
        All comparisons. ``report.ok`` is False when a number that must be the paper's is not: all of interaction I1,
        the winners of I2, and what the text states of both.
    """
    from rich.text import Text

    target = as_path("out", out)
    if target.exists() and not target.is_dir():
        raise NotADirectoryError(f"the output folder {str(target)!r} is a file")
    console = console or terminal()
    watched = console.is_terminal
    runs = {case.scenario: simulate(scenarios.load(case.scenario)) for case in bar(PUBLISHED, "runs", show=watched)}
    report = Report(rows=compare(runs), version=_core.__version__)
    with tempfile.TemporaryDirectory(prefix="tadcore-") as folder:
        draft = Path(folder)
        write_whole(draft / "report.md", report.to_markdown())
        write_whole(draft / "report.json", json.dumps(report.to_dict(), indent=2, ensure_ascii=False) + "\n")
        if figures:
            _draw(runs, draft, show=watched)
        files = _copied(draft, target)
    report = Report(rows=report.rows, version=report.version, files=tuple(files))
    report.print(console)
    pictures = sum(file.suffix == ".png" for file in files)
    console.print(Text(f"Report and {pictures} figures in {target}" if figures else f"Report in {target}"))
    return report


def compare(runs: Mapping[str, Run]) -> tuple[Row, ...]:
    """Return every comparison with the paper; ``runs`` holds the eight runs by the names of their scenarios."""
    rows: list[Row] = []
    for case in PUBLISHED:
        rows += _figures_of(case, runs[case.scenario])
        rows += _statements(case, runs)
    return tuple(rows)


def _figures_of(case: Published, run: Run) -> Iterator[Row]:
    def row(quantity: str, paper: float | str | None, computed: float | str | None, *, required: bool) -> Row:
        if isinstance(paper, float) and isinstance(computed, float):
            agrees = abs(computed - paper) <= _SAME_INSTANT
        else:
            agrees = paper == computed
        return Row(case.scenario, case.title, quantity, paper, computed, required, agrees, case.source)

    winner = None if run.outcome.defender is None else f"d{run.outcome.defender + 1}"
    yield row("outcome", _outcome(case.kind, case.defender), _outcome(run.outcome.kind, winner), required=True)
    yield row("time", case.time, float(run.outcome.time), required=case.exact)
    if case.changes is not None:
        computed = [float(change[0]) for change in list(run.network_changes)[1:]]
        for i, (printed, found) in enumerate(zip_longest(case.changes, computed), start=1):
            yield row(f"change {i}", printed, found, required=case.exact)
    if case.first_edge is not None:
        from .figures import first_edge

        observer, seen, printed = case.first_edge
        # the paper's words: no edge leaves this player before this one
        yield row(f"first {observer}→{_short(seen)}", printed, first_edge(run, observer, seen), required=case.exact)


def _outcome(kind: str, defender: str | None) -> str:
    if kind == "intercepted":
        return f"{defender} intercepts"
    return {"captured": "capture", "timeout": "time out"}[kind]


def _short(player: str) -> str:
    return {"attacker": "a", "target": "τ"}.get(player, player)


def _statements(case: Published, runs: Mapping[str, Run]) -> Iterator[Row]:
    """Measure how far a run is from what the text states of it in words."""

    def row(quantity: str, deviation: float | None, source: str) -> Row:
        agrees = deviation is not None and deviation <= _ROUNDING
        return Row(case.scenario, case.title, quantity, 0.0, deviation, True, agrees, source)

    run = runs[case.scenario]
    if case.scenario == "paper-i1":
        after = run.dataset.sel(time=slice(0.96 - _SAME_INSTANT, None))
        deviation = float(abs(after["theta"]).max()) if bool(after["adjacency"].all()) else None
        yield row("Θ from t = 0.96", deviation, "Section VI, interaction I1, and Theorem consistency")
    if case.scenario.startswith("paper-i1-suicidal"):
        yield row("a, τ off their line", _off_line(run), "Section VI, interaction I1, and Theorem straight_line")
    if case.scenario == "paper-i2-wide":
        deviation = _gap_before_first_edge(runs["paper-i2"], run)
        yield row("control gap until d3→a", deviation, "Section VI, interaction I2, and Theorem delayproperty")


def _gap_before_first_edge(near: Run, wide: Run) -> float | None:
    """Return the largest difference of the two runs' controls before d3 first sees anyone."""
    from .figures import first_edge

    until = first_edge(wide, "d3")
    before = slice(None, None if until is None else until - _SAME_INSTANT)
    a, b = (np.asarray(run.dataset["control"].sel(time=before).values) for run in (near, wide))
    return float(np.abs(a - b).max()) if a.shape == b.shape else None


def _off_line(run: Run) -> float:
    """Return how far the attacker and the target stray from the line through their first positions."""
    position = run.dataset["position"].sel(player=["attacker", "target"]).transpose("time", "player", "axis").values
    start = position[0, 0]
    along = position[0, 1] - start
    along = along / np.linalg.norm(along)
    apart = position - start
    return float(np.abs(apart - (apart @ along)[..., None] * along).max())


def _draw(runs: Mapping[str, Run], folder: Path, *, show: bool) -> None:
    from tadcore.plotting import save, style

    from .figures import FIGURES

    with style():
        for name in bar(list(FIGURES), "figures", show=show):
            save(FIGURES[name](runs), folder / name)


def _copied(draft: Path, target: Path) -> list[Path]:
    target.mkdir(parents=True, exist_ok=True)
    files = []
    for file in sorted(draft.iterdir()):
        write_whole(target / file.name, file.read_bytes())
        files.append(target / file.name)
    return files
