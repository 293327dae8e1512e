"""The tool Draw Road: points of a tangent polygon clicked on the ground, its axis shown as it is drawn.

What the mouse and keys do is in `DrawingState`, which knows nothing of windows; the operator passes events on to it.
Annotations are not postponed here: Blender reads the properties from them.
"""

from typing import Any, Literal

import bpy
import numpy as np
from bpy_extras.view3d_utils import location_3d_to_region_2d, region_2d_to_origin_3d, region_2d_to_vector_3d
from mathutils import Vector

from ...base.arrays import Float
from ...blender.model.store import find_road
from ..translations.blender import said
from ..work.common import is_free, redraw_sidebars
from ..work.view import DRAWING_WIDTH, look_down, redraw_views
from .along_curve import DRAW_ROAD
from .overlay import SketchView
from .sketch import Handle, Sketch, radius_text, shown_elements, state_text

_NEAR = 12.0
"""Distance (pixels at a resolution scale of 1) from which on the mouse takes hold of a handle."""
_LEVEL_VIEW = 1e-3
"""Sine of the angle between view and ground below which nothing is clicked. Chosen: a pixel is metres then."""
_KEYS = (
    ("MOUSE_LMB", "Add Point, Drag Handle"),
    ("EVENT_CTRL", "Snap to 15° and 10 m"),
    ("MOUSE_MMB_SCROLL", "On a Handle: Radius"),
    ("EVENT_BACKSPACE", "Remove Last Point"),
    ("EVENT_RETURN", "Build Road"),
    ("EVENT_ESC", "Cancel"),
)
"""Keys and what they do, as the status bar shows them."""
_WHEEL = {"WHEELUPMOUSE": 1, "WHEELDOWNMOUSE": -1}
"""Events of the mouse wheel and the steps that they are."""
Answer = Literal["on", "pass", "build", "cancel"]
"""State of a drawing after an event: it goes on, passes the event on to Blender, builds the road, or ends."""


class DrawingState:
    """A drawing in progress: the sketch, and what the mouse does with it.

    Attributes:
        sketch: the tangent polygon.
        view: what is shown of it.
        held: handle that is dragged; None if none is.
    """

    def __init__(self, sketch: Sketch) -> None:
        self.sketch, self.view = sketch, SketchView()
        self.held: Handle | None = None
        self.view.height = sketch.height

    def press(self, ground: Float | None, snaps: bool) -> None:
        """Take hold of the handle under the mouse, or add a point at the place (2,) on the ground."""
        if self.view.hovered is not None:
            self.held = self.view.hovered
        elif ground is not None:
            self.sketch.add(ground, snaps)

    def move(self, ground: Float | None, snaps: bool, hovered: Handle | None) -> None:
        """Drag what is held to a place (2,) on the ground; else show the axis with one more point there.

        Args:
            ground: None where the mouse isn't over the ground.
            snaps: whether to snap.
            hovered: the handle under the mouse.
        """
        if self.held is not None and ground is not None:
            if self.held.kind == "radius":
                self.sketch.drag_radius(self.held.number, ground, snaps)
            else:
                self.sketch.move(self.held.number, ground)
        self.view.hovered = self.held or hovered
        further = None if ground is None or self.view.hovered or not self.sketch.points else ground
        self.refresh(self.sketch.snapped(further) if snaps and further is not None else further)

    def release(self) -> None:
        """Let go of what is held."""
        self.held = None

    def wheel(self, steps: int) -> bool:
        """Change the radius of the handle under the mouse; return whether there is one."""
        if self.view.hovered is None:
            return False
        self.sketch.turn_wheel(self.view.hovered.number, steps)
        self.refresh(None)
        return True

    def back(self) -> None:
        """Take the last point away."""
        self.sketch.remove_last()
        self.view.hovered = self.held = None
        self.refresh(None)

    def refresh(self, further: Float | None) -> None:
        """Show the axis of the points, and of one more (2,) if it can be taken."""
        view, sketch = self.view, self.sketch
        drawn = sketch.drawn(further)
        view.is_refused = further is not None and drawn is None
        if view.is_refused:
            view.elements, view.labels = [], []
            view.text = refusal_of(sketch, further)
        axis = sketch.axis(None if view.is_refused else further)
        if axis is not None:
            view.elements = shown_elements(axis)
            corners = [corner for corner in axis.corners if corner.radius]
            middles = [axis.alignment.position((corner.start + corner.end) / 2.0).tolist() for corner in corners]
            view.labels = [((x, y), radius_text(corner)) for (x, y), corner in zip(middles, corners, strict=True)]
        else:
            view.elements, view.labels = [], []
        if not view.is_refused:
            view.text = sketch.refusal or state_text(drawn)
        points = [*sketch.points, *([] if further is None else [(float(further[0]), float(further[1]))])]
        view.tangents = [(*point, sketch.height) for point in points]
        view.handles = sketch.handles()


