"""Furniture and traffic of interchanges: where it stands, what it says, whom it faces, and where it drives."""

from __future__ import annotations

import numpy as np
import pytest

from synthroads_addon.base.errors import InputError
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.guidelines import EXIT_SEQUENCE
from synthroads_addon.road.lanes import lane_of, ramp_way
from synthroads_addon.road.network.network import network_of
from synthroads_addon.road.other_roads.guardrail import RampGuardrail
from synthroads_addon.road.other_roads.parts import ConnectingRamp, CrossingRoad
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.surroundings import RampVehicle
from synthroads_addon.road.terrain import surface_elevation
from synthroads_addon.road.things.delineator import Delineator
from synthroads_addon.road.things.pole import Pole
from synthroads_addon.road.things.sign import TrafficSign
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scanning.scene.motion import lane_motions
from synthroads_addon.scenario.road import RoadScenario
from tests.helpers.roads.interchanges import LENGTH, diamond

ALONG_CROSSING = 50.0
"""Largest distance of delineators along a straight, m."""


def drawn(**interchange: object) -> RoadParameters:
    """Return the interchange of seed 1 with other limits."""
    return sample_road(RoadScenario(length=LENGTH, interchange={"kind": "diamond", **interchange}), 1)


def direction(geometry: RoadGeometry, item: TrafficSign) -> np.ndarray:
    """Return the direction (2,) of the traffic that a sign faces."""
    heading = geometry.alignment.heading(np.array([item.station]))[0] + np.deg2rad(item.rotation_deg)
    return np.array([np.cos(heading), np.sin(heading)])


def signs_of(road: RoadParameters, name: str) -> list[TrafficSign]:
    """Return the signs of a ramp or a crossing road."""
    return [sign for key, sign in road.of_type(TrafficSign).items() if key.startswith(f"sign-{name}-")]


def test_signs_announce_the_exits_at_their_distances() -> None:
    """On a road long enough all of them stand, with the distance that they tell, and the gore has its own."""
    road = sample_road(RoadScenario(length=3400.0, interchange={"kind": "diamond"}), 1)
    geometry = RoadGeometry(road)
    for side, sign in (("right", -1.0), ("left", 1.0)):
        turnout = road.objects[f"exit-{side}"]
        begin = turnout.start_station if side == "right" else turnout.end_station
        beside = [
            item
            for name, item in road.of_type(TrafficSign).items()
            if np.sign(item.offset) == sign and "ramp" not in name and "crossing" not in name
        ]
        for distance, code in EXIT_SEQUENCE.items():
            place = begin + sign * distance
            (found,) = [item for item in beside if item.code == code and abs(item.station - place) < 400.0]
            assert abs(found.station - place) <= 5.0
            if code != "449":
                assert any(f"{distance:.0f} m" in line for line in found.text) or code.startswith("450")
            driven = geometry.alignment.heading(np.array([found.station]))[0] + (0.0 if side == "right" else np.pi)
            assert direction(geometry, found) @ (np.cos(driven), np.sin(driven)) > 0.99
        assert [item.text for item in beside if item.code == "333"] == [("Ausfahrt",)]


def test_signs_at_mouths_face_those_who_come() -> None:
    road = diamond()
    geometry = RoadGeometry(road)
    network = network_of(geometry)
    for name, joint in network.joints.items():
        mouth, signs = joint.surface.mouth, signs_of(road, name)
        leaves = network.leaves(joint)
        codes = sorted(sign.code for sign in signs)
        if not leaves:
            assert codes == ["430-10", "430-20"]
            assert all(sign.text == signs[0].text and sign.text[0].startswith("A ") for sign in signs)
            continue
        wanted = {"give_way": "205", "stop": "206"}[joint.ramp.priority]
        assert codes == sorted([wanted, "267", "267", "418-10", "418-20"])
        for sign in signs:
            place = geometry.alignment.place(np.array([sign.station]), np.array([sign.offset]))
            u, v = mouth.local(place)
            assert 0.0 < u[0] < joint.ramp.mouth_length
            assert abs(v[0]) > joint.ramp.half_width + 0.5
            away = -1.0 if sign.code == "267" else 1.0
            assert direction(geometry, sign) @ -mouth.ahead * away > 0.99
            if sign.code == wanted:
                assert np.sign(v[0]) == mouth.incoming
    crossing = next(iter(road.of_type(CrossingRoad)))
    assert {sign.code for sign in signs_of(road, crossing)} == {"306"}


def test_delineators_stand_along_both_sides_of_ramps_and_crossing_road() -> None:
    road = diamond()
    geometry = RoadGeometry(road)
    network = network_of(geometry)
    for name, item in [*road.of_type(ConnectingRamp).items(), *road.of_type(CrossingRoad).items()]:
        axis = (
            network.joints[name].surface.axis if name in network.joints else network.crossings[name].geometry.alignment
        )
        for side, sign in (("left", 1.0), ("right", -1.0)):
            posts = [p for key, p in road.of_type(Delineator).items() if key.startswith(f"delineator-{name}-{side}-")]
            places = geometry.alignment.place(
                np.array([post.station for post in posts]), np.array([post.offset for post in posts])
            )
            station, offset = axis.project(places)
            assert (sign * offset >= item.half_width + 0.5).all()
            assert (sign * offset <= item.half_width + 1.2).all()
            if isinstance(item, ConnectingRamp):
                assert np.diff(station).max() <= ALONG_CROSSING + 1e-6
                assert station.min() < 40.0


