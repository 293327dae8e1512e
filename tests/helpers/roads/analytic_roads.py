"""Clouds of roads straight from the analytic geometry, without Blender: for tests of what learns from slices."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from ml.data.corridor import Learned, truths
from ml.data.points import Points
from ml.data.roads import LearningRoad
from synthroads_addon.base.classes import class_scheme
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.section import LineMarking
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.road import RoadScenario

SEED = 5
BRIGHTNESS = {0: 0.10, 1: 0.03, 2: 0.30}
"""Intensity of ground, road and marking."""


@cache
def parameters(section: str = "RQ31", design_class: str = "EKA1A", seed: int = SEED) -> RoadParameters:
    """Return a curved road of 160 m without turnouts."""
    scenario = RoadScenario.from_dict(
        {
            "design_class": design_class,
            "cross_section": section,
            "length": 160.0,
            "radius": {"minimum": 300.0 if design_class == "EKA3" else 900.0, "maximum": 1000.0},
            "turnouts": {"exits": 0.0, "entries": 0.0, "emergency_bays": 0.0},
            "lane_changes": {"share": 0.0},
            "furniture": {"construction_zone": 0.0},
            "pavement": {"rutted": 0.0, "potholes_per_km": {"minimum": 0.0, "maximum": 0.0}},
        }
    )
    return sample_road(scenario, seed)


@cache
def points(section: str = "RQ31", design_class: str = "EKA1A", seed: int = SEED, density: float = 8.0) -> Points:
    """Return points of a road as wide as its verges, in map coordinates less a whole origin; classes of five."""
    road = parameters(section, design_class, seed)
    geometry = RoadGeometry(road)
    rng = np.random.default_rng(seed)
    half = 20.0
    count = int(density * geometry.length * 2.0 * half)
    station, offset = rng.uniform(0.0, geometry.length, count), rng.uniform(-half, half, count)
    local = geometry.point(station, offset)
    there = ~np.isnan(local[:, 2])
    station, offset, local = station[there], offset[there], local[there]
    strip = geometry.strip_index(station, offset)
    kinds = np.array([item.class_name for item in geometry.strips])
    labels = np.where(kinds[strip] == "road", 1, 0).astype(np.uint8)
    for line in road.of_type(LineMarking).values():
        left, right = geometry.marking_edges(line, station)
        dashes = geometry.dashes(line)
        on = np.zeros(len(station), dtype=bool)
        for start, end in dashes:
            on |= (station >= start) & (station <= end)
        labels[on & (offset <= left) & (offset >= right)] = 2
    map_xyz = local + np.array(road.transform.translate)
    origin = np.floor(map_xyz.min(axis=0))
    bright = np.array([BRIGHTNESS[number] for number in range(3)])[labels] * rng.uniform(0.9, 1.1, len(labels))
    return Points(
        origin=origin,
        xyz=map_xyz - origin,
        intensity=bright.astype(np.float32),
        rgb=np.repeat(bright[:, None] * 2.0, 3, axis=1).astype(np.float32),
        class_id=labels,
        class_names=class_scheme("5").names(),
        has_color=True,
        epsg=25832,
    )


def roads(
    kind: Learned = "road", section: str = "RQ31", design_class: str = "EKA1A", seed: int = SEED
) -> list[LearningRoad]:
    """Return a road for each truth of a kind; tests share their arrays, which can't be written to."""
    return list(_roads(kind, section, design_class, seed))


@cache
def _roads(kind: Learned, section: str, design_class: str, seed: int) -> tuple[LearningRoad, ...]:
    known = parameters(section, design_class, seed)
    whole = _sorted(section, design_class, seed)
    return tuple(replace(whole, truth=truth) for truth in truths(known, kind, whole.origin))


@cache
def _sorted(section: str, design_class: str, seed: int) -> LearningRoad:
    cloud = points(section, design_class, seed)
    line = truths(parameters(section, design_class, seed), "road", cloud.origin)[0].axis
    whole = LearningRoad.of_points(section, cloud, line)
    for array in (whole.xyz, whole.intensity, whole.rgb, whole.class_id, whole.station):
        array.setflags(write=False)
    return whole
