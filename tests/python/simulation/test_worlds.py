"""Runs and batches in worlds that fail, talk and shake: what must hold of them whatever the numbers."""

import dataclasses
import math

import numpy as np
import pytest

import tadcore
from oracle.network import from_number
from oracle.relay import relay
from tadcore import ScenarioError
from tadcore.sampling import Disk

I1, I2 = (tadcore.scenarios.load(name) for name in ("paper-i1", "paper-i2"))
INF = math.inf
ARRAYS = ("times", "position", "control", "adjacency", "gains", "theta", "theta_terms")
FAILING = {"sensing": {"mean_time_to_failure": 0.5, "mean_time_to_repair": 0.2, "mean_time_detected": 0.6}}
ALL = FAILING | {
    "sensing.mean_time_missed": 0.1,
    "communication": {"radius": 2.0, "relays": 1, "mean_time_up": 0.5, "mean_time_down": 0.2},
    "*.disturbance": 0.05,
}


def same(one, other):
    """Bitwise the same game, whatever is said of it."""
    assert one.outcome == other.outcome
    for name in ARRAYS:
        assert np.array_equal(getattr(one, name), getattr(other, name)), name
    assert one.costs == other.costs
    assert (one.iterations, one.certified, one.passes) == (other.iterations, other.certified, other.passes)


@pytest.mark.parametrize("sc", [I1, I2])
def test_what_cannot_happen_is_bitwise_absent(sc):
    still = sc.replace(
        {
            "sensing": {"mean_time_to_failure": INF, "mean_time_to_repair": 0.1, "begin": "stationary"},
            "disturbance.attacker": 0.0,
        }
    )
    run, plain = tadcore.simulate(still, seed=5, trial=6), tadcore.simulate(sc)
    same(run, plain)
    assert run.course is None
    assert (run.seed, run.trial, run.sensor_outages, run.edge_outages, run.contacts) == (0, 0, (), (), ())
    assert run.seen is run.adjacency
    assert not run.relayed.any()
    positions = sc.positions + np.random.default_rng(1).normal(0, 0.3, (50, 1, sc.dim))
    one, other = (tadcore.simulate_batch(game, positions, seed=9) for game in (still, sc))
    for name in ("kind", "defender", "time", "diverged"):
        assert np.array_equal(getattr(one, name), getattr(other, name))


@pytest.mark.parametrize("sc", [I1, I2])
@pytest.mark.parametrize("frame", ["relative", "common"])
def test_complete_links_with_connected_sight_are_bitwise_full_sight(sc, frame):
    """d1 sees everyone; all hear all, in two hops at most."""
    radii = {f"d{i + 1}.visibility_radius": 0.1001 if i else INF for i in range(sc.n)}
    blind = sc.replace(radii | ({"target.visibility_radius": 1e-3} if sc.interaction == "I2" else {}))
    told = blind.replace({"communication": {"radius": INF, "frame": frame}})
    everyone = {path: INF for path in blind.paths if path.endswith("visibility_radius")}
    run = tadcore.simulate(told)
    same(run, tadcore.simulate(sc.replace(everyone)))
    assert run.relayed[0].any()
    assert not run.relayed[:, 0].any()
    assert tadcore.simulate(blind).outcome != run.outcome
    assert not told.is_random
    assert tadcore.simulate_batch(told, [sc.positions])[0] == run.outcome


@pytest.mark.parametrize(("sc", "player"), [(I1, "d1"), (I1, "d2"), (I2, "d1"), (I2, "target")])
def test_a_sensor_that_has_failed_for_good_at_first_is_none_at_all(sc, player):
    i = sc.constrained.index(player)
    failed = sc.replace({f"{player}.sensing": {"mean_time_to_failure": 1.0, "begin": "stationary"}})
    run = tadcore.simulate(failed, seed=3)
    assert [(o.player, o.start) for o in run.sensor_outages] == [(player, 0.0)]
    assert run.sensor_outages[0].end == run.outcome.time

    def without(_k, _t, _positions, sight):
        out = sight.copy()
        out[i] = False
        return out

    same(run, tadcore.simulate(sc, network=without))
    nearest = np.delete(np.linalg.norm(run.position[:-1] - run.position[:-1, [i]], axis=-1), i, axis=1).min()
    least = 0.5 * nearest
    if player != "target":
        least = max(least, 1.001 * sc.capture_radii[i])
    if nearest > least:  # nobody ever comes within that radius: the scenario without it
        same(run, tadcore.simulate(sc.replace({f"{player}.visibility_radius": least})))


