"""Clouds put together and divided: merge, crop, tile. All in memory that doesn't grow with the cloud."""

from contextlib import ExitStack
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from ...base.arrays import Bool, Float
from ...base.errors import InputError
from ...base.files import output_folder, writable_folder
from ...base.maps.places import Placement, bring_plan
from ...base.progress import Progress, silent
from ...base.schema import read_json
from ..formats.header import CloudHeader
from ..formats.reader import CloudReader
from ..formats.registry import ENDINGS, open_cloud
from ..formats.writer import CloudWriter
from .convert import check_output, offset_of, pass_with_progress, report_losses, scheme_of, summary_of, writer_like
from .quantile_mapping import steps_per_unit
from .subsample import TileFiles, keep_one_per_cell

Box = tuple[float, float, float, float]


def merge(sources: list[Path], output: Path, overwrite: bool = False, progress: Progress = silent) -> dict[str, Any]:
    """Write several clouds as one, in the order in which they are named; return what was done as JSON data.

    Strips keep their numbers, points their times. Intensities have the coarsest steps among the clouds.

    Raises:
        InputError: fewer than two clouds, one can't be read, or it has other classes, attributes or coordinates.
        OutputError: the output is there already or can't be written.
    """
    if len(sources) < 2:
        raise InputError("FILE", len(sources), "must be at least two clouds")
    for source in sources:
        check_output(source, output, overwrite)
    with ExitStack() as stack:
        clouds = [stack.enter_context(open_cloud(source)) for source in sources]
        for other in clouds[1:]:
            _check_alike(clouds[0], other)
        total = sum(cloud.header.count for cloud in clouds)
        blocks = chain.from_iterable(cloud.blocks() for cloud in clouds)
        scale = min(map(steps_per_unit, clouds))
        with writer_like(clouds[0], output, scheme_of(clouds[0], None), scale) as writer:
            for points in pass_with_progress(blocks, total, progress, "merge"):
                writer.write(points)
        return summary_of(clouds[0], writer) | {"files": [source.name for source in sources]}


def crop(
    source: Path,
    output: Path,
    box: Box | None = None,
    heights: tuple[float, float] | None = None,
    polygon: Path | None = None,
    overwrite: bool = False,
    progress: Progress = silent,
) -> dict[str, Any]:
    """Write the part of a cloud that lies within all that is given; return what was done as JSON data.

    Args:
        source: the cloud.
        output: file to write.
        box: least x and y, then largest, map, m; borders belong to it.
        heights: least and largest z, m.
        polygon: GeoJSON file with a Polygon or MultiPolygon, moved into the cloud's system; holes are left out.
        overwrite: whether the output may be replaced.
        progress: is told how far it is.

    Raises:
        InputError: nothing to crop by is given, limits are in the wrong order, or nothing lies within.
        OutputError: the output is there already or can't be written.

    Example:
        >>> from pathlib import Path
        >>> import laspy
        >>> las = laspy.create(point_format=6, file_version="1.4")
        >>> las.x, las.y, las.z = [10.0, 60.0], [0.0, 0.0], [100.0, 101.0]
        >>> las.write("scan.las")
        >>> crop(Path("scan.las"), Path("part.laz"), box=(0.0, -5.0, 50.0, 5.0))["points"]
        1
    """
    check_output(source, output, overwrite)
    if box is None and heights is None and polygon is None:
        raise InputError("--box", None, "give --box, --heights or --polygon, to say which points are kept")
    if box is not None and not (box[0] <= box[2] and box[1] <= box[3]):
        raise InputError("--box", list(box), "must be the smallest x and y, then the largest")
    if heights is not None and not heights[0] <= heights[1]:
        raise InputError("--heights", list(heights), "must be the smallest, then the largest")
    if polygon is not None:
        read_polygon(polygon)  # before the cloud is opened
    with open_cloud(source) as cloud:
        rings = None if polygon is None else read_polygon(polygon, cloud.header.place)
        with writer_like(cloud, output, scheme_of(cloud, None)) as writer:
            for points in pass_with_progress(cloud.blocks(), cloud.header.count, progress, "crop"):
                writer.write(points.select(_inside(points.xyz, box, heights, rings)))
            if not writer.count:
                raise InputError(str(source), None, "has no points within the chosen box, heights or polygon")
        return summary_of(cloud, writer) | {"points_read": cloud.header.count}


