"""Rows that share a past and part: bitwise alike up to there, independent after it, and of the law of any other."""

import math

import numpy as np
import pytest

import tadcore
from tadcore.game.compiled import core_world, game_of
from tadcore.statistics.outcomes import outcome_names

CHANGES = [
    {"d*.disturbance": 0.3, "attacker.disturbance": 0.2},
    {"sensing.mean_time_to_failure": 0.4, "sensing.mean_time_to_repair": 0.2},
    {
        "d*.sensing.mean_time_detected": 0.3,
        "d*.sensing.mean_time_missed": 0.1,
        "d*.sensing.begin": "stationary",
        "d*.communication": {"radius": 3.0, "mean_time_up": 0.3, "mean_time_down": 0.2},
        "target.disturbance": 0.1,
    },
]


def courses(sc, stretches, *, event="captured", seed=5, threads=None):
    """The defenders and the course of the event's score, every row from the scenario's own start."""
    rows = len(stretches)
    flat = [one for row in stretches for one in row]
    return game_of(sc).score_courses(
        np.repeat(sc.positions[np.newaxis], rows, axis=0),
        np.atleast_2d(sc.visibility_radii),
        np.atleast_2d(sc.capture_radii),
        world=core_world(sc),
        seed=seed,
        offsets=np.cumsum([0, *(len(row) for row in stretches)]).astype(np.uint64),
        steps=np.array([k for k, _ in flat], dtype=np.uint64),
        trials=np.array([t for _, t in flat], dtype=np.uint64),
        column=outcome_names(sc.n).index(event),
        threads=threads,
    )


@pytest.fixture(params=range(len(CHANGES)))
def sc(request):
    return tadcore.scenarios.load("paper-i1").replace({"step": 0.02, "horizon": 3.0, **CHANGES[request.param]})


@pytest.mark.parametrize("event", ["captured", "d1", "intercepted"])
def test_one_stretch_is_a_trial_of_its_number(sc, event):
    first = 2**32 - 10
    batch = tadcore.simulate_batch(sc, [sc.positions] * 40, seed=5, first_trial=first, scores=True)
    who, course = courses(sc, [[(0, first + r)] for r in range(40)], event=event)
    assert course.shape == (40, sc.steps + 1)
    assert np.array_equal(course[:, -1], batch.scores[:, outcome_names(sc.n).index(event)])
    assert np.array_equal(who, batch.defender)
    assert (np.diff(course, axis=1) >= 0.0).all()


def test_rows_part_where_they_are_told(sc):
    rng = np.random.default_rng(3)
    places = rng.integers(0, sc.steps, size=(60, 2))
    places.sort(axis=1)
    whole = [[(0, r)] for r in range(60)]
    once = [[(0, r), (int(k), 1000 + r)] for r, (k, _) in enumerate(places)]
    twice = [[*row, (int(k), 2000 + r)] for r, (row, (_, k)) in enumerate(zip(once, places, strict=True))]
    found = {name: courses(sc, rows)[1] for name, rows in (("whole", whole), ("once", once), ("twice", twice))}
    for r, (first, second) in enumerate(places):
        assert np.array_equal(found["whole"][r, : first + 1], found["once"][r, : first + 1])
        assert np.array_equal(found["once"][r, : second + 1], found["twice"][r, : second + 1])
    # Scores are running maxima, so many stay; where they part early they differ.
    early = places[:, 0] < sc.steps // 10
    assert (found["whole"][early, -1] != found["once"][early, -1]).any()
    assert courses(sc, twice, threads=1)[1].tobytes() == courses(sc, twice, threads=3)[1].tobytes()
    # Rows of one path are one path, whatever stands around them.
    assert np.array_equal(courses(sc, twice[17:18])[1][0], found["twice"][17])


def test_what_follows_a_parting_has_the_law_of_any_other(sc):
    """Of 20,000 games that part once or twice as many are captured, in the mean, as of 20,000 that do not."""
    rng = np.random.default_rng(4)
    rows = 20_000
    places = np.sort(rng.integers(0, sc.steps // 2, size=(rows, 2)), axis=1).tolist()
    parted = [[(0, r), (a, 10**6 + r), (b, 2 * 10**6 + r)] for r, (a, b) in enumerate(places)]
    plain = [[(0, 10**7 + r)] for r in range(rows)]
    for event in ("captured", "d1"):
        one, two = (np.mean(courses(sc, kind, event=event)[1][:, -1] >= 0.0) for kind in (parted, plain))
        assert 0.02 < two < 0.98
        assert abs(one - two) < 4.0 * math.sqrt(2.0 * two * (1.0 - two) / rows), (event, one, two)


def test_what_is_no_lineage_is_refused():
    sc = tadcore.scenarios.load("paper-i1").replace({"d*.disturbance": 0.1})
    for bad in ([[(1, 5)]], [[(0, 5), (3, 6), (2, 7)]], [[(0, 5), (sc.steps, 6)]], [[(0, 2**56)]]):
        with pytest.raises(ValueError, match=r"steps of row 0|trials"):
            courses(sc, bad)
