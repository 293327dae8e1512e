"""The stage: a temporary scene in which the objects of another scene are rendered, removed afterwards."""

from __future__ import annotations

import errno
import os
import shutil
import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ...base.scratch.folders import scratch_folder, temporary_folder_error
from ...scanning.colour.colour import MATERIAL_LAYERS
from ..files import stderr_if_it_succeeds
from .exr import read_layers
from .surfaces import NUMBER, prepared_materials
from .versions import eevee_engine, multilayer_exr

NAME = "SR Stage"
_LEAST_FREE = 1 << 16
"""Free space of a disk, bytes, below which an image may have been cut short; chosen."""
_SMALLEST = 4
"""Width and height of the smallest picture that Blender renders, px."""
SUN_GROUP, SKY_GROUP = "sun", "sky"
"""Light groups of the lit image, where both are rendered."""
_POSITION, _DEPTH = "Position", "Depth"


@dataclass(frozen=True)
class Passes:
    """Selection of the passes to render, with samples and bounces.

    Attributes:
        layers: names of the materials' layers, see `MATERIAL_LAYERS`.
        lit: whether to render the sunlight that surfaces reflect.
        sky: whether to render the reflected skylight too, in a pass of its own.
        depth: whether to render the depth along the camera's axis.
        position: whether to render the place that each pixel shows.
        samples: samples per pixel.
        bounces: reflections over which light is followed.
    """

    layers: Sequence[str]
    lit: bool
    sky: bool = False
    depth: bool = False
    position: bool = False
    samples: int = 1
    bounces: int = 0

    @property
    def channels(self) -> dict[str, int]:
        """Return the rendered channels' names in order, with their numbers of components."""
        light = {SUN_GROUP: 3} if self.lit else {}
        light |= {SKY_GROUP: 3} if self.sky else {}
        return {name: MATERIAL_LAYERS[name] for name in self.layers} | light


@dataclass(frozen=True)
class RenderedPasses:
    """Passes of one rendered image, rows from the top.

    Attributes:
        layers: by channel: (H, W, C) float32.
        material: (H, W): number of the material plus 1, 0 for none.
        depth: (H, W) m, or None.
        position: (H, W, 3) local, m, or None.
    """

    layers: dict[str, NDArray[np.float32]]
    material: NDArray[np.float32]
    depth: NDArray[np.float32] | None
    position: NDArray[np.float32] | None


class RenderStage:
    """Temporary scene and camera that render the visible objects of another scene.

    Attributes:
        scene: the temporary scene.
        camera: its camera object.
        folder: temporary folder for files.
        images: images rendered so far.
        pixels: pixels rendered so far.
    """

    def __init__(self, scene: bpy.types.Scene, camera: bpy.types.Object, passes: Passes, folder: Path) -> None:
        self.scene, self.camera, self.passes, self.folder = scene, camera, passes, folder
        self.images = self.pixels = 0

    def render(self, width: int, height: int) -> RenderedPasses:
        """Render the camera's current view; return its passes; must run on Blender's main thread.

        Raises:
            OutputError: the image can't be written to the temporary folder.
        """
        render, path = self.scene.render, self.folder / "image.exr"
        render.resolution_x, render.resolution_y, render.resolution_percentage = width, height, 100
        render.filepath = str(path)
        path.unlink(missing_ok=True)  # else an earlier image would be read if this one can't be written
        self.images, self.pixels = self.images + 1, self.pixels + width * height
        try:
            with _silence(), stderr_if_it_succeeds():
                bpy.ops.render.render(write_still=True, scene=self.scene.name)
                if shutil.disk_usage(self.folder).free < _LEAST_FREE:  # Blender raises nothing where an image is cut
                    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            return self._read(read_layers(path))
        except (OSError, LookupError, StopIteration, RuntimeError) as error:
            raise temporary_folder_error(self.folder, error) from None

    def drop_picture(self) -> None:
        """Make Blender drop the last picture by rendering a tiny one: 5.2 keeps it even after the scene is removed."""
        if not self.images:
            return
        scene, render = self.scene, self.scene.render
        render.use_persistent_data, scene.world = False, None
        for item in list(scene.collection.objects):
            if item != self.camera:
                scene.collection.objects.unlink(item)
        render.resolution_x = render.resolution_y = _SMALLEST
        # After a failed rendering this one may fail too; the user should see the first error.
        with _silence(), stderr_if_it_succeeds(), suppress(RuntimeError):
            bpy.ops.render.render(scene=scene.name)

    def forget(self) -> None:
        """Make the renderer drop the data it keeps from image to image."""
        self.scene.render.use_persistent_data = False
        self.scene.render.use_persistent_data = True

    def _read(self, channels: dict[str, NDArray[Any]]) -> RenderedPasses:
        """Return the passes of an image from its EXR file's channels (H, W), by name."""

        def stacked(name: str, parts: str) -> NDArray[np.float32]:
            return np.stack([channels[f"{name}.{part}"] for part in parts], axis=-1)

        layers = {
            name: stacked(name, "RGB") if MATERIAL_LAYERS[name] == 3 else stacked(name, "X")
            for name in self.passes.layers
        }
        if self.passes.sky:
            layers |= {group: stacked(f"Combined_{group}", "RGB") for group in (SUN_GROUP, SKY_GROUP)}
        elif self.passes.lit:
            layers[SUN_GROUP] = stacked("Combined", "RGB")
        # Names of the material index: our own output in EEVEE, and Cycles' pass in 5.2 and in 4.5.
        index_names = (f"{NUMBER}.X", "Material Index.X", "IndexMA.X")
        material = next(channels[name] for name in index_names if name in channels)
        depth = channels[f"{_DEPTH}.Z"] if self.passes.depth else None
        position = stacked(_POSITION, "XYZ") if self.passes.position else None
        return RenderedPasses(layers, material, depth, position)


