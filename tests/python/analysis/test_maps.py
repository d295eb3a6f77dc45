"""Outcome maps: against single runs, in blocks, and as files."""

import matplotlib as mpl
import numpy as np
import pytest
import xarray as xr

import tadcore
from tadcore import ScenarioError, outcome_map
from tadcore.analysis import maps
from tadcore.cli.app import main


@pytest.fixture(scope="module", autouse=True)
def _agg():
    before = mpl.get_backend()
    mpl.use("Agg")
    yield
    mpl.use(before)


@pytest.fixture(scope="module")
def sc():
    return tadcore.scenarios.load("paper-i1")


@pytest.mark.parametrize(("player", "field"), [("attacker", "attacker"), ("target", "target"), ("d2", "defenders[1]")])
def test_every_place_is_a_game(sc, player, field):
    found = outcome_map(sc, player, x=(-2, 1, 4), y=(0.5, 2.5, 3))
    assert found.dataset["kind"].dims == ("y", "x")
    assert found.dataset["kind"].shape == (3, 4)
    assert (found.dataset["kind"].dtype, found.dataset["defender"].dtype) == (np.int8, np.int32)
    for x in found.dataset["x"].values:
        for y in found.dataset["y"].values:
            alone = tadcore.simulate(sc.replace({f"{field}.position": (x, y)})).outcome
            here = found.dataset.sel(x=x, y=y)
            one = tadcore.Outcome.of(int(here["kind"]), int(here["defender"]), float(here["time"]))
            assert one == alone
    assert sum(found.counts().values()) == 12


def test_blocks_change_nothing(sc, monkeypatch):
    whole = outcome_map(sc, x=(-3, 3, 11), y=(-2, 2, 7), threads=1)
    monkeypatch.setattr(maps, "BLOCK", 10)
    parts = outcome_map(sc, x=(-3, 3, 11), y=(-2, 2, 7), threads=2)
    assert whole.dataset.identical(parts.dataset)


def test_a_map_in_space_is_a_plane_at_a_height(sc):
    lifted = sc.replace(
        {
            "attacker.position": (-2, 2, 0),
            "target.position": (0, 1, 0),
            **{f"defenders[{i}].position": (*d.position, 0) for i, d in enumerate(sc.defenders)},
        }
    )
    flat, own = outcome_map(sc, x=(-3, 3, 5), y=(-3, 3, 5)), outcome_map(lifted, x=(-3, 3, 5), y=(-3, 3, 5))
    assert np.array_equal(flat.dataset["kind"], own.dataset["kind"])
    assert own.dataset.attrs["z"] == 0.0
    high = outcome_map(lifted, x=(0, 0, 1), y=(1, 1, 1), z=2.0)
    alone = tadcore.simulate(lifted.replace({"attacker.position": (0, 1, 2)})).outcome
    assert float(high.dataset["time"][0, 0]) == alone.time
    with pytest.raises(ScenarioError, match="must be left out"):
        outcome_map(sc, z=1.0)


@pytest.mark.parametrize(
    ("options", "name"),
    [
        ({"player": "d4"}, "player"),
        ({"x": (1, -1, 5)}, "x"),
        ({"x": (1, 1, 5)}, "x"),
        ({"y": (0, 1, 1)}, "y"),
        ({"y": (0, np.inf, 5)}, "y"),
        ({"y": (0, 1)}, "y"),
        ({"y": 5}, "y"),
        ({"x": (0, 1, 0)}, "x[2]"),
        ({"x": (0, 1, 2.0)}, "x[2]"),
        ({"threads": 0}, "threads"),
    ],
)
def test_what_is_no_map_is_refused(sc, options, name):
    with pytest.raises(ScenarioError) as caught:
        outcome_map(sc, **options)
    assert caught.value.field == name


def test_files_can_be_read_again(sc, tmp_path):
    found = outcome_map(sc, x=(-3, 3, 5), y=(-3, 3, 4))
    back = xr.load_dataset(found.save(tmp_path / "new" / "map.nc"), engine="scipy")
    xr.testing.assert_equal(back, found.dataset)
    assert tadcore.Scenario.from_toml_string(back.attrs["scenario"]) == sc
    assert found.save(tmp_path / "map.png").read_bytes().startswith(b"\x89PNG")
    assert found.save(tmp_path / "map.svg").read_text(encoding="utf-8").startswith("<?xml")
    for name in ("map.csv", "map"):
        with pytest.raises(ScenarioError, match="path"):
            found.save(tmp_path / name)


def leave(*arguments):
    with pytest.raises(SystemExit) as left:
        main([str(argument) for argument in arguments])
    return left.value.code or 0


def test_the_command_line_draws_and_saves(tmp_path, capsys):
    for name in ("map.png", "map.nc"):
        out = tmp_path / name
        assert leave("map", "paper-i1", "--x", -3, 3, "--y", -3.5, 3, "--size", 12, "--out", out) == 0
        assert out.stat().st_size > 1000
    printed = capsys.readouterr()
    assert "156 places" in printed.out
    assert printed.err == ""
    data = xr.load_dataset(tmp_path / "map.nc", engine="scipy")
    assert data["y"].values[[0, -1]].tolist() == [-3.5, 3.0]


@pytest.mark.parametrize(
    "arguments",
    [
        ("map", "paper-i1", "--out", "map.txt"),
        ("map", "paper-i1", "--player", "d7", "--out", "map.png"),
        ("map", "paper-i1", "--size", "0", "--out", "map.png"),
        ("map", "no-such", "--out", "map.png"),
        ("map", "paper-i1"),
    ],
)
def test_the_command_line_refuses(arguments, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert leave(*arguments) == 2
    assert "Traceback" not in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
