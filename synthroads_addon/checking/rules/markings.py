"""Rules for markings (RMS)."""

from collections.abc import Iterable, Iterator
from itertools import product

import numpy as np

from ...road.objects import nominal_width, width_at, width_kinks
from ...road.section import Arrow, Hatching, LineMarking
from .edges import Edges, Float, TurnoutEdges
from .obstacles import Bool
from .rule import TOLERANCE, Finding, Road, Rule, above, at_least, at_most, below, gaps, stretches
from .section import NO_LANE, narrowest_lane
from .side_roads import mouth_spans

#: Widths that each kind of line may have, m (RMS).
NARROW, BROAD = 0.15, 0.30
LINE_WIDTHS = {
    "outer_edge": (BROAD,),
    "lane": (NARROW,),
    "inner_edge": (NARROW,),
    "block": (BROAD,),
    "turnout_edge": (NARROW, BROAD),
    "gore_edge": (NARROW, BROAD),
}
#: Dash and gap of each kind of broken line, m (RMS); the others are solid.
PATTERNS = {"lane": (6.0, 12.0), "block": (6.0, 6.0)}

#: Arrows may be turned away from their traffic by this angle, degrees.
TURNED = 45.0

#: A free line that moves sideways by more than this per metre runs across the road.
SLANTED = 0.25
_Lines = list[tuple[str, LineMarking]]
_Spans = list[tuple[float, float]]


def _readable(kind: str) -> str:
    """Return a kind of line as words for people, such as ``outer edge``."""
    return kind.replace("_", " ")


def _lines_on(road: Road, edges: Edges) -> _Lines:
    """Return the line markings of a carriageway with their ids."""
    return [(name, line) for name, line in road.of(LineMarking).items() if line.carriageway == edges.name]


def _select_lines(lines: _Lines, kinds: Iterable[str], boundary: int) -> _Lines:
    """Return those of a carriageway's lines that lie on a lane boundary and are of one of some kinds."""
    return [(name, line) for name, line in lines if line.boundary == boundary and line.kind in kinds]


def _lanes_beside(road: Road, edges: Edges, boundary: int) -> tuple[Bool, Bool]:
    """Return masks (M - 1,) of the pieces between marks: both lanes beside a boundary full; one of them gone."""
    least_width = narrowest_lane(road)
    are_full, are_gone = [], []
    for lane in (boundary - 1, boundary):
        width = edges.lane_widths[lane](edges.marks)
        is_wide = width >= min(least_width, nominal_width(edges.carriageway.lanes[lane].width)) * (1.0 - TOLERANCE)
        are_full.append(is_wide[:-1] & is_wide[1:])
        are_gone.append((width[:-1] < NO_LANE) & (width[1:] < NO_LANE))
    return are_full[0] & are_full[1], are_gone[0] | are_gone[1]


def _spans(marks: Float, mask: Bool) -> _Spans:
    """Return the stretches (start, end), m, of the pieces between marks (M,) that a mask (M - 1,) chooses."""
    return [(marks[first_piece], marks[last_piece + 1]) for first_piece, last_piece in stretches(mask)]


def _required_lines(road: Road, edges: Edges) -> Iterator[tuple[str, int, _Spans, _Lines]]:
    """Yield (kind, boundary, stretches where it must run, its lines) for every line along a carriageway's lanes."""
    lines, whole_road, last_boundary = _lines_on(road, edges), [(0.0, road.length)], len(edges.lane_widths)
    if not road.single:  # a single carriageway has rules of its own for its edges and its middle
        yield "outer_edge", 0, whole_road, _select_lines(lines, ("outer_edge", "block"), 0)
    for boundary in range(1, last_boundary):
        spans = whole_road
        if not (edges.lane_widths[boundary - 1].constant and edges.lane_widths[boundary].constant):
            spans = _spans(edges.marks, _lanes_beside(road, edges, boundary)[0])
        yield "lane", boundary, spans, _select_lines(lines, ("lane",), boundary)
    if not road.single:
        yield "inner_edge", last_boundary, whole_road, _select_lines(lines, ("inner_edge",), last_boundary)


