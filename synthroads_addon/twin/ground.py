"""The ground beside the road as triangles, batters included: as fine as its tolerance asks, joined to the road."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..road.alignment import clip_offset
from ..road.geometry import RoadGeometry
from ..road.network.network import network_of
from ..road.network.patches import side_road_patches
from ..road.side_roads.mouth import Mouth
from ..road.surroundings import Terrain
from ..road.terrain import (
    batter_begin,
    foot_reach,
    ground_elevation,
    is_shaped,
    shaped_width,
    swale_share,
)
from .faces import Faces, Float, drop_unused_points, grid_corners, join_faces, split_quads, upward_triangles
from .strips import triangulate_rows
from .structure_ground import structure_ground_patch
from .surfaces import surface_points

GROUND_TOLERANCE = 0.03
"""Largest distance (m) of the ground from its surface, unless a larger one is asked for of everything."""
_SPACINGS = (8.0, 6.0, 4.0, 3.0, 2.0)
"""Spacings of rows and columns that are tried, m; the last one is taken where none keeps the tolerance."""
_LOOKED_AT = 5_000
"""Triangles at whose middles and edges the distance is measured."""
_FIRST_LOOK = 1.0  # m, between places at which a batter's toe is looked for
_HALVINGS = 30
_SHAPE_PIECES, _TOE_PIECES = 8, 8
"""Pieces of the ground's cross-section over crest or swale, and over the rounding of the toe or the ditch there."""
ROUNDING = 1e-6
"""Distance (m) up to which two stations are one."""
_LEAST_WIDTH = 0.3
"""Least width of crest or swale in the triangles, m."""


