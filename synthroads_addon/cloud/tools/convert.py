"""Operations on a cloud's file: convert, thin out, map intensities, draw. All in memory that stays the same."""

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...base.arrays import Float
from ...base.classes import ClassScheme, class_scheme
from ...base.errors import InputError, OutputError
from ...base.files import check_file_target, made_folder, output_folder
from ...base.maps.places import Placement, bring_plan
from ...base.progress import Progress, silent
from ...base.remarks import warn
from ...base.schema import read_json
from ..flags import WITHHELD
from ..formats.reader import BLOCK, CloudReader
from ..formats.registry import check_ending, open_cloud, open_writer
from ..formats.writer import CloudWriter
from ..layers import PREDICTED
from ..points import PointBlock, concatenate
from ..strays import Strays
from .previews import CrossSection, TopView
from .quantile_mapping import IntensityMapping, steps_per_unit
from .subsample import GridSubsampler

KINDS = ("class", "predicted", "intensity", "rgb", "section")
"""Pictures that `draw_previews` draws, in files of `preview_file`."""


def convert(
    source: Path,
    output: Path,
    classes: str | None = None,
    overwrite: bool = False,
    progress: Progress = silent,
    block_size: int = BLOCK,
) -> dict[str, Any]:
    """Write a cloud in the format of another ending, or with merged classes; return what was done as JSON data.

    Args:
        source: the cloud.
        output: file to write.
        classes: scheme for `class_scheme`; the cloud's own if None.
        overwrite: whether the output may be replaced.
        progress: is told how far it is.
        block_size: points that are read at a time; the output doesn't depend on it.

    Raises:
        InputError: a file can't be read, or the scheme is unknown or doesn't suit the cloud.
        OutputError: the output is there already or can't be written.

    Example:
        >>> from pathlib import Path
        >>> import laspy
        >>> las = laspy.create(point_format=6, file_version="1.4")
        >>> las.x, las.y, las.z = [10.0, 60.0], [0.0, 0.0], [100.0, 101.0]
        >>> las.write("scan.las")
        >>> convert(Path("scan.las"), Path("scan.ply"))["points"]
        2
    """
    check_output(source, output, overwrite)
    with open_cloud(source) as cloud:
        scheme = scheme_of(cloud, classes)
        with writer_like(cloud, output, scheme) as writer:
            for points in pass_with_progress(cloud.blocks(block_size), cloud.header.count, progress, "convert"):
                writer.write(points)
        return summary_of(cloud, writer)


def subsample(
    source: Path,
    output: Path,
    cell: float,
    classes: str | None = None,
    overwrite: bool = False,
    progress: Progress = silent,
    block_size: int = BLOCK,
) -> dict[str, Any]:
    """Write one point per occupied cell (edge in m) of a cubic grid; return what was done as JSON data.

    Args:
        source: the cloud.
        output: file to write.
        cell: edge of the cells, m.
        classes: scheme for `class_scheme`; the cloud's own if None.
        overwrite: whether the output may be replaced.
        progress: is told how far it is.
        block_size: points that are read at a time; the output doesn't depend on it.
    """
    check_output(source, output, overwrite)
    with open_cloud(source) as cloud, made_folder(output.parent), GridSubsampler(cell, output.parent) as grid:
        scheme = scheme_of(cloud, classes)
        for points in pass_with_progress(cloud.usable_blocks(block_size), cloud.header.count, progress, "read"):
            grid.add(points)
        with writer_like(cloud, output, scheme) as writer:
            for points in grid.blocks():
                writer.write(points)
        return summary_of(cloud, writer) | {"grid": cell, "points_read": grid.points_read}


