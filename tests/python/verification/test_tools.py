"""Geometry, steps, event times, externality and the protocol: right on good games, and able to fail."""

import dataclasses

import matplotlib as mpl
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import tadcore
from tadcore import verification as v
from tadcore.plotting import externality as draw
from tadcore.verification.checks import geometry, steps

mpl.use("agg")


def play(name, **changes):
    return tadcore.simulate(tadcore.scenarios.load(name).replace(changes))


def placed(name, positions):
    return moved_to(tadcore.scenarios.load(name), positions)


def moved_to(sc, positions):
    names = [*(f"defenders[{i}]" for i in range(sc.n)), "target", "attacker"]
    return sc.replace({f"{p}.position": x for p, x in zip(names, positions, strict=True)})


CHATTERS = [[1.9, -2.98], [2.14, -2.8], [1.38, -1.95], [2.18, 0.25], [-1.2, -0.46]]


# ---- geometry


def test_the_line_of_a_suicidal_attacker_and_only_of_one():
    assert v.off_the_line(play("paper-i1-suicidal")) < 1e-13
    assert v.off_the_line(play("paper-i1")) > 1e-3
    bent = play("paper-i1-suicidal")
    position = bent.position.copy()
    position[30, -1] += [0.0, 1e-6]
    report = v.check_geometry(dataclasses.replace(bent, position=position))
    assert not report["geometry.line"].accepted


def test_a_radius_delays_nothing_else(monkeypatch):
    sc = tadcore.scenarios.load("paper-i2")
    instants, identical = v.radius_delay(sc, "d3", 0.3, 0.6)
    assert instants == round(1.405 / 0.005)  # the first edge of d3, as the paper's run with 0.6 has it
    assert identical
    with pytest.raises(tadcore.ScenarioError, match="one of d1, d2, d3, target"):
        v.radius_delay(sc, "attacker", 0.3, 0.6)
    real = geometry.simulate

    def leaking(scenario, **draws):
        """The radius of d3 shifts the last bit of a control."""
        run = real(scenario, **draws)
        return dataclasses.replace(run, control=run.control * (1.0 + 1e-15 * (scenario.visibility_radii[2] > 0.5)))

    monkeypatch.setattr(geometry, "simulate", leaking)
    assert v.radius_delay(sc, "d3", 0.3, 0.6) == (instants, False)


@pytest.mark.parametrize("name", ["rotation", "reflection", "translation", "relabelling"])
def test_a_symmetry_that_does_not_hold_is_found(name, monkeypatch):
    run = play("paper-i1", step=0.02)
    assert v.check_geometry(run)[f"geometry.{name}"].ok
    real = geometry.simulate

    def skewed(sc, **draws):
        other = real(sc, **draws)
        return dataclasses.replace(other, position=other.position * (1.0 + 1e-6))

    monkeypatch.setattr(geometry, "simulate", skewed)
    assert not v.check_geometry(run)[f"geometry.{name}"].accepted


def test_another_ending_is_infinitely_unlike():
    run, other = play("paper-i1"), play("paper-i1-full")
    assert geometry.unlike(run, other, run.position, 0) == np.inf


def test_a_game_on_the_rim_cannot_decide_a_symmetry(monkeypatch):
    """Exactly at a visibility radius rounding decides, so the checks are not converged."""
    sc = tadcore.scenarios.load("paper-i1").replace({"defenders[0].visibility_radius": float(np.hypot(2.0, 2.0))})
    run = tadcore.simulate(sc)
    real = geometry.simulate

    def flipped(moved, **draws):
        other = real(moved, **draws)
        return dataclasses.replace(other, outcome=dataclasses.replace(other.outcome, time=0.0))

    monkeypatch.setattr(geometry, "simulate", flipped)
    assert not v.check_geometry(run)["geometry.rotation"].converged
    away = tadcore.simulate(sc.replace({"defenders[0].visibility_radius": 2.9}))
    assert v.check_geometry(away)["geometry.rotation"].converged  # there it is a failure


# ---- steps


def test_the_outcome_of_the_paper_survives_smaller_steps():
    study = v.step_study(tadcore.scenarios.load("paper-i1"))
    assert study.stable
    assert study.steps == (0.005, 0.0025, 0.00125)
    assert [o.time for o in study.outcomes] == [1.395, 1.3925, 1.39375]
    assert study.changes == (5, 5, 5)
    assert not any(study.chatter)
    assert "δ = 0.0025" in repr(study)


