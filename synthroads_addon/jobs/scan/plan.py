"""A scenario resolved into a `ScanPlan`: every default of fidelity, device, platform and weather is filled in here.

`Site`: where a scenario's scan takes place, whoever made the scene; and its scan into files or arrays.
"""

from dataclasses import dataclass, field
from pathlib import Path
from tempfile import gettempdir
from typing import Any, Self

from ...base.arrays import Float
from ...base.errors import InputError
from ...base.progress import StageTimer
from ...cloud.tools.previews import TopView
from ...road.geometry import RoadGeometry
from ...scanning.blocks import Blocks
from ...scanning.epochs.truth import EpochTruth
from ...scanning.forecast import check_scan_size, forecast_scan
from ...scanning.parts.conditions import ScanConditions
from ...scanning.parts.layers import SceneServices
from ...scanning.parts.reception import Reception
from ...scanning.parts.run import Run
from ...scanning.plan import ScanPlan
from ...scanning.platforms.guides import RoadGuide
from ...scanning.platforms.path import Path as ScanPath
from ...scanning.platforms.path import epoch_of
from ...scanning.scene.classify import classify_scene
from ...scanning.scene.motion import ScannedScene
from ...scanning.scene.target import Target
from ...scanning.sway import with_motion
from ...scenario.choice import check_choice
from ...scenario.inputs import ScenarioInputs
from ...scenario.scenario import Scenario
from ..images.files import ImageFiles
from .arrays import ArraySink
from .files import CloudFiles
from .outages import outages_in_tunnels
from .parts import (
    SceneMaterials,
    Survey,
    make_atmosphere,
    make_emission,
    make_layers,
    make_reflection,
    make_relief,
)
from .sink import CloudSink, record_cloud


def check_scan(scenario: Scenario, is_foreign: bool = False) -> ScenarioInputs:
    """Raise an InputError for a scan that can't be done, before any work starts; return what its files hold.

    Args:
        scenario: the job.
        is_foreign: whether the scene was built elsewhere.

    Raises:
        InputError: see `check_colour` and `check_choice`; or the device can't do it, or a table of materials or classes
            can't be read.
    """
    if scenario.scans:
        from ...blender.cameras import check_colour  # Blender takes a second to start: other outputs need none

        check_colour(scenario.colour.settings(scenario.fidelity))
    check_choice(scenario, is_foreign)
    return ScenarioInputs.read(scenario)


def plan_scan(survey: Survey, scene: ScannedScene, path: ScanPath) -> ScanPlan:
    """Return the complete plan of the scan of a scene along a path, every default resolved; builds the ray casters.

    Raises:
        InputError: the device can't do what the scenario asks for, or the scan is too large.
    """
    scenario, inputs, scan = survey.scenario, survey.inputs, survey.scenario.scan
    cut = Blocks(inputs.setting(scan), with_motion(path, scan.motion, scenario.seed), 1 + sum(scenario.beam_rings))
    check_scan_size(forecast_scan(cut, len(scene.static), scan.threads), scan.most_pulses)
    labelled_scene = classify_scene(scene, inputs.scheme, survey.conditions.road)
    materials = SceneMaterials.of(survey, scene.static.materials)
    target = Target(labelled_scene, survey.caster, survey.damage_kinds(), survey.truth, survey.places())
    air = make_atmosphere(survey, cut.setting.device.wavelength_nm)
    reflection = make_reflection(survey, labelled_scene, materials)
    emission = make_emission(survey, cut, scene.static, air, reflection)
    relief = make_relief(survey, materials)
    layers = make_layers(survey, labelled_scene, materials, relief, emission)
    is_range_corrected = scenario.cloud.intensity == "range_corrected"
    outages = outages_in_tunnels(survey.conditions.road, path) if scan.strip_errors.outage_sigma else ()
    reception = Reception(
        scan.noise,
        scan.strip_errors,
        epoch_of(path),
        materials.give_intensities,
        is_range_corrected,
        outages,
    )
    return ScanPlan(target, emission, reflection, Run(scenario.seed, scan.threads), air, reception, relief, layers)


