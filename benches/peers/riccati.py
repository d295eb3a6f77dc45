"""Riccati on the grid of 1,201 nodes: SciPy on the paper's blocks, SciPy reduced, Numba, tadcore.

The game is I1 with r_d = 0.8 + 0.4 (i mod 3), r_τ = 1.2, r_a = 0.8, T = 6, δ = 0.005, everything else 1; it has an
equilibrium at every size shown. Every contender returns P at every node, from nothing: tadcore gets a new game each
time, because a game keeps what it has solved. The tolerance of the peers, 1e-12, is the loosest power of ten at which
they are 1e-10 accurate at the nodes.

How to read the table: times are medians over interleaved repetitions (the quick contenders by themselves and more
often, lest the slow ones empty their caches), CPU time of the process and wall clock; `ratio` is the peer's CPU time
over tadcore's; `difference` is the largest relative difference (Frobenius) between its P and tadcore's, over nodes and
groups. A difference above 1e-10 ends the script with an error.
"""

from functools import partial

import _paper
import _side
import numpy as np

SIZES = ((3, 15), (10, 7), (30, 3))


def main() -> None:
    quick = _side.start(__doc__)
    numba = _side.numba_wanted(quick)
    rows, worst = [], 0.0
    for n, repetitions in SIZES[:1] if quick else SIZES:
        game = _side.varied_game(n, horizon=6.0, step=0.005)
        slow = {
            "SciPy DOP853, 2N × 2N": partial(_paper.riccati, game, 2),
            "SciPy DOP853, reduced": partial(_paper.riccati, game, 1),
        }
        fast = {}
        if numba:
            import _numba

            fast["Numba DOP853, reduced"] = partial(_numba.riccati_of, game)
        fast["tadcore"] = lambda game=game: game.core().equilibrium().P
        times, P = _side.interleave(slow, 2 if quick else repetitions)
        more, answers = _side.interleave(fast, 5 if quick else 5 * repetitions)
        times, P = times | more, P | answers
        P["SciPy DOP853, 2N × 2N"] = P["SciPy DOP853, 2N × 2N"][..., ::2, ::2]
        for name, time in times.items():
            gap = np.max(
                np.linalg.norm(P[name] - P["tadcore"], axis=(2, 3)) / np.linalg.norm(P["tadcore"], axis=(2, 3))
            )
            worst = max(worst, gap)
            ratio = time.cpu / times["tadcore"].cpu
            rows.append((name, f"{n}", f"{1e3 * time.cpu:.2f}", f"{1e3 * time.wall:.2f}", f"{ratio:.1f}", f"{gap:.0e}"))
    _side.table(("contender", "n", "CPU ms", "wall ms", "ratio", "difference"), rows)
    _side.agree("P at every node, relative", worst, 1e-10)


if __name__ == "__main__":
    main()
