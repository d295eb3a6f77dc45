"""One study of 10⁹ games, from an empty store to its probabilities: time, memory, bytes and counts.

    python benches/billion.py --trials 1000000000 --threads 2 --store DIR

The game is the paper's first interaction with limited sight, every start uniform in [−3, 3]², of which each trial keeps
its outcome. The gain table is empty when the clock starts.
"""

from __future__ import annotations

import argparse
import json
import resource
import sys
import time
from pathlib import Path

from tadcore import Study, load_study, scenarios
from tadcore.sampling import Box


def main() -> None:
    """Run the study, open its store again and print what both took."""
    ask = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ask.add_argument("--trials", type=int, default=10**9)
    ask.add_argument("--threads", type=int, default=2)
    ask.add_argument("--seed", type=int, default=1)
    ask.add_argument("--store", type=Path, required=True, help="a folder that is empty or does not exist")
    asked = ask.parse_args()

    study = Study(
        scenarios.load("paper-i1"), {"*.position": Box([-3, -3], [3, 3])}, trials=asked.trials, seed=asked.seed
    )
    clock, used = time.perf_counter(), time.process_time()
    study.run(store=asked.store, keep="outcomes", threads=asked.threads, progress=sys.stderr.isatty())
    run_s, processor_s = time.perf_counter() - clock, time.process_time() - used

    clock = time.perf_counter()
    result = load_study(asked.store)
    opened_s = time.perf_counter() - clock
    clock = time.perf_counter()
    probabilities = result.probabilities()
    counted_s = time.perf_counter() - clock

    files = [path for path in asked.store.rglob("*") if path.is_file()]
    facts = {
        "trials": asked.trials,
        "run_s": run_s,
        "processor_s": processor_s,
        "trials_per_second": asked.trials / run_s,
        "open_s": opened_s,
        "count_s": counted_s,
        "peak_MiB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
        "files": len(files),
        "bytes_per_trial": sum(path.stat().st_size for path in files) / asked.trials,
    }
    print(json.dumps({name: round(value, 4) for name, value in facts.items()}, indent=1))
    print(probabilities)


if __name__ == "__main__":
    main()
