"""Lane sections with their lanes: widths, links, heights of the verges and road marks."""

from collections.abc import Mapping

import numpy as np

from ...road.objects import Side
from ...road.section import BAYS, Lane, Turnout
from ...road.streets.street_geometry import BEYOND_PLANE, STREET_STRIPS
from ...road.turnout_geometry import TURNOUT_STRIPS
from ..speeds import SpeedLimits
from .marks import RoadMarks
from .pieces import Float, chord_stations, fit_cubics, join_cubics, merge_similar
from .sections import LanePlan, LaneSection, LaneStrip
from .xml import Element, add_cubic, add_user_data, element

HEIGHT_TOLERANCE = 1e-4
"""Largest distance (m) of a verge's edge from what is interpolated between two lane heights."""
_BEFORE_JUMP = 5e-7
"""Distance of two heights between which one jumps, m. Chosen: half of that up to which two stations are one."""

_WITH_LIMIT = ("driving", "exit", "entry")
"""Types of the lanes to which the carriageway's speed limits apply."""
_LEAVING_PLANE = ("verge", "median", *TURNOUT_STRIPS, *BEYOND_PLANE)
"""Strips whose edges may lie off the carriageway's plane."""
_CLOSED = "stop"
"""Type of the lanes that only emergency vehicles may drive on."""


def write_lanes(road: Element, plan: LanePlan, limits: Mapping[Side, SpeedLimits], marks: RoadMarks) -> None:
    """Add the `lanes` element to a road: the lane offset, then every lane section with its lanes and road marks."""
    parent = element(road, "lanes")
    _add_lane_offset(parent, plan)
    for number, section in enumerate(plan.sections):
        item = element(parent, "laneSection", {"s": section.start})
        _add_side(item, plan, limits, marks, (number, "left"))
        centre = element(element(item, "center"), "lane", {"id": 0, "type": "none", "level": False})
        marks.write(centre, number, 0)
        _add_side(item, plan, limits, marks, (number, "right"))


def _add_lane_offset(parent: Element, plan: LanePlan) -> None:
    """Add `laneOffset` elements that shift the centre lane to the carriageway's inner edge."""
    offsets = fit_cubics(lambda station: plan.offsets(station, plan.side)[:, :1], plan.frame.borders)
    rows = join_cubics(offsets.borders, offsets.coefficients[:, 0])
    for start, coefficients in merge_similar(rows, float(offsets.borders[-1])):
        add_cubic(parent, "laneOffset", {"s": start}, coefficients)


def _add_side(
    parent: Element,
    plan: LanePlan,
    limits: Mapping[Side, SpeedLimits],
    marks: RoadMarks,
    section_and_side: tuple[int, Side],
) -> None:
    """Add the lanes of one side of a lane section, ordered from left to right."""
    number, side = section_and_side
    section = plan.sections[number]
    if not section.lanes[side]:
        return
    group = element(parent, side)
    sign = 1 if side == "left" else -1
    numbered_lanes = list(enumerate(section.lanes[side], 1))
    for lane_number, strip in reversed(numbered_lanes) if sign > 0 else numbered_lanes:
        lane = element(group, "lane", {"id": sign * lane_number, "type": strip.type, "level": False})
        _links(lane, plan, number, side, strip)
        _widths(lane, plan, section, strip)
        marks.write(lane, number, sign * lane_number)
        if side in limits:
            _traffic(lane, limits[side], section, strip)
        if strip.kind in _LEAVING_PLANE or len(plan.frame.sides) > 1:
            _heights(lane, plan, section, side, strip)
        _notes(lane, plan, side, strip)


def _links(lane: Element, plan: LanePlan, number: int, side: Side, strip: LaneStrip) -> None:
    """Add the links of a lane to the lanes that continue the same strip in the sections before and after."""
    sign = 1 if side == "left" else -1
    links = {
        tag: plan.continuing_lane(number, neighbour, side, strip.column)
        for tag, neighbour in (("predecessor", number - 1), ("successor", number + 1))
    }
    if any(links.values()):
        link = element(lane, "link")
        for tag, neighbour in links.items():
            if neighbour is not None:
                element(link, tag, {"id": sign * neighbour})


