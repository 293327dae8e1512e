"""SR Vehicles: vehicles of one model on given points of the road."""

from __future__ import annotations

import bpy
import numpy as np

from ....base.classes import class_id
from ....road.lane_lines import LaneLine
from ....road.lanes import OtherLane, lane_of
from ....road.objects import PointObject
from ....road.surroundings import RampVehicle, Vehicle
from ....road.things.vehicles import CHASSIS
from ...materials.looks import COLOR
from ...nodes import operations as op
from ...nodes.builder import Tree, Value, makes_group, node_group
from ...nodes.inputs import Inputs, metres, socket
from ..model_builder import ModelBuilder
from ..registry import model_part
from .details import VehicleMaterials
from .models import model_group
from .surface import mark_places, registration, write_plates

_POINTS = (
    "One point per vehicle, below its middle, at any height, with heading (rad), grade of the road ahead (m/m), "
    f"elevation above it (m), {COLOR} and instance"
)


def vehicle_group(model: str) -> bpy.types.NodeTree:
    """Return the node group that puts vehicles of a model on points, e.g. SR Vehicles Car."""
    description = f"A {model} on each point; points carry heading (rad), {COLOR} and instance"
    return node_group(f"SR Vehicles {model.title()}", _build, model, description=description)


class _Vehicles(Inputs):
    points = socket("Geometry", _POINTS)
    registration = socket("String", "What is written on the number plates; empty for nothing")
    road = socket("Object", "Surface that they drive on")


def _build(tree: Tree, model: str) -> None:
    """Build the node group that puts vehicles of a model on points of the road."""
    traffic, materials = _Vehicles(tree), VehicleMaterials(tree)
    with tree.frame("Vehicle"):
        body = tree.call(model_group(model), **materials.values).value
        body = op.join(body, write_plates(tree, model, traffic.registration, materials.black_material))
        body = mark_places(body, model)
    with tree.frame("On the road"):
        chassis = CHASSIS[model]
        vehicles = tree.call(
            _on_wheels_group(),
            points=traffic.points,
            vehicle=body,
            road=op.object_geometry(traffic.road),
            front_axle=chassis.front,
            rear_axle=chassis.rear,
            half_track=chassis.half_track,
        ).value
    tree.output("Mesh", vehicles, description="Vehicles; each face has its own vehicle's instance number")


class _OnWheels(Inputs):
    points = socket("Geometry", _POINTS)
    vehicle = socket("Geometry", "The vehicle, its wheels on z = 0, facing along +y")
    road = socket("Geometry", "Surface that the vehicles drive on")
    front_axle = metres(1.3, (-20.0, 20.0), "Place of the middle of the front axles along y")
    rear_axle = metres(-1.3, (-20.0, 20.0), "Place of the middle of the hind axles along y")
    half_track = metres(0.8, (0.1, 3.0), "Distance of the wheels from x = 0")


@makes_group("SR On Wheels")
def _on_wheels_group(tree: Tree) -> None:
    """A vehicle on each point, pitched and rolled as the road below its axles."""
    inputs = _OnWheels(tree)
    road, front_axle, rear_axle = inputs.road, inputs.front_axle, inputs.rear_axle
    with tree.frame("The road below the wheels"):
        rear_middle, rear_vector = _axle(tree, road, rear_axle, inputs.half_track)
        front_middle, front_vector = _axle(tree, road, front_axle, inputs.half_track)
    with tree.frame("As the road is pitched and rolled"):
        # Place and rotation are fields: they are evaluated before the points are moved.
        elevation_vector = op.vector(tree, 0.0, 0.0, op.named_attribute(tree, "elevation"))
        middle = rear_middle - (front_middle - rear_middle) * (rear_axle / (front_axle - rear_axle)) + elevation_vector
        points = op.store(inputs.points, "vehicle_place", middle)
        rotation = tree.node(
            "FunctionNodeAxesToRotation",
            front_middle - rear_middle,
            rear_vector + front_vector,
            primary_axis="Y",
            secondary_axis="X",
        ).value
        vehicles = tree.node("GeometryNodeInstanceOnPoints", points, instance=inputs.vehicle, rotation=rotation).value
        place = op.named_attribute(tree, "vehicle_place", "FLOAT_VECTOR")
        vehicles = tree.node("GeometryNodeSetPosition", vehicles, position=place).value
    with tree.frame("Labels"):
        vehicles = op.store(vehicles, "vehicle_instance", op.named_attribute(tree, "instance", "INT"), "INSTANCE")
        vehicles = op.store(op.realize(vehicles), "class_id", class_id("vehicle"), "FACE")
        vehicles = op.store(vehicles, "instance_id", op.named_attribute(tree, "vehicle_instance", "INT"), "FACE")
    tree.output("Mesh", vehicles, description="Vehicles; each face has its own vehicle's instance number")


