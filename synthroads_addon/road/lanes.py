"""The lines that traffic follows on all roads of a network: on the main road, on ramps, on crossing roads."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from scipy.optimize import least_squares

from ..base.arrays import Float
from ..base.errors import InputError
from .alignment import Alignment, Element
from .geometry import RoadGeometry
from .lane_lines import LaneLine
from .network.network import Joint, Network, network_of
from .other_roads.axis import HorizontalElement, VerticalPoint
from .parameters import AlignmentObject, RoadParameters
from .section import Carriageway, CrossfallPoint, Lane
from .surroundings import RampVehicle, Vehicle
from .terrain import surface_elevation

BESIDE = 60.0
"""Length (m) of the exit's or entry's lane beside the main road that a ramp's traffic drives on; chosen."""
_LANES: WeakKeyDictionary[RoadGeometry, dict[str, _RampWay]] = WeakKeyDictionary()


def lane_of(geometry: RoadGeometry, vehicle: Vehicle) -> LaneLine:
    """Return the centre line of the lane that a vehicle drives on.

    Raises:
        InputError: its road has no such lane.
    """
    if isinstance(vehicle, RampVehicle):
        return _other_lane(geometry, vehicle)
    carriageway = geometry.parameters.carriageway_of(vehicle)
    if vehicle.lane >= len(carriageway.lanes):
        raise InputError("vehicle: lane", vehicle.lane, f"must be less than {len(carriageway.lanes)}")
    return LaneLine(geometry, carriageway, vehicle.lane)


def _other_lane(geometry: RoadGeometry, vehicle: RampVehicle) -> LaneLine:
    """Return the centre line of the lane of a vehicle on a ramp or a crossing road."""
    network = network_of(geometry)
    if vehicle.carriageway in network.crossings:
        road = network.crossings[vehicle.carriageway].geometry
        carriageway = road.parameters.carriageway("right" if vehicle.lane == 0 else "left")
        if carriageway is None or vehicle.lane > 1:
            raise InputError("vehicle: lane", vehicle.lane, "must be 0 (with the stations) or 1 (against them)")
        return OtherLane(road, carriageway, geometry)
    if vehicle.carriageway not in network.joints:
        raise InputError("vehicle: carriageway", vehicle.carriageway, "must be the id of a ramp or a crossing road")
    if vehicle.lane:
        raise InputError("vehicle: lane", vehicle.lane, "must be 0: a ramp has one lane")
    way = ramp_way(geometry, vehicle.carriageway)
    carriageway = next(iter(way.geometry.parameters.of_type(Carriageway).values()))
    return RampLane(way.geometry, carriageway, geometry)


class OtherLane(LaneLine):
    """The centre line of a lane of a crossing road.

    Args:
        road: the crossing road's own geometry, or that of a ramp's way.
        carriageway: of that geometry.
        main: the main road.
    """

    def __init__(self, road: RoadGeometry, carriageway: Carriageway, main: RoadGeometry) -> None:
        super().__init__(road, carriageway, 0)
        self.main = main

    def main_station(self, station: Float) -> Float:
        """Return the main road's stations (N,) beside stations (N,) of this road, m."""
        places = self.geometry.alignment.place(station, self.offset(station))
        return np.asarray(self.main.alignment.project(places)[0])


class RampLane(OtherLane):
    """The line that a ramp's traffic follows, from beside the main road up to the mouth, or the other way.

    Its surface is the main road's up to the cut, then the ramp's.
    """

    def height(self, station: Float, offset: Float) -> Float:
        """Return the surface's local elevation (N,), m, at stations and offsets (N,)."""
        places = self.geometry.alignment.place(station, offset)
        return surface_elevation(self.main, *self.main.alignment.project(places))


@dataclass(frozen=True)
class _RampWay:
    """A ramp's way as a road of its own.

    Attributes:
        geometry: a carriageway of one lane along its middle.
        lead: station (m) at which the ramp's own axis begins.
        stop: station (m) of the line before the crossing road.
    """

    geometry: RoadGeometry
    lead: float
    stop: float

    @cached_property
    def length(self) -> float:
        """The length of the way, m."""
        return self.geometry.length


def ramp_way(geometry: RoadGeometry, name: str) -> _RampWay:
    """Return the way of a ramp's traffic, made once: beside the main road, along the ramp, to the mouth's line."""
    ways = _LANES.setdefault(geometry, {})
    if name not in ways:
        network = network_of(geometry)
        ways[name] = _way_of(network, network.joints[name])
    return ways[name]


