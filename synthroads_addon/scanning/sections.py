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
        start, end: stations that it is of, m.
        low, high: stations between which the road is built for it, m.
        blocks: its blocks of pulses, in the order of time.
    """

    start: float
    end: float
    low: float
    high: float
    blocks: tuple[Block, ...]


def sections(cut: Blocks, geometry: RoadGeometry, length: float, shadows: float = 0.0) -> Iterator[RoadSection]:
    """Yield the parts of a road to be built and scanned in turn, from its start on, that have any blocks.

    Args:
        cut: the scan's blocks.
        geometry: the road's.
        length: of a section along the road, m; the last one is shorter.
        shadows: how far something must be built, beside what the rays reach, for the shadow that it throws, m.
    """
    count = max(1, int(np.ceil(geometry.length / length - 1e-9)))
    owned: list[list[Block]] = [[] for _ in range(count)]
    for strip in cut.path.strips:
        station = _block_stations(cut, geometry, strip)
        for block, owner in enumerate(np.clip(station // length, 0, count - 1).astype(int)):
            owned[owner].append((strip, block))
    beyond = BORDER + shadows + _crossing_reach(geometry)
    for number, blocks in enumerate(owned):
        if blocks:
            low, high = reached_stations(cut, geometry, blocks)
            start, end = number * length, min((number + 1) * length, geometry.length)
            yield RoadSection(start, end, max(low - beyond, 0.0), min(high + beyond, geometry.length), tuple(blocks))


def reached_stations(cut: Blocks, geometry: RoadGeometry, blocks: list[Block]) -> tuple[float, float]:
    """Return the smallest and largest station, m, at which rays of some blocks can meet anything."""
    stations = []
    for strip, numbers in _by_strip(blocks):
        chosen = np.unique(np.linspace(0, len(numbers) - 1, _PLACES).astype(int))
        rays = [_sample_rays(cut, strip, numbers[i]) for i in chosen]
        origin, direction = (np.concatenate(parts) for parts in zip(*rays, strict=True))
        stations.append(_stations_of_rays(cut, geometry, origin, direction))
    return min(low for low, _ in stations), max(high for _, high in stations)


def strip_parts(cut: Blocks, blocks: Sequence[Block]) -> tuple[Strip, ...]:
    """Return the parts of strips, as shorter strips of the same index, that runs of blocks cover."""
    parts = []
    for strip, numbers in _by_strip(blocks):
        for run in np.split(numbers, np.flatnonzero(np.diff(numbers) > 1) + 1):
            first, _ = cut.pulse_span(strip, int(run[0]))
            last, count = cut.pulse_span(strip, int(run[-1]))
            begin, end = cut.time(strip, first), cut.time(strip, last + count - 1)
            parts.append(Strip(strip.index, begin, end - begin))
    return tuple(parts)


def vehicles_through(
    section: RoadSection, cut: Blocks, motions: Mapping[str, LaneMotion], speed_factor: float
) -> dict[str, LaneMotion]:
    """Return the motions, by id, of the vehicles that pass a section while its blocks are scanned.

    Args:
        section: of the scan.
        cut: the scan's blocks.
        motions: of all vehicles, by id.
        speed_factor: on their speeds.
    """
    look = _LOOK / max(1.0, speed_factor)
    times = np.concatenate([
        strip.start_time + np.linspace(0.0, strip.duration, int(np.ceil(strip.duration / look)) + 2)
        for strip in strip_parts(cut, section.blocks)
    ])  # fmt: skip
    low, high = section.low - _AROUND, section.high + _AROUND
    stations = {name: motion.station(times) for name, motion in motions.items()}
    near = {name for name, station in stations.items() if ((station > low) & (station < high)).any()}
    return {name: motion for name, motion in motions.items() if name in near}


def _by_strip(blocks: Sequence[Block]) -> list[tuple[Strip, list[int]]]:
    """Group blocks by strip: return each strip with the numbers of its blocks."""
    strips = {strip.index: strip for strip, _ in blocks}.values()
    return [(strip, [number for owner, number in blocks if owner.index == strip.index]) for strip in strips]


def shadow_length(geometry: RoadGeometry) -> float:
    """Return the length, m, of the shadow of a road's tallest thing, at a sun of 10 degrees or more."""
    elevation = np.deg2rad(max(geometry.parameters.environment.sun_elevation_deg, 10.0))
    return float(_tallest(geometry) / np.tan(elevation))


