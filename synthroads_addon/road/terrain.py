"""The ground beside the road: as it was before, generated or a digital elevation model, and with the road's batter.

The batter's heights count from the road's edge, distances outwards from it. Where the ground at the edge is higher the
road lies in a cutting, and the edge is followed by a swale and a batter that rises to the ground; else by a crest and
a batter that falls to it. Where batter and ground meet, a parabola with two equal tangents rounds them, or there is a
ditch at the foot of the embankment.
"""

from functools import lru_cache

import numpy as np

from ..base.arrays import Float
from ..base.files import change_stamp
from ..base.random_streams import stream
from ..base.schema import round_value
from .elevation_model import Corridor, ElevationModel, read_elevation_model
from .geometry import RoadGeometry, alignment_of, profile_of
from .parameters import AlignmentObject
from .surroundings import Terrain

GROUND_MARGIN = 12.0
"""Heights of the ground are wanted this far (m) beyond the terrain's half width and the road's ends."""

SWALE_FROM, SWALE_FULL = 0.2, 0.8
"""Height of the ground at the road's edge above it from which there is a swale, and from which it is full, m; so deep
below it there is a ditch at the embankment's foot."""

_WAVES = 24
_OCTAVES = 3.0
_FIT_SPACING = 1.0  # m, of the stations at which a road's height above the ground is averaged
_BLOCK = 20_000
"""Places looked up at a time: each needs a row of all strips."""


def ground_elevation(geometry: RoadGeometry, terrain: Terrain, station: Float, offset: Float) -> Float:
    """Return the ground's local elevation (N,), m, at stations and offsets (N,), as it is without batter.

    Generated ground follows the profile at ``embankment_height`` below it and undulates. A digital elevation model is
    the ground itself; farther than `GROUND_MARGIN` beyond the terrain's reach the result can be NaN.

    Raises:
        InputError: the elevation model is missing, unreadable or unfit for this road.
    """
    plan = geometry.alignment.place(station, offset)
    if terrain.elevation_model is None:
        return geometry.profile.elevation(station) - terrain.embankment_height + undulation(terrain, plan)
    parameters = geometry.parameters
    east, north, height = parameters.transform.translate
    model = road_elevation_model(
        terrain.elevation_model, parameters.metadata.epsg, parameters.alignment, (east, north), terrain.half_width
    )
    return model.elevation(plan[:, 0] + east, plan[:, 1] + north) - height


def undulation(terrain: Terrain, plan: Float) -> Float:
    """Return the generated ground's height (N,) above its mean at local points (N, 2), m.

    A sum of seeded plane waves over the plan, whose wavelengths spread over three octaves above ``wavelength`` and
    whose heights have the standard deviation ``undulation``.
    """
    rng = stream(terrain.seed, "terrain undulation")
    octave = rng.uniform(0.0, _OCTAVES, _WAVES)
    direction = rng.uniform(0.0, 2.0 * np.pi, _WAVES)
    phase = rng.uniform(0.0, 2.0 * np.pi, _WAVES)
    # Longer waves are higher; a wave of amplitude a has the variance a^2 / 2.
    weight = 2.0**octave
    amplitude = terrain.undulation * weight * np.sqrt(2.0 / np.sum(weight**2))
    number = 2.0 * np.pi / (terrain.wavelength * weight)
    vectors = number * np.stack([np.cos(direction), np.sin(direction)])
    return np.sin(plan @ vectors + phase) @ amplitude


def road_elevation_model(
    path: str, epsg: int, axis: AlignmentObject, origin: tuple[float, float], half_width: float
) -> ElevationModel:
    """Return the elevation model beneath a road from its file; the last two are cached while the files don't change.

    Args:
        path: GeoTIFF or ESRI ASCII grid; if relative, from the working directory.
        epsg: the road's map coordinate system.
        axis: its centreline.
        origin: map coordinates (east, north) of the local origin, m.
        half_width: the terrain's, m.

    Raises:
        InputError: as `read_elevation_model`.
    """
    file_stamp = change_stamp(path, "an elevation model is needed here")
    return _read_model(path, file_stamp, epsg, axis, origin, half_width + GROUND_MARGIN)


