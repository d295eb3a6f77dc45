"""Extreme but valid games: the right answer, or a refusal that says why; never NaN, a hang or a panic.

"Right" is measured against what no solver of ours knows: units of time and of cost that are changed by powers of
two, a Hamiltonian solved in decimal numbers of 500 digits, distances of whole numbers, one step by SciPy's exponential.
"""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import expm

import tadcore
from oracle.decimals import exact_P
from oracle.model import uniform
from oracle.riccati import equilibrium, feedback, integrate
from oracle.scenario import as_mapping, game_of
from samples import ESCAPES, random_game, random_start
from tadcore import NoEquilibriumError, ScenarioError, TadcoreError

BOTH = pytest.mark.parametrize("interaction", ["I1", "I2"])
TIMED = ("running_weight", "target_running_weight", "evasion_running_weight")


def scenario(interaction, n=2, horizon=1.0, step=0.05, sigma=0.1, zeta=1.6, **parts):
    """Defenders at whole numbers of the first axis, the target above them, the attacker beyond."""
    target = {
        "position": (0.0, 1.0),
        "control_weight": 1.2,
        **({"visibility_radius": zeta} if interaction == "I2" else {}),
    }
    defender = {"control_weight": 1.0, "capture_radius": sigma, "visibility_radius": zeta}
    return tadcore.Scenario(
        interaction=interaction,
        horizon=horizon,
        step=step,
        attacker={"position": (2.0, 2.0), "control_weight": 0.8, "capture_radius": sigma, **parts.get("attacker", {})},
        target=target | parts.get("target", {}),
        defenders=[defender | {"position": (float(i), 0.0)} | parts.get("defender", {}) for i in range(n)],
    )


def finite(run):
    numbers = [run.position, run.control, run.gains, run.theta, np.array(list(run.costs.values()))]
    return all(np.isfinite(x).all() for x in numbers)


def plays(sc):
    """Its recorded run, finite throughout and with the outcome of a batch of one; None where it is refused."""
    try:
        run = tadcore.simulate(sc)
    except TadcoreError as refusal:
        with pytest.raises(type(refusal), match=r"."):
            tadcore.simulate_batch(sc, [sc.positions])
        return None
    assert finite(run)
    assert tadcore.simulate_batch(sc, [sc.positions])[0] == run.outcome
    return run


def reweighted(sc, factor_of):
    data = sc.model_dump()
    for table in (data["attacker"], data["target"], *data["defenders"]):
        for name in [name for name in table if name.endswith("weight")]:
            table[name] *= factor_of(name)
    return data


@BOTH
@pytest.mark.parametrize("power", [-40, 20, 40])
def test_units_of_cost_over_twelve_orders_of_magnitude(interaction, power):
    """All weights times a power of two change no control, no network and no time, not by one bit."""
    sc = scenario(interaction)
    base, P = tadcore.simulate(sc), tadcore.solve_equilibrium(sc).P
    assert len(base.network_changes) > 1
    dear = tadcore.Scenario.model_validate(reweighted(sc, lambda _: 2.0**power))
    run = plays(dear)
    assert (run.outcome, run.network_changes) == (base.outcome, base.network_changes)
    assert np.array_equal(run.position, base.position)
    assert np.array_equal(run.control, base.control)
    for group, p in tadcore.solve_equilibrium(dear).P.items():
        assert np.array_equal(p, 2.0**power * P[group])


@BOTH
@pytest.mark.parametrize("power", [-20, 10, 20])
def test_units_of_time_with_weights_twelve_orders_of_magnitude_apart(interaction, power):
    """t = c s makes q c q and r r/c: the same P and, in full sight, the same path. (Θ adds what has other units.)"""
    sc, c = scenario(interaction, zeta=math.inf), 2.0**power
    base, P = tadcore.simulate(sc), tadcore.solve_equilibrium(sc).P
    data = reweighted(sc, lambda name: c if name in TIMED else 1.0 if "terminal" in name else 1.0 / c)
    quick = tadcore.Scenario.model_validate(data | {"horizon": sc.horizon / c, "step": sc.step / c})
    run = plays(quick)
    assert (run.outcome.kind, run.outcome.time * c) == (base.outcome.kind, base.outcome.time)
    assert np.allclose(run.position, base.position, rtol=0, atol=1e-12)
    for group, p in tadcore.solve_equilibrium(quick).P.items():
        assert np.allclose(p, P[group], rtol=0, atol=1e-12)


