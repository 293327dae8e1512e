"""A ramp from where an exit's or entry's own part ends up to the mouth at the crossing road."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...base.arrays import Float
from ..alignment import Alignment, Element
from ..geometry import RoadGeometry
from ..other_roads.parts import ConnectingRamp
from ..profile import IntersectionPoint, Profile
from ..section_geometry import CarriagewaySection
from ..side_roads.mouth import Mouth
from ..turnout_geometry import TurnoutShape
from .grid import SurfaceGrid, axis_coordinates, smooth_share

BLEND_START, BLEND_END = 15.0, 8.0
"""Length (m) behind the cut, and before the mouth, over which a ramp's surface comes to its own. Chosen."""
_ROW, _TIGHT_ROW = 1.0, 0.5
"""Distance of rows in curves wider than `_TIGHT` and in tighter ones, m: the chord of 0.5 m at 45 m is 0.7 mm off."""
_TIGHT = 90.0
_STEP = 0.25
"""Distance (m) of the places by which direction and curvature at the cut are computed."""
LINE = 0.15
"""Width of a ramp's edge lines, m, where the turnout's aren't known."""


@dataclass(frozen=True)
class Cut:
    """Where an exit's or entry's ramp ends beside the main road, and the connecting ramp begins.

    Attributes:
        station: of the main road, m.
        ahead: 1 where the ramp leaves the main road with its stations, -1 against them.
        sign: 1 at the left carriageway, -1 at the right one.
        distances: (6,) from the centreline, m: outer edge of the main road's verge, then of the ramp the inner edge
            of its pavement and of its lane, the outer edge of the lane, of the pavement and of its verge.
        heights: (6,) local, m.
        points: (6, 2) local, m.
        verge: (2, 3) inner and outer edge of the main road's verge there, local, m.
    """

    station: float
    ahead: float
    sign: float
    distances: Float
    heights: Float
    points: Float
    verge: Float


def cut_of(geometry: RoadGeometry, section: CarriagewaySection, shape: TurnoutShape) -> Cut:
    """Return where a turnout's ramp ends, by the road's geometry."""
    ramp = shape.turnout.ramp
    assert ramp is not None
    station = shape.ramp_end()
    row = np.array([station])
    distances = section.distances(row)[0]
    heights = _heights(geometry, section, row, distances[None])[0]
    first = section.kinds.index("island")
    verge = float(section.verge_beside(row)[0])
    wanted = [distances[first] + verge]
    lane = section.kinds.index("turnout_lane")
    wanted += [distances[first + 1], distances[lane], distances[lane + 1], distances[-2], distances[-1]]
    sign = float(section.carriageway.sign)
    at = np.array(wanted)
    edge = np.array([distances[first], distances[first] + verge])
    return Cut(
        station,
        1.0 if shape.leaves_forward() else -1.0,
        sign,
        at,
        np.interp(at, distances, heights),
        geometry.alignment.place(np.full(len(at), station), sign * at),
        np.column_stack(
            [geometry.alignment.place(np.full(2, station), sign * edge), np.interp(edge, distances, heights)]
        ),
    )


def _heights(geometry: RoadGeometry, section: CarriagewaySection, station: Float, distances: Float) -> Float:
    """Return the local elevations (N, B) of the boundaries of a carriageway's strips at stations (N,), m."""
    crossfall = geometry.crossfall(section.carriageway, station)
    return geometry.profile.elevation(station)[:, None] + section.elevations(station, crossfall, distances)


@dataclass(frozen=True)
class Pose:
    """Place and direction in which a ramp goes on from its cut.

    Attributes:
        x, y: middle of its pavement, local, m.
        heading: away from the main road, rad.
        curvature: 1/m.
        height: m.
        grade: m/m, along its axis.
        crossfall: m/m, positive where it falls to the right.
    """

    x: float
    y: float
    heading: float
    curvature: float
    height: float
    grade: float
    crossfall: float


