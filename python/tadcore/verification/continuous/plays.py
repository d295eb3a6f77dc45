"""What a play from event to event leaves behind; `tadcore.verification.play_by_events` makes one."""

from __future__ import annotations

from dataclasses import dataclass, field

from tadcore._shared.arrays import Floats
from tadcore.game.network import Edge
from tadcore.game.outcome import Outcome


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


@dataclass(frozen=True)
class Slide:
    """A sliding mode: a stretch in which players keep a distance at which an edge neither forms nor breaks.

    Attributes
    ----------
    edges : tuple of (str, str)
        Who sees whom; two edges where two players of one radius see each other.
    start, end : float
        From when to when.
    share : float
        Mean of α over the stretch: the share of the time that the edge is there, in the limit of δ → 0.
    """

    edges: tuple[Edge, ...]
    start: float
    end: float
    share: float


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
        False where two circles would slide at once, or a step holds more events than are followed.
    slides : tuple of Slide
        The sliding modes, in order of time.
    position : ndarray, shape (N, dim)
        z at the end.
    """

    outcome: Outcome | None
    events: tuple[Event, ...]
    resolved: bool
    slides: tuple[Slide, ...]
    position: Floats = field(repr=False)

    @property
    def times(self) -> tuple[float, ...]:
        """Times at which an edge forms, breaks or begins to slide."""
        return tuple(event.time for event in self.events if event.kind != "stops sliding")
