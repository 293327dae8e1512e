"""A scan into files: the cloud and the previews while blocks of points are written to them."""

import logging
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.progress import StageTimer
from ...cloud.formats.registry import open_writer
from ...cloud.formats.writer import CloudWriter
from ...cloud.points import PointBlock
from ...cloud.tools.previews import TopView
from ...cloud.tools.subsample import GridSubsampler
from ...scanning.colour.colour import shares_by_source
from ...scanning.forecast import ScanForecast
from ...scanning.plan import ScanPlan
from ...scanning.receiver import Response
from ...scanning.record import record
from ...scanning.scan import BlockResult
from ...scenario.scan import scanner_setting
from ...scenario.scenario import Scenario

_logger = logging.getLogger("synthroads")
_MOST_PAINTED = 2
"""Blocks that wait to be painted into the previews: the scan goes on meanwhile, and its memory stays small."""


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


@dataclass
class CloudFiles:
    """Sink for blocks of scanned points that writes the cloud's files and the previews.

    Attributes:
        scenario: says which files are wanted.
        folder: where the files go.
        origin: (3,) map coordinates near the points, m.
        typical_range: usual distance to what is scanned, m.
        epsg: map coordinate system, for the previews' titles; None if unknown.
        view: raster for the previews, which are written if it is given.
        system_text: map and vertical coordinate system as WKT; that of ``epsg`` alone if None.
        counts: what was counted so far.
    """

    scenario: Scenario
    folder: Path
    origin: NDArray[np.float64]
    typical_range: float
    epsg: int | None = None
    view: TopView | None = None
    system_text: str | None = None
    counts: ScanCounts = field(default_factory=ScanCounts)
    _writers: list[CloudWriter] = field(default_factory=list)
    _grid: GridSubsampler | None = None
    _painter: ThreadPoolExecutor | None = None
    _painting: list[Future[None]] = field(default_factory=list)

    @property
    def intensity_scale(self) -> float:
        """Return the 16-bit steps per unit of intensity: the scenario's, or one from the usual range.

        A device's own numbers are shares of its full scale, which fill the 16 bits.

        16 bits are full for a white target at a right angle at half the usual range: only what is nearer or a
        retro-reflector is brighter, and the weakest echoes still have hundreds of steps.
        """
        corrected, response = self.scenario.cloud.intensity == "range_corrected", self._response
        if not corrected and response not in (None, "power"):
            return self.scenario.cloud.intensity_scale or 65535.0
        usual = 65535.0 / 4.0 * (1.0 if corrected else max(2.0, self.typical_range) ** 2)
        return self.scenario.cloud.intensity_scale or usual

    @cached_property
    def _response(self) -> Response | None:
        """Return what number the scanner makes of the received power."""
        return scanner_setting(self.scenario.scan).receiver.response

    @contextmanager
    def open(self) -> Iterator[None]:
        """Context that opens the files; they are complete and get their names if it ends without an exception."""
        cloud = self.scenario.cloud
        with ExitStack() as stack:
            if "cloud" in self.scenario.outputs:
                self._writers = [stack.enter_context(self.open_writer(name)) for name in cloud.file_names()]
            if self.view:
                # One thread: blocks are painted in their order, whatever the number of cores.
                self._painter = stack.enter_context(ThreadPoolExecutor(1))
            if cloud.point_spacing:
                self._grid = stack.enter_context(GridSubsampler(cloud.point_spacing, self.folder))
            yield
            for block in self._grid.blocks() if self._grid else ():
                self._keep(block)
            self._wait_for_painter(0)
        if self._writers:
            self.counts.points, self.counts.intensity_clipped = self._writers[0].count, self._writers[0].clipped
        if self.view:
            self.view.save(self.folder, self.epsg)

    def write(self, result: BlockResult) -> None:
        """Write a block of scanned points, after thinning if the scenario asks for it, and count it."""
        self.counts.add(result)
        if self._grid:
            self._grid.add(result.points)
        else:
            self._keep(result.points)

    def open_writer(self, name: str) -> CloudWriter:
        """Return a writer for a cloud file in the folder, with the scenario's attributes and classes."""
        cloud, path = self.scenario.cloud, self.folder / name
        epsg = self.epsg if self.system_text is None else None
        scale = self.intensity_scale
        return open_writer(path, epsg, self.origin, scale, cloud.attributes, cloud.scheme(), self.system_text)

    def _keep(self, points: PointBlock) -> None:
        for writer in self._writers:
            writer.write(points)
        if self.view and self._painter:
            self._wait_for_painter(_MOST_PAINTED - 1)
            self._painting.append(self._painter.submit(self.view.add, points))

    def _wait_for_painter(self, most: int) -> None:
        """Wait until at most so many blocks wait for the previews; raises what failed in the others."""
        while len(self._painting) > most:
            self._painting.pop(0).result()

    def summary(self) -> dict[str, Any]:
        """Return the counts so far as JSON data, by class name and colour source."""
        names = self.scenario.cloud.scheme().sources().names()
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


def record_to_files(
    plans: Iterable[ScanPlan],
    files: CloudFiles,
    timer: StageTimer,
    announce: Callable[[ScanForecast], None] | None = log_forecast,
) -> dict[str, Any]:
    """Scan plans one after the other into the cloud and the previews.

    The stage ``files`` is what is left to be written at the end. Where something is rendered, it must run in the main
    thread.

    Args:
        plans: the sections, or the one scan.
        files: the sink.
        timer: of the job's stages.
        announce: is told beforehand what the whole scan will take; None for stretches that are tried.

    Returns:
        the counts, as JSON data; triangles and vertices are those of the largest scene.
    """
    figures: dict[str, Any] = {}
    rendered: dict[str, Any] = {}
    with ExitStack() as stack:
        stack.enter_context(files.open())
        for plan in plans:
            if announce and not figures:  # the path is the whole scan's, whatever section the plan is of
                announce(plan.forecast().beside_others())
            summary = plan.summary()
            largest = {name: max(figures.get(name, 0), summary[name]) for name in ("triangles", "vertices")}
            figures = summary | largest
            _add_up(rendered, record(plan, files, timer))
            del plan  # its scene, before the next one is built
        with timer.stage("files"):
            stack.close()
    return {"triangles": 0, "vertices": 0} | figures | files.summary() | {"rendered": rendered}


def _add_up(sums: dict[str, Any], figures: Mapping[str, Any]) -> None:
    """Add numbers to the sums of the same names, in place; other values replace those before."""
    for name, value in figures.items():
        sums[name] = sums[name] + value if isinstance(value, int | float) and name in sums else value
