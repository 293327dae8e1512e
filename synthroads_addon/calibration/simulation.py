"""Scans of a level pavement: what a scanner would record of it, without Blender and within seconds.

Settings that are fitted to a real cloud are checked, and corrected, by what the same estimates say of such a scan. The
scanner's own loop makes it, with the noise, sway, strips and surfaces that a scenario names; only the rays are cast by
formula.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import AnyArray, Bool, Float32
from ..base.errors import InputError
from ..cloud.points import concatenate
from ..cloud.selection.classes import RealClass
from ..materials.surfaces import surfaces_of
from ..materials.table import Material
from ..scanning.colour.colour import MaterialLayers, surface_constants
from ..scanning.devices.device import ScannerSetting
from ..scanning.finish import Finish
from ..scanning.parts.atmosphere import Atmosphere
from ..scanning.parts.emission import Emission
from ..scanning.parts.layers import Layers
from ..scanning.parts.reception import Reception
from ..scanning.parts.reflection import Reflection
from ..scanning.parts.relief import Relief
from ..scanning.parts.run import Run
from ..scanning.plan import ScanPlan
from ..scanning.platforms.polyline import PolylineGuide
from ..scanning.relief.micro_relief import micro_relief
from ..scanning.scan import BlockScan
from ..scanning.scene.mesh import SceneMesh
from ..scanning.scene.motion import ScannedScene
from ..scanning.scene.target import Target
from ..scanning.sway import with_motion
from ..scenario.scan import ScanScenario

_OVERRUN = 20.0
"""The path goes on for so long before and behind the pavement, m: swaying scanners look there as well. Chosen: some
degrees of pitch from a UAV's height."""
_LEAST_SLOPE = 1e-12
"""Least downward component of a ray that meets the pavement. Chosen: keeps the division finite; such rays end beyond
any range."""


@dataclass
class LevelPavement:
    """A level rectangle of one material about the origin, along x, as a scene and its own caster.

    Attributes:
        length, width: m.
        material: of all of it.
    """

    length: float
    width: float
    material: Material
    name: str = "formula"
    main_thread_only: bool = False
    kernels: str = "none: rays are met by a formula"

    def mesh(self, material: str) -> SceneMesh:
        """Return the rectangle as a mesh of two triangles, of a material of this name."""
        x, y = self.length / 2.0, self.width / 2.0
        corners = [(-x, -y, 0.0), (x, -y, 0.0), (x, y, 0.0), (-x, y, 0.0)]
        return SceneMesh(
            vertices=np.array(corners, dtype=np.float32),
            triangles=np.array([(0, 1, 2), (0, 2, 3)], dtype=np.int32),
            class_id=np.ones(2, dtype=np.uint8),
            instance_id=np.ones(2, dtype=np.uint32),
            material=np.zeros(2, dtype=np.uint16),
            materials=(material,),
            origin=np.zeros(3),
        )

    def cast(self, origins: Float32, directions: Float32, maximum_range: float) -> NDArray[np.int32]:
        """Return the triangle (N,) that each ray (N, 3) meets, -1 for none; see `scanning.scene.caster.Caster`."""
        x, y = self._meeting_places(origins, directions, maximum_range)
        above_diagonal = y * self.length > x * self.width
        return np.where(np.isfinite(x), above_diagonal, -1).astype(np.int32)

    def occluded(self, origins: Float32, directions: Float32, maximum_range: float | Float32) -> Bool:
        """Return a mask (N,) of the rays (N, 3) that meet it within a range (m); see `scanning.scene.caster.Caster`."""
        return np.asarray(np.isfinite(self._meeting_places(origins, directions, maximum_range)[0]))

    def _meeting_places(
        self, origins: Float32, directions: Float32, reach: float | Float32
    ) -> tuple[AnyArray, AnyArray]:
        """Return the places x and y (N,), m, at which rays meet the rectangle; inf where they don't within their reach.

        Args:
            origins, directions: (N, 3) m, and unit vectors.
            reach: of all rays, or (N,) of each, m.
        """
        origin, direction = origins.astype(np.float64), directions.astype(np.float64)
        rise = np.where(direction[:, 2] < -_LEAST_SLOPE, direction[:, 2], -_LEAST_SLOPE)
        distance = -origin[:, 2] / rise
        x, y = (origin[:, axis] + distance * direction[:, axis] for axis in (0, 1))
        is_met = (np.abs(x) <= self.length / 2.0) & (np.abs(y) <= self.width / 2.0)
        is_met &= (distance > 0.0) & (distance <= reach)
        return np.where(is_met, x, np.inf), np.where(is_met, y, np.inf)


def simulate_pavement(
    scan: ScanScenario, setting: ScannerSetting, pavement: LevelPavement, name: str, seed: int
) -> RealClass:
    """Return the points that a scenario's scanner records of a pavement along whose middle it moves.

    Args:
        scan: its path and its errors.
        setting: the scanner.
        pavement: what is scanned.
        name: of its material in the table, by which it has its relief.
        seed: of everything random.

    Raises:
        InputError: nothing of the pavement is recorded.
    """
    mesh = pavement.mesh(name)
    half_length = pavement.length / 2.0 + _OVERRUN
    guide = PolylineGuide(np.array([[-half_length, 0.0, 0.0], [half_length, 0.0, 0.0]]))
    plan = ScanPlan(
        Target(ScannedScene(mesh, ()), lambda _: pavement),
        Emission(setting, with_motion(scan.platform.make_path(guide), scan.motion, seed), rings=()),
        Reflection(surfaces_of([pavement.material], scan.reflection), surface_seed=seed),
        Run(seed),
        Atmosphere(scan.attenuation or 0.0),
        Reception(scan.noise, scan.strip_errors),
        Relief(micro_relief([name], [pavement.material]) if scan.relief else None, scan.relief),
        Layers(frozenset({"normal", "material"}), seen_points=True),
    )
    stages, finish = BlockScan(plan), Finish(plan, MaterialLayers(surface_constants([pavement.material])))
    blocks = [finish.finish_block(stages.scan_block(*block)).points for block in plan.blocks()]
    filled_blocks = [block for block in blocks if len(block)]
    if not filled_blocks:
        raise InputError("--real", None, "has no pavement that the fitted scanner would see")
    points = concatenate(filled_blocks)
    numbered_rows = np.flatnonzero(points.intensity > 0.0)
    zero_count, points = len(points) - len(numbered_rows), points.select(numbered_rows)
    return RealClass(
        selection="simulated",
        place=points.xyz,
        intensity=points.intensity.astype(np.float64),
        zeros=zero_count,
        distance=points.range.astype(np.float64),
        incidence=np.full(len(points), np.nan),
        returns=points.number_of_returns,
        time=points.gps_time,
    )
