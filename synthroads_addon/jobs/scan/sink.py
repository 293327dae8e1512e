"""`CloudSink`: what takes the points of a scan, counts them and thins them out; and the scan of plans into one."""

import logging
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import asdict, dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ...base.progress import StageTimer
from ...cloud.points import PointBlock
from ...cloud.tools.subsample import GridSubsampler
from ...scanning.colour.colour import shares_by_source
from ...scanning.forecast import ScanForecast
from ...scanning.plan import ScanPlan
from ...scanning.receiver import Response
from ...scanning.record import Sink, record
from ...scanning.scan import BlockResult
from ...scenario.inputs import ScenarioInputs
from ...scenario.scenario import OF_POINTS, Scenario
from ..images.files import ImageFiles

_logger = logging.getLogger("synthroads")


@dataclass
class ScanCounts:
    """Counts of pulses, rays and points of a scan, also by class, by colour source, and of footprints by class."""

    pulses: int = 0
    rays: int = 0
    points: int = 0
    below_threshold: int = 0
    saturated: int = 0
    intensity_clipped: int = 0
    by_class: np.ndarray = field(default_factory=lambda: np.zeros(256, dtype=np.int64))
    by_source: np.ndarray = field(default_factory=lambda: np.zeros(256, dtype=np.int64))
    by_footprint: np.ndarray = field(default_factory=lambda: np.zeros((3, 256), dtype=np.int64))

    def add(self, result: BlockResult) -> None:
        """Add the counts of one block of a scan, in place."""
        for name in ("pulses", "rays", "below_threshold", "saturated"):
            setattr(self, name, getattr(self, name) + getattr(result, name))
        self.points += len(result.points)
        self.by_class += np.bincount(result.points.class_id, minlength=256)
        if result.sources is not None:
            self.by_source += result.sources
        if result.footprints is not None:
            self.by_footprint += result.footprints


class CloudSink(ABC):
    """Base of sinks for blocks of scanned points: it counts them, and thins them out if the scenario asks for it.

    Attributes:
        scenario: the job.
        inputs: what the files that it names hold.
        folder: for files that thinning out takes meanwhile.
        typical_range: usual distance to what is scanned, m.
        counts: what was counted so far.
        images: takes the images of the scenario's cameras; None without any.
    """

    scenario: Scenario
    inputs: ScenarioInputs
    folder: Path
    typical_range: float
    counts: ScanCounts
    images: ImageFiles | None = None
    _grid: GridSubsampler | None = None

    @property
    def intensity_scale(self) -> float:
        """Return the 16-bit steps per unit of intensity: the scenario's, or one from the usual range.

        A device's own numbers are shares of its full scale, which fill the 16 bits.

        16 bits are full for a white target at a right angle at half the usual range: only what is nearer or a
        retro-reflector is brighter, and the weakest echoes still have hundreds of steps.
        """
        is_range_corrected, response = self.scenario.cloud.intensity == "range_corrected", self._response
        if not is_range_corrected and response not in (None, "power"):
            return self.scenario.cloud.intensity_scale or 65535.0
        usual_scale = 65535.0 / 4.0 * (1.0 if is_range_corrected else max(2.0, self.typical_range) ** 2)
        return self.scenario.cloud.intensity_scale or usual_scale

    @cached_property
    def _response(self) -> Response | None:
        """Return what number the scanner makes of the received power."""
        return self.inputs.setting(self.scenario.scan).receiver.response

    def begin(self, plan: ScanPlan) -> None:  # noqa: B027 (most sinks need to know nothing of it)
        """Take the plan of the scan whose points follow."""

    def end(self) -> None:  # noqa: B027
        """Take notice that all points of the plan have come: nothing may hold its scene any longer."""

    @contextmanager
    def open(self) -> Iterator[None]:
        """Context in which points are taken; all is complete if it ends without an exception."""
        with self._opened(), ExitStack() as stack:
            if spacing := self.scenario.cloud.point_spacing:
                self._grid = stack.enter_context(GridSubsampler(spacing, self.folder))
            yield
            for block in self._grid.blocks() if self._grid else ():
                self._keep(block)

    @abstractmethod
    def _opened(self) -> AbstractContextManager[None]:
        """Context in which `_keep` may be called."""

    @abstractmethod
    def _keep(self, points: PointBlock) -> None:
        """Take points that stay in the cloud."""

    def write(self, result: BlockResult) -> None:
        """Take a block of scanned points, after thinning if the scenario asks for it, and count it."""
        self.counts.add(result)
        if self._grid:
            self._grid.add(result.points)
        else:
            self._keep(result.points)

    def summary(self) -> dict[str, Any]:
        """Return the counts so far as JSON data, by class name and colour source."""
        names = self.inputs.scheme.sources().names()
        by_class: Counter[str] = Counter()  # a class of a scheme may have the name of one of the full table
        for number in np.flatnonzero(self.counts.by_class).tolist():
            by_class[names.get(number, str(number))] += int(self.counts.by_class[number])
        return {
            **{name: value for name, value in asdict(self.counts).items() if not name.startswith("by_")},
            "intensity_scale": self.intensity_scale,
            "points_by_class": dict(by_class),
            "points_by_colour_source": shares_by_source(self.counts.by_source),
        } | self._footprints(names)

    def _footprints(self, names: Mapping[int, str]) -> dict[str, Any]:
        """Return how many footprints were spared, by the class that the pulses' axes meet; empty where none could be.

        ``pulses`` met the class; of ``one_ray`` of them only the axis was cast, and of ``checked`` the other rays were
        only looked along for anything in their way.
        """
        counts = self.counts.by_footprint
        rows = {
            names.get(i, str(i)): dict(zip(("pulses", "one_ray", "checked"), counts[:, i].tolist(), strict=True))
            for i in np.flatnonzero(counts[0]).tolist()
        }
        return {"footprints": rows} if rows else {}


