"""Trees that stand alone or in rows (SR Avenue Tree): the stands' trees, each of its own measures."""

from __future__ import annotations

from ...base.classes import class_id
from ...road.things.plant_shape import species_shapes
from ...road.things.tree import Tree as AvenueTree
from ...road.vegetation.species import BARE_TWIGS, is_bare
from ..nodes import operations as op
from ..nodes.builder import Tree, makes_group
from ..nodes.inputs import inputs_class, integer, metres, share
from ..nodes.standing import Standing
from .model_builder import ModelBuilder
from .registry import model_part
from .vegetation.build import DARK_TWIGS
from .vegetation.crown import Crown, PlantMaterials
from .vegetation.tree import shape_group

_GIVEN = ("crown_bottom",)
"""Inputs of a crown that a tree's measures give."""
_Shape = inputs_class("_Shape", {field.name: field for field in Crown.fields() if field.name not in _GIVEN})


class _Tree(Standing):
    height = metres(14.0, (2.0, 50.0), "Top above the surface")
    trunk_diameter = metres(0.4, (0.05, 2.5), "Diameter of the trunk at its foot")
    crown_diameter = metres(8.0, (0.5, 30.0), "Diameter of the crown where it is widest")
    crown_bottom = metres(3.0, (0.3, 40.0), "Height at which the crown begins")
    seed = integer(0, (0, 2**30), "Seed of branches and leaves")
    detail = share(1.0, (0.0, 1.0), "Share of the leaves' triangles")


@makes_group("SR Avenue Tree", catalogue="Plants")
def avenue_tree_group(tree: Tree) -> None:
    """One tree: trunk, branches and leaves; points carry ``heading`` (rad) and ``elevation`` (m)."""
    standing = _Tree(tree)
    with tree.panel("Shape at height 1"):
        shape = _Shape(tree)
    with tree.panel("Materials"):
        materials = PlantMaterials(tree)
    with tree.frame("A tree of height 1, scaled"):
        breadth = standing.crown_diameter * 0.5 / shape.values["crown_radius"]
        inputs = {**shape.values, **materials.values, "seed": standing.seed, "detail": standing.detail}
        inputs["crown_bottom"] = op.minimum(standing.crown_bottom / standing.height, 0.9)
        inputs["trunk_radius"] = standing.trunk_diameter * 0.5 / breadth
        plant = tree.call(shape_group(), **inputs).value
        plant = op.transform(plant, scale=op.vector(tree, breadth, breadth, standing.height))
    with tree.frame("Put onto the points"):
        mesh = standing.put_labelled([plant], class_id(AvenueTree.points_class))
    tree.output("Mesh", mesh, description="The tree")


@model_part("avenue_trees", 67)
def build_avenue_trees(builder: ModelBuilder) -> None:
    """Add one object per tree to the model; none at detail 0."""
    if builder.detail == 0.0:
        return
    for name, item in builder.parameters.of_type(AvenueTree).items():
        shape = {key: value for key, value in species_shapes()["tree"][item.species].items() if key not in _TAKEN}
        bark = f"{item.species}_bark"
        looks = {"bark_material": bark, "leaves_material": f"{item.species}_leaves"}
        if is_bare(item.species, builder.parameters.environment.season):
            shape |= {key: shape[key] * factor for key, factor in BARE_TWIGS.items()}
            looks["leaves_material"] = DARK_TWIGS.get(item.species, bark)
        builder.add_thing(name, item, avenue_tree_group(), detail=builder.detail, **shape, **looks)


_TAKEN = (*_GIVEN, "trunk_radius")
"""Measures of a species in place of which a tree has its own."""
