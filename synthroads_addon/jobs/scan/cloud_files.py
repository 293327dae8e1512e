"""The cloud's files and the previews while blocks of points are written to them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.classes import classes
from ...cloud.formats.base import CloudWriter
from ...cloud.formats.registry import open_writer
from ...cloud.points import PointBlock
from ...cloud.tools.previews import TopView
from ...cloud.tools.subsample import GridSubsampler
from ...scanning.colour.colour import shares_by_source
from ...scanning.scan import BlockResult
from ...scenario.scenario import Scenario


@dataclass
class ScanCounts:
    """What was counted while scanning."""

    pulses: int = 0
    rays: int = 0
    points: int = 0
    below_threshold: int = 0
    saturated: int = 0
    intensity_clipped: int = 0
    by_class: np.ndarray = field(default_factory=lambda: np.zeros(256, dtype=np.int64))
    by_source: np.ndarray = field(default_factory=lambda: np.zeros(256, dtype=np.int64))

    def add(self, result: BlockResult) -> None:
        """Add one block."""
        self.pulses += result.pulses
        self.rays += result.rays
        self.below_threshold += result.below_threshold
        self.saturated += result.saturated
        self.points += len(result.points)
        self.by_class += np.bincount(result.points.class_id, minlength=256)
        if result.sources is not None:
            self.by_source += result.sources


class CloudFiles:
    """The cloud and the previews while a scan, or one section of it after the other, is written to them.

    Args:
        scenario: says which files are wanted.
        folder: where the files go.
        origin: (3,) map coordinates near the points, m.
        typical_range: usual distance to what is scanned, m.
        epsg: map coordinate system; None if unknown.
        view: raster for the previews; None without.

    Attributes:
        counts: what was counted so far.
        intensity_scale: 16-bit steps per unit of intensity.
    """

    def __init__(
        self,
        scenario: Scenario,
        folder: Path,
        origin: NDArray[np.float64],
        typical_range: float,
        epsg: int | None = None,
        view: TopView | None = None,
    ) -> None:
        self.scenario, self.folder, self.view = scenario, folder, view
        self.counts = ScanCounts()
        self._epsg, self._origin = epsg, origin
        self._writers: list[CloudWriter] = []
        self._grid: GridSubsampler | None = None
        # 16 bits are full for a white target at a right angle at half the usual range: only what is nearer or a
        # retro-reflector is brighter, and the weakest echoes still have hundreds of steps.
        corrected = scenario.cloud.intensity == "range_corrected"
        usual = 65535.0 / 4.0 * (1.0 if corrected else max(2.0, typical_range) ** 2)
        self.intensity_scale = scenario.cloud.intensity_scale or usual

    @contextmanager
    def opened(self) -> Iterator[None]:
        """Open the files; they are complete, and under their names, when the context ends without an exception."""
        with ExitStack() as stack:
            self._open(stack)
            yield
            for block in self._grid.blocks() if self._grid else ():
                self._keep(block)
        if self._writers:
            self.counts.points, self.counts.intensity_clipped = self._writers[0].count, self._writers[0].clipped
        if self.view:
            self.view.save(self.folder, self._epsg)

    def take(self, results: Iterable[BlockResult]) -> Iterator[int]:
        """Write the blocks of a scan; yield the number of blocks that are done more."""
        for result in results:
            self.counts.add(result)
            if self._grid:
                self._grid.add(result.points)
            else:
                self._keep(result.points)
            yield result.blocks

    def _keep(self, points: PointBlock) -> None:
        for writer in self._writers:
            writer.write(points)
        if self.view:
            self.view.add(points)

    def _open(self, stack: ExitStack) -> None:
        cloud = self.scenario.cloud
        if "cloud" in self.scenario.outputs:
            options = (self._epsg, self._origin, self.intensity_scale, cloud.attributes, cloud.scheme())
            names = cloud.file_names()
            self._writers = [stack.enter_context(open_writer(self.folder / name, *options)) for name in names]
        if cloud.point_spacing:
            self._grid = stack.enter_context(GridSubsampler(cloud.point_spacing, self.folder))

    def summary(self) -> dict[str, Any]:
        """Return the counts as JSON data."""
        names = {row.id: row.name for row in classes()} | {255: "unlabelled"}
        by_class = {names.get(i, str(i)): int(n) for i, n in enumerate(self.counts.by_class) if n}
        return {
            **{name: value for name, value in asdict(self.counts).items() if not name.startswith("by_")},
            "intensity_scale": self.intensity_scale,
            "points_by_class": by_class,
            "points_by_colour_source": shares_by_source(self.counts.by_source),
        }
