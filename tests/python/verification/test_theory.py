"""The pieces of the verification against the oracle, closed forms and SciPy."""

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline

import tadcore
from oracle import theta as printed
from oracle.riccati import derivative, integrate
from oracle.scenario import as_mapping
from samples import full_P, random_game, random_network, random_start
from tadcore import verification as v
from tadcore.verification.oracle.adapted import Adapted
from tadcore.verification.oracle.flow import gauss, propagate, riccati_within
from tadcore.verification.oracle.matrices import matrices_of
from tadcore.verification.oracle.objective import FullObjective

SEEDS = st.integers(0, 2**32 - 1)


def drawn(seed, interaction, n, step=0.05):
    rng = np.random.default_rng(seed)
    game = random_game(rng, interaction, n, horizon=0.6, step=step)
    start = random_start(rng, game)
    return rng, game, tadcore.Scenario.model_validate(as_mapping(game, start))


@given(seed=SEEDS, n=st.integers(1, 3), interaction=st.sampled_from(["I1", "I2"]))
def test_the_riccati_flow_is_the_printed_one(seed, n, interaction):
    _, game, sc = drawn(seed, interaction, n)
    m = matrices_of(sc)
    P = integrate(game, axes=1)
    groups = dict(zip(("defenders", "target", "attacker") if interaction == "I1" else ("team",), P[3], strict=True))
    slope = derivative(game, P[3], game.matrices(1))
    expected = slope if interaction == "I1" else [-slope[0], slope[0]]
    assert np.allclose(m.slope(m.values(groups)), expected, rtol=1e-12, atol=1e-12)


@given(seed=SEEDS, n=st.integers(1, 3), interaction=st.sampled_from(["I1", "I2"]))
def test_a_random_equilibrium_is_one(seed, n, interaction):
    _, _, sc = drawn(seed, interaction, n)
    report = v.check_equilibrium(sc)
    assert report.ok, report


@given(seed=SEEDS, n=st.integers(1, 3), interaction=st.sampled_from(["I1", "I2"]))
def test_theta_its_gradient_and_its_hessian_in_full_blocks(seed, n, interaction):
    rng, game, sc = drawn(seed, interaction, n)
    k, network = 4, random_network(rng, game)
    m = matrices_of(sc)
    objective = FullObjective(sc, m, m.values(tadcore.solve_equilibrium(sc).P)[:, k], network)
    P = full_P(game, k)

    def blocks(x):
        """The paper's K_i of the unknowns: a block for each player seen."""
        K = [np.zeros((2, 2 * game.N)) for _ in range(game.m)]
        for (i, j), block in zip(objective.seen, x.reshape(-1, 2, 2), strict=True):
            K[i][:, 2 * j : 2 * j + 2] = block
        return K

    def gradient(x):
        whole = printed.gradients(game, P, blocks(x), network)
        return np.concatenate([whole[i][:, 2 * j : 2 * j + 2].ravel() for i, j in objective.seen])

    x = rng.normal(size=objective.unknowns)
    G = printed.joint(blocks(x), network)
    assert np.allclose(objective.rows(x), G, rtol=0, atol=1e-13)
    assert 2.0 * objective.theta(x) == pytest.approx(printed.theta(game, P, G), rel=1e-9)
    scale = np.abs(gradient(x)).max()
    assert np.allclose(2.0 * objective.gradient(x), gradient(x), rtol=0, atol=1e-8 * scale)
    direction = rng.normal(size=objective.unknowns)
    h = 1e-4  # the gradient is a cubic: its central difference errs by h² times a constant
    difference = (gradient(x + h * direction) - gradient(x - h * direction)) / (2 * h)
    product = 2.0 * objective.hessian_product(x, direction)
    assert np.allclose(product, difference, rtol=0, atol=1e-6 * np.abs(difference).max())
    dense = objective.hessian_product(x, np.eye(objective.unknowns))
    assert np.allclose(dense, dense.T, rtol=0, atol=1e-12 * np.abs(dense).max())
    found = tadcore.synthesize(sc, step=k, adjacency=network)
    assert objective.theta(objective.blocks(found.rows)) == pytest.approx(found.theta, rel=1e-10)


