"""Rules for the cross-section (RAA, RAL): lanes and their tapers, median, shoulders, strips; pavement's damage."""

from collections.abc import Iterator
from functools import partial

import numpy as np

from ...road.guidelines import SECTIONS_OF_CLASS, STANDARD_CROSS_SECTIONS, StandardCrossSection
from ...road.objects import AnyWidth, nominal_width, width_kinks
from ...road.section import Carriageway, Median
from .edges import Edges, WidthByStation
from .rule import SAME_STATION, TOLERANCE, Finding, Road, Rule, at_least, out_of_order, stretches

#: Narrowest median of the standard cross-sections, m.
LEAST_MEDIAN = 2.5
#: A lane narrower than this (m) isn't there.
NO_LANE = 1e-6
#: Lanes of both directions of a road with overtaking lanes (Lower Saxony's road authority on the RAL, 2014).
_THREE = 3
#: Changes of width per metre that differ by less than this share are the same: a taper may have points within.
SAME_SLOPE = 0.01


def _widths(carriageway: Carriageway) -> Iterator[tuple[str, AnyWidth]]:
    """Yield (name for people, width) of all widths of a carriageway."""
    yield "The inner offset", carriageway.inner_offset
    yield "The hard shoulder", carriageway.hard_shoulder_width
    yield "The outer edge strip", carriageway.outer_edge_strip_width
    yield "The inner edge strip", carriageway.inner_edge_strip_width
    yield "The verge", carriageway.verge_width
    for i, lane in enumerate(carriageway.lanes):
        yield f"Lane {i + 1}", lane.width


def _width_order(road: Road) -> Iterator[Finding]:
    """Yield a finding for each point of a width that doesn't follow the points before it."""
    for name, edges in road.sides.items():
        for width_name, width in _widths(edges.carriageway):
            for _, station, largest_before in out_of_order(width_kinks(width)):
                text = (
                    f"{width_name} has a width at {station:.3f} m "
                    f"that does not follow the one at {largest_before:.3f} m."
                )
                yield Finding(name, station, station, largest_before, text)


def narrowest_lane(road: Road) -> float:
    """Return the narrowest lane (m) of the standard cross-sections that the road's class may have."""
    return min(width for section in _standard_sections(road) for width in (*section.lanes, *section.oncoming_lanes))


def _standard_sections(road: Road) -> list[StandardCrossSection]:
    """Return the standard cross-sections that the road's design class may have."""
    return [STANDARD_CROSS_SECTIONS[name] for name in SECTIONS_OF_CLASS[road.design_class]]


def _least_overtaking_lane(road: Road) -> float:
    """Return the narrowest lane (m) inside of the outermost one: overtaking lanes may be narrower than others."""
    overtaking = [section.overtaking_lane for section in _standard_sections(road) if section.overtaking_lane]
    return min([narrowest_lane(road), *overtaking])


def _both_overtake(road: Road) -> Iterator[Finding]:
    """Yield a finding for each stretch along which both directions of a road of three lanes have two."""
    sections = _standard_sections(road)
    is_three_lane = any(section.overtaking_lane or section.oncoming_lanes for section in sections)
    if not road.single or not is_three_lane or len(road.sides) < 2:
        return
    widths = [width(road.marks) for edges in road.sides.values() for width in edges.lane_widths]
    # Where lanes begin, both may be there in part.
    lanes = np.sum(np.array(widths) >= _least_overtaking_lane(road) * (1.0 - TOLERANCE), axis=0)
    name = next(iter(road.sides))
    both = (lanes[:-1] > _THREE) & (lanes[1:] > _THREE)
    for first, last in stretches(both):
        text = (
            f"Both directions have an overtaking lane for {road.marks[last + 1] - road.marks[first]:.0f} m; "
            f"a road of three lanes has one ({road.guideline}; confirmed)."
        )
        yield Finding(name, float(road.marks[first]), float(lanes[first]), float(_THREE), text)