def _required_at(road: Road, turnout: TurnoutEdges) -> Iterator[tuple[str, tuple[float, float], _Lines]]:
    """Yield (kind, stretch where it must run, its lines) for the lines of an exit or entry; a bay has none."""
    begins = {"turnout_edge": turnout.taper, "gore_edge": turnout.tip} if turnout.turnout.ramp else {}
    for kind, begin in begins.items():
        lines = [(name, line) for name, line in road.of(LineMarking).items() if line.turnout == turnout.name]
        yield kind, turnout.span(begin, turnout.end), [(name, line) for name, line in lines if line.kind == kind]


def _marking_missing(road: Road) -> Iterator[Finding]:
    """Yield a finding for each lane boundary, exit or entry without one of its lines or its hatching."""
    for name, edges in road.sides.items():
        for kind, boundary, spans, lines in _required_lines(road, edges):
            if spans and not lines:
                text = f"There is no {_readable(kind)} line on lane boundary {boundary} (RMS)."
                yield Finding(name, spans[0][0], 0.0, 1.0, text)
    hatched_turnouts = {hatching.turnout for hatching in road.of(Hatching).values()}
    for edges, turnout in road.turnouts:
        if turnout.turnout.ramp is None:
            continue
        missing_kinds = [kind for kind, _, lines in _required_at(road, turnout) if not lines]
        start, end = turnout.span(turnout.taper, turnout.tip)
        blocks = _select_lines(_lines_on(road, edges), ("block",), 0)
        if not any(line.start_station < end and line.end_station > start for _, line in blocks):
            missing_kinds.append("block")
        missing_kinds += [] if turnout.name in hatched_turnouts else ["hatching"]
        for kind in missing_kinds:
            text = f"The {turnout.turnout.kind} has no {_readable(kind)} (RMS)."
            yield Finding(turnout.name, turnout.turnout.start_station, 0.0, 1.0, text)


def _marking_coverage(road: Road) -> Iterator[Finding]:
    """Yield a finding for each stretch along which a line that is there doesn't run as it must."""
    for edges in road.sides.values():
        for _, boundary, spans, lines in _required_lines(road, edges):
            yield from _find_uncovered(road, f"Lane boundary {boundary}", spans, lines)
    for _, turnout in road.turnouts:
        for kind, span, lines in _required_at(road, turnout):
            yield from _find_uncovered(road, f"The {_readable(kind)} of {turnout.name}", [span], lines)


def _find_uncovered(road: Road, subject: str, spans: _Spans, lines: _Lines) -> Iterator[Finding]:
    """Yield a finding for each part of the spans that none of the lines covers; none without any line."""
    covered_stretches = [(line.start_station, line.end_station) for _, line in lines]
    for span_start, span_end in spans if lines else ():
        for start, end in gaps(covered_stretches, max(span_start, 0.0), min(span_end, road.length)):
            yield Finding(lines[0][0], start, end - start, 0.0, f"{subject} has no line for {end - start:.2f} m (RMS).")


def _marking_between(road: Road) -> Iterator[Finding]:
    """Yield a finding for each stretch of a lane line beside a lane that is gone there."""
    for edges in road.sides.values():
        for boundary in range(1, len(edges.lane_widths)):
            if edges.lane_widths[boundary - 1].constant and edges.lane_widths[boundary].constant:
                continue
            gone_stretches = _spans(edges.marks, _lanes_beside(road, edges, boundary)[1])
            for name, line in _select_lines(_lines_on(road, edges), ("lane",), boundary):
                for gone_start, gone_end in gone_stretches:
                    start, end = max(gone_start, line.start_station), min(gone_end, line.end_station)
                    text = f"The lane line runs {end - start:.2f} m where the lane beside it is gone (RMS)."
                    yield from at_most(name, start, end - start, 0.0, text)


def _regulated_lines(road: Road) -> Iterator[tuple[str, LineMarking, str]]:
    """Yield (id, line, kind) for which the guideline gives width and pattern; ``centre`` lies between the directions.

    They are neither free nor temporary, which is to say of another colour than the guideline's.
    """
    if not road.binds("narrow_line"):
        return
    centre_names = {name for name, _ in _centre_lines(road)}
    for name, line in road.of(LineMarking).items():
        kind = "centre" if name in centre_names else line.kind
        if kind != "free" and line.color == road.color_of(kind):
            yield name, line, kind


