"""The ground beside the road: as it was before, generated or a digital elevation model, and with the road's batter.

The batter's heights count from the road's edge, distances outwards from it. Where the ground at the edge is higher the
road lies in a cutting, and the edge is followed by a swale and a batter that rises to the ground; else by a crest and
a batter that falls to it. Where batter and ground meet, a parabola with two equal tangents rounds them, or there is a
ditch at the foot of the embankment.
"""

from functools import lru_cache

import numpy as np

from ...base.arrays import Float
from ...base.files import change_stamp
from ...base.random_streams import stream
from ...base.schema import round_value
from ..geometry import RoadGeometry, alignment_of, profile_of
from ..parameters import AlignmentObject
from ..side_roads.mouth import HIGH, LOW, Mouth
from ..structures.bridge import Bridge
from ..structures.relief import relief_height, relief_share
from ..structures.tunnel import Tunnel
from ..surroundings import Terrain
from .elevation_model import Corridor, ElevationModel, read_elevation_model

GROUND_MARGIN = 12.0
"""Heights of the ground are wanted this far (m) beyond the terrain's half width and the road's ends."""

SWALE_FROM, SWALE_FULL = 0.2, 0.8
"""Height of the ground at the road's edge above it from which there is a swale, and from which it is full, m; so deep
below it there is a ditch at the embankment's foot."""

LEAST_COVER = 0.6
"""Least height of the ground above the roof of a tunnel, m; chosen."""
VILLAGE_BLEND, VILLAGE_UNDULATION = 40.0, 0.25
"""Length (m) before and behind street sides over which generated ground comes to the profile's height, where houses
stand, and what is left of its undulation there, as a share. Chosen."""
_WAVES = 24
_OCTAVES = 3.0
_FIT_SPACING = 1.0  # m, of the stations at which a road's height above the ground is averaged
_NEAR_EDGE = 0.2
"""By how much less the distance from a side road counts than that from the main road's edge; chosen."""


def ground_elevation(geometry: RoadGeometry, terrain: Terrain, station: Float, offset: Float) -> Float:
    """Return the ground's local elevation (N,), m, at stations and offsets (N,), as it is without batter.

    Generated ground follows the profile at ``embankment_height`` below it and undulates; beside street sides it lies at
    the profile's height, below bridges there are valleys, above tunnels hills. A digital elevation model is
    the ground itself; farther than `GROUND_MARGIN` beyond the terrain's reach the result can be NaN.

    Raises:
        InputError: the elevation model is missing, unreadable or unfit for this road.
    """
    xy = geometry.alignment.place(station, offset)
    if terrain.elevation_model is None:
        height = undulation(terrain, xy) - terrain.embankment_height
        village_share = _village_share(geometry, station)
        if village_share is not None:
            height = height + village_share * (VILLAGE_UNDULATION * undulation(terrain, xy) - height)
        for structure in geometry.reliefs.values():
            share = relief_share(structure, station)
            height = height + share * (undulation(terrain, xy) + relief_height(structure) - height)
        return geometry.profile.elevation(station) + height
    parameters = geometry.parameters
    east, north, zero = parameters.transform.translate
    model = road_elevation_model(
        terrain.elevation_model, parameters.metadata.epsg, parameters.alignment, (east, north), terrain.half_width
    )
    return model.elevation(xy[:, 0] + east, xy[:, 1] + north) - zero


def _village_share(geometry: RoadGeometry, station: Float) -> Float | None:
    """Return how much (N,) of a village's level ground there is at stations (N,), 0 to 1; None on roads without any."""
    streets = [shape.side for section in geometry.sections.values() for shape in section.streets]
    if not streets:
        return None
    shares = [
        np.minimum(station - street.start_station, street.end_station - station) / VILLAGE_BLEND + 1.0
        for street in streets
    ]
    share = np.clip(np.max(shares, axis=0), 0.0, 1.0)
    return share * share * (3.0 - 2.0 * share)


