"""Samplers: each against the distribution it stands for, bad parameters refused."""

import math
import pickle

import numpy as np
import pytest
from scipy import stats
from scipy.stats import qmc

from study_cases import calm, ring
from tadcore import ScenarioError, Study, scenarios
from tadcore.sampling import Annulus, Block, Box, Choice, Cycle, Disk, Gaussian, Sampler

MANY = 8192


def draw(sampler, components, seed=0):
    rng = np.random.default_rng(seed)
    points = qmc.Sobol(max(sampler.coordinates(components), 1), rng=rng).random(MANY)
    return sampler.draw(Block(np.clip(points, 1e-12, 1 - 1e-12), rng, 0), components)


def fits(values, cdf):
    """A low-discrepancy sample lies much nearer to its distribution than chance: 1% for 8,192 points."""
    return stats.kstest(values, cdf).statistic < 0.01


def test_a_box_is_uniform_between_its_corners():
    values = draw(Box([-3, 1], [3, 2]), 2)
    assert values.shape == (MANY, 2)
    assert fits(values[:, 0], stats.uniform(-3, 6).cdf)
    assert fits(values[:, 1], stats.uniform(1, 1).cdf)
    assert fits(draw(Box(0.5, 4), 1)[:, 0], stats.uniform(0.5, 3.5).cdf)
    assert (draw(Box([1, 2], [1, 2]), 2) == [1, 2]).all()


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("inner", [0.0, 1.2])
def test_round_samplers_fill_area_and_volume_evenly(dim, inner):
    center, outer = np.arange(1.0, dim + 1), 2.0
    sampler = Annulus(center, inner, outer) if inner else Disk(center, outer)
    offset = draw(sampler, dim) - center
    radius = np.linalg.norm(offset, axis=1)
    assert inner <= radius.min()
    assert radius.max() <= outer * (1 + 1e-15)
    assert fits(radius, lambda r: (r**dim - inner**dim) / (outer**dim - inner**dim))
    angle = np.arctan2(offset[:, 1], offset[:, 0])
    assert fits(angle, stats.uniform(-math.pi, 2 * math.pi).cdf)
    if dim == 3:  # Archimedes: the height of a point of a sphere is uniform
        assert fits(offset[:, 2] / radius, stats.uniform(-1, 2).cdf)
        assert abs(np.corrcoef(angle, offset[:, 2])[0, 1]) < 0.01


def test_a_gaussian_has_its_mean_and_covariance():
    cov = np.array([[2.0, 0.6], [0.6, 0.5]])
    values = draw(Gaussian([1, -1], cov=cov), 2)
    assert values.mean(axis=0) == pytest.approx([1, -1], abs=0.01)
    assert np.cov(values.T) == pytest.approx(cov, abs=0.02)
    white = np.linalg.solve(np.linalg.cholesky(cov), (values - [1, -1]).T)
    assert all(fits(row, stats.norm.cdf) for row in white)
    apart = draw(Gaussian([1, -1], [0.5, 2.0]), 2)
    assert fits(apart[:, 0], stats.norm(1, 0.5).cdf)
    assert fits(apart[:, 1], stats.norm(-1, 2).cdf)
    assert fits(draw(Gaussian(3.0, 0.1), 1)[:, 0], stats.norm(3, 0.1).cdf)


def test_a_choice_takes_each_as_often_and_a_cycle_in_order():
    places = [[0, 0], [1, 2], [3, 4]]
    values = draw(Choice(places), 2)
    found, counts = np.unique(values, axis=0, return_counts=True)
    assert found.tolist() == places
    assert counts / MANY == pytest.approx([1 / 3] * 3, abs=1e-3)
    assert set(draw(Choice([1.0, math.inf]), 1)[:, 0]) == {1.0, math.inf}
    block = Block(np.empty((5, 0)), np.random.default_rng(0), 8192)
    assert Cycle(places).draw(block, 2).tolist() == [places[i % 3] for i in range(8192, 8197)]


def study_of(value, path="attacker.position", **options):
    return Study(calm(), {path: value}, **{"trials": MANY, "seed": 3, **options})


