"""Bounds of order two: an exact proof, of the polynomial that is meant, which no search goes below; and no other."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.optimize import minimize

import tadcore
from oracle.riccati import equilibrium
from oracle.scenario import as_mapping
from oracle.synthesis import solve
from samples import random_game, random_network, random_start
from tadcore import verification as v
from tadcore.cli import app as cli
from tadcore.verification.bound.along import bound_along
from tadcore.verification.bound.bounds import prove_theta
from tadcore.verification.bound.polynomial import theta_polynomial
from tadcore.verification.bound.proof import Proof
from tadcore.verification.oracle.matrices import matrices_of
from tadcore.verification.oracle.objective import FullObjective

SEEDS = st.integers(0, 2**32 - 1)


def drawn(seed, interaction, n):
    rng = np.random.default_rng(seed)
    game = random_game(rng, interaction, n, horizon=0.6, step=0.05)
    sc = tadcore.Scenario.model_validate(as_mapping(game, random_start(rng, game)))
    return rng, game, sc, int(rng.integers(game.steps + 1)), random_network(rng, game, rng.uniform(0.2, 0.9))


def objective_of(sc, k, network):
    m = matrices_of(sc)
    return FullObjective(sc, m, m.values(tadcore.solve_equilibrium(sc).P)[:, k], network, dim=1)


def rational(array):
    return np.vectorize(Fraction, otypes=[object])(np.asarray(array, dtype=float))


def exact_theta(sc, k, network, x):
    """Θ of eq:errfun1 or eq:errfun2 at gains x on the players that are seen, in rational matrices."""
    P = [rational(p[k]) for p in tadcore.solve_equilibrium(sc).P.values()]
    first = sc.interaction == "I1"
    m, N = network.shape
    r = rational([*(d.control_weight for d in sc.defenders), *([] if first else [sc.target.control_weight])])
    R, Rinv, B = np.diag(r), np.diag(1 / r), np.eye(N, dtype=int)[:, :m] * Fraction(1)
    G = np.full((m, N), Fraction(0))
    for (i, j), gain in zip(np.argwhere(network), x, strict=True):
        G[i, j] += gain
        if i != j:
            G[i, i] -= gain
    gamma = [Fraction(g) for g in sc.synthesis_weights]
    if not first:
        S = R @ G - B.T @ P[0]
        dQ = P[0] @ B @ Rinv @ B.T @ P[0] - G.T @ R @ G
        return gamma[0] * (dQ**2).sum() + gamma[1] * (S[:-1] ** 2).sum() + gamma[2] * (S[-1] ** 2).sum()
    S = B.T @ P[0] + R @ G
    errors = [G.T @ R @ G - P[0] @ B @ Rinv @ B.T @ P[0]]
    for p in P[1:]:
        X = -p @ B @ Rinv @ S
        errors.append(X + X.T)
    return sum(g * (e**2).sum() for g, e in zip(gamma, [*errors, S], strict=True))


@pytest.mark.parametrize("interaction", ["I1", "I2"])
def test_the_polynomial_is_theta_without_any_rounding(interaction):
    rng, _, sc, k, network = drawn(5, interaction, 3)
    objective = objective_of(sc, k, network)
    x = rng.normal(size=objective.unknowns)
    p = theta_polynomial(objective, x).scaled(exponents := rng.integers(-3, 4, objective.unknowns).tolist())
    y = [Fraction(int(a), 8) for a in rng.integers(-20, 20, objective.unknowns)]
    total = sum(
        (value * np.prod([Fraction(1), *(y[u] for u in monomial)]) for monomial, value in p.coefficients.items()),
        Fraction(0),
    )
    at = [Fraction(a) + b * Fraction(2) ** e for a, b, e in zip(x.tolist(), y, exponents, strict=True)]
    assert objective.unknowns > 4
    assert total / p.denominator == exact_theta(sc, k, network, at)


@given(seed=SEEDS, n=st.integers(1, 3), interaction=st.sampled_from(["I1", "I2"]))
@settings(max_examples=15)
def test_no_search_goes_below_it_and_what_is_certified_is_proved(seed, n, interaction):
    _, game, sc, k, network = drawn(seed, interaction, n)
    if network.sum() > 6:
        network[-1] = 0
    if network.sum() > 6:
        network[0] = 0
    bound = v.theta_bound(sc, step=k, adjacency=network, order=2)
    found = tadcore.synthesize(sc, step=k, adjacency=network)
    assert bound.theta == pytest.approx(found.theta, rel=1e-9, abs=1e-12 * bound.scale)
    assert bound.value <= solve(game, equilibrium(game)[k], network, count=4, seed=0).theta + 1e-12 * bound.scale
    assert bound.proved
    assert bound.tight  # no search missed anything here
    assert bound.proof.holds()
    assert Fraction(bound.value) < bound.proof.bound
    assert Fraction(bound.theta) > exact_theta(sc, k, network, map(Fraction, blocks_of(sc, k, network, found.rows)))


def blocks_of(sc, k, network, rows):
    return objective_of(sc, k, network).blocks(rows).tolist()


def test_a_proof_that_is_tampered_with_does_not_hold():
    _, _, sc, k, network = drawn(5, "I1", 3)
    proof = v.theta_bound(sc, step=k, adjacency=network, order=2).proof
    (part,) = proof.parts
    assert proof.holds()

    def changed(**what):
        return Proof(proof.polynomial, (replace(part, **what),)).holds()

    assert not changed(epsilon=-part.epsilon)
    assert not changed(epsilon=0.0)
    G = part.G.copy()
    G[0, 0] = -part.epsilon
    assert not changed(G=G, epsilon=-part.epsilon)
    L = part.L.copy()
    L[1, 1] *= 1.1
    assert not changed(L=L)
    assert not Proof(proof.polynomial, ()).holds()
    for monomial in [(0, 0), (0, 1, 1), (1, 1, 1, 1)]:  # a lower Θ, by a share that the rest cannot make up for
        lower = dict(proof.polynomial.coefficients)
        lower[monomial] = lower.get(monomial, 0) - 10 * proof.polynomial.denominator
        assert not Proof(replace(proof.polynomial, coefficients=lower), proof.parts).holds()
    beyond = dict(proof.polynomial.coefficients)
    beyond[(0,) * 5] = 1
    assert not Proof(replace(proof.polynomial, coefficients=beyond), proof.parts).holds()


def test_from_a_worse_minimum_it_finds_the_lowest_and_proves_that_one():
    """A symmetric Θ = γ₁‖GᵀRG - M‖² + a little: the mirror image of the best gains is a minimum, too, and higher."""
    _, _, sc, k, _ = drawn(8, "I2", 2)
    sc = sc.replace(synthesis_weights=(1.0, 0.02, 0.02))
    network = np.array([[1, 1, 0], [0, 1, 0], [0, 0, 1]], dtype=bool)
    objective = objective_of(sc, k, network)
    best = tadcore.synthesize(sc, step=k, adjacency=network)
    x = objective.blocks(best.rows)
    found = minimize(objective.theta, -x, jac=objective.gradient, method="BFGS", options={"gtol": 1e-12})
    assert found.fun > best.theta * (1 + 1e-6)
    bound = prove_theta(objective, objective.rows(found.x))
    assert bound.proved
    assert not bound.tight
    assert objective.theta_of(bound.lower) == pytest.approx(best.theta, rel=1e-9)
    assert bound.value == pytest.approx(best.theta, rel=1e-9)


def test_equal_minima_leave_a_gap_within_the_tolerance():
    """Without weight on S a row and its negative are equally good: no Gram matrix is definite, t has to be lower."""
    sc = tadcore.scenarios.load("paper-i1").replace(synthesis_weights=(1.0, 0.0, 0.0, 0.0))
    bound = v.theta_bound(sc, step=100, adjacency=[[0, 1, 0, 0], [1, 0, 0, 1], [0, 0, 0, 0]], order=2)
    assert bound.proved
    assert bound.tight
    assert bound.relative_gap > 1e-8


@pytest.mark.parametrize("weights", [(0.0, 0.3, 0.3, 0.4), (0.25, 0.25, 0.25, 0.25)])
def test_where_there_is_nothing_to_choose_nothing_quartic_or_nothing_left(weights):
    sc = tadcore.scenarios.load("paper-i1").replace(synthesis_weights=weights)
    for network in (np.zeros((3, 4)), [[0, 1, 0, 0], [1, 0, 0, 1], [0, 0, 0, 0]]):
        bound = v.theta_bound(sc, step=100, adjacency=network, order=2)
        assert bound.proved
        assert bound.tight


def short_sighted(step):
    """A game whose players see few others: at most four unknowns."""
    radii = {"defenders[*].visibility_radius": 1.5, "target.visibility_radius": 1.5}
    return tadcore.scenarios.load("paper-i2").replace({"step": step, **radii})


def test_every_instant_of_a_run_begins_at_the_one_before(monkeypatch):
    run = tadcore.simulate(short_sighted(0.01))
    values = matrices_of(run.scenario).values(tadcore.solve_equilibrium(run.scenario).P)
    unknowns = run.adjacency[:-1].sum(axis=(1, 2))
    along = bound_along(run, values)
    assert along.proved == len(unknowns)
    assert sum(b.iterations > 0 for b in along.bounds.values()) <= 0.1 * len(unknowns)
    assert unknowns.max() == 4
    monkeypatch.setattr("tadcore.verification.bound.along.MOST", 1)
    some = bound_along(run, values)
    assert 0 < some.proved < len(unknowns)
    assert f"{some.proved} of {len(unknowns)}, 0 open, {len(unknowns) - some.proved} not tried" in some.words


def test_the_report_and_the_command_line_say_what_was_proved(capsys, tmp_path):
    sc = short_sighted(0.05)
    sc.to_toml(tmp_path / "short.toml")
    with pytest.raises(SystemExit) as left:
        cli.main(["verify", str(tmp_path / "short.toml"), "--deviations", "0", "--bound", "2"])
    assert left.value.code == 0
    printed = capsys.readouterr().out
    assert "gains.missed" in printed
    assert "0 open, 0 not tried" in printed
    run = tadcore.simulate(sc)
    run.theta[:] *= 0.5  # no gains have it
    assert not v.check_gains(run, tadcore.solve_equilibrium(sc), instants=1, bound=2)["gains.bound"].ok


def test_what_it_cannot_do_is_refused():
    sc = tadcore.scenarios.load("paper-i1")
    with pytest.raises(tadcore.ScenarioError, match="order"):
        v.theta_bound(sc, step=0, adjacency=np.zeros((3, 4)), order=3)
    with pytest.raises(tadcore.ScenarioError, match="blocks"):
        v.theta_bound(sc, step=0, adjacency=np.zeros((3, 4)), order=2, blocks=True)
    with pytest.raises(tadcore.ScenarioError, match="bound"):
        v.verify(sc, bound=3)
    more = sc.replace({"defenders": [*sc.defenders, sc.defenders[0].model_copy(update={"position": (2.0, 2.0)})]})
    with pytest.raises(tadcore.ScenarioError, match="16 unknowns that do not decouple"):
        v.theta_bound(more, step=0, adjacency=[[1, 1, 1, 1, 0]] * 4, order=2)


def test_sampled_entries_of_a_table_bound_the_share_that_is_not_proved():
    sc = short_sighted(0.1)
    table = v.prove_table(sc, trials=4, entries=30, most=4, seed=3, progress=False)
    assert (table.trials, table.entries, table.missed, table.open) == (4, 30, (), 0)
    assert table.tried == table.proved > 20
    low, high = table.interval
    assert low == 0.0
    assert high == pytest.approx(1.0 - 0.025 ** (1.0 / table.tried), rel=1e-9)  # of a binomial without a failure
    assert f"at most {100 * high:.3g} %" in repr(table)
    assert "95 % confidence" in table._repr_html_()
    assert v.prove_table(sc, trials=4, entries=30, most=4, seed=3, progress=False) == table
    few = v.prove_table(sc, trials=1, entries=1000, most=4, seed=3, progress=False)
    assert few.entries == few.visited < 1000
    assert few.interval == (0.0, 0.0)
    assert "all of them sampled" in repr(few)


def test_an_entry_that_the_search_missed_is_named(monkeypatch):
    """Gains of a worse minimum, as a search that fails would give them."""

    def worse(sc, *, step, adjacency):
        found = tadcore.synthesize(sc, step=step, adjacency=adjacency)
        return replace(found, rows=0.0 * found.rows)

    monkeypatch.setattr("tadcore.verification.bound.sampled.synthesize", worse)
    table = v.prove_table(short_sighted(0.1), trials=3, entries=20, most=4, seed=3, progress=False)
    assert table.missed
    assert table.proved + len(table.missed) + table.open == table.tried
    assert table.missed[0].bound.lower is not None
    assert "missed at k" in table._repr_html_()
    assert table.interval[0] > 0.0


@pytest.mark.parametrize("bad", [{"trials": 0}, {"entries": 0}, {"most": 15}, {"level": 1.0}, {"half_width": 0.0}])
def test_a_table_is_not_begun_with_arguments_out_of_range(bad):
    with pytest.raises(tadcore.ScenarioError, match=next(iter(bad))):
        v.prove_table("paper-i1", **bad)
