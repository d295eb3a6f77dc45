"""Which instants an animation shows, and how long: equal steps of time, with pauses at changes and at the end."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tadcore.game.recorded import Recorded

_PAUSE = 0.4  # seconds for which the picture stands still where the network changes
_PAUSES = 4.0  # seconds of pauses in all; with many changes each is shorter, at last none
_END = 1.6  # seconds for which the end stands


@dataclass(frozen=True, slots=True)
class Frame:
    """What one picture shows: the instant of that index, and whether it is a pause at a change or the end."""

    k: int
    pause: bool = False
    over: bool = False


def frames_of(run: Recorded, seconds: float, fps: float) -> list[Frame]:
    """Return the frames: equal steps of time, a pause at every network change and one at the end."""
    last = len(run.times) - 1
    count = max(round(seconds * fps), 2)
    shown = {int(k) for k in np.linspace(0, last, count).round()}
    changes = [int(np.argmin(np.abs(run.times - change.time))) for change in run.network_changes[1:]]
    pause = int(min(_PAUSE, _PAUSES / max(len(changes), 1)) * fps)
    frames: list[Frame] = []
    for k in sorted(shown | (set(changes) if pause else set())):
        frames += [Frame(k, pause=True)] * pause if k in changes and pause else [Frame(k)]
    return frames + [Frame(last, over=True)] * max(round(_END * fps), 1)


_SHORTEST = 2  # hundredths of a second: browsers play what is shorter at ten pictures a second


def gif_delays(count: int, fps: float) -> dict[int, int]:
    """Which of the pictures a GIF shows, and for how many hundredths of a second: two at least, the last one always.

    Together they last as long as all pictures do, to a hundredth.
    """
    delays: dict[int, int] = {}
    start = 0
    for index in range(count):
        end = round((index + 1) * 100 / fps)
        if end - start >= _SHORTEST:
            delays[index] = end - start
            start = end
        elif index == count - 1:
            _, before = delays.popitem() if delays else (0, 0)
            delays[index] = max(before + end - start, _SHORTEST)
    return delays
