"""A certified map read back from the file that `tadcore.CertifiedMap.save` wrote."""

from __future__ import annotations

import math
import os
from typing import TYPE_CHECKING

import numpy as np

from tadcore._shared.files import as_path
from tadcore._shared.netcdf import loaded
from tadcore._shared.text import one_of
from tadcore.errors import ScenarioError
from tadcore.scenario.model import Scenario

from .boxes import CertifiedMap

if TYPE_CHECKING:
    import xarray

TITLE = "Certified outcomes by the start of"
"""How the title of such a file begins."""

_RULE = "a certified map that CertifiedMap.save wrote: a file that ends in .nc"


def load_certified_map(path: str | os.PathLike[str]) -> CertifiedMap:
    """Read a map that `CertifiedMap.save` wrote as ``.nc``; every number is bitwise the one that was saved.

    What is read is what the file says: a proof is as good as the file is trusted.

    Parameters
    ----------
    path : path
        A file that ends in ``.nc``.

    Returns
    -------
    CertifiedMap
        The map, with everything that it can do.

    Raises
    ------
    ScenarioError
        There is no such file, it is no certified map, or it is damaged.
    """
    place, name = as_path("path", path), os.fspath(path)
    with loaded(place, name, _RULE, decode=False) as data:
        return _checked(data, name)


def _checked(data: xarray.Dataset, name: str) -> CertifiedMap:
    if not str(data.attrs.get("title", "")).startswith(TITLE):
        raise ScenarioError(name, "no certified map", _RULE)
    sc = Scenario.from_toml_string(str(data.attrs["scenario"]), name=name)
    kinds = {"level": "i1", "kind": "i1", "defender": "i4", "reason": "i1"}
    kinds |= dict.fromkeys(("x_low", "x_high", "y_low", "y_high"), "f8")
    native = {}
    for variable, kind in kinds.items():
        values = data[variable].values
        if data[variable].dims != ("box",) or values.dtype.kind + str(values.dtype.itemsize) != kind:
            raise ValueError(f"{variable} is no list of {np.dtype(kind)}")
        native[variable] = ("box", values.astype(kind), data[variable].attrs)
    arrays = {variable: values for variable, (_, values, _) in native.items()}
    if not (np.isin(arrays["kind"], (-1, 0, 1, 2)) & (arrays["defender"] < sc.n) & (arrays["defender"] >= -1)).all():
        raise ValueError("a box has no outcome")
    if not ((arrays["x_low"] < arrays["x_high"]) & (arrays["y_low"] < arrays["y_high"])).all():
        raise ValueError("a box is empty")
    found = CertifiedMap(sc, one_of("player", data.attrs["player"], sc.players), data.assign(native))
    if not math.isclose(
        math.fsum(found.areas), (found.extent[1] - found.extent[0]) * (found.extent[3] - found.extent[2]), rel_tol=1e-9
    ):
        raise ValueError("the boxes do not cover the region once")
    return found
