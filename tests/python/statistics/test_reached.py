"""By when a share of games has ended: against the definition, and against a law whose quantile is known."""

import numpy as np
import pytest

from tadcore import ScenarioError
from tadcore.statistics import incidence

GRID = {"horizon": 10.0, "step": 0.25, "n": 1}


def ended(rng, trials, captured=0.3):
    """Trials of which some are captured, after a time that is geometric on the grid; the others time out."""
    time = np.minimum(rng.geometric(0.15, trials) * 0.25, 10.0)
    kind = np.where((rng.random(trials) < captured) & (time < 10.0), 1, 0)
    return kind, np.full(trials, -1), np.where(kind == 1, time, 10.0)


def test_it_is_the_first_instant_of_estimate_and_band():
    found = incidence(*ended(np.random.default_rng(2), 400), **GRID)
    row = found.names.index("captured")
    for at_least in (0.01, 0.1, 0.2, 0.25, 0.29, 0.35, 0.9):
        said = found.reached(at_least, "captured")
        for value, curve in ((said.time, found.estimate), (said.earliest, found.high), (said.latest, found.low)):
            there = [t for t, share in zip(found.times, curve[row], strict=True) if share >= at_least]
            assert value == (there[0] if there else None)
    assert found.reached(0.1, "captured").earliest < found.reached(0.1, "captured").time
    assert repr(found.reached(0.2, "captured")).startswith("20 % captured by t = ")
    assert repr(found.reached(0.9, "captured")) == "90 % captured: surely not until T, 95 %"
    assert "not until T]" in repr(found.reached(0.3, "captured"))


def test_the_interval_holds_a_known_quantile():
    """F(t_k) = 0.3 (1 - 0.85^k): the true first instants of several shares at once, at the level or above."""
    rng = np.random.default_rng(11)
    law = 0.3 * (1.0 - 0.85 ** np.arange(40))
    true = {share: 0.25 * int(np.flatnonzero(law >= share)[0]) for share in (0.05, 0.1, 0.2, 0.25)}
    held = 0
    for _ in range(400):
        found = incidence(*ended(rng, 150), **GRID)
        said = {share: found.reached(share, "captured") for share in true}
        held += all(
            said[share].earliest is not None
            and said[share].earliest <= at
            and (said[share].latest is None or at <= said[share].latest)
            for share, at in true.items()
        )
    assert held >= 0.95 * 400 - 3 * np.sqrt(400 * 0.95 * 0.05)


def test_no_such_share_or_outcome():
    found = incidence(*ended(np.random.default_rng(2), 20), **GRID)
    for wrong in (0.0, 1.0, True, "half", float("nan")):
        with pytest.raises(ScenarioError, match=r"at_least: got .*, must be a share in \(0, 1\)"):
            found.reached(wrong)
    with pytest.raises(ScenarioError, match=r"one of timeout, captured, intercepted, d1; did you mean captured\?"):
        found.reached(0.5, "capture")