def test_losing_sight_of_everyone_is_losing_the_sensor():
    whole, single = (
        I1.replace({"d1.sensing": {name: 1.0, "begin": "stationary"}})
        for name in ("mean_time_to_failure", "mean_time_detected")
    )
    same(tadcore.simulate(whole), tadcore.simulate(single))


@pytest.mark.parametrize("sc", [I1, I2])
def test_run_batch_study_and_replay_are_the_same_game(sc):
    random = sc.replace(ALL)
    study = tadcore.Study(random, {"attacker.position": Disk(sc.attacker.position, 1.0)}, trials=40, seed=11)
    result = study.run(threads=2)
    alone = study.run(threads=1)
    assert np.array_equal(result.time, alone.time)
    assert len(set(result.time.tolist())) > 20
    for trial in (0, 7, 39):
        run = result.replay(trial)
        assert (run.seed, run.trial) == (11, trial)
        assert run.outcome.time == result.time[trial]
        assert (run.outcome.defender if run.outcome.defender is not None else -1) == result.defender[trial]
        again = tadcore.simulate(result.setup(trial), seed=11, trial=trial)
        same(run, again)
    positions = np.repeat(sc.positions[None], 40, axis=0)
    positions[:, -1] = np.stack([study.inputs()[f"attacker.position.{axis}"] for axis in "xy"], axis=1)
    batch = tadcore.simulate_batch(random, positions, seed=11)
    assert np.array_equal(batch.time, result.time)
    tail = tadcore.simulate_batch(random, positions[30:], seed=11, first_trial=30)
    assert np.array_equal(tail.time, batch.time[30:])
    other = tadcore.simulate_batch(random, positions, seed=12)
    assert not np.array_equal(other.time, batch.time)


def test_trials_are_drawn_from_seed_and_trial_alone():
    """Another radius, weight or mean time leaves what is drawn as it is."""
    random = I1.replace(ALL)
    base = tadcore.simulate(random, seed=4, trial=2).course
    for changes in ({"d2.visibility_radius": 0.9}, {"target.control_weight": 1.3}, {"communication.radius": 0.5}):
        course = tadcore.simulate(random.replace(changes), seed=4, trial=2).course
        rows = slice(min(len(base.sensor_up), len(course.sensor_up)) - 1)
        for name in ("sensor_up", "edge_up", "displacement"):
            assert np.array_equal(getattr(base, name)[rows], getattr(course, name)[rows])
    louder = tadcore.simulate(random.replace({"*.disturbance": 0.1}), seed=4, trial=2).course
    rows = slice(min(len(base.sensor_up), len(louder.sensor_up)) - 1)
    assert np.allclose(louder.displacement[rows], 2 * base.displacement[rows], rtol=1e-15, atol=0)
    apart = [tadcore.simulate(random, seed=s, trial=t).course for s, t in ((4, 3), (5, 2), (4, 2 + 2**32))]
    for course in apart:
        assert not np.array_equal(course.displacement[0], base.displacement[0])
    first = []
    for mean in (0.2, 0.4, 0.8, 1.6):
        sc = I1.replace({"sensing.mean_time_to_failure": mean})
        run = tadcore.simulate(sc, seed=4, trial=2)
        first.append({o.player: o.start for o in run.sensor_outages})
    for player in I1.constrained:
        starts = [found.get(player, INF) for found in first]
        assert starts == sorted(starts)


