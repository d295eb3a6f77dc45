"""Random worlds for the tests: as the oracle takes them, and as changes of a scenario."""

import numpy as np

from oracle.worlds import World

NEVER = np.inf


def owners(game):
    """The players with limited sight, as paths name them."""
    return [*(f"d{i + 1}" for i in range(game.n)), *(["target"] if game.m > game.n else [])]


def players(game):
    """All players, as paths name them."""
    return [*(f"d{i + 1}" for i in range(game.n)), "target", "attacker"]


def random_world(rng, game, *, fails=True, talks=True, shakes=True, spread=2.0):
    """Draw a world of which each part is there or not, and every field takes each of its forms now and then."""
    m, T = game.m, game.horizon

    def means(share):
        return np.where(rng.random(m) < share, np.exp(rng.uniform(np.log(0.03), np.log(2.0), m)) * T, NEVER).round(5)

    def later(first):  # a second mean time is only given where there is a first
        return np.where(np.isfinite(first) & (rng.random(m) < 0.8), (rng.uniform(0.02, 0.6, m) * T).round(5), NEVER)

    fails, talks, shakes = (there and bool(rng.random() < 0.75) for there in (fails, talks and m > 1, shakes))
    to_failure, detected = means(0.6 * fails), means(0.6 * fails)
    radius = np.where(rng.random(m) < 0.75, rng.uniform(0.3, 2.5 * spread, m).round(4), np.nan) if talks else None
    if talks:
        radius[rng.random(m) < 0.2] = np.inf
        if np.isnan(radius).all():
            radius[0] = np.inf
    up = np.where(np.isnan(radius), NEVER, means(0.6)) if talks else np.full(m, NEVER)
    sizes = np.where(rng.random(game.n + 2) < 0.6, rng.uniform(0.0, 0.15, game.n + 2).round(4), 0.0) * shakes
    return World(
        to_failure=to_failure,
        to_repair=later(to_failure),
        detected=detected,
        missed=later(detected),
        stationary=(rng.random(m) < 0.4) & (np.isfinite(to_failure) | np.isfinite(detected)),
        disturbance=sizes,
        link_radius=radius,
        relays=int(rng.integers(0, 4)) if talks and rng.random() < 0.6 else None,
        common=bool(talks and rng.random() < 0.4),
        link_up=up,
        link_down=later(up),
        link_stationary=bool(np.isfinite(up).any() and rng.random() < 0.4),
    )


def changes_of(world, game):
    """The same world as changes of a scenario, every player in a table of its own."""
    found = {}
    names = {
        "mean_time_to_failure": world.to_failure,
        "mean_time_to_repair": world.to_repair,
        "mean_time_detected": world.detected,
        "mean_time_missed": world.missed,
    }
    for i, owner in enumerate(owners(game)):
        table = {name: float(array[i]) for name, array in names.items() if np.isfinite(array[i])}
        table |= {"begin": "stationary"} if world.stationary[i] else {}
        found |= {f"{owner}.sensing": table} if table else {}
        if world.link_radius is not None and not np.isnan(world.link_radius[i]):
            means = {"mean_time_up": world.link_up[i], "mean_time_down": world.link_down[i]}
            sent = {name: float(value) for name, value in means.items() if np.isfinite(value)}
            found[f"{owner}.communication"] = {"radius": float(world.link_radius[i]), **sent}
    if world.link_radius is not None:
        common = {"relays": world.relays} if world.relays is not None else {}
        common |= {"frame": "common"} if world.common else {}
        common |= {"begin": "stationary"} if world.link_stationary else {}
        found |= {"communication": common} if common else {}
    for owner, size in zip(players(game), world.disturbance, strict=True):
        found |= {f"{owner}.disturbance": float(size)} if size > 0 else {}
    return found
