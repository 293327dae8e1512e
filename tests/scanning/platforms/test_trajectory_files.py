"""Trajectories of others: conventions of headings, SBET, coordinate systems, and times that are kept."""

import re
from pathlib import Path

import numpy as np
import pytest

from synthroads_addon.base.errors import InputError
from synthroads_addon.base.maps.crs import MapSystem
from synthroads_addon.base.maps.places import Placement
from synthroads_addon.scanning.platforms.path import epoch_of
from synthroads_addon.scanning.platforms.polyline import PolylineGuide
from synthroads_addon.scanning.platforms.registry import make_platform
from synthroads_addon.scanning.platforms.stretches import PathStretches
from synthroads_addon.scanning.platforms.trajectory import TrajectoryContent, check_headings, read_trajectory
from synthroads_addon.scanning.sway import Motion, with_motion
from tests.helpers.files.axis_files import in_system
from tests.helpers.files.sbet_files import Flight
from tests.helpers.logged import logged

HOME = Placement.of(MapSystem.of(25832))
CONVENTIONS = {
    "radians clockwise from north": np.deg2rad,
    "degrees counter-clockwise from east": lambda degrees: 90.0 - degrees,
    "radians counter-clockwise from east": lambda degrees: np.deg2rad(90.0 - degrees),
    "degrees counter-clockwise from north": lambda degrees: -degrees,
    "degrees of where it comes from": lambda degrees: degrees + 180.0,
}


@pytest.mark.parametrize("course", [20.0, 100.0, 190.0, 250.0, 325.0])
@pytest.mark.parametrize("convention", CONVENTIONS)
def test_headings_of_another_convention_are_told(convention: str, course: float, tmp_path: Path) -> None:
    flight = Flight(course)
    path = flight.csv(tmp_path / "flight.csv", CONVENTIONS[convention](flight.heading))
    with logged() as messages:
        check_headings("flight.csv", read_trajectory(path, HOME))
    (said,) = messages
    assert re.search(r"flight\.csv: headings lie \d+ degrees across the course", said)
    assert "degrees clockwise from grid north is needed" in said
    assert f"they look like {convention}" in said


@pytest.mark.parametrize("crab", [0.0, -7.0, 20.0, 30.0])
@pytest.mark.parametrize("course", [0.0, 45.0, 53.0, 180.0, 300.0])
def test_headings_along_the_course_are_not_told(course: float, crab: float, tmp_path: Path) -> None:
    """An aircraft's nose points into the wind: crab angles of 30 degrees are flown."""
    flight = Flight(course, crab)
    with logged() as messages:
        check_headings("flight.csv", read_trajectory(flight.csv(tmp_path / "flight.csv", flight.heading), HOME))
    assert messages == []


def test_a_platform_that_stands_has_no_course(tmp_path: Path) -> None:
    flight = Flight(count=3)
    path = flight.csv(tmp_path / "flight.csv", flight.heading + 90.0)
    path.write_text(re.sub(r",29\d+\.\d+,56\d+\.\d+,", ",294000,5628000,", path.read_text()))
    with logged() as messages:
        check_headings("flight.csv", read_trajectory(path, HOME))
    assert messages == []


@pytest.mark.parametrize(("wander", "sign"), [(0.0, 1.0), (0.3, 1.0), (0.3, -1.0), (-2.0, 1.0)])
def test_sbet_comes_on_the_map(wander: float, sign: float, tmp_path: Path) -> None:
    """Meridians converge by 2 degrees here: true north isn't the grid's."""
    flight = Flight(crab=1.0)
    with logged() as messages:
        rows = read_trajectory(flight.sbet(tmp_path / "flight.out", wander=wander, sign=sign), HOME)
    np.testing.assert_allclose(rows.position, flight.points, atol=1e-3)
    np.testing.assert_allclose(rows.time, flight.time)
    turned = np.mod(rows.heading - flight.heading + 180.0, 360.0) - 180.0
    np.testing.assert_allclose(turned, 0.0, atol=0.01)
    np.testing.assert_allclose(rows.roll, 0.4)
    np.testing.assert_allclose(rows.pitch, -1.2)
    assert ["counts heights from the ellipsoid" in message for message in messages] == [True]


