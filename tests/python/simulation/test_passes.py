"""Between two instants: passes and the continuous end, beside SciPy's integrator with events and sampled minima."""

import json
import math
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict

import matplotlib.pyplot as plt
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import minimize_scalar

import tadcore
from oracle.stiff import players
from tadcore import Outcome, Scenario, ScenarioError, StoreError
from tadcore.cli.app import main
from tadcore.plotting.run.paths import PASSED
from tadcore.sampling import Box
from tadcore.simulation.termination import TERMINATIONS
from tadcore.statistics import incidence
from tadcore.verification import check_steps, play_by_events, step_study

SUICIDE = Scenario.model_validate(
    {
        "interaction": "I1",
        "horizon": 6.0,
        "step": 0.05,
        "attacker": {"position": [-2.0, 0.0], "control_weight": 0.8, "capture_radius": 0.1, "evasion": 0.0},
        "target": {"position": [2.0, 0.0], "control_weight": 1.2},
        "defenders": [{"position": [0.013, 0.0], "control_weight": 1e6, "capture_radius": 0.01}],
    }
)
"""A suicidal attacker that runs through a defender which hardly moves."""


def random_game(rng, *, steps=6, horizon=1.5):
    """Few players, a step that is long beside their radii, and defenders of which some wait near the attacker's way."""
    first, n, dim = rng.random() < 0.6, int(rng.integers(1, 4)), int(rng.integers(2, 4))
    horizon = horizon if first else horizon / 10
    cheap = 1.0 if first else 0.1  # what moves at all within so short a time is cheap
    attacker, target = rng.uniform(-1.0, 1.0, (2, dim))

    def player(place, weight, **more):
        return {"position": place.tolist(), "control_weight": weight, **more}

    def weight():
        return cheap * float(np.exp(rng.uniform(-1.5, 1.5)))

    def defender():
        sigma = float(rng.uniform(0.01, 0.1))
        radii = {"capture_radius": sigma, "visibility_radius": float(rng.choice([0.5, 1.5, math.inf]))}
        if rng.random() < 0.3:
            return player(rng.uniform(-1.0, 1.0, dim), weight(), **radii)
        on_the_way = attacker + rng.uniform(0.1, 0.7) * (target - attacker)
        return player(on_the_way + rng.normal(scale=0.7 * sigma, size=dim), 1e4, **radii)

    data = {
        "interaction": "I1" if first else "I2",
        "horizon": horizon,
        "step": horizon / steps,
        "attacker": player(attacker, weight(), capture_radius=float(rng.uniform(0.01, 0.1))),
        "target": player(target, weight()),
        "defenders": [defender() for _ in range(n)],
    }
    if first:
        data["attacker"]["evasion"] = float(rng.choice([0.0, 0.3, 1.0]))
    return Scenario.model_validate(data)


def played(count, seed, **options):
    """Random games that have an equilibrium and at least one step, with their runs."""
    rng = np.random.default_rng(seed)
    while count:
        sc = random_game(rng, **options)
        try:
            run = tadcore.simulate(sc)
        except tadcore.TadcoreError:
            continue
        if len(run.times) > 1:
            count -= 1
            yield sc, run


def loops(run):
    """C of every step of a run, from its recorded gains and the equilibrium."""
    rows = players(run)[:-1]
    return rows[:, :-1] - rows[:, -1:]


def minima(run):
    """By (step, pair): where in a step a pair is closest, from 400 samples and a bounded search around the best."""
    step, found = run.scenario.horizon / run.scenario.steps, {}
    for k, C in enumerate(loops(run)):
        z = run.position[k, :-1] - run.position[k, -1]
        fine = expm(C * step / 400)
        at = [z]
        for _ in range(400):
            at.append(fine @ at[-1])
        distance = np.linalg.norm(at, axis=-1)
        for pair, j in enumerate(distance.argmin(axis=0)):
            low, high = max(j - 1, 0) * step / 400, min(j + 1, 400) * step / 400
            best = minimize_scalar(
                lambda s, C=C, z=z, pair=pair: float(np.linalg.norm((expm(C * s) @ z)[pair])),
                bounds=(low, high),
                method="bounded",
                options={"xatol": 1e-12},
            )
            ends = [(distance[0, pair], 0.0), (distance[-1, pair], step), (best.fun, best.x)]
            found[k, pair] = min(ends)
    return found


@pytest.mark.parametrize("step", [0.5, 1.0])
def test_no_graze_is_lost_between_events(step):
    """A suicidal attacker keeps to the x-axis; who hardly moves intercepts it if it stands nearer to that than σ."""
    rng = np.random.default_rng(8)
    for _ in range(40):
        place, aside = float(rng.uniform(-1.5, 1.0)), float(rng.uniform(-0.02, 0.02))
        if 0.0095 < abs(aside) < 0.0105:
            continue
        sc = SUICIDE.replace({"step": step, "d1.position": [place, aside]})
        expected = "intercepted" if abs(aside) < 0.01 else "captured"
        assert play_by_events(sc).outcome.kind == expected, (place, aside)
        assert tadcore.simulate(sc, termination="continuous").outcome.kind == expected, (place, aside)


