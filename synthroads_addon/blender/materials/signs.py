"""Sheeting, plates, housings and glass of signs and equipment."""

from __future__ import annotations

from .shading import Shade


def _sheeting(shade: Shade) -> None:
    """Film that is a little dirty in patches and in streaks that run down."""
    shade.vary(0.05, shade.noise(0.6, 3.0))
    shade.vary(0.05, shade.noise(0.15, 2.0, (1.0, 1.0, 0.15)))


def _housing(shade: Shade) -> None:
    """Weathered plastic or paint."""
    shade.vary(0.08, shade.noise(0.5, 3.0, (1.0, 1.0, 0.3)))
    shade.vary(0.05, shade.noise(0.04, 2.0))


BUILDERS = {
    **dict.fromkeys((f"sheeting_{color}" for color in ("white", "red", "blue", "yellow", "grey")), _sheeting),
    "plastic_orange": _housing,
    "cabinet_grey": _housing,
}
