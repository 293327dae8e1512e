"""Triangles of a side road: pavement, verges and the ground around it, in rows parallel to the main road's edge.

The mesh begins with the points that the main road's edges have there, so that it joins them without gap or overlap.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...base.arrays import Bool, Float, Int
from ..geometry import RoadGeometry
from ..ground.main_surface import side_road_surface_elevation
from ..guidelines import LIMITS, DesignLimits
from ..objects import width_at
from ..side_roads.mouth import ALONG, ARC_STEP, FADE, HIGH, LOW, Mouth
from ..surroundings import Terrain

_SPACING = 1.0
"""Spacing of rows behind the corners, m."""
_COARSE, _COARSE_FROM = 2.0, 20.0
"""Spacing of rows from a depth on, m."""
_VERGE_COLUMNS = 2
_END_ROWS = 0.25
"""Distance (m) between the last row of the pavement and the first of the ground behind its end."""


@dataclass(frozen=True)
class SurfacePatch:
    """A part of a side road's mesh: quadrilaterals whose corners follow each other row by row.

    Attributes:
        kind: ``pavement``, ``verge`` or ``ground``.
        station, depth: (R, C) of its points, m.
        points: (R, C, 3) local, m.
        outwards: (R, C) distance from the verge's outer edge, m; 0 on the pavement.
        flips: whether its columns run against the stations.
    """

    kind: str
    station: Float
    depth: Float
    points: Float
    outwards: Float
    flips: bool

    def quads(self, sign: float) -> Int:
        """Return its corners (Q, 4) as indices into its points, anticlockwise from above.

        Args:
            sign: 1 at the left carriageway, -1 at the right one.
        """
        rows, columns = self.station.shape
        first = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
        corners = np.stack([first, first + 1, first + columns + 1, first + columns], axis=1)
        return corners if (sign > 0.0) != self.flips else corners[:, ::-1]


def side_road_patches(geometry: RoadGeometry, mouth: Mouth, terrain: Terrain | None) -> list[SurfacePatch]:
    """Return a side road's patches: pavement, both verges, and where there is a terrain the ground around them."""
    reach = _terrain_reach(mouth, terrain)
    depths = _row_depths(mouth, min(mouth.reach, reach), reach)
    paved = depths <= mouth.reach + 1e-9
    low, high, middle = mouth.edge_station(LOW, depths), mouth.edge_station(HIGH, depths), mouth.axis_station(depths)
    station = np.hstack(
        [
            _between(low, middle, _shares(mouth, mouth.low.start_station, mouth.station)),
            _between(middle, high, _shares(mouth, mouth.station, mouth.high.start_station))[:, 1:],
        ]
    )
    patches = []
    depth = np.repeat(depths[:, None], station.shape[1], axis=1)
    patches += _split(geometry, mouth, "pavement", station, depth, paved, False)
    for sign, edge in ((LOW, low), (HIGH, high)):
        inner_station, inner_depth = edge, depths
        inner = mouth.plan(inner_station, inner_depth)
        outer = _verge_edge(mouth, sign, inner)
        outer_station, outer_depth = mouth.main_coordinates(outer)
        outer_station[0], outer_depth[0] = mouth.corner(sign).start_station, mouth.verge_width
        share = np.linspace(0.0, 1.0, _VERGE_COLUMNS)
        points = inner[:, None] + share[None, :, None] * (outer - inner)[:, None]
        verge_station, verge_depth = mouth.main_coordinates(points.reshape(-1, 2))
        verge_station, verge_depth = verge_station.reshape(points.shape[:2]), verge_depth.reshape(points.shape[:2])
        verge_station[:, 0], verge_depth[:, 0] = inner_station, inner_depth
        verge_station[:, -1], verge_depth[:, -1] = outer_station, outer_depth
        patches += _split(geometry, mouth, "verge", verge_station, verge_depth, paved, sign == LOW)
        if terrain is not None:
            end = mouth.start if sign == LOW else mouth.end
            shares = _shares(mouth, mouth.corner(sign).start_station, end)
            ground_station = _between(outer_station, np.full(len(depths), end), shares)
            ground_depth = np.repeat(outer_depth[:, None], len(shares), axis=1)
            outwards = np.maximum(ground_station - outer_station[:, None], outer_station[:, None] - ground_station)
            patch = _patch(geometry, mouth, "ground", ground_station, ground_depth, outwards, sign == LOW)
            patches.append(patch)
    return patches


