"""Axes of roads followed in small steps, and what stands beside roads other than the main one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from ...road.objects import PointObject
from ...road.other_roads.parts import ConnectingRamp, CrossingRoad, OwnAxis
from ...road.parameters import AlignmentObject, RoadParameters
from ...road.things.overpass import Overpass
from .edges import Float

_STEP = 0.25
"""Distance at which an axis is followed, m."""


@dataclass(frozen=True)
class Line:
    """An axis followed in small steps: stations (N,), places (N, 2), directions (N,) and curvatures (N,)."""

    station: Float
    place: Float
    heading: Float
    curvature: Float


def line_of(road: OwnAxis | AlignmentObject) -> Line:
    """Return the axis of a road, its places by Simpson's rule."""
    stations, curvatures = [np.zeros(1)], [np.array([road.horizontal[0].curvature_start])]
    begin = 0.0
    for element in road.horizontal:
        count = 2 * max(1, int(np.ceil(element.length / _STEP / 2.0)))
        share = np.linspace(0.0, 1.0, count + 1)[1:]
        stations.append(begin + share * element.length)
        curvatures.append(element.curvature_start + share * (element.curvature_end - element.curvature_start))
        begin += element.length
    station, curvature = np.concatenate(stations), np.concatenate(curvatures)
    heading = np.deg2rad(road.start_heading_deg) * np.ones(len(station))
    places = [np.array([road.start_x, road.start_y])]
    index, turn = 0, heading[0]
    for element in road.horizontal:
        count = 2 * max(1, int(np.ceil(element.length / _STEP / 2.0)))
        u = np.linspace(0.0, element.length, count + 1)
        rate = (element.curvature_end - element.curvature_start) / max(element.length, 1e-12)
        along = turn + element.curvature_start * u + rate * u**2 / 2.0
        step = element.length / count
        xy = np.stack([np.cos(along), np.sin(along)], axis=1)
        middle_turn = turn + element.curvature_start * (u[:-1] + step / 2.0) + rate * (u[:-1] + step / 2.0) ** 2 / 2.0
        middle = np.stack([np.cos(middle_turn), np.sin(middle_turn)], axis=1)
        pieces = step / 6.0 * (xy[:-1] + 4.0 * middle + xy[1:])
        places += list(places[-1] + np.cumsum(pieces, axis=0))
        heading[index + 1 : index + 1 + count] = along[1:]
        index, turn = index + count, along[-1]
    return Line(station, np.array(places), heading, curvature)


def whole_line(road: ConnectingRamp | CrossingRoad) -> Line:
    """Return the axis of a ramp with its mouth's straight stretch behind its end, or that of a crossing road."""
    line = line_of(road)
    if isinstance(road, CrossingRoad):
        return line
    along = np.arange(_STEP, road.mouth_length, _STEP)
    forward = np.array([np.cos(line.heading[-1]), np.sin(line.heading[-1])])
    return Line(
        np.append(line.station, line.station[-1] + along),
        np.concatenate([line.place, line.place[-1] + along[:, None] * forward]),
        np.append(line.heading, np.full(len(along), line.heading[-1])),
        np.append(line.curvature, np.zeros(len(along))),
    )


def names_beside_others(parameters: RoadParameters, clearance: Mapping[str, float]) -> frozenset[str]:
    """Return the ids of what stands beside a ramp or a crossing road: nearer to its pavement than to the main road's.

    Args:
        parameters: the road.
        clearance: distances of things from the main road's pavement, m, by id.
    """
    others = [*parameters.of_type(ConnectingRamp).values(), *parameters.of_type(CrossingRoad).values()]
    things = {name: item for name, item in parameters.of_type(PointObject).items() if not isinstance(item, Overpass)}
    if not others or not things:
        return frozenset()
    places = places_of(line_of(parameters.alignment), list(things.values()))
    away = np.full(len(places), np.inf)
    for road in others:
        assert isinstance(road, ConnectingRamp | CrossingRoad)
        away = np.minimum(away, cKDTree(whole_line(road).place).query(places)[0] - road.half_width)
    return frozenset(
        name for name, distance in zip(things, away.tolist(), strict=True) if distance < clearance.get(name, np.inf)
    )


def places_of(main: Line, things: list[PointObject]) -> Float:
    """Return the places (N, 2) of things, local, m, by the main road's axis."""
    station, offset = (np.array([getattr(item, name) for item in things]) for name in ("station", "offset"))
    x, y, heading = (np.interp(station, main.station, v) for v in (main.place[:, 0], main.place[:, 1], main.heading))
    return np.stack([x - offset * np.sin(heading), y + offset * np.cos(heading)], axis=1)
