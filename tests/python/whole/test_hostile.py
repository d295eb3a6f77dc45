"""Files from a stranger, as SECURITY.md promises: none runs code, writes elsewhere or takes memory by what it says."""

import contextlib
import pickle
import struct
import sys
import zlib
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import tadcore
from study_cases import CHUNK, calm, part, resealed, study
from tadcore import ScenarioError, StoreError
from tadcore.game.compiled import game_of
from tadcore.study.manifest import Manifest

SOURCES = Path(tadcore.__file__).parent


@pytest.fixture
def store(tmp_path):
    study(300).run(store=tmp_path / "store")
    return tmp_path / "store"


def test_the_seal_of_this_test_is_that_of_the_store(store):
    resealed(store, trials=299)
    assert tadcore.load_study(store).trials == 299


class Trap:
    """An object that touches a file when it is unpickled."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return Path.touch, (self.path,)


def test_nothing_that_is_read_back_is_unpickled(store, tmp_path):
    """Arrow's old extension type of Python carries a pickle in the schema of a Parquet file."""
    sprung = tmp_path / "sprung"
    path = store / part(0, 300)
    table = pq.read_table(path)
    trap = {
        b"ARROW:extension:name": b"arrow.py_extension_type",
        b"ARROW:extension:metadata": pickle.dumps(Trap(sprung)),
    }
    fields = [f.with_metadata(trap) if f.name == "time" else f for f in table.schema]
    pq.write_table(pa.Table.from_arrays(table.columns, schema=pa.schema(fields, table.schema.metadata)), path)
    with contextlib.suppress(StoreError):
        tadcore.load_study(store)
    assert not sprung.exists()
    # The one module that names pickle asks whether a user's own callable can travel; it reads nothing back.
    named = {p.name for p in SOURCES.rglob("*.py") if "pickle." in p.read_text(encoding="utf-8")}
    assert named == {"workers.py"}
    text = (SOURCES / "study" / "workers.py").read_text(encoding="utf-8")
    assert "pickle.load" not in text


def test_no_source_evaluates_text():
    for path in SOURCES.rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        for word in (
            "eval(",
            "exec(",
            "os.system",
            "subprocess",
            "yaml.",
            "marshal",
            "shelve",
            "np.load(",
            "allow_pickle",
        ):
            assert word not in text or (word == "eval(" and ".eval(" in text), f"{path.name}: {word}"


def test_a_manifest_that_names_a_callable_imports_nothing(store, tmp_path, monkeypatch):
    (tmp_path / "stranger.py").write_text("from pathlib import Path\nPath(__file__).with_name('ran').touch()\n")
    monkeypatch.syspath_prepend(tmp_path)
    resealed(store, vary={"attacker.position": {"callable": "stranger.draw", "draws": "0"}})
    with pytest.raises(StoreError, match="its columns are"):
        tadcore.load_study(store)  # a store of that study has fewer; the callable was looked at before
    assert "stranger" not in sys.modules
    assert not (tmp_path / "ran").exists()


@pytest.mark.parametrize(
    "sampler", [{"scipy": "os.system"}, {"scipy": "__class__"}, {"eval": "1"}, {"scipy": ["norm"]}]
)
def test_a_manifest_names_only_distributions(store, sampler):
    resealed(store, vary={"attacker.position": sampler})
    with pytest.raises(ScenarioError, match=r"vary\[\"attacker\.position\"\]"):
        tadcore.load_study(store)


@pytest.mark.parametrize(
    "text",
    ["[" * 100_000, '{"format": ' * 5000, "[]", "7", '{"format": 4, "seed": Infinity}', "{}", "\x00", "1" * 5000],
    ids=["deep list", "deep table", "list", "number", "infinite", "empty", "nul", "digits"],
)
def test_no_manifest_is_worse_than_refused(store, text):
    (store / "_manifest.json").write_text(text, encoding="utf-8")
    with pytest.raises(StoreError, match="no manifest of a study"):
        Manifest.read(store)


def test_what_is_infinite_or_huge_in_a_manifest_is_refused(store):
    for changes in ({"seed": float("inf")}, {"seed": -1}, {"trials": 10**30}, {"design": "../../x"}, {"chunk": 2**50}):
        original = (store / "_manifest.json").read_text(encoding="utf-8")
        resealed(store, **changes)
        with pytest.raises((StoreError, ScenarioError)):
            tadcore.load_study(store)
        (store / "_manifest.json").write_text(original, encoding="utf-8")


