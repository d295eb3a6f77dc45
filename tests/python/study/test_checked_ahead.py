"""What no study can be: refused by name, and every trial before anything runs."""

import math
import signal
import time
import tracemalloc

import numpy as np
import pytest
from scipy import stats

import tadcore
from study_cases import CHUNK, ESCAPE, calm, escaping, philox, ring, study
from tadcore import ScenarioError
from tadcore.sampling import Box, Cycle, Gaussian


@pytest.mark.parametrize(
    ("path", "words"),
    [
        ("interaction", r"tadcore\.sweep"),
        ("atacker.position", r"did you mean attacker\.position\?"),
        ("defenders.0.visibility", r"did you mean d1\.visibility_radius\?"),
        ("defender.*.position", r"did you mean d\*\.position\?"),
        ("defenders.3.position", r"of this game, which has 3 defenders, d1 to d3"),
        ("attacker.visibility_radius", "the path of a position, a radius or a weight"),
        ("target.capture_radius", "the path of a position, a radius or a weight"),
        ("attacker.position.z", "the path of a position, a radius or a weight"),
        ("defenders.*", "the path of a position, a radius or a weight"),
        ("attacker.*", "the path of a position, a radius or a weight"),
        ("*", "the path of a position, a radius or a weight"),
        ("", "the path of a position, a radius or a weight"),
        (3, "a path such as attacker"),
    ],
)
def test_paths_that_cannot_vary_are_refused_with_the_way_to_do_it(path, words):
    with pytest.raises(ScenarioError, match=words):
        study(10, vary={path: Box(1, 2)})


@pytest.mark.parametrize(
    ("options", "field"),
    [
        ({"trials": 0}, "trials"),
        ({"trials": -1}, "trials"),
        ({"trials": 1e3}, "trials"),
        ({"trials": True}, "trials"),
        ({"seed": -1}, "seed"),
        ({"seed": 2**64}, "seed"),
        ({"seed": 1.0}, "seed"),
        ({"seed": None}, "seed"),
        ({"design": "halton"}, "design"),
        ({"vary": {}}, "vary"),
        ({"vary": []}, "vary"),
        ({"sc": "paper-i"}, "scenario"),
    ],
)
def test_bad_arguments_are_refused_by_name(options, field):
    with pytest.raises(ScenarioError) as caught:
        study(**options)
    assert caught.value.field == field


def test_one_quantity_varies_once():
    for one, other in [
        ("defenders.*.position", "defenders.0.position"),
        ("*.capture_radius", "attacker.capture_radius"),
        ("attacker.position", "attacker.position.x"),
        ("defenders[0].position.x", "defenders.0.position.x"),
    ]:
        with pytest.raises(ScenarioError, match="once only"):
            study(10, vary={one: Box(1, 2), other: Box(1, 2)})
    vary = {"attacker.position.x": Box(0, 1), "attacker.position.y": Box(1, 2)}
    assert study(10, vary=vary).columns == tuple(vary)


def nan_at_9000(rng, size):
    """Points of a circle, one of which is none: in the second chunk only."""
    points = ring(rng, size)
    if round(points[0, 0], 12) == NINTH:
        points[9000 - CHUNK, 1] = math.nan
    return points


NINTH = round(float(ring(np.random.Generator(np.random.Philox(key=np.array([7, 1], dtype=np.uint64))), 1)[0, 0]), 12)


@pytest.mark.parametrize(
    ("vary", "words"),
    [
        ({"attacker.position": nan_at_9000}, r"attacker\.position\.y, trial 9,000: got nan, must be a finite number"),
        ({"defenders.0.capture_radius": Box(-1, 0.1)}, r"capture_radius, trial \d+: got -0\.\d+, must be a positive"),
        ({"defenders.2.visibility_radius": Gaussian(1, 2)}, r"visibility_radius, trial \d+: got -\d.*, or inf"),
        ({"attacker.capture_radius": [0.1, math.inf]}, r"attacker\.capture_radius, trial \d: got inf, must be a posi"),
        (
            {"defenders.0.visibility_radius": Cycle([5.0] * 9000 + [0.1])},
            r"0\.visibility_radius, trial 9,000: got 0\.1, must be larger than the defender's capture radius, 0\.1",
        ),
        (
            {"defenders.1.visibility_radius": Box(1, 2), "defenders.1.capture_radius": Box(0.5, 1.1)},
            r"1\.visibility_radius, trial [\d,]+: got 1\.\d+, must be larger than the defender's capture radius",
        ),
    ],
)
def test_a_bad_draw_is_refused_before_anything_runs(vary, words, monkeypatch, tmp_path):
    monkeypatch.setattr("tadcore.study.plan.Plan.play", lambda *_, **__: pytest.fail("a game was played"))
    with pytest.raises(ScenarioError, match=words):
        study(2 * CHUNK, vary=vary).run(store=tmp_path / "store")
    assert not (tmp_path / "store").exists()


