"""Bridges that carry the road: their solids (SR Structure), their caps as part of the road, the ground below."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from ...base.arrays import Float
from ...base.classes import class_id
from ...base.turns.stepper import run_aside
from ...road.structures.bridge import Bridge
from ...road.structures.bridge_bodies import bridge_bodies, cap_bodies
from ...road.things.body import Course
from ...twin.faces import loft
from ...twin.structure_ground import GroundPatch, bridge_ground_patch
from ...twin.things import road_course
from ..nodes import operations as op
from ..nodes.builder import Tree, makes_group
from ..nodes.inputs import Inputs, instance_number, integer, metres, socket
from .meshes import signed_instance
from .model_builder import ModelBuilder
from .registry import model_part
from .solid import bodies_mesh

CAPS, CAP_INSTANCE = "Bridge Caps", "cap_instance"
"""Role of the hidden object whose mesh the road takes up, and its faces' attribute with the bridge's number."""


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


@makes_group("SR Bridge")
def bridge_group(tree: Tree) -> None:
    """The solids of a bridge with class and instance number; its measures shape it when the model is built anew."""
    structure = _Structure(tree)
    _Bridge(tree)
    with tree.frame("Labels"):
        mesh = op.label(structure.body, structure.class_, structure.instance)
    tree.output("Mesh", mesh, description="The bridge; its caps belong to the road")


def near_bridges(builder: ModelBuilder) -> Iterator[tuple[str, Bridge]]:
    """Yield the bridges whose caps reach into the stretch that is built."""
    start, end = builder.stretch
    for name, bridge in builder.geometry.bridges.items():
        if bridge.cap_start < end and bridge.cap_end > start:
            yield name, bridge


def add_caps(builder: ModelBuilder) -> None:
    """Add the caps of all bridges near the stretch as one hidden object, which the road takes up as its surface."""
    bodies, numbers = [], []
    for _, bridge in near_bridges(builder):
        caps = run_aside(lambda bridge=bridge: cap_bodies(bridge, _course(builder)))
        bodies += caps
        numbers += [bridge.instance] * len(caps)
    if not bodies:
        return
    moved = [replace(body, sections=body.sections - builder.origin) for body in bodies]
    mesh = bodies_mesh(moved, builder.materials.material)
    polygons = [len(loft(body.sections)) for body in moved]
    instances = np.repeat(signed_instance(numbers), polygons)
    mesh.attributes.new(CAP_INSTANCE, "INT", "FACE").data.foreach_set("value", instances)
    builder.add(CAPS, mesh, support=True)


@model_part("bridges", 26)
def build_bridges(builder: ModelBuilder) -> None:
    """Add one object per bridge near the stretch to the model, without its caps."""
    for name, bridge in near_bridges(builder):
        bodies = run_aside(lambda bridge=bridge: bridge_bodies(bridge, _course(builder)))
        frame = builder.frame(bridge)
        moved = [replace(body, sections=frame.local(body.sections - builder.origin)) for body in bodies]
        mesh = bodies_mesh(moved, builder.materials.material)
        builder.add_thing(name, bridge, bridge_group(), mesh, class_=class_id(bridge.semantic_class))


def bridge_grounds(builder: ModelBuilder) -> list[GroundPatch]:
    """Return the ground below and beside the bridges near the stretch."""
    terrain = builder.geometry.terrain
    patches = [bridge_ground_patch(builder.geometry, bridge, terrain) for _, bridge in near_bridges(builder) if terrain]
    return [patch for patch in patches if patch]


def _course(builder: ModelBuilder) -> Course:
    """Return the road as bodies are built along it, with the rows of its mesh."""
    course = road_course(builder.geometry, builder.tolerance)
    stations = builder.stations

    def rows(_offset: object, start: float, end: float, kinks: Sequence[float]) -> Float:
        """Return the mesh's rows between two stations (m), and both."""
        return np.unique([start, *stations[(stations > start) & (stations < end)].tolist(), *kinks, end])

    return replace(course, rows=rows)

