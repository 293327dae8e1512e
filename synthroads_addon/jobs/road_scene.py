"""A road in Blender's open file: its model, its scan, and the file itself. Must be used in the main thread."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..base.errors import InputError
from ..base.progress import StageTimer
from ..blender.files import empty_file, save_scene
from ..blender.materials import vary
from ..blender.model.build import RoadModel, build_road
from ..blender.model.store import remember
from ..blender.scene.evaluated import scanned_scene
from ..blender.services import BlenderServices
from ..road.geometry import RoadGeometry
from ..scanning.plan import ScanConditions, ScanPlan
from ..scanning.scene.motion import ScannedScene
from ..scenario.scenario import Scenario
from .scan.by_section import scan_by_section
from .scan.files import CloudFiles, record_to_files
from .scan.plan import plan_scan, road_path, road_view


@dataclass(frozen=True)
class RoadScene:
    """A road's model in the open file, and its meshes as they are scanned."""

    model: RoadModel
    scene: ScannedScene


def make_scene_files(
    scenario: Scenario, road: RoadGeometry, folder: Path, timer: StageTimer, built: RoadScene | None, new_file: bool
) -> dict[str, Any]:
    """Build a road's model, unless it stands already, scan it, and write the files that need it.

    Args:
        scenario: the job.
        road: that is built.
        folder: for the files.
        timer: of the stages.
        built: the model that stands, with its scene.
        new_file: empty the open file first.

    Returns:
        the counts, as JSON data.
    """
    if new_file:
        empty_file()
    if scenario.section_length(road.length) is not None:
        return scan_by_section(scenario, road.parameters, folder, timer)
    with timer.stage("model"):
        model = built.model if built else build_model(scenario, road)
        remember(model.collection, road.parameters, scenario, "")
    counts: dict[str, Any] = {}
    if set(scenario.outputs) & {"cloud", "previews"}:
        counts = scan_road(scenario, road, folder, timer, built.scene if built else None)
    if "scene" in scenario.outputs:
        with timer.stage("scene file"):
            save_scene(folder / "scene.blend")
    return counts


def build_model(scenario: Scenario, road: RoadGeometry) -> RoadModel:
    """Build a road in the open file as a scenario asks for it, with the materials of the scenario's own table."""
    settings, parameters = scenario.settings(), road.parameters
    model = build_road(parameters, settings.tolerance, settings.vegetation_detail)
    if scenario.materials_table:
        vary(parameters.materials, parameters.environment, scenario.own_materials())
    return model


def read_scene(scenario: Scenario, road: RoadGeometry) -> ScannedScene:
    """Return the open scene, which shows a road, as it is scanned."""
    return scanned_scene(geometry=road, speed_factor=scenario.scan.traffic_speed_factor)


def plan_road_scan(scenario: Scenario, road: RoadGeometry, scene: ScannedScene) -> ScanPlan:
    """Return the scan of a scene that shows a road.

    Raises:
        InputError: nothing visible could be scanned, or see `plan_scan`.
    """
    refuse_empty(scene)
    conditions = ScanConditions.of(road.parameters)
    return plan_scan(scenario, scene, road_path(scenario, road), BlenderServices(), conditions)


def scan_road(
    scenario: Scenario, road: RoadGeometry, folder: Path, timer: StageTimer, scene: ScannedScene | None = None
) -> dict[str, Any]:
    """Scan the open scene, which shows a road, and write the cloud and the previews.

    Args:
        scenario: the job.
        road: that the scene shows.
        folder: for the files.
        timer: of the stages.
        scene: what is scanned, where that was read already.

    Returns:
        the counts, as JSON data.

    Raises:
        InputError: see `plan_road_scan` and `check_colour`.
    """
    with timer.stage("scene mesh"):
        scene = scene or read_scene(scenario, road)
    with timer.stage("caster"):
        plan = plan_road_scan(scenario, road, scene)
    return record_to_files([plan], road_cloud_files(scenario, road, folder, plan), timer)


def road_cloud_files(scenario: Scenario, road: RoadGeometry, folder: Path, plan: ScanPlan) -> CloudFiles:
    """Return the sink of a road's cloud and previews."""
    view = road_view(road) if "previews" in scenario.outputs else None
    epsg = road.parameters.metadata.epsg
    return CloudFiles(scenario, folder, plan.target.origin, plan.path.typical_range, epsg, view)


def refuse_empty(scene: ScannedScene) -> None:
    """Refuse a scene without anything to scan."""
    if not len(scene.static) and not scene.moving:
        raise InputError("Scene", None, "nothing that could be scanned is visible")
