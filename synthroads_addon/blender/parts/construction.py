"""Beacons of construction zones."""

from __future__ import annotations

import math

import numpy as np

from ...road.parameters import ConstructionBeacon
from ..materials import material
from ..things.beacon import beacon_group
from ..things.model_builder import ModelBuilder


def build_beacons(builder: ModelBuilder) -> None:
    """Make all beacons as one object."""
    beacons = list(builder.parameters.of_type(ConstructionBeacon).values())
    if not beacons:
        return
    inputs = {
        **builder.surfaces(),
        "Red Material": material("sheeting_red"),
        "White Material": material("sheeting_white"),
        "Rubber Material": material("rubber"),
        "Housing Material": material("plastic_black"),
        "Lens Material": material("lamp_yellow"),
    }
    attributes = {
        "width": np.array([beacon.width for beacon in beacons]),
        "height": np.array([beacon.height for beacon in beacons]),
        "pass_side": np.array([_own_side(beacon) for beacon in beacons]),
    }
    builder.add("Beacons", builder.points("Beacons", beacons, attributes), beacon_group(), inputs)


def _own_side(beacon: ConstructionBeacon) -> int:
    """Return +1 where traffic passes a beacon on its own left, -1 on its right: one turned round has them swapped."""
    with_stations = math.cos(math.radians(beacon.rotation_deg)) > 0.0
    return 1 if (beacon.pass_side == "left") == with_stations else -1
