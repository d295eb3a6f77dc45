"""Games that diverge are no timeouts: counted apart wherever the outcomes of many games are shown."""

import json

import matplotlib.pyplot as plt
import numpy as np
import pyarrow.parquet as pq
import pytest

import tadcore
from tadcore import ScenarioError, plotting, statistics
from tadcore.cli.app import main
from tadcore.report import report
from tadcore.sampling import Box

TRIALS = 400


@pytest.fixture(scope="module")
def sc():
    """Half of its games diverge."""
    return tadcore.scenarios.load("paper-i2").replace({"attacker.control_weight": 0.48, "step": 0.05})


@pytest.fixture(scope="module")
def study(sc):
    return tadcore.Study(sc, {"attacker.position": Box([-3, -3], [3, 3])}, trials=TRIALS, seed=7)


@pytest.fixture(scope="module")
def result(study, tmp_path_factory):
    return study.run(store=tmp_path_factory.mktemp("diverged") / "store")


@pytest.fixture(scope="module")
def sizes(study):
    """By how much every game grew, from single runs: not what the batch says."""
    grown = []
    for place in zip(*study.inputs().values(), strict=True):
        at = tadcore.simulate(study.scenario.replace({"attacker.position": tuple(map(float, place))})).position
        start = np.linalg.norm(at[0][:, None] - at[0][None], axis=-1).max()
        grown.append(np.linalg.norm(at[:, :-1] - at[:, -1:], axis=-1).max() / start)
    return np.array(grown)


@pytest.fixture
def shares(result, sizes):
    """What every table has to say, from kinds and sizes alone."""
    lost = sizes > 1000
    found = {name: ((result.kind == code) & ~lost).mean() for code, name in enumerate(statistics.outcomes.KINDS)}
    found |= {f"d{i + 1}": ((result.defender == i) & ~lost).mean() for i in range(3)}
    return found | {"diverged": lost.mean()}


def test_the_trials_that_diverge_are_those_whose_runs_grow(result, sizes):
    assert 0.2 < result.diverged.mean() < 0.8
    assert np.array_equal(result.diverged, sizes > 1000)
    counts = result.counts()
    assert counts["diverged"] == np.count_nonzero(sizes > 1000)
    assert sum(counts.values()) == TRIALS
    assert f"{counts['diverged']} diverged" in repr(result)
    run = result.replay(int(np.flatnonzero(result.diverged)[0]))
    assert run.diverged is not None


def test_probabilities_and_incidence(result, shares):
    found = result.probabilities()
    assert dict(zip(found.names, found.estimate, strict=True)) == pytest.approx(shares)
    assert found["timeout"][0] + found["captured"][0] + found["intercepted"][0] + found["diverged"][0] == 1.0
    assert "diverged" in repr(found)
    assert found.to_pandas().index[-1] == "diverged"
    curves = result.incidence()
    assert dict(zip(curves.names, curves.estimate[:, -1], strict=True)) == pytest.approx(shares)
    assert curves.running[-1] == pytest.approx(0.0)
    sound = result.kind[~result.diverged] == 2
    assert curves["intercepted"][-1] == pytest.approx(sound.sum() / TRIALS)


def test_without_divergence_no_table_has_another_row(sc, result):
    calm = tadcore.Study(sc.replace({"attacker.control_weight": 1.0}), dict(result.study.vary), trials=50, seed=7).run()
    names = ("timeout", "captured", "intercepted", "d1", "d2", "d3")
    assert not calm.diverged.any()
    assert calm.probabilities().names == calm.incidence().names == names
    assert list(calm.counts()) == list(names[:3])
    assert statistics.outcome_names(3) == names


def test_comparisons_count_pairs_in_which_one_diverges(study, result):
    other = study.replace(sc=study.scenario.replace({"attacker.control_weight": 0.6})).run()
    found = tadcore.statistics.compare(result, other)
    a, b = result.diverged, other.diverged
    i = found.names.index("diverged")
    assert (found.only_a[i], found.only_b[i]) == ((a & ~b).sum(), (b & ~a).sum())
    assert found.only_a[i] > 50
    t = found.names.index("timeout")
    sound_a, sound_b = (result.kind == 0) & ~a, (other.kind == 0) & ~b
    assert found.difference[t] == pytest.approx(sound_a.mean() - sound_b.mean())
    assert found.transitions.shape == (4, 4)
    assert found.transitions.sum() == TRIALS
    assert found.transitions[3].sum() == a.sum()
    assert found.transitions[:, 3].sum() == b.sum()
    plain = tadcore.statistics.compare(other, other)
    assert plain.transitions.shape == ((4, 4) if b.any() else (3, 3))


