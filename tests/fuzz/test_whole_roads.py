"""Whole roads of OpenDRIVE files, other programs' and our own, made wrong by chance: a road, or one line."""

from __future__ import annotations

import tempfile
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import strategies as st

from synthroads_addon.base.remarks import collected_remarks
from synthroads_addon.jobs.whole_road import road_from_file
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.scenario.scenario import Scenario
from synthroads_addon.twin.opendrive.writer import write_opendrive
from tests.fuzz.test_roads import with_odd_numbers
from tests.helpers.files.mutations import TOKENS, accepted, damaged, for_all, fuzz
from tests.helpers.files.wrong_xml import wrong_xml
from tests.helpers.roads.lane_files import border, cubic, lane, lanes, road_file, section, width
from tests.helpers.roads.twin_roads import EVERYTHING, road

SHORT = [token for token in TOKENS if len(token) < 100]
MARK = '<roadMark sOffset="0" type="broken" color="yellow"><type name="x" width="0.15">'
MARK += '<line length="4" space="8" tOffset="0" sOffset="3" width="0.15"/></type></roadMark>'
SOLID = '<roadMark sOffset="0" type="solid solid" color="standard" width="0.2"/>'
OBJECTS = """<objects>
<object id="1" s="20" t="-9" type="barrier" subtype="guardRail"><repeat s="20" length="100" distance="0" tStart="-9"
 tEnd="-9.5" heightStart="0.8" heightEnd="0.8"/></object>
<object id="2" s="0" t="0" type="guide-post" height="0.9"><repeat s="10" length="150" distance="50" tStart="-8"
 tEnd="-8"/></object>
<object id="3" s="50" t="14" hdg="0.5" type="building" length="12" width="8" height="6"/>
<object id="4" s="60" t="9" type="soundBarrier" height="3"><outlines><outline id="0"><cornerRoad s="60" t="9" dz="0"
 height="3"/><cornerRoad s="90" t="9" dz="0" height="3"/></outline></outlines></object>
<object id="5" s="70" t="9" type="tree"/><bridge id="6" s="50" length="20" type="concrete"/>
<tunnel id="7" s="90" length="30" type="standard"/></objects>
<signals><signal id="1" name="s" s="40" t="-8" orientation="-" hOffset="0" country="DE" type="274" value="120"
 unit="km/h"/><signal id="2" s="40" t="-8" type="1000001"/></signals>"""
LATERAL = f"<lateralProfile>{cubic('superelevation', 's', 0.0, 0.03, 1e-4)}</lateralProfile>"
SHAPES = f"<lateralProfile>{cubic('superelevation', 's', 0.0, 0.02)}{{}}</lateralProfile>"
HEIGHTS = f"<elevationProfile>{cubic('elevation', 's', 0.0, 50.0, 0.02, 1e-4, -1e-6)}</elevationProfile>"
"""Parts of roads of other programs."""


def _shapes() -> str:
    rows = [(0.0, -5.0, -0.1, 0.02), (0.0, 0.0, 0.0, -0.02), (150.0, -5.0, -0.05, 0.01), (150.0, 0.0, 0.0, 0.0)]
    return "".join(f'<shape s="{s}" t="{t}" a="{a}" b="{b}" c="0" d="0"/>' for s, t, a, b in rows)


def of_others(folder: Path) -> list[bytes]:
    """Return files with widths and borders, sections, offsets, superelevation, shapes, marks, objects and signals."""
    left = lane(1, width(0.0, 3.5) + MARK) + lane(2, width(0.0, 2.5), "shoulder")
    right = lane(-1, width(0.0, 3.25, 0.001) + SOLID) + lane(-2, width(0.0, 0.0, 0.0, 3e-3, -2e-5) + MARK)
    second = lane(-1, width(0.0, 3.35)) + lane(-2, width(0.0, 3.5)) + lane(-3, width(0.0, 1.5), "shoulder", "true")
    high = lane(-1, width(0.0, 3.5) + '<height sOffset="0" inner="0.1" outer="0.12"/>')
    both = lanes(
        cubic("laneOffset", "s", 0.0, 0.5, 0.01),
        section(0.0, left, right, MARK),
        section(100.0, left, second, SOLID),
    )
    borders = lanes(section(0.0, lane(1, border(0.0, 3.4)), lane(-1, border(0.0, 3.4)) + lane(-2, border(0.0, 5.0))))
    arc = '<arc curvature="0.004"/>'
    rest = (
        HEIGHTS + LATERAL + both + OBJECTS,
        SHAPES.format(_shapes()) + both,
        borders + OBJECTS,
        lanes(section(0.0, left, high), section(80.0, "", high, more='singleSide="true"')),
    )
    return [road_file(folder, text, shape=arc).read_bytes() for text in rest]


@cache
def _own() -> bytes:
    limits = {**EVERYTHING, "design_class": "EKA1A", "cross_section": "RQ31", "length": 900.0}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "own.xodr"
        write_opendrive(road(11, **limits), path, 0.05)
        return path.read_bytes()


def use_road(path: Path) -> None:
    """Take a file's whole road, and evaluate it."""
    with collected_remarks() as remarks:
        parameters, report = road_from_file(path, Scenario.from_dict({}))
    assert all(len(text) < 2000 and text.isprintable() for text in remarks), remarks
    assert all(line.isprintable() for line in report.get("summary", ()))
    geometry = RoadGeometry(parameters)
    station = np.linspace(0.0, geometry.length, 50)
    for values in (geometry.alignment.position(station), *geometry.boundaries(station)):
        assert np.isfinite(values).all()
    parameters.to_json()


def run(tmp_path: Path, wrong: st.SearchStrategy[bytes], count: int) -> None:
    path = tmp_path / "road.xodr"

    def body(content: bytes) -> None:
        path.write_bytes(content)
        accepted(lambda: use_road(path))

    for_all(wrong, count, body)


def files_of(whose: str, folder: Path) -> list[bytes]:
    return of_others(folder) if whose == "others" else [_own()]


@fuzz(4, 1000)
@pytest.mark.parametrize("whose", ["others", "own"])
def test_whole_roads_with_wrong_elements(tmp_path: Path, whose: str, count: int) -> None:
    run(tmp_path, wrong_xml(files_of(whose, tmp_path)), count)


@fuzz(4, 1000)
@pytest.mark.parametrize("whose", ["others", "own"])
def test_whole_roads_with_odd_numbers(tmp_path: Path, whose: str, count: int) -> None:
    run(tmp_path, with_odd_numbers(files_of(whose, tmp_path)), count)


@fuzz(10, 1000)
def test_damaged_whole_roads(tmp_path: Path, count: int) -> None:
    run(tmp_path, damaged(files_of("others", tmp_path), SHORT, head=3000), count)
