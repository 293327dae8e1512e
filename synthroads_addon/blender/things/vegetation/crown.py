"""SR Crown: branches and leaves of trees and shrubs of height 1, and how its shape is declared.

Dimensions (m) and shares without a name here are chosen.
"""

from __future__ import annotations

from ...nodes import operations as op
from ...nodes.builder import Tree, Value, makes_group
from ...nodes.inputs import Inputs, boolean, integer, material_of, metres, number, share
from ...nodes.solids import paint_faces
from .plants import one_high

_GOLDEN_ANGLE = 2.4
"""Angle between successive branches, rad, near pi (3 - sqrt 5): they spread evenly around the stem."""
_SEGMENTS = 2
"""Pieces of a branch along its length."""
_CROOKED = 0.05
"""Largest sideways bend of stems, for a plant of height 1; chosen."""
_LEAF = [(0.0, -0.5, 0.0), (0.5, 0.3, 0.0), (-0.42, 0.5, 0.0)]
"""Triangle that represents a twig's leaves, for a width (x) and a length (y) of 1; chosen."""


class Crown(Inputs):
    """Inputs for the shape of a plant's crown; lengths are for a plant of height 1."""

    crown_bottom = metres(0.2, (0.0, 0.9), "Height at which the crown begins")
    crown_radius = metres(0.3, (0.02, 2.0), "Radius of the crown where it is widest")
    crown_widest = share(0.45, (0.02, 0.95), "Where between its bottom and its top the crown is widest")
    crown_fullness = number(0.7, (0.1, 3.0), "Exponent of the crown's outline: 0.5 round, 1 and more pointed")
    branch_rise = number(0.6, (-2.0, 10.0), "Rise of the branches towards their ends (m/m)")
    leafy_share = share(0.4, (0.0, 1.0), "Share of a branch's length that has leaves, from its end")
    cluster_radius = metres(0.1, (0.005, 0.5), "Radius of the cluster of leaves around a branch's end")
    leaf_length = metres(0.07, (0.002, 0.5), "Length of a leaf, a triangle that stands for a twig's leaves")
    leaf_width = metres(0.04, (0.002, 0.5), "Width of a leaf")
    leaf_order = share(0.2, (0.0, 1.0), "0: leaves point anywhere, 1: away from the trunk as their branches do")
    leaf_droop = number(0.2, (0.0, 3.0), "How much the leaves hang")
    branches = integer(26, (1, 300), "Number of branches")
    leaves = integer(2300, (1, 50_000), "Number of leaves, at full detail")

    def crown(self) -> dict[str, Value]:
        """Return the values of the crown's own inputs by field, without those that a subclass adds."""
        return {field.name: self.values[field.name] for field in Crown.fields()}


class PlantMaterials(Inputs):
    """Inputs for the bark and leaf materials of a plant or a stand."""

    bark_material = material_of("trunk, branches and stems", "maple_bark")
    leaves_material = material_of("the leaves", "maple_leaves")


class _Growth(Inputs):
    seed = integer(0, (0, 2**30), "Seed of branches and leaves")
    detail = share(1.0, (0.0, 1.0), "Share of the leaves' triangles")


class Plant(PlantMaterials, _Growth):
    """Inputs of one plant other than its shape: materials, seed, detail."""


class _Branches(Inputs):
    branch_radius = metres(0.008, (0.0005, 0.2), "Radius of the thickest branch")
    from_ground = boolean(False, "The branches are stems that grow from the ground")


