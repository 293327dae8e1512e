"""Verge, median and the ground that grass grows on."""

from __future__ import annotations

from .shading import Shade


def _gravel(shade: Shade) -> None:
    shade.vary(0.45, shade.noise(0.03, 2.0))
    shade.vary(0.30, shade.noise(0.8, 3.0))


def _turf(shade: Shade) -> None:
    shade.vary(0.45, shade.noise(0.04, 2.0))
    shade.vary(0.30, shade.noise(0.7, 3.0))
    shade.vary(0.30, shade.noise(14.0, 3.0))


def _soil(shade: Shade) -> None:
    shade.vary(0.35, shade.noise(0.05, 3.0))
    shade.vary(0.20, shade.noise(3.0, 2.0))


BUILDERS = {"verge": _gravel, "median": _turf, "grass_ground": _turf, "soil": _soil}
