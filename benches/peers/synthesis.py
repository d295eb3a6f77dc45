"""One synthesis, min Θ₁ at mid-game: SciPy on the paper's blocks, SciPy reduced, Numba, tadcore.

The game is I1 with r_d = 0.8 + 0.4 (i mod 3), r_τ = 1.2, r_a = 0.8, T = 3, δ = 0.01, everything else 1, at t = 1.5; the
networks are those of the Criterion bench, random of density ½. All begin at the canonical start:

- BFGS, 2 × 2 blocks: `minimize(method="BFGS", jac=True)` with the gradients as printed, the paper's way;
- LM, reduced: `least_squares(method="lm")` with the exact Jacobian of one Kronecker factor;
- Newton, Numba: damped Newton with the exact Hessian, compiled (not in a quick run);
- tadcore, from Python: one call of `synthesize`; tadcore, less the call: the same less a call under the empty network,
  which has nothing to minimise. At n = 3 a few microseconds remain of two much longer times, noise
  of both included: `cargo bench --bench synthesis` is what resolves them.

How to read the table: times are CPU times of the process. Networks are of two kinds. `certified`: one descent is
proved to reach the global minimum, so tadcore makes no other, and all contenders do equal work. `searched`: no proof,
so tadcore looks on from further starts while its peers still descend once; there the ratio is the price of the search,
not a measure of speed. They are medians over networks of medians over interleaved repetitions (the quick contenders by
themselves and more often, lest the slow ones empty their caches), ratios medians of the peer's time over tadcore's
less the call. Only networks where the answers are equal count (`equal`, to 1e-8 of Θ); `gains` is the largest
difference between the gains there, `Θ` the largest relative difference. The script ends with an error if the answers
differ on a certified network, or if a peer finds a lower Θ anywhere.
"""

from functools import partial

import _paper
import _side
import numpy as np

# n: certified and searched networks, repetitions
SIZES = {3: (8, 4, 15), 5: (6, 4, 9), 10: (3, 2, 3)}
DRAWN, STEP = 64, 150


def networks(n: int) -> np.ndarray:
    """Return the networks of benches/synthesis.rs, by the same xorshift generator: (64, n, N)."""
    state, mask, bits = 0x9E3779B97F4A7C15, (1 << 64) - 1, []
    for _ in range(DRAWN * n * (n + 1)):
        state ^= state << 13 & mask
        state ^= state >> 7
        state ^= state << 17 & mask
        bits.append(state >> 40 & 1 == 1)
    return np.array(bits).reshape(DRAWN, n, n + 1)


def contenders(game, core, P, numba):
    """Name → function of a network that returns the reduced rows of the gains, (n, N)."""
    blocks, reduced = _paper.Theta(game, P, 2), _paper.Theta(game, P, 1)
    reduced.prepare_residuals()
    peers = {
        "BFGS, 2 × 2 blocks": lambda seen: blocks.rows(blocks.bfgs(seen), seen)[::2, ::2],
        "LM, reduced": lambda seen: reduced.rows(reduced.lm(seen), seen),
    }
    if numba:
        import _numba

        newton = partial(_numba.newton, reduced.fne, reduced.r, reduced.M, np.array(reduced.W))
        peers["Newton, Numba"] = lambda seen: newton(seen, _side.GAMMA)
    peers["tadcore, from Python"] = lambda seen: core.synthesize(STEP, seen).rows
    return peers, reduced


def side_by_side(peers, theta, seen, repetitions):
    """Seconds, and relative excess of Θ and distance of the gains from tadcore's, by contender."""
    fast = ("Newton, Numba", "tadcore, from Python")
    seconds, rows = {}, {}
    for names, rounds in (([p for p in peers if p not in fast], repetitions), (fast, 20 * repetitions)):
        runs = {name: partial(peers[name], seen) for name in names if name in peers}
        if names is fast:
            runs["call"] = partial(peers["tadcore, from Python"], np.zeros_like(seen))
        group, answers = _side.interleave(runs, rounds)
        seconds |= {name: time.cpu for name, time in group.items()}
        rows |= answers
    del rows["call"]
    seconds["tadcore, less the call"] = max(seconds["tadcore, from Python"] - seconds.pop("call"), 1e-7)
    rows["tadcore, less the call"] = rows["tadcore, from Python"]
    least = rows["tadcore, from Python"]
    value = theta(theta.unknowns(least, seen), seen)[0]
    excess = {name: theta(theta.unknowns(G, seen), seen)[0] / value - 1 for name, G in rows.items()}
    return seconds, excess, {name: np.max(np.abs(G - least)) for name, G in rows.items()}


def main() -> None:
    quick = _side.start(__doc__)
    numba = _side.numba_wanted(quick)
    table, lower, apart, far = [], 0.0, 0.0, 0.0
    for n, (certified, searched, repetitions) in ({3: (2, 1, 2)} if quick else SIZES).items():
        game = _side.varied_game(n, horizon=3.0, step=0.01)
        core = game.core()
        peers, theta = contenders(game, core, core.equilibrium().P[:, STEP], numba)
        drawn = [(seen, core.synthesize(STEP, seen).certified) for seen in networks(n)]
        for kind, wanted, count in (("certified", True, certified), ("searched", False, searched)):
            chosen = [seen for seen, proved in drawn if proved is wanted][:count]
            results = [side_by_side(peers, theta, seen, repetitions) for seen in chosen]
            for name in results[0][0]:
                equal = [r for r in results if abs(r[1][name]) <= 1e-8]
                lower = max(lower, *(-r[1][name] for r in results))
                if wanted:
                    apart = max(apart, *(abs(r[1][name]) for r in results))
                if not equal:
                    table.append((name, kind, f"{n}", "", "", f"0/{len(results)}", "", ""))
                    continue
                time = np.median([r[0][name] for r in equal])
                ratio = np.median([r[0][name] / r[0]["tadcore, less the call"] for r in equal])
                gains, value = max(r[2][name] for r in equal), max(abs(r[1][name]) for r in equal)
                far = max(far, gains)
                counted = f"{len(equal)}/{len(results)}"
                numbers = f"{1e6 * time:,.0f}", f"{ratio:,.1f}", counted, f"{gains:.0e}", f"{value:.0e}"
                table.append((name, kind, f"{n}", *numbers))
    _side.table(("contender", "networks", "n", "CPU µs", "ratio", "equal", "gains", "Θ"), table)
    _side.agree("Θ on certified networks, relative", apart, 1e-8)
    _side.agree("how far a peer's Θ is below tadcore's, relative", lower, 1e-9)
    _side.agree("gains where Θ is equal", far, 1e-4)


if __name__ == "__main__":
    main()
