"""Diagrams stored as images in the open file, and operators that show them in an image editor."""

from __future__ import annotations

import bpy
import numpy as np
from PIL import Image

from ..translations.blender import said

FIT_PICTURE = "SynthRoads Axis Fit"
"""Name of the image that shows how far an axis was missed."""


def keep_picture(name: str, picture: Image.Image) -> bpy.types.Image:
    """Store a picture as the file's image of a name, replacing its pixels if it exists; return the image."""
    drawn = np.asarray(picture.convert("RGBA"), dtype=np.float32)[::-1] / 255.0
    height, width = drawn.shape[:2]
    image = bpy.data.images.get(name)
    if image is None:
        image = bpy.data.images.new(name, width, height)
    elif tuple(image.size) != (width, height):
        image.scale(width, height)
    image.pixels.foreach_set(np.ascontiguousarray(drawn).ravel())
    image.update()
    return image


class ShowPicture:
    """Base of operators that show one of the file's images in an image editor.

    Attributes:
        picture: the image's name.
        no_picture: what is said while there is none.
    """

    picture = ""
    no_picture = ""

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether the image exists and Blender has a window; else set the tooltip to the reason."""
        reason = ""
        if bpy.app.background or context.window is None:
            reason = "Blender has no window to show it in"
        elif cls.picture not in bpy.data.images:
            reason = cls.no_picture
        if reason:
            cls.poll_message_set(said(reason))  # type: ignore[attr-defined]
        return not reason

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Show the image in an open image editor, else in a new window."""
        areas = [area for window in context.window_manager.windows for area in window.screen.areas]
        area = next((area for area in areas if area.type == "IMAGE_EDITOR"), None)
        if area is None:
            bpy.ops.wm.window_new()
            area = context.window_manager.windows[-1].screen.areas[0]
            area.type = "IMAGE_EDITOR"
        area.spaces.active.image = bpy.data.images[self.picture]
        return {"FINISHED"}
