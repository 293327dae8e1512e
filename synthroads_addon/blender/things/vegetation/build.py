"""Plants."""

from __future__ import annotations

import math
from typing import Any

import bpy

from ....road.parameters import Vegetation
from ...materials import material
from ..model_builder import ModelBuilder
from .grass import grass_group
from .shrub import shrub_group
from .species import GRASSES, SHRUBS, TREES
from .tree import tree_group

_KINDS = {"grass": (grass_group, GRASSES), "shrub": (shrub_group, SHRUBS), "tree": (tree_group, TREES)}
"""Kind of plant -> its group, and the shapes of its species."""
_ROADSIDE_SHARE = 0.8
"""Grass on verges and median, as a share of the density elsewhere; reed grows on neither."""


def build_vegetation(builder: ModelBuilder) -> None:
    """Make one object per stand of plants."""
    terrain = builder.parameters.terrain
    if terrain is None or "Terrain" not in builder.objects or builder.detail == 0.0:
        return
    for name, plants in builder.parameters.of_type(Vegetation).items():
        inputs: dict[str, Any] = {
            **builder.surfaces("Backbone"),
            "Density": plants.density,
            "Band Start": plants.band_start,
            "Band End": plants.band_end,
            "Smallest Height": plants.height_min,
            "Largest Height": plants.height_max,
            "Reach": terrain.half_width,
            "First Metre": math.floor(builder.stretch[0]),
            "Zero": builder.zero,
            "Seed": plants.seed % 2**30,
            "Detail": builder.detail,
            "Instance": plants.instance,
        }
        group, shapes = _KINDS[plants.kind]
        inputs |= shapes[plants.species]
        builder.add(name, bpy.data.meshes.new("SR Plants"), group(), inputs | _extra(plants, builder))


def _extra(plants: Vegetation, builder: ModelBuilder) -> dict[str, Any]:
    """Return the inputs that only one kind of plant has: materials, and the density on verges and median."""
    if plants.kind == "grass":
        roadside = plants.density * _ROADSIDE_SHARE * (plants.species != "reed")
        return {"Roadside Density": roadside, "Roadside Reach": builder.widest, "Material": material(plants.species)}
    parts = {"Bark Material": "bark", "Leaves Material": "leaves"}
    return {name: material(f"{plants.species}_{part}") for name, part in parts.items()}