def _way_of(network: Network, joint: Joint) -> _RampWay:
    """Return the way of a ramp's traffic."""
    geometry, ramp, axis = network.geometry, joint.ramp, joint.surface.axis
    turnout: Any = geometry.parameters.objects[ramp.turnout]
    begin = joint.cut.station - joint.cut.ahead * turnout.ramp.length
    before, (x, y, heading) = _beside_main(network, joint, begin)
    lead = sum(element.length for element in before)
    stop = lead + axis.length + ramp.mouth_length
    elements = [*before, *axis.elements, Element(ramp.mouth_length, 0.0, 0.0)]
    leaves = network.leaves(joint)
    vertical = tuple(
        VerticalPoint(station=p.station + lead, elevation=p.elevation, radius=p.radius) for p in ramp.vertical
    )
    alignment = AlignmentObject(
        instance=1,
        start_x=x,
        start_y=y,
        start_heading_deg=float(np.rad2deg(np.angle(np.exp(1j * heading)))),
        horizontal=tuple(HorizontalElement.between(e.length, e.curvature_start, e.curvature_end) for e in elements),
        vertical=vertical,
    )
    lane = Carriageway(
        instance=2,
        side="right" if leaves else "left",
        inner_offset=-ramp.lane_width / 2.0,
        hard_shoulder_width=0.0,
        outer_edge_strip_width=ramp.edge_strip_width,
        lanes=(Lane(width=ramp.lane_width),),
        inner_edge_strip_width=0.0,
        verge_width=ramp.verge_width,
        crossfall=tuple(
            CrossfallPoint(station=p.station + lead, crossfall_percent=p.crossfall_percent) for p in ramp.crossfall
        ),
        rotation_axis="centreline",
    )
    parameters = geometry.parameters
    way = RoadParameters(
        metadata=parameters.metadata,
        transform=parameters.transform,
        design_class=parameters.design_class,
        objects={"alignment": alignment, "lane": lane},
    )
    return _RampWay(RoadGeometry(way), lead, stop)


def _beside_main(network: Network, joint: Joint, begin: float) -> tuple[list[Element], tuple[float, float, float]]:
    """Return the elements of a ramp's way up to its cut, and where it begins: place (m) and heading (rad).

    Along the exit's or entry's lane it runs in its middle as the main road does, then by three clothoids to the ramp.

    Args:
        network: that it belongs to.
        joint: the ramp.
        begin: station of the main road at which the ramp leaves the lane, m.
    """
    geometry, axis, ahead = network.geometry, joint.surface.axis, joint.cut.ahead
    section, at = geometry.sections[joint.side], np.array([begin])
    lane, distances = section.kinds.index("turnout_lane"), section.distances(at)[0]
    offset = joint.cut.sign * (distances[lane] + distances[lane + 1]) / 2.0
    place = geometry.alignment.place(at, np.array([offset]))[0]
    heading = float(geometry.alignment.heading(at)[0]) + (0.0 if ahead > 0.0 else np.pi)
    main = float(geometry.alignment.curvature(at)[0])
    along, first = main * ahead / (1.0 - main * offset), axis.elements[0].curvature_start
    chord = float(np.hypot(*(axis.x - place[0], axis.y - place[1])))

    def clothoids(values: Float) -> list[Element]:
        """Return three clothoids of one length (m) that meet with two curvatures, times the chord."""
        length, low, high = values[0], values[1] / chord, values[2] / chord
        bends = [along, float(low), float(high), first]
        return [Element(float(length), a, b) for a, b in pairwise(bends)]

    def missed(values: Float) -> Float:
        """Return by how much they miss the cut: in x and y, m, and in heading, as a share of the chord, m."""
        trial = Alignment(clothoids(values), place[0], place[1], heading)
        x, y = trial.position(trial.length).tolist()
        turn = np.angle(np.exp(1j * (float(trial.heading(trial.length)) - axis.start_heading)))
        return np.array([x - axis.x, y - axis.y, turn * chord])

    solved = least_squares(missed, [chord / 3.0, along * chord, first * chord]).x
    parts = [Element(BESIDE, along, along), *clothoids(solved)]
    # Back along the lane, which is as good as parallel to the main road over so short a way.
    lead_in = Alignment(parts[:1], 0.0, 0.0, heading - along * BESIDE)
    dx, dy = lead_in.position(BESIDE).tolist()
    return parts, (float(place[0]) - dx, float(place[1]) - dy, heading - along * BESIDE)
