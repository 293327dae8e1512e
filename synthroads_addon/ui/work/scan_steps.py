"""Parts that scans of roads and of other scenes share: what they have written, and how far they are."""

from collections.abc import Generator
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from ...base.progress import StageTimer
from ...blender.scene.evaluated import CopiedScene
from .job import Report, Step

READ = 0.1
"""Share of a scan's progress that the reading of the scene takes up."""
_SHARES = {"images": (0.05, 0.05), "scan": (0.05, 1.0), "files": (1.0, 1.0)}


@dataclass(frozen=True)
class Written:
    """Result of a scan: so many points into a folder."""

    points: int
    target: Path


def pass_on_reading(steps: Generator[float, None, CopiedScene]) -> Generator[Step, None, CopiedScene]:
    """Pass on the steps of reading a scene as shares of the whole."""
    with closing(steps):
        while True:
            try:
                share = next(steps)
            except StopIteration as end:
                return end.value
            yield Step(READ * share)


def follow_scan(timer: StageTimer, report: Report) -> None:
    """Have the stages of a scan report the share of the whole that is done."""
    timer.progress = lambda stage, share: report(_SHARES[stage][0] * (1.0 - share) + _SHARES[stage][1] * share)
