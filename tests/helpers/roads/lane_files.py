"""Small OpenDRIVE roads with lanes, and what becomes of them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from synthroads_addon.base.remarks import collected_remarks
from synthroads_addon.jobs.whole_road import road_from_file
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.scenario.scenario import Scenario
from tests.helpers.roads.written_lines import opendrive, xodr_road

LENGTH = 200.0


def cubic(tag: str, where: str, start: float, *row: float) -> str:
    values = " ".join(f'{name}="{value!r}"' for name, value in zip("abcd", (*row, 0.0, 0.0, 0.0), strict=False))
    return f'<{tag} {where}="{start!r}" {values}/>'


def width(start: float, *row: float) -> str:
    return cubic("width", "sOffset", start, *row)


def border(start: float, *row: float) -> str:
    return cubic("border", "sOffset", start, *row)


def lane(number: int, inner: str, kind: str = "driving", level: str = "false") -> str:
    return f'<lane id="{number}" type="{kind}" level="{level}">{inner}</lane>'


def section(start: float, left: str = "", right: str = "", centre: str = "", more: str = "") -> str:
    sides = f'{f"<left>{left}</left>" if left else ""}<center><lane id="0" type="none">{centre}</lane></center>'
    return f'<laneSection s="{start!r}" {more}>{sides}{f"<right>{right}</right>" if right else ""}</laneSection>'


def lanes(*parts: str) -> str:
    return f"<lanes>{''.join(parts)}</lanes>"


def road_file(folder: Path, rest: str, rule: str = "RHT", length: float = LENGTH, shape: str = "<line/>") -> Path:
    """Write a road of one element with what is given, at a height of 50 m where nothing says another."""
    if "elevationProfile" not in rest:
        rest = f"<elevationProfile>{cubic('elevation', 's', 0.0, 50.0)}</elevationProfile>{rest}"
    road = xodr_road([(0.0, length, (10.0, 20.0, 0.3), shape)], rest).replace("<road ", f'<road rule="{rule}" ')
    return opendrive(folder / "lanes.xodr", [road], "<geoReference>EPSG:25832</geoReference>")


def taken(path: Path, name: str | None = None) -> tuple[RoadParameters, RoadGeometry, dict[str, Any]]:
    """Return the road that a file becomes, its geometry, and the report."""
    with collected_remarks():
        parameters, report = road_from_file(path, Scenario.from_dict({}), name)
    return parameters, RoadGeometry(parameters), report