def pose_of(geometry: RoadGeometry, section: CarriagewaySection, shape: TurnoutShape, cut: Cut) -> Pose:
    """Return how the middle of a turnout's ramp runs at its cut, by its clothoid carried on."""
    ramp = shape.turnout.ramp
    assert ramp is not None
    middle = (cut.distances[1] + cut.distances[4]) / 2.0
    moved = ramp.length**3 / (6.0 * ramp.clothoid_parameter**2)
    along = np.arange(-2.0, 3.0) * _STEP
    distance = middle - moved + (ramp.length + along) ** 3 / (6.0 * ramp.clothoid_parameter**2)
    x, y = geometry.alignment.place(cut.station + cut.ahead * along, cut.sign * distance).T
    first = np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / (12.0 * _STEP)
    second = np.array([-1.0, 16.0, -30.0, 16.0, -1.0]) / (12.0 * _STEP**2)
    dx, dy, ddx, ddy = float(first @ x), float(first @ y), float(second @ x), float(second @ y)
    speed = float(np.hypot(dx, dy))
    heading, curvature = float(np.arctan2(dy, dx)), (dx * ddy - dy * ddx) / speed**3
    # The grade by the heights of its pavement's edges a little before the cut, where they are the turnout's.
    back = np.array([cut.station - cut.ahead * _STEP, cut.station])
    distances = section.distances(back)
    heights = _heights(geometry, section, back, distances)
    inner, outer = section.kinds.index("ramp_inner_strip"), len(section.kinds) - 1
    edges = heights[:, [inner, outer]].mean(axis=1)
    place = geometry.alignment.place(back, cut.sign * distances[:, [inner, outer]].mean(axis=1))
    grade = float((edges[1] - edges[0]) / np.hypot(*(place[1] - place[0])))
    across = cut.points[4] - cut.points[1]
    left = np.array([-np.sin(heading), np.cos(heading)])
    forward = np.array([np.cos(heading), np.sin(heading)])
    rise = float(cut.heights[4] - cut.heights[1]) - grade * float(across @ forward)
    return Pose(
        float(x[2]),
        float(y[2]),
        heading,
        curvature,
        float(np.mean(cut.heights[[1, 4]])),
        grade,
        rise / float(across @ left),
    )


def axis_of(ramp: ConnectingRamp) -> Alignment:
    """Return the axis of a connecting ramp, in local coordinates."""
    elements = [Element(e.length, e.curvature_start, e.curvature_end) for e in ramp.horizontal]
    return Alignment(elements, ramp.start_x, ramp.start_y, float(np.deg2rad(ramp.start_heading_deg)))


