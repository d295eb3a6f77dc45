"""A table kept from study to study: the same outcomes, nothing solved twice, and bad files that cost only time."""

import os
import subprocess
import sys
import tracemalloc

import numpy as np
import pytest

import tadcore
from tadcore.errors import ScenarioError
from tadcore.game.compiled import game_of
from tadcore.sampling import Box

PLACES = {"attacker.position": Box([-3.0, -3.0], [3.0, 3.0])}


def test_a_second_study_starts_warm_and_ends_alike(tmp_path):
    kept = tmp_path / "table.bin"
    sc = tadcore.scenarios.load("paper-i1").replace({"horizon": 1.0, "step": 0.0125})
    study = tadcore.Study(sc, vary=PLACES, trials=300, seed=3)
    first = study.run(table=kept)
    solved = game_of(sc).table()
    assert solved["misses"] == solved["entries"] > 100
    assert kept.read_bytes() == game_of(sc).save_table()

    # The bytes of one game in a new one: as a process of its own would read them.
    code = (
        "import sys, numpy as np, tadcore\n"
        "from tadcore.game.compiled import game_of\n"
        "from tadcore.sampling import Box\n"
        "sc = tadcore.scenarios.load('paper-i1').replace({'horizon': 1.0, 'step': 0.0125})\n"
        "study = tadcore.Study(sc, vary={'attacker.position': Box([-3.0, -3.0], [3.0, 3.0])}, trials=300, seed=3)\n"
        "result = study.run(table=sys.argv[1])\n"
        "np.savez(sys.argv[2], kind=result.kind, time=result.time, misses=game_of(sc).table()['misses'])\n"
    )
    subprocess.run([sys.executable, "-c", code, str(kept), str(tmp_path / "second.npz")], check=True)
    second = np.load(tmp_path / "second.npz")
    assert second["misses"] == 0
    assert np.array_equal(second["kind"], first.kind)
    assert np.array_equal(second["time"], first.time)


def short(step=0.02):
    sc = tadcore.scenarios.load("paper-i1").replace({"horizon": 1.0, "step": step})
    return tadcore.Study(sc, vary=PLACES, trials=50, seed=4)


@pytest.mark.parametrize("change", [lambda table: b"", lambda table: table[:-1], lambda table: table[:8]])
def test_a_damaged_table_is_named_and_replaced(tmp_path, change):
    kept = tmp_path / "table.bin"
    short().run(table=kept)
    whole = kept.read_bytes()
    kept.write_bytes(change(whole))
    with pytest.warns(RuntimeWarning, match="table.bin: the "):
        short().run(table=kept)
    assert kept.read_bytes() == whole


def test_the_table_of_another_game_is_named_and_replaced(tmp_path):
    kept = tmp_path / "table.bin"
    short().run(table=kept)
    with pytest.warns(RuntimeWarning, match="table.bin: "):
        short(0.04).run(table=kept)
    assert kept.read_bytes() == game_of(short(0.04).scenario).save_table()


def test_what_is_no_table_is_refused_before_anything_is_made(tmp_path):
    short().run(store=tmp_path / "other")
    precious = [tmp_path / "scenario.toml", next((tmp_path / "other").glob("part-*.parquet")), tmp_path / "zeros"]
    short().scenario.to_toml(precious[0])
    with precious[2].open("wb") as stream:
        stream.truncate(3 << 30)  # a hole, which takes no room and would take memory
    (tmp_path / "link").symlink_to(precious[0])
    (tmp_path / "folder").mkdir()
    os.mkfifo(tmp_path / "pipe")
    before = [(path.stat().st_ino, path.stat().st_size, path.stat().st_mtime_ns) for path in precious]
    others = [tmp_path / name for name in ("link", "folder", "pipe", "x" * 300)]
    for path in [*precious, *others]:
        with pytest.raises(
            ScenarioError, match=r"^table: got .* must be a table that a study has saved, or a new name"
        ):
            short().run(table=path, store=tmp_path / "store")
    assert [(path.stat().st_ino, path.stat().st_size, path.stat().st_mtime_ns) for path in precious] == before
    assert not (tmp_path / "store").exists()


def test_a_table_is_saved_into_a_folder_that_is_made(tmp_path):
    short().run(table=tmp_path / "new" / "folder" / "table.bin")
    assert (tmp_path / "new" / "folder" / "table.bin").read_bytes().startswith(b"tadtable")


def test_a_table_of_another_size_is_not_read(tmp_path):
    kept, other = tmp_path / "table.bin", tmp_path / "other.bin"
    short().run(table=kept)
    start = kept.read_bytes()
    counted = start[:32] + (2**40).to_bytes(8, "little")
    for content, reason in [
        (start[:8], "the bytes are not a saved table|the table has format 0"),
        (start[:40], "the table is damaged: it has 3,221,225,472 bytes, and says"),
        (counted, "the table says that it has 1099511627776 entries, and a table of this game has at most"),
    ]:
        other.write_bytes(content)
        with other.open("r+b") as stream:
            stream.truncate(3 << 30)  # a hole
        tracemalloc.start()
        with pytest.warns(RuntimeWarning, match=f"other.bin: {reason}"):
            short().run(table=other)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert peak < 64 << 20
        assert other.read_bytes() == start
