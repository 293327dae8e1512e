"""`ScanPlan`: everything that a scan was asked for, decided once, and the interfaces of what it is carried out with."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Literal, Protocol, Self

import numpy as np

from ..base.arrays import Float
from ..base.classes import UNLABELLED
from ..base.maps.crs import MapSystem
from ..materials.surfaces import Surfaces
from ..materials.table import Material
from ..road.geometry import RoadGeometry
from ..road.parameters import RoadParameters
from ..road.surroundings import Environment, MaterialVariation
from .beam import BeamPattern, beam_pattern
from .blocks import Block, Blocks
from .colour.colour import LayerSource, takes_nodes
from .colour.light import sun_direction
from .colour.request import LayerRequest
from .colour.transparency import SeeThrough, Transparency
from .devices.device import ScannerSetting
from .effects import EchoEffect
from .forecast import ScanForecast, forecast_scan
from .kernels.library import NoKernelError
from .kernels.noise import CompiledNoise, usable_noise
from .kernels.packets import PacketScene
from .kernels.points import CompiledPoints, usable_points
from .kernels.poses import CompiledPoses, usable_poses
from .kernels.pulses import PulseKernel
from .multipath import Multipath
from .noise import Noise
from .platforms.path import Path, Strip
from .receiving.response import laser_gains
from .relief.micro_relief import MicroRelief
from .relief.normal_images import NormalImage, NormalImages
from .relief.pavement import PavementRelief
from .scene.bare_ground import BareGround
from .scene.caster import Caster
from .scene.gaps import LeafGaps
from .scene.mesh import SceneMesh
from .scene.outline import Outline
from .scene.target import Target
from .strip_errors import StripErrors, strip_error_report
from .trace import Openings

_SPARE = 2
"""Factor on the returns of a pulse that are kept meanwhile: some are lost to the threshold later."""


class SceneServices(Protocol):
    """Interface to the program that shows the scene, Blender or a stand-in: casters, materials, rendered layers."""

    def caster(self, name: str, mesh: SceneMesh, kernels: str) -> Caster:
        """Return a ray caster over a mesh by `ScanScenario.caster` and `ScanScenario.kernels`."""
        ...

    def materials(self, names: Sequence[str]) -> list[Material]:
        """Return the mean properties of the scene's materials, in the order of the names."""
        ...

    def reflectance_varies(self, names: Sequence[str]) -> bool:
        """Return whether any of these materials has a reflectance that varies from place to place."""
        ...

    def normal_images(self, names: Sequence[str]) -> dict[int, NormalImage]:
        """Return the normal images of these materials, by their index in the names."""
        ...

    def transparencies(self, names: Sequence[str]) -> dict[int, Transparency]:
        """Return the light that these materials let through at each place, by their index in the names."""
        ...

    def layers(self, request: LayerRequest, progress: Callable[[float], None]) -> AbstractContextManager[LayerSource]:
        """Return a context that renders images first (progress 0 to 1) and gives the request's layer source."""
        ...


@dataclass(frozen=True)
class ScanConditions:
    """Properties of the road that a scan depends on besides its geometry; clear and dry weather if there is no road.

    Attributes:
        environment: light and weather.
        variation: of the road's materials.
        epsg: map coordinate system; None if unknown.
        road: what stands on and beside it, for classes by things; None if there is no road.
        height_epsg: vertical coordinate system; None if it isn't named.
    """

    environment: Environment = field(default_factory=Environment)
    variation: MaterialVariation = field(default_factory=MaterialVariation)
    epsg: int | None = None
    road: RoadParameters | None = None
    height_epsg: int | None = None

    @classmethod
    def of(cls, road: RoadParameters | None) -> Self:
        """Return the conditions that a road's parameters set; the defaults, clear and dry, for None."""
        if road is None:
            return cls()
        about = road.metadata
        return cls(road.environment, road.materials, about.epsg, road, about.height_epsg)

    @property
    def system(self) -> MapSystem | None:
        """Return the map coordinate system, with the vertical one if it is named; None if it is unknown."""
        return None if self.epsg is None else MapSystem.of(self.epsg, self.height_epsg)

    @cached_property
    def pavement(self) -> PavementRelief | None:
        """The heights of the road's pavement; None if there is no road."""
        return None if self.road is None else PavementRelief(RoadGeometry(self.road))


