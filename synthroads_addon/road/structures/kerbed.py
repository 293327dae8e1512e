"""Caps of bridges and walkways of tunnels as solids, rows along them, and places in their cross-sections."""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np

from ...base.arrays import Float
from ..things.body import Body, Course
from .caps import KERB_LEAN, NARROWEST_CAP, Capped, cap_share, median_cap_height, outer_cap_height

CAP_DEPTH, CAP_NOSE, CAP_HANG, CAP_TOE = 0.3, 0.25, 0.5, 0.2
"""An outer cap: depth below the pavement's edge, thickness of its nose, depth to which that hangs, and how far its foot
reaches below the pavement, m."""
LEFT, RIGHT = 1.0, -1.0
"""The road's sides: the signs of their offsets."""
OUTER = {LEFT: 0, RIGHT: 5}
"""Columns of `Course.edges` by side: the verges' outer edges, the pavements' outer and inner edges."""
PAVED = {LEFT: 1, RIGHT: 4}
INNER = {LEFT: 2, RIGHT: 3}
NAMES = {LEFT: "left", RIGHT: "right"}
_SPACING = 2.0
"""Longest piece of parts along the road, m, where their course asks for no less."""


class Structure(Capped, Protocol):
    """The values of a structure on which the parts along it depend."""

    @property
    def stations(self) -> Float:
        """Return the stations (4,) at which its caps begin and end, and have their full height, m."""


def kerb_bodies(structure: Structure, course: Course) -> list[Body]:
    """Return the closed solids of caps or walkways in local coordinates, whose tops are the surface of the road there.

    The outer caps' feet reach below the pavement, so that no gap opens where chords differ.
    """
    station = section_rows(structure, course, structure.cap_start, structure.cap_end)
    if len(station) < 2:
        return []
    edges, share = course.edges(station), cap_share(structure, station)[:, None]
    bodies = []
    for side in (LEFT, RIGHT):
        paved, outer = edges[:, PAVED[side]], edges[:, OUTER[side]]
        width = side * (outer - paved)
        if width.min() <= CAP_NOSE + 2.0 * KERB_LEAN:
            continue
        lean = np.full(len(station), KERB_LEAN)
        across = np.stack([width, width, lean, 0.0 * width, 0.0 * width - CAP_TOE, lean, width - CAP_NOSE,
                           width - CAP_NOSE], axis=1)  # fmt: skip
        offset = paved[:, None] + side * across
        edge = course.pavement(station, paved)[:, None]
        verge = np.stack([course.pavement(station, offset[:, column]) for column in (1, 2)], axis=1) - edge
        cap = np.stack([outer_cap_height(structure, across[:, column]) for column in (1, 2)], axis=1)
        top = verge + share * (cap - verge)
        low = [np.full(len(station), -depth) for depth in (CAP_HANG, CAP_DEPTH)]
        height = np.stack([low[0], top[:, 0], top[:, 1], 0.0 * width, low[1], low[1], low[1], low[0]], axis=1)
        name = f"cap-{NAMES[side]}"
        bodies.append(
            Body(place_sections(course, station, offset, edge + height), "barrier_concrete", name, "IfcBeam.EDGEBEAM")
        )
    left, right = edges[:, INNER[LEFT]], edges[:, INNER[RIGHT]]
    width = left - right
    if width.min() >= NARROWEST_CAP:
        lean = np.full(len(station), KERB_LEAN)
        distance = np.stack([0.0 * width, lean, width - lean, width], axis=1)
        distance = np.concatenate([distance, distance[:, ::-1]], axis=1)
        offset = left[:, None] - distance
        edge = np.stack([course.pavement(station, offset[:, column]) for column in range(8)], axis=1)
        lift = np.stack([median_cap_height(structure, width, distance[:, column]) for column in range(4)], axis=1)
        height = edge + np.concatenate([share * lift, np.full((len(station), 4), -CAP_DEPTH)], axis=1)
        offset[:, 4] -= CAP_TOE
        offset[:, 7] += CAP_TOE
        bodies.append(
            Body(place_sections(course, station, offset, height), "barrier_concrete", "cap-median", "IfcBeam.EDGEBEAM")
        )
    return bodies


def section_rows(structure: Structure, course: Course, start: float, end: float) -> Float:
    """Return the stations (R,) of sections between two stations that are on the road, m; none where nothing is.

    They are those that the outer edges' course asks for, the caps' ramps, and others at most `_SPACING` apart.
    """
    start, end = max(start, 0.0), min(end, course.length)
    if end - start < 1e-3:
        return np.empty(0)
    kinks = [station for station in structure.stations.tolist() if start < station < end]
    every = [np.linspace(start, end, max(2, math.ceil((end - start) / _SPACING) + 1)), np.array(kinks)]
    for column in (0, 5):

        def edge(station: Float, column: int = column) -> Float:
            """Return the offsets (N,) of one of the road's edges at stations (N,), m."""
            return course.edges(station)[:, column]

        every.append(course.rows(edge, start, end, kinks))
    station = np.unique(np.round(np.concatenate(every), 9))
    keep = np.append(np.diff(station) > 1e-4, True)
    keep[0] = True
    return station[keep]


def place_sections(course: Course, station: Float, offset: Float, height: Float) -> Float:
    """Return local points (R, K, 3) at stations (R,), offsets (R, K) and elevations (R, K), m."""
    feet, left = course.feet(station, np.zeros(len(station))), course.left(station)
    points = feet[:, None] + offset[..., None] * left[:, None]
    points[..., 2] = height
    return points
