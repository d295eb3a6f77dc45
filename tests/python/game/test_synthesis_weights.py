"""The weights γ of Θ: their scale is nowhere in the gains, and without weight on S the gains are still defined."""

import numpy as np
import pytest

import tadcore

WITHOUT = {"paper-i1": [(1.0, 0.0, 0.0, 0.0), (0.5, 0.2, 0.3, 0.0)], "paper-i2": [(0.5, 0.0, 0.5), (0.5, 0.5, 0.0)]}


def networks(sc, count, seed=0):
    rng = np.random.default_rng([seed, sc.n])
    shape = (len(sc.constrained), sc.n + 1)
    for _ in range(count):
        yield int(rng.integers(sc.steps + 1)), rng.random(shape) < rng.uniform(0.3, 0.9)


@pytest.mark.parametrize("name", ["paper-i1", "paper-i2"])
@pytest.mark.parametrize("method", ["newton", "restarts", "descent"])
@pytest.mark.parametrize("exponent", [1, -1, -9, -60, -600, -1000])
def test_a_power_of_two_in_gamma_changes_theta_alone(name, method, exponent):
    sc = tadcore.scenarios.load(name)
    gamma = (0.5, 0.1, 0.3, 0.05)[: len(sc.synthesis_weights)]
    factor = 2.0**exponent
    one, other = sc.replace(synthesis_weights=gamma), sc.replace(synthesis_weights=[factor * g for g in gamma])
    for k, network in networks(sc, 12):
        expected = tadcore.synthesize(one, step=k, adjacency=network, method=method)
        found = tadcore.synthesize(other, step=k, adjacency=network, method=method)
        assert found.rows.tobytes() == expected.rows.tobytes()
        assert found.theta == expected.theta * factor
        assert found.terms == expected.terms
        assert (found.certified, found.iterations, found.start) == (
            expected.certified,
            expected.iterations,
            expected.start,
        )


@pytest.mark.parametrize("name", ["paper-i1", "paper-i2"])
def test_any_factor_of_gamma_leaves_the_gains_within_rounding(name):
    sc = tadcore.scenarios.load(name)
    for factor in (0.3, 1e-5, 7e-200):
        other = sc.replace(synthesis_weights=[factor * g for g in sc.synthesis_weights])
        for k, network in networks(sc, 8, seed=1):
            expected = tadcore.synthesize(sc, step=k, adjacency=network)
            found = tadcore.synthesize(other, step=k, adjacency=network)
            assert np.allclose(found.rows, expected.rows, rtol=0, atol=1e-8 * (1 + np.abs(expected.rows).max()))
            assert found.theta == pytest.approx(factor * expected.theta, rel=1e-9, abs=1e-25 * factor)


@pytest.mark.parametrize(("name", "gamma"), [(name, gamma) for name, all_ in WITHOUT.items() for gamma in all_])
def test_everyone_seen_gives_the_equilibrium_without_weight_on_s(name, gamma):
    sc = tadcore.scenarios.load(name).replace(synthesis_weights=gamma)
    feedback = tadcore.solve_equilibrium(sc).feedback
    for k in (0, 300, sc.steps):
        gains = tadcore.synthesize(sc, step=k, adjacency=np.ones((len(sc.constrained), sc.n + 1)))
        rows = np.array([feedback[player][k] for player in sc.constrained])
        assert np.allclose(gains.rows, rows, rtol=0, atol=1e-9 * (1 + np.abs(rows).max()))
        assert gains.theta <= 1e-20


@pytest.mark.parametrize(("name", "gamma"), [(name, gamma) for name, all_ in WITHOUT.items() for gamma in all_])
def test_without_weight_on_s_the_gains_are_the_nearest_of_equal_minima(name, gamma):
    """Reversing a row on which Θ has no weight but ΔQ's leaves Θ as it is and may not lead nearer to F."""
    sc = tadcore.scenarios.load(name).replace(synthesis_weights=gamma)
    feedback = tadcore.solve_equilibrium(sc).feedback
    alike = 0
    for k, network in networks(sc, 25, seed=2):
        gains = tadcore.synthesize(sc, step=k, adjacency=network)
        small = [g if g else 2.0**-14 for g in gamma]
        near = tadcore.synthesize(sc.replace(synthesis_weights=small), step=k, adjacency=network)
        alike += np.allclose(gains.rows, near.rows, rtol=0, atol=0.02 * (1 + np.abs(near.rows).max()))
        assert gains.converged
        linear = name == "paper-i1" and any(gamma[1:3])  # then no sign is free
        for i, player in enumerate(sc.constrained):
            weight = gamma[3] if name == "paper-i1" else gamma[1 + (player == "target")]
            if weight == 0.0 and not linear:
                assert gains.rows[i] @ feedback[player][k] >= -1e-12
    assert alike >= 23


@pytest.mark.parametrize("name", ["paper-i1", "paper-i2"])
def test_the_scenario_says_what_is_taken_without_weight_on_s(name):
    sc = tadcore.scenarios.load(name)
    assert "limit of a small weight" not in sc.describe()
    for gamma in WITHOUT[name]:
        assert "limit of a small weight" in sc.replace(synthesis_weights=gamma).describe()