def test_an_outcome_that_depends_on_the_step_is_found(monkeypatch):
    run = play("paper-i1", step=0.01)
    assert v.check_steps(run).ok
    real = steps.simulate

    def turning(sc):
        """At the smallest step someone else wins."""
        other = real(sc)
        outcome = dataclasses.replace(other.outcome, defender=1) if sc.step < 0.003 else other.outcome
        return dataclasses.replace(other, outcome=outcome)

    monkeypatch.setattr(steps, "simulate", turning)
    assert not v.check_steps(run)["steps.outcome"].accepted
    assert not v.step_study(run.scenario).stable


def test_chattering_is_found_where_an_edge_keeps_flipping():
    run = play("paper-i1")
    assert v.chatter(run) == ()
    adjacency = run.adjacency.copy()
    adjacency[101:121:2, 2, 1] ^= True  # ten single flips there and back
    (found,) = v.chatter(dataclasses.replace(run, adjacency=adjacency))
    assert found == v.Chatter(("d3", "d2"), run.times[101], run.times[120], 20)
    adjacency = run.adjacency.copy()
    adjacency[[20, 60, 100, 140], 2, 1] ^= True  # as many flips, but far apart
    assert v.chatter(dataclasses.replace(run, adjacency=adjacency)) == ()


def test_how_many_games_change_under_refinement():
    sc = tadcore.scenarios.load("paper-i1").replace(step=0.04)
    rng = np.random.default_rng(5)
    positions = rng.uniform(-2.5, 2.5, (150, 5, 2))
    found = v.refine_batch(sc, positions, halvings=1, threads=1)
    coarse, fine = (tadcore.simulate_batch(sc.replace(step=s), positions, threads=1) for s in (0.04, 0.02))
    differs = [(a.kind, a.defender) != (b.kind, b.defender) for a, b in zip(coarse, fine, strict=True)]
    assert found.changed == (np.mean(differs),)
    assert 0 < sum(differs) < 40
    assert found.undecided.tolist() == np.flatnonzero(differs).tolist()
    assert found.steps == (0.04, 0.02)


# ---- events


def full_sight(sc):
    """A game with full sight by SciPy: P, then z with an event for each capture circle; the end and z there."""
    m = v.oracle.matrices.matrices_of(sc)
    N = m.size
    options = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13}
    back = solve_ivp(
        lambda s, y: -m.slope(y.reshape(m.F.shape)).ravel(), (0, sc.horizon), m.F.ravel(), dense_output=True, **options
    )

    def motion(t, y):
        rows = m.rows(back.sol(sc.horizon - t).reshape(m.F.shape))
        return (m.B @ rows @ y.reshape(N, -1)).ravel()

    events = []
    for i, radius in enumerate(sc.capture_radii):
        events.append(lambda t, y, i=i, radius=radius: np.linalg.norm(y.reshape(N, -1)[i]) - radius)
        events[-1].terminal = True
    z = (sc.positions[:-1] - sc.positions[-1]).ravel()
    found = solve_ivp(motion, (0, sc.horizon), z, events=events, **options)
    return found.t[-1], found.y[:, -1].reshape(N, -1)


@pytest.mark.parametrize("name", ["paper-i1-full", "paper-i2-full"])
def test_the_continuous_end_is_scipys(name):
    sc = tadcore.scenarios.load(name).replace(step=0.02)
    assert v.play_by_events(sc).outcome.time == pytest.approx(full_sight(sc)[0], abs=1e-5)


@pytest.mark.parametrize("name", ["paper-i1-full", "paper-i2-full"])
def test_the_continuous_motion_is_of_second_order(name):
    sc = tadcore.scenarios.load(name).replace(horizon=1.0)
    exact = full_sight(sc)[1]
    errors = [np.abs(v.play_by_events(sc.replace(step=step)).position - exact).max() for step in (0.1, 0.05, 0.025)]
    slopes = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.allclose(slopes, 2.0, atol=0.1)


def test_events_lie_within_a_step_of_the_grids():
    sc = tadcore.scenarios.load("paper-i1")
    run, found = tadcore.simulate(sc), v.play_by_events(sc)
    assert found.resolved
    assert (found.outcome.kind, found.outcome.defender) == (run.outcome.kind, run.outcome.defender)
    changes = run.network_changes[1:]
    assert [event.edge for event in found.events] == [change.added[0] for change in changes]
    late = np.array([change.time for change in changes]) - found.times
    assert ((late > 0) & (late < 0.006)).all()
    z = found.position
    assert np.linalg.norm(z[0]) == pytest.approx(0.1, abs=1e-12)  # exactly on the capture circle


