"""Make random_games.json: games drawn at random and what the oracle of tests/python says happens in them.

    python tests/reference/random_games.py [COUNT]

Game i depends on (seed, i) alone. The file is rewritten after every game, and a second run goes on where the first
stopped. With Numba it takes half an hour on one core. Games of I1 without an equilibrium are in escapes.json.

Every number of a game is rounded before it is used, so that what is in the file is exactly what was played. The
gains are the best of Newton's method from the canonical start, a descent in complex gains, the gains of earlier
instants under the same network and random starts at every instant. A game is left out if moving the players by
1e-10 changes its outcome, its end or one of its network changes: rounding would decide there.

An entry holds `game`, `positions` (d1…dn, target, attacker), `zeta` (null: unlimited), `sigma` (d1…dn, attacker) and
either `escape_backward_time` or `expected`: `kind`, `defender`, the last `step`, the steps of the network `changes`
(the initial network first), each `networks` entry as a number whose bit m N - 1 - (i N + j) is entry (i, j) of the
augmented adjacency, and the `final` positions. `solves` counts instants, `second_look` those where complex gains led
lower than Newton's method alone, `missed` those where only further starts did, and `hard` lists a few of both as
[step, network, best Theta, Theta of Newton's method].
"""

import json
import sys
from collections import Counter
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent / "python"))

from oracle import search  # noqa: E402
from oracle.model import Game, Start  # noqa: E402
from oracle.network import number  # noqa: E402
from oracle.riccati import EscapeError, equilibrium  # noqa: E402
from oracle.stepping import Gains, ended, simulate  # noqa: E402

SEED = 20240611
FILE = HERE / "random_games.json"


def draw(rng):
    """One game and start. Networks that chatter are common and kept."""
    n = int(rng.choice([1, 2, 3, 4, 5], p=[0.2, 0.26, 0.3, 0.13, 0.11]))
    first = bool(rng.random() < 0.5)
    axes = 3 if rng.random() < 0.15 else 2

    def weight(size=None):
        low, high = np.log(0.3), np.log(3.0)
        return np.round(np.exp(rng.uniform(low, high, size)), 4).tolist()

    def team():
        return tuple(weight(n))

    step = float(rng.choice([0.005, 0.01, 0.02], p=[0.5, 0.3, 0.2]))
    horizon = float(np.round(np.exp(rng.uniform(np.log(0.5), np.log(8.0))), 1))
    gamma = ()
    if rng.random() < 0.2:
        gamma = tuple(np.round(rng.uniform(0.1, 1.0, 4 if first else 3), 4).tolist())
    game = Game(
        "I1" if first else "I2",
        horizon,
        step,
        r_d=team(),
        r_tau=weight(),
        r_a=weight(),
        q_da=team() if first else (1.0,) * n,
        f_da=team() if first else (1.0,) * n,
        q_ad=team(),
        f_ad=team(),
        q_taua=weight() if first else 1.0,
        f_taua=weight() if first else 1.0,
        q_atau=weight(),
        f_atau=weight(),
        evasion=float(rng.choice([0.0, 0.5, 1.0], p=[0.25, 0.2, 0.55])) if first else 1.0,
        gamma=gamma,
    )
    positions = np.round(rng.choice([1.0, 2.0, 3.0]) * rng.uniform(-1, 1, (n + 2, axes)), 4)
    sigma = np.round(np.exp(rng.uniform(np.log(0.02), np.log(0.5), n + 1)), 4)
    zeta = np.full(game.m, np.inf)
    for i in range(game.m):
        least = sigma[i] if i < n else 0.02
        kind = rng.random()
        if kind < 0.15:
            zeta[i] = round(least + rng.uniform(0.01, 0.2), 4)
        elif kind < 0.85:
            zeta[i] = round(least + rng.uniform(0.2, 4.0), 4)
    if rng.random() < 0.06:  # over before it begins
        i = int(rng.integers(n + 1))
        positions[i] = np.round(positions[-1] + 0.3 * sigma[i], 4)
    return game, Start(positions, zeta, sigma)


def same(one, other):
    changes = [[(k, number(A)) for k, A in run.changes] for run in (one, other)]
    return (one.kind, one.defender, one.step) == (other.kind, other.defender, other.step) and changes[0] == changes[1]


def describe(game, start):
    fields = {k: list(v) if isinstance(v, tuple) else v for k, v in vars(game).items()}
    return {
        "game": fields,
        "positions": start.positions.tolist(),
        "zeta": [None if np.isinf(z) else float(z) for z in start.zeta],
        "sigma": start.sigma.tolist(),
    }


def play(game, start, rng):
    """Return what goes into the file, or None if rounding decides the game."""
    entry = describe(game, start)
    try:
        equilibrium(game)
    except EscapeError as pole:
        if game.interaction == "I1" or pole.backward_time > game.horizon - 1e-6:
            return None  # not known well enough
        return entry | {"escape_backward_time": pole.backward_time}
    gains = Gains(game)
    run = simulate(game, start, gains)
    if not ended(start.positions, start.sigma):
        moved = start.positions + 1e-10 * rng.normal(size=start.positions.shape)
        if not same(run, simulate(game, Start(moved, start.zeta, start.sigma), gains)):
            return None
    hard = [
        [k, number(A), f.theta, f.newton]
        for k, (A, f) in enumerate(zip(run.networks, run.found, strict=True))
        if f.second_look or f.missed
    ]
    keep = np.linspace(0, len(hard) - 1, min(4, len(hard))).round().astype(int)
    return entry | {
        "expected": {
            "kind": run.kind,
            "defender": run.defender,
            "step": run.step,
            "changes": [k for k, _ in run.changes],
            "networks": [number(A) for _, A in run.changes],
            "final": np.round(run.positions[-1], 10).tolist(),
        },
        "solves": len(run.found),
        "second_look": sum(f.second_look for f in run.found),
        "missed": sum(f.missed for f in run.found),
        "hard": [hard[i] for i in keep],
    }


def save(entries, next_index, dropped):
    lines = ",\n".join(json.dumps(e, separators=(",", ":")) for e in entries)
    head = {"about": "made by random_games.py; see there", "next": next_index, "dropped": dropped}
    FILE.write_text(json.dumps(head)[:-1] + ', "games": [\n' + lines + "\n]}\n", encoding="utf-8")


def main(count):
    search.compile_with_numba()
    done = json.loads(FILE.read_text(encoding="utf-8")) if FILE.exists() else {"next": 0, "dropped": 0, "games": []}
    entries, index, dropped = done["games"], done["next"], done["dropped"]
    while len(entries) < count:
        rng = np.random.default_rng([SEED, index])
        game, start = draw(rng)
        entry = play(game, start, rng)
        equilibrium.cache_clear()
        index += 1
        if entry is None:
            dropped += 1
        else:
            entries.append(entry)
        save(entries, index, dropped)
        e = entry or {}
        x = e.get("expected", {})
        print(
            index,
            game.interaction,
            game.n,
            x.get("kind", e.get("escape_backward_time", "dropped")),
            x.get("step"),
            len(x.get("changes", ())),
            *(e.get(key) for key in ("solves", "second_look", "missed")),
            flush=True,
        )
    print(Counter(e.get("expected", {}).get("kind", "no equilibrium") for e in entries), "dropped", dropped)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 260)