def _line_widths(road: Road) -> dict[str, tuple[tuple[str, float], ...]]:
    """Return the quantities and widths (m) that each kind of line may have."""
    if not road.single:
        names = {BROAD: "broad_line", NARROW: "narrow_line"}
        return {kind: tuple((names[width], width) for width in widths) for kind, widths in LINE_WIDTHS.items()}
    limits = road.limits
    narrow = ("narrow_line", limits.narrow_line)
    edge = ("edge_line_width", limits.edge_line_width) if limits.edge_line_width else narrow
    solid = ("solid_line_width", limits.solid_line_width) if limits.solid_line_width else narrow
    return {"centre": (narrow, solid), "outer_edge": (edge,), "lane": (narrow,), "inner_edge": (narrow, solid)}


def _marking_width(road: Road) -> Iterator[Finding]:
    """Yield a finding for each line whose width isn't one that its kind may have."""
    widths = _line_widths(road)
    for name, line, kind in _regulated_lines(road):
        quantity, limit = min(widths[kind], key=lambda row: abs(row[1] - line.width))
        if below(line.width, limit) or above(line.width, limit):
            text = (
                f"The line is {line.width:.3f} m wide; {_readable(kind)} lines have {limit:.2f} m "
                f"({road.cite(quantity)})."
            )
            yield Finding(name, line.start_station, line.width, limit, text)


def _patterns(road: Road) -> dict[str, tuple[tuple[str, float, float], ...]]:
    """Return the quantities, dashes and gaps (m) that each kind of line may have; kinds without any are solid."""
    if not road.single:
        return {kind: (("lane_dash", *pattern),) for kind, pattern in PATTERNS.items()}
    limits, solid = road.limits, ("solid_lines", 0.0, 0.0)
    lane = ("lane_dash", limits.lane_dash, limits.lane_gap)
    centre = ("centre_dash", limits.centre_dash, limits.centre_gap) if limits.centre_dash else lane
    edge = ("edge_dash", limits.edge_dash, limits.edge_gap) if limits.edge_dash else lane
    warnings = (("warning_dash", limits.warning_dash, limits.warning_gap),) if limits.warning_dash else ()
    town = (("town_dash", limits.town_dash, limits.town_gap),) if limits.town_dash else (centre, *warnings)
    mouth = (("mouth_dash", limits.mouth_dash, limits.mouth_gap),) if limits.mouth_dash else ()
    return {
        "centre": (solid, centre, *warnings),
        "mouth": (solid, *mouth, edge),
        "town": (solid, *town),
        "outer_edge": (solid, edge),
        "lane": (solid, lane),
    }


def _marking_pattern(road: Road) -> Iterator[Finding]:
    """Yield a finding for each line whose dash or gap isn't that of its kind."""
    patterns = _patterns(road)
    for name, line, kind in _regulated_lines(road):
        values = line.dash_length, line.gap_length
        middle = (line.start_station + line.end_station) / 2.0
        if kind == "centre" and road.in_village(middle):
            kind_of_place = "town"
        elif kind == "outer_edge" and any(a < middle < b for a, b in mouth_spans(road, line.carriageway)):
            kind_of_place = "mouth"
        else:
            kind_of_place = kind
        quantity, *limits_of_line = min(
            patterns.get(kind_of_place, (("lane_dash", 0.0, 0.0),)),
            key=lambda row: max(abs(row[1] - values[0]), abs(row[2] - values[1])),
        )
        for part, value, limit in zip(("dash", "gap"), values, limits_of_line, strict=True):
            if below(value, limit) or above(value, limit):
                source = f"{_readable(kind)}, {road.cite(quantity)}"
                text = f"The line's {part} is {value:g} m instead of {limit:g} m ({source})."
                yield Finding(name, line.start_station, value, limit, text)
                break


