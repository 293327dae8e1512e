"""SR Crown: branches and leaves of trees and shrubs of height 1, and how its shape is declared."""

from __future__ import annotations

from ...nodes import operations as op
from ...nodes.builder import Tree, Value, makes_group
from ...nodes.solids import paint_faces
from .plants import one_high

_GOLDEN_ANGLE = 2.4
_SEGMENTS = 2
_CROOKED = 0.05
# A leaf is a triangle that stands for a twig's leaves, for a length and a width of 1: across, along, up.
_LEAF = [(0.0, -0.5, 0.0), (0.5, 0.3, 0.0), (-0.42, 0.5, 0.0)]

_NUMBERS: tuple[tuple[str, float, tuple[float, float], str, str], ...] = (
    ("Crown Bottom", 0.2, (0.0, 0.9), "m", "Height at which the crown begins"),
    ("Crown Radius", 0.3, (0.02, 2.0), "m", "Radius of the crown where it is widest"),
    ("Crown Widest", 0.45, (0.02, 0.95), "share", "Where between its bottom and its top the crown is widest"),
    ("Crown Fullness", 0.7, (0.1, 3.0), "", "Exponent of the crown's outline: 0.5 round, 1 and more pointed"),
    ("Branch Rise", 0.6, (-2.0, 10.0), "", "Rise of the branches towards their ends (m/m)"),
    ("Leafy Share", 0.4, (0.0, 1.0), "share", "Share of a branch's length that has leaves, from its end"),
    ("Cluster Radius", 0.1, (0.005, 0.5), "m", "Radius of the cluster of leaves around a branch's end"),
    ("Leaf Length", 0.07, (0.002, 0.5), "m", "Length of a leaf, a triangle that stands for a twig's leaves"),
    ("Leaf Width", 0.04, (0.002, 0.5), "m", "Width of a leaf"),
    ("Leaf Order", 0.2, (0.0, 1.0), "share", "0: leaves point anywhere, 1: away from the trunk as their branches do"),
    ("Leaf Droop", 0.2, (0.0, 3.0), "", "How much the leaves hang"),
)


def declare_crown(tree: Tree, **defaults: float) -> dict[str, Value]:
    """Declare the inputs that shape a crown; lengths are for a plant of height 1."""
    values: dict[str, Value] = {}
    for name, default, limits, unit, description in _NUMBERS:
        key = name.lower().replace(" ", "_")
        values[key] = tree.number(name, defaults.get(key, default), limits, unit=unit, description=description)
    for name, default, most in (("Branches", 26, 300), ("Leaves", 2300, 50_000)):
        key = name.lower()
        about = f"Number of {key}" + (", at full detail" if name == "Leaves" else "")
        values[key] = tree.integer(name, int(defaults.get(key, default)), (1, most), description=about)
    return values


def declare_plant(tree: Tree) -> dict[str, Value]:
    """Declare what else one plant needs to know."""
    return {
        "seed": tree.integer("Seed", 0, (0, 2**30), description="Seed of branches and leaves"),
        "detail": tree.number("Detail", 1.0, (0.0, 1.0), unit="share", description="Share of the leaves' triangles"),
        **declare_materials(tree),
    }


def declare_materials(tree: Tree) -> dict[str, Value]:
    """Declare the materials of one plant, or of a stand."""
    return {
        "bark_material": tree.input("Bark Material", "Material", description="Material of trunk, branches and stems"),
        "leaves_material": tree.input("Leaves Material", "Material", description="Material of the leaves"),
    }


@makes_group("SR Crown")
def crown_group(tree: Tree) -> None:
    """Branches from a stem, or from the ground, to the crown's outline, and clusters of leaves on them."""
    shape = declare_crown(tree)
    thick = tree.number("Branch Radius", 0.008, (0.0005, 0.2), unit="m", description="Radius of the thickest branch")
    ground = tree.boolean("From Ground", False, description="The branches are stems that grow from the ground")
    plant = declare_plant(tree)
    seed = plant["seed"]
    with tree.frame("Ends of the branches, on and within the crown's outline"):
        end, share, bulge = _ends(tree, shape, seed)
    with tree.frame("Their beginnings: on the stem, or on the ground"):
        begin = _beginnings(tree, shape, ground, end, seed)
    with tree.frame("Branches, thinner towards the top"):
        points = tree.node("GeometryNodePoints", count=shape["branches"]).value
        points = op.store(op.store(op.set_position(points, begin), "end", end), "share", share)
        points = op.store(points, "size", 0.55 + 0.45 * bulge)
        wood = _branches(tree, points, thick)
    with tree.frame("Leaves around the outer parts of the branches"):
        leaves = _leaves(tree, points, shape, seed, plant["detail"])
    with tree.frame("Materials"):
        wood = paint_faces(wood, plant["bark_material"])
        leaves = paint_faces(leaves, plant["leaves_material"])
    tree.output("Mesh", op.join(wood, leaves), description="Branches and leaves, upright on the origin")


