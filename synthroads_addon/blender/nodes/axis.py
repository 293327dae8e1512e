"""SR Axis from Curve: a backbone along any curve; SR Axis: the backbone that a group's inputs give."""

from __future__ import annotations

from . import operations as op
from .builder import Tree, Value, makes_group
from .inputs import Inputs, backbone_socket, integer, metres, number, socket

_RESOLUTION = 32
"""Straight pieces between two control points of a curve before it is cut into rows."""
_CURVE = "Curve that it follows, if no backbone is given: its first spline, from its beginning on"


class AxisInputs(Inputs):
    """Inputs of a node group that follows a backbone or a curve.

    Attributes:
        curve: curve that is followed if no backbone is given.
        backbone: object with the backbone, or with a curve.
    """

    curve = socket("Geometry", _CURVE)
    backbone = socket("Object", "Object that it follows: a curve, or the backbone of a road")

    def axis(self) -> Value:
        """Add nodes for the backbone's geometry, from the object or the curve; return their output."""
        # A transform of a geometry leaves its vectors: those to the left are turned like the object's own frame.
        info = self.tree.node("GeometryNodeObjectInfo", self.backbone, transform_space="RELATIVE")
        left = op.named_attribute(self.tree, "left", "FLOAT_VECTOR")
        left = self.tree.node("FunctionNodeRotateVector", left, info["Rotation"]).value
        given = op.store(info["Geometry"], "left", left)
        return self.tree.call(axis_group(), curve=self.curve, backbone=given).value


def rows_along(curve: Value) -> Value:
    """Add nodes that return a backbone unchanged, or make one along a curve; return their output."""
    return curve.tree.call(axis_group(), curve=curve).value


class _Axis(Inputs):
    curve = socket("Geometry", _CURVE)
    backbone = backbone_socket()


@makes_group("SR Axis")
def axis_group(tree: Tree) -> None:
    """The backbone if there is one, else one along the first curve that there is."""
    inputs = _Axis(tree)
    with tree.frame("A mesh with rows is a backbone, a curve is yet to become one"):
        line = op.join(inputs.backbone, inputs.curve)
        curve_backbone = tree.call(axis_from_curve_group(), curve=line).value
        backbone = op.switch(op.point_count(inputs.curve) > 0, curve_backbone, inputs.curve)
        axis = op.switch(op.point_count(inputs.backbone) > 0, backbone, inputs.backbone)
    tree.output("Axis", axis, description="Backbone")


class _AxisFromCurve(Inputs):
    curve = socket("Geometry", "Curve; its first spline counts")
    step = metres(2.0, (0.05, 100.0), "Distance of the rows")
    first_station = metres(0.0, (-1e6, 1e6), "Station of its beginning")
    crossfall_left = number(-0.025, (-0.12, 0.12), "Fall of the left carriageway to the right (m/m)")
    crossfall_right = number(0.025, (-0.12, 0.12), "Fall of the right carriageway to the right (m/m)")
    smoothing = integer(4, (0, 100), "Rows over which the curvature is averaged")


@makes_group("SR Axis from Curve", catalogue="Tools")
def axis_from_curve_group(tree: Tree) -> None:
    """A curve as the backbone of a road: rows with station, direction to the left, curvature and crossfalls.

    Stations count along the curve in plan, as those of a road do.
    """
    axis = _AxisFromCurve(tree)
    with tree.frame("Its first spline in plan, with the heights kept"):
        spline = op.separate(axis.curve, op.index(tree).equals(0), "CURVE")
        spline = tree.node("GeometryNodeSetSplineResolution", spline, resolution=_RESOLUTION).value
        fine_curve = tree.node("GeometryNodeResampleCurve", spline, mode="EVALUATED").value
        fine_curve = op.store(fine_curve, "elevation", op.component(op.position(tree), "Z"))
        plan_position = op.position(tree) * (1.0, 1.0, 0.0)
        fine_curve = op.set_position(fine_curve, plan_position)
    with tree.frame("Rows at even distances"):
        rows = tree.node("GeometryNodeResampleCurve", fine_curve, length=axis.step, mode="LENGTH").value
        length = tree.node("GeometryNodeSplineParameter")["Length"]
        rows = op.store(rows, "station", length + axis.first_station)
        tangent = tree.node("GeometryNodeInputTangent").value
        rows = op.store(rows, "forwards", tangent)
    with tree.frame("Backbone at the curve's height"):
        line = tree.node("GeometryNodeCurveToMesh", rows).value
        height = op.named_attribute(tree, "elevation")
        line = op.set_position(line, op.position(tree) + op.vector(tree, 0.0, 0.0, height))
    with tree.frame("Directions at the ends go on turning as they do inside"):
        row_index = op.index(tree)
        inner_index = op.clip(row_index, 1, op.point_count(line) - 2)
        forwards = op.named_attribute(tree, "forwards", "FLOAT_VECTOR")
        inner_forwards = op.sample_index(line, forwards, inner_index)
        line = op.store(
            line, "forwards", op.switch(inner_index.equals(row_index), forwards * 2.0 - inner_forwards, forwards)
        )
    with tree.frame("Direction to the left"):
        forwards = op.named_attribute(tree, "forwards", "FLOAT_VECTOR")
        left_vector = op.vector(tree, -op.component(forwards, "Y"), op.component(forwards, "X"))
        line = op.store(line, "left", op.normalize(left_vector))
    with tree.frame("Curvature: turn from the row before to the row behind"):
        line = op.store(line, "curvature", _curvature(tree, line, axis.smoothing))
    with tree.frame("Crossfalls"):
        line = op.store(line, "crossfall_left", axis.crossfall_left)
        line = op.store(line, "crossfall_right", axis.crossfall_right)
        for name in ("forwards", "elevation"):
            line = tree.node("GeometryNodeRemoveAttribute", line, name=name).value
    tree.output("Axis", line, description="Polyline along the curve with the backbone's attributes")


def _curvature(tree: Tree, line: Value, smoothing: Value) -> Value:
    """Add nodes for the curvature (1/m) at every row, averaged over `smoothing` rows; return their output."""
    last_row = op.point_count(line) - 1
    inner_row = op.clip(op.index(tree), 1, last_row - 1)
    previous_row, next_row = op.maximum(inner_row - 1, 0), op.minimum(inner_row + 1, last_row)

    def sampled_at(name: str, row: Value, kind: str) -> Value:
        """Add nodes for an attribute of the line in a row."""
        return op.sample_index(line, op.named_attribute(tree, name, kind), row)

    previous_direction, next_direction = (
        sampled_at("forwards", previous_row, "FLOAT_VECTOR"),
        sampled_at("forwards", next_row, "FLOAT_VECTOR"),
    )
    cross_product = op.component(
        tree.node("ShaderNodeVectorMath", previous_direction, next_direction, operation="CROSS_PRODUCT").value, "Z"
    )
    turn = tree.node(
        "ShaderNodeMath", cross_product, op.dot(previous_direction, next_direction), operation="ARCTAN2"
    ).value
    length = sampled_at("station", next_row, "FLOAT") - sampled_at("station", previous_row, "FLOAT")
    curvature = turn / op.maximum(length, 1e-6)  # turn of the direction per length
    return tree.node("GeometryNodeBlurAttribute", curvature, iterations=smoothing, data_type="FLOAT").value
