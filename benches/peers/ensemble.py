"""A Monte Carlo of the paper's I1 with limited observations: SciPy, Numba, JAX and tadcore, on one thread.

n = 3, T = 6, δ = 0.005, ζ = (5, 2.25, 1.25), σ = 0.1; every coordinate of every player is uniform in [−3, 3]. Numba
has the (step, topology) table too, filled by Newton from the canonical start where an entry is missing (one descent:
it does not look for lower minima, tadcore does); the lockstep fills it by `_strong`, written out for the compiler.
`cold` starts with an empty table, Riccati not counted; `warm` plays
the same trials from the table that a first round filled. JAX is warm only, from the table that Numba filled, in batches
of 4,000. SciPy is the paper's own way, BFGS at every instant (`run.py`): a few trials, whose mean time stands for all.

How to read the table: trials per second of CPU time, the median and the best of interleaved repetitions, each with its
`ratio`, the speed of tadcore over that of the row. On a shared machine a median tells how much the repetitions were
disturbed, too, and what keeps wide registers busy is disturbed most. Every outcome, defender and time must be equal,
but for one trial in a thousand, where a distance meets a radius within rounding.
"""

import importlib.util
import time

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
        import _lockstep3

        memos = {loop: _lockstep.Memo(GAME, 400_000) for loop in (_lockstep.one_by_one, _lockstep3.lockstep3)}

    def peer(loop):
        memo = memos[loop]
        if what == "cold":
            memo.index.fill(-1)
            memo.filled = 0
        return memo.play(loop, positions, VISIBILITY, CAPTURE)

    prepared = [solved() for _ in range(repetitions + 1)] if what == "cold" else []
    own = (lambda: tadcore_play(prepared.pop(), positions)) if what == "cold" else lambda: tadcore_play(core, positions)
    contenders = {"tadcore": own}
    for label, loop in zip(("Numba, trial after trial", "Numba, lockstep"), memos, strict=False):
        contenders[label] = lambda loop=loop: peer(loop)
    times, answers = _side.interleave(contenders, repetitions)
    own_time = times["tadcore"]
    for name, answer in answers.items():
        if name != "tadcore":
            apart = np.any([a != b for a, b in zip(answer[:2], answers["tadcore"][:2], strict=True)], axis=0)
            apart |= np.abs(answer[2] - answers["tadcore"][2]) > 1e-9
            _side.agree(f"{what}, {name}, share of trials that differ", float(np.mean(apart)), 1e-3)
    rows = [
        (
            f"{what}, {trials:,} trials: {name}",
            f"{trials / t.cpu:,.0f}",
            f"{t.cpu / own_time.cpu:,.2f}",
            f"{trials / t.best:,.0f}",
            f"{t.best / own_time.best:,.2f}",
        )
        for name, t in times.items()
    ]
    if memos and what == "warm":
        rows += jax_row(memos[_lockstep3.lockstep3], positions, answers["tadcore"], own_time.best / trials)
    return rows


def jax_row(memo, positions, ours, best: float) -> list[tuple[str, ...]]:
    """One batch in JAX, the faster of two plays after one that compiles; `best` is tadcore's least time for a trial."""
    if not importlib.util.find_spec("jax"):
        print("JAX row left out: JAX is not installed (pip install '.[bench]')")
        return []
    import _jax

    taken, each = positions[: _jax.BATCH], []
    for _ in range(3):
        began = time.process_time()
        answer = _jax.play(memo, taken, VISIBILITY, CAPTURE)
        each.append((time.process_time() - began) / len(taken))
    apart = np.any([a != b[: len(taken)] for a, b in zip(answer[:2], ours[:2], strict=True)], axis=0)
    apart |= np.abs(answer[2] - ours[2][: len(taken)]) > 1e-9
    _side.agree("warm, JAX, share of trials that differ", float(np.mean(apart)), 1e-3)
    least = min(each[1:])
    return [(f"warm, {len(taken):,} trials: JAX, scan and vmap", "", "", f"{1 / least:,.0f}", f"{least / best:,.2f}")]


def papers_way(trials: int, best: float) -> tuple[str, ...]:
    """SciPy on the first trials, against the CPU seconds that a trial takes tadcore cold."""
    import run

    core, positions = solved(), starts(trials)
    began = time.process_time()
    theirs = [run.scipy_run(start)[0] for start in positions]
    each = (time.process_time() - began) / trials
    kind, defender, when, *_ = tadcore_play(core, positions)
    named = [("timeout", "captured", f"d{d + 1} intercepts")[k] for k, d in zip(kind, defender, strict=True)]
    apart = [a != (b[0], b[1]) for a, b in zip(zip(named, when, strict=True), theirs, strict=True)]
    _side.agree(f"SciPy, share of {trials} trials that differ", float(np.mean(apart)), 0.0)
    return f"cold, SciPy the paper's way, {trials} trials", f"{1 / each:,.3f}", f"{each / best:,.0f}", "", ""


def main() -> None:
    quick = _side.start(__doc__)
    # First, before JAX has threads of its own.
    threaded(50 if quick else 200_000)
    numba = _side.numba_wanted(quick)
    rows = compare("cold", 50 if quick else 1_000, 1 if quick else 5, numba)
    rows += compare("warm", 50 if quick else 20_000, 1 if quick else 15, numba)
    if not quick:
        rows.append(papers_way(3, 1.0 / float(rows[0][1].replace(",", ""))))
    _side.table(("contender", "trials/s", "ratio", "best", "ratio"), rows)


def threaded(trials: int) -> None:
    """One and two threads, warm, by the wall clock, the best of six rounds; the bits must be equal."""
    core, positions = solved(), starts(trials)
    best, answers = {}, {}
    # The first fills the table and is not counted.
    for round_, threads in enumerate((1, *(1, 2) * 6)):
        began = time.perf_counter()
        answers[threads] = core.simulate_batch(positions, VISIBILITY[None], CAPTURE[None], threads=threads)
        if round_:
            best[threads] = min(best.get(threads, np.inf), time.perf_counter() - began)
    print(f"\nwall clock, {trials:,} trials: one thread {trials / best[1]:,.0f} a second, two {trials / best[2]:,.0f},")
    print(f"ratio {best[1] / best[2]:.2f}; table {core.table()}")
    apart = max(float(np.mean(a != b)) for a, b in zip(answers[1], answers[2], strict=True))
    _side.agree("one and two threads, share of trials that differ", apart, 0.0)


if __name__ == "__main__":
    main()
