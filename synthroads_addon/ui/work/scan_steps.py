"""Helpers that scans of roads and of other scenes share: working folders, progress, services, result."""

from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self, TypeAlias

from ...base.files import output_folder
from ...base.progress import Progress, StageTimer, silent
from ...base.scratch.folders import scratch_folder
from ...base.turns.main_thread import MainThreadCalls
from ...blender.scene.evaluated import CopiedScene
from ...blender.services import SnapshotServices
from ...jobs.images.files import PHOTOS
from ...scanning.colour.colour import takes_nodes
from ...scanning.forecast import ScanForecast
from ...scenario.scenario import Scenario
from .job import Report, Step

Measure: TypeAlias = Callable[[Report], tuple[dict[str, Any], Sequence[str]]]
"""Scans, writes the cloud and the previews, and returns the counts and the scene's warnings. It touches no data of
Blender."""
READ = 0.1
"""Share of a scan's progress that the reading of the scene takes up."""
_MODELS = 0.02
"""Share of the rest that models of the road take up."""
_PHOTOS_END = 0.6
"""Share of the progress that images of cameras take up, where there are any."""
_SHARES = {"images": (0.05, 0.05), "scan": (0.05, 1.0), "files": (1.0, 1.0)}


@dataclass(frozen=True)
class Workplace:
    """Working folders, main-thread calls and timer of one scan.

    Attributes:
        folder: where its files are made.
        scratch: for files that are needed as long as it lasts.
        calls: those that it has the main thread make.
        timer: of its stages.
        notes: what the window shows while the scan runs.
    """

    folder: Path
    scratch: Path
    calls: MainThreadCalls = field(default_factory=MainThreadCalls)
    timer: StageTimer = field(default_factory=StageTimer)
    notes: list[str] = field(default_factory=list)

    def note_forecast(self, forecast: ScanForecast) -> None:
        """Have the window say what a scan will take, if that is long."""
        if forecast.is_long:
            self.notes.append(forecast.text())

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
    calls = work.calls if scenario.may_render else None
    services = SnapshotServices(materials, calls, work.scratch, scenario.scan.kernels)
    return None if services.needs_renderer else services


@contextmanager
def followed_models(timer: StageTimer, report: Report) -> Iterator[None]:
    """Context in which models of the road are written, before the scan: a stage timer tells the job's progress."""
    timer.progress = lambda _, share: report(_MODELS * share)
    yield
    timer.progress = silent


def progress_of_stages(spans: Mapping[str, tuple[float, float]], report: Report) -> Progress:
    """Return a callback for the stages of a scan that reports the share of all that is done.

    Args:
        spans: shares at which each stage begins and ends where no images of cameras are taken; these come first.
        report: is told the share.
    """
    with_photos = False

    def follow(stage: str, share: float) -> None:
        """Report a stage's share as one of the whole scan."""
        nonlocal with_photos
        if stage == PHOTOS:
            with_photos = True
            report(_PHOTOS_END * share)
            return
        first, last = spans[stage]
        done = first + share * (last - first)
        report(_PHOTOS_END + (1.0 - _PHOTOS_END) * done if with_photos else done)

    return follow


def follow_scan(timer: StageTimer, report: Report) -> None:
    """Connect a scan's stage timer to the job's progress."""
    timer.progress = progress_of_stages(_SHARES, report)
