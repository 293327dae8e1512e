"""Clouds of parameter sets without Blender: points thrown evenly onto the analytic road, its markings and furniture."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from synthroads_addon.base.classes import class_id
from synthroads_addon.cloud.formats.registry import open_writer
from synthroads_addon.cloud.points import PointBlock
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.objects import LineObject
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.section import LineMarking
from synthroads_addon.road.things.concrete_barrier import ConcreteBarrier
from synthroads_addon.road.things.delineator import Delineator
from synthroads_addon.road.things.guardrail import Guardrail
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.road import RoadScenario

Float = NDArray[np.float64]

QUIET = {
    "turnouts": {"exits": 0.0, "entries": 0.0, "emergency_bays": 0.0},
    "lane_changes": {"share": 0.0},
    "barriers": {"noise_barrier": 0.0},
    "furniture": {"signs": False, "gantries": 0.0, "overpass": 0.0, "construction_zone": 0.0, "traffic_lights": 0.0},
}
"""Limits of roads without what makes a cross-section change."""


def road(section: str, design_class: str, length: float, seed: int, **limits: object) -> RoadParameters:
    """Return a sampled road without turnouts and lane changes."""
    data = {"cross_section": section, "design_class": design_class, "length": length} | QUIET | limits
    return sample_road(RoadScenario.from_dict(data), seed)


def cloud_of(parameters: RoadParameters, density: float, seed: int, sigma: float = 0.01) -> PointBlock:
    """Return points of a road, its ground to 12 m beyond the verge, its barriers and delineators.

    Args:
        parameters: the road.
        density: points per m2 of the surface.
        seed: of the points' places and noise.
        sigma: standard deviation of heights, and of intensities in units of 1, m.
    """
    geometry, rng = RoadGeometry(parameters), np.random.default_rng(seed)
    parts = [_surface(geometry, density, rng)]
    for item in parameters.objects.values():
        if isinstance(item, Guardrail | ConcreteBarrier):
            parts.append(_barrier(geometry, item, rng))
        elif isinstance(item, Delineator) and item.station < geometry.length:
            parts.append(_post(geometry, item, rng))
    xyz, intensity, label = (np.concatenate([part[i] for part in parts]) for i in range(3))
    xyz = xyz + np.array(parameters.transform.translate)
    xyz[:, 2] += rng.normal(0.0, sigma, len(xyz))
    intensity = np.clip(intensity + rng.normal(0.0, 2.0 * sigma, len(xyz)), 0.0, 1.0)
    return block_of(xyz, intensity, label)


def block_of(xyz: Float, intensity: Float, label: NDArray[np.uint8]) -> PointBlock:
    """Return a block of points (N) with the instance number 0."""
    count = len(xyz)
    zeros = np.zeros(count)
    return PointBlock(
        xyz=xyz,
        intensity=intensity,
        rgb=np.zeros((count, 3), np.uint16),
        class_id=label.astype(np.uint8),
        instance_id=zeros.astype(np.uint32),
        return_number=np.ones(count, np.uint8),
        number_of_returns=np.ones(count, np.uint8),
        gps_time=zeros,
        scan_angle_deg=zeros.astype(np.float32),
        strip=zeros.astype(np.uint16),
        range=zeros + 60.0,
        incidence_deg=zeros.astype(np.float32),
    )


def write(path: Path, block: PointBlock, epsg: int = 25832) -> Path:
    """Write a block as a cloud file."""
    with open_writer(path, epsg, block.xyz.min(axis=0), 60_000.0, ()) as writer:
        writer.write(block)
    return path


def _surface(geometry: RoadGeometry, density: float, rng: np.random.Generator) -> tuple[Float, Float, NDArray]:
    edges = geometry.offsets(np.linspace(0.0, geometry.length, 50))
    low, high = float(edges.min()) - 12.0, float(edges.max()) + 12.0
    count = int(density * geometry.length * (high - low))
    station, offset = rng.uniform(0.0, geometry.length, count), rng.uniform(low, high, count)
    strip = geometry.strip_index(station, offset)
    names = [s.class_name for s in geometry.strips]
    label = np.array([class_id(name) for name in [*names, "ground"]], np.uint8)[strip]
    for line in geometry.parameters.of_type(LineMarking).values():
        label[_on(geometry, line, station, offset)] = class_id("road_marking")
    inside = np.clip(offset, geometry.offsets(station).min(axis=1), geometry.offsets(station).max(axis=1))
    height = geometry.elevation(station, inside) - 0.4 * np.abs(offset - inside)
    height += np.where(strip < 0, rng.normal(0.0, 0.04, count), 0.0)
    level = {"road": 0.15, "road_marking": 0.75, "roadside": 0.45, "ground": 0.45}
    table = np.zeros(256)
    for name, value in level.items():
        table[class_id(name)] = value
    grass = np.where(np.isin(label, [class_id("roadside"), class_id("ground")]), rng.normal(0.0, 0.08, count), 0.0)
    return np.column_stack([_plan(geometry, station, offset), height]), table[label] + grass, label


def _on(geometry: RoadGeometry, line: LineMarking, station: Float, offset: Float) -> NDArray[np.bool_]:
    left, right = geometry.marking_edges(line, station)
    dashes = geometry.dashes(line)
    if not len(dashes):
        return np.zeros(len(station), bool)
    nth = np.clip(np.searchsorted(dashes[:, 0], station, side="right") - 1, 0, len(dashes) - 1)
    painted = (station >= dashes[nth, 0]) & (station <= dashes[nth, 1])
    return painted & (offset <= left) & (offset >= right)


def _barrier(geometry: RoadGeometry, item: LineObject, rng: np.random.Generator) -> tuple[Float, Float, NDArray]:
    end = min(item.end_station, geometry.length)
    count = int(30 * (end - item.start_station))
    station = rng.uniform(item.start_station, end, count)
    name = "guardrail" if isinstance(item, Guardrail) else "barrier"
    height = rng.uniform(0.4, getattr(item, "height", 0.8), count)
    return _standing(geometry, station, item.offset + rng.normal(0.0, 0.05, count), height, name)


def _post(geometry: RoadGeometry, item: Delineator, rng: np.random.Generator) -> tuple[Float, Float, NDArray]:
    count = 12
    station = item.station + rng.normal(0.0, 0.04, count)
    return _standing(
        geometry, station, item.offset + rng.normal(0.0, 0.04, count), rng.uniform(0.05, 1.0, count), "warning_post"
    )


def _standing(
    geometry: RoadGeometry, station: Float, offset: Float, height: Float, name: str
) -> tuple[Float, Float, NDArray]:
    edges = geometry.offsets(station)
    inside = np.clip(offset, edges.min(axis=1), edges.max(axis=1))
    foot = geometry.elevation(station, inside)
    xyz = np.column_stack([_plan(geometry, station, offset), foot + height])
    return xyz, np.full(len(station), 0.5), np.full(len(station), class_id(name), np.uint8)


def _plan(geometry: RoadGeometry, station: Float, offset: Float) -> Float:
    position, heading, _ = geometry.alignment.frame(station)
    return position + offset[:, None] * np.column_stack([-np.sin(heading), np.cos(heading)])
