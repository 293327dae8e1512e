"""Changes of pavements and markings between two epochs: ruts, settlements, cracks, patches, new courses, paint."""

from __future__ import annotations

import math
from typing import Any

from ...base.schema import round_value
from ...road.changes.kinds import stretch_of
from ...road.section import Carriageway, Crack, LineMarking, Overlay, Patch, RemovedMarking, Rut, Settlement
from .drawing import DIGITS, Epoch

_LONGEST_RUT, _SHORTEST_RUT = 120.0, 25.0
"""Lengths of new ruts, m; chosen."""
_DEEPEST_RUT = 0.08
"""Depth, m, beyond which a rut isn't let grow: the set allows 0.1 m."""
_CRACK_WIDTH = 0.005
"""Width of a new crack, m; chosen."""
_CRACK_STEP, _CRACK_SWAY = 0.25, 0.04
"""Length of a straight piece of a crack that grows, and how far it may stray from its course, m; chosen."""
_PATCH = (0.6, 3.0, 0.5, 2.5)
"""Least and largest length and width of a patch, m; chosen."""
_FRESH_FILM, _THINNEST_FILM = 0.003, 0.0005
"""Films, m: of a line painted anew, a usual one; and the thinnest that a set may have."""
_LEAST_ROAD = 12.0
"""Shortest road, m, on which a new course or settlement is drawn."""
_AT_ENDS = 1.0
"""Distance, m, that changes keep from the road's ends; chosen."""
_OVERLAY_RAMP = 3.0
"""Length of a new course's ramps, m; chosen."""
_MARGIN = 0.05
"""Distance, m, of a new course from the pavement's edges and of patches from their lane's boundaries; chosen."""


def draw_ruts(epoch: Epoch) -> None:
    """Let a lane's ruts grow, or new ones form, on each carriageway."""
    for name, item in epoch.carriageways().items():
        growth = epoch.value(epoch.limits.rut_growth, epoch.limits.years)
        if growth <= 0.0:
            continue
        ruts = epoch.elements(name, "ruts")
        if ruts:
            number = int(epoch.rng.random() * len(ruts))
            rut = ruts[number]
            depth = round_value(rut["depth"] + growth, DIGITS)
            if depth <= _DEEPEST_RUT and epoch.take(name, rut["start_station"], rut["end_station"]):
                epoch.note("rutted", [epoch.change_element(name, "ruts", number, {**rut, "depth": depth})])
            continue
        length = round_value(min(_SHORTEST_RUT + epoch.rng.random() * (_LONGEST_RUT - _SHORTEST_RUT), epoch.length / 2))
        start = epoch.stretch(name, length, _AT_ENDS, epoch.length - _AT_ENDS)
        if start is None:
            continue
        ramp = round_value(min(10.0, length / 3.0), DIGITS)
        end = round_value(start + length, DIGITS)
        lane = _widest_lane(item)
        rut_data = Rut(lane=lane, start_station=start, end_station=end, depth=growth, ramp_length=ramp).to_dict()
        epoch.note("rutted", [epoch.add_element(name, "ruts", rut_data)])


def _widest_lane(item: Carriageway) -> int:
    """Return the outermost lane that is there all along, 0 if none is: lanes count from outside."""
    return next((number for number, lane in enumerate(item.lanes) if isinstance(lane.width, float)), 0)


def draw_settlements(epoch: Epoch) -> None:
    """Let the ground below a carriageway settle, from its inner to its outer edge, with a probability."""
    for name, item in epoch.carriageways().items():
        if not epoch.sometimes(epoch.limits.settlements):
            continue
        length = min(epoch.value(epoch.limits.settlement_length), round_value(epoch.length / 3.0, DIGITS))
        start = epoch.stretch(name, length, _AT_ENDS, epoch.length - _AT_ENDS)
        if start is None or epoch.length < _LEAST_ROAD:
            continue
        section, station = epoch.geometry.sections[item.side], round_value(start + length / 2.0, DIGITS)
        inner = float(section.distances(station)[0, 0])
        outer = float(section.distances(station)[0, section.kinds.index("verge")])
        offset = round_value(item.sign * (inner + outer) / 2.0, DIGITS)
        depth = epoch.value(epoch.limits.settlement_depth)
        width = math.floor((outer - inner) * 100.0) / 100.0
        basin = Settlement(station=station, offset=offset, length=length, width=width, depth=depth)
        epoch.note("settled", [epoch.add_element(name, "settlements", basin.to_dict())])


