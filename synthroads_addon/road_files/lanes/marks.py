"""Road marks of a file's lanes as line markings of a parameter set."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, cast, get_args
from xml.etree.ElementTree import Element  # nosec B405 (its type alone)

import numpy as np
from pydantic import ValidationError

from ...base.arrays import Float
from ...base.schema import round_value
from ...road.objects import SignedWidthPoint
from ...road.section import SHORTEST_DASH, LineMarking
from ...scenario.road import RoadScenario
from ..xml_text import child, children, number
from .carriageways import SIDE_OF, Pavements, Stations
from .corners import corners, polyline, rounded_points
from .loss import Loss
from .records import SHORTEST, FileLane
from .shape import SideShape

Kind = Literal["outer_edge", "lane", "inner_edge", "block", "turnout_edge", "gore_edge", "free"]
_KINDS = frozenset(get_args(Kind))
_OUTWARDS = {"outer_edge": 0.5, "block": 0.5, "turnout_edge": 0.5, "inner_edge": -0.5, "gore_edge": -0.5}
"""Kind of a line -> where its axis lies from its border, outwards, in widths."""
_PAINTED: dict[str, tuple[bool, ...]] = {
    "solid": (True,), "broken": (False,), "solid solid": (True, True), "solid broken": (True, False),
    "broken solid": (False, True), "broken broken": (False, False),
}  # fmt: skip
"""Type of a mark -> its lines from the inside out, whether each is solid."""
_DASH, _GAP, _NARROW, _BROAD = 6.0, 12.0, 0.15, 0.30
"""Lines of motorways where a file says no lengths or widths, m (RMS)."""
_COLOURS = {"standard": "white", "white": "white", "yellow": "yellow"}
_SAME = 1e-3


@dataclass(frozen=True)
class _Line:
    """A line along a border of lanes within a lane section.

    Attributes:
        side: of the carriageway.
        border: first and last of its lane boundaries, counted from outside, that lie there, as lanes between them have
            no width; None where the border is no lane's.
        turnout: id of the turnout whose lane's edge it is.
        place: number and sign of the lane whose outer border it is, 0 for the centre lane, and section.
        start, end: stations, m.
        dash, gap: m; 0 for a solid line.
        first: station at which a dash begins, m.
        shift: of its axis from the border, to the left, m.
        width, film: m.
        color: of the paint.
        kind, name: as our own files say them; empty in others.
    """

    side: SideShape
    border: tuple[int, int] | None
    turnout: str | None
    place: tuple[int, int]
    start: float
    end: float
    dash: float
    gap: float
    first: float
    shift: float
    width: float
    film: float
    color: str
    kind: str
    name: str


def line_markings(
    pavements: Pavements, stations: Stations, scenario: RoadScenario, loss: Loss
) -> dict[str, LineMarking] | None:
    """Return the line markings of a file's road by id, instance 1; None where it has no mark at all."""
    shapes = list(pavements.shapes.values())
    surfaces = {id(side.surface): side.surface for side in shapes}
    lines: list[_Line] = []
    has_marks = False
    for key, surface in surfaces.items():
        sides_by_sign = {side.sign: side for side in shapes if id(side.surface) == key}
        for section_number, section in enumerate(surface.road.sections):
            lanes: list[tuple[int, FileLane | None, Element]] = []
            if section.centre is not None:
                lanes.append((0, None, section.centre))
            lanes += [(lane.number, lane, lane.element) for side in section.lanes.values() for lane in side]
            for lane_number, lane, element in lanes:
                side, border, turnout = _border(sides_by_sign, pavements, section_number, lane)
                position = (side, border, turnout, (lane_number, section_number))
                for line in _lines_of(element, position, (section.start, section.end), scenario, loss):
                    has_marks = True
                    if line is not None:
                        lines.append(line)
    if not has_marks:
        return None
    return _markings(lines, stations, loss)


def _border(
    sides: Mapping[int, SideShape], pavements: Pavements, section: int, lane: FileLane | None
) -> tuple[SideShape, tuple[int, int] | None, str | None]:
    """Return the side that a lane's outer border is on, the lane boundaries there, and the id of a turnout or None."""
    for sign in (-1, 1):  # the line between two directions is the right carriageway's
        side = sides.get(sign)
        if side is None or (lane is not None and lane.number * sign < 0):
            continue
        border = _lane_border(side, section, lane)
        if border is not None:
            return side, border, None
        for kind in ("turnout_lane", "ramp_inner_strip"):
            if lane is not None and lane in side.layout.of_strip(section, kind):
                return side, None, pavements.turnout_ids.get((sign, lane.notes.get("instance", "")))
        if lane is not None:
            return side, None, None
    return sides.get(-1) or sides[1], None, None


