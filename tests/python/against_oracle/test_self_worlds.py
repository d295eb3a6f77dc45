"""The oracle of worlds by itself: known answers of the generator, laws of chains, closures against SciPy's graphs."""

import numpy as np
import pytest
from scipy import stats
from scipy.sparse import csgraph, csr_array

from oracle import chains, relay, worlds
from oracle.model import uniform
from oracle.philox import SENSOR, SHOCK, philox, uniforms

KNOWN_ANSWERS = [
    ("00000000 00000000 00000000 00000000 00000000 00000000", "6627e8d5 e169c58d bc57ac4c 9b00dbd8"),
    ("ffffffff ffffffff ffffffff ffffffff ffffffff ffffffff", "408f276d 41c83b0e a20bc7c6 6d5451fd"),
    ("243f6a88 85a308d3 13198a2e 03707344 a4093822 299f31d0", "d16cfe09 94fdcceb 5001e420 24126ea1"),
]
"""kat_vectors of Random123 1.14: four words of counter, two of key."""


@pytest.mark.parametrize(("given", "expected"), KNOWN_ANSWERS)
def test_philox_gives_its_authors_answers(given, expected):
    words = [int(word, 16) for word in given.split()]
    assert [int(word) for word in philox(words[:4], words[4:])] == [int(word, 16) for word in expected.split()]


def test_numbers_are_uniform_and_those_of_neighbouring_blocks_independent():
    index = np.arange(200_000)
    for trial in (0, 2**32 + 5, 2**56 - 1):
        a, b = uniforms(2**64 - 1, trial, SENSOR, 3, index)
        for numbers in (a, b):
            assert 0 < numbers.min() < numbers.max() < 1
            assert stats.chisquare(np.histogram(numbers, 50, (0, 1))[0]).pvalue > 1e-4
        for one, other in ((a, b), (a[:-1], a[1:])):
            assert stats.chisquare(np.histogram2d(one, other, 12, [(0, 1)] * 2)[0].ravel()).pvalue > 1e-4
    blocks = [uniforms(7, trial, purpose, 1, 0)[0] for trial in (0, 1, 2**32) for purpose in (SENSOR, SHOCK)]
    assert len(set(map(float, blocks))) == 6


def flat_chain(up, down, step, steps, trials, *, stationary=False):
    """The states of one sensor in many trials, (trials, steps + 1)."""
    draws = uniforms(11, np.arange(trials)[:, None], SENSOR, 0, np.arange(steps + 2)[None])[0]
    return np.array([chains.states(up, down, step, steps, row.__getitem__, stationary=stationary) for row in draws])


@pytest.mark.parametrize(("up", "down"), [(3.0, 0.2), (0.5, 1.0), (0.004, 0.02)])
def test_chains_have_their_stationary_law(up, down):
    trials = 4_000
    share = up / (up + down)
    assert chains.stationary_share(up, down) == pytest.approx(share)
    states = flat_chain(up, down, 0.01, 150, trials, stationary=True)
    for k in (0, 1, 70, 150):
        count = int(states[:, k].sum())
        assert stats.chisquare([count, trials - count], [share * trials, (1 - share) * trials]).pvalue > 1e-4


def test_chains_forget_as_a_chain_in_continuous_time_does():
    """P(up at t) from "up" is b/(a+b) + a/(a+b) exp(-(a+b)t), at every instant of the grid and for any step."""
    up, down, trials = 0.5, 0.3, 4_000
    a, b = 1 / up, 1 / down
    for step in (0.05, 0.025):
        states = flat_chain(up, down, step, round(1.0 / step), trials)
        for t in (0.1, 0.3, 1.0):
            p = (b + a * np.exp(-(a + b) * t)) / (a + b)
            count = int(states[:, round(t / step)].sum())
            assert stats.chisquare([count, trials - count], [p * trials, (1 - p) * trials]).pvalue > 1e-4


