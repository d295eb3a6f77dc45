"""Runs saved and read back, bitwise; and files that are none."""

import contextlib
import dataclasses
import json
import math
import os
import shutil
import sys

import numpy as np
import pytest
import xarray as xr
from scipy.io import netcdf_file

import tadcore
from tadcore import ScenarioError
from tadcore.cli import main


@pytest.fixture(scope="module")
def run():
    return tadcore.simulate(tadcore.scenarios.load("paper-i1"))


def games():
    paper = tadcore.scenarios.load
    yield "variant", tadcore.simulate(paper("paper-i1"), hysteresis=0.02, dwell=0.1)
    yield "over at once", tadcore.simulate(paper("paper-i1").replace({"attacker.position": [0.0, 0.0]}))
    yield "unlimited sight", tadcore.simulate(paper("paper-i2").replace({"d*.visibility_radius": math.inf}))
    yield "time out", tadcore.simulate(paper("paper-i1").replace({"horizon": 0.5}))
    for name in tadcore.scenarios.names():
        yield name, tadcore.simulate(paper(name))


def assert_same(one, other):
    for field in dataclasses.fields(tadcore.Run):
        a, b = getattr(one, field.name), getattr(other, field.name)
        if isinstance(a, np.ndarray):
            assert (a.dtype, a.shape, a.tobytes()) == (b.dtype, b.shape, b.tobytes()), field.name
            assert b.flags.c_contiguous
        else:
            assert (type(a), a) == (type(b), b), field.name
            assert repr(a) == repr(b)  # a negative zero, too


@pytest.mark.parametrize("place", ["run.nc", "RUN.NC", "folder", "run-1.5", "deep/er/run.nc"])
def test_what_is_read_is_what_was_saved(tmp_path, place):
    for name, run in games():
        run.save(tmp_path / name / place)
        loaded = tadcore.load_run(tmp_path / name / place)
        assert_same(run, loaded)
        assert repr(loaded) == repr(run)
        assert loaded.dataset.identical(run.dataset)
        assert (tmp_path / name / place).is_file() == place.lower().endswith(".nc")


def test_a_loaded_run_does_what_a_run_does(tmp_path, run, agg):
    run.save(tmp_path / "run.nc")
    loaded = tadcore.load_run(str(tmp_path / "run.nc"))
    assert loaded.network_changes == run.network_changes
    assert loaded.plot.trajectories() is not None
    again = tmp_path / "again.nc"
    loaded.save(again)
    assert again.read_bytes() == (tmp_path / "run.nc").read_bytes()


def test_the_file_opens_without_tadcore(tmp_path, run):
    run.save(tmp_path / "run.nc")
    with netcdf_file(tmp_path / "run.nc", mmap=False) as file:
        assert np.array_equal(file.variables["position"][:], run.position)
        assert json.loads(file.run)["costs"] == run.costs
        assert tadcore.Scenario.from_toml_string(file.scenario.decode()) == run.scenario


def test_a_folder_that_is_there_may_have_any_name(tmp_path, run):
    folder = tmp_path / "results.json"
    folder.mkdir()
    run.save(folder)
    assert_same(run, tadcore.load_run(folder))


