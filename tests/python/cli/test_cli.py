"""The command line: what it prints, where, and how it leaves."""

import os
import subprocess
import sys

import pytest

from tadcore import NoEquilibriumError, scenarios
from tadcore.cli.app import main


@pytest.fixture
def tadcore(capsys):
    """Run the command line in this process: exit code, standard output, standard error."""

    def run(*arguments):
        with pytest.raises(SystemExit) as left:
            main([str(argument) for argument in arguments])
        captured = capsys.readouterr()
        return left.value.code or 0, captured.out, captured.err

    return run


def test_help_shows_examples_and_exit_codes(tadcore):
    code, out, err = tadcore("--help")
    assert (code, err) == (0, "")
    assert "\n    tadcore simulate paper-i1\n" in out
    assert "1 the game has no equilibrium" in out
    for command in ("simulate", "study", "map", "report", "reproduce", "verify", "scenarios", "validate", "explore"):
        code, out, err = tadcore(command, "--help")
        assert (code, err) == (0, "")
        assert len(out) > 200


def test_the_package_runs_as_a_module():
    done = subprocess.run([sys.executable, "-m", "tadcore", "scenarios"], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert scenarios.names()[0] in done.stdout


def test_bundled_scenarios_are_listed_and_printed(tadcore):
    code, out, err = tadcore("scenarios")
    assert (code, err) == (0, "")
    assert out.splitlines()[::2] == list(scenarios.names())
    code, out, err = tadcore("scenarios", "paper-i2")
    assert (code, out, err) == (0, scenarios.text("paper-i2"), "")


def test_a_valid_file_is_described(tadcore, tmp_path):
    place = tmp_path / "my.toml"
    place.write_text(scenarios.text("paper-i2"), encoding="utf-8")
    code, out, err = tadcore("validate", place)
    assert (code, err) == (0, "")
    assert out.startswith(f"{place}: valid\n")
    assert "d3       at (1, 2.5), visibility radius 0.3" in out


def test_bad_input_leaves_with_2_and_one_sentence(tadcore, tmp_path):
    place = tmp_path / "my.toml"
    place.write_text(scenarios.text("paper-i1").replace("2.25", "-1"), encoding="utf-8")
    for command in ("validate", "simulate"):
        code, out, err = tadcore(command, place)
        assert (code, out) == (2, "")
        assert err.startswith("error: defenders[1].visibility_radius: got -1, must be a positive number")
        assert f"(in {place})" in err
        assert "Traceback" not in err
    place.write_text("horizon = \n", encoding="utf-8")
    code, out, err = tadcore("validate", place)
    assert (code, out) == (2, "")
    assert f"{place}, line 1: " in err
    for source, words in [
        ("gone.toml", "must be a file, or the name of a bundled scenario"),
        ("paper-l1", "did you mean paper-i1?"),
        (tmp_path, "must be a file"),
        ("a\0b", "must be a path"),
    ]:
        code, out, err = tadcore("validate", source)
        assert (code, out) == (2, "")
        assert words in err
    assert tadcore("scenarios", "paper-9")[0] == 2


def test_misuse_leaves_with_2(tadcore):
    assert tadcore("simulate")[0] == 2
    assert tadcore("frobnicate")[0] == 2
    assert tadcore("simulate", "paper-i1", "--colour", "red")[0] == 2
    assert tadcore("validate", "paper-i1", "more")[0] == 2


def test_a_destination_that_is_no_folder_is_refused_before_the_game(tadcore, tmp_path):
    place = tmp_path / "taken"
    place.write_text("", encoding="utf-8")
    code, out, err = tadcore("simulate", "paper-i1", "--out", place)
    assert (code, out) == (2, "")
    assert "--out: got " in err


def test_a_game_without_equilibrium_leaves_with_1(tadcore, monkeypatch):
    def escape(sc):
        raise NoEquilibriumError(0.119, sc.horizon, sc.step)

    module = pytest.importorskip("tadcore.simulation.run")
    monkeypatch.setattr(module, "simulate", escape)
    code, out, err = tadcore("simulate", "paper-i1")
    assert (code, out) == (1, "")
    assert err.startswith("error: the game has no feedback Nash equilibrium on [0, 6]")
    assert "0.115" in err


def subprocess_run(*arguments, **environment):
    command = [sys.executable, "-c", "from tadcore.cli import main; main()", *arguments]
    return subprocess.run(command, capture_output=True, check=False, env={**os.environ, **environment})


def test_a_terminal_without_greek_still_gets_an_answer():
    done = subprocess_run("scenarios", PYTHONIOENCODING="ascii")
    assert done.returncode == 0
    assert b"? = 1" in done.stdout


def test_a_narrow_terminal_cuts_nothing_off():
    done = subprocess_run("scenarios", "nothing-like-it", COLUMNS="40", FORCE_COLOR="1")
    assert done.returncode == 2
    lines = done.stderr.decode().splitlines()
    assert max(map(len, lines)) <= 40
    assert "paper-i2-wide" in " ".join(lines)


def test_a_closed_pipe_is_no_catastrophe():
    command = [sys.executable, "-c", "from tadcore.cli import main; main()", "scenarios"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        process.stdout.close()
        err = process.stderr.read()
        process.wait()
    assert b"Traceback" not in err
