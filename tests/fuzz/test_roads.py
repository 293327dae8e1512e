"""Roads of other programs whose files are cut, flipped or hold wrong numbers: a road, or one line."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import strategies as st

from synthroads_addon.base.remarks import collected_remarks
from synthroads_addon.jobs.axis_source import axis_from_file, listed_lines
from synthroads_addon.road.geometry import alignment_of
from synthroads_addon.road_files.axis import road_axis
from synthroads_addon.road_files.read import OF_POINTS, READERS, format_of, read_lines
from synthroads_addon.scenario.road import RoadScenario
from tests.helpers.files.mutations import TOKENS, accepted, damaged, for_all, fuzz, json_files
from tests.helpers.files.wrong_xml import wrong_xml
from tests.helpers.roads.written_lines import opendrive, xodr_road
from tests.helpers.roads.written_maps import Map, bend, beside, degrees, sbet, vector_file, well_known_binary
from tests.road_files.test_ifc import MAP
from tests.road_files.test_ifc import written as ifc_written
from tests.road_files.test_landxml import KINDS, written
from tests.road_files.test_opendrive import main_road

_NUMBER = re.compile(rb"(?<=[\"'> ,])[-+]?\d+\.?\d*(?:[eE][-+]?\d+)?(?=[\"'< ,])")
_IFC_NUMBER = re.compile(rb"(?<=[(,])[-+]?\d+\.?\d*(?:[eE][-+]?\d+)?(?=[,)])")
_ODD = (
    *(b"0", b"-1", b"1e-12", b"1e-300", b"1e300", b"1e12", b"-1e12", b"1e6", b"nan", b"inf", b"", b"x", b"0.1", b"400"),
    *(b"1e5", b"-1e5", b"3.14159", b"1e-4", b"1e-6", b"9" * 400),
)
SHORT = [token for token in TOKENS if len(token) < 100]
REST = """<elevationProfile><elevation s="0" a="1" b="0.01" c="1e-4" d="-1e-6"/>
<elevation s="150" a="2" b="0" c="0" d="0"/></elevationProfile>
<lanes><laneSection s="0"><left><lane id="1"/></left></laneSection></lanes>"""
HEADER = '<geoReference>+proj=utm +zone=32 +ellps=GRS80</geoReference><offset x="500000" y="5600000" z="3" hdg="0.1"/>'
PROFILE = "<PVI>0 50</PVI><ParaCurve length='60'>120 54</ParaCurve><UnsymParaCurve lengthIn='20' lengthOut='40'>250 50"
PROFILE += "</UnsymParaCurve><CircCurve length='50' radius='4000'>400 54</CircCurve><PVI>520 52</PVI>"


def use_road(path: Path) -> None:
    """Take a file's longest road, and evaluate it."""
    for line in read_lines(path):
        assert line.fault is None or str(line.fault).isprintable()
    with collected_remarks() as remarks:
        axis, _, report = road_axis(path, RoadScenario())
    assert all(len(text) < 2000 for text in remarks)
    place = alignment_of(axis).position(np.linspace(0.0, axis.length, 50))
    assert np.isfinite(place).all()
    assert report["length"] == pytest.approx(axis.length, abs=1e-5)


def with_odd_numbers(files: list[bytes]) -> st.SearchStrategy[bytes]:
    """Return files in which one to three numbers are others."""

    def changed(data: bytes, changes: list[tuple[int, bytes]]) -> bytes:
        for at, value in changes:
            found = list((_IFC_NUMBER if data.startswith(b"ISO-10303-21") else _NUMBER).finditer(data))
            place = found[at % len(found)]
            data = data[: place.start()] + value + data[place.end() :]
        return data

    change = st.tuples(st.integers(0, 10_000), st.sampled_from(_ODD))
    return st.builds(changed, st.sampled_from(files), st.lists(change, min_size=1, max_size=3))


