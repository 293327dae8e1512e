"""A long road's scan by section: which blocks of pulses belong to which, and how much of the road they can reach.

A block belongs to the section in which its middle lies. What of the road must be there for a section follows from its
own pulses: where their rays leave the scene's heights, the corridor beside the axis, or the device's range. So a block
meets the same surfaces whatever the sections are.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..base.arrays import Float
from ..road.geometry import RoadGeometry
from ..road.surroundings import Vegetation
from ..road.terrain import surface_elevation
from ..road.things.building import Building
from ..road.things.overpass import Overpass
from ..road.things.power_line import HALF_ARM, PowerLine
from .blocks import Block, Blocks
from .devices.shots import shots
from .platforms.path import Strip
from .scene.motion import LaneMotion

BORDER = 25.0
"""Length built beyond the reach of a section's rays (m), so that where the model is cut lies beyond it as well."""

_PLACES = 8
"""Blocks of a section at whose beginning, middle and end its rays are looked at, for each strip."""
_RUN, _TAKEN = 8192, 128
"""Pulses in a row there, and how many of them are looked at."""
_STEPS = 9
"""Points along each ray that are looked at."""
_TALLEST = 30.0
"""Height above the ground that nothing but the tallest trees exceeds, m."""
_BRIDGE_SIDE = 160.0
"""Offset to which an overpass's approaches reach, m."""
_UNEVEN = 5.0
"""Largest deviation of the ground between the places that are looked at, m."""

_LOOK = 1.0
"""Seconds between two looks at where a vehicle is."""
_AROUND = 60.0
"""A vehicle counts as near a section up to so far beyond it: more than it drives and reaches between two looks, m."""


@dataclass(frozen=True)
class RoadSection:
    """A part of a road that is built and scanned at once, with the blocks of pulses that belong to it.

    Attributes:
        start, end: stations between which the section lies, m.
        build_start, build_end: stations between which the road is built for it, m.
        blocks: its blocks of pulses, in the order of time.
    """

    start: float
    end: float
    build_start: float
    build_end: float
    blocks: tuple[Block, ...]


