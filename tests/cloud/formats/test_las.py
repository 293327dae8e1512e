"""LAZ files keep every attribute, say what they are, and never appear half-written."""

import json
import struct
import tracemalloc
from contextlib import ExitStack
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import laspy
import numpy as np
import pytest

from synthroads_addon.base.classes import classes, las_codes
from synthroads_addon.base.errors import InputError, OutputError
from synthroads_addon.cloud.formats.las import LasWriter
from synthroads_addon.cloud.formats.registry import open_cloud
from synthroads_addon.cloud.layers import ATTRIBUTES, LAYERS, columns
from synthroads_addon.cloud.points import concatenate
from tests.helpers.clouds.cloud_points import with_every_attribute
from tests.judges import require

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


def test_many_open_files_of_few_points_take_little_memory(tmp_path: Path, points) -> None:
    """As tiles are: a full buffer for each would be 18 MB."""
    few = points.select(slice(0, 10))
    tracemalloc.start()
    with ExitStack() as stack:
        for number in range(40):
            path = tmp_path / f"{number}.laz"
            stack.enter_context(LasWriter(path, 25832, ORIGIN, SCALE)).write(few)
        most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most < 40 * 500_000


def test_too_bright_points_are_clipped_and_counted(tmp_path: Path, points) -> None:
    bright = replace(points, intensity=np.where(np.arange(len(points)) < 7, 1.0, points.intensity))
    assert write(tmp_path / "cloud.laz", bright).clipped == 7
    assert laspy.read(tmp_path / "cloud.laz").intensity[:7].tolist() == [65535] * 7


def test_empty_cloud_is_a_valid_file(tmp_path: Path, points) -> None:
    write(tmp_path / "cloud.laz", points.select(np.zeros(len(points), dtype=bool)))
    las = laspy.read(tmp_path / "cloud.laz")
    assert len(las) == 0
    assert las.header.mins.tolist() == las.header.maxs.tolist() == [0.0, 0.0, 0.0]  # no bounds


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
    assert all(row.las in (2, 5, 11, 17) or 64 <= row.las <= 255 for row in rows)


def raw_header(path: Path) -> dict[str, Any]:
    """Return the public header block's fields (LAS 1.4 R15, table 3) and the VLRs, read byte by byte."""
    data = path.read_bytes()
    names = ["day", "year", "header_size", "offset_to_points", "vlrs", "format", "record_length"]
    fields = dict(zip(names, struct.unpack_from("<HHHIIBH", data, 90), strict=True))
    fields |= {"signature": data[:4], "encoding": struct.unpack_from("<H", data, 6)[0], "version": tuple(data[24:26])}
    fields["legacy"] = struct.unpack_from("<6I", data, 107)
    fields["scale"], fields["offset"] = (np.array(struct.unpack_from("<3d", data, at)) for at in (131, 155))
    bounds = struct.unpack_from("<6d", data, 179)
    fields["max"], fields["min"] = np.array(bounds[::2]), np.array(bounds[1::2])
    fields["waveform"], fields["evlr_start"], fields["evlrs"], fields["count"] = struct.unpack_from("<QQIQ", data, 227)
    fields["by_return"] = np.array(struct.unpack_from("<15Q", data, 255))
    at, records = fields["header_size"], []
    for _ in range(fields["vlrs"]):
        reserved, user, number, length = struct.unpack_from("<H16sHH", data, at)
        assert reserved == 0
        records.append((user.rstrip(b"\0").decode(), number, data[at + 54 : at + 54 + length]))
        at += 54 + length
    assert at == fields["offset_to_points"]
    return fields | {"records": records}