@contextmanager
def stage(
    source: bpy.types.Scene,
    materials: Sequence[str],
    passes: Passes,
    lights: Sequence[bpy.types.Object],
    world: bpy.types.World | None,
    engine: str = "cycles",
) -> Iterator[RenderStage]:
    """Context of a stage with a scene's visible objects and prepared materials; removes and restores all on exit.

    Args:
        source: the scene whose objects are rendered.
        materials: names of the scene mesh's materials.
        passes: the passes to render.
        lights: lamps, in place of the source scene's.
        world: the sky, or None for blackness.
        engine: ``cycles`` or ``eevee``.
    """
    with ExitStack() as stack:
        folder = stack.enter_context(scratch_folder())
        stack.enter_context(prepared_materials(materials, passes.layers, engine == "eevee"))
        render_stage = stack.enter_context(new_stage(passes, folder, (*visible_objects(source), *lights), engine))
        scene = render_stage.scene
        scene.world = world
        scene.frame_set(source.frame_current, subframe=source.frame_subframe)
        _set_light_groups(scene, passes, lights, world)
        yield render_stage


@contextmanager
def new_stage(
    passes: Passes, folder: Path, items: Sequence[bpy.types.Object] = (), engine: str = "cycles"
) -> Iterator[RenderStage]:
    """Context of a stage with the given objects and a camera; removes its scene, camera and images on exit.

    Args:
        passes: the passes to render.
        folder: temporary folder for files.
        items: the objects.
        engine: ``cycles`` or ``eevee``.
    """
    image_names = {item.name for item in bpy.data.images}
    with ExitStack() as stack:
        stack.callback(_forget_images, image_names)
        scene = bpy.data.scenes.new(NAME)
        stack.callback(_remove_stage, scene)
        data = bpy.data.cameras.new(NAME)
        stack.callback(lambda: bpy.data.cameras.remove(data))
        camera = bpy.data.objects.new(NAME, data)
        stack.callback(lambda: bpy.data.objects.remove(camera))
        for item in (*items, camera):
            scene.collection.objects.link(item)
        scene.camera = camera
        _set_engine(scene, engine, passes)
        _set_passes(scene, passes)
        multilayer_exr(scene.render.image_settings)
        render_stage = RenderStage(scene, camera, passes, folder)
        stack.callback(render_stage.drop_picture)
        yield render_stage