def by_events(run):
    """Outcome in continuous time: each step integrated from its recorded start, its events found by SciPy.

    SciPy looks at the ends of its own steps, so these are short beside a radius; None for a game that is too fast.
    """
    sc = run.scenario
    step, sigma = sc.horizon / sc.steps, sc.capture_radii
    events = [
        lambda t, y, i=i: float(np.linalg.norm(y.reshape(sc.n + 1, sc.dim)[i]) - sigma[i]) for i in range(sc.n + 1)
    ]
    for event in events:
        event.terminal, event.direction = True, -1
    for k, C in enumerate(loops(run)):
        z = (run.position[k, :-1] - run.position[k, -1]).ravel()
        wide = np.kron(C, np.eye(sc.dim))
        speed = max(np.abs(C @ (x[:-1] - x[-1])).max() for x in run.position[k : k + 2])
        longest = min(step / 50, 0.2 * sigma.min() / speed)
        if step > 2_000 * longest:
            return None
        options = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13, "max_step": longest}
        done = solve_ivp(lambda t, y, wide=wide: wide @ y, (0.0, step), z, events=events, **options)
        times = [(float(t[0]), i) for i, t in enumerate(done.t_events) if len(t)]
        if times:
            s, i = min(times)
            return ("captured", None, k * step + s) if i == sc.n else ("intercepted", i, k * step + s)
    return run.outcome.kind, run.outcome.defender, run.outcome.time


def test_the_attacker_that_runs_through_a_defender():
    run = tadcore.simulate(SUICIDE)
    assert run.outcome == Outcome("captured", None, 3.2)
    (found,) = run.passes
    assert (found.defender, found.start, found.end) == (0, 0.4, 0.45)
    assert found.distance < 1e-4
    ended = tadcore.simulate(SUICIDE, termination="continuous")
    assert (ended.outcome.kind, ended.outcome.defender) == ("intercepted", 0)
    assert ended.outcome.time == found.time == pytest.approx(play_by_events(SUICIDE).outcome.time, abs=2e-4)
    assert "passes within σ of d1 between t = 0.4 and 0.45" in repr(run)


def test_passes_are_the_minima_that_lie_within():
    """On 60 random games, every pair and step: met where and only where the sampled minimum is within the radius."""
    met = 0
    for sc, run in played(60, 5):
        nearest = minima(run)
        found = {
            (int(np.searchsorted(run.times, p.start)), sc.n if p.defender is None else p.defender): p
            for p in run.passes
        }
        for (k, pair), (distance, s) in nearest.items():
            ends = np.linalg.norm(run.position[k : k + 2, pair] - run.position[k : k + 2, -1], axis=1)
            sigma = sc.capture_radii[pair]
            if ends.min() <= sigma or abs(distance - sigma) < 1e-9:  # at an instant, or a rounding decides
                continue
            if k == len(run.times) - 2 and run.outcome.kind != "timeout" and (k, pair) not in found:
                continue  # it may have come after the one that ends the game
            assert ((k, pair) in found) == (distance <= sigma), (k, pair, distance, sigma)
            if (k, pair) in found:
                met += 1
                one = found[k, pair]
                assert one.distance == pytest.approx(distance, rel=1e-9, abs=1e-12)
                assert one.closest_time == pytest.approx(run.times[k] + s, abs=1e-6)
                assert (one.start, one.end) == (run.times[k], run.times[k + 1])
                assert one.start <= one.time <= one.closest_time <= one.end
    assert met > 30


def test_figures_show_where_the_attacker_passes(agg):
    run = tadcore.simulate(SUICIDE)
    (each,) = run.passes
    k = run.times.tolist().index(each.start)
    for draw, points in (
        (run.plot.distances, [[each.closest_time, each.distance]]),
        (run.plot.trajectories, [run.position[k, -1], run.position[k + 1, -1]]),
    ):
        ax = draw()
        (mark,) = [line for line in ax.lines if line.get_marker() == PASSED["marker"]]
        (point,) = mark.get_xydata()
        low, high = np.min(points, axis=0) - 1e-12, np.max(points, axis=0) + 1e-12
        assert ((point >= low) & (point <= high)).all()
        (note,) = [text.get_text() for text in ax.texts if text.get_gid() == "note"]
        assert note.endswith("between two instants, once")
        plt.close(ax.figure)
    ended = tadcore.simulate(SUICIDE, termination="continuous").plot.distances()
    assert not any(text.get_gid() == "note" for text in ended.texts)
    plt.close(ended.figure)


