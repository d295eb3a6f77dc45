"""What the tests of studies share: a quick game, what varies in it, and callables that worker processes can import."""

import contextlib
import hashlib
import json
import multiprocessing
import os
import signal
from pathlib import Path

import numpy as np

import tadcore
from tadcore.game.compiled import game_of
from tadcore.sampling import Box, Disk

CHUNK = 8192
FLAG = "TADCORE_TEST_LETHAL"


def philox(seed, chunk, purpose, coordinates):
    """The documented stream of one quantity, written out once more."""
    counter = np.array([0, 0, 0, purpose], dtype=np.uint64)
    bits = np.random.Philox(key=np.array([seed, chunk], dtype=np.uint64), counter=counter)
    return np.random.Generator(bits).random((CHUNK, coordinates))


def calm():
    """The paper's game on a short and coarse grid: a chunk takes a tenth of a second."""
    return tadcore.scenarios.load("paper-i1").replace({"horizon": 1.0, "step": 0.05})


def calm_team():
    return tadcore.scenarios.load("paper-i2").replace({"horizon": 1.0, "step": 0.05})


ESCAPE = 3.2197539590990143
"""Escape time of `escaping`, exact: the first zero of a determinant in closed form."""


def escaping(horizon):
    """A duel of I2 without an equilibrium for horizons from `ESCAPE` on."""
    light = {"target_running_weight": 0.01, "target_terminal_weight": 0.01}
    defender = {"position": (1.0, 0.0), "control_weight": 1.0, "capture_radius": 0.1, "visibility_radius": 5.0}
    return tadcore.Scenario(
        interaction="I2",
        horizon=horizon,
        step=0.05,
        attacker={"position": (2.0, 2.0), "control_weight": 0.8, "capture_radius": 0.1, **light},
        target={"position": (0.0, 1.0), "control_weight": 1.0},
        defenders=[defender],
    )


def study(trials=2 * CHUNK + 500, seed=7, **changes):
    vary = {"attacker.position": Disk([0, 1], 2.0), "defenders.0.visibility_radius": Box(0.5, 4.0)}
    return tadcore.Study(**{"sc": calm(), "vary": vary, "trials": trials, "seed": seed, **changes})


def to_kill(group, pause):
    """The script of a child that plays a study slowly enough to be met on the way, into the store it is told."""
    return f"""
import sys, time
from study_cases import CHUNK, study
from tadcore.study import parts
from tadcore.study.plan import Plan
parts.GROUP = {group}
play = Plan.play
Plan.play = lambda *given: (time.sleep({pause}), play(*given))[1]
study(20 * CHUNK).run(store=sys.argv[1], threads=1)
"""


def ring(rng, size):
    """A callable sampler: points of a circle."""
    angle = rng.uniform(0, 2 * np.pi, size)
    return np.stack([1.5 * np.cos(angle), 1.0 + 1.5 * np.sin(angle)], axis=1)


def lethal(rng, size):
    """Points as `ring` draws them; but the first worker process that finds the flag file takes it and dies."""
    flag = Path(os.environ.get(FLAG, os.devnull))
    if multiprocessing.parent_process() is not None and flag.is_file():
        # Two workers may see the flag at once: who takes it dies.
        with contextlib.suppress(FileNotFoundError):
            flag.unlink()
            os.kill(os.getpid(), signal.SIGKILL)
    return ring(rng, size)


def misses(sc):
    """How many entries of its table of gains this process has computed."""
    return game_of(sc).table()["misses"]


def part(chunk, rows=CHUNK):
    """The name of the part of one chunk, where a part has no more."""
    first = chunk * CHUNK
    return f"part-{first:010d}-{first + rows:010d}.parquet"


def parts(folder):
    """The bytes of every part of a store, by name."""
    return {path.name: path.read_bytes() for path in sorted(Path(folder).glob("part-*.parquet"))}


def edited(folder, **changes):
    """The manifest of a store with some entries changed, its digest left as it was."""
    path = Path(folder) / "_manifest.json"
    path.write_text(json.dumps(json.loads(path.read_text(encoding="utf-8")) | changes), encoding="utf-8")


def resealed(folder, **changes):
    """The manifest with some entries changed and its digest made right again, written down once more."""
    path = Path(folder) / "_manifest.json"
    content = json.loads(path.read_text(encoding="utf-8")) | changes
    del content["manifest_sha256"]
    canonical = json.dumps(content, sort_keys=True, separators=(",", ":"))
    edited(folder, **changes, manifest_sha256=hashlib.sha256(canonical.encode()).hexdigest())