@lru_cache(maxsize=2)
def _read_model(
    path: str, _stamp: tuple[int, int], epsg: int, axis: AlignmentObject, origin: tuple[float, float], reach: float
) -> ElevationModel:
    return read_elevation_model(path, epsg, Corridor(alignment_of(axis), *origin, reach))


def fit_to_ground(
    axis: AlignmentObject, origin: tuple[float, float], model: ElevationModel, embankment_height: float
) -> tuple[float, float, float]:
    """Return the local origin's map coordinates (east, north, elevation), m, that put a road at its mean height.

    Args:
        axis: centreline and profile, local.
        origin: map coordinates (east, north) of the local origin, m; they are kept.
        model: the ground, all along the centreline.
        embankment_height: mean height (m) of the centreline above the ground, which the third coordinate gives it.
    """
    alignment, (east, north) = alignment_of(axis), origin
    count = int(np.ceil(alignment.length / _FIT_SPACING))
    station = (np.arange(count) + 0.5) * (alignment.length / count)
    plan = alignment.position(station)
    above = profile_of(axis).elevation(station) - model.elevation(plan[:, 0] + east, plan[:, 1] + north)
    return east, north, round_value(embankment_height - float(np.mean(above)))


def surface_elevation(geometry: RoadGeometry, station: Float, offset: Float) -> Float:
    """Return the local elevation (N,), m, of road, batter or ground at stations and offsets (N,); no plants.

    Beside the road the batter rises or falls from the verge's edge until it meets the ground, with swale and roundings
    as in `batter_height`; without a terrain the road's edge goes on level.
    """
    boundaries = geometry.boundaries(station)
    within = np.clip(offset, boundaries[0][:, -1], boundaries[0][:, 0])
    height = geometry.elevation(station, within, boundaries)
    terrain = geometry.terrain
    beside = np.flatnonzero(within != offset)
    if terrain is not None and len(beside):
        distance, edge = np.abs(offset - within)[beside], height[beside]
        above = ground_elevation(geometry, terrain, station[beside], offset[beside]) - edge
        at_edge = above
        if is_shaped(terrain):
            at_edge = ground_elevation(geometry, terrain, station[beside], within[beside]) - edge
        height[beside] = edge + batter_height(terrain, distance, above, at_edge)
    return height


def known_elevation(geometry: RoadGeometry, station: Float, offset: Float) -> Float:
    """Return the surface's local elevation (N,), m, with the road's edge going on where an elevation model ends."""
    height = np.empty(station.shape)
    for first in range(0, len(station), _BLOCK):
        part = slice(first, first + _BLOCK)
        height[part] = surface_elevation(geometry, station[part], offset[part])
    unknown = np.flatnonzero(np.isnan(height))
    if len(unknown):
        edges = geometry.offsets(station[unknown])
        within = np.clip(offset[unknown], edges[:, -1], edges[:, 0])
        height[unknown] = geometry.elevation(station[unknown], within)
    return height


def highest_pavement(geometry: RoadGeometry, station: Float, offset: Float) -> float | None:
    """Return the largest local elevation, m, of those places (N,) that are paved; None if none is."""
    strip = geometry.strip_index(station, offset)
    paved = np.array([item.class_name == "road" for item in geometry.strips])
    on = (strip >= 0) & paved[strip] & (station >= 0.0) & (station <= geometry.length)
    return float(np.max(geometry.elevation(station[on], offset[on]))) if on.any() else None


def is_shaped(terrain: Terrain) -> bool:
    """Return whether anything but the two planes of the batter lies between road and ground."""
    return bool(terrain.crest_length or terrain.rounding_length or terrain.swale_width or terrain.ditch_width)


