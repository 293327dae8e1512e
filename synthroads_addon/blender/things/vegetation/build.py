"""Plants."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

from ....base.files import PRESETS
from ....base.schema import read_json
from ....road.surroundings import Vegetation
from ..model_builder import ModelBuilder
from .grass import grass_group
from .shrub import shrub_group
from .tree import tree_group

_GROUPS = {"grass": grass_group, "shrub": shrub_group, "tree": tree_group}
_ROADSIDE_SHARE = 0.8
"""Grass on verges and median, as a share of the density elsewhere; reed grows on neither."""


@cache
def species_shapes() -> dict[str, dict[str, dict[str, float]]]:
    """Return the shapes of the species by kind of plant and name: inputs of its group, for a plant of height 1."""
    shapes: dict[str, dict[str, dict[str, float]]] = read_json(PRESETS / "plants.json")
    return shapes


def build_vegetation(builder: ModelBuilder) -> None:
    """Make one object per stand of plants."""
    terrain = builder.parameters.terrain
    if terrain is None or "Terrain" not in builder.objects or builder.detail == 0.0:
        return
    for name, plants in builder.parameters.of_type(Vegetation).items():
        builder.add_thing(
            name,
            plants,
            _GROUPS[plants.kind](),
            reach=terrain.half_width,
            first_metre=math.floor(builder.stretch[0]),
            zero=builder.zero,
            seed=plants.seed % 2**30,
            detail=builder.detail,
            **species_shapes()[plants.kind][plants.species],
            **_further_inputs(plants, builder),
        )


def _further_inputs(plants: Vegetation, builder: ModelBuilder) -> dict[str, Any]:
    """Return the inputs that only one kind of plant has: materials, and the density on verges and median."""
    if plants.kind == "grass":
        roadside = plants.density * _ROADSIDE_SHARE * (plants.species != "reed")
        return {"roadside_density": roadside, "roadside_reach": builder.widest, "material": plants.species}
    return {"bark_material": f"{plants.species}_bark", "leaves_material": f"{plants.species}_leaves"}