def test_sbet_needs_a_map(tmp_path: Path) -> None:
    path = Flight().sbet(tmp_path / "flight.sbet")
    TrajectoryContent.read(path)
    with pytest.raises(InputError, match=r"flight\.sbet: the map's coordinate system must be named"):
        read_trajectory(path)
    with pytest.raises(InputError, match="outside of the system's area of use"):
        read_trajectory(path, Placement.of(MapSystem.of(2193)))


def damaged(column: int, row: int, value: float) -> bytes:
    records = np.zeros((5, 17))
    records[:, 0], records[:, 1], records[:, 2] = np.arange(5.0), 0.886, 0.106
    records[row, column] = value
    return records.astype("<f8").tobytes()


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (damaged(1, 3, 50.7), "value 2 of record 4 is 50.7: records of 17 doubles are needed"),
        (damaged(2, 0, np.nan), "value 3 of record 1 is nan"),
        (damaged(3, 0, 1e7), "value 4 of record 1 is 10000000.0"),
        (damaged(0, 3, 1.0), "time of record 4 is 1.0: times must increase"),
    ],
)
def test_what_is_no_sbet_is_refused_by_record(data: bytes, said: str, tmp_path: Path) -> None:
    (tmp_path / "flight.out").write_bytes(data)
    for read in (TrajectoryContent.read, lambda path: read_trajectory(path, HOME)):
        with pytest.raises(InputError, match=re.escape(said)):
            read(tmp_path / "flight.out")


def test_binary_of_another_size_is_no_text(tmp_path: Path) -> None:
    (tmp_path / "flight.out").write_bytes(damaged(0, 0, 0.0)[:-8])
    with pytest.raises(InputError, match="this is no text"):
        read_trajectory(tmp_path / "flight.out", HOME)


def test_a_trajectory_in_another_zone_is_moved(tmp_path: Path) -> None:
    flight = Flight(count=41)
    path = flight.csv(tmp_path / "flight.csv", flight.heading, "# crs: EPSG:25833\ntime,x,y,z,roll,pitch,heading")
    there = in_system(25833)
    lines = path.read_text().splitlines()
    for number in range(41):
        entries = lines[2 + number].split(",")
        lines[2 + number] = ",".join([entries[0], *map(str, there[number, :2]), *entries[3:]])
    path.write_text("\n".join(lines))
    np.testing.assert_allclose(read_trajectory(path, HOME).position[0, :2], [294_000.0, 5_628_000.0], atol=1e-3)
    with pytest.raises(InputError, match="area of use"):
        read_trajectory(flight.csv(tmp_path / "swapped.csv", flight.heading, "time,y,x,z,roll,pitch,heading"), HOME)


@pytest.mark.parametrize("keep", [False, True])
def test_times_of_the_file_are_kept_on_request(keep: bool, tmp_path: Path) -> None:
    flight = Flight()
    guide = PolylineGuide(flight.points - flight.points[0], flight.points[0].tolist())
    guide.place = HOME
    platform = make_platform(
        kind="trajectory", file=str(flight.sbet(tmp_path / "f.out")), keep_time=keep, height_shift=-47.5
    )
    path = platform.make_path(guide)
    begin = flight.begin if keep else 0.0
    assert epoch_of(path) == begin
    assert epoch_of(with_motion(path, Motion(position_sigma=0.1), 1)) == begin
    assert epoch_of(PathStretches(path, path.strips)) == begin
    position, _ = path.pose(path.strips[0], np.array([0.0]))
    np.testing.assert_allclose(position, [[0.0, 0.0, -47.5]], atol=1e-3)