def test_a_chattering_game_slides_and_the_grid_converges_to_it():
    sc = placed("paper-i1", CHATTERS).replace(step=0.01)
    found = v.play_by_events(sc)
    assert found.resolved
    first, last = (event for event in found.events if "slid" in event.kind)
    assert (first.kind, last.kind, first.edge) == ("slides", "stops sliding", ("d1", "d2"))
    changes = []
    for step in (0.005, 0.0025, 0.00125):
        run = tadcore.simulate(sc.replace(step=step))
        (loud,) = v.chatter(run)
        assert loud.edge == first.edge
        assert loud.start == pytest.approx(first.time, abs=1.5 * step)
        assert loud.end == pytest.approx(last.time, abs=10 * step)
        assert run.outcome.time == pytest.approx(found.outcome.time, abs=2 * step)
        changes.append(loud.flips)
    assert changes[1] > 1.8 * changes[0]  # how often it flips is a property of δ
    assert changes[2] > 1.8 * changes[1]
    assert any("d1→d2 chatters" in note for note in v.check_steps(run).notes)


def test_the_sliding_mode_is_the_limit_of_the_chattering():
    sc = placed("paper-i1", CHATTERS).replace(step=0.01)
    study = v.sliding_study(sc)
    (slide,) = study.play.slides
    assert slide.edges == (("d1", "d2"),)
    begins, ends = (event.time for event in study.play.events if "slid" in event.kind)
    assert (slide.start, slide.end) == (begins, ends)
    # Filippov's share against the grid's, which only counts: all errors are of the order of δ
    for found, exact in ((study.share, slide.share), (study.start, slide.start), (study.end, slide.end)):
        assert (np.abs(found[0] - exact) < 2.5 * study.steps).all(), found
    assert np.allclose(study.drift[0, :-1] / study.drift[0, 1:], 2.0, atol=0.1)  # the distance tends to ζ, at order 1
    assert (study.flips[0, 1:] > 1.8 * study.flips[0, :-1]).all()  # and the flips to infinity
    assert np.abs(study.ends - study.play.outcome.time).max() < 0.01
    text = repr(study)
    assert "d1→d2: slides from 1.2199 to 1.91186" in text
    assert "δ = 0.00125" in text


def test_a_run_says_that_it_chatters():
    run = tadcore.simulate(placed("paper-i1", CHATTERS))
    assert run.chattering == v.chatter(run)
    assert [c.edge for c in run.chattering] == [("d1", "d2")]
    assert repr(run).endswith("network changes, chattering: d1→d2)")
    assert "\n" not in repr(run)
    quiet = play("paper-i1")
    assert quiet.chattering == ()
    assert "chatter" not in repr(quiet)


def test_two_who_see_each_other_across_one_circle_slide_as_one():
    rng = np.random.default_rng(0)
    sc = tadcore.scenarios.load("paper-i1").replace(
        {f"defenders[{i}].visibility_radius": 2.0 for i in range(3)} | {"step": 0.02}
    )
    met = 0
    for _ in range(12):
        at = moved_to(sc, rng.uniform(-2.5, 2.5, (5, 2)))
        play = v.play_by_events(at)
        for event in play.events:
            back = (event.edge[1], event.edge[0])
            if "attacker" not in back and "target" not in back:
                assert any(e.time == event.time and e.kind == event.kind and e.edge == back for e in play.events)
        met += sum(len(slide.edges) == 2 for slide in play.slides)
        for slide in play.slides:
            assert 0.0 <= slide.share <= 1.0
            assert slide.start <= slide.end
    assert met  # this happens


def test_a_game_over_at_once_has_no_events():
    sc = tadcore.scenarios.load("paper-i1").replace({"target.position": [-2.0, 2.0]})
    found = v.play_by_events(sc)
    assert (found.outcome.kind, found.outcome.time, found.events) == ("captured", 0.0, ())


# ---- externality


@pytest.mark.parametrize(
    "field", [{"sensing.mean_time_to_failure": 1.0}, {"communication.radius": 2.0}, {"attacker.disturbance": 0.1}]
)
def test_what_surrounds_a_game_has_no_play_in_continuous_time(field):
    sc = tadcore.scenarios.load("paper-i1").replace(field)
    for asked in (v.play_by_events, v.sliding_study):
        with pytest.raises(tadcore.ScenarioError, match="failures, links or disturbances"):
            asked(sc)


def test_a_new_edge_moves_the_others_too():
    run = play("paper-i1")
    found = v.control_jumps(run)
    changes = run.network_changes[1:]
    assert found["time"].values.tolist() == [change.time for change in changes]
    assert found["edges"].values.tolist() == [f"+{p}→{q}" for change in changes for p, q in change.added]
    own = found["own"].values
    assert [found["player"].values[row].tolist() for row in own] == [[c.added[0][0]] for c in changes]
    assert (found["size"].values[~own] > 1e-3).all()  # every other defender's control jumps as well
    # the jump is what the control does across the change, up to the motion of one step
    k = round(0.49 / 0.005)
    across = run.control[k, :3] - run.control[k - 1, :3]
    assert np.allclose(found["jump"].sel(time=run.times[k]).values, across, atol=0.05)
    assert len(found["size"].to_dataframe()) == 15


