"""Roads without furniture, made by hand, for the tests of the placement; and what is placed on them."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from synthroads_addon.checking.checker import check
from synthroads_addon.checking.rules import barriers as checker_barriers
from synthroads_addon.checking.rules import furniture as checker_furniture
from synthroads_addon.checking.rules import signs as checker_signs
from synthroads_addon.checking.rules import traffic as checker_traffic
from synthroads_addon.checking.rules.rule import Violation
from synthroads_addon.road.guidelines import STANDARD_CROSS_SECTIONS, StandardCrossSection
from synthroads_addon.road.objects import LineObject, RoadObject
from synthroads_addon.road.other_roads.axis import HorizontalElement, VerticalPoint
from synthroads_addon.road.parameters import AlignmentObject, Metadata, RoadParameters, Transform
from synthroads_addon.road.section import Carriageway, CrossfallPoint, Lane, Median, Ramp, Turnout
from synthroads_addon.road.surroundings import Terrain
from synthroads_addon.sampling.placing.furniture import place_furniture
from synthroads_addon.sampling.placing.site import PlacementSite
from synthroads_addon.scenario.road import RoadScenario

NOTHING: dict[str, Any] = {
    "barriers": {"noise_barrier": 0.0, "concrete_median": 0.0, "concrete_roadside": 0.0},
    "furniture": {
        "signs": False,
        "delineators": False,
        "kilometre_boards": False,
        "emergency_phones": False,
        "gutters": False,
        "shafts": False,
        "gantries": 0.0,
        "lighting": 0.0,
        "surveillance": 0.0,
        "traffic_lights": 0.0,
        "cabinets_per_km": {"minimum": 0.0, "maximum": 0.0},
        "overpass": 0.0,
        "construction_zone": 0.0,
    },
}
"""A scenario without any furniture but steel barriers where they must be, and at random."""
EVERYTHING: dict[str, Any] = {
    "barriers": {"noise_barrier": 0.7, "concrete_median": 0.5, "concrete_roadside": 0.5},
    "furniture": {
        "gantries": 0.7,
        "lighting": 0.3,
        "surveillance": 0.7,
        "traffic_lights": 0.7,
        "overpass": 0.6,
        "construction_zone": 0.7,
    },
}
"""A scenario with much of all furniture."""
RULES = {rule.id for m in (checker_barriers, checker_furniture, checker_signs, checker_traffic) for rule in m.RULES}
"""The checker's rules for furniture."""
BODIES = {"object-on-pavement", "object-overlap", "object-range", "sign-distance", "sign-facing", "clearance"}
"""Those of them that hold for furniture at random, too."""


def merged(base: dict[str, Any], changes: dict[str, Any]) -> dict[str, Any]:
    """Return nested data with changes."""
    result = dict(base)
    for key, value in changes.items():
        known = result.get(key)
        result[key] = merged(known, value) if isinstance(known, dict) and isinstance(value, dict) else value
    return result


def straight(length: float) -> list[tuple[float, float, float]]:
    """Return length (m) and curvatures at start and end (1/m) of a straight road's elements."""
    return [(length, 0.0, 0.0)]


def curve(radius: float, length: float = 300.0, before: float = 700.0) -> list[tuple[float, float, float]]:
    """Return the elements of straight, clothoid, arc (positive radius to the left), clothoid, straight."""
    bend = 1.0 / radius
    return [(before, 0.0, 0.0), (150.0, 0.0, bend), (length, bend, bend), (150.0, bend, 0.0), (700.0, 0.0, 0.0)]


def exit_at(start: float, side: str = "right", shoulder: float = 1.5, clothoid: float = 90.0) -> Turnout:
    """Return an exit by its lowest station (m)."""
    return Turnout(
        instance=1,
        carriageway=f"carriageway-{side}",
        kind="exit",
        start_station=start,
        taper_in_length=40.0,
        lane_length=250.0,
        lane_width=3.75,
        shoulder_width=shoulder,
        ramp=Ramp(length=110.0, clothoid_parameter=clothoid),
    )


def entry_at(start: float, side: str = "right") -> Turnout:
    """Return an entry by its lowest station (m)."""
    return Turnout(
        instance=1,
        carriageway=f"carriageway-{side}",
        kind="entry",
        start_station=start,
        taper_out_length=40.0,
        lane_length=250.0,
        lane_width=3.75,
        shoulder_width=1.5,
        ramp=Ramp(length=110.0, clothoid_parameter=90.0),
    )


def bay_at(start: float, side: str = "right") -> Turnout:
    """Return an emergency bay by its lowest station (m)."""
    return Turnout(
        instance=1,
        carriageway=f"carriageway-{side}",
        kind="emergency_bay",
        start_station=start,
        taper_in_length=25.0,
        lane_length=50.0,
        taper_out_length=25.0,
        lane_width=3.2,
        edge_strip_width=0.0,
    )


