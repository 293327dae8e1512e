"""Carriageways of a parameter set from the sides of OpenDRIVE roads, and how far they are off."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ...base.arrays import Float
from ...base.schema import round_value
from ...road.geometry import RoadGeometry
from ...road.objects import Side, SignedWidthPoint, WidthPoint
from ...road.section import Carriageway, CrossfallPoint, Lane, Pavement, Turnout
from ...road.section_geometry import CarriagewaySection
from ...road.turnout_geometry import TURNOUT_STRIPS
from ..heights import HeightPiece
from .corners import Polyline, corners, polyline, rounded_points
from .loss import Loss
from .plane import Planes, RotationAxis, joined, planes
from .records import merged
from .shape import OUTSIDE, Boundaries, SideShape
from .strips import DRIVEN
from .turnouts import beside, read_turnouts

SIDE_OF: dict[int, Side] = {1: "left", -1: "right"}
WIDTH_TOLERANCE = 3e-4
"""Distance, m, that boundaries of strips keep from the file's cubics."""
TOLD = 1e-3
"""Distance, m, from which a deviation of the surface counts as lost."""
_STEEPEST_VERGE, _STEEPEST = 15.0, 12.0
_LANE, _SHOULDER, _STRIP = (2.0, 6.0), (0.0, 6.0), (0.0, 2.0)
_NONE = 1e-6
_STRAIGHT_PERCENT = 2e-4
_TURNOUTS = 5e-3
"""The same for turnouts' strips, whose rounded noses are polylines."""
_DIGITS = 6
Stations = Callable[[Float], Float]
"""Stations of the parameter set at those of the file, m."""


@dataclass(frozen=True)
class Verge:
    """The verge of a road that has none in its file: width (m) and fall (%)."""

    width: float
    slope: float = 8.0


@dataclass(frozen=True)
class Pavements:
    """Carriageways that roads of a file became.

    Attributes:
        carriageways: by side, instance 1.
        turnouts: by id, instance 1.
        heights: cubics of the profile in the file's stations; None where it is the file's elevation.
        lines: boundaries of each side's strips by station of the file.
        shapes: what they are made of.
        turnout_ids: ids of turnouts by side and instance in the file.
    """

    carriageways: dict[Side, Carriageway]
    turnouts: dict[str, Turnout]
    heights: list[HeightPiece] | None
    lines: dict[int, Polyline]
    shapes: dict[int, SideShape]
    turnout_ids: dict[tuple[int, str], str]


def pavements(sides: Sequence[SideShape], verge: Verge, stations: Stations, loss: Loss) -> Pavements:
    """Return the carriageways of the sides of one road, or of two roads along one line.

    Args:
        sides: at most one of each sign.
        verge: where the file has none.
        stations: of the parameter set.
        loss: what is approximated is added to it.
    """
    lines = {side.sign: _boundary_lines(side, loss) for side in sides}
    readings = {side.sign: read_turnouts(side, f"carriageway-{SIDE_OF[side.sign]}", loss) for side in sides}
    turnouts_by_sign = {sign: turnouts for sign, (turnouts, _) in readings.items()}
    instance_ids = {(sign, instance): name for sign, (_, ids) in readings.items() for instance, name in ids.items()}
    # The planes are fitted to the road without turnouts, whose ramps leave them.
    main_lines = {side.sign: _without_turnouts(side, lines[side.sign], turnouts_by_sign[side.sign]) for side in sides}
    road_planes = _planes(sides, main_lines)
    carriageways: dict[Side, Carriageway] = {}
    turnouts: dict[str, Turnout] = {}
    for side in sides:
        carriageways[SIDE_OF[side.sign]] = _carriageway(
            side, main_lines[side.sign], (road_planes, turnouts_by_sign[side.sign]), (verge, stations), loss
        )
        turnouts |= {key: _placed(item, stations) for key, item in turnouts_by_sign[side.sign].items()}
    if len(sides) == 2 and _touch(*(main_lines[side.sign] for side in sides)):
        # Both sides have one inner edge: the left one mirrors the right one, so that rounding opens no gap.
        right_inner = carriageways["right"].inner_offset
        mirrored = (
            tuple(point.model_copy(update={"width": -point.width}) for point in right_inner)
            if isinstance(right_inner, tuple)
            else -right_inner
        )
        carriageways["left"] = carriageways["left"].model_copy(update={"inner_offset": mirrored})
    return Pavements(
        carriageways, turnouts, road_planes.heights, lines, {side.sign: side for side in sides}, instance_ids
    )


