"""Rules for the cross-section (RAA): lanes and their tapers, median, shoulders, strips; and the pavement's damage."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...road.guidelines import LANE_TAPER_LENGTH, SECTIONS_OF_CLASS, STANDARD_CROSS_SECTIONS, StandardCrossSection
from ...road.objects import AnyWidth, nominal_width
from ...road.section import Carriageway, Median, Pothole
from .edges import Edges, Float, WidthByStation
from .rule import SAME_STATION, TOLERANCE, Finding, Road, Rule, below, out_of_order, stretches

#: Narrowest median of the standard cross-sections, m.
LEAST_MEDIAN = 2.5
#: A lane narrower than this (m) isn't there.
NO_LANE = 1e-6
#: Changes of width per metre that differ by less than this share are the same: a taper may have points within.
SAME_SLOPE = 0.01


def _widths(carriageway: Carriageway) -> Iterator[tuple[str, AnyWidth]]:
    """Yield (what it is, width) of all widths of a carriageway."""
    yield "The inner offset", carriageway.inner_offset
    yield "The hard shoulder", carriageway.hard_shoulder_width
    yield "The outer edge strip", carriageway.outer_edge_strip_width
    yield "The inner edge strip", carriageway.inner_edge_strip_width
    yield "The verge", carriageway.verge_width
    for i, lane in enumerate(carriageway.lanes):
        yield f"Lane {i + 1}", lane.width


def _width_order(road: Road) -> Iterator[Finding]:
    for name, edges in road.sides.items():
        for what, width in _widths(edges.carriageway):
            if not isinstance(width, tuple):
                continue
            station = np.array([point.station for point in width])
            for i in out_of_order(station):
                at, past = float(station[i]), float(station[:i].max())
                text = f"{what} has a width at {at:.3f} m that does not follow the one at {past:.3f} m."
                yield Finding(name, at, at, past, text)


def least_lane(road: Road) -> float:
    """Return the narrowest lane (m) of the standard cross-sections that the road's class may have."""
    return min(width for section in _standard(road) for width in section.lanes)


def _standard(road: Road) -> list[StandardCrossSection]:
    return [STANDARD_CROSS_SECTIONS[name] for name in SECTIONS_OF_CLASS[road.design_class]]


def _lane_ramps(lane: WidthByStation) -> list[tuple[int, int]]:
    """Return (first, last) point of every straight piece of a lane's widths that has the width 0 at one of its ends."""
    if lane.constant:
        return []
    slope = np.diff(lane.width) / np.diff(lane.station)
    same = np.abs(np.diff(slope)) <= SAME_SLOPE * np.abs(slope[1:])
    pieces: list[tuple[int, int]] = []
    for i in range(len(slope)):
        if pieces and same[i - 1]:
            pieces[-1] = (pieces[-1][0], i + 1)
        else:
            pieces.append((i, i + 1))
    zero = lane.width < NO_LANE
    return [(first, last) for first, last in pieces if zero[first] != zero[last]]


def _lane_width(road: Road) -> Iterator[Finding]:
    least, names = least_lane(road), ", ".join(SECTIONS_OF_CLASS[road.design_class])
    for name, edges in road.sides.items():
        for i, lane in enumerate(edges.lane_widths):
            narrow = (lane.width < least * (1.0 - TOLERANCE)) & (lane.width >= NO_LANE)
            for first, last in _lane_ramps(lane):
                narrow[first + 1 : last] = False
            for first, last in stretches(narrow):
                worst = first + int(np.argmin(lane.width[first : last + 1]))
                value, station = float(lane.width[worst]), float(lane.station[worst])
                text = f"Lane {i + 1} is {value:.2f} m wide; {least:.2f} m are needed (RAA, {names})."
                yield Finding(name, min(max(station, 0.0), road.length), value, least, text)


def lane_tapers(road: Road, edges: Edges) -> Iterator[tuple[int, float, float]]:
    """Yield (lane, first station, last station) of every stretch on the road on which a lane begins or ends."""
    for i, lane in enumerate(edges.lane_widths):
        for first, last in _lane_ramps(lane):
            begin, end = float(lane.station[first]), float(lane.station[last])
            if begin < road.length - SAME_STATION and end > SAME_STATION:
                yield i, begin, end


def _lane_taper(road: Road) -> Iterator[Finding]:
    least = LANE_TAPER_LENGTH[road.design_class]
    for name, edges in road.sides.items():
        for lane, begin, end in lane_tapers(road, edges):
            if below(end - begin, least):
                text = f"Lane {lane + 1} begins or ends over {end - begin:.1f} m; {least:.0f} m are needed (RAA)."
                yield Finding(name, max(begin, 0.0), end - begin, least, text)


