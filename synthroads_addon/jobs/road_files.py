"""The files that hold a road itself: its parameters and its centreline."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..base.schema import canonical_json
from ..road.centerline import centerline_geojson
from ..road.geometry import RoadGeometry
from ..road.parameters import RoadParameters
from ..road.tessellation import sample_stations
from ..scenario.scenario import Scenario


def write_road_files(
    folder: Path, wanted: Sequence[str], parameters: RoadParameters, geometry: RoadGeometry, scenario: Scenario
) -> None:
    """Write the files that hold the road itself, as far as they are wanted."""
    if "parameters" in wanted:
        (folder / "parameters.json").write_text(parameters.to_json(), encoding="utf-8")
    if "centerline" in wanted:
        stations = sample_stations(geometry, scenario.settings().tolerance)
        text = canonical_json(centerline_geojson(geometry, stations))
        (folder / "centerline.geojson").write_text(text, encoding="utf-8")
