"""PCD: what other programs write and read."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from synthroads_addon.base.errors import InputError, OutputError
from synthroads_addon.cloud.formats.registry import open_cloud, open_writer
from synthroads_addon.cloud.points import PointBlock, concatenate
from tests.helpers.clouds.random_points import make_points

ORIGIN = (294_000.0, 5_628_000.0, 180.0)


def read(path: Path) -> PointBlock:
    with open_cloud(path) as cloud:
        return concatenate(list(cloud.blocks()))


def pcd_file(path: Path, fields: list[tuple[str, str, int, int]], data: bytes, points: int, **entries: str) -> Path:
    """Write a PCD file of fields (name, letter, size, count) as other programs do, and return its path."""
    lines = {
        "VERSION": "0.7",
        "FIELDS": " ".join(name for name, *_ in fields),
        "SIZE": " ".join(str(size) for *_, size, _ in fields),
        "TYPE": " ".join(letter for _, letter, *_ in fields),
        "COUNT": " ".join(str(count) for *_, count in fields),
        "WIDTH": str(points),
        "HEIGHT": "1",
        "VIEWPOINT": "0 0 0 1 0 0 0",
        "POINTS": str(points),
        "DATA": "binary",
    } | entries
    text = "# .PCD v0.7\n" + "".join(f"{name} {value}\n" for name, value in lines.items() if value)
    path.write_bytes(text.encode() + data)
    return path


XYZ = [("x", "F", 4, 1), ("y", "F", 4, 1), ("z", "F", 4, 1)]


def test_coordinates_are_single_and_the_offset_is_told_to_people(tmp_path: Path) -> None:
    points = make_points(500)
    with open_writer(tmp_path / "a.pcd", 25832, np.array(ORIGIN), 1.0) as writer:
        writer.write(points)
    head = (tmp_path / "a.pcd").read_bytes()[:4000].decode("ascii", errors="replace")
    assert "# map coordinates: x + 294000, y + 5628000, z + 180\n" in head
    assert "\nSIZE 4 4 4 4 4 1 1 8 4 2 1 4 8 4\nTYPE F F F U F U U F F U U U F F\n" in head
    assert np.abs(read(tmp_path / "a.pcd").xyz - points.xyz).max() < 5e-4


def test_a_coordinate_that_single_precision_would_move_is_refused(tmp_path: Path) -> None:
    points = make_points(5)
    far = replace(points, xyz=np.array(ORIGIN) + np.array([0.0, 16_385.0, 0.0]) + np.zeros((5, 3)))
    with (
        pytest.raises(OutputError, match=r"is 16385\.0: y must lie within 16384 m of the offset.*use \.laz or \.ply"),
        open_writer(tmp_path / "a.pcd", 25832, np.array(ORIGIN), 1.0) as writer,
    ):
        writer.write(far)
    assert list(tmp_path.iterdir()) == []


def test_organised_cloud_with_missing_points_packed_colours_and_padding(tmp_path: Path) -> None:
    kind = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("_", "u1", (4,)), ("rgb", "<f4"), ("label", "<u4")])
    data = np.zeros(6, dtype=kind)
    data["x"], data["y"], data["z"] = np.arange(6), 1.0, [2.0, np.nan, 2.0, 2.0, 2.0, np.nan]
    data["rgb"] = np.array([0x102030] * 6, dtype="<u4").view("<f4")
    data["label"] = 2
    fields = [*XYZ, ("_", "U", 1, 4), ("rgb", "F", 4, 1), ("label", "U", 4, 1)]
    path = pcd_file(tmp_path / "a.pcd", fields, data.tobytes(), 6, WIDTH="3", HEIGHT="2", POINTS="")
    found = read(path)
    assert found.xyz[:, 0].tolist() == [0.0, 2.0, 3.0, 4.0]
    assert (found.rgb >> 8).tolist() == [[0x10, 0x20, 0x30]] * 4
    assert found.class_id.tolist() == [2] * 4


def test_text_is_read_in_parts(tmp_path: Path) -> None:
    fields = [*XYZ, ("intensity", "F", 4, 1), ("rgba", "U", 4, 1)]
    rows = "".join(f"{n} {n + 0.5} -1e1 {n * 2} {0xFF0000 + n}\n" for n in range(10)).encode()
    path = pcd_file(tmp_path / "a.pcd", fields, rows, 10, DATA="ascii")
    with open_cloud(path) as cloud:
        blocks = list(cloud.blocks(4))
    assert [len(block) for block in blocks] == [4, 4, 2]
    found = concatenate(blocks)
    assert found.xyz[3].tolist() == [3.0, 3.5, -10.0]
    assert found.intensity.tolist() == [2.0 * n for n in range(10)]
    assert (found.rgb[7] >> 8).tolist() == [255, 0, 7]


@pytest.mark.parametrize(
    ("data", "entries", "message"),
    [
        (b"", {"DATA": "binary_compressed"}, r"DATA is 'binary_compressed': must be binary or ascii \(pcl_convert"),
        (b"\0" * 23, {}, r"truncated or damaged after 1 of 2 points"),
        (b"1 2 3\n1 2\n", {"DATA": "ascii"}, r"truncated or damaged after 0 of 2 points"),
        (b"1 2 3\n1 zwei 3\n", {"DATA": "ascii"}, r"truncated or damaged after 0 of 2 points"),
        (b"\0" * 24, {"SIZE": "4 4 3"}, r"field z is 'F 3 1': must be a type F, U or I"),
        (b"\0" * 24, {"SIZE": "4 4"}, r"FIELDS, SIZE, TYPE and COUNT differ in length"),
        (b"\0" * 24, {"POINTS": "-2"}, r"POINTS is '-2': must be a whole number"),
        (b"\0" * 24, {"FIELDS": "a b c"}, r"has no x, y, z"),
        (b"\0" * 24, {"VERSION": "0.7\nHEIGTH 1"}, r"is not a PCD file"),
        (b"\0" * 24, {"TYPE": ""}, r"is a PCD file without TYPE"),
        (b"\0" * 24, {"COUNT": "1 1 0"}, r"COUNT of z is '0': must be from 1"),
    ],
)
def test_broken_files_are_refused_in_one_line(tmp_path: Path, data: bytes, entries: dict[str, str], message) -> None:
    path = pcd_file(tmp_path / "a.pcd", XYZ, data, 2, **entries)
    with pytest.raises(InputError, match=message):
        read(path)


def test_numbers_of_text_beyond_their_field_are_no_numbers_of_it(tmp_path: Path) -> None:
    path = pcd_file(tmp_path / "a.pcd", [*XYZ, ("label", "U", 1, 1)], b"1 2 3 256\n", 1, DATA="ascii")
    with pytest.raises(InputError, match=r"damaged after 0 of 1 points"):
        read(path)
