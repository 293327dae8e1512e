"""SR Asphalt Look, SR Concrete Look, SR Paint Look: the pavement's field as node groups, and their use in materials."""

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
"""Attributes of a pavement's mesh: place; length of slabs, depths of joints and wheel tracks; brightness by age. See
SR Pavement Place."""


WEAR_INPUTS = ("Polish", "Seed", "Renewed", "Dirt", "Rubber")
"""Inputs of the looks' node groups, in the order of `Wear`; each group has those that its field depends on."""


class NodeCalculus:
    """The arithmetic `road.pavement.field.Calculus`, done by nodes that are added to a node group.

    Args:
        tree: the node group.
    """

    def __init__(self, tree: Tree) -> None:
        self._tree = tree

    def _math(self, operation: str, *operands: Operand) -> Value:
        """Add a Math node; return its result."""
        return self._tree.node("ShaderNodeMath", *operands, operation=operation).value

    def floor(self, value: Value) -> Value:
        """Return the largest whole number that isn't larger."""
        return self._math("FLOOR", value)

    def absolute(self, value: Value) -> Value:
        """Return the absolute value of the number."""
        return self._math("ABSOLUTE", value)

    def exponential(self, value: Value) -> Value:
        """Return e to the power of the number."""
        return self._math("EXPONENT", value)

    def smaller(self, value: Value, operand: Operand) -> Value:
        """Return the smaller of two numbers."""
        return self._math("MINIMUM", value, operand)

    def larger(self, value: Value, operand: Operand) -> Value:
        """Return the larger of two numbers."""
        return self._math("MAXIMUM", value, operand)

    def below(self, value: Value, limit: Operand) -> Value:
        """Return 1 where the number is below a limit, else 0."""
        return self._math("LESS_THAN", value, limit)

    def hash(self, key: Value, seed: Operand) -> Value:
        """Return a hash, from 0 to 1, of a whole-numbered key and seed."""
        place = self._tree.node("ShaderNodeCombineXYZ", key, seed).value
        return self._tree.node("ShaderNodeTexWhiteNoise", place, noise_dimensions="2D")["Value"]


_OF_PAINT = (
    ("Renewed", 0.0, (0.0, 1.0), "Share of the lines' length that was painted anew"),
    ("Dirt", 0.0, (0.0, 1.0), "Share of the brightness that dirt takes"),
    ("Rubber", 0.0, (0.0, 1.0), "Share of the most crossed lines' length that rubber has blackened"),
)
"""Inputs of the look of paint alone: name, default, limits, description."""


def look_group(kind: str) -> bpy.types.NodeTree:
    """Return the node group of the look of ``asphalt``, ``concrete``, or the ``paint`` of markings; built once.

    Its inputs are the attribute `ATTRIBUTE`, and the field's parameters.
    """
    about = f"How {kind} differs from its mean by where it lies on the road"
    return node_group(f"SR {kind.title()} Look", _build, kind, description=about, kind="ShaderNodeTree")


def _build(tree: Tree, kind: str) -> None:
    """Build the node group of a look: inputs, the field of station and offset, outputs."""
    description = "Station (m), distance from the lane's middle (m), code of strip and lane's width"
    place = tree.input("Place", "Vector", description=description)
    wear = Wear(
        tree.number("Polish", 0.3, (0.0, 1.0), description="Polish of the wheel tracks") if kind != "paint" else 0.0,
        tree.number("Seed", 0.0, (0.0, 65535.0), description="Seed of all that is random"),
        *(tree.number(*row[:3], description=row[3]) for row in (_OF_PAINT if kind == "paint" else ())),
    )
    calculus, height = NodeCalculus(tree), None
    # As a vector: a number taken from a colour is its luminance, whose weights don't add up to 1 exactly.
    description = "Length of slabs, depths of joints and wheel tracks (m)"
    shape_input = tree.input("Shape", "Vector", description=description) if kind != "paint" else None
    description = "By how much it is brighter for its age (x), as a share"
    age_input = tree.input("Age", "Vector", description=description) if kind != "paint" else None
    with tree.frame("Field of station and offset"):
        pavement_place = PavementPlace(*(op.component(place, axis) for axis in "XYZ"))
        if age_input is not None:
            pavement_place = pavement_place._replace(age=op.component(age_input, "X"))
        if shape_input is None:
            look = paint_look(calculus, pavement_place, wear)
        else:
            slabs, joints, tracks = (op.component(shape_input, axis) for axis in "XYZ")
            shape = Shape(tracks, joints)
            if kind == "asphalt":
                look, height = (
                    asphalt_look(calculus, pavement_place, wear),
                    asphalt_height(calculus, pavement_place, shape),
                )
            else:
                look = concrete_look(calculus, pavement_place, wear, slabs)
                height = concrete_height(calculus, pavement_place, shape, slabs)
    tree.output("Brightness", look.brightness, description="Factor on base colour and specular")
    tree.output("Roughness", look.roughness, description="What is added to the roughness")
    if height is not None:
        tree.output("Height", height, description="Height above the mean surface (m)")


def pavement_look(shade: Shade, kind: str, wear: Wear) -> tuple[Look, Value | None]:
    """Add the look of a pavement or marking to a material; return it, and the pavement's height (m), None for paint.

    Args:
        shade: the material.
        kind: ``asphalt``, ``concrete`` or ``paint``.
        wear: parameters of the field, as numbers.
    """
    tree = shade.tree
    group_node = tree.group.nodes.new("ShaderNodeGroup")
    group_node.node_tree = look_group(kind)
    for name, value in zip(WEAR_INPUTS, wear, strict=True):
        if name in group_node.inputs:
            tree.feed(group_node.inputs[name], value)
    for name, input_name in ((ATTRIBUTE, "Place"), (SHAPE, "Shape"), (AGE, "Age")):
        if input_name in group_node.inputs:
            attribute = tree.node("ShaderNodeAttribute", attribute_name=name)["Vector"]
            tree.feed(group_node.inputs[input_name], attribute)
    outputs = {output.name: Value(tree, output, "VALUE") for output in group_node.outputs}
    return Look(outputs["Brightness"], outputs["Roughness"]), outputs.get("Height")