def first_at_most(seed, trials, mean, spread, bound):
    """The first trial of N(mean, spread²) at most ``bound``, from the documented stream and SciPy's quantiles."""
    for chunk in range(math.ceil(trials / CHUNK)):
        low = stats.norm(mean, spread).ppf(philox(seed, chunk, PURPOSE_OF_D1_SIGHT, 1)[:, 0]) <= bound
        if low.any():
            trial = chunk * CHUNK + int(low.argmax())
            return trial if trial < trials else None
    return None


PURPOSE_OF_D1_SIGHT = 8 * 2 + 1


@pytest.mark.parametrize(
    ("spread", "seed", "trials"),
    [(0.19, 11, 1_600_000), (0.185, 12, 3_000_000), (0.18, 5, 6_000_000), (0.19, 11, 1_408_743)],
)
def test_every_trial_of_a_long_study_is_checked_before_anything_runs(monkeypatch, tmp_path, spread, seed, trials):
    class PlayedError(Exception):
        pass

    def played(*given, **named):
        raise PlayedError

    monkeypatch.setattr("tadcore.study.plan.Plan.play", played)
    wanted = study(trials, seed, vary={"d1.visibility_radius": stats.norm(1.0, spread)})
    bad = first_at_most(seed, trials, 1.0, spread, 0.1)
    if bad is None:
        with pytest.raises(PlayedError):
            wanted.run()
        return
    assert bad > 2**20
    with pytest.raises(
        ScenarioError, match=rf"^defenders\.0\.visibility_radius, trial {bad:,}: got .*, must be larger"
    ):
        wanted.run(store=tmp_path / "store")
    assert not (tmp_path / "store").exists()


def test_a_normal_position_is_checked_to_the_last_trial():
    seed, trials, bound = 3, 2_000_000, 1e100 / stats.norm.isf(3e-7)
    unlimited = calm().replace({"d*.visibility_radius": math.inf})
    wanted = study(trials, seed, sc=unlimited, vary={"target.position.x": Gaussian(0.0, bound)})
    values = np.abs(wanted.inputs()["target.position.x"])
    bad = int((values > 1e100).argmax())
    assert bad > CHUNK
    with pytest.raises(ScenarioError, match=rf"^target\.position\.x, trial {bad:,}: got .* between -1e100 and 1e100"):
        wanted.run()


def test_the_check_of_a_very_long_study_stops_on_ctrl_c_and_needs_no_memory(tmp_path):
    signal.signal(signal.SIGALRM, signal.default_int_handler)
    signal.setitimer(signal.ITIMER_REAL, 0.5)
    began = time.monotonic()
    tracemalloc.start()
    try:
        with pytest.raises(KeyboardInterrupt):
            study(2**32, vary={"d1.visibility_radius": stats.norm(5.0, 0.1)}).run(store=tmp_path / "store")
        assert tracemalloc.get_traced_memory()[1] < 20e6
    finally:
        tracemalloc.stop()
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, signal.SIG_DFL)
    assert time.monotonic() - began < 2.0
    assert not (tmp_path / "store").exists()


def test_radii_without_limit_and_distributions_that_reach_below_are_taken_as_drawn():
    vary = {"defenders.*.visibility_radius": [1.0, math.inf], "defenders.0.capture_radius": Gaussian(0.2, 0.001)}
    assert study(3000, vary=vary).run().trials == 3000
    assert study(10, vary={"defenders.*.visibility_radius": stats.lognorm(0.1)}).run().trials == 10


def test_a_game_without_equilibrium_is_an_error_before_the_store_is_made(tmp_path):
    with pytest.raises(tadcore.NoEquilibriumError) as caught:
        study(10, sc=escaping(4.0)).run(store=tmp_path / "store")
    assert caught.value.escape_time == pytest.approx(ESCAPE, rel=1e-9)
    assert not (tmp_path / "store").exists()


def test_what_is_no_executor_is_refused():
    class Client:
        def get_executor(self):
            """As Dask's client has it."""

    with pytest.raises(ScenarioError, match=r"client\.get_executor\(\)"):
        study(10).run(executor=Client())
    for threads in (0, 1.5):
        with pytest.raises(ScenarioError, match="threads"):
            study(10).run(threads=threads)
