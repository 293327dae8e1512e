"""Solids that furniture is made of: closed, their faces outwards."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from . import operations as op
from .builder import Operand, Tree, Value

Point = tuple[float, float, float]


def box(tree: Tree, size: Operand, middle: Operand = (0.0, 0.0, 0.0)) -> Value:
    """Return a box of a size (vector) around its middle."""
    return move_geometry(tree.node("GeometryNodeMeshCube", size=size).value, middle)


def move_geometry(geometry: Value, by: Operand) -> Value:
    """Return the geometry moved as a whole."""
    return op.transform(geometry, translation=by)


def paint_faces(geometry: Value, material: Value, selection: Value | bool = True) -> Value:
    """Give all faces, or those selected, a material."""
    return geometry.tree.node("GeometryNodeSetMaterial", geometry, selection, material=material).value


def flip_faces(geometry: Value) -> Value:
    """Turn all faces round."""
    return geometry.tree.node("GeometryNodeFlipFaces", geometry).value


def loft(
    tree: Tree,
    outline: Callable[[Value], Value],
    columns: int,
    rows: Value | int,
    place: Callable[[Value, Value], Value],
    stored: Mapping[str, Callable[[Value], Value]] | None = None,
) -> Value:
    """Return a solid between outlines that stand one behind the other.

    Args:
        outline: gives the outline's points by number, 0 to `columns` - 1. Seen along the rows they run clockwise.
        columns: number of the outline's points.
        rows: number of places that it is put to.
        place: gives where a point of the outline stands in a row.
        stored: attributes of the points, by row.
    """
    mesh, column, row = op.grid(tree, columns + 1, rows)
    for name, value in (stored or {}).items():
        mesh = op.store(mesh, name, value(row))
    body = op.set_position(mesh, place(outline(column % columns), row))
    lids = []
    for last in (False, True):
        lid = tree.node("GeometryNodeMeshCircle", vertices=columns, fill_type="NGON").value
        number = tree.node("FunctionNodeInputInt", integer=0).value
        lid = op.set_position(lid, place(outline(op.index(tree)), rows - 1 + number if last else number))
        lids.append(lid if last else flip_faces(lid))
    return op.join(body, *lids)


def prism(tree: Tree, outline: list[tuple[float, float]], size: Operand = (1.0, 1.0, 1.0)) -> Value:
    """Return an upright solid on an outline from z = 0 to 1, scaled by `size`; from above it runs anticlockwise."""

    def place(point: Value, row: Value) -> Value:
        raised = point + op.vector(tree, 0.0, 0.0, row)
        return raised * size

    points = [(x, y, 0.0) for x, y in outline]
    return loft(tree, lambda number: op.choose(number, points), len(points), 2, place)


def bars(points: Value, start: Value, end: Value, width: Operand) -> Value:
    """Return a square bar for every point of a mesh, from one place to another (fields on its points)."""
    tree = points.tree
    along = end - start
    length = op.length(along)
    body = box(tree, 1.0)
    return op.realize(
        tree.node(
            "GeometryNodeInstanceOnPoints",
            op.set_position(points, (start + end) * 0.5),
            instance=body,
            rotation=tree.node("FunctionNodeAlignRotationToVector", vector=along, axis="X").value,
            scale=op.vector(tree, length, width, width),
        ).value
    )


def row_of_points(tree: Tree, count: Operand) -> Value:
    """Return points for `put_on_points` and `bars`."""
    return tree.node("GeometryNodeMeshLine", count=count).value


def put_on_points(
    points: Value, body: Value, place: Value, scale: Operand = 1.0, rotation: Operand | None = None
) -> Value:
    """Return a copy of the body (as an instance) at a place on every point (a field)."""
    settings = {} if rotation is None else {"rotation": rotation}
    return points.tree.node(
        "GeometryNodeInstanceOnPoints", op.set_position(points, place), instance=body, scale=scale, **settings
    ).value


def tube(tree: Tree, radius: Operand, height: Value | float, sides: int = 12) -> Value:
    """Return an upright closed tube from z = 0 on."""
    cylinder = tree.node("GeometryNodeMeshCylinder", vertices=sides, radius=radius, depth=height)
    smooth = tree.node("GeometryNodeSetShadeSmooth", cylinder["Mesh"], cylinder["Side"]).value
    return move_geometry(smooth, op.vector(tree, 0.0, 0.0, height * 0.5))


def cone(tree: Tree, bottom: Operand, top: Operand, height: Operand, sides: int = 16) -> Value:
    """Return an upright closed cone, cut off, from z = 0 on."""
    body = tree.node("GeometryNodeMeshCone", vertices=sides, radius_top=top, radius_bottom=bottom, depth=height)
    return tree.node("GeometryNodeSetShadeSmooth", body["Mesh"], body["Side"]).value
