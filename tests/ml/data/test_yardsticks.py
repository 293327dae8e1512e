"""Public data sets are read from a folder: samples of their formats, written by hand, come back class by class."""

from __future__ import annotations

import json
from pathlib import Path

import laspy
import numpy as np
import pytest

from ml.data.classes import IGNORED, class_names
from ml.data.sources import Source, read_tiles
from ml.data.yardsticks import load_yardstick, yardstick_names
from synthroads_addon.base.classes import class_scheme
from synthroads_addon.base.errors import InputError, MissingFileError
from synthroads_addon.base.remarks import collected_remarks

SCHEME = class_scheme("5")
XYZ = np.array([[0.0, 0.0, 0.0], [1.0, 2.0, 0.1], [2.0, 0.5, 0.2], [3.0, 1.5, 1.0], [4.0, 1.0, 2.0]])


def tiles_of(folder: Path, yardstick: str, split: str | None) -> list[tuple[list[str], np.ndarray, np.ndarray | None]]:
    """Return of each tile the names of its points' classes ("-": ignored) by x, the places, and the intensities."""
    found = []
    names = (*load_yardstick(yardstick).mapping_in(folder).targets(class_names(SCHEME)), "-")
    for tile in read_tiles(Source(path=str(folder), yardstick=yardstick, split=split), SCHEME, None):
        order = np.argsort(tile.coord[:, 0] + tile.origin[0])
        strength = None if tile.strength is None else tile.strength[order]
        found.append(([names[number] for number in tile.segment[order]], tile.coord[order] + tile.origin, strength))
    return found


def write_ply(path: Path, fields: list[tuple[str, str, np.ndarray]]) -> None:
    """Write a binary PLY file with properties (name, PLY's type, values)."""
    words = {"double": "<f8", "float": "<f4", "uchar": "u1", "int": "<i4", "uint": "<u4", "ushort": "<u2"}
    record = np.zeros(len(XYZ), dtype=[(name, words[kind]) for name, kind, _ in fields])
    for name, _, values in fields:
        record[name] = values
    head = ["ply", "format binary_little_endian 1.0", f"element vertex {len(XYZ)}"]
    head += [f"property {kind} {name}" for name, kind, _ in fields] + ["end_header", ""]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes("\n".join(head).encode() + record.tobytes())


def write_las(path: Path, numbers: list[int], shift: tuple[float, float] = (0.0, 0.0)) -> None:
    """Write a LAS file with a classification."""
    file = laspy.create(point_format=6, file_version="1.4")
    file.header.scales, file.header.offsets = [0.001] * 3, [*shift, 0.0]
    file.x, file.y, file.z = XYZ[:, 0] + shift[0], XYZ[:, 1] + shift[1], XYZ[:, 2]
    file.intensity = np.arange(5, dtype=np.uint16) * 1000
    file.classification = np.array(numbers, dtype=np.uint8)
    path.parent.mkdir(parents=True, exist_ok=True)
    file.write(path)


def test_sweeps_of_semantickitti(tmp_path: Path) -> None:
    sequence = tmp_path / "sequences/08"
    (sequence / "velodyne").mkdir(parents=True)
    (sequence / "labels").mkdir()
    points = np.column_stack([XYZ - [2.0, 1.0, 1.7], [0.2, 0.9, 0.3, 0.0, 0.4]]).astype("<f4")
    points.tofile(sequence / "velodyne/000000.bin")
    # The upper half of a label is the instance; a point without remission was not measured.
    numbers = np.array([40, 60, 48 | 7 << 16, 70, 252 | 3 << 16], dtype="<u4")
    numbers.tofile(sequence / "labels/000000.label")
    ((classes, places, strength),) = tiles_of(tmp_path, "semantickitti", "validation")
    assert classes == ["road", "road_marking", "ground", "-", "road_furniture"]
    assert places == pytest.approx(points[:, :3], abs=1e-5)
    assert strength == pytest.approx(points[:, 3], abs=2e-5)
    with pytest.raises(MissingFileError, match="holds no file like"):
        tiles_of(tmp_path, "semantickitti", "train")
    (sequence / "labels/000000.label").write_bytes(numbers[:3].tobytes())
    with pytest.raises(InputError, match="a label for each of the 5 points"):
        tiles_of(tmp_path, "semantickitti", "validation")


def test_streets_of_toronto_3d(tmp_path: Path) -> None:
    east = XYZ + [627285.0, 4841948.0, 0.0]
    axes = [(name, "double", east[:, at]) for at, name in enumerate("xyz")]
    colors = [(name, "uchar", np.full(5, 100)) for name in ("red", "green", "blue")]
    labels = ("scalar_Label", "float", np.array([1.0, 2.0, 3.0, 4.0, 7.0]))
    write_ply(tmp_path / "L002.ply", [*axes, *colors, ("scalar_Intensity", "float", np.full(5, 655.35)), labels])
    ((classes, places, strength),) = tiles_of(tmp_path, "toronto-3d", "test")
    assert classes == ["road", "road_marking", "vegetation", "-", "road_furniture"]
    assert places == pytest.approx(east, abs=1e-3)
    assert strength == pytest.approx(0.01, abs=2e-5)


