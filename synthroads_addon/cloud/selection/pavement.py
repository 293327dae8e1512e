"""Pavement and markings of a cloud without labels, told apart by where they lie beside the road's axis.

A marking is known by its line, never by a point's own intensity alone: its points would then be the bright ones by
definition, and their distribution would say nothing. Of every line that the user names by its offset

1. each stretch of `STRETCH` is shifted to where its points are brightest, at most `REACH` aside: axes are good to some
   decimetres, lines are a decimetre wide;
2. the points within half the line's width of it are its own;
3. they are inside a dash where the *medians* of the line's points within `ALONG` before and within `ALONG` behind both
   exceed Otsu's threshold of these medians: between dashes there is pavement, at their ends there is a bit of both.

The pavement is what lies between given offsets, more than `CLEAR` from every line's nominal place.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...base.arrays import Float, Index, otsu_threshold
from ...base.errors import InputError
from ...road.axes.measured_axis import MeasuredAxis
from .classes import RealClass, RealCloud, select_class

STRETCH = 20.0
REACH = 0.6
ALONG = 1.5
CLEAR = 0.9
"""m."""
_FARTHEST = 40.0
"""Points farther from the axis than this, m, are not looked at."""
_FEWEST_OF_LINE = 30


@dataclass(frozen=True)
class RoadClasses:
    """Road axis, and the offsets from it at which pavement and markings lie.

    Attributes:
        axis: CSV or GeoJSON, in the cloud's coordinates.
        paved: offsets (from, to) between which there is pavement, m, positive to the left.
        lines: offsets of the markings' middles, m.
        line_width: m.
    """

    axis: Path
    paved: tuple[tuple[float, float], ...]
    lines: tuple[float, ...]
    line_width: float = 0.15


def road_classes(cloud: RealCloud, road: RoadClasses, owner: str | None = None) -> dict[str, RealClass]:
    """Return the points of pavement (``paved``) and markings (``line``) of a cloud, told by offset from the axis.

    Args:
        cloud: with its points.
        road: axis and offsets.
        owner: of the fields ``paved`` and ``lines``, which errors put before their names; options if None.

    Raises:
        InputError: the axis can't be read, or too few points lie where pavement or markings should be.
    """
    station, offset = MeasuredAxis.read(road.axis, place=cloud.place).beside(cloud.xyz, _FARTHEST)
    is_clear = np.isfinite(offset)
    for line in road.lines:
        is_clear &= ~(np.abs(offset - line) < CLEAR)
    is_paved = np.zeros(len(offset), dtype=bool)
    for begin, end in road.paved:
        is_paved |= (offset > begin) & (offset < end)
    spans = " and ".join(f"{begin:g} to {end:g}" for begin, end in road.paved)
    fields = ("--paved", "--line") if owner is None else (f"{owner}paved", f"{owner}lines")
    result = {}
    if road.paved:
        selection = f"{spans} m from the axis, more than {CLEAR:g} m from the lines" if road.lines else f"{spans} m"
        result["paved"] = select_class(cloud, np.flatnonzero(is_paved & is_clear), selection, fields[0])
    if road.lines:
        dash_points, threshold = _points_on_dashes(cloud.intensity, station, offset, road, fields[1])
        selection = (
            f"within {road.line_width / 2:g} m of the lines at {', '.join(f'{line:g}' for line in road.lines)} m, "
            f"each {STRETCH:g} m of them moved by up to {REACH:g} m to where it is brightest, where the "
            f"median intensities of {ALONG:g} m of the line before and behind exceed {threshold:,.0f} (Otsu)"
        )
        result["line"] = select_class(cloud, dash_points, selection, fields[1])
    return result


def _points_on_dashes(
    intensity: Float, station: Float, offset: Float, road: RoadClasses, field: str
) -> tuple[Index, float]:
    """Return the indices of points on dashes, and Otsu's threshold of median intensities that told them apart.

    Args:
        intensity: (N,) of all points.
        station, offset: (N,) along and from the axis, m; NaN far from it.
        road: with the lines.
        field: that names the lines, for errors.

    Raises:
        InputError: no points lie at the lines.
    """
    half_width = road.line_width / 2.0
    points, medians = [], []
    for line in road.lines:
        nearby = np.flatnonzero(np.abs(offset - line) < REACH + half_width)
        stretch = np.floor(station[nearby] / STRETCH)
        for number in np.unique(stretch):
            rows = nearby[stretch == number]
            distance = offset[rows] - line
            shift = _brightest_shift(distance, intensity[rows], half_width)
            rows = rows[np.abs(distance - shift) <= half_width]
            if len(rows) >= _FEWEST_OF_LINE // 2:
                points.append(rows)
                medians.append(_median_along(station[rows], intensity[rows]))
    if not points:
        raise InputError(field, list(road.lines), "no points lie there")
    line_points, level = np.concatenate(points), np.concatenate(medians)
    threshold = otsu_threshold(level)
    return line_points[level > threshold], threshold


def _brightest_shift(distance: Float, intensity: Float, half_width: float) -> float:
    """Return the lateral shift of a line, m, at which the mean intensity of its points is largest.

    Args:
        distance: (N,) of the points from the line's nominal middle, m.
        intensity: (N,).
        half_width: of the line, m.
    """
    shifts = np.arange(-REACH, REACH + 1e-9, 0.02)
    is_on_line = np.abs(distance[:, None] - shifts) <= half_width
    count = is_on_line.sum(axis=0)
    mean = (intensity[:, None] * is_on_line).sum(axis=0) / np.maximum(count, 1)
    # Shifts at which the line would have few points don't count.
    is_dense = count >= max(5, count.max() // 3)
    return float(shifts[np.argmax(np.where(is_dense, mean, -np.inf))])


def _median_along(station: Float, intensity: Float) -> Float:
    """Return for each point (N,) the smaller of the median intensities within `ALONG` before and behind it.

    Args:
        station: (N,) m.
        intensity: (N,).
    """
    order = np.argsort(station, kind="stable")
    place, value = station[order], intensity[order]
    begin, end = np.searchsorted(place, place - ALONG), np.searchsorted(place, place + ALONG, side="right")
    result = np.empty(len(station))
    spans = zip(begin, range(len(station)), end, strict=True)
    result[order] = [min(np.median(value[a : i + 1]), np.median(value[i:b])) for a, i, b in spans]
    return result