def batter_height(terrain: Terrain, distance: Float, ground: Float, at_edge: Float) -> Float:
    """Return the height (N,) above the road's edge, m, of what lies beside it.

    Args:
        terrain: its slope, lengths and widths.
        distance: (N,) outwards from the edge, m.
        ground: (N,) height of the ground there before the road was built, above the edge, m.
        at_edge: (N,) height of that ground at the edge, above the edge, m.
    """
    width, rounding = terrain.swale_width, rounding_height(terrain, at_edge)
    depth = swale_share(at_edge) * terrain.swale_depth if width else np.zeros(distance.shape)
    upper = _rise(distance - width / 2.0, width / 4.0) / terrain.batter_slope
    lower = -_rise(distance, terrain.crest_length) / terrain.batter_slope
    if width:
        upper = upper - depth * np.sin(np.pi * np.minimum(distance / width, 1.0)) ** 2
    cutting = np.maximum(-_smooth_maximum(-ground, -upper, rounding), lower - 2.0 * depth)
    if terrain.ditch_width:
        ditch = ditch_share(terrain, at_edge)
        # How far beyond the foot a place lies, on level ground.
        beyond = np.clip((ground - lower) * terrain.batter_slope / terrain.ditch_width, 0.0, 1.0)
        ground = ground - ditch * terrain.ditch_depth * np.sin(np.pi * beyond) ** 2
        rounding = rounding * (1.0 - ditch)
    embankment = np.minimum(_smooth_maximum(ground, lower, rounding), upper)
    return np.where(at_edge > 0.0, cutting, embankment)


def swale_share(at_edge: Float) -> Float:
    """Return the share (N,) of its full depth that a swale has, by the ground's height at the road's edge (N,), m."""
    return np.clip((at_edge - SWALE_FROM) / (SWALE_FULL - SWALE_FROM), 0.0, 1.0)


def ditch_share(terrain: Terrain, at_edge: Float) -> Float:
    """Return the share (N,) of its full depth that a ditch has; beside it the batter's foot isn't rounded."""
    return swale_share(-at_edge) if terrain.ditch_width else np.zeros(at_edge.shape)


def foot_reach(terrain: Terrain, at_edge: Float) -> tuple[Float, Float]:
    """Return how far (N,) before and beyond the batter's foot rounding or ditch reach, m."""
    ditch = ditch_share(terrain, at_edge)
    tangent = rounding_height(terrain, at_edge) * terrain.batter_slope * (1.0 - ditch)
    return tangent, np.maximum(tangent, np.where(ditch > 0.0, terrain.ditch_width, 0.0))


def rounding_height(terrain: Terrain, at_edge: Float) -> Float:
    """Return the height (N,), m, by which batter and ground differ where their rounding begins.

    The tangents are as long as the terrain's rounding on a batter high enough for it, else shorter.
    """
    return np.minimum(terrain.rounding_length / terrain.batter_slope, np.abs(at_edge))


def batter_begin(terrain: Terrain, at_edge: Float) -> Float:
    """Return the distance (N,) from the road's edge, m, at which the batter's plane is as high as the edge."""
    return np.where(at_edge > 0.0, 0.75 * terrain.swale_width, terrain.crest_length)


def shaped_width(terrain: Terrain, at_edge: Float) -> Float:
    """Return the distance (N,) from the road's edge, m, from which the batter is a plane."""
    return np.where(at_edge > 0.0, terrain.swale_width, 2.0 * terrain.crest_length)


def _rise(distance: Float, tangent: float) -> Float:
    """Return how far (N,) a plane of slope 1 has risen at distances (N,), rounded from level over two tangents (m)."""
    beyond = np.maximum(distance, 0.0)
    if tangent <= 0.0:
        return beyond
    return np.where(beyond < 2.0 * tangent, beyond**2 / (4.0 * tangent), beyond - tangent)


def _smooth_maximum(first: Float, second: Float, rounding: Float) -> Float:
    """Return the larger of two heights (N,), m, rounded by a parabola where they differ by less than ``rounding``."""
    near = np.maximum(rounding - np.abs(first - second), 0.0)
    return np.maximum(first, second) + near**2 / np.maximum(4.0 * rounding, 1e-12)
