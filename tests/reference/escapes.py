"""Make escapes.json: games of I1 whose Riccati solution escapes, with the escape time in extended precision.

    python tests/reference/escapes.py

Needs gmpy2; a few minutes. With the weights of random_games.py an escape in I1 is not met in hundreds of games, so
the weights here are drawn over two decades.
"""

import json
import sys
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent / "python"))

from oracle.escape import taylor_escape  # noqa: E402
from oracle.model import uniform  # noqa: E402
from oracle.riccati import escape_time  # noqa: E402

COUNT, LONGEST = 10, 4.0


def draw(rng, n):
    def weight(size=None):
        return np.exp(rng.uniform(np.log(0.1), np.log(10.0), size)).round(3).tolist()

    team = {key: tuple(weight(n)) for key in ("q_da", "f_da", "q_ad", "f_ad")}
    one = {key: weight() for key in ("q_taua", "f_taua", "q_atau", "f_atau")}
    return uniform("I1", tuple(weight(n)), weight(), weight(), horizon=LONGEST, **team, **one)


def main():
    entries, seed = [], 0
    while len(entries) < COUNT:
        seed += 1
        game = draw(np.random.default_rng([81, seed]), 1 + seed % 2)
        if escape_time(game, LONGEST) is None:
            continue
        pole, _ = taylor_escape(game, LONGEST)
        if pole is None:
            continue
        fields = {k: list(v) if isinstance(v, tuple) else v for k, v in vars(game).items()}
        entries.append(json.dumps({"game": fields, "escape_backward_time": pole}, separators=(",", ":")))
        print(seed, game.n, pole, flush=True)
    text = '{"about": "made by escapes.py; see there", "games": [\n' + ",\n".join(entries) + "\n]}\n"
    (HERE / "escapes.json").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
