"""Make paper_runs.json: the eight runs of section 6 as the oracle of tests/python plays them.

    python tests/reference/paper_runs.py

For every run: kind, defender, last step, steps of the network changes with the network (numbers as in
random_games.py), positions at every 20th step and at the end, Theta there, and the costs.
"""

import json
import sys
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent / "python"))

from oracle import search  # noqa: E402
from oracle.costs import costs  # noqa: E402
from oracle.model import paper_cases  # noqa: E402
from oracle.network import number  # noqa: E402
from oracle.stepping import Gains, simulate  # noqa: E402


def entry(case):
    run = simulate(case.game, case.start, Gains(case.game))
    steps = sorted({*range(0, run.step, 20), run.step})
    return {
        "name": case.name,
        "kind": run.kind,
        "defender": run.defender,
        "step": run.step,
        "changes": [k for k, _ in run.changes],
        "networks": [number(A) for _, A in run.changes],
        "steps": steps,
        "positions": [np.round(run.positions[k], 12).tolist() for k in steps],
        "theta": [float(f"{run.found[k].theta:.13g}") for k in steps[:-1]],
        "costs": np.round(costs(case.game, run), 12).tolist(),
        "improved": sum(f.second_look or f.missed for f in run.found),
        "margin": float(f"{run.margin:.2g}"),
    }


if __name__ == "__main__":
    search.compile_with_numba()
    lines = ",\n".join(json.dumps(entry(case), separators=(",", ":")) for case in paper_cases())
    text = '{"about": "made by paper_runs.py; see there", "runs": [\n' + lines + "\n]}\n"
    (HERE / "paper_runs.json").write_text(text, encoding="utf-8")
