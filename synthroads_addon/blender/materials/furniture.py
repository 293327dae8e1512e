"""Steel and plastics."""

from __future__ import annotations

from .shading import Shade


def _make_galvanised(shade: Shade) -> None:
    shade.vary(0.12, shade.noise(0.08, 3.0))
    shade.vary(0.10, shade.noise(3.0, 2.0))


BUILDERS = {"galvanised_steel": _make_galvanised}
