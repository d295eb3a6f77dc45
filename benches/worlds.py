"""Steps per second of a batch in worlds that fail, talk and shake, beside those of the plain batch.

    python benches/worlds.py                    # every width of this processor, each in a process of its own
    python benches/worlds.py --trials 8192 --rounds 9

The paper's limited game of I1 from random starts, one thread, a warm table. Within a process the worlds take turns,
round by round, so that other load meets all of them, and the processor's time counts, not the clock's. A world's games
end at other instants than the plain ones, so the figure is nanoseconds a step of one game; its share of the plain rate
is the median over rounds of the ratio within a round. `plain again` is what two measurements of one thing differ by.
"""

from __future__ import annotations

import argparse
import math
import os
import statistics
import subprocess
import sys
import time
from typing import Any

import numpy as np

import tadcore
from tadcore import _core

INF = math.inf
WORLDS: dict[str, dict[str, Any]] = {
    "plain": {},
    "plain again": {},
    "sensors": {"sensing": {"mean_time_to_failure": 3.0, "mean_time_to_repair": 0.2}},
    "edges": {"sensing": {"mean_time_detected": 1.0, "mean_time_missed": 0.05}},
    "links everywhere": {"communication.radius": INF},
    "links of radius 2": {"communication.radius": 2.0},
    "links that fail": {"communication": {"radius": 2.0, "mean_time_up": 5.0, "mean_time_down": 0.5}},
    "attacker disturbed": {"attacker.disturbance": 0.05},
    "all disturbed": {"*.disturbance": 0.05},
}


def measure(trials: int, rounds: int) -> None:
    """Print the table of the width in use."""
    plain = tadcore.scenarios.load("paper-i1")
    worlds = {name: plain.replace(changes) if changes else plain for name, changes in WORLDS.items()}
    positions = np.random.default_rng(7).uniform(-3.0, 3.0, (trials, plain.n + 2, plain.dim))
    steps = {}
    for name, sc in worlds.items():  # fills the table, too
        batch = tadcore.simulate_batch(sc, positions, threads=1, seed=1)
        steps[name] = int(np.rint(batch.time / plain.step).sum())
    taken: dict[str, list[float]] = {name: [] for name in worlds}
    for _ in range(rounds):
        for name, sc in worlds.items():
            began = time.process_time()
            tadcore.simulate_batch(sc, positions, threads=1, seed=1)
            taken[name].append((time.process_time() - began) / steps[name] * 1e9)
    print(f"{_core.simd()}, {trials:,} games, {rounds} rounds: ns a step (median, best), share of the plain rate")
    for name, times in taken.items():
        shares = [of / own for of, own in zip(taken["plain"], times, strict=True)]
        share, best = statistics.median(shares), min(taken["plain"]) / min(times)
        print(f"  {name:<20} {statistics.median(times):7.1f} {min(times):7.1f}   {share:5.2f}  of the best {best:5.2f}")


def widths() -> list[str]:
    """What this processor has, by what the refusal of a wrong word says."""
    code = "from tadcore import _core; _core.simd()"
    environment = {**os.environ, "TADCORE_SIMD": "none"}
    refused = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment, check=False)
    return refused.stderr.strip().rsplit("this processor has ", 1)[1].split(", ")


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--trials", type=int, default=8192)
    parser.add_argument("--rounds", type=int, default=9)
    given = parser.parse_args()
    if os.environ.get("TADCORE_SIMD"):
        measure(given.trials, given.rounds)
    else:
        for width in widths():
            fewer = {"baseline": max(given.trials // 8, 1)}.get(width, given.trials)
            command = [sys.executable, __file__, f"--trials={fewer}", f"--rounds={given.rounds}"]
            subprocess.run(command, env={**os.environ, "TADCORE_SIMD": width}, check=True)
