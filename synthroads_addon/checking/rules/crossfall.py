"""Rules for the crossfall and its run-offs (RAA, RAL)."""

from collections.abc import Iterator

import numpy as np

from ...road.guidelines import curve_crossfall_percent
from .edges import Edges
from .obstacles import Bool
from .rule import TOLERANCE, Crossfall, Finding, Road, Rule, at_least, at_most, below, out_of_order, stretches

#: A run-off may reach this far (m) beyond the elements whose curvature changes: crossfall points are often rounded.
RUN_OFF_BEYOND = 1.0


def _crossfall_order(road: Road) -> Iterator[Finding]:
    """Yield a finding for each crossfall point that doesn't follow the points before it."""
    for name, edges in road.sides.items():
        points = edges.carriageway.crossfall
        for number, station, largest_before in out_of_order(point.station for point in points):
            if station < largest_before or points[number - 1].crossfall_percent != points[number - 2].crossfall_percent:
                text = f"Crossfall point {number} at {station:.3f} m does not follow the one at {largest_before:.3f} m."
                yield Finding(name, station, station, largest_before, text)


def _crossfall_least(road: Road) -> Iterator[Finding]:
    """Yield a finding for each stretch of less than the least crossfall outside of run-offs."""
    least_percent = road.limits.least_crossfall_percent
    if not road.binds("least_crossfall_percent"):
        return
    for name, fall in road.crossfalls.items():
        value = np.abs(fall.percent[:-1])
        for first_piece, last_piece in stretches(~fall.runs_off & (value < least_percent * (1.0 - TOLERANCE))):
            worst_percent = value[first_piece : last_piece + 1].min()
            text = f"The crossfall is {worst_percent:.2f} % outside of a run-off; {least_percent} % are needed (RAA)."
            yield Finding(name, fall.station[first_piece], worst_percent, least_percent, text)


def _crossfall_largest(road: Road) -> Iterator[Finding]:
    """Yield a finding for each stretch of more than the largest crossfall."""
    largest_percent = road.limits.largest_crossfall_percent
    if not road.binds("largest_crossfall_percent"):
        return
    for name, fall in road.crossfalls.items():
        value = np.abs(fall.percent)
        for first_row, last_row in stretches(value > largest_percent * (1.0 + TOLERANCE)):
            worst_row = first_row + int(np.argmax(value[first_row : last_row + 1]))
            text = f"The crossfall is {value[worst_row]:.2f} %; {largest_percent} % are allowed (RAA)."
            yield Finding(name, fall.station[worst_row], value[worst_row], largest_percent, text)


def _crossfall_inside(road: Road) -> Iterator[Finding]:
    """Yield a finding for each curve that doesn't fall to its inside as its radius needs."""
    if not road.binds("radius_least_crossfall"):
        return
    for name, fall in road.crossfalls.items():
        for run in road.runs:
            if run.straight or not below(run.radius, road.limits.radius_outwards):
                continue
            start = run.start + (RUN_OFF_BEYOND if run.first > 0 else 0.0)
            end = run.end - (RUN_OFF_BEYOND if run.end < road.length else 0.0)
            if end < start:
                start = end = 0.5 * (run.start + run.end)
            span = np.searchsorted(fall.station, [start, end])
            stations = np.concatenate(([start], fall.station[span[0] : span[1]], [end]))
            inward_percent = -np.sign(run.curvature) * np.interp(stations, fall.station, fall.percent)
            worst_row = int(np.argmin(inward_percent))
            needed_percent = curve_crossfall_percent(road.design_class, run.curvature)
            text = (
                f"The crossfall towards the inside of the {run.radius:.0f} m curve is "
                f"{inward_percent[worst_row]:.2f} %; {needed_percent} % are needed ({road.guideline})."
            )
            station = run.start if worst_row == 0 else stations[worst_row]
            yield from at_least(name, station, inward_percent[worst_row], needed_percent, text)


def _edge_lever(road: Road, edges: Edges) -> float:
    """Return the largest distance of the main road's farther edge from its rotation axis outside of villages, m."""
    is_open = ~np.any([(edges.marks > a) & (edges.marks < b) for a, b in [*road.villages, (np.inf, np.inf)]], axis=0)
    main, inner = edges.at_marks.main[is_open], edges.at_marks.inner[is_open]
    if edges.carriageway.rotation_axis == "centreline":
        return float(np.maximum(np.abs(main), np.abs(inner)).max())
    width = float((main - inner).max())
    return width / (2.0 if edges.carriageway.rotation_axis == "carriageway_axis" else 1.0)


