"""Whole runs: the eight of the paper, positions and all; random games by outcome, times and network changes."""

import numpy as np
import pytest

import tadcore
from oracle import costs as oracle_costs
from oracle.model import paper_cases
from oracle.network import number
from oracle.riccati import equilibrium
from oracle.scenario import as_mapping, from_table
from oracle.stepping import Gains, simulate

CASES = {case.name: case for case in paper_cases()}
BUNDLED = {
    "I1 full": "paper-i1-full",
    "I1 limited": "paper-i1",
    "I1 suicidal full": "paper-i1-suicidal-full",
    "I1 suicidal limited": "paper-i1-suicidal",
    "I2 full": "paper-i2-full",
    "I2 far target": "paper-i2-far",
    "I2 near target": "paper-i2",
    "I2 wider d3": "paper-i2-wide",
}


def scenario(game, start):
    return tadcore.Scenario.model_validate(as_mapping(game, start))


def change_steps(run):
    """Steps of the network changes and the network from each on, from the public record."""
    step = run.scenario.step
    steps = [round(change.time / step) for change in run.network_changes]
    assert [change.time for change in run.network_changes] == pytest.approx([k * step for k in steps], abs=1e-9)
    return steps, [number(run.adjacency[k]) for k in steps]


def check_outcome(run, expected, step):
    assert run.outcome.kind == expected["kind"]
    assert run.outcome.defender == expected["defender"]
    assert run.outcome.time == pytest.approx(expected["step"] * step, abs=1e-9)
    assert len(run.times) == expected["step"] + 1
    assert change_steps(run) == (expected["changes"], expected["networks"])


@pytest.mark.parametrize("name", CASES)
def test_paper_run_is_the_oracles(name, reference):
    case = CASES[name]
    expected = next(r for r in reference("paper_runs")["runs"] if r["name"] == name)
    run = tadcore.simulate(scenario(case.game, case.start))
    check_outcome(run, expected, case.game.step)
    assert np.max(np.abs(run.position[expected["steps"]] - expected["positions"])) <= 1e-8
    assert run.theta[expected["steps"][:-1]] == pytest.approx(expected["theta"], rel=1e-8, abs=1e-12)
    assert list(run.costs.values()) == pytest.approx(expected["costs"], rel=1e-8)
    assert run.converged


@pytest.mark.parametrize("name", CASES)
def test_paper_numbers(name):
    case = CASES[name]
    run = tadcore.simulate(tadcore.scenarios.load(BUNDLED[name]))
    assert (run.outcome.kind, run.outcome.defender) == (case.kind, case.defender)
    assert run.outcome.time == pytest.approx(case.time, abs=1e-9)
    if case.changes is not None:
        times = [change.time for change in run.network_changes]
        assert times == pytest.approx([0.0, *case.changes], abs=1e-9)
    for key, time in case.known.items():
        assert key == "first_edge_of_d3"
        first = next(c.time for c in run.network_changes if any(seer == "d3" for seer, _ in c.added))
        assert first == pytest.approx(time, abs=1e-9)


def test_a_run_played_by_the_oracle_now():
    """The tables are not taken on trust: one limited run is played afresh, every instant compared."""
    case = CASES["I1 limited"]
    played = simulate(case.game, case.start, Gains(case.game, few=0, many=1))
    run = tadcore.simulate(scenario(case.game, case.start))
    assert run.outcome.time == pytest.approx(played.time, abs=1e-9)
    assert np.max(np.abs(run.position - np.array(played.positions))) <= 1e-8
    assert np.array_equal(run.adjacency[:-1], np.array(played.networks))
    assert np.allclose(run.gains[:-1], [f.rows for f in played.found], rtol=0, atol=1e-9)
    controls = [rows @ (x[:-1] - x[-1]) for rows, x in zip(played.loops, played.positions, strict=False)]
    assert np.allclose(run.control[:-1], controls, rtol=0, atol=1e-8)
    assert list(run.costs.values()) == pytest.approx(oracle_costs.costs(case.game, played), rel=1e-8)