def _touch(line: Polyline, other_line: Polyline) -> bool:
    """Return whether the inner edges of two carriageways, on either side of the line, are the same."""
    gap = line.values[:, 0] + other_line.at(line.stations)[:, 0]
    return float(np.abs(gap).max()) < 2.0 * WIDTH_TOLERANCE and float(np.abs(np.median(gap))) < _NONE


def _without_turnouts(side: SideShape, line: Polyline, turnouts: dict[str, Turnout]) -> Polyline:
    """Return a carriageway's boundaries without turnouts: the shoulder gives way to them, and the verge is wider."""
    widths = np.diff(line.values, axis=1)
    is_free = ~beside(line.stations, turnouts)
    shoulder, verge = paved_index(side) - 1, widths.shape[1] - 1
    if not is_free.any():  # beside turnouts a shoulder is never wider than elsewhere, and a verge never narrower
        widths[:, shoulder], widths[:, verge] = widths[:, shoulder].max(), widths[:, verge].min()
    else:
        for column in (shoulder, verge):
            widths[:, column] = np.interp(line.stations, line.stations[is_free], widths[is_free, column])
    widths[:, shoulder + 1 : verge] = 0.0  # the turnouts' own strips
    inner_edge = line.values[:, :1]
    return Polyline(line.stations, np.column_stack([inner_edge, inner_edge + np.cumsum(widths, axis=1)]), line.jumps)


def _placed(turnout: Turnout, stations: Stations) -> Turnout:
    """Return a turnout whose lowest station is one of the parameter set."""
    start = float(stations(np.array([turnout.start_station]))[0])
    return turnout.model_copy(update={"start_station": round_value(start, _DIGITS)})


def _boundary_lines(side: SideShape, loss: Loss) -> Polyline:
    """Return the distances of a side's strip boundaries by station of the file; negative widths are read as 0."""
    line = polyline(lambda s, n: side.boundaries(s, n).distances, side.breaks, WIDTH_TOLERANCE)
    for station, jump in line.jumps.tolist():
        loss.approximate("lane widths", "they jump, which takes 5 cm", jump, station)
    widths = np.diff(line.values, axis=1)
    if widths.min() < -TOLD:
        worst_station = float(line.stations[np.unravel_index(np.argmin(widths), widths.shape)[0]])
        loss.approximate("lane widths", "they are negative, read as 0", float(-widths.min()), worst_station)
        loss.surface = True
    values = np.column_stack([line.values[:, :1], line.values[:, :1] + np.cumsum(np.maximum(widths, 0.0), axis=1)])
    return Polyline(line.stations, values, line.jumps)


def _planes(sides: Sequence[SideShape], lines: Mapping[int, Polyline]) -> Planes:
    """Return the planes of the carriageways of one or two roads; `lines` are their strips' boundaries by sign."""
    if len({id(side.surface) for side in sides}) == 1:
        return planes(sides)
    # Two roads along one line: each rotation axis has a distance from the line on either side.
    right_side, left_side = sorted(sides, key=lambda side: side.sign)
    breaks = merged(np.concatenate([side.breaks for side in sides]), float(right_side.breaks[-1]))
    pivots: dict[RotationAxis, dict[int, Polyline]] = {"carriageway_axis": {}, "inner_edge": {}, "centreline": {}}
    for side in sides:
        boundaries, outer_column = lines[side.sign], paved_index(side)
        inner_edge, outer_edge = boundaries.values[:, [0]], boundaries.values[:, [outer_column]]
        distances_by_axis = {
            "carriageway_axis": 0.5 * (inner_edge + outer_edge),
            "inner_edge": inner_edge,
            "centreline": 0.0 * inner_edge,
        }
        for axis, lines_by_sign in pivots.items():
            lines_by_sign[side.sign] = Polyline(boundaries.stations, distances_by_axis[axis], boundaries.jumps)
    return joined(right_side, left_side, breaks, pivots)


