"""Speed limits of OpenDRIVE: what cars drive at most, and what is counted as lost."""

from __future__ import annotations

from pathlib import Path

import pytest

from synthroads_addon.base.remarks import collected_remarks
from synthroads_addon.jobs.whole_road import road_from_file
from synthroads_addon.road.surroundings import Vehicle
from synthroads_addon.scenario.scenario import Scenario
from tests.helpers.roads.lane_files import lane, lanes, road_file, section, taken, width

LANES = lanes(section(0.0, lane(1, width(0.0, 3.5)), lane(-1, width(0.0, 3.5))))


def kind(start: float, most: str, unit: str = "") -> str:
    words = f'unit="{unit}"' if unit else ""
    return f'<type s="{start!r}" type="motorway"><speed max="{most}" {words}/></type>'


def told(report: dict) -> tuple[dict[str, int], dict[str, str]]:
    lost = {row["kind"]: row["why"] for row in report["whole"]["left_out"] if row["kind"].startswith("speed")}
    return report["whole"]["read"], lost


@pytest.mark.parametrize(
    ("most", "unit", "kmh"), [("80", "km/h", 80.0), ("20", "", 72.0), ("50", "mph", 80.4672), ("70", "kph", 70.0)]
)
def test_cars_keep_to_the_roads_limit(tmp_path: Path, most: str, unit: str, kmh: float) -> None:
    path = road_file(tmp_path, kind(0.0, most, unit) + LANES)
    busy = Scenario.from_dict({"road": {"vehicles": {"per_km": {"minimum": 60.0, "maximum": 60.0}}}})
    with collected_remarks():
        parameters, report = road_from_file(path, busy)
    speeds = [item.speed for item in parameters.of_type(Vehicle).values()]
    assert len(speeds) > 5
    assert 0.8 * kmh / 3.6 < max(speeds) <= kmh / 3.6 + 1e-3
    read, lost = told(report)
    assert read["speed limits of the road"] == 1
    assert lost == {}


def test_the_limit_of_most_of_the_road_is_taken(tmp_path: Path) -> None:
    types = kind(0.0, "60", "km/h") + kind(150.0, "100", "km/h")
    _, _, report = taken(road_file(tmp_path, types + LANES))
    read, lost = told(report)
    assert read["speed limits of the road"] == 2
    assert lost == {"speed limits of the road": "cars drive at most 60 km/h all along"}


def test_limits_of_lanes_and_unknown_ones_are_counted(tmp_path: Path) -> None:
    right = lane(-1, width(0.0, 3.5) + '<speed sOffset="0" max="60" unit="km/h"/>')
    _, _, report = taken(road_file(tmp_path, kind(0.0, "9", "furlongs") + lanes(section(0.0, "", right))))
    read, lost = told(report)
    assert "speed limits of the road" not in read
    assert lost == {
        "speed limits of lanes": "in a parameter set signs alone say them",
        "speed limits of the road": "their number or unit isn't known",
    }


@pytest.mark.parametrize("most", ["no limit", "undefined"])
def test_no_limit_is_none(tmp_path: Path, most: str) -> None:
    _, _, report = taken(road_file(tmp_path, kind(0.0, most) + LANES))
    read, lost = told(report)
    assert "speed limits of the road" not in read
    assert lost == {}
