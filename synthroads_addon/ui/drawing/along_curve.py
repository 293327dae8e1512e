"""Road from Curve: a road along any curve object, linked to it as long as that is wanted.

Annotations are not postponed here: Blender reads the properties from them.
"""

import json
from typing import Any, ClassVar

import bpy
import numpy as np
from bpy.app.handlers import persistent

from ...base.errors import InputError
from ...blender.model.build import BuildTarget
from ...blender.model.roads import ROAD, choose_road, origin_of, road_of_id, scene_origin
from ...blender.model.store import find_road, recall, roads
from ...blender.scene.curve_points import KINDS
from ...fitting.fit import AxisRefusedError
from ...fitting.plot import axis_picture
from ...jobs.drawn_axis import road_along, rules_text
from ...scenario.scenario import Scenario
from ..fields.numbers import LENGTH_DIGITS, exact
from ..fields.room import buttons_row, draw_flag, draw_text, value_row
from ..translations.blender import said
from ..work.build import road_work, unused_seed
from ..work.common import Sidebar, column, is_free, redraw_sidebars
from ..work.job import Aside, PanelJob, Work, running_job
from ..work.long_operator import LongOperator
from ..work.pictures import FIT_PICTURE, keep_picture
from .links import (
    FOLLOWS,
    TANGENTS,
    CurveLine,
    CurveSettings,
    built_from,
    curve_line,
    curve_settings,
    drawn_texts,
    is_outdated,
    keep_link,
    linked_curve,
    unlink,
)

_DELAY = 0.5
"""Seconds after a change of a curve until its road is looked at; each further change begins anew."""
DRAW_ROAD = "synthroads.draw_road"
"""Name of the drawing tool and of its operator."""
POLYGON_NAME = "SynthRoads Tangents"
"""Name of a curve that the drawing tool makes."""


def _shown_follows(state: Any) -> bool:
    root = find_road(bpy.context.scene)
    return bool(root is not None and root.get(FOLLOWS))


def _set_follows(state: Any, value: bool) -> None:
    root = find_road(bpy.context.scene)
    if root is not None:
        root[FOLLOWS] = value


def _look_at_once(state: Any, context: bpy.types.Context) -> None:
    look_later()


class SYNTHROADS_PG_drawing(bpy.types.PropertyGroup):
    """How roads are built along curves."""

    tangents: bpy.props.BoolProperty(
        name="Tangent Polygon",
        description="The curve's points are those at which straight tangents meet, and each point's radius (Item > "
        "Mean Radius in Edit Mode) is that of its rounding in m, e.g. 900; 1 takes the design class's smallest. Else "
        "the road is fitted to the curve itself",
    )
    tolerance: bpy.props.FloatProperty(
        name="Tolerance",
        description="Root mean square distance of the road from the curve that the fit aims at, in m, e.g. 0.05",
        default=0.05,
        min=0.001,
        max=10.0,
        precision=LENGTH_DIGITS,
        step=1,
        unit="LENGTH",
    )
    heights: bpy.props.EnumProperty(
        name="Heights",
        description="Where the road's profile comes from",
        items=[
            ("CURVE", "The Curve's", "The curve's heights; a curve that lies flat gives a level road"),
            ("SEED", "From the Seed", "Drawn within the limits of the panel Road, as those of a random road"),
        ],
    )
    linked: bpy.props.BoolProperty(
        name="Keep Linked",
        description="The road remembers its curve, and can be fitted again when the curve has changed",
        default=True,
    )
    dots: bpy.props.BoolProperty(
        name="Dots and Labels",
        description="Show dots at the ends of elements (blue), vertical points (pink) and stations of things (yellow) "
        "of the active object's road, to be dragged along it, and a label with station and offset of what is moved",
        default=True,
    )
    follows: bpy.props.BoolProperty(
        name="Follow the Curve",
        description="Build the shown road again as soon as its curve has changed, outside of Edit Mode",
        get=_shown_follows,
        set=_set_follows,
        update=_look_at_once,
    )

    def settings(self, curve: bpy.types.Object | None) -> CurveSettings:
        """Return how a road is to be built along a curve; a drawn polygon always says its tangents' points."""
        tangents = self.tangents or curve is None or TANGENTS in curve
        return CurveSettings(tangents, exact(self.tolerance, None), self.heights == "SEED")


def active_curve(context: bpy.types.Context) -> bpy.types.Object | None:
    """Return the active object if it is a curve."""
    item = context.view_layer.objects.active
    return item if item is not None and item.type in KINDS else None