def undulation(terrain: Terrain, xy: Float) -> Float:
    """Return the generated ground's height (N,) above its mean at local points (N, 2), m.

    A sum of seeded plane waves over the plan, whose wavelengths spread over three octaves above ``wavelength`` and
    whose heights have the standard deviation ``undulation``.
    """
    rng = stream(terrain.seed, "terrain undulation")
    octaves = rng.uniform(0.0, _OCTAVES, _WAVES)
    directions = rng.uniform(0.0, 2.0 * np.pi, _WAVES)
    phases = rng.uniform(0.0, 2.0 * np.pi, _WAVES)
    # Longer waves are higher; a wave of amplitude a has the variance a^2 / 2.
    weights = 2.0**octaves
    amplitude = terrain.undulation * weights * np.sqrt(2.0 / np.sum(weights**2))
    wave_numbers = 2.0 * np.pi / (terrain.wavelength * weights)
    vectors = wave_numbers * np.stack([np.cos(directions), np.sin(directions)])
    return np.sin(xy @ vectors + phases) @ amplitude


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
    """Return the elevation model for a road's corridor; the file's stamp is in the cache's key and not used else."""
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
    xy = alignment.position(station)
    heights_above = profile_of(axis).elevation(station) - model.elevation(xy[:, 0] + east, xy[:, 1] + north)
    return east, north, round_value(embankment_height - float(np.mean(heights_above)))


def side_road_surface_elevation(geometry: RoadGeometry, station: Float, offset: Float) -> Float:
    """Return the local elevation (N,), m, of road, batter or ground at stations and offsets (N,); no plants.

    A side road has its own surface, and batters of its own beside it.
    """
    height = main_surface_elevation(geometry, station, offset)
    for mouth in geometry.mouths.values():
        near = np.flatnonzero(mouth.is_near(station) & (mouth.sign * offset > 0.0))
        if len(near):
            height[near] = _around_mouth(geometry, mouth, station[near], offset[near], height[near])
    return height


def _around_mouth(geometry: RoadGeometry, mouth: Mouth, station: Float, offset: Float, main: Float) -> Float:
    """Return the local elevation (N,), m, of a side road and the ground around it.

    Args:
        geometry: the main road.
        mouth: the side road.
        station, offset: (N,) on its side and near it, m.
        main: (N,) the surface there without it, m.
    """
    result = main.copy()
    own = mouth.height_at(station, offset)
    is_own = ~np.isnan(own)
    result[is_own] = own[is_own]
    depth = mouth.depth(station, offset)
    ground = np.flatnonzero(~is_own & (depth > 0.0))
    terrain = geometry.terrain
    if terrain is None or not len(ground):
        return result
    station, depth, main = station[ground], depth[ground], main[ground]
    points = mouth.plan(station, depth)
    sides = [mouth.verge_height(sign, points) for sign in (LOW, HIGH)]
    is_low = sides[0][1] >= sides[1][1]
    edge, distance = (np.where(is_low, low, high) for low, high in zip(*sides, strict=True))
    behind_end = np.flatnonzero((depth > mouth.reach) & (distance < 0.0))
    edge[behind_end] = mouth.continued_height(station[behind_end], depth[behind_end])
    distance = np.maximum(np.maximum(distance, 0.0), depth - mouth.reach)
    # What was the ground for the main road's batter is the ground for its own.
    beyond = np.maximum(depth - mouth.verge_width, 0.0)
    batter = edge + batter_height(terrain, distance, main - edge, main - edge)
    # Beside the main road's edge its surface is the main road's; far away too.
    share = np.where(distance > 0.0, beyond / np.maximum(beyond + _NEAR_EDGE * distance, 1e-9), 1.0)
    share *= mouth.fade(station) * mouth.end_share(depth)
    result[ground] = main + share * (batter - main)
    return result


def main_surface_elevation(geometry: RoadGeometry, station: Float, offset: Float) -> Float:
    """Return `surface_elevation` (N,) without side roads.

    Beside the road the batter rises or falls from the verge's edge until it meets the ground, with swale and roundings
    as in `batter_height`; without a terrain the road's edge goes on level.
    """
    boundaries = geometry.boundaries(station)
    edge_offset = np.clip(offset, boundaries[0][:, -1], boundaries[0][:, 0])
    height = geometry.main_elevation(station, edge_offset, boundaries)
    terrain = geometry.terrain
    beside_road = np.flatnonzero(edge_offset != offset)
    if terrain is not None and len(beside_road):
        distance, edge = np.abs(offset - edge_offset)[beside_road], height[beside_road]
        ground_height = ground_elevation(geometry, terrain, station[beside_road], offset[beside_road]) - edge
        ground_at_edge = ground_height
        if is_shaped(terrain):
            ground_at_edge = ground_elevation(geometry, terrain, station[beside_road], edge_offset[beside_road]) - edge
        height[beside_road] = edge + batter_height(terrain, distance, ground_height, ground_at_edge)
        for structure in geometry.structures.values():
            within = (station[beside_road] > structure.cap_start) & (station[beside_road] < structure.cap_end)
            there = beside_road[within]
            height[there] = ground_at(geometry, structure, station[there], offset[there])
    return height


