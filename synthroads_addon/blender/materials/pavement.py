"""SR Asphalt Look, SR Concrete Look, SR Paint Look: the pavement's field as node groups, and how materials take it."""

from __future__ import annotations

import bpy

from ...road.pavement.field import (
    Look,
    PavementPlace,
    Shape,
    Wear,
    asphalt_height,
    asphalt_look,
    concrete_height,
    concrete_look,
    paint_look,
)
from ..nodes import operations as op
from ..nodes.builder import Operand, Tree, Value, node_group
from .shading import Shade

ATTRIBUTE, SHAPE, AGE = "pavement", "pavement_shape", "pavement_age"
"""Attributes of a pavement's mesh: place; slabs' length, depths of joints and tracks; how bright it is for its age. See
SR Pavement Place."""


class NodeCalculus:
    """`road.pavement.field.Calculus` of values in a material's node group.

    Args:
        tree: the group.
    """

    def __init__(self, tree: Tree) -> None:
        self._tree = tree

    def _math(self, operation: str, *operands: Operand) -> Value:
        return self._tree.node("ShaderNodeMath", *operands, operation=operation).value

    def floor(self, value: Value) -> Value:
        """Return the largest whole number that isn't larger."""
        return self._math("FLOOR", value)

    def absolute(self, value: Value) -> Value:
        """Return the number without sign."""
        return self._math("ABSOLUTE", value)

    def exponential(self, value: Value) -> Value:
        """Return e to the power of the number."""
        return self._math("EXPONENT", value)

    def smaller(self, value: Value, other: Operand) -> Value:
        """Return the smaller of two."""
        return self._math("MINIMUM", value, other)

    def larger(self, value: Value, other: Operand) -> Value:
        """Return the larger of two."""
        return self._math("MAXIMUM", value, other)

    def below(self, value: Value, limit: float) -> Value:
        """Return 1 where the number is below a limit, else 0."""
        return self._math("LESS_THAN", value, limit)

    def hash(self, key: Value, seed: Operand) -> Value:
        """Return a number from 0 to 1 that follows from whole numbers and looks random."""
        place = self._tree.node("ShaderNodeCombineXYZ", key, seed).value
        return self._tree.node("ShaderNodeTexWhiteNoise", place, noise_dimensions="2D")["Value"]


def look_group(kind: str) -> bpy.types.NodeTree:
    """Return the group of the look of ``asphalt``, ``concrete``, or the ``paint`` of markings.

    Its inputs are the place, as the attribute has it, and the field's parameters.
    """
    about = f"How {kind} differs from its mean by where it lies on the road"
    return node_group(f"SR {kind.title()} Look", _build, kind, description=about, kind="ShaderNodeTree")


def _build(tree: Tree, kind: str) -> None:
    about = "Station (m), distance from the lane's middle (m), code of strip and lane's width"
    place = tree.input("Place", "Vector", description=about)
    wear = Wear(
        tree.number("Polish", 0.3, (0.0, 1.0), description="Polish of the wheel tracks") if kind != "paint" else 0.0,
        tree.number("Seed", 0.0, (0.0, 65535.0), description="Seed of all that is random"),
    )
    calculus, height = NodeCalculus(tree), None
    # As a vector: a number taken from a colour is its luminance, whose weights don't add up to 1 exactly.
    about = "Length of slabs, depths of joints and wheel tracks (m)"
    shapes = tree.input("Shape", "Vector", description=about) if kind != "paint" else None
    about = "By how much it is brighter for its age (x), as a share"
    age = tree.input("Age", "Vector", description=about) if kind != "paint" else None
    with tree.frame("Field of station and offset"):
        parts = PavementPlace(*(op.component(place, axis) for axis in "XYZ"))
        if age is not None:
            parts = parts._replace(age=op.component(age, "X"))
        if shapes is None:
            look = paint_look(calculus, parts, wear)
        else:
            slabs, joints, tracks = (op.component(shapes, axis) for axis in "XYZ")
            shape = Shape(tracks, joints)
            if kind == "asphalt":
                look, height = asphalt_look(calculus, parts, wear), asphalt_height(calculus, parts, shape)
            else:
                look = concrete_look(calculus, parts, wear, slabs)
                height = concrete_height(calculus, parts, shape, slabs)
    tree.output("Brightness", look.brightness, description="Factor on base colour and specular")
    tree.output("Roughness", look.roughness, description="What is added to the roughness")
    if height is not None:
        tree.output("Height", height, description="Height above the mean surface (m)")


def pavement_look(shade: Shade, kind: str, wear: Wear) -> tuple[Look, Value | None]:
    """Add the look of a pavement or marking to a material and return it, and the pavement's height (m).

    Args:
        shade: the material.
        kind: ``asphalt``, ``concrete`` or ``paint``.
        wear: parameters of the field, as numbers.
    """
    tree = shade.tree
    raw = tree.group.nodes.new("ShaderNodeGroup")
    raw.node_tree = look_group(kind)
    for name, value in zip(("Polish", "Seed"), wear, strict=True):
        if name in raw.inputs:
            tree.feed(raw.inputs[name], value)
    for name, entry in ((ATTRIBUTE, "Place"), (SHAPE, "Shape"), (AGE, "Age")):
        if entry in raw.inputs:
            attribute = tree.node("ShaderNodeAttribute", attribute_name=name)["Vector"]
            tree.feed(raw.inputs[entry], attribute)
    outputs = {output.name: Value(tree, output, "VALUE") for output in raw.outputs}
    return Look(outputs["Brightness"], outputs["Roughness"]), outputs.get("Height")
