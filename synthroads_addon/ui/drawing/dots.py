"""Dots on the road that are dragged along it, and the label that tells station and offset of what is moved.

A dot at each end of an element, at each vertical point, at both ends of each exit or bay, and at each thing's station.
What is dragged is set by an operator when the mouse is released: so it can be undone, and scripts can do the same.
Annotations are not postponed here: Blender reads the properties from them.
"""

import itertools
from typing import Any, cast

import bpy
import numpy as np
from bpy_extras.view3d_utils import location_3d_to_region_2d
from mathutils import Matrix, Vector

from ...base.errors import InputError
from ...blender.model.added import change_thing, present_thing, stored_axes
from ...blender.model.build import BuildTarget, RoadModel
from ...blender.model.older_files import PARAMETERS
from ...blender.model.roads import ROAD, parts_and_copies, root_of, world_matrix
from ...blender.model.store import BUILT_FROM, find_road, recall
from ...blender.model.truth import read_road
from ...blender.things.model_builder import ROLE
from ...jobs.drawn_axis import place_text
from ...road.geometry import RoadGeometry
from ...road.section import Turnout
from ...road.things.thing import Thing
from ..fields.numbers import LENGTH_DIGITS, exact
from ..translations.blender import said
from ..work.build import road_work
from ..work.common import has_road, is_free, refusing
from ..work.job import PanelJob
from ..work.long_operator import LongOperator
from .overlay import draw_labels
from .stations import FIELDS, KIND_NAMES, Dot, Kind, changed_turnout, moved_axis, road_dots, station_at, with_axis
from .tool import ground_point

MOST = 400
"""Dots at most: of a road with more things those of its first ones are shown. Chosen: more are a crowd."""
_COLORS: dict[Kind, tuple[float, float, float]] = {
    "element": (0.25, 0.75, 1.0),
    "vertical": (0.95, 0.35, 0.95),
    "thing": (1.0, 0.75, 0.2),
    "start": (1.0, 0.75, 0.2),
    "end": (1.0, 0.75, 0.2),
    "turnout": (0.35, 0.95, 0.45),
    "turnout_end": (0.35, 0.95, 0.45),
}
_SIZE = {
    "element": 0.11,
    "vertical": 0.11,
    "thing": 0.07,
    "start": 0.07,
    "end": 0.07,
    "turnout": 0.1,
    "turnout_end": 0.1,
}
"""Sizes of the dots as shares of Blender's usual gizmo. Chosen: those of the axis are larger."""
_ALPHA, _HIGHLIGHT = 0.85, (1.0, 1.0, 0.3)
"""Opacity of a dot, and its colour under the mouse."""
_LABEL_ABOVE = 30.0
"""Height of the label above the object's origin, pixels at a resolution scale of 1."""
_CORNERS = 16
"""Corners of a dot's disc."""


def _built_turnout(root: bpy.types.Object, name: str) -> Turnout | None:
    """Return an exit, entry or bay of a road as it was built; None if it has none of that id."""
    axes = stored_axes(str(root.get(PARAMETERS, "")))
    return None if axes is None else axes.before.parameters.of_type(Turnout).get(name)


def _disc() -> list[tuple[float, float, float]]:
    """Return triangles of a disc of radius 1 in the plane z = 0."""
    angles = 2.0 * np.pi * np.arange(_CORNERS + 1) / _CORNERS
    rim = [(float(np.cos(angle)), float(np.sin(angle)), 0.0) for angle in angles]
    return [corner for a, b in itertools.pairwise(rim) for corner in ((0.0, 0.0, 0.0), a, b)]


def present_dots(root: bpy.types.Object, scene: bpy.types.Scene) -> tuple[RoadGeometry, list[Dot]] | None:
    """Return a road's geometry as it was built, and the dots of its axis and of its things where they are now.

    Returns:
        None where the road's parameters are damaged.
    """
    axes = stored_axes(str(root.get(PARAMETERS, "")))
    if axes is None:
        return None
    things: dict[str, Thing] = {}
    for role, item in parts_and_copies(root, scene)[0].items():
        thing = present_thing(root, item)
        if isinstance(thing, Thing) and len(things) < MOST:
            things[role] = thing
    return axes.before, road_dots(axes.before, things)[:MOST]


