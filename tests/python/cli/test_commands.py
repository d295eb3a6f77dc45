"""Commands that print JSON, that print nothing, and those around many games and pictures."""

import json
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import tadcore
from tadcore.cli.app import main

STUDY = """
scenario = "paper-i1"
trials = 40
seed = 7
[vary]
"attacker.position" = { box = [[-3, -2], [3, 4]] }
"""


@pytest.fixture
def run(capsys, tmp_path, monkeypatch):
    """Run the command line in a folder with a study: exit code, standard output, standard error."""
    (tmp_path / "study.toml").write_text(STUDY, encoding="utf-8")
    monkeypatch.chdir(tmp_path)

    def call(*arguments):
        with pytest.raises(SystemExit) as left:
            main([str(argument) for argument in arguments])
        captured = capsys.readouterr()
        return left.value.code or 0, captured.out, captured.err

    return call


def test_json_is_all_that_stands_on_standard_output(run):
    code, out, err = run("simulate", "paper-i1", "--json", "--out", "run")
    assert (code, err) == (0, "")
    assert json.loads(out) == json.loads(Path("run/summary.json").read_text(encoding="utf-8"))
    code, out, _ = run("study", "study.toml", "--store", "store", "--json")
    found = json.loads(out)
    result = tadcore.load_study("store")
    assert (code, found["trials"]) == (0, 40)
    for name, (p, low, high) in ((n, result.probabilities()[n]) for n in ("captured", "d1")):
        assert [found["outcomes"][name][key] for key in ("estimate", "low", "high")] == [p, low, high]
    code, out, _ = run("map", "paper-i1", "--size", 9, "--out", "map.nc", "--json")
    assert (code, json.loads(out)["places"]) == (0, 81)
    assert sum(json.loads(out)["counts"].values()) == 81
    code, out, err = run("verify", "paper-i1", "--deviations", 0, "--json")
    assert (code, err, json.loads(out)["status"]) == (0, "", "passed")


def test_a_game_is_played_with_gains_that_turn_and_compared_with_them(run):
    code, out, _ = run("simulate", "paper-i1", "--gains", "turning", "--mirror", "--out", "run", "--json")
    assert (code, json.loads(out)["variant"]) == (0, "mirrored turning gains")
    assert tadcore.load_run("run").mirror
    assert "mirrored turning gains\n" in "".join(run("simulate", "paper-i1", "--gains", "turning", "--mirror")[1:])
    code, out, _ = run("verify", "paper-i1", "--deviations", 0, "--turning", "--json")
    measured = {m["name"]: m["value"] for m in json.loads(out)["measurements"]}
    assert (code, measured["turning.covered"], measured["turning.gap"]) == (0, 1.0, 0.0)


def test_quiet_prints_errors_only(run):
    for command in (
        ("simulate", "paper-i1"),
        ("validate", "paper-i1"),
        ("map", "paper-i1", "--size", 5, "--out", "m.nc"),
        ("study", "study.toml", "--store", "s"),
        ("curve", "study.toml", "--radii", 1, 5, 3),
        ("sweep", "study.toml", "--over", "horizon=[2]"),
        ("compare", "paper-i1", "paper-i1-full", "--out", "c.png"),
        ("animate", "paper-i1", "--out", "a.gif", "--seconds", 0.2),
    ):
        assert run(*command, "--quiet") == (0, "", ""), command
    code, out, err = run("simulate", "gone.toml", "-q")
    assert (code, out) == (2, "")
    assert "there is no such file" in err
    assert run("validate", "paper-i1")[1].startswith("paper-i1: valid\n")  # no call hushes the next one


def test_validate_says_whether_there_is_an_equilibrium(run):
    weak = ("validate", "paper-i2", "--set", "attacker.control_weight=20")
    with pytest.raises(tadcore.NoEquilibriumError) as caught:
        tadcore.solve_equilibrium(tadcore.scenarios.load("paper-i2").replace({"attacker.control_weight": 20.0}))
    said = f"no equilibrium on [0, 6]: longest horizon {caught.value.longest_horizon:g}"
    code, out, err = run(*weak)
    assert (code, err) == (0, "")
    assert out.startswith(f"paper-i2: valid; {said}\n")
    code, out, err = run(*weak, "--equilibrium")
    assert code == 1
    assert said in err
    assert run("validate", "paper-i1", "--equilibrium")[0] == 0
    instant = caught.value.escape_instant
    assert f"finite only from t = {instant:.6g} on, {6 - instant:.6g} before the horizon" in str(caught.value)


def test_a_file_that_is_not_there_is_said_to_be_missing(run):
    code, out, err = run("simulate", "paper-i")
    assert (code, out) == (2, "")
    assert "error: paper-i: there is no such file, and no bundled scenario of that name; did you mean paper-i" in err


