"""SR Noise Panel: one panel of a noise barrier."""

from __future__ import annotations

import math
from dataclasses import dataclass

import bpy

from . import operations as op
from .builder import Tree, Value, node_group
from .solids import box, painted, prism, put, row_of_points

KINDS = ("aluminium", "concrete", "wood", "glass")
_CAP = 0.04  # m, height of the strip on top
_SUNK = 0.003  # m: faces that coincide have no first hit
_PANE = 0.02  # m
_RAIL = 0.07  # m, width of a glass panel's frame


@dataclass(frozen=True)
class _Relief:
    """Slats on a panel's face: cassettes, ribs or boards.

    Attributes:
        lying: whether they run along the panel; they stand otherwise.
        pitch: distance between them, m.
        share: their width as a share of the pitch.
        bevel: what either flank takes of the width, as a share.
        depth: how far they stand out, m.
        cap: whether a strip closes the panel's top.
    """

    lying: bool
    pitch: float
    share: float
    bevel: float
    depth: float
    cap: bool


_RELIEFS = {
    "aluminium": _Relief(lying=True, pitch=0.25, share=0.9, bevel=0.15, depth=0.025, cap=True),
    "concrete": _Relief(lying=False, pitch=0.2, share=0.7, bevel=0.2, depth=0.045, cap=False),
    "wood": _Relief(lying=False, pitch=0.14, share=0.82, bevel=0.02, depth=0.024, cap=True),
}


def noise_panel_group() -> bpy.types.NodeTree:
    """Return the group SR Noise Panel."""
    return node_group("SR Noise Panel", _build)


@dataclass(frozen=True)
class _Panel:
    length: Value
    height: Value
    thickness: Value
    face: Value
    frame: Value


def _build(tree: Tree) -> None:
    """A panel of a noise barrier, upright on the origin along x; its face looks to -y."""
    kind = tree.integer("Panel", 0, (0, 3), description="Kind: 0 aluminium, 1 concrete, 2 wood, 3 glass")
    panel = _Panel(
        length=tree.number("Length", 3.98, (0.1, 20.0), unit="m", description="Length"),
        height=tree.number("Height", 3.5, (0.1, 20.0), unit="m", description="Height"),
        thickness=tree.number("Thickness", 0.15, (0.02, 0.6), unit="m", description="Thickness"),
        face=tree.input("Panel Material", "Material", description="Material of the panel"),
        frame=tree.input("Frame Material", "Material", description="Material of frame and cap"),
    )
    parts = []
    for number, name in enumerate(KINDS):
        with tree.frame(f"{name.capitalize()} panel"):
            made = _slatted(tree, panel, _RELIEFS[name]) if name in _RELIEFS else _glazed(tree, panel)
            parts.append(op.only_if(kind.equals(number), made))
    tree.output("Mesh", op.realize(op.join(*parts)), description="The panel")


def _slatted(tree: Tree, panel: _Panel, relief: _Relief) -> Value:
    """Return a wall with slats on its face."""
    out = op.minimum(panel.thickness * 0.3, relief.depth)
    tall = panel.height - (_CAP if relief.cap else 0.0)
    core = box(
        tree,
        op.vector(tree, panel.length, panel.thickness - out, tall),
        op.vector(tree, 0.0, out * 0.5, tall * 0.5),
    )
    span, length = (tall, panel.length) if relief.lying else (panel.length, tall)
    count = op.rounded_up(span / relief.pitch - 0.5)
    pitch = span / count
    across = (op.index(tree) + 0.5) * pitch
    front = out - panel.thickness * 0.5 + _SUNK
    slat = prism(tree, [(-0.5, 0.0), (relief.bevel - 0.5, -1.0), (0.5 - relief.bevel, -1.0), (0.5, 0.0)])
    size = op.vector(tree, pitch * relief.share, out + _SUNK, length - 0.002)
    if relief.lying:
        start = op.vector(tree, 0.001 - length * 0.5, front, across)
        slats = put(row_of_points(tree, count), slat, start, size, op.turn(tree, y=math.pi / 2))
    else:
        start = op.vector(tree, across - panel.length * 0.5, front, 0.001)
        slats = put(row_of_points(tree, count), slat, start, size)
    parts = [painted(core, panel.face), painted(op.realize(slats), panel.face)]
    if relief.cap:
        strip = op.vector(tree, panel.length, panel.thickness, _CAP)
        parts.append(painted(box(tree, strip, op.vector(tree, 0.0, 0.0, tall + _CAP / 2)), panel.frame))
    return op.join(*parts)


def _glazed(tree: Tree, panel: _Panel) -> Value:
    """Return a pane in a frame."""
    deep, tall = panel.thickness, panel.height
    level = box(tree, op.vector(tree, panel.length, deep, _RAIL))
    upright = box(tree, op.vector(tree, _RAIL, deep, tall - 2.0 * _RAIL))
    side = panel.length * 0.5 - _RAIL / 2
    frame = [
        tree.node("GeometryNodeTransform", part, translation=op.vector(tree, x, 0.0, z)).value
        for part, x, z in (
            (level, 0.0, _RAIL / 2),
            (level, 0.0, tall - _RAIL / 2),
            (upright, side, tall * 0.5),
            (upright, -side, tall * 0.5),
        )
    ]
    inside = op.vector(tree, panel.length - 1.9 * _RAIL, op.minimum(deep * 0.6, _PANE), tall - 1.9 * _RAIL)
    pane = box(tree, inside, op.vector(tree, 0.0, 0.0, tall * 0.5))
    return op.join(painted(op.join(*frame), panel.frame), painted(pane, panel.face))
