"""Best responses over long horizons: decided, right against an integral over time, and able to refuse.

In the first two games Π loses its symmetry to rounding unless it is kept, though their closed loops are stable;
in the third, gains near the horizon are too steep to be played between 800 instants.
"""

import numpy as np
import pytest
from scipy.integrate import simpson, solve_ivp

import tadcore
from oracle.model import Start, uniform
from oracle.scenario import as_mapping
from tadcore import verification as v
from tadcore.verification.oracle.matrices import matrices_of, stacked_rows

LONG = {
    "one defender": (
        uniform(
            "I2", (1.1587,), 1.0504, 1.9519, horizon=6.0, step=0.06,
            q_ad=(1.5376,), f_ad=(0.958,), q_atau=1.7867, f_atau=1.0852,
        ),
        [[-0.2503, -1.9662], [0.7139, 1.1453], [0.8237, 1.8484]],
    ),
    "two defenders": (
        uniform(
            "I2", (1.8384, 1.9724), 0.5968, 0.6098, horizon=10.0, step=0.1,
            q_ad=(0.9868, 1.5905), f_ad=(1.4539, 2.269), q_atau=0.4529, f_atau=0.9838,
        ),
        [[-0.6464, 0.4077], [-1.8309, -0.64], [-1.6732, 1.885], [0.3551, 0.0307]],
    ),
}  # fmt: skip


def scenario(name):
    game, positions = LONG[name]
    start = Start(np.array(positions), np.full(game.m, np.inf), np.full(game.n + 1, 0.05))
    return tadcore.Scenario.model_validate(as_mapping(game, start))


@pytest.mark.parametrize("name", LONG)
def test_a_long_game_is_decided(name):
    report = v.check_equilibrium(scenario(name))
    assert report.ok, report


def test_a_horizon_of_twenty_is_decided():
    sc = tadcore.scenarios.load("paper-i1").replace(horizon=20.0, step=0.2)
    assert v.check_equilibrium(sc).ok


@pytest.mark.parametrize("name", LONG)
def test_a_small_deviation_costs_its_integral(name):
    """Where the others play the equilibrium, what a party loses by its own feedback is ½∫‖u - u*‖² along the play."""
    sc = scenario(name)
    sc = sc.replace(step=sc.horizon / 800)
    m, rows = matrices_of(sc), stacked_rows(tadcore.solve_equilibrium(sc).feedback, sc.players)
    wrong = rows.copy()
    wrong[:, -1] *= 1.001
    found = {response.party: response for response in v.best_responses(sc, wrong)}["attacker"]
    assert found.converged
    assert found.relative > 1e-9  # refused
    times = np.linspace(0.0, sc.horizon, 801)
    start = sc.positions[:-1] - sc.positions[-1]

    def motion(t, y):
        k = min(int(t / sc.step), 799)
        share = t / sc.step - k
        return (m.B @ ((1 - share) * wrong[k] + share * wrong[k + 1]) @ y.reshape(start.shape)).ravel()

    played = solve_ivp(motion, (0.0, sc.horizon), start.ravel(), t_eval=times, rtol=1e-9, atol=1e-12, max_step=sc.step)
    z = played.y.T.reshape(-1, *start.shape)
    u = np.einsum("kj,kjx->kx", wrong[:, -1] - rows[:, -1], z)
    assert found.regret == pytest.approx(0.5 * m.r[-1] * simpson(np.sum(u * u, axis=1), x=times), rel=1e-3)