@pytest.mark.parametrize("design", ["random", "sobol", "latin"])
@pytest.mark.parametrize(
    ("frozen", "cdfs"),
    [
        (stats.norm(1, 0.5), [stats.norm(1, 0.5).cdf] * 2),
        (stats.norm(loc=[0, 1], scale=[1, 2]), [stats.norm(0, 1).cdf, stats.norm(1, 2).cdf]),
        (stats.Normal(mu=1.0, sigma=0.5), [stats.norm(1, 0.5).cdf] * 2),
        (stats.triang(0.3, -1, 2), [stats.triang(0.3, -1, 2).cdf] * 2),
    ],
)
def test_frozen_distributions_of_scipy_are_drawn_for_each_coordinate(design, frozen, cdfs):
    inputs = study_of(frozen, design=design).inputs()
    for values, cdf in zip(inputs.values(), cdfs, strict=True):
        assert stats.kstest(values, cdf).pvalue > 1e-3
    assert abs(np.corrcoef(*inputs.values())[0, 1]) < 0.05


def test_multivariate_distributions_of_scipy():
    cov = [[1.0, 0.7], [0.7, 1.0]]
    inputs = study_of(stats.multivariate_normal([0, 1], cov), design="sobol").inputs()
    assert np.cov(np.stack(list(inputs.values()))) == pytest.approx(np.array(cov), abs=0.03)
    other = study_of(stats.multivariate_t([0, 1], cov, df=5))
    x, y = other.inputs().values()
    assert stats.kstest(x, stats.t(5).cdf).pvalue > 1e-3
    assert stats.kstest(y - 1, stats.t(5).cdf).pvalue > 1e-3
    with pytest.raises(ScenarioError, match='needs design="random"'):
        study_of(stats.multivariate_t([0, 1], cov, df=5), design="sobol")


def test_a_callable_gets_the_stream_of_its_chunk_and_quantity():
    sc = calm()
    drawn = Study(sc, {"attacker.position": ring, "target.position": ring}, trials=9000, seed=5).inputs()
    for column, player in (("attacker", 0), ("target", 1)):
        wanted = []
        for chunk in range(2):
            counter = np.array([0, 0, 0, 8 * player], dtype=np.uint64)
            key = np.array([5, chunk], dtype=np.uint64)
            wanted.append(ring(np.random.Generator(np.random.Philox(key=key, counter=counter)), 8192))
        wanted = np.concatenate(wanted)[:9000]
        assert np.array_equal(drawn[f"{column}.position.x"], wanted[:, 0])
        assert np.array_equal(drawn[f"{column}.position.y"], wanted[:, 1])
    with pytest.raises(ScenarioError, match='needs design="random"'):
        study_of(ring, design="latin")


@pytest.mark.parametrize(
    ("make", "field", "rule"),
    [
        (lambda: Box([0, 0], [1, -1]), "Box.high", "nowhere below"),
        (lambda: Box([0, 0], [1, 1, 1]), "Box.high", "2 numbers"),
        (lambda: Box(math.nan, 1), "Box.low", "a finite number"),
        (lambda: Box("0", 1), "Box.low", "a finite number"),
        (lambda: Box(-1e308, 1e308), "Box.high", "finite"),
        (lambda: Disk([0, 0], 0), "Disk.radius", "positive"),
        (lambda: Disk([0, 0], [1, 1]), "Disk.radius", "positive"),
        (lambda: Disk([0, 0, 0, 0], 1), "Disk.center", "2 or 3"),
        (lambda: Annulus([0, 0], 2, 1), "Annulus.inner", "in [0, 1.0]"),
        (lambda: Annulus([0, 0], -1, 1), "Annulus.inner", "in [0, 1.0]"),
        (lambda: Gaussian(0), "Gaussian", "either std or cov"),
        (lambda: Gaussian(0, 1, [[1]]), "Gaussian", "either std or cov"),
        (lambda: Gaussian(0, 0), "Gaussian.std", "positive"),
        (lambda: Gaussian([0, 0], cov=[[1, 2], [2, 1]]), "Gaussian.cov", "positive definite"),
        (lambda: Gaussian([0, 0], cov=[[1, 0.5], [0, 1]]), "Gaussian.cov", "symmetric"),
        (lambda: Gaussian([0, 0], cov=[[1, math.nan], [math.nan, 1]]), "Gaussian.cov", "symmetric"),
        (lambda: Choice([]), "Choice.values", "at least one"),
        (lambda: Choice(["a"]), "Choice.values", "a list of numbers"),
        (lambda: Choice([[0, 0], [1]]), "Choice.values", "a list of numbers"),
        (lambda: Cycle([1.0, math.nan]), "Cycle.values", "a list of numbers"),
    ],
)
def test_bad_parameters_are_refused_by_name(make, field, rule):
    with pytest.raises(ScenarioError) as caught:
        make()
    assert caught.value.field == field
    assert rule in caught.value.rule


