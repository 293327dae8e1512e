"""Beacons (Leitbaken) of construction zones (SR Beacon)."""

from __future__ import annotations

import math

import numpy as np

from ...base.classes import class_id
from ...road.things import beacon as sizes
from ...road.things.beacon import ConstructionBeacon
from ..nodes import operations as op
from ..nodes.builder import Tree, Value, makes_group
from ..nodes.inputs import boolean, material_of, metres, socket
from ..nodes.solids import box, flip_faces, move_geometry, paint_faces, prism, put_on_points, row_of_points
from ..nodes.standing import OnSurface
from .model_builder import ModelBuilder
from .registry import model_part

CELLS = (2, 8)
"""Columns and rows of a blade's cells, each cut diagonally by a stripe's border; squares on a blade of 0.25 m x 1 m."""


class _BeaconInputs(OnSurface):
    points = socket("Geometry", "One point per beacon, at any height; pass_side +1 is left")
    width = metres(0.25, (0.05, 1.0), "Width of blades whose points have no width")
    height = metres(1.0, (0.2, 3.0), "Height of blades whose points have no height")
    pass_on_left = boolean(True, "Traffic passes on the left of beacons whose points have no pass_side")
    red_material = material_of("the red stripes", "sheeting_red")
    white_material = material_of("the white stripes", "sheeting_white")
    rubber_material = material_of("the foot", "rubber")
    housing_material = material_of("the lamp", "plastic_black")
    lens_material = material_of("the lamp's lens", "lamp_yellow")


@makes_group("SR Beacon", catalogue="Roadside")
def beacon_group(tree: Tree) -> None:
    """A beacon on each point; points carry ``heading`` (rad), ``elevation``, ``width``, ``height``, ``pass_side``."""
    beacon = _BeaconInputs(tree)

    with tree.frame("Foot and its tenon"):
        foot = paint_faces(
            op.join(_foot(tree), box(tree, sizes.TENON, (0.0, 0.0, sizes.TENON_MIDDLE))),
            beacon.rubber_material,
        )
    with tree.frame("Blades of size 1: stripes fall to the left or to the right"):
        blades = [_blade(tree, beacon.red_material, beacon.white_material, side) for side in (1, -1)]
    with tree.frame("Lamp"):
        lamp = _lamp(tree, beacon.housing_material, beacon.lens_material)
    with tree.frame("On the surface"):
        points = beacon.places()
    with tree.frame("Beacons"):
        rotation = op.turn(tree, z=op.named_attribute(tree, "heading"))
        place, height = op.position(tree), op.attribute_or(beacon.height, "height")
        width = op.attribute_or(beacon.width, "width")
        passing_side = op.attribute_or(op.switch(beacon.pass_on_left, -1, 1), "pass_side")
        bottom = place + (0.0, 0.0, sizes.BLADE_BOTTOM)
        parts = [put_on_points(points, foot, place, 1.0, rotation)]
        for side, blade in zip((1, -1), blades, strict=True):
            side_points = op.separate(points, passing_side.equals(side))
            parts.append(put_on_points(side_points, blade, bottom, op.vector(tree, width, 1.0, height), rotation))
        parts.append(put_on_points(points, lamp, bottom + op.vector(tree, 0.0, 0.0, height), 1.0, rotation))
        beacons = op.join(*parts)
    with tree.frame("Labels"):
        beacons = op.realize(
            op.store(beacons, "beacon_instance", op.named_attribute(tree, "instance", "INT"), "INSTANCE")
        )
        beacons = op.store(beacons, "class_id", class_id(ConstructionBeacon.points_class), "FACE")
        beacons = op.store(beacons, "instance_id", op.named_attribute(tree, "beacon_instance", "INT"), "FACE")
    tree.output("Mesh", beacons, description="Beacons; each face has its own beacon's instance number")


def _foot(tree: Tree) -> Value:
    """Add nodes for a beacon's foot: a slab with chamfered corners and edges, a little sunk."""
    outline, (share, top_scale) = [(x, y) for x, y in sizes.foot_outline().tolist()], sizes.LEVELS
    slab = prism(tree, outline, (1.0, 1.0, sizes.FOOT[2] * share + sizes.SUNK))
    top = prism(tree, outline, (*top_scale, sizes.FOOT[2]))
    return op.join(move_geometry(slab, (0.0, 0.0, -sizes.SUNK)), top)


