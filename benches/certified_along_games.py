"""What share of the networks that games visit has gains without a certificate?

    python benches/certified_along_games.py [--games 100] [--seed 0]

The paper's two games with limited sight, and random games of three defenders (weights as in global_minimum.py, every
visibility radius uniform in [0.5, 3]): all starts uniform in [-3, 3]². *pairs* are distinct (instant, network), the
entries of a gain table; *steps* counts a pair each time a game passes it. Quoted in the README and in docs.
"""

from __future__ import annotations

import argparse

import numpy as np
from global_minimum import random_scenario

import tadcore


def placed(rng: np.random.Generator, sc: tadcore.Scenario) -> tadcore.Scenario:
    """The game with everyone anywhere in the square."""
    players = [*(f"defenders[{i}]" for i in range(sc.n)), "target", "attacker"]
    return sc.replace({f"{player}.position": rng.uniform(-3.0, 3.0, sc.dim).tolist() for player in players})


def drawn(rng: np.random.Generator, interaction: str) -> tadcore.Scenario:
    """A random game with limited sight."""
    sc = random_scenario(rng, interaction, 3)
    return sc.replace({f"{player}.visibility_radius": float(rng.uniform(0.5, 3.0)) for player in sc.constrained})


def main() -> None:
    """Print a line for each kind of game."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--games", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    print(f"{'':12} {'games':>6} {'pairs':>8} {'uncertified':>12} {'steps':>8} {'uncertified':>12}")
    for number, name in enumerate(("paper-i1", "paper-i2", "random I1", "random I2")):
        rng = np.random.Generator(np.random.Philox([options.seed, number]))
        met: dict[tuple[int, int, bytes], bool] = {}
        steps = uncertified = 0
        for game in range(options.games):
            random = name.startswith("random")
            sc = placed(rng, drawn(rng, name[-2:]) if random else tadcore.scenarios.load(name))
            run = tadcore.simulate(sc)
            for k, adjacency in enumerate(run.adjacency[:-1]):
                key = (game if random else 0, k, adjacency.tobytes())
                if key not in met:
                    met[key] = tadcore.synthesize(sc, step=k, adjacency=adjacency).certified
                steps += 1
                uncertified += not met[key]
        share = 1.0 - sum(met.values()) / len(met)
        print(f"{name:12} {options.games:6} {len(met):8,} {share:12.1%} {steps:8,} {uncertified / steps:12.1%}")


if __name__ == "__main__":
    main()