def files_of(kind: str, folder: Path) -> list[bytes]:
    if kind == "xml":
        for name in KINDS:
            written(folder / f"{name}.xml", name, profile=PROFILE)
        return [(folder / f"{name}.xml").read_bytes() for name in KINDS]
    if kind == "ifc":
        for n, (schema, rest) in enumerate((("IFC4X3_ADD2", ""), ("IFC4X3_RC3", MAP.format(1.0, 0.2)))):
            ifc_written(folder / f"{n}.ifc", schema, 1.0 - 0.5 * n, rest)
        return [(folder / f"{n}.ifc").read_bytes() for n in range(2)]
    cubic = '<paramPoly3 pRange="normalized" aU="0" bU="90" cU="1" dU="2" aV="0" bV="0" cV="9" dV="-3"/>'
    curves = (
        [(0.0, 92.0, (0.0, 0.0, 0.2), cubic)],
        [(0.0, 60.0, (0.0, 0.0, 0.0), '<poly3 a="0" b="0" c="1e-3" d="1e-5"/>')],
    )
    roads = [main_road(rest=REST)[0], *(xodr_road(rows, REST) for rows in curves)]
    return [opendrive(folder / f"{n}.xodr", [road], HEADER).read_bytes() for n, road in enumerate(roads)]


@fuzz(40, 2500)
@pytest.mark.parametrize("kind", ["xodr", "xml", "ifc"])
def test_roads_with_odd_numbers(tmp_path: Path, kind: str, count: int) -> None:
    path = tmp_path / f"road.{kind}"

    def body(content: bytes) -> None:
        path.write_bytes(content)
        accepted(lambda: use_road(path))

    for_all(with_odd_numbers(files_of(kind, tmp_path)), count, body)


@fuzz(25, 2500)
@pytest.mark.parametrize("kind", ["xodr", "xml", "ifc"])
def test_damaged_roads(tmp_path: Path, kind: str, count: int) -> None:
    path = tmp_path / f"road.{kind}"

    def body(content: bytes) -> None:
        path.write_bytes(content)
        accepted(lambda: use_road(path))

    for_all(damaged(files_of(kind, tmp_path), SHORT), count, body)


@fuzz(25, 2500)
@pytest.mark.parametrize("kind", ["xodr", "xml"])
def test_roads_with_wrong_elements(tmp_path: Path, kind: str, count: int) -> None:
    path = tmp_path / f"road.{kind}"

    def body(content: bytes) -> None:
        path.write_bytes(content)
        accepted(lambda: use_road(path))

    for_all(wrong_xml(files_of(kind, tmp_path)), count, body)


# --- maps, vector files and tracks ----------------------------------------------------------------------------------

MAPS = {
    "osm": None,
    "pbf": "osmium",
    "gpkg": "pyogrio",
    "shp": "pyogrio",
    "fgb": "pyogrio",
    "sbet": None,
    **dict.fromkeys(("kml", "gpx", "csv", "geojson")),
}
"""Kinds of files, and the library that each needs."""


def map_files(kind: str, folder: Path) -> list[bytes]:
    """Return small files of a kind, whose lines have few points, so that the fit is quick."""
    station = np.linspace(0.0, 500.0, 12).tolist()
    points = np.column_stack([beside(bend(), station), 100.0 + 0.01 * np.array(station)])
    path = folder / f"sound.{kind}"
    if kind == "sbet":
        return [sbet(path, points).read_bytes()]
    if kind in ("osm", "pbf"):
        return [
            map_of(way).pbf(path).read_bytes() if kind == "pbf" else map_of(way).xml(path).read_bytes() for way in WAYS
        ]
    if kind in ("csv", "geojson"):
        return [text_of(points, kind)]
    if kind in ("kml", "gpx"):
        return [degrees_of(np.column_stack([degrees(points), points[:, 2]]), kind)]
    driver = {"gpkg": "GPKG", "shp": "ESRI Shapefile", "fgb": "FlatGeobuf"}[kind]
    vector_file(path, driver, {"axis": well_known_binary(points), "short": well_known_binary(points[:3])})
    return [path.read_bytes()]