def _inside(
    xyz: Float,
    box: tuple[float, float, float, float] | None,
    heights: tuple[float, float] | None,
    rings: list[Float] | None,
) -> Bool:
    """Return a mask (N,) of the points that lie within all limits that are given.

    Args:
        xyz: (N, 3) map coordinates, m.
        box: least x and y, then largest, m; None without.
        heights: least and largest z, m; None without.
        rings: of polygons, see `points_in_rings`; None without.
    """
    mask = np.ones(len(xyz), dtype=bool)
    if box is not None:
        mask &= np.all((xyz[:, :2] >= box[:2]) & (xyz[:, :2] <= box[2:]), axis=1)
    if heights is not None:
        mask &= (xyz[:, 2] >= heights[0]) & (xyz[:, 2] <= heights[1])
    if rings is not None:
        mask &= points_in_rings(xyz[:, :2], rings)
    return mask


def tile(
    source: Path,
    folder: Path,
    size: float = 60.0,
    grid: float | None = None,
    fewest: int = 1,
    kind: str | None = None,
    overwrite: bool = False,
    progress: Progress = silent,
) -> dict[str, Any]:
    """Cut a cloud into square tiles, each a file named by its corner in whole metres; return JSON data.

    Args:
        source: the cloud.
        folder: for ``NAME_X_Y.laz`` and so on: X and Y of the corner of least coordinates, a multiple of the size.
        size: edge of a tile, m.
        grid: thin out to one point per cell of this edge, m; all stay if None.
        fewest: tiles with fewer points aren't written.
        kind: ending of the files; the cloud's own if None.
        overwrite: whether files of these names may be replaced.
        progress: is told how far it is.

    Raises:
        InputError: a number is out of its limits, or no tile has enough points.
        OutputError: a file is there already or can't be written.
    """
    ending = source.suffix.lower() if kind is None else f".{kind}"
    if ending not in ENDINGS:
        raise InputError("--format", kind, f"must be one of {', '.join(name.strip('.') for name in ENDINGS)}")
    if not 1.0 <= size <= 100_000.0:
        raise InputError("--size", size, "must be 1 to 100000 m")
    if grid is not None and not 0.0005 <= grid <= size:
        raise InputError("--grid", grid, "must be 0.0005 m to the tiles' size")
    tile_entries: list[dict[str, Any]] = []
    writers: list[CloudWriter] = []
    with writable_folder(folder), open_cloud(source) as cloud, ExitStack() as stack:
        files = stack.enter_context(TileFiles(folder))
        keys: set[tuple[int, int]] = set()
        blocks = cloud.blocks() if grid is None else cloud.usable_blocks()
        for points in pass_with_progress(blocks, cloud.header.count, progress, "read"):
            numbers = np.floor(points.xyz[:, :2] / size).astype(np.int64)
            keys |= {(int(x), int(y)) for x, y in np.unique(numbers, axis=0)}
            files.append(points, numbers)
        scheme, offset = scheme_of(cloud, None), offset_of(cloud)
        names = {key: f"{source.stem}_{_corner(key[0], size)}_{_corner(key[1], size)}{ending}" for key in keys}
        with output_folder(folder, names.values(), overwrite) as work:
            for number, (key, points) in enumerate(files.by_tile(), 1):
                tile_points = points if grid is None else points.select(np.sort(keep_one_per_cell(points, grid)))
                progress("tile", number / len(keys))
                if len(tile_points) >= fewest:
                    with writer_like(cloud, work / names[key], scheme, offset=offset) as writer:
                        writer.write(tile_points)
                    tile_entries.append({"file": names[key], "points": writer.count})
                    writers.append(writer)
            report_losses(source.name, writers)
            if not tile_entries:
                raise InputError("--fewest", fewest, "is more than the points of any tile")
    return {"file": source.name, "output": str(folder), "size": size, "grid": grid, "tiles": tile_entries}


