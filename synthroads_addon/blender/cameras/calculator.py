"""Cycles as a calculator of materials: their nodes at the very returns, read from images of what they ask for.

Each return is a pixel of a plane that a camera looks at straight down. Copies of the materials read their positions,
normals and attributes from images that have these values at the same pixel, in place of asking the plane.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from typing import TypeAlias

import bpy
import numpy as np

from ...base.arrays import Float32, Index
from ...base.scratch.folders import scratch_folder
from ...scanning.scene.surface_values import SurfaceInput
from ..materials.image import unlink_missing
from ..materials.inputs import InputSearch, copy_groups, replace_inputs
from ..materials.surface_layers import LayerNodes, layer_expressions
from .stage import Passes, RenderStage, new_stage

WIDTH = 1024
"""Width of the largest plane, px."""
_LEAST_WIDTH = 64
"""Width of the smallest plane, px; chosen."""
_HEIGHT_STEP = 64
"""Heights of input images are multiples of this, px, so that existing images mostly fit the next places too; chosen."""
_LEAST_HEIGHT = 4
"""Least height of an image, px: Blender doesn't render lower ones."""
_FIRST_FRAME = -1_000_000
"""A frame before those of every scene."""
_CAMERA_HEIGHT = 10.0
"""Height of the orthographic camera above the plane, in pixels of the plane; any height would do."""


_Spans: TypeAlias = list[tuple[slice, slice]]
"""Pairs of slices: a run of places, and the run of pixels (row by row from below) that stands for these places."""


@dataclass
class ReadingCopy:
    """A copy of a material whose inputs (positions, normals, attributes) are read from images.

    Attributes:
        item: the copy.
        readers: nodes that read each input.
    """

    item: bpy.types.Material
    readers: list[tuple[SurfaceInput, bpy.types.Node]] = field(default_factory=list)