@dataclass(frozen=True)
class ScanPlan:
    """Inputs and settings of one scan, all resolved, that its blocks share.

    Attributes:
        target: the scene with its casters.
        surfaces: means of the scene's materials, as the beam meets them.
        transparency: of materials that are clear in one place and solid in another; None without any.
        setting: the scanner's.
        path: the scanner's.
        rings: rays on each ring around the beam's axis.
        seed: of everything random.
        epoch: what the times of points count from, s.
        noise: random errors of the measurement.
        strip_errors: systematic errors of its strips.
        attenuation: of the beam by the air, 1/m of range.
        effects: effects that change the echoes of pulses, in the order in which they act.
        multipath: ghost echoes over surfaces that mirror; None without.
        air_class: ``class_id`` of the echoes that these add.
        ground: where footprints that meet one plane alone are spared; None: every footprint is cast in full.
        outline: of the static scene, with room for a pulse's rays, by which pulses that meet nothing aren't cast; None:
            all are that the scene's bounds don't rule out.
        beam: whether the rays of a pulse diverge from the aperture or run parallel.
        measured_layers: names of the optional per-point layers that the scan itself fills.
        records_seen_points: whether blocks tell where each point was seen (`BlockResult.seen`), for colours and relief.
        detects_after_layers: whether intensities still change by the points' own layers, see `finish`: until then every
            echo that may pass the detector is kept, and nothing saturates.
        frame_origin: (3,) origin of the scene's local frame in the coordinates of the surfaces' random fields, m: those
            of the whole road where only a section of it is scanned.
        chosen_blocks: blocks that are scanned, in their order; all if None.
        on_vehicle: whether a vehicle carries the scanner.
        colour_layers: ``rgb`` and material layers that the points get.
        kept_layers: optional per-point layers that the sink gets; the others are needed on the way only.
        material_means: means of the scene's materials, around which the layers of single points vary.
        range_corrected: intensities are multiplied by the squared range, after the detector.
        relief: micro-relief of the materials; None without.
        relief_strength: factor on it.
        relief_octaves: of it.
        relief_normals: whether normals and incidence angles follow it, and the pavement's heights.
        normal_images: that tilt normals, incidence angles and, with layers, intensities; None where nothing does.
        pavement: heights of the pavement, which points have as well where there is a micro-relief; None without.
        threads: blocks that are worked on at once; 0 for every core.
        request: colours and layers that are asked of the scene.
        services: of the program that shows the scene, for these; None where points stay as they are measured.
        progress: shares of a larger scan that are done before this one, and after it.
        pattern: rays of a pulse.
        gains: (256,) of the lasers.
    """

    target: Target
    surfaces: Surfaces
    setting: ScannerSetting
    path: Path
    rings: tuple[int, ...]
    seed: int
    epoch: float = 0.0
    noise: Noise = Noise()  # noqa: RUF009 (frozen)
    strip_errors: StripErrors = StripErrors()  # noqa: RUF009 (frozen)
    attenuation: float = 0.0
    effects: tuple[EchoEffect, ...] = ()
    multipath: Multipath | None = None
    air_class: int = UNLABELLED
    ground: BareGround | None = None
    outline: Outline | None = None
    transparency: SeeThrough | None = None
    beam: Literal["conical", "cylindrical"] = "conical"
    measured_layers: frozenset[str] = frozenset()
    records_seen_points: bool = False
    detects_after_layers: bool = False
    frame_origin: Float = field(default_factory=lambda: np.zeros(3))
    chosen_blocks: tuple[Block, ...] | None = None
    on_vehicle: bool = False
    colour_layers: frozenset[str] = frozenset()
    kept_layers: frozenset[str] = frozenset()
    material_means: Surfaces | None = None
    range_corrected: bool = False
    relief: MicroRelief | None = None
    relief_strength: float = 0.0
    relief_octaves: int = 4
    relief_normals: bool = False
    normal_images: NormalImages | None = None
    pavement: PavementRelief | None = None
    threads: int = 0
    request: LayerRequest | None = None
    services: SceneServices | None = None
    progress: tuple[float, float] = (0.0, 1.0)
    pattern: BeamPattern = field(init=False)
    gains: Float = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "pattern", beam_pattern(self.rings))
        object.__setattr__(self, "gains", laser_gains(self.setting, self.seed))

    @property
    def sun(self) -> Float | None:
        """Return the unit vector (3,) towards the sun; None unless points need to know whether it reaches them."""
        request = self.request
        if request is None or not request.lit or not (self.services is None or takes_nodes(request.settings)):
            return None
        return sun_direction(request.environment)

    @cached_property
    def gaps(self) -> LeafGaps | None:
        """Return the leaves and gaps of the scene's materials, as the beam meets them; None where there are none."""
        if not self.surfaces.gappy.any():
            return None
        return LeafGaps.of(self.setting, self.seed, self.frame_origin)

    @cached_property
    def openings(self) -> Openings | None:
        """Return where the scene's materials are open; None where none is."""
        clear = self.transparency and replace(self.transparency, frame_origin=self.frame_origin)
        return None if self.gaps is None and clear is None else Openings(self.gaps, clear)

    @cached_property
    def pulse_kernel(self) -> PulseKernel | NoKernelError:
        """Return the compiled loops that follow the scan's pulses, or why NumPy does."""
        parallel = self.beam == "cylindrical"
        try:
            return PulseKernel(
                self.target, self.surfaces, self.setting, self.pattern, self.openings, self.attenuation, parallel
            )
        except NoKernelError as error:
            return error

    @cached_property
    def noise_kernel(self) -> CompiledNoise | None:
        """Return the compiled loop over random fields; None for NumPy, as where rays aren't cast in packets either."""
        noise = usable_noise()
        return noise if isinstance(noise, CompiledNoise) and isinstance(self.target.caster, PacketScene) else None

    @cached_property
    def pose_kernel(self) -> CompiledPoses | None:
        """Return the compiled loop over the pulses' poses; None for NumPy, likewise."""
        poses = usable_poses()
        return poses if isinstance(poses, CompiledPoses) and isinstance(self.target.caster, PacketScene) else None

    @cached_property
    def point_loops(self) -> CompiledPoints | None:
        """Return the compiled loops over points once they are measured; None for NumPy, likewise."""
        points = usable_points()
        return points if isinstance(points, CompiledPoints) and isinstance(self.target.caster, PacketScene) else None

    @property
    def _kernels(self) -> str:
        """Return by what way rays are cast, pulses followed and random fields worked out, for the report."""
        caster = self.target.caster
        if not isinstance(caster, PacketScene):
            return caster.kernels
        ways = {
            "pulses": self.pulse_kernel,
            "noise": usable_noise(),
            "poses": usable_poses(),
            "points": usable_points(),
        }
        parts = [
            f"{of} {f'by NumPy: {way}' if isinstance(way, NoKernelError) else 'compiled'}" for of, way in ways.items()
        ]
        if isinstance(self.pulse_kernel, PulseKernel) and (left := self._left_to_numpy):
            parts[0] += f", by NumPy: {', '.join(left)}"
        return "; ".join([caster.kernels, *parts])

    @property
    def _left_to_numpy(self) -> list[str]:
        """Return what of pulses that are followed by compiled loops is worked out by NumPy nonetheless."""
        parts = {
            "what panes let through": self.openings is not None and self.openings.clear is not None,
            "which footprints are spared": self.spares,
            "echoes of the air": bool(self.effects),
            "what surfaces mirror": self.multipath is not None,
        }
        return [part for part, there in parts.items() if there]

    @property
    def rays_per_pulse(self) -> int:
        """Return the number of rays that sample one pulse."""
        return len(self.pattern.weights)

    @property
    def spares(self) -> bool:
        """Return whether footprints that meet one plane alone are spared: none where echoes come from elsewhere too."""
        from_surfaces = not self.effects and self.multipath is None
        return self.ground is not None and from_surfaces and self.rays_per_pulse > 1

    @property
    def most_returns(self) -> int:
        """Return the largest number of returns kept of one pulse; twice the device's until the layers are known."""
        return self.setting.device.maximum_returns * (_SPARE if self.detects_after_layers else 1)

    @property
    def cut(self) -> Blocks:
        """Return the division of the scan's pulses into blocks."""
        return Blocks(self.setting, self.path, self.rays_per_pulse)

    def pulse_count(self, strip: Strip) -> int:
        """Return the number of pulses fired during a strip, all heads together."""
        return self.cut.pulse_count(strip)

    def blocks(self) -> Iterator[Block]:
        """Yield (strip, number) of every block that is scanned, in the order of time."""
        return self.cut.all() if self.chosen_blocks is None else iter(self.chosen_blocks)

    def forecast(self) -> ScanForecast:
        """Return the expected pulses, computing time and memory of scanning the whole path."""
        return forecast_scan(self.cut, self.target.triangles, self.threads)

    def block_count(self) -> int:
        """Return the number of blocks that are scanned."""
        return self.cut.count() if self.chosen_blocks is None else len(self.chosen_blocks)

    def summary(self) -> dict[str, Any]:
        """Return the figures that are known before the scan begins, as JSON data."""
        strip_errors = strip_error_report(self.strip_errors, self.seed, self.path.strips)
        return {
            "triangles": self.target.triangles,
            "vertices": self.target.vertices,
            "caster": self.target.caster.name,
            "kernels": self._kernels,
            "attenuation": self.attenuation,
        } | ({"strip_errors": strip_errors} if strip_errors else {})