def _lane_border(side: SideShape, section: int, lane: FileLane | None) -> tuple[int, int] | None:
    """Return the first and last lane boundary at a lane's outer border, several where lanes have no width; or None."""
    slots = side.layout.slots
    section_lanes = [(n, slot.lanes[section]) for n, slot in enumerate(slots) if section in slot.lanes]
    for row, (n, slot_lane) in enumerate(section_lanes):
        if slot_lane is lane:
            next_slot = section_lanes[row + 1][0] if row + 1 < len(section_lanes) else len(slots)
            return len(slots) - next_slot, len(slots) - 1 - n
    if not section_lanes:
        return None
    lanes = side.surface.road.sections[section].lanes[side.sign]
    inner_lanes = [slot_lane for slot_lane in lanes if abs(slot_lane.number) < abs(section_lanes[0][1].number)]
    if (inner_lanes[-1] if inner_lanes else None) is lane:
        return len(slots) - section_lanes[0][0], len(slots)
    return None


def _lines_of(
    element: Element,
    position: tuple[SideShape, tuple[int, int] | None, str | None, tuple[int, int]],
    span: tuple[float, float],
    scenario: RoadScenario,
    loss: Loss,
) -> Iterator[_Line | None]:
    """Yield the lines of a lane's road marks within its section (m); None for a mark that is left out."""
    start, end = span
    marks = sorted(children(element, "roadMark"), key=lambda mark: number(mark, "sOffset", 0.0))
    begins = [start + number(mark, "sOffset", 0.0) for mark in marks]
    for mark, begin, next_begin in zip(marks, begins, [*begins[1:], end], strict=False):
        first_station, last_station = max(begin, start), min(next_begin, end)
        kind = mark.get("type", "none").strip()
        if kind == "none" or last_station - first_station <= SHORTEST:
            continue
        yield from _lines_of_mark(mark, position, (first_station, last_station), scenario, loss)


def _lines_of_mark(
    mark: Element,
    position: tuple[SideShape, tuple[int, int] | None, str | None, tuple[int, int]],
    span: tuple[float, float],
    scenario: RoadScenario,
    loss: Loss,
) -> Iterator[_Line | None]:
    """Yield the lines that one road mark consists of within a span (m); None for a mark that is left out.

    `position` is the lines' side, border, turnout and place, as in `_Line`.
    """
    side, border, turnout, place = position
    kind = mark.get("type", "none").strip()
    type_element = child(mark, "type")
    rows = [] if type_element is None else children(type_element, "line")
    if kind not in _PAINTED and not rows:
        loss.leave_out("road marks", f"of type {kind}")
        yield None
        return
    notes = {row.get("code", ""): row.get("value", "") for row in children(mark, "userData")}
    usual_width = _BROAD if mark.get("weight", "standard").strip() == "bold" else _NARROW
    width = number(mark, "width", 0.0) or (0.0 if type_element is None else number(type_element, "width", 0.0))
    if not width and not (rows and all(number(row, "width", 0.0) for row in rows)):
        loss.approximate("road marks", f"a width that isn't given is {usual_width:g} m")
        width = usual_width
    film = number(mark, "height", 0.0)
    common: dict[str, Any] = {
        "side": side, "border": border, "turnout": turnout, "place": place, "start": span[0], "end": span[1],
        "film": film if 0.0005 <= film <= 0.006 else 0.003,
        "kind": type_element.get("name", "") if type_element is not None and "instance" in notes else "",
        "name": notes.get("id", ""),
    }  # fmt: skip
    if rows:
        for row in rows:
            dash, gap = number(row, "length", 0.0), number(row, "space", 0.0)
            is_dashed = gap > 0.0
            color = _colour(row.get("color") or mark.get("color") or "standard", loss)
            yield _Line(
                **common, dash=dash if is_dashed else 0.0, gap=gap, first=span[0] + number(row, "sOffset", 0.0),
                shift=number(row, "tOffset", 0.0), width=number(row, "width", 0.0) or width, color=color,
            )  # fmt: skip
        return
    solid_flags = _PAINTED[kind]
    dash, gap = scenario.markings.lane_dash or _DASH, scenario.markings.lane_gap or _GAP
    if not all(solid_flags):
        loss.approximate("road marks", f"dashes and gaps that aren't given are {dash:g} m and {gap:g} m")
    inward_sign = 1.0 if place[0] <= 0 else -1.0  # lines are named from the inside out, at the centre from the left
    shifts = (0.0,) if len(solid_flags) == 1 else (inward_sign * width, -inward_sign * width)
    color = _colour(mark.get("color", "standard"), loss)
    for is_solid, shift in zip(solid_flags, shifts, strict=True):
        lengths = (0.0, 0.0) if is_solid else (dash, gap)
        yield _Line(**common, dash=lengths[0], gap=lengths[1], first=span[0], shift=shift, width=width, color=color)


