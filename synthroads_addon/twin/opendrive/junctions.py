"""Junctions where side roads join: the main road in pieces, the side road, and the ways from one to the other.

A piece of the main road within a junction is a connecting road that both directions drive through. For each turn there
is a connecting road with one lane, whose reference line is the lane's middle.
"""

from __future__ import annotations

import copy
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from ...base.arrays import Float
from ...road.geometry import RoadGeometry
from ...road.guidelines import GUIDELINE_OF_CLASS
from ...road.objects import Side
from ...road.side_roads.mouth import Mouth
from .numbers import FreeIds
from .pieces import merge_similar, shift_cubic, value_of_cubic
from .sections import RULES, LanePlan
from .surface import BESIDE, plan_range
from .xml import Element, Value, add_cubic, add_object_data, add_user_data, element

_STEP = 2.0
"""Spacing of heights along a turn, m."""
_SAMPLES = 400
_QUARTER = 4.0 / 3.0
_FROM_CORNER = 0.1
"""Distance (m) behind corners and blend at which the side road's own `road` begins."""
_ENDS = ("start", "end")
"""Contact points of roads."""
_LOCAL = 0.05
"""Distance (m) over which the slope across a turn is measured."""


def junction_borders(geometry: RoadGeometry) -> list[float]:
    """Return the stations (m) at which the main road is divided for its junctions, in order, two for each side road.

    Junctions of side roads that are opposite each other overlap, and are one.
    """
    return [station for group in _groups(geometry) for station in group[0]]


def _groups(geometry: RoadGeometry) -> list[tuple[tuple[float, float], list[str]]]:
    """Return the stations of each junction, and the ids of its side roads."""
    groups: list[tuple[tuple[float, float], list[str]]] = []
    spans = sorted(
        (mouth.low.start_station - BESIDE, mouth.high.start_station + BESIDE, name)
        for name, mouth in geometry.mouths.items()
    )
    for start, end, name in spans:
        if groups and start < groups[-1][0][1] + 2.0 * BESIDE:
            (first, last), names = groups[-1]
            groups[-1] = (first, max(last, end)), [*names, name]
        else:
            groups.append(((start, end), [name]))
    return groups


@dataclass(frozen=True)
class RampEnd:
    """A ramp that joins a road at a mouth.

    Attributes:
        road: its `road` element.
        to_junction: whether its traffic drives towards the mouth.
    """

    road: Element
    to_junction: bool


@dataclass(frozen=True)
class RampCut:
    """Where a ramp goes on from a turnout of the main road.

    Attributes:
        name: of the junction.
        span: stations (m) of the main road that the junction takes.
        leaves_forward: whether the turnout lies before the junction.
        is_exit: whether its traffic leaves the main road.
        connector: `road` element of the ramp's first metres.
        road: that of the rest of it.
    """

    name: str
    span: tuple[float, float]
    leaves_forward: bool
    is_exit: bool
    connector: Element
    road: Element

    @property
    def ramp(self) -> int:
        """Return the id of the ramp's `road`."""
        return int(self.road.attrib["id"])


@dataclass(frozen=True)
class _End:
    """Where a lane ends at a junction.

    Attributes:
        road, contact, lane: id of the `road`, its contact point, and the lane's number.
        point: (3,) middle of the lane, local, m.
        heading: in which it is driven there, rad.
        width: m.
    """

    road: int
    contact: str
    lane: int
    point: Float
    heading: float
    width: float


