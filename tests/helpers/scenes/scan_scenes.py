"""Small scenes, a hovering scanner and a caster by brute force, for tests of the scanner's loop."""

import dataclasses
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from synthroads_addon.materials.surfaces import surfaces_of
from synthroads_addon.materials.table import materials
from synthroads_addon.scanning.beam import RINGS
from synthroads_addon.scanning.parts.emission import Emission
from synthroads_addon.scanning.parts.layers import Layers
from synthroads_addon.scanning.parts.reflection import Reflection
from synthroads_addon.scanning.parts.run import Run
from synthroads_addon.scanning.plan import ScanPlan
from synthroads_addon.scanning.platforms.path import Strip
from synthroads_addon.scanning.pulses import Pulses
from synthroads_addon.scanning.returns import Echoes, group_returns
from synthroads_addon.scanning.scan import BlockResult, BlockScan
from synthroads_addon.scanning.scene.mesh import SceneMesh
from synthroads_addon.scanning.scene.motion import ScannedScene
from synthroads_addon.scanning.scene.target import Target
from synthroads_addon.scanning.trace import Rays, trace
from synthroads_addon.scenario.scan import scanner_setting
from synthroads_addon.scenario.scenario import load_scenario

ORIGIN = np.array([294_000.0, 5_628_000.0, 180.0])


@dataclass
class BruteForce:
    """Casts by testing every face: slow, and plainly right."""

    mesh: SceneMesh
    name: str = "brute force"
    main_thread_only: bool = False
    kernels: str = "none"

    def cast(self, origins, directions, maximum_range):
        best, hit = np.full(len(origins), np.inf), np.full(len(origins), -1, dtype=np.int32)
        o, d = origins.astype(float), directions.astype(float)
        for index, (a, b, c) in enumerate(self.mesh.vertices[self.mesh.triangles].astype(float)):
            p = np.cross(d, c - a)
            det = p @ (b - a)
            with np.errstate(divide="ignore", invalid="ignore"):
                s = o - a
                u = (s * p).sum(1) / det
                q = np.cross(s, b - a)
                v = (d * q).sum(1) / det
                t = q @ (c - a) / det
                inside = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0) & (t < best) & (t <= maximum_range)
            best, hit = np.where(inside, t, best), np.where(inside, index, hit).astype(np.int32)
        return hit

    def occluded(self, origins, directions, maximum_range):
        return self.cast(origins, directions, maximum_range) >= 0


def upright(angle: np.ndarray) -> np.ndarray:
    """Return rotations (K, 3, 3) about the vertical by angles (K,), rad."""
    cos, sin, none = np.cos(angle), np.sin(angle), np.zeros_like(angle)
    return np.stack([cos, -sin, none, sin, cos, none, none, none, none + 1.0], axis=-1).reshape(-1, 3, 3)


class Standing:
    """A scanner that hovers over the origin, above z = 0, heading east; or flies east at a speed."""

    strips = (Strip(0, 0.0, 75.0),)
    knot_spacing = 0.01

    def __init__(self, height: float = 60.0, speed: float = 0.0) -> None:
        self.typical_range = self.height = height
        self.speed = speed

    def pose(self, strip, time):
        place = np.zeros((len(time), 3))
        place[:, 0], place[:, 2] = self.speed * time, self.height
        return place, np.broadcast_to(np.eye(3), (len(time), 3, 3))


def mesh_of(vertices, triangles, material="asphalt") -> SceneMesh:
    count = len(triangles)
    return SceneMesh(
        vertices=np.asarray(vertices, dtype=np.float32),
        triangles=np.asarray(triangles, dtype=np.int32).reshape(-1, 3),
        class_id=np.ones(count, dtype=np.uint8),
        instance_id=np.full(count, 7, dtype=np.uint32),
        material=np.zeros(count, dtype=np.uint16),
        materials=(material,),
        origin=ORIGIN,
    )


def plane(size: float = 5000.0, slope: tuple[float, float] = (0.0, 0.0)) -> SceneMesh:
    """Return a square through the origin that rises by ``slope`` along x and y."""
    corners = [(x, y, x * slope[0] + y * slope[1]) for x in (-size, size) for y in (-size, size)]
    return mesh_of(corners, [(0, 2, 3), (0, 3, 1)])


def scan_of(mesh: SceneMesh, rays: int = 1, path: Standing | None = None, moving=(), **changes) -> ScanPlan:
    setting = scanner_setting(load_scenario("rq31-600m-even").scan)
    setting = replace(setting, **{"range_sigma": 0.0, "threshold": 0.0, "saturation": np.inf, **changes})
    surfaces = surfaces_of(materials()[name] for name in mesh.materials)
    target = Target(ScannedScene(mesh, tuple(moving)), BruteForce)
    layers = Layers(frozenset({"rgb", "normal", "true_range", "true_xyz", "scanner"}))
    emission = Emission(setting, path or Standing(), RINGS[rays])
    return ScanPlan(target, emission, Reflection(surfaces, surface_seed=3), Run(seed=3), layers=layers)


def altered(plan: ScanPlan, **fields: Any) -> ScanPlan:
    """Return a plan with fields of its parts changed, by the fields' names: no two parts have one of the same."""
    parts = {}
    for part in dataclasses.fields(plan):
        value = getattr(plan, part.name)
        known = {one.name for one in dataclasses.fields(value)} if dataclasses.is_dataclass(value) else set()
        if mine := {name: fields.pop(name) for name in known & fields.keys()}:
            parts[part.name] = replace(value, **mine)
    return replace(plan, **parts, **fields)


def scan_block(scan: ScanPlan, strip: Strip, block: int) -> BlockResult:
    """Scan one block."""
    return BlockScan(scan).scan_block(strip, block)


def scan_pulses(scan: ScanPlan, strip: Strip, first: int, count: int, key: int = 0) -> BlockResult:
    """Scan pulses of a strip."""
    return BlockScan(scan).scan_pulses(strip, first, count, key)


def emit_pulses(scan: ScanPlan, strip: Strip, begin: float, end: float, first: int, count: int) -> Pulses:
    """Return pulses of a strip without pointing errors; the poses are those between two times."""
    emitter = BlockScan(scan).emitter
    return emitter.emit(strip, emitter.poses_between(strip, begin, end), None, first, count)


def beam_rays(scan: ScanPlan, pulses: Pulses) -> Rays:
    """Return the rays of pulses where nothing moves."""
    return BlockScan(scan).tracer.rays(pulses, [])


def middle_pulses(scan: ScanPlan, count: int = 100):
    """Scan pulses around the nadir of the first line."""
    return scan_pulses(scan, scan.path.strips[0], 500 - count // 2, count)


def echoes_and_pulses(scan: ScanPlan, first: int, count: int) -> tuple[Echoes, Pulses]:
    """Return the echoes of some pulses of the first strip, before any threshold, and the pulses."""
    strip = scan.path.strips[0]
    pulses = emit_pulses(scan, strip, 0.0, 80.0, first, count)
    traced = trace(scan.target, scan.reflection.surfaces, beam_rays(scan, pulses), [], 0.0, scan.setting.maximum_range)
    signals = BlockScan(scan).tracer.signals(traced)
    return group_returns(*signals, traced.pulse, scan.setting.range_resolution), pulses
