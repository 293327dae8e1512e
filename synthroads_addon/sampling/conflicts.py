"""Limits of a scenario that contradict each other or the guidelines, found before anything is drawn.

Each function yields sentences, one for each limit that can't be kept. The sampler can make a road of every scenario for
which there is none.
"""

import math
from collections.abc import Callable, Iterator
from functools import lru_cache
from operator import attrgetter

from ..base.errors import InputError
from ..base.schema import Model
from ..road.guidelines import (
    DUAL_CROSS_SECTIONS,
    EMERGENCY_BAY_LENGTH,
    EMERGENCY_BAY_TAPER,
    EMERGENCY_BAY_WIDTH,
    LIMITS,
    SECTIONS_OF_CLASS,
    STANDARD_CROSS_SECTIONS,
    TURNOUT_GAP,
    TURNOUT_LANE_WIDTH,
    TURNOUT_TAPER,
    is_single,
)
from ..road.section import Marking, Pothole, Ramp, Rut, Turnout
from ..road.side_roads.side_road import SideRoad
from ..road.streets.street_side import ParkingBay, StreetSide
from ..road.structures.bridge import SHORTEST_BRIDGE, Bridge
from ..road.structures.tunnel import SHORTEST_TUNNEL, Tunnel
from ..road.surroundings import Environment, Landscape, MaterialVariation, Terrain, Vegetation, Vehicle
from ..road.things.limits import Interval
from ..road.things.pole import Pole
from ..road.things.registry import limits_of
from ..scenario.road import EnvironmentLimits, MaterialLimits, RoadScenario
from .overtaking_lanes import has_overtaking_lanes
from .placing.construction import SHORTEST_ALONG, TAPER_OUT, TAPERS_IN
from .placing.village_plan import MARGIN as VILLAGE_MARGIN
from .placing.village_plan import SHORTEST as SHORTEST_VILLAGE
from .placing.village_plan import may_have_villages
from .section import RampLimits, cross_section_of, features_of, may_change_lanes, traffic_side_of
from .side_roads import may_have_side_roads
from .turnouts.room import stated_reasons

LEAST_MEDIAN = min(section.median for section in DUAL_CROSS_SECTIONS.values())
"""Narrowest median of the standard cross-sections, m."""
WIDEST_RADIUS = 100_000.0
"""A curve of a larger radius (m) is a straight."""
VILLAGE_ROOM = 5.0
"""Ground that a village needs beside its footways, m. Chosen."""
STEADY_CLIMB = 250.0
"""Height (m) that the gentlest of the grades may climb over half of the road."""

