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
        ("gone.toml", "there is no such file, and no bundled scenario of that name"),
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


def test_a_random_game_is_played_by_seed_and_trial(tadcore):
    import tadcore as library

    change = ("--set", "sensing.mean_time_to_failure=0.3")
    code, out, _ = tadcore("simulate", "paper-i1", *change, "--seed", "7", "--trial", "3")
    sc = library.scenarios.load("paper-i1").replace({"sensing.mean_time_to_failure": 0.3})
    assert code == 0
    assert str(library.simulate(sc, seed=7, trial=3).outcome) in out
    assert "d1, d2, d3: sensor fails after 0.3 on average, for good" in out
    assert "seed 7, trial 3" in out
    assert "seed" not in tadcore("simulate", "paper-i1")[1]
    code, _, err = tadcore("simulate", "paper-i1", "--seed", "-1")
    assert code == 2
    assert "seed: got -1" in err


def test_a_game_without_equilibrium_leaves_with_1(tadcore, monkeypatch):
    def escape(sc, **_options):
        raise NoEquilibriumError(0.119, sc.horizon, sc.step)

    monkeypatch.setattr("tadcore.simulation.play.simulate", escape)
    code, out, err = tadcore("simulate", "paper-i1")
    assert (code, out) == (1, "")
    assert err.startswith("error: the game has no feedback Nash equilibrium on [0, 6]")
    assert "0.115" in err


def subprocess_run(*arguments, cwd=None, **environment):
    command = [sys.executable, "-c", "from tadcore.cli import main; main()", *arguments]
    return subprocess.run(command, capture_output=True, check=False, cwd=cwd, env={**os.environ, **environment})


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


@pytest.mark.parametrize("encoding", ["ascii", "cp932", "utf-16"])
def test_a_scenario_printed_into_a_file_is_read_again(tmp_path, encoding):
    """Whatever the locale says, a scenario is UTF-8."""
    done = subprocess_run("scenarios", "paper-i1", PYTHONIOENCODING=encoding)
    assert (done.returncode, done.stderr) == (0, b"")
    assert done.stdout == scenarios.text("paper-i1").encode("utf-8")
    place = tmp_path / "my.toml"
    place.write_bytes(done.stdout)
    assert subprocess_run("validate", str(place), PYTHONIOENCODING=encoding).returncode == 0


@pytest.mark.parametrize("locale", ["C", "POSIX", "en_US.ISO-8859-1"])
def test_a_locale_of_any_kind_gets_its_scenario(locale):
    done = subprocess_run("scenarios", "paper-i1", LC_ALL=locale, PYTHONCOERCECLOCALE="0", PYTHONUTF8="0")
    assert done.stdout == scenarios.text("paper-i1").encode("utf-8")


def piped(given, *arguments, **environment):
    command = [sys.executable, "-c", "from tadcore.cli import main; main()", *arguments]
    return subprocess.run(command, input=given, capture_output=True, check=False, env={**os.environ, **environment})


STUDY = b'scenario = "paper-i1"\ntrials = 20\n[vary]\n"attacker.position" = { box = [[-3, -3], [3, 3]] }\n'


def test_standard_input_stands_for_a_file(tmp_path):
    text = scenarios.text("paper-i1")
    for encoding in ("utf-8", "utf-16"):
        done = piped(text.encode(encoding), "validate", "-", PYTHONIOENCODING="ascii")
        assert (done.returncode, done.stderr) == (0, b"")
        assert done.stdout.startswith(b"-: valid\n")
    out = tmp_path / "run"
    done = piped(text.encode(), "simulate", "-", "--set", "d1.visibility_radius=2", "--out", str(out))
    assert done.returncode == 0
    assert (out / "summary.json").exists()
    done = piped(text.encode(), "map", "-", "--size", "3", "--out", str(tmp_path / "map.nc"))
    assert done.returncode == 0
    done = piped(STUDY, "study", "-", "--store", str(tmp_path / "store"))
    assert (done.returncode, done.stdout.splitlines()[0]) == (0, b"20 trials")
    for command in (("validate", "-"), ("study", "-", "--store", str(tmp_path / "other"))):
        done = piped(b"horizon = \n", *command)
        assert done.returncode == 2
        assert done.stderr.startswith(b"error: standard input, line 1: ")
        done = piped(b"\xff", *command)
        assert done.stderr.startswith(b"error: standard input: got b'\\xff', must be text in UTF-8")
        assert done.returncode == 2
    assert not (tmp_path / "other").exists()


