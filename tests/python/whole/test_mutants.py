"""The list of mutants fits the sources: a full run takes half an hour, a line that no longer matches shows at once."""

import importlib.util
import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]


@pytest.fixture
def mutants(monkeypatch):
    """The program of `make mutants`, loaded and not run."""
    folder = ROOT / "tests" / "mutants"
    monkeypatch.syspath_prepend(str(folder))
    spec = importlib.util.spec_from_file_location("mutants", folder / "__main__.py")
    program = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(program)
    yield program
    for name in {file.stem for file in folder.glob("*.py")} & set(sys.modules) - {"__main__"}:
        del sys.modules[name]


def source(mutants, file):
    """The text of the file that `make mutants` changes: of the core, otherwise of the kernels."""
    return next(path for root in mutants.CRATES.values() if (path := ROOT / root / file).is_file()).read_text("utf-8")


def test_every_quoted_line_stands_once_in_its_file(mutants):
    listed = mutants.numbered()
    for file in {file for _, file, *_ in listed}:
        before = source(mutants, file)
        after = mutants.planted(file, before, listed)
        assert len(re.findall(r"crate::mutant\(\d+\)", after)) == sum(own == file for _, own, *_ in listed)


def test_what_is_replaced_is_an_expression(mutants):
    """An operator, or one with what follows it, would not compile beside a choice in parentheses."""
    for _, file, formula, marked, _ in mutants.numbered():
        part = re.search("«(.*)»", marked, re.S)[1]
        assert not re.match(r"[-+*/%&|<>=]+( |$)", part), (file, formula)


def test_a_quoted_line_that_is_gone_is_named(mutants):
    number, file, formula, marked, instead = mutants.numbered()[0]
    with pytest.raises(SystemExit, match=re.escape(f"{file}, {formula}: not once")):
        mutants.planted(file, source(mutants, file), [(number, file, formula, marked.replace("«", "gone «"), instead)])


def test_every_size_that_the_build_leaves_out_is_there(mutants):
    for files in mutants.LIGHTER.values():
        for file, (pattern, instead) in files.items():
            assert re.subn(pattern, instead, source(mutants, file), flags=re.M)[1], file


def test_the_pages_say_how_many_are_listed(mutants):
    text = (ROOT / "CONTRIBUTING.md").read_text("utf-8")
    assert re.search(r"`make mutants` \| (\d+) mutants", text)[1] == str(len(mutants.numbered()))
