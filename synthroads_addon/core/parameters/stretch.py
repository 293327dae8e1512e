"""Stretches of a long road: what of a parameter set lies between two stations."""

from __future__ import annotations

import math
from itertools import pairwise

from .model import LineMarking, LineObject, PointObject, RoadParameters, TemporaryBarrier, Vegetation, Vehicle
from .model_base import RoadObject

LONGEST = 500.0
"""Length of a stretch unless something else is asked for, m."""
BEYOND = 60.0
"""What runs along the road is cut so far (m) outside of a stretch, so that no terminal is made up inside of it."""


def stretches(length: float, longest: float = LONGEST) -> list[tuple[float, float]]:
    """Return the (start, end) stations of a road's stretches: as few as can be, equally long, none above `longest`."""
    count = max(1, math.ceil(length / longest - 1e-9))
    borders = [length * i / count for i in range(count + 1)]
    return list(pairwise(borders))


def cut(parameters: RoadParameters, start: float, end: float) -> RoadParameters:
    """Return a set with only what stands between two stations (the end is the next stretch's, but for the last one).

    The road itself stays whole, and so does what runs obliquely. What is periodic (posts, dashes) is cut in its rhythm.
    """
    last = end >= parameters.alignment.length
    objects: dict[str, RoadObject] = {}
    for name, item in parameters.objects.items():
        if isinstance(item, PointObject | Vehicle):
            if start <= item.station < end or (last and item.station >= end):
                objects[name] = item
        elif isinstance(item, LineObject | LineMarking):
            if item.end_station > start and item.start_station < end:
                objects[name] = item if isinstance(item, TemporaryBarrier) else _cut(item, start, end)
        elif isinstance(item, Vegetation):
            # The same seed would put the same plants on every stretch.
            objects[name] = item.model_copy(update={"seed": item.seed + int(start)})
        else:
            objects[name] = item
    return parameters.model_copy(update={"objects": objects})


def _cut(item: LineObject | LineMarking, start: float, end: float) -> RoadObject:
    """Return a line object that begins and ends near a stretch; its beginning moves by whole periods."""
    low, high = start - BEYOND, end + BEYOND
    update: dict[str, float] = {}
    if item.start_station < low:
        period = _period(item)
        update["start_station"] = item.start_station + period * math.floor((low - item.start_station) / period)
    if item.end_station > high:
        update["end_station"] = high
    return item.model_copy(update=update) if update else item


def _period(item: LineObject | LineMarking) -> float:
    if isinstance(item, LineMarking):
        return item.dash_length + item.gap_length or 1.0
    return float(getattr(item, "post_spacing", 0.0) or getattr(item, "segment_length", 0.0) or 1.0)