def paved_index(side: SideShape) -> int:
    """Return the number of the boundary at which the pavement ends."""
    return 1 + len(side.layout.slots) + 2


def _carriageway(
    side: SideShape,
    line: Polyline,
    planes_and_turnouts: tuple[Planes, dict[str, Turnout]],
    verge_and_stations: tuple[Verge, Stations],
    loss: Loss,
) -> Carriageway:
    """Return the carriageway of a side from the boundaries of its strips by station; what is approximated is noted."""
    (road_planes, turnouts), (verge, stations) = planes_and_turnouts, verge_and_stations
    layout, line_stations = side.layout, stations(line.stations)
    widths = np.diff(line.values, axis=1)
    lane_count = len(layout.slots)
    lanes = []
    for n, slot in enumerate(layout.slots):
        lanes.append(Lane(width=_width(line_stations, widths[:, 1 + n], _LANE)))
        loss.read["lanes"] += 1
        for kind in sorted(slot.kinds - DRIVEN):
            loss.approximate("lanes", f"a {kind} lane between others is read as one that is driven on")
    verge_width, slope = widths[:, -1], verge.slope
    if verge_width.max() <= _NONE:
        verge_width = np.full(len(line_stations), verge.width)
    else:
        slope = _verge_slope(side, turnouts, verge.slope, loss)
    inner_corners = corners(line_stations, line.values[:, 0])
    rise = road_planes.rises[side.sign]
    percent = 100.0 * rise.values[:, 0]
    if np.abs(percent).max() > _STEEPEST:
        steepest_row = int(np.abs(percent).argmax())
        deviation = (abs(percent[steepest_row]) - _STEEPEST) / 100.0 * float(np.abs(line.values).max())
        text = f"it is {abs(percent[steepest_row]):.1f} %, but must be at most {_STEEPEST:g} %"
        loss.approximate("crossfall", text, deviation, float(rise.stations[steepest_row]))
        loss.surface = True
    falls = corners(stations(rise.stations), np.clip(percent, -_STEEPEST, _STEEPEST), _STRAIGHT_PERCENT)
    return Carriageway(
        instance=1,
        side=SIDE_OF[side.sign],
        inner_offset=_offset(inner_corners, line_stations),
        inner_edge_strip_width=_width(line_stations, widths[:, 0], _STRIP),
        lanes=tuple(reversed(lanes)),  # a set counts them from the outside
        outer_edge_strip_width=_width(line_stations, widths[:, 1 + lane_count], _STRIP),
        hard_shoulder_width=_width(line_stations, widths[:, 2 + lane_count], _SHOULDER),
        verge_width=_width(line_stations, verge_width, _SHOULDER),
        verge_slope_percent=slope,
        crossfall=tuple(
            CrossfallPoint(station=s, crossfall_percent=round_value(v, _DIGITS)) for s, v in rounded_points(falls)
        ),
        rotation_axis=road_planes.axis,
        traffic_side="left" if side.surface.road.left_hand else None,
        pavement=Pavement(),
    )


def _width(stations: Float, widths: Float, limits: tuple[float, float]) -> float | tuple[WidthPoint, ...]:
    """Return a width by station (m), or one number where it is constant and within the limits of one."""
    points = corners(stations, np.maximum(widths, 0.0))
    if len(points) == 1:
        value = round_value(points[0][1], _DIGITS)
        if limits[0] <= value <= limits[1]:
            return value
        points = [(float(stations[0]), value), (float(stations[-1]), value)]
    return tuple(WidthPoint(station=s, width=round_value(w, _DIGITS)) for s, w in rounded_points(points))


