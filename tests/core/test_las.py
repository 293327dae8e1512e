"""LAZ files keep every attribute, say what they are, and never appear half-written."""

import json
from dataclasses import replace
from pathlib import Path

import laspy
import numpy as np
import pytest

from synthroads_addon.core.cloud.labels import classes, las_codes
from synthroads_addon.core.cloud.las import LasWriter
from synthroads_addon.core.cloud.points import concatenate
from synthroads_addon.core.errors import InputError, OutputError

SCALE = 65535 * 900.0
ORIGIN = np.array([294_000.0, 5_628_000.0, 180.0])


def write(path: Path, *blocks, epsg=25832) -> LasWriter:
    with LasWriter(path, epsg, ORIGIN, SCALE) as writer:
        for block in blocks:
            writer.write(block)
    return writer


@pytest.mark.parametrize("name", ["cloud.laz", "cloud.las"])
def test_round_trip(tmp_path: Path, points, name: str) -> None:
    write(tmp_path / name, points)
    las = laspy.read(tmp_path / name)
    assert (las.header.version.major, las.header.version.minor, las.header.point_format.id) == (1, 4, 7)
    assert las.header.global_encoding.wkt
    assert "ETRS89 / UTM zone 32N" in las.header.vlrs.get("WktCoordinateSystemVlr")[0].string
    assert np.abs(las.xyz - points.xyz).max() <= 0.0005 + 1e-9  # rounded, not truncated
    np.testing.assert_array_equal(las.class_id, points.class_id)
    np.testing.assert_array_equal(las.classification, las_codes()[points.class_id])
    np.testing.assert_array_equal(las.instance_id, points.instance_id)
    np.testing.assert_array_equal(las.return_number, points.return_number)
    np.testing.assert_array_equal(las.number_of_returns, points.number_of_returns)
    np.testing.assert_array_equal(las.point_source_id, points.strip + 1)
    np.testing.assert_array_equal(las.gps_time, points.gps_time)
    np.testing.assert_array_equal(np.stack([las.red, las.green, las.blue], axis=1), points.rgb)
    np.testing.assert_array_equal(las.intensity, np.rint(points.intensity * SCALE))
    assert np.abs(las["range"] - points.range).max() <= 0.00005 + 1e-9
    assert np.abs(las["incidence"] - points.incidence_deg).max() <= 0.005 + 1e-4
    assert np.abs(las.scan_angle * 0.006 - points.scan_angle_deg).max() <= 0.003 + 1e-4
    notes = next(v for v in las.header.vlrs if v.user_id == "SynthRoads")
    assert json.loads(notes.record_data_bytes())["intensity_scale"] == SCALE


def test_blocks_make_the_same_file_as_one(tmp_path: Path, points) -> None:
    half = np.arange(len(points)) < 4321
    write(tmp_path / "one.laz", points)
    write(tmp_path / "two.laz", points.select(half), points.select(~half))
    assert (tmp_path / "one.laz").read_bytes() == (tmp_path / "two.laz").read_bytes()
    assert len(concatenate([points.select(half), points.select(~half)])) == len(points)


def test_too_bright_points_are_clipped_and_counted(tmp_path: Path, points) -> None:
    bright = replace(points, intensity=np.where(np.arange(len(points)) < 7, 1.0, points.intensity))
    assert write(tmp_path / "cloud.laz", bright).clipped == 7
    assert laspy.read(tmp_path / "cloud.laz").intensity[:7].tolist() == [65535] * 7


def test_empty_cloud_is_a_valid_file(tmp_path: Path, points) -> None:
    write(tmp_path / "cloud.laz", points.select(np.zeros(len(points), dtype=bool)))
    assert len(laspy.read(tmp_path / "cloud.laz")) == 0


def test_overflow_is_refused_and_nothing_is_left(tmp_path: Path, points) -> None:
    far = replace(points, xyz=points.xyz + [0.0, 3e6, 0.0])
    with pytest.raises(OutputError, match="2147 km"):
        write(tmp_path / "cloud.laz", far)
    assert list(tmp_path.iterdir()) == []


def test_interrupted_writing_leaves_nothing(tmp_path: Path, points) -> None:
    def stopped() -> None:
        with LasWriter(tmp_path / "cloud.laz", None, ORIGIN, SCALE) as writer:
            writer.write(points)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        stopped()
    assert list(tmp_path.iterdir()) == []


def test_same_points_give_the_same_bytes(tmp_path: Path, points) -> None:
    write(tmp_path / "a.laz", points)
    write(tmp_path / "b.laz", points)
    assert (tmp_path / "a.laz").read_bytes() == (tmp_path / "b.laz").read_bytes()


def test_unknown_coordinate_system_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="epsg is 99999"):
        LasWriter(tmp_path / "cloud.laz", 99999, ORIGIN, SCALE)


def test_class_table_is_complete() -> None:
    rows = classes()
    assert [row.id for row in rows] == list(range(17))
    assert len({row.las for row in rows}) == 17
    assert {row.five for row in rows} == {"ground", "road", "road_marking", "vegetation", "road_furniture"}
    assert all(row.las in (2, 5, 11, 17) or 64 <= row.las <= 255 for row in rows)
