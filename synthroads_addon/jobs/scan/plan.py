"""A scenario resolved into a `ScanPlan`: every default of fidelity, device, platform and weather is filled in here.

`Site`: where a scenario's scan takes place, whoever made the scene; and its scan into files or arrays.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import gettempdir
from typing import Any, Self

from ...base.arrays import Float
from ...base.classes import UNLABELLED
from ...base.errors import InputError
from ...base.progress import StageTimer
from ...cloud.layers import optional_arrays
from ...cloud.tools.previews import TopView
from ...materials.surfaces import Surfaces, surfaces_of
from ...materials.table import Material, entry_of
from ...materials.variation import vary_material, water_film
from ...road.geometry import RoadGeometry
from ...road.instances import InstanceNumbers
from ...scanning.beam import RINGS, outer_radii
from ...scanning.blocks import Blocks
from ...scanning.colour.colour import takes_nodes
from ...scanning.colour.request import LayerRequest
from ...scanning.colour.surfaces import SceneSurfaces
from ...scanning.colour.transparency import SeeThrough, Transparency
from ...scanning.finish import OF_INTENSITY
from ...scanning.forecast import check_scan_size, forecast_scan
from ...scanning.multipath import Multipath, mirrors_of
from ...scanning.plan import ScanConditions, ScanPlan, SceneServices
from ...scanning.platforms.guides import RoadGuide
from ...scanning.platforms.path import Path as ScanPath
from ...scanning.platforms.path import epoch_of
from ...scanning.relief.micro_relief import micro_relief
from ...scanning.relief.normal_images import NormalImages
from ...scanning.scene.bare_ground import MOST_CELLS, BareGround
from ...scanning.scene.caster import Caster
from ...scanning.scene.classify import classify_scene
from ...scanning.scene.mesh import SceneMesh
from ...scanning.scene.motion import ScannedScene
from ...scanning.scene.outline import Outline
from ...scanning.scene.target import Target
from ...scanning.sway import with_motion
from ...scanning.weather.registry import weather_of
from ...scenario.choice import check_choice
from ...scenario.scan import scanner_setting
from ...scenario.scenario import OF_POINTS, Scenario
from .arrays import ArraySink
from .files import CloudFiles
from .sink import CloudSink, record_cloud

_CELLS_PER_PULSE, _FEWEST_CELLS = 4, 1 << 18
"""Cells in which it is looked for what is near a footprint: many are dearer than what a small scan saves by them."""
AIR_CLASS = "noise"
"""Class of what rain, snow and fog send back, in schemes that have it; without one it is unlabelled."""


def check_scan(scenario: Scenario, foreign: bool = False) -> None:
    """Raise an InputError for a scan that can't be done, before any work starts.

    Args:
        scenario: the job.
        foreign: whether the scene was built elsewhere.

    Raises:
        InputError: see `check_colour` and `check_choice`; or the device can't do it, or a table of materials or classes
            can't be read.
    """
    if set(scenario.outputs) & set(OF_POINTS):
        from ...blender.cameras import check_colour  # Blender takes a second to start: other outputs need none

        check_colour(scenario.colour.settings(scenario.fidelity))
    check_choice(scenario, foreign)
    scanner_setting(scenario.scan)
    scenario.cloud.scheme()
    scenario.own_materials()


def plan_scan(
    scenario: Scenario,
    scene: ScannedScene,
    path: ScanPath,
    services: SceneServices,
    conditions: ScanConditions | None = None,
) -> ScanPlan:
    """Return the complete plan of a scenario's scan, every default resolved; builds the ray casters.

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
    epoch, path = epoch_of(path), with_motion(path, scenario.scan.motion, scenario.seed)
    usual, scene = scene.static, classify_scene(scene, scenario.cloud.scheme(), conditions.road)
    kept, coloured, rings = scenario.kept_layers, scenario.coloured_layers, scenario.beam_rings
    scan, settings, table = scenario.scan, scenario.settings(), scenario.own_materials()
    materials, shifts = scene.static.materials, scan.relief > 0.0
    tilting = services.normal_images(materials) if scan.relief_normals else {}
    colour = scenario.colour.settings(scenario.fidelity, path.typical_range)
    setting, loss = scanner_setting(scan), scan.attenuation
    weather = scan.weather or weather_of(conditions.environment)
    cut = Blocks(setting, path, 1 + sum(rings))
    check_scan_size(forecast_scan(cut, len(scene.static), scan.threads), scan.most_pulses)
    means = services.materials(materials)
    road = conditions.road
    damages = InstanceNumbers(road).damages() if road is not None and "damage" in kept else {}

    def make_caster(mesh: SceneMesh) -> Caster:
        return services.caster(scan.caster, mesh, scan.kernels)

    target = Target(scene, make_caster, damages)
    relief = micro_relief(materials, means) if shifts else None
    variation = conditions.variation
    scanned = [
        # A textured one has the images' means, and was made with the table.
        vary_material(name, variation, conditions.environment, table)
        if name in table and variation.texture(name) is None
        else mean
        for name, mean in zip(map(entry_of, materials), means, strict=True)
    ]
    by_layers = _intensity_from_layers(scenario, scanned, services, materials)
    # The layers of each point have the variation of their own already.
    transparencies = services.transparencies(materials)
    surfaces = surfaces_of(scanned, scan.reflection, spread=not by_layers, clear=transparencies)
    effects = weather.effects() if loss is None else ()
    multipath = _multipath(scan.multipath, materials, scanned, conditions)
    ground, all_from_surfaces = None, not effects and multipath is None
    if settings.footprints == "where_needed" and (rings or scenario.chooses) and all_from_surfaces:
        ground = _bare_ground(usual, surfaces, cut, outer_radii(rings, setting.divergence))
    outline = None
    if rings and not effects and len(usual.triangles):
        widest = max(max(outer_radii(pattern, setting.divergence)) for pattern in RINGS.values())
        margin = widest * setting.maximum_range  # measurements take the plan with other rays per pulse
        outline = Outline(usual, make_caster, margin)
    return ScanPlan(
        target=target,
        surfaces=surfaces,
        setting=setting,
        path=path,
        rings=rings,
        seed=scenario.seed,
        epoch=epoch,
        noise=scan.noise,
        strip_errors=scan.strip_errors,
        attenuation=weather.attenuation(setting.device.wavelength_nm) if loss is None else loss,
        effects=effects,
        multipath=multipath,
        air_class=scenario.cloud.scheme().source_ids().get(AIR_CLASS, UNLABELLED),
        ground=ground,
        outline=outline,
        transparency=_see_through(scene, transparencies),
        beam=scan.beam,
        measured_layers=(kept & optional_arrays("scan")) | ({"normal", "material"} if shifts or tilting else set()),
        records_seen_points=bool(coloured) or by_layers or shifts or bool(tilting),
        detects_after_layers=by_layers,
        on_vehicle=scan.platform.driven,
        colour_layers=coloured,
        kept_layers=kept,
        material_means=surfaces_of(means),
        range_corrected=scenario.cloud.intensity == "range_corrected",
        relief=relief,
        relief_strength=scan.relief,
        relief_octaves=settings.relief_octaves,
        relief_normals=scan.relief_normals,
        normal_images=NormalImages(tilting, conditions.pavement) if tilting else None,
        pavement=conditions.pavement if shifts else None,
        threads=scan.threads,
        request=LayerRequest(
            settings=colour,
            wanted=coloured | (OF_INTENSITY if by_layers else set()),
            mesh=scene.static,
            environment=conditions.environment,
            path=path,
            field_of_view=setting.field_of_view,
            seed=scenario.seed,
            moving=scene.moving,
            kernels=scan.kernels,
        ),
        services=services,
    )


