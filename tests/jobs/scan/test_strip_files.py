"""A file for each strip: flight line numbers, GPS time, and all points of the whole cloud."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from pathlib import Path

import laspy
import numpy as np
import pytest

from synthroads_addon.base.errors import InputError
from synthroads_addon.base.text.gps_time import gps_seconds
from synthroads_addon.jobs.scan.files import CloudFiles
from synthroads_addon.scenario.inputs import ScenarioInputs
from synthroads_addon.scenario.scenario import load_scenario
from tests.helpers.clouds.random_points import make_points

START = "2026-05-04T09:30:00Z"


def written(folder: Path, *changes: str) -> None:
    scenario = load_scenario("rq31-600m", ['outputs=["cloud"]', 'cloud.attributes=["range"]', *changes])
    points = make_points(3000)
    files = CloudFiles(scenario, ScenarioInputs.read(scenario), folder, points.xyz.min(axis=0), 60.0, 25832)
    with files.open():
        for rows in np.array_split(np.arange(3000), 4):
            files._keep(points.select(rows))


def test_each_strip_has_a_file_with_its_flight_line(tmp_path: Path) -> None:
    written(tmp_path, "cloud.strip_files=true", f"cloud.start_time={START}", 'cloud.formats=["laz","las"]')
    whole = laspy.read(tmp_path / "cloud.laz")
    assert whole.header.file_source_id == 0
    assert sorted(path.name for path in (tmp_path / "strips").iterdir()) == [
        "strip-001.las",
        "strip-001.laz",
        "strip-002.las",
        "strip-002.laz",
    ]
    for strip in (1, 2):
        las = laspy.read(tmp_path / "strips" / f"strip-{strip:03d}.laz")
        rows = whole.point_source_id == strip
        assert las.header.file_source_id == strip
        assert (las.point_source_id == strip).all()
        for name in ("X", "Y", "Z", "gps_time", "class_id", "instance_id", "intensity", "return_number"):
            assert np.array_equal(las[name], whole[name][rows]), name
        assert las.header.global_encoding.gps_time_type == laspy.header.GpsTimeType.STANDARD
    # Adjusted standard GPS time: 1e9 s and 18 leap seconds from UTC.
    first = datetime(1980, 1, 6, tzinfo=UTC) + timedelta(seconds=float(whole.gps_time.min()) + 1e9 - 18.0)
    assert 0.0 <= (first - datetime(2026, 5, 4, 9, 30, tzinfo=UTC)).total_seconds() < 1.0
    assert whole.gps_time.max() - whole.gps_time.min() == pytest.approx(np.ptp(make_points(3000).gps_time), abs=1e-6)


def test_without_them_nothing_changes(tmp_path: Path) -> None:
    written(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["cloud.laz"]
    las = laspy.read(tmp_path / "cloud.laz")
    assert np.array_equal(las.gps_time, make_points(3000).gps_time)
    assert las.header.global_encoding.gps_time_type == laspy.header.GpsTimeType.WEEK_TIME


@pytest.mark.parametrize("text", ["noon", "2016-12-31T23:00:00Z", "2026-13-01T00:00:00Z"])
def test_other_times_are_refused(text: str) -> None:
    with pytest.raises(InputError, match=r"cloud\.start_time"):
        load_scenario("rq31-600m", [f"cloud.start_time={text}"])


def test_gps_time_by_what_is_published() -> None:
    assert gps_seconds("2020-01-01T00:00:00Z") == gps_seconds("2020-01-01T01:00:00+01:00") == 1261872018.0
