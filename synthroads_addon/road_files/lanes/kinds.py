"""Which thing of a road an object of another program is: a table of words in its type, subtype and name."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from ...road.objects import RoadObject
from ...road.things.beacon import ConstructionBeacon
from ...road.things.building import Building
from ...road.things.cabinet import Cabinet
from ...road.things.concrete_barrier import ConcreteBarrier
from ...road.things.delineator import Delineator
from ...road.things.fence import Fence
from ...road.things.gantry import Gantry
from ...road.things.guardrail import Guardrail
from ...road.things.hedge import Hedge
from ...road.things.noise_barrier import NoiseBarrier
from ...road.things.pole import Pole
from ...road.things.shaft import Shaft
from ...road.things.traffic_light import TrafficLight
from ...road.things.wall import Wall

if TYPE_CHECKING:
    from .objects import Stretch

_TOLD = 1e-3
"""Distance, m, from which a size that is limited is told."""


class Size:
    """Sizes that a file gives an object, and how far the thing's own are from them where it can't have them.

    Attributes:
        limited: the largest distance of a size that was limited, m, by its name.
    """

    def __init__(self, given: Mapping[str, float]) -> None:
        self._given = given
        self.limited: dict[str, float] = {}

    def __getitem__(self, name: str) -> float:
        return self._given[name]

    def within(self, name: str, lowest: float, highest: float, usual: float) -> float:
        """Return the file's size of a name (m), clipped to limits and noted if it was; the usual one if it is 0."""
        return self.fit(name, self._given[name], lowest, highest, usual)

    def fit(self, name: str, value: float, lowest: float, highest: float, usual: float) -> float:
        """Return a value (m), clipped to limits and noted under a name if it was; the usual one if it is 0 or less."""
        if not value > 0.0:
            return usual
        fitted_value = min(max(value, lowest), highest)
        if abs(fitted_value - value) > _TOLD:
            self.limited[name] = max(abs(fitted_value - value), self.limited.get(name, 0.0))
        return fitted_value


Along = Callable[["Stretch", Size], RoadObject]
Standing = Callable[[dict[str, Any], Size], RoadObject]


class Maker(NamedTuple):
    """The thing that an object becomes.

    Attributes:
        name: for people.
        along, standing: makes the thing; none of both where it has none.
        why: why it has none.
        approximated: what of it isn't as in the file.
    """

    name: str = ""
    along: Along | None = None
    standing: Standing | None = None
    why: str = ""
    approximated: str = ""


# Makers of things. Limits of sizes (m) are those of the things' fields; sizes for objects without any are chosen.


def _stretch(stretch: Stretch) -> dict[str, Any]:
    """Return the fields that all things along the road have."""
    return {
        "instance": 1,
        "start_station": stretch.start,
        "end_station": stretch.end,
        "offset": stretch.offset,
    }


def _guardrail(stretch: Stretch, size: Size) -> RoadObject:
    """Return a guardrail along a stretch, its face towards the road."""
    height = size.within("height", 0.3, 1.5, 0.75)
    return Guardrail(**_stretch(stretch), faces="left" if stretch.offset < 0.0 else "right", height=height)


def _concrete_barrier(stretch: Stretch, size: Size) -> RoadObject:
    """Return a concrete barrier along a stretch."""
    foot_width = size.within("width", 0.3, 1.2, 0.54)
    return ConcreteBarrier(**_stretch(stretch), height=size.within("height", 0.4, 2.0, 0.9), base_width=foot_width)


def _noise_barrier(stretch: Stretch, size: Size) -> RoadObject:
    """Return a noise barrier along a stretch."""
    return NoiseBarrier(**_stretch(stretch), height=size.within("height", 1.0, 12.0, 4.0))


def _fence(stretch: Stretch, size: Size) -> RoadObject:
    """Return a fence along a stretch."""
    return Fence(**_stretch(stretch), height=size.within("height", 0.5, 4.0, 1.8))


def _wall(stretch: Stretch, size: Size) -> RoadObject:
    """Return a wall along a stretch."""
    wall_thickness = size.within("width", 0.08, 1.0, 0.24)
    return Wall(**_stretch(stretch), height=size.within("height", 0.3, 6.0, 1.8), thickness=wall_thickness)


def _hedge(stretch: Stretch, size: Size) -> RoadObject:
    """Return a hedge along a stretch."""
    hedge_width = size.within("width", 0.3, 5.0, 1.2)
    return Hedge(**_stretch(stretch), height=size.within("height", 0.3, 8.0, 1.8), width=hedge_width)


def _delineator(place: dict[str, Any], size: Size) -> RoadObject:
    """Return a delineator at a place."""
    return Delineator(**place, height=size.within("height", 0.3, 1.5, 1.0))


def _lamp(place: dict[str, Any], size: Size) -> RoadObject:
    """Return a lighting pole at a place."""
    return Pole(**place, kind="lighting", height=size.within("height", 2.0, 30.0, 12.0))


def _pole(place: dict[str, Any], size: Size) -> RoadObject:
    """Return a pole without an arm at a place."""
    pole_diameter = size.fit("width", 2.0 * size["radius"] or size["width"], 0.05, 0.6, 0.2)
    return Pole(**place, height=size.within("height", 2.0, 30.0, 6.0), diameter=pole_diameter, arm_length=0.0)


