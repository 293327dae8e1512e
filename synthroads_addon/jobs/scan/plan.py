"""A scenario resolved into a `ScanPlan`: every default of fidelity, device, platform and weather is filled in here.

`Site`: where a scenario's scan takes place, whoever made the scene; and its scan into files.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.classes import ClassScheme
from ...base.errors import InputError
from ...base.progress import StageTimer
from ...cloud.layers import optional_arrays
from ...cloud.tools.previews import TopView
from ...materials.surfaces import surfaces_of
from ...materials.variation import vary_material
from ...road.geometry import RoadGeometry
from ...scanning.beam import RINGS
from ...scanning.blocks import Blocks
from ...scanning.colour.request import LayerRequest
from ...scanning.forecast import forecast_scan, refuse_large
from ...scanning.plan import ScanConditions, ScanPlan, SceneServices
from ...scanning.platforms.guides import RoadGuide
from ...scanning.platforms.path import Path as ScanPath
from ...scanning.relief import micro_relief
from ...scanning.scene.classify import classify_scene
from ...scanning.scene.motion import ScannedScene
from ...scanning.scene.target import Target
from ...scanning.weather.registry import weather_of
from ...scenario.scan import scanner_setting
from ...scenario.scenario import Scenario
from .files import CloudFiles, record_to_files


def plan_scan(
    scenario: Scenario,
    scene: ScannedScene,
    path: ScanPath,
    services: SceneServices,
    conditions: ScanConditions | None = None,
) -> ScanPlan:
    """Return the scan that a scenario asks for, with nothing left open; builds the casters.

    Args:
        scenario: the job.
        scene: what is scanned.
        path: the scanner's.
        services: of the program that shows the scene.
        conditions: the road's; those of no road if None.

    Raises:
        InputError: the device can't do what the scenario asks for, or its table of materials can't be read.
    """
    conditions = conditions or ScanConditions()
    scene = classify_scene(scene, scenario.cloud.scheme(), conditions.road)
    scan, settings, setting = scenario.scan, scenario.settings(), scanner_setting(scenario.scan)
    materials, kept = scene.static.materials, kept_layers(scenario)
    means, by_layers = services.materials(materials), scenario.colour.intensity_from_layers
    table = scenario.own_materials()
    scanned = [
        vary_material(name, conditions.variation, conditions.environment, table) if name in table else mean
        for name, mean in zip(materials, means, strict=True)
    ]
    loss, weather = scan.attenuation, scan.weather or weather_of(conditions.environment)
    rings = beam_rings(scenario)
    forecast = forecast_scan(Blocks(setting, path, 1 + sum(rings)), len(scene.static), scan.threads)
    refuse_large(forecast, scan.most_pulses)
    coloured, shifts = coloured_layers(scenario), scan.relief > 0.0
    colour = scenario.colour.settings(scenario.fidelity, path.typical_range)
    return ScanPlan(
        target=Target(scene, lambda mesh: services.caster(scan.caster, mesh)),
        # The layers of each point have the variation of their own already.
        surfaces=surfaces_of(scanned, scan.reflection, spread=not by_layers),
        setting=setting,
        path=path,
        rings=rings,
        seed=scenario.seed,
        noise=scan.noise,
        attenuation=weather.attenuation(setting.device.wavelength_nm) if loss is None else loss,
        effects=weather.effects() if loss is None else (),
        beam=scan.beam,
        wanted=(kept & optional_arrays("scan")) | ({"normal", "material"} if shifts else set()),
        targets=bool(coloured) or by_layers or shifts,
        detects_later=by_layers,
        driven=scan.platform.driven,
        coloured=coloured,
        kept=kept,
        means=surfaces_of(means),
        range_corrected=scenario.cloud.intensity == "range_corrected",
        relief=micro_relief(materials, means) if shifts else None,
        relief_strength=scan.relief,
        relief_octaves=settings.relief_octaves,
        threads=scan.threads,
        request=LayerRequest(
            settings=colour,
            wanted=coloured | ({"base_color"} if by_layers else set()),
            mesh=scene.static,
            environment=conditions.environment,
            path=path,
            field_of_view=setting.field_of_view,
            seed=scenario.seed,
        ),
        services=services,
    )


def beam_rings(scenario: Scenario) -> tuple[int, ...]:
    """Return the rays on each ring around the beam's axis."""
    own = scenario.scan.beam_rings
    return RINGS[scenario.settings().rays_per_pulse] if own is None else own


def kept_layers(scenario: Scenario) -> frozenset[str]:
    """Return the names of the optional per-point layers that the files hold."""
    return scenario.cloud.arrays() & optional_arrays() if "cloud" in scenario.outputs else frozenset()


def coloured_layers(scenario: Scenario) -> frozenset[str]:
    """Return the layers that points get besides what the scanner measures: ``rgb`` and material layers."""
    rgb = {"rgb"} if scenario.colour.rgb else set()
    return frozenset(rgb | (kept_layers(scenario) & optional_arrays("material")))


def may_render(scenario: Scenario) -> bool:
    """Return whether a scan may have to render: whether it does depends on the scene's materials as well."""
    points = bool(set(scenario.outputs) & {"cloud", "previews"})
    asked = bool(coloured_layers(scenario)) or scenario.colour.intensity_from_layers
    return points and asked and scenario.colour.source != "material"


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
        view = road_view(road, scenario.cloud.scheme().sources()) if "previews" in scenario.outputs else None
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


def road_view(geometry: RoadGeometry, scheme: ClassScheme | None = None) -> TopView:
    """Return a raster for the previews that holds the whole swath of a road.

    Args:
        geometry: the road.
        scheme: of the points' classes; the 17 if None.
    """
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
    return TopView(plan[0] + origin, plan[-1] + origin, float(across.min()) - 2, float(across.max()) + 2, scheme)
