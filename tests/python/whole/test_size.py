"""Large games: solved, or refused by size before anything is allocated; never an interpreter that ends.

What may end the process runs in a child. The gains of a sparse network are measured against Θ and its gradient as the
paper prints them (eq:errfun1, eq:errgradient), written out here.
"""

import json
import math
import re
import resource
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import tadcore
from tadcore import OutOfMemoryError, ScenarioError


def crowd(n, zeta=math.inf, interaction="I1", horizon=0.05, step=0.005, seed=0):
    """n defenders at random on a square on which each has about one neighbour within 0.56."""
    places = np.random.default_rng(seed).uniform(0.0, math.sqrt(n), (n, 2))
    defender = {"control_weight": 1.0, "capture_radius": 1e-3, "visibility_radius": zeta}
    own = {"visibility_radius": zeta} if interaction == "I2" else {}
    return tadcore.Scenario.model_validate(
        {
            "interaction": interaction,
            "horizon": horizon,
            "step": step,
            "attacker": {"position": [-1.0, -1.0], "control_weight": 0.8, "capture_radius": 1e-3},
            "target": {"position": [math.sqrt(n) / 2] * 2, "control_weight": 1.2, **own},
            "defenders": [{**defender, "position": place} for place in places.tolist()],
        }
    )


@pytest.mark.parametrize("interaction", ["I1", "I2"])
def test_full_sight_costs_no_synthesis(interaction):
    """Every row is the equilibrium's: −P_d[i, :]/r_i in I1, P[i, :]/r_i in I2, here with r_i = 1 but the target's."""
    sc = crowd(260, interaction=interaction, horizon=1e-4, step=1e-4)
    run = tadcore.simulate(sc)
    assert run.outcome.kind == "timeout"
    assert (run.iterations, run.certified) == (0, 2)
    P = tadcore.solve_equilibrium(sc).P
    rows = -P["defenders"][0][:260] if interaction == "I1" else P["team"][0] / np.array([*[1.0] * 260, 1.2])[:, None]
    assert np.allclose(run.gains[0], rows, rtol=1e-14, atol=0)
    assert run.theta[0] <= 1e-20 * np.linalg.norm(rows) ** 4
    assert tadcore.simulate_batch(sc, [sc.positions] * 2)[1] == run.outcome
    found = tadcore.synthesize(sc, step=0, adjacency=tadcore.VisibilityNetwork.from_positions(sc))
    assert (found.rows == run.gains[0]).all()
    assert found.certified_blocks


def theta_and_gradient(sc, P, G):
    """Θ₁ and its gradient in reduced factors; Θ₁ = Σ γ‖·‖² of ΔQ_d, ΔQ_τ, ΔQ_a and S₁."""
    n, r = sc.n, np.array([d.control_weight for d in sc.defenders])
    first, second, third, fourth = sc.synthesis_weights
    B, D = np.eye(n + 1)[:, :n], np.diag(r)
    S = B.T @ P["defenders"] + D @ G
    dQ = G.T @ D @ G - P["defenders"] @ B @ np.diag(1 / r) @ B.T @ P["defenders"]
    value, slope = first * (dQ**2).sum() + fourth * (S**2).sum(), 4 * first * D @ G @ dQ + 2 * fourth * D @ S
    for weight, name in ((second, "target"), (third, "attacker")):
        half = P[name] @ B @ np.diag(1 / r) @ S
        both = -half - half.T
        value += weight * (both**2).sum()
        slope -= 4 * weight * B.T @ P[name] @ both
    return value, slope