def log_forecast(forecast: ScanForecast) -> None:
    """Log what a scan will take; unless details are asked for only if that is long."""
    level = logging.INFO if forecast.is_long else logging.DEBUG
    _logger.log(level, "scan: %s", forecast.text())


def record_cloud(
    plans: Iterable[ScanPlan],
    sink: CloudSink,
    timer: StageTimer,
    announce: Callable[[ScanForecast], None] | None = log_forecast,
) -> dict[str, Any]:
    """Scan plans one after the other into a cloud.

    The stage ``files`` is what is left to be written at the end. Where something is rendered, it must run in the main
    thread.

    Args:
        plans: the sections, or the one scan.
        sink: takes the points.
        timer: of the job's stages.
        announce: is told beforehand what the whole scan will take; None for stretches that are tried.

    Returns:
        the counts, as JSON data; triangles and vertices are those of the largest scene.
    """
    figures: dict[str, Any] = {}
    rendering_sums: dict[str, Any] = {}
    with ExitStack() as stack:
        stack.enter_context(sink.open())
        for plan in plans:
            if announce and not figures:  # the path is the whole scan's, whatever section the plan is of
                announce(plan.forecast().beside_others())
            summary = plan.summary()
            largest_counts = {name: max(figures.get(name, 0), summary[name]) for name in ("triangles", "vertices")}
            figures = summary | largest_counts
            taker: Sink = sink
            if sink.images is not None:
                sink.images.shoot(plan, timer)
                taker = sink.images.coloured(sink)
            if set(sink.scenario.outputs) & set(OF_POINTS):
                sink.begin(plan)
                _add_up(rendering_sums, record(plan, taker, timer))
                sink.end()
            del plan  # its scene, before the next one is built
        with timer.stage("files"):
            stack.close()
            if sink.images is not None:
                sink.images.finish()
    counts = {"triangles": 0, "vertices": 0} | figures | sink.summary() | {"rendered": rendering_sums}
    return counts if sink.images is None else counts | {"images": sink.images.summary()}


def _add_up(sums: dict[str, Any], figures: Mapping[str, Any]) -> None:
    """Add numbers to the sums of the same names, in place; other values replace those before."""
    for name, value in figures.items():
        sums[name] = sums[name] + value if isinstance(value, int | float) and name in sums else value
