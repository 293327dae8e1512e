"""Clouds in the 3D view: the last scan's or any other, coloured by class, intensity, colour or height.

Annotations are not postponed here: Blender reads the properties from them.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import bpy
import bpy.utils.previews
import numpy as np
from bpy.app.handlers import persistent
from mathutils import Vector

from ...base.errors import InputError
from ...blender.model.roads import scene_origin
from ...blender.model.store import find_road
from ...blender.views.cloud import CloudView
from ...blender.views.cloud_object import add_cloud_object, cloud_objects, color_cloud_object
from ...cloud.formats.registry import ENDINGS, installed_endings
from ...cloud.tools.display import COLOURINGS, ColourBy, DisplayCloud, height_colors, read_display
from ..fields.room import draw_text, fits, is_narrow
from ..fields.wording import title_case
from ..translations.blender import said
from ..work.common import Sidebar, column, is_free, right_label
from ..work.job import PanelJob, Report
from ..work.long_operator import LongOperator, draw_job
from ..work.view import frame_points, redraw_views, view_of

AVAILABLE = installed_endings()
"""Endings of clouds that are offered: those that can be read and written here."""
ENDINGS_GLOB = ";".join(f"*{ending}" for ending in AVAILABLE)
_FAR = 20_000.0
"""A cloud farther than this (m) from the road's origin and beyond the road's length is likely to be of elsewhere."""
_LABELS: dict[ColourBy, tuple[str, str]] = {
    "class": ("Class", "The classes' colours, as in the pictures of a scan"),
    "intensity": ("Intensity", "Black to white, clipped by 0.5 % at both ends; multiplied by the squared range"),
    "rgb": ("RGB", "The colours that the cloud holds"),
    "height": ("Height", "Dark blue to yellow, clipped by 0.5 % at both ends"),
}
_GRADIENT_STEPS, _SWATCH_SIZE = 10, 32
_LEGEND_SHARE = 0.65
"""Share of a row of the legend that is a class's name, where that fits."""
_icons: Any = None

view = CloudView()
"""Cloud that is drawn over the 3D views."""


def last_cloud(context: bpy.types.Context) -> Path | None:
    """Return the path of the cloud in the panel's output folder, where a scan writes it; None if there is none."""
    settings = context.scene.synthroads
    if not settings.chosen_folder().strip() or settings.needs_saved_file():
        return None
    paths = [settings.folder() / f"cloud{ending}" for ending in ENDINGS]
    return next((path for path in paths if path.is_file()), None)


def _is_shown(operator: type[bpy.types.Operator]) -> bool:
    """Return whether a cloud is shown, for an operator's `poll`; else set its tooltip to the reason."""
    if view.cloud is None:
        operator.poll_message_set(said("Show a cloud first"))
    return view.cloud is not None


def cloud_path(context: bpy.types.Context, given: str) -> Path:
    """Return the given path, or the last scan's cloud if it is empty; InputError if there is neither."""
    if given.strip():
        return Path(bpy.path.abspath(given)).expanduser()
    path = last_cloud(context)
    if path is None:
        raise InputError("File", None, "scan first, or choose a cloud")
    return path


def read_cloud_to_show(path: Path, points: int, origin: Any, by: ColourBy, report: Report) -> DisplayCloud:
    """Read at most `points` points of a cloud for display, and precompute their colours by a quantity if it has it."""
    cloud = read_display(path, points, origin, lambda share: report(0.95 * share))
    cloud.colors(by if by in cloud.colorings() else "class")
    report(1.0)
    return cloud


def _redraw(settings: "SYNTHROADS_PG_cloud_view", context: bpy.types.Context) -> None:
    """Apply the panel's colouring, size and visibility to the shown cloud, and redraw the 3D views."""
    view.by, view.size, view.visible = settings.by, settings.size, settings.visible
    if view.cloud is not None and view.by in view.cloud.colorings():
        for item in cloud_objects(context.scene, view.cloud):
            color_cloud_object(item, view.cloud, view.by)
    redraw_views(context)


class SYNTHROADS_PG_cloud_view(bpy.types.PropertyGroup):
    """Settings of the display of clouds in the 3D view."""

    file: bpy.props.StringProperty(
        name="File",
        description=f"Cloud to show ({', '.join(AVAILABLE)}); if empty, that of the last scan",
        subtype="FILE_PATH",
    )
    points: bpy.props.IntProperty(
        name="Points",
        description="Largest number of points to show; a larger cloud is thinned evenly. 40 bytes of memory each",
        default=2_000_000,
        min=1_000,
        max=100_000_000,
        soft_max=20_000_000,
        step=100_000,
    )
    by: bpy.props.EnumProperty(
        name="Colour",
        description="Attribute that colours the points",
        items=[(name, *_LABELS[name]) for name in COLOURINGS],
        default="class",
        update=_redraw,
    )
    size: bpy.props.FloatProperty(
        name="Point Size",
        description="Size of a point on the screen, pixels",
        default=2.0,
        min=1.0,
        max=20.0,
        update=_redraw,
    )
    visible: bpy.props.BoolProperty(name="Visible", description="Show or hide the cloud", default=True, update=_redraw)


