"""A table kept from study to study: the same outcomes, nothing solved twice, and bad files that cost only time."""

import subprocess
import sys

import numpy as np
import pytest

import tadcore
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


@pytest.mark.parametrize("content", [b"", b"not a table at all, but long enough to have a header and a checksum in it"])
def test_a_file_that_is_no_table_is_named_and_replaced(tmp_path, content):
    kept = tmp_path / "table.bin"
    kept.write_bytes(content)
    sc = tadcore.scenarios.load("paper-i1").replace({"horizon": 1.0, "step": 0.02})
    study = tadcore.Study(sc, vary=PLACES, trials=50, seed=4)
    with pytest.warns(RuntimeWarning, match="table.bin: the bytes are not a saved table"):
        study.run(table=kept)
    assert kept.read_bytes().startswith(b"tadtable")
