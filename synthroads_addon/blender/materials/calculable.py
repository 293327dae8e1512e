"""Which materials can be worked out at the very returns: what their layers ask for, and what stands in the way."""

from __future__ import annotations

from dataclasses import dataclass

import bpy

from ...scanning.scene.surface_values import ALONG, SurfaceInput
from .inputs import OF_POINT, InputSearch
from .surface_layers import layer_expressions, sockets_of
from .transparency import asked_by_transparency


@dataclass(frozen=True)
class MaterialNeeds:
    """Inputs that a material's layers depend on, and obstacles.

    Attributes:
        inputs: what they ask of the place that is seen.
        obstacles: names of nodes that no values can stand for; empty where the material can be worked out.
    """

    inputs: frozenset[SurfaceInput]
    obstacles: tuple[str, ...]


def material_needs(item: bpy.types.Material) -> MaterialNeeds:
    """Return what a material's layers depend on."""
    search = InputSearch()
    for expression in layer_expressions(item).values():
        for linked in sockets_of(expression):
            search.visit(linked.output, linked.path)
    return MaterialNeeds(frozenset(site.what for site in search.sites), tuple(search.obstacles))


def asked_inputs(item: bpy.types.Material) -> frozenset[SurfaceInput]:
    """Return what a material asks of surfaces beside the places: its layers, if they can be worked out, and its alpha.

    Args:
        item: the material.
    """
    needs = material_needs(item)
    of_layers = frozenset() if needs.obstacles else needs.inputs
    return (of_layers | asked_by_transparency(item)) - {*OF_POINT, ALONG}
