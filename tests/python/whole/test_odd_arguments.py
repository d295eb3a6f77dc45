"""Arguments of every kind that is none: taken for what they are, or refused by name, and never a raw error."""

import concurrent.futures
import re

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
import xarray as xr
from scipy import stats

import tadcore
from tadcore import Scenario, ScenarioError, Study, plotting, sampling

SC = tadcore.scenarios.load("paper-i1").replace({"horizon": 0.5, "step": 0.05})
STARTS = np.stack([SC.positions, SC.positions + 0.25, SC.positions - 0.25])
EXPECTED = tadcore.simulate_batch(SC, STARTS)


class Broken:
    """Says that it is an array, and is none; does not even tell what it is."""

    def __array__(self, *_, **__):
        raise RuntimeError("no")

    def __repr__(self):
        raise RuntimeError("no")


def misaligned(array):
    buffer = np.zeros(array.nbytes + 1, dtype=np.uint8)
    view = buffer[1:].view(array.dtype).reshape(array.shape)
    view[...] = array
    assert not view.flags.aligned
    return view


def frozen(array):
    array = array.copy()
    array.flags.writeable = False
    return array


SAME = {
    "lists": STARTS.tolist(),
    "tuples": tuple(map(tuple, (map(tuple, game) for game in STARTS.tolist()))),
    "a list of arrays": list(STARTS),
    "big-endian": STARTS.astype(">f8"),
    "in Fortran's order": np.asfortranarray(STARTS),
    "every second": np.repeat(STARTS, 2, axis=0)[::2],
    "backwards": STARTS[::-1, ::-1, ::-1].copy()[::-1, ::-1, ::-1],
    "read-only": frozen(STARTS),
    "misaligned": misaligned(STARTS),
    "misaligned, big-endian": misaligned(STARTS.astype(">f8")),
    "long doubles": STARTS.astype(np.longdouble),
    "xarray": xr.DataArray(STARTS),
    "pandas": [pd.DataFrame(game) for game in STARTS],
    "nothing masked": np.ma.masked_array(STARTS, mask=False),
    "nothing masked, in a list": [np.ma.masked_array(game) for game in STARTS],
    "matrices": [np.asmatrix(game) for game in STARTS],
    "a memory view": memoryview(STARTS),
}


@pytest.mark.parametrize("given", SAME.values(), ids=SAME.keys())
def test_an_array_is_what_it_holds(given):
    found = tadcore.simulate_batch(SC, given, visibility_radii=np.asarray(SC.visibility_radii, dtype=">f4"))
    np.testing.assert_array_equal(found.time, EXPECTED.time)
    np.testing.assert_array_equal(found.defender, EXPECTED.defender)


HOLED = np.ma.masked_array(STARTS, mask=False)
HOLED[1, 2, 0] = np.ma.masked
NONE = {
    "None": None,
    "a number": 5.0,
    "a string": "positions",
    "bytes": b"positions",
    "a generator": (game for game in STARTS),
    "a set": {1.0, 2.0},
    "a dict": {"d1": [0.0, 0.0]},
    "ragged": [[[0.0, 0.0]], [[0.0]]],
    "objects": STARTS.astype(object),
    "complex": STARTS.astype(complex),
    "booleans": STARTS > 0,
    "strings": STARTS.astype(str),
    "dates": STARTS.astype("M8[s]"),
    "fields": np.zeros(3, dtype=[("x", float)]),
    "0-d": np.array(1.0),
    "masked": HOLED,
    "masked in a list": list(HOLED),
    "masked in lists": [list(game) for game in HOLED],
    "masked in tuples": [tuple(game) for game in HOLED],
    "NaN in pandas": [pd.DataFrame(STARTS[0]).mask(pd.DataFrame(STARTS[0]) > 1.5)],
    "NA in pandas": [pd.DataFrame(STARTS[0]).astype("Float64").mask(pd.DataFrame(STARTS[0]) > 1.5)],
    "a scenario": SC,
    "a function": lambda: STARTS,
    "a class": np.ndarray,
    "broken": Broken(),
    "one game": STARTS[0],
    "a player too many": np.zeros((1, 6, 2)),
}


