"""Digests of what tadcore computes, made before the code was laid out anew: `golden.json` holds what this prints.

Outcomes and termination times of batches of four games, every recorded array of the bundled runs, gains under drawn
networks, and the rows of a stored study. All of it is bitwise reproducible, on every width of vector registers
(TADCORE_SIMD). Starts and networks are made from the raw words of Philox by exact arithmetic, so that no change in a
library's distributions moves them.

    python tests/reference/golden.py > tests/reference/golden.json

With `--few` the first thousand trials of each batch, and no store: what registers of one number do in seconds.
"""

import hashlib
import json
import sys
import tempfile
from pathlib import Path

import numpy as np
from scipy import stats

import tadcore
from tadcore.sampling import Box

TRIALS = 20_000
FEW = 1_000
NETWORKS = 40


def digest(*arrays):
    """SHA-256 of shapes, types and bytes."""
    total = hashlib.sha256()
    for array in map(np.asarray, arrays):
        total.update(f"{array.shape}{array.dtype.str}".encode())
        total.update(np.ascontiguousarray(array).tobytes())
    return total.hexdigest()


def uniform(key, shape):
    """Numbers in [0, 1), multiples of 2^-53."""
    words = np.random.Philox(key=np.array([key, 2026], dtype=np.uint64)).random_raw(int(np.prod(shape)))
    return ((words >> np.uint64(11)) * 2.0**-53).reshape(shape)


def game(interaction, weights, axes, horizon, step, sight):
    """A game of n defenders around the origin; the weights are those of control, and the target's and attacker's."""
    *team, target, attacker = weights
    first = interaction == "I1"
    return tadcore.Scenario.model_validate(
        {
            "interaction": interaction,
            "horizon": horizon,
            "step": step,
            "attacker": {"position": [0.0] * axes, "control_weight": attacker, "capture_radius": 0.15},
            "target": {"position": [1.0] * axes, "control_weight": target}
            | ({} if first else {"visibility_radius": 2.0}),
            "defenders": [
                {"position": [2.0 + i] * axes, "control_weight": r, "capture_radius": 0.2, "visibility_radius": sight}
                for i, r in enumerate(team)
            ],
        }
    )


def games():
    """Four games: both interactions, one to five defenders, the plane and space."""
    return {
        "paper-i1": (tadcore.scenarios.load("paper-i1").replace({"step": 0.05}), TRIALS),
        "paper-i2": (tadcore.scenarios.load("paper-i2").replace({"step": 0.05}), TRIALS),
        "i1-two-in-space": (game("I1", (0.9, 1.3, 1.2, 0.8), 3, 2.0, 0.02, 1.7), TRIALS),
        "i2-five": (game("I2", (1.0, 1.0, 1.1, 0.9, 1.2, 1.4, 0.8), 2, 0.2, 0.02, 1.5), TRIALS),
    }


def batches(few):
    """Outcomes and times."""
    found = {}
    for key, (name, (sc, trials)) in enumerate(games().items()):
        starts = 6.0 * uniform(key, (trials, sc.n + 2, sc.dim)) - 3.0
        batch = tadcore.simulate_batch(sc, starts[:FEW] if few else starts, threads=2)
        columns = batch.kind, batch.defender, batch.time
        found[name] = {} if few else batch.counts() | {"digest": digest(*columns)}
        found[name]["first"] = digest(*(column[:FEW] for column in columns))
    return found


def runs():
    """Everything a run records."""
    found = {}
    for name in tadcore.scenarios.names():
        run = tadcore.simulate(tadcore.scenarios.load(name))
        arrays = (run.times, run.position, run.control, run.adjacency, run.gains, run.theta, run.theta_terms)
        costs = [run.costs[player] for player in sorted(run.costs)]
        found[name] = digest(*arrays, costs, [run.iterations, run.unconverged, run.certified])
    return found


def gains():
    """Gains under drawn networks, by both methods."""
    found = {}
    scenarios = {name: sc for name, (sc, _) in games().items()} | {
        "i1-seven": game("I1", (1.0, 1.0, 1.1, 0.9, 1.2, 0.8, 1.3, 1.2, 0.8), 2, 1.0, 0.1, 1.5),
        "i2-eight": game("I2", (1.0, 1.0, 1.1, 0.9, 1.2, 0.8, 1.3, 1.0, 1.2, 1.0), 2, 0.05, 0.01, 1.5),
    }
    for key, (name, sc) in enumerate(scenarios.items(), 10):
        m, size = len(sc.constrained), sc.n + 1
        steps = round(sc.horizon / sc.step)
        many = NETWORKS if sc.n < 6 else 6
        networks = uniform(key, (many, m, size)) < 0.6
        instants = (uniform(key + 100, (many,)) * steps).astype(int)
        solved = [
            tadcore.synthesize(sc, step=int(k), adjacency=network)
            for k, network in zip(instants, networks, strict=True)
        ]
        found[name] = {
            "digest": digest(*(g.rows for g in solved), [g.theta for g in solved], [g.certified for g in solved]),
            "iterations": sum(g.iterations for g in solved),
        }
    return found


def store():
    """The rows of a stored study, read back: its numbers, and its outcomes as words."""
    sc = tadcore.scenarios.load("paper-i1").replace({"step": 0.05})
    vary = {"attacker.position": Box([-3, -2], [3, 4]), "defenders.*.visibility_radius": stats.uniform(0.5, 2.5)}
    study = tadcore.Study(sc, vary, trials=10_000, seed=7)
    with tempfile.TemporaryDirectory() as folder:
        study.run(store=Path(folder) / "store")
        table = tadcore.load_study(Path(folder) / "store").table
    numbers = digest(*(column.to_numpy() for column in table.drop_columns(["outcome"]).columns))
    return {"numbers": numbers, "words": digest(np.array(table["outcome"].to_pylist(), dtype="U16"))}


if __name__ == "__main__":
    few = "--few" in sys.argv
    parts = {"batches": batches(few), "runs": runs(), "gains": gains()} | ({} if few else {"store": store()})
    json.dump(parts, sys.stdout, indent=1)
    print()
