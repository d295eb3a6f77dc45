"""Ctrl-C in the middle of verification, of questions over many games, and of statistics of many trials.

The rule is 0.2 s on a quiet machine. The measured time is printed; what is asserted leaves room for a busy one.
"""

import subprocess
import sys

import pytest

ROOM = 2.0
CHILD = """
import os, signal, sys, threading, time
import numpy as np
import tadcore
from tadcore import statistics
from tadcore.sampling import Box, Gaussian

signal.signal(signal.SIGINT, signal.default_int_handler)
what = sys.argv[1]
sc = tadcore.scenarios.load("paper-i1")
study = tadcore.Study(sc, {"attacker.position": Box([-3, -2], [3, 4])}, trials=200_000, seed=7)
full = tadcore.scenarios.load("paper-i1-full")
starts = {f"{p}.position": Gaussian(at, 0.022) for p, at in zip(full.players, full.positions)}
near = tadcore.Study(full, starts, trials=1)
still = {"attacker": {"position": [0, 0], "control_weight": 1.0, "capture_radius": 0.5, "disturbance": 0.3}}
still |= {"target": {"position": [1.5, 0], "control_weight": 1.0}, "interaction": "I1", "horizon": 0.4, "step": 0.01}
still |= {"defenders": [{"position": [0, 5], "control_weight": 1.0, "capture_radius": 0.1}]}
shaken = tadcore.Study(tadcore.Scenario.model_validate(still), {}, trials=1)
rng = np.random.default_rng(1)
many = 5_000_000 if what in ("probabilities", "incidence") else 1
kind = rng.integers(0, 3, many).astype(np.int8)
defender = np.where(kind == 2, rng.integers(0, 3, many), -1).astype(np.int32)
time_of = rng.integers(0, sc.steps + 1, many) * sc.horizon / sc.steps
noise = rng.normal(size=(4_096, 4))

def again(call):
    while True:
        call()

calls = {
    "verify": lambda: tadcore.verify(sc, deviations=500, starts=500),
    "map": lambda: tadcore.outcome_map(sc, x=(-5, 5, 4_000), y=(-5, 5, 4_000)),
    "probability map": lambda: tadcore.probability_map(study, "d3", x=(-2, 2, 200), y=(-2, 2, 200)),
    "best start": lambda: tadcore.best_start(study, "d3", x=(-2, 2), y=(-2, 2)),
    "best radii": lambda: tadcore.best_radii(study, 6.0, evaluations=10_000),
    "curve": lambda: tadcore.radius_curve(study, player="d1", radii=np.linspace(0.5, 6, 500), refine=True),
    "rare": lambda: again(lambda: tadcore.rare(near, "intercepted", error=0.02)),
    "rare paths": lambda: again(lambda: tadcore.rare(shaken, error=0.02)),
    "sweep": lambda: tadcore.sweep(study, {"attacker.control_weight": np.linspace(0.4, 2, 50)}),
    "sensitivity": lambda: tadcore.analysis.sensitivity(
        sc, {"attacker.position.x": statistics_uniform(), "attacker.position.y": statistics_uniform()},
        points=2**17, resamples=20_000),
    "probabilities": lambda: again(lambda: statistics.probabilities(kind, defender, 3, method="sequence")),
    "incidence": lambda: again(lambda: statistics.incidence(
        kind, defender, time_of, horizon=sc.horizon, step=sc.step, n=3)),
    "intervals": lambda: again(lambda: statistics.proportion_interval(
        rng.integers(0, 10**6, 10_000), 10**6, method="exact")),
}

def statistics_uniform():
    from scipy import stats
    return stats.uniform(-3, 6)

def interrupt():
    time.sleep(2.0)
    print("sent", time.monotonic(), flush=True)
    os.kill(os.getpid(), signal.SIGINT)

threading.Thread(target=interrupt, daemon=True).start()
try:
    calls[what]()
    print("finished", time.monotonic(), flush=True)
except KeyboardInterrupt:
    print("interrupted", time.monotonic(), flush=True)
os._exit(0)
"""
QUESTIONS = ["verify", "map", "probability map", "best start", "best radii", "curve", "sweep", "rare", "rare paths"]
STATISTICS = ["sensitivity", "probabilities", "incidence", "intervals"]


@pytest.mark.skipif(sys.platform == "win32", reason="signals to a process are POSIX")
@pytest.mark.parametrize("what", [*QUESTIONS, *STATISTICS])
def test_it_stops_soon(what):
    done = subprocess.run([sys.executable, "-c", CHILD, what], capture_output=True, text=True, timeout=300)
    said = dict(line.split() for line in done.stdout.splitlines())
    assert set(said) == {"sent", "interrupted"}, (done.stdout, done.stderr[-2000:])
    took = float(said["interrupted"]) - float(said["sent"])
    print(f"{what}: stopped after {took:.3f} s")
    assert took < ROOM
