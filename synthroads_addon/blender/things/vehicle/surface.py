"""Surfaces of vehicles: writing on number plates, and the places that seams and dirt follow."""

from __future__ import annotations

import math

from ....base.random_streams import stream
from ....road.things.vehicles import CHASSIS
from ...materials.looks import VEHICLE_BASE, VEHICLE_PLACE, VEHICLE_SEAMS
from ...nodes import operations as op
from ...nodes.builder import Tree, Value
from ...nodes.solids import move_geometry, paint_faces
from ..sign.writing import sign_writing_group
from .models import plates_of

_DISTRICTS = ("AC", "BN", "D", "DO", "E", "HH", "K", "KS", "M", "MS", "OL", "S", "WI", "WÜ")
_LETTERS = "ABCDEFGHJKLMNPRSTUVWXYZ"
_RAISED = 0.001
"""Height of the letters above a plate, m."""
_NARROW = 0.3
"""Width of a plate, m, below which there is room for a short registration alone."""
_BORDER = 0.1
"""Part of a plate on either side that its writing leaves free."""
_DOORS = {"car": (-0.62, 0.42), "estate": (-0.62, 0.42), "van": (-0.75, 0.0)}
"""Model with doors -> the front door's front edge against the front axle, the rear one's rear edge against the rear."""


def registration(seed: int, name: str, model: str) -> str:
    """Return a made-up registration number of a vehicle of a road, by its name; a short one where its plate is narrow.

    On a motorcycle's plate longer ones would be too small to be read, and aren't written at all.
    """
    rng = stream(seed, "registration", name)
    narrow = any(width < _NARROW for _, (width, _, _) in plates_of(model))
    letters = "".join(_LETTERS[i] for i in rng.integers(len(_LETTERS), size=1 if narrow else int(rng.integers(1, 3))))
    number = int(rng.integers(10, 100 if narrow else 10_000))
    return f"{_DISTRICTS[int(rng.integers(len(_DISTRICTS)))]} {letters} {number}"


def write_plates(tree: Tree, model: str, text: Value, material: Value) -> Value:
    """Add nodes for the writing on a model's number plates; return its mesh."""
    parts = []
    for (x, y, z), (width, depth, height) in plates_of(model):
        half, high = width * (0.5 - _BORDER), height * 0.42
        low, top = op.vector(tree, -half, -high), op.vector(tree, half, high)
        written = tree.call(sign_writing_group(), line_1=text, low_corner=low, high_corner=top).value
        ahead = 1.0 if y > 0.0 else -1.0
        turn = (math.pi / 2.0, 0.0, math.pi if ahead > 0.0 else 0.0)
        written = op.transform(written, rotation=turn)
        parts.append(move_geometry(written, (x, y + ahead * (depth / 2.0 + _RAISED), z)))
    return paint_faces(op.join(*parts), material)


def mark_places(vehicle: Value, model: str) -> Value:
    """Add nodes that tell the points of a vehicle where they are on it, and where its doors have seams; return it."""
    tree, chassis = vehicle.tree, CHASSIS[model]
    place = op.position(tree) + (0.0, 0.0, VEHICLE_BASE)
    seams = (0.0, 0.0, 0.0)
    if model in _DOORS:
        front, rear = _DOORS[model]
        first, last = chassis.front + front, chassis.rear + rear
        seams = (first, (first + last) / 2.0 - 0.05, last)
    vehicle = op.store(vehicle, VEHICLE_PLACE, place)
    return op.store(vehicle, VEHICLE_SEAMS, op.vector(tree, *seams))