@pytest.mark.parametrize("given", NONE.values(), ids=NONE.keys())
def test_what_is_no_array_is_refused_by_name(given):
    with pytest.raises(ScenarioError, match=r"^positions"):
        tadcore.simulate_batch(SC, given)
    for name in ("visibility_radii", "capture_radii"):
        if given is not None:
            with pytest.raises(ScenarioError, match=rf"^{name}"):
                tadcore.simulate_batch(SC, STARTS, **{name: given})
    with pytest.raises(ScenarioError, match=r"^adjacency"):
        tadcore.VisibilityNetwork(given)
    with pytest.raises(ScenarioError, match=r"^adjacency"):
        tadcore.synthesize(SC, step=0, adjacency=given)
    if given is not None and given is not NONE["one game"]:
        with pytest.raises(ScenarioError, match=r"^positions"):
            tadcore.VisibilityNetwork.from_positions(SC, given)
    if not isinstance(given, str | bytes):
        with pytest.raises(ScenarioError):
            Scenario.model_validate({**SC.model_dump(), "synthesis_weights": given})


@pytest.mark.parametrize("mask", [[[0, 1, 0, 0], [0] * 4, [0] * 4], True])
def test_a_masked_network_is_refused(mask):
    seen = np.ma.masked_array(np.ones((3, 4)), mask=np.broadcast_to(mask, (3, 4)))
    for given in (seen, list(seen)):
        with pytest.raises(ScenarioError, match="adjacency: got 'an array with masked entries'"):
            tadcore.VisibilityNetwork(given)


NOT_A_SCENARIO = [None, 5, "no such file", b"x", [], {}, np.zeros(3), SC.model_dump(), SC.attacker, Scenario, Broken()]


@pytest.mark.parametrize("given", NOT_A_SCENARIO, ids=lambda given: type(given).__name__)
def test_what_is_no_scenario_is_refused_by_name(given):
    everyone = [[1] * 4] * 3
    uses = [
        tadcore.simulate,
        tadcore.solve_equilibrium,
        tadcore.verify,
        tadcore.outcome_map,
        tadcore.VisibilityNetwork.from_positions,
        lambda sc: tadcore.simulate_batch(sc, STARTS),
        lambda sc: tadcore.synthesize(sc, step=0, adjacency=everyone),
        lambda sc: Study(sc, vary={"attacker.position": sampling.Box(-1, 1)}, trials=1),
        lambda sc: tadcore.radius_curve(sc, STARTS, radii=[1.0]),
        lambda sc: tadcore.analysis.sensitivity(sc, {"d1.visibility_radius": stats.uniform(1, 2)}),
        lambda sc: tadcore.verification.step_study(sc),
        lambda sc: tadcore.verification.play_by_events(sc),
    ]
    for use in uses:
        with pytest.raises(ScenarioError):
            use(given)


ODD = [
    None,
    5,
    1.5,
    True,
    b"d1",
    [],
    ["d1"],
    np.array([]),
    np.array(["d1", "d2"]),
    {},
    Broken(),
    "\ud800",
    "",
    "d0",
    object,
]


@pytest.mark.parametrize("given", ODD, ids=lambda given: type(given).__name__)
def test_what_is_no_name_is_refused_by_name(given):
    run, eq = tadcore.simulate(SC), tadcore.solve_equilibrium(SC)
    for use in (
        lambda: tadcore.outcome_map(SC, given, x=(0, 1, 2), y=(0, 1, 2)),
        lambda: tadcore.scenarios.load(given),
        lambda: tadcore.scenarios.text(given),
        lambda: tadcore.scenarios.find(given),
        lambda: eq.full(given, 0),
        lambda: tadcore.synthesize(SC, step=0, adjacency=[[1] * 4] * 3, method=given),
        lambda: Study(SC, vary={"attacker.position": sampling.Box(-1, 1)}, trials=1, design=given),
        lambda: tadcore.radius_curve(SC, STARTS, player=[given], radii=[1.0]),
        lambda: tadcore.radius_curve(SC, STARTS, kind=given, radii=[1.0]),
        lambda: run.plot.controls(axis=given) if given is not None else tadcore.scenarios.load(given),
    ):
        with pytest.raises((ScenarioError, ValueError)) as caught:
            use()
        assert "ambiguous" not in str(caught.value)


PATHS = [5, 1.5, True, b"x", "", "a\0b", "\ud800", ["x"], object(), Broken()]


