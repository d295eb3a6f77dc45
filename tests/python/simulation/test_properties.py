"""What holds for every valid scenario, found by Hypothesis; the theorems themselves are in test_oracle_theorems."""

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

import tadcore
from tadcore import NoEquilibriumError, Outcome, Scenario, TadcoreError
from tadcore.statistics import incidence
from tadcore.study.manifest import Manifest

PLAIN, NEAR, SMALL = st.floats(0.3, 3.0), st.floats(-3.0, 3.0), st.floats(0.05, 0.4)
ANY_WEIGHT = st.floats(1e-30, 1e30)
ANY_POSITIVE = st.floats(min_value=0.0, exclude_min=True, allow_nan=False, allow_infinity=False)
ANY_COORDINATE = st.floats(-1e100, 1e100)


@st.composite
def grids(draw, longest=0.5):
    """T and δ, in decimal as people write them or as a division leaves them."""
    count = draw(st.integers(1, 100))
    if draw(st.booleans()):
        step = draw(st.integers(1, max(int(1e4 * longest / count), 1))) / 1e4
        return float(f"{count * step:.4f}"), step
    horizon = draw(st.floats(0.01, longest))
    return horizon, horizon / count * (1.0 + draw(st.floats(-9e-10, 9e-10)))


@st.composite
def scenarios(draw, most=4, weight=PLAIN, coordinate=NEAR, radius=SMALL):
    """A valid scenario of either interaction, in the plane or in space, with or without its optional fields."""
    interaction, axes = draw(st.sampled_from(["I1", "I2"])), draw(st.sampled_from([2, 3]))

    def part(needed, optional):
        table = {"position": draw(st.lists(coordinate, min_size=axes, max_size=axes)), "control_weight": draw(weight)}
        table |= {name: draw(weight) for name in optional if draw(st.booleans())}
        return table | {name: draw(radius) for name in needed}

    own = ["running_weight", "terminal_weight"] if interaction == "I1" else []
    horizon, step = draw(grids())
    data = {
        "interaction": interaction,
        "horizon": horizon,
        "step": step,
        "attacker": part(["capture_radius"], ["target_running_weight", "target_terminal_weight"]),
        "target": part([], own),
        "defenders": [
            part(["capture_radius"], [*own, "evasion_running_weight", "evasion_terminal_weight"])
            for _ in range(draw(st.integers(1, most)))
        ],
    }
    places = np.array([part["position"] for part in (data["attacker"], data["target"], *data["defenders"])])
    least = 1.001e-12 * float(np.abs(places - places[0]).max())
    for d in data["defenders"]:
        if draw(st.booleans()):
            sight = d["capture_radius"] * draw(st.floats(1.001, 40.0))
            d["visibility_radius"] = sight if sight > max(d["capture_radius"], least) else math.inf
    if interaction == "I1" and draw(st.booleans()):
        data["attacker"]["evasion"] = draw(st.floats(0.0, 1.0))
    if interaction == "I2" and draw(st.booleans()):
        data["target"]["visibility_radius"] = max(draw(radius), least)
    if draw(st.booleans()):
        terms = 4 if interaction == "I1" else 3
        gamma = draw(st.lists(st.floats(0.0, 1.0), min_size=terms, max_size=terms))
        data["synthesis_weights"] = [gamma[0] or 1.0, *gamma[1:]]
    return Scenario.model_validate(data)


def bits(sc):
    """Every number of a scenario, to the bit."""

    def walk(value):
        if isinstance(value, dict):
            return {key: walk(entry) for key, entry in value.items()}
        if isinstance(value, list | tuple):
            return [walk(entry) for entry in value]
        return value.hex() if isinstance(value, float) else value

    return walk(sc.model_dump())


@given(scenarios(weight=ANY_WEIGHT, coordinate=ANY_COORDINATE, radius=ANY_POSITIVE))
def test_toml_loses_no_bit(sc):
    again = Scenario.from_toml_string(sc.to_toml())
    assert bits(again) == bits(sc)
    assert again == sc
    assert again.to_toml() == sc.to_toml()


@given(scenarios(), st.integers(0, 2**32 - 1), st.integers(1, 3))
def test_a_batch_is_its_single_runs_whatever_varies(sc, seed, threads):
    rng = np.random.default_rng(seed)
    games = int(rng.integers(1, 12))
    positions = sc.positions + rng.normal(scale=0.4, size=(games, *sc.positions.shape))
    capture = sc.capture_radii * rng.uniform(0.5, 1.0, (games, sc.n + 1))
    try:
        batch = tadcore.simulate_batch(sc, positions, capture_radii=capture, threads=threads)
    except TadcoreError:
        with np.testing.assert_raises(TadcoreError):
            tadcore.solve_equilibrium(sc)
        return
    for i in range(games):
        changes = {"attacker.position": positions[i, -1], "target.position": positions[i, -2]}
        changes |= {f"defenders[{j}].position": positions[i, j] for j in range(sc.n)}
        changes |= {f"defenders[{j}].capture_radius": capture[i, j] for j in range(sc.n)}
        changes["attacker.capture_radius"] = capture[i, -1]
        assert tadcore.simulate(sc.replace(changes)).outcome == batch[i]