def write_junctions(
    root: Element, road: Element, plan: LanePlan, numbers: FreeIds, ramps: Mapping[str, RampEnd] | None = None
) -> list[int]:
    """Divide the main road's element at its side roads, and add these, their turns and junctions; return the new ids.

    Args:
        root: of the file; the road is in it.
        road: the whole main road's element.
        plan: its lanes.
        numbers: ids for pieces, turns and junctions.
        ramps: what of its mouths are ramps, by id; these are no side roads, and have roads of their own.
    """
    geometry, ramps = plan.geometry, ramps or {}
    borders = [0.0, *junction_borders(geometry), geometry.length]
    ids = [int(road.attrib["id"]), *(numbers.take() for _ in borders[2:])]
    pieces = [
        _piece(road, plan, (start, end), number, numbers)
        for start, end, number in zip(borders[:-1], borders[1:], ids, strict=True)
    ]
    root.remove(road)
    root.extend(pieces)
    for place, (span, names) in enumerate(_groups(geometry)):
        junction = numbers.take()
        before, inside, after = ids[2 * place : 2 * place + 3]
        _link_pieces(pieces[2 * place : 2 * place + 3], (before, after), junction)
        connections: list[tuple[int, int, str, list[tuple[int, int]]]] = []
        driven = _driven_lanes(plan, span)
        for side in _by_traffic(plan, driven):
            lanes = [(_lane_number(side, n), _lane_number(side, n)) for n in driven[side]]
            is_with_stations = plan.section(side).carriageway.traffic > 0
            incoming, contact = (before, "start") if is_with_stations else (after, "end")
            connections.append((incoming, inside, contact, lanes))
        for name in names:
            mouth = geometry.mouths[name]
            ramp = ramps.get(name)
            if ramp is None:
                root.append(_side_road(geometry, name, mouth, junction))
            else:
                link_road(ramp.road, "successor", {"elementType": "junction", "elementId": junction})
            for begin, end in _turns(plan, mouth, span, (before, after), ramp):
                turn = numbers.take()
                root.append(_turn(geometry, f"{name}-turn", turn, junction, begin, end))
                lane = _turning_lane(geometry)
                connections.append((begin.road, turn, "start", [(begin.lane, lane)]))
        item = element(root, "junction", {"name": "-".join(names), "id": junction, "type": "default"})
        for number, (incoming, connecting, contact, lanes) in enumerate(connections):
            entry = element(
                item,
                "connection",
                {"id": number, "incomingRoad": incoming, "connectingRoad": connecting, "contactPoint": contact},
            )
            for start_lane, end_lane in lanes:
                element(entry, "laneLink", {"from": start_lane, "to": end_lane})
    _junctions_last(root)
    return ids[1:]


def _junctions_last(root: Element) -> None:
    """Move the junctions behind all roads, as the standard's schema has them, and what else there is behind these."""
    order = {"header": 0, "road": 1, "controller": 2, "junction": 3}
    root[:] = sorted(root, key=lambda item: order.get(item.tag, 4))


# --- pieces of the main road --------------------------------------------------------------------------------------


def _piece(road: Element, plan: LanePlan, span: tuple[float, float], number: int, numbers: FreeIds) -> Element:
    """Return the main road's element between two stations (m) as a `road` of its own."""
    start, end = span
    piece = element(None, "road", {**road.attrib, "id": number, "length": end - start})
    for child in road:
        if child.tag == "planView":
            plan_range(piece, plan.geometry, start, end)
        elif child.tag in ("elevationProfile", "lateralProfile"):
            _cut_cubics(element(piece, child.tag), list(child), start, end)
        elif child.tag == "lanes":
            lanes = element(piece, "lanes")
            _cut_cubics(lanes, child.findall("laneOffset"), start, end)
            for section in child.findall("laneSection"):
                if start - 1e-6 <= float(section.attrib["s"]) < end - 1e-6:
                    moved = copy.deepcopy(section)
                    moved.set("s", element(None, "s", {"s": max(float(section.attrib["s"]) - start, 0.0)}).attrib["s"])
                    lanes.append(moved)
        elif child.tag in ("objects", "signals"):
            _cut_objects(element(piece, child.tag), child, span, end >= plan.geometry.length, numbers)
        else:
            piece.append(copy.deepcopy(child))
    return piece


def _cut_cubics(parent: Element, rows: list[Element], start: float, end: float) -> None:
    """Add the cubics that hold between two stations (m), counted from the first."""
    starts = [float(row.attrib["s"]) for row in rows]
    for row, begin, until in zip(rows, starts, [*starts[1:], np.inf], strict=True):
        if until <= start + 1e-6 or begin >= end - 1e-6:
            continue
        cubic = np.array([float(row.attrib[name]) for name in "abcd"])
        if begin < start:
            cubic = shift_cubic(cubic, start - begin)
        add_cubic(parent, row.tag, {"s": max(begin - start, 0.0)}, cubic.tolist())