def _colour(name: str, loss: Loss) -> str:
    """Return the paint, white or yellow, of a colour of OpenDRIVE; another colour is noted as approximated."""
    colour = _COLOURS.get(name.strip())
    if colour is None:
        colour = "yellow" if name.strip() == "orange" else "white"
        loss.approximate("road marks", f"{name.strip()} paint is {colour}")
    return colour


def _markings(lines: Sequence[_Line], stations: Stations, loss: Loss) -> dict[str, LineMarking]:
    """Return the line markings by id; lines that a parameter set can't hold are noted as left out."""
    markings: dict[str, LineMarking] = {}
    for line in _joined(lines):
        name = line.name
        if not name or name in markings:
            stem = name or f"line-{SIDE_OF[line.side.sign]}"
            count = 1
            while f"{stem}-{count}" in markings:
                count += 1
            name = f"{stem}-{count}"
        try:
            marking = _marking(line, stations)
        except ValidationError as error:
            fault = error.errors(include_url=False)[0]
            loss.leave_out("road marks", f"{'.'.join(map(str, fault['loc'])) or 'line'}: {fault['msg'].lower()}")
            continue
        if marking.end_station - marking.start_station > SHORTEST:
            markings[name] = marking
            loss.read["road marks"] += 1
    return markings


def _joined(lines: Sequence[_Line]) -> list[_Line]:
    """Return the lines, with those joined that go on in the next lane section with the same dashes.

    Our own files write a dash that a section cuts as a solid line, so there all lines of one id are one line.
    """
    parts_by_name: dict[str, list[_Line]] = {}
    others: list[_Line] = []
    for line in sorted(lines, key=lambda one: one.start):
        if line.name and line.kind in _KINDS:
            parts_by_name.setdefault(line.name, []).append(line)
        else:
            others.append(line)
    # Lines of our own files: parts of one id that follow each other, whatever their dashes.
    joined: list[_Line] = []
    for parts in parts_by_name.values():
        runs: list[list[_Line]] = []
        for part in parts:
            last = runs[-1][-1] if runs else None
            border = _common(last.border, part.border) if last is not None else None
            continues = last is not None and part.start - last.end < _SAME and _key(part)[:-3] == _key(last)[:-3]
            if continues and last is not None and (border or last.border is part.border is None):
                runs[-1].append(replace(part, border=border))
            else:
                runs.append([part])
        for run in runs:
            dashed_part = next((part for part in run if part.gap), run[0])
            joined.append(
                replace(
                    run[0],
                    end=run[-1].end,
                    dash=dashed_part.dash,
                    gap=dashed_part.gap,
                    border=run[-1].border,
                    first=run[0].first if run[0].gap else run[0].start,
                )
            )
    # Lines of other programs: a line goes on where paint, place and the phase of the dashes are the same.
    joined_others: list[_Line] = []
    for line in others:
        for n, other in enumerate(joined_others):
            border = _common(other.border, line.border)
            same_border = border is not None or other.border is line.border is None
            if (
                same_border
                and abs(other.end - line.start) < _SAME
                and _key(other) == _key(line)
                and _goes_on(other, line)
            ):
                joined_others[n] = replace(other, end=line.end, border=border)
                break
        else:
            joined_others.append(line)
    return joined + joined_others


def _common(border: tuple[int, int] | None, other_border: tuple[int, int] | None) -> tuple[int, int] | None:
    """Return the lane boundaries that two lines may both lie on, None without any."""
    if border is None or other_border is None:
        return None
    start, end = max(border[0], other_border[0]), min(border[1], other_border[1])
    return (start, end) if start <= end else None


def _boundary(line: _Line) -> int:
    """Return the lane boundary that a line follows: the outermost or innermost one if possible, else the inner one."""
    assert line.border is not None
    outermost, innermost = line.border
    return 0 if outermost == 0 and innermost < len(line.side.layout.slots) else innermost


