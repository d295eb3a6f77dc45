"""What is shipped: what an import costs, one version everywhere, the files a contributor relies on."""

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import tadcore

ROOT = Path(__file__).parents[3]


def modules_of(code):
    """Which modules a fresh interpreter has loaded after some code; counted, since seconds depend on the machine."""
    done = subprocess.run(
        [sys.executable, "-c", f"{code}\nimport sys\nprint(*sys.modules)"], capture_output=True, text=True, check=True
    )
    return set(done.stdout.split())


def test_importing_loads_one_module_of_ours_and_few_others():
    new = modules_of("import tadcore") - modules_of("import typing, importlib")
    assert {name for name in new if name.startswith("tadcore")} == {"tadcore"}
    assert new <= {"tadcore", "lazy_loader", "ast", "_ast"}, sorted(new)


def test_errors_load_nothing_but_the_standard_library():
    new = modules_of("import tadcore; tadcore.ScenarioError")
    known = sys.stdlib_module_names | {"tadcore", "lazy_loader", "__main__"}
    outside = {name.partition(".")[0] for name in new} - known
    assert {name for name in outside if not name.startswith("_")} <= {"sitecustomize", "usercustomize"}


@pytest.mark.parametrize("heavy", ["matplotlib", "xarray", "pandas", "bokeh", "clarabel"])
def test_playing_a_game_draws_nothing(heavy):
    code = "import tadcore; run = tadcore.simulate(tadcore.scenarios.load('paper-i1')); run.network_changes; run.plot"
    assert heavy not in modules_of(code)


def test_one_version_everywhere():
    cargo = tomllib.loads((ROOT / "Cargo.toml").read_text(encoding="utf-8"))
    assert cargo["workspace"]["package"]["version"] == tadcore.__version__
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert re.search(r"^version: (.+)$", citation, flags=re.MULTILINE)[1].strip('"') == tadcore.__version__


def test_every_target_that_is_named_exists():
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8").replace("\\\n", " ")
    targets = set(re.findall(r"^([a-z-]+):", makefile, flags=re.MULTILINE))
    for page in ("README.md", "CONTRIBUTING.md", "docs/release-checklist.md", "docs/install.md"):
        named = set(re.findall(r"(?:`|^)make ([a-z-]+)", (ROOT / page).read_text(encoding="utf-8"), flags=re.MULTILINE))
        assert named <= targets, page
    phony = set(re.search(r"^\.PHONY: (.*)$", makefile, flags=re.MULTILINE)[1].split())
    assert targets == phony
    described = set(re.findall(r"^([a-z-]+):.*## ", makefile, flags=re.MULTILINE))
    assert {"wheel", "sdist", "docs", "test", "demo"} <= described


def test_every_folder_that_contributing_names_exists():
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (`.+?) \|", text, flags=re.MULTILINE)
    folders = re.findall(r"`([\w./-]+)`", " ".join(rows))
    assert {"rust/tadcore", "python/tadcore", "docs"} <= set(folders)
    for folder in folders:
        assert (ROOT / folder).is_dir(), folder


def test_extras_bring_what_their_part_imports():
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
    names = {extra: {re.split(r"[<>=]", need)[0] for need in needs} for extra, needs in extras.items()}
    configuration = (ROOT / "docs" / "conf.py").read_text(encoding="utf-8")
    loaded = set(re.findall(r'^    "([\w-]+)",$', configuration, flags=re.MULTILINE))
    assert {"myst_nb", "numpydoc", "sphinx_design"} <= loaded
    for module in loaded:
        assert module.replace("_", "-") in names["docs"], module
    assert "bokeh" in names["explore"]
    assert "clarabel" in names["bounds"]
    assert "fsspec" in names["cloud"]


@pytest.mark.parametrize("package", ["rust/tadcore", "rust/tadcore-kernels", "fuzz"])
def test_the_fuzz_targets_lock_what_the_core_needs(package):
    """They are a workspace of their own, which no build of the library brings up to date."""
    manifest = tomllib.loads((ROOT / package / "Cargo.toml").read_text("utf-8"))
    locked = tomllib.loads((ROOT / "fuzz" / "Cargo.lock").read_text("utf-8"))["package"]
    found = next(entry for entry in locked if entry["name"] == manifest["package"]["name"])
    assert {name.partition(" ")[0] for name in found["dependencies"]} == set(manifest["dependencies"])
