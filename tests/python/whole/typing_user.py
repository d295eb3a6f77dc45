"""A user's script, checked by ``mypy --strict`` and pyright: what one writes in a first hour, with every type said."""

from pathlib import Path
from typing import Any, assert_type

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from numpy.typing import NDArray

import tadcore
from tadcore import plotting
from tadcore.game import Recorded


def make() -> tadcore.Scenario:
    """Describe a game by keywords, with the parts as models and as tables."""
    return tadcore.Scenario(
        interaction="I1",
        horizon=4.0,
        step=0.01,
        attacker=tadcore.Attacker(position=(2.0, 1.0), control_weight=0.8, capture_radius=0.1),
        target=tadcore.Target(position=(0.0, 0.0), control_weight=1.2),
        defenders=(
            tadcore.Defender(position=(-1.0, 0.0), control_weight=1.0, capture_radius=0.1, visibility_radius=2.0),
        ),
    )


def play(sc: tadcore.Scenario) -> tuple[str, float]:
    """Run a game and look at everything a run has."""
    run = tadcore.simulate(sc)
    assert_type(run, tadcore.Run)
    assert_type(run.times, NDArray[np.float64])
    assert_type(run.adjacency, NDArray[np.bool_])
    assert_type(run.costs, dict[str, float])
    assert_type(run.converged, bool)
    recorded: Recorded = run
    assert_type(recorded.position, NDArray[np.float64])
    data: xr.Dataset = run.dataset
    nearest = float(data["distance"].sel(player="d1").min())
    for change in run.network_changes:
        assert_type(change, tadcore.NetworkChange)
        assert_type(change.time, float)
        for observer, seen in change.added:
            print(f"{observer} sees {seen} from {change.time}")
    if run.outcome.kind == "intercepted" and run.outcome.defender is not None:
        print(f"d{run.outcome.defender + 1}")
    return str(run.outcome), nearest


def solve(sc: tadcore.Scenario) -> float:
    """Take the pieces one by one."""
    equilibrium = tadcore.solve_equilibrium(sc)
    assert_type(equilibrium.P["defenders"], NDArray[np.float64])
    network = tadcore.VisibilityNetwork.from_positions(sc)
    gains = tadcore.synthesize(sc, step=0, adjacency=network, method="newton")
    assert_type(gains.rows, NDArray[Any])  # complex where gains turn
    assert_type(gains.theta, float)
    return gains.theta + equilibrium.max_residual


def many(sc: tadcore.Scenario, count: int) -> dict[str, int]:
    """Play a batch."""
    rng = np.random.default_rng(0)
    starts = sc.positions + rng.normal(size=(count, *sc.positions.shape))
    batch = tadcore.simulate_batch(sc, starts, capture_radii=[0.1, 0.2], threads=1)
    assert_type(batch.kind, NDArray[np.int8])
    assert_type(batch[0], tadcore.Outcome)
    assert_type(batch[:2], tadcore.Batch)
    return batch.counts()


def draw(sc: tadcore.Scenario, folder: Path) -> list[Path]:
    """Draw into axes of one's own, as methods and as functions."""
    run = tadcore.simulate(sc)
    _, ax = plt.subplots()
    assert_type(plotting.trajectories(run, ax), Axes)
    assert_type(run.plot.controls(axis="y"), Axes)
    assert_type(run.plot.visibility(ax=ax), Axes)
    assert_type(plotting.compare(run, run, what="distances"), Axes)
    run.plot.network()
    with plotting.style():
        figure = run.plot.theta().get_figure(root=True)
    assert figure is not None
    return [
        *plotting.save(figure, folder / "theta", formats=["svg"]),
        run.animate(seconds=0.2, fps=5).save(folder / "a.gif"),
    ]


def main(folder: Path) -> None:
    """Do all of it, errors included."""
    sc = make()
    sc.to_toml(folder / "mine.toml")
    again = tadcore.Scenario.from_toml(folder / "mine.toml")
    assert_type(again, tadcore.Scenario)
    near = again.replace({"defenders[0].visibility_radius": 1.0}, horizon=3.0)
    assert_type(near, tadcore.Scenario)
    try:
        print(*play(near), solve(near), many(near, 5), *draw(near, folder))
    except tadcore.NoEquilibriumError as error:
        print(error.escape_time, error.longest_horizon)
    except tadcore.ScenarioError as error:
        print(error.field, error.value, error.rule)
