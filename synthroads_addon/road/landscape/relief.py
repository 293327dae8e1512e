"""The land's heights: at the terrain's edge those of the terrain, farther out hills."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from ...base.arrays import Float
from ...base.random_streams import stream
from ..geometry import RoadGeometry
from ..surroundings import Landscape
from ..terrain import known_elevation

_WAVES, _OCTAVES = 16, 2.5
_FLAT, _RISE = 1200.0, 1500.0  # m ahead of the road's ends: where hills begin on its prolongation, and over how far
_NEAR = 500.0  # m beside the road over which the terrain turns into hills
_EASE = 400.0  # m over which the road's grade eases beyond its ends


class LandRelief:
    """Heights of the land around a road, anywhere in local coordinates.

    Args:
        geometry: the road.
        landscape: of its parameter set.

    Attributes:
        half_width: distance from the axis to which the terrain itself is built, m.
    """

    def __init__(self, geometry: RoadGeometry, landscape: Landscape) -> None:
        terrain = geometry.parameters.terrain
        edges = geometry.offsets([0.0, geometry.length])
        self.geometry, self.landscape = geometry, landscape
        self.half_width = max(terrain.half_width if terrain else 0.0, float(np.abs(edges).max()))

    def elevation(self, xy: Float) -> Float:
        """Return the local elevation (N,), m, at local points (N, 2), of the land or the road's prolongation."""
        station, offset = self.geometry.alignment.project(xy)
        return self.elevation_beside(xy, station, offset)

    def elevation_beside(self, xy: Float, station: Float, offset: Float) -> Float:
        """Return the local elevation (N,), m, at points (N, 2) with stations and offsets (N,) on the axis or beyond."""
        length = self.geometry.length
        on_road = np.clip(station, 0.0, length)
        offset_on_terrain = np.clip(offset, -self.half_width, self.half_width)
        terrain_elevation = known_elevation(self.geometry, on_road, offset_on_terrain) + self._climb(station)
        distance_ahead = np.maximum(np.maximum(-station, station - length), 0.0)
        distance_beside = np.maximum(np.abs(offset) - self.half_width, 0.0)
        hill_share = np.maximum(
            1.0 - np.exp(-((distance_beside / _NEAR) ** 2)), _smooth((distance_ahead - _FLAT) / _RISE)
        )
        return terrain_elevation * (1.0 - hill_share) + (self._mean + self._hills(xy)) * hill_share

    def _climb(self, station: Float) -> Float:
        """Return the rise (N,), m, beyond the road's ends: at its grade there, which eases."""
        length, profile = self.geometry.length, self.geometry.profile
        start_grade, end_grade = profile.grade(np.array([0.0, length])).tolist()
        distance_before, distance_after = np.maximum(-station, 0.0), np.maximum(station - length, 0.0)
        return _EASE * (np.tanh(distance_after / _EASE) * end_grade - np.tanh(distance_before / _EASE) * start_grade)

    @cached_property
    def _mean(self) -> float:
        """Return the mean elevation of the terrain's outer edges along the road, m: the level that hills rise from."""
        station = np.linspace(0.0, self.geometry.length, 9)
        return float(
            np.mean([known_elevation(self.geometry, station, np.full(9, side * self.half_width)) for side in (-1, 1)])
        )

    def _hills(self, xy: Float) -> Float:
        """Return the hills' heights (N,), m: seeded plane waves, the longer the higher."""
        return plane_waves(xy, self.landscape.seed, "hills", self.landscape.hill_length) * self.landscape.hill_height


def plane_waves(xy: Float, seed: int, purpose: str, shortest_wavelength: float) -> Float:
    """Return a seeded field (N,) of mean 0 and standard deviation 1 at points (N, 2).

    Args:
        xy: local points, m.
        seed, purpose: of its random numbers.
        shortest_wavelength: of the field's waves, m; the others are up to two and a half octaves longer.
    """
    rng = stream(seed, "landscape", purpose)
    octaves, directions = rng.uniform(0.0, _OCTAVES, _WAVES), rng.uniform(0.0, 2.0 * np.pi, _WAVES)
    phases, weights = rng.uniform(0.0, 2.0 * np.pi, _WAVES), 2.0 ** (0.7 * octaves)
    wave_numbers = 2.0 * np.pi / (shortest_wavelength * 2.0**octaves)
    vectors = wave_numbers * np.stack([np.cos(directions), np.sin(directions)])
    waves: Float = np.sin(xy @ vectors + phases) @ (weights * np.sqrt(2.0 / np.sum(weights**2)))
    return waves


def _smooth(share: Float) -> Float:
    """Return shares clipped to 0 to 1 and eased at both ends: the smoothstep 3 x^2 - 2 x^3."""
    clipped = np.clip(share, 0.0, 1.0)
    return clipped * clipped * (3.0 - 2.0 * clipped)
