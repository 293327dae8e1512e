"""Builders of the parts of a scan's plan (`scanning.parts`), with every default of fidelity and weather filled in."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from ...base.classes import UNLABELLED
from ...cloud.layers import optional_arrays
from ...materials.surfaces import Surfaces, surfaces_of
from ...materials.table import Material, entry_of
from ...materials.variation import vary_material, water_film
from ...road.instances import InstanceNumbers
from ...road.network.places import RoadPlaces
from ...scanning.beam import RINGS, outer_radii
from ...scanning.blocks import Blocks
from ...scanning.colour.colour import takes_nodes
from ...scanning.colour.request import LayerRequest
from ...scanning.colour.surfaces import SceneSurfaces
from ...scanning.colour.transparency import SeeThrough, Transparency
from ...scanning.epochs.truth import EpochTruth
from ...scanning.finish import OF_INTENSITY
from ...scanning.multipath import Multipath, mirrors_of
from ...scanning.parts.atmosphere import Atmosphere
from ...scanning.parts.conditions import ScanConditions
from ...scanning.parts.emission import Emission
from ...scanning.parts.layers import Layers, SceneServices
from ...scanning.parts.reflection import Reflection
from ...scanning.parts.relief import Relief
from ...scanning.relief.micro_relief import micro_relief
from ...scanning.relief.normal_images import NormalImage, NormalImages
from ...scanning.scene.bare_ground import MOST_CELLS, BareGround
from ...scanning.scene.caster import Caster
from ...scanning.scene.mesh import SceneMesh
from ...scanning.scene.motion import ScannedScene
from ...scanning.scene.outline import Outline
from ...scanning.weather.extinction import REFERENCE
from ...scanning.weather.registry import weather_of
from ...scenario.inputs import ScenarioInputs
from ...scenario.scenario import Scenario

AIR_CLASS = "noise"
"""Class of what rain, snow and fog send back, in schemes that have it; without one it is unlabelled."""
_CELLS_PER_PULSE, _FEWEST_CELLS = 4, 1 << 18
"""Cells in which it is looked for what is near a footprint: many are dearer than what a small scan saves by them."""


@dataclass(frozen=True)
class Survey:
    """Basis of a scan's plan, whatever the scene.

    Attributes:
        scenario: the job.
        inputs: what the files that it names hold.
        services: of the program that shows the scene.
        conditions: the road's; those of no road by default.
        truth: of the changes to another epoch of the road; None where there is none.
    """

    scenario: Scenario
    inputs: ScenarioInputs
    services: SceneServices
    conditions: ScanConditions = field(default_factory=ScanConditions)
    truth: EpochTruth | None = None

    def caster(self, mesh: SceneMesh) -> Caster:
        """Return a ray caster over a mesh, of the kind that the scenario asks for."""
        return self.services.caster(self.scenario.scan.caster, mesh, self.scenario.scan.kernels)

    @property
    def surface_seed(self) -> int:
        """Return the seed of the surfaces' random fields: the road's own; that of the scan where there is no road."""
        road = self.conditions.road
        return self.scenario.seed if road is None else road.metadata.seed

    def damage_kinds(self) -> dict[int, int]:
        """Return the kinds of the road's damages by instance number, if the cloud's files hold them; else none."""
        road, kept_layers = self.conditions.road, self.scenario.kept_layers
        return InstanceNumbers(road).damages() if road is not None and "damage" in kept_layers else {}

    def places(self) -> RoadPlaces | None:
        """Return what tells places along the scene's roads, if the cloud's files hold them; else None."""
        return self.conditions.places if "road_id" in self.scenario.kept_layers else None


@dataclass(frozen=True)
class SceneMaterials:
    """Materials of a scene, asked once of the program that shows it; lists are in the order of the names.

    Attributes:
        names: as the scene has them.
        means: as the scene has them.
        scanned: as the scan meets them, with the road's age and wetness.
        transparencies: light that they let through at each place, by index.
        normal_images: by index; none unless normals follow them.
        give_intensities: whether intensities are computed from each point's own material layers.
    """

    names: tuple[str, ...]
    means: list[Material]
    scanned: list[Material]
    transparencies: Mapping[int, Transparency]
    normal_images: dict[int, NormalImage]
    give_intensities: bool

    @classmethod
    def of(cls, survey: Survey, names: tuple[str, ...]) -> SceneMaterials:
        """Return a scene's materials of these names."""
        services, table = survey.services, survey.inputs.materials
        images = services.normal_images(names) if survey.scenario.scan.relief_normals else {}
        means = services.materials(names)
        variation, environment = survey.conditions.variation, survey.conditions.environment
        # Age and wetness change the table's entries alone. A textured material keeps its images' means, in which they
        # are already: the images are multiplied so when it is made.
        scanned = [
            vary_material(entry, variation, environment, table)
            if entry in table and variation.texture(entry) is None
            else mean
            for entry, mean in zip(map(entry_of, names), means, strict=True)
        ]
        give_intensities = _intensity_from_layers(survey, scanned, names)
        return cls(names, means, scanned, services.transparencies(names), images, give_intensities)


def _intensity_from_layers(survey: Survey, scanned_materials: list[Material], names: tuple[str, ...]) -> bool:
    """Return whether intensities are computed from each point's own material layers.

    Where nothing is said they do if nodes give these layers, and no table says how the brightness varies: who fitted
    such a table to a real cloud wants that.
    """
    colour, fidelity = survey.scenario.colour, survey.scenario.fidelity
    if colour.intensity_from_layers != "auto":
        return colour.intensity_from_layers == "always"
    has_spread = any(row.spread_below or row.spread_above for row in scanned_materials)
    return takes_nodes(colour.settings(fidelity)) and not has_spread and survey.services.reflectance_varies(names)


