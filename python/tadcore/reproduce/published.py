"""The numbers that the paper prints in its section VI, each with the place that prints it.

The paper is S. K. Singh and P. V. Reddy, "Dynamic network analysis of a target defense differential game with limited
observations". Nothing here is computed: these are the numbers that `tadcore.reproduce` compares with.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

I2_NOTE = (
    "Interaction I2: the computed winners are the paper's, the times are not. The run with full observation has no "
    "free choice in it, neither a gain to synthesise nor a network, and integrating its differential equations in "
    "continuous time gives 3.273 too; so the parameters in print cannot be the ones behind the printed times. Both "
    "columns are shown, and no parameter has been tuned to bring them together."
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Published:
    """One run of section VI as printed."""

    scenario: str
    """The name under `tadcore.scenarios`."""
    title: str
    kind: Literal["captured", "intercepted"]
    defender: str | None = None
    """Who intercepts."""
    time: float
    changes: tuple[float, ...] | None = None
    """Instants at which the visibility network changes, where the paper prints them."""
    first_edge: tuple[str, str, float] | None = None
    """The observer, the seen player and the instant of an edge that the text singles out."""
    exact: bool
    """Whether the computed numbers must be the printed ones, to the last digit."""
    source: str


PUBLISHED: tuple[Published, ...] = (
    Published(
        scenario="paper-i1-full",
        title="I1, λ = 1, full observation",
        kind="captured",
        time=2.66,
        exact=True,
        source="Section VI, interaction I1, text on fig:Scn12full",
    ),
    Published(
        scenario="paper-i1",
        title="I1, λ = 1, ζ = (5, 2.25, 1.25)",
        kind="intercepted",
        defender="d1",
        time=1.395,
        changes=(0.16, 0.49, 0.575, 0.915, 0.96),
        exact=True,
        source="Section VI, interaction I1, text on fig:Scn12pobs, captions of fig:Scn12gph1 to fig:Scn12gph6",
    ),
    Published(
        scenario="paper-i1-suicidal-full",
        title="I1, λ = 0, full observation",
        kind="intercepted",
        defender="d2",
        time=2.375,
        exact=True,
        source="Section VI, interaction I1, text on fig:suicidalattacker",
    ),
    Published(
        scenario="paper-i1-suicidal",
        title="I1, λ = 0, ζ = (5, 2.25, 1.25)",
        kind="intercepted",
        defender="d1",
        time=1.67,
        exact=True,
        source="Section VI, interaction I1, text on fig:suicidalattacker",
    ),
    Published(
        scenario="paper-i2-full",
        title="I2, full observation",
        kind="intercepted",
        defender="d1",
        time=3.455,
        exact=False,
        source="Section VI, interaction I2, text on fig:Int2full",
    ),
    Published(
        scenario="paper-i2-far",
        title="I2, ζ = (5, 3, 0.3), ζτ = 10",
        kind="captured",
        time=4.065,
        exact=False,
        source="Section VI, interaction I2, text on fig:Int2part1",
    ),
    Published(
        scenario="paper-i2",
        title="I2, ζ = (5, 3, 0.3), ζτ = 2.5",
        kind="intercepted",
        defender="d1",
        time=3.46,
        changes=(0.51, 0.895, 0.91, 1.2),
        exact=False,
        source="Section VI, interaction I2, text on fig:Int2part2, captions of fig:Int2gph1 to fig:Int2gph5",
    ),
    Published(
        scenario="paper-i2-wide",
        title="I2, ζ = (5, 3, 0.6), ζτ = 2.5",
        kind="intercepted",
        defender="d1",
        time=3.48,
        first_edge=("d3", "attacker", 1.305),
        exact=False,
        source="Section VI, interaction I2, text on fig:Int2part3 and fig:Int2Control2",
    ),
)
"""The eight runs, in the order of the text."""
