"""`RoadScene`: a road in Blender's open file, its scan, and the file itself. Must be used in the main thread."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from ..base.progress import StageTimer
from ..blender.files import save_scene
from ..blender.materials import vary
from ..blender.model.build import RoadModel, build_road
from ..blender.model.store import remember
from ..blender.scene.evaluated import scanned_scene
from ..blender.services import BlenderServices
from ..road.geometry import RoadGeometry
from ..scanning.scene.motion import ScannedScene
from ..scenario.scenario import Scenario
from .job_files import OF_POINTS
from .scan.by_section import scan_by_section
from .scan.plan import Site


@dataclass
class RoadScene:
    """A road in the open file: built, read and scanned as a scenario asks for it.

    Attributes:
        scenario: the job.
        road: that the file shows, or is to show.
        model: that was built for it; None before, and in a file that shows the road already.
        scene: of that model, as it was read; None before.
    """

    scenario: Scenario
    road: RoadGeometry
    model: RoadModel | None = None
    scene: ScannedScene | None = None

    @cached_property
    def site(self) -> Site:
        """The site of the road's scan."""
        return Site.of_road(self.scenario, self.road)

    @property
    def area(self) -> float:
        """Return the area of the model, m2."""
        terrain = self.road.parameters.terrain
        return 2.0 * (terrain.half_width if terrain else self.scenario.road.half_width) * self.road.length

    def build(self) -> RoadModel:
        """Build the road in place of that before, with the materials of the scenario's own table."""
        settings, parameters = self.scenario.settings(), self.road.parameters
        model = build_road(parameters, settings.tolerance, settings.vegetation_detail)
        if self.scenario.materials_table:
            vary(parameters.materials, parameters.environment, self.scenario.own_materials())
        return model

    def read(self) -> ScannedScene:
        """Return the open scene, which shows the road, as it is scanned."""
        factor, class_ids = self.scenario.scan.traffic_speed_factor, self.scenario.cloud.scheme().source_ids()
        return scanned_scene(geometry=self.road, speed_factor=factor, class_ids=class_ids)

    def rebuild(self, changes: Mapping[str, Any]) -> ScannedScene:
        """Return the scene of the model with fields of the scenario changed, which is built in place of that before."""
        self.model = RoadScene(self.scenario.model_copy(update=changes), self.road).build()
        self.scene = self.read()
        return self.scene

    def scan(self, folder: Path, timer: StageTimer) -> dict[str, Any]:
        """Scan the scene and write the cloud and the previews; return the counts as JSON data, see `Site.scan`."""
        with timer.stage("scene mesh"):
            scene = self.scene or self.read()
        return self.site.scan(scene, BlenderServices(), folder, timer)

    def write_files(self, folder: Path, timer: StageTimer) -> dict[str, Any]:
        """Build the model, unless it stands, scan it, and write the files that need it; return the counts."""
        scenario = self.scenario
        if scenario.section_length(self.road.length) is not None:
            return scan_by_section(self.site, self.road, folder, timer)
        with timer.stage("model"):
            model = self.model or self.build()
            remember(model.collection, self.road.parameters, scenario, "")
        counts = self.scan(folder, timer) if set(scenario.outputs) & set(OF_POINTS) else {}
        if "scene" in scenario.outputs:
            with timer.stage("scene file"):
                save_scene(folder / "scene.blend")
        return counts
