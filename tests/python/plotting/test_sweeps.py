"""Figures of sweeps: they show the numbers of the dataset, and the cells that have none."""

import numpy as np
import pytest
from matplotlib.collections import LineCollection, PolyCollection

import tadcore
from tadcore import ScenarioError
from tadcore.sampling import Box

pytestmark = pytest.mark.usefixtures("agg")
WEIGHTS = [0.5, 0.2, 0.3]  # the first of them without an equilibrium in order of size


@pytest.fixture(scope="module")
def study():
    sc = tadcore.scenarios.load("paper-i2").replace({"step": 0.1})
    return tadcore.Study(sc, {"attacker.position": Box([-3, -2], [3, 4])}, trials=40, seed=7)


@pytest.fixture(scope="module")
def over_weights(study):
    return tadcore.sweep(study, {"attacker.control_weight": WEIGHTS})


def of_colour(ax, name):
    from tadcore.plotting.tools.outcomes import outcome_look

    return [line for line in ax.lines if line.get_color() == outcome_look(name).colour]


def test_lines_are_the_probabilities_in_order_of_the_weight(over_weights):
    ax = over_weights.plot()
    made = over_weights.to_xarray().sortby("attacker.control_weight")
    assert made["status"].values.tolist() == ["no equilibrium", "done", "done"]
    for name in ("intercepted", "captured", "timeout", "diverged"):
        [line] = of_colour(ax, name)
        assert np.array_equal(line.get_xdata(), sorted(WEIGHTS))
        assert np.array_equal(line.get_ydata(), made["probability"].sel(outcome=name), equal_nan=True)
    assert ax.get_xlabel() == "$r_{a}$"
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["no equilibrium"]
    [span] = [patch for patch in ax.patches if patch.get_hatch()]
    assert (span.get_x(), span.get_x() + span.get_width()) == pytest.approx((0.15, 0.25))


def test_intervals_are_those_of_the_dataset(over_weights):
    ax = over_weights.plot(outcomes=["captured"])
    made = over_weights.to_xarray().sortby("attacker.control_weight").sel(outcome="captured")
    [whiskers] = [drawn for drawn in ax.collections if isinstance(drawn, LineCollection)]
    ends = np.array([segment[:, 1] for segment in whiskers.get_segments() if len(segment)])
    assert np.array_equal(ends[-2:], np.stack([made["low"], made["high"]], axis=1)[1:])
    pale, dark = (drawn.get_paths()[0].vertices[:, 1] for drawn in ax.collections if isinstance(drawn, PolyCollection))
    for drawn, low, high in ((pale, "band_low", "band_high"), (dark, "low", "high")):
        assert (drawn.min(), drawn.max()) == (made[low].min(), made[high].max())
    assert pale.max() > dark.max()
    with pytest.raises(ValueError, match="no outcome 'won'; one of timeout, captured, intercepted, diverged"):
        over_weights.plot(outcomes=["won"])


def test_what_is_no_finite_number_stands_side_by_side(study):
    swept = tadcore.sweep(study, {"d1.visibility_radius": [np.inf, 1.0]})
    ax = swept.plot(outcomes=["intercepted"])
    assert [tick.get_text() for tick in ax.get_xticklabels()] == ["∞", "1"]
    assert of_colour(ax, "intercepted")[0].get_linestyle() == "None"


def test_two_quantities_are_a_heat_map(study):
    swept = tadcore.sweep(study, {"attacker.control_weight": WEIGHTS, "horizon": [4.0, 2.0]})
    ax = swept.plot(outcome="captured")
    made = swept.to_xarray().sortby(["attacker.control_weight", "horizon"])
    shown = np.ma.filled(ax.images[0].get_array(), np.nan)
    assert np.array_equal(shown, made["probability"].sel(outcome="captured").T, equal_nan=True)
    assert [tick.get_text() for tick in ax.get_yticklabels()] == ["2", "4"]
    written = sorted(text.get_text() for text in ax.texts)
    assert written == sorted(f"{p:.2f}" for p in shown.ravel() if np.isfinite(p))
    said = {text.get_text() for text in ax.get_legend().get_texts()}
    lost, some = (made["status"] != "done").values, (made["count"].sel(outcome="diverged") > 0).values
    assert said == {word for word, there in (("no equilibrium", lost), ("some diverged", some)) if there.any()}
    assert len(ax.lines[-1].get_xdata()) == some.sum()


def test_three_quantities_are_refused(study):
    grid = {"attacker.control_weight": [0.5], "horizon": [2.0], "d1.capture_radius": [0.1]}
    swept = tadcore.sweep(study, grid)
    with pytest.raises(ScenarioError, match="a sweep of one or two paths"):
        swept.plot()
