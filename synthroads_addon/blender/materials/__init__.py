"""Blender materials from the material table; their means are equal to the table's."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from functools import partial

import bpy

from ...base.errors import nearest_name
from ...base.random_streams import stream
from ...materials.table import UNKNOWN, Material, materials
from ...materials.variation import vary_material
from ...road.pavement.field import Wear
from ...road.surroundings import Environment, MaterialVariation
from .looks import is_worn, vary_color
from .shading import shade
from .surface_layers import PROPERTY, layer_expressions, mean_value

MEAN = "synthroads_mean"
"""Custom property of a Blender material: its mean properties on this road, as JSON."""
WEAR = "synthroads_wear"
"""Custom property of a pavement's material: the parameters of its field."""
_USUAL = Wear(MaterialVariation().wheel_track_polish, 0.0)


def material(name: str) -> bpy.types.Material:
    """Return the Blender material of a table entry, made if the file has none; KeyError for other names."""
    if name not in materials():
        raise KeyError(f"no material '{name}'{nearest_name(name, materials())}")
    for existing in bpy.data.materials:
        if existing.get(PROPERTY) == name:
            return existing
    made = bpy.data.materials.new(f"SR {name}")
    made[PROPERTY] = name
    _shade(made, materials()[name], _USUAL)
    return made


def vary(
    variation: MaterialVariation,
    environment: Environment,
    own: Mapping[str, Material] | None = None,
    seed: int = 0,
) -> None:
    """Give the materials that the file has their means on a road with this variation and weather.

    Args:
        variation, environment: the road's.
        own: materials in place of the shipped table's.
        seed: the road's, for what is random on its pavement.
    """
    wear = Wear(variation.wheel_track_polish, float(stream(seed, "pavement look").integers(1 << 16)))
    for item in bpy.data.materials:
        if PROPERTY in item and item[PROPERTY] in materials():
            mean = vary_material(item[PROPERTY], variation, environment, own)
            if mean.to_json() != item.get(MEAN) or (is_worn(item[PROPERTY]) and tuple(item.get(WEAR, ())) != wear):
                _shade(item, mean, wear)


def _shade(item: bpy.types.Material, mean: Material, wear: Wear) -> None:
    shade(item, mean, partial(vary_color, item[PROPERTY], wear))
    item[MEAN] = mean.to_json()
    if is_worn(item[PROPERTY]):
        item[WEAR] = wear


def table_name(item: bpy.types.Material | None) -> str:
    """Return the name that a face's material is known by: the table's, else Blender's own."""
    if item is None:
        return UNKNOWN
    return str(item.get(PROPERTY, item.name))


def constants(names: Iterable[str]) -> dict[str, Material]:
    """Return materials' properties by name: this road's, else those of the material's Principled BSDF."""
    table = materials()
    here = {item[PROPERTY]: item[MEAN] for item in bpy.data.materials if PROPERTY in item and MEAN in item}

    def mean(name: str) -> Material:
        return Material.from_dict(json.loads(here[name])) if name in here else table[name]

    return {name: mean(name) if name in table else _principled(name) for name in names}


def _principled(name: str) -> Material:
    item = bpy.data.materials.get(name)
    if item is None:
        return materials()[UNKNOWN]
    means = {layer: mean_value(found) for layer, found in layer_expressions(item).items()}
    nodes = item.node_tree.nodes if item.node_tree else ()
    node = next((node for node in nodes if node.type == "BSDF_PRINCIPLED"), None)
    red, green, blue = (share(part) for part in means.get("base_color", item.diffuse_color[:3]))
    # A renderer's default specular of 0.5 would drown the contrast of the base colours.
    specular = min(0.2, node.inputs["Specular IOR Level"].default_value) if node else 0.2
    return Material(
        base_color=(red, green, blue),
        roughness=share(means["roughness"][0] if "roughness" in means else item.roughness),
        metallic=share(means["metallic"][0] if "metallic" in means else item.metallic),
        specular=share(specular),
    )


def share(value: float) -> float:
    """Return a value between 0 and 1."""
    return min(1.0, max(0.0, float(value)))