def test_bad_flags_are_refused():
    for bad in ([True], [1, 0], "no", [[True, False]]):
        with pytest.raises(ScenarioError, match="diverged"):
            statistics.probabilities([0, 1], [-1, -1], 1, diverged=bad)
    counts = statistics.outcome_counts([0, 2, 2], [-1, 0, 0], 1, [False, True, False])
    assert counts == {"timeout": 1, "captured": 0, "intercepted": 1, "d1": 1, "diverged": 1}


def test_the_table_and_the_store_have_a_column_and_a_word(result, tmp_path):
    words = np.array(result.table["outcome"].to_pylist())
    assert np.array_equal(words == "diverged", result.diverged)
    kept = result.study.run(store=tmp_path / "store")
    table = pq.read_table(next((tmp_path / "store").glob("part-*.parquet")), partitioning=None)
    assert table["diverged"].to_pylist() == result.diverged.tolist()
    loaded = tadcore.load_study(tmp_path / "store")
    assert np.array_equal(loaded.diverged, kept.diverged)
    assert loaded.counts() == result.counts()
    assert result.to_pandas()["diverged"].sum() == result.diverged.sum()


def test_sweeps_maps_curves_and_indices(sc, study, result):
    swept = tadcore.sweep(study, {"attacker.control_weight": [0.48, 1.0]})
    grid = swept.to_xarray()
    assert grid["count"].sel(outcome="diverged").values.tolist() == [result.diverged.sum(), 0]
    assert grid["probability"].sum("outcome").values.tolist() == pytest.approx([1.0, 1.0])
    assert f"{result.diverged.sum()} games diverged" in repr(swept)
    found = tadcore.outcome_map(sc, x=(-3, 3, 9), y=(-3, 3, 9))
    assert found.counts()["diverged"] == found.dataset["diverged"].values.sum() > 5
    assert sum(found.counts().values()) == 81
    curve = tadcore.radius_curve(result, player="d1", radii=[0.5, 2.0, np.inf])
    i = curve.names.index("diverged")
    assert curve.estimate[i] == pytest.approx(curve.diverged.mean(axis=1))
    assert curve.estimate[[0, 1, 2, i]].sum(axis=0) == pytest.approx(np.ones(3))
    assert "games diverged" in repr(curve)
    spread = tadcore.probability_map(study.replace(trials=20), "d1", x=(-1, 1, 2), y=(-1, 1, 2)).dataset
    four = spread["estimate"].sel(outcome=["timeout", "captured", "intercepted", "diverged"])
    assert four.sum("outcome").values == pytest.approx(np.ones((2, 2)))


def test_figures_draw_it(result, study, tmp_path, agg):
    labels = [text.get_text() for text in plotting.outcome_probabilities(result.probabilities()).get_yticklabels()]
    assert labels[-1] == "diverged"
    for draw, what in (
        (plotting.incidence, result.incidence()),
        (plotting.outcome_map, tadcore.outcome_map(study.scenario, x=(-3, 3, 9), y=(-3, 3, 9))),
        (plotting.radius_curve, tadcore.radius_curve(result, player="d1", radii=[0.5, 2.0])),
    ):
        figure = draw(what).get_figure(root=True)
        figure.canvas.draw()
        words = [
            t.get_text() for a in figure.axes for t in [*a.texts, *(a.get_legend().texts if a.get_legend() else ())]
        ]
        assert "diverged" in words, draw
    axes = plotting.outcomes_by_inputs(result, list(result.inputs))
    assert "diverged" in [text.get_text() for text in axes.flat[0].figure.legends[0].texts]
    plt.close("all")


def test_reports_and_the_command_line_say_it(result, study, tmp_path, capsys):
    page = report(result, tmp_path / "page.html").read_text(encoding="utf-8")
    count = int(result.diverged.sum())
    assert f"{count} of {TRIALS} trials diverged" in page
    path = tmp_path / "study.toml"
    path.write_text(
        'scenario = "s.toml"\ntrials = 400\nseed = 7\n[vary]\n"attacker.position" = { box = [[-3, -3], [3, 3]] }\n'
    )
    study.scenario.to_toml(tmp_path / "s.toml")
    with pytest.raises(SystemExit) as left:
        main(["study", str(path), "--store", str(tmp_path / "out"), "--no-progress"])
    assert left.value.code == 0
    assert any(line.split()[:2] == ["diverged", str(count)] for line in capsys.readouterr().out.splitlines())
    lost = ["paper-i2", "--set", "attacker.control_weight=0.3", "--out", str(tmp_path / "run")]
    with pytest.raises(SystemExit) as left:
        main(["simulate", *lost])
    said = capsys.readouterr()
    assert left.value.code == 1
    assert "diverges at t = 0.725" in said.out
    assert "diverges at t = 0.725" in said.err
    assert json.loads((tmp_path / "run" / "summary.json").read_text())["diverged"]["time"] == 0.725