def _offset(points: list[tuple[float, float]], stations: Float) -> float | tuple[SignedWidthPoint, ...]:
    """Return a signed width by station (m), or one number where it is constant."""
    if len(points) == 1:
        return round_value(points[0][1], _DIGITS)
    return tuple(SignedWidthPoint(station=s, width=round_value(w, _DIGITS)) for s, w in rounded_points(points))


def _verge_slope(side: SideShape, turnouts: dict[str, Turnout], usual_fall: float, loss: Loss) -> float:
    """Return the fall, %, of a file's verge away from the pavement: the mean, weighted by area.

    Places beside turnouts, whose ramps bend the verge, count only if there are no others; then the median is returned.
    A verge without width in the middle of all stretches has the usual fall.
    """
    rows: list[tuple[float, float, float, bool]] = []  # length, width, fall (m), whether a turnout is near
    for stretch in range(len(side.breaks) - 1):
        middle = np.linspace(side.breaks[stretch], side.breaks[stretch + 1], 3)[1:2]
        boundaries = side.boundaries(middle, stretch)
        width = float(boundaries.distances[0, -1] - boundaries.distances[0, -2])
        fall = float(boundaries.inner_heights[0, -1] - boundaries.heights[0, -1])
        if width > _NONE:
            length = float(side.breaks[stretch + 1] - side.breaks[stretch])
            rows.append((length, width, fall, bool(beside(middle, turnouts).any())))
    loss.read["verges"] += 1
    if not rows:
        return usual_fall
    length, width, fall, is_near_turnout = np.array(rows).T
    is_free = is_near_turnout == 0.0
    if is_free.any():
        percent = 100.0 * float((length * fall)[is_free].sum() / (length * width)[is_free].sum())
    else:
        percent = 100.0 * float(np.median(np.repeat(fall / width, np.maximum(length, 1.0).astype(int))))
    return round_value(min(max(percent, 0.0), _STEEPEST_VERGE), 4)


class _Comparison(NamedTuple):
    """Boundaries of the file and of the set at some stations of a stretch.

    Attributes:
        stations: (N,) of the file, m.
        boundaries: of the file, (N, B).
        distances, heights: of the set's boundaries (N, C), m; heights above the file's elevation.
    """

    stations: Float
    boundaries: Boundaries
    distances: Float
    heights: Float


def deviations(parts: Pavements, road: RoadGeometry, stations: Stations, loss: Loss) -> dict[str, Any]:
    """Return how far the boundaries of a set's strips are from the file's, and note what is more than 1 mm off.

    Three stations of each stretch without a break are compared, but none within 6 cm behind a jump of the widths.
    """
    report: dict[str, Any] = {}
    levels = road.profile
    for sign, side in parts.shapes.items():
        section, jumps = road.sections[SIDE_OF[sign]], parts.lines[sign].jumps[:, 0]
        rows = []
        for stretch in range(len(side.breaks) - 1):
            start, end = float(side.breaks[stretch]), float(side.breaks[stretch + 1])
            station = start + (end - start) * np.array([0.1, 0.5, 0.9])
            if len(jumps):
                distance_behind = station[:, None] - jumps
                station = station[~((distance_behind >= 0.0) & (distance_behind < 0.06)).any(axis=1)]
            if not len(station):
                continue
            boundaries, set_station = side.boundaries(station, stretch), stations(station)
            set_distances = section.distances(set_station)
            crossfall = road.crossfall(section.carriageway, set_station)
            heights = levels.elevation(set_station)[:, None] + section.elevations(set_station, crossfall, set_distances)
            line_heights = side.surface.road.elevation.at(station, side.inside(station, stretch))[:, None]
            rows.append(_Comparison(station, boundaries, set_distances, heights - line_heights))
        report[SIDE_OF[sign]] = _worst(side, section, rows, stations, loss)
    return report


def _columns(column_mask: Any, strip_numbers: list[int]) -> list[int]:
    """Return for each chosen column the strip of which it is the outer boundary; the first column is the inner edge."""
    return [([0, *strip_numbers])[n] for n in np.flatnonzero(column_mask).tolist()]


