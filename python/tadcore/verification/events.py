"""A game in continuous time: changes of the network and the end at their own instants, sliding modes included.

On a step [t_k, t_k + h] the closed loop of one network is ż = Cz with C the mean of its matrices at t_k and t_{k+1}, so
z is exact and errors are of second order in h. Every visibility and capture circle is a function of time on it,

    f(s) = ‖w(s)‖² - ρ²,   f'(s) = 2w(s)·ẇ(s),   w = z_i - z_j or z_i,

and its first root is bracketed by the signs of f at a few nodes and at the extrema between them (roots of f', so that a
graze is not missed), then found by Brent's method. The network changes there and the rest of the step goes on with it.

Where an edge would break at once after it formed and form at once after it broke, f'_on > 0 > f'_off, the game slides
along the circle: by Filippov's rule with αC_on + (1 - α)C_off, α = f'_off / (f'_off - f'_on), until α leaves [0, 1].
Two edges sliding at once have no unique continuation: the play then stops and says so.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.optimize import brentq

from tadcore.equilibrium import solve_equilibrium
from tadcore.network import Edge, VisibilityNetwork, edges_of
from tadcore.outcome import Outcome, OutcomeKind
from tadcore.synthesis import synthesize

from ._matrices import Floats, matrices_of

if TYPE_CHECKING:
    from tadcore.scenario import Scenario

__all__ = ["Event", "EventPlay", "play_by_events"]

_PARTS = 4
_DEGREE = 16
_EVENTS_PER_STEP = 40
_ROOT = 1e-13


@dataclass(frozen=True)
class Event:
    """One change of the network in continuous time.

    Attributes
    ----------
    time : float
        When.
    edge : tuple of str
        Who sees whom.
    kind : {"formed", "broke", "slides", "stops sliding"}
        What happened to it.
    """

    time: float
    edge: Edge
    kind: str


@dataclass(frozen=True, eq=False)
class EventPlay:
    """A game played from event to event; made by `play_by_events`.

    Attributes
    ----------
    outcome : Outcome or None
        How it ended; None where it could not be continued.
    events : tuple of Event
        Every change of the network, in order of time.
    resolved : bool
        False where two edges would slide at once, or a step holds more events than are followed.
    position : ndarray, shape (N, dim)
        z at the end.
    """

    outcome: Outcome | None
    events: tuple[Event, ...]
    resolved: bool
    position: Floats = field(repr=False)

    @property
    def times(self) -> tuple[float, ...]:
        """Times at which an edge forms, breaks or begins to slide."""
        return tuple(event.time for event in self.events if event.kind != "stops sliding")


class _Loops:
    """C on a step by network: the mean of the closed loops at both ends."""

    def __init__(self, sc: Scenario) -> None:
        self.sc, self.m = sc, matrices_of(sc)
        self.rows = self.m.rows(self.m.values(solve_equilibrium(sc).P))
        self.kept: dict[tuple[int, bytes], Floats] = {}

    def __call__(self, k: int, network: NDArray[np.bool_]) -> Floats:
        key = (k, network.tobytes())
        if key not in self.kept:
            rows = 0.5 * (self.rows[k] + self.rows[k + 1])
            ends = [synthesize(self.sc, step=i, adjacency=network).rows for i in (k, k + 1)]
            rows[: len(network)] = 0.5 * (ends[0] + ends[1])
            self.kept[key] = self.m.B @ rows
        return self.kept[key]


class _Circles:
    """The circles of one game: who is watched from where, and at which radius."""

    def __init__(self, sc: Scenario) -> None:
        m, size = len(sc.constrained), sc.n + 1
        pairs = [(i, j) for i in range(m) for j in range(size) if np.isfinite(sc.visibility_radii[i])]
        self.pairs = pairs
        self.capture = [(i, float(sc.capture_radii[i])) for i in range(size)]
        # one row for each circle: w = row @ z; the own column of 𝒜 stands for the attacker, at the origin
        self.rows = np.zeros((len(pairs) + size, size))
        for s, (i, j) in enumerate(pairs):
            self.rows[s, i] = 1.0
            if i != j:
                self.rows[s, j] = -1.0
        self.rows[len(pairs) :] = np.eye(size)
        sight = [sc.visibility_radii[i] for i, _ in pairs]
        self.square = np.array([*sight, *sc.capture_radii]) ** 2

    def values(self, z: Floats) -> Floats:
        """F of every circle."""
        w = self.rows @ z
        values: Floats = np.sum(w * w, axis=1) - self.square
        return values

    def slopes(self, z: Floats, C: Floats) -> Floats:
        """F' of every circle under ż = Cz."""
        slopes: Floats = 2.0 * np.sum((self.rows @ z) * (self.rows @ (C @ z)), axis=1)
        return slopes


