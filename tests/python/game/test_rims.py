"""Who sees whom on the very rim, against exact rational arithmetic; and how far apart players may be.

Doubles are rational numbers, so a distance on a rim can be compared without any rounding. Where every number on the
way is exact the network must be the exact one; where it is rounded, it may differ only within rounding of the rim.
"""

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

import tadcore
from tadcore import ScenarioError, VisibilityNetwork

TRIPLES = [(3, 4, 0, 5), (5, 12, 0, 13), (8, 15, 0, 17), (20, 21, 0, 29), (1, 2, 2, 3), (2, 3, 6, 7), (4, 4, 7, 9)]


def game(places, radii, target, attacker):
    """Defenders at places, with radii; small capture radii."""
    return tadcore.Scenario.model_validate(
        {
            "interaction": "I1",
            "horizon": 0.01,
            "step": 0.005,
            "attacker": {"position": attacker, "control_weight": 0.8, "capture_radius": 1e-9},
            "target": {"position": target, "control_weight": 1.2},
            "defenders": [
                {"position": place, "control_weight": 1.0, "capture_radius": 1e-9, "visibility_radius": radius}
                for place, radius in zip(places, radii, strict=True)
            ],
        }
    )


def exact(sc):
    """𝒜 by fractions, and of each entry the squared distance over the squared radius."""
    at = [[Fraction(x) for x in place] for place in sc.positions.tolist()]
    n, ratios = sc.n, np.zeros((sc.n, sc.n + 1))
    seen = np.zeros((n, n + 1), dtype=bool)
    for i, radius in enumerate(sc.visibility_radii.tolist()):
        for j in range(n + 1):
            other = at[n + 1] if j == i else at[j]
            squared = sum((a - b) ** 2 for a, b in zip(at[i], other, strict=True))
            seen[i, j] = squared <= Fraction(radius) ** 2
            ratios[i, j] = float(squared / Fraction(radius) ** 2)
    return seen, ratios


def nudged(radius, by):
    for _ in range(abs(by)):
        radius = math.nextafter(radius, math.inf if by > 0 else 0.0)
    return radius


@settings(max_examples=200, deadline=None)
@given(
    st.sampled_from(TRIPLES),
    st.integers(1, 2**20),
    st.integers(-12, 12),
    st.permutations(range(3)),
    st.tuples(*[st.sampled_from([-1, 1])] * 3),
    st.tuples(*[st.integers(-(2**20), 2**20)] * 3),
    st.integers(-1, 1),
    st.sampled_from([2, 3]),
)
def test_rims_of_whole_numbers_are_exact(triple, factor, power, order, signs, corner, ulps, axes):
    """Two players whose offset is a Pythagorean triple, at corners of whole numbers: nothing is rounded but a root."""
    *legs, distance = triple
    if axes == 2 and legs[2]:
        legs, distance = [3, 4, 0], 5
    order = [k for k in order if k < axes] if axes == 2 else order
    unit = 2.0**power
    offset = [signs[k] * legs[k] * factor for k in order]
    here = [float(c) * unit for c in corner[:axes]]
    there = [(c + o) * unit for c, o in zip(corner, offset, strict=False)]
    radius = nudged(distance * factor * unit, ulps)
    sc = game([here, there], [radius] * 2, [x + 1.0 * unit for x in here], [0.0] * axes)
    seen, _ = exact(sc)
    assert seen[0, 1] == (ulps >= 0)
    network = VisibilityNetwork.from_positions(sc).adjacency
    # The last digit of a root may hide one ulp of the radius; whole numbers are on the rim, or a whole ulp off it.
    assert network[0, 1] == seen[0, 1]
    assert (network == tadcore.simulate(sc).adjacency[0]).all()


COORDINATE = st.floats(-4.0, 4.0)


@settings(max_examples=150, deadline=None)
@given(st.data(), st.integers(1, 4), st.sampled_from([2, 3]))
def test_rounded_rims_differ_by_rounding_alone(data, n, axes):
    places = data.draw(st.lists(st.tuples(*[COORDINATE] * axes), min_size=n + 2, max_size=n + 2))
    spots = [list(place) for place in places]
    radii = []
    for i in range(n):
        j = data.draw(st.sampled_from([k for k in range(n + 2) if k != i]))
        distance = math.hypot(*(a - b for a, b in zip(spots[i], spots[j], strict=True)))
        radii.append(nudged(max(distance, 1e-3), data.draw(st.integers(-3, 3))))
    sc = game(spots[:n], radii, spots[n], spots[n + 1])
    seen, ratios = exact(sc)
    network = VisibilityNetwork.from_positions(sc).adjacency
    assert (network == tadcore.simulate(sc).adjacency[0]).all()
    # Coordinates relative to the attacker are rounded by 2^-53 of at most 8 each, a distance by no more than their sum.
    width = np.array([16 * 8 * 2.0**-53 / radius for radius in radii])[:, None] + 16 * 2.0**-53
    assert (np.abs(ratios - 1) <= 2 * width)[network != seen].all()


@pytest.mark.parametrize("far", [1e17, 1e30, 1e100])
def test_players_too_far_to_be_told_apart_are_refused(far):
    """At 1e17 two defenders 3 apart have one distance from the attacker, and would see each other within 2."""
    with pytest.raises(ScenarioError, match=r"defenders\[0\]\.visibility_radius: got 2\.0, must be at least 1e-12"):
        game([[0.0, 0.0], [3.0, 0.0]], [2.0, math.inf], [0.0, 1.0], [far, 0.0])
    sc = game([[0.0, 0.0], [3.0, 0.0]], [math.inf] * 2, [0.0, 1.0], [far, 0.0])
    assert VisibilityNetwork.from_positions(sc).adjacency.all()
    near = sc.replace({"attacker.position": [1e9, 0.0], "d*.visibility_radius": 2.0})
    assert not VisibilityNetwork.from_positions(near).adjacency[:, :2].any()


def test_rows_of_batches_and_studies_are_refused_before_anything_runs():
    sc = game([[0.0, 0.0], [3.0, 0.0]], [2.0, math.inf], [0.0, 1.0], [5.0, 0.0])
    rows = np.repeat([sc.positions], 3, axis=0)
    rows[1, -1, 0] = -1e17
    with pytest.raises(ScenarioError, match=r"visibility_radii\[1, 0\]: got 2\.0, must be at least 1e-12"):
        tadcore.simulate_batch(sc, rows)
    rows[0, -1, 0] = 1e18  # farther, and everybody sees without limit there
    sight = np.array([[math.inf, math.inf], [2.0, math.inf], [2.0, math.inf]])
    with pytest.raises(ScenarioError, match=r"visibility_radii\[1, 0\]: got 2\.0, must be .* along an axis \(1e\+17\)"):
        tadcore.simulate_batch(sc, rows, visibility_radii=sight)
    study = tadcore.Study(sc, {"attacker.position.x": tadcore.sampling.Choice([5.0, 1e17])}, trials=50, seed=1)
    with pytest.raises(ScenarioError, match=r"defenders\.0\.visibility_radius, trial \d+: got 2\.0, must be at least"):
        study.run()
    with pytest.raises(ScenarioError, match=r"target\.visibility_radius"):
        tadcore.scenarios.load("paper-i2").replace({"attacker.position": [1e14, 0.0], "target.visibility_radius": 2.5})
