"""From a file to a parameter set: where the road lies, where heights come from, and that nothing is lost on the way."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from headless.cli import main
from synthroads_addon.base.errors import InputError
from synthroads_addon.base.remarks import collected_remarks
from synthroads_addon.jobs.axis_source import axis_from_file
from synthroads_addon.road.geometry import RoadGeometry, alignment_of
from synthroads_addon.road.parameters import read_parameters
from synthroads_addon.road_files.axis import road_axis
from synthroads_addon.scenario.road import RoadScenario
from tests.helpers.files.mutations import limited
from tests.helpers.roads.written_lines import opendrive, xodr_road
from tests.road_files.test_opendrive import ELEMENTS, main_road

UTM32 = "<geoReference>EPSG:25832</geoReference>"
HEIGHTS = '<elevationProfile><elevation s="0" a="412" b="0.01" c="0" d="0"/></elevationProfile>'
PLACE = 500_000.0, 5_600_000.0


def test_the_road_lies_where_the_file_says(tmp_path: Path) -> None:
    road, walk = main_road(*PLACE, HEIGHTS)
    path = opendrive(tmp_path / "a.xodr", [road], UTM32)
    axis, scenario, report = road_axis(path, RoadScenario())
    assert scenario.epsg == 25832
    station, points = walk.points(5.0)
    found = alignment_of(axis).position(station) + scenario.map_origin[:2]
    assert np.hypot(*(found - points).T).max() < 1e-6
    assert axis.vertical[0].elevation + scenario.map_origin[2] == pytest.approx(412.0)
    assert [(e.length, e.curvature_start, e.curvature_end) for e in axis.horizontal] == ELEMENTS
    assert report["placed"] == "as the file has it, in EPSG:25832"


def test_another_zone_that_the_scenario_names_is_moved_to_and_told(tmp_path: Path) -> None:
    """Elements of one projection are none of another's: the road is moved as a whole, and its ends' error is told."""
    from pyproj import Transformer

    road, walk = main_road(*PLACE, HEIGHTS)
    path = opendrive(tmp_path / "a.xodr", [road], UTM32)
    with collected_remarks() as remarks:
        axis, scenario, _ = road_axis(path, RoadScenario(epsg=25833))
    assert scenario.epsg == 25833
    station, points = walk.points(5.0)
    wanted = np.column_stack(Transformer.from_crs(25832, 25833, always_xy=True).transform(*points.T))
    found = alignment_of(axis).position(station) + scenario.map_origin[:2]
    off = np.hypot(*(found - wanted).T).max()
    assert 0.05 < off < 0.5
    assert f"its ends are off by {off:.3f}"[:24] in remarks[0]


def test_a_projection_of_its_own_becomes_a_zone_of_utm(tmp_path: Path) -> None:
    road, _ = main_road(0.0, 0.0, HEIGHTS)
    header = "<geoReference>+proj=tmerc +lat_0=-33.9 +lon_0=18.4 +k=1 +x_0=0 +y_0=0 +datum=WGS84</geoReference>"
    axis, scenario, _ = road_axis(opendrive(tmp_path / "a.xodr", [road], header), RoadScenario())
    assert scenario.epsg == 32734
    assert axis.length == pytest.approx(400.0)


GK21 = "<geoReference>+proj=tmerc +lat_0=0 +lon_0=21 +k=1 +x_0=21500000 +y_0=0 +ellps=GRS80 +units=m</geoReference>"
"""ETRS89 / GK21FIN (EPSG:3875), as a string that names no datum."""


@pytest.mark.parametrize(
    ("notes", "given", "codes"),
    [
        ('<userData code="epsg" value="3875"/><userData code="height_epsg" value="3900"/>', None, (3875, 3900)),
        ('<userData code="epsg" value="3875"/>', None, (3875, None)),
        ("", 3875, (3875, None)),
        ('<userData code="epsg" value="25832"/>', None, (32634, None)),
        ('<userData code="epsg" value="999999"/>', None, (32634, None)),
        ('<userData code="epsg" value="x"/>', None, (32634, None)),
    ],
)
def test_a_projection_that_names_no_datum_is_the_one_of_a_code_beside_it(
    tmp_path: Path, notes: str, given: int | None, codes: tuple[int, int | None]
) -> None:
    road, walk = main_road(21_510_000.0, 6_700_000.0, HEIGHTS)
    path = opendrive(tmp_path / "a.xodr", [road], GK21 + notes)
    with collected_remarks() as remarks:
        axis, scenario, _ = road_axis(path, RoadScenario(epsg=given) if given else RoadScenario())
    assert (scenario.epsg, scenario.height_epsg) == codes
    if codes[0] == 3875:
        assert not any("moved" in remark for remark in remarks)
        station, points = walk.points(5.0)
        found = alignment_of(axis).position(station) + scenario.map_origin[:2]
        assert np.hypot(*(found - points).T).max() < 1e-6


def test_without_a_system_the_scenarios_is_assumed_and_told(tmp_path: Path) -> None:
    road, _ = main_road(rest=HEIGHTS)
    path = opendrive(tmp_path / "a.xodr", [road])
    for scenario, word in ((RoadScenario(), "--set road.epsg=CODE"), (RoadScenario(epsg=25833), "EPSG:25833")):
        with collected_remarks() as remarks:
            _, there, _ = road_axis(path, scenario)
        assert there.epsg == scenario.epsg
        assert word in remarks[0]


@pytest.mark.parametrize("curvature", [0.5, -3.0])
def test_what_no_road_may_be_is_one_line(tmp_path: Path, curvature: float) -> None:
    shape = f'<arc curvature="{curvature}"/>'
    path = opendrive(tmp_path / "a.xodr", [xodr_road([(0.0, 3.0, (0.0, 0.0, 0.0), shape)])])
    with pytest.raises(
        InputError, match=r"main: arc at station 0\.000 m: curvature, 1/m is (0\.5|3\.0): must be at most 0\.1"
    ):
        road_axis(path, RoadScenario())


def test_heights_are_drawn_where_the_file_has_none(tmp_path: Path) -> None:
    road, _ = main_road()
    path = opendrive(tmp_path / "a.xodr", [road])
    with collected_remarks() as remarks:
        first, _, report = axis_from_file(path, RoadScenario(), 3)
    assert "a.xodr has no heights: they are drawn" in " ".join(remarks)
    assert report["heights"]["points"] == len(first.vertical) > 1
    assert axis_from_file(path, RoadScenario(), 3)[0] == first
    assert axis_from_file(path, RoadScenario(), 4)[0].vertical != first.vertical


def test_heights_follow_an_elevation_model(tmp_path: Path) -> None:
    """A plane that rises by 3 % to the east and falls by 1 % to the north."""
    road, walk = main_road(*PLACE)
    path = opendrive(tmp_path / "a.xodr", [road], UTM32)
    size, cell = 90, 10.0
    east, north = PLACE[0] - 300.0 + cell * np.arange(size), PLACE[1] - 300.0 + cell * np.arange(size)
    ground = 200.0 + 0.03 * (east[None, :] - PLACE[0]) - 0.01 * (north[::-1, None] - PLACE[1])
    head = f"ncols {size}\nnrows {size}\nxllcenter {east[0]}\nyllcenter {north[0]}\ncellsize {cell}\n"
    rows = "\n".join(" ".join(f"{value:.4f}" for value in row) for row in ground)
    (tmp_path / "ground.asc").write_text(head + rows + "\n")
    scenario = RoadScenario(elevation_model=str(tmp_path / "ground.asc"))
    axis, there, report = axis_from_file(path, scenario, 1)
    assert "ground.asc" in report["heights"]["source"]
    from synthroads_addon.road.geometry import profile_of

    station, points = walk.points(10.0)
    wanted = 200.0 + 0.03 * (points[:, 0] - PLACE[0]) - 0.01 * (points[:, 1] - PLACE[1])
    found = profile_of(axis).elevation(station) + there.map_origin[2]
    assert np.abs(found - wanted).max() < 1.5
    assert np.sqrt(np.mean((found - wanted) ** 2)) < 0.5


def test_a_road_that_comes_back_near_itself_is_told(tmp_path: Path) -> None:
    """A hairpin whose legs are 80 m apart: half of that is free beside each."""
    curve = xodr_road(
        [
            (0.0, 300.0, (0.0, 0.0, 0.0), "<line/>"),
            (300.0, 40.0 * np.pi, (300.0, 0.0, 0.0), '<arc curvature="0.025"/>'),
            (300.0 + 40.0 * np.pi, 300.0, (300.0, 80.0, np.pi), "<line/>"),
        ],
        HEIGHTS,
    )
    path = opendrive(tmp_path / "a.xodr", [curve], UTM32)
    found = {}
    for width in (30.0, 39.0, 60.0):
        with collected_remarks() as remarks:
            axis_from_file(path, RoadScenario(half_width=width), 1)
        found[width] = [text for text in remarks if "comes back" in text]
    assert found[30.0] == found[39.0] == []
    assert "try road.half_width=40" in found[60.0][0]


# --- the command --------------------------------------------------------------------------------------------------


LANES = '<lanes><laneSection s="0"><right><lane id="-1"/></right></laneSection></lanes>'


def test_the_command_writes_a_road_that_comes_back_exactly(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    road, walk = main_road(*PLACE, HEIGHTS)
    path = opendrive(tmp_path / "a.xodr", [road], UTM32)
    assert main(["road", str(path), "--output", str(tmp_path / "out"), "--seed", "4"]) == 0
    assert ["1 line", "2 spiral", "1 arc"][1] in capsys.readouterr().out
    assert sorted(file.name for file in (tmp_path / "out").iterdir()) == [
        "centerline.geojson", "deviation.png", "parameters.json", "road.json",
    ]  # fmt: skip
    parameters = read_parameters(tmp_path / "out/parameters.json")
    found = RoadGeometry(parameters)
    station, points = walk.points(0.5)
    there = found.alignment.position(station) + parameters.transform.translate[:2]
    assert np.hypot(*(there - points).T).max() < 1e-6
    height = found.profile.elevation(station) + parameters.transform.translate[2]
    assert np.abs(height - (412.0 + 0.01 * station)).max() < 1e-6
    report = json.loads((tmp_path / "out/road.json").read_text())
    assert report["elements"] == 5
    assert report["kinds"] == {"line": 2, "spiral": 2, "arc": 1}
    assert report["joints"]["gap"] < 1e-6
    assert report["remarks"] == []


def test_lanes_that_nothing_drives_on_leave_the_axis(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    road, _ = main_road(*PLACE, HEIGHTS + LANES)
    path = opendrive(tmp_path / "a.xodr", [road], UTM32)
    words = ["road", str(path), "--quiet", "--output"]
    assert main([*words, str(tmp_path / "all")]) == 2
    assert "--only-axis reads only the line of the road" in capsys.readouterr().err
    assert main([*words, str(tmp_path / "axis"), "--only-axis"]) == 0
    assert json.loads((tmp_path / "axis/road.json").read_text())["left_out"] == ["lanes of 1 lane sections"]


def test_the_list_names_every_road(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    broken = xodr_road([(0.0, 9.0, (0.0, 0.0, 0.0), '<arc curvature="x"/>')], name="broken")
    path = opendrive(tmp_path / "a.xodr", [main_road()[0], broken])
    assert main(["road", str(path), "--list"]) == 0
    first, second = capsys.readouterr().out.splitlines()[1:]
    assert first.split() == ["main", "400.0", "m", "5", "not", "named", "no", "heights"]
    assert "must be a finite number" in second
    assert main(["road", str(path), "--axis-name", "broken", "--output", str(tmp_path / "out")]) == 2
    assert main(["road", str(path)]) == 2
    assert not (tmp_path / "out").exists()


def test_generate_takes_the_road_of_a_file(tmp_path: Path) -> None:
    far = xodr_road([(0.0, 900.0, (0.0, 0.0, 0.0), "<line/>")], HEIGHTS, name="long")
    path = opendrive(tmp_path / "a.xodr", [main_road(*PLACE, HEIGHTS)[0], far], UTM32)
    words = ["generate", "--axis", str(path), "--axis-name", "main", "--set", 'outputs=["parameters"]', "--quiet"]
    assert main([*words, "--output", str(tmp_path / "out")]) == 0
    parameters = read_parameters(tmp_path / "out/parameters.json")
    assert [(e.length, e.curvature_start, e.curvature_end) for e in parameters.alignment.horizontal] == ELEMENTS
    assert json.loads((tmp_path / "out/report.json").read_text())["axis"]["name"] == "main"
    (tmp_path / "axis.csv").write_text("x,y\n0,0\n100,0\n200,3\n")
    words[2] = str(tmp_path / "axis.csv")
    assert main([*words, "--output", str(tmp_path / "points")]) == 2


def test_a_line_that_runs_round_a_circle_hundreds_of_times_is_told_at_once(tmp_path: Path) -> None:
    road = xodr_road([(0.0, 1e6, (*PLACE, 0.3), '<arc curvature="0.004"/>')])
    path = opendrive(tmp_path / "a.xodr", [road], UTM32)
    with collected_remarks() as remarks, limited():
        axis_from_file(path, RoadScenario(), 1)
    assert any("comes back so near" in remark for remark in remarks)