def _flat_pieces(fall: Crossfall, flat_limit: float) -> tuple[Bool, Bool]:
    """Return two masks (N - 1,): pieces wholly, and at least partly, of less than the least crossfall (%)."""
    least_percent = np.minimum(fall.percent[:-1], fall.percent[1:])
    largest_percent = np.maximum(fall.percent[:-1], fall.percent[1:])
    is_wholly_flat = (least_percent >= -flat_limit * (1.0 + TOLERANCE)) & (
        largest_percent <= flat_limit * (1.0 + TOLERANCE)
    )
    return is_wholly_flat, (least_percent < flat_limit * (1.0 - TOLERANCE)) & (
        largest_percent > -flat_limit * (1.0 - TOLERANCE)
    )


def _run_off_steepest(road: Road) -> Iterator[Finding]:
    """Yield a finding for each run-off in which the pavement's edge is too steep against the rotation axis."""
    source = road.cite("run_off_percent")
    for name, fall in road.crossfalls.items():
        lever = _edge_lever(road, road.sides[name])
        allowed_slope = min(road.limits.run_off_percent, road.limits.run_off_percent_per_metre * lever)
        is_wholly_flat, _ = _flat_pieces(fall, road.limits.least_crossfall_percent)
        least_slope = road.limits.run_off_least_per_metre * lever
        limit = np.where(is_wholly_flat, max(allowed_slope, least_slope), allowed_slope)
        slope = np.abs(fall.slope) * lever
        # In built-up areas the edge may be as steep as it is (wikipedia "Anrampungsneigung", of the RASt).
        is_open = ~np.any(
            [(fall.station[:-1] >= a) & (fall.station[1:] <= b) for a, b in [*road.villages, (np.inf, np.inf)]], axis=0
        )
        for first_piece, last_piece in stretches(is_open & fall.runs_off & (slope > limit * (1.0 + TOLERANCE))):
            worst_piece = first_piece + int(
                np.argmax(slope[first_piece : last_piece + 1] / limit[first_piece : last_piece + 1])
            )
            text = (
                f"The edge runs off at {slope[worst_piece]:.3f} %; {limit[worst_piece]:.3f} % are allowed ({source})."
            )
            yield Finding(name, fall.station[worst_piece], slope[worst_piece], limit[worst_piece], text)


def _run_off_least(road: Road) -> Iterator[Finding]:
    """Yield a finding for each run-off whose edge is too level where the crossfall is too small to drain."""
    for name, fall in road.crossfalls.items():
        lever = _edge_lever(road, road.sides[name])
        least_slope = road.limits.run_off_least_per_metre * lever
        _, is_partly_flat = _flat_pieces(fall, road.limits.least_crossfall_percent)
        slope = np.abs(fall.slope) * lever
        for first_piece, last_piece in stretches(
            fall.runs_off & is_partly_flat & (slope < least_slope * (1.0 - TOLERANCE))
        ):
            worst_piece = first_piece + int(np.argmin(slope[first_piece : last_piece + 1]))
            text = (
                f"The edge runs off at {slope[worst_piece]:.3f} % where the crossfall is below "
                f"{road.limits.least_crossfall_percent} %; {least_slope:.3f} % are needed to drain it "
                f"({road.cite('run_off_least_per_metre')})."
            )
            yield Finding(name, fall.station[worst_piece], slope[worst_piece], least_slope, text)


def _run_off_place(road: Road) -> Iterator[Finding]:
    """Yield a finding for each stretch over which the crossfall changes although the curvature doesn't."""
    for name, fall in road.crossfalls.items():
        cuts = np.union1d(fall.station, road.starts)
        interval_middles = 0.5 * (cuts[:-1] + cuts[1:])
        piece = np.clip(np.searchsorted(fall.station, interval_middles) - 1, 0, len(fall.runs_off) - 1)
        element = np.clip(np.searchsorted(road.starts, interval_middles) - 1, 0, len(road.lengths) - 1)
        for first_interval, last_interval in stretches(fall.runs_off[piece] & road.constant[element]):
            length = cuts[last_interval + 1] - cuts[first_interval]
            text = f"The crossfall changes over {length:.1f} m where the curvature doesn't ({road.guideline_name})."
            yield from at_most(name, cuts[first_interval], length, RUN_OFF_BEYOND, text)


RULES = (
    Rule("crossfall-order", "Crossfall points are in order", "m", "", "definition", _crossfall_order),
    Rule("crossfall-least", "Least crossfall outside of run-offs", "%", "RAA", "confirmed", _crossfall_least),
    Rule("crossfall-largest", "Largest crossfall", "%", "RAA", "confirmed", _crossfall_largest),
    Rule("crossfall-inside", "Crossfall towards the inside of curves", "%", "RAA", "derived", _crossfall_inside),
    Rule("run-off-steepest", "Largest slope of the edge in a run-off", "%", "RAA", "confirmed", _run_off_steepest),
    Rule("run-off-least", "Least slope of the edge in a run-off", "%", "RAA", "confirmed", _run_off_least),
    Rule("run-off-place", "Run-offs lie where the curvature changes", "m", "RAA", "unconfirmed", _run_off_place),
)