def test_a_curve_is_printed_and_written(run):
    code, out, _ = run("curve", "study.toml", "--player", "d1", "--radii", 1, 5, 3, "--out", "curve.nc")
    assert code == 0
    study = tadcore.Study.from_toml("study.toml")
    expected = tadcore.radius_curve(study, player="d1", radii=[1.0, 3.0, 5.0])
    with xr.open_dataset("curve.nc", engine="scipy") as written:
        assert np.array_equal(written["estimate"], expected.estimate)
    assert [line.split()[0] for line in out.splitlines()[2:6]] == ["radius", "1", "3", "5"]
    assert max(map(len, out.splitlines())) <= 80
    assert run("curve", "study.toml", "--radii", 1, 5, 3, "--out", "curve.pdf")[0] == 0
    assert run("curve", "study.toml", "--radii", 1, 5, 3, "--out", "curve.doc")[0] == 2


def test_curves_of_several_players_and_of_the_team(run):
    radii = ("--radii", 1, 3, 2)
    command = ("curve", "study.toml", "--player", "d2", "--player", "defenders[*]", *radii, "--at-least", 0.5)
    code, out, _ = run(*command, "--out", "curves.nc")
    assert code == 0
    study = tadcore.Study.from_toml("study.toml")
    expected = tadcore.radius_curve(study, player=["d2", "d*"], radii=[1.0, 3.0])
    with xr.open_dataset("curves.nc", engine="scipy") as written:
        assert list(written["player"].values) == ["d2", "d*"]
        assert np.array_equal(written["estimate"], expected.to_xarray()["estimate"])
    for player, whose in (("d2", "of d2"), ("d*", "of all defenders")):
        part = out.partition(f"{whose}\n")[2].partition("of ")[0]
        i = expected[player].names.index("captured")
        assert f"{expected[player].estimate[i, 1]:.3f} [" in part
        least = expected[player].smallest(0.5)
        assert f"smallest for 0.50: {'none; the best is' if least.radius is None else f'{least.radius:g}'}" in part
    assert max(map(len, out.splitlines())) <= 80
    assert run(*command, "--out", "curves.svg")[0] == 0
    code, out, err = run("curve", "study.toml", *radii, "--at-least", 2)
    assert (code, out) == (2, "")
    assert "--at-least: got 2.0, must be a probability in (0, 1)" in err


def test_the_best_start_and_radii_are_those_of_the_package(run):
    study = tadcore.Study.from_toml("study.toml")
    start = ("best-start", "study.toml", "--player", "d3", "--x", -1, 1, "--y", 0, 1, "--evaluations", 25)
    found = tadcore.best_start(study, "d3", x=(-1, 1), y=(0, 1), evaluations=25)
    code, out, err = run(*start, "--json")
    assert (code, err) == (0, "")
    assert json.loads(out) == json.loads(json.dumps(asdict(found)))
    out = run(*start)[1]
    assert out.startswith(f"d3 at ({found.position[0]:.4g}, {found.position[1]:.4g}), of {found.evaluations} places")
    assert "on 40 fresh trials" in out
    radii = ("best-radii", "study.toml", "--total", 6, "--evaluations", 25, "--outcome", "captured")
    shared = tadcore.best_radii(study, 6.0, evaluations=25, outcome="captured")
    assert json.loads(run(*radii, "--json")[1])["radii"] == shared.radii
    assert f"d1 {shared.radii['d1']:.4g}, d2 {shared.radii['d2']:.4g}" in run(*radii)[1]
    assert run(*radii, "--quiet") == (0, "", "")
    assert "--x: got (1.0, 1.0), must be (low, high)" in run(*start[:4], "--x", 1, 1, "--y", 0, 1)[2]


def test_a_sweep_is_printed_and_written(run):
    Path("study.toml").write_text(STUDY.replace("paper-i1", "paper-i2-full"), encoding="utf-8")
    over = ("--over", "attacker.control_weight=[0.8, 20.0]", "--over", "step=[0.01]")
    code, out, _ = run("sweep", "study.toml", *over, "--out", "swept.nc")
    assert code == 0
    assert "attacker.control_weight = 0.8, step = 0.01" in out
    assert "no equilibrium: it escapes" in out
    with xr.open_dataset("swept.nc", engine="scipy") as written:
        assert written.sizes["attacker.control_weight"] == 2
        assert int(written["count"].sum()) == 40
    assert run("sweep", "study.toml", "--over", "horizon")[0] == 2


def test_two_runs_and_a_film_are_written(run, tmp_path):
    code, out, _ = run("compare", "paper-i1", "paper-i1", "--set", "d1.visibility_radius=1", "--out", "both.svg")
    assert code == 0
    assert "written to both.svg" in out
    assert (tmp_path / "both.svg").read_bytes()[:5] == b"<?xml"
    assert run("compare", "paper-i1", "paper-i1", "--what", "colours", "--out", "b.png")[0] == 2
    assert run("animate", "paper-i1", "--out", "run.gif", "--seconds", "0.3")[0] == 0
    assert (tmp_path / "run.gif").read_bytes()[:3] == b"GIF"
    assert run("animate", "paper-i1", "--out", "run.avi")[0] == 2


@pytest.mark.parametrize("command", ["curve", "sweep", "compare", "animate"])
def test_help_folds_into_a_narrow_terminal(run, monkeypatch, command):
    monkeypatch.setenv("COLUMNS", "60")
    code, out, err = run(command, "--help")
    assert (code, err) == (0, "")
    assert f"tadcore {command} " in out
