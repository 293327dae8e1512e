"""Bodies of things: closed solids in true dimensions, each with its material, and the places that they are made for.

Every shape is a row of sections, one behind the other: outlines of the same number of corners, joined from corner to
corner, the first and the last closed by lids. Outlines that aren't convex begin where corner i faces the last but i.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...base.arrays import Float

Point2 = tuple[float, float]
Point3 = tuple[float, float, float]

BURIED = 0.3
"""Depth to which posts and foundations reach below the surface, m."""
_BAR_AXIS = np.array([1.0, 0.0, 0.0])


@dataclass(frozen=True)
class Body:
    """A closed solid of a thing: a row of cross-sections, with its material.

    Attributes:
        sections: (R, K, 3) R >= 2 outlines of K corners, m, in the thing's frame: of what stands at one place x to the
            right of traffic with the stations, y along it, z up from its foot; of what runs along the road the local
            frame.
        material: name in the material table.
        part: name of the part of the thing that it belongs to; empty for the thing itself.
        ifc: entity and predefined type of that part in IFC, with a dot between them.
        detail: 0, or for fittings too small for a model of the whole their size, m: the box around them then.
    """

    sections: Float
    material: str
    part: str = ""
    ifc: str = ""
    detail: float = 0.0


@dataclass(frozen=True)
class Place:
    """The ground and the pavement around a thing that stands at one place, in its frame.

    Attributes:
        ground: height of the surface at x (N,) and y (N,), m.
        pavement: height of the pavement's highest point below a rectangle, m: its limits in x and in y, and by how much
            y grows per x. Where nothing below is paved it is 0.
        slope: run of batters per metre of height.
    """

    ground: Callable[[ArrayLike, ArrayLike], Float]
    pavement: Callable[[Point2, Point2, float], float]
    slope: float


LEVEL = Place(lambda x, y: np.zeros(np.broadcast(x, y).shape), lambda x, y, shear: 0.0, 1.5)
"""A level surface, all paved."""


@dataclass(frozen=True)
class Course:
    """The road's surface along which something runs, in local coordinates.

    Attributes:
        length: of the road, m.
        feet: points (N, 3) on the surface at stations (N,) and offsets (N,).
        left: level unit vectors (N, 3) to the left at stations (N,).
        rows: stations (N,) at which what runs along the road needs a section: its offsets by station, its first and
            last station, and further stations.
        edges: offsets (N, 6) at stations (N,), from the left: the left verge's outer edge, the outer and the inner edge
            of the left pavement, the inner and the outer edge of the right one, the right verge's outer edge.
        pavement: elevations (N,) of pavements, verges and median without damage and caps, at stations and offsets (N,).
        ground: elevations (N,) of the ground at stations and offsets (N,), below bridges and above tunnels.
    """

    length: float
    feet: Callable[[Float, Float], Float]
    left: Callable[[Float], Float]
    rows: Callable[[Callable[[Float], Float], float, float, Sequence[float]], Float]
    edges: Callable[[Float], Float]
    pavement: Callable[[Float, Float], Float]
    ground: Callable[[Float, Float], Float]


# --- shapes at one place --------------------------------------------------------------------------------------------


def prism(outline: Sequence[Point2] | Float, bottom: float, top: float) -> Float:
    """Return the sections (2, K, 3) of the prism over an outline (K, 2) in x, y between two heights, m."""
    corners = np.asarray(outline, dtype=np.float64)
    return np.stack([np.column_stack([corners, np.full(len(corners), z)]) for z in (bottom, top)])


def box(size: Sequence[float], middle: Sequence[float] = (0.0, 0.0, 0.0)) -> Float:
    """Return the sections (2, 4, 3) of a box of a size (x, y, z), m, around its middle."""
    (x, y, z), half_size = middle, np.asarray(size, dtype=np.float64) / 2.0
    corners = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]) * half_size[:2] + (x, y)
    return prism(corners, z - half_size[2], z + half_size[2])


def plate(outline: Sequence[Point2] | Float, front: float, back: float) -> Float:
    """Return the sections (2, K, 3) of an upright plate: an outline (K, 2) in x, z extruded between two y, m."""
    corners = np.asarray(outline, dtype=np.float64)
    return np.stack([np.column_stack([corners[:, 0], np.full(len(corners), y), corners[:, 1]]) for y in (front, back)])


def circle(diameter: float, sides: int = 12) -> Float:
    """Return the corners (K, 2) of a regular polygon of so many sides, inscribed in a circle of the diameter, m."""
    angles = 2.0 * np.pi * np.arange(sides) / sides
    return diameter / 2.0 * np.column_stack([np.cos(angles), np.sin(angles)])


def post(diameter: float, bottom: float, top: float, x: float = 0.0, y: float = 0.0, sides: int = 12) -> Float:
    """Return the sections (2, K, 3) of an upright round post between two heights, its axis at x and y, m."""
    return prism(circle(diameter, sides) + (x, y), bottom, top)


def shift(sections: Float, vector: Sequence[float], scale: Sequence[float] = (1.0, 1.0, 1.0)) -> Float:
    """Return sections (R, K, 3) scaled along each axis about the origin, then shifted."""
    return sections * np.asarray(scale) + np.asarray(vector)


def rotate_x(sections: Float, angle: float) -> Float:
    """Return sections (R, K, 3) rotated about the x axis by an angle (rad)."""
    cosine, sine = math.cos(angle), math.sin(angle)
    return sections @ np.array([(1.0, 0.0, 0.0), (0.0, cosine, sine), (0.0, -sine, cosine)])


def rotate_z(sections: Float, angle: float) -> Float:
    """Return sections (R, K, 3) rotated about the z axis by an angle (rad)."""
    cosine, sine = math.cos(angle), math.sin(angle)
    return sections @ np.array([(cosine, sine, 0.0), (-sine, cosine, 0.0), (0.0, 0.0, 1.0)])


def bar(start: Sequence[float] | Float, end: Sequence[float] | Float, width: float) -> Float:
    """Return the sections (2, 4, 3) of a bar of square section from one point to another, its sides ``width`` (m)."""
    start_point, end_point = np.asarray(start, dtype=np.float64), np.asarray(end, dtype=np.float64)
    direction = (end_point - start_point) / np.linalg.norm(end_point - start_point)
    axis = np.cross(_BAR_AXIS, direction)
    if not axis.any():
        axis = np.array([0.0, 0.0, 1.0])
    axis /= np.linalg.norm(axis)
    # Rodrigues' rotation of the square from the x axis into the bar's direction.
    cosine = float(_BAR_AXIS @ direction)
    sine = math.sqrt(max(1.0 - cosine**2, 0.0))
    sides = np.array([(0.0, y, z) for y, z in ((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5))]) * width
    corners = sides * cosine + np.cross(axis, sides) * sine + axis * (sides @ axis)[:, None] * (1.0 - cosine)
    return np.stack([start_point + corners, end_point + corners])


# --- shapes along the road ------------------------------------------------------------------------------------------


def sweep(feet: Float, left: Float, across: ArrayLike, height: ArrayLike) -> Float:
    """Return the sections (N, K, 3) of an outline swept along the road.

    Args:
        feet, left: (N, 3) points below its axis, and unit vectors to the left.
        across: (K,) distances of its corners to the left of the axis, m.
        height: (K,) or (N, K) heights above the feet, m.
    """
    sections = feet[:, None] + np.asarray(across)[None, :, None] * left[:, None]
    sections[..., 2] += height
    return sections


def boxes(
    feet: Float, left: Float, size: Sequence[Any], bottom: ArrayLike, lateral_distance: float = 0.0
) -> list[Float]:
    """Return the sections (2, 4, 3) of upright boxes beside feet (N, 3), one for each.

    Args:
        left: (N, 3) unit vectors to the left.
        size: across, along and height, m, each one for all or (N,).
        bottom: height of the undersides above the feet, m, one for all or (N,).
        lateral_distance: distance of their middles to the left of the feet, m.
    """
    widths, lengths, heights = (np.broadcast_to(value, len(feet))[:, None] for value in size)
    forward_vectors = np.stack([left[:, 1], -left[:, 0], left[:, 2]], axis=1)
    corners = np.array([(-0.5, -0.5), (-0.5, 0.5), (0.5, 0.5), (0.5, -0.5)])
    base_points = feet[:, None] + (corners[:, 0] * widths + lateral_distance)[..., None] * left[:, None]
    base_points = base_points + (corners[:, 1] * lengths)[..., None] * forward_vectors[:, None]
    bottom_points = base_points + np.broadcast_to(bottom, len(feet))[:, None, None] * np.array([0.0, 0.0, 1.0])
    top_points = bottom_points + heights[..., None] * np.array([0.0, 0.0, 1.0])
    return list(np.stack([bottom_points, top_points], axis=1))
