"""Render targets: colours and material layers of the points, from images along the path or a pixel per return."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager

import bpy

from ...base.errors import InputError
from ...base.turns.main_thread import MainThreadCalls
from ...scanning.colour.colour import (
    MATERIAL_LAYERS,
    ColourSettings,
    LayerSource,
    MaterialLayers,
    SurfaceConstants,
    needed_layers,
    takes_nodes,
)
from ...scanning.colour.light import SunAndSky
from ...scanning.colour.request import LayerRequest, material_layers
from ...scanning.colour.surfaces import SceneSurfaces
from ...scanning.colour.views import View, scene_sample, views_along
from ..materials.calculable import material_needs
from .images import RenderedLayers
from .light import Daylight, daylight, measured_light
from .nodes import NodeLayers
from .programs import material_work
from .returns import ReturnCamera
from .snapshot import MaterialSnapshot
from .stage import Passes, RenderStage, stage
from .surfaces import numbered_materials, scene_constants
from .versions import HAS_RETURN_CAMERA

__all__ = [
    "HAS_RETURN_CAMERA",
    "MaterialSnapshot",
    "RenderedLayers",
    "ReturnCamera",
    "check_colour",
    "image_views",
    "layer_source",
    "renders_returns",
    "snapshot_layers",
    "varying_materials",
]

_BOUNCES = 3
"""Reflections after which a light path ends; chosen: later ones add little in the open."""


def check_colour(settings: ColourSettings) -> None:
    """Raise `InputError` if colour settings contradict each other, or this Blender can't render them.

    Raises:
        InputError: a pixel per return in a Blender before 5.0 or without OSL, or with EEVEE; materials' nodes with
            EEVEE; EEVEE or materials' nodes with whole light paths.
    """
    if settings.source == "nodes" and settings.lighting == "path":
        raise InputError("colour.source", "nodes", "must be images or returns where colour.lighting is path")
    if settings.source == "nodes" and settings.engine != "cycles":
        raise InputError("colour.engine", settings.engine, "must be cycles where colour.source is nodes")
    if settings.source == "returns" and not HAS_RETURN_CAMERA:
        raise InputError("colour.source", "returns", "needs Blender 5.0 or newer, with OSL: take images or nodes here")
    if settings.source == "returns" and settings.engine != "cycles":
        raise InputError("colour.engine", settings.engine, "must be cycles where colour.source is returns")
    if settings.lighting == "path" and settings.engine != "cycles":
        raise InputError("colour.lighting", settings.lighting, "must be direct where colour.engine is eevee")


def renders_returns(settings: ColourSettings) -> bool:
    """Return whether colours come from rendering a pixel per return in this Blender, not from images or nodes."""
    return settings.source == "returns" or (
        settings.source == "auto" and not takes_nodes(settings) and settings.engine == "cycles" and HAS_RETURN_CAMERA
    )


@contextmanager
def layer_source(
    request: LayerRequest, source: bpy.types.Scene | None = None, progress: Callable[[float], None] = lambda share: None
) -> Iterator[LayerSource]:
    """Context of a source of the points' colours and layers; renders images on entry, restores the scene on exit.

    Must be called on Blender's main thread; what it yields may be used by any threads.

    Args:
        request: the layers that are requested, the scene mesh, and how colours are made.
        source: the Blender scene that is scanned; the current one if None.
        progress: called with the share (0 to 1) of the images that is rendered.
    """
    check_colour(request.settings)
    constants = scene_constants(request.mesh.materials)
    by_nodes = takes_nodes(request.settings)
    with ExitStack() as stack:
        day, light = None, SunAndSky()
        if request.lit and request.settings.source != "material":
            day = stack.enter_context(daylight(request.environment, request.settings.lighting == "direct"))
            light = day.light
        fallback = material_layers(request, constants, light)
        if by_nodes:
            yield _node_layers(stack, request, fallback, day, source)
            return
        passes = _passes(request, constants)
        if request.settings.source == "material" or not passes.channels:
            yield fallback
            return
        if request.mesh.unit != 1.0:
            text = f"can't render a scene whose unit is {request.mesh.unit:g} m: take nodes or material, or set its "
            text += "unit scale to 1 and scale what is in it"
            raise InputError("colour.source", request.settings.source, text)
        render_stage = _lit_stage(stack, request, passes, day, source)
        exposure = day.exposure if day else 1.0
        if passes.position:  # a pixel per return
            yield ReturnCamera(render_stage, fallback, exposure)
            return
        views = image_views(request)
        images = RenderedLayers(render_stage, views, fallback, exposure)
        try:
            images.render(progress)
            # The stage is removed before the scan, which needs the renderer's memory.
            stack.close()
            yield images
        finally:
            images.close()


def _lit_stage(
    stack: ExitStack, request: LayerRequest, passes: Passes, day: Daylight | None, source: bpy.types.Scene | None
) -> RenderStage:
    """Enter a stage that shows the scene in daylight into the stack, so that the stack closes it; return the stage."""
    lamps = (day.sun,) if day else ()
    world = day.world if day and passes.sky else None
    scene = source or bpy.context.scene
    return stack.enter_context(stage(scene, request.mesh.materials, passes, lamps, world, request.settings.engine))


def _node_layers(
    stack: ExitStack,
    request: LayerRequest,
    fallback: MaterialLayers,
    day: Daylight | None,
    source: bpy.types.Scene | None,
) -> LayerSource:
    """Return a source that evaluates layers by the materials' nodes.

    Materials whose nodes can't be evaluated ("obstacles") are rendered with a pixel per return where this Blender can,
    else they get their mean values.
    """
    calls, constants, names = MainThreadCalls(), fallback.constants, request.mesh.materials
    layers = node_layers(request, constants)
    if not layers and not request.lit:
        return fallback
    varying = varying_materials(constants, layers)
    items = {index: item for index, item in numbered_materials(names) if index in varying}
    needs_by_index = {index: material_needs(item) for index, item in items.items()}
    obstacles = {index: need.obstacles for index, need in needs_by_index.items() if need.obstacles}
    calculable_items = {index: item for index, item in items.items() if index not in obstacles}
    return_camera = None
    if obstacles and HAS_RETURN_CAMERA and request.mesh.unit == 1.0:
        render_stage = _lit_stage(stack, request, _passes(request, constants, by_return=True), day, source)
        return_camera = ReturnCamera(render_stage, fallback, day.exposure if day else 1.0, calls)
    work = stack.enter_context(material_work(calculable_items, layers, request.kernels))
    surfaces = SceneSurfaces(request.mesh, request.moving)
    return NodeLayers(calls, work, surfaces, fallback, return_camera, obstacles, request)


def node_layers(request: LayerRequest, constants: SurfaceConstants) -> tuple[str, ...]:
    """Return the names of the layers for which materials' nodes are evaluated: requested ones that vary somewhere."""
    layers = needed_layers(request.names, request.settings.mode)
    if request.lit:
        layers |= set(MATERIAL_LAYERS)  # reflected light depends on all layers of the material
    return constants.varying_layers(frozenset(layers))


