"""What stores look like to readers that know nothing of tadcore, and parts that no study wrote."""

import hashlib
import json
import math
import re
import shutil
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.dataset as ds
import pyarrow.parquet as pq
import pytest

import tadcore
from study_cases import CHUNK, calm, part, parts, study
from tadcore import OutcomeKind, StoreError

NAMES = ["timeout", "captured", "d1", "d2", "d3", "diverged"]


@pytest.fixture(autouse=True, scope="module")
def small_parts():
    """A part for every chunk, so that a store of a few chunks has several."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("tadcore.study.parts.GROUP", 1)
        yield


@pytest.fixture(scope="module")
def clean(tmp_path_factory):
    """A store of two parts, in a folder whose name looks like a partition."""
    folder = tmp_path_factory.mktemp("stores") / "seed=7"
    return study(CHUNK + 500).run(store=folder), folder


@pytest.fixture
def copied(clean, tmp_path):
    return Path(shutil.copytree(clean[1], tmp_path / "store"))


def words(result):
    """How every game ended, from its codes, one by one."""
    ends = zip(result.kind, result.defender, result.diverged, strict=True)
    return [
        "diverged" if lost else f"d{d + 1}" if kind == OutcomeKind.INTERCEPTED else OutcomeKind(kind).name.lower()
        for kind, d, lost in ends
    ]


def test_outcomes_are_words(clean):
    result, folder = clean
    assert set(words(result)) >= {"timeout", "captured", "d1", "d2"}
    for one in (result, tadcore.load_study(folder)):
        assert one.table["outcome"].to_pylist() == words(one)
        frame = one.to_pandas()
        assert list(frame["outcome"].cat.categories) == NAMES
        assert frame["outcome"].tolist() == words(one)
        assert frame.groupby("outcome", observed=False).size()["captured"] == one.counts()["captured"]


def as_frame(folder):
    pandas = pytest.importorskip("pandas")
    return pandas.read_parquet(folder)


def as_dataset(folder):
    return ds.dataset(folder).to_table().to_pandas()


def as_table(folder):
    return pq.read_table(folder).to_pandas()


def as_dask(folder):
    return pytest.importorskip("dask.dataframe").read_parquet(folder).compute()


@pytest.mark.parametrize("read", [as_frame, as_dataset, as_table, as_dask])
def test_a_folder_is_one_table(clean, read, recwarn):
    result, folder = clean
    frame = read(folder).sort_values("trial")
    assert frame["trial"].tolist() == list(range(result.trials))
    assert list(frame["outcome"].cat.categories) == NAMES
    assert frame["outcome"].tolist() == words(result)
    assert np.array_equal(frame["time"], result.time)
    assert np.array_equal(frame["attacker.position.x"], result.inputs["attacker.position.x"])


def test_polars_and_duckdb_read_the_parts(clean):
    result, folder = clean
    polars = pytest.importorskip("polars")
    frame = polars.read_parquet(folder / "*.parquet").sort("trial")
    assert frame["outcome"].cast(polars.String).to_list() == words(result)
    assert result.to_polars()["outcome"].cast(polars.String).to_list() == words(result)
    duckdb = pytest.importorskip("duckdb")
    for place in (folder, folder / "*.parquet"):
        counted = duckdb.sql(f"select outcome, count(*) from read_parquet('{place}') group by outcome").fetchall()
        assert dict(counted) == {name: words(result).count(name) for name in set(words(result))}


def test_a_part_explains_itself(clean):
    result, folder = clean
    schema = pq.read_schema(folder / part(1, 500))
    about = {key.decode(): value.decode() for key, value in schema.metadata.items()}
    assert about["tadcore_version"] == tadcore.__version__
    assert (about["tadcore_seed"], about["tadcore_design"], about["tadcore_first"]) == ("7", "random", "8192")
    assert tadcore.Scenario.from_toml_string(about["tadcore_scenario"]) == result.scenario
    columns = json.loads(about["tadcore_columns"])
    assert list(columns) == schema.names == result.table.schema.names
    for field in schema:
        assert {key.decode(): value.decode() for key, value in field.metadata.items()} == columns[field.name]
        assert columns[field.name]["meaning"]
        assert (columns[field.name].get("unit") == "1") == (field.type == pa.float64())
    for kind in OutcomeKind:
        assert f"{kind.value} {kind.name.lower()}" in columns["kind"]["meaning"]
    assert result.table.schema.equals(tadcore.load_study(folder).table.schema, check_metadata=True)


def test_a_store_of_an_earlier_format_is_named(clean, tmp_path):
    old = Path(shutil.copytree(clean[1], tmp_path / "old"))
    (old / "_manifest.json").rename(old / "manifest.json")
    before = parts(old)
    for use in (tadcore.load_study, lambda folder: study().run(store=folder)):
        with pytest.raises(
            StoreError, match=r"manifest\.json: it has format 1 or 2, and this version of tadcore reads 4"
        ):
            use(old)
    assert parts(old) == before


def written_anew(path, change):
    """A part with some columns changed, its rows and digest made right by hand."""
    table = pq.read_table(path, partitioning=None)
    columns = {name: table[name].to_numpy(zero_copy_only=False).copy() for name in table.column_names}
    change(columns)
    arrays = [pa.array(columns[field.name], field.type) for field in table.schema]
    digest = hashlib.sha256()
    for name, array in zip(table.column_names, arrays, strict=True):
        if name != "outcome":
            digest.update(array.to_numpy(zero_copy_only=False).tobytes())
    metadata = {**table.schema.metadata, b"tadcore_sha256": digest.hexdigest().encode()}
    pq.write_table(pa.Table.from_arrays(arrays, schema=table.schema.with_metadata(metadata)), path)


def put(name, value):
    def change(columns):
        columns[name][41] = value

    return change


def put_outcome(kind, defender, time=None):
    def change(columns):
        columns["kind"][41], columns["defender"][41] = kind, defender
        if time is not None:
            columns["time"][41] = time
        columns["outcome"][41] = f"d{defender + 1}" if kind == 2 else ["timeout", "captured"][kind]

    return change


FORGED = {
    "kind 99": (put("kind", 99), "kind 99"),
    "kind -1": (put("kind", -1), "kind -1"),
    "kind 3": (put("kind", 3), "kind 3"),
    "a defender beyond": (put_outcome(2, 3), "defender 3"),
    "no defender": (put("defender", -7), "defender -7"),
    "a defender without": (put_outcome(0, 1, 1.0), "defender 1"),
    "nan": (put("time", math.nan), "time nan"),
    "inf": (put("time", math.inf), "time inf"),
    "before": (put("time", -0.05), "time -0.05"),
    "beyond": (put_outcome(1, -1, 1.05), "time 1.05"),
    "between": (put_outcome(1, -1, 0.07), "time 0.07"),
    "early": (put_outcome(0, -1, 0.5), "time 0.5"),
    "trial": (put("trial", 40), "trial 40"),
    "diverged": (put("diverged", True), "outcome '"),
    "word": (put("outcome", "d9"), "outcome 'd9'"),
    "nan input": (put("attacker.position.x", math.nan), "attacker.position.x, trial .*: got nan"),
    "far input": (put("attacker.position.y", 1e101), r"attacker.position.y, trial .*: got 1e\+101"),
    "radius": (put("defenders.0.visibility_radius", -1.0), "visibility_radius, trial .*: got -1.0"),
    "short sight": (put("defenders.0.visibility_radius", 0.01), "visibility_radius, trial .*: got 0.01"),
}


@pytest.mark.parametrize("name", FORGED)
@pytest.mark.parametrize("chunk", [0, 1])
def test_a_part_that_no_study_wrote_is_named(copied, name, chunk):
    change, found = FORGED[name]
    path = copied / part(chunk, (CHUNK, 500)[chunk])
    written_anew(path, change)
    for use in (tadcore.load_study, lambda folder: study(CHUNK + 500).run(store=folder)):
        with pytest.raises(StoreError, match=rf"no outcomes of this study \(.*{found}") as caught:
            use(copied)
        assert caught.value.path == str(path)
    assert re.search(f"{chunk * CHUNK + 41:,}", str(caught.value))


def test_a_part_written_anew_without_a_change_is_read(copied, clean):
    written_anew(copied / part(0), lambda columns: None)
    loaded = tadcore.load_study(copied)
    assert loaded.table.equals(clean[0].table)
    assert list(loaded.to_pandas()["outcome"].cat.categories) == NAMES


def test_a_part_without_words_is_named(copied):
    path = copied / part(0)
    table = pq.read_table(path)
    place = table.schema.get_field_index("outcome")
    field = pa.field("outcome", pa.string(), nullable=False)
    pq.write_table(table.set_column(place, field, table["outcome"].cast(pa.string())), path)
    with pytest.raises(StoreError, match=rf"{part(0)}: its columns are"):
        tadcore.load_study(copied)


DIVIDES_ALMOST = (1.0, 1.0 / 5000 * (1.0 + 5e-10))


@pytest.mark.parametrize(("horizon", "step"), [(0.3, 0.1), (1.3, 0.1), (1.0, 1.0), (2.1, 0.07), DIVIDES_ALMOST])
def test_every_end_of_a_real_study_is_accepted(tmp_path, horizon, step):
    """Also on grids on which k·δ is not the nearest double."""
    result = study(500, sc=calm().replace({"horizon": horizon, "step": step})).run(store=tmp_path)
    assert tadcore.load_study(tmp_path).table.equals(result.table)
