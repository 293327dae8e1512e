"""SR Grass: tufts of blades on the ground, the verges and the median.

Dimensions (m) and shares without a name here are chosen.
"""

from __future__ import annotations

from ....base.classes import class_id
from ....road.vegetation.plants import ROADSIDE_HEIGHT
from ...nodes import operations as op
from ...nodes.builder import Tree, Value, makes_group
from ...nodes.inputs import INSTANCES, Inputs, integer, material_of, metres, number, share
from ...nodes.solids import Point
from ...nodes.strip import SEALED
from .plants import Stand, one_high, plant_points, points_in_band, points_on

_VARIANTS = 4
"""Number of different tufts; chosen."""
_GOLDEN_ANGLE = 2.4
"""Angle between successive blades, rad, near pi (3 - sqrt 5): they spread evenly."""
_BLADE = [(0.0, -0.5, -0.04), (0.0, 0.5, -0.04), (0.0, 0.0, 1.0)]
"""A blade of height and width 1: a triangle from a broad foot, slightly buried, to its tip; x is outwards."""
_STALK = [(0.0, 0.0, -0.04), (0.10, -0.5, 0.78), (0.10, 0.5, 0.78), (0.2, 0.0, 1.0)]
"""A stalk of height and width 1: one face, widest at its ear."""


class _Roadside(Inputs):
    roadside_density = number(1.0, (0.0, 50.0), "Tufts per area of verge and median (1/m2)")
    roadside_reach = metres(30.0, (1.0, 100.0), "Farthest verge from the axis")
    roadside_height = share(ROADSIDE_HEIGHT, (0.0, 1.0), "Height there, as a share of the height elsewhere")
    mown_width = metres(0.0, (0.0, 20.0), "Width of the strip behind the verge where grass is as high as there")
    median_instance = integer(0, INSTANCES, "Instance number of the median's faces; 0 if it has none of its own")
    material = material_of("the blades", "meadow")


class _Tuft(Inputs):
    blades = integer(8, (1, 200), "Blades of a tuft")
    blade_width = metres(0.11, (0.002, 1.0), "Width of a blade at its foot")
    spread = metres(0.4, (0.0, 2.0), "Radius of the tuft on the ground")
    lean = number(0.8, (0.0, 1.5), "Lean of the outermost blades from the vertical", unit="rad")
    stalks = integer(2, (1, 50), "Stalks of a tuft, taller than its blades")
    ear_width = metres(0.07, (0.002, 1.0), "Width of a stalk's ear")
    blade_height = share(0.75, (0.05, 1.0), "Length of the blades, of the stalks'")


@makes_group("SR Grass")
def grass_group(tree: Tree) -> None:
    """Tufts of grass in a band beside the road, and shorter ones on its verges and median."""
    stand, roadside = Stand(tree), _Roadside(tree)
    with tree.panel("Shape at height 1"):
        shape = _Tuft(tree)

    with tree.frame("Places on the terrain"):
        distance = op.named_attribute(tree, "distance")
        points = points_in_band(tree, stand, stand.density * stand.detail, surface_field=distance)
        is_mown = op.named_attribute(tree, "found") < roadside.mown_width
        share = op.switch(is_mown, 1.0, roadside.roadside_height)
        # Strips, by which instance numbers are given: 0 and 1 beside the road, left and right; 2 and 3 on the median,
        # 4 on verges.
        points = op.store(op.store(points, "share", share), "strip", _on_right(tree))
    with tree.frame("Places on verges and median"):
        is_roadside = op.named_attribute(tree, "class_id", "INT").equals(class_id("roadside"))
        is_roadside = is_roadside & op.named_attribute(tree, SEALED, "INT").equals(0)  # not kerbs and footways
        faces = op.separate(op.object_geometry(stand.road), is_roadside, "FACE")
        density = roadside.roadside_density * stand.detail
        instance = op.named_attribute(tree, "instance_id", "INT")
        roadside_points = points_on(
            tree, stand, faces, density, roadside.roadside_reach, stand.seed + 7, surface_field=instance
        )
        surface_instance = op.named_attribute(tree, "found", "INT")
        is_in_median = (surface_instance - roadside.median_instance).equals(0) & ~roadside.median_instance.equals(0)
        roadside_points = op.store(roadside_points, "strip", op.switch(is_in_median, 2 + _on_right(tree), 4))
        points = op.join(points, op.store(roadside_points, "share", roadside.roadside_height))
    with tree.frame("Kinds of tufts"):
        variants = [tree.call(tuft_group(), **shape.values, seed=100 * n).value for n in range(_VARIANTS)]
    with tree.frame("Tufts"):
        share = op.named_attribute(tree, "share")
        height = op.random(tree, stand.smallest_height, stand.largest_height, stand.seed + 3) * share
        # Low tufts are broad for their height; fewer tufts are broader, so that they cover the same area (chosen).
        breadth = (height + stand.largest_height * share) * 0.65 / op.unary("SQRT", op.maximum(stand.detail, 0.05))
        scale = op.vector(tree, breadth, breadth, height)
        number = stand.instance + op.named_attribute(tree, "strip", "INT")
        mesh = plant_points(tree, points, variants, scale, 0.12, stand.seed, number)
        mesh = op.store(mesh, "class_id", class_id("vegetation"), "FACE")
        mesh = tree.node("GeometryNodeSetMaterial", mesh, material=roadside.material).value
    tree.output("Mesh", mesh, description="Grass; only faces that scanner and camera can see")