def map_intensity(
    source: Path,
    target: Path,
    output: Path,
    per_class: bool = False,
    overwrite: bool = False,
    progress: Progress = silent,
) -> dict[str, Any]:
    """Write a cloud with its intensities mapped onto another's distribution; return what was done as JSON data."""
    check_output(source, output, overwrite)
    check_output(target, output, overwrite)
    with open_cloud(source) as cloud, open_cloud(target) as target_cloud:
        mapping = IntensityMapping(cloud, target_cloud, per_class)
        with writer_like(cloud, output, scheme_of(cloud, None), mapping.scale) as writer:
            for block in pass_with_progress(mapping.blocks(cloud), cloud.header.count, progress, "map"):
                writer.write(block)
        result = summary_of(cloud, writer) | {
            "target": target_cloud.header.path.name,
            "distance_before": mapping.distance_before(),
            "distance_after": mapping.distance_after(),
        }
        if per_class:
            names = cloud.header.scheme.names()
            distances = {names.get(label, str(label)): gap for label, gap in mapping.class_distances().items()}
            result |= {"class_distances": distances, "classes_mapped_together": mapping.classes_without_target}
        return result


def preview_file(kind: str) -> str:
    """Return the file's name of a picture of `KINDS`."""
    return f"preview_{kind}.png"


def draw_previews(
    source: Path,
    output: Path,
    line: tuple[float, float, float, float] | None = None,
    station: float | None = None,
    centerline: Float | None = None,
    depth: float = 1.0,
    overwrite: bool = False,
    picture: str | None = None,
) -> dict[str, Any]:
    """Draw a cloud from above and in cross-section into PNG files; return what was drawn as JSON data.

    Args:
        output: folder for the pictures, `KINDS`; those by predicted class and by colour only if the cloud has these.
            With ``picture`` a .png file for this picture.
        line: x, y of the ends of the cut, from left to right; across the cloud's long axis if not given.
        station: where to cut, m along the centreline or the long axis; in its middle if not given.
        centerline: (N, 2) map coordinates that stations count along.
        depth: thickness of the slab that is cut out, m.
        picture: the one picture of `KINDS` that is wanted; all if None.

    Raises:
        InputError: the cloud can't be read, has no points or not what a picture shows, or the cut lies outside of it.
        OutputError: a picture is there already or can't be written.
    """
    single_file = output if output.suffix.lower() == ".png" and not output.is_dir() else None
    folder = output.parent if single_file else output
    if single_file and picture is None:
        raise OutputError("--output", str(output), _one_of_several())
    with open_cloud(source) as cloud:
        kinds = _kinds_of(cloud, picture)
        if single_file:
            check_file_target(single_file, overwrite=overwrite)
        names = {kind: single_file.name if single_file else preview_file(kind) for kind in kinds}
        with output_folder(folder, names.values(), overwrite) as work:
            counts, fields_by_kind = _draw(cloud, work, kinds, line, station, centerline, depth)
            for kind, name in names.items():
                (work / preview_file(kind)).replace(work / name)
    fields = {name: fields_by_kind[kind] for kind, name in names.items()}
    return {"file": source.name, "pictures": list(names.values()), "fields": fields} | counts


def _one_of_several() -> str:
    """Return the remedy for a single file that is to hold one picture of several."""
    kinds = ", ".join(KINDS[:-1])
    return f"names one picture of several: --picture {kinds} or {KINDS[-1]} says which; a folder gets all of them"


def _kinds_of(cloud: CloudReader, picture: str | None) -> list[str]:
    """Return the kinds of pictures to draw of a cloud: all that it has content for, or the one asked for.

    Raises:
        InputError: it lacks the content of that one.
    """
    absent = {"predicted": cloud.header.predicted is None, "rgb": not cloud.header.has_color}
    if picture and absent.get(picture):
        content = "predicted classes: `synthroads predict` adds them" if picture == "predicted" else "colours"
        raise InputError("--picture", picture, f"{cloud.header.path.name} has no {content}")
    return [picture] if picture else [kind for kind in KINDS if not absent.get(kind)]


