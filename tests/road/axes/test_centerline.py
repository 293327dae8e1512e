"""Declarations of files of lines on their coordinate system and units: used, refused, or told."""

import logging
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from pyproj import CRS

from synthroads_addon.base.errors import InputError
from synthroads_addon.base.maps.crs import MapSystem
from synthroads_addon.base.maps.places import Placement
from synthroads_addon.cloud.tools.convert import read_centerline
from synthroads_addon.cloud.tools.divide import read_polygon
from synthroads_addon.jobs.axis_source import axis_from_file
from synthroads_addon.road.axes.centerline import read_axis
from synthroads_addon.scenario.road import RoadScenario
from tests.helpers.files.axis_files import ROAD, csv, geojson, in_system, lines, named, urn
from tests.helpers.logged import logged

Write = Callable[[Path], Path]
FOOT = 1200.0 / 3937.0
ESRI_33 = str(CRS.from_epsg(25833).to_wkt("WKT1_ESRI"))
FLAT = np.column_stack([ROAD[:, :2], np.zeros(len(ROAD))])

UNDERSTOOD: dict[str, tuple[Write, str]] = {
    "the road's own": (geojson(ROAD, urn(25832)), ""),
    "none": (geojson(ROAD), "names no system: its coordinates are read as EPSG:25832"),
    "CSV, none": (csv(ROAD), "names no system: its coordinates are read as EPSG:25832"),
    "Web Mercator": (geojson(in_system(3857), urn(3857)), "moved from EPSG:3857 to EPSG:25832"),
    "next zone": (geojson(in_system(25833), urn(25833)), "moved from EPSG:25833 to EPSG:25832"),
    "Gauss-Krueger": (geojson(in_system(31466), urn(31466)), "to within"),
    "longitude, latitude": (geojson(in_system(4326), named("urn:ogc:def:crs:OGC:1.3:CRS84")), "moved from"),
    "4326, longitude first": (geojson(in_system(4326), urn(4326)), "moved from EPSG:4326"),
    "4258": (geojson(in_system(4258), urn(4258)), "moved from EPSG:4258"),
    "RFC 7946": (geojson(in_system(4326)), "longitudes and latitudes of WGS 84 are assumed (RFC 7946)"),
    "of the feature": (geojson(in_system(25833), urn(25833), "feature"), "moved from EPSG:25833"),
    "of the geometry": (geojson(in_system(25833), urn(25833), "geometry"), "moved from EPSG:25833"),
    "short name": (geojson(in_system(25833), named("EPSG:25833")), "moved from EPSG:25833"),
    "URL": (geojson(in_system(25833), named("http://www.opengis.net/def/crs/EPSG/0/25833")), "EPSG:25833"),
    "code, as of old": (geojson(in_system(25833), {"type": "EPSG", "properties": {"code": 25833}}), "EPSG:25833"),
    "pair": (geojson(in_system(25833), named("urn:ogc:def:crs,crs:EPSG::25833,crs:EPSG::7837")), "EPSG:25833"),
    "heights in feet": (geojson(in_system(25833, FOOT), named("EPSG:25833+6360")), "EPSG:25833"),
    "CSV, comment": (csv(in_system(25833), "# crs: EPSG:25833\nx,y,z"), "moved from EPSG:25833"),
    "CSV, bare comment": (csv(in_system(25833), "# EPSG:25833"), "moved from EPSG:25833"),
    "CSV, .prj beside": (csv(in_system(25833), prj=ESRI_33), "moved from EPSG:25833"),
    "CSV, numbers named": (csv(np.column_stack([np.arange(41.0), ROAD]), "id,x,y,z"), "names no system"),
}


@pytest.mark.parametrize("name", UNDERSTOOD)
def test_lines_come_where_the_road_is(name: str, tmp_path: Path) -> None:
    write, told = UNDERSTOOD[name]
    with logged(logging.INFO) as messages:
        points = read_axis(write(tmp_path), Placement.of(MapSystem.of(25832)))
    np.testing.assert_allclose(points[:, :2], ROAD[:, :2], atol=0.002)
    np.testing.assert_allclose(points[:, 2], ROAD[:, 2], atol=0.001)
    assert told in "\n".join(messages)
    assert bool(messages) == bool(told)


