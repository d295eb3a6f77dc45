"""A game and a start in the words of a tadcore scenario, and in the compact form of the tables of random games."""

import numpy as np

from .model import Game, Start


def as_mapping(game, start):
    """The fields that belong to the interaction, none that does not."""
    n, first = game.n, game.interaction == "I1"
    sigma, zeta = np.asarray(start.sigma, dtype=float), np.asarray(start.zeta, dtype=float)
    positions = np.asarray(start.positions, dtype=float).tolist()
    attacker = {
        "position": positions[n + 1],
        "control_weight": game.r_a,
        "capture_radius": float(sigma[n]),
        "target_running_weight": game.q_atau,
        "target_terminal_weight": game.f_atau,
    }
    target = {"position": positions[n], "control_weight": game.r_tau}
    if first:
        attacker["evasion"] = game.evasion
        target |= {"running_weight": game.q_taua, "terminal_weight": game.f_taua}
    else:
        target["visibility_radius"] = float(zeta[n])
    defenders = []
    for i in range(n):
        d = {
            "position": positions[i],
            "control_weight": game.r_d[i],
            "capture_radius": float(sigma[i]),
            "visibility_radius": float(zeta[i]),
            "evasion_running_weight": game.q_ad[i],
            "evasion_terminal_weight": game.f_ad[i],
        }
        if first:
            d |= {"running_weight": game.q_da[i], "terminal_weight": game.f_da[i]}
        defenders.append(d)
    return {
        "interaction": game.interaction,
        "horizon": game.horizon,
        "step": game.step,
        "attacker": attacker,
        "target": target,
        "defenders": defenders,
        "synthesis_weights": game.gammas.tolist(),
    }


def game_of(entry):
    """Return the game of one entry of a table."""
    return Game(**{k: tuple(v) if isinstance(v, list) else v for k, v in entry["game"].items()})


def from_table(entry):
    """Return the game and the start of one entry of a table; a radius that is null is infinite."""
    zeta = np.array([np.inf if z is None else z for z in entry["zeta"]])
    return game_of(entry), Start(np.array(entry["positions"], dtype=float), zeta, np.array(entry["sigma"]))
