"""One run, the paper's I1 with limited observations: SciPy the paper's way, tadcore cold.

n = 3, r_d = (1, 1, 1), r_τ = 1.2, r_a = 0.8, T = 6, δ = 0.005, ζ = (5, 2.25, 1.25), everything else 1. SciPy's side is
what the paper describes: `solve_ivp` for the Riccati equations in 2N × 2N blocks; at every instant BFGS on the
2 × 2 blocks of the gains, warm-started from the instant before (from the projected equilibrium rows where the network
has just changed and the unknowns with it); `scipy.linalg.expm` of the frozen closed loop. tadcore is cold: a new game
each time, Riccati and every synthesis included, everything recorded.

How to read the table: times are medians over interleaved repetitions, CPU time of the process and wall clock, `ratio`
the CPU time over that of tadcore's cold run. `tadcore, warm` is the same run from the table that the cold one filled,
`tadcore, Riccati` a new game's equilibrium alone; the line below the table is what remains of the cold run for each
synthesis. Outcome, time and network changes must be equal and the paper's own, the trajectories within 1e-6 of each
other, or the script ends with an error.
"""

import _paper
import _side
import numpy as np
from scipy.linalg import expm

GAME = _side.Game((1.0, 1.0, 1.0), horizon=6.0, step=0.005)
POSITIONS = np.array([[0.0, 0.0], [1.0, 1.5], [-1.0, 0.0], [0.0, 1.0], [-2.0, 2.0]])  # d1, d2, d3, target, attacker
VISIBILITY = np.array([5.0, 2.25, 1.25])
CAPTURE = np.full(4, 0.1)  # d1, d2, d3, attacker
PRINTED = ("d1 intercepts", 1.395, (0.16, 0.49, 0.575, 0.915, 0.96))


def network(positions: np.ndarray) -> np.ndarray:
    """The augmented adjacency: entry (i, j) is player j seen by d_i, entry (i, i) the attacker."""
    n = GAME.n
    far = np.linalg.norm(positions[:n, None] - positions[None], axis=-1)
    far[np.arange(n), np.arange(n)] = far[:, -1]
    return far[:, :-1] <= VISIBILITY[:, None]


def ended(positions: np.ndarray) -> str | None:
    """How the game ends in this state: the nearest defender first, then the attacker."""
    far = np.linalg.norm(positions[:-1] - positions[-1], axis=-1)
    within = [i for i in range(GAME.n) if far[i] <= CAPTURE[i]]
    if within:
        return f"d{min(within, key=lambda i: far[i]) + 1} intercepts"
    return "captured" if far[-1] <= CAPTURE[-1] else None


def scipy_run(start: np.ndarray = POSITIONS):
    """Outcome, time, instants of change and positions at every instant."""
    n, N = GAME.n, GAME.n + 1
    P = _paper.riccati(GAME, 2)
    times, changes, path = GAME.times, [], [start]
    seen = gains = None
    for k in range(GAME.steps + 1):
        positions = path[-1]
        outcome = ended(positions) or ("timeout" if k == GAME.steps else None)
        if outcome:
            return (outcome, float(times[k]), tuple(float(times[c]) for c in changes)), np.array(path)
        theta, before, seen = _paper.Theta(GAME, P[:, k, ::2, ::2], 2), seen, network(positions)
        if before is None or np.any(before != seen):
            if before is not None:
                changes.append(k)
            gains = None
        gains = theta.bfgs(seen, gains)
        feedback = np.zeros((2 * (N + 1), 2 * N))
        feedback[: 2 * n] = theta.rows(gains, seen)
        feedback[2 * n : 2 * N] = -P[1, k, 2 * n :] / GAME.r_tau
        feedback[2 * N :] = P[2, k].reshape(N, 2, 2 * N).sum(axis=0) / GAME.r_a
        loop = np.zeros((2 * (N + 1), 2 * (N + 1)))  # z, then the attacker's own position
        loop[: 2 * N, : 2 * N] = feedback[: 2 * N] - np.tile(feedback[2 * N :], (N, 1))
        loop[2 * N :, : 2 * N] = feedback[2 * N :]
        state = np.vstack([positions[:-1] - positions[-1], positions[-1]]).ravel()
        state = (expm(GAME.step * loop) @ state).reshape(N + 1, 2)
        path.append(np.vstack([state[:-1] + state[-1], state[-1]]))
    raise AssertionError("a run ends at T")


def play(core):
    return core.simulate(POSITIONS, VISIBILITY, CAPTURE)


def summary(record):
    """The same three of a record of tadcore."""
    kind = ("timeout", "captured", f"d{record.defender + 1} intercepts")[record.kind]
    changed = np.any(record.adjacency[1:-1] != record.adjacency[:-2], axis=(1, 2))
    return kind, float(record.time), tuple(float(t) for t in record.times[1:-1][changed])


def main() -> None:
    quick = _side.start(__doc__)
    warm = GAME.core()
    peer = "SciPy, the paper's way"
    times, answers = _side.interleave({peer: scipy_run, "cold": lambda: play(GAME.core())}, 1 if quick else 5)
    own = {
        "tadcore, cold": lambda: play(GAME.core()),
        "tadcore, warm": lambda: play(warm),
        "tadcore, Riccati": lambda: GAME.core().equilibrium(),
    }
    parts, _ = _side.interleave(own, 5 if quick else 60)
    cold = parts["tadcore, cold"].cpu
    rows = [
        (name, f"{1e3 * t.cpu:.2f}", f"{1e3 * t.wall:.2f}", f"{t.cpu / cold:,.2f}")
        for name, t in {peer: times[peer], **parts}.items()
    ]
    _side.table(("contender", "CPU ms", "wall ms", "ratio"), rows)
    (theirs, path), record = answers[peer], answers["cold"]
    left = cold - parts["tadcore, warm"].cpu - parts["tadcore, Riccati"].cpu
    instants = len(record.times) - 1
    each = 1e6 * left / instants
    print(f"{instants} instants, {record.iterations} Newton steps: {each:.1f} µs for each synthesis and expm")
    ours = summary(record)
    print(f"SciPy   {theirs}\ntadcore {ours}\nprinted {PRINTED}")
    same = ours[0] == theirs[0] == PRINTED[0] and len(ours[2]) == len(theirs[2]) == len(PRINTED[2])
    gap = np.inf
    if same:
        gap = max(np.max(np.abs(np.array([r[1], *r[2]]) - [PRINTED[1], *PRINTED[2]])) for r in (ours, theirs))
    _side.agree("outcome, time and network changes", gap, 1e-9)
    _side.agree("positions at every instant", np.max(np.abs(path - record.position)), 1e-6)


if __name__ == "__main__":
    main()
