"""The button that scans. The work itself is `scan_job`'s."""

from __future__ import annotations

import bpy

from ...blender.model.read_back import edited_parameters
from ...blender.model.store import find_road, objects_of, recall
from ..fields.preferences import with_preferences
from .common import is_free
from .job import PanelJob
from .long_operator import LongOperator
from .scan_job import RoadScan, Written, scan_work


class SYNTHROADS_OT_scan(LongOperator, bpy.types.Operator):
    """Scan everything that is visible, and write the labelled point cloud with pictures and the road's parameters"""

    bl_idname = "synthroads.scan"
    bl_label = "Scan"

    nothing_done = "nothing was written"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """A road must have been built."""
        if not is_free(cls, context):
            return False
        if find_road(context.scene) is None:
            cls.poll_message_set("Build a road first")
            return False
        return True

    def job(self, context: bpy.types.Context) -> PanelJob[Written]:
        """Return the scan that the panel asks for: the road as it is edited now, the scanner as it is set now."""
        return PanelJob("Scan", scan_work(asked_for(context)))

    def succeed(self, context: bpy.types.Context, job: PanelJob[Written]) -> str:
        """Say what was written."""
        global _last
        assert job.result
        _last = job.result
        return f"{_last.points:,} points written to {_last.target}"


def asked_for(context: bpy.types.Context) -> RoadScan:
    """Return what the panel's button scans; raise `InputError` if that can't be done."""
    settings, road = context.scene.synthroads, find_road(context.scene)
    assert road  # poll() has seen it
    parameters, built = recall(road)
    parameters = edited_parameters(parameters, objects_of(road))
    shown = settings.scenario()
    # The road and its fidelity are those that it was built with.
    chosen = {name: getattr(shown, name) for name in ("scan", "colour", "cloud", "outputs", "twin", "materials_table")}
    scenario = with_preferences(built.model_copy(update=chosen))
    return RoadScan(scenario, parameters, settings.folder(), settings.overwrite)


_last: Written | None = None


def last_written() -> Written | None:
    """Return what the last scan of this session has written."""
    return _last


CLASSES = (SYNTHROADS_OT_scan,)