def test_the_continuous_end_is_that_of_an_integrator_with_events():
    kinds, inside = set(), 0
    for sc, run in played(120, 6):
        ended = tadcore.simulate(sc, termination="continuous")
        played_by_scipy = by_events(run)
        sigma = [sc.capture_radii[-1 if each.defender is None else each.defender] for each in run.passes]
        grazes = any(each.distance > 0.9 * radius for each, radius in zip(run.passes, sigma, strict=True))
        if played_by_scipy is None or grazes:  # SciPy sees a sign change only; the test above has the grazes
            continue
        kind, defender, time = played_by_scipy
        assert (ended.outcome.kind, ended.outcome.defender) == (kind, defender)
        assert ended.outcome.time == pytest.approx(time, abs=1e-8)
        kinds.add(kind)
        inside += (run.outcome.kind, run.outcome.defender) != (kind, defender)
        last = len(ended.times) - 1
        for name in ("times", "position", "adjacency", "gains", "theta"):  # up to the end the same game, bitwise
            assert np.array_equal(getattr(ended, name)[:last], getattr(run, name)[:last]), name
        assert ended.times[-1] == ended.outcome.time
        if kind != "timeout":
            pair = sc.n if defender is None else defender
            off = np.linalg.norm(ended.position[-1, pair] - ended.position[-1, -1])
            assert off == pytest.approx(sc.capture_radii[pair], rel=1e-12)
    assert kinds == {"timeout", "captured", "intercepted"}
    assert inside > 10


def test_costs_up_to_a_crossing_are_those_of_the_shorter_last_step():
    """A game over the same equilibrium, cut where the crossing is: the last step's cost by an integrator."""
    for sc, run in played(30, 7):
        ended = tadcore.simulate(sc, termination="continuous")
        if ended.outcome.time in run.times:
            continue
        k = len(ended.times) - 2
        step = ended.times[-1] - ended.times[-2]
        rows = players(run)[k]
        C = rows[:-1] - rows[-1]
        z = ended.position[k, :-1] - ended.position[k, -1]
        assert ended.position[-1, :-1] - ended.position[-1, -1] == pytest.approx(expm(C * step) @ z, abs=1e-12)


def test_batches_and_studies_end_and_count_as_runs_do():
    for sc, _ in played(12, 8):
        starts = sc.positions + np.random.default_rng(1).normal(scale=0.3, size=(60, *sc.positions.shape))
        plain = tadcore.simulate_batch(sc, starts)
        watched = tadcore.simulate_batch(sc, starts, passes=True, threads=2)
        ended = tadcore.simulate_batch(sc, starts, termination="continuous", threads=3)
        assert plain.passed is None
        assert all(
            np.array_equal(getattr(plain, name), getattr(watched, name)) for name in ("kind", "defender", "time")
        )
        for i, start in enumerate(starts):
            moved = sc.replace({f"{p}.position": x.tolist() for p, x in zip(sc.players, start, strict=True)})
            run = tadcore.simulate(moved)
            assert watched.passed[i] == (len(run.passes) > 0)
            assert ended[i] == tadcore.simulate(moved, termination="continuous").outcome


def test_what_is_neither_end_is_refused():
    for play in (tadcore.simulate, lambda sc, **k: tadcore.simulate_batch(sc, [sc.positions], **k)):
        with pytest.raises(ScenarioError) as caught:
            play(SUICIDE, termination="euler")
        assert caught.value.field == "termination"
        with pytest.raises(ScenarioError, match=r"^termination: "):
            play(SUICIDE, termination=np.array(TERMINATIONS))


def test_a_step_study_is_not_stable_where_a_crossing_changes_the_outcome():
    study = step_study(SUICIDE, halvings=1)
    assert [outcome.kind for outcome in study.outcomes] == ["captured", "captured"]
    assert not study.stable
    assert "passes within σ of d1" in repr(study)
    check = check_steps(tadcore.simulate(SUICIDE))["steps.outcome"]
    assert not check.accepted
    assert "d1" in check.detail
    clear = SUICIDE.replace({"d1.position": [0.013, 0.5]})
    assert step_study(clear, halvings=1).stable
    assert check_steps(tadcore.simulate(clear))["steps.outcome"].accepted