class SYNTHROADS_OT_move_thing(bpy.types.Operator):
    """Move a thing of the road to another station, at its offset. The road's parameter set has it there at once"""

    bl_idname = "synthroads.move_thing"
    bl_label = "Move Along Road"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012 (Blender reads a plain set)

    thing: bpy.props.StringProperty(name="Thing", description="Id of the thing in the parameter set, e.g. sign-2")
    kind: bpy.props.EnumProperty(
        name="Place",
        description="Which of its stations is set",
        items=[(kind, KIND_NAMES[kind], "") for kind in FIELDS],
    )
    station: bpy.props.FloatProperty(
        name="Station",
        description="Distance along the road in m, e.g. 120",
        min=0.0,
        precision=LENGTH_DIGITS,
        unit="LENGTH",
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether the scene has a road and no other work is running."""
        return is_free(cls, context) and has_road(cls, context)

    @refusing
    def execute(self, context: bpy.types.Context) -> None:
        """Give the thing the station, and make it the active object."""
        root = find_road(context.scene)
        assert root  # poll() has seen it
        item = parts_and_copies(root, context.scene)[0].get(self.thing)
        if item is None:
            raise InputError("Thing", self.thing, "must be a part of the shown road, as the panel Edit lists them")
        change_thing(root, context.scene, item, {FIELDS[cast("Kind", self.kind)]: exact(self.station, None)})
        context.view_layer.objects.active = item


class SYNTHROADS_OT_move_axis_point(LongOperator, bpy.types.Operator):
    """Move the end of an element or a vertical point of the road's axis to another station, and build the road again. The elements' curvatures and the road's length stay"""  # noqa: E501 (a tooltip is one line)

    bl_idname = "synthroads.move_axis_point"
    bl_label = "Move Axis Point"
    bl_options = {"UNDO"}  # noqa: RUF012 (Blender reads a plain set)

    kind: bpy.props.EnumProperty(
        name="Point",
        description="What is moved",
        items=[(kind, KIND_NAMES[kind], "") for kind in ("element", "vertical")],
    )
    number: bpy.props.IntProperty(
        name="Number",
        description="Of the element that begins there, or of the vertical point, counted from 0, e.g. 1",
        default=1,
        min=1,
    )
    station: bpy.props.FloatProperty(
        name="Station",
        description="Distance along the road in m, e.g. 120",
        min=0.0,
        precision=LENGTH_DIGITS,
        unit="LENGTH",
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether the scene has a road and no other work is running."""
        return is_free(cls, context) and has_road(cls, context)

    def job(self, context: bpy.types.Context) -> PanelJob[RoadModel]:
        """Return the job that builds the road with its moved axis."""
        root = find_road(context.scene)
        assert root  # poll() has seen it
        parameters = read_road(root, context.scene).known()
        axis = moved_axis(parameters.alignment, cast("Kind", self.kind), self.number, exact(self.station, None))
        place = BuildTarget(str(root[ROAD]), keep_moves=False)
        work = road_work(with_axis(parameters, axis), recall(root)[1], str(root.get(BUILT_FROM, "")), place)
        return PanelJob("Build", work)

    def succeed(self, context: bpy.types.Context, job: PanelJob[RoadModel]) -> str:
        """Return the message."""
        return f"{KIND_NAMES[cast('Kind', self.kind)]} {self.number} is at station {self.station:.2f} m"


class _Hovered:
    """The dot under the mouse or in hand, whose label is shown; None if there is none."""

    dot: Dot | None = None
    place: Vector = Vector()


class SYNTHROADS_GT_dot(bpy.types.Gizmo):
    """A dot that is dragged along the road."""

    bl_idname = "SYNTHROADS_GT_dot"

    __slots__ = ("disc", "dot", "root", "station")

    def setup(self) -> None:
        """Make the disc that is drawn."""
        if not hasattr(self, "disc"):
            self.disc = self.new_custom_shape("TRIS", _disc())

    def hold(self, root: bpy.types.Object, dot: Dot) -> None:
        """Show a dot of a road."""
        self.root, self.dot, self.station = root.name, dot, dot.station
        shown: Any = self  # what Blender's own gizmos have isn't among the slots
        shown.color, shown.alpha = _COLORS[dot.kind], _ALPHA
        shown.color_highlight, shown.alpha_highlight = _HIGHLIGHT, 1.0
        shown.scale_basis, shown.use_draw_modal = _SIZE[dot.kind], True
        self._put(dot.place)

    def _put(self, place: tuple[float, float, float]) -> None:
        """Show the dot at a place of the road's own coordinates."""
        shown: Any = self
        shown.matrix_basis = Matrix.Translation(self._world(place))

    def _world(self, place: tuple[float, float, float]) -> Vector:
        root = bpy.data.objects[self.root]
        return Matrix(world_matrix(root).tolist()) @ Vector(place)

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the disc, turned to the view."""
        if self.is_highlight or self.is_modal:
            _Hovered.dot, _Hovered.place = self._now(), self.matrix_basis.translation.copy()
        elif _Hovered.dot is not None and (_Hovered.dot.kind, _Hovered.dot.name, _Hovered.dot.number) == self._key():
            _Hovered.dot = None
        self.draw_custom_shape(self.disc, matrix=self._facing(context))

    def draw_select(self, context: bpy.types.Context, select_id: int) -> None:
        """Draw the disc where Blender looks what the mouse is over."""
        self.draw_custom_shape(self.disc, matrix=self._facing(context), select_id=select_id)

    def _facing(self, context: bpy.types.Context) -> Matrix:
        place = self.matrix_world.copy()
        return (
            Matrix.Translation(place.translation)
            @ context.region_data.view_rotation.to_matrix().to_4x4()
            @ Matrix.Scale(place.median_scale, 4)
        )

    def _key(self) -> tuple[str, str, int]:
        return self.dot.kind, self.dot.name, self.dot.number

    def _now(self) -> Dot:
        dot = self.dot
        return Dot(dot.kind, dot.name, dot.number, self.station, dot.offset, dot.place)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Take hold of the dot."""
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event, tweak: set[str]) -> set[str]:
        """Move the dot along the road to where the mouse is."""
        axes = stored_axes(str(bpy.data.objects[self.root].get(PARAMETERS, "")))
        place = self._world(self.dot.place)
        mouse = (float(event.mouse_region_x), float(event.mouse_region_y))
        ground = ground_point(context.region, context.region_data, mouse, place.z)
        if axes is None or ground is None:
            return {"RUNNING_MODAL"}
        into = np.linalg.inv(world_matrix(bpy.data.objects[self.root]))
        local = into[:2, :2] @ ground + into[:2, 3]
        self.station = station_at(axes.before, self.dot, (float(local[0]), float(local[1])))
        x, y = axes.before.alignment.place(np.array([self.station]), np.array([self.dot.offset]))[0].tolist()
        self._put((x, y, self.dot.place[2]))
        context.area.header_text_set(f"{self.dot.title}: station {self.station:.2f} m")
        context.area.tag_redraw()
        return {"RUNNING_MODAL"}

    def exit(self, context: bpy.types.Context, cancel: bool) -> None:
        """Set the station by an operator, or put the dot back."""
        context.area.header_text_set(None)
        _Hovered.dot = None
        dot, station = self.dot, self.station
        if cancel or station == dot.station:
            self.station = dot.station
            self._put(dot.place)
            return
        if dot.kind in FIELDS:
            bpy.ops.synthroads.move_thing("EXEC_DEFAULT", True, thing=dot.name, kind=dot.kind, station=station)
        elif dot.kind in ("turnout", "turnout_end"):
            turnout = _built_turnout(bpy.data.objects[self.root], dot.name)
            if turnout is not None:
                fields = changed_turnout(turnout, dot.kind, station)
                bpy.ops.synthroads.change_turnout("EXEC_DEFAULT", True, turnout=dot.name, **fields)
        else:
            bpy.ops.synthroads.move_axis_point(
                "INVOKE_DEFAULT", True, kind=dot.kind, number=dot.number, station=station
            )


class SYNTHROADS_GGT_dots(bpy.types.GizmoGroup):
    """The dots of the road that the active object belongs to."""

    bl_idname = "SYNTHROADS_GGT_dots"
    bl_label = "Stations of the Road"
    bl_space_type = "VIEW_3D"
    bl_region_type = "WINDOW"
    bl_options = {"3D", "PERSISTENT", "SHOW_MODAL_ALL"}  # noqa: RUF012 (Blender reads a plain set)

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether dots are to be shown: in Object Mode, while the active object is a road's."""
        if context.mode != "OBJECT" or not context.scene.synthroads_drawing.dots:
            return False
        item = context.view_layer.objects.active
        return item is not None and root_of(item, context.scene) is not None

    def setup(self, context: bpy.types.Context) -> None:
        """Make the dots."""
        self.refresh(context)

    def refresh(self, context: bpy.types.Context) -> None:
        """Put the dots where the road's places are now."""
        root = root_of(context.view_layer.objects.active, context.scene)
        found = present_dots(root, context.scene) if root is not None and PARAMETERS in root else None
        dots = found[1] if found else []
        for gizmo in list(self.gizmos)[len(dots) :]:
            self.gizmos.remove(gizmo)
        while len(self.gizmos) < len(dots):
            self.gizmos.new(SYNTHROADS_GT_dot.bl_idname)
        for gizmo, dot in zip(self.gizmos, dots, strict=True):
            if not gizmo.is_modal:
                gizmo.hold(root, dot)


# --- the label -------------------------------------------------------------------------------------------------------


def label_of(item: bpy.types.Object | None, scene: bpy.types.Scene) -> str:
    """Return station and offset of a road's thing where its object is now; empty for any other object."""
    if item is None or ROLE not in item:
        return ""
    root = root_of(item, scene)
    axes = stored_axes(str(root.get(PARAMETERS, ""))) if root is not None else None
    if root is None or axes is None or not isinstance(present_thing(root, item), Thing):
        return ""
    place = np.linalg.inv(world_matrix(root)) @ world_matrix(item)
    return place_text(axes.before.parameters.alignment, place[:2, 3].tolist())


def _draw_label() -> None:
    """Draw the label of the active thing while it is selected, and that of the dot under the mouse."""
    context = bpy.context
    region, space = context.region, context.space_data
    if region is None or not isinstance(space, bpy.types.SpaceView3D) or not context.scene.synthroads_drawing.dots:
        return
    scale = context.preferences.system.ui_scale
    item = context.view_layer.objects.active
    labels: list[tuple[Vector, str]] = []
    if item is not None and item.select_get() and (text := label_of(item, context.scene)):
        labels.append((item.matrix_world.translation, text))
    if _Hovered.dot is not None and not (labels and item is not None and item[ROLE] == _Hovered.dot.name):
        labels.append((_Hovered.place, f"{_Hovered.dot.title}: station {_Hovered.dot.station:.2f} m"))
    draw_labels(
        [
            ((at.x + _LABEL_ABOVE * scale / 2.0, at.y + _LABEL_ABOVE * scale), said(text))
            for place, text in labels
            if (at := location_3d_to_region_2d(region, space.region_3d, place)) is not None
        ],
        scale,
    )


_handlers: list[Any] = []
CLASSES = (SYNTHROADS_OT_move_thing, SYNTHROADS_OT_move_axis_point, SYNTHROADS_GT_dot, SYNTHROADS_GGT_dots)


def register() -> None:
    """Begin to draw the label; without a window there is nothing to draw on."""
    if not bpy.app.background:
        _handlers.append(bpy.types.SpaceView3D.draw_handler_add(_draw_label, (), "WINDOW", "POST_PIXEL"))


def unregister() -> None:
    """End to draw the label."""
    _Hovered.dot = None
    while _handlers:
        bpy.types.SpaceView3D.draw_handler_remove(_handlers.pop(), "WINDOW")
