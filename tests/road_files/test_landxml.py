"""Alignments of LandXML: north before east, feet of two kinds, every transition curve, stations and profiles."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from synthroads_addon.base.errors import InputError
from synthroads_addon.base.remarks import collected_remarks
from synthroads_addon.road_files.line import RoadLine, exact_axis
from synthroads_addon.road_files.read import choose_line, read_lines
from tests.helpers.roads.written_lines import (
    Shape,
    Walk,
    bloss,
    cosine,
    helmert,
    landxml,
    linear,
    sine,
    xml_alignment,
    xml_points,
)
from tests.road_files.test_opendrive import profile_of

START = (350_000.0, 5_600_000.0, 1.1)
KINDS = {"clothoid": linear, "bloss": bloss, "cosine": cosine, "sinusoid": sine, "biquadratic": helmert}


def line_xml(walk: Walk, n: int, unit: float = 1.0) -> str:
    start, end = (tuple(v / unit for v in walk.poses[k][:2]) for k in (n, n + 1))
    return f"<Line dir='999'>{xml_points(Start=start, End=end)}</Line>"


def curve_xml(walk: Walk, n: int, curvature: float, unit: float = 1.0) -> str:
    x, y, heading = walk.poses[n]
    centre = (x - math.sin(heading) / curvature, y + math.cos(heading) / curvature)
    points = {"Start": walk.poses[n][:2], "Center": centre, "End": walk.poses[n + 1][:2]}
    scaled = {name: tuple(v / unit for v in point) for name, point in points.items()}
    sense = "ccw" if curvature > 0.0 else "cw"
    return f"<Curve rot='{sense}' crvType='arc' radius='{abs(1.0 / curvature / unit)!r}'>{xml_points(**scaled)}</Curve>"


def spiral_xml(walk: Walk, n: int, kind: str, length: float, first: float, last: float, unit: float = 1.0) -> str:
    radii = [("INF" if k == 0.0 else repr(abs(1.0 / k) / unit)) for k in (first, last)]
    sense = "ccw" if first + last > 0.0 else "cw"
    points = {name: tuple(v / unit for v in walk.poses[k][:2]) for name, k in (("Start", n), ("End", n + 1))}
    words = f"spiType='{kind}' rot='{sense}' length='{length / unit!r}' radiusStart='{radii[0]}' radiusEnd='{radii[1]}'"
    return f"<Spiral {words}>{xml_points(**points)}</Spiral>"


def written(path: Path, kind: str, unit: float = 1.0, profile: str = "", start: float = 0.0) -> Walk:
    """Write line, transition, arc and transition back to a line, to the right; return where they run."""
    shape: Shape = KINDS[kind](120.0, 0.0, -1 / 400)
    back: Shape = KINDS[kind](100.0, -1 / 400, 0.0)
    parts = [(90.0, linear(90.0, 0, 0)), (120.0, shape), (150.0, linear(150.0, -1 / 400, -1 / 400)), (100.0, back)]
    walk = Walk([*parts, (60.0, linear(60.0, 0, 0))], *START)
    elements = [
        line_xml(walk, 0, unit),
        spiral_xml(walk, 1, kind, 120.0, 0.0, -1 / 400, unit),
        curve_xml(walk, 2, -1 / 400, unit),
        spiral_xml(walk, 3, kind, 100.0, -1 / 400, 0.0, unit),
        line_xml(walk, 4, unit),
    ]
    names = {1.0: ("Metric", "meter"), 0.3048: ("Imperial", "foot"), 1200 / 3937: ("Imperial", "USSurveyFoot")}
    landxml(path, [xml_alignment("".join(elements), profile, start, 520.0 / unit)], *names[unit])
    return walk


def only(path: Path) -> RoadLine:
    return choose_line(read_lines(path), None, path.name)


@pytest.mark.parametrize("kind", KINDS)
def test_each_kind_of_transition_runs_where_it_is_designed(tmp_path: Path, kind: str) -> None:
    walk = written(tmp_path / "a.xml", kind)
    axis = exact_axis(only(tmp_path / "a.xml"))
    station, points = walk.points()
    off = np.hypot(*(axis.alignment.position(station) - points).T)
    assert off.max() < (1e-5 if kind == "clothoid" else 5e-4)
    assert len(axis.alignment.elements) == 5 if kind == "clothoid" else len(axis.approximated) == 2
    as_clothoids = Walk([(90.0, linear(90, 0, 0)), (120.0, linear(120.0, 0.0, -1 / 400))], *START)
    if kind != "clothoid":  # this would be 0.2 m and more off
        assert math.dist(as_clothoids.poses[2][:2], walk.poses[2][:2]) > 0.1


@pytest.mark.parametrize("unit", [0.3048, 1200 / 3937])
def test_feet_of_both_kinds_are_metres(tmp_path: Path, unit: float) -> None:
    """Of a northing of 5,600 km the two differ by 11 m."""
    walk = written(
        tmp_path / "a.xml", "clothoid", unit, f"<PVI>0 {100 / unit}</PVI><PVI>{520 / unit} {110 / unit}</PVI>"
    )
    axis = exact_axis(only(tmp_path / "a.xml"))
    station, points = walk.points(5.0)
    assert np.hypot(*(axis.alignment.position(station) - points).T).max() < 1e-4
    assert profile_of(axis).elevation(260.0) == pytest.approx(105.0)


@pytest.mark.parametrize("unit", ["", "furlong"])
def test_a_file_without_a_unit_isnt_guessed(tmp_path: Path, unit: str) -> None:
    written(tmp_path / "a.xml", "clothoid")
    text = (tmp_path / "a.xml").read_text()
    (tmp_path / "a.xml").write_text(text.replace('linearUnit="meter"', f'linearUnit="{unit}"' if unit else ""))
    with pytest.raises(InputError, match="Units linearUnit"):
        read_lines(tmp_path / "a.xml")


def test_a_transition_that_its_ends_contradict_is_refused(tmp_path: Path) -> None:
    """As where a Bloss curve of another program is called a clothoid."""
    written(tmp_path / "a.xml", "bloss")
    text = (tmp_path / "a.xml").read_text().replace("spiType='bloss'", "spiType='helmert'")
    (tmp_path / "a.xml").write_text(text)
    with pytest.raises(InputError, match=r"Spiral at station 90\.000 m: spiType is 'helmert'"):
        only(tmp_path / "a.xml")
    text = text.replace("spiType='helmert'", "spiType='clothoid'")
    (tmp_path / "a.xml").write_text(text.replace("length='120.0'", "length='119.9'"))
    with pytest.raises(InputError, match="its ends must be"):
        only(tmp_path / "a.xml")


PARABOLA = "<PVI>0 50</PVI><ParaCurve length='80'>200 54</ParaCurve><PVI>520 50</PVI>"


@pytest.mark.parametrize("start", [0.0, 12_000.0, -300.0])
@pytest.mark.parametrize("included", [True, False])
def test_stations_of_the_profile_may_include_the_start(tmp_path: Path, start: float, included: bool) -> None:
    shift = start if included else 0.0
    profile = f"<PVI>{shift} 50</PVI><ParaCurve length='80'>{200 + shift} 54</ParaCurve><PVI>{520 + shift} 50</PVI>"
    written(tmp_path / "a.xml", "clothoid", profile=profile, start=start)
    with collected_remarks() as remarks:
        line = only(tmp_path / "a.xml")
    assert line.first_station == start
    assert bool(remarks) == (start != 0.0 and not included)
    rise, fall = 4.0 / 200.0, -4.0 / 320.0
    heights = profile_of(exact_axis(line)).elevation(np.array([0.0, 160.0, 200.0, 240.0, 520.0]))
    top = 54.0 + (fall - rise) * 80.0 / 8.0
    assert heights.tolist() == pytest.approx([50.0, 53.2, top, 54.0 + 40.0 * fall, 50.0])


def test_unsymmetrical_parabolas_and_circles(tmp_path: Path) -> None:
    profile = "<PVI>0 50</PVI><UnsymParaCurve lengthIn='40' lengthOut='100'>150 56</UnsymParaCurve>"
    profile += "<CircCurve length='90' radius='3000'>380 51.4</CircCurve><PVI>520 56</PVI>"
    written(tmp_path / "a.xml", "clothoid", profile=profile)
    axis = exact_axis(only(tmp_path / "a.xml"))
    found = profile_of(axis)
    rise, fall, last = 6.0 / 150.0, -4.6 / 230.0, 4.6 / 140.0
    middle = (rise * 40.0 + fall * 100.0) / 140.0
    assert found.grade(150.0) == pytest.approx(middle, abs=1e-9)
    assert found.elevation(150.0) == pytest.approx(56.0 - 40.0 * rise + 0.5 * (rise + middle) * 40.0)
    # The circle touches both grades: points of it are 3000 m from its centre.
    a, b = math.atan(fall), math.atan(last)
    begin = 380.0 - 3000.0 * math.tan(0.5 * (b - a)) * math.cos(a)
    centre = (begin - 3000.0 * math.sin(a), found.elevation(begin) + 3000.0 * math.cos(a))
    station = np.linspace(begin, begin + 3000.0 * (math.sin(b) - math.sin(a)), 50)
    away = np.hypot(station - centre[0], found.elevation(station) - centre[1])
    assert np.abs(away - 3000.0).max() < 1e-3
    assert found.elevation(520.0) == pytest.approx(56.0, abs=1e-6)


def test_profiles_that_cover_a_part_go_on_with_their_grades(tmp_path: Path) -> None:
    written(tmp_path / "a.xml", "clothoid", profile="<PVI>100 50</PVI><PVI>300 54</PVI>")
    found = profile_of(exact_axis(only(tmp_path / "a.xml")))
    assert found.elevation(np.array([0.0, 520.0])).tolist() == pytest.approx([48.0, 58.4])


@pytest.mark.parametrize(
    ("profile", "message"),
    [
        ("<PVI>0 50</PVI><ParaCurve length='300'>100 54</ParaCurve><PVI>520 50</PVI>", "curves must not overlap"),
        ("<PVI>0 50</PVI><PVI>0 54</PVI>", "stations must increase"),
        ("<PVI>0</PVI>", "must be a station and an elevation"),
        (
            "<PVI>0 1</PVI><UnsymParaCurve lengthIn='0' lengthOut='9'>99 2</UnsymParaCurve><PVI>300 4</PVI>",
            "two lengths",
        ),
        ("<PVI>0 nan</PVI>", "must be a finite number"),
    ],
)
def test_profiles_that_no_road_follows_are_refused(tmp_path: Path, profile: str, message: str) -> None:
    written(tmp_path / "a.xml", "clothoid", profile=profile)
    with pytest.raises(InputError, match=message):
        only(tmp_path / "a.xml")


def test_station_equations_and_other_dialects(tmp_path: Path) -> None:
    """A national dialect has a namespace of its own, a byte order mark, and codes of coordinate systems."""
    written(tmp_path / "a.xml", "clothoid", profile=PARABOLA, start=1000.0)
    equation = "<StaEquation staInternal='1300' staBack='1300' staAhead='2000'/>"
    text = (tmp_path / "a.xml").read_text().replace("</Alignment>", f"{equation}</Alignment>")
    text = text.replace("http://www.landxml.org/schema/LandXML-1.2", "http://www.inframodel.fi/inframodel")
    text = text.replace("<Alignments>", '<CoordinateSystem name="ETRS" epsgCode="25832"/><Alignments>')
    (tmp_path / "a.xml").write_bytes(b"\xef\xbb\xbf" + text.encode())
    line = only(tmp_path / "a.xml")
    assert [(e.station, e.back, e.ahead) for e in line.equations] == [(300.0, 1300.0, 2000.0)]
    assert line.system is not None
    assert line.system.epsg == 25832


def test_a_circle_that_its_ends_contradict_is_refused(tmp_path: Path) -> None:
    points = xml_points(Start=(0.0, 0.0), Center=(0.0, 100.0), End=(100.0, 90.0))
    landxml(tmp_path / "a.xml", [xml_alignment(f"<Curve rot='ccw'>{points}</Curve>")])
    with pytest.raises(InputError, match="its end must lie 100 m from Center"):
        only(tmp_path / "a.xml")


def test_points_by_reference_and_other_elements_are_named(tmp_path: Path) -> None:
    for inner, message in (
        ("<Line><Start pntRef='P1'/><End>1 2</End></Line>", "must contain coordinates; references"),
        ("<Chain>1 2 3</Chain>", "must be one of Line, Curve, Spiral, IrregularLine"),
    ):
        landxml(tmp_path / "a.xml", [xml_alignment(inner)])
        with pytest.raises(InputError, match=message):
            only(tmp_path / "a.xml")
