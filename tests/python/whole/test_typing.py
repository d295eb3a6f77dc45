"""A user's script type-checks strictly, runs, and is told when it is wrong."""

import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parent / "typing_user.py"


def checked(tool, *arguments):
    """Run a type checker on files outside the project's own settings."""
    command = [sys.executable, "-m", tool, *map(str, arguments)]
    source = Path(__import__("tadcore").__file__).parents[1]
    # An installed package is found by itself; mypy refuses to have its folder named.
    installed = source.name in ("site-packages", "dist-packages")
    environment = os.environ if installed else {**os.environ, "MYPYPATH": str(source), "PYTHONPATH": str(source)}
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    return done.returncode, done.stdout + done.stderr


def mypy(tmp_path, script):
    cache = f"--cache-dir={tmp_path / 'cache'}"
    return checked("mypy", "--config-file=", "--strict", "--follow-imports=silent", cache, script)


def test_a_users_script_runs(tmp_path, capsys, agg):
    specification = importlib.util.spec_from_file_location("typing_user", SCRIPT)
    script = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(script)
    script.main(tmp_path)
    printed = capsys.readouterr().out
    assert "a.gif" in printed
    assert {"mine.toml", "theta.svg", "a.gif"} == {file.name for file in tmp_path.iterdir()}


def test_mypy_strict_passes_and_finds_mistakes(tmp_path):
    code, said = mypy(tmp_path, SCRIPT)
    assert code == 0, said
    wrong = tmp_path / "wrong.py"
    text = SCRIPT.read_text(encoding="utf-8")
    mistakes = (
        ('interaction="I1"', 'interaction="I3"'),
        ("run.outcome.defender + 1", "run.outcome.winner + 1"),
        ('method="newton"', 'method="bfgs"'),
        ('what="distances"', 'what="paths"'),
        ('run.plot.controls(axis="y")', 'run.plot.controls(axes="y")'),
    )
    for right, bad in mistakes:
        assert text.count(right) == 1
        text = text.replace(right, bad)
    wrong.write_text(text, encoding="utf-8")
    code, said = mypy(tmp_path, wrong)
    assert code == 1
    lines = {i + 1 for i, line in enumerate(text.splitlines()) if any(bad in line for _, bad in mistakes)}
    found = {int(line.split(":")[1]) for line in said.splitlines() if ": error:" in line}
    assert lines <= found, said


@pytest.mark.skipif(importlib.util.find_spec("pyright") is None, reason="pyright is not installed")
def test_pyright_passes():
    code, said = checked("pyright", "--pythonpath", sys.executable, SCRIPT)
    assert code == 0, said