def sections(division: Blocks, geometry: RoadGeometry, length: float, shadows: float = 0.0) -> Iterator[RoadSection]:
    """Yield the parts of a road to be built and scanned in turn, from its start on, that have any blocks.

    Args:
        division: the scan's blocks.
        geometry: the road's.
        length: of a section along the road, m; the last one is shorter.
        shadows: how far something must be built, beside what the rays reach, for the shadow that it throws, m.
    """
    # The small number keeps a length that rounding puts above a whole number of sections from adding an empty one.
    count = max(1, int(np.ceil(geometry.length / length - 1e-9)))
    section_blocks: list[list[Block]] = [[] for _ in range(count)]
    for strip in division.path.strips:
        station = _block_stations(division, geometry, strip)
        section_numbers = np.clip(station // length, 0, count - 1).astype(int)
        for block, number in enumerate(section_numbers):
            section_blocks[number].append((strip, block))
    margin = BORDER + shadows + _crossing_reach(geometry)
    for number, blocks in enumerate(section_blocks):
        if blocks:
            lowest_station, highest_station = reached_stations(division, geometry, blocks)
            start, end = number * length, min((number + 1) * length, geometry.length)
            build_start = max(lowest_station - margin, 0.0)
            build_end = min(highest_station + margin, geometry.length)
            yield RoadSection(start, end, build_start, build_end, tuple(blocks))


def reached_stations(division: Blocks, geometry: RoadGeometry, blocks: list[Block]) -> tuple[float, float]:
    """Return the smallest and largest station, m, at which rays of some blocks can meet anything."""
    stations = []
    for strip, numbers in _by_strip(blocks):
        sample_indices = np.unique(np.linspace(0, len(numbers) - 1, _PLACES).astype(int))
        rays = [_sample_rays(division, strip, numbers[i]) for i in sample_indices]
        origin, direction = (np.concatenate(parts) for parts in zip(*rays, strict=True))
        stations.append(_stations_of_rays(division, geometry, origin, direction))
    return min(lowest_station for lowest_station, _ in stations), max(
        highest_station for _, highest_station in stations
    )


def strip_parts(division: Blocks, blocks: Sequence[Block]) -> tuple[Strip, ...]:
    """Return the parts of strips that blocks cover, as shorter strips of the same index: one for each run of blocks."""
    parts = []
    for strip, numbers in _by_strip(blocks):
        for run in np.split(numbers, np.flatnonzero(np.diff(numbers) > 1) + 1):
            first_pulse, _ = division.pulse_span(strip, int(run[0]))
            last_pulse, count = division.pulse_span(strip, int(run[-1]))
            begin, end = division.time(strip, first_pulse), division.time(strip, last_pulse + count - 1)
            parts.append(Strip(strip.index, begin, end - begin))
    return tuple(parts)


def vehicles_through(
    section: RoadSection, division: Blocks, motions: Mapping[str, LaneMotion], speed_factor: float
) -> dict[str, LaneMotion]:
    """Return the motions, by id, of the vehicles that pass a section while its blocks are scanned.

    Args:
        section: of the scan.
        division: the scan's blocks.
        motions: of all vehicles, by id.
        speed_factor: share of their speeds that they drive at.
    """
    interval = _LOOK / max(1.0, speed_factor)
    times = np.concatenate([
        strip.start_time + np.linspace(0.0, strip.duration, int(np.ceil(strip.duration / interval)) + 2)
        for strip in strip_parts(division, section.blocks)
    ])  # fmt: skip
    lowest_station, highest_station = section.build_start - _AROUND, section.build_end + _AROUND
    stations = {name: motion.station(times) for name, motion in motions.items()}
    passing_ids = {
        name for name, station in stations.items() if ((station > lowest_station) & (station < highest_station)).any()
    }
    return {name: motion for name, motion in motions.items() if name in passing_ids}


def _by_strip(blocks: Sequence[Block]) -> list[tuple[Strip, list[int]]]:
    """Group blocks by strip: return each strip with the numbers of its blocks."""
    strips = {strip.index: strip for strip, _ in blocks}.values()
    return [(strip, [number for owner, number in blocks if owner.index == strip.index]) for strip in strips]


def shadow_length(geometry: RoadGeometry) -> float:
    """Return the length, m, of the shadow of a road's tallest thing, at a sun of 10 degrees or more."""
    elevation = np.deg2rad(max(geometry.parameters.environment.sun_elevation_deg, 10.0))
    return float(_tallest(geometry) / np.tan(elevation))


def _block_stations(division: Blocks, geometry: RoadGeometry, strip: Strip) -> Float:
    """Return the scanner's stations (B,), m, at the middle pulse of each of a strip's blocks."""
    borders = [division.pulse_span(strip, block) for block in division.block_numbers(strip)]
    times = np.array([division.time(strip, first_pulse + count // 2) for first_pulse, count in borders])
    return geometry.alignment.project(division.path.pose(strip, times)[0][:, :2])[0]


def _sample_rays(division: Blocks, strip: Strip, block: int) -> tuple[Float, Float]:
    """Return local origins (N, 3), m, and unit directions (N, 3) of a sample of a block's pulses.

    Up to `_TAKEN` pulses are taken of each of three runs of `_RUN` pulses: at the block's beginning, middle and end.
    """
    first_pulse, count = division.pulse_span(strip, block)
    starts = sorted({first_pulse, first_pulse + max(0, (count - _RUN) // 2), first_pulse + max(0, count - _RUN)})
    origins, directions = [], []
    for start in starts:
        run = min(_RUN, first_pulse + count - start)
        sample_rows = np.linspace(0, run - 1, min(run, _TAKEN)).astype(int)
        shot = shots(division.setting, start, run, False)
        position, rotation = division.path.pose(strip, strip.start_time + shot.time[sample_rows])
        origins.append(position)
        directions.append(np.einsum("nij,jn->ni", rotation, shot.direction[:, sample_rows]))
    return np.concatenate(origins), np.concatenate(directions)


def _stations_of_rays(division: Blocks, geometry: RoadGeometry, origin: Float, direction: Float) -> tuple[float, float]:
    """Return the smallest and largest station, m, at which rays can meet anything.

    Args:
        division: the scan's blocks.
        geometry: the road's.
        origin: (N, 3) where the rays begin, local, m.
        direction: (N, 3) unit vectors.
    """
    farthest = division.setting.maximum_range
    origin_stations, _ = geometry.alignment.project(origin[:, :2])
    begin, end = float(origin_stations.min()) - farthest, float(origin_stations.max()) + farthest
    lowest_elevation, highest_elevation = _elevation_range(geometry, begin, end)
    rise = direction[:, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        range_to_lowest = (lowest_elevation - origin[:, 2]) / rise
        range_to_highest = (highest_elevation - origin[:, 2]) / rise
    # Ranges between which a ray is between the two elevations. A level ray is so everywhere or nowhere.
    is_level = np.abs(rise) < 1e-9
    starts_between = (origin[:, 2] >= lowest_elevation) & (origin[:, 2] <= highest_elevation)
    entry, exit_ = np.minimum(range_to_lowest, range_to_highest), np.maximum(range_to_lowest, range_to_highest)
    begin_range = np.where(is_level, np.where(starts_between, 0.0, np.inf), np.clip(entry, 0.0, None))
    end_range = np.where(is_level, farthest, np.clip(exit_, None, farthest))
    rows = np.flatnonzero(begin_range <= end_range)
    if not len(rows):
        return float(origin_stations.min()), float(origin_stations.max())
    # Each of these rays is looked at in `_STEPS` places, of which those count that lie in the road's corridor.
    share = np.linspace(0.0, 1.0, _STEPS)
    sample_ranges = begin_range[rows, None] + (end_range - begin_range)[rows, None] * share
    footprint = 0.5 * max(division.setting.divergence) * float(sample_ranges.max())
    places = origin[rows, None, :2] + sample_ranges[..., None] * direction[rows, None, :2]
    station, offset = geometry.alignment.project(places.reshape(-1, 2))
    in_corridor = station[np.abs(offset) <= _corridor(geometry) + footprint]
    stations = np.concatenate([in_corridor, origin_stations])
    return float(stations.min()) - footprint, float(stations.max()) + footprint


def _crossing_reach(geometry: RoadGeometry) -> float:
    """Return how far, m, along the road an overpass, a power line or a building reaches at most from its station."""
    parameters = geometry.parameters
    bridges, lines = parameters.of_type(Overpass).values(), parameters.of_type(PowerLine).values()
    buildings = parameters.of_type(Building).values()
    # What crosses at a slant reaches sin(angle) of its length to the side along the road, and its own width at most.
    reaches = [abs(np.sin(np.deg2rad(bridge.rotation_deg))) * _BRIDGE_SIDE + bridge.width for bridge in bridges]
    for line in lines:
        side_length = max(line.left_distance, line.right_distance)
        reaches.append(abs(np.sin(np.deg2rad(line.rotation_deg))) * side_length + line.height * HALF_ARM)
    reaches += [math.hypot(building.width, building.depth) for building in buildings]
    return float(max(reaches, default=0.0))


def _corridor(geometry: RoadGeometry) -> float:
    """Return the largest offset from the axis, m, at which the road's model has anything."""
    parameters = geometry.parameters
    edges = [float(section.road_edge([0.0, *section.kinks()]).max()) for section in geometry.sections.values()]
    reach = [*edges, parameters.terrain.half_width if parameters.terrain else 0.0]
    reach += [max(item.left_distance, item.right_distance) for item in parameters.of_type(PowerLine).values()]
    return max(reach) + (_BRIDGE_SIDE if parameters.of_type(Overpass) else 0.0)


def _elevation_range(geometry: RoadGeometry, start: float, end: float) -> tuple[float, float]:
    """Return the lowest and highest local elevation, m, of anything between two stations."""
    station = np.linspace(max(start, 0.0), min(end, geometry.length), 60)
    half_width = _corridor(geometry)
    offset = np.linspace(-half_width, half_width, 9)
    pairs: Any = np.meshgrid(station, offset)
    height = surface_elevation(geometry, *(part.ravel() for part in pairs))
    axis = geometry.profile.elevation(station)
    lowest_elevation = min(float(np.nanmin(height)), float(axis.min()))
    highest_elevation = max(float(np.nanmax(height)), float(axis.max()))
    return lowest_elevation - _UNEVEN, highest_elevation + _UNEVEN + _tallest(geometry)


def _tallest(geometry: RoadGeometry) -> float:
    """Return the height of the tallest things beside or over a road, m."""
    plants = [item.height_max * 1.3 for item in geometry.parameters.of_type(Vegetation).values()]
    heights = [float(getattr(item, "height", 0.0)) for item in geometry.parameters.objects.values()]
    return max([_TALLEST, *plants, *heights])
