"""Grass, leaves and bark."""

from __future__ import annotations

from collections.abc import Callable

from .shading import Shade

_DRY = (0.55, 0.18, 0.25)
"""How much red, green and blue change between fresh and dry grass, as shares of the mean."""
_AUTUMN = (0.35, 0.12, 0.0)
"""The same between a dark and a light tree's leaves."""


def _grass(shade: Shade) -> None:
    shade.vary(0.30, shade.noise(0.15, 1.0))
    # Features about as large as the tufts are apart, and patches.
    shade.vary(_DRY, shade.noise(0.9, 0.0))
    shade.vary(0.30, shade.noise(9.0, 2.0))


def _leaves(shade: Shade) -> None:
    shade.vary(0.35, shade.noise(0.3, 1.0))
    shade.vary(_AUTUMN, shade.noise(8.0, 1.0))
    shade.vary(0.25, shade.noise(25.0, 1.0))


def _bark(shade: Shade) -> None:
    shade.vary(0.35, shade.noise(0.08, 3.0, (1.0, 1.0, 0.25)))


def _birch_bark(shade: Shade) -> None:
    """White, with dark scars across."""
    shade.vary(0.15, shade.noise(0.2, 2.0))
    scars = shade.noise(0.12, 1.0, (0.35, 0.35, 1.6))
    dark = shade.tree.node("ShaderNodeMapRange", scars, 0.25, 0.4, 1.12, 0.25).value
    shade.scale(dark)


_SPECIES = ("maple", "birch", "poplar", "spruce", "pine", "hawthorn", "hazel", "blackthorn")

BUILDERS: dict[str, Callable[[Shade], None]] = {
    **dict.fromkeys(("grass", "meadow", "ryegrass", "reed"), _grass),
    **dict.fromkeys(("leaves", *(f"{species}_leaves" for species in _SPECIES)), _leaves),
    **dict.fromkeys(("bark", *(f"{species}_bark" for species in _SPECIES)), _bark),
    "birch_bark": _birch_bark,
}
