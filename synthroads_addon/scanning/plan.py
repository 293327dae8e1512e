"""`ScanPlan`: everything that a scan was asked for, decided once, in parts: see `scanning.parts`."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from ..base.arrays import Float
from .blocks import Block, Blocks
from .colour.colour import takes_nodes
from .colour.light import sun_direction
from .devices.device import ScannerSetting
from .forecast import ScanForecast, forecast_scan
from .kernels.library import NoKernelError
from .kernels.noise import CompiledNoise, usable_noise
from .kernels.packets import PacketScene
from .kernels.points import CompiledPoints, usable_points
from .kernels.poses import CompiledPoses, usable_poses
from .kernels.pulses import PulseKernel
from .parts.atmosphere import Atmosphere
from .parts.emission import Emission
from .parts.layers import Layers
from .parts.reception import Reception
from .parts.reflection import Reflection
from .parts.relief import Relief
from .parts.run import Run
from .platforms.path import Path, Strip
from .receiving.response import laser_gains
from .scene.gaps import LeafGaps
from .scene.target import Target
from .strip_errors import strip_error_report
from .trace import Openings

_SPARE = 2
"""Factor on the returns of a pulse that are kept meanwhile: some are lost to the threshold later."""


@dataclass(frozen=True)
class ScanPlan:
    """Inputs and settings of one scan, all resolved, that its blocks share.

    Attributes:
        target: the scene with its casters.
        emission: how pulses leave the scanner.
        reflection: what the scene's materials make of them.
        run: how the scan is carried out.
        atmosphere: what the air does to them.
        reception: what is measured of the echoes.
        relief: of the surfaces, beyond the model's faces.
        layers: of the points.
    """

    target: Target
    emission: Emission
    reflection: Reflection
    run: Run
    atmosphere: Atmosphere = Atmosphere()  # noqa: RUF009 (frozen)
    reception: Reception = Reception()  # noqa: RUF009 (frozen)
    relief: Relief = Relief()  # noqa: RUF009 (frozen)
    layers: Layers = Layers()  # noqa: RUF009 (frozen)

    @property
    def setting(self) -> ScannerSetting:
        """Return the scanner's setting."""
        return self.emission.setting

    @property
    def path(self) -> Path:
        """Return the scanner's path."""
        return self.emission.path

    @cached_property
    def gains(self) -> Float:
        """Return the gains (256,) of the lasers."""
        return laser_gains(self.setting, self.run.seed)

    @property
    def sun(self) -> Float | None:
        """Return the unit vector (3,) towards the sun; None unless points need to know whether it reaches them."""
        request = self.layers.request
        if request is None or not request.lit or not (self.layers.services is None or takes_nodes(request.settings)):
            return None
        return sun_direction(request.environment)

    @cached_property
    def gaps(self) -> LeafGaps | None:
        """Return the leaves and gaps of the scene's materials, as the beam meets them; None where there are none."""
        if not self.reflection.surfaces.gappy.any():
            return None
        return LeafGaps.of(self.setting, self.reflection.surface_seed, self.reflection.frame_origin)

    @cached_property
    def openings(self) -> Openings | None:
        """Return where the scene's materials are open; None where none is."""
        reflection = self.reflection
        see_through = reflection.transparency and replace(reflection.transparency, frame_origin=reflection.frame_origin)
        return None if self.gaps is None and see_through is None else Openings(self.gaps, see_through)

    @cached_property
    def pulse_kernel(self) -> PulseKernel | NoKernelError:
        """Return the compiled loops that follow the scan's pulses, or the reason why NumPy follows them instead."""
        emission, surfaces = self.emission, self.reflection.surfaces
        parallel = emission.beam == "cylindrical"
        beam = (emission.setting, emission.pattern, self.openings, self.atmosphere.attenuation, parallel)
        try:
            return PulseKernel(self.target, surfaces, *beam)
        except NoKernelError as error:
            return error

    @cached_property
    def noise_kernel(self) -> CompiledNoise | None:
        """Return the compiled loop over random fields; None where NumPy works them out.

        NumPy does so as well where rays aren't cast in packets, whose speed the loops are made for.
        """
        noise = usable_noise()
        return noise if isinstance(noise, CompiledNoise) and isinstance(self.target.caster, PacketScene) else None

    @cached_property
    def pose_kernel(self) -> CompiledPoses | None:
        """Return the compiled loop over the pulses' poses; None where NumPy works them out, as for `noise_kernel`."""
        poses = usable_poses()
        return poses if isinstance(poses, CompiledPoses) and isinstance(self.target.caster, PacketScene) else None

    @cached_property
    def point_loops(self) -> CompiledPoints | None:
        """Return the compiled loops over measured points; None where NumPy is used, as for `noise_kernel`."""
        points = usable_points()
        return points if isinstance(points, CompiledPoints) and isinstance(self.target.caster, PacketScene) else None

    @property
    def _kernels(self) -> str:
        """Return a sentence for the report: how rays are cast, and whether NumPy or compiled loops do the rest."""
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
            f"{subject} {f'by NumPy: {way}' if isinstance(way, NoKernelError) else 'compiled'}"
            for subject, way in ways.items()
        ]
        if isinstance(self.pulse_kernel, PulseKernel) and (numpy_parts := self._left_to_numpy):
            parts[0] += f", by NumPy: {', '.join(numpy_parts)}"
        return "; ".join([caster.kernels, *parts])

    @property
    def _left_to_numpy(self) -> list[str]:
        """Return the tasks, in words, that NumPy still does where compiled loops follow the pulses."""
        parts = {
            "what panes let through": self.openings is not None and self.openings.clear is not None,
            "which footprints are spared": self.spares,
            "echoes of the air": bool(self.atmosphere.effects),
            "what surfaces mirror": self.reflection.multipath is not None,
        }
        return [part for part, present in parts.items() if present]

    @property
    def rays_per_pulse(self) -> int:
        """Return the number of rays that sample one pulse."""
        return len(self.emission.pattern.weights)

    @property
    def spares(self) -> bool:
        """Return whether footprints that meet one plane alone are spared: not where air or mirrors give echoes too."""
        from_surfaces = not self.atmosphere.effects and self.reflection.multipath is None
        return self.emission.ground is not None and from_surfaces and self.rays_per_pulse > 1

    @property
    def most_returns(self) -> int:
        """Return the largest number of returns kept of one pulse.

        It is the device's, times `_SPARE` where intensities still change by the points' layers.
        """
        return self.setting.device.maximum_returns * (_SPARE if self.reception.after_layers else 1)

    @property
    def cut(self) -> Blocks:
        """Return the division of the scan's pulses into blocks."""
        return Blocks(self.setting, self.path, self.rays_per_pulse)

    def pulse_count(self, strip: Strip) -> int:
        """Return the number of pulses fired during a strip, all heads together."""
        return self.cut.pulse_count(strip)

    def blocks(self) -> Iterator[Block]:
        """Yield (strip, number) of every block that is scanned, in the order of time."""
        return self.cut.all() if self.run.chosen_blocks is None else iter(self.run.chosen_blocks)

    def forecast(self) -> ScanForecast:
        """Return the expected pulses, computing time and memory of scanning the whole path."""
        request = self.layers.request
        rendered = request is not None and request.settings.source != "material" and not takes_nodes(request.settings)
        return forecast_scan(self.cut, self.target.triangles, self.run.threads, rendered)

    def block_count(self) -> int:
        """Return the number of blocks that are scanned."""
        return self.cut.count() if self.run.chosen_blocks is None else len(self.run.chosen_blocks)

    def summary(self) -> dict[str, Any]:
        """Return the figures that are known before the scan begins, as JSON data."""
        strip_errors = strip_error_report(
            self.reception.strip_errors, self.run.seed, self.path.strips, self.reception.outages
        )
        return {
            "triangles": self.target.triangles,
            "vertices": self.target.vertices,
            "caster": self.target.caster.name,
            "kernels": self._kernels,
            "attenuation": self.atmosphere.attenuation,
        } | ({"strip_errors": strip_errors} if strip_errors else {})