def _cut_objects(
    parent: Element, children: Element, span: tuple[float, float], is_last: bool, numbers: FreeIds
) -> None:
    """Add the objects and signals between two stations (m); what runs on is cut, its parts with ids of their own."""
    start, end = span
    for child in children:
        repeats = child.findall("repeat")
        if not repeats:
            s = float(child.attrib["s"])
            if start <= s < end or (s >= end and is_last):
                moved = copy.deepcopy(child)
                _move(moved, -start)
                parent.append(moved)
            continue
        parts = [part for repeat in repeats if (part := _cut_repeat(repeat, start, end)) is not None]
        if not parts:
            continue
        moved = copy.deepcopy(child)
        for repeat in moved.findall("repeat"):
            moved.remove(repeat)
        first = parts[0]
        if float(repeats[0].attrib["s"]) < start:
            moved.set("id", str(numbers.take()))
        texts: dict[str, Value] = {"s": first["s"], "t": first["tStart"], "zOffset": first["zOffsetStart"]}
        texts["length"] = sum(part["length"] for part in parts)
        for key, text in element(None, "x", texts).attrib.items():
            moved.set(key, text)
        for place, part in enumerate(parts):
            moved.insert(place, element(None, "repeat", part))
        parent.append(moved)


def _cut_repeat(repeat: Element, start: float, end: float) -> dict[str, float] | None:
    """Return a repeat's attributes between two stations (m), linear in between, counted from the first; or None."""
    values = {key: float(text) for key, text in repeat.attrib.items()}
    begin, length = float(repeat.attrib["s"]), float(repeat.attrib["length"])
    low, high = max(begin, start), min(begin + length, end)
    if high - low <= 1e-6:
        return None
    for name in ("t", "height", "zOffset", "width"):
        first, last = float(repeat.attrib[f"{name}Start"]), float(repeat.attrib[f"{name}End"])
        for word, place in (("Start", low), ("End", high)):
            values[f"{name}{word}"] = first + (last - first) * (place - begin) / length
    return values | {"s": low - start, "length": high - low}


def _move(item: Element, distance: float) -> None:
    """Add a distance (m) to the stations of an object and its corners, in place."""
    for part in item.iter():
        if "s" in part.attrib and part.tag in ("object", "signal", "cornerRoad", "tunnel"):
            part.set("s", element(None, "s", {"s": max(float(part.attrib["s"]) + distance, 0.0)}).attrib["s"])


def _link_pieces(pieces: list[Element], ids: tuple[int, int], junction: int) -> None:
    """Add the links of the pieces before, in and after a junction."""
    before, inside, after = pieces
    inside.set("junction", str(junction))
    link_road(inside, "predecessor", {"elementType": "road", "elementId": ids[0], "contactPoint": "end"})
    link_road(inside, "successor", {"elementType": "road", "elementId": ids[1], "contactPoint": "start"})
    link_road(before, "successor", {"elementType": "junction", "elementId": junction})
    link_road(after, "predecessor", {"elementType": "junction", "elementId": junction})
    # Lanes beside a junction are linked by its connections.
    for piece, section, tag in ((before, -1, "successor"), (after, 0, "predecessor")):
        for lane in piece.findall("lanes/laneSection")[section].iter("lane"):
            link = lane.find("link")
            found = None if link is None else link.find(tag)
            if link is not None and found is not None:
                link.remove(found)
                if not len(link):
                    lane.remove(link)


def link_road(road: Element, tag: str, attributes: dict[str, Value]) -> None:
    """Add one end's link to a road; its `link` comes first, the predecessor before the successor."""
    parent = road.find("link")
    if parent is None:
        parent = element(None, "link")
        road.insert(0, parent)
    parent.insert(0 if tag == "predecessor" else len(parent), element(None, tag, attributes))


