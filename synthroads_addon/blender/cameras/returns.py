"""One pixel per return: a camera whose rays are the scanner's own (Blender 5.0 and newer)."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix
from numpy.typing import NDArray

from ...base.turns.main_thread import MainThreadCalls
from ...scanning.colour.colour import FROM_MATERIAL, FROM_RETURN, LayerValues, MaterialLayers, SeenPoints
from .exr import write_image
from .stage import SKY_GROUP, SUN_GROUP, RenderStage

Float = NDArray[np.float64]

BLOCK = 1 << 20
"""Largest number of returns that one image renders; chosen."""
_LARGEST_HEIGHT = 1024
"""Largest height of an image, px."""
_LEAST_SIDE = 64
"""Least width and height of an image, px: Cycles reads very narrow textures wrongly."""
RENDERINGS_KEPT = 19
"""Renderings after which the renderer's data is dropped: Cycles keeps each image of rays, 60 bytes per ray; chosen."""
_RAY_START = 0.002
"""Distance before the return at which its ray starts, m: less than that to leaves in front of it; chosen."""
_LARGEST_ERROR = 0.01
"""Distance between a return and the place that its pixel shows, m, beyond which it shows another thing; chosen."""

_SHADER = """
shader sr_return_camera(
    output point position = 0.0, output vector direction = 0.0, output color throughput = 1.0)
{{
  point at = camera_shader_raster_position();
  // The middle of the pixel, exactly: a little aside, neighbours would mix in.
  float s = (floor(at[0] * {width}.0) + 0.5) / {columns}.0;
  float t = (floor(at[1] * {height}.0) + 0.5) / {height}.0;
  color coarse = texture("{coarse}", s, t, "interp", "closest");
  color fine = texture("{fine}", s, t, "interp", "closest");
  color along = texture("{direction}", s, t, "interp", "closest");
  position = point(coarse[0] + fine[0], coarse[1] + fine[1], -(coarse[2] + fine[2]));
  direction = vector(along[0], along[1], -along[2]);
}}
"""
"""In camera space z points forwards; the camera isn't turned, so local z is against it."""