_FIELDS: dict[str, tuple[type[Model], str]] = {
    "turnouts.taper_length": (Turnout, "taper_in_length"),
    "turnouts.lane_length": (Turnout, "lane_length"),
    "turnouts.lane_width": (Turnout, "lane_width"),
    "turnouts.shoulder_width": (Turnout, "shoulder_width"),
    "turnouts.ramp_length": (Ramp, "length"),
    "turnouts.ramp_clothoid": (Ramp, "clothoid_parameter"),
    "turnouts.ramp_crossfall": (Ramp, "crossfall_percent"),
    "turnouts.ramp_grade": (Ramp, "grade_percent"),
    "turnouts.bay_length": (Turnout, "lane_length"),
    "turnouts.bay_taper_length": (Turnout, "taper_in_length"),
    "turnouts.bay_width": (Turnout, "lane_width"),
    "turnouts.bus_bay_length": (Turnout, "lane_length"),
    "turnouts.layby_length": (Turnout, "lane_length"),
    "turnouts.side_bay_taper_length": (Turnout, "taper_in_length"),
    "side_roads.angle_deg": (SideRoad, "angle_deg"),
    "side_roads.lane_width": (SideRoad, "lane_width"),
    "side_roads.track_width": (SideRoad, "lane_width"),
    "side_roads.radius": (SideRoad, "near_radius"),
    "side_roads.length": (SideRoad, "length"),
    "side_roads.grade_percent": (SideRoad, "grade_percent"),
    "side_roads.blend_length": (SideRoad, "blend_length"),
    **{f"bridges.{name}": (Bridge, name) for name in ("kerb_height", "wing_length", "valley_depth")},
    **{f"tunnels.{name}": (Tunnel, name) for name in ("height", "cover")},
    "pavement.rut_depth": (Rut, "depth"),
    "pavement.rut_width": (Rut, "width"),
    "pavement.pothole_size": (Pothole, "width"),
    "pavement.pothole_depth": (Pothole, "depth"),
    "markings.film_thickness": (Marking, "film_thickness"),
    "villages.kerb_height": (StreetSide, "kerb_height"),
    "villages.footway_width": (StreetSide, "footway_width"),
    "villages.bay_width": (ParkingBay, "width"),
    "villages.light_height": (Pole, "height"),
    "vehicles.speed": (Vehicle, "speed"),
    "embankment_height": (Terrain, "embankment_height"),
    "undulation": (Terrain, "undulation"),
    "wavelength": (Terrain, "wavelength"),
    "batter_slope": (Terrain, "batter_slope"),
    **{name: (Terrain, name) for name in ("crest_length", "rounding_length", "swale_width", "ditch_width")},
    **{f"landscape.{name}": (Landscape, name) for name in ("hill_height", "hill_length", "parcel_size")},
    "vegetation.tree_height": (Vegetation, "height_min"),
    "vegetation.shrub_height": (Vegetation, "height_min"),
    "vegetation.grass_height": (Vegetation, "height_min"),
    "vegetation.mown_width": (Vegetation, "mown_width"),
    "vegetation.forest_height": (Vegetation, "height_min"),
    **{f"environment.{n}": (Environment, n) for n in EnvironmentLimits.model_fields if n in Environment.model_fields},
    **{
        f"materials.{n}": (MaterialVariation, n)
        for n in MaterialLimits.model_fields
        if n in MaterialVariation.model_fields
    },
}
"""Interval of the scenario -> the field of the parameter set whose limits it must keep to."""
_PLAIN = {
    "lane_changes.taper_length": (0.0, 1e4),
    "overtaking.section_length": (20.0, 1e5),
    "side_roads.per_km": (0.0, 50.0),
    "bridges.per_km": (0.0, 20.0),
    "bridges.length": (SHORTEST_BRIDGE, 5000.0),
    "bridges.span": (SHORTEST_BRIDGE, 300.0),
    "bridges.clearance": (2.0, 100.0),
    "bridges.cap_width": (0.8, 6.0),
    "tunnels.per_km": (0.0, 20.0),
    "tunnels.length": (SHORTEST_TUNNEL, 50_000.0),
    "tunnels.walkway_width": (0.5, 6.0),
    "pavement.potholes_per_km": (0.0, 1e4),
    "environment.time_of_day": (0.0, 24.0),
    "environment.day_of_year": (1.0, 366.0),
    "materials.patch_density": (0.0, 20.0),
    "materials.crack_density": (0.0, 1.0),
    "landscape.forest_share": (0.0, 1.0),
    "landscape.meadow_share": (0.0, 1.0),
    "landscape.villages": (0.0, 50.0),
    "landscape.turbines": (0.0, 200.0),
    "vegetation.forest_edges_per_km": (0.0, 20.0),
    "vegetation.forest_edge_length": (5.0, 1e4),
    "vegetation.forest_depth": (5.0, 500.0),
    "villages.length": (50.0, 1e4),
    "villages.plot_length": (8.0, 200.0),
    "villages.house_distance": (0.3, 30.0),
    "villages.light_spacing": (5.0, 1e3),
    "vehicles.per_km": (0.0, 1e3),
    "vehicles.trucks": (0.0, 1.0),
}
"""Interval of the scenario -> its limits, where they are no field's."""
_ABOVE = 1e-6  # what must be greater than a number is so by this much, at least


_SHARES = {
    "exit": "turnouts.exits",
    "entry": "turnouts.entries",
    "emergency_bay": "turnouts.emergency_bays",
    "bus_bay": "turnouts.bus_bays",
    "layby": "turnouts.laybys",
    "lane_change": "lane_changes.share",
}


def check_conflicts(scenario: RoadScenario, with_axis: bool = False) -> None:
    """Raise one `InputError` that names every limit of a scenario that can't be kept.

    Args:
        scenario: the limits.
        with_axis: the road has an axis of its own, so that limits of the alignment don't matter.
    """
    sentences = conflicts(scenario, with_axis)
    if sentences:
        raise InputError("road", None, f"limits conflict: {'; '.join(sentences)}")


@lru_cache(maxsize=16)
def conflicts(scenario: RoadScenario, with_axis: bool = False) -> tuple[str, ...]:
    """Return a sentence for each limit of a scenario that can't be kept; cached."""
    kinds: list[Callable[[RoadScenario], Iterator[str]]] = [
        _ranges,
        _cross_section,
        _villages,
        _lane_changes,
        _overtaking,
        _turnouts,
        _side_roads,
        _interchange,
        _lengths,
        _land_use,
    ]
    if not with_axis:
        kinds.insert(1, _alignment)
    return tuple(f"road.{sentence}" for kind in kinds for sentence in kind(scenario))