def _double_line_gap(road: Road) -> Iterator[Finding]:
    """Yield a finding for each solid line between the directions that isn't as far from the middle as of two lines."""
    if not road.single or not road.binds("double_line_gap") or road.limits.solid_lines < 2.0:
        return
    gap = road.limits.double_line_gap
    for name, line in _centre_lines(road):
        if line.dash_length or line.kind != "free" or _is_beside_island(road, line):
            continue
        edges = road.sides[line.carriageway]
        inner_edge = float(edges.inner(np.array([line.start_station]))[0])
        value = 2.0 * (nominal_width(line.offset) - inner_edge) - line.width
        if below(value, gap) or above(value, gap):
            text = (
                f"The two solid lines are {value:.3f} m apart; {gap:.3f} m are needed ({road.cite('double_line_gap')})."
            )
            yield Finding(name, line.start_station, value, gap, text)


def _is_beside_island(road: Road, line: LineMarking) -> bool:
    """Return whether a line bounds the area around a traffic island: in its middle the lanes lie apart."""
    middle = np.array([(line.start_station + line.end_station) / 2.0])
    if not road.in_village(float(middle[0])):
        return False
    strips = sum(float(edges.at(middle).lanes[0, -1] - edges.inner(middle)[0]) for edges in road.sides.values())
    return strips > road.limits.double_line_gap


def _traffic_side(road: Road) -> Iterator[Finding]:
    """Yield a finding for each carriageway whose traffic doesn't keep to the guideline's side."""
    rule = road.traffic_side
    for name, edges in road.sides.items():
        side = edges.carriageway.traffic_side or "right"
        if side != rule.side:
            text = (
                f"Traffic keeps left, not right ({road.guideline_name}: {rule.source}; {rule.sure})."
                if side == "left"
                else f"Traffic keeps right, not left ({road.guideline_name}: {rule.source}; {rule.sure})."
            )
            yield Finding(name, 0.0, 0.0, 1.0, text)


def _marking_pavement(road: Road) -> Iterator[Finding]:
    """Yield a finding for each free line or arrow that lies beside its carriageway's pavement."""
    items: list[tuple[str, LineMarking | Arrow]] = [*road.of(LineMarking).items(), *road.of(Arrow).items()]
    for (side, edges), (name, item) in product(road.sides.items(), items):
        if item.carriageway == side and (isinstance(item, Arrow) or item.kind == "free"):
            station, distance = _course(edges, item)
            overshoot = edges.at(station).clearance(distance, distance)
            worst_row = np.argmax(overshoot)
            if overshoot[worst_row] > TOLERANCE:
                text = f"The marking lies {overshoot[worst_row]:.2f} m beside the carriageway's pavement."
                yield Finding(name, station[worst_row], overshoot[worst_row], 0.0, text)


def _course(edges: Edges, item: LineMarking | Arrow) -> tuple[Float, Float]:
    """Return stations (N,) of an arrow, or at which a free line or the pavement bends, and distances (N,) there, m."""
    if isinstance(item, Arrow):
        return np.array([item.station]), np.array([edges.sign * item.offset])
    bends = np.concatenate((edges.marks, width_kinks(item.offset)))
    inner_bends = bends[(bends > item.start_station) & (bends < item.end_station)]
    station = np.concatenate(([item.start_station], inner_bends, [item.end_station]))
    return station, width_at(item.offset, station)


def _arrow_direction(road: Road) -> Iterator[Finding]:
    """Yield a finding for each arrow that points away from its lane's traffic."""
    for name, arrow in road.of(Arrow).items():
        traffic_rotation = 0.0 if road.sides[arrow.carriageway].traffic > 0 else 180.0
        angle = abs((arrow.rotation_deg - traffic_rotation + 180.0) % 360.0 - 180.0)
        text = f"The arrow is turned {angle:.0f} degrees away from its traffic; {TURNED:.0f} are allowed."
        yield from at_most(name, arrow.station, angle, TURNED, text)