def _lane_ramps(lane: WidthByStation) -> list[tuple[int, int]]:
    """Return (first, last) point of every straight piece of a lane's widths that is 0 at just one end."""
    if lane.constant:
        return []
    slope = np.diff(lane.width) / np.diff(lane.station)
    continues = np.abs(np.diff(slope)) <= SAME_SLOPE * np.abs(slope[1:])
    pieces: list[tuple[int, int]] = []
    for i in range(len(slope)):
        if pieces and continues[i - 1]:
            pieces[-1] = (pieces[-1][0], i + 1)
        else:
            pieces.append((i, i + 1))
    is_zero = lane.width < NO_LANE
    return [
        (first_point, last_point) for first_point, last_point in pieces if is_zero[first_point] != is_zero[last_point]
    ]


def _lane_width(road: Road) -> Iterator[Finding]:
    """Yield a finding for each stretch of a lane that is too narrow, tapers to or from nothing left out."""
    source = f"{road.guideline_name}, {', '.join(SECTIONS_OF_CLASS[road.design_class])}"
    for name, edges in road.sides.items():
        for i, lane in enumerate(edges.lane_widths):
            least_width = _least_overtaking_lane(road) if i else narrowest_lane(road)
            is_narrow = (lane.width < least_width * (1.0 - TOLERANCE)) & (lane.width >= NO_LANE)
            for first_point, last_point in _lane_ramps(lane):
                is_narrow[first_point + 1 : last_point] = False
            for first_point, last_point in stretches(is_narrow):
                worst_point = first_point + int(np.argmin(lane.width[first_point : last_point + 1]))
                width = lane.width[worst_point]
                text = f"Lane {i + 1} is {width:.2f} m wide; {least_width:.2f} m are needed ({source})."
                yield Finding(
                    name,
                    np.clip(lane.station[worst_point], 0.0, road.length),
                    width,
                    least_width,
                    text,
                )


def lane_tapers(road: Road, edges: Edges) -> Iterator[tuple[int, float, float]]:
    """Yield (lane, first station, last station) of every taper on the road along which a lane begins or ends."""
    for i, lane in enumerate(edges.lane_widths):
        for first_point, last_point in _lane_ramps(lane):
            begin, end = float(lane.station[first_point]), float(lane.station[last_point])
            if begin < road.length - SAME_STATION and end > SAME_STATION:
                yield i, begin, end


def _lane_taper(road: Road) -> Iterator[Finding]:
    """Yield a finding for each taper over which a lane begins or ends that is too short."""
    if not road.binds("lane_taper_length"):
        return
    least_length = road.limits.lane_taper_length
    for name, edges in road.sides.items():
        for lane, begin, end in lane_tapers(road, edges):
            text = f"Lane {lane + 1} begins or ends over {end - begin:.1f} m; {least_length:.0f} m are needed (RAA)."
            yield from at_least(name, max(begin, 0.0), end - begin, least_length, text)


def _median_width(road: Road) -> Iterator[Finding]:
    """Yield a finding for each stretch along which the median is narrower than any standard one."""
    if len(road.sides) < 2 or road.single:
        return
    width = np.sum([edges.inner(road.marks) for edges in road.sides.values()], axis=0)
    name = next(iter([*road.of(Median), *road.sides]))
    for first_mark, last_mark in stretches(width < LEAST_MEDIAN * (1.0 - TOLERANCE)):
        worst_mark = first_mark + int(np.argmin(width[first_mark : last_mark + 1]))
        text = f"The median is {width[worst_mark]:.2f} m wide; {LEAST_MEDIAN} m are needed (RAA)."
        yield Finding(name, road.marks[worst_mark], width[worst_mark], LEAST_MEDIAN, text)


def _is_standard(road: Road, edges: Edges) -> bool:
    """Return whether a carriageway's lanes are those of a standard cross-section with as many carriageways."""
    lanes = tuple(nominal_width(lane.width) for lane in edges.carriageway.lanes)
    sections = (section for section in STANDARD_CROSS_SECTIONS.values() if section.single == road.single)
    return any(lanes in (section.lanes, section.oncoming_lanes) for section in sections)