class RampSurfaceGrid:
    """The surface of a connecting ramp.

    Attributes:
        ramp: what the set says of it.
        cut: where it begins.
        mouth: where it joins the crossing road.
        line: width of its edge lines, m.
    """

    def __init__(self, ramp: ConnectingRamp, cut: Cut, mouth: Mouth, line: float) -> None:
        self.ramp, self.cut, self.mouth, self.line = ramp, cut, mouth, line
        self.axis = axis_of(ramp)
        self.profile = Profile([IntersectionPoint(p.station, p.elevation, p.radius) for p in ramp.vertical])

    @property
    def main_is_left(self) -> bool:
        """Return whether the main road lies to the left of its axis at the cut."""
        return self.cut.ahead * self.cut.sign < 0.0

    def crossfall(self, station: Float) -> Float:
        """Return its own crossfall (N,) at own stations (N,): m/m, positive where it falls to the right."""
        points = self.ramp.crossfall
        return np.interp(station, [p.station for p in points], [p.crossfall_percent for p in points]) / 100.0

    def own_height(self, station: Float, offset: Float) -> Float:
        """Return the height (N,) of its own surface at own stations and offsets (N,), m, carried on at its ends."""
        half = self.ramp.half_width
        paved = np.clip(offset, -half, half)
        fall = self.ramp.verge_slope_percent / 100.0 * (np.abs(offset) - np.abs(paved))
        return self.profile.elevation(station) + self.crossfall(station) * paved - fall

    @cached_property
    def columns(self) -> Float:
        """The offsets (C,) of its columns from left to right, m: verges, edges, lines."""
        ramp = self.ramp
        lane, half = ramp.lane_width / 2.0, ramp.half_width
        line = min(self.line, ramp.edge_strip_width - 0.01)
        right = [0.0, -lane, -lane - line, -half, -half - ramp.verge_width]
        return np.array([*(-np.array(right[:0:-1])), *right])

    @cached_property
    def rows(self) -> Float:
        """The own stations (R,) of its rows, m."""
        marks = np.unique(
            np.concatenate(
                [
                    self.axis.element_starts,
                    self.profile.breakpoints,
                    [p.station for p in self.ramp.crossfall],
                    [BLEND_START, self.axis.length - BLEND_END],
                ]
            ).clip(0.0, self.axis.length)
        )
        marks = marks[np.append(np.diff(marks) > 1e-3, True)]
        marks[-1] = self.axis.length
        pieces = []
        for begin, end in zip(marks[:-1].tolist(), marks[1:].tolist(), strict=True):
            curvature = np.abs(self.axis.curvature(np.linspace(begin, end, 5))).max()
            spacing = _TIGHT_ROW if curvature * _TIGHT > 1.0 or begin < BLEND_START else _ROW
            pieces.append(np.linspace(begin, end, max(1, int(np.ceil((end - begin) / spacing))) + 1)[:-1])
        return np.append(np.concatenate(pieces), marks[-1])

    @cached_property
    def grid(self) -> SurfaceGrid:
        """Its surface: it begins with the points of the main road's row at the cut, and ends with the mouth's."""
        station, columns = self.rows, self.columns
        begin, begin_heights = self._begin()
        end, end_heights = self._end()
        near = np.zeros(len(columns))
        start_station, start_offset = axis_coordinates(self.axis, begin, near)
        end_station, end_offset = axis_coordinates(self.axis, end, near + self.axis.length)
        kept = 1.0 - smooth_share(station / BLEND_START)[:, None]
        kept_end = 1.0 - smooth_share((self.axis.length - station) / BLEND_END)[:, None]
        along = np.asarray(
            station[:, None] + kept * start_station + kept_end * (end_station - self.axis.length), dtype=np.float64
        )
        offset: Float = columns + kept * (start_offset - columns) + kept_end * (end_offset - columns)
        shape = along.shape
        plan = self.axis.place(along.ravel(), offset.ravel()).reshape(*shape, 2)
        height = self.own_height(along.ravel(), offset.ravel()).reshape(shape)
        height += kept * (begin_heights - self.own_height(start_station, start_offset))
        height += kept_end * (end_heights - self.own_height(end_station, end_offset))
        points = np.dstack([plan, height])
        points[0], points[-1] = np.column_stack([begin, begin_heights]), np.column_stack([end, end_heights])
        kinds = ("verge", *["pavement"] * (len(columns) - 3), "verge")
        cells = (shape[0] - 1, shape[1] - 1)
        paint = np.zeros(cells, dtype=bool)
        paint[:, [2, -3]] = True
        return SurfaceGrid(points, along, offset, kinds, np.ones(cells, dtype=bool), paint)

    def _begin(self) -> tuple[Float, Float]:
        """Return the points (C, 2) and heights (C,) of its first row, on the main road's row at the cut."""
        d = self.cut.distances
        line = abs(self.columns[3] - self.columns[2])
        wanted = np.array([d[0], d[1], d[2] - line, d[2], (d[1] + d[4]) / 2.0, d[3], d[3] + line, d[4], d[5]])
        share = (wanted - d[0]) / (d[5] - d[0])
        points = self.cut.points[0] + share[:, None] * (self.cut.points[5] - self.cut.points[0])
        heights = np.interp(wanted, d, self.cut.heights)
        return (points, heights) if self.main_is_left else (points[::-1], heights[::-1])

    def _end(self) -> tuple[Float, Float]:
        """Return the points (C, 2) and heights (C,) of its last row, at the end of the mouth's straight stretch."""
        mouth, columns = self.mouth, self.columns
        # Its axis runs towards the crossing road, the mouth's away from it.
        left = np.array([-np.sin(self.axis.heading(self.axis.length)), np.cos(self.axis.heading(self.axis.length))])
        v = columns * float(np.sign(left @ mouth.across))
        u = np.full(len(columns), mouth.side_road.length)
        half = self.ramp.half_width
        paved = np.clip(v, -half, half)
        fall = mouth.section.carriageway.verge_slope_percent / 100.0
        return mouth.place(u, v), mouth.own_surface(u, paved) - fall * (np.abs(v) - np.abs(paved))