def _driven_lanes(plan: LanePlan, span: tuple[float, float]) -> dict[Side, list[int]]:
    """Return the unsigned numbers of the lanes that are driven through a junction, from the inside out, by side."""
    section = next(item for item in plan.sections if item.start <= span[0] + 1e-6 < item.end)
    return {
        side: [number for number, lane in enumerate(section.lanes[side], 1) if lane.kind == "lane"]
        for side in section.lanes
    }


# --- the side road ------------------------------------------------------------------------------------------------


def _begin_u(mouth: Mouth) -> float:
    """Return u (m) at which a side road's own `road` begins: behind its corners, where its surface is its own."""
    road = mouth.side_road
    angle = np.deg2rad(road.angle_deg)
    blended = road.blend_length / np.sin(angle) + road.half_width / abs(np.tan(angle)) * (
        abs(road.angle_deg - 90.0) > 0
    )
    return float(max(mouth.low.end_u, mouth.high.end_u, blended)) + _FROM_CORNER


def _side_road(geometry: RoadGeometry, name: str, mouth: Mouth, junction: int) -> Element:
    """Return a side road's `road` element, outwards from its mouth: its lanes, edge strips and verges."""
    side_road = mouth.side_road
    begin = _begin_u(mouth)
    angle = np.deg2rad(side_road.angle_deg)
    reach = min(side_road.length, _built_length(geometry, mouth))
    length = reach - side_road.half_width / abs(np.tan(angle)) * (abs(side_road.angle_deg - 90.0) > 0) - begin
    own: dict[str, Value] = {"name": name, "id": side_road.instance, "junction": "-1", "length": length}
    road = element(None, "road", own | {"rule": RULES[geometry.parameters.traffic_side]})
    link_road(road, "predecessor", {"elementType": "junction", "elementId": junction})
    element(road, "type", {"s": 0.0, "type": "rural", "country": _country(geometry)})
    _straight(element(road, "planView"), mouth, begin, length)
    profile = element(road, "elevationProfile")
    height = float(mouth.own_surface(np.array([begin]), np.zeros(1))[0])
    grade = side_road.grade_percent / 100.0
    add_cubic(profile, "elevation", {"s": 0.0}, [height, grade, 0.0, 0.0])
    element(road, "lateralProfile")
    section = element(element(road, "lanes"), "laneSection", {"s": 0.0})
    strips = _side_strips(mouth)
    for sign, tag in ((1, "left"), (-1, "right")):
        group = element(None, tag)
        lanes = []
        inner = 0.0
        for number, (kind, lane_type, width) in enumerate(strips, 1):
            lane = element(None, "lane", {"id": sign * number, "type": lane_type, "level": False})
            add_cubic(lane, "width", {"sOffset": 0.0}, [width, 0.0, 0.0, 0.0])
            # Left of the axis, seen outwards, is the side of lower stations at the left carriageway.
            v_sign = -mouth.sign * sign
            falls = [_fall(mouth, v_sign, d) for d in (inner, inner + width)]
            element(lane, "height", {"sOffset": 0.0, "inner": round(-falls[0], 6), "outer": round(-falls[1], 6)})
            add_user_data(lane, "instance", side_road.instance)
            add_user_data(lane, "strip", kind)
            lanes.append(lane)
            inner += width
        group.extend(lanes[::-1] if sign > 0 else lanes)
        if tag == "left":
            section.append(group)
            element(element(section, "center"), "lane", {"id": 0, "type": "none", "level": False})
        else:
            section.append(group)
    add_object_data(road, name, side_road.instance, object_type="SideRoad")
    return road


def _straight(plan: Element, mouth: Mouth, begin: float, length: float) -> None:
    """Add the line of a side road's axis from a place u (m) on, of a length (m), to its plan."""
    x, y = mouth.place(np.array([begin]), np.zeros(1))[0].tolist()
    heading = float(np.arctan2(mouth.ahead[1], mouth.ahead[0]))
    line = element(plan, "geometry", {"s": 0.0, "x": x, "y": y, "hdg": heading, "length": length})
    element(line, "line")


def _country(geometry: RoadGeometry) -> str:
    """Return the road's country by ISO 3166."""
    return GUIDELINE_OF_CLASS[geometry.parameters.design_class].country


