"""A fork while another thread plays or solves: the child, which has none of those threads, plays all the same."""

import json
import os
import subprocess
import sys

import pytest

CODE = """
import os, signal, sys, threading, time
import numpy as np
import tadcore

what = sys.argv[1]
sc = tadcore.scenarios.load("paper-i1")
positions = np.random.default_rng(2).uniform(-2.0, 2.0, (20_000, 5, 2))
fine = 6.0 / 400_000  # solving takes a while

def play():
    while True:
        tadcore.simulate_batch(sc, positions, threads=2)

# What Python imports when it is first needed it imports now: locks of imports are its own.
tadcore.simulate_batch(sc, positions[:1])
tadcore.simulate(sc)
tadcore.solve_equilibrium(sc)
if what == "play":
    threading.Thread(target=play, daemon=True).start()
for k in range(3):
    if what == "solve":
        sc = sc.replace({"attacker.control_weight": 0.8 + 0.01 * k, "step": fine})
        threading.Thread(target=lambda: tadcore.solve_equilibrium(sc), daemon=True).start()
    time.sleep(0.03 + 0.06 * k)
    child = os.fork()
    if child == 0:
        if what == "play":
            run = tadcore.simulate(sc)
            ends = tadcore.simulate_batch(sc, positions[:50], threads=2)
            os._exit(7 if len(ends) == 50 and run.outcome.time == 1.395 else 1)
        os._exit(7 if np.isfinite(tadcore.solve_equilibrium(sc).P["target"][0]).all() else 1)
    deadline = time.monotonic() + 60.0
    while True:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            break
        if time.monotonic() > deadline:
            os.kill(child, signal.SIGKILL)
            print("hangs", flush=True)
            os._exit(1)
        time.sleep(0.01)
    print(os.waitstatus_to_exitcode(status), flush=True)
os._exit(0)
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork")
@pytest.mark.parametrize("what", ["play", "solve"])
def test_a_child_of_a_fork_does_not_hang(what):
    command = [sys.executable, "-c", CODE, what]
    done = subprocess.run(command, capture_output=True, text=True, timeout=420)
    assert done.stdout.split() == ["7"] * 3, (done.stdout, done.stderr[-2000:])


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork")
def test_a_quiet_table_is_inherited():
    """Where nobody held anything the child reads the parent's table."""
    code = """
import json, os, numpy as np, tadcore
sc = tadcore.scenarios.load("paper-i1").replace({"step": 0.05})
positions = np.random.default_rng(2).uniform(-2.0, 2.0, (500, 5, 2))
tadcore.simulate_batch(sc, positions)
game = tadcore.game.compiled.game_of(sc)
before = game.table()
read, write = os.pipe()
if os.fork() == 0:
    tadcore.simulate_batch(sc, positions)
    os.write(write, json.dumps([before, game.table()]).encode())
    os._exit(0)
os.wait()
print(os.read(read, 10_000).decode())
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    before, after = json.loads(done.stdout)
    assert before["entries"] == after["entries"] > 100
    assert after["misses"] == before["misses"]