class AlongCurve(LongOperator):
    """Base of operators that build a road along a curve in a job."""

    option_labels: ClassVar = {"points": "Points", "point": "Point"}
    bl_options = {"UNDO"}  # noqa: RUF012 (Blender reads a plain set)

    def refuse(self, error: InputError) -> set[str]:
        """Report an error; if the fit misses the curve, also keep a picture of it."""
        if not isinstance(error, AxisRefusedError):
            return super().refuse(error)
        keep_picture(FIT_PICTURE, axis_picture(error.fit, error.name))
        text = "If its points are where straight tangents meet, tick Tangent Polygon in Road > Draw"
        self.report({"INFO"}, said(text))
        return super().refuse(error.with_picture("Show Missed Axis"))


def along_work(
    line: CurveLine, scenario: Scenario, place: BuildTarget, origin: tuple[float, float, float]
) -> Work[Any]:
    """Generator that builds a road along a line, as a job's work; it returns the model and two sentences on it.

    Args:
        line: that the road follows.
        scenario: limits and seed of the road.
        place: which road it takes the place of.
        origin: map coordinates of the scene's own origin, m.
    """

    def fit(_: Any) -> Any:
        drawn = line.axis(scenario)
        parameters, violations = road_along(drawn, scenario, origin)
        return parameters, (drawn.text, rules_text(violations))

    parameters, texts = yield Aside(fit, "Fitting", 0.0, 0.1)
    model = yield from road_work(parameters, scenario, built_from(line.name, line.settings), place)
    return model, texts


def map_origin(context: bpy.types.Context) -> tuple[float, float, float]:
    """Return the map coordinates of the scene's origin: as its roads say, else the panel's map origin, m."""
    origin = scene_origin(context.scene)
    if origin is None:
        return tuple(context.scene.synthroads.scenario().road.map_origin)
    return (float(origin[0]), float(origin[1]), float(origin[2]))


class SYNTHROADS_OT_road_from_curve(AlongCurve, bpy.types.Operator):
    """Build a road along the active curve: lines, clothoids and arcs fitted to it, with its heights. It tells how far the road is from the curve, and which rules it breaks. The shown road is replaced unless another one is added"""  # noqa: E501 (a tooltip is one line)

    bl_idname = "synthroads.road_from_curve"
    bl_label = "Road from Curve"

    beside: bpy.props.BoolProperty(
        name="One More",
        description="Add a road to the scene instead of rebuilding the shown one, with a seed that no road there has",
        options={"SKIP_SAVE"},
    )
    polygon: bpy.props.StringProperty(
        name="Points",
        description="JSON rows of x, y, z and radius in m of a tangent polygon, e.g. [[0, 0, 0, 0], [900, 0, 0, 0]]; "
        "empty takes the active curve",
        options={"SKIP_SAVE", "HIDDEN"},
    )

    _line: CurveLine
    _curve = ""
    _seed = 0

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether nothing else is at work."""
        return is_free(cls, context)

    def job(self, context: bpy.types.Context) -> PanelJob[Any]:
        """Return the job that fits a road to the curve and builds it."""
        drawing, panel = context.scene.synthroads_drawing, context.scene.synthroads
        curve = None if self.polygon else active_curve(context)
        if self.polygon:
            rows = _rows(self.polygon)
            points = np.array(rows, dtype=np.float64)[:, :3]
            self._line = CurveLine(POLYGON_NAME, points, tuple(row[3] for row in rows), drawing.settings(None))
        elif curve is None:
            raise InputError("Curve", None, "select a curve first, or draw one (Add > Curve, or the tool Draw Road)")
        else:
            self._line = curve_line(curve, drawing.settings(curve))
        self._curve = "" if curve is None else curve.name
        adds = self.beside and find_road(context.scene) is not None
        self._seed = unused_seed(panel.exact_seed(), context.scene) if adds else panel.exact_seed()
        scenario = panel.scenario().model_copy(update={"seed": self._seed})
        shown = find_road(context.scene)
        place = BuildTarget("" if shown is None else str(shown[ROAD]), adds, moves_aside=False, keep_moves=False)
        return PanelJob("Road from Curve", along_work(self._line, scenario, place, map_origin(context)))

    def succeed(self, context: bpy.types.Context, job: PanelJob[Any]) -> str:
        """Link the road and its curve, make a drawn polygon an object, and return the message."""
        assert job.result
        model, texts = job.result
        curve = context.scene.objects.get(self._curve) if self._curve else new_polygon(context, self._line)
        keep_link(model.root, curve if context.scene.synthroads_drawing.linked else None, self._line, texts)
        choose_road(context.scene, model.root)
        if len(roads(context.scene)) > 1:
            context.view_layer.objects.active = model.root
        if self._seed != context.scene.synthroads.exact_seed():
            context.scene.synthroads.seed = self._seed
        name = curve.name if curve else self._line.name
        return f"Built {recall(model.root)[0].alignment.length:,.0f} m of road along {name}: {texts[0]}; {texts[1]}"


def _rows(text: str) -> list[list[float]]:
    """Return the rows of a polygon's JSON text; raise InputError if it is none."""
    try:
        rows = [[float(value) for value in row] for row in json.loads(text)]
    except (TypeError, ValueError):
        rows = []
    if not rows or any(len(row) != 4 for row in rows):
        raise InputError("Points", text[:60], "must be JSON rows of x, y, z and radius in m: [[0, 0, 0, 0], ...]")
    return rows