class SYNTHROADS_OT_show_cloud(LongOperator, bpy.types.Operator):
    """Draw a cloud over the 3D view. The cloud isn't added to the file, nor scanned, nor rendered"""

    bl_idname = "synthroads.show_cloud"
    bl_label = "Show Cloud"

    filepath: bpy.props.StringProperty(
        name="File", description="Cloud to show; if empty, the last scan's", subtype="FILE_PATH", options={"SKIP_SAVE"}
    )
    nothing_done = "the view wasn't changed"

    def job(self, context: bpy.types.Context) -> PanelJob[DisplayCloud]:
        """Return the reading of the cloud for display, relative to the scene's origin, as a job in a thread."""
        path, settings = cloud_path(context, self.filepath), context.scene.synthroads_cloud_view
        points, by, origin = settings.points, settings.by, scene_origin(context.scene)
        return PanelJob.aside(
            "Loading", lambda report: read_cloud_to_show(path, points, origin, by, report), "Loading the cloud"
        )

    def succeed(self, context: bpy.types.Context, job: PanelJob[DisplayCloud]) -> str:
        """Show the cloud that was read, framed if it is the first and there is no road; return the message."""
        cloud, settings = job.result, context.scene.synthroads_cloud_view
        assert cloud
        first = view.cloud is None and find_road(context.scene) is None
        if settings.by not in cloud.colorings():
            settings.by = "class"
        view.show(cloud, context.scene)
        settings.visible = True
        _redraw(settings, context)
        space = view_of(context)
        if first and space:
            frame_points(space, cloud.xyz)
        return f"{len(cloud):,} of {cloud.total:,} points of {cloud.header.path.name} are shown"


class SYNTHROADS_OT_hide_cloud(bpy.types.Operator):
    """Hide the cloud, and free its memory"""

    bl_idname = "synthroads.hide_cloud"
    bl_label = "Remove Cloud"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether a cloud is shown."""
        return _is_shown(cls)

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Remove the shown cloud and redraw the views."""
        view.remove()
        redraw_views(context)
        return {"FINISHED"}


