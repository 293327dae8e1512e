"""Things that were hit, by a further modifier each: dented rails, what leans, missing panels (SR Dent, Lean, Gap)."""

from __future__ import annotations

import math

import bpy
import numpy as np
from mathutils import Matrix

from ...base.arrays import Float
from ...road.terrain import known_elevation
from ...road.things.beacon import ConstructionBeacon
from ...road.things.deformation import Dent, lean_matrix
from ...road.things.delineator import Delineator
from ...road.things.guardrail import Guardrail
from ...road.things.noise_barrier import NoiseBarrier
from ...road.things.thing import StandingThing
from ..compat import set_modifier_input
from ..nodes import operations as op
from ..nodes.builder import Tree, makes_group
from ..nodes.inputs import FAR, Inputs, integer, metres, number, socket
from .model_builder import ModelBuilder

_PLAN = (1.0, 1.0, 0.0)
_REACH = 1.0
"""Distance in plan, m, within which faces of a part with several things belong to the one that leans; chosen."""
_WHOLE = 1000.0
"""The same of a part that is one thing, m."""


SHARED: dict[type[StandingThing], str] = {Delineator: "Delineators", ConstructionBeacon: "Beacons"}
"""Roles of the parts that hold all things of a type."""


class _Bent(Inputs):
    rail = socket("Geometry", "Rail")
    place = socket("Vector", "Middle of the dent on the rail's axis, in the object's frame")
    along = socket("Vector", "Unit vector along the rail there")
    left = socket("Vector", "Unit vector to the left there")
    length = metres(4.0, (0.1, 100.0), "Length that is bent")
    depth = metres(0.3, FAR, "How far it is bent to the left")


@makes_group("SR Dent")
def dent_group(tree: Tree) -> None:
    """A dent in a rail: its points move sideways by depth * cos^2(pi * x / length)."""
    bent = _Bent(tree)
    with tree.frame("Wave along the rail"):
        position = op.position(tree)
        share = op.dot(position - bent.place, bent.along) / op.maximum(bent.length, 1e-3)
        wave = op.unary("COSINE", op.clip(share, -0.5, 0.5) * math.pi)
    with tree.frame("Points to the side"):
        rail = op.set_position(bent.rail, position + bent.left * (wave * wave * bent.depth))
    tree.output("Mesh", rail)


class _Leaning(Inputs):
    things = socket("Geometry", "Things")
    foot = socket("Vector", "Foot of the one that leans, in the object's frame")
    x_axis = socket("Vector", "Where the x axis is turned to")
    y_axis = socket("Vector", "Where the y axis is turned to")
    z_axis = socket("Vector", "Where the z axis is turned to")
    reach = metres(_REACH, (0.0, _WHOLE), "Distance in plan within which points lean")


@makes_group("SR Lean")
def lean_group(tree: Tree) -> None:
    """A thing that leans: its points are turned about its foot."""
    leaning = _Leaning(tree)
    with tree.frame("Turned about the foot"):
        arm = op.position(tree) - leaning.foot
        turned = leaning.x_axis * op.component(arm, "X")
        turned = turned + leaning.y_axis * op.component(arm, "Y") + leaning.z_axis * op.component(arm, "Z")
    with tree.frame("Points near the foot"):
        is_near = op.length(arm * _PLAN) < leaning.reach
        place = op.switch(is_near, op.position(tree), leaning.foot + turned)
        things = op.set_position(leaning.things, place)
    tree.output("Mesh", things)


class _Gap(Inputs):
    wall = socket("Geometry", "Noise barrier")
    bay = integer(0, (0, 100_000), "Number of the bay without a panel")
    least = number(1e-3, (0.0, 1.0), "Shortest bay, m")


