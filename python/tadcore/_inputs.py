"""Named numbers of many trials, such as ``"attacker.position.x"``, as the arrays that a batch takes."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import ScenarioError

if TYPE_CHECKING:
    from .scenario import Scenario

Floats = NDArray[np.float64]

_NAME = re.compile(r"(attacker|target|defenders\.(\d+))\.(?:position\.([xyz])|(visibility_radius|capture_radius))")


@dataclass(frozen=True, eq=False)
class Rows:
    """The starts of M trials: positions (M, n + 2, dim), and radii, one row for each trial or one for all."""

    positions: Floats
    visibility_radii: Floats
    capture_radii: Floats

    def __len__(self) -> int:
        return len(self.positions)


def rows_of(sc: Scenario, inputs: Mapping[str, ArrayLike], trials: int) -> Rows:
    """The scenario repeated, with the inputs in their places.

    Parameters
    ----------
    sc : Scenario
        What holds where nothing is named.
    inputs : mapping of str to array_like, shape (trials,)
        Values of single numbers: positions by axis, visibility and capture radii.
    trials : int
        M.

    Raises
    ------
    ScenarioError
        A name is not one of a number that may vary within one game, or an array has another length.
    """
    positions = np.repeat(sc.positions[np.newaxis], trials, axis=0)
    radii = {"visibility_radius": sc.visibility_radii, "capture_radius": sc.capture_radii}
    for name, given in inputs.items():
        values = np.asarray(given, dtype=np.float64)
        if values.shape != (trials,):
            raise ScenarioError(name, f"shape {values.shape}", f"of shape ({trials},), one value for each trial")
        row, column = place_of(sc, name)
        if row == "position":
            positions[:, column[0], column[1]] = values
        else:
            if radii[row].ndim == 1:
                radii[row] = np.repeat(radii[row][np.newaxis], trials, axis=0)
            radii[row][:, column[0]] = values
    return Rows(positions, radii["visibility_radius"], radii["capture_radius"])


def place_of(sc: Scenario, name: str) -> tuple[str, tuple[int, int]]:
    """Which array a name belongs to, and where in it: (player, axis) of a position, (column, 0) of a radius."""
    rule = "a number that varies within one game, such as attacker.position.x or defenders.0.visibility_radius"
    found = _NAME.fullmatch(name) if isinstance(name, str) else None
    if found is None:
        raise ScenarioError("input", name, rule)
    owner, index, axis, radius = found.groups()
    label = owner if index is None else f"d{int(index) + 1}"
    columns = {
        "position": sc.players,
        "visibility_radius": sc.constrained,
        "capture_radius": (*sc.players[: sc.n], "attacker"),
    }
    kind = radius or "position"
    along = "xyz".index(axis) if axis else 0
    if label not in columns[kind] or along >= sc.dim:
        raise ScenarioError("input", name, f"{rule}, of a player of this game")
    return kind, (columns[kind].index(label), along)
