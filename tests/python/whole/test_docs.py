"""The documentation: its code runs, its links lead somewhere, and it leaves no public name out."""

import contextlib
import io
import re
import struct
import subprocess
import sys
import types
from pathlib import Path

import pytest

import tadcore
from tadcore import (
    analysis,
    errors,
    game,
    plotting,
    report,
    reproduce,
    sampling,
    scenario,
    simulation,
    statistics,
    study,
    verification,
)

DOCS = Path(__file__).parents[3] / "docs"
PAGES = sorted(
    page for page in DOCS.rglob("*.md") if "_build" not in page.parts and "jupyter_execute" not in page.parts
)
CELL = re.compile(r"^```\{code-(?:cell|block)\} python\n(.*?)^```$", re.MULTILINE | re.DOTALL)
EXECUTED = [page for page in PAGES if CELL.search(page.read_text(encoding="utf-8"))]

UNLISTED = {"draw", "manifest"}
"""What is public to other packages of the library alone."""

pytestmark = pytest.mark.usefixtures("agg")


def cells(page):
    return CELL.findall(page.read_text(encoding="utf-8"))


def run_cells(page, monkeypatch, tmp_path):
    """Run every cell of a page in one namespace, IPython's display left out; return what was printed."""
    import matplotlib.pyplot as plt

    shell, display = types.ModuleType("IPython"), types.ModuleType("IPython.display")
    shell.version_info, shell.get_ipython, display.HTML = (9, 0), lambda: None, str
    monkeypatch.setitem(sys.modules, "IPython", shell)
    monkeypatch.setitem(sys.modules, "IPython.display", display)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(plt, "show", lambda: plt.close("all"))
    printed = io.StringIO()
    namespace = {"__name__": "page"}
    with contextlib.redirect_stdout(printed):
        for number, cell in enumerate(cells(page)):
            exec(compile(cell, f"{page.name}, cell {number}", "exec"), namespace)
    plt.close("all")
    return printed.getvalue()


@pytest.mark.parametrize("page", EXECUTED, ids=lambda page: str(page.relative_to(DOCS)))
def test_the_code_of_a_page_runs(page, monkeypatch, tmp_path):
    monkeypatch.setattr(plotting.Animation, "to_gif", lambda self, **options: repr(self))  # tested where it belongs
    printed = run_cells(page, monkeypatch, tmp_path)
    if page.stem == "errors":
        said = {line.partition(":")[0] for line in printed.splitlines()}
        wanted = {"ScenarioError", "NoEquilibriumError", "StoreError", "WorkerError", "VerificationError"}
        assert wanted <= said
    if page.stem == "paper":
        assert re.search(r"paper-i2-full +time +3\.455 +3\.275", printed)


def test_the_pages_are_those_that_were_meant():
    names = {str(page.relative_to(DOCS)) for page in EXECUTED}
    assert {
        "errors.md",
        "glossary.md",
        "guide/run.md",
        "guide/studies.md",
        "guide/statistics.md",
        "guide/maps.md",
        "gallery/paper.md",
        "gallery/own-scenario.md",
        "gallery/million.md",
        "gallery/radius.md",
        "gallery/outcome-map.md",
        "gallery/nash.md",
        "gallery/dask.md",
        "verification.md",
    } <= names


def test_every_public_name_is_in_the_reference():
    text = "\n".join(page.read_text(encoding="utf-8") for page in (DOCS / "api").iterdir())
    named = set(re.findall(r"^\.\. auto(?:class|function|data|module):: ([\w.]+)", text, flags=re.MULTILINE))
    subpackages = {name for name in tadcore.__all__ if isinstance(getattr(tadcore, name), types.ModuleType)}
    assert {*tadcore.__all__} - {"__version__", *subpackages} <= {name.removeprefix("tadcore.") for name in named}
    assert set(plotting.__all__) <= named
    assert set(sampling.__all__) <= named
    bare = {name.removeprefix("tadcore.") for name in named}
    for package in (statistics, verification, analysis):
        home = package.__name__.removeprefix("tadcore.")
        assert {f"{home}.{name}" for name in package.__all__ if name not in tadcore.__all__} <= bare
    last = {name.rpartition(".")[2] for name in named}
    for package in (errors, game, report, reproduce, scenario, simulation, study):
        assert {*package.__all__} <= last, package.__name__
    assert "tadcore.__version__" in text


def test_every_member_that_is_public_is_in_the_reference():
    """What a class of results has is listed where the class is, but for what its attributes' section says."""
    text = "\n".join(page.read_text(encoding="utf-8") for page in sorted((DOCS / "api").glob("*.rst")))
    for kind in (tadcore.Run, tadcore.Batch, tadcore.Gains, tadcore.StudyResult, tadcore.Study, tadcore.SweepResult):
        found = re.search(rf"^\.\. autoclass:: {kind.__name__}\n   :members: (.*)$", text, flags=re.MULTILINE)
        listed = set(found[1].split(", ")) if found else set()
        own = {
            n
            for base in kind.__mro__[:-1]
            for n, v in vars(base).items()
            if n[0] != "_" and (callable(v) or hasattr(v, "__get__"))
        }
        said = set(re.findall(r"^ {4}(\w+(?:, \w+)*) : ", kind.__doc__, flags=re.MULTILINE))
        said = {name for names in said for name in names.split(", ")}
        assert own - said <= listed | UNLISTED, (kind.__name__, own - said - listed)