def test_tiles_of_dales_and_of_ign(tmp_path: Path) -> None:
    write_las(tmp_path / "dales_las/test/5080_54400.las", [1, 2, 3, 8, 0])
    ((classes, places, _),) = tiles_of(tmp_path, "dales", "test")
    assert classes == ["ground", "vegetation", "road_furniture", "-", "-"]
    assert places == pytest.approx(XYZ, abs=1e-3)
    write_las(tmp_path / "ign/tile.laz", [2, 3, 5, 6, 1], (700_000.0, 6_600_000.0))
    ((classes, places, _),) = tiles_of(tmp_path / "ign", "ign", None)
    assert classes == ["ground", "vegetation", "vegetation", "-", "-"]


def test_streets_of_paris_and_towns_of_carla(tmp_path: Path) -> None:
    axes = [(name, "float", XYZ[:, at]) for at, name in enumerate("xyz")]
    intensity, labels = ("intensity", "uchar", np.full(5, 51)), ("semantic", "uint", np.array([7, 6, 8, 9, 1]))
    write_ply(tmp_path / "Paris/Soufflot0.ply", [*axes, intensity, labels])
    write_ply(tmp_path / "CARLA/Town1.ply", [*axes, labels])
    ((classes, _, strength),) = tiles_of(tmp_path, "paris-carla-3d", "test")
    assert classes == ["road", "road_marking", "ground", "vegetation", "-"]
    assert strength == pytest.approx(0.2, abs=1e-3)
    ((_, _, strength),) = tiles_of(tmp_path, "paris-carla-3d", "carla")
    assert strength is None


def test_streets_of_truecity_by_the_names_of_its_classes(tmp_path: Path) -> None:
    write_las(tmp_path / "real/test/block.las", [3, 1, 2, 4, 9])
    with pytest.raises(MissingFileError, match="must say which number is which class"):
        tiles_of(tmp_path, "truecity", "test")
    names = {
        "1": "RoadSurface",
        "2": "GroundSurface",
        "3": "Vehicle",
        "4": "WallSurface",
        "9": "SolitaryVegetationObject",
    }
    (tmp_path / "labels.json").write_text(json.dumps(names))
    ((classes, _, _),) = tiles_of(tmp_path, "truecity", "test")
    assert classes == ["road_furniture", "road", "ground", "-", "vegetation"]


@pytest.mark.parametrize("columns", [4, 7])
@pytest.mark.parametrize("kind", ["float32", "float64"])
@pytest.mark.parametrize(
    ("place", "split"), [("test", "test"), ("val", "validation"), ("train/datav2_0_octree_fps", "train")]
)
def test_arrays_of_truecity_as_its_repository_describes_them(
    tmp_path: Path, place: str, split: str, kind: str, columns: int
) -> None:
    (tmp_path / place).mkdir(parents=True)
    labels = np.array([0.0, 1.0, 10.0, 5.0, np.nan])
    rows = np.column_stack([XYZ, labels, np.ones((5, columns - 4))]).astype(kind)
    np.save(tmp_path / place / "block_000001.npy", rows)
    with collected_remarks() as remarks:
        ((classes, places, strength),) = tiles_of(tmp_path, "truecity", split)
    assert (classes, strength) == (["road", "ground", "vegetation", "-", "-"], None)
    assert places == pytest.approx(XYZ, abs=1e-3)
    assert any("read as 0 RoadSurface, 1 GroundSurface" in remark for remark in remarks)
    assert any("columns after the fourth" in remark for remark in remarks) == (columns > 4)


@pytest.mark.parametrize(
    "array", [np.zeros((5, 3)), np.zeros(5), np.array([["a"] * 4] * 5), np.full((5, 4), np.inf), np.array([{}] * 4)]
)
def test_arrays_that_are_no_points_are_refused(tmp_path: Path, array: np.ndarray) -> None:
    (tmp_path / "test").mkdir()
    np.save(tmp_path / "test/block.npy", array, allow_pickle=True)
    with pytest.raises(InputError, match=r"block\.npy"):
        tiles_of(tmp_path, "truecity", "test")


@pytest.mark.parametrize("kind", ["int", "ushort", "float"])
def test_tiles_of_dales_objects_whose_points_are_called_testing(tmp_path: Path, kind: str) -> None:
    axes = [(name, "double", XYZ[:, at]) for at, name in enumerate("xyz")]
    fields = [("intensity", kind, np.full(5, 6553.5)), ("sem_class", "uchar", np.array([1, 2, 3, 5, 0]))]
    write_ply(tmp_path / "test/5080_54400_new.ply", [*axes, *fields, ("ins_class", "int", np.arange(5))])
    text = (tmp_path / "test/5080_54400_new.ply").read_bytes().replace(b"element vertex", b"element testing")
    (tmp_path / "test/5080_54400_new.ply").write_bytes(text)
    ((classes, places, strength),) = tiles_of(tmp_path, "dales-objects", "test")
    assert classes == ["ground", "vegetation", "road_furniture", "-", "-"]
    assert places == pytest.approx(XYZ, abs=1e-3)
    assert strength == pytest.approx(0.1, abs=2e-5)


@pytest.mark.parametrize("name", yardstick_names())
def test_every_yardstick_maps_to_classes_there_are(name: str) -> None:
    yardstick = load_yardstick(name)
    if not yardstick.names:
        yardstick.mapping.targets(class_names(SCHEME))
    assert set(yardstick.mapping.classes.values()) <= {*class_names(SCHEME), *yardstick.mapping.groups}
    assert IGNORED not in yardstick.mapping.classes
    with pytest.raises(InputError, match="must be one of"):
        yardstick.files(Path(), "no-such-split")
