"""Builder of the part vegetation: an object for each stand of plants."""

from __future__ import annotations

import math
from typing import Any

import bpy
import numpy as np

from ....base.turns.stepper import run_aside
from ....road.section import Median
from ....road.surroundings import Terrain, Vegetation
from ....road.things.plant_shape import species_shapes
from ....road.vegetation.plants import ROADSIDE_SHARE, SEEDS, WILD_GRASSES, plant_places
from ....road.vegetation.species import BARE_TWIGS, is_bare
from ..field_entrance import clear_grass
from ..meshes import attribute, fill
from ..model_builder import ModelBuilder
from ..registry import model_part
from .grass import grass_group
from .shrub import shrub_group
from .tree import tree_group

DARK_TWIGS = {"birch": "hazel_bark"}
"""Material of the twigs of species with white bark on trunk and branches only."""
_SIDES = {"both": 0, "left": 1, "right": -1}
_GROUPS = {"grass": grass_group, "shrub": shrub_group, "tree": tree_group}


@model_part("vegetation", 190)
def build_vegetation(builder: ModelBuilder) -> None:
    """Add one object per stand of plants to the model; none without terrain or at detail 0."""
    terrain = builder.parameters.terrain
    if terrain is None or "Terrain" not in builder.objects or builder.detail == 0.0:
        return
    for name, plants in builder.parameters.of_type(Vegetation).items():
        builder.add_thing(
            name,
            plants,
            _GROUPS[plants.kind](),
            None if plants.kind == "grass" else _places_mesh(builder, plants, terrain),
            instance=builder.geometry.numbers.parts[name].first,
            reach=terrain.half_width,
            first_metre=math.floor(builder.stretch[0]),
            zero=builder.zero,
            seed=plants.seed % SEEDS,
            detail=builder.detail,
            **species_shapes()[plants.kind][plants.species] | _further_inputs(plants, builder),
        )
        if plants.kind == "grass":
            clear_grass(builder, builder.objects[name])


def _places_mesh(builder: ModelBuilder, plants: Vegetation, terrain: Terrain) -> bpy.types.Mesh:
    """Create a mesh with a vertex per candidate place of a stand: number, whether a plant stands there, inputs."""
    places = run_aside(lambda: plant_places(builder.geometry, plants, terrain, *builder.stretch))
    mesh = bpy.data.meshes.new("SR Places")
    fill(mesh, np.zeros((len(places.number), 3)))
    attribute(mesh, "id", places.number)
    attribute(mesh, "stands", places.stands.astype(np.int64))
    attribute(mesh, "seed", np.full(len(places.number), plants.seed % SEEDS))
    inputs = {name: getattr(plants, name) for name in ("density", "band_start", "band_end")}
    stretch = {name: builder.along(getattr(plants, name)) for name in ("start_station", "end_station")}
    for name, value in {**inputs, **stretch, "reach": terrain.half_width, "on_side": _SIDES[plants.side]}.items():
        attribute(mesh, name, np.full(len(places.number), float(value)))
    return mesh


def _further_inputs(plants: Vegetation, builder: ModelBuilder) -> dict[str, Any]:
    """Return a stand's inputs that depend on its kind: for grass densities on verge and median, else materials.

    Leafless plants have twigs of bark in place of leaves.
    """
    if plants.kind == "grass":
        roadside = plants.density * ROADSIDE_SHARE * (plants.species not in WILD_GRASSES)
        median_instance = next((item.instance for item in builder.parameters.of_type(Median).values()), 0)
        reach_inputs = {"roadside_reach": builder.widest, "median_instance": median_instance}
        return {"roadside_density": roadside, "material": plants.species, **reach_inputs}
    bark, leaves = f"{plants.species}_bark", f"{plants.species}_leaves"
    side_input = {"on_side": _SIDES[plants.side]}
    if not is_bare(plants.species, builder.parameters.environment.season):
        return {"bark_material": bark, "leaves_material": leaves, **side_input}
    species_shape = species_shapes()[plants.kind][plants.species]
    twigs = {name: species_shape[name] * factor for name, factor in BARE_TWIGS.items()}
    return {"bark_material": bark, "leaves_material": DARK_TWIGS.get(plants.species, bark), **twigs, **side_input}