def _fall(mouth: Mouth, v_sign: float, distance: float) -> float:
    """Return how far (m) a side road lies below its axis at a distance (m) from it, towards one side of v."""
    road = mouth.side_road
    fall = road.crossfall_percent / 100.0
    paved = min(distance, road.half_width)
    lower = fall * paved if road.lanes > 1 else fall * v_sign * paved
    return lower + max(distance - road.half_width, 0.0) * mouth.section.carriageway.verge_slope_percent / 100.0


def _side_strips(mouth: Mouth) -> list[tuple[str, str, float]]:
    """Return kind, OpenDRIVE type and width (m) of a side road's strips on either side of its axis."""
    road = mouth.side_road
    strips = [("lane", "driving", road.lane_width * road.lanes / 2.0)]
    if road.edge_strip_width > 0.0:
        strips.append(("outer_edge_strip", "border", road.edge_strip_width))
    return [*strips, ("verge", "shoulder", mouth.verge_width)]


def _built_length(geometry: RoadGeometry, mouth: Mouth) -> float:
    """Return the length (m) of the axis up to which a side road is built: the terrain's reach at most."""
    if geometry.terrain is None:
        return mouth.side_road.length
    edge = float(mouth.section.paved_edge(np.array([mouth.station]))[0])
    return (geometry.terrain.half_width - edge) / float(np.sin(np.deg2rad(mouth.side_road.angle_deg)))


# --- turns --------------------------------------------------------------------------------------------------------


def _turns(
    plan: LanePlan, mouth: Mouth, span: tuple[float, float], ids: tuple[int, int], ramp: RampEnd | None = None
) -> Iterator[tuple[_End, _End]]:
    """Yield where each of the four turns begins and ends: into the side road and out of it, to and from either side."""
    before, after = ids
    driven = _driven_lanes(plan, span)
    near: Side = "right" if mouth.sign < 0.0 else "left"
    lanes = {side: driven[side][-1] if side == near else driven[side][0] for side in driven}
    into, out = _side_end(mouth, outwards=True), _side_end(mouth, outwards=False)
    if ramp is not None:
        into, out = (_ramp_end(mouth, ramp, outwards) for outwards in (True, False))
        # A ramp has one direction.
        ends = [
            _main_end(
                plan,
                "right",
                lanes["right"],
                span[ramp.to_junction],
                ids[ramp.to_junction],
                _ENDS[not ramp.to_junction],
            ),
            _main_end(
                plan,
                "left",
                lanes["left"],
                span[not ramp.to_junction],
                ids[not ramp.to_junction],
                _ENDS[ramp.to_junction],
            ),
        ]
        for end in (
            _leaning(plan, end, place)
            for end, place in zip(ends, (span[ramp.to_junction], span[not ramp.to_junction]), strict=True)
        ):
            yield (out, end) if ramp.to_junction else (end, into)
        return
    for side in _by_traffic(plan, lanes):
        borders = [(span[0], before, "end"), (span[1], after, "start")]
        first, last = borders if plan.section(side).carriageway.traffic > 0 else borders[::-1]
        yield _main_end(plan, side, lanes[side], *first), into
        yield out, _main_end(plan, side, lanes[side], *last)


def _main_end(plan: LanePlan, side: Side, number: int, station: float, road: int, contact: str) -> _End:
    """Return where a lane of the main road ends at a junction."""
    geometry, section = plan.geometry, plan.section(side)
    place = np.array([station])
    lanes = next(item for item in plan.sections if item.start <= station + 1e-6 < item.end or item is plan.sections[-1])
    index = lanes.lanes[side][number - 1].index
    inner, outer = section.distances(place)[0, index : index + 2].tolist()
    offset = np.array([section.carriageway.sign * (inner + outer) / 2.0])
    point = np.append(geometry.alignment.place(place, offset)[0], geometry.main_elevation(place, offset))
    heading = float(geometry.alignment.heading(place)[0]) + (0.0 if section.carriageway.traffic > 0 else np.pi)
    return _End(road, contact, _lane_number(side, number), point, heading, outer - inner)