@makes_group("SR Gap")
def gap_group(tree: Tree) -> None:
    """A noise barrier without the panel of one bay; the posts stay."""
    gap = _Gap(tree)
    with tree.frame("Panel of the bay"):
        is_filled = op.named_attribute(tree, "to") - op.named_attribute(tree, "from") > gap.least
        is_bay = op.named_attribute(tree, "bay", "INT").equals(gap.bay)
        wall = op.delete_faces(gap.wall, is_bay & is_filled)
    tree.output("Mesh", wall)


def deform_things(builder: ModelBuilder) -> None:
    """Add a modifier to the model's objects for each dent, each missing panel and each thing that leans."""
    for name, item in builder.parameters.objects.items():
        if isinstance(item, Guardrail) and name in builder.objects:
            for dent in item.dents or ():
                _add_dent(builder, name, item, dent)
        elif isinstance(item, NoiseBarrier) and name in builder.objects:
            for bay in item.missing_panels or ():
                _add(builder.objects[name], gap_group(), {"Bay": bay})
        elif isinstance(item, StandingThing) and item.lean_deg:
            _add_lean(builder, name, item)


def _add(part: bpy.types.Object, group: bpy.types.NodeTree, inputs: dict[str, object]) -> None:
    """Add a modifier of a node group, with its inputs by name, to a part of the model."""
    modifier = part.modifiers.new(group.name, "NODES")
    modifier.node_group = group
    for name, value in inputs.items():
        set_modifier_input(modifier, name, value)


def _add_dent(builder: ModelBuilder, name: str, rail: Guardrail, dent: Dent) -> None:
    """Add the modifier of a rail's dent."""
    frame, station = builder.frame(rail), np.array([dent.station])
    offset = rail.model_copy(update={"dents": None}).offset_at(station)
    heading = float(builder.geometry.alignment.heading(station)[0]) - frame.turn
    along = (math.cos(heading), math.sin(heading), 0.0)
    place = frame.local(_surface_point(builder, station, offset))[0]
    inputs = {"Place": place.tolist(), "Along": along, "Left": (-along[1], along[0], 0.0)}
    _add(builder.objects[name], dent_group(), {**inputs, "Length": dent.length, "Depth": dent.depth})


def _add_lean(builder: ModelBuilder, name: str, item: StandingThing) -> None:
    """Add the modifier of a thing that leans, or turn the instance that it is."""
    role = name if name in builder.objects else SHARED.get(type(item), "")
    if role not in builder.objects:
        return
    station, offset = np.array([item.station]), np.array([item.offset])
    heading = float(builder.geometry.alignment.heading(station)[0]) + item.turn
    heading += math.radians(item.lean_direction_deg or 0.0)
    part = builder.objects[role]
    foot = _surface_point(builder, station, offset)
    foot[0, 2] += item.elevation
    angle = math.radians(item.lean_deg or 0.0)
    if part.type == "EMPTY":
        rotation = lean_matrix(angle, (math.cos(heading), math.sin(heading)))
        part.rotation_mode = "QUATERNION"
        part.rotation_quaternion = Matrix(rotation.tolist()).to_quaternion() @ part.rotation_euler.to_quaternion()
        return
    turn = float(part.rotation_euler.z)
    rotation = lean_matrix(angle, (math.cos(heading - turn), math.sin(heading - turn)))
    arm = foot[0] - np.array(part.location)
    cosine, sine = math.cos(turn), math.sin(turn)
    local_foot = (cosine * arm[0] + sine * arm[1], cosine * arm[1] - sine * arm[0], arm[2])
    axes = {f"{axis} Axis": rotation[:, number].tolist() for number, axis in enumerate("XYZ")}
    _add(part, lean_group(), {"Foot": local_foot, **axes, "Reach": _WHOLE if role == name else _REACH})


def _surface_point(builder: ModelBuilder, station: Float, offset: Float) -> Float:
    """Return the point (1, 3) of the surface at a station and offset (1,), in the scene, m."""
    plan = builder.geometry.alignment.place(station, offset)
    height = known_elevation(builder.geometry, station, offset)
    return np.asarray(np.column_stack([plan, height]) - builder.origin)
