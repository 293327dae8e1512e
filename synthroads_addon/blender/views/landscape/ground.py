"""The land's surface as one mesh of triangles: parcels as exact polygons, finer near the road."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import bpy
import numpy as np
from mathutils import Vector
from mathutils.geometry import delaunay_2d_cdt

from ....base.arrays import Bool, Float, Int
from ....road.alignment import left_vectors
from ....road.geometry import RoadGeometry
from ....road.landscape.parcels import KINDS, Parcels
from ....road.landscape.relief import LandRelief
from ...materials.looks import ROWS
from ...things.meshes import fill

MATERIALS = {"forest": "leaves", "meadow": "grass_ground", "soil": "soil"} | {
    k: k for k in ("wheat", "crop", "rapeseed")
}
"""Material of the ground by the use of a parcel; a forest's ground is hidden below its crowns."""
_RINGS = ((0.0, 20.0), (200.0, 40.0), (500.0, 80.0), (1200.0, 160.0), (2500.0, 320.0))
"""Distances from the road (m) at which grids of points begin, and the width (m) of their cells; chosen."""
_DEPTH, _OVERLAP = 0.15, 1.0
"""Depth of the land below the terrain's border, and its width there, m: it overlaps the terrain; chosen."""
_BORDER_STEP = 12.0
"""Distance between points on that border, m; chosen."""
_PLAIN_RADIUS, _PLAIN_CORNERS = 15_000.0, 24
"""Radius (m) of the plain beyond the landscape's reach, and the number of its corners; chosen."""
_MERGE_DISTANCE = 0.01
"""Distance up to which points are merged, m; chosen."""


def ground_mesh(
    geometry: RoadGeometry, relief: LandRelief, parcels: Parcels, material: Callable[[str], bpy.types.Material]
) -> bpy.types.Mesh:
    """Create the mesh of the land beside terrain and road, in local coordinates, its faces with their materials."""
    border, edges = _border(geometry, relief)
    parcel_corners = parcels.corners.reshape(-1, 2)
    parcel_sides = np.arange(len(parcel_corners)).reshape(-1, 4)
    parcel_sides = np.stack([parcel_sides, np.roll(parcel_sides, -1, axis=1)], axis=-1).reshape(-1, 2)
    grid_points = np.concatenate([*_ring_points(geometry, relief), _horizon(parcels)])
    plan = np.concatenate([border, parcel_corners, grid_points])
    # Edges of the triangulation: the border of the terrain, and the four sides of each parcel.
    points, triangles = _triangulate(plan, np.concatenate([edges, parcel_sides + len(border)]))
    centres = points[triangles].mean(axis=1)
    is_land = ~_in_corridor(geometry, relief, centres, 0.0)
    triangles, centres = triangles[is_land], centres[is_land]
    station, offset = geometry.alignment.project(points)
    z = relief.elevation_beside(points, station, offset)
    # The border lies within the terrain, and a little below it, so that no gap is seen.
    z[np.abs(offset) < relief.half_width - _OVERLAP / 2.0] -= _DEPTH
    mesh = bpy.data.meshes.new("SR Landscape Ground")
    fill(mesh, np.column_stack([points, z]), faces=triangles)
    _dress(mesh, parcels, parcels.of_points(centres), material)
    return mesh


def _dress(
    mesh: bpy.types.Mesh, parcels: Parcels, parcel_numbers: Int, material: Callable[[str], bpy.types.Material]
) -> None:
    """Give faces the materials and rows of crop of their parcels (F,), -1 for none; faces without one are fields."""
    for kind in KINDS:
        mesh.materials.append(material(MATERIALS[kind]))
    kinds = np.where(parcel_numbers >= 0, parcels.kind[parcel_numbers], KINDS.index("crop"))
    mesh.polygons.foreach_set("material_index", kinds.astype(np.int32))
    row_normals = np.zeros((len(parcel_numbers), 3), dtype=np.float32)
    row_normals[:, 0], row_normals[:, 1] = -parcels.rows[parcel_numbers, 1], parcels.rows[parcel_numbers, 0]
    mesh.attributes.new(ROWS, "FLOAT_VECTOR", "FACE").data.foreach_set("vector", row_normals.ravel())
    mesh.polygons.foreach_set("use_smooth", np.ones(len(parcel_numbers), dtype=np.bool_))