def test_random_weights_over_twelve_orders_of_magnitude_against_500_digits():
    rng = np.random.default_rng(9)
    compared = refused = 0
    while compared < 25:
        draw = SimpleNamespace(w=lambda: float(10.0 ** rng.uniform(-6, 6)))
        attacker = {"control_weight": draw.w(), "target_running_weight": draw.w(), "target_terminal_weight": draw.w()}
        defender = {name: draw.w() for name in ("control_weight", "evasion_running_weight", "evasion_terminal_weight")}
        parts = {"attacker": attacker, "defender": defender, "target": {"control_weight": draw.w()}}
        # The fastest mode turns at most 100 times, so that 500 digits are enough.
        heaviest = max(attacker["target_running_weight"], defender["evasion_running_weight"])
        lightest = min(attacker["control_weight"], defender["control_weight"], parts["target"]["control_weight"])
        horizon = rng.uniform(0.1, 100) * math.sqrt(lightest / heaviest)
        sc = scenario("I2", n=1, horizon=horizon, step=horizon / 8, **parts)
        try:
            P = tadcore.solve_equilibrium(sc).P["team"][0]
        except NoEquilibriumError as error:
            refused += 0 < error.escape_time <= horizon
            continue
        exact = exact_P(sc)
        # As large as P was on its way, rounding may have left a trace of it.
        most = np.abs(tadcore.solve_equilibrium(sc).P["team"]).max()
        assert np.max(np.abs(P - exact)) <= 1e-9 * most
        assert plays(sc) is not None
        compared += 1
    assert refused > 0


@BOTH
def test_random_weights_over_twelve_orders_of_magnitude_are_finite_or_refused(interaction):
    rng = np.random.default_rng([10, interaction == "I2"])
    answered = 0
    for _ in range(12):
        horizon = float(10 ** rng.uniform(-4, 0))
        sc = scenario(interaction, n=int(rng.integers(1, 4)), horizon=horizon, step=horizon / 4)
        data = reweighted(sc, lambda _: float(10.0 ** rng.uniform(-6, 6)))
        answered += plays(tadcore.Scenario.model_validate(data)) is not None
    assert answered > 0


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"attacker.control_weight": 5e-324}, "attacker.control_weight"),
        ({"defenders[1].evasion_running_weight": 1e308}, "defenders[1].evasion_running_weight"),
        ({"target.position": (0.0, 1e200)}, "target.position[1]"),
    ],
)
def test_numbers_beyond_all_games_are_refused_by_name(changes, field):
    with pytest.raises(ScenarioError, match="between") as caught:
        scenario("I2").replace(changes)
    assert caught.value.field == field
    sc = scenario("I1")
    far = np.array([sc.positions, sc.positions])
    far[1, 0, 0] = -1e101
    with pytest.raises(ScenarioError, match=r"positions\[1, 0, 0\]: got -1e\+101"):
        tadcore.simulate_batch(sc, far)
    vary = {"attacker.position": tadcore.sampling.Box([0, 0], [1e300, 1])}
    with pytest.raises(ScenarioError, match=r"attacker\.position\.x, trial 0: .*1e100"):
        tadcore.Study(sc, vary, trials=10).run()


def test_the_largest_and_smallest_numbers_that_are_accepted():
    for interaction in ("I1", "I2"):
        for size in (2e99, 1e-300):
            sc = scenario(interaction, zeta=math.inf, sigma=size / 10)
            run = plays(
                sc.replace({f"{p}.position": (size * i, size * i * i) for i, p in enumerate(("attacker", "target"), 1)})
            )
            assert run is not None
        for weights in (1e-29, 1e29):
            plays(tadcore.Scenario.model_validate(reweighted(scenario(interaction), lambda _: weights)))  # noqa: B023
            mixed = iter([weights, 1 / weights] * 20)
            plays(tadcore.Scenario.model_validate(reweighted(scenario(interaction), lambda _: next(mixed))))  # noqa: B023


