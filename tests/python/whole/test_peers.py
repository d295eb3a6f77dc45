"""The side-by-side scripts run, and their contenders agree."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

PEERS = Path(__file__).parents[3] / "benches" / "peers"
SCRIPTS = {
    "riccati": ["P at every node"],
    "synthesis": ["Θ on certified networks", "how far a peer's Θ is below tadcore's", "gains where Θ is equal"],
    "ensemble": ["one and two threads, share of trials that differ"],
    "run": ["outcome, time and network changes", "positions at every instant"],
}


def test_every_script_is_listed() -> None:
    assert {path.stem for path in PEERS.glob("[a-z]*.py")} == set(SCRIPTS)


@pytest.mark.parametrize("script", SCRIPTS)
def test_contenders_agree(script: str) -> None:
    done = subprocess.run(
        [sys.executable, str(PEERS / f"{script}.py"), "--quick"],
        capture_output=True,
        encoding="utf-8",
        env=os.environ | {"PYTHONIOENCODING": "utf-8"},
        timeout=60,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "ratio" in done.stdout
    lines = [line for line in done.stdout.splitlines() if line.startswith("agreement, ")]
    assert len(lines) == len(SCRIPTS[script])
    for line, what in zip(lines, SCRIPTS[script], strict=True):
        assert what in line
        assert line.endswith(": ok")