def _centre_lines(road: Road) -> Iterator[tuple[str, LineMarking]]:
    """Yield (id, line) of the lines between the directions of a single carriageway."""
    if not road.single:
        return
    for name, line in road.of(LineMarking).items():
        edges = road.sides[line.carriageway]
        middle = np.array([(line.start_station + line.end_station) / 2.0])
        offset = float(width_at(line.offset, middle)[0])
        innermost = float(edges.at(middle).lanes[0, -1])  # beside a traffic island it lies farther out
        if line.kind == "inner_edge" or (
            # A bar of a pedestrian crossing is wider than any line.
            line.kind == "free"
            and not _is_slanted(line)
            and line.width <= road.limits.broad_line * (1.0 + TOLERANCE)
            and offset <= innermost + line.width + road.limits.double_line_gap
        ):
            yield name, line


def _is_slanted(line: LineMarking) -> bool:
    """Return whether a free line is a stripe of a barred area: it runs across the road, not along it."""
    if not isinstance(line.offset, tuple):
        return False
    points = line.offset
    reach, length = abs(points[-1].width - points[0].width), abs(points[-1].station - points[0].station)
    return reach > SLANTED * length


def _centre_line_missing(road: Road) -> Iterator[Finding]:
    """Yield a finding for each stretch of a single carriageway with fewer lines between its directions than needed."""
    needed = int(road.limits.centre_lines)
    if not road.single or not needed or len(road.sides) < 2 or _narrowest_through_lane(road) < _least_marked(road):
        return
    lines = [line for _, line in _centre_lines(road)]
    if needed == 1:
        spans_of_lines = [[(line.start_station, line.end_station) for line in lines]]
    else:
        spans_of_lines = [
            [(line.start_station, line.end_station) for line in lines if line.carriageway == name]
            for name in road.sides
        ]
    for spans in spans_of_lines:
        for start, end in gaps(spans, 0.0, road.length):
            text = (
                f"There is no line between the directions for {end - start:.2f} m; "
                f"{road.design_class} has {needed} ({road.cite('centre_lines')})."
            )
            yield Finding(next(iter(road.sides)), start, end - start, 0.0, text)


def _centre_line_narrow(road: Road) -> Iterator[Finding]:
    """Yield a finding for each line between the directions of a single carriageway whose lanes are too narrow."""
    width, least_width = _narrowest_through_lane(road), _least_marked(road)
    for name, line in _centre_lines(road):
        text = (
            f"A line lies between lanes of {width:.2f} m; lanes below {least_width:.2f} m have none "
            f"({road.cite('narrowest_centre_line_lane')})."
        )
        yield from at_least(name, line.start_station, width, least_width, text)


def _narrowest_through_lane(road: Road) -> float:
    """Return the width (m) of the narrowest of the innermost lanes, at its widest."""
    return min(nominal_width(edges.carriageway.lanes[-1].width) for edges in road.sides.values())


def _least_marked(road: Road) -> float:
    """Return the width (m) below which lanes have no line between the directions."""
    return road.limits.narrowest_centre_line_lane * (1.0 - TOLERANCE)


RULES = (
    Rule(
        "centre-line-missing", "Directions of one carriageway are parted", "m", "RMS", "confirmed", _centre_line_missing
    ),
    Rule("centre-line-narrow", "Narrow lanes have no line between them", "m", "RMS", "confirmed", _centre_line_narrow),
    Rule("marking-missing", "Every lane boundary and turnout has its lines", "1", "RMS", "confirmed", _marking_missing),
    Rule("marking-coverage", "Lines run all along what they bound", "m", "RMS", "definition", _marking_coverage),
    Rule("marking-between", "Lane lines run between two lanes", "m", "RMS", "definition", _marking_between),
    Rule("marking-width", "Width of lines", "m", "RMS", "unconfirmed", _marking_width),
    Rule("marking-pattern", "Dash and gap of lines", "m", "RMS", "unconfirmed", _marking_pattern),
    Rule("marking-pavement", "Free lines and arrows lie on the pavement", "m", "", "definition", _marking_pavement),
    Rule("double-line-gap", "Two solid lines are as far apart as they must be", "m", "", "derived", _double_line_gap),
    Rule("traffic-side", "Traffic keeps to its country's side", "1", "", "confirmed", _traffic_side),
    Rule("arrow-direction", "Arrows point with their traffic", "deg", "", "definition", _arrow_direction),
)
