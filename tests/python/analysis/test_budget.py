"""How to share a budget of radii: against a grid over all shares, with the answer played again by studies."""

import numpy as np
import pytest

import tadcore
from tadcore import ScenarioError, best_radii
from tadcore.analysis.budget import _parts
from tadcore.sampling import Box, Disk
from tadcore.statistics import paired


@pytest.fixture(scope="module")
def study():
    sc = tadcore.scenarios.load("paper-i1").replace({"step": 0.02})
    return tadcore.Study(sc, {"attacker.position": Disk([-2, 2], 1.0)}, trials=150, seed=11)


@pytest.fixture(scope="module")
def found(study):
    return best_radii(study, 4.0, evaluations=300)


def played(study, radii, **changes):
    fields = {f"d{i}.visibility_radius": radius for i, radius in enumerate(radii, start=1)}
    return study.replace(sc=study.scenario.replace(fields), **changes).run()


def test_the_answer_is_that_of_studies_with_fresh_trials(study, found):
    radii = list(found.radii.values())
    assert list(found.radii) == ["d1", "d2", "d3"]
    assert sum(radii) == pytest.approx(4.0, abs=1e-12)
    fresh, equal = played(study, radii, seed=12), played(study, [4.0 / 3.0] * 3, seed=12)
    assert (found.estimate, found.low, found.high) == fresh.probabilities(method="exact")["intercepted"]
    assert found.own == equal.probabilities()["intercepted"][0]
    pair = paired(fresh.kind, fresh.defender, equal.kind, equal.defender, 3)
    i = pair.names.index("intercepted")
    assert (found.gain, found.gain_low, found.gain_high) == pytest.approx(
        (pair.difference[i], pair.low[i], pair.high[i])
    )
    assert found.searched == played(study, radii).probabilities()["intercepted"][0]
    assert repr(found) == repr(best_radii(study, 4.0, evaluations=300, threads=1))


def test_no_share_of_a_grid_is_better(study, found):
    parts = [(i, j, 12 - i - j) for i in range(13) for j in range(13 - i)]
    least = study.scenario.capture_radii[:3] * (1.0 + 1e-6)
    best = max(
        played(study, least + (4.0 - least.sum()) * np.array(part) / 12.0).probabilities()["intercepted"][0]
        for part in parts
    )
    assert found.searched >= best


def test_equal_volumes_are_equal_volumes_of_shares():
    """Uniform shares of four: each is below x with probability 1 - (1 - x)^3, and all sum to one."""
    grid = (np.stack(np.meshgrid(*[np.arange(40)] * 3), axis=-1).reshape(-1, 3) + 0.5) / 40.0
    shares = np.array([_parts(cuts) for cuts in grid])
    assert shares.min() >= 0.0
    assert np.allclose(shares.sum(axis=1), 1.0)
    for share in shares.T:
        for x in (0.1, 0.3, 0.6):
            assert np.mean(share < x) == pytest.approx(1.0 - (1.0 - x) ** 3, abs=0.02)


def test_radii_that_a_study_varies_give_way(study):
    varied = study.replace(vary={**study.vary, "d*.visibility_radius": Box(1.0, 4.0)})
    fixed = best_radii(study, 4.0, evaluations=40)
    assert best_radii(varied, 4.0, evaluations=40).trials == fixed.trials == 150


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"total": 0.2}, "total"),
        ({"total": np.inf}, "total"),
        ({"total": "6"}, "total"),
        ({"outcome": "won"}, "outcome"),
        ({"evaluations": 3}, "evaluations"),
        ({"seed": 11}, "seed"),
        ({"level": 0.0}, "level"),
    ],
)
def test_bad_questions_are_refused_by_name(study, wrong, said):
    given = {"total": 4.0, **wrong}
    with pytest.raises(ScenarioError) as refused:
        best_radii(study, given.pop("total"), **given)
    assert refused.value.field == said


def test_there_is_nothing_to_share_alone(study):
    sc = study.scenario
    alone = sc.replace({"defenders": sc.model_dump()["defenders"][:1]})
    with pytest.raises(ScenarioError, match="a team of two or more"):
        best_radii(study.replace(sc=alone), 4.0)
    with pytest.raises(ScenarioError, match="study"):
        best_radii(study.run(), 4.0)
