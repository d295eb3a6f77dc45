"""A Monte Carlo of the paper's I1 with limited observations: Numba with a table, and tadcore, on one thread.

n = 3, T = 6, δ = 0.005, ζ = (5, 2.25, 1.25), σ = 0.1; every coordinate of every player is uniform in [−3, 3]. Numba
has the (step, topology) table too, filled by Newton from the canonical start where an entry is missing (one descent:
it does not look for lower minima, tadcore does). `cold` starts with an empty table, Riccati not counted; `warm` plays
the same trials from the table that a first round filled. The paper's own way, SciPy at every instant, is `run.py`: it
takes about ten seconds a trial.

How to read the table: medians over interleaved repetitions, trials per second of CPU time, `ratio` the speed of tadcore
over that of the row. Every outcome, defender and time must be equal, but for one trial in a thousand, where a distance
meets a radius within rounding.
"""

import _side
import numpy as np

GAME = _side.Game((1.0, 1.0, 1.0), horizon=6.0, step=0.005)
VISIBILITY = np.array([5.0, 2.25, 1.25])
CAPTURE = np.full(4, 0.1)


def starts(trials: int) -> np.ndarray:
    """Positions d1, d2, d3, target, attacker."""
    return np.random.default_rng(7).uniform(-3.0, 3.0, (trials, GAME.n + 2, 2))


def tadcore_play(core, positions: np.ndarray):
    return core.simulate_batch(positions, VISIBILITY[None], CAPTURE[None], threads=1)


def solved():
    """A game with its equilibrium and an empty table."""
    core = GAME.core()
    core.equilibrium()
    return core


def compare(what: str, trials: int, repetitions: int, numba: bool) -> list[tuple[str, ...]]:
    """One block of the table: cold or warm."""
    positions = starts(trials)
    core = solved()
    memos = {}
    if numba:
        import _lockstep

        memos = {name: _lockstep.Memo(GAME, 400_000) for name in ("one_by_one", "lockstep")}

    def peer(name: str):
        memo = memos[name]
        if what == "cold":
            memo.index.fill(-1)
            memo.filled = 0
        return memo.play(getattr(_lockstep, name), positions, VISIBILITY, CAPTURE)

    prepared = [solved() for _ in range(repetitions + 1)] if what == "cold" else []
    own = (lambda: tadcore_play(prepared.pop(), positions)) if what == "cold" else lambda: tadcore_play(core, positions)
    contenders = {"tadcore": own}
    for name, label in (("one_by_one", "Numba, trial after trial"), ("lockstep", "Numba, lockstep")):
        if name in memos:
            contenders[label] = lambda name=name: peer(name)
    times, answers = _side.interleave(contenders, repetitions)
    best = times["tadcore"].cpu
    for name, answer in answers.items():
        if name != "tadcore":
            apart = np.any([a != b for a, b in zip(answer[:2], answers["tadcore"][:2], strict=True)], axis=0)
            apart |= np.abs(answer[2] - answers["tadcore"][2]) > 1e-9
            _side.agree(f"{what}, {name}, share of trials that differ", float(np.mean(apart)), 1e-3)
    return [
        (f"{what}, {trials:,} trials: {name}", f"{trials / t.cpu:,.0f}", f"{t.cpu / best:,.2f}")
        for name, t in times.items()
    ]


def main() -> None:
    quick = _side.start(__doc__)
    numba = _side.numba_wanted(quick)
    rows = compare("cold", 50 if quick else 1_000, 1 if quick else 3, numba)
    rows += compare("warm", 50 if quick else 20_000, 1 if quick else 9, numba)
    _side.table(("contender", "trials/s", "ratio"), rows)
    threaded(50 if quick else 200_000)


def threaded(trials: int) -> None:
    """One and two threads, warm, by the wall clock; the bits must be equal."""
    import time

    core, positions = solved(), starts(trials)
    best, answers = {}, {}
    for threads in (1, 1, 2, 1, 2):
        began = time.perf_counter()
        answers[threads] = core.simulate_batch(positions, VISIBILITY[None], CAPTURE[None], threads=threads)
        best[threads] = min(best.get(threads, np.inf), time.perf_counter() - began)
    print(f"\nwall clock, {trials:,} trials: one thread {trials / best[1]:,.0f} a second, two {trials / best[2]:,.0f},")
    print(f"ratio {best[1] / best[2]:.2f}; table {core.table()}")
    apart = max(float(np.mean(a != b)) for a, b in zip(answers[1], answers[2], strict=True))
    _side.agree("one and two threads, share of trials that differ", apart, 0.0)


if __name__ == "__main__":
    main()