def _key(line: _Line) -> tuple[Any, ...]:
    """Return what two lines must have in common to be one: side, turnout, place and paint; dash and gap come last."""
    border = None if line.border is not None else ("free", line.place[0])
    shape = (round(line.shift, 4), round(line.width, 4), line.color, line.film)
    return (line.side.sign, line.turnout, *shape, border, round(line.dash, 4), round(line.gap, 4))


def _goes_on(line: _Line, next_line: _Line) -> bool:
    """Return whether the second line's dashes lie where the first line's pattern would go on."""
    period = line.dash + line.gap
    if not period:
        return True
    phase = (next_line.first - line.first) % period
    return min(phase, period - phase) < _SAME


def _marking(line: _Line, stations: Stations) -> LineMarking:
    """Return the line marking of the parameter set for a file's line.

    Args:
        line: with stations of the file.
        stations: function that gives the parameter set's stations for the file's.

    Raises:
        ValidationError: the line has values that no line marking may have.
    """
    side = SIDE_OF[line.side.sign]
    # A line marking begins with a dash, where a file's line may begin with a gap.
    first_paint = line.first if line.gap and line.first > line.start else line.start
    start, end = (float(value) for value in stations(np.array([first_paint, line.end])))
    outward_widths = line.side.sign * line.shift / line.width
    kind = _kind(line, outward_widths)
    if kind == "free":
        place_fields: dict[str, Any] = {"offset": _offset(line, stations)}
    elif kind in ("turnout_edge", "gore_edge"):
        place_fields = {"turnout": line.turnout}
    else:
        place_fields = {"boundary": _boundary(line) if line.border else 0}
    dash, gap = line.dash, line.gap
    # A line with shorter dashes or gaps than a line marking may have becomes solid, as it looks.
    if dash and (dash < SHORTEST_DASH or gap < SHORTEST_DASH):
        dash = gap = 0.0
    return LineMarking(
        instance=1,
        carriageway=f"carriageway-{side}",
        kind=cast(Kind, kind),
        color=cast(Literal["white", "yellow"], line.color),
        film_thickness=line.film,
        width=round_value(line.width, 6),
        dash_length=round_value(dash, 6),
        gap_length=round_value(gap, 6),
        start_station=round_value(max(start, 0.0), 6),
        end_station=round_value(end, 6),
        **place_fields,
    )


def _kind(line: _Line, outward_shift: float) -> str:
    """Return the kind of marking that lies so far outwards (in widths of the line) from its border."""
    if line.kind in _KINDS and abs(_OUTWARDS.get(line.kind, 0.0) - outward_shift) < _SAME:
        if line.kind in ("turnout_edge", "gore_edge"):
            return line.kind if line.turnout else "free"
        return line.kind if line.border is not None else "free"
    if line.border is None:
        return "free"
    innermost, boundary = len(line.side.layout.slots), _boundary(line)
    if boundary == 0 and abs(outward_shift - 0.5) < _SAME:
        return "outer_edge"
    if boundary == innermost and abs(outward_shift + 0.5) < _SAME:
        return "inner_edge"
    return "lane" if abs(outward_shift) < _SAME else "free"


def _offset(line: _Line, stations: Stations) -> float | tuple[SignedWidthPoint, ...]:
    """Return the distance, m, of a free line's axis from the centreline by station, or one number if it is constant."""
    side, lane = line.side, line.place[0]

    def axis_distance(station: Float, stretch: int) -> Float:
        """Return the distances (N, 1), m, of the line's axis outwards from the reference line at stations (N,)."""
        if lane == 0:
            edge = side.surface.centre(station, side.inside(station, stretch)).offset
        else:
            rows = side.lanes(station, stretch)[1 if lane > 0 else -1]
            edge = next((row.outer.offset for row in rows if row.lane.number == lane), rows[-1].outer.offset)
        return np.asarray(side.sign * (edge + line.shift))[:, None]

    is_inside = (side.breaks > line.start + SHORTEST) & (side.breaks < line.end - SHORTEST)
    stretch_ends = np.array([line.start, *side.breaks[is_inside], line.end])
    # The stretch of the side's breaks in which each part of the line lies.
    numbers = np.clip(
        np.searchsorted(side.breaks, 0.5 * (stretch_ends[:-1] + stretch_ends[1:]), side="right") - 1, 0, None
    )
    distances = polyline(lambda s, n: axis_distance(s, int(numbers[n])), stretch_ends, _SAME * 0.3)
    points = corners(stations(distances.stations), distances.values[:, 0])
    if len(points) == 1:
        return round_value(points[0][1], 6)
    return tuple(SignedWidthPoint(station=s, width=round_value(w, 6)) for s, w in rounded_points(points, 6))
