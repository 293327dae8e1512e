"""The road's straight prolongation beyond both ends, with the cross-section and the lines at the end."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import bpy
import numpy as np

from ....base.arrays import Float
from ....road.geometry import RoadGeometry
from ....road.landscape.relief import LandRelief
from ...things.meshes import attribute, fill
from .ground import place_beyond

_ROWS = 40
"""Rows of points along each prolongation; chosen."""
_LINE, _LINE_HEIGHT = 0.15, 0.02
"""Width of a line, and its height above the pavement, m; chosen."""
_LINE_RISE = 2e-4
"""Rise of a line above the pavement per metre of distance from the road's end (m/m); chosen."""
_DASH, _PERIOD, _DASHED = 6.0, 18.0, 700.0
"""Length of a lane line's dash, distance from one dash to the next, and length that has dashes, m; chosen."""
_COLUMN_DISTANCES = (1.5, 4.0, 9.0, 18.0, 36.0)
"""Distances (m) beside the road at which the ground has columns of points, as far as the terrain reaches; chosen."""
_NARROW = 1e-3
"""Width (m) up to which a strip is left out; chosen."""


def far_road_mesh(
    geometry: RoadGeometry, relief: LandRelief, material: Callable[[str], bpy.types.Material]
) -> bpy.types.Mesh:
    """Create the mesh of the road and the ground beside it beyond both ends, in local coordinates."""
    names: list[str] = []
    vertices: list[Float] = []
    faces, slots, road_places = [], [], []
    for end, direction in ((0.0, -1.0), (geometry.length, 1.0)):
        for station, offset, name, height in _strips(geometry, relief, end, direction):
            first_vertex = sum(len(part) for part in vertices)
            # Points of a strip: for each row the left one and the right one.
            plan = place_beyond(geometry, station.ravel(), offset.ravel())
            z = relief.elevation_beside(plan, station.ravel(), offset.ravel()) + height
            vertices.append(np.column_stack([plan, z]))
            road_places.append(np.column_stack([station.ravel(), offset.ravel()]))
            rows = len(station)
            first_corners = first_vertex + 2 * np.arange(rows - 1)
            # Anticlockwise from above beyond the end of the road; before its beginning rows run the other way.
            quads = np.stack([first_corners, first_corners + 2, first_corners + 3, first_corners + 1], axis=-1)
            faces.append(quads if direction > 0.0 else quads[:, ::-1])
            if name not in names:
                names.append(name)
            slots.append(np.full(rows - 1, names.index(name)))
    mesh = bpy.data.meshes.new("SR Landscape Road")
    fill(mesh, np.concatenate(vertices), faces=np.concatenate(faces))
    for name in names:
        mesh.materials.append(material(name))
    mesh.polygons.foreach_set("material_index", np.concatenate(slots).astype(np.int32))
    road_place = np.concatenate(road_places)
    attribute(mesh, "station", road_place[:, 0])
    attribute(mesh, "offset", road_place[:, 1])
    return mesh


Strip = tuple[Float, Float, str, Float | float]
"""Strip: stations (R, 2) and offsets (R, 2) of its left and right edge, m; material; height above the surface, m."""


def _strips(geometry: RoadGeometry, relief: LandRelief, end: float, direction: float) -> list[Strip]:
    """Return the strips of surfaces and lines beyond one end of the road; the direction is -1 at its start, else 1."""
    distances = np.append(0.0, np.geomspace(4.0, relief.landscape.reach * 1.4, _ROWS))
    station = end + direction * np.repeat(distances[:, None], 2, axis=1)
    offsets = geometry.offsets(end)[0]
    columns_beside = [distance for distance in _COLUMN_DISTANCES if offsets[0] + distance < relief.half_width]
    strips: list[Strip] = []

    def add(left_edge: float, right_edge: float, name: str, line_height: Float | float = 0.0) -> None:
        """Add a strip between two constant offsets (m), unless it is too narrow."""
        if left_edge - right_edge > _NARROW:
            strips.append((station, np.broadcast_to([left_edge, right_edge], station.shape), name, line_height))

    for strip, left_edge, right_edge in zip(geometry.strips, offsets[:-1], offsets[1:], strict=True):
        add(left_edge, right_edge, strip.material)
    for edge, side in ((float(offsets[0]), 1.0), (float(offsets[-1]), -1.0)):
        columns = [edge + side * distance for distance in (0.0, *columns_beside)]
        columns = [edge, *(column for column in columns[1:] if abs(column) < relief.half_width)]
        columns.append(side * relief.half_width)
        for column, next_column in itertools.pairwise(columns):
            add(max(column, next_column), min(column, next_column), "grass_ground")
    # Lines rise with the distance, so that a camera's depth buffer still tells them from the pavement.
    line_height = _LINE_HEIGHT + _LINE_RISE * np.repeat(distances, 2)
    for section in geometry.sections.values():
        bounds = section.carriageway.sign * section.lane_boundaries(end)[0]
        for number, bound in enumerate(bounds.tolist()):
            left_edge, right_edge = bound + _LINE / 2.0, bound - _LINE / 2.0
            if number in (0, len(bounds) - 1):
                add(left_edge, right_edge, "paint_white", line_height)
            else:
                strips += _dashes(end, direction, left_edge, right_edge)
    return strips


def _dashes(end: float, direction: float, left: float, right: float) -> list[Strip]:
    """Return the dashes of a lane line between two offsets (m) beyond one end of the road."""
    strips: list[Strip] = []
    for dash_start in np.arange(_PERIOD - _DASH, _DASHED, _PERIOD).tolist():
        station = end + direction * np.array([[dash_start, dash_start], [dash_start + _DASH, dash_start + _DASH]])
        strips.append((station, np.array([[left, right]] * 2), "paint_white", _LINE_HEIGHT + _LINE_RISE * dash_start))
    return strips
