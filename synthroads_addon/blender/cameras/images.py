"""Images along the path, rendered before the scan and kept in files that the scan reads from."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix

from ...base.scratch.folders import scratch_folder, temporary_folder_error
from ...scanning.colour.colour import MaterialLayers
from ...scanning.colour.images import ImageLayers
from ...scanning.colour.views import RenderedImage, View
from .stage import RenderedPasses, RenderStage

_LARGEST_HALF = 65504.0
"""Largest 16-bit float (IEEE 754)."""
_SENSOR = 36.0
"""Width of a camera's sensor, mm: Blender's default."""


class RenderedLayers(ImageLayers):
    """Source of layers from rendered images along the path, memory-mapped from files of a temporary folder.

    Attributes:
        report: images, pixels, layers and bytes, as JSON data.
    """

    def __init__(self, stage: RenderStage, views: Sequence[View], fallback: MaterialLayers, exposure: float) -> None:
        """Prepare without rendering; `render` makes the images."""
        super().__init__((), stage.passes.channels, fallback)
        self._stage, self._views, self._exposure = stage, views, exposure
        self._scratch = ExitStack()
        self._folder = self._scratch.enter_context(scratch_folder())

    def render(self, progress: Callable[[float], None]) -> None:
        """Render and store all images, calling `progress` with the share done; must run on Blender's main thread."""
        for number, view in enumerate(self._views):
            aim(self._stage.camera, view)
            self.images.append(self._store_image(number, view, self._stage.render(*view.size)))
            progress((number + 1) / len(self._views))
        self._locate()
        self.report = {
            "images": self._stage.images,
            "pixels": self._stage.pixels,
            "layers": list(self.channels),
            "bytes": sum(i.layers.nbytes + i.depth.nbytes + i.material.nbytes for i in self.images),
        }

    def _store_image(self, number: int, view: View, passes: RenderedPasses) -> RenderedImage:
        """Write a view's rendered passes into files, layers as 16-bit floats; return them as a memory-mapped image."""
        light = ("sun", "sky")
        layer_parts = [
            values * np.float32(self._exposure) if name in light else values for name, values in passes.layers.items()
        ]
        height, width = passes.material.shape
        stacked_layers = (
            np.concatenate(layer_parts, axis=2) if layer_parts else np.zeros((height, width, 0), np.float32)
        )
        assert passes.depth is not None
        layers = np.clip(stacked_layers, 0.0, _LARGEST_HALF).astype(np.float16)
        material = np.rint(passes.material).astype(np.uint16)
        return RenderedImage(
            view,
            self._map_file(f"{number}-layers", layers),
            self._map_file(f"{number}-depth", passes.depth),
            self._map_file(f"{number}-material", material),
        )

    def _map_file(self, name: str, array: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
        """Write an array into a file of the temporary folder; return it memory-mapped, read only."""
        path = self._folder / f"{name}.npy"
        try:
            np.save(path, array)
        except OSError as error:
            raise temporary_folder_error(self._folder, error) from None
        # An empty array can't be mapped.
        return np.load(path, mmap_mode="r" if array.size else None)

    def close(self) -> None:
        """Remove the images' temporary files."""
        self.images.clear()
        self._scratch.close()


def aim(camera: bpy.types.Object, view: View) -> None:
    """Set a camera object's position, rotation, focal length and shift to those of a view."""
    data, (width, height) = camera.data, view.size
    data.type, data.sensor_fit, data.sensor_width = "PERSP", "HORIZONTAL", _SENSOR
    # Focal length and principal point, of pixels, in Blender's units: mm, and shares of the image's width.
    data.lens = view.focal * _SENSOR / width
    data.shift_x = (width / 2.0 - view.centre[0]) / width
    data.shift_y = (view.centre[1] - height / 2.0) / width
    data.clip_start, data.clip_end = 0.05, 1e5
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = view.rotation, view.position
    camera.matrix_world = Matrix(matrix.tolist())