def _by_traffic(plan: LanePlan, sides: Iterable[Side]) -> list[Side]:
    """Return sides, first the one whose traffic goes with the stations."""
    return sorted(sides, key=lambda side: -plan.section(side).carriageway.traffic)


def _lane_number(side: Side, number: int) -> int:
    """Return a lane's number with its sign: positive to the left of the reference line."""
    return -number if side == "right" else number


def _turning_lane(geometry: RoadGeometry) -> int:
    """Return the number of a turn's lane, which is driven along its reference line."""
    return -1 if geometry.parameters.traffic_side == "right" else 1


def _leaning(plan: LanePlan, end: _End, station: float) -> _End:
    """Return a lane's end where readers see it, by the standard's formula for places of a road that climbs."""
    heading = float(plan.geometry.alignment.heading(np.array([station]))[0])
    shift = plan.frame.ahead_of_station(station, float(end.point[2]))
    return replace(end, point=end.point + shift * np.array([np.cos(heading), np.sin(heading), 0.0]))


def _side_end(mouth: Mouth, outwards: bool) -> _End:
    """Return where the side road's lane outwards or inwards ends at the junction."""
    u = np.array([_begin_u(mouth)])
    road = mouth.side_road
    width = road.lane_width * road.lanes / 2.0
    # Outwards on the one side of the axis, inwards on the other.
    v = np.array([-mouth.incoming * width / 2.0 * (1.0 if outwards else -1.0)])
    point = np.append(mouth.place(u, v)[0], mouth.own_surface(u, v))
    heading = float(np.arctan2(mouth.ahead[1], mouth.ahead[0])) + (0.0 if outwards else np.pi)
    # Lanes towards lower stations are left of the axis at the left carriageway, right of it at the right one.
    lane = -int(mouth.sign * float(np.sign(v[0])))
    return _End(road.instance, "start", lane, point, heading, width)


def begin_of_side(mouth: Mouth) -> float:
    """Return u (m) at which the junction of a mouth ends."""
    return _begin_u(mouth)


def _ramp_end(mouth: Mouth, ramp: RampEnd, outwards: bool) -> _End:
    """Return where a ramp's lane ends at the junction; away from the crossing road it is driven outwards."""
    u, v = np.array([_begin_u(mouth)]), np.zeros(1)
    point = np.append(mouth.place(u, v)[0], mouth.own_surface(u, v))
    heading = float(np.arctan2(mouth.ahead[1], mouth.ahead[0])) + (0.0 if outwards else np.pi)
    lane = -1 if ramp.to_junction else 1
    return _End(int(ramp.road.attrib["id"]), "end", lane, point, heading, mouth.side_road.lane_width)


