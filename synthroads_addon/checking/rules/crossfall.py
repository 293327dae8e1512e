"""Rules for the crossfall and its run-offs (RAA)."""

from collections.abc import Iterator

import numpy as np

from ...road.guidelines import LARGEST_CROSSFALL_PERCENT, LEAST_CROSSFALL_PERCENT, curve_crossfall_percent
from .edges import Edges
from .obstacles import Bool
from .rule import TOLERANCE, Crossfall, Finding, Road, Rule, at_least, at_most, below, out_of_order, stretches

#: A run-off may reach this far (m) beyond the elements whose curvature changes: crossfall points are often rounded.
RUN_OFF_BEYOND = 1.0
#: The least run-off slope (%) per metre between rotation axis and edge (RAA); the largest one where that is below 4 m.
LEAST_RUN_OFF_PER_METRE = 0.1
NARROW_RUN_OFF_PER_METRE = 0.225
NARROW_RUN_OFF = 4.0


def _crossfall_order(road: Road) -> Iterator[Finding]:
    for name, edges in road.sides.items():
        points = edges.carriageway.crossfall
        for number, at, past in out_of_order(point.station for point in points):
            if at < past or points[number - 1].crossfall_percent != points[number - 2].crossfall_percent:
                text = f"Crossfall point {number} at {at:.3f} m does not follow the one at {past:.3f} m."
                yield Finding(name, at, at, past, text)


def _crossfall_least(road: Road) -> Iterator[Finding]:
    least = LEAST_CROSSFALL_PERCENT
    for name, fall in road.crossfalls.items():
        value = np.abs(fall.percent[:-1])
        for first, last in stretches(~fall.runs_off & (value < least * (1.0 - TOLERANCE))):
            worst = value[first : last + 1].min()
            text = f"The crossfall is {worst:.2f} % outside of a run-off; {least} % are needed (RAA)."
            yield Finding(name, fall.station[first], worst, least, text)


def _crossfall_largest(road: Road) -> Iterator[Finding]:
    largest = LARGEST_CROSSFALL_PERCENT
    for name, fall in road.crossfalls.items():
        value = np.abs(fall.percent)
        for first, last in stretches(value > largest * (1.0 + TOLERANCE)):
            worst = first + int(np.argmax(value[first : last + 1]))
            text = f"The crossfall is {value[worst]:.2f} %; {largest} % are allowed (RAA)."
            yield Finding(name, fall.station[worst], value[worst], largest, text)


def _crossfall_inside(road: Road) -> Iterator[Finding]:
    for name, fall in road.crossfalls.items():
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
            text = (
                f"The crossfall towards the inside of the {run.radius:.0f} m curve is {inwards[worst]:.2f} %; "
                f"{needed} % are needed ({road.guideline})."
            )
            station = run.start if worst == 0 else at[worst]
            yield from at_least(name, station, inwards[worst], needed, text)


def _edge_lever(edges: Edges) -> float:
    """Return the largest distance of the main road's farther edge from its rotation axis, m."""
    if edges.carriageway.rotation_axis == "centreline":
        return float(np.maximum(np.abs(edges.at_marks.main), np.abs(edges.at_marks.inner)).max())
    width = float((edges.at_marks.main - edges.at_marks.inner).max())
    return width / (2.0 if edges.carriageway.rotation_axis == "carriageway_axis" else 1.0)


def _flat_pieces(fall: Crossfall) -> tuple[Bool, Bool]:
    """Return two masks (N - 1,): pieces wholly, and at least partly, of less than the least crossfall."""
    low = np.minimum(fall.percent[:-1], fall.percent[1:])
    high = np.maximum(fall.percent[:-1], fall.percent[1:])
    least = LEAST_CROSSFALL_PERCENT
    wholly = (low >= -least * (1.0 + TOLERANCE)) & (high <= least * (1.0 + TOLERANCE))
    return wholly, (low < least * (1.0 - TOLERANCE)) & (high > -least * (1.0 - TOLERANCE))


def _run_off_steepest(road: Road) -> Iterator[Finding]:
    for name, fall in road.crossfalls.items():
        lever = _edge_lever(road.sides[name])
        wide = lever >= NARROW_RUN_OFF
        allowed = road.limits.run_off_percent if wide else NARROW_RUN_OFF_PER_METRE * lever
        wholly, _ = _flat_pieces(fall)
        limit = np.where(wholly, max(allowed, LEAST_RUN_OFF_PER_METRE * lever), allowed)
        slope = np.abs(fall.slope) * lever
        for first, last in stretches(fall.runs_off & (slope > limit * (1.0 + TOLERANCE))):
            worst = first + int(np.argmax(slope[first : last + 1] / limit[first : last + 1]))
            text = f"The edge runs off at {slope[worst]:.3f} %; {limit[worst]:.3f} % are allowed (RAA)."
            yield Finding(name, fall.station[worst], slope[worst], limit[worst], text)


def _run_off_least(road: Road) -> Iterator[Finding]:
    for name, fall in road.crossfalls.items():
        lever = _edge_lever(road.sides[name])
        least = LEAST_RUN_OFF_PER_METRE * lever
        _, partly = _flat_pieces(fall)
        slope = np.abs(fall.slope) * lever
        for first, last in stretches(fall.runs_off & partly & (slope < least * (1.0 - TOLERANCE))):
            worst = first + int(np.argmin(slope[first : last + 1]))
            text = (
                f"The edge runs off at {slope[worst]:.3f} % where the crossfall is below {LEAST_CROSSFALL_PERCENT} %; "
                f"{least:.3f} % are needed to drain it (RAA)."
            )
            yield Finding(name, fall.station[worst], slope[worst], least, text)


def _run_off_place(road: Road) -> Iterator[Finding]:
    for name, fall in road.crossfalls.items():
        cuts = np.union1d(fall.station, road.starts)
        middle = 0.5 * (cuts[:-1] + cuts[1:])
        piece = np.clip(np.searchsorted(fall.station, middle) - 1, 0, len(fall.runs_off) - 1)
        element = np.clip(np.searchsorted(road.starts, middle) - 1, 0, len(road.lengths) - 1)
        for first, last in stretches(fall.runs_off[piece] & road.constant[element]):
            length = cuts[last + 1] - cuts[first]
            text = f"The crossfall changes over {length:.1f} m where the curvature doesn't (RAA)."
            yield from at_most(name, cuts[first], length, RUN_OFF_BEYOND, text)


RULES = (
    Rule("crossfall-order", "Crossfall points are in order", "m", "", "definition", _crossfall_order),
    Rule("crossfall-least", "Least crossfall outside of run-offs", "%", "RAA", "confirmed", _crossfall_least),
    Rule("crossfall-largest", "Largest crossfall", "%", "RAA", "confirmed", _crossfall_largest),
    Rule("crossfall-inside", "Crossfall towards the inside of curves", "%", "RAA", "derived", _crossfall_inside),
    Rule("run-off-steepest", "Largest slope of the edge in a run-off", "%", "RAA", "confirmed", _run_off_steepest),
    Rule("run-off-least", "Least slope of the edge in a run-off", "%", "RAA", "confirmed", _run_off_least),
    Rule("run-off-place", "Run-offs lie where the curvature changes", "m", "RAA", "unconfirmed", _run_off_place),
)