def _ends(tree: Tree, shape: dict[str, Value], seed: Value) -> tuple[Value, Value, Value]:
    """Return where the branches end, and how far up (0 to 1) and how wide (0 to 1) the crown is there."""
    number = op.index(tree)
    share = (number + 0.5) / (shape["branches"] * 1.0)
    # The power of the height that makes the sine's maximum lie where the crown is widest.
    bulge = op.unary("SINE", op.power(share, _log(0.5, shape["crown_widest"])) * 3.1416)
    bulge = op.power(op.maximum(bulge, 0.0), shape["crown_fullness"])
    outline = bulge * shape["crown_radius"]
    inside = op.unary("SQRT", op.random(tree, 0.25, 1.0, seed + 1)) * op.maximum(
        outline - shape["cluster_radius"] * 0.6, 0.0
    )
    around = number * _GOLDEN_ANGLE + op.random(tree, -0.5, 0.5, seed + 2)
    height = shape["crown_bottom"] + (1.0 - shape["crown_bottom"] - shape["cluster_radius"] * 0.7) * share
    end = op.vector(tree, op.unary("COSINE", around) * inside, op.unary("SINE", around) * inside, height)
    return end, share, bulge


def _log(value: float, base: Value) -> Value:
    return base.tree.node("ShaderNodeMath", value, base, operation="LOGARITHM").value


def _beginnings(tree: Tree, shape: dict[str, Value], ground: Value, end: Value, seed: Value) -> Value:
    height = op.component(end, "Z")
    flat = end * (1.0, 1.0, 0.0)
    reach = op.length(flat)
    lowest = shape["crown_bottom"] * 0.9
    on_stem = op.minimum(op.maximum(height - reach * shape["branch_rise"], lowest), 0.95)
    below = flat * 0.18 + op.vector(tree, 0.0, 0.0, -0.02)
    return op.switch(ground, op.vector(tree, 0.0, 0.0, on_stem), below)


def _branches(tree: Tree, points: Value, thick: Value) -> Value:
    along = op.named_attribute(tree, "end", "FLOAT_VECTOR") - op.position(tree)
    length = op.length(along)
    width = thick * (1.0 - op.named_attribute(tree, "share") * 0.6)
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
        rotation=tree.node("FunctionNodeAlignRotationToVector", vector=along, axis="Z").value,
        scale=op.vector(tree, width, width, length),
    ).value
    return op.realize(branches)


def _leaves(tree: Tree, branches: Value, shape: dict[str, Value], seed: Value, detail: Value) -> Value:
    share = op.maximum(detail, 0.04)
    number = op.index(tree)
    branch = number % shape["branches"]
    begin = op.sample_index(branches, op.position(tree), branch)
    end = op.sample_index(branches, op.named_attribute(tree, "end", "FLOAT_VECTOR"), branch)
    along = 1.0 - op.random(tree, 0.0, 1.0, seed + 3) * shape["leafy_share"]
    size = op.sample_index(branches, op.named_attribute(tree, "size"), branch)
    radius = shape["cluster_radius"] * size * op.random(tree, 0.75, 1.25, seed + 5, branch)
    around = _in_ball(tree, seed + 4, number) * radius
    place = begin + (end - begin) * along + around
    points = tree.node("GeometryNodePoints", count=shape["leaves"] * share).value
    way = tree.node("ShaderNodeVectorMath", end - begin, operation="NORMALIZE").value
    anywhere = op.random(tree, (-1.0, -1.0, -1.0), (1.0, 1.0, 1.0), seed + 6)
    points_to = anywhere * (1.0 - shape["leaf_order"]) + way * (shape["leaf_order"] * 1.5)
    points_to = points_to - op.vector(tree, 0.0, 0.0, shape["leaf_droop"])
    turned = op.random_turn(tree, (0.0, -0.9, 0.0), (0.0, 0.9, 0.0), seed + 7)
    leaves = tree.node(
        "GeometryNodeInstanceOnPoints",
        op.set_position(points, place),
        instance=_leaf(tree, shape["leaf_length"], shape["leaf_width"]),
        rotation=tree.node("FunctionNodeAlignRotationToVector", turned, 1.0, points_to, axis="Y").value,
        # Fewer leaves are larger, so that the crown lets as much through.
        scale=op.random(tree, 0.7, 1.3, seed + 8) * size / op.unary("SQRT", share),
    ).value
    return op.realize(leaves)


def _leaf(tree: Tree, length: Value, width: Value) -> Value:
    face = tree.node("GeometryNodeMeshCircle", vertices=3, fill_type="NGON").value
    outline = op.choose(op.index(tree), _LEAF)
    size = op.vector(tree, width, length, 1.0)
    return op.set_position(face, outline * size)


def _in_ball(tree: Tree, seed: Value, identifier: Value) -> Value:
    """Return a random point of the unit ball, rather on its outside."""
    direction = op.random(tree, (-1.0, -1.0, -1.0), (1.0, 1.0, 1.0), seed, identifier)
    direction = tree.node("ShaderNodeVectorMath", direction, operation="NORMALIZE").value
    return direction * op.power(op.random(tree, 0.0, 1.0, seed + 100, identifier), 0.4)


def bend_stems(tree: Tree, plant: Value, seed: Value) -> Value:
    """Return the plant with its stems bent a little, and exactly 1 high."""
    place = op.position(tree)
    bent = tree.node("ShaderNodeTexNoise", place, noise_dimensions="4D", w=seed, scale=2.5, detail=1.0)
    aside = (bent["Color"] - (0.5, 0.5, 0.5)) * (op.minimum(op.component(place, "Z") * 4.0, 1.0) * (2.0 * _CROOKED))
    flat = aside * (1.0, 1.0, 0.0)
    return one_high(tree.node("GeometryNodeSetPosition", plant, offset=flat).value)
