"""Structures of the landscape: villages, wind turbines, and power lines beyond the terrain.

Dimensions (m) and shares without a name here are chosen.
"""

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
"""Distance between pylons, m; chosen."""
_GOLDEN_ANGLE = 2.399963
"""Angle between neighbours on a Fermat spiral that fills a disc evenly, rad: pi (3 - sqrt 5)."""
_HOUSES = (("house", 0.6), ("brick_house", 0.22), ("barn", 0.18))
"""Kinds of a village's buildings and their shares; chosen."""
_CHURCH = {"width": 22.0, "depth": 10.0, "height": 8.5, "roof_height": 7.0}
_TOWER = (6.0, 22.0, 13.0)
"""Side of a church's tower, its height, and that of its spire, m."""
_BLADE = ((0.0, 0.03, 0.03), (0.08, 0.032, 0.012), (0.2, 0.036, 0.01), (0.6, 0.02, 0.005), (0.97, 0.008, 0.002))
"""Sections of a blade from the hub outwards: distance, chord and thickness, as shares of the rotor's radius; chosen."""


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
    """Yield the bodies of a village: houses on a spiral around its church."""
    limits = np.cumsum([weight for _, weight in _HOUSES])
    for number in range(1, village.houses + 1):
        angle = _GOLDEN_ANGLE * number + rng.normal(0.0, 0.08)
        distance = village.radius * math.sqrt((number + 0.6) / (village.houses + 1.0))
        place = np.array([village.x + distance * math.cos(angle), village.y + distance * math.sin(angle)])
        kind = _HOUSES[int(np.searchsorted(limits, rng.random() * limits[-1]))][0]
        dimensions = (rng.uniform(9.0, 14.0), rng.uniform(8.0, 10.5), rng.uniform(3.4, 6.0), rng.uniform(3.0, 4.8))
        house = Building(instance=1, station=0.0, offset=0.0, kind=kind, **dict(zip(_CHURCH, dimensions, strict=True)))
        yield from _stand(house, place, angle + rng.normal(0.0, 0.15) + math.pi / 2.0 * int(rng.integers(2)), relief)
    church = Building(instance=1, station=0.0, offset=0.0, kind="house", **_CHURCH)
    centre, angle = np.array([village.x, village.y]), rng.uniform(0.0, math.pi)
    yield from _stand(church, centre, angle, relief)
    tower_side, tower_height, spire_height = _TOWER
    tower_offset = np.array([math.cos(angle), math.sin(angle)]) * (_CHURCH["width"] + tower_side) / 2.0
    foot = np.append(centre + tower_offset, relief.elevation((centre + tower_offset)[None])[0])
    walls = box((tower_side, tower_side, tower_height + 1.0), (0.0, 0.0, tower_height / 2.0 - 0.5))
    roof = prism(
        np.array(circle(tower_side * 1.5, 4)) @ _row_rotation(math.pi / 4.0), tower_height, tower_height + spire_height
    )
    roof[1, :, :2] *= 0.02
    for shape, name in ((walls, "plaster"), (roof, "roof_tiles")):
        yield Body(rotate_z(shape, angle) + foot, name)


def _row_rotation(angle: float) -> Float:
    """Return the matrix (2, 2) that rotates row vectors by an angle (rad), anticlockwise."""
    return np.array([(math.cos(angle), math.sin(angle)), (-math.sin(angle), math.cos(angle))])


def _stand(item: Building, place: Float, angle: float, relief: LandRelief) -> Iterator[Body]:
    """Yield the bodies of a building at a place (2,), turned about the vertical (rad), on the land."""
    z = float(relief.elevation(place[None])[0])

    def ground(x: ArrayLike, y: ArrayLike) -> Float:
        """Return the land's elevation (N,) at places in the building's frame, relative to the building's foot, m."""
        local_points = np.stack(np.broadcast_arrays(x, y), axis=-1).astype(np.float64).reshape(-1, 2)
        return relief.elevation(place + local_points @ _row_rotation(angle)) - z

    for body in item.bodies(Place(ground, lambda x, y, shear: 0.0, 1.5)):
        yield Body(rotate_z(body.sections, angle) + np.append(place, z), body.material)


def _turbine(turbine: WindTurbine, relief: LandRelief) -> Iterator[Body]:
    """Yield the bodies of a wind turbine: tower, nacelle, nose and blades."""
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
    """Return the sections (R, 4, 3), m, of a blade in the plane y = 0, rotated from upright by an angle (rad)."""
    sections = [
        [
            (x * chord * radius, y * thickness * radius, distance * radius)
            for x, y in ((-0.7, 0), (0, -0.5), (0.3, 0), (0, 0.5))
        ]
        for distance, chord, thickness in _BLADE
    ]
    shape = rotate_z(np.array(sections), math.pi / 2.0)  # rotate_x then rotates in the rotor's plane
    return rotate_z(rotate_x(shape, angle), -math.pi / 2.0)


def _lines(geometry: RoadGeometry, relief: LandRelief) -> Iterator[Body]:
    """Yield the pylons and conductors of power lines from the road's outermost pylons to the landscape's end."""
    items = list(geometry.parameters.of_type(PowerLine).values())
    for item, frame in zip(items, standing_frames(geometry, items), strict=True):
        for end_pylon, direction in zip(item.pylons(), (-1.0, 1.0), strict=True):
            x = end_pylon + direction * _SPAN * np.arange(int(relief.landscape.reach / _SPAN) + 1)
            plan = frame.to_local(np.column_stack([x, np.zeros((len(x), 2))]))[:, :2]
            z = relief.elevation(plan) - frame.origin[2]
            feet = np.column_stack([x, np.zeros(len(x)), z])
            bodies = [body for foot in feet[1:] for body in item.pylon(foot)]
            for start, end in itertools.pairwise(feet):
                bodies += item.conductors(start, end)
            yield from (Body(frame.to_local(body.sections), body.material) for body in bodies)
