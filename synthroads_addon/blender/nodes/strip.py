"""SR Strip: one lengthwise ribbon of the road."""

from __future__ import annotations

from . import operations as op
from .axis import rows_along
from .backbone import limit_offset, row
from .builder import Tree, makes_group
from .inputs import (
    FAR,
    Inputs,
    backbone_socket,
    instance_number,
    integer,
    material_of,
    metres,
    socket,
)

_DETAIL = (
    "Finer columns: a point per column and row (row by row within a column, from the left), with the attributes share "
    "(1 at the left edge, 0 at the right one), depth (m below the plane) and damage (instance number of what the face "
    "after it is of; 0 for the strip itself); two columns if empty"
)
NARROW = 0.24
"""Strips narrower than this (m) have two columns whatever their detail, as where lanes begin and end. Chosen: less
than the narrowest edge strip of a standard cross-section, 0.25 m."""
CLOSED = 1e-4
"""Where a strip is narrower than this (m) it has no faces."""


SEALED = "sealed"
"""Attribute of the faces of street sides, which no grass grows on."""
_DAMAGE = "damage"
"""Attribute of faces while the strip is made: instance number of the damage."""


class StripFaces(Inputs):
    """Inputs of a strip of the road other than its place: class, instance, material, detail."""

    class_ = integer(0, (0, 255), "Semantic class of the faces")
    instance = instance_number()
    material = material_of("the faces")
    detail = socket("Geometry", _DETAIL)


class _Strip(Inputs):
    backbone = backbone_socket()
    left_offset = metres(1.0, FAR, "Offset of the left edge, positive to the left")
    right_offset = metres(-1.0, FAR, "Offset of the right edge")
    left_height = metres(0.0, FAR, "Left edge above the axis, per row")
    right_height = metres(0.0, FAR, "Right edge above the axis, per row")


@makes_group("SR Strip", catalogue="Road")
def strip_group(tree: Tree) -> None:
    """A ribbon along a backbone between two offsets, each at its own height above the axis.

    Offsets and heights may be fields on the backbone's points.
    """
    strip, faces = _Strip(tree), StripFaces(tree)
    detail = faces.detail

    with tree.frame("Columns, one row per point of the backbone"):
        backbone = rows_along(strip.backbone)
        row_count, detail_points = op.point_count(backbone), op.point_count(detail)
        mesh, column, row_number = op.grid(tree, op.switch(detail_points > 0, 2, detail_points // row_count), row_count)
        point = column * row_count + row_number
    with tree.frame("Rows of the backbone"):
        axis, left_vector, curvature = row(backbone, row_number)
        left, right, left_height, right_height = (
            op.sample_index(backbone, value, row_number)
            for value in (strip.left_offset, strip.right_offset, strip.left_height, strip.right_height)
        )
    with tree.frame("Share of the left edge and depth of every column"):
        share = op.switch(
            detail_points > 0, 1.0 - column, op.sample_index(detail, op.named_attribute(tree, "share"), point)
        )
        depth = op.switch(detail_points > 0, 0.0, op.sample_index(detail, op.named_attribute(tree, "depth"), point))
        # Where a strip closes, rounding would fold its fine columns: they all lie on the right edge.
        is_wide = left - right > NARROW
        share = op.switch(is_wide, op.switch(share > 0.999, 0.0, 1.0), share)
        depth = op.switch(is_wide, 0.0, depth)
    with tree.frame("Offset, cut where it would fold, and the height there"):
        offset = limit_offset(left * share + right * (1.0 - share), curvature)
        left_weight = (offset - right) / op.maximum(left - right, 1e-9)
        height = left_height * left_weight + right_height * (1.0 - left_weight) - depth
    with tree.frame("Instance of every face: the damage that it is of, or the strip"):
        face_index = op.index(tree)
        # Faces are numbered column by column: the first corner of one is a point of the detail.
        first_corner = face_index // (row_count - 1) * row_count + face_index % (row_count - 1)
        damage = op.sample_index(detail, op.named_attribute(tree, "damage", "INT"), first_corner)
        mesh = op.store(mesh, _DAMAGE, op.switch(detail_points > 0, 0, damage), "FACE")
    with tree.frame("Place and label"):
        place = axis + left_vector * offset + op.vector(tree, 0.0, 0.0, height)
        mesh = op.store(op.store(mesh, "offset", offset), "row", row_number)
        mesh = op.store(mesh, "strip_width", left - right)
        mesh = op.store(mesh, "station", op.sample_index(backbone, op.named_attribute(tree, "station"), row_number))
        damage = op.named_attribute(tree, _DAMAGE, "INT")
        instance = op.switch(damage.equals(0), damage, faces.instance)
        mesh = op.label(op.set_position(mesh, place), faces.class_, instance, faces.material)
        mesh = tree.node("GeometryNodeRemoveAttribute", mesh, name=_DAMAGE).value
        # Rounding would decide which way faces look where the strip is this narrow.
        mesh = op.delete_faces(op.delete_degenerate(mesh), op.named_attribute(tree, "strip_width") < CLOSED)
    tree.output("Mesh", mesh, description="Ribbon whose faces look up")
