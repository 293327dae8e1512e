"""The surface of files: superelevation, shape, crossfall and heights of lanes, against rotations in space."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import RoadParameters
from tests.helpers.roads.lane_files import cubic, lane, lanes, road_file, section, taken, width

AT = np.array([10.0, 60.0, 85.0, 120.0, 140.0, 190.0])
TWO_WAYS = section(0.0, lane(1, width(0.0, 3.5)), lane(-1, width(0.0, 3.5)))


def turned(s: float, t: float, heading: float, level: float, grade: float, tilt: float) -> np.ndarray:
    """Return the point at s and t of a straight road: the section turned with the grade, then about the line."""
    climb = np.arctan(grade)
    along = np.array([np.cos(heading) * np.cos(climb), np.sin(heading) * np.cos(climb), np.sin(climb)])
    left = np.array([-np.sin(heading), np.cos(heading), 0.0])
    up = np.cross(along, left)
    line = np.array([10.0 + s * np.cos(heading), 20.0 + s * np.sin(heading), level])
    return line + t * (np.cos(tilt) * left + np.sin(tilt) * up)


def height_at(parameters: RoadParameters, geometry: RoadGeometry, point: np.ndarray) -> float:
    """Return how far a point of the map lies above the road's surface, m."""
    local = point - parameters.transform.translate
    s, t = geometry.alignment.project(local[None, :2])
    return float(local[2] - geometry.elevation(s, t)[0])


@pytest.mark.parametrize("offset", [0.0, 2.0])
def test_the_plane_turns_about_the_line(tmp_path: Path, offset: float) -> None:
    """Positive superelevation rises to the left, and t lies in the plane."""
    tilt = np.polynomial.Polynomial([0.02, 5e-4, -2e-6])
    grade = 0.04
    rest = f"<elevationProfile>{cubic('elevation', 's', 0.0, 50.0, grade)}</elevationProfile>"
    rest += f"<lateralProfile>{cubic('superelevation', 's', 0.0, *tilt.coef)}</lateralProfile>"
    rest += lanes(cubic("laneOffset", "s", 0.0, offset), TWO_WAYS)
    parameters, geometry, report = taken(road_file(tmp_path, rest))
    assert not report["whole"]["surface_lost"]
    for s in AT.tolist():
        for t in (offset - 3.49, offset - 1.0, offset + 0.5, offset + 3.49):
            point = turned(s, t, 0.3, 50.0 + grade * s, grade, float(tilt(s)))
            assert abs(height_at(parameters, geometry, point)) < 1e-3
    edge = turned(120.0, offset - 3.5, 0.3, 0.0, grade, float(tilt(120.0)))[:2] - parameters.transform.translate[:2]
    s, t = geometry.alignment.project(edge[None])
    assert abs(geometry.sections["right"].lane_boundaries(s)[0, 0] + t[0]) < 1e-3
    assert parameters.carriageway("right").crossfall[0].crossfall_percent == pytest.approx(2.0, abs=0.01)


def test_a_median_lies_in_the_plane_too(tmp_path: Path) -> None:
    """Both carriageways turn about the line itself: their inner edges aren't level."""
    side = [("median", 2.0), ("driving", 3.5)]
    both = ["".join(lane(sign * n, width(0.0, w), kind) for n, (kind, w) in enumerate(side, 1)) for sign in (1, -1)]
    rest = f"<lateralProfile>{cubic('superelevation', 's', 0.0, 0.05)}</lateralProfile>" + lanes(section(0.0, *both))
    parameters, geometry, report = taken(road_file(tmp_path, rest))
    assert not report["whole"]["surface_lost"]
    for t in (-5.4, -2.0, -1.0, 0.0, 1.0, 2.0, 5.4):
        assert abs(height_at(parameters, geometry, turned(70.0, t, 0.3, 50.0, 0.0, 0.05))) < 1e-3


def test_crossfall_falls_to_both_sides(tmp_path: Path) -> None:
    """OpenDRIVE 1.4: an angle by side, positive where it falls outwards."""
    rows = '<crossfall side="left" s="0" a="0.02"/><crossfall side="right" s="0" a="0.03"/>'
    rest = f"<lateralProfile>{rows}</lateralProfile>" + lanes(TWO_WAYS)
    parameters, _, report = taken(road_file(tmp_path, rest))
    assert not report["whole"]["surface_lost"]
    falls = [parameters.carriageway(side).crossfall[0].crossfall_percent for side in ("left", "right")]
    assert falls == pytest.approx([-100.0 * np.tan(0.02), 100.0 * np.tan(0.03)], abs=1e-3)