def ground_at(geometry: RoadGeometry, structure: Bridge | Tunnel, station: Float, offset: Float) -> Float:
    """Return the local elevation (N,), m, of the ground below and beside a bridge, or above and beside a tunnel."""
    if isinstance(structure, Bridge):
        return ground_at_bridge(geometry, structure, station, offset)
    return ground_at_tunnel(geometry, structure, station, offset)


def ground_at_tunnel(geometry: RoadGeometry, tunnel: Tunnel, station: Float, offset: Float) -> Float:
    """Return the local elevation (N,), m, of the ground above and beside a tunnel, between its portals.

    It is the ground as it was, but filled up where that wouldn't cover the tubes: `LEAST_COVER` above their roof, and
    from there down with the batters' slope.
    """
    terrain = geometry.terrain
    assert terrain is not None
    offsets, heights = geometry.boundaries(station)
    roof = np.maximum(heights[:, 1], heights[:, -2]) + tunnel.height + tunnel.wall_thickness
    beside = np.maximum(np.maximum(offset - offsets[:, 0], offsets[:, -1] - offset) - tunnel.wall_thickness, 0.0)
    fill = roof + LEAST_COVER - beside / terrain.batter_slope
    return np.fmax(ground_elevation(geometry, terrain, station, offset), fill)


def ground_at_bridge(geometry: RoadGeometry, bridge: Bridge, station: Float, offset: Float) -> Float:
    """Return the local elevation (N,), m, of the ground below and beside a bridge, between the ends of its caps.

    There the road's embankment ends: from either end's cross-section batters fall in all directions, so that they are
    cones at its corners. In between lies the ground; both ends' surfaces pass into each other over the middle third.

    Args:
        geometry: a road with a terrain.
        bridge: one of its bridges.
        station, offset: (N,) m.
    """
    terrain = geometry.terrain
    assert terrain is not None
    ground = ground_elevation(geometry, terrain, station, offset)
    heights = []
    for end in (bridge.cap_start, bridge.cap_end):
        at_end = np.full(station.shape, np.clip(end, 0.0, geometry.length))
        boundaries = geometry.boundaries(at_end)
        edge_offset = np.clip(offset, boundaries[0][:, -1], boundaries[0][:, 0])
        edge = geometry.uncapped_elevation(at_end, edge_offset, boundaries)
        distance = np.hypot(station - at_end, offset - edge_offset)
        ground_at_edge = ground_elevation(geometry, terrain, at_end, edge_offset) - edge
        heights.append(edge + batter_height(terrain, distance, ground - edge, ground_at_edge))
    length = bridge.cap_end - bridge.cap_start
    share = np.clip(3.0 * (station - bridge.cap_start) / length - 1.0, 0.0, 1.0)
    share = share * share * (3.0 - 2.0 * share)
    return heights[0] + share * (heights[1] - heights[0])


def highest_pavement(geometry: RoadGeometry, station: Float, offset: Float) -> float | None:
    """Return the largest local elevation, m, of those places (N,) that are paved; None if none is."""
    strip = geometry.strip_index(station, offset)
    is_pavement = np.array([item.class_name == "road" for item in geometry.strips])
    is_on_pavement = (strip >= 0) & is_pavement[strip] & (station >= 0.0) & (station <= geometry.length)
    return (
        float(np.max(geometry.elevation(station[is_on_pavement], offset[is_on_pavement])))
        if is_on_pavement.any()
        else None
    )


def is_shaped(terrain: Terrain) -> bool:
    """Return whether anything but the two planes of the batter lies between road and ground."""
    return bool(terrain.crest_length or terrain.rounding_length or terrain.swale_width or terrain.ditch_width)