@makes_group("SR Crown")
def crown_group(tree: Tree) -> None:
    """Branches from a stem, or from the ground, to the crown's outline, and clusters of leaves on them."""
    shape, wood, plant = Crown(tree), _Branches(tree), Plant(tree)
    seed = plant.seed
    with tree.frame("Ends of the branches, on and within the crown's outline"):
        end, share, relative_width = _ends(tree, shape, seed)
    with tree.frame("Their beginnings: on the stem, or on the ground"):
        start = _beginnings(tree, shape, wood.from_ground, end)
    with tree.frame("Branches, thinner towards the top"):
        points = tree.node("GeometryNodePoints", count=shape.branches).value
        points = op.store(op.store(op.set_position(points, start), "end", end), "share", share)
        points = op.store(points, "size", 0.55 + 0.45 * relative_width)
        branches = _branches(tree, points, wood.branch_radius)
    with tree.frame("Leaves around the outer parts of the branches"):
        leaves = _leaves(tree, points, shape, seed, plant.detail)
    with tree.frame("Materials"):
        branches = paint_faces(branches, plant.bark_material)
        leaves = paint_faces(leaves, plant.leaves_material)
    tree.output("Mesh", op.join(branches, leaves), description="Branches and leaves, upright on the origin")


def _ends(tree: Tree, shape: Crown, seed: Value) -> tuple[Value, Value, Value]:
    """Add nodes for the branches' ends, and for the crown's relative height and width (0 to 1) there; fields."""
    branch_index = op.index(tree)
    share = (branch_index + 0.5) / (shape.branches * 1.0)
    # sin(pi share^p) has its maximum where share^p = 1/2: p = log 0.5 / log(widest) puts it where the crown is widest.
    relative_width = op.unary("SINE", op.power(share, _log(0.5, shape.crown_widest)) * 3.1416)
    relative_width = op.power(op.maximum(relative_width, 0.0), shape.crown_fullness)
    outline = relative_width * shape.crown_radius
    radius = op.unary("SQRT", op.random(tree, 0.25, 1.0, seed + 1)) * op.maximum(
        outline - shape.cluster_radius * 0.6, 0.0
    )
    angle = branch_index * _GOLDEN_ANGLE + op.random(tree, -0.5, 0.5, seed + 2)
    height = shape.crown_bottom + (1.0 - shape.crown_bottom - shape.cluster_radius * 0.7) * share
    end = op.vector(tree, op.unary("COSINE", angle) * radius, op.unary("SINE", angle) * radius, height)
    return end, share, relative_width


def _log(value: float, base: Value) -> Value:
    """Add a node for the logarithm of a number to a base."""
    return base.tree.node("ShaderNodeMath", value, base, operation="LOGARITHM").value


def _beginnings(tree: Tree, shape: Crown, from_ground: Value, end: Value) -> Value:
    """Add nodes for the starts of branches: on the stem, below the ends by the branches' rise, or on the ground."""
    height = op.component(end, "Z")
    plan_end = end * (1.0, 1.0, 0.0)
    reach = op.length(plan_end)
    lowest_start = shape.crown_bottom * 0.9
    stem_height = op.minimum(op.maximum(height - reach * shape.branch_rise, lowest_start), 0.95)
    ground_start = plan_end * 0.18 + op.vector(tree, 0.0, 0.0, -0.02)
    return op.switch(from_ground, op.vector(tree, 0.0, 0.0, stem_height), ground_start)


def _branches(tree: Tree, points: Value, radius: Value) -> Value:
    """Add nodes for the branches as tapered cones from the points to their ``end``, thinner towards the top."""
    direction = op.named_attribute(tree, "end", "FLOAT_VECTOR") - op.position(tree)
    length = op.length(direction)
    width = radius * (1.0 - op.named_attribute(tree, "share") * 0.6)
    cone = tree.node(
        "GeometryNodeMeshCone",
        fill_type="NONE",
        vertices=3,
        side_segments=_SEGMENTS,
        radius_bottom=1.0,
        radius_top=0.25,
        depth=1.0,
    ).value
    branches = tree.node(
        "GeometryNodeInstanceOnPoints",
        points,
        instance=cone,
        rotation=tree.node("FunctionNodeAlignRotationToVector", vector=direction, axis="Z").value,
        scale=op.vector(tree, width, width, length),
    ).value
    for name in ("end", "share", "size"):  # else each of a forest's many points would have them
        branches = tree.node("GeometryNodeRemoveAttribute", branches, name=name).value
    return op.realize(branches)


