"""A game in continuous time: changes of the network and the end at their own instants, sliding modes included.

On a step [t_k, t_k + h] the closed loop of one network is ż = Cz with C the mean of its matrices at t_k and t_{k+1}, so
z is exact and errors are of second order in h. Every visibility and capture circle is a function of time on it,

    f(s) = ‖w(s)‖² - ρ²,   f'(s) = 2w(s)·ẇ(s),   w = z_i - z_j or z_i,

and its first root is bracketed by the signs of f at a few nodes and at the extrema between them (roots of f', so that a
graze is not missed), then found by Brent's method. The network changes there, and the step continues with it.

Where an edge would break at once after it formed and form at once after it broke, f'_on > 0 > f'_off, the game slides
along the circle: by Filippov's rule with αC_on + (1 - α)C_off, α = f'_off / (f'_off - f'_on), until α leaves [0, 1].
Two players of one radius see each other across the same circle and their edges slide as one. Two circles at once have
no unique continuation: the play then stops and says so.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.optimize import brentq

from tadcore import _core
from tadcore._shared.arrays import Floats
from tadcore.errors import ScenarioError
from tadcore.game.network import Edge, VisibilityNetwork, edges_of
from tadcore.game.outcome import Outcome, OutcomeKind
from tadcore.scenario.model import Scenario
from tadcore.scenarios.given import ScenarioLike, as_scenario

from .circles import Circles, Loops, flow
from .plays import Event, EventPlay, Slide

_PARTS = 4
_EVENTS_PER_STEP = 40
_ROOT = 1e-13


def play_by_events(sc: ScenarioLike) -> EventPlay:
    """Play a scenario in continuous time, from event to event.

    Parameters
    ----------
    sc : Scenario, path or name
        The scenario, without failures, links and disturbances. Its step is the step of the feedback; halve it to see
        the times converge, at second order.

    Returns
    -------
    EventPlay
        How it ends and every change of the network, at their own times.

    Raises
    ------
    ScenarioError
        The game has failures, links or disturbances.
    NoEquilibriumError
        The game has no equilibrium on [0, T].

    Examples
    --------
    >>> import tadcore
    >>> play = tadcore.verification.play_by_events(tadcore.scenarios.load("paper-i1"))
    >>> play.outcome.kind, round(play.outcome.time, 3)
    ('intercepted', 1.393)
    """
    sc = as_scenario(sc)
    if sc.world is not None:
        rule = "one without failures, links and disturbances in continuous time, where sight alone is followed"
        raise ScenarioError("scenario", "a game with failures, links or disturbances", rule)
    return _Play(sc).run()


class _Play:
    """The state of one play: z, network, and the edge that slides, if any."""

    def __init__(self, sc: Scenario) -> None:
        self.sc, self.loops, self.circles = sc, Loops(sc), Circles(sc)
        self.z = sc.positions[:-1] - sc.positions[-1]
        self.network = VisibilityNetwork.from_positions(sc).adjacency.copy()
        self.sliding: int | None = None
        self.began, self.shown = 0.0, 0.0  # of the slide under way: its start, and ∫α
        self.events: list[Event] = []
        self.slides: list[Slide] = []
        self.first = len(self.circles.edges)

    def run(self) -> EventPlay:
        """From t = 0 to the end."""
        sc, step = self.sc, self.sc.horizon / self.sc.steps
        times = _core.grid_times(sc.horizon, sc.step).tolist()
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
                time = min(times[k] + done, times[k + 1])
                if circle >= self.first:
                    return self._end(time, circle - self.first)
                if not self._switch(k, circle, time):
                    return self._stop(time)
            else:
                return self._stop(time)
        return self._end(sc.horizon, None)

    def _end(self, time: float, who: int | None) -> EventPlay:
        n = self.sc.n
        kind = OutcomeKind.TIMEOUT if who is None else OutcomeKind.INTERCEPTED if who < n else OutcomeKind.CAPTURED
        defender = who if who is not None and who < n else -1
        self._close(time)
        return EventPlay(Outcome.of(kind, defender, time), tuple(self.events), True, tuple(self.slides), self.z)

    def _stop(self, time: float) -> EventPlay:
        self._close(time)
        return EventPlay(None, tuple(self.events), False, tuple(self.slides), self.z)

    def _close(self, time: float) -> None:
        """Note the slide under way, if any, as over."""
        if self.sliding is not None:
            share = min(self.shown / (time - self.began), 1.0) if time > self.began else 0.5
            self.slides.append(Slide(self._edges(self.sliding), self.began, time, share))
            self.sliding = None

    def _edges(self, circle: int) -> tuple[Edge, ...]:
        """The edges of a circle by name."""
        single = np.zeros_like(self.network)
        single[self.circles.where[circle]] = True
        return edges_of(single, self.sc.players)

    def _pair(self, k: int, circle: int) -> tuple[Floats, Floats]:
        """C with and without the edge of a circle."""
        where = self.circles.where[circle]
        on, off = self.network.copy(), self.network.copy()
        on[where], off[where] = True, False
        return self.loops(k, on), self.loops(k, off)

    def _advance(self, k: int, h: float) -> tuple[float, int | None]:
        """Move z on to the first event within h, or through h; the time taken and the circle met."""
        if self.sliding is not None:
            return self._slide(k, h, self.sliding)
        C = self.loops(k, self.network)
        at = flow(C, self.z, h)
        nodes = np.linspace(0.0, h, _PARTS + 1)
        z = [at(float(node)) for node in nodes]
        f = self.inside() * np.stack([self.circles.values(x) for x in z])
        slope = self.inside() * np.stack([self.circles.slopes(x, C) for x in z])
        # outwards through the circle: f grows past zero; or a graze, with a maximum inside
        graze = (slope[:-1] > 0) & (slope[1:] < 0) & (f[:-1] + 2.0 * nodes[1] * slope[:-1] > 0)
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
        signs = [1.0 if self.network[pairs[0]] else -1.0 for pairs in self.circles.edges]
        return np.array(signs + [-1.0] * (self.sc.n + 1))

    def _crossing(self, at: Callable[[float], Floats], C: Floats, c: int, low: float, high: float) -> float | None:
        """The first s in (low, high] at which circle c is crossed, in the direction that matters."""
        sign = float(self.inside()[c])

        def f(s: float) -> float:
            return sign * float(self.circles.values(at(s))[c])

        def slope(s: float) -> float:
            return sign * float(self.circles.slopes(at(s), C)[c])

        if f(high) <= 0:  # a graze: evaluate at the top
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
        where, edges = self.circles.where[circle], self._edges(circle)
        on, off = self._pair(k, circle)
        if self.sliding == circle:  # α left [0, 1]
            self._close(time)
            self.network[where] = bool(self.circles.slopes(self.z, on)[circle] <= 0)
            what = "stops sliding"
        elif self.circles.slopes(self.z, on)[circle] > 0 > self.circles.slopes(self.z, off)[circle]:
            if self.sliding is not None:
                return False
            self.sliding, self.began, self.shown = circle, time, 0.0
            what = "slides"
        else:
            self.network[where] = not self.network[self.circles.edges[circle][0]]
            what = "formed" if self.network[self.circles.edges[circle][0]] else "broke"
        self.events += [Event(time, edge, what) for edge in edges]
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
        inside, reached = self.inside(), best
        ends = inside * self.circles.values(at(reached))
        starts = inside * self.circles.values(self.z)
        for c in np.flatnonzero((ends > 0) & (starts < 0)).tolist():
            if c != circle:
                root = float(brentq(lambda s, c=c: inside[c] * self.circles.values(at(s))[c], 0.0, reached, xtol=_ROOT))
                if root < best or met is None:
                    best, met = root, c
        share = np.clip([alpha(self.z), alpha(at(0.5 * best)), alpha(at(best))], 0.0, 1.0)  # beyond by rounding only
        self.shown += best * float(share @ [1.0, 4.0, 1.0]) / 6.0
        self.z = at(best)
        return best, met
