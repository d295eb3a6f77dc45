"""Datasets as files: netCDF 3, which keeps every number bitwise and needs nothing but SciPy."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from tadcore.errors import ScenarioError

from .files import strange

if TYPE_CHECKING:
    import xarray

SUFFIX = ".nc"


def netcdf(dataset: xarray.Dataset) -> bytes:
    """A dataset as the bytes of a file."""
    return bytes(dataset.to_netcdf(engine="scipy", format="NETCDF3_64BIT"))


@contextlib.contextmanager
def loaded(
    place: Path, name: str, rule: str, *, in_folder: str | None = None, decode: bool = True
) -> Iterator[xarray.Dataset]:
    """The dataset of an untrusted file, all in memory; ``in_folder`` names the file where the place is a folder.

    Raises
    ------
    ScenarioError
        Naming ``name`` and ``rule``: there is no such file, it is of another kind or damaged, or the block found that
        its content is not what it should be, by whatever exception.
    """
    import xarray as xr

    try:
        file = place / in_folder if in_folder is not None and place.is_dir() else place
        found = strange(file)
        if found is not None:
            raise ScenarioError(name, found, rule)
        with file.open("rb") as stream:
            begins = stream.read(3)
        if begins != b"CDF":
            raise ScenarioError(name, "a file of another kind", rule)
        with xr.open_dataset(file, engine="scipy", mmap=False, decode_cf=decode) as opened:
            data = opened.load()
        yield data
    except OSError as error:
        raise ScenarioError(name, error.strerror or str(error), rule) from None
    except ScenarioError:
        raise
    except Exception as error:  # of the reader of netCDF: whatever damaged bytes lead it to
        raise ScenarioError(name, "a damaged file", f"{rule} ({type(error).__name__}: {error})") from None
