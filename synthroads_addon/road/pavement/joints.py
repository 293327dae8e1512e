"""Joints of a pavement as outlines in stations and offsets: where the field and its heights have them."""

from collections.abc import Iterator
from itertools import pairwise
from typing import Literal, NamedTuple

import numpy as np

from ...base.arrays import Bool, Float
from ..section_geometry import CarriagewaySection
from .field import DAY, SEAM, SEAM_INWARDS, SLAB_JOINT


class Joint(NamedTuple):
    """A joint of a carriageway's pavement.

    Attributes:
        kind: whether it runs along the road or across it.
        outlines: convex outlines (4, 2) in stations and offsets, counter-clockwise from above.
    """

    kind: Literal["longitudinal", "transverse"]
    outlines: list[Float]


def joint_width(section: CarriagewaySection) -> float:
    """Return the width of a carriageway's joints, m."""
    return SLAB_JOINT if section.carriageway.pavement.is_concrete else SEAM


def joints_of(section: CarriagewaySection, stations: Float) -> Iterator[Joint]:
    """Yield a carriageway's joints: asphalt's where the paver's ways and days meet, concrete's around its slabs.

    Args:
        section: the carriageway's.
        stations: (N,) from 0 to the road's end, m; joints along the road are straight between two.
    """
    half_width, pavement = joint_width(section) / 2.0, section.carriageway.pavement
    for distance, exists in _along(section, stations):
        places = list(zip(stations.tolist(), (distance - half_width).tolist(), strict=True))
        rows = np.flatnonzero(exists[:-1] & exists[1:]).tolist()
        yield Joint("longitudinal", [_quad(section, places[row], places[row + 1], 2.0 * half_width) for row in rows])
    period, last_station = pavement.slab_length if pavement.is_concrete else DAY, float(stations[-1])
    for number in range(int(last_station // period) + 1):
        joint_station = number * period
        start, end = max(joint_station - half_width, 0.0), min(joint_station + half_width, last_station)
        if end > start:
            yield Joint("transverse", [_across(section, start, end, *part) for part in _paved(section, joint_station)])


def _along(section: CarriagewaySection, stations: Float) -> Iterator[tuple[Float, Bool]]:
    """Yield the distances (N,) of joints along the road from the centreline at stations (N,), m, and where they are."""
    edges = section.lane_boundaries(stations).T
    if section.carriageway.pavement.is_concrete:
        yield from ((edge, np.ones(len(edge), bool)) for edge in edges)
        return
    for outer, inner in pairwise(edges):
        yield outer - SEAM_INWARDS, outer - inner > 2.0 * SEAM_INWARDS


def _paved(section: CarriagewaySection, station: float) -> list[tuple[float, float]]:
    """Return the inner and outer distances (m) of what is paved at a station."""
    edges = section.distances(station)[0]
    if "island" not in section.kinds:
        return [(float(edges[0]), float(edges[-2]))]
    island_start, island_end = (float(value[0]) for value in section.boundaries_of("island", np.array([station])))
    parts = [(float(edges[0]), island_start), (island_end, float(edges[-2]))]
    return (
        [part for part in parts if part[1] > part[0]]
        if island_end > island_start
        else [(float(edges[0]), float(edges[-2]))]
    )


def _quad(section: CarriagewaySection, first: tuple[float, float], second: tuple[float, float], width: float) -> Float:
    """Return the outline between two places (station, inner distance) of a strip of a width, m."""
    corners = [first, second, (second[0], second[1] + width), (first[0], first[1] + width)]
    outline = np.array([(station, section.carriageway.sign * distance) for station, distance in corners])
    return outline if section.carriageway.sign > 0 else outline[::-1]


def _across(section: CarriagewaySection, start: float, end: float, inner: float, outer: float) -> Float:
    """Return the outline (4, 2) of a joint across the road: between two stations and two distances, m."""
    return _quad(section, (start, inner), (end, inner), outer - inner)