def _terrain_reach(mouth: Mouth, terrain: Terrain | None) -> float:
    """Return the depth up to which there are rows, m."""
    if terrain is None:
        return mouth.reach
    edge = float(mouth.section.paved_edge(np.array([mouth.station]))[0])
    return max(terrain.half_width - edge, 1.0)


def _row_depths(mouth: Mouth, paved_reach: float, reach: float) -> Float:
    """Return the depths (R,) of the rows, m: those of the corners' points, then evenly up to the terrain's end."""
    depths = [np.zeros(1)]
    for corner in (mouth.low, mouth.high):
        count = int(np.ceil(abs(corner.sweep) / ARC_STEP)) + 1
        arc = corner.arc(np.linspace(0.0, 1.0, count)[1:], corner.radius)
        depths.append(mouth.main_coordinates(arc)[1])
    farthest = max(float(part[-1]) for part in depths)
    marks = [np.arange(farthest, _COARSE_FROM, _SPACING), np.arange(max(farthest, _COARSE_FROM), reach, _COARSE)]
    marks.append(np.arange(ALONG, mouth.side_road.blend_length, ALONG))
    marks.append(np.arange(paved_reach, min(paved_reach + FADE, reach), ALONG))
    marks.append(np.array([paved_reach, reach, min(paved_reach + _END_ROWS, reach)]))
    every = np.sort(np.concatenate([*depths, *marks]))
    every = every[(every >= 0.0) & (every <= reach)]
    kept = [every[0]]
    ends = {paved_reach, reach}
    for value in every[1:].tolist():
        if value - kept[-1] > 2e-3:
            kept.append(value)
        elif value in ends:
            kept[-1] = value
    return np.array(kept)


def _shares(mouth: Mouth, begin: float, end: float) -> Float:
    """Return the shares (C,) of the way from one station to another at which the main road's edge has points."""
    low, high = sorted((begin, end))
    stations = mouth.stations
    inside = stations[(stations >= low - 1e-9) & (stations <= high + 1e-9)]
    return np.sort((inside - begin) / (end - begin))


def _between(begin: Float, end: Float, share: Float) -> Float:
    """Return values (R, C) at shares (C,) of the way from begins to ends (R,)."""
    return begin[:, None] + share * (end - begin)[:, None]


def _verge_edge(mouth: Mouth, sign: float, inner: Float) -> Float:
    """Return the points (R, 2) of a verge's outer edge beside points of its inner edge."""
    corner = mouth.corner(sign)
    u, _ = mouth.local(inner)
    radial = corner.arc(corner.share_of(inner), corner.radius - mouth.verge_width)
    straight = inner + sign * mouth.verge_width * mouth.across
    return np.where((u >= corner.end_u)[:, None], straight, radial)


def _split(
    geometry: RoadGeometry,
    mouth: Mouth,
    kind: str,
    station: Float,
    depth: Float,
    paved: Bool,
    flips: bool,
) -> list[SurfacePatch]:
    """Return a patch up to the pavement's end, and what goes on behind it as ground."""
    count = int(np.count_nonzero(paved))
    parts = [_patch(geometry, mouth, kind, station[:count], depth[:count], np.zeros(station[:count].shape), flips)]
    if count < len(station):
        rest = slice(count - 1, None)
        away = np.maximum(depth[rest] - mouth.reach, 0.0)
        parts.append(_patch(geometry, mouth, "ground", station[rest], depth[rest], away, flips))
    return parts


def _patch(
    geometry: RoadGeometry, mouth: Mouth, kind: str, station: Float, depth: Float, outwards: Float, flips: bool
) -> SurfacePatch:
    """Return a patch with its points on the surface."""
    flat_station, flat_depth = station.ravel(), depth.ravel()
    offset = mouth.offset(flat_station, flat_depth)
    height = side_road_surface_elevation(geometry, flat_station, offset)
    if kind == "pavement":
        height = mouth.pavement_height(flat_station, flat_depth)
    elif kind == "verge":
        height = _verge_heights(mouth, flat_station, flat_depth, station.shape)
    points = np.column_stack([mouth.plan(flat_station, flat_depth), height])
    return SurfacePatch(kind, station, depth, points.reshape(*station.shape, 3), outwards, flips)