def batter_height(terrain: Terrain, distance: Float, ground: Float, ground_at_edge: Float) -> Float:
    """Return the height (N,) above the road's edge, m, of the batter or the ground beside it.

    In a cutting: the lower one of the ground and the surface that rises through the swale to the batter. On an
    embankment: the higher one of the ground and the surface that falls over the crest. Either pair is rounded where the
    two meet.

    Args:
        terrain: its slope, lengths and widths.
        distance: (N,) outwards from the edge, m.
        ground: (N,) height of the ground there before the road was built, above the edge, m.
        ground_at_edge: (N,) height of that ground at the edge, above the edge, m.
    """
    width, rounding = terrain.swale_width, rounding_height(terrain, ground_at_edge)
    depth = swale_share(ground_at_edge) * terrain.swale_depth if width else np.zeros(distance.shape)
    cutting_surface = _rise(distance - width / 2.0, width / 4.0) / terrain.batter_slope
    embankment_surface = -_rise(distance, terrain.crest_length) / terrain.batter_slope
    if width:
        cutting_surface = cutting_surface - depth * np.sin(np.pi * np.minimum(distance / width, 1.0)) ** 2
    cutting = np.maximum(-_smooth_maximum(-ground, -cutting_surface, rounding), embankment_surface - 2.0 * depth)
    if terrain.ditch_width:
        ditch = ditch_share(terrain, ground_at_edge)
        # Distance beyond the batter's foot as a share of the ditch's width, exact on level ground.
        share_beyond_foot = np.clip(
            (ground - embankment_surface) * terrain.batter_slope / terrain.ditch_width, 0.0, 1.0
        )
        ground = ground - ditch * terrain.ditch_depth * np.sin(np.pi * share_beyond_foot) ** 2
        rounding = rounding * (1.0 - ditch)
    embankment = np.minimum(_smooth_maximum(ground, embankment_surface, rounding), cutting_surface)
    return np.where(ground_at_edge > 0.0, cutting, embankment)


def swale_share(ground_at_edge: Float) -> Float:
    """Return the share (N,) of its full depth that a swale has, by the ground's height at the road's edge (N,), m."""
    return np.clip((ground_at_edge - SWALE_FROM) / (SWALE_FULL - SWALE_FROM), 0.0, 1.0)


def ditch_share(terrain: Terrain, ground_at_edge: Float) -> Float:
    """Return the share (N,) of its full depth that a ditch has; beside it the batter's foot isn't rounded."""
    return swale_share(-ground_at_edge) if terrain.ditch_width else np.zeros(ground_at_edge.shape)


def foot_reach(terrain: Terrain, ground_at_edge: Float) -> tuple[Float, Float]:
    """Return how far (N,) before and beyond the batter's foot rounding or ditch reach, m."""
    ditch = ditch_share(terrain, ground_at_edge)
    tangent = rounding_height(terrain, ground_at_edge) * terrain.batter_slope * (1.0 - ditch)
    return tangent, np.maximum(tangent, np.where(ditch > 0.0, terrain.ditch_width, 0.0))


def rounding_height(terrain: Terrain, ground_at_edge: Float) -> Float:
    """Return the height (N,), m, by which batter and ground differ where their rounding begins.

    The tangents are as long as the terrain's rounding on a batter high enough for it, else shorter.
    """
    return np.minimum(terrain.rounding_length / terrain.batter_slope, np.abs(ground_at_edge))


def batter_begin(terrain: Terrain, ground_at_edge: Float) -> Float:
    """Return the distance (N,) from the road's edge, m, at which the batter's plane is as high as the edge."""
    return np.where(ground_at_edge > 0.0, 0.75 * terrain.swale_width, terrain.crest_length)


def shaped_width(terrain: Terrain, ground_at_edge: Float) -> Float:
    """Return the distance (N,) from the road's edge, m, from which the batter is a plane."""
    return np.where(ground_at_edge > 0.0, terrain.swale_width, 2.0 * terrain.crest_length)


def _rise(distance: Float, tangent: float) -> Float:
    """Return how far (N,) a plane of slope 1 has risen at distances (N,), rounded from level over two tangents (m)."""
    distance_beyond = np.maximum(distance, 0.0)
    if tangent <= 0.0:
        return distance_beyond
    return np.where(distance_beyond < 2.0 * tangent, distance_beyond**2 / (4.0 * tangent), distance_beyond - tangent)


def _smooth_maximum(first: Float, second: Float, rounding: Float) -> Float:
    """Return the larger of two heights (N,), m, rounded by a parabola where they differ by less than ``rounding``."""
    closeness = np.maximum(rounding - np.abs(first - second), 0.0)
    return np.maximum(first, second) + closeness**2 / np.maximum(4.0 * rounding, 1e-12)