def _ranges(scenario: RoadScenario) -> Iterator[str]:
    """Yield a sentence for each interval that reaches beyond what a parameter set may hold."""
    for path, (least, largest) in _ALLOWED.items():
        limits: Interval = attrgetter(path)(scenario)
        if limits.minimum < least:
            yield f"{path}.minimum is {limits.minimum:g}, at least {least:g} is allowed"
        if limits.maximum > largest:
            yield f"{path}.maximum is {limits.maximum:g}, at most {largest:g} is allowed"


def _land_use(scenario: RoadScenario) -> Iterator[str]:
    """Yield a sentence if forest and meadow may have more than all of the land together."""
    shares = scenario.landscape.forest_share.maximum, scenario.landscape.meadow_share.maximum
    if sum(shares) > 1.0:
        yield f"landscape.forest_share.maximum and meadow_share.maximum are {sum(shares):g} together, at most 1 allowed"


def _alignment(scenario: RoadScenario) -> Iterator[str]:
    """Yield a sentence for each limit of radii and grades that the design class or the road's length doesn't allow."""
    limits, name = LIMITS[scenario.design_class], scenario.design_class
    if scenario.radius and scenario.radius.minimum < limits.radius:
        yield f"radius.minimum is {scenario.radius.minimum:g} m, {name} needs {limits.radius:g} m"
    if scenario.radius and scenario.radius.maximum > WIDEST_RADIUS:
        yield f"radius.maximum is {scenario.radius.maximum:g} m, at most {WIDEST_RADIUS:g} m are allowed"
    if not (grades := scenario.grade_percent):
        return
    for end, grade in (("minimum", grades.minimum), ("maximum", grades.maximum)):
        if abs(grade) > limits.grade_percent:
            yield f"grade_percent.{end} is {grade:g} %, {name} allows {limits.grade_percent:g} %"
    gentlest_grade = max(grades.minimum, -grades.maximum, 0.0)
    climb = gentlest_grade / 100.0 * scenario.length / 2.0
    if climb > STEADY_CLIMB:
        yield (
            f"grade_percent is {gentlest_grade:g} % or more one way, which over half of length {scenario.length:g} m "
            f"is {climb:.0f} m of height, at most {STEADY_CLIMB:g} m are allowed"
        )


def _cross_section(scenario: RoadScenario) -> Iterator[str]:
    """Yield a sentence for each width or number of lanes that doesn't go with the cross-section or design class."""
    section, name = cross_section_of(scenario), scenario.cross_section
    if isinstance(name, str):
        standard = STANDARD_CROSS_SECTIONS[name]
        width, allowed_width = section.total_width, standard.total_width
        if len(section.lanes) > len(standard.lanes):
            yield f"lanes is {len(section.lanes)}, {name} has {len(standard.lanes)} per direction"
        if width > allowed_width + 1e-9:
            changed_fields = [
                field for field in ("lanes", "lane_width", "median_width") if getattr(scenario, field) is not None
            ]
            yield f"{' and '.join(changed_fields)} make the road {width:g} m wide, {name} is {allowed_width:g} m wide"
    least_width = min(
        min(STANDARD_CROSS_SECTIONS[section_name].lanes) for section_name in SECTIONS_OF_CLASS[scenario.design_class]
    )
    if min(section.lanes) < least_width and not section.single:
        field = "cross_section.lanes" if scenario.lane_width is None else "lane_width"
        yield f"{field} is {min(section.lanes):g} m, {scenario.design_class} needs {least_width:g} m"
    if section.single and scenario.median_width is not None:
        yield f"median_width is {section.median:g} m, the one carriageway of {scenario.design_class} has no median"
    if not section.single and section.median < LEAST_MEDIAN:
        field = "cross_section.median" if scenario.median_width is None else "median_width"
        yield f"{field} is {section.median:g} m, {LEAST_MEDIAN:g} m are needed"
    edge = section.median / 2.0 + section.paved_width + section.verge
    if scenario.half_width < edge:
        yield f"half_width is {scenario.half_width:g} m, the road alone reaches {edge:g} m"