def _multipath(
    strength: float, names: Sequence[str], rows: Sequence[Material], conditions: ScanConditions
) -> Multipath | None:
    """Return the ghost echoes of a scene's materials by name, as scanned; None with the strength 0."""
    if not strength:
        return None
    films = [water_film(entry_of(name), conditions.environment) for name in names]
    return Multipath(mirrors_of(rows, films), strength)


def _see_through(scene: ScannedScene, materials: Mapping[int, Transparency]) -> SeeThrough | None:
    """Return the transparent materials of a scene by their index; None if it has none."""
    if not materials:
        return None
    return SeeThrough(SceneSurfaces(scene.static, scene.moving), materials, unit=scene.static.unit)


def _bare_ground(mesh: SceneMesh, surfaces: Surfaces, cut: Blocks, radii: tuple[float, float]) -> BareGround:
    """Return where footprints of half axes ``radii`` (m per metre of range) meet nothing but ground, for all pulses."""
    pulses = sum(map(cut.pulse_count, cut.path.strips))
    cells = min(max(_CELLS_PER_PULSE * pulses, _FEWEST_CELLS), MOST_CELLS)
    return BareGround(mesh, surfaces.pervious, max(radii) * cut.path.typical_range, cells)


def _intensity_from_layers(
    scenario: Scenario, scanned: Sequence[Material], services: SceneServices, materials: tuple[str, ...]
) -> bool:
    """Return whether intensities are computed from each point's own material layers.

    Where nothing is said they do if nodes give these layers, and no table says how the brightness varies: who fitted
    such a table to a real cloud wants that.
    """
    asked, colour = scenario.colour.intensity_from_layers, scenario.colour.settings(scenario.fidelity)
    if asked != "auto":
        return asked == "always"
    spread = any(row.spread_below or row.spread_above for row in scanned)
    return takes_nodes(colour) and not spread and services.reflectance_varies(materials)


@dataclass(frozen=True)
class Site:
    """Place and conditions of a scenario's scan, independent of who made the scene.

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
    def of_road(cls, scenario: Scenario, road: RoadGeometry) -> Self:
        """Return the site of a road's scan: the platform's path over it, its conditions, a preview raster if wanted."""
        view = TopView.over_road(road, scenario.cloud.scheme().sources()) if "previews" in scenario.outputs else None
        path = scenario.scan.platform.make_path(RoadGuide(road))
        return cls(scenario, path, ScanConditions.of(road.parameters), view)

    @property
    def cut(self) -> Blocks:
        """Return the division of the scan's pulses into blocks."""
        return Blocks(scanner_setting(self.scenario.scan), self.path, 1 + sum(self.scenario.beam_rings))

    def plan(self, scene: ScannedScene, services: SceneServices) -> ScanPlan:
        """Return the plan of the scan of a scene with every default resolved; builds the ray casters.

        Raises:
            InputError: there is nothing that could be scanned, or see `plan_scan`.
        """
        if not len(scene.static) and not scene.moving:
            raise InputError("Scene", None, "nothing that could be scanned is visible")
        return plan_scan(self.scenario, scene, self.path, services, self.conditions)

    def files(self, folder: Path, origin: Float) -> CloudFiles:
        """Return a sink that writes cloud and previews to a folder; the origin (3,) is near the points, map, m."""
        conditions, typical = self.conditions, self.path.typical_range
        text = conditions.system.to_wkt() if conditions.system else None
        return CloudFiles(self.scenario, folder, origin, typical, conditions.epsg, self.view, system_text=text)

    def arrays(self) -> ArraySink:
        """Return a sink that keeps the cloud's arrays in memory."""
        return ArraySink(self.scenario, Path(gettempdir()), self.path.typical_range)

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
        return record_cloud([plan], self.sink(to, plan.target.origin), timer)