def make_atmosphere(survey: Survey, wavelength: float) -> Atmosphere:
    """Return the air for light of a wavelength (nm), by the scenario's weather, else the road's.

    An attenuation that the scenario gives stands for a weather without echoes, alike for all light.
    """
    scan = survey.scenario.scan
    attenuation, weather = scan.attenuation, scan.weather or weather_of(survey.conditions.environment)
    return Atmosphere(
        attenuation=weather.attenuation(wavelength) if attenuation is None else attenuation,
        extinction=weather.extinction(REFERENCE) if attenuation is None else attenuation / 2.0,
        effects=weather.effects() if attenuation is None else (),
        air_class=survey.inputs.scheme.source_ids().get(AIR_CLASS, UNLABELLED),
    )


def make_reflection(survey: Survey, scene: ScannedScene, materials: SceneMaterials) -> Reflection:
    """Return what a scene's materials make of the beam; the layers of each point have their own variation already."""
    scan, transparencies, has_spread = survey.scenario.scan, materials.transparencies, not materials.give_intensities
    return Reflection(
        surfaces=surfaces_of(materials.scanned, scan.reflection, spread=has_spread, clear=transparencies),
        transparency=_see_through(scene, transparencies) if transparencies else None,
        multipath=_multipath(survey, materials) if scan.multipath else None,
        surface_seed=survey.surface_seed,
    )


def _see_through(scene: ScannedScene, materials: Mapping[int, Transparency]) -> SeeThrough:
    """Return the transparent materials of a scene by their index."""
    return SeeThrough(SceneSurfaces(scene.static, scene.moving), materials, unit=scene.static.unit)


def _multipath(survey: Survey, materials: SceneMaterials) -> Multipath:
    """Return the ghost echoes over a scene's materials as scanned."""
    films = [water_film(entry_of(name), survey.conditions.environment) for name in materials.names]
    return Multipath(mirrors_of(materials.scanned, films), survey.scenario.scan.multipath)


def make_emission(survey: Survey, cut: Blocks, mesh: SceneMesh, air: Atmosphere, reflection: Reflection) -> Emission:
    """Return how pulses leave the scanner, with what needn't be cast of them where echoes come from surfaces alone.

    Args:
        survey: basis of the plan.
        cut: the scan's blocks.
        mesh: what stands still, with classes of the full table.
        air: adds echoes or doesn't.
        reflection: of the scene.
    """
    scenario, setting, scan, ground, outline = survey.scenario, cut.setting, survey.scenario.scan, None, None
    rings, divergence = scenario.beam_rings, setting.divergence
    may_spare = scenario.settings().footprints == "where_needed" and (rings or scenario.chooses)
    if may_spare and not air.effects and reflection.multipath is None:
        ground = _bare_ground(mesh, reflection.surfaces, cut, outer_radii(rings, divergence))
    if rings and not air.effects and len(mesh.triangles):
        widest_radius = max(max(outer_radii(pattern, divergence)) for pattern in RINGS.values())
        margin = widest_radius * setting.maximum_range  # measurements take the plan with other rays per pulse
        outline = Outline(mesh, survey.caster, margin)
    return Emission(setting, cut.path, rings, scan.beam, scan.platform.driven, ground, outline)


def _bare_ground(mesh: SceneMesh, surfaces: Surfaces, cut: Blocks, radii: tuple[float, float]) -> BareGround:
    """Return where footprints of half axes ``radii`` (m per metre of range) meet nothing but ground, for all pulses."""
    pulses = sum(map(cut.pulse_count, cut.path.strips))
    cells = min(max(_CELLS_PER_PULSE * pulses, _FEWEST_CELLS), MOST_CELLS)
    return BareGround(mesh, surfaces.pervious, max(radii) * cut.path.typical_range, cells)


def make_relief(survey: Survey, materials: SceneMaterials) -> Relief:
    """Return the relief of a scene's surfaces beyond the model's faces, as far as the scenario wants it."""
    scan, conditions, images = survey.scenario.scan, survey.conditions, materials.normal_images
    has_relief = scan.relief > 0.0
    return Relief(
        micro=micro_relief(materials.names, materials.means) if has_relief else None,
        strength=scan.relief,
        octaves=survey.scenario.settings().relief_octaves,
        normals=scan.relief_normals,
        images=NormalImages(images, conditions.pavement) if images else None,
        pavement=conditions.pavement if has_relief else None,
    )


def make_layers(
    survey: Survey, scene: ScannedScene, materials: SceneMaterials, relief: Relief, emission: Emission
) -> Layers:
    """Return which layers the points get, and where from; what relief and intensities need is among the measured."""
    scenario, path, gives_intensities = survey.scenario, emission.path, materials.give_intensities
    kept_layers, coloured_layers = scenario.kept_layers, scenario.coloured_layers
    moves_points = relief.micro is not None or relief.images is not None
    return Layers(
        measured=(kept_layers & optional_arrays("scan")) | ({"normal", "material"} if moves_points else set()),
        coloured=coloured_layers,
        kept=kept_layers,
        seen_points=bool(coloured_layers) or gives_intensities or moves_points,
        means=surfaces_of(materials.means),
        request=LayerRequest(
            settings=scenario.colour.settings(scenario.fidelity, path.typical_range),
            names=coloured_layers | (OF_INTENSITY if gives_intensities else set()),
            mesh=scene.static,
            environment=survey.conditions.environment,
            path=path,
            field_of_view=emission.setting.field_of_view,
            seed=scenario.seed,
            moving=scene.moving,
            kernels=scenario.scan.kernels,
            road=survey.conditions.road,
        ),
        services=survey.services,
    )
