"""The profile and cross-section of the current road, drawn in every image editor that shows no image.

Annotations are not postponed here: Blender reads the properties from them.
"""

from typing import Any

import blf
import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader

from ...base.errors import InputError
from ...jobs.tables.diagram import Diagram, picked_point, road_diagram, zoomed
from ...road.geometry import RoadGeometry
from ...road.parameters import RoadParameters
from ..fields.room import value_row
from ..translations.blender import said
from ..work.common import has_road, redraw_sidebars
from ..work.view import draw_lines
from .tables import tables

COLORS = {
    "frame": (0.55, 0.55, 0.55, 1.0),
    "grid": (0.27, 0.27, 0.27, 1.0),
    "ground": (0.55, 0.42, 0.25, 1.0),
    "tangent": (0.50, 0.50, 0.50, 1.0),
    "road": (0.95, 0.95, 0.95, 1.0),
    "point": (1.00, 0.75, 0.20, 1.0),
    "curvature": (0.35, 0.75, 1.00, 1.0),
    "left": (0.95, 0.45, 0.45, 1.0),
    "right": (0.45, 0.85, 0.50, 1.0),
    "station": (1.00, 0.35, 0.10, 1.0),
    "text": (0.90, 0.90, 0.90, 1.0),
    "faint": (0.68, 0.68, 0.68, 1.0),
}
"""Colours of lines and texts by their role, told apart also by those who don't see red and green: by place and name."""
_BACKGROUND = (0.11, 0.11, 0.11, 1.0)
_TEXT_SIZE = 11.0
_REACH = 8.0
"""Distance of the mouse from a vertical point, pixels at a resolution scale of 1, at which it is picked. Chosen."""
_ZOOM = 1.25
"""Factor of the shown length for a turn of the wheel. Chosen."""
_KEYS = (
    ("synthroads.zoom_profile", "WHEELUPMOUSE", 1.0 / _ZOOM),
    ("synthroads.zoom_profile", "WHEELDOWNMOUSE", _ZOOM),
    ("synthroads.pick_in_profile", "LEFTMOUSE", None),
)
"""Operators on the profile, their event of the mouse, and a zoom's factor."""


class ProfileView:
    """The drawing of the profile, and the diagram that was drawn last."""

    def __init__(self) -> None:
        self._handler: object | None = None
        self._key: tuple[Any, ...] = ()
        self._geometry: RoadGeometry | None = None
        self._parameters: RoadParameters | None = None
        self._diagram: Diagram | None = None
        self._shown: tuple[float, float] | None = None

    @property
    def is_shown(self) -> bool:
        """Return whether the profile is drawn."""
        return self._handler is not None

    def show(self) -> None:
        """Begin to draw."""
        if self._handler is None:
            self._handler = bpy.types.SpaceImageEditor.draw_handler_add(self._draw, (), "WINDOW", "POST_PIXEL")

    def hide(self) -> None:
        """End drawing."""
        if self._handler is not None:
            bpy.types.SpaceImageEditor.draw_handler_remove(self._handler, "WINDOW")
            self._handler = None
        self._key, self._geometry, self._parameters, self._diagram = (), None, None, None
        self._shown = None

    def diagram(self, scene: bpy.types.Scene, width: float, height: float, scale: float) -> Diagram | None:
        """Return the diagram of the current road for a view of a size (pixels); None without a road."""
        if tables.read(scene) is None or tables.parameters is None:
            return None
        if tables.parameters is not self._parameters:
            self._parameters, self._key = tables.parameters, ()
            try:
                self._geometry = RoadGeometry(tables.parameters)
            except InputError:
                self._geometry = None
        if self._geometry is None:
            return None
        if self._shown is not None and self._shown[1] > self._geometry.length:  # the road is shorter now
            self._shown = None
        key = (scene.synthroads_alignment.station, width, height, scale, self._shown)
        if key != self._key:
            self._key, self._diagram = key, road_diagram(self._geometry, *key)
        return self._diagram

    def zoom(self, x: float, factor: float) -> None:
        """Show a shorter or longer part of the road; what is at x pixels of the view stays there."""
        if self._diagram is None or self._geometry is None:
            return
        shown = (self._diagram.first, self._diagram.last)
        self._shown = zoomed(shown, self._geometry.length, self._diagram.station(x), factor)

    def pick(self, scene: bpy.types.Scene, x: float, y: float, reach: float) -> bool:
        """Make the vertical point at pixels of the view the active row, or look at the station there.

        Returns:
            whether there is a diagram.
        """
        if self._diagram is None:
            return False
        number = picked_point(self._diagram, x, y, reach)
        if number is None:
            scene.synthroads_alignment.station = self._diagram.station(x)
        else:
            scene.synthroads_alignment.active_vertical = number
        return True

    def _draw(self) -> None:
        """Draw the diagram into the image editor that is being drawn."""
        context = bpy.context
        space: Any = context.space_data
        region = context.region
        if space is None or getattr(space, "image", None) is not None or region is None:
            return
        scale = context.preferences.system.ui_scale
        diagram = self.diagram(context.scene, region.width, region.height, scale)
        _fill(region.width, region.height)
        if diagram is None:
            _write("Build a road to see its profile", 20.0 * scale, 20.0 * scale, COLORS["text"], scale)
            return
        gpu.state.blend_set("ALPHA")
        for line in diagram.lines:
            points = np.column_stack([line.points, np.zeros(len(line.points))])
            corners = np.repeat(points, 2, axis=0)[1:-1]
            draw_lines([tuple(corner) for corner in corners.tolist()], COLORS[line.role], line.width * scale)
        for text in diagram.texts:
            _write(text.text, text.x, text.y, COLORS[text.role], scale, text.align)
        gpu.state.blend_set("NONE")