def draw_cracks(epoch: Epoch) -> None:
    """Let cracks of the pavement extend, or new ones begin where there are none."""
    for name, item in epoch.carriageways().items():
        cracks = epoch.elements(name, "cracks")
        for _ in range(epoch.count(epoch.limits.cracks_per_km, epoch.limits.years)):
            growth = epoch.value(epoch.limits.crack_growth, epoch.limits.years)
            number = int(epoch.rng.random() * max(len(cracks), 1))
            if growth <= 0.0:
                continue
            if cracks and _extend(epoch, name, number, growth):
                continue
            start = epoch.stretch(name, growth, _AT_ENDS, epoch.length - _AT_ENDS)
            if start is None:
                continue
            middle = epoch.lane_middle(item.side, _widest_lane(item), start)
            line = _grown(epoch, [(start, middle)], growth, 1.0)
            crack = Crack(kind="longitudinal", width=_CRACK_WIDTH, lines=(tuple(map(tuple, line)),))
            epoch.note("cracked", [epoch.add_element(name, "cracks", crack.to_dict())])


def _extend(epoch: Epoch, name: str, number: int, growth: float) -> bool:
    """Let a crack extend at the end of its last line; return whether it has room."""
    crack = epoch.elements(name, "cracks")[number]
    last = crack["lines"][-1]
    (s0, o0), (s1, o1) = last[-2:]
    is_across = abs(o1 - o0) > abs(s1 - s0)
    stations = [corner[0] for line in crack["lines"] for corner in line]
    low, high = min(stations), max(stations)
    sense = 1.0 if s1 >= s0 else -1.0
    low, high = (low, high + growth) if sense > 0 else (low - growth, high)
    if is_across or low < _AT_ENDS or high > epoch.length - _AT_ENDS or not epoch.take(name, low, high):
        return False
    line = _grown(epoch, [tuple(corner) for corner in last], growth, sense)
    epoch.note(
        "cracked", [epoch.change_element(name, "cracks", number, {**crack, "lines": [*crack["lines"][:-1], line]})]
    )
    return True


def _grown(epoch: Epoch, line: list[tuple[float, float]], growth: float, sense: float) -> list[list[float]]:
    """Return a crack's line (station, offset, m) longer by so much (m) along the road, swaying about its course."""
    result = [list(corner) for corner in line]
    station, offset = result[-1]
    steps = max(1, math.ceil(growth / _CRACK_STEP))
    for step in range(1, steps + 1):
        sway = (2.0 * epoch.rng.random() - 1.0) * _CRACK_SWAY
        place = round_value(station + sense * growth * step / steps, DIGITS)
        result.append([place, round_value(offset + sway, DIGITS)])
    return result


def draw_patches(epoch: Epoch) -> None:
    """Repair places: on a crack or pothole if there is a short one, else anywhere in a lane."""
    for name, item in epoch.carriageways().items():
        for _ in range(epoch.count(epoch.limits.patches_per_km, epoch.limits.years)):
            length = round_value(_PATCH[0] + epoch.rng.random() * (_PATCH[1] - _PATCH[0]), DIGITS)
            width = round_value(_PATCH[2] + epoch.rng.random() * (_PATCH[3] - _PATCH[2]), DIGITS)
            holes = [hole for hole in epoch.elements(name, "potholes") if hole["length"] < length - 2 * _MARGIN]
            removed: list[Any] = []
            if holes:
                hole = holes[int(epoch.rng.random() * len(holes))]
                start = round_value(hole["station"] - length / 2.0, DIGITS)
                if start < 0.0 or start + length > epoch.length or not epoch.take(name, start, start + length):
                    continue
                middle = hole["offset"]
                width = max(width, round_value(hole["width"] + 2 * _MARGIN, DIGITS))
                removed = [epoch.remove_element(name, "potholes", epoch.elements(name, "potholes").index(hole))]
            else:
                found = epoch.stretch(name, length, _AT_ENDS, epoch.length - _AT_ENDS)
                if found is None:
                    continue
                start, middle = found, epoch.lane_middle(item.side, _widest_lane(item), found)
            height = round_value(0.002 + 0.004 * epoch.rng.random(), DIGITS)
            corners = _rectangle(start, round_value(start + length, DIGITS), middle - width / 2.0, middle + width / 2.0)
            patch = Patch(outline=corners, age=0.0, height=height)
            epoch.note("patched", [*removed, epoch.add_element(name, "patches", patch.to_dict())])


