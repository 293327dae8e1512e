"""Where the plants of a stand grow, and how large each is: as the node groups place them, without Blender.

Every metre of road has as many places as the stand's density needs at most, each with a number. Where a place lies,
whether a plant grows there and how tall it is follow from its number and the stand's seed, by the hash of Blender's
node *Random Value* (Jenkins' lookup3). So a stretch of a road has the whole road's plants.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...base.arrays import Bool, Float, Int
from ..alignment import clip_offset
from ..geometry import RoadGeometry
from ..instances import places_per_metre
from ..network.network import network_of
from ..surroundings import Terrain, Vegetation
from ..terrain import known_elevation
from ..things.thing import Thing

STATION, OFFSET, CHANCE = 11, 12, 13
"""Added to a stand's seed: for a place's station within its metre, its offset, and whether a plant grows there."""
KIND, HEIGHT, BREADTH = 2, 3, 4
"""Added to a stand's seed: for which of the kinds of its species a plant is, its height and its breadth."""
KINDS = {"tree": (1.0, 0.86, 1.12), "shrub": (1.0, 0.82, 1.15)}
"""Kind of plant -> factors on the crown's radius of the kinds that each species has."""
BOTTOMS = {"tree": (1.0, 0.85, 1.2), "shrub": (1.0, 1.0, 1.0)}
"""Kind of plant -> factors on the height at which the crowns of these kinds begin."""
BREADTHS = {"tree": (0.9, 1.15), "shrub": (0.85, 1.25)}
"""Kind of plant -> limits of a plant's breadth for its height."""
PICK = 0.001
"""A random number from 0 to the number of kinds less this picks one."""
SEEDS = 2**30
"""A stand's seed is taken modulo this: the nodes have whole numbers of 32 bits with a sign."""
ROADSIDE_SHARE = 0.8
"""Grass on verges and median, as a share of the density elsewhere."""
ROADSIDE_HEIGHT = 0.5
"""Height of grass there, as a share of the height elsewhere."""
WILD_GRASSES = ("reed",)
"""Grasses that grow on neither verges nor median."""
MOUTH_CLEARING = 2.0
"""Distance from a side road's verges within which no shrubs and trees grow, m; chosen."""
BRIDGE_CLEARING = 4.0
"""Distance from a bridge's edges within which no shrubs and trees grow, m; chosen."""
_SLOPE = 0.25
"""Half the distance over which the ground's slope is measured, m."""


@dataclass(frozen=True)
class PlantPlaces:
    """Places where plants of a stand may grow along a stretch of road, those of the first metre first.

    Attributes:
        number: (N,) of each place.
        station, offset: (N,) m.
        stands: (N,) whether a plant grows there.
    """

    number: Int
    station: Float
    offset: Float
    stands: Bool


@dataclass(frozen=True)
class Plants:
    """Trees or shrubs of a stand: where each grows and how large it is.

    Attributes:
        number: (N,) of each plant's place.
        station, offset: (N,) m.
        position: (N, 3) local, of its foot, m.
        height: (N,) m.
        breadth: (N,) by which the shape of a plant of height 1 is scaled across, m.
        kind: (N,) which of the kinds of its species it is.
    """

    number: Int
    station: Float
    offset: Float
    position: Float
    height: Float
    breadth: Float
    kind: Int


def random_share(seed: int, number: Int) -> NDArray[np.float32]:
    """Return the random numbers (N,), 0 to 1, of Blender's node Random Value for a seed and ids (N,)."""
    initial_word = np.uint32(0xDEADBEEF + (2 << 2) + 13)
    with np.errstate(over="ignore"):
        a = np.full(len(number), initial_word + np.uint32(seed % 2**32))
        b = initial_word + number.astype(np.uint32)
        c = np.full(len(number), initial_word)
        for target, source, bits in (("c", "b", 14), ("a", "c", 11), ("b", "a", 25), ("c", "b", 16)):
            a, b, c = _mix_words(a, b, c, target, source, bits)
        for target, source, bits in (("a", "c", 4), ("b", "a", 14), ("c", "b", 24)):
            a, b, c = _mix_words(a, b, c, target, source, bits)
    return c.astype(np.float32) / np.float32(0xFFFFFFFF)


Words = NDArray[np.uint32]


def _mix_words(a: Words, b: Words, c: Words, target: str, source: str, bits: int) -> tuple[Words, Words, Words]:
    """Return the state a, b, c of Jenkins' hash after one step: ``target ^= source; target -= rotated(source)``.

    Args:
        a, b, c: (N,) words of the state.
        target, source: names of the word that changes and of the one that changes it.
        bits: by which the source is rotated to the left.
    """
    words = {"a": a, "b": b, "c": c}
    rotated = (words[source] << np.uint32(bits)) | (words[source] >> np.uint32(32 - bits))
    words[target] = (words[target] ^ words[source]) - rotated
    return words["a"], words["b"], words["c"]


