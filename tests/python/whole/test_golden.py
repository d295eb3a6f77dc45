"""What tadcore computes is bitwise what it computed before, on every width of vector registers of this processor."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("tadcore._core")

SCRIPT = Path(__file__).parents[2] / "reference" / "golden.py"


def test_everything_is_as_recorded(reference):
    done = subprocess.run([sys.executable, str(SCRIPT)], capture_output=True, text=True, check=True)
    assert json.loads(done.stdout) == reference("golden")