def _blade(tree: Tree, red: Value, white: Value, side: int) -> Value:
    """Add nodes for a blade of 1 m x 1 m on z = 0 whose stripes fall to the left (side 1) or right (-1)."""
    stripes = _blade_face(tree)
    faces = []
    for is_front in (True, False):
        # The stripes of `_blade_face` rise to the right. A mirrored face must be flipped, and so must one of the back.
        y = -sizes.BLADE / 2 - sizes.SHEETING
        scale = (float(side), 1.0, 1.0)
        face = op.transform(stripes, translation=(0.0, y if is_front else -y, 0.0), scale=scale)
        faces.append(face if (side > 0) == is_front else flip_faces(face))
    mesh = paint_faces(op.join(*faces), white)
    is_red = (op.named_attribute(tree, "stripe", "INT") % 2).equals(0)
    mesh = paint_faces(mesh, red, is_red)
    plate = box(tree, (1.0, sizes.BLADE, 1.0), (0.0, 0.0, 0.5))
    return op.join(paint_faces(plate, white), mesh)


def _blade_face(tree: Tree) -> Value:
    """Add nodes for a blade's face towards -y, triangles with their ``stripe``'s number, which rises with x."""
    columns, rows = CELLS
    halves = []
    for is_upper in (0, 1):
        corners = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 0.0, 1.0)]
        if is_upper:
            corners = [(0.0, 0.0, 0.0), (1.0, 0.0, 1.0), (0.0, 0.0, 1.0)]
        half = tree.node("GeometryNodeMeshCircle", vertices=3, fill_type="NGON").value
        half = op.set_position(half, op.choose(op.index(tree), corners))
        cells = row_of_points(tree, columns * rows)
        column, row = op.index(tree) % columns, op.index(tree) // columns
        cells = op.store(cells, "stripe", row - column + is_upper + columns)
        place = op.vector(tree, column / float(columns) - 0.5, 0.0, row / float(rows))
        halves.append(put_on_points(cells, half, place, (1.0 / columns, 1.0, 1.0 / rows)))
    return op.realize(op.join(*halves))


def _lamp(tree: Tree, housing: Value, lens: Value) -> Value:
    """Add nodes for a warning lamp that shines both ways."""
    radius, depth = sizes.LENS
    body = paint_faces(box(tree, sizes.HOUSING, (0.0, 0.0, sizes.HOUSING_MIDDLE)), housing)
    middle = (0.0, 0.0, sizes.LENS_MIDDLE)
    drum = tree.node("GeometryNodeMeshCylinder", vertices=sizes.LENS_SIDES, radius=radius, depth=depth).value
    glass = tree.node(
        "GeometryNodeMeshCylinder", vertices=sizes.LENS_SIDES, radius=radius * 0.85, depth=depth + sizes.LENS_PROUD
    ).value
    lying = op.turn(tree, x=1.5707963)
    parts = [op.transform(mesh, translation=middle, rotation=lying) for mesh in (drum, glass)]
    return op.join(body, paint_faces(parts[0], housing), paint_faces(parts[1], lens))


@model_part("beacons", 80)
def build_beacons(builder: ModelBuilder) -> None:
    """Add all beacons to the model as one object, a point each; none if there are no beacons."""
    beacons = list(builder.parameters.of_type(ConstructionBeacon).values())
    if not beacons:
        return
    attributes = {
        "width": np.array([beacon.width for beacon in beacons]),
        "height": np.array([beacon.height for beacon in beacons]),
        "pass_side": np.array([_passing_side(beacon) for beacon in beacons]),
    }
    mesh = builder.points("Beacons", beacons, attributes)
    builder.add("Beacons", mesh, beacon_group(), frame=builder.frame(*beacons))


def _passing_side(beacon: ConstructionBeacon) -> int:
    """Return +1 if traffic passes a beacon on the beacon's own left, -1 if right; its rotation may swap them."""
    with_stations = math.cos(math.radians(beacon.rotation_deg)) > 0.0
    return 1 if (beacon.pass_side == "left") == with_stations else -1
