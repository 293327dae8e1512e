"""A scan into files: the cloud and the previews while blocks of points are written to them."""

from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...cloud.formats.registry import open_writer
from ...cloud.formats.writer import CloudWriter
from ...cloud.points import PointBlock
from ...cloud.tools.previews import TopView
from ...road.parameters import RoadParameters
from ...scanning.plan import ScanPlan
from ...scanning.scan import BlockResult
from ...scenario.inputs import ScenarioInputs
from ...scenario.scenario import Scenario
from ..images.files import ImageFiles
from .sink import CloudSink, ScanCounts
from .sweeps import SweepFiles

_MOST_PAINTED = 2
"""Blocks that wait to be painted into the previews: the scan goes on meanwhile, and its memory stays small."""


@dataclass
class CloudFiles(CloudSink):
    """Sink for blocks of scanned points that writes the cloud's files and the previews.

    Attributes:
        scenario: says which files are wanted.
        inputs: what the files that it names hold.
        folder: where the files go.
        origin: (3,) map coordinates near the points, m.
        typical_range: usual distance to what is scanned, m.
        epsg: map coordinate system, for the previews' titles; None if unknown.
        view: raster for the previews, which are written if it is given.
        system_text: map and vertical coordinate system as WKT; that of ``epsg`` alone if None.
        road: what stands on and beside it, for the names of things; None without a road.
        counts: what was counted so far.
        images: of the scenario's cameras; None without any.
    """

    scenario: Scenario
    inputs: ScenarioInputs
    folder: Path
    origin: NDArray[np.float64]
    typical_range: float
    epsg: int | None = None
    view: TopView | None = None
    system_text: str | None = None
    road: RoadParameters | None = None
    counts: ScanCounts = field(default_factory=ScanCounts)
    images: ImageFiles | None = None
    _writers: list[CloudWriter] = field(default_factory=list)
    _sweeps: SweepFiles | None = None
    _stack: ExitStack | None = None
    _by_strip: dict[int, list[CloudWriter]] = field(default_factory=dict)
    _painter: ThreadPoolExecutor | None = None
    _painting: list[Future[None]] = field(default_factory=list)

    @contextmanager
    def _opened(self) -> Iterator[None]:
        """Context that opens the files; they are complete and get their names if it ends without an exception."""
        with ExitStack() as stack:
            if "cloud" in self.scenario.outputs:
                names = self.scenario.cloud.file_names()
                self._writers = [stack.enter_context(self.open_writer(name)) for name in names]
                self._stack = stack
            if self.scenario.sweeps.formats:
                self._sweeps = self._open_sweeps()
                stack.callback(self._sweeps.discard)
            if self.view:
                # One thread: blocks are painted in their order, whatever the number of cores.
                self._painter = stack.enter_context(ThreadPoolExecutor(1))
            yield
            self._wait_for_painter(0)
            if self._sweeps:
                self._sweeps.close()
        if self._writers:
            self.counts.points, self.counts.intensity_clipped = self._writers[0].count, self._writers[0].clipped
        if self.view:
            self.view.save(self.folder, self.epsg)

    def _open_sweeps(self) -> SweepFiles:
        """Return the files of the scan's sweeps, begun."""
        files = SweepFiles(
            self.scenario, self.inputs, self.folder, self.origin, self.intensity_scale, self.epsg, self.road
        )
        files.open()
        return files

    def begin(self, plan: ScanPlan) -> None:
        """Take the plan of the scan whose points follow: the sweeps have its path and its things."""
        if self._sweeps:
            self._sweeps.begin(plan)

    def end(self) -> None:
        """Take notice that all points of the plan have come: complete sweeps are written, and let its scene go."""
        if self._sweeps:
            self._sweeps.end()

    def write(self, result: BlockResult) -> None:
        """Take a block of scanned points, see `CloudSink.write`; sweeps have all points, thinned out or not."""
        if self._sweeps:
            self._sweeps.add(result.points)
        super().write(result)

    def summary(self) -> dict[str, Any]:
        """Return the counts so far as JSON data, see `CloudSink.summary`, with those of the sweeps."""
        return super().summary() | ({"sweeps": self._sweeps.counts} if self._sweeps else {})

    def open_writer(self, name: str) -> CloudWriter:
        """Return a writer for a cloud file in the folder, with the scenario's attributes and classes."""
        cloud, path = self.scenario.cloud, self.folder / name
        epsg = self.epsg if self.system_text is None else None
        scale = self.intensity_scale
        standard_time = cloud.start_time is not None
        return open_writer(
            path, epsg, self.origin, scale, cloud.attributes, self.inputs.scheme, self.system_text, standard_time
        )

    def _keep(self, points: PointBlock) -> None:
        """Write a block to the cloud's files, and have it painted into the previews."""
        if shift := self.scenario.cloud.time_shift:
            points = points.with_arrays({"gps_time": points.gps_time + shift})
        for writer in self._writers:
            writer.write(points)
        if self._writers and self.scenario.cloud.strip_files:
            self._write_strips(points)
        if self.view and self._painter:
            self._wait_for_painter(_MOST_PAINTED - 1)
            self._painting.append(self._painter.submit(self.view.add, points))

    def _write_strips(self, points: PointBlock) -> None:
        """Write a block to the files of its strips, which are opened when their first points come."""
        assert self._stack is not None
        for strip in np.unique(points.strip).tolist():
            if strip not in self._by_strip:
                writers = [self.open_writer(name) for name in self.scenario.cloud.strip_file_names(strip)]
                for writer in writers:
                    writer.source_id = strip + 1
                self._by_strip[strip] = [self._stack.enter_context(writer) for writer in writers]
            part = points.select(points.strip == strip)
            for writer in self._by_strip[strip]:
                writer.write(part)

    def _wait_for_painter(self, most_waiting: int) -> None:
        """Wait until at most so many blocks wait for the previews; raises what failed in the others."""
        while len(self._painting) > most_waiting:
            self._painting.pop(0).result()