def _draw(
    cloud: CloudReader,
    folder: Path,
    kinds: Sequence[str],
    line: tuple[float, float, float, float] | None,
    station: float | None,
    centerline: Float | None,
    depth: float,
) -> tuple[dict[str, Any], dict[str, str]]:
    """Draw a cloud's pictures into a folder, see `draw_previews`; return counts of points, and each picture's field."""
    header, strays = cloud.header, _strays_of(cloud)
    extent = _Extent(header.path, _staying_blocks(cloud, strays))
    start, end = (extent.start, extent.end) if centerline is None else (centerline[0], centerline[-1])
    right_reach, left_reach = extent.across(start, end)
    view = TopView(start, end, right_reach, left_reach, header.scheme)
    predicted = TopView(start, end, right_reach, left_reach, header.predicted) if "predicted" in kinds else None
    path = extent.axis() if centerline is None else centerline
    middle, rightward, reach = _cross_cut(line, station, path, max(1.0, (left_reach - right_reach) / 2), extent)
    slab: list[PointBlock] = []
    for block in _staying_blocks(cloud, strays):
        view.add(block)
        if predicted:
            predicted.add(block.with_arrays({"class_id": block.array(PREDICTED)}))
        distance = (block.xyz[:, :2] - middle) @ np.array([-rightward[1], rightward[0]])
        slab.append(block.select(np.abs(distance) <= depth / 2))
    fields = {kind: {"class": header.class_field, "predicted": PREDICTED}.get(kind, kind) for kind in kinds}
    view.save(folder, header.epsg, [kind for kind in kinds if kind not in ("predicted", "section")], fields)
    if predicted:
        predicted.save(folder, header.epsg, ["predicted"], fields)
    counts = {"points": int(view.raster.count.sum())} | ({"strays_left_out": strays.count()} if strays else {})
    if "section" not in kinds:
        return counts, fields
    slab_points = concatenate(slab)
    if len(slab_points) == 0:
        raise InputError("--line" if line else "--station", line or station, "meets no points of the cloud")
    section = _cross_section(slab_points, header.scheme, middle, rightward, depth, None if line is None else reach)
    fields["section"] = header.class_field if section.by_class else "intensity"
    section.save(folder / preview_file("section"), fields["section"])
    return counts | {"section_points": len(slab_points)}, fields


def _cross_section(
    points: PointBlock, scheme: ClassScheme, middle: Float, rightward: Float, depth: float, reach: float | None
) -> CrossSection:
    """Return a cross-section with its points; coloured by intensity where all of them have one class.

    Args:
        points: at least one, of a slice of the cloud.
        scheme: of their classes.
        middle: (2,) of the section, m.
        rightward: (2,) unit vector along it.
        depth: of the slice, m.
        reach: to either side of the middle, m; as far as the points lie if None.
    """
    heights = float(points.xyz[:, 2].min()), float(points.xyz[:, 2].max())
    if reach is None:
        reach = 1.02 * float(np.abs((points.xyz[:, :2] - middle) @ rightward).max()) + 0.5
    by_class = len(np.unique(points.class_id)) > 1
    section = CrossSection(middle, rightward, reach, depth, heights, scheme, by_class)
    section.add(points)
    return section


def _strays_of(cloud: CloudReader) -> Strays | None:
    """Return the detector of a cloud's stray points, which would make pictures too wide; None if there are none."""
    strays = Strays()
    for block in cloud.usable_blocks():
        strays.add(block.xyz)
    return strays if strays.count() else None


def _staying_blocks(cloud: CloudReader, strays: Strays | None) -> Iterator[PointBlock]:
    """Yield a cloud's blocks without their stray points."""
    for block in cloud.usable_blocks():
        yield block if strays is None else block.select(np.flatnonzero(strays.belongs(block.xyz)))


def read_centerline(path: Path, place: Placement | None = None) -> Float:
    """Read the first LineString of a GeoJSON file and return its points (N, 2).

    Args:
        path: the file.
        place: the system that they are wanted in; without it they stay as they stand in the file.

    Raises:
        InputError: it isn't GeoJSON with a line, or there is no way into that system.
    """
    data = read_json(path)
    try:
        shapes = [feature["geometry"] for feature in data["features"]] if "features" in data else [data]
        line = next(shape["coordinates"] for shape in shapes if shape["type"] == "LineString")
        points = np.array([point[:2] for point in line], dtype=np.float64)
    except (KeyError, TypeError, ValueError, IndexError, StopIteration):
        raise InputError(str(path), None, "must be GeoJSON with a LineString") from None
    if len(points) < 2 or np.ptp(points, axis=0).max() == 0:
        raise InputError(str(path), None, "must have a line of some length")
    return points if place is None else bring_plan(str(path), [points], data, place)[0]


