"""Rules for crossfall (RAA), cross-section (RAA) and line markings (RMS)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from .checker_base import (
    TOLERANCE,
    Finding,
    Float,
    Road,
    Rule,
    above,
    below,
    gaps,
    increasing,
    stretches,
)
from .limits import (
    LARGEST_CROSSFALL_PERCENT,
    LEAST_CROSSFALL_PERCENT,
    SECTIONS_OF_CLASS,
    STANDARD_CROSS_SECTIONS,
    curve_crossfall_percent,
)
from .model import Carriageway, LineMarking

#: Crossfalls that differ by less than this (%) don't run off.
SAME_CROSSFALL = 1e-6
#: A run-off may reach this far (m) beyond the elements whose curvature changes: crossfall points are often rounded.
RUN_OFF_BEYOND = 1.0
#: The least run-off slope (%) per metre between rotation axis and edge (RAA); the largest one where that is below 4 m.
LEAST_RUN_OFF_PER_METRE = 0.1
NARROW_RUN_OFF_PER_METRE = 0.225
NARROW_RUN_OFF = 4.0
#: Narrowest median of the standard cross-sections, m.
LEAST_MEDIAN = 2.5
#: Widths of the lines, m, and the lane line's dash and gap, m (RMS).
LINE_WIDTHS = {"outer_edge": 0.30, "lane": 0.15, "inner_edge": 0.15}
LANE_DASH, LANE_GAP = 6.0, 12.0

_Boundary = tuple[str, int, list[tuple[str, LineMarking]]]


class _Crossfall(NamedTuple):
    """A carriageway's crossfall on the road as arrays.

    Attributes:
        station: (N,) m: the road's begin, the points on it, its end.
        percent: (N,) crossfall there.
        runs_off: (N - 1,) whether it changes from one to the next.
        slope: (N - 1,) % per m.
    """

    station: Float
    percent: Float
    runs_off: np.ndarray
    slope: Float


def _crossfall(road: Road, carriageway: Carriageway) -> _Crossfall:
    points = np.array([(p.station, p.crossfall_percent) for p in carriageway.crossfall])
    station, percent = points[increasing(points[:, 0])].T
    inside = (station > 0.0) & (station < road.length)
    at = np.concatenate(([0.0], station[inside], [road.length]))
    values = np.interp(at, station, percent)
    change = np.diff(values)
    return _Crossfall(at, values, np.abs(change) > SAME_CROSSFALL, change / np.diff(at))


def _crossfall_order(road: Road) -> Iterator[Finding]:
    for name, carriageway in road.carriageways.items():
        before = -np.inf
        for i, point in enumerate(carriageway.crossfall):
            step = point.station == before and point.crossfall_percent != carriageway.crossfall[i - 1].crossfall_percent
            if point.station < before or step:
                text = f"Crossfall point {i + 1} at {point.station:.3f} m does not follow the one at {before:.3f} m."
                yield Finding(name, point.station, point.station, before, text)
            before = max(before, point.station)


def _crossfall_least(road: Road) -> Iterator[Finding]:
    least = LEAST_CROSSFALL_PERCENT
    for name, carriageway in road.carriageways.items():
        fall = _crossfall(road, carriageway)
        value = np.abs(fall.percent[:-1])
        for first, last in stretches(~fall.runs_off & (value < least * (1.0 - TOLERANCE))):
            worst = float(value[first : last + 1].min())
            text = f"The crossfall is {worst:.2f} % outside of a run-off; {least} % are needed (RAA)."
            yield Finding(name, float(fall.station[first]), worst, least, text)


def _crossfall_largest(road: Road) -> Iterator[Finding]:
    largest = LARGEST_CROSSFALL_PERCENT
    for name, carriageway in road.carriageways.items():
        fall = _crossfall(road, carriageway)
        value = np.abs(fall.percent)
        for first, last in stretches(value > largest * (1.0 + TOLERANCE)):
            worst = first + int(np.argmax(value[first : last + 1]))
            text = f"The crossfall is {value[worst]:.2f} %; {largest} % are allowed (RAA)."
            yield Finding(name, float(fall.station[worst]), float(value[worst]), largest, text)


def _crossfall_inside(road: Road) -> Iterator[Finding]:
    for name, carriageway in road.carriageways.items():
        fall = _crossfall(road, carriageway)
        for run in road.runs:
            if run.straight or not below(run.radius, road.limits.radius_outwards):
                continue
            low = run.start + (RUN_OFF_BEYOND if run.first > 0 else 0.0)
            high = run.end - (RUN_OFF_BEYOND if run.end < road.length else 0.0)
            if high < low:
                low = high = 0.5 * (run.start + run.end)
            span = np.searchsorted(fall.station, [low, high])
            at = np.concatenate(([low], fall.station[span[0] : span[1]], [high]))
            inwards = -np.sign(run.curvature) * np.interp(at, fall.station, fall.percent)
            worst = int(np.argmin(inwards))
            needed = curve_crossfall_percent(road.design_class, run.curvature)
            if below(float(inwards[worst]), needed):
                text = (
                    f"The crossfall towards the inside of the {run.radius:.0f} m curve is {inwards[worst]:.2f} %; "
                    f"{needed} % are needed ({road.guideline})."
                )
                station = run.start if worst == 0 else float(at[worst])
                yield Finding(name, station, float(inwards[worst]), needed, text)


def _lever(carriageway: Carriageway) -> float:
    """Return the distance of the carriageway's farther edge from its rotation axis, m."""
    return carriageway.paved_width / (2.0 if carriageway.rotation_axis == "carriageway_axis" else 1.0)