def place_beyond(geometry: RoadGeometry, station: Float, offset: Float) -> Float:
    """Return local points (N, 2) at stations and offsets (N,); beyond an end of the road along its tangent there."""
    road_station = np.clip(station, 0.0, geometry.length)
    position, heading, _ = geometry.alignment.frame(road_station)
    direction = np.column_stack([np.cos(heading), np.sin(heading)])
    extension = (station - road_station)[:, None] * direction
    return np.asarray(position + extension + offset[:, None] * left_vectors(heading))


def _border(geometry: RoadGeometry, relief: LandRelief) -> tuple[Float, Int]:
    """Return the outline of the terrain with the road's prolongations: corners (N, 2), m, and edges (N, 2)."""
    reach = relief.landscape.reach * 1.5
    distances = np.concatenate([np.arange(0.0, 200.0, 25.0), np.geomspace(200.0, reach, 16)])
    count = max(2, int(geometry.length / _BORDER_STEP))
    station = np.concatenate(
        [-distances[:0:-1], np.linspace(0.0, geometry.length, count), geometry.length + distances[1:]]
    )
    offset = np.full(len(station), relief.half_width - _OVERLAP)
    sides = [place_beyond(geometry, station, offset), place_beyond(geometry, station[::-1], -offset)]
    ring = np.concatenate(sides)
    corner_numbers = np.arange(len(ring))
    return ring, np.column_stack([corner_numbers, np.roll(corner_numbers, -1)])


def _ring_points(geometry: RoadGeometry, relief: LandRelief) -> Iterator[Float]:
    """Yield points (N, 2), m, of square grids around the road, with wider cells farther from it."""
    station = np.linspace(0.0, geometry.length, 64)
    axis = geometry.alignment.position(station)
    ring_ends = [*(ring_start for ring_start, _ in _RINGS[1:]), np.inf]
    for (ring_start, cell), ring_end in zip(_RINGS, ring_ends, strict=True):
        reach = min(ring_end + relief.half_width, relief.landscape.reach)
        first_cell, last_cell = np.floor((axis.min(axis=0) - reach) / cell), np.ceil((axis.max(axis=0) + reach) / cell)
        grid = np.stack(
            np.meshgrid(*(np.arange(a, b + 1.0) * cell for a, b in zip(first_cell, last_cell, strict=True))), axis=-1
        )
        plan = grid.reshape(-1, 2)
        # Distance from the terrain and the road's prolongations: beside, ahead, or both at the ends' corners.
        plan_station, offset = geometry.alignment.project(plan)
        distance_ahead = np.maximum(np.maximum(-plan_station, plan_station - geometry.length), 0.0)
        distance = np.hypot(distance_ahead, np.maximum(np.abs(offset) - relief.half_width, 0.0))
        yield plan[(distance >= ring_start) & (distance < ring_end) & (np.abs(offset) > relief.half_width + cell / 3.0)]


def _horizon(parcels: Parcels) -> Float:
    """Return the corners (N, 2), m, of the plain beyond the landscape."""
    angle = 2.0 * np.pi * np.arange(_PLAIN_CORNERS) / _PLAIN_CORNERS
    centre = (parcels.corners.reshape(-1, 2).min(axis=0) + parcels.corners.reshape(-1, 2).max(axis=0)) / 2.0
    return centre + _PLAIN_RADIUS * np.column_stack([np.cos(angle), np.sin(angle)])


def _in_corridor(geometry: RoadGeometry, relief: LandRelief, plan: Float, room: float) -> Bool:
    """Return a mask (N,) of the points (N, 2) on the terrain or the road's prolongations, widened by `room` (m)."""
    _, offset = geometry.alignment.project(plan)
    return np.asarray(np.abs(offset) < relief.half_width - _OVERLAP + room)


def _triangulate(plan: Float, edges: Int) -> tuple[Float, Int]:
    """Return points (V, 2) and triangles (T, 3) of a constrained Delaunay triangulation; close points are merged."""
    centre = plan.mean(axis=0)
    # Relative to the centre, as Blender's vectors are 32-bit floats.
    result = delaunay_2d_cdt(
        [Vector(point) for point in (plan - centre).tolist()], edges.tolist(), [], 0, _MERGE_DISTANCE
    )
    points = np.array([point[:] for point in result[0]], dtype=np.float64) + centre
    return points, np.array(result[2], dtype=np.intp)