def _worst(
    side: SideShape, section: CarriagewaySection, rows: Sequence[_Comparison], stations: Stations, loss: Loss
) -> dict[str, Any]:
    """Return the largest errors of offsets and heights of pavement, turnouts and verge, with their stations, in m.

    Strips of the file that have no width, or that the set lacks, are passed over.
    """
    kinds, turnouts = section.kinds, {str(n): shape.turnout for n, shape in enumerate(section.turnouts)}
    names = ["inner_edge_strip", *["lane"] * len(side.layout.slots), *OUTSIDE]
    station = np.concatenate([row.stations for row in rows])
    is_beside_turnout = beside(stations(station), turnouts)
    file_distances = np.concatenate([row.boundaries.distances for row in rows])
    file_heights = np.concatenate([row.boundaries.heights for row in rows])
    file_inner_heights = np.concatenate([row.boundaries.inner_heights for row in rows])
    set_distances = np.concatenate([row.distances for row in rows])
    set_heights = np.concatenate([row.heights for row in rows])
    # Strips that are nowhere wider than 0 aren't among the set's.
    strip_numbers = [
        n
        for n in range(len(names))
        if (file_distances[:, n + 1] - file_distances[:, n]).max() > _NONE and names[n] in kinds
    ]
    # Columns of the set's boundaries on the inner and outer side of each strip, then the file's on its outer side.
    inner_columns = [kinds.index(names[n]) + _lanes_before(names, strip_numbers, n) for n in strip_numbers]
    set_outer_columns = [0, *(n + 1 for n in inner_columns)]
    has_verge = bool(strip_numbers) and names[strip_numbers[-1]] == "verge"
    file_columns = [0, *(n + 1 for n in strip_numbers)]
    offset_errors = np.abs(set_distances[:, set_outer_columns] - file_distances[:, file_columns])
    height_errors = np.abs(set_heights[:, set_outer_columns] - file_heights[:, file_columns])
    has_width = np.diff(file_distances, axis=1)[:, strip_numbers] > _NONE
    # Inner borders count as well, which differ from the neighbour's where a lane is a step higher.
    height_errors[:, 1:] = np.where(
        has_width,
        np.maximum(
            height_errors[:, 1:], np.abs(set_heights[:, inner_columns] - file_inner_heights[:, file_columns[1:]])
        ),
        height_errors[:, 1:],
    )
    report: dict[str, Any] = {}
    for kind, values in (("offset", offset_errors), ("height", height_errors)):
        of_turnouts = np.array([False, *(names[n] in TURNOUT_STRIPS for n in strip_numbers)])
        of_verge = np.array([has_verge and n == len(file_columns) - 1 for n in range(len(file_columns))])
        parts = (
            ("pavement", ~of_turnouts & ~of_verge, TOLD),
            ("turnouts", of_turnouts, _TURNOUTS),
            ("verge", of_verge, TOLD),
        )
        for part, column_mask, limit in parts:
            errors = values[:, column_mask].copy()
            if part == "pavement":  # beside a turnout the shoulder is one of its strips
                errors[
                    np.ix_(
                        is_beside_turnout,
                        np.array([names[n] for n in _columns(column_mask, strip_numbers)]) == "hard_shoulder",
                    )
                ] = 0.0
            if not errors.size:
                continue
            worst_row = int(errors.max(axis=1).argmax())
            largest = float(errors.max())
            report[f"{part}_{kind}"] = round(largest, 6)
            report[f"{part}_{kind}_station"] = round(float(station[worst_row]), 3)
            if largest > limit:
                loss.approximate(f"{SIDE_OF[side.sign]} {part}", f"its {kind}s", largest, float(station[worst_row]))
                loss.surface = True
    return report


def _lanes_before(names: list[str], present: list[int], n: int) -> int:
    """Return how many lanes lie inside of lane n; 0 for other strips, whose names are unique."""
    return sum(names[m] == "lane" for m in present if m < n) if names[n] == "lane" else 0