def _strip_widths(road: Road, fields: tuple[str, ...]) -> Iterator[Finding]:
    """Yield findings for strips of a standard cross-section narrower than in those of the class."""
    for field in fields:
        strip_name, least_width = (
            field.replace("_", " "),
            min(getattr(section, field) for section in _standard_sections(road)),
        )
        for name, edges in road.sides.items():
            if _is_standard(road, edges):
                strip = WidthByStation(getattr(edges.carriageway, f"{field}_width"))
                width = strip.width
                if field == "verge":  # in tunnels walkways take its place, which have a rule of their own
                    for start, end in road.tunnels:
                        width = np.where((strip.station >= start) & (strip.station <= end), np.inf, width)
                worst_point = int(np.argmin(width))
                station, value = np.clip(strip.station[worst_point], 0.0, road.length), strip.width[worst_point]
                text = (
                    f"The {strip_name} is {value:.2f} m wide; "
                    f"the class's standard cross-sections have {least_width} m ({road.guideline_name})."
                )
                yield from at_least(name, station, value, least_width, text)


def _rut_lane(road: Road) -> Iterator[Finding]:
    """Yield a finding for each rut whose lane is missing or narrower than the rut."""
    for name, edges in road.sides.items():
        for i, rut in enumerate(edges.carriageway.pavement.ruts):
            needed_width, narrowest_width, station = rut.track + rut.width, 0.0, rut.start_station
            if rut.lane < len(edges.lane_widths):
                stations = edges.between(rut.start_station, rut.end_station)
                width = edges.lane_widths[rut.lane](stations)
                narrowest_width, station = width.min(), stations[np.argmin(width)]
            place = f"lane {rut.lane + 1} that it lies in is {narrowest_width:.2f} m wide there"
            yield from at_least(
                name, station, narrowest_width, needed_width, f"Rut {i + 1} takes {needed_width:.2f} m, and {place}."
            )


def _pothole_pavement(road: Road) -> Iterator[Finding]:
    """Yield a finding for each pothole that reaches beyond its carriageway's pavement."""
    for name, edges in road.sides.items():
        potholes = edges.carriageway.pavement.potholes
        if not potholes:
            continue
        station, offset, width = np.array([(pothole.station, pothole.offset, pothole.width) for pothole in potholes]).T
        nearest, farthest = edges.distances(offset - width / 2.0, offset + width / 2.0)
        overshoot = edges.at(station).clearance(
            farthest, nearest
        )  # with its edges exchanged: of the edge that lies farther off
        for i in np.flatnonzero(overshoot > TOLERANCE):
            text = f"Pothole {i + 1} reaches {overshoot[i]:.2f} m beyond the carriageway's pavement."
            yield Finding(name, station[i], overshoot[i], 0.0, text)


_HARD_SHOULDER = partial(_strip_widths, fields=("hard_shoulder",))
_EDGE_STRIPS = partial(_strip_widths, fields=("outer_edge_strip", "inner_edge_strip"))
_VERGE = partial(_strip_widths, fields=("verge",))

RULES = (
    Rule("width-order", "Points of widths are in order", "m", "", "definition", _width_order),
    Rule("lane-width", "Narrowest lane", "m", "RAA", "confirmed", _lane_width),
    Rule("lane-taper", "Length over which a lane begins or ends", "m", "RAA", "unconfirmed", _lane_taper),
    Rule("overtaking-lanes", "One overtaking lane at a time", "1", "RAL", "confirmed", _both_overtake),
    Rule("median-width", "Narrowest median", "m", "RAA", "confirmed", _median_width),
    Rule("hard-shoulder-width", "Narrowest hard shoulder", "m", "RAA", "derived", _HARD_SHOULDER),
    Rule("edge-strip-width", "Narrowest edge strips", "m", "RAA", "derived", _EDGE_STRIPS),
    Rule("verge-width", "Narrowest verge", "m", "RAA", "confirmed", _VERGE),
    Rule("rut-lane", "Ruts lie within a lane that is there", "m", "", "definition", _rut_lane),
    Rule("pothole-pavement", "Potholes lie on the pavement", "m", "", "definition", _pothole_pavement),
)
