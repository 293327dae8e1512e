"""Share of light that a material lets straight through at each place: see `scanning.colour.transparency`.

A beam passes where a camera sees through: by a Principled BSDF's alpha, a Transparent BSDF, and mixes of them. Clear
glass of a renderer lets as much light through as the table's glass. A colour's mean is a factor of that share.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import bpy
import numpy as np

from ...base.arrays import Float
from ...materials.table import materials
from ...scanning.colour.transparency import Transparency
from ...scanning.scene.surface_values import SurfaceInput
from .fields import Field, FieldReader, Path, UnevaluatedError, Values, source_of
from .surface_layers import PROPERTY, surface_socket

Share = Callable[[Values], Float]
"""Function from the inputs at N places to the share (N,) of light that goes through there."""

_GLASS = {"BSDF_GLASS": "Color", "BSDF_REFRACTION": "Color"}
"""Input of the colour of each shader of glass."""


@dataclass(frozen=True)
class ReadTransparency:
    """Transparency of a material, as far as it can be evaluated.

    Attributes:
        transparency: the share of light by place; None if the material is opaque everywhere, or assumed to be.
        obstacle: name of a node that can't be evaluated, so that the material is assumed to be opaque; empty if none.
        missing: images whose files are missing.
    """

    transparency: Transparency | None = None
    obstacle: str = ""
    missing: tuple[bpy.types.Image | None, ...] = ()


def read_transparency(item: bpy.types.Material) -> ReadTransparency:
    """Return the transparency that a material's nodes define; none for a material of the table."""
    if item.node_tree is None or PROPERTY in item:
        return ReadTransparency()
    surface = surface_socket(item.node_tree)
    if surface is None:
        return ReadTransparency()
    reader = FieldReader()
    try:
        share = _of_input(reader, surface, ())
    except UnevaluatedError as obstacle:
        return ReadTransparency(None, str(obstacle), tuple(reader.missing))
    if share is None or (not reader.inputs and not share({}).any()):
        return ReadTransparency(None, "", tuple(reader.missing))
    return ReadTransparency(Transparency(frozenset(reader.inputs), share), "", tuple(reader.missing))


def _of_input(reader: FieldReader, shader_input: bpy.types.NodeSocket, path: Path) -> Share | None:
    """Return the share of light through the shader that is linked to an input socket; None if no light passes."""
    source = source_of(shader_input, path)
    if source.output is None:
        return None  # nothing is linked: black and opaque
    node, path = source.output.node, source.path
    if node.type == "MIX_SHADER":
        return _mixed(reader, node, path)
    if node.type == "ADD_SHADER":
        return _added(reader, node, path)
    if node.type == "BSDF_TRANSPARENT":
        return _tint(reader.input_field(node.inputs["Color"], path))
    if node.type == "BSDF_PRINCIPLED":
        return _principled(reader, node, path)
    if node.type in _GLASS:
        return _scaled(_tint(reader.input_field(node.inputs[_GLASS[node.type]], path)), _glass())
    return None


def _mixed(reader: FieldReader, node: bpy.types.Node, path: Path) -> Share | None:
    """Return the share of light through two mixed shaders; None if both are opaque, whatever the factor is."""
    share_a, share_b = (_of_input(reader, shader_input, path) for shader_input in node.inputs[1:3])
    if share_a is None and share_b is None:
        return None
    factor = reader.input_number(node, 0, path)

    def share(values: Values) -> Float:
        weight_b = np.clip(factor(values), 0.0, 1.0)
        result = np.zeros(1) if share_a is None else (1.0 - weight_b) * share_a(values)
        return result if share_b is None else result + weight_b * share_b(values)

    return share


def _added(reader: FieldReader, node: bpy.types.Node, path: Path) -> Share | None:
    """Return the share of light through two added shaders: the mean of both, without emissions, which block nothing."""
    shares: list[Share | None] = []
    for shader_input in node.inputs[-2:]:
        output = source_of(shader_input, path).output
        if output is not None and output.node.type != "EMISSION":
            shares.append(_of_input(reader, shader_input, path))
    terms = [share for share in shares if share is not None]
    if not terms:
        return None
    return lambda values: np.asarray(sum(share(values) for share in terms) / len(shares))


def _principled(reader: FieldReader, node: bpy.types.Node, path: Path) -> Share | None:
    """Return the share of light through a Principled BSDF, by its alpha and transmission; None if it is opaque."""
    alpha = reader.input_number(node, "Alpha", path) if _is_set(node.inputs["Alpha"], path, 1.0) else None
    glass: Share | None = None
    if _is_set(node.inputs["Transmission Weight"], path, 0.0):
        names = ("Transmission Weight", "Metallic")
        transmission_weight, metallic = (reader.input_number(node, name, path) for name in names)
        tint, glass_transmission = _tint(reader.input_field(node.inputs["Base Color"], path)), _glass()

        def through_glass(values: Values) -> Float:
            metal_share = np.clip(metallic(values), 0.0, 1.0)
            return np.asarray(
                glass_transmission * np.clip(transmission_weight(values), 0.0, 1.0) * (1.0 - metal_share) * tint(values)
            )

        glass = through_glass
    if alpha is None:
        return glass

    def share(values: Values) -> Float:
        opacity = np.clip(alpha(values), 0.0, 1.0)
        return 1.0 - opacity if glass is None else 1.0 - opacity + opacity * glass(values)

    return share


def _is_set(input_socket: bpy.types.NodeSocket, path: Path, default: float) -> bool:
    """Return whether an input may differ from its default: it is linked, or has another value."""
    source = source_of(input_socket, path)
    return source.output is not None or float(np.mean(source.input.default_value)) != default


def _tint(color: Field) -> Share:
    """Return the mean of a colour's components, 0 to 1, as a share of light."""
    return lambda values: np.asarray(np.clip(color(values)[:, :3], 0.0, 1.0).mean(axis=1))


def _scaled(share: Share, factor: float) -> Share:
    """Return a share of light times a factor."""
    return lambda values: factor * share(values)


def _glass() -> float:
    """Return the share of light that the table's glass lets through."""
    return materials()["glass"].transmission


def transparency_inputs(item: bpy.types.Material) -> frozenset[SurfaceInput]:
    """Return the inputs that a material's transparency reads at the places."""
    transparency = read_transparency(item).transparency
    return frozenset() if transparency is None else transparency.inputs


def glass_weight(item: bpy.types.Material) -> float:
    """Return how much of a material is glass to a renderer, 0 to 1; 0 if that varies over the material."""
    surface = surface_socket(item.node_tree) if item.node_tree is not None else None
    output = None if surface is None else source_of(surface, ()).output
    if output is None:
        return 0.0
    if output.node.type in _GLASS:
        return 1.0
    if output.node.type != "BSDF_PRINCIPLED":
        return 0.0
    weight, metallic = (source_of(output.node.inputs[name], ()) for name in ("Transmission Weight", "Metallic"))
    if weight.output is not None or metallic.output is not None:
        return 0.0
    shares = (min(1.0, max(0.0, float(part.input.default_value))) for part in (weight, metallic))
    glass, metal = shares
    return glass * (1.0 - metal)