def read_polygon(path: Path, place: Placement | None = None) -> list[Float]:
    """Return the rings (N, 2) of all polygons in a GeoJSON file, holes among them.

    Args:
        path: the file.
        place: the system that they are wanted in; without it they stay as they stand in the file.

    Raises:
        InputError: it isn't GeoJSON with a polygon, or there is no way into that system.
    """
    data = read_json(path)
    try:
        shapes = [feature["geometry"] for feature in data["features"]] if "features" in data else [data]
        shapes = [shape.get("geometry", shape) for shape in shapes]
        polygons = [shape["coordinates"] for shape in shapes if shape["type"] == "Polygon"]
        polygons += [part for shape in shapes if shape["type"] == "MultiPolygon" for part in shape["coordinates"]]
        rings = [np.array([point[:2] for point in ring], dtype=np.float64) for part in polygons for ring in part]
    except (KeyError, TypeError, ValueError, IndexError, AttributeError):
        rings = []
    if not rings or any(ring.ndim != 2 or len(ring) < 4 or not np.isfinite(ring).all() for ring in rings):
        raise InputError(str(path), None, "must be GeoJSON with a Polygon of 4 points or more in each ring")
    return rings if place is None else bring_plan(str(path), rings, data, place)


def points_in_rings(points: Float, rings: list[Float]) -> Bool:
    """Return a mask (N,) of the points (N, 2) in an odd number of rings: within polygons, but not within their holes.

    A ray from the point to the right crosses the sides of a ring that it lies in an odd number of times.

    Example:
        >>> import numpy as np
        >>> outer = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]])
        >>> hole = np.array([[4.0, 4.0], [6.0, 4.0], [6.0, 6.0], [4.0, 6.0]])
        >>> points_in_rings(np.array([[1.0, 1.0], [5.0, 5.0], [11.0, 5.0]]), [outer, hole]).tolist()
        [True, False, False]
    """
    is_inside = np.zeros(len(points), dtype=bool)
    x, y = points.T
    for ring in rings:
        begin, end = ring, np.roll(ring, -1, axis=0)
        candidates = np.flatnonzero((y >= ring[:, 1].min()) & (y <= ring[:, 1].max()) & (x <= ring[:, 0].max()))
        for (x1, y1), (x2, y2) in zip(begin, end, strict=True):
            if y1 == y2:
                continue
            # Points at the height of the side, of its lower end included and its upper one not.
            rows = candidates[(y[candidates] >= min(y1, y2)) & (y[candidates] < max(y1, y2))]
            side_x = x1 + (y[rows] - y1) / (y2 - y1) * (x2 - x1)
            is_inside[rows[side_x > x[rows]]] ^= True
    return is_inside


def _corner(number: int, size: float) -> str:
    """Return a corner's coordinate for a file's name: in whole metres where the size is whole."""
    return str(int(number * size)) if float(size).is_integer() else f"{number * size:.3f}".rstrip("0")


def _system_of(header: CloudHeader) -> object:
    """Return a value that is equal for clouds of the same coordinate system: its codes, or its text if it has none."""
    system = header.system
    return system and ((system.epsg, system.height_epsg) if system.epsg else system.text)


def _check_alike(reference: CloudReader, other: CloudReader) -> None:
    """Raise `InputError` if a cloud can't stand in one file with a reference cloud."""
    reference_header, header = reference.header, other.header
    for property_name, expected, value in (
        ("attributes", sorted(reference_header.attributes), sorted(header.attributes)),
        (
            "classes",
            reference_header.scheme.to_dict() if reference_header.labelled else None,
            header.scheme.to_dict() if header.labelled else None,
        ),
        ("coordinate system", _system_of(reference_header), _system_of(header)),
        ("colours", reference_header.has_color, header.has_color),
        ("unit of intensity", reference_header.intensity_scale is None, header.intensity_scale is None),
        ("epoch of GPS time", reference_header.standard_time, header.standard_time),
    ):
        if expected != value:
            raise InputError(
                str(header.path),
                None,
                f"has a different {property_name} from {reference_header.path.name}: convert one first",
            )
