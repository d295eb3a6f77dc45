"""Results as notebooks show them, and as tables of pandas."""

import base64
import inspect
from html.parser import HTMLParser

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from scipy import stats

import tadcore
from tadcore import plotting
from tadcore.sampling import Box, Disk

VOID = {"img", "br"}


class Page(HTMLParser):
    """Reads a page whose tags must nest."""

    def __init__(self, text):
        super().__init__()
        self.open, self.words, self.pictures = [], [], []
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attributes):
        if tag not in VOID:
            self.open.append(tag)
        if tag == "img":
            self.pictures.append(dict(attributes))

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.words.append(data)


@pytest.fixture(scope="module")
def sc():
    return tadcore.scenarios.load("paper-i1").replace({"step": 0.02})


@pytest.fixture(scope="module")
def study(sc):
    return tadcore.Study(sc, {"attacker.position": Disk([-2, 2], 1.0)}, trials=60, seed=7)


@pytest.fixture(scope="module")
def shown(sc, study):
    result, run = study.run(), tadcore.simulate(sc)
    curve = tadcore.radius_curve(study, player="d1", radii=np.linspace(0.5, 5, 40))
    return {
        "scenario": sc,
        "run": run,
        "batch": tadcore.simulate_batch(sc, [sc.positions] * 3),
        "study": result,
        "probabilities": result.probabilities(),
        "incidence": result.incidence(),
        "comparison": result.compare(study.replace(sc=sc.replace({"d1.visibility_radius": 0.5})).run()),
        "curve": curve,
        "sweep": tadcore.sweep(study, {"horizon": [2.0, 6.0], "attacker.control_weight": [0.8, 0.05]}),
        "map": tadcore.outcome_map(sc, x=(-3, 3, 7), y=(-2, 4, 7)),
        "probability map": tadcore.probability_map(study, "d3", x=(-1, 1, 3), y=(0, 2, 3)),
        "sensitivity": tadcore.analysis.sensitivity(sc, {"attacker.position.x": stats.uniform(-3, 3)}, points=8),
        "verification": tadcore.verify(run, deviations=0, instants=1),
    }


NAMES = [
    "scenario", "run", "batch", "study", "probabilities", "incidence", "comparison", "curve", "sweep", "map",
    "probability map", "sensitivity", "verification",
]  # fmt: skip
EXPECTED = {
    "scenario": ["I1, defenders against attacker and target (λ = 1)", "d3", "(-2, 2)", "1.25", "∞"],
    "run": ["d1 intercepts the attacker at t = 1.4", "d1→attacker", "edges that form"],
    "batch": ["3 games", "intercepted", "3"],
    "study": ["60 trials", "intercepted", "varies attacker.position; seed 7"],
    "curve": ["visibility radius of d1, 60 trials at each", "0.5", "…", "P(captured)"],
    "sweep": ["horizon", "attacker.control_weight", "P(intercepted)"],
    "verification": ["record.outcome", "fne.riccati.defenders"],
}


@pytest.mark.parametrize("name", NAMES)
def test_a_notebook_shows_it(shown, name):
    text = shown[name]._repr_html_()
    page = Page(text)
    for words in EXPECTED.get(name, []):
        assert any(words in said for said in page.words), (words, page.words[:40])
    for picture in page.pictures:
        assert base64.b64decode(picture["src"].partition(",")[2])[:4] == b"\x89PNG"
        assert picture["alt"]
    assert bool(page.pictures) == (name in ("run", "map", "probability map"))
    assert plt.get_fignums() == []
    assert repr(shown[name])


def test_what_comes_from_outside_is_escaped(shown):
    report = shown["verification"]
    odd = tadcore.VerificationReport("<script>alert(1)</script>", report.checks, notes=("<b>",))
    assert "<script>" not in odd._repr_html_()
    assert "&lt;b&gt;" in odd._repr_html_()


def test_a_run_is_a_table(shown):
    run = shown["run"]
    frame = run.to_pandas()
    assert len(frame) == len(run.times) * 5
    at = frame.loc[(run.times[3], "d2")]
    assert at[["x", "y"]].tolist() == run.position[3, 1].tolist()
    assert at[["control_x", "control_y"]].tolist() == run.control[3, 1].tolist()
    assert at["distance"] == np.hypot(*(run.position[3, 1] - run.position[3, -1]))


def test_a_batch_is_a_table(sc):
    starts = Box([-3, -2], [3, 4])
    study = tadcore.Study(sc, {"attacker.position": starts}, trials=200, seed=1, passes=True)
    positions = np.repeat(sc.positions[None], 200, axis=0)
    drawn = study.inputs()
    positions[:, -1] = np.column_stack([drawn["attacker.position.x"], drawn["attacker.position.y"]])
    batch = tadcore.simulate_batch(sc, positions, passes=True)
    frame, other = batch.to_pandas(), study.run().to_pandas()
    pd.testing.assert_frame_equal(frame, other[list(frame.columns)], check_categorical=False)
    assert list(frame["outcome"].cat.categories) == list(other["outcome"].cat.categories)
    assert list(batch[:5].to_pandas()["outcome"]) == list(frame["outcome"][:5])


