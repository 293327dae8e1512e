"""The shape of the ground between the road's edge and the ground as it was: crest, swale, batter, rounded toe.

Heights count from the road's edge, distances outwards from it. Where the ground at the edge is higher the road lies in
a cutting, and the edge is followed by a swale and a batter that rises to the ground; else by a crest and a batter that
falls to it. Where batter and ground meet, a parabola with two equal tangents rounds them.
"""

from __future__ import annotations

import numpy as np

from ..base.arrays import Float
from .surroundings import Terrain

SWALE_FROM, SWALE_FULL = 0.2, 0.8
"""Height of the ground at the road's edge above it from which there is a swale, and from which it is full, m."""


def is_shaped(terrain: Terrain) -> bool:
    """Return whether anything but the two planes of the batter lies between road and ground."""
    return bool(terrain.crest_length or terrain.rounding_length or terrain.swale_width)


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
    embankment = np.minimum(_smooth_maximum(ground, lower, rounding), upper)
    return np.where(at_edge > 0.0, cutting, embankment)


def swale_share(at_edge: Float) -> Float:
    """Return the share (N,) of its full depth that a swale has, by the ground's height at the road's edge (N,), m."""
    return np.clip((at_edge - SWALE_FROM) / (SWALE_FULL - SWALE_FROM), 0.0, 1.0)


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