@settings(max_examples=300)
@given(scenarios(most=2))
def test_instants_are_those_of_exact_arithmetic(sc):
    """t_k is the double nearest to k T / K in whatever shows a time, and every accepted grid is solved or escapes."""
    grid = np.array([float(Fraction(sc.horizon) * k / sc.steps) for k in range(sc.steps + 1)])
    assert (grid[0], grid[-1]) == (0.0, sc.horizon)
    try:
        equilibrium = tadcore.solve_equilibrium(sc)
    except NoEquilibriumError:
        return
    assert np.array_equal(equilibrium.times, grid)
    run = tadcore.simulate(sc)
    last = len(run.times) - 1
    assert np.array_equal(run.times, grid[: last + 1])
    assert np.array_equal(run.dataset.time, run.times)
    assert run.outcome.time == grid[last]
    assert {change.time for change in run.network_changes} <= set(grid)
    assert run.intervals()[-1].end == run.outcome.time if run.network_changes else last == 0
    batch = tadcore.simulate_batch(sc, [sc.positions])
    assert batch.time[0] == grid[last]
    found = incidence(batch.kind, batch.defender, batch.time, horizon=sc.horizon, step=sc.step, n=sc.n)
    assert np.array_equal(found.times, grid)
    assert found.running[last] == 0.0
    assert (found.running[:last] == 1.0).all()


@pytest.mark.parametrize(("horizon", "step"), [(0.99, 0.01), (1.3, 0.1), (5.2, 0.1), (0.42, 0.005), (0.29, 0.01)])
def test_horizons_that_a_rounded_division_misses(horizon, step):
    sc = tadcore.scenarios.load("paper-i1").replace({"horizon": horizon, "step": step})
    assert tadcore.solve_equilibrium(sc).times[-1] == horizon
    far = sc.replace({"attacker.position": [-50.0, 0.0]})
    assert tadcore.simulate(far).outcome == Outcome("timeout", None, horizon)


@given(scenarios())
def test_costs_and_values_are_finite(sc):
    try:
        run = tadcore.simulate(sc)
    except TadcoreError:
        return
    assert all(math.isfinite(value) for value in run.costs.values())
    z = run.position[:, :-1] - run.position[:, -1:]
    for P in tadcore.solve_equilibrium(sc).P.values():
        assert np.isfinite(np.einsum("kia,kij,kja->k", z, P[: len(z)], z)).all()
    assert np.isfinite(run.theta).all()
    assert (run.theta >= 0.0).all()


@settings(max_examples=12, deadline=None)
@given(
    st.sampled_from(["I1", "I2"]),
    st.sampled_from([9, 30, 61, 100, 201, 320, 500]),
    st.sampled_from([1e-9, 1e-6, 1e-3]),
    st.sampled_from([1e-3, 0.4, 0.9, 20.0, math.inf]),
    st.integers(0, 2**32 - 1),
)
def test_large_teams_in_short_games_are_played_or_refused_by_size(interaction, n, horizon, sight, seed):
    """As many unknowns as edges: none where nobody sees anyone or all see all, and more than fit in between."""
    places = np.random.default_rng(seed).uniform(0.0, math.sqrt(n), (n + 2, 2)).tolist()
    reach = {"capture_radius": 1e-5}
    seeing = {"control_weight": 1.0, "visibility_radius": sight}
    sc = Scenario.model_validate(
        {
            "interaction": interaction,
            "horizon": horizon,
            "step": horizon,
            "attacker": {"position": places[0], "control_weight": 0.8, **reach},
            "target": {"position": places[1], **({"control_weight": 1.2} if interaction == "I1" else seeing)},
            "defenders": [{"position": place, **seeing, **reach} for place in places[2:]],
        }
    )
    seen = tadcore.VisibilityNetwork.from_positions(sc).adjacency
    unknowns = 0 if seen.all() else int(seen.sum())
    # Played, too, but not within the time of a test.
    if 1_000 < unknowns < 9_000:
        sc = sc.replace(
            {"d*.visibility_radius": 1e-3} | ({"target.visibility_radius": 1e-3} if interaction == "I2" else {})
        )
    if unknowns > 10_000:
        with pytest.raises(
            tadcore.OutOfMemoryError, match=r"the synthesis of the gains under one network: [\d,]+ bytes"
        ):
            tadcore.simulate(sc)
        return
    run = tadcore.simulate(sc)
    assert np.isfinite(run.gains).all()
    assert len(run.times) == 2
    assert tadcore.simulate_batch(sc, [sc.positions])[0] == run.outcome


@given(scenarios(), st.integers(0, 2**64 - 1), st.sampled_from(["random", "sobol", "latin"]))
def test_a_manifest_loses_nothing(tmp_path_factory, sc, seed, design):
    folder = tmp_path_factory.mktemp("manifest")
    vary = {
        "attacker.position": {"disk": {"center": [0.0, 1.0], "radius": 0.1}},
        "defenders.0.visibility_radius": {"values": [1.0, math.inf]},
    }
    wanted = Manifest(sc.to_toml(), vary, seed, design, 100, ("attacker.position.x",))
    (folder / "_manifest.json").write_text(wanted.to_json(), encoding="utf-8")
    assert Manifest.read(folder) == wanted
    assert Scenario.from_toml_string(Manifest.read(folder).scenario) == sc