def varying_materials(constants: SurfaceConstants, layers: Sequence[str] = tuple(MATERIAL_LAYERS)) -> set[int]:
    """Return the indices of the materials that vary some of these layers."""
    return {index for name in layers for index in constants.varies[name].nonzero()[0].tolist()}


@contextmanager
def snapshot_layers(
    request: LayerRequest, constants: SurfaceConstants, snapshot: MaterialSnapshot, calls: MainThreadCalls
) -> Iterator[LayerSource]:
    """Context of a source of layers from materials' nodes as they were at the snapshot; any thread may open it.

    Points of materials whose nodes can't be evaluated get their material's mean values.

    Args:
        request: the layers that are requested, the scene mesh, and how colours are made.
        constants: mean layers of the scene's materials, and which of them vary.
        snapshot: copies of these materials in a file.
        calls: queue of calls that Blender's main thread makes for other threads.
    """
    light = SunAndSky()
    if request.lit:
        light = calls.call(lambda: measured_light(request.environment))
    fallback = material_layers(request, constants, light)
    layers = node_layers(request, constants)
    if not layers and not request.lit:
        yield fallback
        return
    varying = varying_materials(constants, layers)
    obstacles = {index: names for index, names in snapshot.obstacles.items() if index in varying}
    surfaces = SceneSurfaces(request.mesh, request.moving)
    yield NodeLayers(calls, snapshot.work(varying, layers), surfaces, fallback, None, obstacles, request)


def image_views(request: LayerRequest) -> list[View]:
    """Return the camera views along the path from which a request's images are rendered."""
    settings, points = request.settings, scene_sample(request.mesh)
    views = views_along(request.path, points, settings, request.field_of_view, settings.max_resolution)
    return views if request.pick is None else request.pick(views)


def _passes(request: LayerRequest, constants: SurfaceConstants, by_return: bool = False) -> Passes:
    """Return the passes to render for a request: only requested layers that vary on some material.

    Args:
        request: the layers that are requested, and how colours are made.
        constants: mean layers of the materials, and which of them vary.
        by_return: whether a pixel per return is rendered whatever the request's settings say.
    """
    settings, lit = request.settings, request.lit
    light_paths = lit and settings.lighting == "path" and settings.engine == "cycles"
    layers = needed_layers(request.names, settings.mode)
    if light_paths:
        # Cycles multiplies by the base colour itself: it is an output only where it is requested.
        layers -= {"base_color"} - request.names
    returns = by_return or renders_returns(settings)
    return Passes(
        layers=constants.varying_layers(layers),
        lit=lit,
        sky=light_paths,
        depth=not returns,
        position=returns,
        samples=settings.samples,
        bounces=_BOUNCES if light_paths else 0,
    )
