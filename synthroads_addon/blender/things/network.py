"""Roads beside and above the main one: crossing roads and ramps with their mouths, markings and verges."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from ...base.arrays import Float, Int
from ...base.classes import class_id
from ...base.turns.stepper import run_aside
from ...road.network.crossing import film
from ...road.network.grid import SurfaceGrid
from ...road.network.network import Network, network_of
from ...road.other_roads.guardrail import RampGuardrail
from ...road.section import Pavement
from ...road.things.body import Body
from ...twin.things import other_road_course
from ..nodes import operations as op
from ..nodes.builder import Tree, makes_group
from ..nodes.inputs import Inputs, instance_number, socket
from .model_builder import ModelBuilder
from .registry import model_part
from .side_road import RoadPart, add_road_parts
from .solid import bodies_mesh


class _Rail(Inputs):
    body = socket("Geometry", "Its solids")
    instance = instance_number()


@makes_group("SR Ramp Guardrail")
def rail_group(tree: Tree) -> None:
    """The solids of a guardrail along a ramp or a crossing road, with class and instance number."""
    rail = _Rail(tree)
    with tree.frame("Labels"):
        mesh = op.label(rail.body, class_id(RampGuardrail.points_class), rail.instance)
    tree.output("Mesh", mesh, description="Beams, posts, spacers, splices and reflectors")


@model_part("network", 26)
def build_network(builder: ModelBuilder) -> None:
    """Add every crossing road, and every ramp that joins it, whose middle lies within the stretch that is built."""
    network = network_of(builder.geometry)
    start, end = builder.stretch
    is_whole = (start, end) == (0.0, builder.geometry.length)

    def is_here(station: float) -> bool:
        return is_whole or start <= station < end

    for name, crossing in network.crossings.items():
        if is_here(crossing.road.station):
            parts = run_aside(partial(_grid_parts, crossing.grid))
            add_road_parts(builder, name, parts, crossing.instance, Pavement().kind)
    for name, joint in network.joints.items():
        if is_here(joint.cut.station):
            parts = run_aside(partial(_ramp_parts, network, name))
            add_road_parts(builder, name, parts, joint.ramp.instance, Pavement().kind)
    for name, rail in builder.geometry.parameters.of_type(RampGuardrail).items():
        on_ramp = rail.road in network.joints
        station = network.joints[rail.road].cut.station if on_ramp else network.crossings[rail.road].road.station
        if is_here(station):
            bodies = run_aside(partial(_rail_bodies, builder, rail))
            builder.add_thing(name, rail, rail_group(), bodies_mesh(bodies, builder.materials.material))


def _rail_bodies(builder: ModelBuilder, rail: RampGuardrail) -> list[Body]:
    """Return the solids of a guardrail along a ramp or a crossing road, in the scene's coordinates."""
    bodies = rail.bodies(other_road_course(builder.geometry, rail.road, builder.tolerance))
    return [replace(body, sections=body.sections - builder.origin) for body in bodies]


def _part(points: Float, quads: Int, kind: str) -> RoadPart:
    """Return a part of a road."""
    return RoadPart(points, quads, kind, np.zeros(len(points)))


def _grid_parts(grid: SurfaceGrid) -> list[RoadPart]:
    """Return the pavement, the verges and the markings of a grid."""
    points = grid.points.reshape(-1, 3)
    parts = [_part(points, grid.quads(kind), kind) for kind in ("pavement", "verge")]
    return [*parts, _part(film(points), grid.quads("paint"), "paint")]


def _ramp_parts(network: Network, name: str) -> list[RoadPart]:
    """Return the parts of a ramp: its own surface, its mouth, and the piece of verge at its cut."""
    joint = network.joints[name]
    crossing, mouth = network.crossings[joint.ramp.crossing_road], joint.surface.mouth
    parts = _grid_parts(joint.surface.grid)
    parts.append(_part(network.stubs()[name], np.arange(4)[None], "verge"))
    parts += [_part(p.points.reshape(-1, 3), p.quads(mouth.sign), p.kind) for p in crossing.patches(name)]
    paint = crossing.mouth_paint(name).reshape(-1, 3)
    if len(paint):
        parts.append(_part(paint, np.arange(len(paint)).reshape(-1, 4), "paint"))
    return parts