@pytest.mark.parametrize("name", ["cloud.laz", "cloud.las"])
def test_header_keeps_the_rules_of_las_14(tmp_path: Path, points, name: str) -> None:
    block = with_every_attribute(points)
    with LasWriter(tmp_path / name, 25832, ORIGIN, SCALE, ATTRIBUTES) as writer:
        writer.write(block)
    head = raw_header(tmp_path / name)
    assert (head["signature"], head["version"], head["header_size"]) == (b"LASF", (1, 4), 375)
    assert head["encoding"] == 0b10000  # WKT, and nothing else
    assert head["format"] == (7 | 128 if name.endswith("laz") else 7)
    assert head["legacy"] == (0,) * 6
    assert (head["waveform"], head["evlr_start"], head["evlrs"]) == (0, 0, 0)
    assert (head["count"], head["by_return"].sum()) == (len(block), len(block))
    np.testing.assert_array_equal(head["by_return"], np.bincount(block.return_number, minlength=16)[1:])
    steps = np.rint((block.xyz - head["offset"]) / head["scale"])
    np.testing.assert_array_equal(head["min"], steps.min(axis=0) * head["scale"] + head["offset"])
    np.testing.assert_array_equal(head["max"], steps.max(axis=0) * head["scale"] + head["offset"])
    records = {(user, number): data for user, number, data in head["records"]}
    assert len(records) == len(head["records"])
    assert records["LASF_Projection", 2112].startswith(b"PROJCS[")
    assert records["LASF_Projection", 2112].endswith(b"]\0")
    assert ("laszip encoded", 22204) in records or name.endswith("las")
    _check_extra_bytes(records["LASF_Spec", 4], head)


def _check_extra_bytes(data: bytes, head: dict[str, Any]) -> None:
    """Check the record of extra bytes (LAS 1.4 R15, table 24) against the table of columns."""
    expected = columns(ATTRIBUTES)
    assert len(data) == 192 * len(expected)
    sizes = {1: 1, 3: 2, 4: 2, 5: 4, 6: 4}
    total = 0
    for at, column in zip(range(0, len(data), 192), expected, strict=True):
        reserved, kind, options, name = struct.unpack_from("<HBB32s", data, at)
        assert (reserved, name.rstrip(b"\0").decode()) == (0, column.name)
        assert options == (0 if column.whole else 0b11000)  # scale and offset are relevant; nothing else is set
        assert data[at + 36 : at + 40] == bytes(4)
        if not column.whole:
            assert struct.unpack_from("<d", data, at + 112)[0] == column.scale
            shift = head["offset"][column.component] if column.local else 0.0
            assert struct.unpack_from("<d", data, at + 136)[0] == shift
        assert data[at + 160 : at + 192].rstrip(b"\0").decode() == column.description
        total += sizes[kind]
    assert head["record_length"] == 36 + total


def test_an_independent_reader_reads_every_attribute(tmp_path: Path, points) -> None:
    """LASzip's own code, which has nothing in common with the writer's."""
    require("laszip")
    block = with_every_attribute(points)
    with LasWriter(tmp_path / "cloud.laz", 25832, ORIGIN, SCALE, ATTRIBUTES) as writer:
        writer.write(block)
    with laspy.open(tmp_path / "cloud.laz", laz_backend=laspy.LazBackend.Laszip) as reader:
        las = reader.read()
    names = list(las.point_format.extra_dimension_names)
    assert names == [column.name for column in columns(ATTRIBUTES)]
    assert np.abs(las.xyz - block.xyz).max() <= 0.0005 + 1e-9
    np.testing.assert_array_equal(las.gps_time, block.gps_time)
    for attribute in ATTRIBUTES:
        for column in LAYERS[attribute].columns:
            error = np.abs(np.asarray(las[column.name]) - column.values(block)).max()
            rounding = 8e-6  # of angles in single precision
            assert error <= (0 if column.whole else column.scale / 2 + rounding), column.name