@pytest.mark.parametrize("columns", ["0", "-1", "1", "x", "9" * 30])
def test_a_terminal_of_any_width_gets_its_answer(columns):
    done = subprocess_run("validate", "paper-i1", COLUMNS=columns, LINES=columns)
    words = b" ".join(done.stdout.split())
    assert words.startswith(b"paper-i1: valid I1, defenders against attacker and target")
    assert words.endswith(b"captures within 0.1")
    done = subprocess_run("validate", "nothing-like-it", COLUMNS=columns, FORCE_COLOR="1")
    assert done.returncode == 2
    assert b"there is no such file, and no bundled scenario of that name" in b" ".join(done.stderr.split())


@pytest.mark.parametrize("term", ["dumb", "", "unknown"])
def test_a_poor_terminal_gets_its_answer(term):
    environment = {key: value for key, value in os.environ.items() if key != "HOME"}
    command = [sys.executable, "-c", "from tadcore.cli import main; main()", "validate", "paper-i1"]
    done = subprocess.run(command, capture_output=True, check=False, env={**environment, "TERM": term})
    assert (done.returncode, done.stderr) == (0, b"")
    assert done.stdout.startswith(b"paper-i1: valid")


def test_output_that_is_closed_is_no_catastrophe():
    for command in ("scenarios paper-i1", "validate paper-i1", "validate nix"):
        line = f"{sys.executable} -m tadcore {command}"
        assert subprocess.run(["sh", "-c", f"{line} >&- 2>&-"], check=False).returncode == (
            2 if "nix" in command else 0
        )
        done = subprocess.run(["sh", "-c", f"{line} > /dev/full"], check=False, capture_output=True)
        assert done.returncode == 2
        assert b"Traceback" not in done.stderr


ODD = ["nan", "inf", "-inf", "0", "-1", "1e-320", "5e-324", "1e308", "-1e308", "1e400", "9" * 400, "x", "", "1" * 5000]
"""What an option of a number may be given."""


@pytest.mark.parametrize("value", ODD)
@pytest.mark.parametrize(
    "arguments",
    [
        ("map", "paper-i1", "--size", "3", "--x", "{}", "1"),
        ("map", "paper-i1", "--size", "3", "--x", "0", "{}"),
        ("map", "paper-i1", "--size", "3", "--y", "{}", "1"),
        ("map", "paper-i1", "--size", "3", "--y", "0", "{}"),
        ("map", "paper-i1", "--size", "3", "--x", "-{}", "{}"),
        ("map", "paper-i1", "--size", "3", "--z", "{}"),
        ("map", "paper-i1", "--size", "{}"),
        ("map", "paper-i1", "--size", "3", "--threads", "{}"),
        ("map", "paper-i1", "--size", "3", "--player", "{}"),
        ("map", "paper-i1", "--size", "3", "--set", "d1.visibility_radius={}"),
        ("map", "paper-i1", "--size", "3", "--set", "step={}"),
        ("verify", "paper-i1", "--set", "horizon=0.05", "--seed", "{}"),
        ("explore", "paper-i1", "--port", "{}", "--no-browser", "--set", "horizon=-1"),
    ],
)
def test_an_odd_number_is_taken_or_refused_by_name(tadcore, tmp_path, arguments, value):
    """No option takes the command line down: 0, or 2 and one sentence that names what is wrong."""
    given = [argument.format(value) for argument in arguments]
    if arguments[0] == "map":
        given += ["--out", tmp_path / "map.png"]
    code, out, err = tadcore(*given)
    assert code in (0, 2) or (code == 1 and arguments[0] == "verify")
    if code == 2:
        assert out == ""
        assert "rror" in err
        assert len(err) < 7000
        assert not (tmp_path / "map.png").exists()


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("--x nan 1", "--x: got (nan, 1.0), must be LOW HIGH"),
        ("--x 1 1", "--x: got (1.0, 1.0), must be LOW HIGH with low < high"),
        ("--y 5 1", "--y: got (5.0, 1.0), must be LOW HIGH with low < high"),
        ("--y 0 1e200", "--y: got (0.0, 1e+200), must be a range"),
        ("--size 1", "--size: got 1, must be at least 2"),
        ("--z 1", "--z: got 1.0, must be left out"),
        ("--player d9", "--player: got 'd9', must be one of"),
        ("--threads 0", "--threads: got 0"),
    ],
)
def test_a_map_that_cannot_be_made_names_the_option(tadcore, tmp_path, given, said):
    code, _, err = tadcore("map", "paper-i1", *given.split(), "--out", tmp_path / "map.png")
    assert code == 2
    assert said in err


