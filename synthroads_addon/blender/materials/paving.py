"""Asphalt, concrete and paint."""

from __future__ import annotations

from .shading import Shade


def _asphalt(shade: Shade) -> None:
    shade.vary(0.25, shade.noise(0.012, 1.0))
    shade.vary(0.12, shade.noise(0.6, 4.0))
    shade.vary(0.10, shade.noise(25.0, 2.0))


def _concrete(shade: Shade) -> None:
    shade.vary(0.10, shade.noise(0.01, 1.0))
    shade.vary(0.12, shade.noise(1.5, 4.0))


def _paint(shade: Shade) -> None:
    shade.vary(0.18, shade.noise(0.05, 3.0))


BUILDERS = {"asphalt": _asphalt, "concrete": _concrete, "paint_white": _paint}