class _Extent:
    """A cloud's extent in plan: its middle, its long axis, and its reach in any direction, from one pass.

    One look at the points is enough: of each block the outermost points in 48 directions are kept, between which
    nothing reaches out by more than 0.3 % of the cloud's radius.
    """

    _SLACK = 0.003

    def __init__(self, path: Path, blocks: Iterable[PointBlock]) -> None:
        angle = np.arange(24) * (np.pi / 24)
        directions = np.stack([np.cos(angle), np.sin(angle)])
        # Sums about the first point, so that map coordinates leave enough digits to the covariance.
        count, origin = 0, np.zeros(2)
        total, products = np.zeros(2), np.zeros((2, 2))
        outermost = []
        for block in blocks:
            if not len(block):
                continue
            origin = origin if count else block.xyz[0, :2].copy()
            offsets = block.xyz[:, :2] - origin
            count += len(offsets)
            total += offsets.sum(axis=0)
            products += offsets.T @ offsets
            projections = offsets @ directions
            outermost.append(offsets[np.r_[projections.argmin(axis=0), projections.argmax(axis=0)]])
        if count == 0:
            raise InputError(str(path), None, "has no points")
        self._outermost = np.concatenate(outermost) + origin
        self.middle = origin + total / count
        covariance = products / count - np.outer(total / count, total / count)
        axis = np.linalg.eigh(covariance)[1][:, 1]  # eigenvector of the larger eigenvalue
        self.along: Float = axis if axis[0] >= 0 else -axis
        begin, end = self._reach(self.middle, self.along)
        self.start, self.end = self.middle + begin * self.along, self.middle + end * self.along

    def across(self, start: Float, end: Float) -> tuple[float, float]:
        """Return the cloud's extent across a line, m: to the right (negative) and to the left, 1 m added to each.

        Args:
            start, end: (2,) of the line, map coordinates, m.
        """
        direction = np.asarray(end) - np.asarray(start)
        length = float(np.hypot(*direction))
        direction = direction / length if length else np.array([1.0, 0.0])
        right_reach, left_reach = self._reach(np.asarray(start), np.array([-direction[1], direction[0]]))
        return right_reach - 1.0, left_reach + 1.0

    def axis(self) -> Float:
        """Return both ends (2, 2) of the cloud's long axis, map coordinates, m."""
        return np.stack([self.start, self.end])

    def _reach(self, origin: Float, direction: Float) -> tuple[float, float]:
        """Return the least and the largest place, m, of the cloud along a unit vector (2,) from an origin (2,)."""
        projections = (self._outermost - origin) @ direction
        slack = self._SLACK * float(np.ptp(self._outermost, axis=0).max())
        return float(projections.min()) - slack, float(projections.max()) + slack


def _cross_cut(
    line: tuple[float, float, float, float] | None, station: float | None, path: Float, reach: float, extent: _Extent
) -> tuple[Float, Float, float]:
    """Return a cross-section's middle (2,), direction (2,) to the right, and reach (m) to either side.

    Args:
        line: x, y of its ends, from left to right; None: it lies across a path.
        station: along the path, m; None: in its middle.
        path: (N, 2) map coordinates, m.
        reach: to either side where it lies across a path, m.
        extent: of the cloud.

    Raises:
        InputError: the line has no length, or the station isn't on the path.
    """
    if line is not None:
        left_end, right_end = np.array(line[:2]), np.array(line[2:])
        length = float(np.hypot(*(right_end - left_end)))
        if not 0 < length < np.inf:
            raise InputError("--line", list(line), "must be two different points x y x y")
        return (left_end + right_end) / 2, (right_end - left_end) / length, length / 2
    steps = np.hypot(*np.diff(path, axis=0).T)
    stations = np.r_[0.0, np.cumsum(steps)]
    length = float(stations[-1])
    if length == 0:
        return extent.middle, np.array([0.0, -1.0]), reach
    station = length / 2 if station is None else station
    if not 0 <= station <= length:
        raise InputError("--station", station, f"must be 0 to {length:.1f} m")
    segment = int(np.clip(np.searchsorted(stations, station, side="right") - 1, 0, len(steps) - 1))
    while steps[segment] == 0:
        segment -= 1
    direction = (path[segment + 1] - path[segment]) / steps[segment]
    return path[segment] + direction * (station - stations[segment]), np.array([direction[1], -direction[0]]), reach


