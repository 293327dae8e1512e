"""A long road by section: memory as for 2 km, and returns where exact rays meet the exact triangles."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import laspy
import numpy as np
import pytest
from numpy.typing import NDArray

from synthroads_addon.base.classes import class_id
from synthroads_addon.base.progress import StageTimer
from synthroads_addon.blender.model.build import remove_road
from synthroads_addon.jobs.scan.by_section import SectionScan
from synthroads_addon.jobs.scan.plan import Site
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import read_parameters
from synthroads_addon.road.tessellation import sample_stations
from synthroads_addon.scanning.plan import ScanPlan
from synthroads_addon.scenario.inputs import ScenarioInputs
from synthroads_addon.scenario.scenario import Scenario
from tests.helpers.scenes.scan_scenes import emit_pulses, scan_pulses
from tests.helpers.scenes.sparse_scanner import sparse_scanner

pytestmark = pytest.mark.any_blender

Float = NDArray[np.float64]

TOLERANCE = 0.005
LAS_ROUNDING = 0.0005 * np.sqrt(3.0)
LONG = 500.0 * int(os.environ.get("SYNTHROADS_SECTIONS", "40"))
"""Length of the long road (m): 40 sections of 500 m show what 200 show in a fifth of the time."""
LOOKED_AT = 5
"""Sections, spread over the road, that rays are cast at in float64."""
PULSES = 400


def sparse(folder: Path, length: float) -> dict[str, Any]:
    return {
        "type": "Scenario", "version": "1.0", "seed": 4, "vegetation_detail": 0.0,
        # Each vehicle is built anew with its section: with few of them a section takes a third of the time.
        "road": {"length": length, "vehicles": {"per_km": {"minimum": 1.0, "maximum": 1.0}}},
        "scan": {
            "device": sparse_scanner(folder, kilohertz=2.0), "rays_per_pulse": 1, "relief": 0.0,
            "lines_per_second": 20.0, "platform": {"speed": 40.0, "lateral_offsets": [0.0]},
        },
        "colour": {"source": "material", "rgb": False},
        "outputs": ["parameters", "cloud", "centerline"],
    }  # fmt: skip


def generated(folder: Path, length: float) -> dict[str, Any]:
    """Generate in a process of its own, whose memory is its own; return the report."""
    file, output = folder / f"{length:g}.json", folder / f"{length:g}"
    file.write_text(json.dumps(sparse(folder, length)), encoding="utf-8")
    command = [sys.executable, "-m", "headless.generate", "--scenario", str(file), "--output", str(output), "--quiet"]
    subprocess.run(command, check=True, cwd=Path(__file__).parents[3])
    report: dict[str, Any] = json.loads((output / "report.json").read_text(encoding="utf-8"))
    return report


def exact_triangles(geometry: RoadGeometry, low: float, high: float, scan: ScanPlan, frame: Float) -> Float:
    """Return the triangles (T, 3, 3) of a section's pavement in the road's frame, their corners in float64.

    They are the model's but for patches and cracks, which lie on it between its rows; only where its corners lie is
    worked out anew, from the road's rows and boundaries.
    """
    rows = sample_stations(geometry, TOLERANCE, low, high)
    mesh = MESH[id(scan)]
    chosen = mesh.triangles[(mesh.class_id == class_id("road")) & ~is_laid_on(geometry, mesh.instance_id)]
    used, corner = np.unique(chosen, return_inverse=True)
    given = mesh.vertices[used].astype(np.float64) + frame
    station, offset = geometry.alignment.project(given[:, :2])
    nearest = np.clip(np.searchsorted(rows, station), 1, len(rows) - 1)
    nearest -= np.abs(rows[nearest - 1] - station) < np.abs(rows[nearest] - station)
    plan, heading, _ = geometry.alignment.frame(rows[nearest])
    left = np.stack([-np.sin(heading), np.cos(heading)], axis=1)
    exact = np.column_stack([plan + offset[:, None] * left, geometry.elevation(rows[nearest], offset)])
    away = np.linalg.norm(exact - given, axis=1)
    assert away.max() < 0.001, f"a corner of the model lies {away.max() * 1000:.2f} mm off"
    return exact[corner.reshape(-1, 3)]


def is_laid_on(geometry: RoadGeometry, instance: Any) -> Any:
    """Return which of some instances are patches or cracks: a patch fills the ruts below it."""
    return np.isin(instance, geometry.numbers.laid_on())


MESH: dict[int, Any] = {}


def met(triangles: Float, origin: Float, direction: Float) -> Iterator[float]:
    """Yield the range at which each ray meets the first of some triangles, inf for none: Moeller and Trumbore."""
    a = triangles[:, 0]
    e1, e2 = triangles[:, 1] - a, triangles[:, 2] - a
    for start, along in zip(origin, direction, strict=True):
        p = np.cross(along, e2)
        scale = np.einsum("ij,ij->i", e1, p)
        with np.errstate(divide="ignore", invalid="ignore"):
            s = start - a
            u = np.einsum("ij,ij->i", s, p) / scale
            q = np.cross(s, e1)
            v = q @ along / scale
            distance = np.einsum("ij,ij->i", e2, q) / scale
        inside = (u >= -1e-9) & (v >= -1e-9) & (u + v <= 1.0 + 1e-9) & (distance > 0.0)
        yield float(distance[inside].min(initial=np.inf))


@contextmanager
def build_section(work: SectionScan, section: Any) -> Iterator[ScanPlan]:
    """Build a section and yield its plan; drop it afterwards."""
    try:
        yield work.plan(section, StageTimer())
    finally:
        remove_road()


def errors_of_a_section(work: SectionScan, road: RoadGeometry, section: Any, monkeypatch: pytest.MonkeyPatch) -> Float:
    """Return how far (m) returns from the pavement lie from where exact rays meet the exact triangles."""
    make = Site.plan
    meshes = []

    def keep(site: Site, scene: Any, services: Any) -> ScanPlan:
        meshes.append(scene.static)
        return make(site, scene, services)

    monkeypatch.setattr(Site, "plan", keep)
    with build_section(work, section) as scan:
        MESH[id(scan)] = meshes[-1]
        triangles = exact_triangles(road, section.build_start, section.build_end, scan, scan.reflection.frame_origin)
        strip, block = section.blocks[len(section.blocks) // 2]
        first, _ = work.cut.pulse_span(strip, block)
        result = scan_pulses(scan, strip, first, PULSES, block).points
        times = (work.cut.time(strip, number) for number in (first, first + PULSES - 1))
        pulses = emit_pulses(scan, strip, *times, first, PULSES)
    monkeypatch.undo()
    paved = result.select(np.flatnonzero((result.class_id == class_id("road")) & ~is_laid_on(road, result.instance_id)))
    rows = np.searchsorted(pulses.time, paved.gps_time)
    assert np.array_equal(pulses.time[rows], paved.gps_time)
    origin, direction = pulses.origin.T[rows] + scan.reflection.frame_origin, pulses.direction.T[rows]
    exact = np.array(list(met(triangles, origin, direction)))
    place = origin + exact[:, None] * direction + np.array(road.parameters.transform.translate)
    return np.linalg.norm(paved.xyz - place, axis=1)


@pytest.mark.slow
def test_a_long_road(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    short, report = generated(tmp_path, 2000.0), generated(tmp_path, LONG)
    peaks = [max(stage["peak_memory_mb"] for stage in one["stages"].values()) for one in (short, report)]
    counts = report["counts"]
    print(f"\n{counts['sections']} sections, {counts['points']:,} points in {report['seconds']:.0f} s")
    print(f"peak memory {peaks[0]:.0f} MB for 2 km, {peaks[1]:.0f} MB for {LONG / 1000.0:g} km")
    assert counts["sections"] == LONG / 500.0
    assert peaks[1] < 1.05 * peaks[0]

    folder = tmp_path / f"{LONG:g}"
    parameters = read_parameters(folder / "parameters.json")
    geometry = RoadGeometry(parameters)
    worst = 0.0
    with laspy.open(folder / "cloud.laz") as file:
        for chunk in file.chunk_iterator(1_000_000):
            surface = (chunk["class_id"] == class_id("road")) & ~is_laid_on(geometry, chunk["instance_id"])
            xyz = np.column_stack([chunk.x, chunk.y, chunk.z])[surface]
            assert (xyz[:, 1] > 5.4e6).all()
            local = xyz - np.array(parameters.transform.translate)
            error = local[:, 2] - geometry.elevation(*geometry.alignment.project(local[:, :2]))
            worst = max(worst, float(np.nanmax(np.abs(error))))
    print(f"farthest from the analytic surface: {worst * 1000:.2f} mm")
    assert worst < TOLERANCE + 0.001 + LAS_ROUNDING

    scenario = Scenario.from_dict(sparse(tmp_path, LONG))
    work = SectionScan(Site.of_road(scenario, geometry, ScenarioInputs.read(scenario)), geometry)
    sections = list(work.sections())
    for number in np.linspace(0, len(sections) - 1, LOOKED_AT).astype(int):
        errors = errors_of_a_section(work, geometry, sections[number], monkeypatch)
        print(f"{sections[number].start:7.0f} m: {len(errors)} returns, at most {errors.max() * 1000:.3f} mm off")
        assert len(errors) > 50
        assert errors.max() < 0.001