class SYNTHROADS_OT_add_cloud(bpy.types.Operator):
    """Add the shown points to the file as Blender's own point cloud, with class, intensity and colour as attributes"""

    bl_idname = "synthroads.add_cloud"
    bl_label = "Add to Scene"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012 (Blender reads a plain set)

    radius: bpy.props.FloatProperty(
        name="Radius", description="Size of a point in renders", default=0.02, min=0.001, max=1.0, unit="LENGTH"
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether a cloud is shown and Blender is in object mode."""
        return _is_shown(cls) and is_free(cls, context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Add the cloud as an object, and hide the overlay, so that each point is seen once."""
        settings = context.scene.synthroads_cloud_view
        assert view.cloud
        add_cloud_object(view.cloud, settings.by, self.radius, view.offset(context.scene))
        settings.visible = False
        return {"FINISHED"}


class SYNTHROADS_OT_frame_cloud(bpy.types.Operator):
    """Show the whole cloud in the 3D view"""

    bl_idname = "synthroads.frame_cloud"
    bl_label = "Look at Cloud"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether a cloud is shown and there is a 3D view."""
        if not _is_shown(cls):
            return False
        if view_of(context) is None:
            cls.poll_message_set(said("There is no 3D view"))
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Frame the cloud's points in the 3D view."""
        assert view.cloud
        frame_points(view_of(context), view.cloud.xyz, Vector(view.offset(context.scene)))
        redraw_views(context)
        return {"FINISHED"}


class SYNTHROADS_PT_cloud_view(Sidebar, bpy.types.Panel):
    """Panel of the cloud shown over the 3D view."""

    bl_label = "Cloud in Viewport"
    bl_parent_id = "SYNTHROADS_PT_output"
    bl_order = 10
    bl_options = {"DEFAULT_CLOSED"}  # noqa: RUF012

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the cloud's file, the display settings and the legend of its colours."""
        layout, settings = column(self), context.scene.synthroads_cloud_view
        layout.prop(settings, "file", placeholder=said("Last scan's cloud"))
        layout.prop(settings, "points")
        if not draw_job(layout):
            layout.operator(SYNTHROADS_OT_show_cloud.bl_idname, icon="POINTCLOUD_DATA").filepath = settings.file
        cloud = view.cloud
        if cloud is None:
            return
        row = layout.row(align=True)
        icon = "HIDE_OFF" if settings.visible else "HIDE_ON"
        row.prop(settings, "visible", text="", icon=icon, emboss=False)
        draw_text(row, cloud.header.path.name, beside=3)
        row.operator(SYNTHROADS_OT_frame_cloud.bl_idname, text="", icon="VIEWZOOM", emboss=False)
        row.operator(SYNTHROADS_OT_hide_cloud.bl_idname, text="", icon="X", emboss=False)
        for text, icon in cloud_notes(cloud, context.scene):
            draw_text(layout, text, icon)
        row = layout.column(align=True) if is_narrow() else layout.row(align=True)
        row.use_property_split = False
        for by in COLOURINGS:
            choice = row.row(align=True)
            choice.enabled = by in cloud.colorings()
            choice.prop_enum(settings, "by", by)
        layout.prop(settings, "size")
        layout.operator(SYNTHROADS_OT_add_cloud.bl_idname, icon="OUTLINER_OB_POINTCLOUD")
        _draw_legend(layout, cloud, settings.by)


def cloud_notes(cloud: DisplayCloud, scene: bpy.types.Scene) -> Iterator[tuple[str, str]]:
    """Yield (text, icon) of notes on the shown cloud: number of points, no road, or far from the road."""
    yield f"{len(cloud):,} of {cloud.total:,} points", "NONE"
    if scene_origin(scene) is None:
        x, y, z = (f"{value:,.0f}" for value in cloud.origin)
        yield f"No road: drawn from {x}, {y}, {z}", "INFO"
    elif _distance(cloud, scene) > _FAR:
        yield f"It lies {_distance(cloud, scene) / 1000.0:,.0f} km from the road", "ERROR"


def _distance(cloud: DisplayCloud, scene: bpy.types.Scene) -> float:
    """Return the distance of the cloud's first point from the road's origin, m."""
    return float(np.hypot(*(cloud.xyz[0, :2] + view.offset(scene)[:2])))


def _draw_legend(layout: bpy.types.UILayout, cloud: DisplayCloud, by: ColourBy) -> None:
    if by == "class":
        _class_legend(layout, cloud)
    elif by in ("intensity", "height"):
        low, high = cloud.limits(by)
        colors = height_colors() if by == "height" else np.repeat(np.arange(256, dtype=np.uint8)[:, None], 3, axis=1)
        form, unit = ("{:,.1f}", " m") if by == "height" else ("{:.3g}", "")
        row = layout.row(align=True)
        for step in np.linspace(0, 255, _GRADIENT_STEPS).astype(int):
            row.label(text="", icon_value=swatch(colors[step]))
        row = layout.row()
        row.label(text=form.format(low) + unit)
        right_label(row, form.format(high) + unit)
        if by == "intensity":
            draw_text(layout, cloud.brightness_text.capitalize())


def _class_legend(layout: bpy.types.UILayout, cloud: DisplayCloud) -> None:
    rows = layout.column(align=True)
    for row, count in cloud.classes():
        name, number = said(title_case(row.name)), f"{count:,}"
        if fits(f"{name} {number}", icons=1):
            line = rows.split(factor=_LEGEND_SHARE) if fits(name, _LEGEND_SHARE, 1) else rows.row()
            line.label(text=name, icon_value=swatch(row.color))
            right_label(line, number)
        else:
            rows.label(text=name, icon_value=swatch(row.color))
            right_label(rows, number)


def swatch(color: Sequence[int]) -> int:
    """Return the icon id of a colour (red, green, blue; sRGB, 0 to 255); cached."""
    name = "#" + bytes(int(value) for value in color).hex()
    if name not in _icons:
        icon = _icons.new(name)
        icon.icon_size = (_SWATCH_SIZE, _SWATCH_SIZE)
        icon.icon_pixels_float = [*(value / 255.0 for value in color), 1.0] * _SWATCH_SIZE**2
    return int(_icons[name].icon_id)


@persistent
def _forget(path: str) -> None:
    """Handler: remove the shown cloud before another file is opened."""
    view.remove()


ATTACHED = (bpy.types.Scene, "synthroads_cloud_view", SYNTHROADS_PG_cloud_view)
HANDLERS = {"load_pre": _forget}


def register() -> None:
    """Create Blender's collection of preview icons for colours."""
    global _icons
    _icons = bpy.utils.previews.new()


def unregister() -> None:
    """Remove the shown cloud and the collection of icons."""
    view.remove()
    bpy.utils.previews.remove(_icons)
