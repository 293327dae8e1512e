"""A road written as OpenDRIVE and taken in again, judged by a reader of the standard's formulas that shares no code."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from synthroads_addon.base.remarks import collected_remarks
from synthroads_addon.jobs.whole_road import road_from_file
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.road.things.registry import THINGS
from synthroads_addon.road_files.lanes.differences import Difference, differences
from synthroads_addon.scenario.scenario import Scenario
from synthroads_addon.twin.opendrive.writer import write_opendrive
from tests.helpers.files.opendrive_reader import OpenDrive

TYPES = {"Alignment", "Carriageway", "Turnout", "LineMarking", "Arrow", "Hatching", *THINGS}
TOLERANCE = 0.005
_BESIDE_STEP = 0.12


def there_and_back(road: RoadParameters, folder: Path) -> tuple[Path, RoadParameters, dict[str, Any]]:
    """Return the file that a road is written to, the road that comes of it, and the report."""
    path = folder / "own.xodr"
    write_opendrive(road, path, TOLERANCE)
    scenario = Scenario.from_dict({"road": {"epsg": road.metadata.epsg}})
    with collected_remarks():
        found, report = road_from_file(path, scenario)
    return path, found, report


def surface_errors(path: Path, road: RoadParameters, count: int = 301) -> tuple[float, float]:
    """Return the largest distances (m) of the borders of all lanes of a file from a road: across, and in height."""
    geometry = RoadGeometry(road)
    across, up = [], []
    steps = np.array([s for section in geometry.sections.values() for step in section.steps() for s in step])
    for file in OpenDrive.read(path):
        rng = np.random.default_rng(1)
        stations = np.sort(rng.uniform(0.5, file.length - 0.5, count))
        if len(steps):  # the road changes within 5 cm there
            stations = stations[np.abs(stations[:, None] - steps).min(axis=1) > _BESIDE_STEP]
        for _, _, points in file.border_points(stations):
            for number, place in points.items():
                if number == 0:
                    continue
                local = place - road.transform.translate
                s, t = geometry.alignment.project(local[:, :2])
                offsets, heights = geometry.boundaries(s)
                away = np.abs(offsets - t[:, None])
                nearest = away.argmin(axis=1)
                across.append(away.min(axis=1))
                level = np.take_along_axis(heights, nearest[:, None], axis=1)[:, 0]
                up.append(np.abs(level - local[:, 2]))
    return float(np.concatenate(across).max()), float(np.concatenate(up).max())


def roads_apart(before: RoadParameters, after: RoadParameters, count: int = 2001) -> tuple[float, float]:
    """Return how far (m) the boundaries of two roads' strips are apart at the same stations: across, and in height."""
    first, second = RoadGeometry(before), RoadGeometry(after)
    station = np.linspace(0.0, first.length, count)
    steps = np.array([s for section in first.sections.values() for step in section.steps() for s in step])
    if len(steps):
        station = station[np.abs(station[:, None] - steps).min(axis=1) > _BESIDE_STEP]
    (a, low), (b, high) = first.boundaries(station), second.boundaries(station)
    up = before.transform.translate[2], after.transform.translate[2]
    return float(np.abs(a - b).max()), float(np.abs(low + up[0] - high - up[1]).max())


def changed_fields(before: RoadParameters, after: RoadParameters) -> list[Difference]:
    """Return in what the road differs from what it was, of all that OpenDRIVE holds."""
    return differences(before, after, TYPES)
