"""The road's prolongation beyond both ends: straight on, with the cross-section that it ends with, and its lines."""

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
_LINE, _ABOVE = 0.15, 0.02
"""Width of a line, and its height above the pavement, m."""
_DASH, _PERIOD, _DASHED = 6.0, 18.0, 700.0
"""Length of a lane line's dash, distance from one to the next, and how far ahead there are dashes, m."""
_BESIDE = (1.5, 4.0, 9.0, 18.0, 36.0)
"""Distances (m) beside the road at which its cross-section has columns, as far as the terrain reaches."""
_NARROW = 1e-3  # m


def far_road_mesh(
    geometry: RoadGeometry, relief: LandRelief, material: Callable[[str], bpy.types.Material]
) -> bpy.types.Mesh:
    """Create the mesh of the road and the ground beside it beyond both ends, in local coordinates."""
    names: list[str] = []
    vertices: list[Float] = []
    faces, slots, places = [], [], []
    for end, way in ((0.0, -1.0), (geometry.length, 1.0)):
        for station, offset, name, raised in _strips(geometry, relief, end, way):
            count = sum(len(part) for part in vertices)
            plan = place_beyond(geometry, station.ravel(), offset.ravel())
            z = relief.elevation_beside(plan, station.ravel(), offset.ravel()) + raised
            vertices.append(np.column_stack([plan, z]))
            places.append(np.column_stack([station.ravel(), offset.ravel()]))
            rows = len(station)
            corner = count + 2 * np.arange(rows - 1)
            quads = np.stack([corner, corner + 2, corner + 3, corner + 1], axis=-1)
            faces.append(quads if way > 0.0 else quads[:, ::-1])
            if name not in names:
                names.append(name)
            slots.append(np.full(rows - 1, names.index(name)))
    mesh = bpy.data.meshes.new("SR Landscape Road")
    fill(mesh, np.concatenate(vertices), faces=np.concatenate(faces))
    for name in names:
        mesh.materials.append(material(name))
    mesh.polygons.foreach_set("material_index", np.concatenate(slots).astype(np.int32))
    place = np.concatenate(places)
    attribute(mesh, "station", place[:, 0])
    attribute(mesh, "offset", place[:, 1])
    return mesh


Strip = tuple[Float, Float, str, Float | float]
"""Stations (R, 2) and offsets (R, 2) of its left and right edge, m, its material, its height above the surface, m."""


def _strips(geometry: RoadGeometry, relief: LandRelief, end: float, way: float) -> list[Strip]:
    """Return the strips of surfaces and lines beyond one end of the road."""
    ahead = np.append(0.0, np.geomspace(4.0, relief.landscape.reach * 1.4, _ROWS))
    station = end + way * np.repeat(ahead[:, None], 2, axis=1)
    offsets = geometry.offsets(end)[0]
    beside = [b for b in _BESIDE if offsets[0] + b < relief.half_width]
    made: list[Strip] = []

    def add(left: float, right: float, name: str, raised: Float | float = 0.0) -> None:
        if left - right > _NARROW:
            made.append((station, np.broadcast_to([left, right], station.shape), name, raised))

    for strip, left, right in zip(geometry.strips, offsets[:-1], offsets[1:], strict=True):
        add(left, right, strip.material)
    for edge, side in ((float(offsets[0]), 1.0), (float(offsets[-1]), -1.0)):
        columns = [edge, *(edge + side * b for b in beside if abs(edge + side * b) < relief.half_width)]
        columns.append(side * relief.half_width)
        for one, other in itertools.pairwise(columns):
            add(max(one, other), min(one, other), "grass_ground")
    raised = _ABOVE + 2e-4 * np.repeat(ahead, 2)
    for section in geometry.sections.values():
        bounds = section.carriageway.sign * section.lane_boundaries(end)[0]
        for number, bound in enumerate(bounds.tolist()):
            left, right = bound + _LINE / 2.0, bound - _LINE / 2.0
            if number in (0, len(bounds) - 1):
                add(left, right, "paint_white", raised)
            else:
                made += _dashes(end, way, left, right)
    return made


def _dashes(end: float, way: float, left: float, right: float) -> list[Strip]:
    made: list[Strip] = []
    for begin in np.arange(_PERIOD - _DASH, _DASHED, _PERIOD).tolist():
        station = end + way * np.array([[begin, begin], [begin + _DASH, begin + _DASH]])
        made.append((station, np.array([[left, right]] * 2), "paint_white", _ABOVE + 2e-4 * begin))
    return made
