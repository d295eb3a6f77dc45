"""A study with continuous termination asked questions over many games: they end as in the study."""

import numpy as np
import pytest

import tadcore
from tadcore.sampling import Disk


@pytest.fixture(scope="module")
def study():
    """Large steps and small capture radii: half of the games pass through a radius between two instants."""
    sc = tadcore.scenarios.load("paper-i1").replace(
        {"step": 0.1, "horizon": 3.0, "d*.capture_radius": 0.02, "attacker.capture_radius": 0.02}
    )
    vary = {"attacker.position": Disk([-2, 2], 1.0)}
    return tadcore.Study(sc, vary, trials=80, seed=5, termination="continuous")


def with_(study, **fields):
    changes = {path.replace("__", "."): value for path, value in fields.items()}
    return study.replace(sc=study.scenario.replace(changes))


def test_a_radius_curve_ends_games_as_its_study_does(study):
    radii = [1.0, 2.0, 3.0]
    for source in (study, study.run()):
        curve = tadcore.radius_curve(source, player="d2", radii=radii)
        for r, radius in enumerate(radii):
            assert np.array_equal(curve.kind[r], with_(study, d2__visibility_radius=radius).run().kind)
    sampled = tadcore.radius_curve(study.replace(termination="sampled"), player="d2", radii=radii)
    assert (sampled.kind != curve.kind).mean() > 0.1


def test_maps_and_searches_end_games_as_their_study_does(study):
    found = tadcore.probability_map(study, "d3", x=(-1, 1, 2), y=(0, 1, 2))
    for x in (-1.0, 1.0):
        for y in (0.0, 1.0):
            own = with_(study, d3__position=[x, y]).run().probabilities()
            assert np.array_equal(found.dataset["count"].sel(x=x, y=y), own.count)
    best = tadcore.best_start(study, "d3", x=(-1, 1), y=(0, 1), evaluations=20)
    again = with_(study.replace(seed=6), d3__position=list(best.position)).run().probabilities()
    assert best.estimate == again["intercepted"][0]
    shared = tadcore.best_radii(study, 4.0, evaluations=20)
    own = {f"{player}__visibility_radius": radius for player, radius in shared.radii.items()}
    assert shared.estimate == with_(study.replace(seed=6), **own).run().probabilities()["intercepted"][0]


def test_the_share_of_the_start_ends_games_as_its_study_does(study):
    failing = with_(study, sensing__mean_time_to_failure=20.0)
    first = (failing.run().kind == tadcore.OutcomeKind.TIMEOUT).sum()
    share = tadcore.analysis.start_share(failing, outcome="timeout")
    sampled = tadcore.analysis.start_share(failing.replace(termination="sampled"), outcome="timeout")
    assert 0 < first - share.both < share.one  # the first trial of each start is the study's own
    assert share.both < sampled.both - 10  # games that pass through a radius end there
