"""Helpers that scans of roads and of other scenes share: working folders, progress, services, result."""

from collections.abc import Generator, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Self

from ...base.files import output_folder
from ...base.progress import StageTimer
from ...base.scratch.folders import scratch_folder
from ...base.turns.main_thread import MainThreadCalls
from ...blender.scene.evaluated import CopiedScene
from ...blender.services import SnapshotServices
from ...scanning.colour.colour import takes_nodes
from ...scenario.scenario import Scenario
from .job import Report, Step

READ = 0.1
"""Share of a scan's progress that the reading of the scene takes up."""
_SHARES = {"images": (0.05, 0.05), "scan": (0.05, 1.0), "files": (1.0, 1.0)}


@dataclass(frozen=True)
class Workplace:
    """Working folders, main-thread calls and timer of one scan.

    Attributes:
        folder: where its files are made.
        scratch: for files that are needed as long as it lasts.
        calls: those that it has the main thread make.
        timer: of its stages.
    """

    folder: Path
    scratch: Path
    calls: MainThreadCalls = field(default_factory=MainThreadCalls)
    timer: StageTimer = field(default_factory=StageTimer)

    @classmethod
    @contextmanager
    def opened(cls, target: Path, names: Sequence[str], overwrite: bool) -> Iterator[Self]:
        """Context of a workplace whose files are put into the target folder on success, see `output_folder`."""
        with output_folder(target, names, overwrite) as folder, scratch_folder() as scratch:
            yield cls(folder, scratch)


@dataclass(frozen=True)
class Written:
    """Result of a scan: number of points, and target folder."""

    points: int
    target: Path


def renders_scene(scenario: Scenario) -> bool:
    """Return whether a scenario's colours need the scene rendered, whatever its materials are."""
    return scenario.may_render and not takes_nodes(scenario.colour.settings(scenario.fidelity))


def pass_on_reading(steps: Generator[float, None, CopiedScene]) -> Generator[Step, None, CopiedScene]:
    """Generator that runs the steps of copying a scene, scaled to the whole scan's progress."""
    with closing(steps):
        while True:
            try:
                share = next(steps)
            except StopIteration as end:
                return end.value
            yield Step(READ * share)


def snapshot_services(scenario: Scenario, materials: Sequence[str], work: Workplace) -> SnapshotServices | None:
    """Return the services for scanning a copied scene; None if some of its materials need the scene rendered.

    Args:
        scenario: the job.
        materials: the scene's.
        work: the scan's.
    """
    services = SnapshotServices(materials, work.calls if scenario.may_render else None, work.scratch)
    return None if services.needs_renderer else services


def follow_scan(timer: StageTimer, report: Report) -> None:
    """Connect a scan's stage timer to the job's progress."""
    timer.progress = lambda stage, share: report(_SHARES[stage][0] * (1.0 - share) + _SHARES[stage][1] * share)