def test_the_curvature_of_a_large_team_is_found_without_forming_the_hessian(monkeypatch):
    _, _, sc = drawn(3, "I2", 3)
    m = matrices_of(sc)
    objective = FullObjective(sc, m, m.values(tadcore.solve_equilibrium(sc).P)[:, 2], np.ones((4, 4), dtype=bool))
    x = np.random.default_rng(0).normal(size=objective.unknowns)
    dense = v.lowest_curvature(objective, x)
    monkeypatch.setattr(v.checks.gains, "_DENSE", 1)
    assert v.lowest_curvature(objective, x) == pytest.approx(dense, rel=1e-8)


def test_the_best_response_of_one_player_is_the_closed_form():
    """The target against players who stand still: z' = u_τ, a scalar Riccati equation solved by a tangent."""
    sc = tadcore.scenarios.load("paper-i1").replace(horizon=0.9, step=0.01)
    still = np.zeros((sc.steps + 1, sc.n + 2, sc.n + 1))
    found = {response.party: response for response in v.best_responses(sc, still)}["target"]
    q, f, r, T = 1.0, 1.0, sc.target.control_weight, sc.horizon
    z = sc.positions[3] - sc.positions[4]
    root = np.sqrt(q * r)
    best = -root * np.tan(np.sqrt(q / r) * T + np.arctan(f / root))
    assert found.best == pytest.approx(0.5 * best * z @ z, rel=1e-9)
    assert found.cost == pytest.approx(-0.5 * (f + q * T) * z @ z, rel=1e-9)
    assert found.regret > 0


def test_collocation_is_of_its_order_and_quadrature_too():
    """ż = cos(t) z over one step against the closed form; polynomials of degree 9 exactly."""
    c, b, a = gauss()
    assert c @ b == pytest.approx(0.5, rel=1e-15)
    assert all(b @ c**d == pytest.approx(1.0 / (d + 1), rel=1e-13) for d in range(10))
    assert np.allclose(a.sum(axis=1), c, rtol=1e-13)
    errors = []
    for count in (2, 4):
        step = 3.0 / count
        times = step * (np.arange(count)[:, None] + c)
        C = np.cos(times)[..., None, None]
        _, ends = propagate(lambda part, C=C: C[part], count, np.ones((1, 1)), step)
        errors.append(abs(ends[-1, 0, 0] / np.exp(np.sin(3.0)) - 1.0))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(10.0, abs=1.0), errors


def test_p_inside_steps_is_the_solution_there():
    _, game, sc = drawn(11, "I1", 2)
    m = matrices_of(sc)
    values = m.values(tadcore.solve_equilibrium(sc).P)
    nodes, left = riccati_within(m, values[:, 1:], sc.step)
    times = (sc.step * (np.arange(sc.steps)[:, None] + gauss()[0])).ravel()
    exact = integrate(game, axes=1, times=times)
    scale = np.abs(values).max()
    assert np.allclose(nodes.reshape(3, -1, 3, 3), np.moveaxis(exact, 0, 1), rtol=0, atol=1e-9 * scale)
    assert np.allclose(left, values[:, :-1], rtol=0, atol=1e-9 * scale)


