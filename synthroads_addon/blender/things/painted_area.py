"""SR Painted Area: outlines in stations and offsets, laid on the pavement."""

from __future__ import annotations

import bpy

from ...base.classes import class_id
from ..nodes import operations as op
from ..nodes.backbone import height_on, look_up, station_ribbon
from ..nodes.builder import Tree, node_group


def painted_area_group() -> bpy.types.NodeTree:
    """Return the group SR Painted Area."""
    return node_group("SR Painted Area", _build)


def _build(tree: Tree) -> None:
    """Faces given by stations and offsets, laid on the pavement.

    Their points carry ``film`` (m), ``instance`` and ``yellow`` (0 or 1).
    """
    outlines = tree.input("Outlines", "Geometry", description="Faces with x = station, y = offset")
    backbone = tree.input("Backbone", "Object", description="Polyline along the axis with its attributes")
    road = tree.input("Road", "Object", description="Surface that is painted")
    white = tree.input("Material", "Material", description="Material of the paint")
    yellow = tree.input("Yellow Material", "Material", description="Material of temporary paint")

    with tree.frame("Place in plan"):
        ribbon = station_ribbon(op.object_geometry(backbone))
        station, offset = (op.component(op.position(tree), axis) for axis in ("X", "Y"))
        plan = look_up(ribbon, "axis", station) + look_up(ribbon, "left", station) * offset
    with tree.frame("On the pavement"):
        surface = op.object_geometry(road)
        height = height_on(surface, surface, plan) + op.named(tree, "film")
        flat = tree.node("ShaderNodeVectorMath", plan, (1.0, 1.0, 0.0), operation="MULTIPLY").value
        mesh = op.set_position(outlines, flat + op.vector(tree, 0.0, 0.0, height))
    with tree.frame("Labels"):
        mesh = op.label(mesh, class_id("road_marking"), op.named(tree, "instance", "INT"), white)
        temporary = op.named(tree, "yellow") > 0.5
        mesh = tree.node("GeometryNodeSetMaterial", mesh, temporary, material=yellow).value
    tree.output("Mesh", mesh, description="Paint whose faces look up")