@dataclass(frozen=True)
class GroundSide:
    """The ground on one side of the road, sampled in rows across the road and columns outwards.

    Attributes:
        geometry: the road.
        sign: 1 on the left, -1 on the right.
        station: (R,) of the rows, m.
        edge: (R,) offsets of the road's edge, m.
        distance: (R, K) of the columns from there, m: the edge; where batters are rounded crest or swale; the toe; and
            evenly beyond it.
        swale: (R,) share of its full depth that the swale has; 0 where there is none.
    """

    geometry: RoadGeometry
    sign: float
    station: Float
    edge: Float
    distance: Float
    swale: Float

    def points(self, distance: Float) -> Float:
        """Return the ground's local points (R * K, 3) at distances (R, K) outwards from the road's edge, m."""
        curvature = self.geometry.alignment.curvature(self.station)
        offset = clip_offset(self.edge[:, None] + self.sign * distance, curvature[:, None])
        return surface_points(self.geometry, np.repeat(self.station, distance.shape[1]), offset.ravel())

    def triangles(self, road_stations: Float) -> Faces:
        """Return the ground's triangles, anticlockwise from above, with the road's edge points as their seam.

        Args:
            road_stations: (N,) stations at which the road's edge has points: the ground's are the same.
        """
        # Two parts, told apart by who numbers their points: the band from the road's edge to the first column, whose
        # inner side has the road's own points (the seam), and the grid of the columns beyond.
        rows, columns = self.distance.shape
        grid = self.points(self.distance)
        edge = self.geometry.offsets(road_stations)[:, 0 if self.sign > 0.0 else -1]
        seam = surface_points(self.geometry, road_stations, edge)
        seam_index, column_index = len(grid) + np.arange(len(road_stations)), np.arange(rows) * columns + 1
        seam_triangles = np.append(seam_index, column_index)[np.array(triangulate_rows(road_stations, self.station))]
        cells = grid_corners(rows, columns - 1)
        grid_triangles = split_quads(cells + cells // (columns - 1) + 1)
        # From above, the seam's triangles run anticlockwise on the left of the road, and the grid's on its right.
        corners = np.concatenate(
            [seam_triangles, grid_triangles[:, ::-1]] if self.sign > 0.0 else [seam_triangles[:, ::-1], grid_triangles]
        )
        points = np.concatenate([grid, seam])
        stations = np.concatenate([np.repeat(self.station, columns), road_stations])
        for start, end in [*((mouth.start, mouth.end) for mouth in self.mouths), *self.geometry.capped]:
            within = (stations >= start - ROUNDING) & (stations <= end + ROUNDING)
            corners = corners[~within[corners].all(axis=1)]
        triangles = upward_triangles(points, corners)
        parts = [*(self._around(mouth) for mouth in self.mouths), *self._at_structures()]
        return join_faces([triangles, *parts]) if parts else triangles

    def _at_structures(self) -> Iterator[Faces]:
        """Yield the triangles of the ground at each bridge and tunnel, which belong to the left side."""
        terrain = self.geometry.terrain
        if terrain is None or self.sign <= 0.0:
            return
        for structure in self.geometry.structures.values():
            patch = structure_ground_patch(self.geometry, structure, terrain)
            if patch:
                yield upward_triangles(patch.points.reshape(-1, 3), split_quads(patch.quads))

    @property
    def mouths(self) -> list[Mouth]:
        """Return the mouths of the side roads on this side."""
        return [mouth for mouth in self.geometry.mouths.values() if mouth.sign == self.sign]

    def _around(self, mouth: Mouth) -> Faces:
        """Return the triangles of the ground around a side road."""
        patches = side_road_patches(self.geometry, mouth, self.geometry.terrain)
        return join_faces(
            [
                upward_triangles(patch.points.reshape(-1, 3), split_quads(patch.quads(mouth.sign)))
                for patch in patches
                if patch.kind == "ground"
            ]
        )

    def swale_faces(self, width: float) -> Faces:
        """Return the triangles of a swale of a width (m) within the ground's reach; none where there is no cutting."""
        is_there = (self.swale[:-1] > 0.0) | (self.swale[1:] > 0.0)
        for start, end in self.geometry.capped:
            is_there &= (self.station[:-1] < start - ROUNDING) | (self.station[1:] > end + ROUNDING)
        rows = np.flatnonzero(is_there)
        distances = np.linspace(0.0, width, _SHAPE_PIECES + 1)
        points = self.points(np.minimum(distances, self.distance[:, -1:]))
        corners = grid_corners(len(self.station), len(distances)).reshape(len(self.station) - 1, -1, 4)
        triangles = split_quads(corners[rows].reshape(-1, 4))
        return upward_triangles(points, triangles[:, ::-1] if self.sign > 0.0 else triangles)

    def clip_to_band(self, start: float, end: float) -> Float:
        """Return the column distances (R, K) clipped to a band between two distances from the road's edge, m."""
        reach = self.distance[:, -1:]
        return np.clip(self.distance, min(max(start, 0.0), reach.min()), np.clip(end, 0.0, reach))


@dataclass(frozen=True)
class GroundMesh:
    """The triangulated ground beside a road, left and right, with its measured deviation.

    Attributes:
        sides: left and right.
        faces: triangles of each.
        deviation: farthest that they were measured to lie from the surface, m.
    """

    sides: tuple[GroundSide, GroundSide]
    faces: tuple[Faces, Faces]
    deviation: float


def triangulate_ground(geometry: RoadGeometry, terrain: Terrain, road_stations: Float, tolerance: float) -> GroundMesh:
    """Triangulate the ground beside a road as coarsely as `GROUND_TOLERANCE`, or a larger tolerance, allows.

    Args:
        geometry: the road.
        terrain: its terrain.
        road_stations: (N,) stations at which the road's surface has rows.
        tolerance: that of the model, m.
    """
    mesh: GroundMesh | None = None
    if geometry.crossing_roads:
        return _network_ground(geometry, terrain, road_stations)
    for spacing in _SPACINGS:
        sides = (_side(geometry, terrain, 1.0, spacing), _side(geometry, terrain, -1.0, spacing))
        faces = (sides[0].triangles(road_stations), sides[1].triangles(road_stations))
        mesh = GroundMesh(sides, faces, max(_deviation(geometry, part) for part in faces))
        if mesh.deviation <= max(tolerance, GROUND_TOLERANCE):
            break
    assert mesh
    return mesh


def _network_ground(geometry: RoadGeometry, terrain: Terrain, road_stations: Float) -> GroundMesh:
    """Return the one ground between all roads of a network, by the side of the main road that it lies on."""
    ground, _ = network_of(geometry).ground_beside(road_stations)
    _, offset = geometry.alignment.project(ground.points[ground.corners][..., :2].mean(axis=1))
    parts = [ground.corners[offset > 0.0], ground.corners[offset <= 0.0]]
    faces = [
        drop_unused_points(Faces(ground.points, part.ravel(), np.full(len(part), 3, dtype=np.int64))) for part in parts
    ]
    sides = (_side(geometry, terrain, 1.0, _SPACINGS[0]), _side(geometry, terrain, -1.0, _SPACINGS[0]))
    return GroundMesh(sides, (faces[0], faces[1]), 0.0)


def swales(name: str, terrain: Terrain, ground: GroundMesh) -> Iterator[tuple[str, Faces]]:
    """Yield (name, triangles) of the swales on each side that has any; the terrain's name begins theirs.

    Between the roads of a network none are told apart from the ground.
    """
    for side, part in zip(("left", "right"), ground.sides, strict=True):
        if part.geometry.crossing_roads:
            continue
        if part.swale.any() and len(faces := part.swale_faces(terrain.swale_width)):
            yield f"{name}/swale-{side}", faces


def _side(geometry: RoadGeometry, terrain: Terrain, sign: float, spacing: float) -> GroundSide:
    """Sample the ground on one side of the road in rows and columns that are `spacing` (m) apart at most.

    Rows lie also where the road's width bends, and columns also over the batter's shape (crest, swale, toe).
    """
    regular_stations = np.linspace(0.0, geometry.length, max(2, int(np.ceil(geometry.length / spacing)) + 1))
    kinks = [s for section in geometry.sections.values() for s in section.kinks() if 0.0 < s < geometry.length]
    borders = [s for mouth in geometry.mouths.values() for s in (mouth.start, mouth.end)]
    borders += [float(np.clip(s, 0.0, geometry.length)) for ends in geometry.capped for s in ends]
    station = np.unique(np.concatenate([regular_stations, kinks, borders]))
    edge = geometry.offsets(station)[:, 0 if sign > 0.0 else -1]
    reach = np.maximum(terrain.half_width - sign * edge, 0.0)
    ground_above_edge = ground_elevation(geometry, terrain, station, edge) - geometry.elevation(station, edge)
    toe = _toe_distance(geometry, terrain, station, edge, reach * sign, ground_above_edge)
    columns = _columns_to_toe(terrain, toe, ground_above_edge)
    outer_distances = np.arange(1, int(np.ceil(reach.max() / spacing)) + 1) * spacing
    outer_columns = np.clip(outer_distances[None, :], columns[:, -1:], reach[:, None])
    swale_shares = swale_share(np.nan_to_num(ground_above_edge)) * (terrain.swale_width > 0.0)
    distance = np.minimum(np.column_stack([np.zeros(len(station)), columns, outer_columns]), reach[:, None])
    return GroundSide(geometry, sign, station, edge, distance, swale_shares)


def _columns_to_toe(terrain: Terrain, toe: Float, ground_above_edge: Float) -> Float:
    """Return the distances (R, C) from the road's edge, m, of the columns up to where the batter has met the ground."""
    if not is_shaped(terrain):
        return toe[:, None]
    ground_above_edge = np.nan_to_num(ground_above_edge)
    # Not at the edge itself, where the road's points are.
    shape_width = np.maximum(shaped_width(terrain, ground_above_edge), _LEAST_WIDTH)
    reach_before_toe, reach_beyond_toe = foot_reach(terrain, ground_above_edge)
    toe_begin = np.maximum(toe - reach_before_toe, shape_width)
    toe_end = np.maximum(toe + reach_beyond_toe, toe_begin)
    shape_columns = shape_width[:, None] * (np.arange(1, _SHAPE_PIECES + 1) / _SHAPE_PIECES)
    toe_columns = toe_begin[:, None] + (toe_end - toe_begin)[:, None] * np.linspace(0.0, 1.0, _TOE_PIECES + 1)
    return np.column_stack([shape_columns, toe_columns])


def _toe_distance(
    geometry: RoadGeometry, terrain: Terrain, station: Float, edge: Float, reach: Float, ground_above_edge: Float
) -> Float:
    """Return the distance (R,) from the road's edge at which its batter meets the ground, m; the reach if nowhere.

    Args:
        geometry, terrain: the road and its ground.
        station, edge: (R,) stations, and offsets of the road's edge.
        reach: (R,) largest distance, negative on the right.
        ground_above_edge: (R,) height of the ground above the edge there, m.
    """
    edge_height, largest_distance = geometry.elevation(station, edge), np.abs(reach)
    batter_begins = batter_begin(terrain, ground_above_edge)[:, None]

    def excess_height(distance: Float) -> Float:
        """Return by how much the ground's height over the edge exceeds the batter's (R, D), m; -1 where unknown."""
        stations = np.repeat(station, distance.shape[1])
        offset = (edge[:, None] + np.sign(reach)[:, None] * distance).ravel()
        ground = ground_elevation(geometry, terrain, stations, offset).reshape(distance.shape)
        excess = (
            np.abs(ground - edge_height[:, None]) - np.maximum(distance - batter_begins, 0.0) / terrain.batter_slope
        )
        return np.where(np.isnan(excess), -1.0, excess)

    # The first place, from the edge outwards, at which ground and batter have met; bisection then narrows the toe down
    # between it and the place before.
    steps = np.linspace(0.0, 1.0, max(2, int(np.ceil(largest_distance.max() / _FIRST_LOOK)) + 1))
    has_met = excess_height(largest_distance[:, None] * steps) <= 0.0
    first_met = np.where(has_met.any(axis=1), has_met.argmax(axis=1), len(steps) - 1)
    upper = largest_distance * steps[first_met]
    lower = largest_distance * steps[np.maximum(first_met - 1, 0)]
    for _ in range(_HALVINGS):
        middle = (lower + upper) / 2.0
        has_met_at_middle = excess_height(middle[:, None])[:, 0] <= 0.0
        lower, upper = np.where(has_met_at_middle, lower, middle), np.where(has_met_at_middle, middle, upper)
    return np.where(has_met.any(axis=1), upper, largest_distance)


def _deviation(geometry: RoadGeometry, faces: Faces) -> float:
    """Return the largest vertical distance of sampled triangles from the ground, at centroids and edge middles, m."""
    return max((float(np.abs(distances).max()) for distances in _away(geometry, faces) if len(distances)), default=0.0)


def _away(geometry: RoadGeometry, faces: Faces) -> Iterator[Float]:
    """Yield the surface's height above the triangles, m: at their centroids, then at the middle of each edge."""
    corners = faces.corners.reshape(-1, 3)
    corners = corners[:: max(1, -(-len(corners) // _LOOKED_AT))]
    a, b, c = (faces.points[corners[:, number]] for number in range(3))
    for samples in ((a + b + c) / 3.0, (a + b) / 2.0, (b + c) / 2.0, (c + a) / 2.0):
        station, offset = geometry.alignment.project(samples[:, :2])
        on_road = (station >= 0.0) & (station <= geometry.length)
        yield (surface_points(geometry, station[on_road], offset[on_road]) - samples[on_road])[:, 2]