def write_cuts(root: Element, road: Element, plan: LanePlan, numbers: FreeIds, cuts: Iterable[RampCut]) -> list[int]:
    """Divide a carriageway's element where ramps go on from its exits and entries; return the new ids.

    Args:
        root: of the file; the road is in it.
        road: the carriageway's element.
        plan: its lanes.
        numbers: ids for pieces and junctions.
        cuts: at which ramps go on.
    """
    cuts = sorted(cuts, key=lambda cut: cut.span[0])
    borders = [0.0, *(station for cut in cuts for station in cut.span), plan.geometry.length]
    ids = [int(road.attrib["id"]), *(numbers.take() for _ in borders[2:])]
    pieces = [
        _piece(road, plan, (start, end), number, numbers)
        for start, end, number in zip(borders[:-1], borders[1:], ids, strict=True)
    ]
    root.remove(road)
    root.extend(pieces)
    side = plan.side
    sign = 1 if side == "left" else -1
    for place, cut in enumerate(cuts):
        junction = numbers.take()
        before, inside, after = ids[2 * place : 2 * place + 3]
        _link_pieces(pieces[2 * place : 2 * place + 3], (before, after), junction)
        middle = (cut.span[0] + cut.span[1]) / 2.0
        driven = [sign * n for n in _driven_lanes(plan, (middle, middle))[side]]
        # The piece with the turnout lies before the cut, or behind it.
        beside = before if cut.leaves_forward else after
        section = plan.sections[_section_at(plan, cut.span[0] - _LOCAL if cut.leaves_forward else cut.span[1] + _LOCAL)]
        lane = sign * next(n for n, item in enumerate(section.lanes[side], 1) if item.kind == "turnout_lane")
        with_stations = plan.section(side).carriageway.traffic > 0
        first, contact = (before, "start") if with_stations else (after, "end")
        own = -1 if cut.is_exit else 1
        item = element(root, "junction", {"name": cut.name, "id": junction, "type": "default"})
        entries = [(first, inside, contact, [(n, n) for n in driven])]
        number = int(cut.connector.attrib["id"])
        entries.append(
            (beside, number, "start", [(lane, own)]) if cut.is_exit else (cut.ramp, number, "end", [(own, own)])
        )
        cut.connector.set("junction", str(junction))
        border = "end" if cut.leaves_forward else "start"
        link_road(cut.connector, "predecessor", {"elementType": "road", "elementId": beside, "contactPoint": border})
        link_road(cut.connector, "successor", {"elementType": "road", "elementId": cut.ramp, "contactPoint": "start"})
        driving = next(item for item in cut.connector.iter("lane") if item.attrib["type"] == "driving")
        links = element(None, "link")
        element(links, "predecessor", {"id": lane})
        element(links, "successor", {"id": own})
        driving.insert(0, links)
        root.append(cut.connector)
        link_road(cut.road, "predecessor", {"elementType": "junction", "elementId": junction})
        for entry_number, (incoming, connecting, point, lanes) in enumerate(entries):
            values: dict[str, Value] = {"id": entry_number, "incomingRoad": incoming, "connectingRoad": connecting}
            entry = element(item, "connection", values | {"contactPoint": point})
            for start_lane, end_lane in lanes:
                element(entry, "laneLink", {"from": start_lane, "to": end_lane})
    _junctions_last(root)
    return ids[1:]


def _section_at(plan: LanePlan, station: float) -> int:
    """Return the number of the lane section at a station, m."""
    return next(n for n, item in enumerate(plan.sections) if item.start <= station < item.end)


