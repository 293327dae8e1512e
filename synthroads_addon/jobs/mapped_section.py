"""A map's words on a road's cross-section and traffic, as limits of a scenario: as much as a parameter set holds."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from ..base.remarks import assume
from ..road.crossfall import crossfall_points
from ..road.guidelines import (
    DUAL_CROSS_SECTIONS,
    SECTIONS_OF_CLASS,
    STANDARD_CROSS_SECTIONS,
    StandardCrossSection,
    design_class_of,
    is_single,
    sections_of_country,
)
from ..road.objects import Side
from ..road.parameters import AlignmentObject
from ..road.section import Carriageway, Lane
from ..road.things.limits import Interval
from ..road_files.points import MappedSection
from ..sampling.conflicts import conflicts
from ..sampling.section import SIDES, cross_section_of
from ..scenario.road import FreeCrossSection, RoadScenario

_MOST_LANES = 8
_LANE_TOLERANCE = 0.15
"""Metres by which a map's width of a lane may differ from a standard's: less than maps are good for."""
_MEDIAN_TOLERANCE = 1.5
"""The same of the median, which follows from the distance of two lines that somebody drew over a picture."""
_USUAL_COUNTRY_LANE = 3.5
"""Width of a lane, m, of a country road whose map says none: RQ 11, the usual section of its class (RAL)."""
_WIDEST_MEDIAN = 40.0
_SLOWEST = 5.0
"""Speed of cars at least, km/h."""


def with_mapped_section(
    name: str, mapped_section: MappedSection | None, scenario: RoadScenario
) -> tuple[RoadScenario, list[str]]:
    """Return a scenario with what a map says of a road, and what of it is left out, as texts.

    Lanes become the scenario's own cross-section if it has as many, else the first standard one that has, else one by
    hand; those of a road with both directions on one line first a standard one of one carriageway; where a map's
    widths differ from those by more than maps are good for, one by hand. A scenario that says ``lanes`` itself keeps
    its cross-section. The speed limit is the highest speed of cars.

    Args:
        name: of file and road, for remarks.
        mapped_section: what the map says; None for other files.
        scenario: limits of the road.
    """
    if mapped_section is None:
        return scenario, []
    losses = list[str]()
    if mapped_section.lanes is None:
        text = "%s: the map gives no number of lanes: the scenario's cross-section is used"
        assume(text, name)
    elif scenario.lanes is not None:
        if scenario.lanes != mapped_section.lanes:
            losses.append(f"lanes: {mapped_section.lanes} each way, road.lanes={scenario.lanes} is taken instead")
    else:
        scenario, losses = _with_lanes(name, mapped_section, mapped_section.lanes, scenario)
    if mapped_section.spread is None and mapped_section.one_way:
        losses.append(_of_one_line(cross_section_of(scenario)))
    elif mapped_section.side_by_side and scenario.median_width is not None:
        losses.append(f"lanes side by side: road.median_width={scenario.median_width:g} m parts them instead")
    if mapped_section.speed is not None:
        scenario = with_speed(name, mapped_section.speed, scenario)
    if mapped_section.pavement is not None:
        share = 1.0 if mapped_section.pavement == "concrete" else 0.0
        pavement = scenario.pavement.model_copy(update={"concrete": share})
        scenario = scenario.model_copy(update={"pavement": pavement})
    return scenario, losses


def meets(mapped_section: MappedSection | None, scenario: RoadScenario) -> bool:
    """Return whether a map's road has both directions side by side, and the scenario asks for no median.

    A class of one carriageway has them so by itself.
    """
    is_dual = not is_single(scenario.design_class)
    return mapped_section is not None and mapped_section.side_by_side and scenario.median_width is None and is_dual


def side_by_side(scenario: RoadScenario, axis: AlignmentObject) -> dict[Side, Carriageway]:
    """Return the carriageways of a road whose directions lie side by side: they meet at its axis, without turnouts."""
    section = cross_section_of(scenario)
    paved_width = section.paved_width - section.inner_edge_strip
    return {
        side: Carriageway(
            instance=1,
            side=side,
            inner_offset=0.0,
            inner_edge_strip_width=0.0,
            lanes=tuple(Lane(width=width) for width in section.lanes),
            outer_edge_strip_width=section.outer_edge_strip,
            hard_shoulder_width=section.hard_shoulder,
            verge_width=section.verge,
            crossfall=crossfall_points(scenario.design_class, side, paved_width, axis.horizontal),
            rotation_axis="centreline",
        )
        for side in SIDES
    }


def _of_one_line(section: StandardCrossSection) -> str:
    """Return what becomes of a road that a map has as one carriageway: a parameter set has two."""
    offset = 0.5 * (section.median + math.fsum(section.lanes)) + section.inner_edge_strip
    text = "lanes of one carriageway: the road gets two about this line, as their axis; --offset-from-path"
    return f"{text} {offset:g} leaves the right one where the map has it"


def _with_lanes(
    name: str, mapped_section: MappedSection, lanes: int, scenario: RoadScenario
) -> tuple[RoadScenario, list[str]]:
    """Return the scenario with the first cross-section for a map's lanes that meets no conflict."""
    if lanes > _MOST_LANES:
        return scenario, [f"lanes: {lanes} each way, at most {_MOST_LANES} are possible"]
    conflicts_before = set(conflicts(scenario, True))
    for update, losses in _candidates(mapped_section, lanes, scenario):
        candidate = scenario.model_copy(update=update)
        if set(conflicts(candidate, True)) <= conflicts_before:
            section = cross_section_of(candidate)
            widths = ", ".join(f"{width:g}" for width in section.lanes)
            section_name = candidate.cross_section if isinstance(candidate.cross_section, str) else "by hand"
            median = (
                "no median" if section.single or meets(mapped_section, candidate) else f"median of {section.median:g} m"
            )
            text = "%s: %d lanes each way: cross-section %s, lanes of %s m, %s; road.lanes=N asks for others"
            assume(text, name, lanes, section_name, widths, median)
            return candidate, losses
    return scenario, [f"lanes: {lanes} each way, which no cross-section of {scenario.design_class} holds"]