class ReturnCamera:
    """Source of each return's layers by rendering one pixel per return; the main thread renders them.

    A return's ray starts a little before the place that was hit, along the scanner's ray, so that leaves or wires that
    the pulse passed on its way don't hide it. If a pixel shows another place or material than the return's, the return
    gets the material's mean values.

    Attributes:
        calls: queue of calls that Blender's main thread makes for other threads.
        worst: largest distance so far between a return and the place that its pixel shows, m, of pixels in use.
    """

    def __init__(
        self, stage: RenderStage, fallback: MaterialLayers, exposure: float, calls: MainThreadCalls | None = None
    ) -> None:
        self._stage, self.material, self._exposure = stage, fallback, exposure
        self.calls = calls or MainThreadCalls()
        self._blocks = 0
        self.worst = 0.0

    @property
    def report(self) -> dict[str, Any]:
        """Return the images, pixels and layers rendered so far, as JSON data."""
        stage = self._stage
        return {"images": stage.images, "pixels": stage.pixels, "layers": list(stage.passes.channels)}

    def sample(self, points: SeenPoints, names: frozenset[str]) -> LayerValues:
        """Return the wanted layers of N points, and how each point got them (its source)."""
        parts = [
            self._block(points.select(slice(start, start + BLOCK)), names)
            for start in range(0, max(len(points), 1), BLOCK)
        ]
        arrays = {name: np.concatenate([part.arrays[name] for part in parts]) for name in parts[0].arrays}
        return LayerValues(arrays, np.concatenate([part.source for part in parts]))

    def _block(self, points: SeenPoints, names: frozenset[str]) -> LayerValues:
        """Return the requested layers of at most `BLOCK` points, see `sample`."""
        channels: dict[str, NDArray[np.float32]] = {}
        matching = np.zeros(0, bool)
        if len(points):
            channels, matching = self.calls.call(lambda: self._render_points(points))
        source = np.where(matching, FROM_RETURN, FROM_MATERIAL).astype(np.uint8)
        return self.material.layer_values(points, channels, source, names)

    def _render_points(self, points: SeenPoints) -> tuple[dict[str, NDArray[np.float32]], NDArray[np.bool_]]:
        """Render N points; return channels (N, C) by name, and a mask (N,) of points that their pixels show."""
        # A height that is a power of two divides without error, whichever way a version counts the rows.
        height = int(np.clip(1 << ((len(points) - 1).bit_length() // 2), _LEAST_SIDE, _LARGEST_HEIGHT))
        width = max(_LEAST_SIDE, -(-len(points) // height))
        camera_place = self._aim(points, width, height)
        if self._blocks % RENDERINGS_KEPT == 0:
            self._stage.forget()
        with _without_bumps():
            passes = self._stage.render(width, height)
        assert passes.position is not None
        # Blender versions differ in the order of the rows: take the order by which the pixels show the returns' places.
        errors = {
            step: np.linalg.norm(_first_pixels(passes.position[::step], len(points)) - points.position, axis=1)
            for step in (1, -1)
        }
        step = 1 if np.median(errors[1]) <= np.median(errors[-1]) else -1
        # Rendered positions are float32: far from the origin they are less precise.
        matching = errors[step] < _LARGEST_ERROR + 1e-6 * np.abs(camera_place).max()
        material = np.rint(_first_pixels(passes.material[::step, :, None], len(points))[:, 0]) - 1
        matching &= material == points.material
        self.worst = max(self.worst, float(errors[step][matching].max(initial=0.0)))
        channels = {name: _first_pixels(values[::step], len(points)) for name, values in passes.layers.items()}
        for name in (SUN_GROUP, SKY_GROUP):
            if name in channels:
                channels[name] = channels[name] * np.float32(self._exposure)
        return channels, matching

    def _aim(self, points: SeenPoints, width: int, height: int) -> Float:
        """Give the camera a shader with one ray per point; return the camera's place (3,), m."""
        direction = points.position - points.scanner
        direction /= np.maximum(np.linalg.norm(direction, axis=1, keepdims=True), 1e-9)
        # The camera is amid the returns: rays relative to it are precise enough as 32-bit floats.
        camera_place = np.round((points.position.min(axis=0) + points.position.max(axis=0)) / 2.0)
        start = points.position - _RAY_START * direction - camera_place
        coarse = start.astype(np.float16).astype(np.float64)
        self._blocks += 1
        file_names = {}
        columns = 1 << (width - 1).bit_length()
        for name, values in {"coarse": coarse, "fine": start - coarse, "direction": direction}.items():
            path = self._stage.folder / f"{name}-{self._blocks}.exr"
            write_image(path, _fill_image(values, width, height, columns))
            file_names[name] = path.as_posix()
        self._set_shader(_SHADER.format(width=width, height=height, columns=columns, **file_names))
        camera = self._stage.camera
        camera.matrix_world = Matrix.Translation(camera_place.tolist())
        self._remove_earlier_images()
        return camera_place

    def _set_shader(self, text: str) -> None:
        """Compile an OSL shader and make it the camera's; raise RuntimeError if that fails."""
        import _cycles  # not every Blender has it

        source, bytecode_file = self._stage.folder / "camera.osl", self._stage.folder / "camera.oso"
        source.write_text(text, encoding="utf-8")
        if not _cycles.osl_compile(str(source), str(bytecode_file)):
            raise RuntimeError("Cycles could not compile the shader of the camera that renders a pixel per return")
        bytecode = bytecode_file.read_text(encoding="utf-8")
        data = self._stage.camera.data
        # The bytecode is set here, not compiled by Cycles' operator, which needs a module that the bpy package lacks.
        data.type, data.custom_mode = "CUSTOM", "INTERNAL"
        data.clip_start, data.clip_end = 1e-5, 1e5
        data.custom_bytecode = bytecode
        data.custom_bytecode_hash = hashlib.md5(bytecode.encode(), usedforsecurity=False).hexdigest()

    def _remove_earlier_images(self) -> None:
        """Remove the files with the rays of the block before this one."""
        for name in ("coarse", "fine", "direction"):
            (self._stage.folder / f"{name}-{self._blocks - 1}.exr").unlink(missing_ok=True)


@contextmanager
def _without_bumps() -> Iterator[None]:
    """Context in which all bump nodes of the file are muted.

    Cycles computes a bump from differences between neighbouring pixels, which here show places far apart.
    """
    trees = [item.node_tree for item in bpy.data.materials if item.node_tree] + list(bpy.data.node_groups)
    bumps = [node for tree in trees for node in tree.nodes if node.bl_idname == "ShaderNodeBump" and not node.mute]
    for node in bumps:
        node.mute = True
    try:
        yield
    finally:
        for node in bumps:
            node.mute = False


def _fill_image(values: Float, width: int, height: int, columns: int) -> NDArray[np.float32]:
    """Return values (N, 3) row by row as an image (height, columns, 3) whose first `width` columns are used.

    Pixels of the last row beyond the N values repeat the last value; N is at most width times height.
    """
    rows = np.empty((width * height, 3), np.float32)
    rows[: len(values)], rows[len(values) :] = values, values[-1]
    image = np.zeros((height, columns, 3), np.float32)
    image[:, :width] = rows.reshape(height, width, 3)
    return image


def _first_pixels(image: NDArray[np.float32], count: int) -> NDArray[np.float32]:
    """Return the first `count` pixels (count, C) of an image (H, W, C), row by row."""
    return image.reshape(-1, image.shape[2])[:count]