def _widths(lane: Element, plan: LanePlan, section: LaneSection, strip: LaneStrip) -> None:
    """Add a lane's `width` elements: cubics over the distance from the lane section's start."""
    first_piece, end_piece = section.pieces
    borders = plan.widths.borders[first_piece : end_piece + 1]
    pieces = plan.widths.coefficients[first_piece:end_piece, strip.column]
    rows = [(start - section.start, coefficients) for start, coefficients in join_cubics(borders, pieces)]
    for start, coefficients in merge_similar(rows, section.end - section.start):
        add_cubic(lane, "width", {"sOffset": start}, coefficients)


def _traffic(lane: Element, limits: SpeedLimits, section: LaneSection, strip: LaneStrip) -> None:
    """Add speed limits to a lane that is driven on, and access for emergency vehicles only to a hard shoulder."""
    if strip.type in _WITH_LIMIT:
        for start, speed in limits.limits_between(section.start, section.end):
            element(lane, "speed", {"sOffset": start - section.start, "max": speed, "unit": "km/h"})
    elif strip.type == _CLOSED:
        element(lane, "access", {"sOffset": 0.0, "rule": "allow", "restriction": "emergency"})


def _heights(lane: Element, plan: LanePlan, section: LaneSection, side: Side, strip: LaneStrip) -> None:
    """Add the `height` elements of a lane whose edges leave the road's plane: verge, median, a ramp's, a roof's."""

    first_piece, end_piece = section.pieces
    borders = plan.widths.borders[first_piece : end_piece + 1]
    last_within = np.nextafter(borders[-1], borders[0])

    def heights(station: Float) -> Float:
        """Return the heights (N, 2) of the lane's inner and outer edge above the carriageway's plane, m."""
        station = np.minimum(station, last_within)  # the next section has its own height at the border
        if strip.kind == "median":
            falls = np.column_stack([np.zeros(len(station)), plan.median_fall(station)])
        else:
            falls = plan.falls(station, side)[:, strip.index : strip.index + 2]
        return np.column_stack([plan.frame.h_coordinate(station, fall) for fall in falls.T])

    # Where the line has a kink in height, what is normal to it jumps: a record just before it has the height up to it.
    stations_before = borders[1:-1] - _BEFORE_JUMP
    has_jump = np.abs(heights(stations_before) - heights(borders[1:-1])).max(axis=1, initial=0.0) > HEIGHT_TOLERANCE
    stations = chord_stations(heights, np.sort(np.append(borders, stations_before[has_jump])), HEIGHT_TOLERANCE)
    values = heights(stations)
    if np.ptp(values, axis=0).max() <= HEIGHT_TOLERANCE / 10.0:
        stations, values = stations[:1], values[:1]
        if strip.kind not in ("verge", "median") and np.abs(values).max() <= HEIGHT_TOLERANCE / 10.0:
            return
    for station, (inner, outer) in zip(stations.tolist(), values.tolist(), strict=True):
        edges = {"inner": round(inner, 6) + 0.0, "outer": round(outer, 6) + 0.0}
        element(lane, "height", {"sOffset": station - section.start, **edges})


def _notes(lane: Element, plan: LanePlan, side: Side, strip: LaneStrip) -> None:
    """Add to a lane as user data what OpenDRIVE has no place for: instance number, kind of strip, turnout, lane."""
    add_user_data(lane, "instance", strip.instance)
    add_user_data(lane, "strip", strip.kind)
    if strip.kind in (*TURNOUT_STRIPS, *STREET_STRIPS):
        items = plan.geometry.parameters.objects.items()
        name, item = next((name, item) for name, item in items if item.instance == strip.instance)
        add_user_data(lane, "id", name)
        if isinstance(item, Turnout) and strip.kind == "bay" and item.kind != BAYS[0]:
            add_user_data(lane, "kind", item.kind)
    if strip.kind == "lane":
        section = plan.section(side)
        index = len(section.carriageway.lanes) - 1 - (strip.index - section.kinds.index("lane"))
        carriageway_lane: Lane = section.carriageway.lanes[index]
        add_user_data(lane, "lane", index)
        add_user_data(lane, "kind", carriageway_lane.kind)
