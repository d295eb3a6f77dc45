"""The network in the paper's form: Example 1 entry by entry, radii, edges."""

import numpy as np
import pytest

from tadcore import ScenarioError, VisibilityNetwork, scenarios
from tadcore.game.changes import NetworkChange, changes_of, intervals_of

# Example 1 of the paper: n = 4, the network of panel (b).I1 at t₁.
EXAMPLE = VisibilityNetwork([[1, 1, 0, 0, 0], [1, 1, 1, 1, 0], [0, 0, 0, 0, 0], [0, 0, 1, 0, 1]])


def test_example_1_adjacency_and_its_parts():
    assert EXAMPLE.Ad.tolist() == [[0, 1, 0, 0], [1, 0, 1, 1], [0, 0, 0, 0], [0, 0, 1, 0]]
    assert EXAMPLE.Phi_a.tolist() == np.diag([1, 1, 0, 0]).tolist()
    assert EXAMPLE.Phi_tau.tolist() == [[0], [0], [0], [1]]
    whole = np.hstack([EXAMPLE.Phi_a + EXAMPLE.Ad, EXAMPLE.Phi_tau])
    assert whole.tolist() == EXAMPLE.adjacency.astype(int).tolist()


def test_example_1_information_matrix_of_d2():
    sees = np.diag([1, 1, 1, 1, 0])
    relative = [[1, -1, 0, 0, 0], [0, 1, 0, 0, 0], [0, -1, 1, 0, 0], [0, -1, 0, 1, 0], [0, -1, 0, 0, 1]]
    assert np.array_equal(EXAMPLE.information_matrix("d2"), np.kron(sees @ relative, np.eye(2)))
    assert EXAMPLE.information_matrix("d2").shape == (10, 10)
    assert EXAMPLE.information_matrix(1, dim=3).shape == (15, 15)


def test_example_1_strategy_of_d2_uses_whom_it_sees():
    rng = np.random.default_rng(1)
    gains, z = rng.normal(size=(2, 10)), rng.normal(size=(5, 2))
    blocks = gains.reshape(2, 5, 2).swapaxes(0, 1)
    z1, z2, z3, z4, _ = z
    expected = blocks[1] @ z2 + blocks[0] @ (z1 - z2) + blocks[2] @ (z3 - z2) + blocks[3] @ (z4 - z2)
    assert np.allclose(gains @ EXAMPLE.information_matrix("d2") @ z.ravel(), expected, rtol=1e-13)


def test_example_1_edges_and_team():
    assert EXAMPLE.edges() == (
        ("d1", "d2"),
        ("d1", "attacker"),
        ("d2", "d1"),
        ("d2", "d3"),
        ("d2", "d4"),
        ("d2", "attacker"),
        ("d4", "d3"),
        ("d4", "target"),
    )
    team = EXAMPLE.information_matrix_team
    assert team.shape == (40, 10)
    assert np.array_equal(team[10:20], EXAMPLE.information_matrix("d2"))
    assert not team[20:30].any()


def test_the_target_of_i2_has_a_row_whose_own_entry_is_the_attacker():
    net = VisibilityNetwork([[0, 0, 1], [0, 0, 0], [1, 0, 1]])
    assert net.observers == ("d1", "d2", "target")
    assert net.edges() == (("d1", "target"), ("target", "d1"), ("target", "attacker"))
    expected = np.diag([1, 0, 1]) @ np.array([[1, 0, -1], [0, 1, -1], [0, 0, 1]])
    assert np.array_equal(net.information_matrix("target", dim=1), expected)
    assert net.Phi_tau.tolist() == [[1], [0]]


def test_the_paper_starts_with_these_edges():
    start = VisibilityNetwork.from_positions(scenarios.load("paper-i1"))
    assert start.edges() == (
        ("d1", "d2"),
        ("d1", "d3"),
        ("d1", "target"),
        ("d1", "attacker"),
        ("d2", "d1"),
        ("d2", "target"),
        ("d3", "d1"),
    )
    two = VisibilityNetwork.from_positions(scenarios.load("paper-i2"))
    assert two.observers == ("d1", "d2", "d3", "target")
    assert ("target", "attacker") not in two.edges()
    assert VisibilityNetwork.from_positions(scenarios.load("paper-i2-full")).adjacency.all()


def test_the_edge_of_the_disc_is_seen():
    sc = scenarios.load("paper-i1").replace({"defenders[0].visibility_radius": 1.0})
    at = np.array([[0, 0], [1.0, 0], [np.nextafter(1.0, 2), 0], [5, 5], [0, -1.0]])
    assert VisibilityNetwork.from_positions(sc, at).adjacency[0].tolist() == [True, True, False, False]


def test_changes_and_intervals_from_a_record():
    a = np.array([[1, 0]], dtype=bool)
    b = np.array([[1, 1]], dtype=bool)
    c = np.array([[0, 1]], dtype=bool)
    times = np.arange(5) / 10
    changes = changes_of(times, np.array([a, a, b, c, c]), ("d1", "target", "attacker"))
    assert changes == (
        NetworkChange(0.0, (("d1", "attacker"),), ()),
        NetworkChange(0.2, (("d1", "target"),), ()),
        NetworkChange(0.3, (), (("d1", "attacker"),)),
    )
    assert intervals_of(changes, 0.5) == (
        (0.0, 0.2, (("d1", "attacker"),)),
        (0.2, 0.3, (("d1", "target"), ("d1", "attacker"))),
        (0.3, 0.5, (("d1", "target"),)),
    )


def test_a_network_is_a_value():
    again = VisibilityNetwork(EXAMPLE.adjacency.astype(float))
    assert again == EXAMPLE
    assert hash(again) == hash(EXAMPLE)
    assert VisibilityNetwork([[0, 0]]) != EXAMPLE
    assert repr(VisibilityNetwork([[1, 0]])) == "VisibilityNetwork(d1→attacker)"
    assert repr(VisibilityNetwork([[0, 0]])) == "VisibilityNetwork(no edges)"
    with pytest.raises(ValueError, match="read-only"):
        EXAMPLE.adjacency[0, 0] = False


@pytest.mark.parametrize(
    ("adjacency", "field"),
    [
        ([1, 0], "adjacency"),
        ([[1, 0], [0]], "adjacency"),
        ([[1]], "adjacency"),
        (np.ones((3, 2)), "adjacency"),
        ([["a", "b"]], "adjacency"),
        ([[1, 2]], "adjacency[0, 1]"),
        ([[np.nan, 1]], "adjacency[0, 0]"),
    ],
)
def test_what_is_no_adjacency(adjacency, field):
    with pytest.raises(ScenarioError) as caught:
        VisibilityNetwork(adjacency)
    assert caught.value.field == field


def test_players_without_limits_have_no_information_matrix():
    for player in ("attacker", "target", 4, -1, None):
        with pytest.raises(ScenarioError, match="a player with limited sight: d1, d2, d3, d4"):
            EXAMPLE.information_matrix(player)
