"""Things that were hit: rails with dents, things that lean, panels that are missing; their shape and their bodies."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...base.arrays import Float
from ...base.schema import Model, quantity
from .body import Body

DENT_ROWS = 16
"""Sections along a dent: a chord of cos^2 over a sixteenth of its length is off by depth * (pi / 16)^2 / 4 at most,
5 mm in a dent of 0.5 m."""


class Dent(Model):
    """A place at which a rail is bent sideways by depth * cos^2(pi * x / length)."""

    station: float = quantity(ge=0, unit="m", description="Station of its middle.")
    length: float = quantity(4.0, ge=0.5, le=40, unit="m", description="Length that is bent.")
    depth: float = quantity(ge=-2, le=2, unit="m", description="How far it is bent; positive to the left.")


def dent_offsets(dents: Sequence[Dent], station: Float) -> Float:
    """Return how far (N,), m, dents move a rail to the left at stations (N,)."""
    result = np.zeros(np.shape(station))
    for dent in dents:
        share = np.minimum(np.abs(station - dent.station) / dent.length, 0.5)
        result += dent.depth * np.cos(np.pi * share) ** 2
    return result


def dent_stations(dents: Sequence[Dent], start: float, end: float) -> list[float]:
    """Return the stations (m) between a start and an end at which a dented rail needs sections."""
    places = [dent.station + dent.length * np.linspace(-0.5, 0.5, DENT_ROWS + 1) for dent in dents]
    return [float(place) for place in np.concatenate([*places, np.empty(0)]) if start < place < end]


def lean_matrix(angle: float, direction: tuple[float, float]) -> NDArray[np.float64]:
    """Return the rotation (3, 3) that leans what is upright by an angle (rad) towards a unit vector in plan."""
    # Rodrigues' rotation about the level axis to the left of the direction.
    axis = np.array([-direction[1], direction[0], 0.0])
    cross = np.array([(0.0, -axis[2], axis[1]), (axis[2], 0.0, -axis[0]), (-axis[1], axis[0], 0.0)])
    return np.asarray(np.eye(3) + math.sin(angle) * cross + (1.0 - math.cos(angle)) * (cross @ cross))


def lean_bodies(bodies: list[Body], lean_deg: float | None, direction_deg: float | None) -> list[Body]:
    """Return a standing thing's bodies in its frame, leaning about its foot.

    Args:
        bodies: of the upright thing, x to the right and y ahead.
        lean_deg: angle from the vertical; the bodies stay as they are without one.
        direction_deg: where to, counter-clockwise from ahead; ahead if not given.
    """
    if not lean_deg:
        return bodies
    turn = math.radians(direction_deg or 0.0)
    rotation = lean_matrix(math.radians(lean_deg), (-math.sin(turn), math.cos(turn)))
    return [replace(body, sections=body.sections @ rotation.T) for body in bodies]
