"""Where nothing stands yet: the next station along the road at which one thing more reaches into no other."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from ...base.arrays import Float
from ...base.schema import round_value
from ...road.geometry import RoadGeometry
from ...road.objects import RoadObject, Side
from ...road.things.thing import StandingThing, Thing
from .single import thing_by_rule

FARTHEST_MOVE = 50.0
"""So far along the road, m, a place is looked for. Chosen: the spacing of delineators, and still in sight."""
_GAP = 0.1
"""Distance along the road, m, that is kept from what stands in the way. Chosen: more than stations are rounded by."""
_TOUCH = 1e-3
"""Boxes may reach this far (m) into each other: offsets are rounded."""


class FreePlace(NamedTuple):
    """A thing at the place that was found for it.

    Attributes:
        thing: with the instance number 1.
        obstacle: id of what stands where it was asked for; empty if nothing does.
        is_free: whether nothing stands where the thing is now.
    """

    thing: Thing
    obstacle: str
    is_free: bool


class StandingBoxes:
    """The boxes of all things of a road, in stations, offsets and heights.

    Args:
        objects: of the road, by id.
    """

    def __init__(self, objects: Mapping[str, RoadObject]) -> None:
        self._names = [name for name, item in objects.items() if isinstance(item, Thing) for _ in item.footprint()]
        self._borders = np.concatenate(
            [np.empty((0, 6)), *(borders(item) for item in objects.values() if isinstance(item, Thing))]
        )

    def obstacle(self, thing: Thing) -> tuple[str, float]:
        """Return what a thing reaches into: its id, and how far (m) along the road ends the last such box.

        The distance is counted from the thing's beginning; the id is empty, and the distance 0, if it reaches into
        nothing.
        """
        own = borders(thing)
        lower = np.maximum(own[:, None, ::2], self._borders[None, :, ::2])
        upper = np.minimum(own[:, None, 1::2], self._borders[None, :, 1::2])
        depth = (upper - lower).min(axis=2, initial=np.inf)
        mine, other = np.nonzero(depth > _TOUCH)
        if not len(mine):
            return "", 0.0
        deepest = int(depth[mine, other].argmax())
        needed_move = self._borders[other, 1] - own[mine, 0]
        return self._names[other[deepest]], float(needed_move.max())


def borders(thing: Thing) -> Float:
    """Return the borders (N, 6), m, of a thing's boxes: start, end, low, high, bottom, top."""
    return np.array([block[1:] for block in thing.footprint()], dtype=np.float64).reshape(-1, 6)


def thing_at_free_place(
    geometry: RoadGeometry,
    kind: str,
    side: Side,
    station: float,
    fields: Mapping[str, Any],
    *,
    farthest_move: float = FARTHEST_MOVE,
) -> FreePlace:
    """Return one thing more for a road by `thing_by_rule`, moved along with the stations to where nothing stands.

    What runs along the road isn't moved, and neither is what finds no place: it is returned where it was asked for.

    Args:
        geometry, kind, side, station, fields: see `thing_by_rule`.
        farthest_move: m.

    Raises:
        InputError: a field is out of its limits.
    """
    boxes = StandingBoxes(geometry.parameters.objects)
    first = thing_by_rule(geometry, kind, side, station, fields)
    assert isinstance(first, Thing)
    first_obstacle, move = boxes.obstacle(first)
    if not first_obstacle:
        return FreePlace(first, "", is_free=True)
    if isinstance(first, StandingThing):
        tried_station = first.station
        while (tried_station := round_value(tried_station + move + _GAP)) <= min(
            first.station + farthest_move, geometry.length
        ):
            thing = thing_by_rule(geometry, kind, side, tried_station, fields)
            assert isinstance(thing, Thing)
            obstacle, move = boxes.obstacle(thing)
            if not obstacle:
                return FreePlace(thing, first_obstacle, is_free=True)
    return FreePlace(first, first_obstacle, is_free=False)