@pytest.mark.parametrize("seed", range(3))
def test_a_sparse_network_of_sixty_is_solved(seed):
    sc = crowd(60, zeta=1.2, seed=seed)
    network = tadcore.VisibilityNetwork.from_positions(sc)
    assert 100 < network.adjacency.sum() < 500
    P = {name: p[0] for name, p in tadcore.solve_equilibrium(sc).P.items()}
    found = tadcore.synthesize(sc, step=0, adjacency=network)
    value, slope = theta_and_gradient(sc, P, found.rows)
    assert found.converged
    assert found.theta == pytest.approx(value, rel=1e-11)
    scale, seen = np.abs(slope).max(), network.adjacency
    assert scale > 1.0  # towards players that are not seen it falls
    for i in range(sc.n):
        others = [j for j in range(sc.n + 1) if j != i and seen[i, j]]
        unseen = [j for j in range(sc.n + 1) if j != i and not seen[i, j]]
        assert (found.rows[i, unseen] == 0).all()
        own = slope[i, i] if seen[i, i] else 0.0
        if not seen[i, i]:
            assert abs(found.rows[i].sum()) <= 1e-12 * np.abs(found.rows[i]).max(initial=1e-300)
        along = slope[i, others] - (0.0 if seen[i, i] else slope[i, i])
        assert np.abs([own, *along]).max() < 1e-8 * scale


CHILD = """
import json, math, sys, time
sys.path[:0] = json.loads(sys.argv[1])
import numpy as np, resource, tadcore
from whole.test_size import crowd, within
"""


def within(room):
    """Limits the address space to what is in use and some more."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + room,) * 2)


def child(code, timeout=120):
    """What a child that must not be ended prints."""
    command = [sys.executable, "-c", CHILD + code, json.dumps([p for p in sys.path if p])]
    done = subprocess.run(command, capture_output=True, text=True, timeout=timeout)
    assert done.returncode == 0, (done.returncode, done.stderr[-2000:])
    return done.stdout.split("\n")[:-1]


@pytest.mark.parametrize(
    "call",
    [
        "tadcore.simulate(sc)",
        "tadcore.simulate_batch(sc, [sc.positions])",
        "tadcore.synthesize(sc, step=0, adjacency=tadcore.VisibilityNetwork.from_positions(sc))",
        "tadcore.synthesize(sc, step=0, method='descent', adjacency=tadcore.VisibilityNetwork.from_positions(sc))",
    ],
)
def test_what_is_too_large_is_refused_by_its_size(call):
    """260 defenders of whom each sees all but a few: 67,000 unknowns, and a matrix of their pairs."""
    printed = child(f"""
sc = crowd(260, zeta=15.0, horizon=1e-4, step=1e-4)
tadcore.solve_equilibrium(sc)
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
start = time.monotonic()
try:
    {call}
except tadcore.OutOfMemoryError as error:
    print(error.size, error.limit)
    print(error)
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
""")
    sc = crowd(260, zeta=15.0)
    unknowns = int(tadcore.VisibilityNetwork.from_positions(sc).adjacency.sum())
    size, limit = map(int, printed[0].split())
    assert size >= 8 * unknowns**2 > limit == 4 << 30
    assert "the synthesis of the gains under one network" in printed[1]
    assert f"{size:,} bytes" in printed[1]
    assert int(printed[2]) < 300_000  # kB


def test_the_command_line_refuses_in_one_line(tmp_path):
    crowd(260, zeta=15.0, horizon=1e-4, step=1e-4).to_toml(tmp_path / "crowd.toml")
    command = [sys.executable, "-m", "tadcore", "simulate", str(tmp_path / "crowd.toml")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.returncode == 1
    assert done.stderr.count("\n") <= 3
    assert re.search(r"the gains under one network: [\d,]+ bytes", " ".join(done.stderr.split()))


def test_a_short_game_of_four_hundred_is_played():
    """T = δ = 1e-6 and nobody sees anyone: no gain, no unknown."""
    sc = crowd(400, zeta=0.01, interaction="I2", horizon=1e-6, step=1e-6)
    run = tadcore.simulate(sc)
    assert (run.gains == 0).all()
    assert run.certified == 2


def test_a_thousand_defenders_are_a_scenario_and_their_grid_is_refused_by_size():
    sc = crowd(1000, horizon=6.0)
    with pytest.raises(ScenarioError, match=r"1201|1200 steps of 1001 players, \d+ GiB"):
        tadcore.simulate(sc)


@pytest.mark.skipif(sys.platform != "linux", reason="limits the address space")
@pytest.mark.parametrize(
    ("make", "call", "room"),
    [
        ("crowd(60, interaction='I2', horizon=0.004, step=4e-6)", "tadcore.simulate(sc)", 24),
        ("crowd(10, horizon=30.0, step=0.0005)", "tadcore.solve_equilibrium(sc).P", 60),
        ("crowd(10, horizon=30.0, step=0.0005)", "tadcore.solve_equilibrium(sc)._core.feedback()", 20),
        ("crowd(300, horizon=1e-4, step=1e-4)", "tadcore.simulate(sc)", 24),
        ("crowd(300, horizon=1e-4, step=1e-4)", "tadcore.simulate(sc)", 30),
        ("crowd(300, interaction='I2', horizon=1e-4, step=1e-4)", "tadcore.simulate(sc)", 10),
        ("crowd(40, zeta=3.0)", "tadcore.simulate_batch(sc, np.repeat([sc.positions], 50_000, 0))", 60),
        (  # 40,401 chains for each of 200 trials
            "crowd(200, 0.01, 'I2', 1e-4, 1e-4).replace({'sensing': {'mean_time_detected': 1.0}})",
            "tadcore.simulate_batch(sc, np.repeat([sc.positions], 200, 0), threads=1)",
            30,
        ),
    ],
)
def test_a_system_without_memory_is_an_error(make, call, room):
    printed = child(f"""