def test_a_shape_that_is_two_planes_is_taken_over(tmp_path: Path) -> None:
    """Linear between the stations that have a profile; the line itself is raised by 5 cm at the second."""
    rows = "".join(
        f'<shape s="{s}" t="{t}" a="{a!r}" b="{b!r}" c="0" d="0"/>'
        for s, t, a, b in ((0, -4, -0.08, 0.02), (0, 0, 0.0, -0.02), (200, -4, -0.03, 0.02), (200, 0, 0.05, -0.04))
    )
    rest = f"<lateralProfile>{rows}</lateralProfile>" + lanes(TWO_WAYS)
    parameters, geometry, report = taken(road_file(tmp_path, rest))
    assert not report["whole"]["surface_lost"], report["whole"]
    for s in AT.tolist():
        share = s / 200.0
        for t in (-3.4, -1.0, 1.0, 3.4):
            slope = 0.02 if t < 0.0 else -0.02 - 0.02 * share
            point = turned(s, t, 0.3, 50.0 + 0.05 * share + slope * t, 0.0, 0.0)
            assert abs(height_at(parameters, geometry, point)) < 1e-3


def test_a_bowed_shape_is_told_with_the_worst_place(tmp_path: Path) -> None:
    """1 cm/m2 across: no plane holds that."""
    rows = '<shape s="0" t="-4" a="0" b="0" c="0" d="0"/><shape s="0" t="0" a="0" b="0" c="-0.01" d="0"/>'
    rest = f"<lateralProfile>{rows}</lateralProfile>" + lanes(TWO_WAYS)
    _, _, report = taken(road_file(tmp_path, rest))
    assert report["whole"]["surface_lost"]
    (row,) = [row for row in report["whole"]["approximated"] if row["kind"] == "left pavement"]
    assert 0.005 < row["deviation"] < 0.0613


@pytest.mark.parametrize(
    ("inner", "level", "tilt", "deviation"),
    [('<height sOffset="0" inner="0.12" outer="0.12"/>', "false", 0.0, 0.12), ("", "true", 0.04, 0.139)],
)
def test_lanes_off_the_plane_are_told(tmp_path: Path, inner: str, level: str, tilt: float, deviation: float) -> None:
    """A lane that is raised by a kerb, and one that stays level where the road is tilted."""
    right = lane(-1, width(0.0, 3.5)) + lane(-2, width(0.0, 3.5) + inner, "shoulder", level)
    rest = f"<lateralProfile>{cubic('superelevation', 's', 0.0, tilt)}</lateralProfile>" if tilt else ""
    _, _, report = taken(road_file(tmp_path, rest + lanes(section(0.0, "", right))))
    assert report["whole"]["surface_lost"]
    (row,) = [row for row in report["whole"]["approximated"] if row["kind"] == "right pavement"]
    assert 0.1 * deviation < row["deviation"] <= deviation + 1e-3


def test_a_verge_falls_as_its_heights_say(tmp_path: Path) -> None:
    fall = '<height sOffset="0" inner="0" outer="-0.12"/>'
    right = lane(-1, width(0.0, 3.5)) + lane(-2, width(0.0, 1.5) + fall, "none")
    parameters, _, report = taken(road_file(tmp_path, lanes(section(0.0, "", right))))
    assert not report["whole"]["surface_lost"]
    assert parameters.carriageway("right").verge_slope_percent == pytest.approx(8.0)


def test_steeper_crossfall_than_a_set_has_is_told(tmp_path: Path) -> None:
    rest = f"<lateralProfile>{cubic('superelevation', 's', 0.0, 0.2)}</lateralProfile>" + lanes(TWO_WAYS)
    parameters, _, report = taken(road_file(tmp_path, rest))
    assert parameters.carriageway("left").crossfall[0].crossfall_percent == 12.0
    assert report["whole"]["surface_lost"]
    assert any("at most 12 %" in row["why"] for row in report["whole"]["approximated"])
