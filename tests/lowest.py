"""Every part of the package once, under the lowest versions that `pyproject.toml` declares; `make lowest` runs it.

Without arguments: `requirements` prints those versions, for pip. With them installed: one call of each part, in this
process and on the command line, whose results are compared with what the paper and arithmetic say.
"""

from __future__ import annotations

import contextlib
import io
import pickle
import re
import sys
import tempfile
import tomllib
import warnings
from importlib import metadata
from pathlib import Path

ROOT = Path(__file__).parent.parent
EXTRAS = ("explore", "bounds")


def lowest() -> dict[str, str]:
    """The lowest version of every dependency, those of some extras included, by name."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = project["optional-dependencies"]
    lines = [*project["dependencies"], *(line for extra in EXTRAS for line in extras[extra])]
    found = (re.match(r"([\w-]+)>=([\d.]+)", line) for line in lines)
    return {match[1]: match[2] for match in found if match}


def command(*arguments: str, code: int = 0) -> str:
    """What the command line prints, on both streams."""
    from tadcore.cli import main

    printed = io.StringIO()
    left: object = None
    with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
        try:
            main(list(arguments))
        except SystemExit as gone:
            left = gone.code
    assert (left or 0) == code, (arguments, left, printed.getvalue())
    return printed.getvalue()


def check_command_line(folder: Path) -> None:
    study = folder / "study.toml"
    study.write_text(
        'scenario = "paper-i1"\ntrials = 300\n[vary]\n"attacker.position" = { box = [[-3, -3], [3, 3]] }\n'
        '"d1.visibility_radius" = { scipy = "uniform", loc = 1, scale = 4 }\n',
        encoding="utf-8",
    )
    for name in ("simulate", "study", "map", "report", "reproduce", "verify", "scenarios", "validate", "explore"):
        assert "Usage: tadcore" in command(name, "--help")
    assert "simulate" in command("--help")
    assert command("--version").startswith("tadcore ")
    assert "paper-i1: valid" in command("validate", "paper-i1")
    assert "No such option" in command("validate", "paper-i1", "--colour", code=2)
    assert "did you mean" in command("validate", "paper-i3", code=2)
    played = command(
        "simulate", "paper-i1", "--set", "d1.visibility_radius=5.0", "--out", str(folder / "run"), "--plot"
    )
    assert "d1 intercepts the attacker at t = 1.395" in played
    assert "written to" in command("map", "paper-i1", "--size", "5", "--out", str(folder / "map.png"))
    assert "300 trials" in command("study", str(study), "--store", str(folder / "store"))
    assert "written to" in command("report", str(folder / "store"), "--out", str(folder / "page.html"))
    assert (folder / "page.html").stat().st_size > 100_000


def check_results(folder: Path) -> None:
    import numpy as np
    import xarray as xr

    import tadcore
    from tadcore import plotting, sampling
    from tadcore.explorer import Explorer, Page

    sc = tadcore.scenarios.load("paper-i1")
    assert tadcore.Scenario.from_toml_string(sc.to_toml()) == sc == pickle.loads(pickle.dumps(sc))
    run = tadcore.simulate(sc)
    assert str(run.outcome) == "d1 intercepts the attacker at t = 1.395"
    with xr.open_dataset(folder / "run" / "run.nc", engine="scipy") as saved:
        np.testing.assert_array_equal(saved["position"].values, run.position)
    assert tadcore.solve_equilibrium(sc).max_residual < 1e-9
    result = tadcore.load_study(folder / "store")
    assert sum(result.counts().values()) == result.trials == len(result.to_pandas()) == 300
    probabilities = result.probabilities()
    assert "captured" in repr(probabilities)
    assert "captured" in repr(result.incidence())
    short = sc.replace({"horizon": 0.5, "step": 0.05})
    study = tadcore.Study(short, vary={"attacker.position": sampling.Box(-3, 3)}, trials=40)
    bound = tadcore.verification.theta_bound(short, step=2, adjacency=1 - np.eye(3, 4))
    assert bound.value <= bound.theta * (1.0 + 1e-6)
    page = Page(Explorer(short))
    page.change(lambda: page.explorer.see("d1", 0.01))
    assert "must be larger than the capture radius" in page.status.text
    swept = tadcore.sweep(study, {"d1.visibility_radius": [0.5, 5.0]}).to_xarray()
    assert swept.sel({"d1.visibility_radius": 5.0})["trials"] == 40
    curve = tadcore.radius_curve(study.run(), player="d1", radii=[1.0, 2.0])
    outcomes = tadcore.outcome_map(short, x=(-2, 2, 5), y=(-2, 2, 5))
    with plotting.style():
        axes = [run.plot.trajectories(), run.plot.visibility(), run.plot.controls(), run.plot.gains(), run.plot.theta()]
        axes += [run.plot.network(), plotting.compare(run, run), plotting.incidence(result.incidence())]
        axes += [plotting.outcome_probabilities(probabilities), plotting.radius_curve(curve), outcomes.plot()]
        axes += [plotting.outcomes_by_input(result, "d1.visibility_radius")]
        for number, drawn in enumerate(axes):
            figure = np.asarray(drawn, dtype=object).flat[0].figure
            plotting.save(figure, folder / f"figure-{number}", formats=["png", "svg"], dpi=60)
    animation = run.animate(seconds=0.3, fps=10, width=3.0)
    for suffix in ("gif", "html"):
        assert animation.save(folder / f"run.{suffix}", dpi=40, progress=False).stat().st_size > 5_000


def main() -> None:
    """Print the requirements, or check everything."""
    wanted = lowest()
    if sys.argv[1:] == ["requirements"]:
        print(*(f"{name}=={version}" for name, version in wanted.items()), sep="\n")
        return
    if sys.argv[1:] != ["newest"]:
        for name, version in wanted.items():
            found = metadata.version(name)
            assert (found + ".0.0").startswith(version + ".") or found == version, f"{name} {found}, not {version}"
    warnings.simplefilter("ignore")  # of old versions about old versions
    with tempfile.TemporaryDirectory() as folder:
        check_command_line(Path(folder))
        check_results(Path(folder))
    print("every part works with", ", ".join(f"{name} {metadata.version(name)}" for name in wanted))


if __name__ == "__main__":
    main()