class Calculator:
    """Evaluates layers of materials at given places by rendering; must be used on Blender's main thread.

    Attributes:
        stage: scene and camera that render the plane.
        materials: indices of the materials that it evaluates.
        layers: names of the layers that it returns.
        at_once: largest number of places that one call evaluates.
        main_thread: whether only Blender's main thread may use it.
    """

    at_once = 1 << 20
    main_thread = True

    def __init__(self, stage: RenderStage, copies: dict[int, ReadingCopy], layers: Sequence[str]) -> None:
        self.stage, self.layers, self._copies = stage, tuple(layers), copies
        self.materials = frozenset(copies)
        self._images: dict[SurfaceInput, bpy.types.Image] = {}
        self._size = 0, 0
        self._item: bpy.types.Object | None = None

    def inputs_of(self, material: int) -> frozenset[SurfaceInput]:
        """Return the inputs that the nodes of the material with this index read."""
        return frozenset(surface_input for surface_input, _ in self._copies[material].readers)

    def calculate(self, material: Index, values: dict[SurfaceInput, Float32]) -> dict[str, Float32]:
        """Render the materials' layers at N places; return them by name, (N, C) float32.

        Args:
            material: (N,) index of each place's material, ascending.
            values: (N, 4) values of each input at the places.
        """
        numbers, starts, counts = np.unique(material, return_index=True, return_counts=True)
        # Few places get a narrower plane, so that at least about 8 rows of pixels are used.
        width = WIDTH
        while width > _LEAST_WIDTH and width * width > 8 * len(material):
            width //= 2
        # Each material begins in a new row of pixels.
        rows = -(-counts // width)  # rounded up
        first_rows = np.cumsum([0, *rows])
        spans = [
            (slice(start, start + count), slice(row * width, row * width + count))
            for start, row, count in zip(starts.tolist(), first_rows[:-1].tolist(), counts.tolist(), strict=True)
        ]
        height = max(int(first_rows[-1]), _LEAST_HEIGHT)
        self._fit_images(width, height)
        self._fill(values, spans)
        self._lay_out(numbers.tolist(), first_rows)
        camera = self.stage.camera
        camera.data.type, camera.data.ortho_scale = "ORTHO", float(max(width, height))
        camera.location = (width / 2.0, height / 2.0, _CAMERA_HEIGHT)
        passes = self.stage.render(width, height)
        result = {}
        for name, image in passes.layers.items():
            # Rows come from the top, spans count them from below.
            image_pixels = image[::-1].reshape(-1, image.shape[2])
            result[name] = np.concatenate([image_pixels[pixels] for _, pixels in spans])
        return result

    def _fit_images(self, width: int, height: int) -> None:
        """Remove the input images unless they have this width and a height between `height` and twice as much.

        Blender looks through the whole file when an image is made or removed, so images are reused where possible.
        """
        fitting_height = -(-height // _HEIGHT_STEP) * _HEIGHT_STEP
        if self._size[0] != width or not fitting_height <= self._size[1] <= 2 * fitting_height:
            self._remove_images()
            self._size = width, fitting_height

    def _fill(self, values: dict[SurfaceInput, Float32], spans: _Spans) -> None:
        """Write the inputs' values into the images that the materials read; pixels outside the spans become 0."""
        image_pixels = np.zeros((self._size[0] * self._size[1], 4), np.float32)
        for surface_input, place_values in values.items():
            if surface_input not in self._images:
                self._add_image(surface_input)
            for places, pixels in spans:
                image_pixels[pixels] = place_values[places]
            image = self._images[surface_input]
            image.pixels.foreach_set(image_pixels.ravel())
            image.update()

    def _add_image(self, surface_input: SurfaceInput) -> None:
        """Add an image for an input, and have the copies' nodes that read this input show it."""
        self._images[surface_input] = _new_image(*self._size)
        for copy in self._copies.values():
            for node_input, node in copy.readers:
                if node_input == surface_input:
                    node.image = self._images[surface_input]

    def _lay_out(self, numbers: list[int], first_rows: np.ndarray) -> None:
        """Give the stage's plane one face per material, from its first row of pixels up to the next material's.

        The UV map makes each pixel of the picture read the same pixel of the input images, which may be higher.

        Args:
            numbers: index of each face's material.
            first_rows: (M + 1,) first row of each face, and the end of the last face.
        """
        width, height = self._size
        corners: list[tuple[float, float, float]] = []
        faces: list[tuple[int, ...]] = []
        map_corners: list[float] = []
        for bottom, top in zip(first_rows[:-1].tolist(), first_rows[1:].tolist(), strict=True):
            first_corner = len(corners)
            corners += [(0.0, bottom, 0.0), (width, bottom, 0.0), (width, top, 0.0), (0.0, top, 0.0)]
            faces.append((first_corner, first_corner + 1, first_corner + 2, first_corner + 3))
            map_corners += [0.0, bottom / height, 1.0, bottom / height, 1.0, top / height, 0.0, top / height]
        mesh = self._empty_mesh()
        mesh.from_pydata(corners, [], faces)
        mesh.uv_layers.new(name="SR Pixels").data.foreach_set("uv", map_corners)
        for number in numbers:
            mesh.materials.append(self._copies[number].item)
        mesh.polygons.foreach_set("material_index", np.arange(len(faces), dtype=np.int32))

    def _empty_mesh(self) -> bpy.types.Mesh:
        """Return the mesh of the object that the stage shows, without faces and materials."""
        if self._item is None:
            mesh = bpy.data.meshes.new("SR Calculator")
            self._item = bpy.data.objects.new("SR Calculator", mesh)
            self.stage.scene.collection.objects.link(self._item)
        mesh = self._item.data
        mesh.clear_geometry()
        mesh.materials.clear()
        return mesh

    def close(self) -> None:
        """Remove the plane and the input images from the file."""
        self._remove_images()
        if self._item is not None:
            mesh, item, self._item = self._item.data, self._item, None
            bpy.data.objects.remove(item)
            bpy.data.meshes.remove(mesh)

    def _remove_images(self) -> None:
        """Remove the input images from the file."""
        for copy in self._copies.values():
            for _, node in copy.readers:
                node.image = None
        for image in self._images.values():
            bpy.data.images.remove(image)
        self._images.clear()


@contextmanager
def opened_calculator(copies: dict[int, ReadingCopy], layers: Sequence[str]) -> Iterator[Calculator]:
    """Context of a calculator with copies of materials, by index; on exit all but the copies is removed."""
    with ExitStack() as stack:
        folder = stack.enter_context(scratch_folder())
        render_stage = stack.enter_context(new_stage(Passes(layers, lit=False), folder))
        render_stage.scene.render.use_persistent_data = False  # else images that change would be kept
        calculator = Calculator(render_stage, copies, layers)
        stack.callback(calculator.close)
        yield calculator


@contextmanager
def reading_copy(item: bpy.types.Material, layers: Sequence[str]) -> Iterator[ReadingCopy]:
    """Context of a copy of a material that outputs only the layers, its inputs read from images; removed on exit.

    Animated values of the material stay in the copy as they are in the current scene's frame.
    """
    copy = item.copy()
    groups: list[bpy.types.NodeTree] = []
    try:
        tree = copy.node_tree
        groups = copy_groups(tree)
        _freeze(copy, groups, bpy.context.scene.frame_current)
        for node_tree in (tree, *groups):
            unlink_missing(node_tree)
        expressions = layer_expressions(copy)
        nodes = LayerNodes(tree)
        layer_outputs = {
            node.aov_name: node for node in tree.nodes if node.type == "OUTPUT_AOV" and node.aov_name in layers
        }
        for layer in layers:
            if layer in expressions and layer not in layer_outputs:
                layer_outputs[layer] = nodes.add_output(layer, expressions[layer])
        for node in [node for node in tree.nodes if node.type in ("OUTPUT_AOV", "OUTPUT_MATERIAL")]:
            if node not in layer_outputs.values():
                tree.nodes.remove(node)
        # Where the outputs' trees read positions, normals and attributes, they read images from now on.
        search = InputSearch()
        for node in layer_outputs.values():
            for socket in node.inputs:
                for link in socket.links:
                    search.visit(link.from_socket)
        readers = list(replace_inputs(search.sites))
        emission, surface_output = tree.nodes.new("ShaderNodeEmission"), tree.nodes.new("ShaderNodeOutputMaterial")
        tree.links.new(emission.outputs[0], surface_output.inputs["Surface"])
        yield ReadingCopy(copy, readers)
    finally:
        # One removal for all: Blender looks through the whole file each time.
        bpy.data.batch_remove([copy, *groups])


def _freeze(item: bpy.types.Material, groups: Sequence[bpy.types.NodeTree], frame: int) -> None:
    """Make a copied material look at all frames of all scenes as it does now, at a frame of the current scene."""
    for block in (item, item.node_tree, *groups):
        block.animation_data_clear()  # values stay as they are, without their animation and drivers
    for tree in (item.node_tree, *groups):
        for node in tree.nodes:
            if node.type == "TEX_IMAGE" and node.image_user.use_auto_refresh:
                _freeze_sequence(node.image_user, frame)


def _freeze_sequence(user: bpy.types.ImageUser, frame: int) -> None:
    """Make an image sequence or movie show at all frames the image that it shows at this frame of the scene."""
    image_number = frame - user.frame_start + 1
    if user.use_cyclic:
        image_number = (image_number - 1) % user.frame_duration + 1
    user.frame_offset += min(max(image_number, 0), user.frame_duration) - 1
    # Beyond its end a sequence shows its last image, here the only one.
    user.frame_start, user.frame_duration, user.use_cyclic = _FIRST_FRAME, 1, False


def _new_image(width: int, height: int) -> bpy.types.Image:
    """Return a new float RGBA image without colour management."""
    image = bpy.data.images.new("SR Calculator", width, height, alpha=True, float_buffer=True, is_data=True)
    image.alpha_mode = "CHANNEL_PACKED"
    return image
