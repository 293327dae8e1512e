"""Solids that furniture is made of: closed, their faces outwards."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import bpy

from . import operations as op
from .builder import Operand, Tree, Value

Point = tuple[float, float, float]


def box(tree: Tree, size: Operand, middle: Operand = (0.0, 0.0, 0.0)) -> Value:
    """Add nodes for a box of a size (vector, m) around its middle."""
    return move_geometry(tree.node("GeometryNodeMeshCube", size=size).value, middle)


def move_geometry(geometry: Value, shift: Operand) -> Value:
    """Add a node that translates a whole geometry by a vector, m."""
    return op.transform(geometry, translation=shift)


def paint_faces(geometry: Value, material: Value, selection: Value | bool = True) -> Value:
    """Add a node that sets the material of all or the selected faces; return the geometry."""
    return geometry.tree.node("GeometryNodeSetMaterial", geometry, selection, material=material).value


def picked_material(tree: Tree, name: str) -> Value:
    """Add a node that gives the open file's material of a name."""
    node = tree.node("GeometryNodeInputMaterial")
    node.raw.material = bpy.data.materials[name]
    return node.value


def flip_faces(geometry: Value, selection: Value | bool = True) -> Value:
    """Add a node that flips the normals of all or the selected faces; return the geometry."""
    return geometry.tree.node("GeometryNodeFlipFaces", geometry, selection).value


def loft(
    tree: Tree,
    outline: Callable[[Value], Value],
    columns: int,
    rows: Value | int,
    place: Callable[[Value, Value], Value],
    attributes: Mapping[str, Callable[[Value], Value]] | None = None,
) -> Value:
    """Add nodes for a closed solid lofted through copies of an outline, one per row, with lids at both ends.

    Args:
        tree: tree to add the nodes to.
        outline: function from a point's number, 0 to `columns` - 1, to the point. Seen along the rows, points run
            clockwise.
        columns: number of the outline's points.
        rows: number of copies of the outline.
        place: function from a point of the outline and a row's number to the point's position.
        attributes: functions from a row's number to attributes of its points, by name.
    """
    mesh, column, row = op.grid(tree, columns + 1, rows)
    for name, value in (attributes or {}).items():
        mesh = op.store(mesh, name, value(row))
    body = op.set_position(mesh, place(outline(column % columns), row))
    lids = []
    for is_last in (False, True):
        lid = tree.node("GeometryNodeMeshCircle", vertices=columns, fill_type="NGON").value
        number = tree.node("FunctionNodeInputInt", integer=0).value
        lid = op.set_position(lid, place(outline(op.index(tree)), rows - 1 + number if is_last else number))
        lids.append(lid if is_last else flip_faces(lid))
    return op.join(body, *lids)


def prism(tree: Tree, outline: list[tuple[float, float]], size: Operand = (1.0, 1.0, 1.0)) -> Value:
    """Add nodes for a prism on an outline (anticlockwise from above) from z = 0 to 1, scaled by `size`."""

    def place(point: Value, row: Value) -> Value:
        shifted_point = point + op.vector(tree, 0.0, 0.0, row)
        return shifted_point * size

    points = [(x, y, 0.0) for x, y in outline]
    return loft(tree, lambda number: op.choose(number, points), len(points), 2, place)


def bars(points: Value, start: Value, end: Value, width: Operand) -> Value:
    """Add nodes for a square bar of `width` (m) per point of a mesh, from `start` to `end` (fields on its points)."""
    tree = points.tree
    direction = end - start
    length = op.length(direction)
    body = box(tree, 1.0)
    return op.realize(
        tree.node(
            "GeometryNodeInstanceOnPoints",
            op.set_position(points, (start + end) * 0.5),
            instance=body,
            rotation=tree.node("FunctionNodeAlignRotationToVector", vector=direction, axis="X").value,
            scale=op.vector(tree, length, width, width),
        ).value
    )


def row_of_points(tree: Tree, count: Operand) -> Value:
    """Add a node for a mesh of `count` points, to put bodies or bars on."""
    return tree.node("GeometryNodeMeshLine", count=count).value


def put_on_points(
    points: Value, body: Value, place: Value, scale: Operand = 1.0, rotation: Operand | None = None
) -> Value:
    """Add nodes for an instance of a body per point, at a place given as a field on the points."""
    settings = {} if rotation is None else {"rotation": rotation}
    return points.tree.node(
        "GeometryNodeInstanceOnPoints", op.set_position(points, place), instance=body, scale=scale, **settings
    ).value


def tube(tree: Tree, radius: Operand, height: Value | float, sides: int = 12) -> Value:
    """Add nodes for an upright closed cylinder from z = 0 to `height`, m, smoothly shaded."""
    cylinder = tree.node("GeometryNodeMeshCylinder", vertices=sides, radius=radius, depth=height)
    smooth_cylinder = tree.node("GeometryNodeSetShadeSmooth", cylinder["Mesh"], cylinder["Side"]).value
    return move_geometry(smooth_cylinder, op.vector(tree, 0.0, 0.0, height * 0.5))


def cone(tree: Tree, bottom_radius: Operand, top_radius: Operand, height: Operand, sides: int = 16) -> Value:
    """Add nodes for an upright closed truncated cone from z = 0 to `height`, m, with the radii at its ends, m."""
    body = tree.node(
        "GeometryNodeMeshCone", vertices=sides, radius_top=top_radius, radius_bottom=bottom_radius, depth=height
    )
    return tree.node("GeometryNodeSetShadeSmooth", body["Mesh"], body["Side"]).value
