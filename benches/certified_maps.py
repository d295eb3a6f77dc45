"""How much of the plane of the attacker's starts is proved, at which cost; and ten million starts against the proofs.

    python benches/certified_maps.py [--starts 10000000] [--picture FILE.png] [full] [one] [limited]

Every start is drawn in a proved box, three quarters of them on its rim or at a corner, and played by `simulate_batch`;
the corners of all proved boxes are played besides.
"""

from __future__ import annotations

import argparse
import os
import time

import numpy as np

import tadcore

REGION = {"x": (-3.0, 3.0), "y": (-3.0, 3.0)}
SIDES = {"full": 6 / 2048, "one": 6 / 512, "limited": 6 / 512}
PART = 1_000_000


def game(which: str) -> tadcore.Scenario:
    """Full sight; one defender that sees 2 far; the paper's limited sight."""
    if which == "full":
        return tadcore.scenarios.load("paper-i1-full")
    sc = tadcore.scenarios.load("paper-i1")
    if which == "limited":
        return sc
    one = {"position": [0.0, 0.0], "control_weight": 1.0, "visibility_radius": 2.0, "capture_radius": 0.1}
    return sc.replace({"defenders": [one]})


def wrong(found: tadcore.CertifiedMap, points: np.ndarray, kind: np.ndarray, defender: np.ndarray) -> int:
    """How many of some starts end otherwise than proved."""
    sc, many = found.scenario, 0
    for first in range(0, len(points), PART):
        part = slice(first, first + PART)
        positions = np.repeat(sc.positions[np.newaxis], len(points[part]), axis=0)
        positions[:, sc.players.index(found.player)] = points[part]
        batch = tadcore.simulate_batch(sc, positions)
        bad = (batch.kind != kind[part]) | (batch.defender != defender[part]) | batch.diverged
        many += int(np.count_nonzero(bad))
    return many


def starts(found: tadcore.CertifiedMap, count: int, draws: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Random starts in proved boxes, inside, on rims and at corners, and the boxes."""
    data = found.dataset
    which = draws.choice(np.flatnonzero(data["kind"].values >= 0), size=count)
    part, place = draws.random((count, 2)), draws.integers(0, 4, size=count)
    rim = draws.integers(0, 2, size=(count, 2)).astype(float)
    part[:, 0] = np.where(place % 2 == 1, rim[:, 0], part[:, 0])
    part[:, 1] = np.where(place >= 2, rim[:, 1], part[:, 1])
    low, high = (np.column_stack([data[f"{axis}_{end}"].values[which] for axis in "xy"]) for end in ("low", "high"))
    return np.where(part == 1.0, high, np.clip(low + part * (high - low), low, high)), which


def main() -> None:
    """One line for each game."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("games", nargs="*", default=list(SIDES))
    parser.add_argument("--starts", type=int, default=10_000_000)
    parser.add_argument("--side", type=float)
    parser.add_argument("--picture")
    given = parser.parse_args()
    for which in given.games:
        sc, began, used = game(which), time.perf_counter(), time.process_time()
        side = given.side or SIDES[which]
        found = tadcore.certified_map(sc, **REGION, resolution=side, budget=10**6)
        seconds, cpu = time.perf_counter() - began, time.process_time() - used
        steps, looked = found.dataset.attrs["steps"], found.dataset.attrs["boxes_looked_at"]
        print(f"{which}: {found!r}", f"{looked:.0f} boxes looked at, {steps:.0f} steps", sep="\n  ")
        print(f"  {seconds:.2f} s, {cpu:.2f} s of the processor, {os.cpu_count()} cores")
        if given.picture:
            found.save(given.picture)
        data, many, played = found.dataset, 0, 0
        kind, defender = data["kind"].values, data["defender"].values
        proved = np.flatnonzero(kind >= 0)
        for x in ("low", "high"):
            for y in ("low", "high"):
                corners = np.column_stack([data[f"x_{x}"].values, data[f"y_{y}"].values])[proved]
                many += wrong(found, corners, kind[proved], defender[proved])
                played += len(proved)
        draws = np.random.default_rng(11)
        while played < given.starts + 4 * len(proved):
            points, boxes = starts(found, min(PART, given.starts + 4 * len(proved) - played), draws)
            many += wrong(found, points, kind[boxes], defender[boxes])
            played += len(points)
        print(f"  {played:,} starts in proved boxes played, {many:,} contradict")


if __name__ == "__main__":
    main()
