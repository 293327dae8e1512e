"""Render targets: colours and material layers of the points, from images along the path or a pixel per return."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager

import bpy

from ...base.errors import InputError
from ...scanning.colour.colour import ColourSettings, LayerSource, SurfaceConstants, needed_layers
from ...scanning.colour.light import SunAndSky
from ...scanning.colour.request import LayerRequest, material_layers
from ...scanning.colour.views import View, scene_sample, views_along
from .images import RenderedLayers
from .light import daylight
from .returns import ReturnCamera
from .stage import Passes, stage
from .surfaces import scene_constants
from .versions import HAS_RETURN_CAMERA

__all__ = [
    "HAS_RETURN_CAMERA",
    "RenderedLayers",
    "ReturnCamera",
    "check_colour",
    "image_views",
    "layer_source",
    "renders_returns",
]

_BOUNCES = 3
"""Reflections that whole light paths are followed over."""


def check_colour(settings: ColourSettings) -> None:
    """Refuse what this Blender can't do.

    Raises:
        InputError: a pixel per return in a Blender before 5.0 or without OSL, or with EEVEE; EEVEE with whole light
            paths.
    """
    if settings.source == "returns" and not HAS_RETURN_CAMERA:
        raise InputError("colour: source", "returns", "needs Blender 5.0 or newer, with OSL; this one has images")
    if settings.source == "returns" and settings.engine != "cycles":
        raise InputError("colour: engine", settings.engine, "must be cycles for a pixel per return")
    if settings.lighting == "path" and settings.engine != "cycles":
        raise InputError("colour: lighting", settings.lighting, "must be direct for eevee")


def renders_returns(settings: ColourSettings) -> bool:
    """Return whether what is rendered is a pixel per return here, and not images."""
    return settings.source == "returns" or (
        settings.source == "auto" and settings.engine == "cycles" and HAS_RETURN_CAMERA
    )


@contextmanager
def layer_source(
    request: LayerRequest, source: bpy.types.Scene | None = None, progress: Callable[[float], None] = lambda share: None
) -> Iterator[LayerSource]:
    """Yield what gives the points their layers; images are rendered before. The scene is as it was afterwards.

    Must be called on Blender's main thread. `ReturnCamera` must be used there as well; the others by any threads.

    Args:
        request: what is wanted.
        source: the scene that is scanned; the current one if None.
        progress: called with the share of the images that is rendered.
    """
    check_colour(request.settings)
    constants = scene_constants(request.mesh.materials)
    passes = _passes(request, constants)
    with ExitStack() as stack:
        light, exposure, world = SunAndSky(), 1.0, None
        lamps: tuple[bpy.types.Object, ...] = ()
        if request.lit and request.settings.source != "material":
            day = stack.enter_context(daylight(request.environment, request.settings.lighting == "direct"))
            light, exposure, lamps = day.light, day.exposure, (day.sun,)
            world = day.world if passes.sky else None
        fallback = material_layers(request, constants, light)
        if request.settings.source == "material" or not passes.channels:
            yield fallback
            return
        set_up = stack.enter_context(
            stage(source or bpy.context.scene, request.mesh.materials, passes, lamps, world, request.settings.engine)
        )
        if passes.position:
            yield ReturnCamera(set_up, fallback, exposure)
            return
        views = image_views(request)
        images = RenderedLayers(set_up, views, fallback, exposure)
        try:
            images.render(progress)
            # The scan needs the renderer's memory.
            stack.close()
            yield images
        finally:
            images.close()


def image_views(request: LayerRequest) -> list[View]:
    """Return the cameras of a request's images."""
    settings, points = request.settings, scene_sample(request.mesh)
    views = views_along(request.path, points, settings, request.field_of_view, settings.max_resolution)
    return views if request.pick is None else request.pick(views)


def _passes(request: LayerRequest, constants: SurfaceConstants) -> Passes:
    """Return what must be rendered: no layer that isn't wanted, and none that is constant on every material."""
    settings, lit = request.settings, request.lit
    whole = lit and settings.lighting == "path" and settings.engine == "cycles"
    needed = needed_layers(request.wanted, settings.mode)
    if whole:
        needed -= {"base_color"} - request.wanted
    returns = renders_returns(settings)
    return Passes(
        layers=constants.varying(needed),
        lit=lit,
        sky=whole,
        depth=not returns,
        position=returns,
        samples=settings.samples,
        bounces=_BOUNCES if whole else 0,
    )