def _remove_stage(scene: bpy.types.Scene) -> None:
    """Remove the stage's scene with its renderer's data, keeping the objects.

    A renderer that outlives its scene still knows the objects, and Blender 4.5 crashes now and then when one of these
    is removed later.
    """
    scene.render.use_persistent_data = False
    for item in list(scene.collection.objects):
        scene.collection.objects.unlink(item)
    bpy.data.scenes.remove(scene)
    bpy.context.view_layer.update()


def visible_objects(source: bpy.types.Scene) -> list[bpy.types.Object]:
    """Return the visible objects of a scene's view layer (the current, else the first), without lamps and cameras."""
    layer = bpy.context.view_layer if source == bpy.context.scene else source.view_layers[0]
    layer.update()
    return [
        item
        for item in layer.objects
        if item.type not in ("LIGHT", "CAMERA", "LIGHT_PROBE") and item.visible_get(view_layer=layer)
    ]


def _set_engine(scene: bpy.types.Scene, engine: str, passes: Passes) -> None:
    """Set a scene's render engine, and its settings: one exact ray per sample, linear colours, no denoising."""
    scene.render.use_compositing = scene.render.use_sequencer = False
    scene.render.film_transparent = True
    scene.view_settings.view_transform = "Raw"
    if engine == "eevee":
        scene.render.engine = eevee_engine()
        scene.eevee.taa_render_samples = passes.samples
        scene.render.filter_size = 0.0
        return
    scene.render.engine = "CYCLES"
    # Keeps geometry and search trees from image to image.
    scene.render.use_persistent_data = True
    cycles = scene.cycles
    cycles.samples, cycles.use_adaptive_sampling, cycles.use_denoising = passes.samples, False, False
    cycles.max_bounces = cycles.diffuse_bounces = cycles.glossy_bounces = passes.bounces
    cycles.transparent_max_bounces = 8
    # A narrow filter: pixels take nothing of their neighbours.
    cycles.pixel_filter_type, cycles.filter_width = "BLACKMAN_HARRIS", 0.01
    cycles.use_auto_tile = False
    cycles.seed = 0
    preferences = bpy.context.preferences.addons.get("cycles")
    if preferences and preferences.preferences.has_active_device():
        cycles.device = "GPU"


def _set_passes(scene: bpy.types.Scene, passes: Passes) -> None:
    """Switch on the passes of a scene's view layer, and add an output for each of the materials' layers."""
    layer = scene.view_layers[0]
    layer.use_pass_material_index = scene.render.engine == "CYCLES"
    layer.use_pass_z, layer.use_pass_position = passes.depth, passes.position
    for name in passes.layers:
        output = layer.aovs.add()
        output.name, output.type = name, "COLOR" if MATERIAL_LAYERS[name] == 3 else "VALUE"
    if not layer.use_pass_material_index:
        # EEVEE has no pass of material indices. Declared last: in 5.2 values declared before colours come back 0.
        output = layer.aovs.add()
        output.name, output.type = NUMBER, "VALUE"


def _set_light_groups(
    scene: bpy.types.Scene, passes: Passes, lights: Sequence[bpy.types.Object], world: bpy.types.World | None
) -> None:
    """Put sun and sky into separate light groups if the passes include the sky."""
    if not passes.sky:
        return
    layer = scene.view_layers[0]
    for name in (SUN_GROUP, SKY_GROUP):
        layer.lightgroups.add(name=name)
    for item in lights:
        item.lightgroup = SUN_GROUP
    if world is not None:
        world.lightgroup = SKY_GROUP


@contextmanager
def _silence() -> Iterator[None]:
    """Context in which the process's standard output, where Blender reports each image, is discarded."""
    if sys.stdout is not None:
        sys.stdout.flush()
    try:
        saved_output = os.dup(1)
    except OSError:
        # A Blender without a console has no standard output.
        yield
        return
    null_device = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(null_device, 1)
        yield
    finally:
        os.dup2(saved_output, 1)
        os.close(null_device)
        os.close(saved_output)


def _forget_images(names: set[str]) -> None:
    """Remove the images from the open file that aren't in `names`."""
    for item in [item for item in bpy.data.images if item.name not in names]:
        bpy.data.images.remove(item)
