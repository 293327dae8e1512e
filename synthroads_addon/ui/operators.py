"""What the panel's buttons do. The work itself is the library's; see `pipeline`."""

from __future__ import annotations

import traceback

import bpy

from ..blender.kept_road import find_road, objects_of, recall, remember
from ..core.errors import Cancelled, InputError
from ..core.parameters.geometry import RoadGeometry
from ..core.parameters.sampler import sample_road
from . import scan_job
from .scan_job import ScanJob, scanning
from .view import look_along

_TICK = 0.1
"""Seconds between two looks at a running scan."""


class SYNTHROADS_OT_build(bpy.types.Operator):
    """Make a road from these settings. It takes the place of the road built before; other objects stay as they are"""

    bl_idname = "synthroads.build"
    bl_label = "Build Road"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012 (Blender reads a plain set)

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Object mode, and no scan at work."""
        return _is_free(cls, context)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Build, and show the first road that is built."""
        first = find_road(context.scene) is None
        context.window.cursor_set("WAIT")
        result = self.execute(context)
        context.window.cursor_set("DEFAULT")
        road = find_road(context.scene)
        if first and road and isinstance(context.space_data, bpy.types.SpaceView3D):
            look_along(context.space_data, recall(road)[0])
        return result

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Sample the parameters and build the model."""
        from ..blender.model import build_road

        settings = context.scene.synthroads
        try:
            scenario = settings.scenario()
            parameters = sample_road(scenario.road, scenario.seed, scenario.title)
            fidelity = scenario.settings()
            model = build_road(parameters, fidelity.tolerance, fidelity.vegetation_detail)
        except InputError as error:
            return _refuse(self, error)
        remember(model.collection, parameters, scenario, settings.road_values())
        self.report({"INFO"}, f"Built {parameters.alignment.length:,.0f} m of road")
        return {"FINISHED"}


class SYNTHROADS_OT_scan(bpy.types.Operator):
    """Scan everything that is visible, and write the labelled point cloud with pictures and the road's parameters"""

    bl_idname = "synthroads.scan"
    bl_label = "Scan"
    bl_options = {"REGISTER"}  # noqa: RUF012

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """A road must have been built."""
        if not _is_free(cls, context):
            return False
        if find_road(context.scene) is None:
            cls.poll_message_set("Build a road first")
            return False
        return True

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Begin; the scan runs beside the window, which looks at it now and then."""
        try:
            job = scan_job.latest = _scan_of(context)
        except InputError as error:
            return _refuse(self, error)
        job.start()
        self._timer = context.window_manager.event_timer_add(_TICK, window=context.window)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Show how far the scan is, or that it has ended."""
        job = scan_job.latest
        assert job
        if event.type == "ESC" and event.value == "PRESS" and job.running:
            job.stop()
            return {"RUNNING_MODAL"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        if job.running:
            context.workspace.status_text_set(_draw_status)
            _redraw_sidebars(context)
            return {"PASS_THROUGH"}
        return self._end(context, job)

    def cancel(self, context: bpy.types.Context) -> None:
        """Stop: another file is opened, or the window closed."""
        stop_scan()
        self._leave(context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Scan without a window, to the end."""
        try:
            job = _scan_of(context)
            job.run()
        except InputError as error:
            return _refuse(self, error)
        return self._succeed(job)

    def _end(self, context: bpy.types.Context, job: ScanJob) -> set[str]:
        self._leave(context)
        if job.error is None:
            return self._succeed(job)
        if isinstance(job.error, Cancelled):
            self.report({"WARNING"}, "Scan cancelled; nothing was written")
            return {"CANCELLED"}
        if isinstance(job.error, InputError):
            return _refuse(self, job.error)
        traceback.print_exception(job.error)
        self.report({"ERROR"}, f"Scan failed, nothing was written: {job.error!r} (the console says more)")
        return {"CANCELLED"}

    def _leave(self, context: bpy.types.Context) -> None:
        context.window_manager.event_timer_remove(self._timer)
        _reset_status()
        _redraw_sidebars(context)

    def _succeed(self, job: ScanJob) -> set[str]:
        scan_job.latest = job
        self.report({"INFO"}, f"{job.points:,} points written to {job.target}")
        return {"FINISHED"}


class SYNTHROADS_OT_cancel_scan(bpy.types.Operator):
    """Stop the scan; nothing is written"""

    bl_idname = "synthroads.cancel_scan"
    bl_label = "Cancel Scan"

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Have it stop; the scan's own operator notices when it has."""
        if scan_job.latest:
            scan_job.latest.stop()
        return {"FINISHED"}


def stop_scan() -> None:
    """Stop a scan that is at work, and wait until it has."""
    if scanning() and scan_job.latest:
        scan_job.latest.stop(wait=True)
        _reset_status()


def _is_free(operator: type[bpy.types.Operator], context: bpy.types.Context) -> bool:
    if scanning():
        operator.poll_message_set("A scan is running")
        return False
    if context.mode != "OBJECT":
        operator.poll_message_set("Go back to object mode first")
        return False
    return True


def _scan_of(context: bpy.types.Context) -> ScanJob:
    """Return the scan that the panel asks for: the road as it is edited now, the scanner as it is set now."""
    from ..blender.read_back import edited_parameters
    from ..blender.scene import scanned_scene

    settings, road = context.scene.synthroads, find_road(context.scene)
    assert road  # poll() has seen it
    parameters, built = recall(road)
    parameters = edited_parameters(parameters, objects_of(road))
    scenario = built.model_copy(update={"scan": settings.scenario().scan})
    target = settings.folder()
    geometry = RoadGeometry(parameters)
    scene = scanned_scene(geometry=geometry, speed_factor=scenario.scan.traffic_speed_factor)
    if len(scene.static.triangles) == 0 and not scene.moving:
        raise InputError("Scene", None, "nothing that could be scanned is visible")
    return ScanJob(scenario, parameters, scene, target, settings.overwrite)


def _refuse(operator: bpy.types.Operator, error: InputError) -> set[str]:
    """Show what is wrong in the panel's words."""
    message = str(error).replace("--overwrite replaces it", "tick Replace Files, or choose another folder")
    operator.report({"ERROR"}, message.replace("--output", "Output"))
    return {"CANCELLED"}


def _draw_status(header: bpy.types.Header, context: bpy.types.Context) -> None:
    """Draw the status bar during a scan."""
    job, layout = scan_job.latest, header.layout
    if job is None:
        return
    layout.label(text="", icon="EVENT_ESC")
    layout.separator(factor=2.0)
    layout.label(text="Cancel Scan")
    layout.separator_spacer()
    layout.label(text="SynthRoads")
    layout.progress(factor=job.share, text=job.state)
    layout.separator_spacer()


def _reset_status() -> None:
    """Give the status bar back to Blender; what draws it is the same in every workspace."""
    bpy.data.workspaces[0].status_text_set(None)


def _redraw_sidebars(context: bpy.types.Context) -> None:
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            for region in area.regions:
                if area.type == "VIEW_3D" and region.type == "UI":
                    region.tag_redraw()


CLASSES = (SYNTHROADS_OT_build, SYNTHROADS_OT_scan, SYNTHROADS_OT_cancel_scan)