@dataclass(frozen=True)
class Site:
    """Place and conditions of a scenario's scan, independent of who made the scene.

    Attributes:
        scenario: the job.
        inputs: what the files that it names hold.
        path: the scanner's.
        conditions: those of the scene's road.
        view: raster for the previews, which are written if it is given.
        truth: of the changes to another epoch of the road; None where there is none.
    """

    scenario: Scenario
    inputs: ScenarioInputs
    path: ScanPath
    conditions: ScanConditions = field(default_factory=ScanConditions)
    view: TopView | None = None
    truth: EpochTruth | None = None

    @classmethod
    def of_road(
        cls, scenario: Scenario, road: RoadGeometry, inputs: ScenarioInputs, truth: EpochTruth | None = None
    ) -> Self:
        """Return the site of a road's scan: the platform's path over it, its conditions, a preview raster if wanted."""
        view = TopView.over_road(road, inputs.scheme.sources()) if "previews" in scenario.outputs else None
        path = inputs.platform.make_path(RoadGuide(road))
        return cls(scenario, inputs, path, ScanConditions.of(road.parameters), view, truth)

    @property
    def cut(self) -> Blocks:
        """Return the division of the scan's pulses into blocks."""
        return Blocks(self.inputs.setting(self.scenario.scan), self.path, 1 + sum(self.scenario.beam_rings))

    def plan(self, scene: ScannedScene, services: SceneServices) -> ScanPlan:
        """Return the plan of the scan of a scene with every default resolved; builds the ray casters.

        Raises:
            InputError: there is nothing that could be scanned, or see `plan_scan`.
        """
        if not len(scene.static) and not scene.moving:
            raise InputError("Scene", None, "nothing that could be scanned is visible")
        return plan_scan(Survey(self.scenario, self.inputs, services, self.conditions, self.truth), scene, self.path)

    def files(self, folder: Path, origin: Float) -> CloudFiles:
        """Return a sink that writes cloud and previews to a folder; the origin (3,) is near the points, map, m."""
        start_time = self.scenario.cloud.start_time
        if start_time is not None and epoch_of(self.path):
            raise InputError("cloud.start_time", start_time, "must be left out: the trajectory has times of its own")
        conditions, typical_range = self.conditions, self.path.typical_range
        text = conditions.system.to_wkt() if conditions.system else None
        images = None
        if self.scenario.scan.cameras is not None:
            scan = self.scenario.scan
            path = with_motion(self.path, scan.motion, self.scenario.seed)
            images = ImageFiles(self.scenario, self.inputs, folder, origin, path, conditions.epsg)
        return CloudFiles(
            self.scenario,
            self.inputs,
            folder,
            origin,
            typical_range,
            conditions.epsg,
            self.view,
            system_text=text,
            road=conditions.road,
            images=images,
        )

    def arrays(self) -> ArraySink:
        """Return a sink that keeps the cloud's arrays in memory."""
        return ArraySink(self.scenario, self.inputs, Path(gettempdir()), self.path.typical_range)

    def sink(self, to: Path | ArraySink, origin: Float) -> CloudSink:
        """Return what takes the points: files in a folder, or the sink itself; origin (3,): see `files`."""
        return self.files(to, origin) if isinstance(to, Path) else to

    def scan(
        self, scene: ScannedScene, services: SceneServices, to: Path | ArraySink, timer: StageTimer
    ) -> dict[str, Any]:
        """Scan a scene into a folder's files (cloud and previews) or into memory; return the counts as JSON data.

        Raises:
            InputError: see `plan` and `check_colour`.
        """
        with timer.stage("caster"):
            plan = self.plan(scene, services)
        counts = record_cloud([plan], self.sink(to, plan.target.origin), timer)
        if self.truth is not None:
            self.truth.finish(plan.target)
        return counts
