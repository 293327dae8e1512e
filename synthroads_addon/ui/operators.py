"""What the panel's buttons do. The work itself is the library's; see `pipeline`."""

from __future__ import annotations

import json
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import bpy

from ..core.errors import InputError
from ..core.files import output_folder
from ..core.parameters.geometry import RoadGeometry
from ..core.parameters.model import RoadParameters
from ..core.parameters.sampler import sample_road
from ..core.schema import canonical_json
from ..pipeline import FILES, ScanToFiles, make_scan

STORED = "synthroads_parameters"
"""Custom property of the scene that holds the parameter set of the model in it, as JSON."""


def stored_parameters(scene: bpy.types.Scene) -> RoadParameters | None:
    """Return the parameter set of the model in a scene, if there is one."""
    text = scene.get(STORED)
    return RoadParameters.from_dict(json.loads(text), source="stored parameters") if text else None


class SYNTHROADS_OT_build(bpy.types.Operator):
    """Make a road from the seed and build its model"""

    bl_idname = "synthroads.build"
    bl_label = "Build Road"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012 (Blender reads a plain set)

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Sample the parameters and build the model."""
        from ..blender.model import build_road

        try:
            scenario = context.scene.synthroads.scenario()
            parameters = sample_road(scenario.road, scenario.seed, scenario.title)
            settings = scenario.settings()
            build_road(parameters, settings.tolerance, settings.vegetation_detail)
        except InputError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        context.scene[STORED] = parameters.to_json()
        self.report({"INFO"}, f"Built {parameters.metadata.identifier}: {len(parameters.objects)} objects")
        return {"FINISHED"}


class SYNTHROADS_OT_scan(bpy.types.Operator):
    """Scan the model that was built and write the labelled cloud. Esc cancels"""

    bl_idname = "synthroads.scan"
    bl_label = "Scan"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """A road must have been built."""
        return bool(context.scene.get(STORED))

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Begin; the blocks are computed between the window's own events."""
        if not self._begin(context):
            return {"CANCELLED"}
        manager = context.window_manager
        manager.progress_begin(0, 100)
        self._timer = manager.event_timer_add(0.05, window=context.window)
        manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Take the next block, or stop."""
        if event.type == "ESC":
            return self._end(context, cancelled=True)
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        try:
            share = next(self._steps, None)
        except InputError as error:
            self.report({"ERROR"}, str(error))
            return self._end(context, cancelled=True)
        if share is None:
            return self._end(context, cancelled=False)
        context.window_manager.progress_update(100 * share)
        context.workspace.status_text_set(f"SynthRoads scans: {100 * share:.0f} %   Esc cancels")
        return {"RUNNING_MODAL"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Scan without a window."""
        if not self._begin(context):
            return {"CANCELLED"}
        try:
            for _ in self._steps:
                pass
        except InputError as error:
            self.report({"ERROR"}, str(error))
            return self._end(context, cancelled=True)
        return self._end(context, cancelled=False)

    def _begin(self, context: bpy.types.Context) -> bool:
        from ..blender.scene import scene_mesh

        self._stack, self._timer = ExitStack(), None
        try:
            scenario = context.scene.synthroads.scenario()
            parameters = stored_parameters(context.scene)
            assert parameters  # poll() has seen it
            target = Path(bpy.path.abspath(context.scene.synthroads.output))
            names = [name for output in scenario.outputs for name in FILES[output]]
            self._folder = self._stack.enter_context(output_folder(target, names, overwrite=True))
            geometry = RoadGeometry(parameters)
            mesh = scene_mesh()
            self._task = ScanToFiles(scenario, make_scan(scenario, geometry, mesh), geometry, self._folder)
            (self._folder / "parameters.json").write_text(parameters.to_json(), encoding="utf-8")
        except InputError as error:
            self._stack.__exit__(type(error), error, None)
            self.report({"ERROR"}, str(error))
            return False
        self._steps = self._task.run()
        return True

    def _end(self, context: bpy.types.Context, *, cancelled: bool) -> set[str]:
        self._steps.close()
        if self._timer:
            context.window_manager.event_timer_remove(self._timer)
            context.window_manager.progress_end()
            context.workspace.status_text_set(None)
        if cancelled:
            stop = KeyboardInterrupt()
            self._stack.__exit__(type(stop), stop, None)
            self.report({"WARNING"}, "Scan cancelled; nothing was written")
            return {"CANCELLED"}
        summary: dict[str, Any] = self._task.summary()
        (self._folder / "report.json").write_text(canonical_json({"counts": summary}), encoding="utf-8")
        self._stack.close()
        self.report({"INFO"}, f"{summary['points']:,} points written to {context.scene.synthroads.output}")
        return {"FINISHED"}


CLASSES = (SYNTHROADS_OT_build, SYNTHROADS_OT_scan)
