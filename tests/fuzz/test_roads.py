"""Roads of other programs whose files are cut, flipped or hold wrong numbers: a road, or one line."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import strategies as st

from synthroads_addon.base.remarks import collected_remarks
from synthroads_addon.road.geometry import alignment_of
from synthroads_addon.road_files.axis import road_axis
from synthroads_addon.road_files.read import read_lines
from synthroads_addon.scenario.road import RoadScenario
from tests.helpers.files.mutations import TOKENS, accepted, damaged, for_all, fuzz
from tests.helpers.roads.written_lines import opendrive, xodr_road
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