def _on_right(tree: Tree) -> Value:
    """Add nodes for 1 at points on the right of the axis, 0 at those on its left; a field."""
    return op.switch(op.named_attribute(tree, "offset") < 0.0, 0, 1)


@makes_group("SR Grass Tuft")
def tuft_group(tree: Tree) -> None:
    """One tuft of height 1: blades all around, and some stalks in the middle."""
    shape = _Tuft(tree)
    seed = tree.integer("Seed", 0, (0, 2**30), description="Seed of the blades")
    with tree.frame("A blade"):
        disc = tree.node("GeometryNodeMeshCircle", vertices=3, fill_type="NGON").value
        blade = _shape_blade(disc, _BLADE, shape.blade_width)
    with tree.frame("Blades, the outer ones lean more"):
        blades = _around(tree, blade, shape.blades, shape.spread, shape.lean, seed)
    with tree.frame("A stalk with its ear"):
        face = tree.node("GeometryNodeMeshGrid", vertices_x=2, vertices_y=2).value
        stalk = _shape_blade(face, _STALK, shape.ear_width)
    with tree.frame("Stalks"):
        stalks = _around(tree, stalk, shape.stalks, shape.spread * 0.6, shape.lean * 0.3, seed + 50)
    with tree.frame("Blades of their height, all 1 high"):
        blade_scale = op.vector(tree, 1.0, 1.0, shape.blade_height)
        place = op.position(tree) * blade_scale
        blades = op.set_position(blades, place)
        tuft = one_high(op.join(blades, stalks))
    tree.output("Mesh", tuft, description="The tuft's blades")


def _shape_blade(face: Value, outline: list[Point], width: Value) -> Value:
    """Add nodes that give a face the outline of a blade or stalk of a width (m) and height 1."""
    tree = face.tree
    size = op.vector(tree, 1.0, width, 1.0)
    place = op.choose(op.index(tree), outline) * size
    return op.set_position(face, place)


def _around(tree: Tree, blade: Value, count: Value, spread: Value, lean: Value, seed: Value) -> Value:
    """Add nodes for `count` blades on a disc of radius `spread`; outer blades lean more, away from the middle."""
    blade_index = op.index(tree)
    radius_share = op.unary("SQRT", (blade_index + 0.5) / (count * 1.0))
    angle = blade_index * _GOLDEN_ANGLE + op.random(tree, -0.6, 0.6, seed)
    place = op.vector(tree, op.unary("COSINE", angle), op.unary("SINE", angle)) * (radius_share * spread)
    points = tree.node("GeometryNodePoints", count=count).value
    tilt = radius_share * lean * op.random(tree, 0.5, 1.1, seed + 1)
    blades = tree.node(
        "GeometryNodeInstanceOnPoints",
        op.set_position(points, place),
        instance=blade,
        rotation=op.turn(tree, y=tilt, z=angle + op.random(tree, -0.9, 0.9, seed + 2)),
        scale=op.random(tree, 0.7, 1.0, seed + 3),
    ).value
    return op.realize(blades)