def _verge_heights(mouth: Mouth, station: Float, depth: Float, shape: tuple[int, ...]) -> Float:
    """Return the heights (N,) of a verge's points: the pavement's at its inner edge, falling outwards from there."""
    inner_height = mouth.pavement_height(station.reshape(shape)[:, 0], depth.reshape(shape)[:, 0])
    fall = mouth.section.carriageway.verge_slope_percent / 100.0
    share = np.linspace(0.0, 1.0, shape[1])
    return (inner_height[:, None] - fall * mouth.verge_width * share).ravel()


# --- paint --------------------------------------------------------------------------------------------------------

FILM = 0.003
"""Thickness of a side road's markings, m."""
_PIECE = 0.5
"""Longest piece of a line, m."""
_BEFORE_EDGE = 0.5
"""Distance of the priority line from the main road's edge, m; chosen."""
_SOLID, _BEHIND_BAR = 15.0, 1.0
"""Length of the solid line between the lanes, and its distance from the priority line, m; chosen."""


def side_road_paint(geometry: RoadGeometry, mouth: Mouth) -> list[Float]:
    """Return a side road's markings as quadrilaterals (4, 2) of station and offset, m, on the surface.

    They are its edge lines, which join the main road's around the corners, the line between its lanes, and the one at
    which it gives way.
    """
    road, limits = mouth.side_road, LIMITS[geometry.parameters.design_class]
    width = limits.narrow_line
    pieces: list[Float] = []
    if road.edge_lines:
        for sign in (LOW, HIGH):
            pieces += _edge_line(geometry, mouth, sign, width)
    angle = float(np.sin(np.deg2rad(road.angle_deg)))
    if road.priority != "none":
        pieces += _priority_line(mouth, limits)
    begin = (_bar_depths(road.priority, limits)[-1, 1] + _BEHIND_BAR) / angle
    if road.centre_line and road.lanes > 1:
        end = min(road.length, _depth_limit(geometry, mouth) / angle)
        solid_end = min(begin + _SOLID, end)
        spans = [(begin, solid_end)]
        dash_starts = np.arange(solid_end + limits.lane_gap, end, limits.lane_dash + limits.lane_gap)
        spans += [(start, min(start + limits.lane_dash, end)) for start in dash_starts.tolist()]
        for start, stop in spans:
            u = np.linspace(start, stop, max(2, int(np.ceil((stop - start) / _PIECE)) + 1))
            half = np.full(len(u), width / 2.0)
            pieces += _ribbon(mouth, mouth.place(u, -half), mouth.place(u, half))
    return pieces


def side_road_paint_points(geometry: RoadGeometry, mouth: Mouth) -> Float:
    """Return the corners (P, 4, 3) of a side road's markings, local, m, as high above its surface as their film."""
    pieces = side_road_paint(geometry, mouth)
    if not pieces:
        return np.empty((0, 4, 3))
    station, offset = np.concatenate(pieces).T
    depth = mouth.depth(station, offset)
    height = mouth.pavement_height(station, np.maximum(depth, 0.0))
    on_main = np.flatnonzero(depth < 0.0)
    height[on_main] = geometry.main_elevation(station[on_main], offset[on_main])
    return np.column_stack([geometry.alignment.place(station, offset), height + FILM]).reshape(-1, 4, 3)


def _depth_limit(geometry: RoadGeometry, mouth: Mouth) -> float:
    """Return the depth up to which its pavement is built, m."""
    return min(mouth.reach, _terrain_reach(mouth, geometry.terrain))


