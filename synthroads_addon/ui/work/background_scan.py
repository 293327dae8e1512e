"""Entry point of a second Blender without a window, which `rendered_scan` starts to scan a copy of the user's file.

It says on its standard output, in lines of JSON after `MARK`, how far it is and how it ended.
"""

from __future__ import annotations

import json
import os
import sys
import threading
import traceback
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NoReturn

import bpy

from ...base.class_mapping import ClassMapping
from ...base.errors import InputError
from ...base.progress import Progress, StageTimer
from ...base.remarks import collected_remarks
from ...blender.cameras import renders_returns
from ...blender.scene.evaluated import scanned_scene
from ...jobs.open_scene import ForeignScene, RoadScene
from ...jobs.scan_scene import route_site
from ...road.geometry import RoadGeometry
from ...road.parameters import RoadParameters
from ...scanning.colour.colour import takes_nodes
from ...scanning.platforms.over_scene import SceneRoute
from ...scenario.inputs import ScenarioInputs
from ...scenario.scenario import Scenario
from .scan_steps import progress_of_stages

MARK = "synthroads-scan: "
"""Begins what is said in a line; Blender has lines of its own there."""


def main(path: str) -> NoReturn:
    """Run the job file that `rendered_scan.save_open_scene` has written, and end the process."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    code = 0
    try:
        _say(done=_scan(json.loads(Path(path).read_text(encoding="utf-8"))))
    except InputError as error:
        _say(error=(str(error).removesuffix(f": {error.allowed}"), error.allowed))
    except BaseException:
        traceback.print_exc()
        sys.stderr.flush()
        code = 1
    # Blender's own way out can crash, and may save the user's preferences.
    os._exit(code)


def _scan(job: dict[str, Any]) -> dict[str, Any]:
    """Open the copied file and scan it; return counts of points, timed stages, warnings of the scene and remarks."""
    bpy.ops.wm.open_mainfile(filepath=job["file"], load_ui=False, use_scripts=job["scripts"])
    scene = bpy.data.scenes[job["scene"]]
    window = bpy.context.window_manager.windows[0]
    window.scene, window.view_layer = scene, scene.view_layers[job["view_layer"]]
    scenario = Scenario.from_dict(job["scenario"])
    colour = scenario.colour.settings(scenario.fidelity)
    timer = StageTimer(_overall_progress(takes_nodes(colour) or renders_returns(colour)))
    with bpy.context.temp_override(window=window), collected_remarks() as remarks:
        counts, warnings = (_scan_road if "parameters" in job else _scan_visible)(job, scenario, timer)
    return {"counts": counts, "stages": timer.stages, "warnings": list(warnings), "remarks": remarks}


def _scan_road(job: dict[str, Any], scenario: Scenario, timer: StageTimer) -> tuple[dict[str, Any], Sequence[str]]:
    road = RoadGeometry(RoadParameters.from_dict(job["parameters"]))
    scene = RoadScene(scenario, road, ScenarioInputs.read(scenario), road_id=job["road"])
    return scene.scan(Path(job["folder"]), timer), scene.read().warnings


def _scan_visible(job: dict[str, Any], scenario: Scenario, timer: StageTimer) -> tuple[dict[str, Any], Sequence[str]]:
    classes = ClassMapping.from_dict(job["classes"]) if job["classes"] else None
    factor, inputs = scenario.scan.traffic_speed_factor, ScenarioInputs.read(scenario)
    with timer.stage("scene mesh"):
        further = {"number_objects": True, "class_ids": inputs.scheme.source_ids(), "visible": job["visible"]}
        scene = scanned_scene(classes=classes, speed_factor=factor, **further)
    if not len(scene.static) and not scene.moving:
        raise InputError("Scene", None, "nothing visible has faces that can be scanned")
    site = route_site(scenario, inputs, SceneRoute(**job["route"]), scene.static)
    return ForeignScene(site, scene).scan(Path(job["folder"]), timer), scene.warnings


def _overall_progress(by_return: bool) -> Progress:
    """Map stage progress to overall progress.

    Args:
        by_return: whether returns are rendered, during the scan; images are rendered before.
    """
    rendered = 0.1 if by_return else 0.6
    spans = {
        "scene mesh": (0.0, 0.05),
        "caster": (0.05, 0.1),
        "images": (0.1, rendered),
        "scan": (rendered, 1.0),
        "files": (1.0, 1.0),
    }

    return progress_of_stages(spans, lambda share: _say(share=share))


def _say(**what: Any) -> None:
    sys.stdout.write(f"{MARK}{json.dumps(what)}\n")
    sys.stdout.flush()


def _end_with_parent() -> None:
    """End this process as soon as standard input closes, which it does when the parent process ends in any way."""
    while os.read(0, 1024):
        pass
    os._exit(130)