def _block_stations(cut: Blocks, geometry: RoadGeometry, strip: Strip) -> Float:
    """Return the scanner's stations (B,), m, at the middle pulse of each of a strip's blocks."""
    borders = [cut.pulse_span(strip, block) for block in cut.block_numbers(strip)]
    times = np.array([cut.time(strip, first + count // 2) for first, count in borders])
    return geometry.alignment.project(cut.path.pose(strip, times)[0][:, :2])[0]


def _sample_rays(cut: Blocks, strip: Strip, block: int) -> tuple[Float, Float]:
    """Return local origins (N, 3), m, and directions (N, 3) of a sample of a block's pulses, its ends included."""
    first, count = cut.pulse_span(strip, block)
    starts = sorted({first, first + max(0, (count - _RUN) // 2), first + max(0, count - _RUN)})
    origins, directions = [], []
    for start in starts:
        run = min(_RUN, first + count - start)
        taken = np.linspace(0, run - 1, min(run, _TAKEN)).astype(int)
        shot = shots(cut.setting, start, run, False)
        position, rotation = cut.path.pose(strip, strip.start_time + shot.time[taken])
        origins.append(position)
        directions.append(np.einsum("nij,jn->ni", rotation, shot.direction[:, taken]))
    return np.concatenate(origins), np.concatenate(directions)


def _stations_of_rays(cut: Blocks, geometry: RoadGeometry, origin: Float, direction: Float) -> tuple[float, float]:
    """Return the smallest and largest station, m, at which rays can meet anything."""
    farthest = cut.setting.maximum_range
    begin, _ = geometry.alignment.project(origin[:, :2])
    lowest, highest = _elevation_range(geometry, float(begin.min()) - farthest, float(begin.max()) + farthest)
    rise = direction[:, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        down, up = (lowest - origin[:, 2]) / rise, (highest - origin[:, 2]) / rise
    # From where to where a ray is between the lowest and the highest that there is.
    level = np.abs(rise) < 1e-9
    inside = (origin[:, 2] >= lowest) & (origin[:, 2] <= highest)
    first = np.where(level, np.where(inside, 0.0, np.inf), np.clip(np.minimum(down, up), 0.0, None))
    last = np.where(level, farthest, np.clip(np.maximum(down, up), None, farthest))
    meets = np.flatnonzero(first <= last)
    if not len(meets):
        return float(begin.min()), float(begin.max())
    share = np.linspace(0.0, 1.0, _STEPS)
    along = first[meets, None] + (last - first)[meets, None] * share
    footprint = 0.5 * max(cut.setting.divergence) * float(along.max())
    places = (origin[meets, None, :2] + along[..., None] * direction[meets, None, :2]).reshape(-1, 2)
    station, offset = geometry.alignment.project(places)
    near = station[np.abs(offset) <= _corridor(geometry) + footprint]
    every = np.concatenate([near, begin])
    return float(every.min()) - footprint, float(every.max()) + footprint


def _crossing_reach(geometry: RoadGeometry) -> float:
    """Return how far, m, along the road an overpass, a power line or a building reaches at most from its station."""
    parameters = geometry.parameters
    bridges, lines = parameters.of_type(Overpass).values(), parameters.of_type(PowerLine).values()
    lengths = [abs(np.sin(np.deg2rad(item.rotation_deg))) * _BRIDGE_SIDE + item.width for item in bridges]
    for line in lines:
        aside = abs(np.sin(np.deg2rad(line.rotation_deg))) * max(line.left_distance, line.right_distance)
        lengths.append(aside + line.height * HALF_ARM)
    lengths += [math.hypot(item.width, item.depth) for item in parameters.of_type(Building).values()]
    return float(max(lengths, default=0.0))


def _corridor(geometry: RoadGeometry) -> float:
    """Return the largest offset from the axis, m, at which there is anything."""
    parameters = geometry.parameters
    edges = [float(section.road_edge([0.0, *section.kinks()]).max()) for section in geometry.sections.values()]
    reach = [*edges, parameters.terrain.half_width if parameters.terrain else 0.0]
    reach += [max(item.left_distance, item.right_distance) for item in parameters.of_type(PowerLine).values()]
    return max(reach) + (_BRIDGE_SIDE if parameters.of_type(Overpass) else 0.0)


def _elevation_range(geometry: RoadGeometry, start: float, end: float) -> tuple[float, float]:
    """Return the lowest and highest local elevation, m, of anything between two stations."""
    station = np.linspace(max(start, 0.0), min(end, geometry.length), 60)
    wide = _corridor(geometry)
    offset = np.linspace(-wide, wide, 9)
    pairs: Any = np.meshgrid(station, offset)
    height = surface_elevation(geometry, *(part.ravel() for part in pairs))
    axis = geometry.profile.elevation(station)
    lowest = min(float(np.nanmin(height)), float(axis.min()))
    highest = max(float(np.nanmax(height)), float(axis.max()))
    return lowest - _UNEVEN, highest + _UNEVEN + _tallest(geometry)


def _tallest(geometry: RoadGeometry) -> float:
    """Return the height of the tallest things beside or over a road, m."""
    plants = [item.height_max * 1.3 for item in geometry.parameters.of_type(Vegetation).values()]
    others = [float(getattr(item, "height", 0.0)) for item in geometry.parameters.objects.values()]
    return max([_TALLEST, *plants, *others])
