"""Barriers, gantries, bridges and what stands in construction zones."""

from __future__ import annotations

from ..nodes import operations as op
from ..nodes.builder import Value
from .shading import Shade

ELEMENT = 6.0
"""Length of a concrete barrier between two joints, m."""
_JOINT = 0.02  # m
_SHADE = 0.5
"""Mean base colour of a gantry's steel: what its attribute ``shade`` is a share of."""


def _attribute(shade: Shade, name: str) -> Value:
    return op.component(shade.tree.node("ShaderNodeAttribute", attribute_name=name)["Vector"], "X")


def _barrier_concrete(shade: Shade) -> None:
    """Weathered concrete with dark joints at whole elements, by the attribute ``station``."""
    shade.vary(0.10, shade.noise(0.012, 1.0))
    shade.vary(0.16, shade.noise(0.9, 4.0))
    shade.vary(0.12, shade.noise(0.25, 2.0, (1.0, 1.0, 0.15)))
    beside = op.unary("ABSOLUTE", _attribute(shade, "station") % ELEMENT - ELEMENT / 2)
    joint = shade.tree.node("ShaderNodeMath", beside, _JOINT / 2, operation="LESS_THAN").value
    shade.scale((1.0 - joint * 0.8) / (1.0 - 0.8 * _JOINT / ELEMENT))


def _bridge_concrete(shade: Shade) -> None:
    """Board-marked concrete with stains that run down."""
    shade.vary(0.08, shade.noise(0.012, 1.0))
    shade.vary(0.14, shade.noise(1.6, 4.0))
    shade.vary(0.14, shade.noise(0.5, 3.0, (1.0, 1.0, 0.12)))


def _bay(shade: Shade) -> None:
    """Panels that differ a little, by the attribute ``bay``."""
    number = shade.tree.node("ShaderNodeTexWhiteNoise", w=_attribute(shade, "bay"), noise_dimensions="1D")["Value"]
    shade.vary(0.08, number * 2.0 - 1.0)


def _noise_aluminium(shade: Shade) -> None:
    _bay(shade)
    shade.vary(0.08, shade.noise(1.2, 3.0, (1.0, 1.0, 0.3)))


def _noise_concrete(shade: Shade) -> None:
    _bay(shade)
    shade.vary(0.16, shade.noise(0.02, 2.0))
    shade.vary(0.14, shade.noise(1.0, 4.0, (1.0, 1.0, 0.3)))


def _noise_wood(shade: Shade) -> None:
    _bay(shade)
    shade.vary(0.30, shade.noise(0.12, 3.0, (1.0, 1.0, 0.06)))
    shade.vary(0.18, shade.noise(0.02, 2.0, (1.0, 1.0, 0.05)))


def _acrylic_glass(shade: Shade) -> None:
    shade.transparency = 0.8


def _gantry_steel(shade: Shade) -> None:
    """Steel as bright as its faces' attribute ``shade`` says."""
    shade.scale(_attribute(shade, "shade") / _SHADE)
    shade.vary(0.06, shade.noise(0.1, 3.0))
    shade.vary(0.06, shade.noise(2.5, 2.0, (1.0, 1.0, 0.3)))


def _make_worn(shade: Shade) -> None:
    shade.vary(0.10, shade.noise(0.05, 3.0))


BUILDERS = {
    "barrier_concrete": _barrier_concrete,
    "bridge_concrete": _bridge_concrete,
    "noise_aluminium": _noise_aluminium,
    "noise_concrete": _noise_concrete,
    "noise_wood": _noise_wood,
    "acrylic_glass": _acrylic_glass,
    "gantry_steel": _gantry_steel,
    "plastic_red": _make_worn,
    "rubber": _make_worn,
}