def _flow(C: Floats, z: Floats, h: float) -> Callable[[float], Floats]:
    """exp(Cs)z as a function of s in [0, h]: its Taylor series, or the exponential where that is too long."""
    if np.abs(C).sum(axis=1).max() * h > 0.5:
        return lambda s: np.asarray(expm(C * s) @ z)
    terms = [z]
    for j in range(1, _DEGREE):
        terms.append(C @ terms[-1] / j)
    series, powers = np.stack(terms), np.arange(_DEGREE)
    return lambda s: np.tensordot(s**powers, series, axes=1)


def play_by_events(sc: Scenario) -> EventPlay:
    """Play a scenario in continuous time, from event to event.

    Parameters
    ----------
    sc : Scenario
        The scenario. Its step is the step of the feedback; halve it to see the times converge, at second order.

    Returns
    -------
    EventPlay
        How it ends and every change of the network, at their own times.

    Raises
    ------
    NoEquilibriumError
        The game has no equilibrium on [0, T].

    Examples
    --------
    >>> import tadcore
    >>> play = tadcore.verification.play_by_events(tadcore.scenarios.load("paper-i1"))
    >>> play.outcome.kind, round(play.outcome.time, 3)
    ('intercepted', 1.393)
    """
    return _Play(sc).run()


class _Play:
    """The state of one play: z, network, and the edge that slides, if any."""

    def __init__(self, sc: Scenario) -> None:
        self.sc, self.loops, self.circles = sc, _Loops(sc), _Circles(sc)
        self.z = sc.positions[:-1] - sc.positions[-1]
        self.network = VisibilityNetwork.from_positions(sc).adjacency.copy()
        self.sliding: int | None = None
        self.events: list[Event] = []
        self.first = len(self.circles.pairs)

    def run(self) -> EventPlay:
        """From t = 0 to the end."""
        sc, step = self.sc, self.sc.horizon / self.sc.steps
        values = self.circles.values(self.z)[self.first :]
        if (values <= 0).any():
            return self._end(0.0, int(np.argmin(np.where(values <= 0, np.linalg.norm(self.z, axis=1), np.inf))))
        for k in range(sc.steps):
            done = 0.0
            for _ in range(_EVENTS_PER_STEP):
                s, circle = self._advance(k, step - done)
                done += s
                if circle is None:
                    break
                time = k * step + done
                if circle >= self.first:
                    return self._end(time, circle - self.first)
                if not self._switch(k, circle, time):
                    return EventPlay(None, tuple(self.events), False, self.z)
            else:
                return EventPlay(None, tuple(self.events), False, self.z)
        return self._end(sc.horizon, None)

    def _end(self, time: float, who: int | None) -> EventPlay:
        n = self.sc.n
        kind = OutcomeKind.TIMEOUT if who is None else OutcomeKind.INTERCEPTED if who < n else OutcomeKind.CAPTURED
        defender = who if who is not None and who < n else -1
        return EventPlay(Outcome.of(kind, defender, time), tuple(self.events), True, self.z)

    def _pair(self, k: int, circle: int) -> tuple[Floats, Floats]:
        """C with and without the edge of a circle."""
        i, j = self.circles.pairs[circle]
        on, off = self.network.copy(), self.network.copy()
        on[i, j], off[i, j] = True, False
        return self.loops(k, on), self.loops(k, off)

    def _advance(self, k: int, h: float) -> tuple[float, int | None]:
        """Move z on to the first event within h, or through h; the time taken and the circle met."""
        if self.sliding is not None:
            return self._slide(k, h, self.sliding)
        C = self.loops(k, self.network)
        at = _flow(C, self.z, h)
        nodes = np.linspace(0.0, h, _PARTS + 1)
        z = [at(float(node)) for node in nodes]
        f = self.inside() * np.stack([self.circles.values(x) for x in z])
        slope = self.inside() * np.stack([self.circles.slopes(x, C) for x in z])
        # outwards through the circle: f grows past zero; or a graze, with a maximum inside
        graze = (slope[:-1] > 0) & (slope[1:] < 0) & (f[1:] + 2.0 * nodes[1] * slope[:-1] > 0)
        best, met = h, None
        for part, c in np.argwhere((f[1:] > 0) | graze).tolist():
            if nodes[part] < best:
                root = self._crossing(at, C, c, float(nodes[part]), float(nodes[part + 1]))
                if root is not None and root < best:
                    best, met = root, c
        self.z = at(best)
        return best, met

    def inside(self) -> Floats:
        """The sign of each circle: +1 where its edge exists, so that it breaks outwards, else -1."""
        signs = [1.0 if self.network[pair] else -1.0 for pair in self.circles.pairs]
        return np.array(signs + [-1.0] * (self.sc.n + 1))

    def _crossing(self, at: Callable[[float], Floats], C: Floats, c: int, low: float, high: float) -> float | None:
        """The first s in (low, high] at which circle c is crossed, in the direction that matters."""
        sign = float(self.inside()[c])

        def f(s: float) -> float:
            return sign * float(self.circles.values(at(s))[c])

        def slope(s: float) -> float:
            return sign * float(self.circles.slopes(at(s), C)[c])

        if f(high) <= 0:  # a graze: look at the top
            high = brentq(slope, low, high, xtol=_ROOT)
            if f(high) <= 0:
                return None
        if f(low) >= 0:  # on the circle from the start of this part, by rounding
            return low if slope(low) > 0 else self._again(f, slope, low, high)
        return float(brentq(f, low, high, xtol=_ROOT))

    @staticmethod
    def _again(f: Callable[[float], float], slope: Callable[[float], float], low: float, high: float) -> float | None:
        """The return to a circle that was just left inwards."""
        if slope(high) <= 0:
            return None
        bottom = brentq(slope, low, high, xtol=_ROOT)
        return float(brentq(f, bottom, high, xtol=_ROOT)) if f(bottom) < 0 else float(bottom)

    def _switch(self, k: int, circle: int, time: float) -> bool:
        """Change an edge, or let it slide; False where the play cannot go on."""
        pair = self.circles.pairs[circle]
        single = np.zeros_like(self.network)
        single[pair] = True
        (edge,) = edges_of(single, self.sc.players)
        if self.sliding == circle:  # α left [0, 1]
            self.sliding = None
            on, _ = self._pair(k, circle)
            self.network[pair] = bool(self.circles.slopes(self.z, on)[circle] <= 0)
            self.events.append(Event(time, edge, "stops sliding"))
            return True
        on, off = self._pair(k, circle)
        if self.circles.slopes(self.z, on)[circle] > 0 > self.circles.slopes(self.z, off)[circle]:
            if self.sliding is not None:
                return False
            self.sliding = circle
            self.events.append(Event(time, edge, "slides"))
            return True
        self.network[pair] = not self.network[pair]
        self.events.append(Event(time, edge, "formed" if self.network[pair] else "broke"))
        return True

    def _slide(self, k: int, h: float, circle: int) -> tuple[float, int | None]:
        """Move along a circle by the classical Runge-Kutta method, to an event within h or through h."""
        on, off = self._pair(k, circle)

        def alpha(z: Floats) -> float:
            a, b = self.circles.slopes(z, on)[circle], self.circles.slopes(z, off)[circle]
            return float(b / (b - a)) if b != a else 0.5

        def field_of(z: Floats) -> Floats:
            share = alpha(z)
            moved: Floats = share * (on @ z) + (1.0 - share) * (off @ z)
            return moved

        def at(s: float) -> Floats:
            z = self.z
            k1 = field_of(z)
            k2 = field_of(z + 0.5 * s * k1)
            k3 = field_of(z + 0.5 * s * k2)
            k4 = field_of(z + s * k3)
            moved: Floats = z + (s / 6.0) * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
            return moved

        def margin(s: float) -> float:
            share = alpha(at(s))
            return min(share, 1.0 - share)

        best, met = h, None
        if margin(0.0) <= 0:
            return 0.0, circle
        if margin(h) < 0:
            best, met = float(brentq(margin, 0.0, h, xtol=_ROOT)), circle
        inside = self.inside()
        ends = inside * self.circles.values(at(best))
        starts = inside * self.circles.values(self.z)
        for c in np.flatnonzero((ends > 0) & (starts < 0)).tolist():
            if c != circle:
                root = float(brentq(lambda s, c=c: inside[c] * self.circles.values(at(s))[c], 0.0, best, xtol=_ROOT))
                if root < best or met is None:
                    best, met = root, c
        self.z = at(best)
        return best, met