def _axle(tree: Tree, road: Value, axle_y: Value, half_track: Value) -> tuple[Value, Value]:
    """Add nodes for the midpoint of the road below an axle's wheels, and the vector from the left to the right one."""
    heading = op.named_attribute(tree, "heading")
    sine, cosine = op.unary("SINE", heading), op.unary("COSINE", heading)
    forward, right_vector = op.vector(tree, -sine, cosine), op.vector(tree, cosine, sine)
    left_wheel, right_wheel = (
        _on_road(road, op.position(tree) + forward * axle_y + right_vector * x, forward)
        for x in (-half_track, half_track)
    )
    return (left_wheel + right_wheel) * 0.5, right_wheel - left_wheel


def _on_road(road: Value, place: Value, forward: Value) -> Value:
    """Add nodes for the road's point above or below `place`; beyond its ends the road goes on at the vehicle's grade.

    Args:
        road: mesh of the road.
        place: place to project, m (a field).
        forward: unit vector of the vehicle's direction (a field).
    """
    tree = road.tree
    ray = tree.node(
        "GeometryNodeRaycast", target_geometry=road, source_position=place + (0.0, 0.0, 500.0), ray_length=1000.0
    )
    nearest_point = op.sample_surface(road, op.position(tree), place)
    extended_z = op.component(nearest_point, "Z") + op.dot(place - nearest_point, forward) * op.named_attribute(
        tree, "grade"
    )
    height = op.switch(ray["Is Hit"], extended_z, op.component(ray["Hit Position"], "Z"))
    plan_place = place * (1.0, 1.0, 0.0)
    return plan_place + op.vector(tree, 0.0, 0.0, height)


@model_part("vehicles", 180)
def build_vehicles(builder: ModelBuilder) -> None:
    """Add one object per vehicle to the model, so that each can be moved by itself."""
    lines: dict[tuple[str, int], LaneLine] = {}
    for name, vehicle in builder.parameters.of_type(Vehicle).items():
        lane = (vehicle.carriageway, vehicle.lane)
        if lane not in lines:
            lines[lane] = lane_of(builder.geometry, vehicle)
        line = lines[lane]
        grade = line.carriageway.traffic * line.geometry.profile.grade(np.array([vehicle.station]))
        place = vehicle_place(line, vehicle)
        mesh = builder.points("Vehicle", [place], {COLOR: np.array([vehicle.color]), "grade": grade})
        inputs = {"Registration": registration(builder.parameters.metadata.seed, name, vehicle.model)}
        if isinstance(vehicle, RampVehicle):
            if vehicle.carriageway not in builder.objects:
                continue  # its road isn't built
            boundaries = builder.geometry.offsets(np.array([place.station]))[0]
            is_beside = not boundaries[-1] <= place.offset <= boundaries[0]
            if is_beside or vehicle.carriageway in builder.geometry.crossing_roads:
                inputs["Road"] = builder.objects[vehicle.carriageway]
        builder.add(name, mesh, vehicle_group(vehicle.model), inputs, frame=builder.frame(place))


def vehicle_place(line: LaneLine, vehicle: Vehicle) -> PointObject:
    """Return a vehicle's place at the time 0 as a point object: on its lane's line, heading with the traffic."""
    station = np.array([vehicle.station])
    turn = float(np.rad2deg(line.turn(station, CHASSIS[vehicle.model].wheel_base / 2.0)[0]))
    if isinstance(line, OtherLane):
        own = line.geometry.alignment
        main, offset = line.main.alignment.project(own.place(station, line.offset(station)))
        turn += float(np.rad2deg(own.heading(station) - line.main.alignment.heading(main))[0])
        rotation = turn if line.carriageway.traffic > 0 else 180.0 + turn
        rotation = float(np.rad2deg(np.angle(np.exp(1j * np.deg2rad(rotation)))))
        return PointObject(
            instance=vehicle.instance, station=float(main[0]), offset=float(offset[0]), rotation_deg=rotation
        )
    return PointObject(
        instance=vehicle.instance,
        station=vehicle.station,
        offset=float(line.offset(station)[0]),
        rotation_deg=turn if line.carriageway.traffic > 0 else 180.0 + turn,
    )