def test_no_change_no_jump():
    found = v.control_jumps(play("paper-i1-full"))
    assert dict(found.sizes) == {"time": 0, "player": 3, "axis": 2}


def test_the_jumps_are_drawn():
    run = play("paper-i2")
    ax = draw(run)
    heights = {round(float(y), 9) for line in ax.lines for y in np.atleast_1d(line.get_ydata())}
    size = v.control_jumps(run)["size"].values
    assert {round(float(y), 9) for y in size[size > 0]} <= heights
    assert len(ax.get_xticks()) == len(run.network_changes) - 1
    mpl.pyplot.close(ax.figure)


# ---- the protocol


@pytest.mark.parametrize("name", ["paper-i1", "paper-i2"])
def test_the_players_reach_the_central_optimum(name):
    run = play(name)
    found = v.decentralise(run.scenario, step=0, adjacency=run.adjacency[0])
    assert found.converged
    assert abs(found.gap) < 1e-12
    assert found.distance < 1e-7
    assert found.staleness == 0
    m, size = run.adjacency[0].shape
    assert found.scalars == found.messages * size
    assert found.messages % (m - 1) == 0
    assert m * (m - 1) < found.messages <= (found.rounds + 1) * m * (m - 1)
    assert (np.diff(found.history) <= 1e-14 * found.history[0]).all()  # each turn descends the common Θ


def test_late_messages_cost_rounds_and_change_nothing_else():
    run = play("paper-i1")
    prompt, late = (v.decentralise(run.scenario, step=0, adjacency=run.adjacency[0], delay=d) for d in (0, 1))
    assert late.converged
    assert abs(late.gap) < 1e-8
    assert late.rounds > prompt.rounds
    assert late.staleness == 1


def test_plain_gradients_get_there_too_and_a_bound_on_rounds_is_reported():
    run = play("paper-i1")
    found = v.decentralise(run.scenario, step=0, adjacency=run.adjacency[0], method="gradient", max_rounds=400)
    assert abs(found.gap) < 1e-6
    cut = v.decentralise(run.scenario, step=0, adjacency=run.adjacency[0], max_rounds=2)
    assert not cut.converged
    assert cut.gap > 1e-8
    assert "still talking after 2 rounds" in repr(cut)


def test_a_player_is_told_nothing_of_the_others_sight(monkeypatch):
    """Each player's objective is built from a network in which it alone sees."""
    told = []
    real = v.checks.decentral.FullObjective

    def listening(sc, m, values, adjacency, dim=None):
        told.append(adjacency.copy())
        return real(sc, m, values, adjacency, dim)

    monkeypatch.setattr(v.checks.decentral, "FullObjective", listening)
    run = play("paper-i1")
    v.decentralise(run.scenario, step=0, adjacency=run.adjacency[0], max_rounds=1)
    for i, seen in enumerate(told[:3]):
        assert not np.delete(seen, i, axis=0).any()
        assert np.array_equal(seen[i], run.adjacency[0][i])


@pytest.mark.parametrize("name", ["paper-i1", "paper-i2"])
def test_the_protocol_runs_between_anchors_too(name):
    """Where a minimum was followed from other instants it is still in the basin of the canonical start."""
    run = play(name)
    changed = np.flatnonzero((run.adjacency[1:-1] != run.adjacency[:-2]).any(axis=(1, 2))) + 1
    found = [tadcore.synthesize(run.scenario, step=int(k), adjacency=run.adjacency[k]).start for k in changed]
    assert "between" in found
    report = v.check_decentral(run)
    assert report.ok
    assert not report.notes
    assert report.checks[0].detail.startswith("3 networks")


def test_a_protocol_that_stops_early_is_found(monkeypatch):
    run = play("paper-i1")
    assert v.check_decentral(run).ok
    real = v.checks.decentral.decentralise
    monkeypatch.setattr(v.checks.decentral, "decentralise", lambda *a, **o: real(*a, max_rounds=3, **o))
    report = v.check_decentral(run)
    assert not report.accepted
    assert not report.converged


def test_options_are_checked():
    sc = tadcore.scenarios.load("paper-i1")
    blind = np.zeros((3, 4), dtype=bool)
    with pytest.raises(tadcore.ScenarioError, match="method"):
        v.decentralise(sc, step=0, adjacency=blind, method="magic")
    with pytest.raises(tadcore.ScenarioError, match="step"):
        v.decentralise(sc, step=-1, adjacency=blind)
    found = v.decentralise(sc, step=0, adjacency=blind)
    assert found.converged
    assert not found.rows.any()