def test_the_law_at_common_instants_is_exact_in_the_step():
    """The chance of each history over the instants 0, δ, 2δ, 3δ is the same where δ is halved, as matrices."""
    for up, down in ((0.5, 0.3), (3.0, 0.02), (1.0, np.inf), (np.inf, 1.0)):
        once, half = (chains.leaving(up, down, step) for step in (0.1, 0.05))

        def matrix(pair):
            return np.array([[1 - pair[0], pair[0]], [pair[1], 1 - pair[1]]])

        assert np.allclose(matrix(half) @ matrix(half), matrix(once), rtol=1e-14, atol=0)
    coarse = flat_chain(0.5, 0.3, 0.1, 3, 6_000)
    fine = flat_chain(0.5, 0.3, 0.05, 6, 6_000)[:, ::2]
    codes = [np.bincount(s[:, 1:] @ [4, 2, 1], minlength=8) for s in (coarse, fine)]
    assert stats.chi2_contingency(codes).pvalue > 1e-4


def test_holding_times_are_geometric():
    u, p = (np.arange(100_000) + 0.5) / 100_000, 0.13
    waits = np.array([chains.wait(x, p) for x in u])
    for h in (1, 2, 5, 20):
        assert np.mean(waits == h) == pytest.approx(p * (1 - p) ** (h - 1), abs=2e-5)
    up, down, step = 0.1, 0.06, 0.02
    states = flat_chain(up, down, step, 400, 300)
    p_up, _ = chains.leaving(up, down, step)
    held = [np.diff(np.flatnonzero(np.r_[True, s[1:] != s[:-1]])) for s in states]
    of_up = np.concatenate([h[::2] for h in held])  # every second one: chains begin up
    most = 12
    expected = np.array([p_up * (1 - p_up) ** (h - 1) for h in range(1, most)])
    counts = np.array([np.sum(of_up == h) for h in range(1, most)] + [np.sum(of_up >= most)])
    law = np.r_[expected, 1 - expected.sum()] * len(of_up)
    assert len(of_up) > 5_000
    assert stats.chisquare(counts, law).pvalue > 1e-4


def test_a_chain_that_never_fails_draws_nothing_and_one_for_good_stays_down():
    def none(_index):
        raise AssertionError

    assert chains.states(np.inf, 1.0, 0.1, 10, none).all()
    assert chains.states(np.inf, np.inf, 0.1, 10, none, stationary=True).all()
    gone = flat_chain(0.2, np.inf, 0.1, 40, 200)
    assert (np.diff(gone.astype(int)) <= 0).all()
    assert not flat_chain(0.2, np.inf, 0.1, 3, 50, stationary=True).any()


def test_common_draws_are_monotone_in_the_mean_times():
    """With the same draws a longer mean time up never brings the first failure earlier, nor a shorter repair a later
    return; and the share of time up of one trial is close for close rates."""
    first = []
    for up in (0.1, 0.2, 0.4, 0.8):
        states = flat_chain(up, np.inf, 0.01, 200, 300)
        first.append(np.where(states.all(axis=1), 201, states.argmin(axis=1)))
    assert (np.diff(np.array(first), axis=0) >= 0).all()
    assert (np.array(first[0]) < first[-1]).any()
    begin = np.array([flat_chain(0.5, down, 0.01, 0, 500, stationary=True)[:, 0] for down in (0.1, 0.5, 2.0)])
    assert (np.diff(begin.astype(int), axis=0) <= 0).all()
    a, b = (flat_chain(0.4, d, 0.01, 100, 100) for d in (0.2, 0.202))
    assert np.mean(a != b) < 0.1


def closure_by_graphs(seen, heard, relays, common):
    """Rows of the network by SciPy: shortest paths among reporters, connected components of what they see."""
    m, N = seen.shape
    hops = csgraph.shortest_path(csr_array(heard.astype(float)), unweighted=True)
    out = np.zeros_like(seen)
    for i in range(m):
        members = np.flatnonzero(hops[i] <= (np.inf if relays is None else relays + 1))
        members = members[np.isfinite(hops[i][members])]
        graph = np.zeros((N + 1, N + 1))
        for p in members:
            graph[p, :N] += seen[p]
            graph[p, N] += seen[p, p]
            if common:
                graph[i, p] += 1
        np.fill_diagonal(graph, 0)
        _, labels = csgraph.connected_components(csr_array(graph), directed=False)
        out[i] = labels[:N] == labels[i]
        out[i, i] = labels[N] == labels[i]
    return out