@pytest.mark.parametrize("given", PATHS, ids=lambda given: type(given).__name__)
def test_what_is_no_path_is_refused_by_name(tmp_path, given):
    run = tadcore.simulate(SC)
    study = Study(SC, vary={"attacker.position": sampling.Box(-1, 1)}, trials=2)
    result = study.run()
    for use in (
        SC.to_toml,
        run.save,
        run.animate(seconds=0.1, fps=5).save,
        tadcore.outcome_map(SC, x=(0, 1, 2), y=(0, 1, 2)).save,
        lambda path: tadcore.report.report(result, path),
        lambda path: tadcore.reproduce.reproduce(path),
        lambda path: study.run(store=path),
        lambda path: study.run(table=path),
        tadcore.load_study,
        Scenario.from_toml,
        Study.from_toml,
        lambda path: tadcore.scenarios.find("x.toml", path),
        lambda path: Study.from_toml_string("", folder=path),
    ):
        with pytest.raises(ScenarioError):
            use(given)


def test_draws_of_a_callable_that_reuses_its_memory_are_kept_apart():
    """It fills the same array at every call, and hands it out."""

    class Reusing:
        def __init__(self, components):
            self.memory = np.empty((8192, components))

        def __call__(self, rng, size):
            memory = self.memory[:size]
            memory[...] = rng.uniform(1.0, 3.0, memory.shape)
            return memory

    for components, paths in ((1, ["d1", "d2"]), (2, ["d1", "d2"])):
        field = "visibility_radius" if components == 1 else "position"
        fresh = lambda rng, size, c=components: rng.uniform(1.0, 3.0, (size, c))  # noqa: E731
        reusing = Reusing(components)
        wanted = Study(SC, vary={f"{p}.{field}": fresh for p in paths}, trials=50).run()
        found = Study(SC, vary={f"{p}.{field}": reusing for p in paths}, trials=50).run()
        assert len(found.inputs) == 2 * components
        for name, values in wanted.inputs.items():
            np.testing.assert_array_equal(found.inputs[name], values)
        first, second = (values for name, values in found.inputs.items() if name.endswith(("radius", ".x")))
        assert not np.array_equal(first, second)


RETURNS = {
    "ragged": lambda rng, size: [[0.0, 0.0]] * (size - 1) + [[0.0]],
    "nothing": lambda rng, size: None,
    "a string": lambda rng, size: "x",
    "too few": lambda rng, size: np.zeros((size - 1, 2)),
    "turned": lambda rng, size: np.zeros((2, size)),
    "complex": lambda rng, size: np.zeros((size, 2), dtype=complex),
    "objects": lambda rng, size: np.zeros((size, 2), dtype=object),
    "masked": lambda rng, size: np.ma.masked_array(np.zeros((size, 2)), mask=True),
    "masked in a list": lambda rng, size: [np.ma.masked_array([0.0, 0.0], mask=[0, 1])] * size,
    "broken": lambda rng, size: Broken(),
    "a generator": lambda rng, size: (row for row in np.zeros((size, 2))),
}


@pytest.mark.parametrize("function", RETURNS.values(), ids=RETURNS.keys())
def test_what_a_callable_must_not_return_is_named(function, tmp_path):
    for options in ({}, {"store": tmp_path / "store"}):
        with pytest.raises(ScenarioError, match=r"^what .* returns: got .*, must be an array of numbers"):
            Study(SC, vary={"attacker.position": function}, trials=5).run(**options)
    assert not list(tmp_path.glob("store/part*"))


TABLES = [pd.Series([1.0, 2.0]), pd.DataFrame([[1.0]]), pd.DataFrame({"pdf": [1.0]}), xr.DataArray([[1.0, 2.0]])]


@pytest.mark.parametrize(
    "given", [lambda: 1, lambda rng: 1, int, float, dict, sampling.Box, object(), "normal", 5, None, *TABLES]
)
def test_what_is_no_sampler_is_refused(given):
    with pytest.raises(ScenarioError, match=r"^vary\["):
        Study(SC, vary={"attacker.position": given}, trials=5)


class Own:
    """A distribution that writes every draw where the one before was."""

    def support(self):
        return 1.0, 2.0

    def __init__(self, change=lambda values: values):
        self.change, self.buffer = change, np.empty((8192, 1))

    def ppf(self, points):
        buffer = self.buffer[: len(points)]
        buffer[...] = 1.0 + points
        return self.change(buffer)


def test_quantiles_of_a_distribution_that_reuses_its_memory_are_kept_apart():
    own = Own()
    drawn = Study(SC, vary={"d1.visibility_radius": own, "d2.visibility_radius": own}, trials=50).inputs()
    apart = Study(SC, vary={"d1.visibility_radius": Own(), "d2.visibility_radius": Own()}, trials=50).inputs()
    for name, values in apart.items():
        np.testing.assert_array_equal(drawn[name], values)
    first, second = drawn.values()
    assert not np.any(first == second)


