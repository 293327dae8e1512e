"""Measures how long work takes in seconds of a quiet machine, whatever else this one does meanwhile.

A busy core gives a process less of its caches and of its clock: the same work then takes up to four times the
processor's time. So fixed work is timed beside it, by turns, and the time is divided by how much slower that is.
"""

import time
from collections.abc import Callable

import numpy as np

QUIET_SECONDS = 0.006
"""Processor time, s, that the fixed work takes on a quiet core of the machine that limits are stated for."""


def _fixed_work() -> None:
    """Handle objects, text and arrays, as much of each as the project's own code does."""
    table = {f"name {number}": {"value": 0.1 * number, "words": str(number).split("1")} for number in range(2500)}
    assert sum(len(row["words"]) + row["value"] for row in table.values()) > 0.0
    values = np.sin(np.arange(40_000, dtype=np.float64))
    assert np.isfinite(values[np.argsort(values)].cumsum()[-1])


def _seconds(work: Callable[[], object]) -> float:
    begin = time.process_time()
    work()
    return time.process_time() - begin


def quiet_seconds(work: Callable[[], object], rounds: int = 1) -> float:
    """Return the median processor time (s, all threads) of some rounds of work, as of a quiet machine.

    The fixed work is done before, between and after the rounds.
    """
    fixed, spent = [_seconds(_fixed_work) for _ in range(3)], []
    for _ in range(rounds):
        spent.append(_seconds(work))
        fixed += [_seconds(_fixed_work) for _ in range(3)]
    return float(np.median(spent) / np.median(fixed)) * QUIET_SECONDS


def times_as_long(work: Callable[[], object], other: Callable[[], object], rounds: int) -> float:
    """Return the median processor time of some rounds of work over that of other work, done by turns."""
    pairs = [(_seconds(work), _seconds(other)) for _ in range(rounds)]
    spent, others = np.median(pairs, axis=0)
    return float(spent / others)
