"""Studies from TOML files, and the command that runs them."""

import os
import pty
import re
import signal
import subprocess
import sys
import termios
import time
from concurrent.futures import ThreadPoolExecutor

import pytest
from scipy import stats

import tadcore
from study_cases import CHUNK, calm
from tadcore import ScenarioError, Study
from tadcore.cli.app import main
from tadcore.sampling import Annulus, Box, Choice, Cycle, Disk, Gaussian

FILE = """
scenario = "calm.toml"
trials = 300
seed = 5
design = "sobol"

[vary]
"attacker.position" = { box = [[-3, -3], [3, 3]] }
"target.position" = { disk = { center = [0, 1], radius = 0.5 } }
defenders.0.position = { annulus = [[0, 0], 1, 2] }
"defenders[1].position" = { gaussian = { mean = [0, 0], cov = [[1, 0.5], [0.5, 1]] } }
"defenders.2.position" = { values = [[0, 0], [1, 1]] }
"defenders.*.visibility_radius" = { scipy = "uniform", loc = 1, scale = 4 }
"attacker.capture_radius" = { cycle = [0.1, 0.2, 0.3] }
"defenders.*.capture_radius" = [0.1, 0.2]
"""


@pytest.fixture
def written(tmp_path):
    """Write a study beside the scenario that it names."""
    calm().to_toml(tmp_path / "calm.toml")

    def write(text=FILE):
        place = tmp_path / "study.toml"
        place.write_text(text, encoding="utf-8")
        return place

    return write


def test_a_file_is_the_study_it_says(written):
    vary = {
        "attacker.position": Box([-3, -3], [3, 3]),
        "target.position": Disk([0, 1], 0.5),
        "defenders.0.position": Annulus([0, 0], 1, 2),
        "defenders.1.position": Gaussian([0, 0], cov=[[1, 0.5], [0.5, 1]]),
        "defenders.2.position": Choice([[0, 0], [1, 1]]),
        "defenders.*.visibility_radius": stats.uniform(loc=1, scale=4),
        "attacker.capture_radius": Cycle([0.1, 0.2, 0.3]),
        "defenders.*.capture_radius": [0.1, 0.2],
    }
    read = Study.from_toml(written())
    assert (read.scenario, read.trials, read.seed, read.design) == (calm(), 300, 5, "sobol")
    assert read.run().table.equals(Study(calm(), vary, trials=300, seed=5, design="sobol").run().table)


def test_a_scenario_is_a_name_or_a_table(written):
    text = 'scenario = "paper-i1"\ntrials = 10\nvary."*.position" = { gaussian = [0, 1] }\n'
    assert Study.from_toml(written(text.replace("[0, 1]", "{ mean = 0, std = 1 }"))).scenario == tadcore.scenarios.load(
        "paper-i1"
    )
    tables = calm().to_toml().replace("[attacker]", "[scenario.attacker]").replace("[target]", "[scenario.target]")
    tables = "[scenario]\n" + tables.replace("[[defenders]]", "[[scenario.defenders]]")
    inline = Study.from_toml(written('trials = 10\nvary."attacker.position" = { values = [[0, 0]] }\n' + tables))
    assert (inline.scenario, inline.seed, inline.design) == (calm(), 0, "random")


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("trials = 300", "trails = 300", r"trails: .*did you mean trials\?"),
        ("trials = 300", "", "trials: got nothing, must be given"),
        ("trials = 300", "trials = 0", "trials: got 0"),
        ("trials = 300", 'trials = "300"', "trials: got '300'"),
        ("trials = 300", "trials =", "line 3"),
        ("seed = 5", "seed = -1", "seed: got -1"),
        ('"sobol"', '"halton"', "design: got 'halton'"),
        ("calm.toml", "clam.toml", "scenario: got 'clam.toml', must be a file, or the name of a bundled scenario"),
        ("calm.toml", "paper-1", r"did you mean paper-i1\?"),
        ('"calm.toml"', "3", "scenario: got 3"),
        ("{ box =", "{ bax =", r"\.bax: .* must be one of the samplers"),
        ("[[-3, -3], [3, 3]]", "[[-3, -3]]", "box: got .* a table of low, high"),
        ("[[-3, -3], [3, 3]]", "{ low = [-3, -3] }", "box.high: got nothing, must be given"),
        ("radius = 0.5", "raduis = 0.5", r"disk\.raduis: got 0\.5, must be left out: it has center, radius"),
        ("radius = 0.5", "radius = -1", r'vary\["target\.position"\], Disk\.radius: got -1'),
        ("radius = 0.5", 'radius = "0.5"', r"Disk\.radius: got '0\.5'"),
        ('"uniform"', '"randint"', r"scipy: got 'randint', must be the name of a continuous"),
        ('"uniform"', '"os.system"', "must be the name of a continuous"),
        ('"uniform"', '"rv_continuous"', "must be the name of a continuous"),
        ("loc = 1", "low = 1", "uniform has loc, scale"),
        ("loc = 1", 'loc = "1"', "a number, or a list"),
        ('"uniform", loc = 1', '"gamma"', r"\.a: got nothing, must be given: gamma has a, loc, scale"),
        ("{ cycle = [0.1, 0.2, 0.3] }", "0.1", "a table such as"),
        ("{ cycle = [0.1, 0.2, 0.3] }", "{}", "a table such as"),
        ("{ cycle = [0.1, 0.2, 0.3] }", "{ cycle = [0.1], values = [0.1] }", "one of the samplers"),
        ("{ cycle = [0.1, 0.2, 0.3] }", '{ callable = "os.system" }', "one of the samplers"),
        ('"attacker.capture_radius"', '"interaction"', "tadcore.sweep"),
        ('"attacker.capture_radius"', '"atacker.capture_radius"', "did you mean attacker.capture_radius"),
    ],
)
def test_what_a_file_must_not_say(written, old, new, words):
    assert old in FILE
    with pytest.raises(ScenarioError, match=words):
        Study.from_toml(written(FILE.replace(old, new)))