def test_every_public_name_of_plotting_is_a_figure_or_is_said():
    index = (DOCS / "guide" / "figures.md").read_text(encoding="utf-8")
    for name in ("trajectories", "network", "visibility", "controls", "distances", "gains", "theta"):
        assert f"run.plot.{name}(" in index


def test_every_error_has_a_cause_and_a_fix():
    text = (DOCS / "errors.md").read_text(encoding="utf-8")
    from tadcore import errors

    for name in errors.__all__:
        thing = getattr(errors, name)
        if isinstance(thing, type) and issubclass(thing, Exception) and name != "TadcoreError":
            assert re.search(rf"^## `{name}`", text, flags=re.MULTILINE), name
    assert text.count("*Fix*") >= 10


def test_every_page_is_in_a_toctree():
    listed = set()
    for page in PAGES:
        for tree in re.findall(r"```\{toctree\}\n(.*?)```", page.read_text(encoding="utf-8"), flags=re.DOTALL):
            for line in tree.splitlines():
                if line and not line.startswith(":"):
                    found = [file for kind in ("md", "rst") for file in page.parent.glob(f"{line.strip()}.{kind}")]
                    assert found, f"{page.name} lists {line}"
                    listed |= set(found)
    assert {*PAGES, *(DOCS / "api").glob("*.rst")} - listed == {DOCS / "index.md"}


def test_every_decision_has_a_number_of_its_own():
    pages = sorted((DOCS / "decisions").glob("0*.md"))
    numbers = [page.name[:4] for page in pages]
    assert len(pages) > 10
    assert len(set(numbers)) == len(pages), numbers
    for page, number in zip(pages, numbers, strict=True):
        assert page.read_text(encoding="utf-8").startswith(f"# {number} · "), page.name


def test_code_cells_keep_to_eighty_columns():
    for page in PAGES:
        for cell in re.findall(r"```\{code-cell\} python\n(.*?)```", page.read_text(encoding="utf-8"), flags=re.DOTALL):
            long = [line for line in cell.splitlines() if len(line) > 80]
            assert not long, (page.name, long)


def test_relative_links_and_pictures_exist():
    for page in [*PAGES, DOCS.parent / "CONTRIBUTING.md"]:
        text = page.read_text(encoding="utf-8")
        for link in re.findall(r"\]\(([^)#:]+)\)|\{(?:image|include|literalinclude)\} (\S+)", text):
            path = next(filter(None, link))
            assert (page.parent / path).exists(), f"{page.name}: {path}"


def check_pages(folder):
    command = [sys.executable, str(DOCS / "check_pages.py"), str(folder)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_the_built_pages_are_read_for_what_no_cell_should_print(tmp_path):
    def png(name, width):
        (tmp_path / name).write_bytes(b"\x89PNG\r\n\x1a\n" + struct.pack(">I4sII", 13, b"IHDR", width, 10))

    png("wide.png", 1400)
    png("small.png", 500)
    cell = '<div class="cell_output docutils container">{}</div>'
    good = cell.format("<pre>d1 at t = 1.395, see https://x.y/home/z</pre>") + "<pre>ls /home/you; Warning: mine</pre>"
    (tmp_path / "a.html").write_text(good + cell.format('<img src="wide.png" style="width: 660px;">'))
    assert check_pages(tmp_path).returncode == 0
    bad = [
        "<pre>/home/ada/x.py: gone</pre>",
        f"<pre>{DOCS.parent}/x.py: gone</pre>",
        '<div class="output stderr highlight"><pre>TqdmWarning</pre></div>',
        "<pre>UserWarning: beware</pre>",
        '<img src="small.png">',
        '<img src="wide.png" style="width: 300px;">',
    ]
    (tmp_path / "a.html").write_text("".join(map(cell.format, bad)))
    done = check_pages(tmp_path)
    assert done.returncode == 1
    assert done.stdout.splitlines() == [
        "a.html: on standard error: TqdmWarning",
        "a.html: a path of this machine: /home/ada",
        f"a.html: a path of this machine: {DOCS.parent}",
        "a.html: a warning: UserWarning: beware",
        "a.html: small.png has 500 pixels, shown as wide as they are",
        "a.html: wide.png has 1400 pixels, shown 300",
    ]


def test_the_link_checker_finds_what_leads_nowhere(tmp_path):
    def check():
        return check_pages(tmp_path)

    assert (check().returncode, check().stdout) == (1, f"{tmp_path}: no pages\n")
    (tmp_path / "a.html").write_text('<h1 id="top"></h1><a href="b.html#here">b</a><a href="https://x.y/">x</a>')
    (tmp_path / "b.html").write_text('<p id="here"></p><a href="a.html#top">a</a>')
    assert check().returncode == 0
    (tmp_path / "b.html").write_text('<a href="a.html#nowhere">a</a><img src="none.png">')
    done = check()
    assert done.returncode == 1
    assert done.stdout.splitlines() == [
        "a.html: no anchor for b.html#here",
        "b.html: no anchor for a.html#nowhere",
        "b.html: no file for none.png",
    ]
