"""What is known of a rare event: its probability, an interval, and what it took."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from tadcore._shared.arrays import Floats
from tadcore._shared.html import as_html, line
from tadcore._shared.shares import percent
from tadcore.scenario.model import Scenario


@dataclass(frozen=True, eq=False, repr=False)
class RareEvent:
    """The probability of a rare outcome; made by `rare`.

    Attributes
    ----------
    scenario : Scenario
        The game.
    event : str
        The outcome.
    probability : float
        The mean of the replications, each of which is unbiased; where more of them were played because the first twenty
        spread too far, only up to what that choice adds.
    interval : tuple of float
        (low, high), Student's interval of that mean at ``level``.
    level : float
        Confidence level.
    error : float
        Standard error over probability, as the replications show it.
    runs : int
        Games that were played, those of the pilot included.
    replications : ndarray of float64, shape (R,)
        The estimate of each, independent of the others.
    levels : ndarray of float64, shape (m,)
        Scores that were climbed to one after another, the last just below 0. Empty where paths were split: there every
        replication has levels of its own.
    rates : ndarray of float64, shape (R, m)
        Of each replication the share above each level among what was above the level before; no columns where
        paths were split.
    shares : dict of str to float
        Of ``"intercepted"`` the share of each defender; empty for another event.
    seed : int
        The seed of the study.
    """

    scenario: Scenario
    event: str
    probability: float
    interval: tuple[float, float]
    level: float
    error: float
    runs: int
    replications: Floats
    levels: Floats
    rates: Floats
    shares: dict[str, float]
    seed: int

    @property
    def crude_runs(self) -> float:
        """Games that crude Monte Carlo would need for the same error: (1 - P) / (P error²)."""
        return (1.0 - self.probability) / (self.probability * self.error**2)

    def to_dict(self) -> dict[str, Any]:
        """Everything but the scenario, as JSON has it."""
        about = {"event": self.event, "probability": self.probability, "interval": list(self.interval)}
        about |= {"level": self.level, "error": self.error, "runs": self.runs, "crude_runs": self.crude_runs}
        arrays = {"replications": self.replications, "levels": self.levels, "rates": self.rates.mean(axis=0)}
        return {**about, **{k: array.tolist() for k, array in arrays.items()}, "shares": self.shares, "seed": self.seed}

    def lines(self) -> list[str]:
        """The answer as lines of text."""
        low, high = self.interval
        by = ", ".join(f"{name} {share:.1%}" for name, share in self.shares.items() if share > 0.0)
        reached = int(np.count_nonzero(self.replications))
        missed = "" if reached == len(self.replications) else f", {len(self.replications) - reached} without the event"
        return [
            f"P({self.event}) = {self.probability:.3g} [{low:.3g}, {high:.3g}] ({percent(self.level)})",
            *([f"by {by}"] if by else []),
            f"relative error {self.error:.1%} by {len(self.replications)} replications{missed}",
            f"{self.runs:,} runs; crude Monte Carlo would need {self.crude_runs:.1e}",
        ]

    def __repr__(self) -> str:
        return f"RareEvent({'; '.join(self.lines())})"

    def _repr_html_(self) -> str:
        mean, spread = self.rates.mean(axis=0), self.rates.std(axis=0, ddof=1)
        scores = [f"{level:.4g}" for level in self.levels[:-1]] + ["0"] * (len(self.levels) > 0)
        rows = [
            [f"{i + 1}", score, f"{rate:.4f}", f"{sd:.4f}", ""]
            for i, (score, rate, sd) in enumerate(zip(scores, mean, spread, strict=True))
        ]
        head = ["level", "score", "share above it", "spread over replications", ""]
        return as_html(f"P({self.event})", head, rows, *map(line, self.lines()))


def summary(estimates: Floats, level: float) -> tuple[float, tuple[float, float], float]:
    """Mean, Student's interval and relative standard error of independent estimates."""
    from scipy.special import stdtrit

    count, mean = len(estimates), float(estimates.mean())
    error = float(estimates.std(ddof=1)) / np.sqrt(count)
    reach = float(stdtrit(count - 1, 0.5 + 0.5 * level)) * error
    return mean, (max(mean - reach, 0.0), min(mean + reach, 1.0)), float(error / mean) if mean > 0.0 else np.inf
