"""The truth of a road's centreline and corridor at slices across it, from its parameters or a measured axis."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from synthroads_addon.base.arrays import Float
from synthroads_addon.base.errors import InputError
from synthroads_addon.road.axes.measured_axis import MeasuredAxis
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.section_geometry import CarriagewaySection
from synthroads_addon.road.turnout_geometry import TURNOUT_STRIPS

from .frames import Frames

TruthKind = Literal["road", "carriageway"]
TRUTH_KINDS: tuple[TruthKind, ...] = ("road", "carriageway")
Learned = Literal["road", "carriageway", "either"]
"""Truths that a model learns: of one kind, or of whole roads and of carriageways without shoulders as well."""
LEARNED_KINDS: tuple[Learned, ...] = (*TRUTH_KINDS, "either")

CORRIDOR = ("left_edge", "right_edge", "lanes", "lane_width", "heading", "height")
"""Columns of a corridor: y of the pavement's outer edges in the frame (m, left positive), number of lanes over both
directions, their mean width (m), direction of the centreline against the frame's (rad), its height above the slice's
origin (m). Of a carriageway they are those of the carriageway."""
STEP = 0.5
"""Distance of the vertices of lines that are made from parameters, m."""
_FULL_LANE = 2.5
"""A lane of less than this width (m) is just beginning or ending."""
_NO_LANE = 0.01
NO_SHOULDER = 1.2
"""Pavement beyond an edge line that is no shoulder yet, m."""


@dataclass(frozen=True)
class Truth:
    """Ground truth of a road: its centreline, and the corridor around it where known, at the axis' N vertices.

    Attributes:
        kind: ``road``, the middle of the whole road; ``carriageway``, the line between a carriageway's two lanes.
        axis: the centreline, in the coordinates of the cloud's points.
        left, right: outer edges of the pavement; None where they aren't known anywhere.
        lanes: (N,) number of lanes; NaN where one begins or ends, or where unknown.
        lane_width: (N,) mean width of the lanes, m, or NaN.
        lines: (N, 2) distances from the centre to the left and to the right edge line, m; NaN where they aren't known.
        room: (N, 2) distances to the left and to the right in which the scene belongs to this road alone, m; infinite
            for a whole road, for a carriageway up to the middle of the median.
        has_height: whether the axis' elevations are known.
    """

    kind: TruthKind
    axis: MeasuredAxis
    left: MeasuredAxis | None
    right: MeasuredAxis | None
    lanes: Float
    lane_width: Float
    lines: Float
    room: Float
    has_height: bool = True

    @classmethod
    def of_axis(cls, axis: MeasuredAxis, kind: TruthKind) -> Truth:
        """Return the truth of a measured centreline alone: corridor unknown (NaN), height only if z varies."""
        unknown = np.full(len(axis.points), np.nan)
        return cls(
            kind=kind,
            axis=axis,
            left=None,
            right=None,
            lanes=unknown,
            lane_width=unknown,
            lines=np.column_stack([unknown, unknown]),
            room=np.full((len(axis.points), 2), np.inf),
            has_height=bool(np.ptp(axis.points[:, 2]) > 0.0),
        )

    def translate(self, shift: ArrayLike) -> Truth:
        """Return the truth moved by a vector (3,), m."""
        return replace(
            self,
            axis=self.axis.translate(shift),
            left=None if self.left is None else self.left.translate(shift),
            right=None if self.right is None else self.right.translate(shift),
        )

    def at(self, frames: Frames) -> Crossings:
        """Return the truth where M frames' y axes cross it, signed as in the frames; heights are elevations, m."""
        center, station = self.axis.crossing(frames.position, frames.direction)
        turn = self.axis.direction(station) - frames.direction
        against = np.cos(turn) < 0.0
        unknown = np.full(len(center), np.nan)

        def as_seen(road_left: Float, road_right: Float) -> Float:
            """Return the road's left and right values as the frames' (M, 2): swapped where it runs against them."""
            return np.column_stack([np.where(against, road_right, road_left), np.where(against, road_left, road_right)])

        edges = [
            unknown if line is None else line.crossing(frames.position, frames.direction)[0]
            for line in (self.left, self.right)
        ]
        heading = (turn + np.pi / 2) % np.pi - np.pi / 2
        height = self.axis.elevation(station) if self.has_height else unknown
        lanes = [self._along(values, station) for values in (self.lanes, self.lane_width)]
        corridor = np.column_stack([as_seen(edges[0], edges[1]), *lanes, heading, height])
        corridor[np.isnan(center)] = np.nan
        lines, room = (
            as_seen(*(self._along(side, station) for side in side_values.T)) for side_values in (self.lines, self.room)
        )
        return Crossings(center, station, corridor, lines, room)

    @property
    def without_shoulders(self) -> bool:
        """Return whether this is a carriageway whose pavement nowhere reaches `NO_SHOULDER` beyond its edge lines."""
        if self.kind != "carriageway" or self.left is None or self.right is None:
            return False
        station = self.axis.station
        frames = Frames(self.axis.position(station), self.axis.direction(station), station)
        crossings = self.at(frames)
        sides = (
            np.column_stack([crossings.corridor[:, 0] - crossings.center, crossings.center - crossings.corridor[:, 1]])
            - crossings.lines
        )
        excesses = sides[np.isfinite(sides)]
        return bool(len(excesses)) and float(excesses.max()) <= NO_SHOULDER

    def _along(self, values: Float, station: Float) -> Float:
        """Return values (M,) interpolated at stations, NaN at NaN; the vertex before counts where one is infinite."""
        known_station = np.nan_to_num(station)
        vertex_after = np.clip(np.searchsorted(self.axis.station, known_station), 1, len(values) - 1)
        vertex_before = vertex_after - 1
        share = (known_station - self.axis.station[vertex_before]) / (
            self.axis.station[vertex_after] - self.axis.station[vertex_before]
        )
        infinite = np.isinf(values[vertex_before]) | np.isinf(values[vertex_after])
        with np.errstate(invalid="ignore"):
            interpolated = values[vertex_before] * (1.0 - share) + values[vertex_after] * share
        return np.where(np.isnan(station), np.nan, np.where(infinite, values[vertex_before], interpolated))


