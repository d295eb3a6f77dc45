"""A run as a notebook shows it: its paths, how it ends, network changes and costs."""

from __future__ import annotations

from tadcore._shared.html import as_html, line, thinned
from tadcore.plotting.run.trajectories import trajectories
from tadcore.plotting.tools.inline import inline

from .files import Written


def html_of(run: Written) -> str:
    """The run as HTML."""
    lost = [f"the game {run.diverged}"] if run.diverged is not None else []
    lost += [] if run.unconverged == 0 else [f"the gains of {run.unconverged} instants did not converge"]
    said = [
        run.variant and f"a variant: {run.variant}",
        *lost,
        *(f"between instants: {each}" for each in run.passes[:5]),
    ]
    said.append("costs J: " + ", ".join(f"{group} {value:.6g}" for group, value in run.costs.items()))
    rows = [
        [f"{time:.10g}", *(", ".join("→".join(edge) for edge in edges) for edges in (added, removed))]
        for time, added, removed in run.network_changes
    ]
    picture = inline(lambda: trajectories(run), f"paths of all players; {run.outcome}")
    lines = [line(text) for text in said if text]
    head = ["t", "edges that form", "edges that break"]
    return as_html(str(run.outcome), head, thinned(rows), *lines, picture, words=True)
