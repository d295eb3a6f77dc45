"""What tadcore computes is bitwise what it computed before, on every width of vector registers of this processor."""

import json
from pathlib import Path

import pytest

from widths import python, widths

SCRIPT = Path(__file__).parents[2] / "reference" / "golden.py"


def recorded_and_found(reference, simd, *arguments):
    done = python(SCRIPT.read_text(encoding="utf-8"), simd, *arguments)
    assert done.returncode == 0, done.stderr
    return reference("golden"), json.loads(done.stdout)


@pytest.mark.parametrize("simd", [width for width in widths() if width != "baseline"])
def test_everything_is_as_recorded(reference, simd):
    recorded, found = recorded_and_found(reference, simd)
    assert found == recorded


def test_one_number_at_a_time_gives_what_was_recorded(reference):
    """Fewer trials of the same games: without vectors the gains of 20,000 take a minute."""
    recorded, found = recorded_and_found(reference, "baseline", "--few")
    assert found.pop("batches") == {name: {"first": whole["first"]} for name, whole in recorded["batches"].items()}
    assert found == {part: recorded[part] for part in ("runs", "gains")}


@pytest.mark.heavy
def test_one_number_at_a_time_gives_all_that_was_recorded(reference):
    recorded, found = recorded_and_found(reference, "baseline")
    assert found == recorded