@dataclass(frozen=True)
class Crossings:
    """Ground truth of a road sampled in M frames.

    Attributes:
        center: (M,) y of the centreline, m; NaN where it has a gap.
        station: (M,) station of the truth's axis there, m.
        corridor: (M, K) columns `CORRIDOR`.
        lines, room: (M, 2) as `Truth`'s, to the frame's left and right.
    """

    center: Float
    station: Float
    corridor: Float
    lines: Float
    room: Float


def truths(parameters: RoadParameters, kind: Learned, origin: ArrayLike = (0.0, 0.0, 0.0)) -> list[Truth]:
    """Return the truths of a road: one of kind ``road``, one of kind ``carriageway`` for each with two lanes anywhere.

    Args:
        parameters: the road.
        kind: kind of centreline; ``either``: the road's, then that of each carriageway without shoulders, which by
            itself is like a road of two lanes.
        origin: (3,) map coordinates that were subtracted from the cloud's points.

    Raises:
        InputError: the kind isn't known.
    """
    if kind not in LEARNED_KINDS:
        raise InputError("truth", kind, f"must be one of {', '.join(LEARNED_KINDS)}")
    if kind == "either":
        without_shoulder_truths = [
            truth for truth in truths(parameters, "carriageway", origin) if truth.without_shoulders
        ]
        return [*truths(parameters, "road", origin), *without_shoulder_truths]
    geometry = RoadGeometry(parameters)
    shift: Float = np.array(parameters.transform.translate) - np.asarray(origin, dtype=np.float64)
    if kind == "road":
        return [_whole_road(geometry).translate(shift)]
    carriageways = (_carriageway(geometry, section) for section in geometry.sections.values())
    return [truth.translate(shift) for truth in carriageways if truth is not None]


def _whole_road(geometry: RoadGeometry) -> Truth:
    """Return the truth of a whole road: its axis, outer edges, and the lanes of both directions together."""
    axis = MeasuredAxis.of_road(geometry, STEP)
    station = _vertices(geometry)
    count, total = np.zeros(len(station)), np.zeros(len(station))
    edges: dict[str, Float] = {}
    for side, section in geometry.sections.items():
        number, width = _lanes(section, station)
        count, total = count + number, total + width
        edges[side] = section.carriageway.sign * _paved_edge(section, station)
    unknown = np.full(len(station), np.nan)
    distances = [np.abs(edges.get(side, unknown)) for side in ("left", "right")]
    return Truth(
        kind="road",
        axis=axis,
        left=_offset_line(geometry, station, edges.get("left", unknown)),
        right=_offset_line(geometry, station, edges.get("right", unknown)),
        lanes=count,
        lane_width=total / np.maximum(count, 1.0),
        lines=np.column_stack(distances),
        room=np.full((len(station), 2), np.inf),
    )