profile_view = ProfileView()


def _fill(width: float, height: float) -> None:
    """Fill the region with the background."""
    shader = gpu.shader.from_builtin("UNIFORM_COLOR")
    corners = [(0.0, 0.0), (width, 0.0), (0.0, height), (width, height)]
    batch = batch_for_shader(shader, "TRI_STRIP", {"pos": corners})
    shader.uniform_float("color", _BACKGROUND)
    batch.draw(shader)


def _write(text: str, x: float, y: float, color: tuple[float, ...], scale: float, align: str = "left") -> None:
    """Write a text at a place, pixels."""
    blf.size(0, _TEXT_SIZE * scale)
    width = blf.dimensions(0, text)[0]
    blf.position(0, x - {"left": 0.0, "center": 0.5, "right": 1.0}[align] * width, y, 0.0)
    blf.color(0, *color)
    blf.draw(0, text)


def redraw_profiles() -> None:
    """Tag all image editors for redraw."""
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "IMAGE_EDITOR":
                area.tag_redraw()


class SYNTHROADS_OT_show_profile(bpy.types.Operator):
    """Show the profile, curvature, crossfall and a cross-section of the road in an image editor without an image, in a new window if there is none; press again to hide them"""  # noqa: E501 (a tooltip is one line)

    bl_idname = "synthroads.show_profile"
    bl_label = "Show Profile"
    bl_options = {"REGISTER"}  # noqa: RUF012 (Blender reads a plain set)

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether the scene has a road and Blender a window."""
        if bpy.app.background or context.window is None:
            cls.poll_message_set(said("Blender has no window to show it in"))
            return False
        return has_road(cls, context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Begin to draw the profile, or end it."""
        if profile_view.is_shown and _free_area(context) is not None:
            profile_view.hide()
            redraw_profiles()
            return {"FINISHED"}
        profile_view.show()
        if _free_area(context) is None:
            bpy.ops.wm.window_new()
            area = context.window_manager.windows[-1].screen.areas[0]
            area.type = "IMAGE_EDITOR"
            area.spaces.active.image = None
        redraw_profiles()
        return {"FINISHED"}


class _InProfile:
    """Base of operators on the drawn profile: for others the mouse stays Blender's own."""

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether the mouse is in an image editor that shows the profile."""
        space: Any = context.space_data
        in_editor = context.area is not None and context.area.type == "IMAGE_EDITOR"
        if not (profile_view.is_shown and in_editor and space.image is None):
            operator: Any = cls
            operator.poll_message_set(said("Press Show Profile, and point at it"))
            return False
        return True


class SYNTHROADS_OT_zoom_profile(_InProfile, bpy.types.Operator):
    """Show a shorter or longer part of the road in the profile, about the station at the mouse"""

    bl_idname = "synthroads.zoom_profile"
    bl_label = "Zoom Profile"

    factor: bpy.props.FloatProperty(
        name="Factor", description="Factor of the shown length, e.g. 0.8 to zoom in", default=0.8, min=0.01, max=100.0
    )

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Zoom about the station at the mouse."""
        profile_view.zoom(float(event.mouse_region_x), self.factor)
        redraw_profiles()
        return {"FINISHED"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Zoom about the middle of the view."""
        profile_view.zoom(context.region.width / 2.0 if context.region else 0.0, self.factor)
        redraw_profiles()
        return {"FINISHED"}


class SYNTHROADS_OT_pick_in_profile(_InProfile, bpy.types.Operator):
    """Make the vertical point at the mouse the active row of its table; elsewhere show the cross-section there"""

    bl_idname = "synthroads.pick_in_profile"
    bl_label = "Pick in Profile"
    bl_options = {"UNDO"}  # noqa: RUF012 (Blender reads a plain set)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Look for a vertical point at the mouse."""
        reach = _REACH * context.preferences.system.ui_scale
        place = float(event.mouse_region_x), float(event.mouse_region_y)
        if not profile_view.pick(context.scene, *place, reach):
            return {"PASS_THROUGH"}
        redraw_profiles()
        redraw_sidebars(context)
        return {"FINISHED"}


def _free_area(context: bpy.types.Context) -> bpy.types.Area | None:
    """Return an image editor that shows no image; None if there is none."""
    areas = [area for window in context.window_manager.windows for area in window.screen.areas]
    return next((a for a in areas if a.type == "IMAGE_EDITOR" and a.spaces.active.image is None), None)


def draw_station(layout: bpy.types.UILayout, scene: bpy.types.Scene) -> None:
    """Draw the station of the cross-section while the profile is shown."""
    if profile_view.is_shown:
        value_row(layout, "Cross-section at").prop(scene.synthroads_alignment, "station", text="")


_keys: list[tuple[bpy.types.KeyMap, bpy.types.KeyMapItem]] = []


def register() -> None:
    """Bind the wheel and the left button in image editors; where no profile is drawn they stay Blender's own."""
    configuration = bpy.context.window_manager.keyconfigs.addon
    if configuration is None:  # without a window
        return
    keymap = configuration.keymaps.new(name="Image", space_type="IMAGE_EDITOR")
    for operator, event, factor in _KEYS:
        item = keymap.keymap_items.new(operator, event, "PRESS")
        if factor is not None:
            item.properties.factor = factor
        _keys.append((keymap, item))


def unregister() -> None:
    """End drawing, and free wheel and button."""
    profile_view.hide()
    while _keys:
        keymap, item = _keys.pop()
        keymap.keymap_items.remove(item)