def plant_places(
    geometry: RoadGeometry, plants: Vegetation, terrain: Terrain, start: float = 0.0, end: float | None = None
) -> PlantPlaces:
    """Return the places of a stand in the whole metres from ``start`` to ``end`` (m), and whether a plant grows there.

    Where plants grow there are as many on each square metre of ground, sloping or not, as the density says.
    """
    place_rate, seed = places_per_metre(plants, terrain), plants.seed % SEEDS
    end_metre = math.ceil(geometry.length if end is None else min(end, geometry.length))
    number = np.arange(math.floor(start) * place_rate, end_metre * place_rate, dtype=np.int64)
    station = (number // place_rate).astype(np.float64) + random_share(seed + STATION, number)
    offset = (random_share(seed + OFFSET, number).astype(np.float64) * 2.0 - 1.0) * terrain.half_width
    curvature = geometry.alignment.curvature(np.minimum(station, geometry.length))
    boundaries = geometry.offsets(np.minimum(station, geometry.length))
    distance = np.maximum(offset - boundaries[:, 0], boundaries[:, -1] - offset)
    stands = (station <= geometry.length) & (distance > 0.0) & (clip_offset(offset, curvature) == offset)
    stands &= (distance >= plants.band_start) & (distance <= plants.band_end)
    stands &= (station >= plants.start_station) & (station <= plants.end_station)
    if plants.side != "both":
        stands &= offset > 0.0 if plants.side == "left" else offset < 0.0
    stands &= ~_in_clearings(geometry, station, offset)
    for mouth in geometry.mouths.values():
        stands &= ~mouth.is_beside(station, offset, MOUTH_CLEARING)
    for first, last in geometry.capped:
        stands &= (distance > BRIDGE_CLEARING) | (station < first) | (station > last)
    if geometry.crossing_roads:
        near = np.flatnonzero(stands)
        places = geometry.alignment.place(station[near], offset[near])
        stands[near] &= ~network_of(geometry).covers(places, MOUTH_CLEARING)
    candidates = np.flatnonzero(stands)
    ground_area = (1.0 - curvature[candidates] * offset[candidates]) * _steepness(
        geometry, station[candidates], offset[candidates], curvature[candidates]
    )
    plant_chance = terrain.half_width * 2.0 * plants.density * ground_area
    stands[candidates] = random_share(seed + CHANCE, number[candidates]) * place_rate <= plant_chance
    return PlantPlaces(number, station, offset, stands)


def _in_clearings(geometry: RoadGeometry, station: Float, offset: Float) -> Bool:
    """Return whether places (N,) lie on or so near things that no shrubs and trees grow there."""
    mask = np.zeros(len(station), dtype=np.bool_)
    for item in geometry.parameters.of_type(Thing).values():
        for block in item.footprint() if item.clearing is not None else ():
            clearing = item.clearing or 0.0
            is_within_stations = (station > block.start - clearing) & (station < block.end + clearing)
            mask |= is_within_stations & (offset > block.low - clearing) & (offset < block.high + clearing)
    return mask


def _steepness(geometry: RoadGeometry, station: Float, offset: Float, curvature: Float) -> Float:
    """Return the area of ground (N,) per area in plan at stations and offsets (N,), at most 10."""
    station_step = _SLOPE / np.maximum(1.0 - curvature * offset, 0.02)

    def height(station_shift: Float | float, offset_shift: float) -> Float:
        """Return the surface's elevations (N,), m, at the places moved by a station and an offset, m."""
        return known_elevation(geometry, np.clip(station + station_shift, 0.0, geometry.length), offset + offset_shift)

    grade = (height(station_step, 0.0) - height(-station_step, 0.0)) / (2.0 * _SLOPE)
    cross_slope = (height(0.0, _SLOPE) - height(0.0, -_SLOPE)) / (2.0 * _SLOPE)
    return np.minimum(np.sqrt(1.0 + grade**2 + cross_slope**2), 10.0)


def grown_plants(geometry: RoadGeometry, plants: Vegetation, terrain: Terrain) -> Plants:
    """Return the trees or shrubs of a stand along the whole road: places, heights, breadths and kinds.

    Each measure follows from the plant's place number and the stand's seed plus a constant of the measure, so that a
    plant has the same measures in every stretch of the road. Breadths are drawn as a ratio to the height.
    """
    places = plant_places(geometry, plants, terrain)
    number, seed = places.number[places.stands], plants.seed % SEEDS
    station, offset = places.station[places.stands], places.offset[places.stands]
    height = plants.height_min + (plants.height_max - plants.height_min) * random_share(seed + HEIGHT, number)
    least_breadth, largest_breadth = BREADTHS[plants.kind]
    breadth_ratio = least_breadth + (largest_breadth - least_breadth) * random_share(seed + BREADTH, number)
    kind = np.floor(random_share(seed + KIND, number) * (len(KINDS[plants.kind]) - PICK)).astype(np.int64)
    position = np.column_stack([geometry.alignment.place(station, offset), known_elevation(geometry, station, offset)])
    return Plants(number, station, offset, position, height, height * breadth_ratio, kind)