@pytest.mark.parametrize("name", ["paper-i1", "paper-i2"])
def test_who_sees_whom_is_what_the_distances_say(name):
    run = tadcore.simulate(name)
    sees = run.dataset["sees"]
    assert sees.dtype == bool
    radii = dict(zip(run.scenario.constrained, run.scenario.visibility_radii, strict=True))
    apart = np.linalg.norm(run.position[:-1, :, None] - run.position[:-1, None], axis=-1)
    for i, player in enumerate(run.scenario.players):
        within = apart[:, i] <= radii.get(player, np.inf)
        within[:, i] = False
        assert np.array_equal(sees.sel(player=player).values[:-1], within), player


def test_a_foreign_trajectory_is_drawn_by_the_same_figures(shown, agg):
    own = shown["run"]
    other = plotting.run_of(own.scenario, own.times, own.position)
    assert other.outcome == own.outcome
    assert np.array_equal(other.adjacency, own.adjacency)
    assert [change.time for change in other.network_changes] == [change.time for change in own.network_changes]
    same = (own.adjacency[1:] == own.adjacency[:-1]).all(axis=(1, 2))  # a control jumps where the network changes
    inner = np.flatnonzero(same[1:] & same[:-1]) + 1
    assert len(inner) > 50
    assert np.allclose(other.control[inner], own.control[inner], atol=0.1)
    for draw in (plotting.trajectories, plotting.distances, plotting.controls, plotting.visibility):
        assert draw(other).has_data()
    assert plotting.compare(own, other).has_data()
    assert plotting.Animation(other, seconds=0.1).figure().axes
    plt.close("all")
    for wrong in (
        {"times": own.times[:-1]},
        {"times": own.times[::-1]},
        {"position": own.position[:, :-1]},
        {"position": np.full_like(own.position, np.nan)},
        {"control": own.control[:-1]},
    ):
        given = {"times": own.times, "position": own.position} | wrong
        with pytest.raises(tadcore.ScenarioError, match=next(iter(wrong))):
            plotting.run_of(own.scenario, **given)


@pytest.mark.parametrize(
    ("last", "outcome"),
    [
        ({"d1": [0.09, 0], "d3": [0, 0.05]}, ("intercepted", 2)),  # the nearest, not the first
        ({"d1": [0.3, 0.4], "d2": [0.1, 0]}, ("intercepted", 1)),  # at exactly σ, and d1 out of its own radius
        ({"d2": [0, 0.06], "target": [0, 0.05]}, ("intercepted", 1)),  # before a capture
        ({"target": [0, 0.05]}, ("captured", None)),
        ({}, ("timeout", None)),
    ],
)
def test_a_foreign_trajectory_ends_by_the_rule_of_a_run(last, outcome):
    sc = tadcore.scenarios.load("paper-i1")
    at = sc.positions + 5.0
    at[-1] = 0.0
    for player, place in last.items():
        at[sc.players.index(player)] = place
    found = plotting.run_of(sc, [0.0, 1.0], np.array([at, at])).outcome
    own = {f"{player}.position": place for player, place in zip(sc.players, at.tolist(), strict=True)}
    assert (found.kind, found.defender) == outcome
    played = tadcore.simulate(sc.replace(own)).outcome
    assert outcome[0] == "timeout" or (played.kind, played.defender, played.time) == (*outcome, 0.0)


@pytest.mark.parametrize("model", [tadcore.Scenario, tadcore.Attacker, tadcore.Target, tadcore.Defender])
def test_help_says_what_every_field_is(model):
    for name, field in model.model_fields.items():
        assert f"{name} : " in model.__doc__
        assert field.description in model.__doc__
    signature = inspect.signature(model)
    assert list(signature.parameters) == list(model.model_fields)
    assert not any(word in str(signature) for word in ("Annotated", "BeforeValidator", "PydanticUndefined"))
    assert {"json", "dict", "parse_obj", "copy"}.isdisjoint(dir(model))
    assert {"replace", "model_dump"} <= set(dir(model))


def test_completion_of_a_scenario_has_no_deprecated_methods(sc):
    assert {"json", "dict", "parse_obj", "copy"}.isdisjoint(dir(sc))
    assert {"replace", "to_toml", "attacker"} <= set(dir(sc))


def test_two_points_in_a_tuple_are_refused_and_in_a_list_a_choice(sc):
    with pytest.raises(tadcore.ScenarioError, match="a Box for all that lies between the two, or a list"):
        tadcore.Study(sc, {"attacker.position": ([-3, -2], [3, 4])}, trials=4)
    study = tadcore.Study(sc, {"attacker.position": [[-3, -2], [3, 4]]}, trials=4)
    assert "attacker.position (Choice)" in repr(study)


def test_a_sweep_is_selected_by_keywords(study):
    made = tadcore.sweep(study, {"d1.visibility_radius": [1.0, 2.0], "attacker.control_weight": [0.8, 1.0]}).to_xarray()
    by_name = made.sel({"d1.visibility_radius": 2.0, "attacker.control_weight": 0.8})
    by_keyword = made.sel(d1_visibility_radius=2.0, attacker_control_weight=0.8)
    assert np.array_equal(by_name["count"], by_keyword["count"])
    assert made.sizes == {"defenders.0.visibility_radius": 2, "attacker.control_weight": 2, "outcome": 3}