def _candidates(
    mapped_section: MappedSection, lanes: int, scenario: RoadScenario
) -> Iterator[tuple[dict[str, Any], list[str]]]:
    """Yield changes of a scenario that hold a map's lanes, the nearest first, and what each leaves out."""
    if mapped_section.side_by_side and scenario.median_width is None:
        yield from _on_one_carriageway(mapped_section, lanes, scenario)
    bases = list(_bases(lanes, mapped_section.lane_width, scenario))
    for update, section in bases:
        widths = section.lanes
        if (
            mapped_section.lane_width is not None
            and abs(math.fsum(widths) / lanes - mapped_section.lane_width) > _LANE_TOLERANCE
        ):
            widths = (mapped_section.lane_width,) * lanes
        median, losses = _median(mapped_section, section, widths)
        if widths == section.lanes and median == section.median:
            yield update, losses
        else:
            yield {**update, "cross_section": _by_hand(section, widths, median)}, losses
    for update, _ in bases:  # without the map's widths, where they meet limits
        losses = [f"lane width: {mapped_section.lane_width:g} m"] if mapped_section.lane_width is not None else []
        yield (
            update,
            [
                *losses,
                *(
                    [f"median: by {mapped_section.spread:.1f} m between the carriageways"]
                    if mapped_section.spread
                    else []
                ),
            ],
        )


def _on_one_carriageway(
    mapped_section: MappedSection, lanes: int, scenario: RoadScenario
) -> Iterator[tuple[dict[str, Any], list[str]]]:
    """Yield changes that make a scenario one of a country road with a number of lanes each way, the nearest first.

    What the scenario leaves open becomes what is usual for such roads. A country road with as many lanes keeps its
    cross-section; lanes whose width is another one than in any get the map's, if that makes the section no wider.
    """
    section, width = cross_section_of(scenario), mapped_section.lane_width
    usual_width = _USUAL_COUNTRY_LANE if width is None else width
    of_country = sections_of_country(scenario.design_class)
    distances = {
        name: abs(math.fsum(row.lanes) / lanes - usual_width)
        for name, row in STANDARD_CROSS_SECTIONS.items()
        if name in of_country and row.single and not row.oncoming_lanes and len(row.lanes) == lanes
    }
    if section.single and len(section.lanes) == lanes:
        distances = {str(scenario.cross_section): abs(math.fsum(section.lanes) / lanes - usual_width)}
    given = scenario.model_dump(mode="json", exclude_unset=True)
    # Of sections with the same lanes the one without a strip between the directions, which few roads have, comes first.
    for name in sorted(distances, key=lambda name: (distances[name], STANDARD_CROSS_SECTIONS[name].inner_edge_strip)):
        data = given | {"cross_section": name, "design_class": design_class_of(name, scenario.design_class)}
        ways: list[tuple[dict[str, Any], list[str]]] = [({}, [])]
        if width is not None and distances[name] > _LANE_TOLERANCE:  # lanes that make the section wider aren't allowed
            ways = [({"lane_width": width}, []), ({}, [f"lane width: {width:g} m"])]
        for changes, losses in ways:
            country_road = RoadScenario.from_dict(data | changes)
            yield {field: getattr(country_road, field) for field in RoadScenario.model_fields}, losses