@BOTH
def test_players_on_top_of_each_other(interaction):
    sc, here = scenario(interaction), (0.5, -0.25)
    everyone = {f"{p}.position": here for p in ("attacker", "target", "defenders[0]", "defenders[1]")}
    run = plays(sc.replace(everyone))
    assert (run.outcome.kind, run.outcome.defender, run.outcome.time) == ("intercepted", 0, 0.0)
    assert not run.control.any()
    run = plays(sc.replace({"target.position": (2.0, 2.0)}))
    assert (run.outcome.kind, run.outcome.time) == ("captured", 0.0)
    run = plays(sc.replace({"defenders[1].position": (0.0, 0.0)}))  # two defenders as one
    assert np.array_equal(run.position[0, 0], run.position[0, 1])
    assert np.allclose(run.position[:, 0], run.position[:, 1], rtol=0, atol=1e-12)
    plays(sc.replace({"defenders[0].position": (0.0, 1.0), "defenders[1].position": (0.0, 1.0)}))  # on the target


@BOTH
def test_radii_exactly_met(interaction):
    """3, 4, 5 and 6, 8, 10: a ball is closed, and the next smaller number is too small."""
    sc = scenario(interaction, n=1, sigma=5.0, zeta=10.0)
    sc = sc.replace({"attacker.position": (0, 0), "target.position": (6, 8), "defenders[0].position": (3, 4)})
    run = plays(sc)
    assert (run.outcome.kind, run.outcome.time) == ("intercepted", 0.0)
    less = math.nextafter(5.0, 0.0)
    assert plays(sc.replace({"defenders[0].capture_radius": less})).outcome.time > 0.0
    near = {"defenders[0].position": (30, 40), "target.position": (3, 4), "defenders[0].visibility_radius": 50.0}
    assert plays(sc.replace(near)).outcome.kind == "captured"
    assert plays(sc.replace({**near, "attacker.capture_radius": less})).outcome.time > 0.0
    seen = sc.replace(
        {"defenders[0].capture_radius": 0.1, "attacker.capture_radius": 0.1, "defenders[0].position": (-6, -8)}
    )
    assert plays(seen).adjacency[0, 0].tolist() == [True, False]
    short = seen.replace({"defenders[0].visibility_radius": math.nextafter(10.0, 0.0)})
    assert plays(short).adjacency[0, 0].tolist() == [False, False]
    assert plays(seen.replace({"defenders[0].visibility_radius": 20.0})).adjacency[0, 0].tolist() == [True, True]


