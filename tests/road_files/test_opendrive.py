"""Roads of OpenDRIVE: elements as they stand, cubics within a millimetre, and what must not be taken for something."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from synthroads_addon.base.errors import InputError
from synthroads_addon.base.remarks import collected_remarks
from synthroads_addon.road.profile import IntersectionPoint, Profile
from synthroads_addon.road_files import curves
from synthroads_addon.road_files.line import ExactAxis, RoadLine, exact_axis
from synthroads_addon.road_files.read import choose_line, read_lines
from tests.helpers.roads.written_lines import Walk, linear, opendrive, xodr_road

ELEMENTS = [(80.0, 0.0, 0.0), (60.0, 0.0, 0.004), (120.0, 0.004, 0.004), (50.0, 0.004, -0.002), (90.0, 0.0, 0.0)]
"""Length and curvatures: line, clothoid, arc, an egg-shaped clothoid through zero, line."""
SHAPES = {"line": "<line/>", "arc": '<arc curvature="{0!r}"/>', "spiral": '<spiral curvStart="{0!r}" curvEnd="{1!r}"/>'}


def shape_of(first: float, last: float) -> str:
    kind = "line" if first == last == 0.0 else "arc" if first == last else "spiral"
    return SHAPES[kind].format(first, last)


def main_road(x: float = 1000.0, y: float = -500.0, rest: str = "") -> tuple[str, Walk]:
    walk = Walk([(length, linear(length, a, b)) for length, a, b in ELEMENTS], x, y, 0.7)
    rows = [(walk.starts[n], length, walk.poses[n], shape_of(a, b)) for n, (length, a, b) in enumerate(ELEMENTS)]
    return xodr_road(rows, rest), walk


def only_line(path: Path) -> RoadLine:
    (line,) = read_lines(path)
    if line.fault:
        raise line.fault
    return line


def profile_of(axis: ExactAxis) -> Profile:
    assert axis.heights is not None
    return Profile([IntersectionPoint(p.station, p.elevation, p.radius) for p in axis.heights.points])


def test_lines_arcs_and_clothoids_are_taken_over(tmp_path: Path) -> None:
    road, walk = main_road()
    line = only_line(opendrive(tmp_path / "a.xodr", [road]))
    axis = exact_axis(line)
    assert [piece.kind for piece in line.pieces] == ["line", "spiral", "arc", "spiral", "line"]
    found = [(e.length, e.curvature_start, e.curvature_end) for e in axis.alignment.elements]
    assert found == ELEMENTS
    station, points = walk.points()
    assert np.hypot(*(axis.alignment.position(station) - points).T).max() < 1e-6
    assert axis.approximated == ()


def test_the_headers_offset_is_added_and_turned(tmp_path: Path) -> None:
    """ASAM OpenDRIVE 1.8.1, 9.3: the offset leads from the file's coordinates to those of the projection."""
    road, walk = main_road(10.0, 20.0)
    header = '<offset x="500000" y="5600000" z="100" hdg="0.5"/>'
    rest = '<elevationProfile><elevation s="0" a="7" b="0" c="0" d="0"/></elevationProfile>'
    road, walk = main_road(10.0, 20.0, rest)
    axis = exact_axis(only_line(opendrive(tmp_path / "a.xodr", [road], header)))
    station, points = walk.points(20.0)
    cos, sin = math.cos(0.5), math.sin(0.5)
    wanted = points @ np.array([[cos, sin], [-sin, cos]]) + (500000.0, 5600000.0)
    assert np.hypot(*(axis.alignment.position(station) - wanted).T).max() < 1e-6
    assert profile_of(axis).elevation(50.0) == pytest.approx(107.0)


