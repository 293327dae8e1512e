"""Road marks as line markings: kinds, dashes and their phase, doubles, colours, and what a file doesn't say."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from synthroads_addon.road.section import LineMarking
from tests.helpers.roads.lane_files import cubic, lane, lanes, road_file, section, taken, width


def lines_of(path: Path) -> tuple[dict[str, LineMarking], list, dict]:
    """Return the markings, where each lies (left and right edge at 20 m and 150 m), and the report."""
    parameters, geometry, report = taken(path)
    markings = parameters.of_type(LineMarking)
    at = np.array([20.0, 150.0])
    middles = [np.mean(geometry.marking_edges(line, at), axis=0) for line in markings.values()]
    return markings, middles, report["whole"]


def marked(mark: str, number: int = -1) -> str:
    inner = [width(0.0, 3.5) + (mark if number == -n else "") for n in (1, 2)]
    return lanes(section(0.0, "", lane(-1, inner[0]) + lane(-2, inner[1]), mark if number == 0 else ""))


def test_a_broken_line_between_lanes(tmp_path: Path) -> None:
    mark = '<roadMark sOffset="0" type="broken" color="yellow" height="0.002"><type name="x" width="0.15">'
    mark += '<line length="4" space="8" tOffset="0" sOffset="3" width="0.15"/></type></roadMark>'
    markings, middles, _ = lines_of(road_file(tmp_path, marked(mark)))
    (line,) = markings.values()
    assert (line.kind, line.boundary, line.color) == ("lane", 1, "yellow")
    assert (line.dash_length, line.gap_length, line.width, line.film_thickness) == (4.0, 8.0, 0.15, 0.002)
    assert (line.start_station, line.end_station) == (3.0, 200.0)
    assert middles[0].tolist() == pytest.approx([-3.5, -3.5])


@pytest.mark.parametrize(
    ("kind", "offsets", "dashes"),
    [
        ("solid solid", (0.2, -0.2), (0.0, 0.0)),
        ("solid broken", (0.2, -0.2), (0.0, 6.0)),
        ("broken solid", (0.2, -0.2), (6.0, 0.0)),
    ],
)
def test_double_lines_are_two(tmp_path: Path, kind: str, offsets: tuple, dashes: tuple) -> None:
    """At the centre lane they are named from left to right."""
    mark = f'<roadMark sOffset="0" type="{kind}" color="standard" width="0.2"/>'
    path = road_file(tmp_path, lanes(cubic("laneOffset", "s", 0.0, 1.0), *[marked(mark, 0)[7:-8]]))
    markings, middles, _ = lines_of(path)
    assert [line.dash_length for line in markings.values()] == list(dashes)
    assert [float(middle[0]) for middle in middles] == pytest.approx([1.0 + offset for offset in offsets])
    assert {line.width for line in markings.values()} == {0.2}


def test_what_isnt_given_is_usual_and_told(tmp_path: Path) -> None:
    markings, _, report = lines_of(road_file(tmp_path, marked('<roadMark sOffset="0" type="broken" color="red"/>')))
    (line,) = markings.values()
    assert (line.dash_length, line.gap_length, line.width, line.color) == (6.0, 12.0, 0.15, "white")
    told = [row["why"] for row in report["approximated"]]
    assert told == [
        "a width that isn't given is 0.15 m",
        "dashes and gaps that aren't given are 6 m and 12 m",
        "red paint is white",
    ]


def test_a_mark_begins_and_ends(tmp_path: Path) -> None:
    mark = '<roadMark sOffset="30" type="solid" width="0.3"/><roadMark sOffset="80" type="none"/>'
    markings, middles, _ = lines_of(road_file(tmp_path, marked(mark, -2)))
    (line,) = markings.values()
    assert (line.start_station, line.end_station, line.boundary) == (30.0, 80.0, 0)
    assert middles[0].tolist() == pytest.approx([-7.0, -7.0])


def test_dashes_go_on_across_sections(tmp_path: Path) -> None:
    """The second section's first dash is where the first's next one would be; a third's isn't."""

    def part(start: float, first: float) -> str:
        rows = f'<line length="4" space="6" tOffset="0" sOffset="{first}" width="0.12"/>'
        mark = f'<roadMark sOffset="0" type="broken" width="0.12"><type name="x" width="0.12">{rows}</type></roadMark>'
        return section(start, "", lane(-1, width(0.0, 3.5) + mark) + lane(-2, width(0.0, 3.5)))

    markings, _, _ = lines_of(road_file(tmp_path, lanes(part(0.0, 0.0), part(65.0, 5.0), part(130.0, 3.0))))
    found = [(line.start_station, line.end_station) for line in markings.values()]
    assert found == [(0.0, 130.0), (133.0, 200.0)]


def test_a_line_that_follows_no_lane_is_free(tmp_path: Path) -> None:
    """The outer border of a shoulder that widens."""
    mark = '<roadMark sOffset="0" type="solid" width="0.12"/>'
    right = lane(-1, width(0.0, 3.5)) + lane(-2, width(0.0, 1.0, 0.01) + mark, "shoulder")
    markings, middles, _ = lines_of(road_file(tmp_path, lanes(section(0.0, "", right))))
    (line,) = markings.values()
    assert line.kind == "free"
    assert middles[0].tolist() == pytest.approx([-4.7, -6.0], abs=1e-3)


def test_edges_that_arent_painted_are_left_out(tmp_path: Path) -> None:
    markings, _, report = lines_of(road_file(tmp_path, marked('<roadMark sOffset="0" type="curb" width="0.2"/>')))
    assert markings == {}
    assert report["left_out"] == [{"kind": "road marks", "count": 1, "why": "of type curb"}]


def test_without_marks_the_usual_ones_are_drawn(tmp_path: Path) -> None:
    markings, _, report = lines_of(road_file(tmp_path, marked("")))
    assert {line.kind for line in markings.values()} == {"outer_edge", "lane", "inner_edge"}
    assert "road marks" not in report["read"]


@pytest.mark.parametrize("offset", [(0.0,), (1.5,), (0.5, 0.01), (0.2, 0.0, 2e-4)])
def test_a_road_without_marks_whose_directions_meet_gets_one_dashed_line_between_them(
    tmp_path: Path, offset: tuple[float, ...]
) -> None:
    rest = lanes(
        cubic("laneOffset", "s", 0.0, *offset), section(0.0, lane(1, width(0.0, 3.5)), lane(-1, width(0.0, 3.5)))
    )
    markings, middles, _ = lines_of(road_file(tmp_path, rest))
    assert len(markings) == 3
    place = list(markings).index("centre-line")
    wanted = np.polynomial.Polynomial(offset)(np.array([20.0, 150.0]))
    assert middles[place] == pytest.approx(wanted, abs=1e-6 if len(offset) < 3 else 3e-4)
    assert markings["centre-line"].dash_length > 0.0
    assert sorted(line.kind for line in markings.values()) == ["free", "outer_edge", "outer_edge"]