def test_guardrails_stand_where_embankments_are_high() -> None:
    """By own heights: the ground beside a ramp's end lies metres below it, at its begin it doesn't."""
    road = diamond()
    geometry = RoadGeometry(road)
    network = network_of(geometry)
    rails = road.of_type(RampGuardrail).values()
    for name, joint in network.joints.items():
        for sign in (1.0, -1.0):
            spans = [(r.start_station, r.end_station) for r in rails if r.road == name and np.sign(r.offset) == sign]
            station = np.arange(10.0, joint.surface.axis.length - 2.0, 1.0)
            foot = joint.surface.axis.place(station, np.full(len(station), sign * (joint.ramp.half_width + 12.0)))
            ground = surface_elevation(geometry, *geometry.alignment.project(foot))
            drop = joint.surface.profile.elevation(station) - ground
            has_rail = np.array([any(a <= s <= b for a, b in spans) for s in station])
            assert has_rail[drop > 4.5].all()
            assert not has_rail[station < 60.0].any()
    heights = {rail.height for rail in rails}
    assert len(heights) == 1
    assert all(abs(rail.offset) > road.objects[rail.road].half_width + 0.69 for rail in rails)


@pytest.mark.parametrize(("share", "count"), [(0.0, 0), (1.0, 8)])
def test_mouths_are_lit_as_the_limits_say(share: float, count: int) -> None:
    road = drawn(lighting=share)
    poles = [pole for name, pole in road.of_type(Pole).items() if name.startswith("pole-ramp-")]
    assert len(poles) == count
    geometry = RoadGeometry(road)
    for pole in poles:
        # The arm reaches towards the crossing road, to the left of the traffic that it faces.
        left = direction(geometry, pole) @ np.array([[0.0, 1.0], [-1.0, 0.0]])  # type: ignore[arg-type]
        place = geometry.alignment.place(np.array([pole.station]), np.array([pole.offset]))
        axis = next(iter(network_of(geometry).crossings.values())).geometry.alignment
        nearer = np.abs([axis.project(place + step * left)[1][0] for step in (0.0, 1.0)])
        assert nearer[1] < nearer[0] - 0.9


def test_vehicles_wait_behind_the_line() -> None:
    road = drawn(waiting=1.0, stop_lines=1.0)
    geometry = RoadGeometry(road)
    network = network_of(geometry)
    for name, joint in network.joints.items():
        vehicles = [v for v in road.of_type(RampVehicle).values() if v.carriageway == name]
        if not network.leaves(joint):
            assert all(vehicle.speed > 0.0 for vehicle in vehicles)
            continue
        assert vehicles
        assert all(vehicle.speed == 0.0 for vehicle in vehicles)
        line = lane_of(geometry, vehicles[0])
        station = np.array([vehicle.station for vehicle in vehicles])
        places = line.geometry.alignment.place(station, line.offset(station))
        u, v = joint.surface.mouth.local(places)
        assert np.abs(v).max() < 0.01
        assert u.min() > 3.0
        assert (np.diff(u) > 3.5).all()


def test_traffic_leaves_and_enters_on_the_ramps_surface() -> None:
    """Its way meets the ramp's axis exactly, begins in the exit's lane, and its wheels stand on the surface."""
    road = drawn(waiting=0.0)
    geometry = RoadGeometry(road)
    network = network_of(geometry)
    motions = lane_motions(geometry)
    seen = {"crossing-road": 0}
    for name, joint in network.joints.items():
        way, axis = ramp_way(geometry, name), joint.surface.axis
        along = np.linspace(0.0, axis.length, 20)
        assert np.abs(way.geometry.alignment.position(way.lead + along) - axis.position(along)).max() < 1e-6
        station, offset = geometry.alignment.project(way.geometry.alignment.position(np.linspace(0.0, 55.0, 12)))
        section = geometry.sections[joint.side]
        lane = section.kinds.index("turnout_lane")
        distances = section.distances(station)
        assert (np.abs(np.abs(offset) - (distances[:, lane] + distances[:, lane + 1]) / 2.0) < 0.25).all()
    for name, motion in motions.items():
        vehicle = road.objects[name]
        if not isinstance(vehicle, RampVehicle):
            continue
        seen[vehicle.carriageway] = seen.get(vehicle.carriageway, 0) + 1
        times = np.linspace(0.0, 60.0, 40)
        _, place, present = motion.pose(times)
        xy = place[present][:, :2]
        surface = surface_elevation(geometry, *geometry.alignment.project(xy))
        if vehicle.carriageway != "crossing-road":
            assert np.abs(surface - place[present][:, 2]).max() < 0.05
    assert seen["crossing-road"] >= 4
    assert sum(count for name, count in seen.items() if name.startswith("ramp")) >= 4


def test_vehicles_name_roads_that_are_there() -> None:
    data = diamond().to_dict()
    name = next(iter(diamond().of_type(RampVehicle)))
    data["objects"][name]["carriageway"] = "carriageway-left"
    with pytest.raises(InputError, match="must name a ConnectingRamp or a CrossingRoad"):
        RoadParameters.from_dict(data)