@pytest.mark.parametrize("common", [False, True])
@pytest.mark.parametrize("relays", [None, 0, 1, 2, 3, 11])
def test_closures_are_those_of_graphs(common, relays):
    rng = np.random.default_rng([81, common, relays or 99])
    differ = 0
    for n in range(1, 13):
        for m in (n, n + 1):
            for _ in range(6):
                seen = rng.random((m, n + 1)) < rng.uniform(0.05, 0.5)
                heard = (rng.random((m, m)) < rng.uniform(0.05, 0.5)) & ~np.eye(m, dtype=bool)
                ours = relay.relay(seen, heard, relays, common)
                assert np.array_equal(ours, closure_by_graphs(seen, heard, relays, common))
                assert (ours >= seen).all()
                differ += bool((ours != seen).any())
                assert np.array_equal(relay.relay(seen, np.zeros_like(heard)), seen)
                wider = relay.relay(seen, heard, None if relays is None else relays + 1, common)
                assert (wider >= ours).all()
    assert differ > 60


def test_a_chain_of_reporters_by_hand():
    """d3 sees the attacker and d2, d2 sees d1; each hears the next. What d1 makes of it depends on the relays."""
    seen = np.zeros((3, 4), dtype=bool)
    seen[2, 2] = seen[2, 1] = seen[1, 0] = True
    heard = np.zeros((3, 3), dtype=bool)
    heard[0, 1] = heard[1, 2] = True
    alone, told = (relay.relay(seen, heard, relays) for relays in (0, 1))
    assert alone[0].tolist() == [False, True, False, False]  # told by d2 alone, from whom it has its own place
    assert told[0].tolist() == [True, True, True, False]
    assert alone[1].tolist() == told[1].tolist() == [True, True, True, False]
    assert relay.relay(seen, heard, 0, common=True)[0].tolist() == [False, True, False, False]
    blind = np.zeros((3, 4), dtype=bool)
    blind[2, 2] = True
    assert relay.relay(blind, heard, None)[0].tolist() == [False] * 4  # nobody has d1 and d3 in one picture
    assert relay.relay(blind, heard, None, common=True)[0].tolist() == [True, True, True, False]


def test_complete_links_and_connected_sight_are_full_sight():
    rng, tried = np.random.default_rng(82), 0
    for n in (1, 2, 3, 5):
        for m in (n, n + 1) * 3:
            seen = np.zeros((m, n + 1), dtype=bool)
            order = rng.permutation(n + 2)
            for place, q in enumerate(order[1:], 1):  # a random tree over all players, each edge seen from some end
                p = order[rng.integers(place)]
                p, q = (p, q) if p < m and (q >= m or rng.random() < 0.5) else (q, p)
                if p >= m:
                    break
                seen[p, p if q == n + 1 else q] = True
            else:
                heard = ~np.eye(m, dtype=bool)
                assert relay.relay(seen, heard).all()
                tried += 1
    assert tried >= 4


def test_disturbances_have_their_variance_and_depend_on_nothing_else():
    game = uniform("I1", (1.0,), 1.0, 1.0, horizon=40.0, step=0.01)
    world = worlds.still(game, disturbance=np.array([0.3, 0.0, 0.1]))
    for axes in (2, 3):
        course = worlds.Course(world, game, axes, seed=5, trial=9)
        shocks = np.array([course.shock(k) for k in range(4_000)])
        assert not shocks[:, 1].any()
        for player, size in ((0, 0.3), (2, 0.1)):
            unit = shocks[:, player] / (size * 0.1)
            assert all(stats.kstest(axis, "norm").pvalue > 1e-4 for axis in unit.T)
            assert np.abs(np.corrcoef(unit.T) - np.eye(axes)).max() < 0.07
        assert abs(np.corrcoef(shocks[:, 0, 0], shocks[:, 2, 0])[0, 1]) < 0.07
    again = worlds.Course(worlds.still(game, disturbance=np.array([0.6, 0.2, 0.0])), game, 2, seed=5, trial=9)
    assert np.allclose(again.shock(7)[0], 2 * worlds.Course(world, game, 2, seed=5, trial=9).shock(7)[0], rtol=1e-15)
