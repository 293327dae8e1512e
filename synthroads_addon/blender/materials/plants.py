"""Grass, leaves and bark."""

from __future__ import annotations

from .shading import Shade


def _grass(shade: Shade) -> None:
    shade.vary(0.35, shade.noise(0.25, 1.0))
    shade.vary(0.35, shade.noise(9.0, 2.0))


def _leaves(shade: Shade) -> None:
    shade.vary(0.40, shade.noise(0.3, 1.0))
    shade.vary(0.40, shade.noise(12.0, 1.0))


def _bark(shade: Shade) -> None:
    shade.vary(0.35, shade.noise(0.08, 3.0, (1.0, 1.0, 0.25)))


BUILDERS = {"grass": _grass, "leaves": _leaves, "bark": _bark}