def test_many_blocks_of_odd_sizes_fill_whole_chunks(tmp_path: Path) -> None:
    """The buffer is flushed in the middle of blocks; the file is the same as from one block."""
    from tests.helpers.clouds.random_points import make_points

    block = make_points(130_001)
    write(tmp_path / "one.las", block)
    bounds = [0, 1, 32_768, 32_769, 99_000, 130_001]
    write(tmp_path / "many.las", *(block.select(slice(a, b)) for a, b in pairwise(bounds)))
    assert (tmp_path / "one.las").read_bytes() == (tmp_path / "many.las").read_bytes()


def test_more_points_than_the_buffer_holds(tmp_path: Path, monkeypatch) -> None:
    from synthroads_addon.cloud.formats import las as las_module
    from tests.helpers.clouds.random_points import make_points

    block = make_points(5_000)
    write(tmp_path / "large.laz", block)
    monkeypatch.setattr(las_module, "_BUFFER", 999)
    monkeypatch.setattr(las_module, "_SLICE", 100)
    write(tmp_path / "small.laz", block)
    assert (tmp_path / "large.laz").read_bytes() == (tmp_path / "small.laz").read_bytes()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"class_id": np.full(10, 300)}, "class_id must lie from 0 to 255"),
        ({"class_id": np.full(10, -1)}, "class_id must lie from 0 to 255"),
        ({"return_number": np.full(10, 16, dtype=np.uint8)}, "at most 15"),
        ({"scan_angle_deg": np.full(10, 181.0)}, "scan_angle is at most 180"),
        ({"scan_angle_deg": np.full(10, 1e6)}, "scan_angle must lie from"),
        ({"intensity": np.full(10, np.nan)}, "intensity must not be negative or NaN"),
        ({"intensity": np.full(10, -1e-6)}, "intensity must not be negative or NaN"),
        ({"gps_time": np.full(10, np.nan)}, "gps_time must be finite"),
        ({"range": np.full(10, np.nan)}, "range must lie from"),
        ({"range": np.full(10, 1e6)}, "range must lie from 0 to 429497"),
        ({"xyz": np.full((10, 3), np.nan)}, "within 2147 km"),
        ({"strip": np.full(10, 70_000)}, "strip must lie from 0 to 65535"),
        ({"rgb": np.full((10, 3), 65_536)}, "rgb must lie from 0 to 65535"),
    ],
    ids=lambda value: value if isinstance(value, str) else "-".join(value),
)
def test_what_does_not_fit_is_refused_by_name(tmp_path: Path, points, change, message: str) -> None:
    bad = replace(points.select(slice(0, 10)), **change)
    with pytest.raises(OutputError, match=message):
        write(tmp_path / "cloud.laz", bad)
    assert list(tmp_path.iterdir()) == []


def test_attribute_that_the_points_lack_is_refused(tmp_path: Path, points) -> None:
    with (
        pytest.raises(OutputError, match="normal"),
        LasWriter(tmp_path / "cloud.laz", None, ORIGIN, SCALE, ("normal",)) as writer,
    ):
        writer.write(points)
    assert list(tmp_path.iterdir()) == []


def test_a_scale_may_be_negative(tmp_path: Path) -> None:
    """Nothing in LAS 1.4 forbids it; none may be 0, which would put all points in one place."""
    las = laspy.create(point_format=7, file_version="1.4")
    las.header.scales, las.header.offsets = [-0.001, 0.001, 0.001], ORIGIN
    las.xyz = ORIGIN + np.array([[1.5, 2.0, 3.0], [-4.25, 5.0, 6.0]])
    las.write(tmp_path / "cloud.las")
    with open_cloud(tmp_path / "cloud.las") as cloud:
        (block,) = cloud.blocks()
    assert np.abs(block.xyz - las.xyz).max() < 1e-9
    data = bytearray((tmp_path / "cloud.las").read_bytes())
    data[131:139] = struct.pack("<d", 0.0)
    (tmp_path / "cloud.las").write_bytes(data)
    with pytest.raises(InputError, match="the scales not 0"):
        open_cloud(tmp_path / "cloud.las")
