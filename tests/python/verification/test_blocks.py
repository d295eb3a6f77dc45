"""Scalars and blocks: what a certificate covers, against the quadratic forms in NumPy and descents in full blocks."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

import tadcore
from oracle.scenario import as_mapping
from samples import random_game, random_network, random_start
from tadcore import verification as v
from tadcore.verification.oracle.matrices import matrices_of
from tadcore.verification.oracle.objective import FullObjective

TURNING = """
interaction = "I1"
horizon = 3.0
step = 0.05
synthesis_weights = [0.206, 0.517, 0.983, 0.055]
[attacker]
position = [-2.111, 2.557]
control_weight = 1.861
capture_radius = 0.1
target_running_weight = 1.706
target_terminal_weight = 1.016
evasion = 1.0
[target]
position = [-0.514, -1.180]
control_weight = 2.879
running_weight = 1.850
terminal_weight = 0.929
[[defenders]]
position = [2.707, -0.701]
control_weight = 0.682
capture_radius = 0.1
visibility_radius = 1.641
running_weight = 2.670
terminal_weight = 0.403
evasion_running_weight = 0.650
evasion_terminal_weight = 1.561
[[defenders]]
position = [0.777, 2.966]
control_weight = 0.419
capture_radius = 0.1
visibility_radius = 1.213
running_weight = 1.160
terminal_weight = 1.278
evasion_running_weight = 0.319
evasion_terminal_weight = 0.339
[[defenders]]
position = [0.828, 1.544]
control_weight = 0.987
capture_radius = 0.1
visibility_radius = 2.221
running_weight = 2.093
terminal_weight = 0.657
evasion_running_weight = 0.506
evasion_terminal_weight = 1.588
"""


def turning():
    """A game, an instant and a network where blocks that turn have a lower Θ than the certified scalars."""
    return (
        tadcore.Scenario.from_toml_string(TURNING),
        58,
        np.array([[0, 0, 0, 0], [0, 0, 1, 0], [0, 1, 0, 0]], dtype=bool),
    )


def values_of(sc, k):
    return matrices_of(sc).values(tadcore.solve_equilibrium(sc).P)[:, k]


def full(sc, k, network):
    return FullObjective(sc, matrices_of(sc), values_of(sc, k), network)


def spectrum(sc, k, network, rows, kind):
    """Smallest over largest eigenvalue of the certificate's form over blocks of one kind, from the Θ of full blocks.

    The form is the Hessian without what the first term's own square adds: the polarisation of Θ, less that.
    """
    objective = full(sc, k, network)
    x = objective.blocks(rows)
    basis = np.kron(np.eye(objective.unknowns // 4), np.array([kind]).reshape(1, 4))
    H = basis @ objective.hessian_product(x, basis).T
    G, g1 = objective.rows(x), objective.gamma[0]
    R = objective.R
    V = objective.rows(basis)
    square = np.stack([step.T @ (R * G) + (R * G).T @ step for step in V])
    H = H - g1 * 2.0 * np.einsum("vab,wab->vw", square, square) / objective.dim
    low = np.linalg.eigvalsh(H)
    return low[0] / max(abs(low[0]), abs(low[-1]))


@given(seed=st.integers(0, 2**32 - 1), n=st.integers(1, 3), interaction=st.sampled_from(["I1", "I2"]))
@settings(max_examples=40)
def test_the_flags_are_the_definiteness_of_the_two_forms(seed, n, interaction):
    rng = np.random.default_rng(seed)
    game = random_game(rng, interaction, n, horizon=0.6, step=0.05)
    sc = tadcore.Scenario.model_validate(as_mapping(game, random_start(rng, game)))
    k, network = int(rng.integers(game.steps + 1)), random_network(rng, game, rng.uniform(0.2, 0.9))
    if sc.dim != 2 or not network.any():
        return
    found = tadcore.synthesize(sc, step=k, adjacency=network)
    kinds = [[[1, 0], [0, 1]], [[1, 0], [0, -1]], [[0, 1], [1, 0]], [[0, -1], [1, 0]]]
    scalar, first, second, turning = (spectrum(sc, k, network, found.rows, kind) for kind in kinds)
    assert first == pytest.approx(scalar, abs=1e-9)  # symmetric blocks have the form of scalars
    assert second == pytest.approx(scalar, abs=1e-9)
    if interaction == "I2":
        assert turning == pytest.approx(scalar, abs=1e-9)
        assert found.certified_blocks == found.certified
    if min(abs(scalar), abs(turning)) > 1e-8 and not network.all():
        assert found.certified == (scalar > 0)
        assert found.certified_blocks == (scalar > 0 and turning > 0)


def test_a_certificate_among_scalars_need_not_cover_blocks():
    sc, k, network = turning()
    found = tadcore.synthesize(sc, step=k, adjacency=network)
    assert found.certified
    assert not found.certified_blocks
    objective = full(sc, k, network)
    best = v.multistart(objective, objective.blocks(found.rows), 12, np.random.default_rng(0))
    assert best < found.theta * (1 - 1e-4)


def test_no_descent_in_full_blocks_goes_below_a_certificate_that_covers_them():
    covered = beaten = 0
    for seed in range(20):
        rng = np.random.default_rng(seed)
        sc, k, _ = turning()
        sc = sc.replace({f"defenders[{i}].control_weight": float(np.exp(rng.uniform(-1, 1))) for i in range(3)})
        network = rng.random((3, 4)) < 0.4
        found = tadcore.synthesize(sc, step=k, adjacency=network)
        if found.certified_blocks and network.any():
            objective = full(sc, k, network)
            best = v.multistart(objective, objective.blocks(found.rows), 2, rng)
            covered += 1
            beaten += best < found.theta - 1e-8 * max(found.theta, 1e-10)
    assert covered > 5
    assert not beaten


def test_where_nothing_is_certified_neither_flag_is_set():
    sc, k, network = turning()
    stopped = tadcore.synthesize(sc, step=k, adjacency=network, max_iterations=1)
    assert not stopped.certified
    assert not stopped.certified_blocks


def test_both_mirror_images_are_critical_in_full_blocks_and_no_full_blocks_are_lower():
    sc, k, network = turning()
    objective = full(sc, k, network)
    gains, mirror = (
        tadcore.synthesize(sc, step=k, adjacency=network, gains="turning", mirror=mirror) for mirror in (False, True)
    )
    for image in (gains, mirror):
        K = np.stack([image.K[label].reshape(2, -1, 2).transpose(1, 0, 2) for label in image.players])
        blocks = np.concatenate([K[i, j].ravel() for i, j in objective.seen])
        assert objective.theta(blocks) == pytest.approx(gains.theta, rel=1e-12)
        assert np.abs(objective.gradient(blocks)).max() < 1e-10 * objective.gradient_scale(blocks)
    scalars = tadcore.synthesize(sc, step=k, adjacency=network).rows
    best = v.multistart(objective, objective.blocks(scalars), 12, np.random.default_rng(1))
    assert gains.theta == pytest.approx(best, rel=1e-7)


def test_along_a_game_of_which_turning_gains_are_lower_the_study_says_so():
    sc, _, _ = turning()
    study = v.turning_study(sc, progress=False)
    assert (study.instants, study.covered, study.lower) == (60, 57, 3)
    assert study.widest == pytest.approx(0.00603, abs=1e-5)
    assert f"{study.lower} of {study.instants}" in repr(study)
    assert str(study.mirror) in study._repr_html_()
    ends = {(end.kind, end.defender) for end in (study.scalar, study.turning, study.mirror)}
    assert study.depends == (len(ends) > 1)


def test_gains_turn_in_the_plane_alone():
    sc = tadcore.scenarios.load("paper-i1")
    at = {f"{p}.position": (*getattr(sc, p).position, 0.0) for p in ("attacker", "target")}
    space = sc.replace({**at, **{f"defenders[{i}].position": (*d.position, 0.0) for i, d in enumerate(sc.defenders)}})
    with pytest.raises(tadcore.ScenarioError, match="in the plane"):
        v.turning_study(space)


def test_along_no_run_of_the_paper_do_descents_in_full_blocks_find_less():
    """At every tenth instant: in I1 it is proved; in I2, where no certificate covers blocks, descents find none."""
    uncovered = 0
    for name in tadcore.scenarios.names():
        run = tadcore.simulate(name)
        sc, open_at = run.scenario, []
        for k in range(0, len(run.times) - 1, 10):
            gains = tadcore.synthesize(sc, step=k, adjacency=run.adjacency[k], gains="turning")
            assert not gains.turns
            if not gains.certified_blocks:
                open_at.append(k)
        uncovered += len(open_at)
        for k in open_at[:: max(len(open_at) // 2, 1)]:
            objective = full(sc, k, run.adjacency[k])
            best = v.multistart(objective, objective.blocks(run.gains[k]), 2, np.random.default_rng(k))
            assert best > run.theta[k] * (1 - 1e-8)
        if sc.interaction == "I1":
            assert not open_at  # proved
    assert uncovered > 10


def test_verify_measures_the_gap_and_says_whether_the_outcome_depends_on_it():
    report = v.verify(turning()[0], deviations=0, instants=1, turning=True)
    (gap,) = [m for m in report.measurements if m.name == "turning.gap"]
    assert gap.value == pytest.approx(0.00603, abs=1e-5)
    assert any("does not depend on the choice of gains" in note for note in report.notes)
