"""The paper's eight runs: what is compared, what must agree, what is written."""

import io
import json

import pytest
from rich.console import Console

from tadcore import scenarios
from tadcore.reproduce import figures as paper, paper as module
from tadcore.reproduce.published import PUBLISHED

# what an independent implementation computes for interaction I2
COMPUTED_I2 = {
    "paper-i2-full": [3.275],
    "paper-i2-far": [3.925],
    "paper-i2": [3.54, 0.5, 1.005, 1.055, 1.31],
    "paper-i2-wide": [3.495, 1.405],
}


@pytest.fixture(scope="module")
def reproduced(tmp_path_factory):
    out = tmp_path_factory.mktemp("paper") / "out"
    screen = io.StringIO()
    report = module.reproduce(out, console=Console(file=screen, width=100))
    return report, out, screen.getvalue()


def rows_of(report, scenario):
    return [row for row in report.rows if row.scenario == scenario]


def test_the_table_covers_the_bundled_scenarios():
    assert sorted(case.scenario for case in PUBLISHED) == sorted(scenarios.names())
    assert all(case.source.startswith("Section VI") for case in PUBLISHED)


def test_interaction_1_is_the_papers_to_the_digit(reproduced):
    report, _, _ = reproduced
    assert report.ok
    assert report.failures == ()
    for case in PUBLISHED:
        if case.exact:
            rows = rows_of(report, case.scenario)
            assert all(row.required and row.agrees for row in rows)
            numbers = {row.quantity: row.computed for row in rows}
            assert round(numbers["time"], 9) == case.time
    changes = [r for r in rows_of(report, "paper-i1") if r.quantity.startswith("change")]
    assert [round(r.computed, 9) for r in changes] == [0.16, 0.49, 0.575, 0.915, 0.96]
    assert [r.difference for r in changes] == [0.0] * 5


@pytest.mark.parametrize("scenario", COMPUTED_I2)
def test_interaction_2_shows_both_columns(reproduced, scenario):
    report, _, _ = reproduced
    rows = rows_of(report, scenario)
    assert rows[0].quantity == "outcome"
    assert rows[0].required
    assert rows[0].agrees
    times = [row for row in rows[1:] if not row.required]
    assert [row.computed for row in times] == pytest.approx(COMPUTED_I2[scenario], abs=1e-9)
    assert all(isinstance(row.paper, float) and row.difference != 0 for row in times)


def test_what_the_text_states_holds(reproduced):
    report, _, _ = reproduced
    stated = [row for row in report.rows if row.paper == 0.0]
    assert len(stated) == 4
    assert all(row.agrees and row.computed <= 1e-9 for row in stated)


def test_every_file_is_there_whole(reproduced):
    report, out, _ = reproduced
    expected = {"report.md", "report.json"} | {f"{name}.{kind}" for name in paper.FIGURES for kind in ("png", "pdf")}
    assert {f.name for f in out.iterdir()} == expected
    assert {f.name for f in report.files} == expected
    assert [f.name for f in out.parent.iterdir()] == ["out"]
    for file in out.glob("*.pdf"):
        content = file.read_bytes()
        assert content.startswith(b"%PDF")
        assert b"/Type3" not in content
        assert b"/FontFile2" in content
    for file in out.glob("*.png"):
        assert file.read_bytes().startswith(b"\x89PNG")


def test_the_report_reads_back(reproduced):
    report, out, _ = reproduced
    data = json.loads((out / "report.json").read_text(encoding="utf-8"))
    assert data == json.loads(json.dumps(report.to_dict()))
    assert data["ok"] is True
    assert len(data["rows"]) == len(report.rows)
    assert {"case", "scenario", "quantity", "paper", "computed", "difference", "source"} <= set(data["rows"][0])
    text = (out / "report.md").read_text(encoding="utf-8")
    assert "| case | quantity | paper | computed | difference |" in text
    assert "no parameter has been tuned" in " ".join(text.split())


def test_the_table_on_screen(reproduced):
    report, _, screen = reproduced
    for case in PUBLISHED:
        assert case.title in screen
    assert "no parameter has been tuned" in " ".join(screen.split())
    assert "-0.180" in screen
    assert str(report).startswith("All ")
    assert str(report) in screen
    assert f"Report and {len(paper.FIGURES)} figures in" in screen


@pytest.mark.parametrize("width", [40, 60, 80, 96, 200])
def test_the_table_fits_its_console(reproduced, width):
    report, _, _ = reproduced
    screen = io.StringIO()
    report.print(Console(file=screen, width=width))
    lines = screen.getvalue().splitlines()
    assert max(len(line.rstrip()) for line in lines) <= width
    assert "…" not in screen.getvalue()
    for number in ("1.395", "0.575", "3.275", "3.455"):
        assert number in screen.getvalue()


def test_a_number_that_is_off_fails_the_report(reproduced):
    report, _, _ = reproduced
    rows = list(report.rows)
    k = next(i for i, row in enumerate(rows) if row.scenario == "paper-i1" and row.quantity == "time")
    rows[k] = module.Row("paper-i1", rows[k].case, "time", 1.395, 1.4, True, False, rows[k].source)
    off = module.Report(rows=tuple(rows), version=report.version)
    assert not off.ok
    assert off.failures == (rows[k],)
    assert "✗" in off.to_markdown()
    assert str(off).startswith("1 of the")


def test_a_missing_or_extra_network_change_is_a_difference(reproduced):
    case = next(case for case in PUBLISHED if case.scenario == "paper-i1")
    run = module.simulate(scenarios.load("paper-i1-suicidal"))
    rows = list(module._figures_of(case, run))
    assert not all(row.ok for row in rows)


def test_figures_may_be_left_out_and_other_files_stay(tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    (out / "mine.txt").write_text("kept", encoding="utf-8")
    screen = io.StringIO()
    report = module.reproduce(out, figures=False, console=Console(file=screen, width=40))
    assert report.ok
    assert {f.name for f in out.iterdir()} == {"mine.txt", "report.md", "report.json"}
    assert max(len(line.rstrip()) for line in screen.getvalue().splitlines()[:-3]) <= 40


def test_an_output_that_is_a_file_is_refused_before_anything_runs(tmp_path):
    (tmp_path / "out").write_text("", encoding="utf-8")
    with pytest.raises(NotADirectoryError, match="is a file"):
        module.reproduce(tmp_path / "out", console=Console(file=io.StringIO()))


def test_a_failure_half_way_leaves_no_trace(tmp_path, monkeypatch):
    def broken(*_, **__):
        raise RuntimeError("no ink")

    monkeypatch.setattr(module, "_draw", broken)
    with pytest.raises(RuntimeError, match="no ink"):
        module.reproduce(tmp_path / "out", console=Console(file=io.StringIO()))
    assert list(tmp_path.iterdir()) == []
