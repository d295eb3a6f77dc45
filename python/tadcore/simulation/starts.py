"""Named numbers of many trials, such as ``"attacker.position.x"``, as the arrays that a batch takes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from tadcore._shared.arrays import Floats, as_real
from tadcore.errors import ScenarioError
from tadcore.scenario.model import Scenario
from tadcore.scenario.quantities import component, setups


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
    columns = np.empty((trials, len(inputs)))
    for column, (name, given) in enumerate(inputs.items()):
        values = as_real(name, given, f"numbers, one for each of {trials} trials")
        if values.shape != (trials,):
            raise ScenarioError(name, f"shape {values.shape}", f"of shape ({trials},), one value for each trial")
        columns[:, column] = values
    return Rows(*setups(sc, tuple(component(sc, name) for name in inputs), columns))