@pytest.mark.parametrize("normalized", [True, False])
def test_a_parametric_cubic_runs_by_its_arc_length(tmp_path: Path, normalized: bool) -> None:
    """The parameter isn't the station: it is fast at first, slow in the end."""
    u, v = np.array([0.0, 130.0, -40.0, 5.0]), np.array([0.0, 0.0, 18.0, -6.0])
    p = np.linspace(0.0, 1.0, 200_001)
    x, y = np.polynomial.Polynomial(u)(p), np.polynomial.Polynomial(v)(p)
    run = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))])
    length = float(run[-1])
    scale = np.ones(4) if normalized else length ** -np.arange(4.0)
    words = " ".join(f'{n}{axis}="{value!r}"' for axis, row in (("U", u * scale), ("V", v * scale))
                     for n, value in zip("abcd", row.tolist(), strict=True))  # fmt: skip
    kind = "normalized" if normalized else "arcLength"
    geometry = (0.0, length, (3.0, 4.0, 0.3), f'<paramPoly3 pRange="{kind}" {words}/>')
    axis = exact_axis(only_line(opendrive(tmp_path / "a.xodr", [xodr_road([geometry])])))
    assert axis.alignment.length == pytest.approx(length, abs=1e-6)
    station = np.linspace(0.0, length, 300)
    along = np.column_stack([np.interp(station, run, x), np.interp(station, run, y)])
    cos, sin = math.cos(0.3), math.sin(0.3)
    wanted = along @ np.array([[cos, sin], [-sin, cos]]) + (3.0, 4.0)
    assert np.hypot(*(axis.alignment.position(station) - wanted).T).max() < 5e-4
    ((_, _, count, worst),) = axis.approximated
    assert count > 1
    assert worst < 2.1e-4


def test_a_curve_that_clothoids_dont_follow_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(curves, "_MOST_PIECES", 1)
    words = '<poly3 a="0" b="0" c="4e-3" d="2e-6"/>'
    line = only_line(opendrive(tmp_path / "a.xodr", [xodr_road([(0.0, 90.0, (0.0, 0.0, 0.0), words)])]))
    with pytest.raises(InputError, match=r"poly3 at station 0\.000 m: distance, m is .*within 1 mm"):
        exact_axis(line)


@pytest.mark.parametrize(
    ("c", "d", "end"),
    [(4e-3, 2e-6, 90.0), (0.0, 2e-4, 60.0), (0.0, -5e-4, 50.0), (0.02, -2e-4, 70.0), (0.0, 0.0, 80.0)],
)
def test_the_distance_of_a_cubic_isnt_its_station(c: float, d: float, end: float, tmp_path: Path) -> None:
    """Taken for it, the curve would be too long, by 2 to 60 m here: OpenDRIVE's length is that of the arc."""
    v = np.polynomial.Polynomial([0.0, 0.0, c, d])
    u = np.linspace(0.0, end, 200_001)
    run = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(u), np.diff(v(u))))])
    words = f'<poly3 a="0" b="0" c="{c}" d="{d}"/>'
    geometry = (0.0, float(run[-1]), (0.0, 0.0, 0.0), words)
    axis = exact_axis(only_line(opendrive(tmp_path / "a.xodr", [xodr_road([geometry])])))
    assert axis.alignment.length == pytest.approx(run[-1], abs=1e-6)
    assert axis.alignment.position(axis.alignment.length).tolist() == pytest.approx([end, v(end)], abs=1e-3)