@pytest.mark.parametrize(
    "change",
    [
        lambda values: np.ma.masked_less(values, 1.5),
        lambda values: values.astype(str),
        lambda values: values > 1.5,
        lambda values: [[1.0], [2.0, 3.0]],
        lambda values: np.ones(3),
        lambda values: None,
    ],
)
def test_quantiles_that_are_no_numbers_are_refused_by_name(change):
    with pytest.raises(ScenarioError, match=r"^what .*Own returns: got .*, must be an array of numbers"):
        Study(SC, vary={"d1.visibility_radius": Own(change)}, trials=5).run()


@pytest.mark.parametrize("support", [None, 5.0, (), (1.0,), ("a", "b"), ([1.0], [2.0, 3.0], 4.0)])
def test_a_support_that_is_none_is_refused_by_name(support):
    own = Own()
    own.support = lambda: support
    with pytest.raises(ScenarioError, match=r"^vary\[.*support\(\) is two numbers"):
        Study(SC, vary={"d1.visibility_radius": own}, trials=5)


def test_a_density_estimate_is_a_sampler():
    rng = np.random.default_rng(1)
    seen = rng.normal([-1.0, 1.0], [0.2, 0.4], (400, 2))
    study = Study(SC, vary={"attacker.position": stats.gaussian_kde(seen.T)}, trials=20_000, seed=3)
    drawn = np.stack(list(study.inputs().values()))
    np.testing.assert_allclose(drawn.mean(axis=1), seen.mean(axis=0), atol=0.02)
    covariance = np.cov(seen.T) + stats.gaussian_kde(seen.T).covariance  # of an estimate: what was seen, and its kernel
    np.testing.assert_allclose(np.cov(drawn), covariance, atol=0.01)
    with pytest.raises(ScenarioError, match=r"returns: got .*, must be an array of numbers of shape \(8192, 2\)"):
        Study(SC, vary={"attacker.position": stats.gaussian_kde(seen[:, 0])}, trials=5).run()
    with pytest.raises(ScenarioError, match='this one needs design="random"'):
        Study(SC, vary={"attacker.position": stats.gaussian_kde(seen.T)}, trials=5, design="sobol")


@pytest.mark.parametrize("kind", [concurrent.futures.ThreadPoolExecutor, concurrent.futures.ProcessPoolExecutor])
def test_an_executor_that_was_shut_down_is_named(kind):
    executor = kind(1)
    executor.shutdown()
    study = Study(SC, vary={"attacker.position": sampling.Box(-1, 1)}, trials=5)
    with pytest.raises(ScenarioError, match=r"^executor: got .*, must be open: this one has been shut down"):
        study.run(executor=executor)


@pytest.mark.parametrize("given", [*NOT_A_SCENARIO, SC, EXPECTED], ids=lambda given: type(given).__name__)
def test_what_is_no_result_is_refused_by_name(given, tmp_path):
    from tadcore import plotting

    for name in ("trajectories", "network", "visibility", "controls", "distances", "gains", "theta", "externality"):
        with pytest.raises(ScenarioError, match=r"^run: got .*, must be a Run"):
            getattr(plotting, name)(given)
    with pytest.raises(ScenarioError, match=r"^run_b: got .*, must be a Run"):
        plotting.compare(tadcore.simulate(SC), given)
    with pytest.raises(ScenarioError, match=r"^result: got .*, must be a StudyResult"):
        tadcore.report.report(given, tmp_path / "page.html")
    with pytest.raises(ScenarioError, match=r"^study: got .*, must be a tadcore.Study"):
        tadcore.sweep(given, {"horizon": [1.0]})
    assert plt.get_fignums() == []


@pytest.mark.parametrize("given", [None, 0, -1, 1.5, "2", 10**9, True, np.array([2])], ids=repr)
def test_odd_panels_are_refused_by_name(given):
    run = tadcore.simulate(SC)
    for draw, name in ((run.plot.gains, "columns"), (run.plot.network, "columns"), (run.plot.network, "max_panels")):
        with pytest.raises(ScenarioError, match=rf"^{name}: got .*, must be a whole number in \[1, 1000\]"):
            draw(**{name: given})
    assert plt.get_fignums() == []


NEARLY_ONE = np.longdouble(1) - np.finfo(np.longdouble).epsneg