def refusal_of(sketch: Sketch, point: Float | None) -> str:
    """Return why a point (2,) can't be added to a sketch, which stays as it is."""
    if point is None:
        return ""
    trial = Sketch(sketch.scenario, list(sketch.points), list(sketch.radii), sketch.height)
    trial.add(point)
    return trial.refusal


def ground_point(
    region: bpy.types.Region, view: bpy.types.RegionView3D, mouse: tuple[float, float], height: float
) -> Float | None:
    """Return the place (2,) of the scene at a height (m) that the mouse is over; None where the view looks past it.

    Args:
        region: of a 3D view.
        view: how it looks.
        mouse: in the region, pixels.
        height: of the plane that is clicked, m.
    """
    origin = region_2d_to_origin_3d(region, view, mouse)
    ahead = region_2d_to_vector_3d(region, view, mouse)
    if abs(ahead.z) < _LEVEL_VIEW:
        return None
    distance = (height - origin.z) / ahead.z
    if distance <= 0.0 and view.is_perspective:
        return None
    place = origin + distance * ahead
    return np.array([place.x, place.y], dtype=np.float64)


class SYNTHROADS_OT_draw_road(bpy.types.Operator):
    """Draw a road: click the points at which its straight tangents meet, on the ground (best in top view, Numpad 7). Lines, clothoids and arcs are shown as they will be built. Enter or the right mouse button builds the road"""  # noqa: E501 (a tooltip is one line)

    bl_idname = DRAW_ROAD
    bl_label = "Draw Road"

    beside: bpy.props.BoolProperty(
        name="One More",
        description="Add a road to the scene instead of replacing the shown one",
        default=True,
    )

    _state: DrawingState | None = None

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether nothing else is at work."""
        return is_free(cls, context)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Begin to draw; a click of the tool is the first point."""
        if bpy.app.background or not isinstance(context.space_data, bpy.types.SpaceView3D):
            self.report({"ERROR"}, said("Draw Road needs a 3D view: move the mouse over one and press F3, Draw Road"))
            return {"CANCELLED"}
        if _in_progress:
            return self._again(context, event)
        sketch = Sketch(context.scene.synthroads.scenario().road, height=float(context.scene.cursor.location.z))
        is_click = event.type == "LEFTMOUSE" and event.value == "PRESS"  # of the tool, whose view the user has chosen
        if not is_click and find_road(context.scene) is None:
            look_down(context.space_data, context.scene.cursor.location, DRAWING_WIDTH)
        state = self._state = DrawingState(sketch)
        _in_progress.append(state)
        state.view.show()
        context.window_manager.modal_handler_add(self)
        context.workspace.status_text_set(draw_keys)
        context.window.cursor_modal_set("CROSSHAIR")
        if event.type == "LEFTMOUSE":
            self._handle(context, event)
        return {"RUNNING_MODAL"}

    def _again(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Take a click that the drawing in progress passed on, and that Blender gave to the tool: it was on the view.

        The sidebar lies over the view and is transparent where it has no panels, which Python can't see.
        """
        if event.type != "LEFTMOUSE":
            self.report({"WARNING"}, said("A road is being drawn: Enter builds it, Esc cancels"))
            return {"CANCELLED"}
        region, mouse = mouse_in_view(context.area, event)
        click(_in_progress[0], region, context.space_data.region_3d, mouse, event.ctrl)
        redraw_views(context)
        return {"CANCELLED"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Refuse: without a mouse there is nothing to draw with."""
        self.report({"ERROR"}, said("Draw Road needs the mouse in a 3D view; scripts use road_from_curve"))
        return {"CANCELLED"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Pass an event on to the drawing."""
        answer = self._handle(context, event)
        redraw_views(context)
        if answer == "pass":
            return {"PASS_THROUGH"}
        if answer == "on":
            return {"RUNNING_MODAL"}
        state = self._state
        assert state
        self._leave(context)
        if answer == "cancel":
            return {"CANCELLED"}
        return self._build(context, state.sketch)

    def cancel(self, context: bpy.types.Context) -> None:
        """End the drawing when Blender does, as another file is opened."""
        self._leave(context)

    def _handle(self, context: bpy.types.Context, event: bpy.types.Event) -> Answer:
        state = self._state
        assert state
        region, mouse = mouse_in_view(context.area, event)
        if event.value == "PRESS" and event.type in ("RET", "NUMPAD_ENTER", "RIGHTMOUSE"):
            return "build"
        if event.value == "PRESS" and event.type == "ESC":
            return "cancel"
        if event.value == "PRESS" and event.type == "BACK_SPACE":
            state.back()
            return "on"
        if event.type not in ("LEFTMOUSE", "MOUSEMOVE", "LEFT_CTRL", "RIGHT_CTRL", *_WHEEL):
            return "pass"
        is_click = event.type == "LEFTMOUSE" and event.value == "PRESS"
        if (is_click or event.type in _WHEEL) and not is_over_view(context.area, event.mouse_x, event.mouse_y):
            return "pass"
        if event.type in _WHEEL:
            return "on" if state.wheel(_WHEEL[event.type]) else "pass"
        view = context.space_data.region_3d
        if is_click:
            click(state, region, view, mouse, event.ctrl)
            return "on"
        if event.type == "LEFTMOUSE" and event.value == "RELEASE":
            state.release()
        ground = ground_point(region, view, mouse, state.sketch.height)
        state.move(ground, event.ctrl, nearest_handle(region, view, state, mouse))
        return "on"

    def _build(self, context: bpy.types.Context, sketch: Sketch) -> set[str]:
        if len(sketch.points) < 2:
            self.report({"WARNING"}, said("No road was drawn: two points or more are needed"))
            return {"CANCELLED"}
        bpy.ops.synthroads.road_from_curve("INVOKE_DEFAULT", True, beside=self.beside, polygon=sketch.to_text())
        return {"FINISHED"}

    def _leave(self, context: bpy.types.Context) -> None:
        if self._state is None:
            return
        self._state.view.hide()
        _in_progress.remove(self._state)
        self._state = None
        context.workspace.status_text_set(None)
        context.window.cursor_modal_restore()
        redraw_views(context)
        redraw_sidebars(context)


_in_progress: list[DrawingState] = []
"""The drawing in progress, if there is one."""


def mouse_in_view(area: bpy.types.Area, event: bpy.types.Event) -> tuple[bpy.types.Region, tuple[float, float]]:
    """Return the region of an area's view, and where the mouse is in it, pixels."""
    region = next(part for part in area.regions if part.type == "WINDOW")
    return region, (float(event.mouse_x - region.x), float(event.mouse_y - region.y))


def click(
    state: DrawingState,
    region: bpy.types.Region,
    view: bpy.types.RegionView3D,
    mouse: tuple[float, float],
    snaps: bool,
) -> None:
    """Have a drawing take a click: hold of the handle there, or one more point."""
    state.view.hovered = nearest_handle(region, view, state, mouse)
    ground = ground_point(region, view, mouse, state.sketch.height)
    state.press(ground, snaps)
    state.move(ground, snaps, nearest_handle(region, view, state, mouse))


def is_over_view(area: bpy.types.Area, x: int, y: int) -> bool:
    """Return whether a place of the window (pixels) is over an area's view, and over no header or sidebar on it."""
    over = {
        region.type
        for region in area.regions
        if region.x <= x < region.x + region.width and region.y <= y < region.y + region.height
    }
    return over == {"WINDOW"}


def nearest_handle(
    region: bpy.types.Region, view: bpy.types.RegionView3D, state: DrawingState, mouse: tuple[float, float]
) -> Handle | None:
    """Return the handle of a drawing under the mouse (pixels of the region); None if there is none."""
    reach = _NEAR * bpy.context.preferences.system.ui_scale
    found: list[tuple[float, int, Handle]] = []
    for number, handle in enumerate(state.view.handles):
        at = location_3d_to_region_2d(region, view, Vector((*handle.place, state.sketch.height)))
        if at is not None:
            found.append((float(np.hypot(at.x - mouse[0], at.y - mouse[1])), number, handle))
    nearest = min(found, default=None)
    return nearest[2] if nearest is not None and nearest[0] <= reach else None


def draw_keys(header: bpy.types.Header, context: bpy.types.Context) -> None:
    """Draw the keys of the tool into the status bar."""
    row = header.layout.row(align=True)
    for icon, text in _KEYS:
        row.label(text="", icon=icon)
        row.separator(factor=1.5)
        row.label(text=text)
        row.separator(factor=2.0)


class DrawRoadTool(bpy.types.WorkSpaceTool):
    """The tool in the 3D view's toolbar."""

    bl_space_type = "VIEW_3D"
    bl_context_mode = "OBJECT"
    bl_idname = DRAW_ROAD
    bl_label = "Draw Road"
    bl_description = (
        "Draw a road on the ground: click the points at which its straight tangents meet.\n"
        "Ctrl snaps, Backspace removes the last point, Enter builds"
    )
    bl_icon = "ops.curve.draw"
    bl_widget = None
    bl_keymap = ((SYNTHROADS_OT_draw_road.bl_idname, {"type": "LEFTMOUSE", "value": "PRESS"}, None),)

    @staticmethod
    def draw_settings(context: bpy.types.Context, layout: bpy.types.UILayout, tool: Any) -> None:
        """Draw the tool's settings into the header or the panel Tool."""
        properties = tool.operator_properties(SYNTHROADS_OT_draw_road.bl_idname)
        if find_road(context.scene) is not None:
            layout.prop(properties, "beside")
        layout.prop(context.scene.synthroads_drawing, "heights")
        layout.prop(context.scene.synthroads.road, "design_class")


CLASSES = (SYNTHROADS_OT_draw_road,)


def register() -> None:
    """Add the tool to the toolbar."""
    bpy.utils.register_tool(DrawRoadTool, separator=True)


def unregister() -> None:
    """Take the tool out of the toolbar."""
    bpy.utils.unregister_tool(DrawRoadTool)