@BOTH
@pytest.mark.parametrize("n", [1, 3])
def test_one_step_is_one_exponential(interaction, n):
    """T = δ: the equilibrium's feedback frozen at t = 0, whatever lies between."""
    rng = np.random.default_rng([17, n])
    game = random_game(rng, interaction, n, horizon=0.25, step=0.25)
    start = random_start(rng, game, sigma=1e-6)
    sc = tadcore.Scenario.model_validate(as_mapping(game, start)).replace(
        {f"defenders[{i}].visibility_radius": math.inf for i in range(n)}
    )
    if interaction == "I2":
        sc = sc.replace({"target.visibility_radius": math.inf})
    run = plays(sc)
    assert (run.outcome.kind, run.outcome.time, len(run.times)) == ("timeout", 0.25, 2)
    rows = feedback(game, equilibrium(game)[0])  # of z, for every player; velocities of all, then of z
    C = np.vstack([rows[:-1] - rows[-1], rows[-1:]])
    flow = expm(0.25 * np.hstack([C, np.zeros((n + 2, 1))]))
    end = flow @ np.vstack([start.positions[:-1] - start.positions[-1], start.positions[-1:]])
    assert np.allclose(run.position[1], np.vstack([end[:-1] + end[-1], end[-1:]]), rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", ESCAPES)
@pytest.mark.parametrize("near", [1e-2, 1e-6, 1e-9])
def test_runs_on_both_sides_of_an_exact_escape(name, near):
    """Just short of it the feedback is 1/near: frozen for a step, it may throw a player beyond the range of doubles."""
    game, pole = ESCAPES[name]
    data = as_mapping(game, random_start(np.random.default_rng(3), game))
    short = tadcore.Scenario.model_validate(data | {"horizon": (1 - near) * pole, "step": (1 - near) * pole / 40})
    P = tadcore.solve_equilibrium(short).P["team"]
    assert np.isfinite(P).all()
    assert np.abs(P[0]).max() > 0.01 / near
    if plays(short) is None:
        assert near < 1e-2
        with pytest.raises(TadcoreError, match="leaves the range of double precision by t = "):
            tadcore.simulate(short)
    beyond = tadcore.Scenario.model_validate(data | {"horizon": (1 + near) * pole, "step": (1 + near) * pole / 40})
    assert plays(beyond) is None
    with pytest.raises(NoEquilibriumError) as caught:
        tadcore.simulate(beyond)
    assert caught.value.escape_time == pytest.approx(pole, rel=1e-9)


def test_runs_on_both_sides_of_escapes_of_the_coupled_equations(reference):
    for entry in reference("escapes")["games"][:4]:
        game, pole = game_of(entry), entry["escape_backward_time"]
        data = as_mapping(game, random_start(np.random.default_rng(4), game))
        short = {"horizon": 0.99 * pole, "step": 0.99 * pole / 40}
        assert plays(tadcore.Scenario.model_validate(data | short)) is not None
        beyond = {"horizon": 1.00001 * pole, "step": 1.00001 * pole / 40}
        assert plays(tadcore.Scenario.model_validate(data | beyond)) is None


@BOTH
def test_forty_defenders_in_full_sight_play_the_equilibrium(interaction):
    """Against DOP853 of SciPy on the reduced equations, N = 41."""
    sc = scenario(interaction, n=40, horizon=0.02, step=0.01, zeta=math.inf, sigma=1e-9)
    run = plays(sc)
    team = (1.0,) * 40
    game = uniform(interaction, team, 1.2, 0.8, horizon=0.02)
    rows, z = feedback(game, integrate(game, axes=1, times=[0.0])[0]), sc.positions[:-1] - sc.positions[-1]
    assert np.allclose(run.control[0], rows @ z, rtol=0, atol=1e-8 * np.abs(rows).max() * np.abs(z).max() * 40)


def test_a_grid_or_a_team_too_large_for_memory_is_refused_before_it_is_allocated():
    for sc in (scenario("I1", n=1000, step=1e-3), scenario("I2", n=60, horizon=10.0, step=1e-6)):
        with pytest.raises(ScenarioError, match="GiB") as caught:
            tadcore.simulate(sc)
        assert caught.value.field == "step"


def fine(steps, **changes):
    sc = scenario("I1", n=1, horizon=2.0, step=2.0 / steps, zeta=1.9, sigma=0.05)
    return sc.replace(changes) if changes else sc


def test_a_fine_grid_tends_to_the_coarse_one():
    coarse, finer = plays(fine(1000)), plays(fine(20_000))
    assert finer.outcome.kind == coarse.outcome.kind
    assert finer.outcome.time == pytest.approx(coarse.outcome.time, abs=0.02)


@pytest.mark.heavy
def test_a_million_steps():
    sc = fine(1_000_000)
    run = plays(sc)
    assert len(run.times) > 500_000
    coarse = tadcore.simulate(fine(20_000))
    assert run.outcome.kind == coarse.outcome.kind
    assert run.outcome.time == pytest.approx(coarse.outcome.time, abs=1e-3)
    many = np.random.default_rng(0).uniform(-2, 2, (2000, 3, 2))
    ends = tadcore.simulate_batch(sc, many)
    same = tadcore.simulate_batch(fine(20_000), many)
    assert np.mean(ends.kind == same.kind) > 0.99
    assert np.quantile(np.abs(ends.time - same.time)[ends.kind == same.kind], 0.99) < 0.01


@pytest.mark.heavy
@BOTH
def test_forty_defenders_of_limited_sight(interaction):
    assert plays(scenario(interaction, n=40, horizon=0.02, step=0.01, zeta=5.0)) is not None