@pytest.mark.parametrize(
    "given",
    [None, 10**400, -(10**400), "x", float("nan"), True, 1.0, 0, NEARLY_ONE],
)
def test_odd_levels_and_widths_are_refused_by_name(given):
    with pytest.raises(ScenarioError, match=r"^level: got"):
        tadcore.HalfWidth(0.1, level=given)
    with pytest.raises(ScenarioError, match=r"^width: got"):
        tadcore.HalfWidth(given)


def test_odd_axes_are_refused_by_name(agg):
    run = tadcore.simulate(SC)
    found = tadcore.outcome_map(SC, x=(0, 1, 2), y=(0, 1, 2))
    for given in (5, "ax", [], np.array([plt.gca(), plt.gca()]), plt.gcf(), plt):
        for draw in (
            run.plot.trajectories,
            run.plot.distances,
            run.plot.theta,
            run.plot.visibility,
            found.plot,
            lambda ax: plotting.compare(run, run, ax=ax),
        ):
            with pytest.raises(ScenarioError, match=r"ax: got .* must be axes of Matplotlib"):
                draw(ax=given)
    for draw in (run.plot.network, run.plot.gains):
        with pytest.raises(ScenarioError, match="axes: got"):
            draw([plt.gca(), "ax"])
    plt.close("all")


def test_flags_are_true_or_false(agg):
    run = tadcore.simulate(SC)
    study = Study(SC, {"attacker.position": sampling.Box(-1, 1)}, trials=2)
    for given in (np.array([True, False]), "yes", 1, None, []):
        for use, name in (
            (lambda x: run.plot.trajectories(zoom=x), "zoom"),
            (lambda x: run.plot.gains(changes=x), "changes"),
            (lambda x: tadcore.outcome_map(SC, x=(0, 1, 2), y=(0, 1, 2), progress=x), "progress"),
            (lambda x: tadcore.radius_curve(study, player="d1", radii=[2.0], refine=x), "refine"),
        ):
            with pytest.raises(ScenarioError, match=rf"{name}: got .*, must be True or False"):
                use(given)
    assert run.plot.trajectories(zoom=np.False_).has_data()
    plt.close("all")


def test_an_option_that_does_not_exist_is_answered_with_the_nearest():
    run = tadcore.simulate(SC)
    study = Study(SC, {"attacker.position": sampling.Box(-1, 1)}, trials=2)
    play = tadcore.simulate
    for use, said in (
        (lambda: play(SC, terminaton="x"), "simulate() has no option 'terminaton'; did you mean termination?"),
        (lambda: run.plot.controls(axes="y"), "controls() has no option 'axes'; did you mean axis?"),
        (lambda: Study(SC, {}, trails=5), "Study() has no option 'trails'; did you mean trials?"),
        (lambda: study.run(thread=1), "Study.run() has no option 'thread'; did you mean threads?"),
        (lambda: tadcore.verify(run, deviation=1), "did you mean deviations?"),
        (lambda: play(SC, colour=1), "simulate() has no option 'colour'; it takes sc, hysteresis, dwell, termination"),
    ):
        with pytest.raises(TypeError, match=re.escape(said)):
            use()


def test_a_path_and_a_name_are_scenarios(tmp_path, monkeypatch):
    (tmp_path / "mine.toml").write_text(SC.to_toml(), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    known = tadcore.scenarios.load("paper-i1")
    vary = {"attacker.position": sampling.Box(-1, 1)}
    for given, meant in (("paper-i1", known), ("mine.toml", SC), (tmp_path / "mine.toml", SC)):
        assert tadcore.simulate(given).scenario == meant
        assert tadcore.solve_equilibrium(given).times[-1] == meant.horizon
        assert len(tadcore.simulate_batch(given, [meant.positions])) == 1
        assert Study(given, vary, trials=1).scenario == meant
        assert tadcore.outcome_map(given, x=(0, 1, 2), y=(0, 1, 2)).scenario == meant
        assert tadcore.radius_curve(given, [meant.positions], radii=[3.0]).trials == 1
        assert tadcore.verification.step_study(given, halvings=0).steps[0] == meant.step
        assert tadcore.synthesize(given, step=0, adjacency=tadcore.VisibilityNetwork.from_positions(given)).players
    with pytest.raises(ScenarioError, match="did you mean paper-i"):
        tadcore.simulate("paper-i")
    with pytest.raises(ScenarioError, match="from_toml_string reads a text"):
        tadcore.simulate(SC.to_toml())
    with pytest.raises(ScenarioError, match="a file that exists"):
        tadcore.simulate(tmp_path / "none.toml")
    for given in ("x" * 5000, "a\0b", "."):
        with pytest.raises(ScenarioError):
            tadcore.simulate(given)
