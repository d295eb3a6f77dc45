"""Make hard_instants.json: instants at which Newton's method from the canonical start misses the lowest Theta.

    python tests/reference/hard_instants.py [COUNT]

Games are drawn as in random_games.py, with four instants and random networks each (often of no positions).
An instant is kept if the oracle's search in tests/python, with its widest choice of starts, ends lower by 1e-9. With
Numba ten minutes on one core. An entry holds `game`, `step`, `network` (a number as in random_games.py), the lowest
`theta` found, `newton` and `procedure` (Newton's method, and with one descent in complex gains).
"""

import json
import sys
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE.parent / "python")]

from random_games import draw  # noqa: E402

from oracle import riccati, search, synthesis  # noqa: E402
from oracle.network import number  # noqa: E402
from samples import random_network  # noqa: E402

SEED = 20240612


def main(count):
    search.compile_with_numba()
    lines, index, looked = [], 0, 0
    while len(lines) < count:
        rng = np.random.default_rng([SEED, index])
        index += 1
        game, _ = draw(rng)
        if game.n == 1:
            continue
        try:
            P = riccati.equilibrium(game)
        except riccati.EscapeError:
            continue
        finally:
            riccati.equilibrium.cache_clear()
        for k in rng.integers(game.steps + 1, size=4).tolist():
            A = random_network(rng, game, rng.uniform(0.3, 0.8))
            looked += 1
            found = synthesis.solve(game, P[k], A, count=24, seed=k)
            if not (found.second_look or found.missed):
                continue
            fields = {key: list(v) if isinstance(v, tuple) else v for key, v in vars(game).items()}
            entry = {"game": fields, "step": k, "network": number(A), "theta": found.theta}
            entry |= {"newton": found.newton, "procedure": found.procedure}
            lines.append(json.dumps(entry, separators=(",", ":")))
            print(
                len(lines), looked, game.interaction, game.n, found.theta / found.newton - 1, found.missed, flush=True
            )
    head = {"about": "made by hard_instants.py; see there", "looked_at": looked}
    text = json.dumps(head)[:-1] + ', "instants": [\n' + ",\n".join(lines) + "\n]}\n"
    (HERE / "hard_instants.json").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 60)
