"""Rules for markings (RMS)."""

from collections.abc import Iterable, Iterator
from itertools import product

import numpy as np

from ...road.objects import nominal_width, width_at, width_kinks
from ...road.section import Arrow, Hatching, LineMarking
from .edges import Edges, Float, TurnoutEdges
from .obstacles import Bool
from .rule import TOLERANCE, Finding, Road, Rule, above, at_most, below, gaps, stretches
from .section import NO_LANE, narrowest_lane

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

_Lines = list[tuple[str, LineMarking]]
_Spans = list[tuple[float, float]]


def _readable(kind: str) -> str:
    return kind.replace("_", " ")


def _lines_on(road: Road, edges: Edges) -> _Lines:
    return [(name, line) for name, line in road.of(LineMarking).items() if line.carriageway == edges.name]


def _select_lines(lines: _Lines, kinds: Iterable[str], boundary: int) -> _Lines:
    """Return those of a carriageway's lines that lie on a lane boundary and are of one of some kinds."""
    return [(name, line) for name, line in lines if line.boundary == boundary and line.kind in kinds]


def _lanes_beside(road: Road, edges: Edges, boundary: int) -> tuple[Bool, Bool]:
    """Return masks (M - 1,) of the pieces between marks: both lanes beside a boundary full; one of them gone."""
    least = narrowest_lane(road)
    full, gone = [], []
    for lane in (boundary - 1, boundary):
        width = edges.lane_widths[lane](edges.marks)
        wide = width >= min(least, nominal_width(edges.carriageway.lanes[lane].width)) * (1.0 - TOLERANCE)
        full.append(wide[:-1] & wide[1:])
        gone.append((width[:-1] < NO_LANE) & (width[1:] < NO_LANE))
    return full[0] & full[1], gone[0] | gone[1]


def _spans(marks: Float, where: Bool) -> _Spans:
    return [(marks[first], marks[last + 1]) for first, last in stretches(where)]


def _required_lines(road: Road, edges: Edges) -> Iterator[tuple[str, int, _Spans, _Lines]]:
    """Yield (kind, boundary, stretches where it must run, its lines) for every line along a carriageway's lanes."""
    lines, whole, last = _lines_on(road, edges), [(0.0, road.length)], len(edges.lane_widths)
    yield "outer_edge", 0, whole, _select_lines(lines, ("outer_edge", "block"), 0)
    for boundary in range(1, last):
        spans = whole
        if not (edges.lane_widths[boundary - 1].constant and edges.lane_widths[boundary].constant):
            spans = _spans(edges.marks, _lanes_beside(road, edges, boundary)[0])
        yield "lane", boundary, spans, _select_lines(lines, ("lane",), boundary)
    yield "inner_edge", last, whole, _select_lines(lines, ("inner_edge",), last)


def _required_at(road: Road, turnout: TurnoutEdges) -> Iterator[tuple[str, tuple[float, float], _Lines]]:
    """Yield (kind, stretch where it must run, its lines) for the lines of an exit or entry; a bay has none."""
    begins = {"turnout_edge": turnout.taper, "gore_edge": turnout.tip} if turnout.turnout.ramp else {}
    for kind, begin in begins.items():
        lines = [(name, line) for name, line in road.of(LineMarking).items() if line.turnout == turnout.name]
        yield kind, turnout.span(begin, turnout.end), [(name, line) for name, line in lines if line.kind == kind]


def _marking_missing(road: Road) -> Iterator[Finding]:
    for name, edges in road.sides.items():
        for kind, boundary, spans, lines in _required_lines(road, edges):
            if spans and not lines:
                text = f"There is no {_readable(kind)} line on lane boundary {boundary} (RMS)."
                yield Finding(name, spans[0][0], 0.0, 1.0, text)
    hatched = {hatching.turnout for hatching in road.of(Hatching).values()}
    for edges, turnout in road.turnouts:
        if turnout.turnout.ramp is None:
            continue
        missing = [kind for kind, _, lines in _required_at(road, turnout) if not lines]
        low, high = turnout.span(turnout.taper, turnout.tip)
        blocks = _select_lines(_lines_on(road, edges), ("block",), 0)
        if not any(line.start_station < high and line.end_station > low for _, line in blocks):
            missing.append("block")
        missing += [] if turnout.name in hatched else ["hatching"]
        for kind in missing:
            text = f"The {turnout.turnout.kind} has no {_readable(kind)} (RMS)."
            yield Finding(turnout.name, turnout.turnout.start_station, 0.0, 1.0, text)


def _marking_coverage(road: Road) -> Iterator[Finding]:
    for edges in road.sides.values():
        for _, boundary, spans, lines in _required_lines(road, edges):
            yield from _find_uncovered(road, f"Lane boundary {boundary}", spans, lines)
    for _, turnout in road.turnouts:
        for kind, span, lines in _required_at(road, turnout):
            yield from _find_uncovered(road, f"The {_readable(kind)} of {turnout.name}", [span], lines)


