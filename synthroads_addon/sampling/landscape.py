"""The landscape of a sampled road: its relief and land use, and where villages and wind turbines are."""

from __future__ import annotations

import math

import numpy as np

from ..base.schema import round_value
from ..road.geometry import alignment_of
from ..road.surroundings import Landscape, Village, WindTurbine
from .placing.draw import draw, draw_between
from .placing.site import PlacementSite

_VILLAGE_DISTANCE, _TURBINE_DISTANCE = (450.0, 1500.0), (700.0, 2300.0)
"""Distances of a village's church and of a row of wind turbines beside the road, m."""
_HOUSES, _ROOM = (14.0, 60.0), (34.0, 42.0)
"""Houses of a village, and the distance from one to the next, m."""
_HUBS, _ROTORS = (85.0, 150.0), (0.75, 0.95)
"""Heights of hubs (m), and rotors' diameters as shares of them."""
_TURBINE_SPACING = 380.0  # m
_SHARE_OF_REACH = 0.75
_HIGHEST_SEED = 2**31


def sample_landscape(site: PlacementSite) -> Landscape:
    """Return the drawn landscape of a road; its instance number is 1."""
    limits, rng = site.scenario.landscape, site.stream("landscape")
    names = ("hill_height", "hill_length", "parcel_size", "forest_share", "meadow_share")
    values = {name: draw(rng, getattr(limits, name)) for name in names}
    return Landscape(
        instance=1,
        reach=limits.reach,
        seed=int(rng.integers(_HIGHEST_SEED)),
        villages=_villages(site, site.stream("landscape", "villages")),
        turbines=_turbines(site, site.stream("landscape", "turbines")),
        **values,
    )


def _villages(site: PlacementSite, rng: np.random.Generator) -> tuple[Village, ...]:
    """Return drawn villages, each with a radius that has room for its houses."""
    villages = []
    for _ in range(int(draw(rng, site.scenario.landscape.villages) + rng.random())):
        houses = int(draw_between(rng, _HOUSES))
        radius = round_value(0.5 * draw_between(rng, _ROOM) * math.sqrt(houses))
        x, y = _beside(site, rng, _VILLAGE_DISTANCE, radius)
        villages.append(Village(x=x, y=y, houses=houses, radius=radius))
    return tuple(villages)


def _turbines(site: PlacementSite, rng: np.random.Generator) -> tuple[WindTurbine, ...]:
    """Return wind turbines of one make in a row, all turned to one wind."""
    hub_height, wind_azimuth = draw_between(rng, _HUBS), draw_between(rng, (200.0, 300.0))
    rotor_diameter, row_direction = (
        round_value(hub_height * draw_between(rng, _ROTORS)),
        draw_between(rng, (0.0, math.pi)),
    )
    x, y = _beside(site, rng, _TURBINE_DISTANCE, 0.0)
    turbines = []
    for number in range(int(draw(rng, site.scenario.landscape.turbines) + rng.random())):
        lateral_shift = draw_between(rng, (-60.0, 60.0))
        place = (
            x + number * _TURBINE_SPACING * math.cos(row_direction),
            y + number * _TURBINE_SPACING * math.sin(row_direction) + lateral_shift,
        )
        turbine = WindTurbine(
            x=round_value(place[0]),
            y=round_value(place[1]),
            hub_height=hub_height,
            rotor_diameter=rotor_diameter,
            azimuth_deg=wind_azimuth,
            rotor_deg=draw_between(rng, (0.0, 120.0)),
        )
        turbines.append(turbine)
    return tuple(turbines)


def _beside(
    site: PlacementSite, rng: np.random.Generator, distances: tuple[float, float], room: float
) -> tuple[float, float]:
    """Return a drawn place, local x and y (m), beside the road's middle stretch, its distance within the reach."""
    alignment, reach = alignment_of(site.alignment), site.scenario.landscape.reach * _SHARE_OF_REACH
    station = np.array([site.length * draw_between(rng, (0.2, 1.0))])
    distance = min(draw_between(rng, distances), reach)
    side = 1.0 if rng.random() < 0.5 else -1.0
    offset = side * max(distance, site.terrain.half_width + room + 60.0)
    position, heading, _ = alignment.frame(station)
    ahead_distance = draw_between(rng, (0.0, 600.0))
    x = position[0, 0] - offset * math.sin(heading[0]) + ahead_distance * math.cos(heading[0])
    y = position[0, 1] + offset * math.cos(heading[0]) + ahead_distance * math.sin(heading[0])
    return round_value(float(x)), round_value(float(y))
