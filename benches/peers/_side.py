"""What the side-by-side scripts share: the games, interleaved timing, a table, a check of agreement.

Importing this module limits BLAS to one thread, so every script imports it before NumPy.
"""

import os

for _name in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ[_name] = "1"

# ruff: noqa: E402
import argparse
import importlib.metadata
import importlib.util
import platform
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tadcore import _core

GAMMA = 0.25
"""Every synthesis weight: the paper's choice, γ equal."""


@dataclass(frozen=True)
class Game:
    """I1 with unit q and f and λ = 1; only the control weights, the horizon and the step differ between scripts."""

    r_d: tuple[float, ...]
    horizon: float
    step: float
    r_tau: float = 1.2
    r_a: float = 0.8

    @property
    def n(self) -> int:
        return len(self.r_d)

    @property
    def steps(self) -> int:
        return round(self.horizon / self.step)

    @property
    def times(self) -> np.ndarray:
        return np.arange(self.steps + 1) * self.step

    def core(self) -> _core.Game:
        """Return a new compiled game, which has solved nothing yet."""
        one = np.ones(self.n)
        return _core.Game(
            interaction="I1",
            horizon=self.horizon,
            step=self.step,
            defender_control_weight=np.array(self.r_d),
            target_control_weight=self.r_tau,
            attacker_control_weight=self.r_a,
            defender_running_weight=one,
            defender_terminal_weight=one,
            evasion_running_weight=one,
            evasion_terminal_weight=one,
            synthesis_weights=np.full(4, GAMMA),
        )


def varied_game(n: int, horizon: float, step: float) -> Game:
    """Return the family of the Criterion benches: r_{d_i} = 0.8 + 0.4 (i mod 3)."""
    return Game(tuple(0.8 + 0.4 * (i % 3) for i in range(n)), horizon, step)


def start(description: str) -> bool:
    """Parse the command line, print the heading and say whether this is a quick run."""
    summary = description.split("\n", 1)[0]
    parser = argparse.ArgumentParser(description=summary)
    parser.add_argument("--quick", action="store_true", help="a smoke run: smallest sizes, few repetitions, no Numba")
    quick: bool = parser.parse_args().quick
    packages = [p for p in ("numpy", "scipy", "numba", "jax", "tadcore") if importlib.util.find_spec(p)]
    versions = ", ".join(f"{p} {importlib.metadata.version(p)}" for p in packages)
    print(f"{summary}\nPython {platform.python_version()}, {versions}; one thread")
    if hasattr(os, "getloadavg"):
        print(
            f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores: where other work runs, read CPU times and ratios"
        )
    return quick


def numba_wanted(quick: bool) -> bool:
    """Whether the Numba rows run; says so where they do not."""
    if not quick and importlib.util.find_spec("numba"):
        return True
    print("Numba rows left out:", "quick run" if quick else "Numba is not installed (pip install '.[bench]')")
    return False


@dataclass(frozen=True)
class Time:
    """Median seconds: CPU time of the process, and what the clock on the wall says."""

    cpu: float
    wall: float
    best: float
    """The least CPU time."""


def interleave(contenders: Mapping[str, Callable[[], Any]], repetitions: int) -> tuple[dict[str, Time], dict[str, Any]]:
    """Run every contender once per round, in turn; return median times and the last answers.

    Interleaving spreads a slow moment of the machine over all of them. A first round warms up and is not counted.
    Everyone works on one thread, so CPU time is the work done. The wall clock adds the wait for a free core, which on
    a busy machine falls mostly on tadcore: it works on a thread of its own, to let Ctrl-C through.
    """
    answers = {name: run() for name, run in contenders.items()}
    samples: dict[str, list[tuple[float, float]]] = {name: [] for name in contenders}
    for _ in range(repetitions):
        for name, run in contenders.items():
            wall, cpu = time.perf_counter(), time.process_time()
            answers[name] = run()
            samples[name].append((time.process_time() - cpu, time.perf_counter() - wall))
    medians = {name: np.median(s, axis=0) for name, s in samples.items()}
    return {name: Time(*map(float, m), best=min(samples[name])[0]) for name, m in medians.items()}, answers


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print rows under a header, the first column to the left, the others to the right."""
    widths = [max(len(row[c]) for row in (header, *rows)) for c in range(len(header))]
    print()
    for i, row in enumerate((header, *rows)):
        cells = [cell.rjust(w) if c else cell.ljust(w) for c, (cell, w) in enumerate(zip(row, widths, strict=True))]
        print("  ".join(cells).rstrip())
        if i == 0:
            print("  ".join("-" * w for w in widths))


def agree(what: str, gap: float, limit: float) -> None:
    """Print how far the answers are apart; end with an error where that is more than `limit`."""
    fine = bool(gap <= limit)
    print(f"agreement, {what}: {gap:.1e} (limit {limit:.0e}): {'ok' if fine else 'FAILED'}", flush=True)
    if not fine:
        raise SystemExit(1)