def _find_uncovered(road: Road, what: str, spans: _Spans, lines: _Lines) -> Iterator[Finding]:
    covered = [(line.start_station, line.end_station) for _, line in lines]
    for low, high in spans if lines else ():
        for start, end in gaps(covered, max(low, 0.0), min(high, road.length)):
            yield Finding(lines[0][0], start, end - start, 0.0, f"{what} has no line for {end - start:.2f} m (RMS).")


def _marking_between(road: Road) -> Iterator[Finding]:
    for edges in road.sides.values():
        for boundary in range(1, len(edges.lane_widths)):
            if edges.lane_widths[boundary - 1].constant and edges.lane_widths[boundary].constant:
                continue
            gone = _spans(edges.marks, _lanes_beside(road, edges, boundary)[1])
            for name, line in _select_lines(_lines_on(road, edges), ("lane",), boundary):
                for low, high in gone:
                    start, end = max(low, line.start_station), min(high, line.end_station)
                    text = f"The lane line runs {end - start:.2f} m where the lane beside it is gone (RMS)."
                    yield from at_most(name, start, end - start, 0.0, text)


def _regulated_lines(road: Road) -> Iterator[tuple[str, LineMarking]]:
    """Yield (id, line) for which the RMS give width and pattern: neither free nor temporary (yellow) ones."""
    for name, line in road.of(LineMarking).items():
        if line.color == "white" and line.kind != "free":
            yield name, line


def _marking_width(road: Road) -> Iterator[Finding]:
    for name, line in _regulated_lines(road):
        limit = min(LINE_WIDTHS[line.kind], key=lambda width: abs(width - line.width))
        if below(line.width, limit) or above(line.width, limit):
            text = f"The line is {line.width:.3f} m wide; {_readable(line.kind)} lines have {limit:.2f} m (RMS)."
            yield Finding(name, line.start_station, line.width, limit, text)


def _marking_pattern(road: Road) -> Iterator[Finding]:
    for name, line in _regulated_lines(road):
        pattern = PATTERNS.get(line.kind, (0.0, 0.0))
        for part, value, limit in zip(("dash", "gap"), (line.dash_length, line.gap_length), pattern, strict=True):
            if below(value, limit) or above(value, limit):
                text = f"The line's {part} is {value:g} m instead of {limit:g} m ({_readable(line.kind)}, RMS)."
                yield Finding(name, line.start_station, value, limit, text)
                break


def _marking_pavement(road: Road) -> Iterator[Finding]:
    items: list[tuple[str, LineMarking | Arrow]] = [*road.of(LineMarking).items(), *road.of(Arrow).items()]
    for (side, edges), (name, item) in product(road.sides.items(), items):
        if item.carriageway == side and (isinstance(item, Arrow) or item.kind == "free"):
            station, distance = _course(edges, item)
            beyond = edges.at(station).clearance(distance, distance)
            worst = np.argmax(beyond)
            if beyond[worst] > TOLERANCE:
                text = f"The marking lies {beyond[worst]:.2f} m beside the carriageway's pavement."
                yield Finding(name, station[worst], beyond[worst], 0.0, text)


def _course(edges: Edges, item: LineMarking | Arrow) -> tuple[Float, Float]:
    """Return stations (N,) of an arrow, or at which a free line or the pavement bends, and distances (N,) there, m."""
    if isinstance(item, Arrow):
        return np.array([item.station]), np.array([edges.sign * item.offset])
    bends = np.concatenate((edges.marks, width_kinks(item.offset)))
    inside = bends[(bends > item.start_station) & (bends < item.end_station)]
    station = np.concatenate(([item.start_station], inside, [item.end_station]))
    return station, width_at(item.offset, station)


def _arrow_direction(road: Road) -> Iterator[Finding]:
    for name, arrow in road.of(Arrow).items():
        ahead = 0.0 if road.sides[arrow.carriageway].traffic > 0 else 180.0
        turned = abs((arrow.rotation_deg - ahead + 180.0) % 360.0 - 180.0)
        text = f"The arrow is turned {turned:.0f} degrees away from its traffic; {TURNED:.0f} are allowed."
        yield from at_most(name, arrow.station, turned, TURNED, text)


RULES = (
    Rule("marking-missing", "Every lane boundary and turnout has its lines", "1", "RMS", "confirmed", _marking_missing),
    Rule("marking-coverage", "Lines run all along what they bound", "m", "RMS", "definition", _marking_coverage),
    Rule("marking-between", "Lane lines run between two lanes", "m", "RMS", "definition", _marking_between),
    Rule("marking-width", "Width of lines", "m", "RMS", "unconfirmed", _marking_width),
    Rule("marking-pattern", "Dash and gap of lines", "m", "RMS", "unconfirmed", _marking_pattern),
    Rule("marking-pavement", "Free lines and arrows lie on the pavement", "m", "", "definition", _marking_pavement),
    Rule("arrow-direction", "Arrows point with their traffic", "deg", "", "definition", _arrow_direction),
)
