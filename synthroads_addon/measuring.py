"""Rows of the trade-off: one setting, its time, its errors against the analytic road and the converged footprint."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

import numpy as np

from .blender.model import build_road
from .blender.scene import scanned_scene
from .core.cloud.points import PointBlock, concatenate
from .core.measure import mesh_height_errors
from .core.parameters.geometry import RoadGeometry
from .core.parameters.sampler import sample_road
from .core.progress import peak_memory_mb
from .core.scanning.beam import RINGS
from .core.scanning.motion import ScannedScene
from .core.scanning.scan import Scan, scan_pulses
from .core.scanning.target import Target
from .core.scenario import load_scenario
from .pipeline import make_scan, road_path

CONVERGED = max(RINGS)
"""Rays per pulse of the footprint that counts as truth."""
_WINDOWS, _WINDOW = 30, 4000
"""Windows of each strip that are scanned, spread evenly over it, and the pulses of each."""


def measure_row(scenario_name: str, knob: str, value: Any) -> dict[str, Any]:
    """Measure one row of the trade-off.

    Times are processor seconds, which other work on the machine hardly touches: building the model, building the
    caster's tree, and the whole scan, projected from a sample of its pulses. Errors:

    - height: largest vertical distance of 100,000 random points of the road's mesh from the analytic surface;
    - position and intensity: first returns against those of the same pulses with 61 rays, 95th percentile;
    - labels: share of the first returns whose class is another.
    """
    path = {"rays_per_pulse": "scan.rays_per_pulse", "caster": "scan.caster"}.get(knob, knob)
    scenario = load_scenario(scenario_name, ["scan.noise.range_sigma=0", f"{path}={value}"])
    parameters = sample_road(scenario.road, scenario.seed)
    geometry = RoadGeometry(parameters)
    start = time.process_time()
    settings = scenario.settings()
    build_road(parameters, settings.tolerance, settings.vegetation_detail)
    scene = scanned_scene(geometry=geometry, speed_factor=scenario.scan.traffic_speed_factor)
    built = time.process_time()
    scan = make_scan(scenario, scene, road_path(scenario, geometry), parameters.environment)
    ready = time.process_time()
    points, rays = _sample(scan)
    seconds = time.process_time() - ready
    share = _WINDOWS * _WINDOW / scan.pulses(scan.path.strips[0])
    errors: dict[str, float] = {"height_mm": 1e3 * float(np.abs(mesh_height_errors(scene.static, geometry)).max())}
    peak = peak_memory_mb()
    errors |= _beam_errors(scan, scene, points)
    return {
        "knob": knob,
        "value": value,
        "seconds": round(ready - start + seconds / share, 3),
        "model_seconds": round(built - start, 3),
        "caster_seconds": round(ready - built, 3),
        "scan_seconds": round(seconds / share, 3),
        "rays_per_second": round(rays / seconds),
        "peak_memory_mb": peak,
        "triangles": scan.target.triangles,
        "errors": {name: round(error, 6) for name, error in errors.items()},
    }


def _sample(scan: Scan) -> tuple[PointBlock, int]:
    """Scan the same pulses whatever the setting; return their first returns and the number of rays cast."""
    parts, rays = [], 0
    for strip in scan.path.strips:
        firsts = np.linspace(0, scan.pulses(strip) - _WINDOW, _WINDOWS).astype(int)
        for first in firsts:
            result = scan_pulses(scan, strip, int(first), _WINDOW)
            parts.append(result.points)
            rays += result.rays
    points = concatenate(parts)
    return points.select(points.return_number == 1), rays


def _beam_errors(scan: Scan, scene: ScannedScene, points: PointBlock) -> dict[str, float]:
    """Compare first returns with those of the converged footprint, pulse by pulse (told by their time)."""
    if scan.rays_per_pulse == CONVERGED:
        return {"position_mm": 0.0, "intensity_percent": 0.0, "labels_percent": 0.0}
    truth, _ = _sample(replace(scan, rings=RINGS[CONVERGED], target=_fast(scan, scene)))
    _times, mine, true = np.intersect1d(points.gps_time, truth.gps_time, return_indices=True)
    a, b = points.select(mine), truth.select(true)
    return {
        "position_mm": 1e3 * float(np.quantile(np.linalg.norm(a.xyz - b.xyz, axis=1), 0.95)),
        "intensity_percent": 100.0 * float(np.quantile(np.abs(a.intensity / b.intensity - 1.0), 0.95)),
        "labels_percent": 100.0 * float(np.mean(a.class_id != b.class_id)),
    }


def _fast(scan: Scan, scene: ScannedScene) -> Target:
    """Return a fast target for the truth."""
    from .blender.casters import make_caster

    if scan.target.caster.name == "embree":
        return scan.target
    return Target(scene, lambda mesh: make_caster("auto", mesh))