@pytest.mark.parametrize("given", ["--seed=-1", "--trial=-1", "--termination=late", "--gains=complex", "--mirror"])
def test_a_run_that_cannot_be_made_names_the_option(tadcore, given):
    code, _, err = tadcore("simulate", "paper-i1", given)
    assert code == 2
    assert f"{given.partition('=')[0]}: got" in err


@pytest.mark.parametrize("value", ["nan", "inf", "0", "1", "-1", "2", "x"])
def test_an_odd_level_is_refused_by_name(tadcore, tmp_path, value):
    study = tmp_path / "study.toml"
    study.write_bytes(STUDY)
    assert tadcore("study", study, "--store", tmp_path / "store")[0] == 0
    code, _, err = tadcore("report", tmp_path / "store", "--out", tmp_path / "page.html", "--level", value)
    assert code == 2
    assert "level" in err
    assert not (tmp_path / "page.html").exists()


def test_a_name_that_no_file_can_have_is_refused_before_anything_is_computed(tadcore, tmp_path):
    long = tmp_path / ("x" * 300)
    study = tmp_path / "study.toml"
    study.write_bytes(STUDY.replace(b"20", b"2_000_000_000"))
    for command in (
        ("map", "paper-i1", "--size", "100000", "--out", f"{long}.png"),
        ("verify", "paper-i1", "--starts", "1000", "--out", long),
        ("simulate", "paper-i1", "--out", long),
        ("study", study, "--store", long),
        ("study", study, "--store", tmp_path / "store", "--table", long),
        ("report", tmp_path, "--out", long),
        ("reproduce", "--out", long),
        ("validate", long),
    ):
        code, out, err = tadcore(*command)
        assert (code, out) == (2, "")
        assert "File name too long" in err


@pytest.mark.parametrize("backend", ["module://matplotlib_inline.backend_inline", "TkAgg", "nonsense"])
def test_figures_for_files_need_no_display_and_no_backend(tmp_path, backend):
    """``!tadcore`` in a notebook of another kernel inherits that one's backend."""
    environment = {"MPLBACKEND": backend, "DISPLAY": ""}
    study = tmp_path / "study.toml"
    study.write_bytes(STUDY)
    files = (("map", "paper-i1", "--size", "5", "--out", "m.png"),)
    more = (
        ("simulate", "paper-i1", "--out", "run", "--plot"),
        ("study", "study.toml", "--store", "store"),
        ("report", "store", "--out", "page.html"),
    )
    for command in files + (more if backend == "TkAgg" else ()):
        done = subprocess_run(*command, cwd=tmp_path, **environment)
        assert (done.returncode, done.stderr) == (0, b""), command
    assert (tmp_path / "m.png").read_bytes().startswith(b"\x89PNG")
    done = subprocess_run("simulate", "paper-i1", "--plot", cwd=tmp_path, **environment)
    assert done.returncode == 2
    assert b"no display to draw on" in done.stderr


def test_savers_leave_the_backend_and_the_figures_of_the_user_alone(tmp_path):
    code = """
import sys, os, matplotlib, tadcore
run = tadcore.simulate(tadcore.scenarios.load("paper-i1"))
found = tadcore.outcome_map(tadcore.scenarios.load("paper-i1"), x=(-2, 2, 3), y=(-2, 2, 3))
found.save(sys.argv[1])
run.animate(seconds=0.2, fps=5).save(sys.argv[2])
assert matplotlib.rcParams._get("backend") == "TkAgg"
import matplotlib.pyplot as plt
assert plt.get_fignums() == []
"""
    environment = {**os.environ, "MPLBACKEND": "TkAgg", "DISPLAY": ""}
    command = [sys.executable, "-c", code, str(tmp_path / "m.png"), str(tmp_path / "m.gif")]
    done = subprocess.run(command, capture_output=True, check=False, env=environment)
    assert (done.returncode, done.stderr) == (0, b"")
