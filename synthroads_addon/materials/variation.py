"""One road's materials: the table's means, changed by age, wear, dryness and rain.

The table holds the means of a road with the default `MaterialVariation`. Base colour and specular change together, so
that what the camera sees and what the laser measures change alike. Facets and retro-reflection change with them: worn
paint has lost its beads with its film, and beads under water retro-reflect little.
"""

from collections.abc import Mapping

import numpy as np

from ..road.pavement.age import asphalt_brightness
from ..road.section import ASPHALTS, CONCRETES
from ..road.surroundings import Environment, MaterialVariation
from .table import Material, materials

DRY_GRASS = (0.27, 0.22, 0.11)
GREEN_GRASS = (0.58, 0.92, 0.7)
"""Shares of the table's red, green and blue that lush grass reflects: chlorophyll takes most of the red, so that a
meadow's is half of its green. Assumed, after spectra of green grass (4 % in the red, 9 % in the green)."""
WET_BASE, WET_SPECULAR, WET_ROUGHNESS = 0.45, 0.5, 0.6
"""Share that water takes of a porous surface's base colour, of what it reflects at 905 nm, and of its roughness."""
WET_RETROREFLECTION = 0.8
"""Share that water takes of the beads' retro-reflection: markings of class R4 (EN 1436) are RW2 when wet."""

_PAINTS = ("paint_white", "paint_yellow")
_GRASSES = ("verge", "median", "grass_ground", "grass", "meadow", "ryegrass", "reed")
_POROUS = (*ASPHALTS, *CONCRETES, "soil", "gravel", "verge", "setts", "concrete_pavers", *_PAINTS)
_DRAINED = 0.4
"""Wetness that water leaves on porous asphalt, as a share of what it is on others: it drains through the pores."""
_DEFAULT = MaterialVariation()


def vary_material(
    name: str,
    variation: MaterialVariation,
    environment: Environment,
    own_materials: Mapping[str, Material] | None = None,
) -> Material:
    """Return a table's material as a road's variation (age, wear, dryness) and wetness change it; KeyError if unknown.

    Args:
        name: of the material.
        variation, environment: the road's.
        own_materials: materials that take the place of the shipped table's, or stand beside them.
    """
    result = _age_material(name, {**materials(), **(own_materials or {})}, variation)
    if environment.wetness > 0.0 and name in _POROUS:
        wet_share = _DRAINED if name == "porous_asphalt" else 1.0
        result = _wet_material(result, environment.wetness * wet_share)
    return result


def water_film(name: str, environment: Environment) -> float:
    """Return the share of a material's surface that a film of water covers, 0 to 1: of porous ones as they are wet."""
    return environment.wetness if name in _POROUS else 0.0


def _wet_material(dry_material: Material, wet_share: float) -> Material:
    """Return a porous material under a film of water, ``wet_share`` 0 to 1: darker, smoother, less retro-reflective."""
    roughness_factor = 1.0 - WET_ROUGHNESS * wet_share
    result = _scale_color(dry_material, 1.0 - WET_BASE * wet_share, 1.0 - WET_SPECULAR * wet_share)
    return result.model_copy(
        update={
            "roughness": dry_material.roughness * roughness_factor,
            "facet_slope": None if dry_material.facet_slope is None else dry_material.facet_slope * roughness_factor**2,
            "retroreflection": dry_material.retroreflection * (1.0 - WET_RETROREFLECTION * wet_share),
        }
    )


def _age_material(name: str, table: Mapping[str, Material], variation: MaterialVariation) -> Material:
    """Return one of a table's materials as age, wear and dryness change it."""
    mean = table[name]
    if name in ASPHALTS:
        age_factor = asphalt_brightness(variation.asphalt_age) / asphalt_brightness(_DEFAULT.asphalt_age)
        return _scale_color(mean, variation.asphalt_brightness * age_factor)
    if name in CONCRETES:
        return _scale_color(mean, variation.concrete_brightness)
    if name in _PAINTS:
        worn_share = (variation.paint_wear - _DEFAULT.paint_wear) / (1.0 - _DEFAULT.paint_wear)
        return _mix_materials(mean, table["asphalt"], worn_share)
    if name in _GRASSES:
        return _dry_grass(mean, variation.grass_dryness)
    return mean


def _dry_grass(mean: Material, dryness: float) -> Material:
    """Return grass between lush, as the table has it, and dry."""
    usual_dryness = _DEFAULT.grass_dryness
    if dryness < usual_dryness:
        color, share = (
            tuple((np.array(mean.base_color) * GREEN_GRASS).tolist()),
            (usual_dryness - dryness) / usual_dryness,
        )
    else:
        color, share = DRY_GRASS, (dryness - usual_dryness) / (1.0 - usual_dryness)
    return _mix_materials(mean, mean.model_copy(update={"base_color": color}), share)


def _scale_color(mean: Material, factor: float, specular: float | None = None) -> Material:
    """Return a material with its base colour and specular times a factor; ``specular`` is the latter's own one."""
    color = np.clip(np.array(mean.base_color) * factor, 0.0, 1.0)
    scaled_specular = float(np.clip(mean.specular * (factor if specular is None else specular), 0.0, 1.0))
    return mean.model_copy(update={"base_color": tuple(color.tolist()), "specular": scaled_specular})


def _mix_materials(mean: Material, other: Material, share: float) -> Material:
    """Return a material between two in colour, specular, facets and beads; a negative share extrapolates.

    Roughness, transmission, spread and the lobe of the retro-reflection stay the first's.
    """

    def between(name: str) -> float:
        """Return a property between those of the two materials."""
        return float((1.0 - share) * getattr(mean, name) + share * getattr(other, name))

    color = np.clip(np.array(mean.base_color) * (1.0 - share) + np.array(other.base_color) * share, 0.0, 1.0)
    slope = None if mean.facet_slope is None else max(0.0, between("slope"))
    return mean.model_copy(
        update={
            "base_color": tuple(color.tolist()),
            "specular": min(1.0, max(0.0, between("specular"))),
            "facet_slope": slope,
            "retroreflection": max(0.0, between("retroreflection")),
        }
    )