def test_rows_are_bounded_by_this_version_and_not_by_the_file(store):
    """A million equal rows take some kilobytes on disk: they are refused by their number, before they are read."""
    path = store / part(0, 300)
    about = pq.read_schema(path).metadata | {b"tadcore_rows": b"1000000"}
    table = pq.read_table(path).slice(0, 1).replace_schema_metadata(about)
    many = pa.Table.from_arrays([pa.repeat(c[0], 1_000_000) for c in table.columns], schema=table.schema)
    pq.write_table(many, path, compression="zstd")
    assert path.stat().st_size < 100_000
    with pytest.raises(StoreError, match="it has 1000000 rows"):
        tadcore.load_study(store)


def test_no_byte_of_a_manifest_can_change_unseen(store):
    """Every byte with each of its bits flipped, as another digit, left out and doubled: refused, or nothing changed."""
    whole = (store / "_manifest.json").read_bytes()
    manifest, harmless = Manifest.read(store), 0
    for at, byte in enumerate(whole):
        before, after = whole[:at], whole[at + 1 :]
        others = [bytes([byte ^ 1 << bit]) for bit in range(8)]
        others += [b"%d" % digit for digit in range(10) if chr(byte).isdigit() and byte != ord("0") + digit]
        for other in (*others, b"", bytes([byte, byte])):
            try:
                assert Manifest.from_json(before + other + after, "_manifest.json") == manifest
            except StoreError:
                continue
            harmless += 1
            assert chr(byte) in " \n0", f"byte {at}: {byte} as {other}"  # spaces, and a nought after a nought: 0.00
    assert 0 < harmless < len(whole) / 2


def test_no_bit_of_a_part_can_flip_unseen(store):
    """Parquet has no checksum on its footer, where a flipped bit can turn one column into another."""
    rng, path = np.random.default_rng(12), store / part(0, 300)
    whole, table = path.read_bytes(), tadcore.load_study(store).table
    footer = 8 * (len(whole) - 8 - int.from_bytes(whole[-8:-4], "little"))
    bits = [*rng.integers(0, footer, 60), *rng.integers(footer, 8 * len(whole), 240)]
    refused = 0
    for bit in bits:
        data = bytearray(whole)
        data[bit // 8] ^= 1 << bit % 8
        path.write_bytes(data)
        try:
            assert tadcore.load_study(store).table.equals(table)
        except StoreError:
            refused += 1
    assert refused > 100


def test_numbers_that_were_changed_with_care_are_found(store):
    """Written anew by a Parquet library, with the metadata kept and right checksums: the digest of the rows tells."""
    path = store / part(0, 300)
    table = pq.read_table(path)
    time = table["time"].to_numpy().copy()
    time[7] = np.nextafter(time[7], 2.0)
    index = table.schema.get_field_index("time")
    pq.write_table(table.set_column(index, table.schema.field(index), pa.array(time)), path, write_page_checksum=True)
    with pytest.raises(StoreError, match="its rows are not those that were written"):
        tadcore.load_study(store)


@pytest.mark.parametrize("name", ["_store.lock", part(1, 300), ".tadcore-a.parquet", "_manifest.json"])
@pytest.mark.parametrize("there", [True, False])
def test_links_out_of_a_store_are_not_written_through(store, tmp_path, name, there):
    victim = tmp_path / "victim"
    if there:
        victim.write_text("precious", encoding="utf-8")
    (store / name).unlink(missing_ok=True)
    (store / name).symlink_to(victim)
    with contextlib.suppress(StoreError):
        study(CHUNK + 50).run(store=store)
    assert victim.exists() == there
    assert not there or victim.read_text(encoding="utf-8") == "precious"


def sealed(table):
    """The checksum at the end of a saved table."""
    return struct.pack("<Q", zlib.crc32(table))


@pytest.mark.parametrize(
    ("word", "value"),
    [
        (4, 2**63),  # the number of entries
        (5, 2**40),  # the step of the first entry
        (6, 2**63),  # its key: bits beyond the network's
        (6, 2**12),
        (7, 0x7FF8000000000000),  # its first number: NaN
        (20, 0x7FF0000000000000),  # infinity
    ],
)
def test_a_saved_table_with_a_right_checksum_is_still_not_believed(word, value):
    sc = calm()
    tadcore.simulate_batch(sc, [sc.positions])
    table = bytearray(game_of(sc).save_table())
    assert sealed(table[:-8]) == table[-8:]
    # Behind the header's five words stands the game's identity, of which the fourth says how long it is.
    at = 8 * word + (struct.unpack_from("<Q", table, 24)[0] if word >= 5 else 0)
    table[at : at + 8] = struct.pack("<Q", value)
    table[-8:] = sealed(table[:-8])
    said = "a table of this game has at most" if (word, value) == (4, 1 << 63) else "damaged"
    with pytest.raises(ValueError, match=said):
        game_of(sc).load_table(bytes(table))
