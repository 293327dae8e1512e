"""A long cloud along its road, one strip of it in memory at a time."""

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from synthroads_addon.base.arrays import Bool, Float
from synthroads_addon.base.errors import InputError
from synthroads_addon.base.progress import Progress, silent
from synthroads_addon.cloud.formats.header import CloudHeader
from synthroads_addon.cloud.formats.registry import open_cloud
from synthroads_addon.cloud.tools.subsample import TileFiles
from synthroads_addon.road.axes.measured_axis import MeasuredAxis

from .frames import Frames, estimated_path
from .points import GROUND_CLASSES, UNSORTED_CLASSES, points_of
from .roads import REACH, LearningRoad

LENGTH = 500.0
"""Length of a strip along the path, m."""
MARGIN = 40.0
"""How far a strip's points and frames reach beyond its ends, m: more than a sequence of slices is long."""
_CELL = 1.0
"""Edge of the cells in which one point each is enough to find the path, m."""


@dataclass(frozen=True)
class GroundReading:
    """Ground classes, colours and occupied cells of a cloud, from a first pass through it.

    Attributes:
        header: header of the cloud's file.
        classes: ids of the classes that its ground has.
        colored: whether any of its points has a colour that isn't black.
        cells: (C, 2) places in plan of some ground points, one in each square metre, map coordinates.
    """

    header: CloudHeader
    classes: Bool
    colored: bool
    cells: Float


def find_ground(cloud: Path, progress: Progress = silent) -> GroundReading:
    """Read a cloud once, in bounded memory; return its ground's classes and the square metres that they occupy.

    Raises:
        MissingFileError, InputError: there is no such cloud, it is damaged, or it has classes but no ground.
    """
    with open_cloud(cloud) as reader:
        header = reader.header
        names = header.scheme.names()
        ground_classes = np.array([names.get(number) in GROUND_CLASSES for number in range(256)])
        counts, colored, points = np.zeros(256, dtype=np.int64), False, 0
        # Dictionaries as sets that keep the order of their cells.
        ground_cells: dict[tuple[int, int], None] = {}
        other_cells: dict[tuple[int, int], None] = {}
        for block in reader.usable_blocks():
            counts += np.bincount(block.class_id, minlength=256)
            colored = colored or bool(block.rgb.any())
            ground = ground_classes[block.class_id]
            for cells, mask in ((ground_cells, ground), (other_cells, ~ground)):
                indices = np.unique(np.floor(block.xyz[mask, :2] / _CELL).astype(np.int64), axis=0)
                cells.update(dict.fromkeys(map(tuple, indices.tolist())))
            points += len(block)
            progress("looking for the road", points / max(header.count, 1))
    if counts[ground_classes].any():
        classes, cells = ground_classes, ground_cells
    elif all(names.get(int(number)) in UNSORTED_CLASSES for number in np.flatnonzero(counts)) and counts.any():
        # Nobody has sorted the cloud: all of it counts as ground.
        classes, cells = np.ones(256, dtype=bool), other_cells
    else:
        raise InputError(
            str(cloud), None, f"must hold points of at least one of the classes {', '.join(GROUND_CLASSES)}"
        )
    centres = _CELL * (np.array(list(cells), dtype=np.float64) + 0.5)
    return GroundReading(header, classes, colored, centres)


def path_through(ground: GroundReading) -> MeasuredAxis:
    """Return the line along the middle of a cloud's ground, found from its occupied cells, in map coordinates."""
    origin = np.floor(ground.cells.min(axis=0))
    return estimated_path(ground.cells - origin).translate((*origin, 0.0))


def strips(
    cloud: Path, ground: GroundReading, path: MeasuredAxis, frames: Frames, progress: Progress = silent
) -> Iterator[tuple[LearningRoad, Frames, Bool]]:
    """Yield a long road in overlapping strips along its path: ground points, local frames, mask of the strip's frames.

    The points lie in a temporary folder meanwhile, and in memory only those of one strip.

    Args:
        cloud: the cloud.
        ground: ground of the cloud, by `find_ground`.
        path: path along the road, map coordinates.
        frames: frames along the path, map coordinates.
        progress: called with the share of points that are sorted.

    Yields:
        the strip's points, its frames in the points' local coordinates, and a mask of the frames within the strip: the
        others belong to the neighbouring strips and are given so that sequences of slices reach across.
    """
    with tempfile.TemporaryDirectory(prefix="synthroads-strips-") as folder, TileFiles(Path(folder)) as files:
        _sort_points(files, cloud, ground, path, progress)
        strip_numbers = np.floor(frames.station / LENGTH).astype(np.int64)
        for (number, _), block in files.by_tile():
            first_station, last_station = number * LENGTH - MARGIN, (number + 1) * LENGTH + MARGIN
            in_strip = (frames.station >= first_station) & (frames.station < last_station)
            if number in strip_numbers:
                points = points_of(ground.header, [block], ground.colored)
                line = _cut_path(path, first_station - REACH, last_station + REACH).translate(-points.origin)
                local_frames = Frames(frames.position - points.origin[:2], frames.direction, frames.station).select(
                    in_strip
                )
                yield LearningRoad.of_points(cloud.stem, points, line), local_frames, strip_numbers[in_strip] == number


def _sort_points(files: TileFiles, cloud: Path, ground: GroundReading, path: MeasuredAxis, progress: Progress) -> None:
    """Write the cloud's ground points near the path to a file per strip, margins included."""
    points_done = 0
    with open_cloud(cloud) as reader:
        for block in reader.usable_blocks():
            points_done += len(block)
            ground_points = block.select(ground.classes[block.class_id])
            station, offset = path.project(ground_points.xyz)
            is_near = np.abs(offset) <= REACH
            ground_points, station = ground_points.select(is_near), station[is_near]
            touched_strips = np.concatenate([np.floor((station + margin) / LENGTH) for margin in (-MARGIN, MARGIN)])
            for number in np.unique(touched_strips).astype(np.int64):
                in_strip = (station >= number * LENGTH - MARGIN) & (station < (number + 1) * LENGTH + MARGIN)
                files.append(ground_points.select(in_strip), np.tile([number, 0], (np.count_nonzero(in_strip), 1)))
            progress("sorting points", points_done / max(ground.header.count, 1))


def _cut_path(path: MeasuredAxis, first_station: float, last_station: float) -> MeasuredAxis:
    """Return the part of a path between two stations (m), with one more vertex on either side."""
    first_vertex = max(0, int(np.searchsorted(path.station, first_station, "right")) - 1)
    end_vertex = min(len(path.points), int(np.searchsorted(path.station, last_station, "left")) + 1)
    first_vertex = min(first_vertex, end_vertex - 2) if end_vertex >= 2 else 0
    return MeasuredAxis(
        path.points[first_vertex : max(end_vertex, 2)], path.joined[first_vertex : max(end_vertex, 2) - 1]
    )