def _carriageway(geometry: RoadGeometry, section: CarriagewaySection) -> Truth | None:
    """Return the truth of one carriageway where it has exactly two full lanes; None if it has them nowhere."""
    station = _vertices(geometry)
    number, width = _lanes(section, station)
    boundaries = section.lane_boundaries(station)
    widths = -np.diff(boundaries, axis=1)
    outer_lane = np.argmax(widths >= _FULL_LANE, axis=1)
    row = np.arange(len(station))
    middle = np.where(number == 2, boundaries[row, np.minimum(outer_lane + 1, boundaries.shape[1] - 1)], np.nan)
    is_known = ~np.isnan(middle)
    if np.count_nonzero(is_known) < 2:
        return None
    sign = float(section.carriageway.sign)
    inner_edge, outer_edge = section.distances(station)[:, 0], _paved_edge(section, station)
    center = _points(geometry, station, sign * middle)[is_known]
    # Distances of the outer and the inner edge line, and how far the scene reaches, outwards and inwards.
    lines = np.column_stack([boundaries[:, 0] - middle, middle - boundaries[:, -1]])[is_known]
    room = np.column_stack([np.full(len(station), np.inf), middle])[is_known]
    outwards = 1 if sign > 0 else -1
    left_edge, right_edge = (outer_edge, inner_edge) if sign > 0 else (inner_edge, outer_edge)
    return Truth(
        kind="carriageway",
        axis=MeasuredAxis(center, np.diff(np.flatnonzero(is_known)) == 1),
        left=_offset_line(geometry, station, sign * left_edge),
        right=_offset_line(geometry, station, sign * right_edge),
        lanes=number[is_known],
        lane_width=(width / 2.0)[is_known],
        lines=lines[:, ::outwards],
        room=room[:, ::outwards],
    )


def _vertices(geometry: RoadGeometry) -> Float:
    """Return the stations (N,), m, at most `STEP` apart, at which lines are made from parameters."""
    return np.linspace(0.0, geometry.length, max(2, int(np.ceil(geometry.length / STEP)) + 1))


def _lanes(section: CarriagewaySection, station: Float) -> tuple[Float, Float]:
    """Return number and summed width (m) of a carriageway's full lanes, (N,); NaN where a lane begins or ends."""
    widths = np.abs(np.diff(section.lane_boundaries(station), axis=1))
    is_full, is_absent = widths >= _FULL_LANE, widths <= _NO_LANE
    is_clear = (is_full | is_absent).all(axis=1)
    total = np.where(is_full, widths, 0.0).sum(axis=1)
    return np.where(is_clear, is_full.sum(axis=1), np.nan), np.where(is_clear, total, np.nan)


def _paved_edge(section: CarriagewaySection, station: Float) -> Float:
    """Return distances (N,) of the pavement's outer edge from the road's axis, m; NaN beside a ramp."""
    edge = section.paved_edge(station)
    ramp = np.zeros(len(station), dtype=bool)
    for kind in ("island", "gore"):
        if kind in section.kinds and kind in TURNOUT_STRIPS:
            inner_boundary, outer_boundary = section.boundaries_of(kind, station)
            ramp |= outer_boundary - inner_boundary > 1e-6
    return np.where(ramp, np.nan, edge)


def _points(geometry: RoadGeometry, station: Float, offset: Float) -> Float:
    """Return points (N, 3) of the undamaged surface at offsets, m; z is the centreline's where the surface has none."""
    position, heading, _ = geometry.alignment.frame(station)
    plan = position + offset[:, None] * np.stack([-np.sin(heading), np.cos(heading)], axis=1)
    height = geometry.elevation(station, np.nan_to_num(offset))
    return np.column_stack([plan, np.where(np.isnan(height), geometry.profile.elevation(station), height)])


def _offset_line(geometry: RoadGeometry, station: Float, offset: Float) -> MeasuredAxis | None:
    """Return the line at offsets (N,), m, from the axis, with gaps where they are NaN; None without two vertices."""
    known_rows = np.flatnonzero(~np.isnan(offset))
    if len(known_rows) < 2:
        return None
    return MeasuredAxis(_points(geometry, station, offset)[known_rows], np.diff(known_rows) == 1)