def test_cubic_elevations_are_within_a_millimetre_and_meet(tmp_path: Path) -> None:
    rows = [(0.0, 100.0, 0.01, 2e-4, -1.5e-6), (130.0, None, None, -1e-4, 8e-7)]
    first = np.polynomial.Polynomial(rows[0][1:])
    rows[1] = (130.0, first(130.0), first.deriv()(130.0), -1e-4, 8e-7)
    inner = "".join(f'<elevation s="{s}" a="{a}" b="{b}" c="{c}" d="{d}"/>' for s, a, b, c, d in rows)
    road, _ = main_road(rest=f"<elevationProfile>{inner}</elevationProfile>")
    axis = exact_axis(only_line(opendrive(tmp_path / "a.xodr", [road])))
    station = np.linspace(0.0, 400.0, 2001)
    second = np.polynomial.Polynomial(rows[1][1:])
    wanted = np.where(station < 130.0, first(station), second(station - 130.0))
    found = profile_of(axis)
    assert np.abs(found.elevation(station) - wanted).max() < 1e-3
    assert axis.heights is not None
    assert axis.heights.deviation == pytest.approx(np.abs(found.elevation(station) - wanted).max(), rel=0.2)
    assert axis.heights.jumps == ()
    grade = np.where(station < 130.0, first.deriv()(station), second.deriv()(station - 130.0))
    assert np.abs(found.grade(station) - grade).max() < 1e-3


def test_heights_that_jump_are_moved_and_told(tmp_path: Path) -> None:
    inner = '<elevation s="0" a="10" b="0.02" c="0" d="0"/><elevation s="200" a="15" b="0" c="0" d="0"/>'
    road, _ = main_road(rest=f"<elevationProfile>{inner}</elevationProfile>")
    axis = exact_axis(only_line(opendrive(tmp_path / "a.xodr", [road])))
    assert axis.heights is not None
    assert axis.heights.jumps == ((200.0, 1.0),)
    assert profile_of(axis).elevation(np.array([199.9, 300.0])).tolist() == pytest.approx([13.998, 14.0])


@pytest.mark.parametrize(("gap", "kink", "text"), [(0.002, 0.0, "gap, m"), (0.0, 2e-4, "change of direction, rad")])
def test_elements_that_dont_join_are_refused_with_the_place(tmp_path: Path, gap: float, kink: float, text: str) -> None:
    walk = Walk([(50.0, linear(50.0, 0.0, 0.0)), (60.0, linear(60.0, 0.01, 0.01))], 0.0, 0.0, 0.0)
    x, y, heading = walk.poses[1]
    rows = [
        (0.0, 50.0, walk.poses[0], "<line/>"),
        (50.0, 60.0, (x, y + gap, heading + kink), '<arc curvature="0.01"/>'),
    ]
    line = only_line(opendrive(tmp_path / "a.xodr", [xodr_road(rows)]))
    with pytest.raises(InputError, match=rf"{text}.*station 50\.000 m"):
        exact_axis(line)
    rows[1] = (50.0, 60.0, (x, y + 0.4 * gap, heading + 0.4 * kink), '<arc curvature="0.01"/>')
    axis = exact_axis(only_line(opendrive(tmp_path / "b.xodr", [xodr_road(rows)])))
    assert axis.drift == pytest.approx(0.4 * gap, abs=1e-9)


def test_the_longest_road_that_is_no_junctions_is_taken_and_names_are_unique(tmp_path: Path) -> None:
    def road(length: float, junction: int, number: int) -> str:
        return xodr_road([(0.0, length, (0.0, 0.0, 0.0), "<line/>")], name="way", number=number, junction=junction)

    path = opendrive(tmp_path / "a.xodr", [road(50.0, -1, 1), road(80.0, -1, 2), road(200.0, 7, 3)])
    lines = read_lines(path)
    assert [line.name for line in lines] == ["way", "way (2)", "way (3)"]
    assert choose_line(lines, None, path.name).name == "way (2)"
    assert choose_line(lines, "way (3)", path.name).junction
    known = r"'way', 'way \(2\)'"
    with pytest.raises(InputError, match=rf"a\.xodr: road is 'no': must be one of the roads in the file: {known}"):
        choose_line(lines, "no", path.name)


def test_a_broken_road_leaves_the_others_usable(tmp_path: Path) -> None:
    broken = xodr_road([(0.0, 900.0, (0.0, 0.0, 0.0), '<arc curvature="x"/>')], name="broken")
    whole, _ = main_road()
    path = opendrive(tmp_path / "a.xodr", [broken, whole])
    lines = read_lines(path)
    assert choose_line(lines, None, path.name).name == "main"
    with pytest.raises(InputError, match=r"a\.xodr: broken: arc curvature is 'x': must be a finite number"):
        choose_line(lines, "broken", path.name)