def test_random_games_one_by_one(reference):
    games = reference("random_games")["games"]
    assert len(games) >= 200
    wrong, refused, kinds = [], 0, set()
    for i, entry in enumerate(games):
        game, start = from_table(entry)
        sc = scenario(game, start)
        if "escape_backward_time" in entry:
            with pytest.raises(tadcore.NoEquilibriumError) as caught:
                tadcore.simulate(sc)
            assert caught.value.escape_time == pytest.approx(entry["escape_backward_time"], rel=1e-7)
            refused += 1
            continue
        expected = entry["expected"]
        run = tadcore.simulate(sc)
        kinds.add(run.outcome.kind)
        try:
            check_outcome(run, expected, game.step)
            final = np.array(expected["final"])
            assert np.max(np.abs(run.position[-1] - final)) <= 1e-7 * (1 + np.max(np.abs(final)))
        except AssertionError as error:
            wrong.append((i, str(error).splitlines()[0]))
    assert not wrong
    assert kinds == {"intercepted", "captured", "timeout"}
    assert refused >= 5


def test_random_games_in_batches(reference):
    codes = {"timeout": 0, "captured": 1, "intercepted": 2}
    played = 0
    for entry in reference("random_games")["games"]:
        game, start = from_table(entry)
        sc = scenario(game, start)
        # The second row is another start, so that the first is not alone in its table.
        positions = np.array([start.positions, start.positions[::-1]])
        if "escape_backward_time" in entry:
            with pytest.raises(tadcore.NoEquilibriumError):
                tadcore.simulate_batch(sc, positions)
            continue
        expected = entry["expected"]
        batch = tadcore.simulate_batch(sc, positions, threads=1)
        assert batch.kind[0] == codes[expected["kind"]]
        assert batch.defender[0] == (-1 if expected["defender"] is None else expected["defender"])
        assert batch.time[0] == pytest.approx(expected["step"] * game.step, abs=1e-9)
        played += 1
    assert played >= 150


def test_radii_of_a_batch_are_those_of_its_rows():
    cases = [c for c in CASES.values() if c.game.interaction == "I2"]
    starts = [c.start for c in cases]
    sc = scenario(cases[0].game, cases[0].start)
    batch = tadcore.simulate_batch(
        sc,
        np.array([s.positions for s in starts]),
        visibility_radii=np.array([s.zeta for s in starts]),
        capture_radii=np.array([s.sigma for s in starts]),
    )
    assert batch.time == pytest.approx([c.time for c in cases], abs=1e-9)
    assert [int(d) for d in batch.defender] == [-1 if c.defender is None else c.defender for c in cases]


@pytest.mark.parametrize("n", [1, 3])
def test_the_nearest_defender_within_its_own_radius_intercepts(n):
    """Interception comes before capture; a near defender with a small radius leaves it to one with a wide one."""
    game = CASES["I1 full"].game
    game = type(game)(
        **{
            **vars(game),
            "r_d": (1.0,) * n,
            "q_da": (1.0,) * n,
            "f_da": (1.0,) * n,
            "q_ad": (1.0,) * n,
            "f_ad": (1.0,) * n,
            "horizon": 1.0,
        }
    )
    attacker, target = [0.0, 0.0], [0.05, 0.0]
    near = [[0.3 - 0.1 * i, 0.0] for i in range(n)]  # the last is the nearest
    positions = np.array([*near, target, attacker])
    start = type(CASES["I1 full"].start)
    outcome = tadcore.simulate(scenario(game, start(positions, np.full(n, np.inf), np.full(n + 1, 0.5)))).outcome
    assert (outcome.kind, outcome.defender, outcome.time) == ("intercepted", n - 1, 0.0)
    sigma = np.full(n + 1, 0.5)
    sigma[n - 1] = 0.01
    outcome = tadcore.simulate(scenario(game, start(positions, np.full(n, np.inf), sigma))).outcome
    expected = ("captured", None, 0.0) if n == 1 else ("intercepted", n - 2, 0.0)
    assert (outcome.kind, outcome.defender, outcome.time) == expected
    assert equilibrium(game).shape == (201, 3, n + 1, n + 1)
