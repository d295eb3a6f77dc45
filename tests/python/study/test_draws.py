"""How a study draws: by hand from its streams, the same for any length, threads and other paths."""

import numpy as np
import pytest
from scipy.stats import qmc

import tadcore
from study_cases import CHUNK, calm, philox, study
from tadcore import Study
from tadcore.sampling import Box, Disk


def test_a_study_is_a_batch_of_draws_by_hand():
    sc, trials = calm(), CHUNK + 1000
    vary = {
        "defenders.*.position": Box([-2, -2], [2, 2]),
        "attacker.position": Box([-3, -3], [3, 3]),
        "defenders[1].visibility_radius": Box(0.5, 4.0),
        "attacker.capture_radius": Box(0.05, 0.4),
        "target.position.y": Box(0, 2),
    }
    result = Study(sc, vary, trials=trials, seed=11).run()
    positions = np.repeat(sc.positions[None], 2 * CHUNK, axis=0)
    sight = np.repeat(sc.visibility_radii[None], 2 * CHUNK, axis=0)
    capture = np.repeat(sc.capture_radii[None], 2 * CHUNK, axis=0)
    for chunk in range(2):
        rows = slice(chunk * CHUNK, (chunk + 1) * CHUNK)
        positions[rows, 4] = -3 + 6 * philox(11, chunk, 0, 2)
        capture[rows, 3] = (0.05 + (0.4 - 0.05) * philox(11, chunk, 2, 1))[:, 0]
        positions[rows, 3, 1] = 2 * philox(11, chunk, 8 + 4, 1)[:, 0]
        for i in range(3):
            positions[rows, i] = -2 + 4 * philox(11, chunk, 8 * (2 + i), 2)
        sight[rows, 1] = (0.5 + 3.5 * philox(11, chunk, 8 * 3 + 1, 1))[:, 0]
    batch = tadcore.simulate_batch(sc, positions[:trials], sight[:trials], capture[:trials])
    assert np.array_equal(result.kind, batch.kind)
    assert np.array_equal(result.defender, batch.defender)
    assert np.array_equal(result.time, batch.time)
    assert result.counts() == batch.counts()
    assert np.array_equal(result.inputs["defenders.2.position.y"], positions[:trials, 2, 1])
    assert np.array_equal(result.inputs["attacker.capture_radius"], capture[:trials, 3])
    assert min(result.counts().values()) > 100  # all outcomes occur, so the comparison says something


def test_adjacent_seeds_and_chunks_share_nothing():
    rows = []
    for seed in (7, 8):
        rows += [half for values in study(2 * CHUNK, seed).inputs().values() for half in np.split(values, 2)]
    assert len(np.unique(rows)) == np.size(rows)
    assert np.abs(np.corrcoef(rows) - np.eye(12)).max() < 0.05  # 5 standard deviations


def test_what_one_path_draws_does_not_depend_on_the_others():
    alone = study(100, vary={"attacker.position": Disk([0, 1], 2.0)}).inputs()
    more = study(100, vary={"*.capture_radius": Box(0.1, 0.2), "attacker.position": Disk([0, 1], 2.0)}).inputs()
    assert np.array_equal(alone["attacker.position.x"], more["attacker.position.x"])


@pytest.mark.parametrize("design", ["random", "sobol", "latin"])
def test_prefixes_agree_and_threads_change_nothing(design):
    long = study(design=design).run(threads=1)
    short = study(9000, design=design).run(threads=2)
    assert long.table.slice(0, 9000).equals(short.table)
    assert study(design=design).run(threads=2).table.equals(long.table)
    assert not study(design=design, seed=8).run().table.equals(long.table)
    assert len(long) == long.trials == 2 * CHUNK + 500
    assert long.table["trial"].to_pylist() == list(range(long.trials))


def test_sobol_is_one_scrambled_sequence_through_all_chunks():
    vary = {"attacker.position": Box([0, 0], [1, 1]), "target.position": Box([0, 0], [1, 1])}
    inputs = study(4 * CHUNK, vary=vary, design="sobol").inputs()
    points = np.stack(list(inputs.values()), axis=1)
    cells = np.floor(points * 8).astype(int) @ [512, 64, 8, 1]
    assert (np.bincount(cells, minlength=4096) == 8).all()  # a net: every box of 1/8 holds its share exactly
    for axis in points.T:
        assert sorted(np.floor(axis * 4 * CHUNK)) == list(range(4 * CHUNK))
    assert qmc.discrepancy(points[:1024]) < 0.2 * qmc.discrepancy(np.random.default_rng(0).random((1024, 4)))
    assert (points > 0).all()
    assert (points < 1).all()


def test_latin_hypercubes_stratify_every_chunk():
    inputs = study(2 * CHUNK, vary={"attacker.position": Box([0, 0], [1, 1])}, design="latin").inputs()
    for values in inputs.values():
        for chunk in (values[:CHUNK], values[CHUNK:]):
            assert sorted(np.floor(chunk * CHUNK)) == list(range(CHUNK))
        assert not np.array_equal(values[:CHUNK], values[CHUNK:])