COUNTED = "\n".join(f"{n},{x:.3f},{y:.3f},{z:.3f}" for n, (x, y, z) in enumerate(ROAD.tolist()))
COUNTED_FLAT = "\n".join(f"{n + 1};{0.5 + 3.0 * n:.2f};{7.25:.2f}" for n in range(30))
SWAPPED, SWISS = ROAD[:, [1, 0, 2]], ROAD - [294_000.0, 5_628_000.0, 0.0] + [2_600_000.0, 1_200_000.0, 0.0]
REFUSED: dict[str, tuple[Write, str]] = {
    "a column that counts": (lines(COUNTED), r"first column is '0, 1, 2 \.\.\.': the first column counts the lines"),
    "a column that counts, flat": (lines(COUNTED_FLAT), "the first column counts the lines"),
    "height of a northing": (csv(ROAD[:, [0, 0, 1]], ""), r"z of point 41 is 5628240\.0: no land lies higher"),
    "height in millimetres": (csv(ROAD * [1.0, 1.0, 1000.0]), "z of point .*: no land lies higher"),
    "depth of the sea": (csv(ROAD - [0.0, 0.0, 20_000.0]), "no land lies higher than 9,000 m"),
    "x and y swapped": (csv(SWAPPED), r"outside of the system's area of use: EPSG:25832 is for longitudes 6\.0 to"),
    "Swiss, undeclared": (csv(SWISS), "outside of the system's area of use"),
    "Gauss-Krueger, undeclared": (csv(in_system(31466)), "outside of the system's area of use"),
    "feet, undeclared": (csv(ROAD / FOOT), "outside of the system's area of use"),
    "degrees in CSV": (csv(in_system(4326), digits=9), "metres of a projected system are needed, not degrees"),
    "declared elsewhere": (geojson(in_system(25833) + [3e6, 0.0, 0.0], urn(25833)), "area of use"),
    "unknown code": (geojson(ROAD, urn(99999)), "crs is 'urn:ogc:def:crs:EPSG::99999': a coordinate system"),
    "unknown name": (geojson(ROAD, named("Gauss-Krueger")), "crs is 'Gauss-Krueger': a coordinate system"),
    "a PROJ string": (geojson(ROAD, named("+init=epsg:25832")), "crs is '\\+init=epsg:25832': a coordinate system"),
    "a link": (geojson(ROAD, {"type": "link", "properties": {"href": "crs.wkt"}}), "links aren't followed"),
    "heights alone": (geojson(ROAD, urn(7837)), "has heights only"),
    "geocentric": (geojson(ROAD, urn(4978)), "geocentric"),
    "comment of an unknown code": (csv(ROAD, "# crs: EPSG:99999\nx,y,z"), "axis.csv crs is 'EPSG:99999'"),
    "a .prj that is none": (csv(ROAD, prj="nothing"), r"axis\.prj crs is 'nothing'"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_lines_that_are_elsewhere_are_refused_by_name(name: str, tmp_path: Path) -> None:
    write, said = REFUSED[name]
    with pytest.raises(InputError, match=said) as caught:
        read_axis(write(tmp_path), Placement.of(MapSystem.of(25832)))
    assert "\n" not in str(caught.value)


def test_two_systems_in_one_file_are_refused(tmp_path: Path) -> None:
    path = geojson(ROAD, urn(25832))(tmp_path)
    path.write_text(path.read_text().replace('"properties": {}', '"crs": "EPSG:25833", "properties": {}'))
    with pytest.raises(InputError, match="one system is needed, EPSG:25832 is named as well"):
        read_axis(path, Placement.of(MapSystem.of(25832)))


@pytest.mark.parametrize(
    ("named_heights", "wanted", "said"),
    [
        ("EPSG:25832+5783", (25832, 7837), "heights is 'EPSG:5783': EPSG:7837 is needed"),
        ("EPSG:7931", (25832, 7837), "heights is 'counted from the ellipsoid': EPSG:7837 is needed"),
        ("EPSG:25832+7837", (5555, None), "heights is 'EPSG:7837': EPSG:5783 is needed"),
    ],
)
def test_heights_of_another_surface_are_refused(
    named_heights: str, wanted: tuple[int, int | None], said: str, tmp_path: Path
) -> None:
    points = in_system(7931) if "7931" in named_heights else ROAD
    path = geojson(points, named(named_heights))(tmp_path)
    with pytest.raises(InputError, match=said):
        read_axis(path, Placement.of(MapSystem.of(*wanted)))


def test_coordinates_beside_the_area_are_told(tmp_path: Path) -> None:
    """Bavaria's own system is that of the zone to its west: up to 2 degrees beyond what EPSG says it is for."""
    bavaria = ROAD - ROAD[0] + [800_000.0, 5_400_000.0, 400.0]
    for points, said in ((bavaria, "lies outside of the area of EPSG:25832"), (ROAD - ROAD[0], "a site's own")):
        with logged() as messages:
            read = read_axis(csv(points)(tmp_path), Placement.of(MapSystem.of(25832)))
        np.testing.assert_allclose(read, points, atol=1e-3)
        assert [said in message for message in messages] == [True]


def test_without_a_system_to_compare_with_it_is_told(tmp_path: Path) -> None:
    with logged() as messages:
        points = read_axis(geojson(in_system(25833), urn(25833))(tmp_path), Placement())
    np.testing.assert_allclose(points, in_system(25833))
    assert ["name no system, and are read in the same system" in message for message in messages] == [True]
    with pytest.raises(InputError, match="metres of a projected system are needed, not degrees"):
        read_axis(geojson(in_system(4258), urn(4258))(tmp_path), Placement())


def test_lines_beside_a_cloud_in_feet(tmp_path: Path) -> None:
    """A file that names no system is taken to be in the cloud's own coordinates: in its feet."""
    declared = MapSystem.of(2225)
    place = Placement(declared.metric(), declared)
    corner = np.array([1_900_000.0, 640_000.0, 150.0])
    wanted = ROAD - ROAD[0] + corner
    np.testing.assert_allclose(read_axis(csv(wanted / FOOT)(tmp_path), place), wanted, atol=1e-3)
    np.testing.assert_allclose(read_axis(geojson(wanted / FOOT, urn(2225))(tmp_path), place), wanted, atol=1e-3)
    np.testing.assert_allclose(read_axis(geojson(wanted, urn(26941))(tmp_path), place), wanted, atol=1e-3)


@pytest.mark.parametrize(("crs", "epsg"), [(3857, 3857), (25833, 25833), (4326, 4326)])
def test_other_lines_in_geojson_are_moved_alike(crs: int, epsg: int, tmp_path: Path) -> None:
    place = Placement.of(MapSystem.of(25832))
    line = read_centerline(geojson(in_system(epsg), urn(crs))(tmp_path), place)
    np.testing.assert_allclose(line, ROAD[:, :2], atol=0.002)
    ring = in_system(epsg)[[0, 20, 40, 0]]
    text = geojson(ring, urn(crs))(tmp_path).read_text().replace('"LineString"', '"Polygon"')
    (tmp_path / "ring.geojson").write_text(text.replace("[[", "[[[").replace("]]", "]]]"))
    (read,) = read_polygon(tmp_path / "ring.geojson", place)
    np.testing.assert_allclose(read, ROAD[[0, 20, 40, 0], :2], atol=0.002)


def test_a_road_along_an_axis_keeps_the_axis_heights_system(tmp_path: Path) -> None:
    path = geojson(in_system(25833), named("EPSG:25833+7837"))(tmp_path)
    alignment, road, _ = axis_from_file(path, RoadScenario(), 1)
    assert (road.epsg, road.height_epsg) == (25832, 7837)
    assert alignment.length == pytest.approx(400.0, abs=0.01)
    np.testing.assert_allclose(road.map_origin, ROAD.mean(axis=0), atol=1.0)
    assert axis_from_file(geojson(ROAD, urn(25832))(tmp_path), RoadScenario(), 1)[1].height_epsg is None
