"""Obstacles on the road as boxes along station, offset and height, and where they stand beside the carriageways."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...road.parameters import RoadParameters
from ...road.things.concrete_barrier import ConcreteBarrier
from ...road.things.guardrail import Guardrail
from ...road.things.kilometre_board import KilometreBoard
from ...road.things.sign import TrafficSign
from ...road.things.thing import Block, Thing
from ...road.things.traffic_light import TrafficLight
from .edges import Edges, Float

#: What is longer than this (m) along the road is looked at at its ends as well.
LONG = 1.5

Bool = NDArray[np.bool_]
Spans = list[tuple[float, float]]
"""Stretches of the road, m."""


class Bodies:
    """The boxes that the things of a road stand in, as arrays.

    Attributes:
        items: the boxes.
        names: ids of their things.
        start, end, low, high, bottom, top: (N,) their borders, m.
    """

    def __init__(self, parameters: RoadParameters) -> None:
        self.items: list[Block] = []
        self.names: list[str] = []
        self._of: dict[type, list[int]] = {}
        for name, item in parameters.objects.items():
            if isinstance(item, Thing):
                first_box = len(self.items)
                self.items += item.footprint()
                self.names += [name] * (len(self.items) - first_box)
                self._of.setdefault(type(item), []).extend(range(first_box, len(self.items)))
        numbers = np.array([block[1:] for block in self.items], dtype=np.float64).reshape(-1, 6)
        self.start, self.end, self.low, self.high, self.bottom, self.top = numbers.T

    def of(self, *kinds: type, part: str) -> list[int]:
        """Return the indices of the boxes of one part of the things of some classes."""
        return [i for kind in kinds for i in self._of.get(kind, ()) if self.items[i].part == part]

    @property
    def station(self) -> Float:
        """Return the stations (N,) of the boxes' middles, m."""
        return 0.5 * self.start + 0.5 * self.end


class BodyPositions:
    """Where bodies stand in relation to the carriageways: clearances and sides.

    Posts and faces are looked at in their middle, what is long at its ends and at the stations of `marks` as well: the
    pavement's edge is straight, or hollow beside a ramp, from one to the next.

    Attributes:
        nearest, where: (N,) distance from the nearest pavement (m, negative over it), and at which station.
        clearance: by carriageway, (N,) distance from its pavement.
        bare: by carriageway, (N,) whether the middle of a body lies between the main road and a ramp.
        outer: by carriageway, (N,) whether a body lies outwards of the middle of its main road's pavement.
    """

    def __init__(self, bodies: Bodies, sides: dict[str, Edges], marks: Float) -> None:
        count, middle_stations = len(bodies.items), bodies.station
        first_mark = np.searchsorted(marks, bodies.start, side="right")
        mark_counts = np.maximum(np.searchsorted(marks, bodies.end, side="left") - first_mark, 0)
        long_bodies = np.flatnonzero(bodies.end - bodies.start > LONG)
        marks_between = [marks[first_mark[i] : first_mark[i] + mark_counts[i]] for i in long_bodies.tolist()]
        station = np.concatenate((middle_stations, bodies.start[long_bodies], bodies.end[long_bodies], *marks_between))
        index = np.concatenate(
            (np.arange(count), long_bodies, long_bodies, np.repeat(long_bodies, mark_counts[long_bodies]))
        )
        lower_offset, higher_offset = bodies.low[index], bodies.high[index]
        self.clearance: dict[str, Float] = {}
        self.outer: dict[str, Bool] = {}
        self.bare: dict[str, Bool] = {}
        nearest_distance = np.full(len(station), np.inf)
        for name, edges in sides.items():
            edge_distances, span = edges.at(station), edges.distances(lower_offset, higher_offset)
            clearance = edge_distances.clearance(*span)
            self.clearance[name] = _least(clearance, index, count)
            middle_distance = 0.5 * (span[0] + span[1])[:count]
            self.outer[name] = middle_distance > edge_distances.middle[:count]
            self.bare[name] = (middle_distance > edge_distances.gap_low[:count]) & (
                middle_distance < edge_distances.gap_high[:count]
            )
            nearest_distance = np.minimum(nearest_distance, clearance)
        self.nearest = _least(nearest_distance, index, count)
        order = np.argsort(-station, kind="stable")
        order = order[nearest_distance[order] <= self.nearest[index[order]]]
        self.where = np.zeros(count)
        self.where[index[order]] = station[order]


