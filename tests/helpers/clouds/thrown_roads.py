"""Roads thrown at random for the study of carriageways: motorways, streets, rural roads, with faults of surveys."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from synthroads_addon.base.arrays import Bool, Float, Int
from tests.helpers.clouds.hard_roads import ASPHALT, Ground, HardRoad, Paint, carriageway, rural, street
from tests.helpers.clouds.survey_faults import SurveyFaults

UNLIKE = "unlike carriageways"
"""The kind of motorway whose carriageways have lanes, shoulders, heights and crossfalls of their own."""
MOTORWAYS = ("narrow median", "exit", "three carriageways", UNLIKE)
"""Kinds of thrown roads with two carriageways and more."""
KINDS = ("narrow median", "exit", "three carriageways", "rural", "street", UNLIKE)
"""All kinds of thrown roads, in the order that their seeds count by."""
_CUTS = (0.0, 0.3, 0.5, 0.65)
"""Largest shares of a side that are cut off: the last two cut within the pavement."""
_GORE = 1.0
"""Distance of a ramp from the carriageway, m, from which on it must count as one; nearer ones may."""


def thrown_road(kind: str, seed: int) -> HardRoad:
    """Return a road of a kind (`KINDS`) drawn by a seed, with the faults of its survey."""
    rng = np.random.default_rng([seed, 11, KINDS.index(kind)])
    cut = float(rng.choice(_CUTS))
    if kind in MOTORWAYS:
        road = _motorway(kind, seed, rng)
    else:
        road = rural(seed) if kind == "rural" else street(seed)
        cut = min(cut, 0.5) if kind == "street" else cut
    rails = (-0.3, 0.3) if kind in MOTORWAYS else ()
    faults = SurveyFaults.draw(1000 * KINDS.index(kind) + seed, road.length, road.reach, rails)
    return replace(road, name=kind, cut=cut, faults=faults, slant=float(rng.uniform(-4.0, 4.0)))


def _motorway(kind: str, seed: int, rng: np.random.Generator) -> HardRoad:
    """Return a motorway with a median of 1.5 to 4 m of any ground, perhaps with a ramp or a third carriageway."""
    width, lane = rng.uniform(1.5, 4.0), float(rng.choice([3.25, 3.5, 3.75]))
    lanes, shoulder = int(rng.choice([2, 2, 3])), float(rng.choice([0.5, 1.5, 2.5]))
    right, right_lines, right_outer = carriageway(-0.5 * width, lanes, lane, shoulder, -1)
    if kind == UNLIKE:
        other = np.random.default_rng([seed, 12])
        lanes, lane = int(other.choice([2, 3])), float(other.choice([3.25, 3.5, 3.75]))
        shoulder = float(other.choice([0.5, 1.5, 2.5]))
    left, left_lines, left_outer = carriageway(0.5 * width, lanes, lane, shoulder, 1)
    if kind == UNLIKE:
        right_fall, left_fall = other.uniform(-0.06, 0.06, 2)
        right = replace(right, fall=right_fall, height=float(other.uniform(-0.4, 0.4)))
        left = replace(left, fall=left_fall)
    dashes = ((6.0, 12.0), (4.0, 8.0))[int(rng.integers(2))]
    phases = rng.uniform(0.0, 18.0, 2)
    lines = [
        replace(line, dash=dashes[0], gap=dashes[1], phase=float(phase)) if line.dash else line
        for side, phase in zip((right_lines, left_lines), phases, strict=True)
        for line in side
    ]
    decibel, rough = rng.uniform(0.0, 3.7), rng.uniform(0.004, 0.03)
    height = float(rng.choice([0.0, 0.03, 0.1]))
    median = Ground(-0.5 * width, 0.5 * width, ASPHALT * 10.0 ** (decibel / 10.0), rough, height)
    grounds, reach = [right, left, median], max(abs(left_outer), abs(right_outer)) + 6.0
    sign, outer = (-1, right_outer) if rng.random() < 0.5 else (1, left_outer)
    if kind == "exit":
        start, turn, ramp = rng.uniform(20.0, 80.0), sign * rng.uniform(8.0, 14.0), rng.uniform(4.0, 6.0)
        inner = outer - sign * ramp
        grounds.insert(0, Ground(*sorted((inner, outer)), turn=turn, start=start, use="ramp"))
        for place in (inner, outer):
            lines.append(Paint(place + (0.4 if place < 0.5 * (inner + outer) else -0.4), turn=turn, start=start))
        reach += 10.0
    if kind == "three carriageways":
        gap, collector_lanes = rng.uniform(1.5, 4.0), int(rng.choice([1, 2]))
        width_of_lane = 4.5 if collector_lanes == 1 else 3.5
        collector, more_lines, collector_outer = carriageway(
            outer + sign * gap, collector_lanes, width_of_lane, float(rng.choice([0.5, 1.5])), sign
        )
        grounds.append(collector)
        if rng.random() < 0.5:  # parted by other ground than the verge's
            level = ASPHALT * 10.0 ** (rng.uniform(1.0, 3.7) / 10.0)
            grounds.append(Ground(*sorted((outer, outer + sign * gap)), level, 0.02, 0.03))
        lines += more_lines
        reach = abs(collector_outer) + 5.0
    marks = {"median": width, "decibel": decibel, "rough": rough}
    return HardRoad(kind, tuple(grounds), tuple(lines), reach, 0.0, 0, seed, marks=marks)


def true_counts(road: HardRoad, station: Float) -> tuple[Int, Int, Bool]:
    """Return the numbers of carriageways and of ramps that the cloud shows at stations (N,), and where both are plain.

    A ramp begins as part of its carriageway: where both are less than `_GORE` apart it may count or not.

    Returns:
        carriageways (N,), ramps (N,), mask (N,).
    """
    strips = road.strips(station, "carriageway")
    number = np.sum([seen for seen, _ in strips], axis=0) if strips else np.ones(len(station), dtype=np.int64)
    ramps, plain = np.zeros(len(station), dtype=np.int64), np.ones(len(station), dtype=bool)
    for ground in (ground for ground in road.grounds if ground.use == "ramp"):
        sign = np.sign(ground.turn)
        carriageways = [other for other in road.grounds if other.use == "carriageway"]
        outer = max(sign * edge for other in carriageways for edge in (other.low, other.high))
        ((_, middle),) = road.strips(station, "ramp")
        apart = sign * middle - 0.5 * (ground.high - ground.low) - outer
        right_cut, left_cut = road.sides(station)
        shown = np.minimum(sign * middle + 0.5 * (ground.high - ground.low), right_cut if sign < 0 else left_cut)
        shown = shown - np.maximum(apart + outer, 0.0)
        ramps += (apart >= _GORE) & (shown >= 3.0) & (station >= ground.start)
        plain &= ~((apart > 0.0) & (apart < _GORE)) & ~((apart >= _GORE) & (shown > 1.5) & (shown < 3.0))
    # A strip that is cut to less than a lane may count or not.
    for (seen, _), (seen_more, _) in zip(strips, road.strips(station, "carriageway", 1.5), strict=True):
        plain &= seen | ~seen_more
    return number, ramps, plain
