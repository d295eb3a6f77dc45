"""How much lower can Θ be in blocks that turn, aI + bJ with J a quarter turn, than in the library's scalar gains?

    python benches/turning_gains.py [--games 60] [--starts 6] [--seed 0]

Random games in the plane with n = 2 … 4 (weights as in global_minimum.py, γ log-uniform in [0.05, 1], visibility radii
uniform in [0.5, 3], starts uniform in [-3, 3]²), played, and every network that one meets, at its first instant. From
each scalar minimum and from random scalars SciPy's BFGS starts with random b. *lower*: by more than 1e-6 of Θ. What is
found is an upper bound on the minimum in blocks, so the counts and the largest share are lower bounds.
"""

from __future__ import annotations

import argparse

import numpy as np
from certified_along_games import placed
from global_minimum import random_scenario
from scipy.optimize import minimize

import tadcore
from tadcore.verification.oracle.matrices import matrices_of
from tadcore.verification.oracle.objective import FullObjective

LOWER = 1e-6
TURN = np.array([[0.0, -1.0], [1.0, 0.0]])


def drawn(rng: np.random.Generator, interaction: str) -> tadcore.Scenario:
    """A random game with limited sight and random synthesis weights."""
    sc = random_scenario(rng, interaction, int(rng.integers(2, 5)))
    gamma = np.exp(rng.uniform(np.log(0.05), 0.0, len(sc.synthesis_weights)))
    radii = {f"{player}.visibility_radius": float(rng.uniform(0.5, 3.0)) for player in sc.constrained}
    return placed(rng, sc.replace({"synthesis_weights": gamma.tolist(), **radii}))


def lowest(objective: FullObjective, x: np.ndarray, starts: int, rng: np.random.Generator) -> float:
    """The lowest Θ that descents in blocks aI + bJ find, half of them from the scalar minimum."""
    basis = np.kron(np.eye(objective.unknowns // 4), np.array([np.eye(2).ravel(), TURN.ravel()]))
    scalars = basis[::2] @ x / 2.0
    size = max(float(np.abs(scalars).max()), 0.3)
    best = np.inf
    for start in range(starts):
        y = rng.normal(scale=size, size=len(basis))
        if start % 2 == 0:
            y[::2] = scalars
        found = minimize(
            lambda y: objective.theta(y @ basis), y, jac=lambda y: basis @ objective.gradient(y @ basis), method="BFGS"
        )
        best = min(best, float(found.fun))
    return best


def main() -> None:
    """Print a line for each interaction."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--games", type=int, default=60)
    parser.add_argument("--starts", type=int, default=6)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    print(f"{'':3} {'games':>6} {'pairs':>6} {'lower':>6} {'of these certified':>19} {'at most by':>11}")
    for number, interaction in enumerate(("I1", "I2")):
        rng = np.random.Generator(np.random.Philox([options.seed, number]))
        pairs = lower = certified = 0
        widest = 0.0
        for _ in range(options.games):
            sc = drawn(rng, interaction)
            matrices, run = matrices_of(sc), tadcore.simulate(sc)
            values = matrices.values(tadcore.solve_equilibrium(sc).P)
            met: set[bytes] = set()
            for k, adjacency in enumerate(run.adjacency[:-1]):
                if adjacency.any() and adjacency.tobytes() not in met:
                    met.add(adjacency.tobytes())
                    gains = tadcore.synthesize(sc, step=k, adjacency=adjacency)
                    objective = FullObjective(sc, matrices, values[:, k], adjacency)
                    found = lowest(objective, objective.blocks(gains.rows), options.starts, rng)
                    gap = 1.0 - found / gains.theta if gains.theta > 1e-12 else 0.0
                    pairs += 1
                    lower += gap > LOWER
                    certified += gap > LOWER and gains.certified
                    widest = max(widest, gap)
        print(f"{interaction:3} {options.games:6} {pairs:6,} {lower:6,} {certified:19,} {widest:11.1%}")


if __name__ == "__main__":
    main()