def _least(values: Float, index: NDArray[np.intp], count: int) -> Float:
    """Return the smallest of the values of each index, (count,); infinite where it has none."""
    least_values = np.full(count, np.inf)
    np.minimum.at(least_values, index, values)
    return least_values


class Barriers:
    """The guardrails and concrete barriers as arrays.

    Attributes:
        names: their ids.
        start, end, offset: (B,) m.
        faces: (B, 2) whether one has a face to the left, and to the right.
        clearance, where: (B,) distance from the pavement (m, negative over it), and at which station.
        outer: by carriageway, (B,) whether one stands outside of its middle.
    """

    def __init__(self, parameters: RoadParameters, bodies: Bodies, positions: BodyPositions) -> None:
        index = bodies.of(Guardrail, ConcreteBarrier, part="barrier")
        self.names = [bodies.names[i] for i in index]
        items: list[Any] = [parameters.objects[name] for name in self.names]
        numbers = [(item.start_station, item.end_station, item.offset) for item in items]
        self.start, self.end, self.offset = np.array(numbers, dtype=np.float64).reshape(-1, 3).T
        sides = [item.faces if isinstance(item, Guardrail) else "both" for item in items]
        self.faces = np.array([(side != "right", side != "left") for side in sides], dtype=bool).reshape(-1, 2)
        self.clearance, self.where = positions.nearest[index], positions.where[index]
        self.outer = {name: outer[index] for name, outer in positions.outer.items()}

    def spans(self, mask: Bool) -> Spans:
        """Return the (start, end) stations, m, of the barriers of a mask (B,)."""
        return list(zip(self.start[mask].tolist(), self.end[mask].tolist(), strict=True))


class ProtectingBarriers:
    """Which barriers protect the traffic of a carriageway: they have a face to it and stand off all pavement.

    Attributes:
        distance: (B,) of their axes from the centreline, outwards.
        outer, inner: (B,) whether they do so outside of the carriageway, or inside.
    """

    def __init__(self, barriers: Barriers, name: str, edges: Edges) -> None:
        self.distance = edges.sign * barriers.offset
        is_outside = barriers.outer[name]
        to_left, to_right = barriers.faces.T
        faces_outwards, faces_inwards = (to_left, to_right) if edges.sign > 0 else (to_right, to_left)
        is_off_pavement = barriers.clearance >= 0.0
        self.outer, self.inner = (
            is_off_pavement & is_outside & faces_inwards,
            is_off_pavement & ~is_outside & faces_outwards,
        )


class Signs:
    """Traffic signs, kilometre boards and traffic lights as arrays.

    Attributes:
        names, codes: their ids, and the traffic signs' codes.
        station: (S,) m.
        turned: (S,) by how much they are turned away from traffic with the stations, degrees from 0 to 180.
        of: by carriageway, (S,) whether one stands on its outer side, or on no carriageway's.
        bare: by carriageway, (S,) whether one stands between the main road and a ramp.
    """

    def __init__(self, parameters: RoadParameters, bodies: Bodies, positions: BodyPositions) -> None:
        index = bodies.of(TrafficSign, KilometreBoard, part="face") + bodies.of(TrafficLight, part="foot")
        self.names = [bodies.names[i] for i in index]
        items: list[Any] = [parameters.objects[name] for name in self.names]
        self.codes = [item.code if isinstance(item, TrafficSign) else "" for item in items]
        numbers = [(item.station, item.rotation_deg) for item in items]
        self.station, rotation = np.array(numbers, dtype=np.float64).reshape(-1, 2).T
        self.turned = np.abs((rotation + 180.0) % 360.0 - 180.0)
        outer = {name: values[index] for name, values in positions.outer.items()}
        is_outside_any = np.any(list(outer.values()), axis=0)
        self.of: dict[str, Bool] = {name: values | ~is_outside_any for name, values in outer.items()}
        self.bare = {name: values[index] for name, values in positions.bare.items()}

    def away(self, edges: Edges) -> Float:
        """Return the angles (S,) by which the signs are turned away from a carriageway's traffic, degrees."""
        return self.turned if edges.traffic > 0 else 180.0 - self.turned

    def seen_by(self, edges: Edges, code: str, largest_angle: float) -> NDArray[np.intp]:
        """Return indices of a code's signs facing a carriageway's traffic, at most ``largest_angle`` degrees off."""
        is_seen = self.of[edges.name] & (self.away(edges) <= largest_angle)
        return np.array(
            [i for i, sign_code in enumerate(self.codes) if sign_code == code and is_seen[i]], dtype=np.intp
        )