def _villages(scenario: RoadScenario) -> Iterator[str]:
    """Yield sentences on why a village that is wanted can't be there."""
    villages, section = scenario.villages, cross_section_of(scenario)
    if villages.share <= 0.0:
        return
    if not may_have_villages(scenario):
        class_text = f"{scenario.design_class} leads through no village: 0 is allowed"
        yield f"villages.share is {villages.share:g}, {class_text}"
        return
    for name in ("bus_bays", "laybys"):
        if getattr(scenario.turnouts, name) >= 1.0:
            yield (
                f"villages.share is {villages.share:g} and turnouts.{name} is 1: a road through a village has no bays, "
                f"make one of the two 0, or turnouts.{name} less than 1"
            )
    least_length = SHORTEST_VILLAGE + 2.0 * VILLAGE_MARGIN
    if scenario.length < least_length:
        length_text = f"length is {scenario.length:g} m: {least_length:g} m are needed"
        yield f"villages.share is {villages.share:g}, {length_text}"
    reach = section.paved_width + villages.footway_width.maximum + villages.bay_width.maximum + VILLAGE_ROOM
    if scenario.half_width < reach:
        yield f"half_width is {scenario.half_width:g} m, a village needs {reach:g} m"


def _lane_changes(scenario: RoadScenario) -> Iterator[str]:
    """Yield a sentence if lanes may begin or end, but their tapers are all too short."""
    if is_single(scenario.design_class):
        if scenario.lane_changes.share > 0.0:
            share = scenario.lane_changes.share
            yield f"lane_changes.share is {share:g}, {scenario.design_class} has none: 0 is allowed"
        return
    limits, least_length = scenario.lane_changes, LIMITS[scenario.design_class].lane_taper_length
    if limits.share > 0.0 and may_change_lanes(scenario, cross_section_of(scenario)):
        yield from _short("lane_changes.taper_length", limits.taper_length, least_length, scenario.design_class)


def _overtaking(scenario: RoadScenario) -> Iterator[str]:
    """Yield sentences if overtaking lanes are to change where there is none, or over more than their stretches."""
    limits, section = scenario.overtaking, cross_section_of(scenario)
    if limits.share <= 0.0:
        return
    if not has_overtaking_lanes(section):
        yield f"overtaking.share is {limits.share:g}, the cross-section has no overtaking lane: 0 is allowed"
    needed_length = limits.critical_length / 2.0 + limits.uncritical_length
    if limits.section_length.minimum < needed_length:
        yield (
            f"overtaking.section_length.minimum is {limits.section_length.minimum:g} m, half of critical_length and "
            f"uncritical_length need {needed_length:g} m"
        )


def _side_roads(scenario: RoadScenario) -> Iterator[str]:
    """Yield a sentence if side roads are wanted where none may join at grade."""
    largest, name = scenario.side_roads.per_km.maximum, scenario.design_class
    if largest > 0.0 and not may_have_side_roads(name):
        yield f"side_roads.per_km.maximum is {largest:g}, no road joins {name} at grade: 0 is allowed"


def _interchange(scenario: RoadScenario) -> Iterator[str]:
    """Yield a sentence where an interchange is wanted on a road that has none, or beside other turnouts."""
    kind, name = scenario.interchange.kind, scenario.design_class
    if kind == "none":
        return
    if is_single(name):
        yield f"interchange.kind is {kind}, only motorways have interchanges, {name} isn't one: none is allowed"
    if traffic_side_of(scenario) == "left":
        yield f"interchange.kind is {kind}, interchanges are only for traffic on the right: none is allowed"
    if scenario.turnouts.places:
        yield f"interchange.kind is {kind} and turnouts.places states others: empty it, or make the interchange none"
    if largest := scenario.tunnels.per_km.maximum:
        yield f"interchange.kind is {kind} and tunnels.per_km.maximum is {largest:g}: a road has one or the other"


def _turnouts(scenario: RoadScenario) -> Iterator[str]:
    """Yield a sentence for each limit that no turnout can keep to, where turnouts are wanted."""
    limits, name = scenario.turnouts, scenario.design_class
    yield from (f"turnouts.{reason}" for reason in stated_reasons(scenario))
    if is_single(name):
        for kind in ("exits", "entries", "emergency_bays"):
            if (share := getattr(limits, kind)) > 0.0:
                yield f"turnouts.{kind} is {share:g}, {name} has none: 0 is allowed"
        return
    for kind in ("bus_bays", "laybys"):
        if (share := getattr(limits, kind)) > 0.0:
            yield f"turnouts.{kind} is {share:g}, {name} has none: 0 is allowed"
    if limits.exits > 0.0 or limits.entries > 0.0:
        yield from _short("turnouts.lane_length", limits.lane_length, LIMITS[name].turnout_lane_length, name)
        yield from _short("turnouts.lane_width", limits.lane_width, TURNOUT_LANE_WIDTH, "a turnout")
        yield from _short("turnouts.taper_length", limits.taper_length, TURNOUT_TAPER, "a turnout")
        ramps = RampLimits(scenario, cross_section_of(scenario))
        yield from _short("turnouts.ramp_length", limits.ramp_length, ramps.shortest, "a ramp to 10 m behind its nose")
    if limits.emergency_bays > 0.0:
        yield from _short("turnouts.bay_length", limits.bay_length, EMERGENCY_BAY_LENGTH, "an emergency bay")
        yield from _short("turnouts.bay_taper_length", limits.bay_taper_length, EMERGENCY_BAY_TAPER, "an emergency bay")
        yield from _short("turnouts.bay_width", limits.bay_width, EMERGENCY_BAY_WIDTH, "an emergency bay")