def _rectangle(start: float, end: float, low: float, high: float) -> tuple[tuple[float, float], ...]:
    """Return the corners (station, offset, m) of a rectangle, against the clock seen from above."""
    low, high = round_value(low, DIGITS), round_value(high, DIGITS)
    return ((start, low), (end, low), (end, high), (start, high))


def draw_overlays(epoch: Epoch) -> None:
    """Pave a stretch of a carriageway with a new course, below which its damages vanish, with a probability."""
    for name, item in epoch.carriageways().items():
        if not epoch.sometimes(epoch.limits.overlays):
            continue
        length = min(epoch.value(epoch.limits.overlay_length), round_value(epoch.length / 2.0, DIGITS))
        start = epoch.stretch(name, length, _AT_ENDS, epoch.length - _AT_ENDS)
        section = epoch.geometry.sections[item.side]
        if start is None or section.constant_distances is None or epoch.length < _LEAST_ROAD:
            continue
        end = round_value(start + length, DIGITS)
        distances = section.constant_distances
        inner = round_value(float(distances[0]) + _MARGIN, DIGITS)
        outer = round_value(float(distances[section.kinds.index("verge")]) - _MARGIN, DIGITS)
        thickness = epoch.value(epoch.limits.overlay_thickness)
        ramp = round_value(min(_OVERLAY_RAMP, length / 3.0), DIGITS)
        course = Overlay(
            start_station=start, end_station=end, inner=inner, outer=outer, thickness=thickness, ramp_length=ramp
        )
        low, high = sorted((item.sign * inner, item.sign * outer))
        patch = Patch(outline=_rectangle(start, end, low, high), age=0.0, height=0.0)
        edits = [epoch.add_element(name, "overlays", course.to_dict())]
        for kind in ("ruts", "potholes", "cracks", "patches", "removed_markings"):
            for number, value in enumerate(epoch.elements(name, kind)):
                if _is_within(kind, value, start, end):
                    edits.append(epoch.remove_element(name, kind, number))
        edits.append(epoch.add_element(name, "patches", patch.to_dict()))
        epoch.note("overlaid", edits)


def _is_within(kind: str, value: dict[str, Any], start: float, end: float) -> bool:
    """Return whether a damage lies wholly between two stations, m."""
    low, high = stretch_of(kind, value)
    return low >= start and high <= end


def draw_paint(epoch: Epoch) -> None:
    """Wear the paint of all markings, and the films of some lines, more driven on or worse laid, besides."""
    wear = epoch.before.materials.paint_wear
    worn = round_value(min(wear + epoch.value(epoch.limits.paint_wear, epoch.limits.years), 1.0), DIGITS)
    if worn > wear:
        epoch.note("worn", [epoch.field("", "materials.paint_wear", worn)])
    for name, line in epoch.before.of_type(LineMarking).items():
        if line.color != "white" or epoch.is_used(name) or not epoch.sometimes(epoch.limits.worn_lines):
            continue
        left = line.film_thickness * (1.0 - epoch.value(epoch.limits.line_wear))
        film = round_value(max(left, _THINNEST_FILM), DIGITS)
        if film < line.film_thickness:
            epoch.use(name)
            epoch.note("worn", [epoch.field(name, "film_thickness", film)])


def draw_markings(epoch: Epoch) -> None:
    """Paint broken lines anew: the old dashes are ground off, and the new ones begin half a period later."""
    for name, line in epoch.before.of_type(LineMarking).items():
        period = line.dash_length + line.gap_length
        is_broken = line.dash_length > 0 and line.kind == "lane" and line.color == "white"
        if not is_broken or not epoch.sometimes(epoch.limits.marked_anew):
            continue
        section = epoch.geometry.sections[epoch.before.carriageway_of(line).side]
        start = round_value(line.start_station + period / 2.0, DIGITS)
        if section.constant_distances is None or start + line.dash_length >= line.end_station:
            continue
        boundary = float(section.lane_boundaries(0.0)[0, line.boundary]) * section.carriageway.sign
        former = RemovedMarking(
            offset=round_value(boundary, DIGITS),
            width=line.width,
            dash_length=line.dash_length,
            gap_length=line.gap_length,
            start_station=line.start_station,
            end_station=line.end_station,
        )
        edits = [epoch.add_element(line.carriageway, "removed_markings", former.to_dict())]
        edits.append(epoch.field(name, "start_station", start))
        if line.film_thickness < _FRESH_FILM:
            edits.append(epoch.field(name, "film_thickness", _FRESH_FILM))
        epoch.use(name)
        epoch.note("marked_anew", edits)