def _median_width(road: Road) -> Iterator[Finding]:
    if len(road.sides) < 2:
        return
    width = np.sum([edges.inner(road.marks) for edges in road.sides.values()], axis=0)
    name = next(iter([*road.of(Median), *road.sides]))
    for first, last in stretches(width < LEAST_MEDIAN * (1.0 - TOLERANCE)):
        worst = first + int(np.argmin(width[first : last + 1]))
        value = float(width[worst])
        text = f"The median is {value:.2f} m wide; {LEAST_MEDIAN} m are needed (RAA)."
        yield Finding(name, float(road.marks[worst]), value, LEAST_MEDIAN, text)


def _is_standard(edges: Edges) -> bool:
    """Return whether a carriageway's lanes are those of a standard cross-section."""
    lanes = tuple(nominal_width(lane.width) for lane in edges.carriageway.lanes)
    return any(section.lanes == lanes for section in STANDARD_CROSS_SECTIONS.values())


def _strip(road: Road, what: str, field: str, least: float) -> Iterator[Finding]:
    """Yield where a strip of a standard cross-section is narrower than in those of the class."""
    for name, edges in road.sides.items():
        if not _is_standard(edges):
            continue
        width: AnyWidth = getattr(edges.carriageway, field)
        points = [(p.station, p.width) for p in width] if isinstance(width, tuple) else [(0.0, width)]
        station, value = min(points, key=lambda point: point[1])
        if below(value, least):
            text = f"The {what} is {value:.2f} m wide; the class's standard cross-sections have {least} m (RAA)."
            yield Finding(name, min(max(station, 0.0), road.length), value, least, text)


def _hard_shoulder(road: Road) -> Iterator[Finding]:
    least = min(section.hard_shoulder for section in _standard(road))
    yield from _strip(road, "hard shoulder", "hard_shoulder_width", least)


def _edge_strip(road: Road) -> Iterator[Finding]:
    outer = min(section.outer_edge_strip for section in _standard(road))
    inner = min(section.inner_edge_strip for section in _standard(road))
    yield from _strip(road, "outer edge strip", "outer_edge_strip_width", outer)
    yield from _strip(road, "inner edge strip", "inner_edge_strip_width", inner)


def _verge(road: Road) -> Iterator[Finding]:
    yield from _strip(road, "verge", "verge_width", min(section.verge for section in _standard(road)))


def _rut_lane(road: Road) -> Iterator[Finding]:
    for name, edges in road.sides.items():
        for i, rut in enumerate(edges.carriageway.pavement.ruts):
            needed, narrowest, station = rut.track + rut.width, 0.0, rut.start_station
            if rut.lane < len(edges.lane_widths):
                at = edges.between(rut.start_station, rut.end_station)
                width = edges.lane_widths[rut.lane](at)
                narrowest, station = float(width.min()), float(at[int(np.argmin(width))])
            if below(narrowest, needed):
                text = (
                    f"Rut {i + 1} takes {needed:.2f} m, and lane {rut.lane + 1} that it lies in is {narrowest:.2f} m "
                    "wide there."
                )
                yield Finding(name, station, narrowest, needed, text)


def _pothole_pavement(road: Road) -> Iterator[Finding]:
    for name, edges in road.sides.items():
        potholes = edges.carriageway.pavement.potholes
        if not potholes:
            continue
        station = np.array([pothole.station for pothole in potholes])
        over = _beyond_pavement(edges, potholes, station)
        for i in np.flatnonzero(over > TOLERANCE).tolist():
            text = f"Pothole {i + 1} reaches {over[i]:.2f} m beyond the carriageway's pavement."
            yield Finding(name, float(station[i]), float(over[i]), 0.0, text)


def _beyond_pavement(edges: Edges, potholes: tuple[Pothole, ...], station: Float) -> Float:
    """Return how far (N,) potholes reach beyond the piece of pavement that they lie on most, m."""
    offset = np.array([pothole.offset for pothole in potholes])
    half = np.array([pothole.width for pothole in potholes]) / 2.0
    low, high = edges.distances(offset - half, offset + half)
    across = edges.at(station)
    main = np.maximum(across.inner - low, high - across.gap_low)
    ramp = np.maximum(across.gap_high - low, high - across.outer)
    return np.minimum(main, ramp)


RULES = (
    Rule("width-order", "Points of widths are in order", "m", "", "definition", _width_order),
    Rule("lane-width", "Narrowest lane", "m", "RAA", "confirmed", _lane_width),
    Rule("lane-taper", "Length over which a lane begins or ends", "m", "RAA", "unconfirmed", _lane_taper),
    Rule("median-width", "Narrowest median", "m", "RAA", "confirmed", _median_width),
    Rule("hard-shoulder-width", "Narrowest hard shoulder", "m", "RAA", "derived", _hard_shoulder),
    Rule("edge-strip-width", "Narrowest edge strips", "m", "RAA", "derived", _edge_strip),
    Rule("verge-width", "Narrowest verge", "m", "RAA", "confirmed", _verge),
    Rule("rut-lane", "Ruts lie within a lane that is there", "m", "", "definition", _rut_lane),
    Rule("pothole-pavement", "Potholes lie on the pavement", "m", "", "definition", _pothole_pavement),
)
