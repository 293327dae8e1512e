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
_NARROWEST = 64
_STEP = 64
"""Heights of images of inputs are multiples of this, px, so that those that are there mostly fit once more."""
_LOWEST = 4
"""Least height of an image, px: Blender renders none that is lower."""
_FIRST_FRAME = -1_000_000
"""Frame that no scene comes before."""
_ABOVE = 10.0
"""Height of the camera above the plane: an image of it is one unit wide for each pixel."""


_Spans: TypeAlias = list[tuple[slice, slice]]
"""Runs of places, and of the pixels that they are."""


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
        stage: what renders.
        materials: indices of those that it works out.
        layers: names of the layers that come back.
        at_once: places that are worked out at once.
        main_thread: it can be used there alone.
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
        return frozenset(what for what, _ in self._copies[material].readers)

    def calculate(self, material: Index, values: dict[SurfaceInput, Float32]) -> dict[str, Float32]:
        """Render the materials' layers at N places; return them by name, (N, C) float32.

        Args:
            material: (N,) of each place, ascending.
            values: (N, 4) of each input.
        """
        numbers, starts, counts = np.unique(material, return_index=True, return_counts=True)
        width = WIDTH
        while width > _NARROWEST and width * width > 8 * len(material):
            width //= 2
        rows = -(-counts // width)
        begins = np.cumsum([0, *rows])
        # Where the places of each material lie among the pixels, row by row from below.
        spans = [
            (slice(start, start + count), slice(row * width, row * width + count))
            for start, row, count in zip(starts.tolist(), begins[:-1].tolist(), counts.tolist(), strict=True)
        ]
        height = max(int(begins[-1]), _LOWEST)
        self._fit_images(width, height)
        self._fill(values, spans)
        self._lay_out(numbers.tolist(), begins)
        camera = self.stage.camera
        camera.data.type, camera.data.ortho_scale = "ORTHO", float(max(width, height))
        camera.location = (width / 2.0, height / 2.0, _ABOVE)
        rendered = self.stage.render(width, height)
        result = {}
        for name, image in rendered.layers.items():
            flat = image[::-1].reshape(-1, image.shape[2])
            result[name] = np.concatenate([flat[pixels] for _, pixels in spans])
        return result

    def _fit_images(self, width: int, height: int) -> None:
        """Remove the input images if they aren't of this width, or too low, or more than twice as high as need be.

        Making and removing them looks through all of the file, so that both are done as seldom as can be.
        """
        fitting = -(-height // _STEP) * _STEP
        if self._size[0] != width or not fitting <= self._size[1] <= 2 * fitting:
            self._remove_images()
            self._size = width, fitting

    def _fill(self, values: dict[SurfaceInput, Float32], spans: _Spans) -> None:
        """Write the inputs' values into the images that the materials read; what lies between the spans is any."""
        flat = np.zeros((self._size[0] * self._size[1], 4), np.float32)
        for what, entry in values.items():
            if what not in self._images:
                self._add_image(what)
            for places, pixels in spans:
                flat[pixels] = entry[places]
            image = self._images[what]
            image.pixels.foreach_set(flat.ravel())
            image.update()

    def _add_image(self, what: SurfaceInput) -> None:
        """Add an image of an input, and have the materials read it."""
        self._images[what] = _new_image(*self._size)
        for copy in self._copies.values():
            for read, node in copy.readers:
                if read == what:
                    node.image = self._images[what]

    def _lay_out(self, numbers: list[int], begins: np.ndarray) -> None:
        """Have the stage show a plane with one face per material, of rows `begins` to the next.

        What the materials read are the lowest rows of the input images.
        """
        width, height = self._size
        corners: list[tuple[float, float, float]] = []
        faces: list[tuple[int, ...]] = []
        maps: list[float] = []
        for low, high in zip(begins[:-1].tolist(), begins[1:].tolist(), strict=True):
            first = len(corners)
            corners += [(0.0, low, 0.0), (width, low, 0.0), (width, high, 0.0), (0.0, high, 0.0)]
            faces.append((first, first + 1, first + 2, first + 3))
            maps += [0.0, low / height, 1.0, low / height, 1.0, high / height, 0.0, high / height]
        mesh = self._empty_mesh()
        mesh.from_pydata(corners, [], faces)
        mesh.uv_layers.new(name="SR Pixels").data.foreach_set("uv", maps)
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
    """Yield a calculator with copies of materials, by their index; afterwards nothing of it is left but these."""
    with ExitStack() as stack:
        folder = stack.enter_context(scratch_folder())
        set_up = stack.enter_context(new_stage(Passes(layers, lit=False), folder))
        set_up.scene.render.use_persistent_data = False  # else images that change would be kept
        result = Calculator(set_up, copies, layers)
        stack.callback(result.close)
        yield result


@contextmanager
def reading_copy(item: bpy.types.Material, layers: Sequence[str]) -> Iterator[ReadingCopy]:
    """Context of a copy of a material that outputs only the layers, its inputs read from images; removed on exit.

    What is animated in the material stays in the copy as it is in the current scene's frame.
    """
    copied = item.copy()
    groups: list[bpy.types.NodeTree] = []
    try:
        tree = copied.node_tree
        groups = copy_groups(tree)
        _freeze(copied, groups, bpy.context.scene.frame_current)
        for part in (tree, *groups):
            unlink_missing(part)
        expressions = layer_expressions(copied)
        nodes = LayerNodes(tree)
        kept = {node.aov_name: node for node in tree.nodes if node.type == "OUTPUT_AOV" and node.aov_name in layers}
        for layer in layers:
            if layer in expressions and layer not in kept:
                kept[layer] = nodes.add_output(layer, expressions[layer])
        for node in [node for node in tree.nodes if node.type in ("OUTPUT_AOV", "OUTPUT_MATERIAL")]:
            if node not in kept.values():
                tree.nodes.remove(node)
        search = InputSearch()
        for node in kept.values():
            for entry in node.inputs:
                for link in entry.links:
                    search.visit(link.from_socket)
        readers = list(replace_inputs(search.sites))
        glow, end = tree.nodes.new("ShaderNodeEmission"), tree.nodes.new("ShaderNodeOutputMaterial")
        tree.links.new(glow.outputs[0], end.inputs["Surface"])
        yield ReadingCopy(copied, readers)
    finally:
        # Each removal looks through the whole file.
        bpy.data.batch_remove([copied, *groups])


def _freeze(item: bpy.types.Material, groups: Sequence[bpy.types.NodeTree], frame: int) -> None:
    """Have a copied material look at any time, in any scene, as it does now, at a frame of the current scene."""
    for block in (item, item.node_tree, *groups):
        block.animation_data_clear()  # values stay as they are; what drives them isn't needed any more
    for tree in (item.node_tree, *groups):
        for node in tree.nodes:
            if node.type == "TEX_IMAGE" and node.image_user.use_auto_refresh:
                _freeze_sequence(node.image_user, frame)


def _freeze_sequence(user: bpy.types.ImageUser, frame: int) -> None:
    """Have an image sequence or movie show at all times what it shows at a frame of the scene."""
    shown = frame - user.frame_start + 1
    if user.use_cyclic:
        shown = (shown - 1) % user.frame_duration + 1
    user.frame_offset += min(max(shown, 0), user.frame_duration) - 1
    # Beyond its end a sequence shows its last image, here the only one.
    user.frame_start, user.frame_duration, user.use_cyclic = _FIRST_FRAME, 1, False


def _new_image(width: int, height: int) -> bpy.types.Image:
    """Return a new float RGBA image without colour management."""
    image = bpy.data.images.new("SR Calculator", width, height, alpha=True, float_buffer=True, is_data=True)
    image.alpha_mode = "CHANNEL_PACKED"
    return image
