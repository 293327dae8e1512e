"""Outlines of painted areas (gore hatching, arrows) in stations and offsets."""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from ..base.arrays import Float
from .geometry import RoadGeometry
from .section import Arrow, Hatching
from .section_geometry import CarriagewaySection

_EDGE_LINE = 0.3
"""The hatching keeps clear of the lines along both sides of the gore, m."""
_NARROWEST = 0.4
"""The hatching begins where the gore between those lines is this wide, m."""
_STEPS = 6

# Arrows of length 1 that point along +x (with the traffic), y to the left, as triangles and quadrilaterals (RMS's
# shapes, straightened); widths are shares of the length.
_SHAFT = [(0.0, -0.03), (0.62, -0.03), (0.62, 0.03), (0.0, 0.03)]
_HEAD = [(0.6, -0.11), (1.0, 0.0), (0.6, 0.11)]
_TURN_SHAFT = [(0.30, -0.03), (0.52, -0.17), (0.56, -0.12), (0.36, 0.03)]
_TURN_HEAD = [(0.46, -0.20), (0.78, -0.30), (0.60, -0.02)]
_MERGE_SHAFT = [(0.0, -0.03), (0.35, -0.03), (0.35, 0.03), (0.0, 0.03)]


def _mirror_outline(shape: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return an outline mirrored at the x axis, its corners in reversed order so that it runs the same way round."""
    return [(x, -y) for x, y in reversed(shape)]


_LONG_SHAFT = [(0.0, -0.03), (0.33, -0.03), (0.33, 0.03), (0.0, 0.03)]
ARROWS: dict[str, list[list[tuple[float, float]]]] = {
    "straight": [_SHAFT, _HEAD],
    "right": [_LONG_SHAFT, _TURN_SHAFT, _TURN_HEAD],
    "straight_right": [_SHAFT, _HEAD, _TURN_SHAFT, _TURN_HEAD],
    "merge_right": [_MERGE_SHAFT, _TURN_SHAFT, _TURN_HEAD],
}
ARROWS |= {
    name.replace("right", "left"): [_mirror_outline(shape) for shape in shapes]
    for name, shapes in list(ARROWS.items())
    if "right" in name
}
"""Kind of arrow -> its convex parts."""


def hatching_outlines(geometry: RoadGeometry, hatching: Hatching) -> list[Float]:
    """Return the stripes of a gore's hatching, each as (4, 2) stations and offsets, counter-clockwise from above.

    The stripes lead traffic away from the gore: seen in the direction of travel towards a diverging gore they run from
    its middle outwards and back.
    """
    turnout = geometry.parameters.objects[hatching.turnout]
    section = geometry.sections[geometry.parameters.carriageway_of(hatching).side]
    shape = next(shape for shape in section.turnouts if shape.turnout is turnout)
    tip, nose = shape.gore_tip(), shape.nose_station()
    forward = 1.0 if nose > tip else -1.0
    stations = np.linspace(tip, nose, 400)
    inner, outer = _hatched_range(section, stations)
    wide_rows = np.flatnonzero(outer - inner >= _NARROWEST)
    if not len(wide_rows):
        return []
    pitch = hatching.stripe_width + hatching.gap_width
    first_station = stations[wide_rows[0]]
    count = int(abs(nose - first_station) // pitch)
    slant = 1.0 / np.tan(np.radians(hatching.angle_deg))
    stripe_middles = first_station + forward * (pitch * np.arange(count) + hatching.stripe_width / 2.0)
    edges = []
    for shift in (-hatching.stripe_width / 2.0, hatching.stripe_width / 2.0):
        for at_outer_edge in (False, True):
            edges.append(_edge_crossings(section, stripe_middles + shift, forward * slant, at_outer_edge, (tip, nose)))
    corners = np.stack([edges[0], edges[2], edges[3], edges[1]], axis=1)
    corners[:, :, 1] *= section.carriageway.sign
    keep_mask = (corners[:, :, 0] * forward).max(axis=1) < nose * forward - 0.2
    return [_counter_clockwise(corner) for corner in corners[keep_mask]]


def arrow_outlines(arrow: Arrow) -> list[Float]:
    """Return the convex parts (K, 2) of an arrow in stations and offsets, counter-clockwise from above."""
    turn = np.radians(arrow.rotation_deg)
    direction = np.array([np.cos(turn), np.sin(turn)])
    rotation = np.column_stack([direction, [-direction[1], direction[0]]])
    parts = [(np.array(part) - (0.5, 0.0)) * arrow.length @ rotation.T for part in ARROWS[arrow.kind]]
    return [_counter_clockwise(part + (arrow.station, arrow.offset)) for part in parts]


def cut_outline(outline: Float, cuts: Float) -> Iterator[Float]:
    """Yield the pieces (M, 2) of a convex outline (K, 2) between each two neighbours of the stations ``cuts``, m."""
    for start, end in pairwise(cuts):
        piece = _clip_outline(_clip_outline(outline, start, 1.0), end, -1.0)
        if len(piece) > 2:
            yield piece


def _clip_outline(outline: Float, station: float, direction: float) -> Float:
    """Return the part of a convex outline beyond (``direction`` 1) or before (-1) a station.

    Sutherland and Hodgman's clipping of a polygon at one line.
    """
    is_inside = (outline[:, 0] - station) * direction >= 0.0
    corners = []
    for i, corner in enumerate(outline):
        previous = outline[i - 1]
        if is_inside[i] != is_inside[i - 1]:
            share = (station - previous[0]) / (corner[0] - previous[0])
            corners.append(previous + share * (corner - previous))
        if is_inside[i]:
            corners.append(corner)
    return np.array(corners).reshape(-1, 2)


def _hatched_range(section: CarriagewaySection, station: Float) -> tuple[Float, Float]:
    """Return the inner and outer distances (N,) from the centreline, m, between which a gore is hatched.

    The gore lies between the outermost lane of the main road and the turnout's lane.
    """
    outermost_lane_edge = section.lane_boundaries(station)[:, 0]
    turnout_lane_inner_edge, _ = section.boundaries_of("turnout_lane", station)
    return outermost_lane_edge + _EDGE_LINE, turnout_lane_inner_edge - _EDGE_LINE


def _edge_crossings(
    section: CarriagewaySection, station: Float, slant: float, at_outer_edge: bool, limits: tuple[float, float]
) -> Float:
    """Return the points (N, 2: station, distance), m, where slanting lines from a gore's middle meet its edge."""
    inner, outer = _hatched_range(section, station)
    middle, crossing_station = (inner + outer) / 2.0, station
    # Fixed-point iteration: where the line meets the edge depends on the edge's distance there.
    for _ in range(_STEPS):
        edge = _hatched_range(section, crossing_station)[1 if at_outer_edge else 0]
        crossing_station = np.clip(station + slant * (edge - middle), min(limits), max(limits))
    return np.column_stack([crossing_station, _hatched_range(section, crossing_station)[1 if at_outer_edge else 0]])


def _counter_clockwise(outline: Float) -> Float:
    """Return an outline (K, 2) counter-clockwise as seen from above, reversed where it isn't."""
    x, y = outline.T
    area = np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)
    return outline if area > 0.0 else outline[::-1]