@pytest.mark.parametrize(("interaction", "player"), [("I1", 0), ("I1", 2), ("I1", 3), ("I2", 1), ("I2", 2), ("I2", 3)])
def test_the_indices_by_another_route(interaction, player):
    """J^Ad of a deviation by integrating z and the printed integrand together with SciPy, in full matrices."""
    seed = 5
    while True:
        rng, game, sc = drawn(seed, interaction, 2, step=0.02)
        run = tadcore.simulate(sc)
        seed += 1
        if len(run.times) > 6 and run.adjacency[:-1].any(axis=(0, 2)).all() and not run.adjacency[:-1].all():
            break
    adapted = Adapted(run)
    deviation = adapted.random_deviation(player, rng)
    index = adapted.index(sampled=False, deviation=deviation)
    party, sign = adapted.party_of(player)
    B, R, _, Q, _ = game.matrices(2)
    times = np.linspace(0, game.horizon, 20 * game.steps + 1)
    fine = integrate(game, axes=2, times=times)
    P_at = CubicHermiteSpline(times, fine, [derivative(game, P, game.matrices(2)) for P in fine])
    names = ("d", "tau", "a") if interaction == "I1" else ("team",)

    def controls(k, P, z):
        u = np.kron(run.gains[k], np.eye(2)) @ z
        if interaction == "I1":
            u = np.r_[u, -np.linalg.inv(R["tau"]) @ B["tau"].T @ P[1] @ z, -np.linalg.inv(R["a"]) @ B["a"].T @ P[2] @ z]
        else:
            u = np.r_[u, -np.linalg.inv(R["a"]) @ B["a"].T @ P[0] @ z]
        u[2 * player : 2 * player + 2] += deviation.gain[k].reshape(2, -1) @ z
        return u

    def rates(t, y, k):
        z, P = y[: 2 * game.N], P_at(t)
        u = controls(k, P, z)
        Bs = np.hstack([B["d"], B["tau"], B["a"]])
        parts = printed.errors(game, P, np.kron(run.gains[k], np.eye(2)))
        ud, ut, ua = u[: 2 * game.n], u[2 * game.n : -2], u[-2:]
        if interaction == "I1":
            state = [z @ (Q[name] + dQ) @ z for name, dQ in zip(names, parts[:3], strict=True)]
            own = [ud @ R["d"] @ ud - 2 * ud @ parts[3] @ z, ut @ R["tau"] @ ut, ua @ R["a"] @ ua]
        else:
            state = [z @ (Q["team"] + parts[0]) @ z]
            own = [2 * ud @ parts[1] @ z + 2 * ut @ parts[2] @ z + ua @ R["a"] @ ua]
            own[0] -= ud @ R["d"] @ ud + ut @ R["tau"] @ ut
        return np.r_[Bs @ u, 0.5 * (np.array(state) + own)]

    y = np.r_[adapted.start.ravel(), np.zeros(len(names))]
    for k in range(adapted.length):
        y = solve_ivp(rates, run.times[k : k + 2], y, args=(k,), method="DOP853", rtol=1e-11, atol=1e-12).y[:, -1]
    z = y[: 2 * game.N]
    for p, found in enumerate(index):
        value = y[2 * game.N + p] + 0.5 * z @ fine[20 * adapted.length][p] @ z
        assert found.value == pytest.approx(value, abs=1e-8 * found.scale)
    moved = index[party]
    assert moved.converged
    assert moved.error < 1e-12
    assert sign * (moved.value - moved.initial) > 0


@given(seed=SEEDS, n=st.integers(1, 3), interaction=st.sampled_from(["I1", "I2"]))
def test_every_random_run_is_a_network_adapted_equilibrium(seed, n, interaction):
    _, _, sc = drawn(seed, interaction, n)
    run = tadcore.simulate(sc)
    if len(run.times) > 1:
        report = v.check_nafne(run, deviations=1, seed=seed)
        assert report.accepted, report


@pytest.mark.parametrize(
    ("name", "order"), [("paper-i1", 1), ("paper-i1-full", 1), ("paper-i2", 2), ("paper-i2-far", 2)]
)
def test_the_order_of_the_gap_in_the_step(name, order):
    """Freezing the feedback over δ costs J^Ad at first order in I1, at second in I2, where it is a saddle."""
    run = tadcore.simulate(tadcore.scenarios.load(name).replace(step=0.01))
    for gaps, orders in v.gap_order(run).values():
        assert np.abs(gaps[-1]) < np.abs(gaps[0])
        assert np.allclose(orders, order, atol=0.15)
    assert len(v.sampling_gap(Adapted(run))) == len(v.gap_order(run, halvings=1))


def test_the_weights_of_the_indices_are_the_printed_ones():
    for interaction in ("I1", "I2"):
        rng, game, sc = drawn(23, interaction, 3)
        m = matrices_of(sc)
        values = m.values(tadcore.solve_equilibrium(sc).P)[:, 3]
        G = rng.normal(size=(game.m, game.N))
        found = v.adapted_weights(sc, m, values, G)
        parts = printed.errors(game, integrate(game, axes=1)[3], G, axes=1)
        count = 3 if interaction == "I1" else 1
        for one, other in zip(found.dQ, parts[:count], strict=True):
            assert np.allclose(one, other, rtol=0, atol=1e-8 * np.abs(other).max())
        assert np.allclose(found.S, np.vstack(parts[count:]), rtol=0, atol=1e-8)
