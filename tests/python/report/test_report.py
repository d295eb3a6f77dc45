"""The page of a study: what it says, that it stands alone, and the command that writes it."""

import base64
import re
from dataclasses import dataclass, field
from html.parser import HTMLParser
from types import SimpleNamespace

import matplotlib as mpl
import numpy as np
import pytest

import tadcore
from study_cases import calm, escaping
from tadcore import ScenarioError
from tadcore.cli.app import main
from tadcore.report import report
from tadcore.sampling import Disk


@pytest.fixture(scope="module", autouse=True)
def _agg():
    before = mpl.get_backend()
    mpl.use("Agg")
    yield
    mpl.use(before)


@dataclass
class Result:
    """The part of a study's result that the page reads."""

    scenario: tadcore.Scenario
    kind: np.ndarray
    defender: np.ndarray
    time: np.ndarray
    inputs: dict[str, np.ndarray]
    seed: int = 7
    study: SimpleNamespace = field(default_factory=SimpleNamespace)

    @property
    def trials(self):
        return len(self.kind)


def result_of(sc, trials, *, asked=None, design="random"):
    rng = np.random.default_rng(8)
    positions = rng.uniform(-3, 3, (trials, 5, 2))
    batch = tadcore.simulate_batch(sc, positions)
    names = [*(f"defenders.{i}" for i in range(3)), "target", "attacker"]
    inputs = {
        f"{who}.position.{axis}": positions[:, p, a] for p, who in enumerate(names) for a, axis in enumerate("xy")
    }
    inputs["defenders.0.visibility_radius"] = np.where(rng.random(trials) < 0.5, np.inf, 2.0)
    vary = {"*.position": "Box([-3, -3], [3, 3])", "<script>": "alert('&')"}
    study = SimpleNamespace(vary=vary, trials=asked or trials, design=design)
    return Result(sc, batch.kind, batch.defender, batch.time, inputs, study=study)


@pytest.fixture(scope="module")
def result():
    return result_of(tadcore.scenarios.load("paper-i1"), 200)


class Page(HTMLParser):
    """The tables, pictures and balance of a page."""

    def __init__(self, text):
        super().__init__()
        self.open, self.rows, self.images, self.outside = [], [], [], []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        given = dict(attributes)
        if tag not in ("meta", "img"):
            self.open.append(tag)
        if tag == "tr":
            self.rows.append([])
        if tag == "img":
            self.images.append(given)
        if tag in ("script", "link", "iframe") or given.get("src", "data:")[:5] != "data:":
            self.outside.append((tag, given))

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] in ("td", "th"):
            self.rows[-1].append(data)


def test_the_page_holds_the_numbers_and_needs_nothing_else(result, tmp_path):
    file = report(result, tmp_path / "new" / "page.html", title="Where <d1> looks & wins")
    text = file.read_text(encoding="utf-8")
    page = Page(text)
    assert page.open == []
    assert page.outside == []
    assert "<h1>Where &lt;d1&gt; looks &amp; wins</h1>" in text
    rows = {row[0]: row[1:] for row in reversed(page.rows) if row}  # of rows with one name, the first
    for code, name in enumerate(("timeout", "captured", "intercepted")):
        count = int(np.count_nonzero(result.kind == code))
        assert rows[name][:2] == [str(count), f"{count / 200:.4f}"]
    assert rows["<script>"] == [repr("alert('&')")]
    assert rows["seed"] == ["7"]
    assert rows["trials"] == ["200 of 200"]
    assert rows["defenders.0.visibility_radius"][::2] == ["2", "inf"]
    assert len(page.images) == 4 + 5  # with a plane for every player
    for image in page.images:
        assert image["alt"]
        png = base64.b64decode(image["src"].removeprefix("data:image/png;base64,"), validate=True)
        assert png.startswith(b"\x89PNG")
    scenario = re.search(r"<summary>The scenario</summary><pre>(.*?)</pre>", text, re.DOTALL)[1]
    assert tadcore.Scenario.from_toml_string(scenario.replace("&#34;", '"')) == result.scenario


def test_the_same_study_gives_the_same_bytes(result, tmp_path):
    first, second = report(result, tmp_path / "a.html"), report(result, tmp_path / "b.html")
    assert first.read_bytes() == second.read_bytes()


def test_a_short_or_even_study_says_so(tmp_path):
    sc = tadcore.scenarios.load("paper-i1")
    text = report(result_of(sc, 12, asked=50, design="sobol"), tmp_path / "page.html").read_text(encoding="utf-8")
    assert "12 of 50 trials are there" in text
    assert "follow a sobol design" in text
    text = report(result_of(sc, 3), tmp_path / "page.html").read_text(encoding="utf-8")
    assert 'class="note"' not in text


def test_what_cannot_be_reported_is_refused(result, tmp_path):
    with pytest.raises(ScenarioError, match="out"):
        report(result, tmp_path)
    none = Result(result.scenario, *(np.empty(0, d) for d in (np.int8, np.int32, float)), {}, study=result.study)
    with pytest.raises(ScenarioError, match="at least one trial"):
        report(none, tmp_path / "page.html")
    assert list(tmp_path.iterdir()) == []


def test_the_command_writes_the_page(tmp_path, capsys):
    store, out = tmp_path / "store", tmp_path / "page.html"
    vary = {"attacker.position": Disk([-2.0, 2.0], 0.5)}
    result = tadcore.Study(tadcore.scenarios.load("paper-i1"), vary, trials=12, seed=7).run(store=store)
    with pytest.raises(SystemExit) as left:
        main(["report", str(store), "--out", str(out), "--title", "Mine"])
    assert not left.value.code
    text = out.read_text(encoding="utf-8")
    assert "<h1>Mine</h1>" in text
    rows = {row[0]: row[1:] for row in reversed(Page(text).rows) if row}
    for name, count in result.counts().items():
        assert rows[name][0] == str(count)
    assert capsys.readouterr().out == f"12 trials; written to {out}\n"
    with pytest.raises(SystemExit) as left:
        main(["report", str(store), "--out", str(tmp_path)])
    assert left.value.code == 2


@pytest.mark.parametrize("keep", ["all", "outcomes", "counts"])
def test_a_study_is_reported_whatever_it_keeps(keep, tmp_path, monkeypatch):
    """Probabilities and quartiles are the same; without single trials, and of very many, the page says so."""
    wanted = tadcore.Study(calm(), {"attacker.position": Disk([0, 1], 2.0)}, trials=300, seed=7)
    whole = report(wanted.run(), tmp_path / "whole.html").read_text(encoding="utf-8")
    page = report(wanted.run(keep=keep), tmp_path / "page.html").read_text(encoding="utf-8")
    table = re.compile(r"<table.*?</table>", re.DOTALL)
    assert table.findall(page)[:2] == table.findall(whole)[:2]
    assert ("keeps counts alone" in page) == (keep == "counts")
    assert (page == whole) == (keep != "counts")
    monkeypatch.setattr("tadcore.report.parts.MOST_SHOWN", 100)
    page = report(wanted.run(keep=keep), tmp_path / "page.html").read_text(encoding="utf-8")
    assert table.findall(page)[:2] == table.findall(whole)[:2]
    assert ("those of the first 100 trials" in page) == (keep != "counts")


def test_games_without_an_equilibrium_are_reported(tmp_path):
    wanted = tadcore.Study(escaping(3.0), {"horizon": [2.0, 4.0]}, trials=40, seed=1)
    page = report(wanted.run(), tmp_path / "page.html").read_text(encoding="utf-8")
    assert page.count("no_equilibrium") >= 2
