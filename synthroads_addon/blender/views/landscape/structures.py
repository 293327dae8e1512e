"""Structures of the landscape: villages, wind turbines, and power lines that go on across the land."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator

import bpy
import numpy as np
from numpy.typing import ArrayLike

from ....base.arrays import Float
from ....base.random_streams import stream
from ....road.geometry import RoadGeometry
from ....road.landscape.relief import LandRelief
from ....road.surroundings import Landscape, Village, WindTurbine
from ....road.things.body import Body, Place, box, circle, prism, rotate_x, rotate_z
from ....road.things.building import Building
from ....road.things.power_line import PowerLine
from ....twin.things import standing_frames
from ...things.solid import bodies_mesh

_SPAN = 290.0
"""Distance between pylons, m."""
_HOUSES = (("house", 0.6), ("brick_house", 0.22), ("barn", 0.18))
_CHURCH = {"width": 22.0, "depth": 10.0, "height": 8.5, "roof_height": 7.0}
_TOWER = (6.0, 22.0, 13.0)
"""Side of a church's tower, its height, and that of its spire, m."""
_BLADE = ((0.0, 0.03, 0.03), (0.08, 0.032, 0.012), (0.2, 0.036, 0.01), (0.6, 0.02, 0.005), (0.97, 0.008, 0.002))
"""A blade from the hub out: distance, chord and thickness, as shares of the rotor's radius."""


def structures_mesh(
    geometry: RoadGeometry, landscape: Landscape, relief: LandRelief, material: Callable[[str], bpy.types.Material]
) -> bpy.types.Mesh:
    """Create one mesh of all that stands in the landscape, in local coordinates."""
    bodies = list(_lines(geometry, relief))
    for number, village in enumerate(landscape.villages):
        bodies += _village(village, relief, stream(landscape.seed, "landscape", "village", number))
    for turbine in landscape.turbines:
        bodies += _turbine(turbine, relief)
    return bodies_mesh(bodies, material) if bodies else bpy.data.meshes.new("SR Landscape Structures")


def _village(village: Village, relief: LandRelief, rng: np.random.Generator) -> Iterator[Body]:
    """Yield the houses of a village, on a spiral around its church."""
    limits = np.cumsum([weight for _, weight in _HOUSES])
    for number in range(1, village.houses + 1):
        turn = 2.399963 * number + rng.normal(0.0, 0.08)
        away = village.radius * math.sqrt((number + 0.6) / (village.houses + 1.0))
        place = np.array([village.x + away * math.cos(turn), village.y + away * math.sin(turn)])
        kind = _HOUSES[int(np.searchsorted(limits, rng.random() * limits[-1]))][0]
        size = (rng.uniform(9.0, 14.0), rng.uniform(8.0, 10.5), rng.uniform(3.4, 6.0), rng.uniform(3.0, 4.8))
        house = Building(instance=1, station=0.0, offset=0.0, kind=kind, **dict(zip(_CHURCH, size, strict=True)))
        yield from _stand(house, place, turn + rng.normal(0.0, 0.15) + math.pi / 2.0 * int(rng.integers(2)), relief)
    church = Building(instance=1, station=0.0, offset=0.0, kind="house", **_CHURCH)
    middle, turn = np.array([village.x, village.y]), rng.uniform(0.0, math.pi)
    yield from _stand(church, middle, turn, relief)
    side, tall, spire = _TOWER
    beside = np.array([math.cos(turn), math.sin(turn)]) * (_CHURCH["width"] + side) / 2.0
    foot = np.append(middle + beside, relief.elevation((middle + beside)[None])[0])
    walls = box((side, side, tall + 1.0), (0.0, 0.0, tall / 2.0 - 0.5))
    roof = prism(np.array(circle(side * 1.5, 4)) @ _turn(math.pi / 4.0), tall, tall + spire)
    roof[1, :, :2] *= 0.02
    for shape, name in ((walls, "plaster"), (roof, "roof_tiles")):
        yield Body(rotate_z(shape, turn) + foot, name)


def _turn(angle: float) -> Float:
    return np.array([(math.cos(angle), math.sin(angle)), (-math.sin(angle), math.cos(angle))])


def _stand(item: Building, place: Float, turn: float, relief: LandRelief) -> Iterator[Body]:
    """Yield the bodies of a building at a place (2,), turned about the vertical (rad), on the land."""
    z = float(relief.elevation(place[None])[0])

    def ground(x: ArrayLike, y: ArrayLike) -> Float:
        around = np.stack(np.broadcast_arrays(x, y), axis=-1).astype(np.float64).reshape(-1, 2) @ _turn(turn)
        return relief.elevation(place + around) - z

    for body in item.bodies(Place(ground, lambda x, y, shear: 0.0, 1.5)):
        yield Body(rotate_z(body.sections, turn) + np.append(place, z), body.material)


def _turbine(turbine: WindTurbine, relief: LandRelief) -> Iterator[Body]:
    """Yield tower, nacelle and blades of a wind turbine."""
    plan = np.array([turbine.x, turbine.y])
    foot = np.append(plan, relief.elevation(plan[None])[0])
    hub, radius = turbine.hub_height, turbine.rotor_diameter / 2.0
    tower = prism(circle(0.036 * hub, 20), -1.0, hub)
    tower[1, :, :2] *= 0.55
    nacelle = box((0.035 * hub, 0.1 * hub, 0.035 * hub), (0.0, -0.01 * hub, hub + 0.01 * hub))
    nose = box((0.028 * hub, 0.03 * hub, 0.028 * hub), (0.0, 0.05 * hub, hub + 0.01 * hub))
    blades = [_blade(radius, math.radians(turbine.rotor_deg + 120.0 * number)) for number in range(3)]
    blades = [shape + (0.0, 0.05 * hub, hub + 0.01 * hub) for shape in blades]
    heading = -math.radians(turbine.azimuth_deg)  # +y is north
    for shape in (tower, nacelle, nose, *blades):
        yield Body(rotate_z(shape, heading) + foot, "plastic_white")


def _blade(radius: float, angle: float) -> Float:
    """Return the sections (R, 4, 3) of a blade in the plane y = 0, turned about y from upright."""
    rows = [
        [(x * chord * radius, y * thick * radius, away * radius) for x, y in ((-0.7, 0), (0, -0.5), (0.3, 0), (0, 0.5))]
        for away, chord, thick in _BLADE
    ]
    shape = rotate_z(np.array(rows), math.pi / 2.0)  # so that a turn about x turns the rotor
    return rotate_z(rotate_x(shape, angle), -math.pi / 2.0)


def _lines(geometry: RoadGeometry, relief: LandRelief) -> Iterator[Body]:
    """Yield the pylons and conductors beyond those that stand beside the road, to the landscape's end."""
    items = list(geometry.parameters.of_type(PowerLine).values())
    for item, frame in zip(items, standing_frames(geometry, items), strict=True):
        for first, way in zip(item.pylons(), (-1.0, 1.0), strict=True):
            x = first + way * _SPAN * np.arange(int(relief.landscape.reach / _SPAN) + 1)
            plan = frame.to_local(np.column_stack([x, np.zeros((len(x), 2))]))[:, :2]
            z = relief.elevation(plan) - frame.origin[2]
            feet = np.column_stack([x, np.zeros(len(x)), z])
            made = [body for foot in feet[1:] for body in item.pylon(foot)]
            for start, end in itertools.pairwise(feet):
                made += item.conductors(start, end)
            yield from (Body(frame.to_local(body.sections), body.material) for body in made)
