"""The files of a road that need no scene: parameters, centreline and geometric-semantic models."""

from __future__ import annotations

from pathlib import Path

from ..base.progress import StageTimer
from ..base.schema import canonical_json
from ..road.centerline import centerline_geojson
from ..road.geometry import RoadGeometry
from ..road.tessellation import sample_stations
from ..scenario.scenario import Scenario
from ..twin.formats import write_twin


def write_road_files(folder: Path, scenario: Scenario, road: RoadGeometry, timer: StageTimer) -> None:
    """Write the files of a road that a scenario asks for and that need no scene."""
    if "parameters" in scenario.outputs:
        (folder / "parameters.json").write_text(road.parameters.to_json(), encoding="utf-8")
    tolerance = scenario.settings().tolerance
    if "centerline" in scenario.outputs:
        text = canonical_json(centerline_geojson(road, sample_stations(road, tolerance)))
        (folder / "centerline.geojson").write_text(text, encoding="utf-8")
    if scenario.twin:
        with timer.stage("twin"):
            write_twin(road.parameters, folder, scenario.twin, tolerance, scenario.ifc)