def make_site(
    elements: list[tuple[float, float, float]] | None = None,
    *,
    seed: int = 1,
    embankment: float = 0.0,
    batter: float = 1.5,
    turnouts: Iterable[Turnout] = (),
    section: StandardCrossSection | None = None,
    outer_lane: Any = None,
    **scenario: Any,
) -> PlacementSite:
    """Return a road without furniture.

    Args:
        elements: length (m) and curvatures (1/m) of the alignment's elements; 600 m of straight if not given.
        seed: of the furniture.
        embankment, batter: of the terrain, m and m/m.
        turnouts: of both carriageways.
        section: the cross-section; that of the scenario if not given.
        outer_lane: width of the right carriageway's outermost lane, if it isn't the cross-section's.
        scenario: changes of `NOTHING`.
    """
    elements = elements or straight(600.0)
    length = sum(element[0] for element in elements)
    limits = RoadScenario.from_dict(merged(NOTHING, scenario | {"length": length}))
    if section is None:
        assert isinstance(limits.cross_section, str)
        section = STANDARD_CROSS_SECTIONS[limits.cross_section]
    carriageways = {side: _carriageway(side, section, outer_lane if side == "right" else None) for side in _SIDES}
    axis = AlignmentObject(
        instance=1,
        start_x=0.0,
        start_y=0.0,
        start_heading_deg=0.0,
        horizontal=tuple(HorizontalElement.between(*element) for element in elements),
        vertical=(VerticalPoint(station=0.0, elevation=0.0),),
    )
    terrain = Terrain(
        instance=1,
        half_width=150.0,
        embankment_height=embankment,
        undulation=0.1,
        wavelength=50.0,
        batter_slope=batter,
        seed=1,
    )
    named = {f"turnout-{number}": turnout for number, turnout in enumerate(turnouts, start=1)}
    return PlacementSite(limits, seed, axis, carriageways, named, terrain)


_SIDES: tuple[Any, ...] = ("right", "left")


def _carriageway(side: Any, section: StandardCrossSection, outer_lane: Any) -> Carriageway:
    widths = [section.lanes[0] if outer_lane is None else outer_lane, *section.lanes[1:]]
    return Carriageway(
        instance=1,
        side=side,
        inner_offset=section.median / 2.0,
        hard_shoulder_width=section.hard_shoulder,
        outer_edge_strip_width=section.outer_edge_strip,
        lanes=tuple(Lane(width=width) for width in widths),
        inner_edge_strip_width=section.inner_edge_strip,
        verge_width=section.verge,
        crossfall=(CrossfallPoint(station=0.0, crossfall_percent=2.5),),
    )


def place(site: PlacementSite) -> dict[str, Any]:
    """Return the furniture of a road by id."""
    found = list(place_furniture(site))
    assert len(dict(found)) == len(found)
    return dict(found)


def of(furniture: dict[str, Any], *kinds: type[RoadObject]) -> dict[str, Any]:
    """Return the objects of some classes by id."""
    return {name: item for name, item in furniture.items() if isinstance(item, kinds)}


def beside(furniture: dict[str, Any], side: str, *kinds: type[RoadObject]) -> list[Any]:
    """Return the objects of some classes beside one carriageway, in the order of their stations."""
    found = [item for name, item in of(furniture, *kinds).items() if side in name and "median" not in name]
    return sorted(found, key=lambda item: item.start_station if isinstance(item, LineObject) else item.station)


def road_of(site: PlacementSite, furniture: dict[str, Any]) -> RoadParameters:
    """Return the whole road."""
    objects: dict[str, Any] = {"alignment": site.alignment, "median": Median(instance=1), "terrain": site.terrain}
    objects |= {f"carriageway-{side}": carriageway for side, carriageway in site.carriageways.items()}
    objects |= site.turnouts | furniture
    numbered = {
        name: item.model_copy(update={"instance": number})
        for number, (name, item) in enumerate(objects.items(), start=1)
    }
    return RoadParameters(
        metadata=Metadata(
            identifier="test", generator="test", referenceSystem="https://www.opengis.net/def/crs/EPSG/0/25832"
        ),
        transform=Transform(translate=(0.0, 0.0, 0.0)),
        design_class=site.scenario.design_class,
        objects=numbered,
    )


def faults(site: PlacementSite, furniture: dict[str, Any], rules: set[str] = RULES) -> list[Violation]:
    """Return the violations of rules that the checker finds."""
    return [found for found in check(road_of(site, furniture)) if found.rule in rules]
