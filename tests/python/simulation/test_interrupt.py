"""Ctrl-C in the middle of a batch and of a study: cold and warm, small and large games.

The rule is 0.2 s on a quiet machine. The measured time is printed; what is asserted leaves room for a busy one.
"""

import signal
import subprocess
import sys
import time

import pytest

pytest.importorskip("tadcore._core")
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
