"""Ctrl-C in the middle of a batch and of a study, cold and warm, small and large games; and of every long computation.

The rule is 0.2 s on a quiet machine. The measured time is printed; what is asserted leaves room for a busy one.
"""

import signal
import subprocess
import sys
import time

import pytest

ROOM = 2.0
CHILD = """
import signal, sys, time
import numpy as np
import tadcore
from tadcore.sampling import Box

signal.signal(signal.SIGINT, signal.default_int_handler)  # who starts us in the background may ignore it
n, what, how = int(sys.argv[1]), sys.argv[2], sys.argv[3]
defender = {"control_weight": 1.0, "capture_radius": 0.02, "visibility_radius": 1.5}
sc = tadcore.Scenario.model_validate({
    "interaction": "I1", "horizon": 2.0, "step": 0.01,
    "attacker": {"position": [-2.0, 2.0], "control_weight": 0.8, "capture_radius": 0.02},
    "target": {"position": [0.0, 1.0], "control_weight": 1.2},
    "defenders": [{**defender, "position": [0.3 * i, -0.2 * i]} for i in range(n)],
})
tadcore.solve_equilibrium(sc)
rng = np.random.default_rng(1)
if how == "warm":  # few different starts, many times each: everything is tabulated, and only stepped
    few = rng.uniform(-2.0, 2.0, (20, n + 2, 2))
    tadcore.simulate_batch(sc, few, threads=1)
    positions = np.tile(few, (40_000, 1, 1))
else:
    positions = rng.uniform(-2.0, 2.0, (200_000, n + 2, 2))
study = tadcore.Study(sc, vary={"*.position": Box([-2.0, -2.0], [2.0, 2.0])}, trials=2_000_000)
print("ready", flush=True)
try:
    if what == "batch":
        while True:
            tadcore.simulate_batch(sc, positions, threads=2)
    study.run(threads=2)
except KeyboardInterrupt:
    print("interrupted", time.monotonic(), flush=True)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="signals to a process are POSIX")
@pytest.mark.parametrize(
    ("n", "what", "how"), [(3, "batch", "cold"), (8, "batch", "cold"), (3, "batch", "warm"), (3, "study", "cold")]
)
def test_it_stops_soon(n, what, how):
    child = subprocess.Popen([sys.executable, "-c", CHILD, str(n), what, how], stdout=subprocess.PIPE, text=True)
    with child:
        assert child.stdout.readline() == "ready\n"
        time.sleep(0.3)
        assert child.poll() is None
        sent = time.monotonic()
        child.send_signal(signal.SIGINT)
        try:
            said, at = child.communicate(timeout=60.0)[0].split()
        finally:
            child.kill()
    assert said == "interrupted"
    print(f"n = {n}, {what}, {how}: stopped after {float(at) - sent:.3f} s")
    assert float(at) - sent < ROOM


LONG = """
import os, signal, sys, threading, time
import numpy as np
import tadcore

signal.signal(signal.SIGINT, signal.default_int_handler)
what, n = sys.argv[1], int(sys.argv[2])
rng = np.random.default_rng(3)
zeta = 0.7 * n**0.5 if what != "equilibrium" else float("inf")
second = what.endswith("I2")
defender = {"control_weight": 1.0, "capture_radius": 0.001, "visibility_radius": zeta}
steps, horizon = {"P": 100_000}.get(what, 10), 0.005 if what == "newton-I2" else 0.05
sc = tadcore.Scenario.model_validate({
    "interaction": "I2" if second else "I1", "horizon": horizon, "step": horizon / steps,
    "attacker": {"position": [-1.0, -1.0], "control_weight": 0.8, "capture_radius": 0.001},
    "target": {"position": [1.0, 1.0], "control_weight": 1.2, **({"visibility_radius": zeta} if second else {})},
    # Not two alike: P of equal defenders is that of a small game.
    "defenders": [
        {**defender, "position": p, "control_weight": 1.0 + 1e-5 * i if what.startswith("equilibrium") else 1.0}
        for i, p in enumerate(rng.uniform(0, n**0.5, (n, 2)).tolist())
    ],
})
network = tadcore.VisibilityNetwork.from_positions(sc)
if what not in ("equilibrium", "equilibrium-I2"):
    solved = tadcore.solve_equilibrium(sc)

def endless():
    # A thread that changes the radii while they are in use: the call has its own.
    radii = np.full((2_000, n), zeta)
    threading.Thread(target=lambda: [radii.__imul__(-1.0) for _ in iter(int, 1)], daemon=True).start()
    positions = np.repeat([sc.positions], 2_000, 0)
    while True:
        try:
            tadcore.simulate_batch(sc, positions, radii)
        except tadcore.ScenarioError:
            pass

def again(call):
    while True:
        call()

calls = {
    "newton": lambda: tadcore.synthesize(sc, step=0, adjacency=network),
    "newton-I2": lambda: tadcore.synthesize(sc, step=0, adjacency=network),
    "descent": lambda: again(lambda: tadcore.synthesize(sc, step=0, adjacency=network, method="descent")),
    "equilibrium": lambda: again(lambda: tadcore.solve_equilibrium(sc.replace({"horizon": 50.0, "step": 5.0}))),
    "equilibrium-I2": lambda: again(lambda: tadcore.solve_equilibrium(sc)),
    "residual": lambda: again(solved._core.residual),
    "P": lambda: again(lambda: solved._core.P),
    "run": lambda: again(lambda: tadcore.simulate(sc)),
    "batch": lambda: tadcore.simulate_batch(sc, np.repeat([sc.positions], 64, 0) + rng.normal(size=(64, n + 2, 2))),
    "threads": lambda: again(lambda: tadcore.simulate_batch(
        sc, np.repeat([sc.positions], 200_000, 0) + rng.normal(size=(200_000, n + 2, 2)), threads=65_536)),
    "radii": endless,
    "verify": lambda: again(lambda: tadcore.verify(sc)),
}
# SIGINT comes from a thread of the process itself, so that it comes after the work has begun.
def interrupt():
    time.sleep(1.0)
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


@pytest.mark.skipif(sys.platform == "win32", reason="signals to a process are POSIX")
@pytest.mark.parametrize(
    ("what", "n"),
    [
        ("newton", 40),
        ("newton", 90),
        ("newton-I2", 60),
        ("descent", 60),
        ("equilibrium", 300),
        ("equilibrium-I2", 500),
        ("residual", 200),
        ("P", 12),
        ("run", 60),
        ("batch", 30),
        ("threads", 3),
        ("radii", 3),
    ],
)
def test_every_long_computation_stops_soon(what, n):
    done = subprocess.run([sys.executable, "-c", LONG, what, str(n)], capture_output=True, text=True, timeout=300)
    said = dict(line.split() for line in done.stdout.splitlines())
    assert set(said) == {"sent", "interrupted"}, (done.stdout, done.stderr[-2000:])
    took = float(said["interrupted"]) - float(said["sent"])
    print(f"{what}, n = {n}: stopped after {took:.3f} s")
    assert took < ROOM
