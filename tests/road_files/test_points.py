"""Lines of KML and GPX: in degrees, by their names, fitted where they lie."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from pyproj import Transformer

from headless.cli import main
from synthroads_addon.base.errors import InputError
from synthroads_addon.base.remarks import collected_remarks
from synthroads_addon.jobs.axis_source import axis_from_file
from synthroads_addon.road.geometry import alignment_of
from synthroads_addon.road_files.points import read_point_lines
from synthroads_addon.scenario.road import RoadScenario
from tests.road_files.test_opendrive import main_road

PLACE = 500_000.0, 5_600_000.0


def line_in_degrees() -> tuple[np.ndarray, np.ndarray]:
    """Return points (N, 2) in UTM, zone 32, and as longitude, latitude, height (N, 3)."""
    _, walk = main_road(*PLACE)
    station, points = walk.points(4.0)
    degrees = Transformer.from_crs(32632, 4326, always_xy=True).transform(*points.T)
    return points, np.column_stack([*degrees, 100.0 + 0.01 * station])


def kml(path: Path, lines: dict[str, np.ndarray], track: bool = False) -> Path:
    parts = []
    for name, rows in lines.items():
        if track:
            coordinates = "".join(f"<gx:coord>{x} {y} {z}</gx:coord>" for x, y, z in rows.tolist())
            shape = f"<gx:Track>{coordinates}</gx:Track>"
        else:
            words = " ".join(f"{x},{y},{z}" for x, y, z in rows.tolist())
            shape = f"<LineString><coordinates>\n{words}\n</coordinates></LineString>"
        parts.append(f"<Placemark><name>{name}</name>{shape}</Placemark>")
    spaces = 'xmlns="http://www.opengis.net/kml/2.2" xmlns:gx="http://www.google.com/kml/ext/2.2"'
    path.write_text(f'<?xml version="1.0"?><kml {spaces}><Document><Folder>{"".join(parts)}</Folder></Document></kml>')
    return path


def gpx(path: Path, rows: np.ndarray) -> Path:
    points = "".join(f'<trkpt lat="{y}" lon="{x}"><ele>{z}</ele></trkpt>' for x, y, z in rows.tolist())
    track = f"<trk><name>drive</name><trkseg>{points}</trkseg></trk>"
    path.write_text(f'<gpx version="1.1" xmlns="http://www.topografix.com/GPX/1/1">{track}</gpx>')
    return path


@pytest.mark.parametrize("kind", ["kml", "track", "gpx"])
def test_the_road_runs_through_the_points_in_its_zone(tmp_path: Path, kind: str) -> None:
    points, degrees = line_in_degrees()
    path = tmp_path / f"a.{kind}"
    gpx(path, degrees) if kind == "gpx" else kml(path, {"axis": degrees}, kind == "track")
    with collected_remarks() as remarks:
        axis, scenario, report = axis_from_file(path, RoadScenario(), 1)
    assert scenario.epsg == 32632
    assert "EPSG:32632" in " ".join(remarks)
    assert report["name"] == ("drive" if kind == "gpx" else "axis")
    _, offset = alignment_of(axis).project(points - scenario.map_origin[:2])
    assert np.abs(offset).max() < 0.05
    assert report["height"]["worst"] < 0.05
    assert axis_from_file(path, RoadScenario(epsg=25832), 1)[1].epsg == 25832


def test_the_longest_line_is_taken_or_the_one_of_a_name(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    _, degrees = line_in_degrees()
    path = kml(tmp_path / "a.kml", {"short": degrees[:30], "long": degrees, "point": degrees[:1]})
    assert [line.name for line in read_point_lines(path)] == ["short", "long"]
    assert axis_from_file(path, RoadScenario(), 1)[2]["name"] == "long"
    assert axis_from_file(path, RoadScenario(), 1, "short")[2]["name"] == "short"
    with pytest.raises(InputError, match="road is 'none': must be one of the roads in the file: 'short', 'long'"):
        axis_from_file(path, RoadScenario(), 1, "none")
    assert main(["road", str(path), "--list"]) == 0
    assert capsys.readouterr().out.splitlines()[1].split()[:5] == ["short", "116.0", "m", "30", "points"]


def test_a_line_without_heights_says_so(tmp_path: Path) -> None:
    _, degrees = line_in_degrees()
    degrees[:, 2] = 0.0
    with collected_remarks() as remarks:
        axis, _, report = axis_from_file(kml(tmp_path / "a.kml", {"axis": degrees}), RoadScenario(), 1)
    assert "a.kml has no heights: they are drawn within the limits of the scenario" in remarks
    assert report["heights"]["points"] == len(axis.vertical)
    assert "height" not in report


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "<kml><Placemark><LineString><coordinates>1 2 3</coordinates></LineString></Placemark></kml>",
            "separated by commas",
        ),
        ("<kml><Placemark><LineString><coordinates>1,200 2,3</coordinates></LineString></Placemark></kml>", "point 1"),
        ("<kml><Placemark><Point><coordinates>1,2</coordinates></Point></Placemark></kml>", "no line of two points"),
        ('<gpx><trk><trkseg><trkpt lat="1"/><trkpt lat="2" lon="x"/></trkseg></trk></gpx>', "lon"),
    ],
)
def test_what_is_no_line_is_one_line_of_error(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "a.kml").write_text(text)
    with pytest.raises(InputError, match=message):
        axis_from_file(tmp_path / "a.kml", RoadScenario(), 1)
