"""The typeface of the signs in the open file: outlines of our own, after DIN 1451 Mittelschrift."""

from __future__ import annotations

from functools import cache

import bpy

from ...nodes.builder import TYPEFACE, files_digest

CAPITAL = 7.0 / 10.6
"""Height of a capital letter at size 1: Blender makes the whole of a typeface, from descenders to dots, 1 high."""
_KEY = "synthroads_typeface"
"""Custom property of the typeface: hash of its file."""


def sign_typeface() -> bpy.types.VectorFont:
    """Return the typeface of the signs, packed into the open file; read if the file lacks it."""
    for font in bpy.data.fonts:
        if font.get(_KEY) == _digest() and font.packed_file is not None and font.library is None:
            return font
    font = bpy.data.fonts.load(str(TYPEFACE))
    font[_KEY] = _digest()
    font.pack()
    # The open file contains it now, and should name no folder of this machine. Blender would expand a bare name to a
    # path when the file is saved.
    font.filepath = f"//{TYPEFACE.name}"
    return font


@cache
def _digest() -> str:
    """Return a digest of the typeface's file; cached."""
    return files_digest(TYPEFACE).hex()[:16]
