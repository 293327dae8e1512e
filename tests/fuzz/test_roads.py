"""Roads of other programs whose files are cut, flipped or hold wrong numbers: a road, or one line."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import strategies as st

from synthroads_addon.base.remarks import collected_remarks
from synthroads_addon.jobs.axis_source import axis_from_file, listed_lines
from synthroads_addon.road.geometry import alignment_of
from synthroads_addon.road_files.axis import road_axis
from synthroads_addon.road_files.read import OF_POINTS, format_of, read_lines
from synthroads_addon.scenario.road import RoadScenario
from tests.helpers.files.mutations import TOKENS, accepted, damaged, for_all, fuzz
from tests.helpers.roads.written_lines import opendrive, xodr_road
from tests.helpers.roads.written_maps import Map, bend, beside, sbet, vector_file, well_known_binary
from tests.road_files.beside.test_superelevation import NAMES
from tests.road_files.test_ifc import MAP
from tests.road_files.test_ifc import written as ifc_written
from tests.road_files.test_landxml import KINDS, written
from tests.road_files.test_opendrive import main_road

_NUMBER = re.compile(rb"(?<=[\"'> ])[-+]?\d+\.?\d*(?:[eE][-+]?\d+)?(?=[\"'< ])")
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
        rows = "".join(f"<{name}>{40.0 + 50.0 * n!r}</{name}>" for n, name in enumerate(NAMES))
        tilt = f"<Superelevation>{rows}<FullSuperelev>4.5</FullSuperelev></Superelevation></Alignment>".encode()
        files = [(folder / f"{name}.xml").read_bytes() for name in KINDS]
        return [*files, files[0].replace(b"</Alignment>", tilt)]
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


# --- maps, vector files and tracks ----------------------------------------------------------------------------------

MAPS = {"osm": None, "pbf": "osmium", "gpkg": "pyogrio", "shp": "pyogrio", "fgb": "pyogrio", "sbet": None}
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
    driver = {"gpkg": "GPKG", "shp": "ESRI Shapefile", "fgb": "FlatGeobuf"}[kind]
    vector_file(path, driver, {"axis": well_known_binary(points), "short": well_known_binary(points[:3])})
    return [path.read_bytes()]


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
    if format_of(path) not in OF_POINTS:
        return
    with collected_remarks() as remarks:
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
def test_maps_with_odd_numbers(tmp_path: Path, count: int) -> None:
    path = tmp_path / "a.osm"

    def body(content: bytes) -> None:
        path.write_bytes(content)
        accepted(lambda: use_points(path))

    for_all(with_odd_numbers(map_files("osm", tmp_path)), count, body)


@fuzz(15, 5000)
def test_paths_with_odd_numbers(tmp_path: Path, count: int) -> None:
    path = tmp_path / "a.sbet"
    (sound,) = map_files("sbet", tmp_path)
    odd = st.sampled_from([0.0, -1.0, 1e-300, 1e300, np.nan, np.inf, 1.5707, 3.2, -9000.0, 1e6, 1000.005])
    change = st.tuples(st.integers(0, len(sound) // 8 - 1), odd)

    def body(changes: list[tuple[int, float]]) -> None:
        records = np.frombuffer(sound, dtype="<f8").copy()
        for at, value in changes:
            records[at] = value
        path.write_bytes(records.tobytes())
        accepted(lambda: use_points(path))

    for_all(st.lists(change, min_size=1, max_size=3), count, body)
