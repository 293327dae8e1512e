"""Reading clouds for learning: shares of 16 bits, local coordinates, ground by its classes."""

from __future__ import annotations

from pathlib import Path

import laspy
import numpy as np
import pytest

from ml.data.points import ROAD_CLASSES, read_ground, read_points
from synthroads_addon.base.classes import class_scheme
from synthroads_addon.base.errors import InputError, MissingFileError
from synthroads_addon.cloud.formats.las import LasReader
from synthroads_addon.cloud.formats.registry import open_writer
from synthroads_addon.cloud.points import PointBlock

CORNER = np.array([294000.0, 5628000.0, 180.0])


def own_cloud(path: Path, labels: list[int], scale: float = 1000.0) -> Path:
    count = len(labels)
    xyz = CORNER + np.column_stack([np.arange(count) + 0.25, np.full(count, 7.5), np.full(count, 1.125)])
    zeros = np.zeros(count)
    block = PointBlock(
        xyz=xyz,
        intensity=np.linspace(0.0, 50.0, count),
        rgb=np.full((count, 3), 32768, dtype=np.uint16),
        class_id=np.array(labels, dtype=np.uint8),
        instance_id=zeros.astype(np.uint32),
        return_number=np.ones(count, dtype=np.uint8),
        number_of_returns=np.ones(count, dtype=np.uint8),
        gps_time=zeros,
        scan_angle_deg=zeros.astype(np.float32),
        strip=zeros.astype(np.uint16),
        range=zeros + 50.0,
        incidence_deg=zeros.astype(np.float32),
    )
    scheme = class_scheme("5").as_stored()
    with open_writer(path, 25832, CORNER, scale, (), scheme) as writer:
        writer.write(block)
    return path


def foreign_cloud(path: Path, codes: list[int], color: int = 40000) -> Path:
    las = laspy.create(point_format=7, file_version="1.4")
    las.header.scales, las.header.offsets = [0.001] * 3, [500.0, 600.0, 70.0]
    count = len(codes)
    las.x, las.y, las.z = np.arange(count) + 500.5, np.full(count, 600.5), np.full(count, 70.5)
    las.intensity = np.full(count, 65535, dtype=np.uint16)
    las.red = las.green = las.blue = np.full(count, color, dtype=np.uint16)
    las.classification = np.array(codes, dtype=np.uint8)
    las.write(str(path))
    return path


@pytest.mark.parametrize("ending", [".laz", ".npz"])
def test_own_cloud_is_read_in_shares_and_local_metres(tmp_path: Path, ending: str) -> None:
    cloud = read_points(own_cloud(tmp_path / f"cloud{ending}", [0, 1, 2, 3, 4, 0]))
    assert cloud.origin.tolist() == [294000.0, 5628007.0, 181.0]
    np.testing.assert_allclose(cloud.xyz[:, 0], np.arange(6) + 0.25, atol=1e-3)
    np.testing.assert_allclose(cloud.intensity, np.linspace(0.0, 50000.0, 6) / 65535.0, atol=1e-5)
    np.testing.assert_allclose(cloud.rgb, 32768 / 65535, atol=1e-5)
    assert cloud.has_color
    assert cloud.class_names[2] == "road_marking"
    assert cloud.of_class(ROAD_CLASSES).tolist() == [False, True, True, False, False, False]


def test_classes_are_chosen_by_name_over_several_blocks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(LasReader.blocks, "__defaults__", (4,))
    path = own_cloud(tmp_path / "cloud.laz", [3, 3, 3, 3, 3, 1, 0, 2, 4, 255])
    assert read_ground(path).class_id.tolist() == [1, 0, 2]
    assert read_points(path, ["vegetation"]).class_id.tolist() == [3] * 5
    with pytest.raises(InputError, match="no point of the classes pole"):
        read_points(path, ["pole"])


def test_ground_of_a_foreign_cloud(tmp_path: Path) -> None:
    assert len(read_ground(foreign_cloud(tmp_path / "ground.las", [2, 5, 6, 2, 11]))) == 3
    unsorted = read_ground(foreign_cloud(tmp_path / "unsorted.las", [0, 1, 1]))
    assert len(unsorted) == 3
    assert unsorted.intensity.tolist() == [1.0, 1.0, 1.0]
    with pytest.raises(InputError, match="at least one of the classes ground"):
        read_ground(foreign_cloud(tmp_path / "trees.las", [1, 5, 5]))


def test_colours_of_eight_bits_and_missing_ones(tmp_path: Path) -> None:
    np.testing.assert_allclose(read_points(foreign_cloud(tmp_path / "a.las", [2, 2], 51)).rgb, 0.2, atol=1e-6)
    without = read_points(foreign_cloud(tmp_path / "b.las", [2, 2], 0))
    assert not without.has_color


def test_missing_file(tmp_path: Path) -> None:
    with pytest.raises(MissingFileError, match="no such file"):
        read_points(tmp_path / "none.laz")
