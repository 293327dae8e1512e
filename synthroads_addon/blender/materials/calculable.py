"""Which materials can be evaluated at the very returns: the inputs of their layers, and nodes that prevent it."""

from __future__ import annotations

from dataclasses import dataclass

import bpy

from ...scanning.scene.surface_values import ALONG, SurfaceInput
from .inputs import POINT_INPUTS, InputSearch
from .surface_layers import layer_expressions, sockets_of
from .transparency import transparency_inputs


@dataclass(frozen=True)
class MaterialNeeds:
    """Inputs that a material's layers depend on, and obstacles.

    Attributes:
        inputs: values that the layers' nodes read at the place that is seen: position, normal, attributes, ...
        obstacles: names of nodes that can't be replaced by values; empty if the material can be evaluated.
    """

    inputs: frozenset[SurfaceInput]
    obstacles: tuple[str, ...]


def material_needs(item: bpy.types.Material) -> MaterialNeeds:
    """Return the inputs that a material's layers depend on, and the nodes that prevent evaluating them."""
    search = InputSearch()
    for expression in layer_expressions(item).values():
        for linked in sockets_of(expression):
            search.visit(linked.output, linked.path)
    return MaterialNeeds(frozenset(site.surface_input for site in search.sites), tuple(search.obstacles))


def asked_inputs(item: bpy.types.Material) -> frozenset[SurfaceInput]:
    """Return the inputs that a material reads from surfaces, not from the points: for its layers and its alpha."""
    needs = material_needs(item)
    layer_inputs = frozenset() if needs.obstacles else needs.inputs
    return (layer_inputs | transparency_inputs(item)) - {*POINT_INPUTS, ALONG}
