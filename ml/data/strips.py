"""A long cloud along its road, one strip of it in memory at a time."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from synthroads_addon.base.arrays import Bool, Float
from synthroads_addon.base.errors import InputError
from synthroads_addon.base.progress import Progress, silent
from synthroads_addon.cloud.formats.base import CloudHeader
from synthroads_addon.cloud.formats.registry import open_cloud
from synthroads_addon.cloud.points import PointBlock

from .axis import MeasuredAxis
from .frames import Frames, estimated_path
from .points import GROUND_CLASSES, SIXTEEN_BITS, UNSORTED_CLASSES, Points, full_color
from .roads import REACH, LearningRoad

LENGTH = 500.0
"""Of a strip along the path, m."""
MARGIN = 40.0
"""How far a strip's points and frames reach beyond its ends, m: more than a sequence of slices is long."""
_CELL = 1.0
"""Edge of the cells in which one point each is enough to find the path, m."""
_STORED = np.dtype([("xyz", "<f8", 3), ("intensity", "<f4"), ("rgb", "<u2", 3), ("class_id", "u1")])


@dataclass(frozen=True)
class GroundReading:
    """Findings of a first reading of a cloud.

    Attributes:
        header: of the cloud.
        classes: ids of the classes that its ground has.
        largest_color: over all points.
        cells: (C, 2) places in plan of some ground points, one in each square metre, map coordinates.
    """

    header: CloudHeader
    classes: Bool
    largest_color: int
    cells: Float


def find_ground(cloud: Path, progress: Progress = silent) -> GroundReading:
    """Read a cloud once and say where its ground is: as `points.read_ground` chooses it, in bounded memory.

    Raises:
        MissingFileError, InputError: there is no such cloud, it is damaged, or it has classes but no ground.
    """
    with open_cloud(cloud) as reader:
        header = reader.header
        names = header.scheme.names()
        ground = np.array([names.get(number) in GROUND_CLASSES for number in range(256)])
        counts, largest, done = np.zeros(256, dtype=np.int64), 0, 0
        cells: dict[bool, dict[tuple[int, int], None]] = {True: {}, False: {}}
        for block in reader.blocks():
            counts += np.bincount(block.class_id, minlength=256)
            largest = max(largest, int(block.rgb.max(initial=0)))
            own = ground[block.class_id]
            for kind, some in ((True, own), (False, ~own)):
                places = np.unique(np.floor(block.xyz[some, :2] / _CELL).astype(np.int64), axis=0)
                cells[kind].update(dict.fromkeys(map(tuple, places.tolist())))
            done += len(block)
            progress("looking for the road", done / max(header.count, 1))
    if counts[ground].any():
        chosen, found = ground, cells[True]
    elif all(names.get(int(number)) in UNSORTED_CLASSES for number in np.flatnonzero(counts)) and counts.any():
        chosen, found = np.ones(256, dtype=bool), cells[False]
    else:
        raise InputError(str(cloud), None, f"holds no point of the classes {', '.join(GROUND_CLASSES)}")
    return GroundReading(header, chosen, largest, _CELL * (np.array(list(found), dtype=np.float64) + 0.5))


def path_through(ground: GroundReading) -> MeasuredAxis:
    """Return the path along a cloud's ground, in map coordinates."""
    origin = np.floor(ground.cells.min(axis=0))
    return estimated_path(ground.cells - origin).moved((*origin, 0.0))


def strips(
    cloud: Path, ground: GroundReading, path: MeasuredAxis, frames: Frames, progress: Progress = silent
) -> Iterator[tuple[LearningRoad, Frames, Bool]]:
    """Yield a road strip by strip, from first to last.

    The points lie in a temporary folder meanwhile, and in memory only those of one strip.

    Args:
        cloud: the cloud.
        ground: what `find_ground` found in it.
        path: along the road, map coordinates.
        frames: along the path, map coordinates.
        progress: told about the sorting.

    Yields:
        the strip's points, its frames in the points' local coordinates, and which of them are its own: the others
        belong to its neighbours and are only there so that sequences of slices reach across.
    """
    with tempfile.TemporaryDirectory(prefix="synthroads-strips-") as folder:
        there = _sorted_to(Path(folder), cloud, ground, path, progress)
        own = np.floor(frames.station / LENGTH).astype(np.int64)
        for number in np.unique(own).tolist():
            first, last = number * LENGTH - MARGIN, (number + 1) * LENGTH + MARGIN
            seen = (frames.station >= first) & (frames.station < last)
            stored = np.fromfile(there[number], dtype=_STORED) if number in there else np.empty(0, _STORED)
            if len(stored):
                points = _points(stored, ground)
                line = _part(path, first - REACH, last + REACH).moved(-points.origin)
                local = Frames(frames.position - points.origin[:2], frames.direction, frames.station).select(seen)
                yield LearningRoad.of_points(cloud.stem, points, line), local, own[seen] == number


def _sorted_to(
    folder: Path, cloud: Path, ground: GroundReading, path: MeasuredAxis, progress: Progress
) -> dict[int, Path]:
    """Write the points near the path to a file per strip, margins included."""
    files: dict[int, Path] = {}
    done = 0
    with open_cloud(cloud) as reader:
        for block in reader.blocks():
            done += len(block)
            some = block.select(ground.classes[block.class_id])
            station, offset = path.project(some.xyz)
            near = np.abs(offset) <= REACH
            rows, station = _rows(some.select(near), ground.header), station[near]
            for number in _touched_strips(station):
                inside = (station >= number * LENGTH - MARGIN) & (station < (number + 1) * LENGTH + MARGIN)
                files.setdefault(number, folder / f"{number}.bin")
                with files[number].open("ab") as file:
                    rows[inside].tofile(file)
            progress("sorting points", done / max(ground.header.count, 1))
    return files


def _touched_strips(station: Float) -> list[int]:
    """Return the numbers of the strips that stations lie in or beside."""
    both = np.concatenate([np.floor((station + by) / LENGTH) for by in (-MARGIN, MARGIN)])
    return np.unique(both).astype(np.int64).tolist()


def _rows(block: PointBlock, header: CloudHeader) -> NDArray[np.void]:
    rows = np.empty(len(block), dtype=_STORED)
    rows["xyz"] = block.xyz
    rows["intensity"] = block.intensity * ((header.intensity_scale or 1.0) / SIXTEEN_BITS)
    rows["rgb"] = block.rgb
    rows["class_id"] = block.class_id
    return rows


def _points(rows: NDArray[np.void], ground: GroundReading) -> Points:
    origin = np.floor(rows["xyz"].min(axis=0))
    return Points(
        origin=origin,
        xyz=rows["xyz"] - origin,
        intensity=rows["intensity"].copy(),
        rgb=(rows["rgb"] / full_color(ground.largest_color)).astype(np.float32),
        class_id=rows["class_id"].copy(),
        class_names=dict(ground.header.scheme.names()),
        has_color=ground.header.has_color and ground.largest_color > 0,
        epsg=ground.header.epsg,
    )


def _part(path: MeasuredAxis, first: float, last: float) -> MeasuredAxis:
    """Return the part of a path around some stations: its vertices there, and one beyond on either side."""
    low = max(0, int(np.searchsorted(path.station, first, "right")) - 1)
    high = min(len(path.points), int(np.searchsorted(path.station, last, "left")) + 1)
    low = min(low, high - 2) if high >= 2 else 0
    return MeasuredAxis(path.points[low : max(high, 2)], path.joined[low : max(high, 2) - 1])
