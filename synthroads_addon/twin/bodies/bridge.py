"""Bodies of an overpass: its deck, piers and abutments."""

from __future__ import annotations

import numpy as np

from ...road.parameters import Overpass
from ...road.things import body_shapes as shapes
from ..faces import Faces, loft
from .at import Place, pavement_below

_PARAPET = 0.25
"""Thickness of the parapets' bodies, m."""


def bridge_bodies(place: Place, bridge: Overpass) -> dict[str, Faces]:
    """Return the closed bodies of an overpass by name.

    The deck is level, its underside `clearance` above the pavement's highest point below it. A skewed bridge is
    sheared: its faces stay parallel to the road, as its piers do.
    """
    shear = float(np.tan(np.deg2rad(bridge.rotation_deg)))
    left, right = bridge.offset - bridge.left_abutment, bridge.offset - bridge.right_abutment
    half = bridge.width / 2.0
    low = pavement_below(place, (left, right), (-half, half), shear) + bridge.clearance - float(place.origin[2])
    high = low + bridge.deck_thickness
    bodies = {"deck": _deck(place, bridge, (left - shapes.BRIDGE_SEAT, right + shapes.BRIDGE_SEAT), low, shear)}
    if bridge.parapet_height > 0.0:
        for name, side in (("parapet-1", -1.0), ("parapet-2", 1.0)):
            y = (half - _PARAPET, half) if side > 0.0 else (-half, _PARAPET - half)
            ends = (left - shapes.BRIDGE_SEAT, right + shapes.BRIDGE_SEAT)
            bodies[name] = _block(place, ends, y, (high, high + bridge.parapet_height), shear)
    top = low - shapes.BRIDGE_BEARING
    for number, offset in enumerate(bridge.pier_offsets, 1):
        bodies[f"pier-{number}"] = _pier(place, bridge, bridge.offset - offset, top, shear)
    for name, face, side in (("abutment-1", left, -1.0), ("abutment-2", right, 1.0)):
        foot = float(place.ground(face, np.array([half, -half]) + face * shear).min()) - shapes.BRIDGE_BURIED
        back = face + side * shapes.BRIDGE_ABUTMENT
        bodies[name] = _block(place, (min(face, back), max(face, back)), (-half, half), (foot, top), shear)
    return bodies


def _pier(place: Place, bridge: Overpass, x: float, top: float, shear: float) -> Faces:
    foot = float(place.ground(x, x * shear)[0]) - shapes.BRIDGE_BURIED
    long = max(bridge.width * shapes.BRIDGE_PIER_LENGTH, bridge.pier_width * 1.02)
    return place.box((bridge.pier_width, long, top - foot), (x, x * shear, (top + foot) / 2.0))


def _deck(place: Place, bridge: Overpass, ends: tuple[float, float], low: float, shear: float) -> Faces:
    half = np.array(shapes.BRIDGE_DECK) * (bridge.width / 2.0, bridge.deck_thickness)
    outline = np.concatenate([half, half[::-1] * (-1.0, 1.0)])
    sections = [
        np.column_stack([np.full(len(outline), x), outline[:, 0] + x * shear, outline[:, 1] + low]) for x in ends
    ]
    return loft(place.local(np.stack(sections)))


def _block(place: Place, x: tuple[float, float], y: tuple[float, float], z: tuple[float, float], shear: float) -> Faces:
    """Return the body between two x, two y and two z, sheared along y."""
    outline = [(u, v + u * shear) for u, v in ((x[0], y[0]), (x[1], y[0]), (x[1], y[1]), (x[0], y[1]))]
    return place.prism(outline, *z)
