"""`Site`: where a scenario's scan takes place, whoever made the scene; and its scan into files."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.errors import InputError
from ...base.progress import StageTimer
from ...cloud.tools.previews import TopView
from ...road.geometry import RoadGeometry
from ...scanning.blocks import Blocks
from ...scanning.plan import ScanConditions, ScanPlan, SceneServices
from ...scanning.platforms.guides import RoadGuide
from ...scanning.platforms.path import Path as ScanPath
from ...scanning.scene.motion import ScannedScene
from ...scenario.scan import scanner_setting
from ...scenario.scenario import Scenario
from .files import CloudFiles, record_to_files
from .plan import beam_rings, plan_scan


@dataclass(frozen=True)
class Site:
    """Where a scenario's scan takes place.

    Attributes:
        scenario: the job.
        path: the scanner's.
        conditions: those of the scene's road.
        view: raster for the previews, which are written if it is given.
    """

    scenario: Scenario
    path: ScanPath
    conditions: ScanConditions = field(default_factory=ScanConditions)
    view: TopView | None = None

    @classmethod
    def of_road(cls, scenario: Scenario, road: RoadGeometry) -> Site:
        """Return the site of a road's scan."""
        view = road_view(road) if "previews" in scenario.outputs else None
        path = scenario.scan.platform.make_path(RoadGuide(road))
        return cls(scenario, path, ScanConditions.of(road.parameters), view)

    @property
    def cut(self) -> Blocks:
        """Return the blocks of pulses that the scan is cut into."""
        return Blocks(scanner_setting(self.scenario.scan), self.path, 1 + sum(beam_rings(self.scenario)))

    def plan(self, scene: ScannedScene, services: SceneServices) -> ScanPlan:
        """Return the scan of a scene, see `plan_scan`.

        Raises:
            InputError: there is nothing that could be scanned, or see `plan_scan`.
        """
        if not len(scene.static) and not scene.moving:
            raise InputError("Scene", None, "nothing that could be scanned is visible")
        return plan_scan(self.scenario, scene, self.path, services, self.conditions)

    def files(self, folder: Path, origin: NDArray[np.float64]) -> CloudFiles:
        """Return the sink that writes the cloud and the previews; the origin (3,) is near the points, map, m."""
        return CloudFiles(self.scenario, folder, origin, self.path.typical_range, self.conditions.epsg, self.view)

    def scan(self, scene: ScannedScene, services: SceneServices, folder: Path, timer: StageTimer) -> dict[str, Any]:
        """Scan a scene and write the cloud and the previews; return the counts as JSON data.

        Raises:
            InputError: see `plan` and `check_colour`.
        """
        with timer.stage("caster"):
            plan = self.plan(scene, services)
        return record_to_files([plan], self.files(folder, plan.target.origin), timer)


def road_view(geometry: RoadGeometry) -> TopView:
    """Return a raster for the previews that holds the whole swath of a road."""
    origin = np.array(geometry.parameters.transform.translate)[:2]
    stations = np.linspace(0.0, geometry.length, 50)
    terrain = geometry.parameters.terrain
    reach = terrain.half_width if terrain else float(np.abs(geometry.offsets(stations)).max())
    plan, heading, _ = geometry.alignment.frame(stations)
    left = np.stack([-np.sin(heading), np.cos(heading)], axis=1)
    chord = plan[-1] - plan[0]
    normal = np.array([-chord[1], chord[0]]) / max(np.hypot(*chord), 1e-9)
    edges = np.concatenate([plan + reach * left, plan - reach * left])
    across = (edges - plan[0]) @ normal
    return TopView(plan[0] + origin, plan[-1] + origin, float(across.min()) - 2, float(across.max()) + 2)