def test_a_study_knows_when_its_games_end(tmp_path):
    vary = {"d1.position": Box([-1.5, -0.02], [1.5, 0.02])}
    studies = {kind: tadcore.Study(SUICIDE, vary, trials=200, seed=3, termination=kind) for kind in TERMINATIONS}
    results = {kind: study.run(store=tmp_path / kind) for kind, study in studies.items()}
    sampled, continuous = results["sampled"], results["continuous"]
    assert continuous.counts()["intercepted"] > sampled.counts()["intercepted"]
    for i in (0, 7, 60):
        for result in results.values():
            assert result.replay(i).outcome == result.replay(i).outcome
            assert result.replay(i).outcome.time == result.time[i]
    assert tadcore.load_study(tmp_path / "continuous").study.termination == "continuous"
    assert tadcore.load_study(tmp_path / "sampled").study.termination == "sampled"
    assert "termination" not in next((tmp_path / "sampled").glob("*manifest.json")).read_text(encoding="utf-8")
    with pytest.raises(StoreError):
        studies["sampled"].run(store=tmp_path / "continuous")
    assert studies["continuous"].run(store=tmp_path / "continuous").counts() == continuous.counts()
    assert studies["continuous"].replace(trials=10).termination == "continuous"
    found = continuous.incidence()
    for k in (8, 9, 10, 64, 120):
        assert found["d1"][k] == np.mean((continuous.defender == 0) & (continuous.time <= found.times[k]))
    with pytest.raises(ScenarioError, match="multiple of the step"):
        incidence(continuous.kind, continuous.defender, continuous.time, horizon=6.0, step=0.05, n=1)


def test_a_study_looks_for_passes_where_it_is_asked_to(tmp_path):
    vary = {"d1.position": Box([-1.5, -0.02], [1.5, 0.02])}
    plain = tadcore.Study(SUICIDE, vary, trials=200, seed=3)
    asked = plain.replace(passes=True)
    result = asked.run(store=tmp_path / "asked")
    assert plain.run().passed is None
    assert "passed" not in plain.run().table.column_names
    for trial in range(0, 200, 13):
        assert result.passed[trial] == (len(result.replay(trial).passes) > 0)
    assert 0 < result.passed.sum() < 200
    assert list(result.inputs) == ["defenders.0.position.x", "defenders.0.position.y"]
    loaded = tadcore.load_study(tmp_path / "asked")
    assert loaded.study.passes
    assert loaded.table.equals(result.table)
    with pytest.raises(StoreError, match="its passes differ"):
        plain.run(store=tmp_path / "asked")
    with pytest.raises(StoreError, match="its termination differ"):
        asked.replace(termination="continuous").run(store=tmp_path / "asked")
    with ProcessPoolExecutor(1) as pool:
        assert asked.run(executor=pool).table.equals(result.table)
    for wrong in (1, "yes", np.array([True, False])):
        with pytest.raises(ScenarioError, match="passes: got"):
            plain.replace(passes=wrong)
        with pytest.raises(ScenarioError, match="passes: got"):
            tadcore.simulate_batch(SUICIDE, [SUICIDE.positions], passes=wrong)


def test_a_study_file_and_the_command_line_take_it(tmp_path, capsys):
    (tmp_path / "s.toml").write_text(SUICIDE.to_toml(), encoding="utf-8")
    text = 'scenario = "s.toml"\ntrials = 5\ntermination = "continuous"\npasses = true\n[vary]\n'
    (tmp_path / "study.toml").write_text(text + '"d1.capture_radius" = { values = [0.01] }\n', encoding="utf-8")
    study = tadcore.Study.from_toml(tmp_path / "study.toml")
    assert study.termination == "continuous"
    assert study.passes
    assert set(study.run().defender) == {0}

    def told(*options):
        with pytest.raises(SystemExit) as left:
            main(["simulate", str(tmp_path / "s.toml"), *options])
        captured = capsys.readouterr()
        return left.value.code or 0, " ".join((captured.out + captured.err).split())

    code, out = told()
    assert code == 0
    assert "passes within σ of d1 between t = 0.4 and 0.45" in out
    code, out = told("--termination", "continuous")
    assert code == 0
    assert "d1 intercepts the attacker at t = 0.430" in out
    code, out = told("--termination", "euler")
    assert code == 2
    assert "termination" in out


def test_what_a_run_writes_tells_its_passes_and_its_termination(tmp_path):
    run = tadcore.simulate(SUICIDE)
    run.save(tmp_path / "sampled")
    summary = json.loads((tmp_path / "sampled" / "summary.json").read_text(encoding="utf-8"))
    assert summary["passes"] == [asdict(each) for each in run.passes]
    assert "termination" not in summary
    ended = tadcore.simulate(SUICIDE, termination="continuous")
    assert ended.variant == "continuous termination"
    assert repr(ended).endswith("; a variant, continuous termination)")
    ended.save(tmp_path / "continuous")
    summary = json.loads((tmp_path / "continuous" / "summary.json").read_text(encoding="utf-8"))
    assert (summary["termination"], summary["passes"]) == ("continuous", [])
    assert ended.dataset.attrs["termination"] == "continuous"
    with pytest.raises(ScenarioError, match="continuous termination"):
        tadcore.verify(ended)
