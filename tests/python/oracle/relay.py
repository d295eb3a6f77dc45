"""Who is told what: reports along heard links, and the component that a player can work out from them."""

import numpy as np


def reporters(heard, i, relays=None):
    """The players whose reports reach i, itself included; ``heard[i, j]``: i hears j."""
    reached, front, rounds = {i}, {i}, 0
    while front and (relays is None or rounds <= relays):
        front = {j for h in front for j in range(len(heard)) if j != h and heard[h, j]} - reached
        reached |= front
        rounds += 1
    return reached


def known(seen, heard, i, relays=None, common=False):
    """Row i of the network that i may use, from what the players see and whom they hear."""
    N = seen.shape[1]
    members = reporters(heard, i, relays)
    pairs = {frozenset((p, N if p == q else q)) for p in members for q in range(N) if seen[p, q]}
    if common:
        pairs |= {frozenset((i, p)) for p in members if p != i}
    component, grown = {i}, True
    while grown:
        more = set().union(*(pair for pair in pairs if pair & component)) | component
        grown, component = more != component, more
    row = np.array([j in component for j in range(N)])
    row[i] = N in component
    return row


def relay(seen, heard, relays=None, common=False):
    """The network in use, (m, N)."""
    return np.array([known(seen, heard, i, relays, common) for i in range(len(seen))])
