"""A cloud drawn over the 3D views: nothing is added to the file, so there is nothing to undo, save, scan or render.

Points are drawn as squares of some pixels in every shading of the viewport, and are hidden by objects in front of them.
They are drawn slightly nearer to the eye than they are, as a cloud lies in the surfaces that it was scanned from. If
drawing all points takes long, fewer are drawn while a view is turned, and all once it stands still.
"""

from __future__ import annotations

from time import perf_counter

import bpy
import gpu
import numpy as np
from mathutils import Matrix, Vector
from numpy.typing import NDArray

from ...cloud.tools.display import ColourBy, DisplayCloud
from ..model.roads import scene_origin

_NEARER = 0.004
"""Share of their distance by which points are drawn nearer: at 50 m, 20 cm along the line of sight; chosen."""
_FLUENT = 0.05
"""Seconds that drawing may take while a view is turned; chosen."""
_STILL = 0.3
"""Seconds after its last movement after which a view is drawn with all points; chosen."""


class CloudView:
    """Drawing of a point cloud over the 3D views of one scene.

    Attributes:
        cloud: the points; None while there is nothing to draw.
        by: attribute by which the points are coloured.
        size: size of a point, pixels.
        visible: whether the points are drawn.
    """

    def __init__(self) -> None:
        self.cloud: DisplayCloud | None = None
        self.by: ColourBy = "class"
        self.size = 2.0
        self.visible = True
        self._scene = 0
        self._handler: object | None = None
        self._positions: gpu.types.GPUVertBuf | None = None
        self._batch: tuple[ColourBy, gpu.types.GPUBatch] | None = None
        self._pace = Pace()

    def show(self, cloud: DisplayCloud, scene: bpy.types.Scene) -> None:
        """Start drawing a cloud over a scene's 3D views, replacing the one before."""
        self.remove()
        self.cloud, self._scene, self.visible, self._pace = cloud, scene.session_uid, True, Pace()
        self._handler = bpy.types.SpaceView3D.draw_handler_add(self._draw, (), "WINDOW", "POST_VIEW")

    def remove(self) -> None:
        """Stop drawing and free the memory."""
        self.cloud = self._positions = self._batch = None
        if self._handler is not None:
            bpy.types.SpaceView3D.draw_handler_remove(self._handler, "WINDOW")
            self._handler = None

    def offset(self, scene: bpy.types.Scene) -> NDArray[np.float64]:
        """Return the offset (3,), m, from the cloud's coordinates to the scene's.

        That is 0 unless a road with another origin was built since the cloud was read.
        """
        origin = scene_origin(scene)
        return np.zeros(3) if origin is None or self.cloud is None else self.cloud.origin - origin

    def is_drawn(self, context: bpy.types.Context) -> bool:
        """Return whether the cloud is drawn in the context's 3D view: visible, its scene, overlays shown."""
        if self.cloud is None or not self.visible or context.scene.session_uid != self._scene:
            return False
        return bool(context.space_data.overlay.show_overlays)

    def _draw(self) -> None:
        """Draw the points into the current 3D view; Blender calls this at each redraw."""
        context = bpy.context
        if not self.is_drawn(context):
            return
        assert self.cloud
        shader = gpu.shader.from_builtin("POINT_FLAT_COLOR")
        batch = self._colored_batch(shader)
        with gpu.matrix.push_pop():
            gpu.matrix.load_matrix(_depth_offset(context.region_data) @ gpu.matrix.get_model_view_matrix())
            gpu.matrix.translate(Vector(self.offset(context.scene)))
            depth_test, depth_mask = gpu.state.depth_test_get(), gpu.state.depth_mask_get()
            gpu.state.depth_test_set("LESS_EQUAL")
            gpu.state.depth_mask_set(True)  # points hide each other
            gpu.state.point_size_set(self.size * context.preferences.system.pixel_size)
            count = self._pace.points(len(self.cloud), context.region, context.region_data.perspective_matrix)
            start_time = perf_counter()
            batch.draw_range(shader, elem_start=0, elem_count=count)
            self._pace.measure(perf_counter() - start_time, count)
            gpu.state.point_size_set(1.0)
            gpu.state.depth_test_set(depth_test)
            gpu.state.depth_mask_set(depth_mask)

    def _colored_batch(self, shader: gpu.types.GPUShader) -> gpu.types.GPUBatch:
        """Return the GPU batch of coloured points, cached; positions are uploaded once, colours when `by` changes."""
        assert self.cloud
        if self._batch and self._batch[0] == self.by:
            return self._batch[1]
        self._batch = None  # its colours are freed before there are others
        if self._positions is None:
            layout = gpu.types.GPUVertFormat()
            layout.attr_add(id="pos", comp_type="F32", len=3, fetch_mode="FLOAT")
            self._positions = gpu.types.GPUVertBuf(layout, len(self.cloud))
            self._positions.attr_fill("pos", np.ascontiguousarray(self.cloud.xyz))
        layout = gpu.types.GPUVertFormat()
        layout.attr_add(id="color", comp_type="U8", len=4, fetch_mode="INT_TO_FLOAT_UNIT")
        colors = gpu.types.GPUVertBuf(layout, len(self.cloud))
        colors.attr_fill("color", np.ascontiguousarray(self.cloud.colors(self.by)))
        self.cloud.forget_colors()
        batch = gpu.types.GPUBatch(type="POINTS", buf=self._positions)
        batch.vertbuf_add(colors)
        self._batch = (self.by, batch)
        return batch


class Pace:
    """Limiter of the points drawn while a view is turned, by the measured drawing speed.

    If a graphics card draws, the call returns at once, so that all points are drawn; software returns when it is done,
    so that its time is measured.
    """

    def __init__(self) -> None:
        self._rate = 0.0
        self._views: dict[int, Matrix] = {}
        self._region: bpy.types.Region | None = None

    def points(self, count: int, region: bpy.types.Region, view: Matrix) -> int:
        """Return how many of ``count`` points to draw now: fewer if the view moves and drawing is slow."""
        key, affordable_count = region.as_pointer(), int(_FLUENT * self._rate)
        is_turned = key in self._views and self._views[key] != view
        self._views[key] = view.copy()
        if not is_turned or not 0 < affordable_count < count:
            return count
        self._draw_all_soon(region)
        return max(affordable_count, min(count, 10_000))

    def measure(self, seconds: float, count: int) -> None:
        """Update the drawing speed from the seconds that ``count`` points took."""
        self._rate = count / max(seconds, 1e-6)

    def _draw_all_soon(self, region: bpy.types.Region) -> None:
        """Start a timer that redraws a region with all points once its view stands still; restart it if it runs."""
        self._region = region
        if bpy.app.timers.is_registered(self._draw_all):
            bpy.app.timers.unregister(self._draw_all)
        bpy.app.timers.register(self._draw_all, first_interval=_STILL)

    def _draw_all(self) -> None:
        """Have Blender redraw the region."""
        try:
            if self._region is not None:
                self._region.tag_redraw()
        except ReferenceError:
            pass  # the area was closed meanwhile


def _depth_offset(view: bpy.types.RegionView3D) -> Matrix:
    """Return the matrix that brings points slightly nearer to the eye without moving them in the picture."""
    if view.is_perspective:
        return Matrix.Diagonal((1.0 - _NEARER, 1.0 - _NEARER, 1.0 - _NEARER, 1.0))
    return Matrix.Translation((0.0, 0.0, _NEARER * view.view_distance))
