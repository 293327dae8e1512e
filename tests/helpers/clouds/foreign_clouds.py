"""Clouds in which there is no road, or only part of one, or one that is hard to tell: each 150 m, thrown at random."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from synthroads_addon.base.arrays import Bool, Float
from synthroads_addon.base.classes import class_id
from tests.helpers.clouds.road_clouds import block_of, write

Across = Callable[[Float, Float, np.random.Generator], tuple[Float, Float]]
"""From offsets and stations (N,), m, to heights, m, and intensities from 0 to 1."""
LENGTH, HALF, DENSITY = 150.0, 18.0, 12.0
EAST, NORTH, UP = 500_000.0, 5_600_000.0, 100.0


def _grass(count: int, rng: np.random.Generator) -> tuple[Float, Float]:
    return rng.normal(0.0, 0.05, count), 0.45 + rng.normal(0.0, 0.07, count)


def paved(
    inside: Bool, paint: Bool, rng: np.random.Generator, kerb: float = 0.08, level: float = 0.18
) -> tuple[Float, Float]:
    """Return heights and intensities of pavement inside of a mask, with paint, and of grass outside, a kerb higher."""
    rough, bright = _grass(len(inside), rng)
    height = np.where(inside, 0.0, kerb + rough)
    return height, np.where(inside, np.where(paint, 0.7, level), bright)


def rural(offset: Float, station: Float, rng: np.random.Generator) -> tuple[Float, Float]:
    """A road of 7 m with edge lines and a dashed line in its middle, between grass: sound."""
    away = np.abs(offset)
    paint = ((away < 0.07) & (station % 12.0 < 4.0)) | (np.abs(away - 3.2) < 0.07)
    return paved(away < 3.5, paint, rng)


def unmarked(offset: Float, station: Float, rng: np.random.Generator) -> tuple[Float, Float]:
    """A road of 5.5 m without any marking, between grass: sound."""
    return paved(np.abs(offset) < 2.75, np.zeros(len(offset), dtype=bool), rng)


def field(offset: Float, station: Float, rng: np.random.Generator) -> tuple[Float, Float]:
    """Grass."""
    return _grass(len(offset), rng)


def noise(offset: Float, station: Float, rng: np.random.Generator) -> tuple[Float, Float]:
    """Points whose heights and intensities mean nothing."""
    return rng.uniform(0.0, 2.0, len(offset)), rng.uniform(0.0, 1.0, len(offset))


def car_park(offset: Float, station: Float, rng: np.random.Generator) -> tuple[Float, Float]:
    """Asphalt everywhere, with rows of bays of 2.5 by 5 m on both sides of aisles of 6 m."""
    within = (offset + HALF) % 16.0
    bays = (within < 5.0) | (within > 11.0)
    paint = (bays & (station % 2.5 < 0.12)) | (np.abs(within - 0.06) < 0.06)
    return paved(np.ones(len(offset), dtype=bool), paint, rng)


def village(offset: Float, station: Float, rng: np.random.Generator) -> tuple[Float, Float]:
    """A street of 6 m between kerbs and pavements, without lines, its brightest strip the gutter along one edge."""
    away, (rough, bright) = np.abs(offset), _grass(len(offset), rng)
    height = np.where(away < 3.0, 0.0, np.where(away < 4.8, 0.11, 0.13 + rough))
    level = np.where(away < 3.0, 0.2, np.where(away < 4.8, 0.28, bright))
    return height, np.where((offset > 2.7) & (offset < 3.0), 0.6, level)


def canal(offset: Float, station: Float, rng: np.random.Generator) -> tuple[Float, Float]:
    """Water 2 m below its banks, with a path of gravel beside it."""
    away, (rough, bright) = np.abs(offset), _grass(len(offset), rng)
    height = np.where(away < 6.0, -2.0, np.where(away < 8.0, -2.0 + (away - 6.0), rough))
    gravel = (offset > 9.0) & (offset < 11.0)
    return height, np.where(away < 6.0, 0.02, np.where(gravel, 0.55, bright))


def railway(offset: Float, station: Float, rng: np.random.Generator) -> tuple[Float, Float]:
    """Two tracks on dark ballast, the rails bright and 0.17 m above it."""
    away, (rough, bright) = np.abs(offset), _grass(len(offset), rng)
    rail = np.abs(np.abs(away - 2.0) - 0.75) < 0.06
    ballast = away < 4.5
    height = np.where(rail, 0.17, np.where(ballast, 0.02 * rng.normal(size=len(offset)), -0.3 + rough))
    return height, np.where(rail, 0.7, np.where(ballast, 0.2 + 0.04 * rng.normal(size=len(offset)), bright))


def ploughed(offset: Float, station: Float, rng: np.random.Generator) -> tuple[Float, Float]:
    """Soil in furrows along the cloud, with bright tracks of a tractor."""
    rough, bright = _grass(len(offset), rng)
    track = np.abs((offset % 12.0) - 6.0) < 0.25
    return 0.12 * np.sin(2.0 * np.pi * offset / 0.8) + 0.3 * rough, np.where(track, 0.6, 0.3 + 0.3 * (bright - 0.45))


def half_road(offset: Float, station: Float, rng: np.random.Generator) -> tuple[Float, Float]:
    """The sound road, cut off beside its middle line."""
    height, brightness = rural(offset, station, rng)
    return np.where(offset > 0.4, height, np.nan), brightness


def hidden_middle(offset: Float, station: Float, rng: np.random.Generator) -> tuple[Float, Float]:
    """The sound road with a strip of 5 m missing from its middle."""
    height, brightness = rural(offset, station, rng)
    return np.where(np.abs(offset - 0.8) > 2.5, height, np.nan), brightness


def slab(offset: Float, station: Float, rng: np.random.Generator) -> tuple[Float, Float]:
    """One even surface as bright everywhere: a hall's floor."""
    return rng.normal(0.0, 0.005, len(offset)), 0.3 + rng.normal(0.0, 0.01, len(offset))


SOUND: tuple[Across, ...] = (rural, unmarked)
"""Roads, their axis along the cloud's east axis."""
FOREIGN: tuple[Across, ...] = (field, noise, car_park, canal, ploughed, slab, railway)
"""No roads."""
DAMAGED: tuple[Across, ...] = (village, half_road, hidden_middle)
"""Roads along the same axis that are hard to tell."""


def throw(path: Path, across: Across, seed: int, slant: float = 0.0, length: float = LENGTH) -> Path:
    """Write a cloud of ground points along the map's east axis, 12 points/m2, bent by a slant (m at its ends)."""
    rng = np.random.default_rng([seed, sum(map(ord, across.__name__))])
    count = int(DENSITY * length * 2.0 * HALF)
    station, offset = rng.uniform(0.0, length, count), rng.uniform(-HALF, HALF, count)
    height, brightness = across(offset, station, rng)
    seen = np.isfinite(height)
    north = NORTH + offset + axis_north(station, slant, length)
    xyz = np.column_stack([EAST + station, north, UP + height + rng.normal(0.0, 0.01, count)])[seen]
    bright = np.clip(brightness + rng.normal(0.0, 0.02, count), 0.0, 1.0)[seen]
    return write(path, block_of(xyz, bright, np.full(len(xyz), class_id("ground"), np.uint8)))


def axis_north(station: Float, slant: float, length: float = LENGTH) -> Float:
    """Return how far north of the east axis a cloud's axis lies at stations, m: a parabola."""
    return slant * (2.0 * station / length - 1.0) ** 2