@pytest.mark.parametrize(
    ("path", "value", "words"),
    [
        ("attacker.position", Box([0, 0, 0], [1, 1, 1]), "Box.low: got .* must be 2 numbers"),
        ("attacker.position", Disk([0, 0, 0], 1), "Disk.center: got .* must be 2 numbers"),
        ("attacker.position", Gaussian([0, 0, 0], 1), "Gaussian.mean: got .* must be 2 numbers"),
        ("attacker.position", Gaussian(0, cov=[[1]]), "Gaussian.cov: got .* must be of shape"),
        ("attacker.position", Choice([1.0, 2.0]), "a list of positions of 2 numbers"),
        ("attacker.position", [1.0, 2.0], "a list of positions of 2 numbers"),
        ("attacker.position", [], "at least one"),
        ("attacker.position", 1.0, "a fixed value belongs in the scenario"),
        ("attacker.position", "box", "must be a sampler"),
        ("attacker.position", None, "must be a sampler"),
        ("attacker.position", Box, r"its parameters: Box\(…\)"),
        ("attacker.position", stats.norm, r"frozen: norm\(…\)"),
        ("attacker.position", stats.norm([0, 1, 2], 1), "parameters are numbers, or lists of 2"),
        ("attacker.position", lambda rng, size: np.zeros(size), r"of shape \(8192, 2\)"),
        ("attacker.position", lambda rng, size: "no", r"of shape \(8192, 2\)"),
        ("attacker.capture_radius", Disk([0, 0], 1), "this quantity is a radius"),
        ("attacker.capture_radius", Box([1, 1], [2, 2]), "must be a number"),
        ("attacker.capture_radius", [[1, 2]], "a list of numbers"),
    ],
)
def test_samplers_that_do_not_fit_are_refused(path, value, words):
    with pytest.raises(ScenarioError, match=words):
        study_of(value, path).run()


def test_samplers_are_values():
    assert Box([-1, -1], 2) == Box((-1.0, -1.0), 2.0)
    assert len({Box(0, 1), Box(0.0, 1.0), Disk([0, 0], 1)}) == 2
    for sampler in (Box(0, 1), Gaussian([0, 0], cov=np.eye(2)), Cycle([[0, 1]])):
        assert isinstance(sampler, Sampler)
        assert pickle.loads(pickle.dumps(sampler)) == sampler
    with pytest.raises(AttributeError):
        Box(0, 1).low = 3


def test_space_has_three_coordinates():
    lifted = {"attacker.position": (-2, 2, 1), "target.position": (0, 1, 0)}
    lifted |= {f"defenders[{i}].position": (i, 0, 0) for i in range(3)}
    sc = scenarios.load("paper-i1").replace({"horizon": 1.0, "step": 0.05, **lifted})
    result = Study(sc, {"defenders.*.position": Disk([0, 0, 0], 1), "target.position.z": Box(0, 1)}, trials=50).run()
    assert [name for name in result.inputs if "target" in name] == ["target.position.z"]
    for i in range(3):
        at = np.stack([result.inputs[f"defenders.{i}.position.{axis}"] for axis in "xyz"])
        assert (np.linalg.norm(at, axis=0) <= 1).all()
    assert result.setup(3).target.position[:2] == (0, 1)
