"""Sun and sky of a road's environment, for the time of rendering."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple, Self

import bpy
import numpy as np

from ...road.surroundings import Environment
from ...scanning.colour.light import SunAndSky, expose_light, sun_direction
from ...scanning.colour.twilight import sun_share
from ..sky import SUN_ANGLE, SUN_COLOR, SUN_STRENGTH, fill_sky, new_sun
from .stage import SUN_GROUP, Passes, stage

_PROBE_SAMPLES = 1024
"""Samples per pixel of the white surface under the sky; chosen."""


@dataclass(frozen=True)
class Daylight:
    """A sun lamp, a sky, and the light that a white surface gets from both.

    Attributes:
        sun: lamp.
        world: sky.
        light: both as white surfaces see them, exposed.
        exposure: factor from rendered radiance to exposed values.
    """

    sun: bpy.types.Object
    world: bpy.types.World
    light: SunAndSky
    exposure: float


@contextmanager
def daylight(environment: Environment, sharp: bool) -> Iterator[Daylight]:
    """Context of a sun lamp and a sky for a road's environment, with their exposure; removes them on exit.

    Args:
        environment: angles and strength of the road's sun.
        sharp: whether the sun is a point, so that one sample per pixel gives shadows without noise.
    """
    sky = _Sky.of(environment)
    with ExitStack() as stack:
        sun = new_sun("SR Stage Sun", environment, 0.0 if sharp else SUN_ANGLE)
        lamp = sun.data
        stack.callback(lambda: bpy.data.lights.remove(lamp))
        stack.callback(lambda: bpy.data.objects.remove(sun))
        world = stack.enter_context(_world(sky))
        light, exposure = _exposed(environment)
        yield Daylight(sun, world, light, exposure)


def measured_light(environment: Environment) -> SunAndSky:
    """Return sunlight and skylight on white surfaces, exposed; renders the sky once. Only in Blender's main thread."""
    return _exposed(environment)[0]


def _exposed(environment: Environment) -> tuple[SunAndSky, float]:
    """Return sunlight and skylight on white surfaces, exposed, and the factor of exposure, see `expose_light`."""
    # Radiance of a white Lambertian surface that faces the sun: L = E / pi. Blender keeps the irradiance E as 32 bits.
    sun_radiance = np.array(SUN_COLOR) * float(np.float32(SUN_STRENGTH * environment.sun_strength)) / math.pi
    sun_radiance = sun_radiance * sun_share(environment.sun_elevation_deg)
    return expose_light(sun_direction(environment), sun_radiance, np.array(sky_radiance(environment)))


def sky_radiance(environment: Environment) -> tuple[float, float, float]:
    """Return the radiance (red, green, blue) of a white matt level surface under an environment's sky alone.

    After sunset it is the radiance of a sky as bright as at a low sun, see `sky.fill_sky`.
    Each sky is rendered once per process, in Blender's main thread.
    """
    return _sky_radiance(_Sky.of(environment))


class _Sky(NamedTuple):
    """Parameters of a sky: angles of the sun (degrees), and its strength."""

    elevation: float
    azimuth: float
    strength: float

    @classmethod
    def of(cls, environment: Environment) -> Self:
        """Return the sky of a road's environment."""
        return cls(environment.sun_elevation_deg, environment.sun_azimuth_deg, environment.sun_strength)


@contextmanager
def _world(sky: _Sky) -> Iterator[bpy.types.World]:
    """Context of a new Blender world with this sky; removes it on exit."""
    world = bpy.data.worlds.new("SR Stage Sky")
    try:
        fill_sky(world, *sky, exposed=True)
        yield world
    finally:
        bpy.data.worlds.remove(world)


@lru_cache(maxsize=64)
def _sky_radiance(sky: _Sky) -> tuple[float, float, float]:
    """Render a white matt horizontal surface under a sky; return its radiance (red, green, blue), cached.

    It takes longer than a small scan, so each sky is rendered once per process.
    """
    with ExitStack() as stack:
        world = stack.enter_context(_world(sky))
        # Importance sampling of the sky would take longer to prepare than the many samples without it take.
        world.cycles.sampling_method = "NONE"
        mesh = bpy.data.meshes.new("SR Probe")
        stack.callback(lambda: bpy.data.meshes.remove(mesh))
        mesh.from_pydata([(-1.0, -1.0, 0.0), (1.0, -1.0, 0.0), (1.0, 1.0, 0.0), (-1.0, 1.0, 0.0)], [], [(0, 1, 2, 3)])
        white = bpy.data.materials.new("SR Probe")
        stack.callback(lambda: bpy.data.materials.remove(white))
        _make_matt(white)
        mesh.materials.append(white)
        item = bpy.data.objects.new("SR Probe", mesh)
        stack.callback(lambda: bpy.data.objects.remove(item))
        scene = bpy.data.scenes.new("SR Probe")
        stack.callback(lambda: bpy.data.scenes.remove(scene))
        scene.collection.objects.link(item)
        probe = stack.enter_context(stage(scene, (), Passes((), lit=True, samples=_PROBE_SAMPLES), (), world))
        probe.camera.location = (0.0, 0.0, 1.0)
        probe.camera.data.type, probe.camera.data.ortho_scale = "ORTHO", 0.5
        red, green, blue = probe.render(8, 8).layers[SUN_GROUP].reshape(-1, 3).mean(axis=0).astype(np.float64)
        return float(red), float(green), float(blue)


def _make_matt(white: bpy.types.Material) -> None:
    """Give a material the nodes of a white Lambertian surface."""
    if white.node_tree is None:
        white.use_nodes = True
    nodes = white.node_tree.nodes
    nodes.clear()
    diffuse, output = nodes.new("ShaderNodeBsdfDiffuse"), nodes.new("ShaderNodeOutputMaterial")
    diffuse.inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)
    white.node_tree.links.new(diffuse.outputs[0], output.inputs["Surface"])