def _flat_zone(fall: _Crossfall) -> tuple[np.ndarray, np.ndarray]:
    """Return where (N - 1,) a piece lies wholly, and at least partly, where the crossfall is below the least."""
    low = np.minimum(fall.percent[:-1], fall.percent[1:])
    high = np.maximum(fall.percent[:-1], fall.percent[1:])
    least = LEAST_CROSSFALL_PERCENT
    wholly = (low >= -least * (1.0 + TOLERANCE)) & (high <= least * (1.0 + TOLERANCE))
    return wholly, (low < least * (1.0 - TOLERANCE)) & (high > -least * (1.0 - TOLERANCE))


def _run_off_steepest(road: Road) -> Iterator[Finding]:
    for name, carriageway in road.carriageways.items():
        fall, lever = _crossfall(road, carriageway), _lever(carriageway)
        wide = lever >= NARROW_RUN_OFF
        allowed = road.limits.run_off_percent if wide else NARROW_RUN_OFF_PER_METRE * lever
        wholly, _ = _flat_zone(fall)
        limit = np.where(wholly, max(allowed, LEAST_RUN_OFF_PER_METRE * lever), allowed)
        slope = np.abs(fall.slope) * lever
        for first, last in stretches(fall.runs_off & (slope > limit * (1.0 + TOLERANCE))):
            worst = first + int(np.argmax(slope[first : last + 1] / limit[first : last + 1]))
            text = f"The edge runs off at {slope[worst]:.3f} %; {limit[worst]:.3f} % are allowed (RAA)."
            yield Finding(name, float(fall.station[worst]), float(slope[worst]), float(limit[worst]), text)


def _run_off_least(road: Road) -> Iterator[Finding]:
    for name, carriageway in road.carriageways.items():
        fall, lever = _crossfall(road, carriageway), _lever(carriageway)
        least = LEAST_RUN_OFF_PER_METRE * lever
        _, partly = _flat_zone(fall)
        slope = np.abs(fall.slope) * lever
        for first, last in stretches(fall.runs_off & partly & (slope < least * (1.0 - TOLERANCE))):
            worst = first + int(np.argmin(slope[first : last + 1]))
            text = (
                f"The edge runs off at {slope[worst]:.3f} % where the crossfall is below {LEAST_CROSSFALL_PERCENT} %; "
                f"{least:.3f} % are needed to drain it (RAA)."
            )
            yield Finding(name, float(fall.station[worst]), float(slope[worst]), least, text)


def _run_off_place(road: Road) -> Iterator[Finding]:
    for name, carriageway in road.carriageways.items():
        fall = _crossfall(road, carriageway)
        cuts = np.union1d(fall.station, road.starts)
        middle = 0.5 * (cuts[:-1] + cuts[1:])
        piece = np.clip(np.searchsorted(fall.station, middle) - 1, 0, len(fall.runs_off) - 1)
        element = np.clip(np.searchsorted(road.starts, middle) - 1, 0, len(road.lengths) - 1)
        for first, last in stretches(fall.runs_off[piece] & road.constant[element]):
            length = float(cuts[last + 1] - cuts[first])
            if above(length, RUN_OFF_BEYOND):
                text = f"The crossfall changes over {length:.1f} m where the curvature doesn't (RAA)."
                yield Finding(name, float(cuts[first]), length, RUN_OFF_BEYOND, text)


def _lane_width(road: Road) -> Iterator[Finding]:
    names = SECTIONS_OF_CLASS[road.design_class]
    least = min(width for name in names for width in STANDARD_CROSS_SECTIONS[name].lanes)
    for name, carriageway in road.carriageways.items():
        for i, lane in enumerate(carriageway.lanes):
            if below(lane.width, least):
                text = f"Lane {i + 1} is {lane.width:.2f} m wide; {least:.2f} m are needed (RAA, {', '.join(names)})."
                yield Finding(name, 0.0, lane.width, least, text)


