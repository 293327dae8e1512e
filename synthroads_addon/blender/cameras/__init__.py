"""Render targets: colours and material layers of the points, from images along the path or a pixel per return."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass

import bpy

from ...base.errors import InputError
from ...road.surroundings import Environment
from ...scanning.colour.colour import LayerSource, MaterialLayers, Shading, SurfaceConstants, needed_layers
from ...scanning.colour.light import CloudShadows, SunAndSky
from ...scanning.colour.views import Poses, View, scene_sample, views_along
from ...scanning.scene.mesh import SceneMesh
from ...scenario.colour import ColourScenario
from .images import RenderedLayers
from .light import daylight
from .returns import ReturnCamera
from .stage import Passes, stage
from .surfaces import scene_constants
from .versions import HAS_RETURN_CAMERA

__all__ = [
    "HAS_RETURN_CAMERA",
    "ColourJob",
    "RenderedLayers",
    "ReturnCamera",
    "check_colour",
    "image_views",
    "layer_source",
    "material_layers",
    "takes_returns",
]

_BOUNCES = 3
"""Reflections that whole light paths are followed over."""


@dataclass(frozen=True)
class ColourJob:
    """What colours and layers are wanted, and of what.

    Attributes:
        scenario: how.
        fidelity: draft, standard or high.
        wanted: layers: ``rgb``, ``base_color``, ``roughness``, ``metallic``, ``specular``.
        mesh: what is scanned, without what moves.
        environment: light and weather.
        path: the scanner's.
        field_of_view: the scanner's, rad.
        seed: of the clouds.
        frame: where (3,) the scene's local frame begins in that of the clouds, m.
        pick: which of the images along the path are rendered, and what of them; None for all.
    """

    scenario: ColourScenario
    fidelity: str
    wanted: frozenset[str]
    mesh: SceneMesh
    environment: Environment
    path: Poses
    field_of_view: float
    seed: int = 0
    frame: tuple[float, float, float] = (0.0, 0.0, 0.0)
    pick: Callable[[list[View]], list[View]] | None = None


def check_colour(scenario: ColourScenario) -> None:
    """Refuse what this Blender can't do.

    Raises:
        InputError: a pixel per return in a Blender before 5.0 or without OSL, or with EEVEE; EEVEE with whole light
            paths.
    """
    if scenario.source == "returns" and not HAS_RETURN_CAMERA:
        raise InputError("colour: source", "returns", "needs Blender 5.0 or newer, with OSL; this one has images")
    if scenario.source == "returns" and scenario.engine != "cycles":
        raise InputError("colour: engine", scenario.engine, "must be cycles for a pixel per return")
    if scenario.lighting == "path" and scenario.engine != "cycles":
        raise InputError("colour: lighting", scenario.lighting, "must be direct for eevee")


def takes_returns(scenario: ColourScenario) -> bool:
    """Return whether what is rendered is a pixel per return here, and not images."""
    return scenario.source == "returns" or (
        scenario.source == "auto" and scenario.engine == "cycles" and HAS_RETURN_CAMERA
    )


@contextmanager
def layer_source(
    job: ColourJob, source: bpy.types.Scene | None = None, progress: Callable[[float], None] = lambda share: None
) -> Iterator[LayerSource]:
    """Yield what gives the points their layers; images are rendered before. The scene is as it was afterwards.

    Must be called on Blender's main thread. `ReturnCamera` must be used there as well; the others by any threads.

    Args:
        job: what is wanted.
        source: the scene that is scanned; the current one if None.
        progress: called with the share of the images that is rendered.
    """
    check_colour(job.scenario)
    constants = scene_constants(job.mesh.materials)
    passes = _passes(job, constants)
    lit = "rgb" in job.wanted and job.scenario.mode == "lit"
    with ExitStack() as stack:
        light, exposure, world = SunAndSky(), 1.0, None
        lamps: tuple[bpy.types.Object, ...] = ()
        if lit and job.scenario.source != "material":
            day = stack.enter_context(daylight(job.environment, job.scenario.lighting == "direct"))
            light, exposure, lamps = day.light, day.exposure, (day.sun,)
            world = day.world if passes.sky else None
        fallback = material_layers(job.scenario, constants, lit, job.environment, job.seed, light, job.frame)
        if job.scenario.source == "material" or not passes.channels:
            yield fallback
            return
        set_up = stack.enter_context(
            stage(source or bpy.context.scene, job.mesh.materials, passes, lamps, world, job.scenario.engine)
        )
        if passes.position:
            yield ReturnCamera(set_up, fallback, exposure)
            return
        views = image_views(job)
        images = RenderedLayers(set_up, views, fallback, exposure)
        try:
            images.render(progress)
            # The scan needs the renderer's memory.
            stack.close()
            yield images
        finally:
            images.close()


def image_views(job: ColourJob) -> list[View]:
    """Return the cameras of a job's images."""
    settings = job.scenario.settings(job.fidelity, job.path.typical_range)
    views = views_along(job.path, scene_sample(job.mesh), settings, job.field_of_view, job.scenario.max_resolution)
    return views if job.pick is None else job.pick(views)


def material_layers(
    scenario: ColourScenario,
    constants: SurfaceConstants,
    lit: bool,
    environment: Environment,
    seed: int,
    light: SunAndSky | None = None,
    frame: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> MaterialLayers:
    """Return the materials' own values: all of it where nothing is rendered, else for what no image shows.

    It touches no data of Blender.

    Args:
        scenario: how.
        constants: means of the scene's materials.
        lit: lit colours are wanted.
        environment: its clouds drift over the scene.
        seed: of the clouds.
        light: that of the images; the usual one if None.
        frame: see `ColourJob`.
    """
    clouds = CloudShadows(environment, seed, frame) if lit and environment.cloud_cover > 0.0 else None
    return MaterialLayers(constants, Shading(scenario.mode, light or SunAndSky(), clouds))


def _passes(job: ColourJob, constants: SurfaceConstants) -> Passes:
    """Return what must be rendered: no layer that isn't wanted, and none that is constant on every material."""
    scenario = job.scenario
    lit = "rgb" in job.wanted and scenario.mode == "lit"
    whole = lit and scenario.lighting == "path" and scenario.engine == "cycles"
    needed = needed_layers(job.wanted, scenario.mode)
    if whole:
        needed -= {"base_color"} - job.wanted
    returns = takes_returns(scenario)
    return Passes(
        layers=constants.varying(needed),
        lit=lit,
        sky=whole,
        depth=not returns,
        position=returns,
        samples=scenario.settings(job.fidelity).samples,
        bounces=_BOUNCES if whole else 0,
    )