def text_of(points: np.ndarray, kind: str) -> bytes:
    """Return points (N, 3) as CSV or GeoJSON."""
    if kind == "csv":
        return (
            "# crs: EPSG:25832\nx,y,z\n" + "".join("{:.3f},{:.3f},{:.3f}\n".format(*row) for row in points)
        ).encode()
    system = {"type": "name", "properties": {"name": "EPSG:25832"}}
    return json.dumps({"type": "LineString", "crs": system, "coordinates": points.round(3).tolist()}).encode()


def degrees_of(points: np.ndarray, kind: str) -> bytes:
    """Return longitudes, latitudes and heights (N, 3) as KML or GPX."""
    rows = points.round(8).tolist()
    if kind == "kml":
        text = " ".join(f"{x},{y},{z}" for x, y, z in rows)
        inner = f"<Placemark><name>A</name><LineString><coordinates>{text}</coordinates></LineString></Placemark>"
        return f'<kml xmlns="http://www.opengis.net/kml/2.2"><Document>{inner}</Document></kml>'.encode()
    track, route = (
        "".join(f'<{name} lat="{y}" lon="{x}"><ele>{z}</ele></{name}>' for x, y, z in rows)
        for name in ("trkpt", "rtept")
    )
    inner = f"<trk><name>A</name><trkseg>{track}</trkseg></trk><rte><name>B</name>{route}</rte>"
    return f'<gpx xmlns="http://www.topografix.com/GPX/1/1">{inner}</gpx>'.encode()


WAYS = (
    {"ref": "A 9", "lanes": "2", "maxspeed": "65 mph"},
    {"name": "Road", "lanes": "3", "width": "7", "highway": "primary"},
)


def map_of(tags: dict[str, str]) -> Map:
    found, walk = Map(), bend()
    station = np.linspace(0.0, 500.0, 9)
    for side in (-1.0, 1.0):
        nodes = found.line(beside(walk, station.tolist(), side * 8.0))[:: int(-side)]
        found.way(nodes[:5], {**tags, "bridge": "yes"})
        found.way(nodes[4:], tags)
    return found


def use_points(path: Path) -> None:
    """List a file's lines, take the longest, and evaluate its road."""
    if (kind := format_of(path)) in READERS:
        return
    with collected_remarks() as remarks:
        if kind in OF_POINTS:
            rows = listed_lines(path)
            assert all(row["fault"] is None or row["fault"].isprintable() for row in rows)
        axis, _, _ = axis_from_file(path, RoadScenario(), 1)
    assert all(len(text) < 2000 and text.isprintable() for text in remarks), remarks
    assert np.isfinite(alignment_of(axis).position(np.linspace(0.0, axis.length, 50))).all()


@fuzz(15, 5000)
@pytest.mark.parametrize("kind", list(MAPS))
def test_damaged_maps(tmp_path: Path, kind: str, count: int) -> None:
    if library := MAPS[kind]:
        pytest.importorskip(library)
    files, path = map_files(kind, tmp_path), tmp_path / f"sound.{kind}"

    def body(content: bytes) -> None:
        path.write_bytes(content)
        accepted(lambda: use_points(path))

    for_all(damaged(files, SHORT), count, body)


@fuzz(15, 5000)
@pytest.mark.parametrize("kind", ["osm", "kml", "gpx"])
def test_maps_with_odd_numbers(tmp_path: Path, kind: str, count: int) -> None:
    path, files = tmp_path / f"a.{kind}", map_files(kind, tmp_path)

    def body(content: bytes) -> None:
        path.write_bytes(content)
        accepted(lambda: use_points(path))

    for_all(st.one_of(with_odd_numbers(files), wrong_xml(files)), count, body)


