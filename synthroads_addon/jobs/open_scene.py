"""Scenes in the open file and their scans: a road that is built, or what others made. For the main thread only."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, Self

from ..base.progress import StageTimer
from ..blender.files import save_scene
from ..blender.materials.textures import packed_textures
from ..blender.model.build import RoadModel, build_road
from ..blender.model.store import remember
from ..blender.scene.evaluated import scanned_scene
from ..blender.scene.labelled import labelled_scene
from ..blender.services import BlenderServices
from ..blender.things.model_builder import BuildRequest
from ..road.geometry import RoadGeometry
from ..scanning.epochs.truth import EpochTruth
from ..scanning.plan import ScanPlan
from ..scanning.scene.motion import ScannedScene
from ..scenario.inputs import ScenarioInputs
from ..scenario.scenario import Scenario
from ..twin.scene.registry import write_scene
from .scan.arrays import ArraySink
from .scan.by_section import scan_by_section
from .scan.plan import Site


@dataclass(frozen=True)
class ForeignScene:
    """An open scene made elsewhere, which is scanned as it is and never rebuilt.

    Attributes:
        site: of its scan.
        scene: as it was read.
        area: of what is built of it: nothing, m2.
    """

    site: Site
    scene: ScannedScene
    area: ClassVar[float] = 0.0

    def rebuild(self, changes: Mapping[str, Any]) -> ScannedScene:
        """Return the scene unchanged: settings of the model don't apply to it."""
        return self.scene

    def with_settings(self, scenario: Scenario, model_stays: bool) -> ForeignScene:
        """Return a copy with another scenario; `model_stays` has no effect, see `RoadScene.with_settings`."""
        return replace(self, site=replace(self.site, scenario=scenario))

    def scan(self, to: Path | ArraySink, timer: StageTimer) -> dict[str, Any]:
        """Scan the scene into a folder's cloud and previews, or into memory; return the counts as JSON data."""
        return self.site.scan(self.scene, BlenderServices(), to, timer)


@dataclass
class RoadScene:
    """A road as a scene in the open Blender file, which is built, read and scanned by a scenario.

    Attributes:
        scenario: the job.
        road: that the file shows, or is to show.
        inputs: what the files that the scenario names hold.
        model: that was built for it; None before, and in a file that shows the road already.
        scene: of that model, as it was read; None before.
        road_id: of the road in the file; that of the one that is meant in it if empty.
        warnings: what isn't scanned as the scene, or an asset in it, declares it: known once it is read.
        truth: of the changes to another epoch of the road; None where there is none.
    """

    scenario: Scenario
    road: RoadGeometry
    inputs: ScenarioInputs
    model: RoadModel | None = None
    scene: ScannedScene | None = None
    road_id: str = ""
    warnings: tuple[str, ...] = ()
    truth: EpochTruth | None = None

    @classmethod
    def of(cls, scenario: Scenario, road: RoadGeometry) -> Self:
        """Return a road's scene by a scenario whose files are read now."""
        return cls(scenario, road, ScenarioInputs.read(scenario))

    @cached_property
    def site(self) -> Site:
        """Return the site of the road's scan: path, conditions and preview raster; cached."""
        return Site.of_road(self.scenario, self.road, self.inputs, self.truth)

    @property
    def area(self) -> float:
        """Return the area of the model in plan, m2: the road's length times the full width of its terrain."""
        terrain = self.road.parameters.terrain
        return 2.0 * (terrain.half_width if terrain else self.scenario.road.half_width) * self.road.length

    def build(self) -> RoadModel:
        """Build the road's model in the open file, in place of the one before, and return it."""
        settings, parameters = self.scenario.settings(), self.road.parameters
        tolerance, detail, materials = settings.tolerance, settings.vegetation_detail, self.inputs.materials
        geometry = self.road if self.road.epochs else None
        self.model = build_road(BuildRequest(parameters, tolerance, detail, geometry=geometry, user_table=materials))
        self.scene = None
        return self.model

    def read(self) -> ScannedScene:
        """Return the open file's evaluated scene for scanning, cached until the model is rebuilt."""
        if self.scene is None:
            speed_factor, class_ids = self.scenario.scan.traffic_speed_factor, self.inputs.scheme.source_ids()
            road = self.model.road_id if self.model else self.road_id
            self.scene = scanned_scene(geometry=self.road, speed_factor=speed_factor, class_ids=class_ids, road=road)
        self.warnings = self.scene.warnings
        return self.scene

    def rebuild(self, changes: Mapping[str, Any]) -> ScannedScene:
        """Build the model with fields of the scenario changed, and return its scene; the scenario stays as it is."""
        changed_scene = RoadScene(self.scenario.model_copy(update=changes), self.road, self.inputs)
        self.model, self.scene = changed_scene.build(), changed_scene.read()
        return self.scene

    def with_settings(self, scenario: Scenario, model_stays: bool) -> RoadScene:
        """Return the road under another scenario that names the same files; model and scene stay if ``model_stays``."""
        return RoadScene(scenario, self.road, self.inputs, *((self.model, self.scene) if model_stays else ()))

    def plan(self) -> ScanPlan:
        """Return the plan of the scan with every default resolved; builds the ray casters."""
        return self.site.plan(self.read(), BlenderServices())

    def scan(self, to: Path | ArraySink, timer: StageTimer) -> dict[str, Any]:
        """Scan the scene into a folder's cloud and previews, or into memory; return the counts as JSON data."""
        with timer.stage("scene mesh"):
            scene = self.read()
        return self.site.scan(scene, BlenderServices(), to, timer)

    def build_and_scan(self, to: Path | ArraySink, timer: StageTimer) -> dict[str, Any]:
        """Build the model unless it is there and scan it into files or memory, a long road section by section.

        Return the counts as JSON data, empty if the scenario asks for nothing that is made from points.
        """
        scenario = self.scenario
        if scenario.section_length(self.road.length) is not None:
            counts, self.warnings = scan_by_section(self.site, self.road, to, timer)
            return counts
        with timer.stage("model"):
            remember((self.model or self.build()).root, self.road.parameters, scenario, "")
        return self.scan(to, timer) if scenario.scans else {}

    def write_files(self, folder: Path, timer: StageTimer) -> dict[str, Any]:
        """Build the model unless it is there, scan it and write the files made from it; return the counts."""
        counts = self.build_and_scan(folder, timer)
        if "scene" in self.scenario.outputs:
            write_scene_files(self.scenario, self.road, self.inputs, folder, timer, self.road_id)
        return counts


def write_scene_files(
    scenario: Scenario, road: RoadGeometry, inputs: ScenarioInputs, folder: Path, timer: StageTimer, road_id: str = ""
) -> None:
    """Write the open file's scene, as it stands, in the formats of a scenario: Blender's own, and others' with labels.

    Args:
        scenario: the job.
        road: that the scene shows.
        inputs: what the files that the scenario names hold.
        folder: where the files go.
        timer: of the job's stages.
        road_id: of the road in the file; that of the one that is meant in it if empty.
    """
    if "blend" in scenario.scene_formats:
        with timer.stage("scene file"), packed_textures():
            save_scene(folder / "scene.blend")
    if others := [name for name in scenario.scene_formats if name != "blend"]:
        with timer.stage("scene formats"):
            scene = labelled_scene(road, inputs.scheme, inputs.materials, scenario.title, road_id)
            for name in others:
                write_scene(scene, name, folder)
