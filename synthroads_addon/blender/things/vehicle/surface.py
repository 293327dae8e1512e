"""Surfaces of vehicles: writing on number plates, and attributes for seams and dirt."""

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
"""Height of the letters above a plate, m; chosen."""
_NARROW = 0.3
"""Width of a plate, m, below which only a short registration fits; chosen."""
_BORDER = 0.1
"""Share of a plate's width on either side without writing; chosen."""
_DOORS = {"car": (-0.62, 0.42), "estate": (-0.62, 0.42), "van": (-0.75, 0.0)}
"""Doors by model: distances (m) of the front door's front edge from the front axle, and of the rear door's rear edge
from the rear axle, positive to the front."""


def registration(seed: int, name: str, model: str) -> str:
    """Return an invented registration number of a road's vehicle, by its name; a short one if its plate is narrow.

    On a motorcycle's plate longer numbers would be too small to be read, and wouldn't be written at all.
    """
    rng = stream(seed, "registration", name)
    is_narrow = any(width < _NARROW for _, (width, _, _) in plates_of(model))
    letters = "".join(
        _LETTERS[i] for i in rng.integers(len(_LETTERS), size=1 if is_narrow else int(rng.integers(1, 3)))
    )
    number = int(rng.integers(10, 100 if is_narrow else 10_000))
    return f"{_DISTRICTS[int(rng.integers(len(_DISTRICTS)))]} {letters} {number}"


def write_plates(tree: Tree, model: str, text: Value, material: Value) -> Value:
    """Add nodes for the writing on a model's number plates; return its mesh."""
    parts = []
    for (x, y, z), (width, depth, height) in plates_of(model):
        half_width, half_height = width * (0.5 - _BORDER), height * 0.42
        low_corner, high_corner = op.vector(tree, -half_width, -half_height), op.vector(tree, half_width, half_height)
        writing = tree.call(sign_writing_group(), line_1=text, low_corner=low_corner, high_corner=high_corner).value
        direction = 1.0 if y > 0.0 else -1.0
        rotation = (math.pi / 2.0, 0.0, math.pi if direction > 0.0 else 0.0)
        writing = op.transform(writing, rotation=rotation)
        parts.append(move_geometry(writing, (x, y + direction * (depth / 2.0 + _RAISED), z)))
    return paint_faces(op.join(*parts), material)


def mark_places(vehicle: Value, model: str) -> Value:
    """Add nodes that store each point's place on a vehicle, and the positions of its doors' seams; return it."""
    tree, chassis = vehicle.tree, CHASSIS[model]
    place = op.position(tree) + (0.0, 0.0, VEHICLE_BASE)
    seams = (0.0, 0.0, 0.0)
    if model in _DOORS:
        front_edge, rear_edge = _DOORS[model]
        first_seam, last_seam = chassis.front + front_edge, chassis.rear + rear_edge
        seams = (first_seam, (first_seam + last_seam) / 2.0 - 0.05, last_seam)
    vehicle = op.store(vehicle, VEHICLE_PLACE, place)
    return op.store(vehicle, VEHICLE_SEAMS, op.vector(tree, *seams))
