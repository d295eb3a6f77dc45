"""Everything that writes files, at places where something special is: all of it keeps the rules of one writer."""

import contextlib
import json
import os
import stat
import subprocess
import sys
import threading

import pytest
from matplotlib.figure import Figure

import tadcore
from tadcore.cli import main
from tadcore.plotting import save as save_figure
from tadcore.report import report
from tadcore.sampling import Box

pytestmark = [pytest.mark.usefixtures("agg"), pytest.mark.skipif(os.name != "posix", reason="links and pipes of POSIX")]


def short():
    return tadcore.scenarios.load("paper-i1").replace({"horizon": 0.5, "step": 0.05})


def study(trials=30):
    return tadcore.Study(short(), {"attacker.position": Box([-3, -3], [3, 3])}, trials=trials, seed=5)


def a_map():
    return tadcore.outcome_map(short(), x=(-3, 3, 4), y=(-3, 3, 4))


def by_verify(path):
    with pytest.raises(SystemExit):
        main(["verify", "paper-i1", "--set", "horizon=0.1", "--deviations", "0", "--out", str(path)])


WRITERS = {
    "a.toml": lambda path: short().to_toml(path),
    "b.html": lambda path: report(study().run(), path),
    "c.png": lambda path: a_map().save(path),
    "d.nc": lambda path: a_map().save(path),
    "d2.nc": lambda path: tadcore.certified_map(short(), x=(-3, 3), y=(-3, 3), resolution=0.5).save(path),
    "e.svg": lambda path: save_figure(Figure(), path.with_suffix(""), formats=["svg"]),
    "f.gif": lambda path: tadcore.simulate(short()).animate(seconds=0.2, fps=5, width=2).save(path),
    "g.html": lambda path: tadcore.simulate(short()).animate(seconds=0.2, fps=5, width=2).save(path),
    "h.table": lambda path: study().run(table=path),
    "run.nc": lambda path: tadcore.simulate(short()).save(path.parent),
    "summary.json": lambda path: tadcore.simulate(short()).save(path.parent),
    "i.json": by_verify,
}
BEGINS = {".gif": b"GIF8", ".png": b"\x89PNG", ".nc": b"CDF", ".table": b"tadtable", ".json": b"{", ".svg": b"<?xml"}


def looks_right(name, content):
    return content.lstrip().startswith(BEGINS.get("." + name.split(".")[1], b"<" if "html" in name else b"interaction"))


@pytest.mark.parametrize("name", WRITERS)
def test_every_writer_follows_a_link_and_keeps_the_mode(tmp_path, name):
    (tmp_path / "here").mkdir()
    target = tmp_path / "there"
    target.touch()
    target.chmod(0o640)
    link = tmp_path / "here" / name
    link.symlink_to("../there")
    with pytest.warns(RuntimeWarning, match="empty table") if name == "h.table" else nothing():
        WRITERS[name](link)
    assert link.is_symlink()
    assert stat.S_IMODE(target.stat().st_mode) == 0o640
    assert looks_right(name, target.read_bytes())
    assert not list(tmp_path.rglob(".*"))


@pytest.mark.parametrize("name", [name for name in WRITERS if name != "h.table"])
def test_every_writer_writes_into_a_pipe(tmp_path, name):
    os.mkfifo(tmp_path / name)
    got = []
    reader = threading.Thread(target=lambda: got.append((tmp_path / name).read_bytes()), daemon=True)
    reader.start()
    WRITERS[name](tmp_path / name)
    reader.join(30)
    assert (tmp_path / name).is_fifo()
    assert looks_right(name, got[0])


@pytest.mark.parametrize("name", WRITERS)
def test_every_writer_refuses_a_folder_by_name(tmp_path, name, capsys):
    (tmp_path / name).mkdir()
    if name == "i.json":
        by_verify(tmp_path / name)
        said = capsys.readouterr().err
        assert name in said
        assert "it is a folder, and must be a file to write" in said
    else:
        with pytest.raises((OSError, tadcore.ScenarioError), match=rf"{name}.* folder|folder.*{name}"):
            WRITERS[name](tmp_path / name)
    assert not list((tmp_path / name).iterdir())
    assert not list(tmp_path.glob(".*"))


@pytest.mark.skipif(not os.path.exists("/dev/stdout"), reason="no /dev/stdout")  # noqa: PTH110
def test_a_report_goes_to_standard_output_before_what_is_printed(tmp_path):
    out = tmp_path / "out"
    command = [sys.executable, "-m", "tadcore", "verify", "paper-i1", "--set", "horizon=0.1", "--deviations", "0"]
    with out.open("w") as stream:
        subprocess.run([*command, "--out", "/dev/stdout"], stdout=stream, stderr=subprocess.PIPE)
    said, end = json.JSONDecoder().raw_decode(out.read_text(encoding="utf-8"))
    assert said["checks"]
    assert out.read_text(encoding="utf-8")[end:].strip()  # the lines that a reader is shown


def nothing():
    return contextlib.nullcontext()
