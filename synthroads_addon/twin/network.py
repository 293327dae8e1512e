"""Polygons of roads beside and above the main one: their pavements, verges and markings."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from ..road.geometry import RoadGeometry
from ..road.network.crossing import film
from ..road.network.grid import SurfaceGrid
from ..road.network.network import Network, network_of
from ..road.other_roads.parts import ConnectingRamp, CrossingRoad
from .faces import Faces, drop_unused_points, join_faces, quad_faces

PARTS = ("pavement", "verge", "paint")
"""Kinds of faces that a road of a network has."""


class NetworkRoad(NamedTuple):
    """A crossing road or a ramp: its id, what the set says of it, and its polygons by kind."""

    name: str
    item: CrossingRoad | ConnectingRamp
    faces: dict[str, Faces]


def network_roads(geometry: RoadGeometry) -> Iterator[NetworkRoad]:
    """Yield the crossing roads and the ramps of a road's network with their polygons."""
    network = network_of(geometry)
    for name, crossing in network.crossings.items():
        yield NetworkRoad(name, crossing.road, _grid_faces(crossing.grid))
    for name, joint in network.joints.items():
        yield NetworkRoad(name, joint.ramp, _ramp_faces(network, name))


def _grid_faces(grid: SurfaceGrid) -> dict[str, Faces]:
    """Return the polygons of a grid by kind."""
    points = grid.points.reshape(-1, 3)
    surfaces = {kind: quad_faces(points, grid.quads(kind)) for kind in PARTS[:2]}
    return {kind: drop_unused_points(faces) for kind, faces in surfaces.items()} | {
        "paint": drop_unused_points(quad_faces(film(points), grid.quads("paint")))
    }


def _ramp_faces(network: Network, name: str) -> dict[str, Faces]:
    """Return the polygons of a ramp by kind, those of its mouth among them."""
    joint = network.joints[name]
    crossing, mouth = network.crossings[joint.ramp.crossing_road], joint.surface.mouth
    parts = {kind: [faces] for kind, faces in _grid_faces(joint.surface.grid).items()}
    parts["verge"].append(quad_faces(network.stubs()[name], np.arange(4)[None]))
    for patch in crossing.patches(name):
        parts[patch.kind].append(quad_faces(patch.points.reshape(-1, 3), patch.quads(mouth.sign)))
    paint = crossing.mouth_paint(name).reshape(-1, 3)
    if len(paint):
        parts["paint"].append(quad_faces(paint, np.arange(len(paint)).reshape(-1, 4)))
    return {kind: drop_unused_points(join_faces(faces)) for kind, faces in parts.items()}
