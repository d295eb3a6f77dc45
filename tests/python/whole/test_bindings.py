"""No panic of the core crosses the bindings: whatever computes or allocates runs behind the one place that catches."""

import re
from pathlib import Path

import pytest

SOURCES = Path(__file__).parents[3] / "rust" / "tadcore-python" / "src"


def entry_points(text):
    """The functions that Python can call, by name: their return type and their body."""
    for start in re.finditer(r"#\[(?:pymethods|pyfunction)[^\n]*\n", text):
        block = body(text, text.index("{", start.end() - 1))
        if "pyfunction" in start[0]:
            block = text[start.end() :].split("{", 1)[0] + block
        for found in re.finditer(r"fn (\w+)(?:<[^>]*>)?\((?:[^()]|\([^()]*\))*\)(?: -> ([^{]+))? \{", block):
            yield found[1], found[2] or "", body(block, found.end() - 1)


def body(text, at):
    """The braces that open at a place, with all between them."""
    depth = 0
    for i in range(at, len(text)):
        depth += {"{": 1, "}": -1}.get(text[i], 0)
        if depth == 0:
            return text[at : i + 1]
    raise AssertionError("braces that do not close")


def unguarded(text):
    """Those that may fail, or that call what may panic, outside of the guard."""
    return [
        name
        for name, returns, inside in entry_points(text)
        if "guarded(" not in inside
        and (returns.startswith("PyResult") or "Bound" in returns or re.search(r"\w\[", inside))
    ]


@pytest.mark.parametrize("source", sorted(SOURCES.glob("*.rs")), ids=lambda source: source.stem)
def test_every_entry_point_is_guarded(source):
    assert unguarded(source.read_text(encoding="utf-8")) == []


def test_the_test_sees_what_it_should():
    text = """
#[pymethods]
impl Game {
    fn open<'py>(&self, py: Python<'py>) -> PyResult<u8> {
        Ok(self.numbers[1])
    }
    fn closed(&self, py: Python<'_>) -> PyResult<u8> { guarded(|| { Ok(1) }) }
    fn plain(&self) -> usize { self.size }
    fn indexed(&self) -> u8 { self.numbers[1] }
}
#[pyfunction]
fn bare(py: Python<'_>) -> PyResult<&'static str> {
    work()
}
"""
    assert unguarded(text) == ["open", "indexed", "bare"]
    names = {name for source in SOURCES.glob("*.rs") for name, _, _ in entry_points(source.read_text(encoding="utf-8"))}
    assert {"simulate_batch", "synthesize", "P", "residual", "costs", "observe", "load_table", "simd"} <= names