def _lengths(scenario: RoadScenario) -> Iterator[str]:
    """Yield a sentence for each thing that must be there, but doesn't fit in the road."""
    yield from _features(scenario)
    furniture, barriers, length = scenario.furniture, scenario.barriers, scenario.length
    if furniture.gantry_spacing is not None and furniture.gantry_spacing > length:
        yield f"furniture.gantry_spacing is {furniture.gantry_spacing:g} m, length is {length:g} m"
    zone = TAPERS_IN[0] + SHORTEST_ALONG + TAPER_OUT
    if furniture.construction_zone > 0.0:
        yield from _short("furniture.construction_length", furniture.construction_length, zone, "a construction zone")
    for field, share, least_length in (
        ("furniture.construction_zone", furniture.construction_zone, max(furniture.construction_length.minimum, zone)),
        ("furniture.overpass", furniture.overpass, furniture.overpass_width.minimum),
        ("barriers.noise_barrier", barriers.noise_barrier, barriers.noise_barrier_length.minimum),
    ):
        if share >= 1.0 and least_length > length:
            yield f"{field} is 1, it needs {least_length:g} m and length is {length:g} m"


def _features(scenario: RoadScenario) -> Iterator[str]:
    """Yield sentences on turnouts and lane changes that must be there, but don't fit in the road or beside it."""
    limits, section = scenario.turnouts, cross_section_of(scenario)
    ramps = RampLimits(scenario, section)
    reason = f"is 1, within half_width {scenario.half_width:g} m there is no room for it"
    if ramps.lengths[0] > ramps.lengths[1] and ramps.shortest <= limits.ramp_length.maximum:
        yield from (f"turnouts.{name} {reason}" for name in ("exits", "entries") if getattr(limits, name) >= 1.0)
    for kind in ("emergency_bays", "bus_bays", "laybys"):
        if getattr(limits, kind) >= 1.0 and not ramps.room_for_bay:
            yield f"turnouts.{kind} {reason}"
    certain_features = [feature for feature in features_of(scenario, section, ramps) if feature.share >= 1.0]
    needed_length = math.fsum(feature.least for feature in certain_features) + TURNOUT_GAP * (len(certain_features) - 1)
    if certain_features and needed_length > scenario.length:
        fields = " and ".join(f"{_SHARES[feature.kind]} is 1" for feature in certain_features)
        yield f"{fields}, {needed_length:.0f} m are needed and length is {scenario.length:g} m"


def _short(path: str, limits: Interval, least_value: float, thing_name: str) -> Iterator[str]:
    """Yield a sentence if the whole interval of a length (m) lies below the least that a thing needs."""
    if limits.maximum < least_value:
        yield f"{path}.maximum is {limits.maximum:g} m, {thing_name} needs {least_value:g} m"


def _allowed_range(model: type[Model], name: str) -> tuple[float, float]:
    """Return the least and the largest value that a model's field may have."""
    least, largest = -1e8, 1e8
    for limit in model.model_fields[name].metadata:
        if hasattr(limit, "ge"):
            least = limit.ge
        elif hasattr(limit, "gt"):
            least = limit.gt + _ABOVE
        elif hasattr(limit, "le"):
            largest = limit.le
    return least, largest


def _allowed_by_things() -> Iterator[tuple[str, tuple[float, float]]]:
    """Yield the path of each interval of the things' limits, and the range that it must keep to."""
    for thing, limits in limits_of():
        for name, allowed in limits.allowed.items():
            yield f"{limits.group}.{name}", _allowed_range(thing, allowed) if isinstance(allowed, str) else allowed


_ALLOWED = {path: _allowed_range(*field) for path, field in _FIELDS.items()} | _PLAIN | dict(_allowed_by_things())