def _leaves(tree: Tree, branches: Value, shape: Crown, seed: Value, detail: Value) -> Value:
    """Add nodes for the leaves in clusters around the outer parts of branches."""
    leaf_share = op.maximum(detail, 0.04)
    leaf_index = op.index(tree)
    branch = leaf_index % shape.branches
    start = op.sample_index(branches, op.position(tree), branch)
    end = op.sample_index(branches, op.named_attribute(tree, "end", "FLOAT_VECTOR"), branch)
    # A leaf lies at a random share of its branch, from the end inwards, shifted within the cluster's radius.
    branch_share = 1.0 - op.random(tree, 0.0, 1.0, seed + 3) * shape.leafy_share
    size = op.sample_index(branches, op.named_attribute(tree, "size"), branch)
    radius = shape.cluster_radius * size * op.random(tree, 0.75, 1.25, seed + 5, branch)
    shift = _in_ball(tree, seed + 4, leaf_index) * radius
    place = start + (end - start) * branch_share + shift
    points = tree.node("GeometryNodePoints", count=shape.leaves * leaf_share).value
    # Leaves point anywhere, or along their branch, by the order; the droop pulls them down.
    branch_direction = tree.node("ShaderNodeVectorMath", end - start, operation="NORMALIZE").value
    random_direction = op.random(tree, (-1.0, -1.0, -1.0), (1.0, 1.0, 1.0), seed + 6)
    leaf_direction = random_direction * (1.0 - shape.leaf_order) + branch_direction * (shape.leaf_order * 1.5)
    leaf_direction = leaf_direction - op.vector(tree, 0.0, 0.0, shape.leaf_droop)
    rotation = op.random_turn(tree, (0.0, -0.9, 0.0), (0.0, 0.9, 0.0), seed + 7)
    leaves = tree.node(
        "GeometryNodeInstanceOnPoints",
        op.set_position(points, place),
        instance=_leaf(tree, shape.leaf_length, shape.leaf_width),
        rotation=tree.node("FunctionNodeAlignRotationToVector", rotation, 1.0, leaf_direction, axis="Y").value,
        # Fewer leaves are larger, so that the crown covers the same area.
        scale=op.random(tree, 0.7, 1.3, seed + 8) * size / op.unary("SQRT", leaf_share),
    ).value
    return op.realize(leaves)


def _leaf(tree: Tree, length: Value, width: Value) -> Value:
    """Add nodes for a leaf's triangle of a length and a width (m)."""
    face = tree.node("GeometryNodeMeshCircle", vertices=3, fill_type="NGON").value
    outline = op.choose(op.index(tree), _LEAF)
    size = op.vector(tree, width, length, 1.0)
    return op.set_position(face, outline * size)


def _in_ball(tree: Tree, seed: Value, identifier: Value) -> Value:
    """Add nodes for a random point per element in the unit ball, denser towards its surface."""
    direction = op.random(tree, (-1.0, -1.0, -1.0), (1.0, 1.0, 1.0), seed, identifier)
    direction = tree.node("ShaderNodeVectorMath", direction, operation="NORMALIZE").value
    return direction * op.power(op.random(tree, 0.0, 1.0, seed + 100, identifier), 0.4)


def bend_stems(tree: Tree, plant: Value, seed: Value) -> Value:
    """Add nodes that bend a plant's stems a little by noise and scale it to height 1; return the plant."""
    place = op.position(tree)
    noise = tree.node("ShaderNodeTexNoise", place, noise_dimensions="4D", w=seed, scale=2.5, detail=1.0)
    shift = (noise["Color"] - (0.5, 0.5, 0.5)) * (op.minimum(op.component(place, "Z") * 4.0, 1.0) * (2.0 * _CROOKED))
    plan_shift = shift * (1.0, 1.0, 0.0)
    return one_high(tree.node("GeometryNodeSetPosition", plant, offset=plan_shift).value)