def test_a_record_says_what_happened():
    random = I2.replace(ALL)
    run = tadcore.simulate(random, seed=7, trial=3)
    course, sc, until = run.course, run.scenario, len(run.times) - 1
    assert run.sensor_outages
    assert run.edge_outages
    assert run.contacts
    assert run.relayed.any()
    states = np.ones((until, len(sc.constrained)), dtype=bool)
    for outage in run.sensor_outages:
        inside = (run.times[:-1] >= outage.start) & (run.times[:-1] < outage.end)
        states[inside, sc.constrained.index(outage.player)] = False
    assert np.array_equal(states, course.sensor_up[:-1])
    heard = np.zeros((until, 4, 4), dtype=bool)
    for contact in run.contacts:
        inside = (run.times[:-1] >= contact.start) & (run.times[:-1] < contact.end)
        heard[inside, sc.constrained.index(contact.listener), sc.constrained.index(contact.speaker)] = True
    assert np.array_equal(heard, course.heard[:-1])
    assert all(0 <= o.start < o.end <= run.outcome.time for o in run.edge_outages)
    assert {o.edge[0] for o in run.edge_outages} <= set(sc.constrained)
    for k in (0, until // 2, until - 1):
        assert np.array_equal(run.adjacency[k], relay(run.seen[k], course.heard[k], 1))
    assert "seed 7, trial 3" in repr(run)


def test_the_dataset_and_the_file_carry_it(tmp_path):
    run = tadcore.simulate(I1.replace(ALL), seed=7, trial=3)
    data = run.dataset
    assert data.attrs["seed"] == 7
    assert data.attrs["trial"] == 3
    assert "sensor fails after 0.5 on average" in data.attrs["world"]
    assert np.array_equal(data["detected"], run.seen)
    for name in ("sensor_up", "edge_up", "heard", "displacement"):
        assert np.array_equal(data[name], getattr(run.course, name))
    assert data["sees"].sel(player="d1", seen="attacker").values.tolist() == run.seen[:, 0, 0].tolist()
    assert data["heard"].dims == ("time", "observer", "speaker")
    run.save(tmp_path / "run.nc")
    back = tadcore.load_run(tmp_path / "run.nc")
    same(run, back)
    assert (back.seed, back.trial, back.course.from_outside) == (7, 3, False)
    for name in ("seen", "sensor_up", "edge_up", "heard", "displacement"):
        assert np.array_equal(getattr(back.course, name), getattr(run.course, name))
    assert not {"detected", "world", "seed"} & (
        set(tadcore.simulate(I1).dataset) | tadcore.simulate(I1).dataset.attrs.keys()
    )
    run.save(tmp_path / "folder")
    assert '"trial": 3' in (tmp_path / "folder" / "summary.json").read_text()


# ---- a network from outside


def test_a_function_decides_the_network():
    calls = []

    def nobody_after_half(k, t, positions, sight):
        calls.append((k, t))
        assert positions.shape == (5, 2)
        assert sight.shape == (3, 4)
        assert sight.dtype == bool
        return sight & (t < 0.5)

    run = tadcore.simulate(I1, network=nobody_after_half)
    assert [k for k, _ in calls] == list(range(len(calls)))
    assert calls[1][1] == I1.step
    assert not run.adjacency[run.times >= 0.5].any()
    assert np.array_equal(run.adjacency[:99], run.seen[:99])
    assert run.course.from_outside
    assert "a network from outside" in repr(run)
    assert "a network from outside" in run.dataset.attrs["variant"]
    same(tadcore.simulate(I1, network=lambda _k, _t, _p, sight: sight), tadcore.simulate(I1))
    with pytest.raises(ScenarioError, match="a network from outside"):
        tadcore.verify(run)


def test_a_function_is_handed_what_is_seen_and_not_what_is_told():
    random = I1.replace(ALL)
    seen = []
    run = tadcore.simulate(random, seed=1, network=lambda _k, _t, _p, sight: seen.append(sight.copy()) or sight)
    assert np.array_equal(run.seen[: len(seen)], seen)
    assert np.array_equal(run.adjacency[: len(seen)], seen)


@pytest.mark.parametrize(
    "answer",
    [
        None,
        np.ones((4, 3), dtype=bool),
        np.ones((3, 4)),
        np.ones((3, 4), dtype=int),
        np.ones((3, 4, 1), dtype=bool),
        [[True] * 4] * 2,
        "yes",
    ],
)
def test_an_answer_that_is_no_network_is_refused_by_name(answer):
    with pytest.raises(ScenarioError, match=r"^network: got .* at t = 0.*, must be .*a bool array of shape \(3, 4\)"):
        tadcore.simulate(I1, network=lambda *_: answer)


def test_what_the_function_raises_ends_the_run():
    class OwnError(Exception):
        pass

    def fails(k, *_):
        if k == 20:
            raise OwnError("at twenty")
        return np.zeros((3, 4), dtype=bool)

    with pytest.raises(OwnError, match="at twenty") as caught:
        tadcore.simulate(I1, network=fails)
    assert caught.value.__notes__ == ["raised by network= at step 20, t = 0.1"]
    with pytest.raises(ScenarioError, match=r"network: .*a function"):
        tadcore.simulate(I1, network=3)


# ---- refused


@pytest.mark.parametrize("seed", [-1, 2**64, 1.0, True, "1", None])
def test_seeds_and_trials_out_of_range_are_refused(seed):
    with pytest.raises(ScenarioError, match="seed"):
        tadcore.simulate(I1, seed=seed)
    with pytest.raises(ScenarioError, match="trial"):
        tadcore.simulate(I1, trial=seed if seed != 2**64 else 2**56)
    with pytest.raises(ScenarioError, match="first_trial"):
        tadcore.simulate_batch(I1, [I1.positions], first_trial=seed if seed != 2**64 else 2**56)


def test_what_needs_the_path_between_instants_is_refused_where_players_are_disturbed():
    shaken = I1.replace({"attacker.disturbance": 0.1})
    for call in (
        lambda: tadcore.simulate(shaken, termination="continuous"),
        lambda: tadcore.simulate_batch(shaken, [I1.positions], termination="continuous"),
        lambda: tadcore.Study(shaken, {}, trials=2, termination="continuous"),
    ):
        with pytest.raises(ScenarioError, match=r"termination: .*players are disturbed"):
            call()
    for call in (
        lambda: tadcore.simulate_batch(shaken, [I1.positions], passes=True),
        lambda: tadcore.Study(shaken, {}, trials=2, passes=True),
    ):
        with pytest.raises(ScenarioError, match=r"passes: .*players are disturbed"):
            call()
    assert tadcore.simulate(shaken).passes == ()
    failing = I1.replace(FAILING)
    assert tadcore.simulate(failing, termination="continuous").outcome.time > 0.0


def test_links_nearer_than_rounding_are_refused_in_batches():
    linked = I1.replace({"communication.radius": 1e-8})
    far = I1.positions.copy()
    far[-1] += 1e6
    with pytest.raises(ScenarioError, match="the radius of communication"):
        tadcore.simulate_batch(linked, [I1.positions, far])


# ---- laws


@pytest.mark.parametrize("pairs", [120, pytest.param(50_000, marks=pytest.mark.heavy)])
def test_more_knowledge_never_raises_theta(pairs):
    """Θ*(𝒜) ≥ Θ*(relay 𝒜), since the gains that 𝒜 allows are among those of its relay."""
    rng = np.random.default_rng(61)
    strict = 0
    for sc in (I1, I2):
        m, N = len(sc.constrained), sc.n + 1
        for _ in range(pairs):
            seen = from_number(int(rng.integers(2 ** (m * N))), m, N)
            heard = (rng.random((m, m)) < rng.random()) & ~np.eye(m, dtype=bool)
            told = relay(seen, heard, [None, 0, 1][rng.integers(3)], bool(rng.integers(2)))
            step = int(rng.integers(sc.steps))
            less, more = (tadcore.synthesize(sc, step=step, adjacency=A).theta for A in (seen, told))
            assert more <= less * (1 + 1e-9) + 1e-12
            strict += more < 0.99 * less
    assert strict > pairs / 2


@pytest.mark.parametrize(("interaction", "dim"), [("I1", 2), ("I1", 3), ("I2", 2), ("I2", 3)])
def test_the_expected_cost_is_that_of_the_riccati_solution(interaction, dim):
    """E J_p = V_p(0, z₀) + ½∫tr(P_p Σ)dt per axis, Σ_ij = ς_i² [i = j] + ς_a²; nobody is ever caught."""
    start = {"I1": I1, "I2": I2}[interaction]
    full = {path: INF for path in start.paths if path.endswith("visibility_radius")}
    tiny = {f"{player}.capture_radius": 1e-12 for player in (*start.players[: start.n], "attacker")}
    near = {f"{player}.position": [0.1 * p, 0.2 - 0.1 * p, 0.05][:dim] for p, player in enumerate(start.players)}
    sizes = {f"{player}.disturbance": s for player, s in zip(start.players, (0.3, 0.5, 0.2, 0.4, 0.6), strict=True)}
    quiet = start.replace({**full, **tiny, **near, "horizon": 1.0, "step": 0.005})
    sc = quiet.replace(sizes)
    eq = tadcore.solve_equilibrium(sc)
    noise = np.array(list(sizes.values())) ** 2
    covariance = np.diag(noise[:-1]) + noise[-1]
    still = tadcore.simulate(quiet).costs
    runs = [tadcore.simulate(sc, seed=17, trial=trial) for trial in range(700)]
    assert {run.outcome.kind for run in runs} == {"timeout"}
    z = quiet.positions[:-1] - quiet.positions[-1]
    by_noise = {g: 0.5 * dim * np.trapezoid(np.einsum("kij,ji->k", P, covariance), dx=sc.step) for g, P in eq.P.items()}
    for group, P in eq.P.items():
        value, added = 0.5 * np.einsum("ix,ij,jx->", z, P[0], z), by_noise[group]
        assert still[group] == pytest.approx(value, rel=0.02, abs=0.02 * abs(added))  # the zero-order hold
        costs = np.array([run.costs[group] for run in runs])
        error = costs.std(ddof=1) / math.sqrt(len(runs))
        assert error < 0.1 * max(map(abs, by_noise.values()))
        assert abs(costs.mean() - value - added) < 4 * error + 0.02 * abs(added)


def test_a_disturbed_step_is_the_drift_and_a_displacement():
    """Without disturbance from the same state, the step leads to where it came from but for what was added."""
    sc = I1.replace({"*.disturbance": 0.2})
    run = tadcore.simulate(sc, seed=2, trial=5)
    for k in (0, 3, 40):
        later = I1.replace({f"{p}.position": x for p, x in zip(I1.players, run.position[k].tolist(), strict=True)})
        drift = run.position[k + 1] - run.course.displacement[k]
        C = np.zeros((5, 5))
        rows = np.vstack([run.gains[k], _opponents(later, k)])
        C[:4, :4], C[4, :4] = rows[:4] - rows[4], rows[4]
        from scipy.linalg import expm

        z = np.vstack([run.position[k, :-1] - run.position[k, -1], run.position[k, -1]])
        moved = expm(C * sc.step) @ z
        assert drift == pytest.approx(np.vstack([moved[:-1] + moved[-1], moved[-1]]), rel=1e-10, abs=1e-12)


def _opponents(sc, k):
    """Feedback rows of target and attacker in I1, from P."""
    P = tadcore.solve_equilibrium(sc).P
    target = -P["target"][k][-1] / sc.target.control_weight
    attacker = P["attacker"][k].sum(axis=0) / sc.attacker.control_weight
    return np.vstack([target, attacker])


def test_a_sampled_cost_is_read_back_from_the_record():
    """The costs of a disturbed run are those of its record, step by step: `verify` recomputes them."""
    report = tadcore.verification.check_record(
        tadcore.simulate(I1.replace(ALL), seed=8), tadcore.solve_equilibrium(I1.replace(ALL))
    )
    assert report.ok, report
    spoilt = dataclasses.replace(tadcore.simulate(I1.replace(ALL), seed=8), costs={"defenders": 1.0})
    assert not tadcore.verification.check_record(spoilt, tadcore.solve_equilibrium(I1)).ok


# ---- the team criterion and receding horizons, by their fields


def test_the_fields_of_feedback_and_criterion_reach_the_game():
    team = tadcore.simulate(I1.replace(criterion="component"))
    plain = tadcore.simulate(I1)
    assert np.array_equal(team.gains[0, 0], tadcore.solve_equilibrium(I1).feedback["d1"][0])  # d1 sees all
    assert not np.array_equal(plain.gains[0, 0], team.gains[0, 0])
    assert team.theta[0] - tadcore.synthesize(I1, step=0, adjacency=team.adjacency[0]).theta == pytest.approx(
        team.theta_price[0], rel=1e-9
    )
    assert (plain.theta_price >= -1e-9 * plain.theta[:-1]).all()
    assert plain.theta_price.shape == (len(plain.times) - 1,)
    ahead = I1.replace({"feedback": "receding", "prediction_horizon": 2.0})
    P = tadcore.solve_equilibrium(ahead).P["defenders"]
    expected = tadcore.solve_equilibrium(I1.replace({"horizon": 2.0})).P["defenders"][0]
    assert np.allclose(P, expected, rtol=1e-9)
    for sc in (ahead, I1.replace(criterion="component")):
        assert tadcore.simulate_batch(sc, [sc.positions])[0] == tadcore.simulate(sc).outcome
        with pytest.raises(ScenarioError, match=r"tadcore.sweep"):
            tadcore.Study(sc, {"attacker.control_weight": [1.0, 1.1]}, trials=2)
