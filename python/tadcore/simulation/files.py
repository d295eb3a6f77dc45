"""A run as an xarray dataset, in a few numbers, and as files."""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import json
import os
from collections.abc import Iterable
from typing import Any, Protocol, get_origin, get_type_hints

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from pydantic import TypeAdapter

from tadcore._shared.files import as_path, destination, write_whole
from tadcore._shared.netcdf import SUFFIX, netcdf
from tadcore.errors import ScenarioError
from tadcore.game.course import ARRAYS
from tadcore.game.network import Edge
from tadcore.game.recorded import Recorded
from tadcore.game.synthesis import theta_terms
from tadcore.scenario import worlds
from tadcore.scenario.provenance import provenance

from .termination import Termination
from .variants import TURNING_WORDS, Variant, told

RECORD = "run"
"""The attribute with all of a run that its dataset does not have."""

COURSE = "course"
"""Its entry with what is no array of a course."""

OF_COURSE = ("seed", "trial", "from_outside")
"""What that is."""

SEAL = "sha256"
"""Its entry with the digest of all else."""

VARIABLES = {"times": "time", "gains": "gain", "seen": "detected"}
"""Where a variable of the dataset is not called as the field of the run, or of its course."""

TURNING = "gain_turning"
"""The variable with the imaginary parts of gains that turn, which the file cannot hold beside the real ones."""

_PAPER = "Singh and Reddy, Dynamic network analysis of a target defense differential game with limited observations"


class Written(Recorded, Variant, Protocol):
    """What a file tells of a run beyond its arrays; `tadcore.Run` has it."""

    @property
    def termination(self) -> Termination:
        """See `tadcore.simulate`."""

    @property
    def costs(self) -> dict[str, float]:
        """J of every player."""

    @property
    def changes_after_divergence(self) -> int:
        """Network changes after the game diverged."""

    @property
    def converged(self) -> bool:
        """Whether all gains reached the tolerance, and the game did not diverge."""

    @property
    def unconverged(self) -> int:
        """Instants at which they did not."""

    @property
    def certified(self) -> int:
        """Rows whose gains are proved to be globally optimal."""

    @property
    def iterations(self) -> int:
        """Steps of the synthesis solver."""

    @property
    def dataset(self) -> xr.Dataset:
        """The record with labels."""


def dataset_of(run: Written) -> xr.Dataset:
    """Every recorded array under its label, symbol and source."""
    sc = run.scenario
    attacker = run.position[:, -1:, :]
    distance = np.linalg.norm(run.position - attacker, axis=-1)
    grid, team = ("time", "player"), ("time", "observer", "entry")
    theta = "Theta_1" if sc.interaction == "I1" else "Theta_2"
    source = "eq:errfun1" if sc.interaction == "I1" else "eq:errfun2"
    return xr.Dataset(
        {
            "position": ((*grid, "axis"), run.position, _about("position", "X_p", "eq:position")),
            "control": (
                (*grid, "axis"),
                run.control,
                _about("control, the velocity", "u_p", "eq:1d, eq:nwadapt"),
            ),
            "distance": (grid, distance, _about("distance to the attacker", "|z_p|", "eq:stateequation")),
            "theta": ("time", run.theta, _about("inconsistency, reduced norms", theta, source)),
            "theta_terms": (
                ("time", "term"),
                run.theta_terms,
                _about("squared norms, unweighted", "", source),
            ),
            "adjacency": (
                team,
                run.adjacency,
                _about("entry j: sees player j; own entry: sees the attacker", "A", "eq:extadj"),
            ),
            "sees": (
                ("time", "player", "seen"),
                sees_of(run),
                _about("whether a player sees another; not itself; who has no radius sees all", "", "eq:limob"),
            ),
            "gain": (team, run.gains.real, _about("feedback rows, u_i = gain @ z", "K_i I_i", "eq:nwadapt")),
            **_turned(run),
            **_around(run),
        },
        coords={
            "time": ("time", run.times, _about("time", "t", "")),
            "player": list(sc.players),
            "axis": list("xyz"[: sc.dim]),
            "observer": list(sc.constrained),
            "entry": list(sc.players[:-1]),
            "seen": list(sc.players),
            "term": list(theta_terms(sc.interaction)),
            **({} if run.course is None else {"speaker": list(sc.constrained)}),
        },
        attrs={
            "title": str(run.outcome),
            "interaction": sc.interaction,
            "references": _PAPER,
            **variant_of(run),
            **world_of(run),
            **divergence_of(run),
            **provenance(sc),
            **record_of(run),
        },
    )


def sees_of(run: Written) -> NDArray[np.bool_]:
    """Who sees whom of all players, at every instant: 𝒜 without its fold, and rows of ones for unlimited sight.

    What is told is not among it.
    """
    rows, m, size = run.seen.shape
    sees = np.ones((rows, size + 1, size + 1), dtype=np.bool_)
    sees[:, :m, :size] = run.seen
    own = np.arange(m)
    sees[:, own, size] = run.seen[:, own, own]  # an entry of its own row says whether it sees the attacker
    sees[:, np.arange(size + 1), np.arange(size + 1)] = False
    return sees


def _turned(run: Written) -> dict[str, Any]:
    """The imaginary parts of gains that turn; empty for scalar ones."""
    if not np.iscomplexobj(run.gains):
        return {}
    about = _about("factors of a quarter turn J, u_i = gain @ z + gain_turning @ Jz", "", "eq:nwadapt")
    return {TURNING: (("time", "observer", "entry"), run.gains.imag, about)}