class SYNTHROADS_OT_fit_again(AlongCurve, bpy.types.Operator):
    """Build the shown road again along its curve as it is now, with the limits and the seed that it was built with"""

    bl_idname = "synthroads.fit_again"
    bl_label = "Fit Again"

    _line: CurveLine
    _curve = ""

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether the shown road is linked to a curve, and nothing else is at work."""
        if not is_free(cls, context):
            return False
        if linked_curve(find_road(context.scene), context.scene) is None:
            cls.poll_message_set(said("The shown road isn't linked to a curve: press Road from Curve first"))
            return False
        return True

    def job(self, context: bpy.types.Context) -> PanelJob[Any]:
        """Return the job that builds the shown road along its curve."""
        root = find_road(context.scene)
        assert root  # poll() has seen both
        curve = linked_curve(root, context.scene)
        assert curve
        self._line, self._curve = curve_line(curve, curve_settings(root)), curve.name
        origin = origin_of(root)
        place = BuildTarget(str(root[ROAD]), keep_moves=False)
        work = along_work(self._line, recall(root)[1], place, (float(origin[0]), float(origin[1]), float(origin[2])))
        return PanelJob("Fit Again", work)

    def succeed(self, context: bpy.types.Context, job: PanelJob[Any]) -> str:
        """Keep the new state of the link and return the message."""
        assert job.result
        model, texts = job.result
        keep_link(model.root, context.scene.objects.get(self._curve), self._line, texts)
        return f"Built {recall(model.root)[0].alignment.length:,.0f} m of road along {self._curve}: {'; '.join(texts)}"


class SYNTHROADS_OT_unlink_curve(bpy.types.Operator):
    """End the link of the shown road with its curve: both stay as they are, and edits of the curve change nothing"""

    bl_idname = "synthroads.unlink_curve"
    bl_label = "Unlink Curve"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012 (Blender reads a plain set)

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether the shown road is linked to a curve."""
        if linked_curve(find_road(context.scene), context.scene) is None:
            cls.poll_message_set(said("The shown road isn't linked to a curve"))
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Remove the link from the road's root."""
        root = find_road(context.scene)
        assert root  # poll() has seen it
        unlink(root)
        redraw_sidebars(context)
        return {"FINISHED"}


def new_polygon(context: bpy.types.Context, line: CurveLine) -> bpy.types.Object:
    """Make a curve object of a drawn tangent polygon, whose points can be moved in Edit Mode; return it."""
    data = bpy.data.curves.new(POLYGON_NAME, "CURVE")
    data.dimensions = "3D"
    spline = data.splines.new("POLY")
    spline.points.add(len(line.points) - 1)
    for point, place, radius in zip(spline.points, line.points.tolist(), line.radii, strict=True):
        point.co, point.radius = (*place, 1.0), radius or 1.0
    item = bpy.data.objects.new(POLYGON_NAME, data)
    item[TANGENTS], item.hide_render = True, True
    context.scene.collection.objects.link(item)
    return item


# --- the curve is followed -------------------------------------------------------------------------------------------