def _edge_line(geometry: RoadGeometry, mouth: Mouth, sign: float, width: float) -> list[Float]:
    """Return the pieces of the line along one edge and its corner."""
    road, corner = mouth.side_road, mouth.corner(sign)
    main_strip = float(width_at(mouth.section.carriageway.outer_edge_strip_width, np.array([corner.start_station]))[0])
    # A line lies within an edge strip that is wide enough for it, beside the lane.
    begin, end = max(main_strip, width), max(road.edge_strip_width, width)
    count = int(np.ceil(abs(corner.sweep) / ARC_STEP)) + 1
    share = np.linspace(0.0, 1.0, count)
    inside = begin + (end - begin) * share
    angle = corner.start_angle + share * corner.sweep
    direction = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    inner, outer = (corner.centre + (corner.radius + d)[:, None] * direction for d in (inside, inside - width))
    depth_share = np.sin(np.deg2rad(road.angle_deg))
    # The pavement's end is parallel to the main road's edge.
    last_u = _depth_limit(geometry, mouth) / depth_share - sign * road.half_width / np.tan(np.deg2rad(road.angle_deg))
    last_u = max(last_u, corner.end_u)
    u = np.linspace(corner.end_u, last_u, max(2, int(np.ceil((last_u - corner.end_u) / _SPACING)) + 1))[1:]
    straight = [mouth.place(u, np.full(len(u), sign * (road.half_width - d))) for d in (end, end - width)]
    return _ribbon(mouth, np.concatenate([inner, straight[0]]), np.concatenate([outer, straight[1]]))


def _bar_depths(priority: str, limits: DesignLimits) -> Float:
    """Return the depths (R, 2) between which the rows of a line for giving way or stopping lie, m."""
    if priority == "stop":
        return np.array([[_BEFORE_EDGE, _BEFORE_EDGE + limits.stop_depth]])
    first = _BEFORE_EDGE + np.arange(int(limits.give_way_rows)) * (limits.give_way_depth + limits.give_way_row_gap)
    return np.stack([first, first + limits.give_way_depth], axis=1)


def _priority_line(mouth: Mouth, limits: DesignLimits) -> list[Float]:
    """Return the pieces of the line before the main road's edge, across the lane of those who come."""
    road, width = mouth.side_road, limits.narrow_line
    block, gap = limits.give_way_block, limits.give_way_gap
    sign = mouth.incoming
    far = sign * (road.half_width - road.edge_strip_width)
    near = width if road.lanes > 1 else -far
    low, high = sorted((near * sign if road.lanes > 1 else near, far))
    edges = np.array([low, high])
    if road.priority == "give_way":
        count = max(1, int((high - low + gap) // (block + gap)))
        begin = (low + high - count * block - (count - 1) * gap) / 2.0
        starts = begin + np.arange(count) * (block + gap)
        spans = [(start, start + block) for start in starts.tolist()]
    else:
        spans = [tuple(pair) for pair in np.stack([edges[:-1], edges[1:]], axis=1).tolist()]
    slant = float(np.sin(np.deg2rad(road.angle_deg)))
    pieces = []
    for depths in _bar_depths(road.priority, limits):
        middle = mouth.axis_station(depths)
        for start, end in spans:
            v = np.linspace(start, end, max(2, int(np.ceil((end - start) / _PIECE)) + 1))
            rows = [
                mouth.plan(s + v / slant, np.full(len(v), d))
                for s, d in zip(middle.tolist(), depths.tolist(), strict=True)
            ]
            pieces += _ribbon(mouth, rows[0], rows[1])
    return pieces


def _ribbon(mouth: Mouth, first: Float, second: Float) -> list[Float]:
    """Return the quadrilaterals (4, 2), stations and offsets, between two rows of local points (N, 2), within reach."""
    rows = []
    for points in (first, second):
        station, depth = mouth.main_coordinates(points)
        rows.append(np.column_stack([station, mouth.offset(station, depth)]))
    quads = np.stack([rows[0][:-1], rows[1][:-1], rows[1][1:], rows[0][1:]], axis=1)
    along, across = quads[:, 2] - quads[:, 0], quads[:, 3] - quads[:, 1]
    is_clockwise = along[:, 0] * across[:, 1] - along[:, 1] * across[:, 0] < 0.0
    quads[is_clockwise] = quads[is_clockwise][:, ::-1]
    return list(quads)