def _median_width(road: Road) -> Iterator[Finding]:
    if len(road.carriageways) < 2:
        return
    width = sum(carriageway.inner_offset for carriageway in road.carriageways.values())
    if below(width, LEAST_MEDIAN):
        name = next(
            (name for name, item in road.parameters.objects.items() if item.type == "Median"),
            next(iter(road.carriageways)),
        )
        yield Finding(
            name, 0.0, width, LEAST_MEDIAN, f"The median is {width:.2f} m wide; {LEAST_MEDIAN} m are needed (RAA)."
        )


def _lines_at(road: Road, name: str, carriageway: Carriageway) -> Iterator[_Boundary]:
    """Yield (kind, boundary, its lines by id) of every lane boundary of a carriageway."""
    last = len(carriageway.lanes)
    for boundary in range(last + 1):
        kind = "outer_edge" if boundary == 0 else "inner_edge" if boundary == last else "lane"
        fits = [
            (key, line)
            for key, line in road.markings.items()
            if line.carriageway == name and line.boundary == boundary and line.kind == kind
        ]
        yield kind, boundary, fits


def _marking_missing(road: Road) -> Iterator[Finding]:
    for name, carriageway in road.carriageways.items():
        for kind, boundary, lines in _lines_at(road, name, carriageway):
            if not lines:
                text = f"There is no {kind.replace('_', ' ')} line on lane boundary {boundary} (RMS)."
                yield Finding(name, 0.0, 0.0, 1.0, text)


def _marking_coverage(road: Road) -> Iterator[Finding]:
    for name, carriageway in road.carriageways.items():
        for _, boundary, lines in _lines_at(road, name, carriageway):
            spans = [(line.start_station, line.end_station) for _, line in lines]
            for start, end in gaps(spans, road.length) if lines else ():
                text = f"Lane boundary {boundary} has no line for {end - start:.2f} m; it runs the whole road (RMS)."
                yield Finding(lines[0][0], start, end - start, 0.0, text)


def _marking_width(road: Road) -> Iterator[Finding]:
    for name, line in road.markings.items():
        width = LINE_WIDTHS[line.kind]
        if below(line.width, width) or above(line.width, width):
            text = f"The line is {line.width:.3f} m wide; {line.kind.replace('_', ' ')} lines have {width:.2f} m (RMS)."
            yield Finding(name, line.start_station, line.width, width, text)


def _marking_pattern(road: Road) -> Iterator[Finding]:
    for name, line in road.markings.items():
        wanted = (LANE_DASH, LANE_GAP) if line.kind == "lane" else (0.0, 0.0)
        for part, value, limit in zip(("dash", "gap"), (line.dash_length, line.gap_length), wanted, strict=True):
            if below(value, limit) or above(value, limit):
                text = f"The line's {part} is {value:g} m instead of {limit:g} m ({line.kind.replace('_', ' ')}, RMS)."
                yield Finding(name, line.start_station, value, limit, text)
                break


RULES = (
    Rule("crossfall-order", "Crossfall points are in order", "m", "", "definition", _crossfall_order),
    Rule("crossfall-least", "Least crossfall outside of run-offs", "%", "RAA", "confirmed", _crossfall_least),
    Rule("crossfall-largest", "Largest crossfall", "%", "RAA", "confirmed", _crossfall_largest),
    Rule("crossfall-inside", "Crossfall towards the inside of curves", "%", "RAA", "derived", _crossfall_inside),
    Rule("run-off-steepest", "Largest slope of the edge in a run-off", "%", "RAA", "confirmed", _run_off_steepest),
    Rule("run-off-least", "Least slope of the edge in a run-off", "%", "RAA", "confirmed", _run_off_least),
    Rule("run-off-place", "Run-offs lie where the curvature changes", "m", "RAA", "unconfirmed", _run_off_place),
    Rule("lane-width", "Narrowest lane", "m", "RAA", "confirmed", _lane_width),
    Rule("median-width", "Narrowest median", "m", "RAA", "confirmed", _median_width),
    Rule("marking-missing", "Every lane boundary has its line", "1", "RMS", "confirmed", _marking_missing),
    Rule("marking-coverage", "Lines run the whole road", "m", "RMS", "definition", _marking_coverage),
    Rule("marking-width", "Width of lines", "m", "RMS", "unconfirmed", _marking_width),
    Rule("marking-pattern", "Dash and gap of lines", "m", "RMS", "confirmed", _marking_pattern),
)
