"""What grass and trees share: where plants grow, and how they are put there."""

from __future__ import annotations

from dataclasses import dataclass

from . import operations as op
from .builder import Operand, Tree, Value
from .strip import INSTANCES

_MARGIN = 6.0
"""Faces this far (m) outside the band are still looked at: their mean distance lies off its border."""

_NEEDED_NO_MORE = ("distance", "station", "offset", "edge", "share", "id")
"""Attributes of the places that the plants' many points would only carry along."""


@dataclass(frozen=True)
class Stand:
    """Inputs of a stand of plants, common to all kinds."""

    terrain: Value
    road: Value
    density: Value
    start: Value
    end: Value
    lowest: Value
    tallest: Value
    seed: Value
    detail: Value
    instance: Value


def declare_stand(tree: Tree, density: float, heights: tuple[float, float], band: tuple[float, float]) -> Stand:
    """Declare the inputs common to all kinds of plants."""
    return Stand(
        terrain=tree.input("Terrain", "Object", description="Terrain whose points carry their distance"),
        road=tree.input("Road", "Object", description="Road, for its verges and median"),
        density=tree.number("Density", density, (0.0, 50.0), description="Plants per area (1/m2)"),
        start=tree.number(
            "Band Start", band[0], (-5.0, 1000.0), unit="m", description="From the outer edge of the verge"
        ),
        end=tree.number("Band End", band[1], (-5.0, 1000.0), unit="m", description="From the outer edge of the verge"),
        lowest=tree.number("Smallest Height", heights[0], (0.01, 60.0), unit="m", description="Height of the smallest"),
        tallest=tree.number("Largest Height", heights[1], (0.01, 60.0), unit="m", description="Height of the tallest"),
        seed=tree.integer("Seed", 0, (0, 2**31 - 1), description="Seed of places, sizes and turns"),
        detail=tree.number("Detail", 1.0, (0.0, 1.0), unit="share", description="Share of the triangles"),
        instance=tree.integer("Instance", 0, INSTANCES, description="Instance number of the faces"),
    )


def points_in_band(tree: Tree, stand: Stand, surface: Value, density: Operand) -> Value:
    """Return points spread at random over the faces of the surface in the band."""
    distance = op.named(tree, "distance")
    near = op.separate(surface, (distance > stand.start - _MARGIN) & (distance < stand.end + _MARGIN), "FACE")
    points = tree.node(
        "GeometryNodeDistributePointsOnFaces",
        near,
        distribute_method="RANDOM",
        density=density,
        seed=stand.seed,
    )["Points"]
    return op.delete_points(points, (distance < stand.start) | (distance > stand.end))


def planted(tree: Tree, stand: Stand, points: Value, variants: list[Value], height: Value, lean: float) -> Value:
    """Put one of the variants (of height 1) on each point, turned and leant at random, and make it real."""
    bodies = op.join(*(tree.node("GeometryNodeGeometryToInstance", variant).value for variant in variants))
    # A whole random number would be another one in Blender 5.
    share = op.random(tree, 0.0, len(variants) - 0.001, stand.seed + 2)
    pick = tree.node("FunctionNodeFloatToInt", share, rounding_mode="FLOOR").value
    plants = tree.node(
        "GeometryNodeInstanceOnPoints",
        points,
        instance=bodies,
        pick_instance=True,
        instance_index=pick,
        rotation=op.random_turn(tree, (-lean, -lean, 0.0), (lean, lean, 6.2832), stand.seed + 1),
        scale=height,
    ).value
    for name in _NEEDED_NO_MORE:
        plants = tree.node("GeometryNodeRemoveAttribute", plants, name=name).value
    return op.realize(plants)


def one_high(plant: Value) -> Value:
    """Return a plant scaled along z so that its top is at 1."""
    tree = plant.tree
    top = op.component(tree.node("GeometryNodeBoundBox", plant)["Max"], "Z")
    size = op.vector(tree, 1.0, 1.0, 1.0 / top)
    place = tree.node("ShaderNodeVectorMath", op.position(tree), size, operation="MULTIPLY").value
    return op.set_position(plant, place)
