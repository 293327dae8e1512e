"""Icons of one colour, for legends."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import bpy.utils.previews

_SIZE = 32
CLASSES = ()
_icons: Any = None


def swatch(color: Sequence[int]) -> int:
    """Return the icon of a colour (red, green, blue; sRGB, 0 to 255); made when it is asked for first."""
    name = "#" + bytes(int(value) for value in color).hex()
    if name not in _icons:
        icon = _icons.new(name)
        icon.icon_size = (_SIZE, _SIZE)
        icon.icon_pixels_float = [*(value / 255.0 for value in color), 1.0] * _SIZE**2
    return int(_icons[name].icon_id)


def register() -> None:
    """Make room for the icons."""
    global _icons
    _icons = bpy.utils.previews.new()


def unregister() -> None:
    """Free the icons."""
    bpy.utils.previews.remove(_icons)