def _turn(geometry: RoadGeometry, name: str, number: int, junction: int, begin: _End, end: _End) -> Element:
    """Return the connecting road of a turn: one lane about a reference line from a lane's middle to another's."""
    cubic = _curve(begin, end)
    share = np.linspace(0.0, 1.0, _SAMPLES + 1)
    plan, tangent = _points(cubic, begin, share), _tangents(cubic, begin, share)
    steps = np.linalg.norm(np.diff(plan, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    length = float(along[-1])
    rule, turning_lane = RULES[geometry.parameters.traffic_side], _turning_lane(geometry)
    road = element(
        None, "road", {"name": name, "id": number, "junction": str(junction), "length": length, "rule": rule}
    )
    for tag, place in (("predecessor", begin), ("successor", end)):
        link_road(road, tag, {"elementType": "road", "elementId": place.road, "contactPoint": place.contact})
    x, y = begin.point[:2].tolist()
    attributes: dict[str, Value] = {"s": 0.0, "x": x, "y": y, "hdg": float(np.angle(np.exp(1j * begin.heading)))}
    item = element(element(road, "planView"), "geometry", attributes | {"length": length})
    names = [f"{letter}{axis}" for axis in "UV" for letter in "abcd"]
    values = {key: f"{value + 0.0:.12g}" for key, value in zip(names, cubic.ravel().tolist(), strict=True)}
    element(item, "paramPoly3", {**values, "pRange": "normalized"})
    rows = np.linspace(0.0, length, max(3, int(np.ceil(length / _STEP)) + 1))
    picked = np.interp(rows, along, np.arange(len(along)))
    index = np.round(picked).astype(int)
    left = np.stack([-tangent[index, 1], tangent[index, 0]], axis=1)
    middle, beside = plan[index], plan[index] + _LOCAL * left
    heights, further = _surface(geometry, middle), _surface(geometry, beside)
    heights[0], heights[-1] = begin.point[2], end.point[2]
    _linear(element(road, "elevationProfile"), "elevation", rows, heights)
    _linear(
        element(road, "lateralProfile"),
        "superelevation",
        rows,
        np.arctan((further - _surface(geometry, middle)) / _LOCAL),
    )
    lanes = element(road, "lanes")
    growth = (end.width - begin.width) / length
    inner = -turning_lane / 2.0
    add_cubic(lanes, "laneOffset", {"s": 0.0}, [inner * begin.width, inner * growth, 0.0, 0.0])
    section = element(lanes, "laneSection", {"s": 0.0})
    centre = element(section, "center")
    element(centre, "lane", {"id": 0, "type": "none", "level": False})
    group = element(None, "right" if turning_lane < 0 else "left")
    section.insert(1 if turning_lane < 0 else 0, group)
    lane = element(group, "lane", {"id": turning_lane, "type": "driving", "level": False})
    link = element(lane, "link")
    element(link, "predecessor", {"id": begin.lane})
    element(link, "successor", {"id": end.lane})
    add_cubic(lane, "width", {"sOffset": 0.0}, [begin.width, growth, 0.0, 0.0])
    return road


def _linear(parent: Element, tag: str, place: Float, values: Float) -> None:
    """Add a function that is linear between places (N,), m."""
    slopes = np.diff(values) / np.diff(place)
    rows = [
        (s, [value, slope, 0.0, 0.0])
        for s, value, slope in zip(place[:-1].tolist(), values[:-1].tolist(), slopes.tolist(), strict=True)
    ]
    for s, coefficients in merge_similar(rows, float(place[-1])):
        add_cubic(parent, tag, {"s": s}, coefficients)


def _surface(geometry: RoadGeometry, points: Float) -> Float:
    """Return the road's local elevations (N,) at local points (N, 2), m."""
    station, offset = geometry.alignment.project(points)
    return geometry.elevation(station, offset)


def _curve(begin: _End, end: _End) -> Float:
    """Return the coefficients (2, 4) of a curve from one place to another, along its heading and to the left of it.

    Its handles are those of an arc between two tangents, each as long as its tangent asks for.
    """
    turn = float(np.angle(np.exp(1j * (end.heading - begin.heading))))
    vector = end.point[:2] - begin.point[:2]
    cosine, sine = np.cos(begin.heading), np.sin(begin.heading)
    ahead = float(vector[0] * cosine + vector[1] * sine)
    left = float(vector[1] * cosine - vector[0] * sine)
    last_tangent = left / np.sin(turn)
    first_tangent = ahead - last_tangent * np.cos(turn)
    factor = _QUARTER * np.tan(turn / 4.0) / np.tan(turn / 2.0)
    first, last = factor * first_tangent, factor * last_tangent
    u = [0.0, first, ahead - last * np.cos(turn), ahead]
    v = [0.0, 0.0, left - last * np.sin(turn), left]
    return np.array([_bezier(values) for values in (u, v)])


def _bezier(values: list[float]) -> list[float]:
    """Return the coefficients of a Bezier curve's coordinate from those of its four points."""
    a, b, c, d = values
    return [a, 3.0 * (b - a), 3.0 * (c - 2.0 * b + a), d - 3.0 * c + 3.0 * b - a]


def _points(cubic: Float, begin: _End, share: Float) -> Float:
    """Return the local points (N, 2) of a curve at shares (N,) of its parameter."""
    u, v = (value_of_cubic(row[None], share) for row in cubic)
    return begin.point[:2] + _turned(u, v, begin.heading)


def _tangents(cubic: Float, begin: _End, share: Float) -> Float:
    """Return the unit tangents (N, 2) of a curve at shares (N,) of its parameter."""
    u, v = (row[1] + share * (2.0 * row[2] + 3.0 * row[3] * share) for row in cubic)
    vectors = _turned(u, v, begin.heading)
    return vectors / np.linalg.norm(vectors, axis=1)[:, None]


def _turned(u: Float, v: Float, heading: float) -> Float:
    """Return vectors (N, 2) given along a heading (rad) and to the left of it."""
    cosine, sine = np.cos(heading), np.sin(heading)
    return np.stack([u * cosine - v * sine, u * sine + v * cosine], axis=1)
