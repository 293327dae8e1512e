"""Meshes that node groups start from: points with attributes, vertices, edges and faces."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import bpy
import numpy as np
from numpy.typing import NDArray

from ...road.geometry import RoadGeometry
from ...road.objects import LineObject, PointObject
from ...road.terrain import known_elevation
from ...road.things.thing import StandingThing

Float = NDArray[np.float64]


FRAME_SPACING = 1000.0
"""Length, m, of the pieces of a road in which the frames of what runs along may begin. Chosen: within it, 32-bit
coordinates are rounded to less than 0.1 mm."""


class ObjectFrame(NamedTuple):
    """Frame of an object in the road's own: x along the road, y to the left, z up.

    Attributes:
        origin: (3,) the place of its origin, m.
        turn: of its x axis from the road's own, about the vertical, rad.
    """

    origin: Float
    turn: float

    def matrix(self) -> Float:
        """Return the frame as a matrix (4, 4) into the road's own."""
        place = np.eye(4)
        cosine, sine = np.cos(self.turn), np.sin(self.turn)
        place[:2, :2] = [[cosine, -sine], [sine, cosine]]
        place[:3, 3] = self.origin
        return place

    def local(self, points: Float) -> Float:
        """Return points (N, 3) of the road's own frame in this one."""
        return (points - self.origin) @ self.matrix()[:3, :3]


def foot_frame(geometry: RoadGeometry, item: PointObject) -> ObjectFrame:
    """Return the frame at a point object's foot on the surface, turned from the road's course as the object is."""
    heading = float(geometry.alignment.heading(np.array([item.station]))[0])
    turn = item.turn if isinstance(item, StandingThing) else float(np.deg2rad(item.rotation_deg))
    return ObjectFrame(feet(geometry, [item])[0], heading + turn)


def line_frame(geometry: RoadGeometry, item: LineObject, stretch: tuple[float, float]) -> ObjectFrame:
    """Return the frame at a line object's beginning on the surface, or where the stretch's piece of the road begins.

    Args:
        geometry: of the whole road.
        item: the line object.
        stretch: stations (m) of the stretch that is built.
    """
    # Stretches that begin within the same piece of the road share a frame with the whole road, and so all roundings.
    station = np.clip(np.array([item.start_station]), frame_piece_start(stretch[0]), stretch[1])
    offset = item.offset_at(station)
    plan = geometry.alignment.place(station, offset)[0]
    origin = np.array([*plan, known_elevation(geometry, station, offset)[0]])
    return ObjectFrame(origin, float(geometry.alignment.heading(station)[0]))


def frame_piece_start(stretch_start: float) -> float:
    """Return the station (m) at which the piece of `FRAME_SPACING` begins in which a stretch does."""
    return FRAME_SPACING * float(np.floor(stretch_start / FRAME_SPACING))


def points_mesh(
    name: str,
    geometry: RoadGeometry,
    items: Sequence[PointObject],
    attributes: Mapping[str, NDArray[Any]],
    frame: ObjectFrame,
) -> bpy.types.Mesh:
    """Create a mesh with one vertex per point object, at its foot, in an object's frame.

    Attributes of its points: ``heading`` (rad, the turn about z of something that was made facing traffic along +y),
    ``elevation`` (m above the surface), ``instance``, and those given: whole numbers, numbers, or vectors (N, 3).
    """
    mesh = bpy.data.meshes.new(f"SR {name}")
    fill(mesh, frame.local(feet(geometry, items)))
    heading = geometry.alignment.heading(np.array([item.station for item in items]))
    turn = heading - np.pi / 2.0 + np.deg2rad([item.rotation_deg for item in items]) - frame.turn
    attribute(mesh, "heading", np.arctan2(np.sin(turn), np.cos(turn)))
    attribute(mesh, "elevation", np.array([item.elevation for item in items]))
    attribute(mesh, "instance", signed_instance([item.instance for item in items]))
    for key, values in attributes.items():
        attribute(mesh, key, values)
    return mesh


def on_plan(geometry: RoadGeometry, items: Sequence[PointObject]) -> Float:
    """Return local places (N, 3), m, of point objects: exact in plan, at the elevation of the road's axis."""
    station = np.array([item.station for item in items])
    offset = np.array([item.offset for item in items])
    position, heading, _ = geometry.alignment.frame(station)
    left = np.stack([-np.sin(heading), np.cos(heading)], axis=-1)
    return np.column_stack([position + offset[:, None] * left, geometry.profile.elevation(station)])


def feet(geometry: RoadGeometry, items: Sequence[PointObject]) -> Float:
    """Return local places (N, 3), m, of point objects' feet: on the surface, and so high above it as they stand."""
    places = on_plan(geometry, items)
    station, offset = (np.array([getattr(item, name) for item in items]) for name in ("station", "offset"))
    places[:, 2] = known_elevation(geometry, station, offset) + [item.elevation for item in items]
    return places


def signed_instance(instances: Sequence[int] | NDArray[np.integer]) -> NDArray[np.int32]:
    """Return unsigned 32-bit instance numbers reinterpreted as signed ones, as node groups hold them."""
    return np.array(instances, dtype=np.uint32).astype(np.int32)


def fill(
    mesh: bpy.types.Mesh,
    vertices: Float,
    edges: NDArray[np.intp] | None = None,
    faces: NDArray[np.intp] | None = None,
) -> None:
    """Fill an empty mesh, in place, with vertices (V, 3) and edges (E, 2) or faces (F, 4)."""
    mesh.vertices.add(len(vertices))
    mesh.vertices.foreach_set("co", vertices.astype(np.float32).ravel())
    if edges is not None:
        mesh.edges.add(len(edges))
        mesh.edges.foreach_set("vertices", edges.astype(np.int32).ravel())
    if faces is not None:
        _add_faces(mesh, faces.ravel(), np.full(len(faces), faces.shape[1]))


def fill_polygons(mesh: bpy.types.Mesh, vertices: Float, sizes: Sequence[int]) -> None:
    """Fill an empty mesh, in place, with polygons of the given sizes whose vertices (V, 3) follow one another."""
    fill(mesh, vertices)
    _add_faces(mesh, np.arange(len(vertices)), np.asarray(sizes))


def _add_faces(mesh: bpy.types.Mesh, corners: NDArray[np.intp], sizes: NDArray[np.intp]) -> None:
    """Add faces of given sizes, whose corners (C,) are vertex indices, to a mesh."""
    mesh.loops.add(corners.size)
    mesh.loops.foreach_set("vertex_index", corners.astype(np.int32))
    mesh.polygons.add(len(sizes))
    mesh.polygons.foreach_set("loop_start", (np.cumsum(sizes) - sizes).astype(np.int32))
    mesh.update(calc_edges=True)


def attribute(mesh: bpy.types.Mesh, name: str, values: NDArray[Any]) -> None:
    """Store a new point attribute in a mesh: integers (N,), floats (N,) or vectors (N, 3), in 32 bits."""
    is_integer = np.issubdtype(values.dtype, np.integer)
    kind = "FLOAT_VECTOR" if values.ndim == 2 else "INT" if is_integer else "FLOAT"
    data = mesh.attributes.new(name, kind, "POINT").data
    flat_values = values.astype(np.int32 if is_integer else np.float32).ravel()
    data.foreach_set("vector" if kind == "FLOAT_VECTOR" else "value", flat_values)
