"""Bridges and tunnels: their solids (SR Bridge, SR Tunnel), their caps as part of the road, the ground at them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial

import bpy
import numpy as np

from ...base.arrays import Float
from ...base.classes import class_id
from ...base.turns.stepper import run_aside
from ...road.structures.bridge import Bridge
from ...road.structures.bridge_bodies import bridge_bodies
from ...road.structures.kerbed import kerb_bodies
from ...road.structures.tunnel import Tunnel
from ...road.structures.tunnel_bodies import tunnel_bodies
from ...road.things.body import Body, Course
from ...twin.faces import loft
from ...twin.structure_ground import GroundPatch, structure_ground_patch
from ...twin.things import road_course
from ..nodes import operations as op
from ..nodes.builder import Tree, makes_group
from ..nodes.inputs import Inputs, instance_number, integer, metres, socket
from .meshes import signed_instance
from .model_builder import ModelBuilder
from .registry import model_part
from .solid import bodies_mesh

CAPS, CAP_INSTANCE = "Bridge Caps", "cap_instance"
"""Role of the hidden object whose mesh the road takes up, and its faces' attribute with the structure's number."""


class _Structure(Inputs):
    body = socket("Geometry", "Its solids")
    start_station = metres(0.0, (-1e6, 1e6), "Station at which it begins")
    end_station = metres(0.0, (-1e6, 1e6), "Station at which it ends")
    class_ = integer(0, (0, 255), "Semantic class of the faces")
    instance = instance_number()


class _Bridge(Inputs):
    deck_depth = metres(1.2, (0.4, 8.0), "From the pavement to the underside of its deck")
    pier_width = metres(1.0, (0.3, 6.0), "Thickness of its piers along the road")
    kerb_height = metres(0.075, (0.02, 0.25), "Caps above the pavement's edge")
    railing_height = metres(1.0, (0.0, 2.0), "Railings above the caps; 0 for none")
    joint_width = metres(0.5, (0.1, 1.5), "Width of its expansion joints along the road")
    wing_length = metres(6.0, (1.0, 30.0), "Length of its wing walls")
    approach_slab_length = metres(5.0, (0.0, 15.0), "Length of the slabs below the pavement before its ends")
    drain_spacing = metres(15.0, (0.0, 200.0), "Distance between its gullies")
    valley_depth = metres(8.0, (0.0, 200.0), "Depth of the generated ground below the road in its middle")


class _Tunnel(Inputs):
    height = metres(6.0, (4.2, 15.0), "From the higher edge of the pavement to the ceiling")
    wall_thickness = metres(0.8, (0.3, 3.0), "Thickness of its walls and its roof")
    kerb_height = metres(0.07, (0.02, 0.25), "Walkways above the pavement's edge")
    lining_height = metres(3.0, (0.0, 4.0), "Height of the light lining of its walls")
    lamp_spacing = metres(8.0, (0.0, 100.0), "Distance between lamps; 0 for none")
    phone_spacing = metres(150.0, (0.0, 1000.0), "Distance between emergency call points; 0 for none")
    exit_spacing = metres(300.0, (0.0, 2000.0), "Distance between emergency exits; 0 for none")
    fan_spacing = metres(90.0, (0.0, 1000.0), "Distance between pairs of jet fans; 0 for none")
    cover = metres(3.0, (0.5, 300.0), "Height of the generated ground above its roof")


@makes_group("SR Bridge")
def bridge_group(tree: Tree) -> None:
    """The solids of a bridge with class and instance number; its measures shape it when the model is built anew."""
    structure = _Structure(tree)
    _Bridge(tree)
    _labelled(tree, structure, "The bridge; its caps belong to the road")


@makes_group("SR Tunnel")
def tunnel_group(tree: Tree) -> None:
    """The solids of a tunnel with class and instance number; its measures shape it when the model is built anew."""
    structure = _Structure(tree)
    _Tunnel(tree)
    _labelled(tree, structure, "The tunnel; its walkways belong to the road")


def _labelled(tree: Tree, structure: _Structure, description: str) -> None:
    """Add nodes that label a structure's solids; they are the group's output."""
    with tree.frame("Labels"):
        mesh = op.label(structure.body, structure.class_, structure.instance)
    tree.output("Mesh", mesh, description=description)


def near_structures(builder: ModelBuilder) -> Iterator[tuple[str, Bridge | Tunnel]]:
    """Yield the bridges and tunnels whose caps or walkways reach into the stretch that is built."""
    start, end = builder.stretch
    for name, structure in builder.geometry.structures.items():
        if structure.cap_start < end and structure.cap_end > start:
            yield name, structure


def add_caps(builder: ModelBuilder) -> None:
    """Add caps and walkways near the stretch as one hidden object, which the road takes up as its surface."""
    bodies: list[Body] = []
    numbers: list[int] = []
    for _, structure in near_structures(builder):
        caps = run_aside(partial(kerb_bodies, structure, _course(builder)))
        bodies += caps
        numbers += [structure.instance] * len(caps)
    if not bodies:
        return
    moved = [replace(body, sections=body.sections - builder.origin) for body in bodies]
    mesh = bodies_mesh(moved, builder.materials.material)
    polygons = [len(loft(body.sections)) for body in moved]
    instances = np.repeat(signed_instance(numbers), polygons)
    mesh.attributes.new(CAP_INSTANCE, "INT", "FACE").data.foreach_set("value", instances)
    builder.add(CAPS, mesh, support=True)


@model_part("structures", 26)
def build_structures(builder: ModelBuilder) -> None:
    """Add one object per bridge or tunnel near the stretch to the model, without its caps or walkways."""
    for name, structure in near_structures(builder):
        make: Callable[..., list[Body]] = bridge_bodies if isinstance(structure, Bridge) else tunnel_bodies
        bodies = run_aside(partial(make, structure, _course(builder)))
        group = bridge_group() if isinstance(structure, Bridge) else tunnel_group()
        _add(builder, (name, structure), bodies, group)


def _add(
    builder: ModelBuilder, named: tuple[str, Bridge | Tunnel], bodies: Sequence[Body], group: bpy.types.NodeTree
) -> None:
    """Add a structure's solids as an object with its node group."""
    name, structure = named
    frame = builder.frame(structure)
    moved = [replace(body, sections=frame.local(body.sections - builder.origin)) for body in bodies]
    mesh = bodies_mesh(moved, builder.materials.material) if moved else bpy.data.meshes.new("SR Structure")
    builder.add_thing(name, structure, group, mesh, class_=class_id(structure.semantic_class))


def structure_grounds(builder: ModelBuilder) -> list[GroundPatch]:
    """Return the ground at the bridges and tunnels near the stretch."""
    terrain = builder.geometry.terrain
    if terrain is None:
        return []
    patches = [structure_ground_patch(builder.geometry, item, terrain) for _, item in near_structures(builder)]
    return [patch for patch in patches if patch]


def _course(builder: ModelBuilder) -> Course:
    """Return the road as bodies are built along it, with the rows of its mesh."""
    course = road_course(builder.geometry, builder.tolerance)
    stations = builder.stations

    def rows(_offset: object, start: float, end: float, kinks: Sequence[float]) -> Float:
        """Return the mesh's rows between two stations (m), and both."""
        return np.unique([start, *stations[(stations > start) & (stations < end)].tolist(), *kinks, end])

    return replace(course, rows=rows)
