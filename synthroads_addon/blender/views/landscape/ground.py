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
"""Use of a parcel -> material of its ground; a forest's is hidden below its crowns."""
_RINGS = ((0.0, 20.0), (200.0, 40.0), (500.0, 80.0), (1200.0, 160.0), (2500.0, 320.0))
"""Distances from the road (m) from which on points of the ground are so far (m) apart."""
_BELOW, _UNDER = 0.15, 1.0
"""The land goes on below the terrain's border: so much lower, and so far inwards, m."""
_ALONG = 12.0  # m between points on that border
_FAR, _FAR_SIDES = 15_000.0, 24
"""Radius (m) of the plain beyond the landscape's reach, and its corners."""
_SAME = 0.01  # m


def ground_mesh(
    geometry: RoadGeometry, relief: LandRelief, parcels: Parcels, material: Callable[[str], bpy.types.Material]
) -> bpy.types.Mesh:
    """Create the mesh of the land beside terrain and road, in local coordinates, its faces with their materials."""
    border, edges = _border(geometry, relief)
    rings = parcels.corners.reshape(-1, 2)
    sides = np.arange(len(rings)).reshape(-1, 4)
    sides = np.stack([sides, np.roll(sides, -1, axis=1)], axis=-1).reshape(-1, 2)
    further = np.concatenate([*_ring_points(geometry, relief), _horizon(parcels)])
    plan = np.concatenate([border, rings, further])
    points, triangles = _triangulate(plan, np.concatenate([edges, sides + len(border)]))
    middle = points[triangles].mean(axis=1)
    outside = ~_in_corridor(geometry, relief, middle, 0.0)
    triangles, middle = triangles[outside], middle[outside]
    station, offset = geometry.alignment.project(points)
    z = relief.elevation_beside(points, station, offset)
    z[np.abs(offset) < relief.half_width - _UNDER / 2.0] -= _BELOW
    mesh = bpy.data.meshes.new("SR Landscape Ground")
    fill(mesh, np.column_stack([points, z]), faces=triangles)
    _dress(mesh, parcels, parcels.of_points(middle), material)
    return mesh


def _dress(mesh: bpy.types.Mesh, parcels: Parcels, of: Int, material: Callable[[str], bpy.types.Material]) -> None:
    """Give faces the materials and rows of the parcels (F,) that they are of; beyond all they are fields."""
    for kind in KINDS:
        mesh.materials.append(material(MATERIALS[kind]))
    use = np.where(of >= 0, parcels.kind[of], KINDS.index("crop"))
    mesh.polygons.foreach_set("material_index", use.astype(np.int32))
    across = np.zeros((len(of), 3), dtype=np.float32)
    across[:, 0], across[:, 1] = -parcels.rows[of, 1], parcels.rows[of, 0]
    mesh.attributes.new(ROWS, "FLOAT_VECTOR", "FACE").data.foreach_set("vector", across.ravel())
    mesh.polygons.foreach_set("use_smooth", np.ones(len(of), dtype=np.bool_))


def place_beyond(geometry: RoadGeometry, station: Float, offset: Float) -> Float:
    """Return local points (N, 2) at stations and offsets (N,), on the tangents beyond the road's ends."""
    inside = np.clip(station, 0.0, geometry.length)
    position, heading, _ = geometry.alignment.frame(inside)
    along = np.column_stack([np.cos(heading), np.sin(heading)])
    beyond = (station - inside)[:, None] * along
    return np.asarray(position + beyond + offset[:, None] * left_vectors(heading))


def _border(geometry: RoadGeometry, relief: LandRelief) -> tuple[Float, Int]:
    """Return the corners (N, 2), m, of the terrain with the road's prolongations, and its edges (N, 2)."""
    reach = relief.landscape.reach * 1.5
    ahead = np.concatenate([np.arange(0.0, 200.0, 25.0), np.geomspace(200.0, reach, 16)])
    count = max(2, int(geometry.length / _ALONG))
    station = np.concatenate([-ahead[:0:-1], np.linspace(0.0, geometry.length, count), geometry.length + ahead[1:]])
    across = np.full(len(station), relief.half_width - _UNDER)
    sides = [place_beyond(geometry, station, across), place_beyond(geometry, station[::-1], -across)]
    ring = np.concatenate(sides)
    number = np.arange(len(ring))
    return ring, np.column_stack([number, np.roll(number, -1)])


def _ring_points(geometry: RoadGeometry, relief: LandRelief) -> Iterator[Float]:
    """Yield points (N, 2), m, of square grids around the road, the wider the farther from it."""
    station = np.linspace(0.0, geometry.length, 64)
    axis = geometry.alignment.position(station)
    far = [*(begin for begin, _ in _RINGS[1:]), np.inf]
    for (begin, cell), end in zip(_RINGS, far, strict=True):
        reach = min(end + relief.half_width, relief.landscape.reach)
        low, high = np.floor((axis.min(axis=0) - reach) / cell), np.ceil((axis.max(axis=0) + reach) / cell)
        grid = np.stack(np.meshgrid(*(np.arange(a, b + 1.0) * cell for a, b in zip(low, high, strict=True))), axis=-1)
        plan = grid.reshape(-1, 2)
        along, offset = geometry.alignment.project(plan)
        ahead = np.maximum(np.maximum(-along, along - geometry.length), 0.0)
        away = np.hypot(ahead, np.maximum(np.abs(offset) - relief.half_width, 0.0))
        yield plan[(away >= begin) & (away < end) & (np.abs(offset) > relief.half_width + cell / 3.0)]


def _horizon(parcels: Parcels) -> Float:
    turn = 2.0 * np.pi * np.arange(_FAR_SIDES) / _FAR_SIDES
    middle = (parcels.corners.reshape(-1, 2).min(axis=0) + parcels.corners.reshape(-1, 2).max(axis=0)) / 2.0
    return middle + _FAR * np.column_stack([np.cos(turn), np.sin(turn)])


def _in_corridor(geometry: RoadGeometry, relief: LandRelief, plan: Float, room: float) -> Bool:
    """Return whether points (N, 2) lie on the terrain or the road's prolongation, which are meshes of their own."""
    _, offset = geometry.alignment.project(plan)
    return np.asarray(np.abs(offset) < relief.half_width - _UNDER + room)


def _triangulate(plan: Float, edges: Int) -> tuple[Float, Int]:
    """Return the points (V, 2) and triangles (T, 3) of the plane that has all these edges, near points merged."""
    middle = plan.mean(axis=0)
    result = delaunay_2d_cdt([Vector(point) for point in (plan - middle).tolist()], edges.tolist(), [], 0, _SAME)
    points = np.array([point[:] for point in result[0]], dtype=np.float64) + middle
    return points, np.array(result[2], dtype=np.intp)
