"""Network externality: what one player's new edge does to the controls of the others.

The gains at an instant minimise Θ over the whole team at once (Remark networkexternality), so when an edge of player i
forms or breaks, the gains of every other player jump too. At each change t_k the jump of a player is

    Δu_p = (G_p(t_k, new network) - G_p(t_k, old network)) z(t_k),

at one and the same instant and state: what the change itself does, apart from the motion.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .changes import changed_rows
from .recorded import Recorded, scalar_gains
from .synthesis import synthesize

if TYPE_CHECKING:
    import xarray


def control_jumps(run: Recorded) -> xarray.Dataset:
    """The jump in every player's control at every change of the network.

    Parameters
    ----------
    run : Run
        The run.

    Returns
    -------
    xarray.Dataset
        Over (time, player), the players those with limited sight: ``jump`` (also over axis), its length ``size``, and
        ``own``, whether an edge of that player itself changed. Jumps where ``own`` is False are the externality.
        ``edges`` over time names what changed, as in ``"+d2→d1"``. Turn it into a table with ``.to_dataframe()``.
    """
    import xarray as xr

    sc, in_force = run.scenario, run.adjacency[: len(run.times) - 1]
    steps = changed_rows(in_force)
    labels = list(sc.constrained)
    jump = np.zeros((len(steps), len(labels), sc.dim))
    own = np.zeros((len(steps), len(labels)), dtype=bool)
    for e, k in enumerate(steps.tolist()):
        z = run.position[k, :-1] - run.position[k, -1]
        old = synthesize(sc, step=k, adjacency=run.adjacency[k - 1]).rows
        jump[e] = (scalar_gains(run)[k] - old) @ z
        own[e] = (run.adjacency[k] != run.adjacency[k - 1]).any(axis=1)
    changes = {change.time: change for change in run.network_changes[1:]}
    edges = []
    for t in run.times[steps].tolist():
        change = changes[t]
        words = [f"+{p}→{q}" for p, q in change.added] + [f"-{p}→{q}" for p, q in change.removed]
        edges.append(" ".join(words))
    return xr.Dataset(
        {
            "jump": (("time", "player", "axis"), jump),
            "size": (("time", "player"), np.linalg.norm(jump, axis=-1)),
            "own": (("time", "player"), own),
            "edges": ("time", np.array(edges, dtype=object)),
        },
        coords={"time": run.times[steps], "player": labels, "axis": list("xyz"[: sc.dim])},
        attrs={"reference": "rem:networkexternality"},
    )
