"""The parts of a model, in the order in which they are built: each a function that adds its objects."""

from __future__ import annotations

from collections.abc import Callable

from ..things.asset import build_assets
from ..things.beacon import build_beacons
from ..things.cabinet import build_cabinets
from ..things.concrete_barrier import build_concrete_barriers
from ..things.delineator import build_delineators
from ..things.gantry.gantry import build_gantries
from ..things.guardrail import build_guardrails
from ..things.kilometre_board import build_kilometre_boards
from ..things.model_builder import ModelBuilder
from ..things.noise_barrier import build_noise_barriers
from ..things.overpass.overpass import build_overpasses
from ..things.painted_area import build_painted_areas
from ..things.pole import build_poles
from ..things.road.build import build_surface
from ..things.sign.sign import build_signs
from ..things.temporary_barrier import build_temporary_barriers
from ..things.terrain import build_terrain
from ..things.traffic_light import build_traffic_lights
from ..things.vegetation.build import build_vegetation
from ..things.vehicle.vehicle import build_vehicles

PARTS: dict[str, Callable[[ModelBuilder], None]] = {
    "road": build_surface,
    "terrain": build_terrain,
    "painted_areas": build_painted_areas,
    "guardrails": build_guardrails,
    "concrete_barriers": build_concrete_barriers,
    "noise_barriers": build_noise_barriers,
    "temporary_barriers": build_temporary_barriers,
    "beacons": build_beacons,
    "gantries": build_gantries,
    "overpasses": build_overpasses,
    "signs": build_signs,
    "kilometre_boards": build_kilometre_boards,
    "poles": build_poles,
    "traffic_lights": build_traffic_lights,
    "cabinets": build_cabinets,
    "delineators": build_delineators,
    "assets": build_assets,
    "vehicles": build_vehicles,
    "vegetation": build_vegetation,
}
ON_THE_ROAD = ("painted_areas", "guardrails", "delineators", "assets")
"""Parts that need no terrain: all others stand on it."""


def required_parts(wanted: set[str]) -> set[str]:
    """Return the parts that must be there for those wanted: what they stand on, too."""
    surfaces = {"road"} if wanted else set()
    return wanted | surfaces | ({"terrain"} if wanted - {"road", *ON_THE_ROAD} else set())
