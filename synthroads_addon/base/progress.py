"""How long work reports where it is, and how it is stopped; and how each stage is measured."""

import sys
import time
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Protocol, Self, TypeVar

S = TypeVar("S")
T = TypeVar("T")


class Progress(Protocol):
    """Callback of long work with the stage's name and the share of it that is done; may raise `Cancelled`."""

    def __call__(self, stage: str, share: float) -> None: ...


class Stage(str):
    """Name of a stage, with what may be said of it beside its share.

    Attributes:
        detail: e.g. ``epoch 3 of 20, loss 0.41``; it doesn't tell stages apart.
    """

    detail: str

    def __new__(cls, name: str, detail: str) -> Self:
        """Return a stage's name with a detail."""
        stage = super().__new__(cls, name)
        stage.detail = detail
        return stage


def silent(stage: str, share: float) -> None:
    """Ignore a report of progress."""


def part_of(progress: Progress, first_share: float, last_share: float) -> Progress:
    """Return a callback for a part of some work: its shares 0 to 1 are `first_share` to `last_share` of the whole."""

    def report(stage: str, share: float) -> None:
        """Report a share of the part as one of the whole."""
        progress(stage, first_share + share * (last_share - first_share))

    return report


def in_stage(progress: Progress, name: str) -> Progress:
    """Return a callback for work that is one stage of a job, whose own stages become the details of that one."""

    def report(stage: str, share: float) -> None:
        """Report a share under the stage's name."""
        progress(Stage(name, stage), share)

    return report


def duration(seconds: float) -> str:
    """Return a time in words, in the largest unit of which it has two: ``90 s``, ``3 min``, ``5 hours``."""
    for unit, size in (("days", 86_400.0), ("hours", 3600.0), ("min", 60.0)):
        if seconds >= 2.0 * size:
            return f"{seconds / size:,.0f} {unit}"
    return f"{seconds:.0f} s"


def exhaust(steps: Generator[S, None, T], report: Callable[[S], object]) -> T:
    """Run a generator to its end, report each value that it yields, and return what it returns."""
    while True:
        try:
            report(next(steps))
        except StopIteration as end:
            result: T = end.value
            return result


@dataclass
class StageTimer:
    """Measures each stage's seconds and the process's peak memory at its end.

    Attributes:
        stages: name -> {"seconds": ..., "peak_memory_mb": ...} in order.
    """

    progress: Progress = silent
    stages: dict[str, dict[str, float | None]] = field(default_factory=dict)

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Measure the seconds and peak memory of what happens inside; seconds of a stage that comes again add up."""
        self.progress(name, 0.0)
        start = time.perf_counter()
        yield
        seconds = time.perf_counter() - start
        if name in self.stages:  # of a section before
            seconds += self.stages[name]["seconds"] or 0.0
        self.stages[name] = {"seconds": round(seconds, 3), "peak_memory_mb": peak_memory_mb()}
        self.progress(name, 1.0)

    @property
    def seconds(self) -> float:
        """Return the sum of all stages' seconds."""
        return sum(row["seconds"] or 0.0 for row in self.stages.values())


def peak_memory_mb() -> float | None:
    """Return the largest resident memory of this process so far, MB (1e6 bytes); None where it can't be told."""
    try:
        import resource
    except ImportError:  # Windows
        return None
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return round(peak * (1 if sys.platform == "darwin" else 1024) / 1e6, 1)