def _around(run: Written) -> dict[str, Any]:
    """What failed, who heard whom and what was displaced; empty for the paper's game."""
    if run.course is None:
        return {}
    dims = {"seen": ("time", "observer", "entry"), "sensor_up": ("time", "observer")}
    dims |= {"edge_up": dims["seen"], "heard": ("time", "observer", "speaker")}
    dims |= {"displacement": ("time", "player", "axis")}
    words = {
        "seen": "entries as of adjacency: what the player sees itself; adjacency has what is reported to it too",
        "sensor_up": "whether the player's sensor works",
        "edge_up": "entries as of adjacency: whether the edge is detected in range, the sensor working",
        "heard": "whether the observer hears the speaker",
        "displacement": "what a disturbance adds to the position at the end of the step",
    }
    return {
        VARIABLES.get(name, name): (dims[name], getattr(run.course, name), _about(words[name], "", ""))
        for name in ARRAYS
    }


def world_of(run: Written) -> dict[str, Any]:
    """What a reader of a file must know of a run with failures, links or disturbances; empty for the paper's game."""
    if run.course is None or run.scenario.world is None:
        return {}
    return {"world": "; ".join(worlds.describe(run.scenario)), "seed": run.course.seed, "trial": run.course.trial}


def variant_of(run: Written) -> dict[str, Any]:
    """What a reader of a file must know of a run by other rules than the default ones; empty for one by those."""
    if not run.variant:
        return {}
    # Gains that turn are the paper's, whose blocks need not be scalars.
    prefix = "" if run.variant in TURNING_WORDS.values() else "not the paper's game: "
    return {
        "variant": prefix + told(run),
        "hysteresis": run.hysteresis,
        "dwell": run.dwell,
        "termination": run.termination,
    }


def divergence_of(run: Written) -> dict[str, Any]:
    """What a reader of a file must know of a run that diverged; empty for one that did not."""
    if run.diverged is None:
        return {}
    return {"diverged": str(run.diverged), "diverged_time": run.diverged.time, "diverged_size": run.diverged.size}


def _about(name: str, symbol: str, source: str) -> dict[str, str]:
    attributes = {"long_name": name, "units": "1", "symbol": symbol, "reference": source}
    return {key: value for key, value in attributes.items() if value}


def summary_of(run: Written) -> dict[str, Any]:
    """The run in a few numbers, ready for JSON."""
    return {
        "outcome": {
            "kind": run.outcome.kind,
            "defender": run.outcome.defender,
            "time": run.outcome.time,
            "text": str(run.outcome),
        },
        "diverged": run.diverged and {"time": run.diverged.time, "size": run.diverged.size, "text": str(run.diverged)},
        **variant_of(run),
        **world_of(run),
        "passes": [dataclasses.asdict(each) for each in run.passes],
        "network_changes": [
            {"time": c.time, "added": _arrows(c.added), "removed": _arrows(c.removed)} for c in run.network_changes
        ],
        "network_changes_after_divergence": run.changes_after_divergence,
        "costs": run.costs,
        "converged": run.converged,
        "unconverged_instants": run.unconverged,
        "certified_rows": run.certified,
        "synthesis_iterations": run.iterations,
        **{key: value for key, value in provenance(run.scenario).items() if key != "scenario"},
    }


def _arrows(edges: tuple[Edge, ...]) -> list[str]:
    return [f"{observer}->{seen}" for observer, seen in edges]


@functools.cache
def fields_of(kind: type[Any]) -> tuple[list[str], dict[str, TypeAdapter[Any]]]:
    """The fields of a run that are arrays, and how each other one becomes JSON and comes back.

    The scenario and the course are kept apart.
    """
    hints = get_type_hints(kind)
    names = [field.name for field in dataclasses.fields(kind) if field.name not in ("scenario", COURSE)]
    arrays = [name for name in names if get_origin(hints[name]) is np.ndarray]
    return arrays, {name: TypeAdapter(hints[name]) for name in names if name not in arrays}


def seal(scenario: str, record: dict[str, Any], arrays: Iterable[NDArray[Any]]) -> str:
    """SHA-256 of a run: of its scenario, of what is no array, and of every number, array after array."""
    total = hashlib.sha256(json.dumps([scenario, record], sort_keys=True).encode())
    for array in arrays:
        total.update(np.ascontiguousarray(array).tobytes())
    return total.hexdigest()


def record_of(run: Written) -> dict[str, str]:
    """What the dataset does not say of a run, as an attribute."""
    arrays, others = fields_of(type(run))
    record = {name: adapter.dump_python(getattr(run, name)) for name, adapter in others.items()}
    sealing = [getattr(run, name) for name in arrays]
    if run.course is not None:
        record[COURSE] = {name: getattr(run.course, name) for name in OF_COURSE}
        sealing += [getattr(run.course, name) for name in ARRAYS]
    sealed = {SEAL: seal(run.scenario.to_toml(), record, sealing)}
    return {RECORD: json.dumps(record | sealed)}


def save(run: Written, path: str | os.PathLike[str]) -> None:
    """Write a run as one file or into a folder; see `tadcore.Run.save`."""
    place = as_path("path", path)
    if place.suffix.lower() == SUFFIX:
        destination(place)
        place.parent.mkdir(parents=True, exist_ok=True)
        write_whole(place, netcdf(run.dataset))
        return
    if any(map(str.isalpha, place.suffix)) and not place.is_dir():
        rule = f"a name that ends in {SUFFIX}, for one file, or has no suffix, for a folder"
        raise ScenarioError("path", os.fspath(path), rule)
    place.mkdir(parents=True, exist_ok=True)
    write_whole(place / "run.nc", netcdf(run.dataset))
    run.scenario.to_toml(place / "scenario.toml")
    write_whole(place / "summary.json", json.dumps(summary_of(run), indent=2, allow_nan=False) + "\n")
