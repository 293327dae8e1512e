"""The light that a material lets straight through at each place: see `scanning.colour.transparency`.

A beam passes as a camera's view does: by a Principled BSDF's alpha, a Transparent BSDF, and what mixes them. What is
clear glass to a renderer lets as much through as the table's glass. Colours tint what passes.
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
"""Share of light (N,) that goes through, by what is read at the places."""

_GLASS = {"BSDF_GLASS": "Color", "BSDF_REFRACTION": "Color"}
"""Shaders of glass, by the input of their colour."""


@dataclass(frozen=True)
class ReadTransparency:
    """Transparency of a material, as far as it can be worked out.

    Attributes:
        transparency: None where it is solid everywhere, or taken for it.
        obstacle: name of a node that can't be evaluated, so that the material is taken for solid; empty without.
        missing: images that can't be shown.
    """

    transparency: Transparency | None = None
    obstacle: str = ""
    missing: tuple[bpy.types.Image | None, ...] = ()


def read_transparency(item: bpy.types.Material) -> ReadTransparency:
    """Return what a material's nodes say of the light that goes through; nothing of one of the table."""
    if item.node_tree is None or PROPERTY in item:
        return ReadTransparency()
    surface = surface_socket(item.node_tree)
    if surface is None:
        return ReadTransparency()
    reader = FieldReader()
    try:
        share = _of_entry(reader, surface, ())
    except UnevaluatedError as obstacle:
        return ReadTransparency(None, str(obstacle), tuple(reader.missing))
    if share is None or (not reader.inputs and not share({}).any()):
        return ReadTransparency(None, "", tuple(reader.missing))
    return ReadTransparency(Transparency(frozenset(reader.inputs), share), "", tuple(reader.missing))


def _of_entry(reader: FieldReader, entry: bpy.types.NodeSocket, path: Path) -> Share | None:
    """Return the light that goes through the shader in an input socket; None if none does anywhere."""
    source = source_of(entry, path)
    if source.output is None:
        return None  # nothing is linked: black, and solid
    node, path = source.output.node, source.path
    if node.type == "MIX_SHADER":
        return _mixed(reader, node, path)
    if node.type == "ADD_SHADER":
        return _added(reader, node, path)
    if node.type == "BSDF_TRANSPARENT":
        return _tint(reader.entry(node.inputs["Color"], path))
    if node.type == "BSDF_PRINCIPLED":
        return _principled(reader, node, path)
    if node.type in _GLASS:
        return _scaled(_tint(reader.entry(node.inputs[_GLASS[node.type]], path)), _glass())
    return None


def _mixed(reader: FieldReader, node: bpy.types.Node, path: Path) -> Share | None:
    """Return the light through two mixed shaders; where both are solid, the factor may be anything."""
    first, second = (_of_entry(reader, entry, path) for entry in node.inputs[1:3])
    if first is None and second is None:
        return None
    factor = reader.number(node, 0, path)

    def share(values: Values) -> Float:
        second_share = np.clip(factor(values), 0.0, 1.0)
        result = np.zeros(1) if first is None else (1.0 - second_share) * first(values)
        return result if second is None else result + second_share * second(values)

    return share


def _added(reader: FieldReader, node: bpy.types.Node, path: Path) -> Share | None:
    """Return the light through two shaders added: half of each, but of a glow, which stops nothing, none."""
    parts = []
    for entry in node.inputs[-2:]:
        output = source_of(entry, path).output
        glows = output is None or output.node.type == "EMISSION"
        parts.append((glows, None if glows else _of_entry(reader, entry, path)))
    shares = [share for glows, share in parts if not glows]
    terms = [share for share in shares if share is not None]
    if not terms:
        return None
    return lambda values: np.asarray(sum(share(values) for share in terms) / len(shares))


def _principled(reader: FieldReader, node: bpy.types.Node, path: Path) -> Share | None:
    alpha = reader.number(node, "Alpha", path) if _is_set(node.inputs["Alpha"], path, 1.0) else None
    glass: Share | None = None
    if _is_set(node.inputs["Transmission Weight"], path, 0.0):
        names = ("Transmission Weight", "Metallic")
        weight, metallic = (reader.number(node, name, path) for name in names)
        tint, through = _tint(reader.entry(node.inputs["Base Color"], path)), _glass()

        def through_glass(values: Values) -> Float:
            metal = np.clip(metallic(values), 0.0, 1.0)
            return np.asarray(through * np.clip(weight(values), 0.0, 1.0) * (1.0 - metal) * tint(values))

        glass = through_glass
    if alpha is None:
        return glass

    def share(values: Values) -> Float:
        solid = np.clip(alpha(values), 0.0, 1.0)
        return 1.0 - solid if glass is None else 1.0 - solid + solid * glass(values)

    return share


def _is_set(entry: bpy.types.NodeSocket, path: Path, usual: float) -> bool:
    """Return whether an input may have another value than the usual one."""
    source = source_of(entry, path)
    return source.output is not None or float(np.mean(source.entry.default_value)) != usual


def _tint(color: Field) -> Share:
    return lambda values: np.asarray(np.clip(color(values)[:, :3], 0.0, 1.0).mean(axis=1))


def _scaled(share: Share, factor: float) -> Share:
    return lambda values: factor * share(values)


def _glass() -> float:
    return materials()["glass"].transmission


def asked_by_transparency(item: bpy.types.Material) -> frozenset[SurfaceInput]:
    """Return what a material's transparency asks of the places."""
    transparency = read_transparency(item).transparency
    return frozenset() if transparency is None else transparency.inputs


def glass_weight(item: bpy.types.Material) -> float:
    """Return how much of a material is glass to a renderer, 0 to 1, where that is one number all over it."""
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
    shares = (min(1.0, max(0.0, float(part.entry.default_value))) for part in (weight, metallic))
    glass, metal = shares
    return glass * (1.0 - metal)
