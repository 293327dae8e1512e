"""Views along the road and at one marked place of it, and helpers for drawing over the 3D view."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import bpy
import gpu
import numpy as np
from mathutils import Vector
from numpy.typing import NDArray

from ...road.geometry import RoadGeometry
from ...road.parameters import RoadParameters

_FARTHEST = 800.0
"""Of a longer road only this much, m, is looked at."""
_BEHIND, _ABOVE = 34.0, 20.0
"""Where one place is looked at from, m: 40 m away, along the road, downwards enough to see the lanes apart."""
_SENSOR = 72.0
"""Width of the image plane (mm) of Blender's views: one without perspective shows 72 mm / lens times its distance."""
DRAWING_WIDTH = 2000.0
"""Width that a view has from above for a road to be drawn in it, m. Chosen: a motorway's three arcs have room."""
_MARKER_HEIGHT = 6.0
_MARKER_COLOR = (1.0, 0.35, 0.1, 1.0)


def look_along(space: bpy.types.SpaceView3D, parameters: RoadParameters) -> None:
    """Set a 3D view to look along the whole road from behind its start, with clipping far enough."""
    geometry = RoadGeometry(parameters)
    reach = min(geometry.length, _FARTHEST)
    stations = np.array([0.0, 0.3 * reach])
    plan, heading, _ = geometry.alignment.frame(stations)
    begin, target = (Vector(point) for point in np.column_stack([plan, geometry.profile.elevation(stations)]))
    back = Vector((np.cos(heading[0]), np.sin(heading[0]), 0.0)) * (0.10 * reach + 10.0)
    _look(space, begin - back + Vector((0.0, 0.0, 0.12 * reach + 5.0)), target)
    space.clip_end = max(space.clip_end, 5.0 * reach)


def look_at_place(space: bpy.types.SpaceView3D, geometry: RoadGeometry, station: float, offset: float) -> None:
    """Set a 3D view to look along the road at one place from 40 m away."""
    target = Vector(surface_point(geometry, station, offset))
    _, heading, _ = geometry.alignment.frame(_on_road(geometry, station))
    ahead = Vector((np.cos(heading), np.sin(heading), 0.0))
    _look(space, target - _BEHIND * ahead + Vector((0.0, 0.0, _ABOVE)), target)
    space.clip_end = max(space.clip_end, 1000.0)


def look_down(space: bpy.types.SpaceView3D, place: Vector, width: float) -> None:
    """Set a 3D view to look down at a place without perspective, the Y axis upwards, with a width (m) in sight."""
    region = space.region_3d
    region.view_perspective = "ORTHO"
    region.view_rotation = (1.0, 0.0, 0.0, 0.0)
    region.view_location = place
    region.view_distance = width * space.lens / _SENSOR
    space.clip_start = max(space.clip_start, 0.5)
    space.clip_end = max(space.clip_end, 4.0 * width)


def surface_point(geometry: RoadGeometry, station: float, offset: float) -> tuple[float, float, float]:
    """Return the surface's local point at a station and offset; beside the road at the centreline's height."""
    at = _on_road(geometry, station)
    x, y, z = geometry.point(at, offset)[0]
    return float(x), float(y), float(geometry.profile.elevation(at) if np.isnan(z) else z)


def view_of(context: bpy.types.Context) -> bpy.types.SpaceView3D | None:
    """Return the 3D view that the operator was called in, else the largest; None if there is none."""
    if isinstance(context.space_data, bpy.types.SpaceView3D):
        return context.space_data
    areas = [area for area in context.screen.areas if area.type == "VIEW_3D"] if context.screen else []
    largest = max(areas, key=lambda area: area.width * area.height, default=None)
    return largest.spaces.active if largest else None


def frame_points(space: bpy.types.SpaceView3D, points: NDArray[np.float32], offset: Vector | None = None) -> None:
    """Set a 3D view to frame points (N, 3), shifted by an offset, from the south-west and above."""
    low, high = points.min(axis=0).astype(np.float64), points.max(axis=0).astype(np.float64)
    middle = Vector((low + high) / 2.0) + (offset or Vector())
    reach = float(np.linalg.norm(high - low)) + 1.0
    _look(space, middle + reach * Vector((-0.5, -0.6, 0.5)), middle)
    space.clip_end = max(space.clip_end, 4.0 * reach)


def redraw_views(context: bpy.types.Context) -> None:
    """Tag all 3D views for redraw, sidebars included."""
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                area.tag_redraw()


class Marker:
    """Overlay of a post and a line across the road at one place, drawn without adding anything to the scene.

    Attributes:
        corners: (x, y, z) of the ends of its lines, two after two; empty while it is hidden.
    """

    def __init__(self) -> None:
        self.corners: list[tuple[float, float, float]] = []
        self._handler: object | None = None

    def show(self, geometry: RoadGeometry, station: float, offset: float) -> None:
        """Show the marker at a place of the road."""
        foot = surface_point(geometry, station, offset)
        across = geometry.offsets(_on_road(geometry, station))[0]
        line = [surface_point(geometry, station, value) for value in across]
        top = (foot[0], foot[1], foot[2] + _MARKER_HEIGHT)
        self.corners = [foot, top, *(corner for pair in pairwise(line) for corner in pair)]
        if self._handler is None:
            self._handler = bpy.types.SpaceView3D.draw_handler_add(self._draw, (), "WINDOW", "POST_VIEW")

    def hide(self) -> None:
        """Remove the marker from the views."""
        self.corners = []
        if self._handler is not None:
            bpy.types.SpaceView3D.draw_handler_remove(self._handler, "WINDOW")
            self._handler = None

    def _draw(self) -> None:
        draw_lines(self.corners, _MARKER_COLOR, 4.0)


def draw_lines(corners: Sequence[tuple[float, float, float]], color: Sequence[float], width: float) -> None:
    """Draw line segments between pairs of points, in a draw handler; `width` in pixels."""
    shader = gpu.shader.from_builtin("POLYLINE_UNIFORM_COLOR")
    shader.uniform_float("viewportSize", gpu.state.viewport_get()[2:])
    shader.uniform_float("lineWidth", width)
    shader.uniform_float("color", color)
    points = gpu.types.GPUVertBuf(shader.format_calc(), len(corners))
    points.attr_fill("pos", corners)
    gpu.types.GPUBatch(type="LINES", buf=points).draw(shader)


def _on_road(geometry: RoadGeometry, station: float) -> float:
    return float(np.clip(station, 0.0, geometry.length))


def _look(space: bpy.types.SpaceView3D, eye: Vector, target: Vector) -> None:
    region = space.region_3d
    region.view_perspective = "PERSP"
    region.view_location = target
    region.view_rotation = (target - eye).to_track_quat("-Z", "Y")
    region.view_distance = (target - eye).length
    # Blender's own clip start of 1 cm leaves too little depth to tell paint from asphalt some hundred metres away.
    space.clip_start = max(space.clip_start, 0.5)
