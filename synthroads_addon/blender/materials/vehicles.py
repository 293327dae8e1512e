"""Car paint and covers of trucks, in the vehicle's colour."""

from __future__ import annotations

from collections.abc import Callable

from ..nodes.builder import Value
from .shading import Shade

COLOR = "vehicle_color"
"""Attribute of vehicles that the paint's base colour is read from."""
_COVER_TINT = 0.35
"""How much of the vehicle's colour its cover has; the rest is the table's mean."""


def _relative(shade: Shade) -> Value:
    """Return the vehicle's colour as shares of the table's mean colour."""
    color = shade.tree.node("ShaderNodeAttribute", attribute_name=COLOR)["Vector"]
    return shade.tree.node("ShaderNodeVectorMath", color, shade.mean.base_color, operation="DIVIDE").value


def _car_paint(shade: Shade) -> None:
    shade.scale(_relative(shade))


def _tarpaulin(shade: Shade) -> None:
    shade.scale(_relative(shade) * _COVER_TINT + (1.0 - _COVER_TINT,) * 3)
    shade.vary(0.06, shade.noise(1.5, 2.0))


BUILDERS: dict[str, Callable[[Shade], None]] = {"car_paint": _car_paint, "tarpaulin": _tarpaulin}