def followers(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """Return the roots of the roads that are to follow their curve and are behind it now."""
    return [root for root in roads(scene) if root.get(FOLLOWS) and is_outdated(root, scene)]


@persistent
def _note_curves(scene: bpy.types.Scene, graph: bpy.types.Depsgraph) -> None:
    """Handler that schedules a look at linked curves after a change to one."""
    changed = {
        update.id.original for update in graph.updates if isinstance(update.id, bpy.types.Object | bpy.types.Curve)
    }
    if not changed:
        return
    for root in roads(scene):
        curve = linked_curve(root, scene)
        if curve is not None and (curve in changed or curve.data in changed):
            look_later()
            return


def look_later() -> None:
    """Schedule a look at the linked curves, not in the background; a scheduled one is put off."""
    if bpy.app.background:
        return
    if bpy.app.timers.is_registered(_look):
        bpy.app.timers.unregister(_look)
    bpy.app.timers.register(_look, first_interval=_DELAY)


def _look() -> float | None:
    """Timer that has a road built again whose curve has changed; waits while Blender is busy or in Edit Mode."""
    context = bpy.context
    if running_job() is not None or context.mode != "OBJECT":
        return _DELAY
    redraw_sidebars(context)
    waiting = followers(context.scene)
    if not waiting:
        return None
    windows = context.window_manager.windows
    if any(operator.bl_idname.startswith("TRANSFORM_OT") for operator in getattr(windows[0], "modal_operators", ())):
        return _DELAY
    follow(waiting[0])
    return _DELAY if len(waiting) > 1 else None


def follow(root: bpy.types.Object) -> None:
    """Have a road built again along its curve, beside the window where there is one."""
    context = bpy.context
    assert road_of_id(context.scene, str(root[ROAD]))
    choose_road(context.scene, root)
    window = context.window_manager.windows[0] if context.window_manager.windows else None
    try:
        if window is None or bpy.app.background:
            bpy.ops.synthroads.fit_again()
            return
        with context.temp_override(window=window, screen=window.screen):
            bpy.ops.synthroads.fit_again("INVOKE_DEFAULT", True)
    except RuntimeError:  # the operator has reported that no road follows the curve: it isn't tried again and again
        root[FOLLOWS] = False


HANDLERS = {"depsgraph_update_post": _note_curves}


class SYNTHROADS_PT_drawing(Sidebar, bpy.types.Panel):
    """Panel of roads that are drawn or follow a curve."""

    bl_label = "Draw"
    bl_parent_id = "SYNTHROADS_PT_road"
    bl_order = 15
    bl_options = {"DEFAULT_CLOSED"}  # noqa: RUF012 (Blender reads a plain set)

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the ways to a drawn road, their settings, and the shown road's link with its curve."""
        layout, drawing = column(self), context.scene.synthroads_drawing
        layout.operator_context = "INVOKE_REGION_WIN"
        row = buttons_row(layout, ("Draw Road", "Road from Curve"), align=True)
        row.operator(DRAW_ROAD, text="Draw Road", icon="GREASEPENCIL")
        row.operator(SYNTHROADS_OT_road_from_curve.bl_idname, icon="CURVE_DATA")
        draw_settings(layout, drawing)
        root = find_road(context.scene)
        if root is None:
            return
        deviation, rules = drawn_texts(root)
        for text, icon in ((deviation, "DRIVER_DISTANCE"), (rules, "CHECKMARK" if "keeps all" in rules else "ERROR")):
            if text:
                draw_text(layout, text[0].upper() + text[1:], icon)
        curve = linked_curve(root, context.scene)
        if curve is None:
            return
        draw_text(layout, f"Linked to {curve.name}", "LINKED")
        draw_flag(layout, drawing, "follows", "Follow the Curve")
        row = buttons_row(layout, ("Fit Again", "Unlink Curve"), align=True)
        row.operator(SYNTHROADS_OT_fit_again.bl_idname, icon="FILE_REFRESH")
        row.operator(SYNTHROADS_OT_unlink_curve.bl_idname, icon="UNLINKED")


def draw_settings(layout: bpy.types.UILayout, drawing: Any) -> None:
    """Draw the settings of roads along curves."""
    value_row(layout, "Heights").prop(drawing, "heights", text="")
    value_row(layout, "Tolerance").prop(drawing, "tolerance", text="")
    for name, label in (("tangents", "Tangent Polygon"), ("linked", "Keep Linked"), ("dots", "Dots and Labels")):
        draw_flag(layout, drawing, name, label)


ATTACHED = (bpy.types.Scene, "synthroads_drawing", SYNTHROADS_PG_drawing)


def unregister() -> None:
    """Cancel the timer."""
    if bpy.app.timers.is_registered(_look):
        bpy.app.timers.unregister(_look)
