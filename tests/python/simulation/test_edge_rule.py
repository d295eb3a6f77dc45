"""Edges with hysteresis or a dwell time: a variant by name, played by the oracle too, and nothing where it is off."""

import dataclasses
import inspect

import numpy as np
import pytest

import tadcore
from oracle.model import Start, uniform
from oracle.network import number
from oracle.scenario import as_mapping
from oracle.stepping import Gains, Remembering, simulate

GAME = uniform("I1", (1, 1, 1), 1.2, 0.8, horizon=6.0, step=0.04)
CHATTERS = np.array([[1.9, -2.98], [2.14, -2.8], [1.38, -1.95], [2.18, 0.25], [-1.2, -0.46]])
START = Start(CHATTERS, np.array([5.0, 2.25, 1.25]), np.full(4, 0.1))
RULES = [(0.3, 0.0), (0.05, 0.25)]


@pytest.fixture(scope="module")
def sc():
    return tadcore.Scenario.model_validate(as_mapping(GAME, START))


@pytest.fixture(scope="module")
def gains():
    return Gains(GAME, few=0, many=1)


def same(one, other):
    """Whether two runs agree to the bit in everything recorded."""
    names = [f.name for f in dataclasses.fields(one) if f.name not in ("scenario", "hysteresis", "dwell")]
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in names)


@pytest.mark.parametrize(("hysteresis", "dwell"), RULES)
def test_the_oracle_plays_the_variant(sc, gains, hysteresis, dwell):
    run = tadcore.simulate(sc, hysteresis=hysteresis, dwell=dwell)
    played = simulate(GAME, START, gains, Remembering(START.zeta, hysteresis, dwell, GAME.step))
    assert (run.outcome.kind, run.outcome.defender) == (played.kind, played.defender)
    assert run.outcome.time == pytest.approx(played.time, abs=1e-9)
    assert [number(A) for A in run.adjacency[:-1]] == [number(A) for A in played.networks]
    assert np.abs(run.position - np.array(played.positions)).max() < 1e-8
    assert not same(run, tadcore.simulate(sc))


def test_off_is_the_papers_game_to_the_bit():
    for name in tadcore.scenarios.names():
        paper = tadcore.scenarios.load(name)
        run = tadcore.simulate(paper)
        assert same(run, tadcore.simulate(paper, hysteresis=0.0, dwell=0))
        assert (run.variant, run.hysteresis, run.dwell) == ("", 0.0, 0.0)
        # a band below the spacing of numbers goes the other way through the core and must come to the same
        assert same(run, tadcore.simulate(paper, hysteresis=5e-324))
        assert "variant" not in run.dataset.attrs


def test_a_band_or_a_dwell_time_ends_the_chattering(sc):
    assert tadcore.simulate(sc).chattering
    for hysteresis, dwell in ((0.3, 0.0), (0.0, 0.3)):
        run = tadcore.simulate(sc, hysteresis=hysteresis, dwell=dwell)
        assert not run.chattering
        edge = run.adjacency[:-1].reshape(len(run.times) - 1, -1)
        distance = np.linalg.norm(run.position[:, :3, None] - run.position[:, None, :], axis=-1)
        distance = distance[:-1, np.arange(3)[:, None], np.where(np.eye(3, 4, dtype=bool), 4, np.arange(4))]
        broke = edge[:-1] & ~edge[1:]
        formed = ~edge[:-1] & edge[1:]
        far = distance.reshape(len(edge), -1)[1:] - np.repeat(START.zeta, 4)
        if hysteresis:
            assert (far[broke] > hysteresis).all()
            assert (far[formed] <= 0).all()
        else:
            for column in (broke | formed).T:
                assert (np.diff(np.flatnonzero(column)) >= round(dwell / GAME.step)).all()


def test_a_variant_says_so_wherever_it_goes(sc, tmp_path):
    run = tadcore.simulate(sc, hysteresis=0.02, dwell=0.1)
    assert (run.hysteresis, run.dwell, run.variant) == (0.02, 0.1, "hysteresis 0.02 and dwell 0.1")
    assert repr(run).endswith("; a variant, edges with hysteresis 0.02 and dwell 0.1)")
    attributes = run.dataset.attrs
    assert attributes["variant"] == "not the paper's game: edges with hysteresis 0.02 and dwell 0.1"
    assert (attributes["hysteresis"], attributes["dwell"]) == (0.02, 0.1)
    run.save(tmp_path)
    assert "not the paper's game" in (tmp_path / "summary.json").read_text(encoding="utf-8")
    with pytest.raises(tadcore.ScenarioError, match="a run of the paper's game"):
        tadcore.verify(run)


@pytest.mark.parametrize("bad", [-0.1, np.nan, np.inf, True, "0.1", None])
@pytest.mark.parametrize("field", ["hysteresis", "dwell"])
def test_bad_numbers_are_refused(sc, field, bad):
    with pytest.raises(tadcore.ScenarioError, match=f"{field}: .* must be a finite number of at least 0"):
        tadcore.simulate(sc, **{field: bad})


def test_the_rule_is_no_part_of_a_scenario_or_a_batch():
    assert not {"hysteresis", "dwell"} & set(tadcore.Scenario.model_fields)
    for call in (tadcore.simulate_batch, tadcore.Study.run):
        assert not {"hysteresis", "dwell"} & set(inspect.signature(call).parameters)
    kinds = inspect.signature(tadcore.simulate).parameters
    assert all(kinds[name].kind is inspect.Parameter.KEYWORD_ONLY for name in ("hysteresis", "dwell"))