def scheme_of(cloud: CloudReader, classes: str | None) -> ClassScheme:
    """Return the class scheme to write a cloud with; raise `InputError` if the cloud's classes don't suit it."""
    header = cloud.header
    if classes is None or (header.labelled and classes == header.scheme.name):
        return header.scheme.as_stored()
    scheme = class_scheme(classes)
    if any(scheme.selectors()):
        finer_names = ", ".join(row.name for row in scheme.fine.values() if any(row.selectors()))
        raise InputError("--classes", classes, f"has {finer_names}, which the cloud doesn't distinguish: scan with it")
    if not header.labelled or header.scheme.name != "17":
        content = f"the classes {header.scheme.name}" if header.labelled else "LAS codes only"
        raise InputError(str(header.path), None, f"holds {content}: only the 17 classes can be merged into {classes}")
    return scheme


def writer_like(
    cloud: CloudReader,
    output: Path,
    scheme: ClassScheme,
    intensity_scale: float | None = None,
    offset: Float | None = None,
) -> CloudWriter:
    """Return the writer of a cloud that has what another one has; a context manager.

    Args:
        cloud: the other one.
        output: file to write.
        scheme: classes to write it with.
        intensity_scale: 16-bit steps per unit of intensity; the other one's if None.
        offset: map coordinates near the points, m, as `offset_of` finds them, which is done if None.
    """
    header = cloud.header
    offset = offset_of(cloud) if offset is None else offset
    scale = steps_per_unit(cloud) if intensity_scale is None else intensity_scale
    return open_writer(output, None, offset, scale, header.attributes, scheme, header.crs_text, header.standard_time)


def offset_of(cloud: CloudReader) -> Float:
    """Return map coordinates (3,) near a cloud's points, m: its own offset, or its first point where that is none."""
    offset = cloud.header.offset
    if cloud.header.labelled or np.any(offset):
        return offset
    return next((block.xyz[0] for block in cloud.blocks(1)), offset)


def summary_of(cloud: CloudReader, writer: CloudWriter) -> dict[str, Any]:
    """Return what was written of a cloud as JSON data; tell the user what the format has no fields for."""
    report_losses(cloud.header.path.name, [writer])
    return {
        "file": cloud.header.path.name,
        "output": str(writer.path),
        "points": writer.count,
        "intensity_clipped": writer.clipped,
        "class_scheme": writer.scheme.name,
        "left_out": list(cloud.header.left_out),
        "lost": dict(writer.lost),
    }


def report_losses(name: str, writers: Iterable[CloudWriter]) -> None:
    """Warn the user of flags that were lost, and of how many points, as the format written has no field for them.

    Args:
        name: of the cloud's file.
        writers: of the output.
    """
    losses: Counter[str] = Counter()
    kind = ""
    for writer in writers:
        losses.update(writer.lost)
        kind = writer.path.suffix.strip(".").upper()
    if withheld := losses.pop(WITHHELD, 0):
        warn(f"{name}: {withheld:,} withheld points left out: {kind} has no field for the flag")
    if losses:
        flag_counts = ", ".join(f"{flag} of {count:,} points" for flag, count in losses.items())
        warn(f"{name}: {flag_counts} lost: {kind} has no field for them")


def check_output(source: Path, output: Path, overwrite: bool) -> None:
    """Raise an error if the output file's ending, place or rights won't do, before any work."""
    check_ending(output, "--output")
    check_ending(source)
    if output.exists() and source.exists() and source.samefile(output):
        raise OutputError("--output", str(output), "must be another file than the input")
    check_file_target(output, overwrite=overwrite)


def pass_with_progress(
    blocks: Iterable[PointBlock], count: int, progress: Progress, stage: str
) -> Iterator[PointBlock]:
    """Yield blocks, and report the share of a number of points that has been passed on.

    Args:
        blocks: of points.
        count: points of all of them.
        progress: is told the share, 0 to 1, after each block.
        stage: name of the stage that it is told.
    """
    count_passed = 0
    for block in blocks:
        yield block
        count_passed += len(block)
        progress(stage, count_passed / max(count, 1))