def _beacon(place: dict[str, Any], size: Size) -> RoadObject:
    """Return a construction beacon at a place, passed on the side of the line."""
    beacon_width = size.fit("width", size["width"] or 2.0 * size["radius"], 0.1, 0.6, 0.25)
    beacon_height = size.within("height", 0.5, 2.0, 1.0)
    return ConstructionBeacon(
        **place, pass_side="left" if place["offset"] < 0.0 else "right", width=beacon_width, height=beacon_height
    )


def _building(place: dict[str, Any], size: Size) -> RoadObject:
    """Return a building in the form of a box at a place."""
    building_width, building_depth = size.within("length", 2.0, 80.0, 11.0), size.within("width", 2.0, 60.0, 9.0)
    building_height = size.within("height", 2.0, 30.0, 5.6)
    return Building(
        **place, kind="hall", width=building_width, depth=building_depth, height=building_height, roof_height=0.0
    )


def _gantry(place: dict[str, Any], size: Size) -> RoadObject:
    """Return a gantry over its width at a place, with a leg at each end."""
    half_width, middle = 0.5 * size.within("width", 4.0, 80.0, 20.0), place["offset"]
    return Gantry(**place, kind="two_sided", left_offset=middle + half_width, right_offset=middle - half_width)


def _cabinet(place: dict[str, Any], size: Size) -> RoadObject:
    """Return a utility cabinet at a place."""
    return Cabinet(**place, kind="utility", **_box(size, 0.8, 0.4))


def _phone(place: dict[str, Any], size: Size) -> RoadObject:
    """Return an emergency phone at a place."""
    return Cabinet(**place, kind="emergency_phone", **_box(size, 0.3, 0.3))


def _box(size: Size, width: float, depth: float) -> dict[str, float]:
    """Return width, depth and height of a cabinet, m; `width` and `depth` hold where the file has none."""
    box_width, box_depth = size.within("length", 0.1, 3.0, width), size.within("width", 0.1, 3.0, depth)
    usual_height = float(Cabinet.model_fields["height"].default)
    return {"width": box_width, "depth": box_depth, "height": size.within("height", 0.4, 3.0, usual_height)}


def _shaft(place: dict[str, Any], size: Size) -> RoadObject:
    """Return a shaft at a place: a manhole where the file gives a radius, else an inlet."""
    kind: Literal["inlet", "manhole"] = "manhole" if size["radius"] > 0.0 else "inlet"
    return Shaft(**place, kind=kind, size=size.fit("width", 2.0 * size["radius"] or size["width"], 0.3, 1.5, 0.6))


def _light(place: dict[str, Any], size: Size) -> RoadObject:
    """Return a traffic light at a place."""
    return TrafficLight(**place, height=size.within("height", 1.5, 8.0, 3.2))


_TABLE: tuple[tuple[str, Maker], ...] = (
    (r"rail[-_ ]?pole|railing[-_ ]?pole|guard[-_ ]?rail[-_ ]?post", Maker(why="posts are their guardrail's")),
    (r"guard[-_ ]?rail|crash[-_ ]?barrier|railing|leitplanke", Maker("guardrail", along=_guardrail)),
    (r"sound[-_ ]?barrier|noise", Maker("noise barrier", along=_noise_barrier)),
    (r"jersey|concrete|beton", Maker("concrete barrier", along=_concrete_barrier)),
    (r"hedge|hecke", Maker("hedge", along=_hedge)),
    (r"fence|zaun", Maker("fence", along=_fence)),
    (r"\bwall|mauer", Maker("wall", along=_wall)),
    (r"guide[-_ ]?post|delineator|reflector|leitpfosten", Maker("delineator", standing=_delineator)),
    (r"gantry", Maker("gantry", standing=_gantry, approximated="a gantry has two legs at the ends of its width")),
    (
        r"cone|barrel|beacon|\bbake|drum",
        Maker("beacon", standing=_beacon, approximated="cones and barrels are beacons"),
    ),
    (r"street[-_ ]?lamp|lamp|street[-_ ]?light|lighting|luminaire", Maker("lighting pole", standing=_lamp)),
    (r"traffic[-_ ]?light", Maker("traffic light", standing=_light)),
    (r"emergency[-_ ]?(phone|call)|notruf", Maker("emergency phone", standing=_phone)),
    (r"cabinet|utility", Maker("cabinet", standing=_cabinet)),
    (r"manhole|shaft|gully", Maker("shaft", standing=_shaft)),
    (r"building|house|haus\b", Maker("building", standing=_building, approximated="a building is a box of its size")),
    (r"\bbarrier", Maker("concrete barrier", along=_concrete_barrier, approximated="a barrier is one of concrete")),
    (r"sign", Maker(why="posts and plates of signs: signals say which")),
    (r"\bpole|mast|post\b", Maker("pole", standing=_pole, approximated="a pole is one for lighting, without an arm")),
    (r"\b(car|van|bus|truck|trailer|bike|motorbike|vehicle|pedestrian)\b", Maker(why="traffic is drawn")),
)


def thing_of(words: str) -> Maker:
    """Return what an object with these words in its type, subtype and name becomes."""
    for pattern, maker in _TABLE:
        if re.search(pattern, words):
            return maker
    return Maker(why="no thing of the set is of their kind")