@fuzz(15, 5000)
def test_geojson_with_wrong_values(tmp_path: Path, count: int) -> None:
    path = tmp_path / "a.geojson"
    document = json.loads(map_files("geojson", tmp_path)[0])

    def body(content: bytes) -> None:
        path.write_bytes(content)
        accepted(lambda: use_points(path))

    for_all(json_files([document, {"type": "Feature", "properties": {}, "geometry": document}]), count, body)


@fuzz(15, 5000)
def test_paths_with_odd_numbers(tmp_path: Path, count: int) -> None:
    path = tmp_path / "a.sbet"
    (sound,) = map_files("sbet", tmp_path)

    def body(changes: list[tuple[int, float]]) -> None:
        path.write_bytes(with_changes(sound, changes))
        accepted(lambda: use_points(path))

    for_all(st.lists(CHANGES, min_size=1, max_size=3), count, body)


CHANGES = st.tuples(
    st.integers(0, 2**31),
    st.sampled_from([0.0, -1.0, 1e-300, 1e300, np.nan, np.inf, 1.5707, 3.2, -9000.0, 1e6, 1000.005]),
)
"""Numbers of a path that are others."""


def with_changes(sound: bytes, changes: list[tuple[int, float]]) -> bytes:
    """Return SBET in which some numbers are others."""
    records = np.frombuffer(sound, dtype="<f8").copy()
    for at, value in changes:
        records[at % len(records)] = value
    return records.tobytes()


# --- lines that are sound to the reader, and no road's --------------------------------------------------------------

WAYWARD = st.fixed_dictionaries(
    {
        "count": st.integers(2, 160),
        "step": st.sampled_from([0.05, 0.5, 1.0, 2.0, 5.0, 10.0, 30.0, 100.0, 400.0, 900.0]),
        "turn": st.sampled_from([0.0, 0.01, 0.1, 0.5, 1.5, 3.0]),
        "wander": st.sampled_from([0.0, 0.0, 0.003, 0.1, 2.0]),
        "rise": st.sampled_from([0.0, 0.01, 1.0, 50.0]),
        "stop": st.sampled_from([0, 0, 3, 40]),
        "back": st.sampled_from([0, 0, 2, 20]),
        "strays": st.lists(st.tuples(st.integers(0, 2**31), st.sampled_from([0.3, 8.0, 70.0, 950.0])), max_size=3),
        "seed": st.integers(0, 2**31),
    }
)
"""Lines that turn as no road does, stand still, go back, jump and rise: what each is drawn with."""


def wayward(case: dict) -> np.ndarray:
    """Return the points (N, 3) of such a line, m."""
    rng = np.random.default_rng(case["seed"])
    count = case["count"]
    heading = 0.3 + np.cumsum(case["turn"] * (0.3 + rng.normal(0.0, 1.0, count)))
    step = case["step"] * rng.uniform(0.3, 1.0, count)
    begin = count // 2
    step[begin : begin + case["stop"]] *= 1e-3
    heading[begin : begin + case["back"]] += np.pi
    move = np.column_stack([step * np.cos(heading), step * np.sin(heading)])
    plan = np.cumsum(move, axis=0) + rng.normal(0.0, case["wander"], (count, 2))
    for number, far in case["strays"]:
        plan[number % count] += far
    height = 100.0 + np.cumsum(rng.normal(0.0, case["rise"], count)).clip(-8000.0, 8000.0)
    return np.column_stack([plan + [500_000.0, 5_600_000.0], height])


@fuzz(4, 5000)
@pytest.mark.parametrize("kind", ["sbet", "csv"])
def test_wayward_lines(tmp_path: Path, kind: str, count: int) -> None:
    path = tmp_path / f"a.{kind}"

    def body(case: dict) -> None:
        points = wayward(case)
        if kind == "sbet":
            sbet(path, points)
        else:
            path.write_bytes(text_of(points, kind))
        accepted(lambda: use_points(path))

    for_all(WAYWARD, count, body)