@pytest.mark.parametrize(
    ("text", "epsg", "word"),
    [
        ("EPSG:25832", 25832, ""),
        ("<![CDATA[ epsg:25833 ]]>", 25833, ""),
        ("+proj=utm +zone=32 +ellps=GRS80 +units=m +no_defs", 25832, ""),
        ("+proj=utm +zone=32 +datum=WGS84 +geoidgrids=none.gtx +vunits=m +no_defs", 32632, ""),
        ("+proj=utm +zone=32 +lon_0=9.1 +datum=WGS84", 32632, "mean nothing"),
        ("+proj=utm +zone=32 +lon_0=-122 +datum=WGS84", None, "contradicts itself"),
        ("+proj=utm +zone=32 +grids=@/etc/passwd", None, "isn't known"),
        ("somewhere", None, "isn't used"),
        ("", None, ""),
    ],
)
def test_what_the_header_says_of_the_place(tmp_path: Path, text: str, epsg: int | None, word: str) -> None:
    road, _ = main_road()
    header = f"<geoReference>{text}</geoReference>"
    with collected_remarks() as remarks:
        line = only_line(opendrive(tmp_path / "a.xodr", [road], header))
    assert (line.system and line.system.epsg) == epsg
    assert word in " ".join(remarks)
    assert bool(remarks) == bool(word)


def test_a_projection_of_its_own_has_no_code(tmp_path: Path) -> None:
    road, _ = main_road()
    header = "<geoReference>+proj=tmerc +lat_0=40.7 +lon_0=-78.1 +k=1 +x_0=0 +y_0=0 +datum=WGS84</geoReference>"
    system = only_line(opendrive(tmp_path / "a.xodr", [road], header)).system
    assert system is not None
    assert (system.epsg, system.unit) == (None, 1.0)


def test_what_is_left_out_is_counted(tmp_path: Path) -> None:
    lanes = '<lanes><laneSection s="0"><left><lane id="1"/></left><right><lane id="-1"/><lane id="-2"/></right>'
    rest = (
        f"{lanes}</laneSection></lanes><objects><object/><object/></objects><lateralProfile><shape/></lateralProfile>"
    )
    road, _ = main_road(rest=rest)
    line = only_line(opendrive(tmp_path / "a.xodr", [road]))
    assert line.lanes == 3
    assert line.left_out == ("lanes of 1 lane sections", "lateral profile: 1 shape", "2 objects")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<OpenDRIVE><road>", "must be valid XML"),
        ('<!DOCTYPE a [<!ENTITY b "c">]><OpenDRIVE><header name="&b;"/></OpenDRIVE>', "document type is 'a'"),
        ("<OpenDRIVE><header/></OpenDRIVE>", "no road or alignment with elements"),
        ("<svg/>", "must be one of OpenDRIVE, LandXML, IFC"),
    ],
)
def test_what_is_no_road_is_one_line(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "a.xodr").write_text(text)
    with pytest.raises(InputError, match=message):
        read_lines(tmp_path / "a.xodr")


@pytest.mark.parametrize(
    "shape", ["", "<line/><line/>", '<paramPoly3 aU="0" bU="0" cU="0" dU="0" aV="0" bV="0" cV="0" dV="0"/>']
)
def test_a_geometry_without_a_curve_is_refused_with_its_station(tmp_path: Path, shape: str) -> None:
    path = opendrive(tmp_path / "a.xodr", [xodr_road([(12.5, 20.0, (0.0, 0.0, 0.0), shape)])])
    with pytest.raises(InputError, match=r"geometry at s = 12\.5"):
        choose_line(read_lines(path), None, path.name)