@pytest.mark.parametrize("name", ["run.json", "run.h5", "run.nc4", "run.zarr", "run.toml", "run.PKL", "run.csv"])
def test_other_formats_are_refused_by_name(tmp_path, run, name):
    with pytest.raises(ScenarioError, match=rf"path: got .*{name}', must be a name that ends in \.nc"):
        run.save(tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_a_folder_with_the_name_of_a_file_is_refused(tmp_path, run):
    (tmp_path / "run.nc").mkdir()
    with pytest.raises(IsADirectoryError, match=r"it is a folder.*run\.nc"):
        run.save(tmp_path / "run.nc")


@pytest.mark.parametrize("given", [None, 5, "", b"x", "a\0b", ["x"]])
def test_what_names_no_file_is_refused(run, given):
    for use in (run.save, tadcore.load_run):
        with pytest.raises(ScenarioError, match=r"must be a path"):
            use(given)


def changed(path, change):
    """The file written anew by xarray with something changed."""
    with xr.open_dataset(path, engine="scipy") as opened:
        data = opened.load()
    change(data).to_netcdf(path, engine="scipy", format="NETCDF3_64BIT")


def attribute(**entries):
    def change(data):
        return data.assign_attrs({"run": json.dumps(json.loads(data.attrs["run"]) | entries)})

    return change


def entry(name, index, value):
    def change(data):
        data[name].values[index] = value
        return data

    return change


def without(name):
    def change(data):
        del data.attrs[name]
        return data

    return change


DAMAGED = {
    "no record": (without("run"), "no attribute 'run'"),
    "no scenario": (without("scenario"), "damaged"),
    "no variable": (lambda data: data.drop_vars("gain"), "damaged.*gain"),
    "a row less": (lambda data: data.isel(player=slice(1, None)), "position.*shape"),
    "other type": (lambda data: data.assign(theta=data["theta"].astype("f4")), "theta.*float32"),
    "nan": (entry("position", (3, 1, 0), math.nan), "position.*finite"),
    "inf": (entry("gain", (0, 0, 0), math.inf), "gains.*finite"),
    "kind": (attribute(outcome={"kind": "won", "defender": None, "time": 1.0}), "damaged.*kind"),
    "defender": (attribute(outcome={"kind": "intercepted", "defender": 7, "time": 1.0}), "outcome.defender"),
    "nobody": (attribute(outcome={"kind": "intercepted", "defender": None, "time": 1.0}), "outcome.defender"),
    "somebody": (attribute(outcome={"kind": "timeout", "defender": 0, "time": 1.0}), "outcome.defender"),
    "costs": (attribute(costs=[1, 2]), "damaged.*dict"),
    "list": (lambda data: data.assign_attrs(run="[1]"), "damaged"),
    "text": (lambda data: data.assign_attrs(run="{"), "damaged"),
    "number": (lambda data: data.assign_attrs(run=7.0), "damaged"),
    "no field": (lambda data: data.assign_attrs(run="{}"), "damaged.*outcome"),
    "scenario": (lambda data: data.assign_attrs(scenario="horizon = -1"), "fields cannot be accepted"),
    "a bit": (entry("control", (9, 2, 1), np.nextafter(0.1, 1.0)), "content is not what was saved"),
    "time": (attribute(outcome={"kind": "intercepted", "defender": 0, "time": 1.4}), "content is not what was saved"),
    "cost": (attribute(costs={"defenders": 0.0, "target": 0.0, "attacker": 0.0}), "content is not what was saved"),
    "order": (lambda data: data.isel(time=slice(None, None, -1)), "times"),
    "empty": (lambda data: data.isel(time=slice(0, 0)), "times"),
}


@pytest.mark.parametrize("name", DAMAGED)
def test_a_file_that_was_changed_is_named(tmp_path, run, name):
    change, words = DAMAGED[name]
    path = tmp_path / "run.nc"
    run.save(path)
    changed(path, change)
    with pytest.raises(ScenarioError, match=f"(?s){words}"):
        tadcore.load_run(path)


def test_truncated_and_random_bytes_are_named(tmp_path, run):
    path = tmp_path / "run.nc"
    run.save(path)
    whole, rng = path.read_bytes(), np.random.default_rng(3)
    for data in [whole[:n] for n in (0, 2, 3, 4, 100, 1000, len(whole) // 2, len(whole) - 5)]:
        path.write_bytes(data)
        with pytest.raises(ScenarioError, match=r"run\.nc"):
            tadcore.load_run(path)
    for at in rng.integers(0, 6000, 300):
        data = bytearray(whole)
        data[at] ^= 1 << rng.integers(8)
        path.write_bytes(data)
        with contextlib.suppress(ScenarioError):
            assert_same(run, tadcore.load_run(path))


def test_what_is_no_run_is_named(tmp_path, run):
    (tmp_path / "empty").mkdir()
    (tmp_path / "text.nc").write_text("not a run", encoding="utf-8")
    tadcore.outcome_map(run.scenario.replace({"horizon": 0.5}), x=(0, 1, 2), y=(0, 1, 2)).save(tmp_path / "map.nc")
    for name, words in (
        ("empty", "No such file"),
        ("nowhere.nc", "No such file"),
        ("text.nc", "another kind"),
        ("map.nc", "no attribute 'run'"),
    ):
        with pytest.raises(ScenarioError, match=f"{name}: got .*{words}"):
            tadcore.load_run(tmp_path / name)
    if sys.platform != "win32":
        os.mkfifo(tmp_path / "pipe.nc")
        with pytest.raises(ScenarioError, match="a pipe"):
            tadcore.load_run(tmp_path / "pipe.nc")


def test_the_command_writes_one_file_too(tmp_path, run, capsys):
    main_done(["simulate", "paper-i1", "--out", str(tmp_path / "run.nc")])
    assert_same(run, tadcore.load_run(tmp_path / "run.nc"))
    with pytest.raises(SystemExit, match="2"):
        main(["simulate", "paper-i1", "--plot", "--out", str(tmp_path / "other.nc")])
    assert "--out: got" in capsys.readouterr().err
    shutil.rmtree(tmp_path)


def main_done(arguments):
    with pytest.raises(SystemExit) as caught:
        main(arguments)
    assert caught.value.code in (0, None)
