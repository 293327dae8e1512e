"""Stretches of a long road: what of a parameter set lies between two stations, and the frame that it is built in.

A stretch is the whole road's piece: its surface has the whole road's rows, what is periodic (posts, dashes, plants) its
rhythm. Only the float32 numbers of Blender's scene depend on the frame, by their rounding, and the frames of stretches
near the local origin are the whole road's own.
"""

import math
from itertools import pairwise

import numpy as np

from ..base.arrays import Float
from .geometry import RoadGeometry
from .objects import LineObject, PointObject, RoadObject
from .parameters import RoadParameters
from .section import LineMarking
from .structures.bridge import Bridge
from .structures.tunnel import Tunnel
from .surroundings import RampVehicle, Vehicle
from .things.temporary_barrier import TemporaryBarrier

LONGEST = 500.0
"""Length of a stretch unless something else is asked for, m."""
BEYOND = 1000.0
"""Distance outside of a stretch at which things along the road are cut, so that no terminal is made up inside, m."""
FRAME = 1000.0
"""Places and stations of frames are whole multiples of this, m. Within the stretch and its frame float32 numbers are
then rounded by less than 0.1 mm, wherever it lies; stretches of one kilometre share a frame."""

_BEFORE = 1200.0
"""A stretch begins at least so far (m) after the station that its nodes count from, if that isn't 0: no input of what
is cut `BEYOND` it is negative."""
_BARRIER_PERIOD = 4.0
"""Longest piece of a barrier without posts, m: see `ModelBuilder.step`."""


def stretches(length: float, longest: float = LONGEST) -> list[tuple[float, float]]:
    """Return the (start, end) stations, m, of a road's stretches: the fewest, equally long, none above ``longest``.

    Example:
        >>> stretches(1000.0, longest=600.0)
        [(0.0, 500.0), (500.0, 1000.0)]
    """
    count = max(1, math.ceil(length / longest - 1e-9))
    borders = [length * i / count for i in range(count + 1)]
    return list(pairwise(borders))


def frame_of(geometry: RoadGeometry, start: float, end: float) -> tuple[Float, int]:
    """Return the local coordinates (3,) of a stretch's scene origin, and the station that its nodes count from, m.

    Args:
        geometry: the whole road's.
        start, end: stations, m.
    """
    middle_station = np.array([(start + end) / 2.0])
    middle_point = np.array(
        [*geometry.alignment.position(middle_station)[0], *geometry.profile.elevation(middle_station)]
    )
    origin = FRAME * np.round(middle_point / FRAME) + 0.0  # no negative zero
    return origin, int(max(0.0, FRAME * math.floor((start - _BEFORE) / FRAME)))


def cut_stretch(parameters: RoadParameters, start: float, end: float) -> RoadParameters:
    """Return a parameter set with only what stands between two stations, the end excluded but at the road's own.

    The road itself stays whole, and so do plants, which are cut with its surface, and what runs obliquely. What is
    periodic (posts, dashes) is cut in its rhythm.
    """
    is_last = end >= parameters.alignment.length
    objects: dict[str, RoadObject] = {}
    for name, item in parameters.objects.items():
        if isinstance(item, PointObject | Vehicle) and not isinstance(item, RampVehicle):
            if start <= item.station < end or (is_last and item.station >= end):
                objects[name] = item
        elif isinstance(item, LineObject | LineMarking):
            if item.end_station > start and item.start_station < end:
                objects[name] = (
                    item if isinstance(item, TemporaryBarrier | Bridge | Tunnel) else _cut_line(item, start, end)
                )
        else:
            objects[name] = item
    return parameters.model_copy(update={"objects": objects})


def _cut_line(item: LineObject | LineMarking, start: float, end: float) -> RoadObject:
    """Return a line object cut to begin and end near a stretch; its beginning moves by whole periods."""
    first_station, last_station = start - BEYOND, end + BEYOND
    update: dict[str, float] = {}
    if item.start_station < first_station:
        period = _period(item)
        update["start_station"] = item.start_station + period * math.floor(
            (first_station - item.start_station) / period
        )
    if item.end_station > last_station:
        update["end_station"] = last_station
    return item.model_copy(update=update) if update else item


def _period(item: LineObject | LineMarking) -> float:
    """Return the length (m) after which a line object repeats itself: dash and gap, or the spacing of its posts."""
    if isinstance(item, LineMarking):
        return item.dash_length + item.gap_length or 1.0
    return float(getattr(item, "post_spacing", 0.0) or _BARRIER_PERIOD)