def run(*arguments):
    with pytest.raises(SystemExit) as left:
        main(["study", *map(str, arguments)])
    return left.value.code or 0


def test_the_command_plays_keeps_and_continues(written, tmp_path, capsys):
    place, store = written(), tmp_path / "out"
    assert run(place, "--store", store, "--resume") == 2
    assert "there is no such file" in capsys.readouterr().err
    for options in (["--threads", "1"], ["--no-progress", "--resume"]):
        assert run(place, "--store", store, *options) == 0
        out, err = capsys.readouterr()
        assert err == ""
        assert out.startswith("300 trials\n")
        assert out.endswith(f"written to {store}\n")
    result = tadcore.load_study(store)
    for name, count in result.counts().items():
        assert f"  {name:<12} {count:>12,}  {count / 300:.4f} [" in out  # its interval follows
    assert run(written(FILE.replace("seed = 5", "seed = 6")), "--store", store) == 2
    assert "holds another study (its seed differ)" in capsys.readouterr().err
    assert run(written(FILE.replace("trials = 300", "trials = 0")), "--store", store) == 2
    assert run(tmp_path / "gone.toml", "--store", store) == 2
    assert run(place) == 2
    assert run("--help") == 0
    assert "tadcore study my-study.toml --store out" in capsys.readouterr().out


def test_the_command_keeps_the_table(written, tmp_path):
    place, kept = written(), tmp_path / "paper.table"
    assert run(place, "--store", tmp_path / "one", "--table", kept) == 0
    assert kept.read_bytes().startswith(b"tadtable")
    assert run(place, "--store", tmp_path / "two", "--table", kept) == 0
    one, two = (tadcore.load_study(tmp_path / name) for name in ("one", "two"))
    assert one.time.tolist() == two.time.tolist()


def all_that_is_shown(terminal):
    shown = b""
    while True:
        try:
            block = os.read(terminal, 4096)
        except OSError:  # the other end is closed
            return shown
        if not block:
            return shown
        shown += block


def test_in_a_terminal_a_bar_runs_and_ctrl_c_says_how_to_go_on(written, tmp_path):
    place = written(FILE.replace("trials = 300", f"trials = {300 * CHUNK}"))
    ours, theirs = pty.openpty()
    termios.tcsetwinsize(ours, (24, 90))
    command = [
        sys.executable,
        "-c",
        "from tadcore.cli import main; main()",
        "study",
        place,
        "--store",
        tmp_path / "out",
    ]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=theirs) as process:
        os.close(theirs)
        # A terminal that nobody reads is full after a few lines, and the command waits for it.
        with ThreadPoolExecutor(1) as reader:
            shown = reader.submit(all_that_is_shown, ours)
            while process.poll() is None and not list((tmp_path / "out").glob("part-*.parquet")):
                time.sleep(0.01)
            process.send_signal(signal.SIGINT)
            assert process.wait(20) == 130
    os.close(ours)
    text = shown.result().decode()
    assert re.search(
        r"\| [\d.]+k/2\.46M \[\d\d:\d\d, +[\d.]+k/s, intercepted 0\.\d{3} captured 0\.\d{3} timeout 0\.\d{3}]", text
    )
    assert "interrupted; what was finished is in" in " ".join(text.split())
    assert tadcore.load_study(tmp_path / "out").trials >= CHUNK
