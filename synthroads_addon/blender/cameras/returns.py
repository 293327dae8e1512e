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
"""Returns rendered at once."""
_HEIGHT = 1024
_SMALLEST = 64
"""Width and height of an image, px: Cycles reads very narrow textures wrongly."""
RENDERINGS_KEPT = 19
"""Renderings after which the renderer begins anew: it keeps the images of rays, 60 bytes for each of them."""
_BEFORE = 0.002
"""How far before the return its ray starts, m: behind leaves, not before them."""
_LARGEST_ERROR = 0.01
"""A pixel that shows a place farther from its return than this shows something else, m."""

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

    A return's ray starts a little before the place that was hit, along the scanner's ray, so that what the pulse
    came through on its way doesn't hide it. Pixels that show another place or another material than the return's
    are given up for the material's means.

    Attributes:
        calls: those that it has the main thread make.
        worst: largest distance between a return and what its pixel shows, of those used, m.
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

    def _block(self, points: SeenPoints, wanted: frozenset[str]) -> LayerValues:
        channels: dict[str, NDArray[np.float32]] = {}
        matching = np.zeros(0, bool)
        if len(points):
            channels, matching = self.calls.call(lambda: self._render_points(points))
        source = np.where(matching, FROM_RETURN, FROM_MATERIAL).astype(np.uint8)
        return self.material.layer_values(points, channels, source, wanted)

    def _render_points(self, points: SeenPoints) -> tuple[dict[str, NDArray[np.float32]], NDArray[np.bool_]]:
        """Render N points; return channels (N, C), and the mask (N,) of points whose pixel shows just that return."""
        # A height that is a power of two divides without error, whichever way a version counts the rows.
        height = int(np.clip(1 << ((len(points) - 1).bit_length() // 2), _SMALLEST, _HEIGHT))
        width = max(_SMALLEST, -(-len(points) // height))
        middle = self._aim(points, width, height)
        if self._blocks % RENDERINGS_KEPT == 0:
            self._stage.forget()
        with _without_bumps():
            rendered = self._stage.render(width, height)
        assert rendered.position is not None
        # Blender versions differ in the order of the rows.
        error = [
            np.linalg.norm(_first_pixels(rendered.position[::step], len(points)) - points.position, axis=1)
            for step in (1, -1)
        ]
        step = 1 if np.median(error[0]) <= np.median(error[1]) else -1
        matching = error[0 if step == 1 else 1] < _LARGEST_ERROR + 1e-6 * np.abs(middle).max()
        matching &= np.rint(_first_pixels(rendered.material[::step, :, None], len(points))[:, 0]) == points.material + 1
        self.worst = max(self.worst, float(error[0 if step == 1 else 1][matching].max(initial=0.0)))
        channels = {name: _first_pixels(values[::step], len(points)) for name, values in rendered.layers.items()}
        for name in (SUN_GROUP, SKY_GROUP):
            if name in channels:
                channels[name] = channels[name] * np.float32(self._exposure)
        return channels, matching

    def _aim(self, points: SeenPoints, width: int, height: int) -> Float:
        """Set up the camera's shader with a ray per point; return the camera's place (3,), m."""
        along = points.position - points.scanner
        along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-9)
        # Near the returns, where 32-bit floats are fine.
        middle = np.round((points.position.min(axis=0) + points.position.max(axis=0)) / 2.0)
        start = points.position - _BEFORE * along - middle
        coarse = start.astype(np.float16).astype(np.float64)
        self._blocks += 1
        names = {}
        columns = 1 << (width - 1).bit_length()
        for name, values in {"coarse": coarse, "fine": start - coarse, "direction": along}.items():
            path = self._stage.folder / f"{name}-{self._blocks}.exr"
            write_image(path, _fill_image(values, width, height, columns))
            names[name] = path.as_posix()
        self._set_shader(_SHADER.format(width=width, height=height, columns=columns, **names))
        camera = self._stage.camera
        camera.matrix_world = Matrix.Translation(middle.tolist())
        self._remove_old()
        return middle

    def _set_shader(self, text: str) -> None:
        """Compile an OSL shader and make it the camera's; raise RuntimeError if that fails."""
        import _cycles  # not every Blender has it

        source, compiled = self._stage.folder / "camera.osl", self._stage.folder / "camera.oso"
        source.write_text(text, encoding="utf-8")
        if not _cycles.osl_compile(str(source), str(compiled)):
            raise RuntimeError("the camera's shader could not be compiled")
        bytecode = compiled.read_text(encoding="utf-8")
        data = self._stage.camera.data
        # Setting these rather than asking Cycles to compile: its own way needs a module that the bpy package lacks.
        data.type, data.custom_mode = "CUSTOM", "INTERNAL"
        data.clip_start, data.clip_end = 1e-5, 1e5
        data.custom_bytecode = bytecode
        data.custom_bytecode_hash = hashlib.md5(bytecode.encode(), usedforsecurity=False).hexdigest()

    def _remove_old(self) -> None:
        for name in ("coarse", "fine", "direction"):
            (self._stage.folder / f"{name}-{self._blocks - 1}.exr").unlink(missing_ok=True)


@contextmanager
def _without_bumps() -> Iterator[None]:
    """Context in which all bump nodes of the file are muted.

    A bump is worked out from what neighbouring pixels see, and here they see places that are far apart.
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

    What is left of the last row repeats the last value.
    """
    rows = np.empty((width * height, 3), np.float32)
    rows[: len(values)], rows[len(values) :] = values, values[-1]
    image = np.zeros((height, columns, 3), np.float32)
    image[:, :width] = rows.reshape(height, width, 3)
    return image


def _first_pixels(image: NDArray[np.float32], count: int) -> NDArray[np.float32]:
    return image.reshape(-1, image.shape[2])[:count]