def _bases(
    lanes: int, width: float | None, scenario: RoadScenario
) -> Iterator[tuple[dict[str, Any], StandardCrossSection]]:
    """Yield changes that give a scenario a cross-section with a number of lanes, and that cross-section."""
    usual_section = cross_section_of(scenario)
    if len(usual_section.lanes) == lanes:
        yield {}, usual_section
    section_names = SECTIONS_OF_CLASS[scenario.design_class]
    of_country = sections_of_country(scenario.design_class)
    standard_names = [
        name for name, row in DUAL_CROSS_SECTIONS.items() if name in of_country and len(row.lanes) == lanes
    ]
    lane_width = 3.75 if width is None else width
    standard_names.sort(
        key=lambda name: (
            name not in section_names,
            abs(math.fsum(DUAL_CROSS_SECTIONS[name].lanes) / lanes - lane_width),
        )
    )
    for name in standard_names:
        section = DUAL_CROSS_SECTIONS[name]
        yield {"cross_section": name, "design_class": design_class_of(name, scenario.design_class)}, section
    widths = (usual_section.lanes + usual_section.lanes[-1:] * lanes)[:lanes]
    section = StandardCrossSection(
        widths,
        usual_section.hard_shoulder,
        usual_section.outer_edge_strip,
        usual_section.inner_edge_strip,
        usual_section.median,
        usual_section.verge,
    )
    yield {"cross_section": _by_hand(section, widths, usual_section.median)}, section


def _by_hand(section: StandardCrossSection, lanes: tuple[float, ...], median: float) -> FreeCrossSection:
    """Return a cross-section by hand: another one's with other lanes and another median, m."""
    return FreeCrossSection(
        lanes=lanes,
        hard_shoulder=section.hard_shoulder,
        outer_edge_strip=section.outer_edge_strip,
        inner_edge_strip=section.inner_edge_strip,
        median=median,
        verge=section.verge,
    )


def _median(
    mapped_section: MappedSection, section: StandardCrossSection, lanes: tuple[float, ...]
) -> tuple[float, list[str]]:
    """Return the median (m) by the distance of the carriageways' middles, or the section's, and what is left out."""
    if mapped_section.spread is None:
        return section.median, []
    median = round(mapped_section.spread - 2.0 * section.inner_edge_strip - math.fsum(lanes), 1)
    if abs(median - section.median) <= _MEDIAN_TOLERANCE:
        return section.median, []
    if not 0.5 <= median <= _WIDEST_MEDIAN:
        return section.median, [
            f"median: {mapped_section.spread:.1f} m between the middles of the lanes would leave {median:g} m"
        ]
    return median, []


def with_speed(name: str, speed: float, scenario: RoadScenario) -> RoadScenario:
    """Return the scenario whose cars drive at most at a speed, km/h."""
    highest_speed = max(speed, _SLOWEST) / 3.6
    speed_limits = scenario.vehicles.speed
    if speed_limits.maximum <= highest_speed:
        return scenario
    limits = Interval(minimum=round(min(speed_limits.minimum, highest_speed), 3), maximum=round(highest_speed, 3))
    assume("%s: cars drive at most %.0f km/h, as the file says", name, 3.6 * highest_speed)
    return scenario.model_copy(update={"vehicles": scenario.vehicles.model_copy(update={"speed": limits})})
