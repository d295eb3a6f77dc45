"""What tadcore computes is bitwise what it computed before, on every width of vector registers of this processor."""

import json
from pathlib import Path

import pytest

from widths import python, widths

SCRIPT = Path(__file__).parents[2] / "reference" / "golden.py"


@pytest.mark.parametrize("simd", widths())
def test_everything_is_as_recorded(reference, simd):
    done = python(SCRIPT.read_text(encoding="utf-8"), simd)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == reference("golden")
