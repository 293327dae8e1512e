"""Measure what epochs of a road take: processor time of each, and of one scan without epochs, by turns.

python studies/costs/epochs.py --length 60 --runs 5
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from synthroads_addon.jobs.epochs import epochs
from synthroads_addon.jobs.generate import Job, generate
from synthroads_addon.scanning.epochs.truth import EpochTruth
from synthroads_addon.scenario.scenario import Scenario, load_scenario

SPENT: defaultdict[str, float] = defaultdict(float)
"""Seconds of processor time by what they were spent on."""


def clocked(owner: Any, method: str, subject: Callable[..., str]) -> None:
    """Have the processor time of a method added to `SPENT` under what it is called with."""
    original = getattr(owner, method)

    def clock(self: Any, *arguments: Any) -> Any:
        begun = time.process_time()
        result = original(self, *arguments)
        SPENT[subject(self, *arguments)] += time.process_time() - begun
        return result

    setattr(owner, method, clock)


def one_run(scenario: Scenario, folder: Path) -> dict[str, float]:
    """Return the seconds of processor time of a scan without epochs, of two epochs, and of parts of these."""
    SPENT.clear()
    begun = time.process_time()
    generate(Job(scenario, folder / "alone", overwrite=True, new_file=True))
    alone = time.process_time() - begun
    epochs.generate_epochs(epochs.EpochsJob(Job(scenario, folder / "pair", overwrite=True, new_file=True)))
    return {"alone": alone, **SPENT, "ratio": (SPENT["epoch-2"] + SPENT["ahead"]) / SPENT["epoch-1"]}


def main() -> None:
    """Print the seconds of each run, and the medians."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--length", type=float, default=60.0, help="of the road, m (%(default)s)")
    parser.add_argument("--runs", type=int, default=5, help="runs (%(default)s)")
    arguments = parser.parse_args()
    # One thread: the processor time of the process is then that of the stage that is measured.
    settings = ["fidelity=draft", f"road.length={arguments.length}", "scan.threads=1"]
    scenario = load_scenario("rq31-600m", settings)
    clocked(epochs._EpochsRun, "_make", lambda _, epoch: epoch.name)
    clocked(epochs._EpochsRun, "_next_mesh", lambda _: "ahead")
    clocked(EpochTruth, "arrays", lambda truth, _: f"truth {2 if truth.is_second else 1}")
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for _ in range(arguments.runs):
            rows.append(one_run(scenario, Path(folder)))
            print(", ".join(f"{name} {value:.2f}" for name, value in rows[-1].items()), flush=True)
    print("medians:", ", ".join(f"{name} {median(row[name] for row in rows):.2f}" for name in rows[0]))


if __name__ == "__main__":
    main()
    sys.stdout.flush()
    os._exit(0)  # Blender's own teardown can crash