sc = {make}
game = tadcore.game.compiled.game_of(sc)
if {"(300" not in make!r}:
    game.equilibrium()
within({room} << 20)
try:
    {call}
except MemoryError as error:
    print("refused", type(error).__name__, str(error)[:100])
""")
    assert printed[0].startswith("refused"), printed


@pytest.mark.skipif(sys.platform != "linux", reason="limits the address space")
def test_a_system_without_threads_is_an_error():
    """Without memory for a thread's stack there is no thread."""
    printed = child("""
sc = tadcore.scenarios.load("paper-i1")
calls = [tadcore.simulate, lambda sc: tadcore.simulate_batch(sc, [sc.positions] * 64, threads=2)]
game = tadcore.game.compiled.game_of(sc)
within(1 << 20)
for call in calls:
    try:
        call(sc)
    except tadcore.TadcoreError as error:
        print(error)
""")
    assert len(printed) == 2
    assert all("thread" in line for line in printed), printed


@pytest.mark.skipif(sys.platform != "linux", reason="limits the address space")
@pytest.mark.parametrize("room", [86, 148])
def test_a_batch_without_room_for_its_threads_is_played_in_fewer(room):
    """An allocator takes some 64 MiB of addresses for a thread; where they end, the process had been ended."""
    printed = child(f"""
sc = crowd(8, zeta=2.0, horizon=0.1, step=0.01)
starts = np.repeat([sc.positions], 8000, 0)
starts += np.random.default_rng(0).normal(scale=0.1, size=starts.shape)
one = tadcore.simulate_batch(sc, starts[:500], threads=1)
within({room} << 20)
found = tadcore.simulate_batch(sc, starts, threads=4)
print((found.kind[:500] == one.kind).all() and (found.time[:500] == one.time).all())
""")
    assert printed == ["True"]


def test_more_threads_than_work_are_not_started():
    sc = tadcore.scenarios.load("paper-i1")
    positions = np.random.default_rng(0).uniform(-2, 2, (50, 5, 2))
    one = tadcore.simulate_batch(sc, positions, threads=1)
    start = time.monotonic()
    many = tadcore.simulate_batch(sc, positions, threads=65_536)
    assert time.monotonic() - start < 2.0
    assert (many.kind == one.kind).all()
    assert (many.time == one.time).all()


def test_the_error_says_who_asked_for_how_much():
    error = OutOfMemoryError("the record of one run", 3 << 30, 2 << 30)
    assert isinstance(error, MemoryError)
    assert str(error).startswith("the record of one run: 3,221,225,472 bytes (3.0 GiB), more than the limit of 2.0 GiB")
    assert "which the system would not give" in str(OutOfMemoryError("P on the grid", 1 << 40))
