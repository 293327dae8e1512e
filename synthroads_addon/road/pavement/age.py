"""How bright a pavement is at an age: asphalt bleaches as its binder wears off, concrete darkens by rubber and dirt.

Both as measured on pavements in use (National Center for Asphalt Technology & National Concrete Pavement Technology
Center 2019, Quantifying Pavement Albedo; asphalt's first years: Sen & Roesler 2016, Journal of Cleaner Production 117).
"""

import math

from ..section import Pavement
from ..section_geometry import CarriagewaySection
from .field import ASPHALT_OF_AGE, FILM_LASTS
from .places import strip_lanes

_CONCRETE_OF_AGE = (1.08, 0.88)
"""Factor on new and on old concrete."""


def asphalt_brightness(age: float) -> float:
    """Return a factor on asphalt's base colour and specular at an age, 0 new, 1 old."""
    film_factor, bare_factor, old_factor = ASPHALT_OF_AGE
    return bare_factor + (film_factor - bare_factor) * math.exp(-age / FILM_LASTS) + (old_factor - bare_factor) * age


def concrete_brightness(age: float) -> float:
    """Return a factor on concrete's base colour and specular at an age, 0 new, 1 old."""
    new_factor, old_factor = _CONCRETE_OF_AGE
    return new_factor + (old_factor - new_factor) * age


def age_contrast(pavement: Pavement, age: float | None, road_age: float) -> float:
    """Return by how much a strip of a pavement is brighter than one of the road's age, as a share.

    Args:
        pavement: the carriageway's.
        age: the strip's; None for the road's.
        road_age: 0 new, 1 old.
    """
    if age is None:
        return 0.0
    brightness = concrete_brightness if pavement.is_concrete else asphalt_brightness
    return brightness(age) / brightness(road_age) - 1.0


def lane_contrasts(pavement: Pavement, lanes: int, road_age: float) -> list[float]:
    """Return `age_contrast` of each of a carriageway's lanes, from outside."""
    ages = [*pavement.lane_ages, *[None] * lanes][:lanes]
    return [age_contrast(pavement, age, road_age) for age in ages]


def strip_contrasts(section: CarriagewaySection, road_age: float) -> list[float]:
    """Return `age_contrast` of each strip of a carriageway, innermost first; edge strips have their lane's."""
    carriageway = section.carriageway
    pavement, lanes = carriageway.pavement, len(carriageway.lanes)
    contrasts_of_lanes = lane_contrasts(pavement, lanes, road_age)
    shoulder_contrast = age_contrast(pavement, pavement.shoulder_age, road_age)
    first_lane = section.kinds.index("lane")
    contrasts = []
    for number, (_, lane) in enumerate(strip_lanes(section.kinds, lanes)):
        if section.kinds[lane] == "lane":
            contrasts.append(contrasts_of_lanes[lanes - 1 - (lane - first_lane)])
        else:
            contrasts.append(shoulder_contrast if section.kinds[number] == "hard_shoulder" else 0.0)
    return contrasts
