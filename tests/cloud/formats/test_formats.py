"""Every format keeps what it is given, streams, and is refused in one line where it is broken."""

from __future__ import annotations

import resource
import zipfile
from contextlib import suppress
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import laspy
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from synthroads_addon.base.classes import class_scheme
from synthroads_addon.base.errors import InputError, MissingFileError, OutputError
from synthroads_addon.cloud.formats.registry import ENDINGS, open_cloud, open_writer
from synthroads_addon.cloud.formats.writer import CloudWriter
from synthroads_addon.cloud.layers import ATTRIBUTES, DEFAULT_ATTRIBUTES, LAYERS, layer_arrays
from synthroads_addon.cloud.points import PointBlock, concatenate
from synthroads_addon.cloud.tools.convert import convert
from tests.helpers.clouds.cloud_points import with_every_attribute
from tests.helpers.clouds.random_points import make_points
from tests.judges import require

SCALE = 65535 * 900.0
ORIGIN = np.array([294_000.5, 5_628_000.0, 180.0])
# Largest error of each array: half a step where a format stores whole steps, single precision else.
STEPS = {
    ".las": {"xyz": 5e-4, "intensity": 0.5 / SCALE, "scan_angle_deg": 0.003, "range": 5e-5, "incidence_deg": 5e-3},
    ".ply": {"intensity": 1e-10, "rgb": 255},
    ".e57": {"xyz": 5e-5, "intensity": 1e-10, "rgb": 255, "range": 5e-5, "incidence_deg": 5e-3},
    ".pcd": {"xyz": 5e-4, "intensity": 1e-10, "rgb": 255},
    ".npz": {},
}
STEPPED = {
    **dict.fromkeys(("normal", "roughness", "metallic", "specular", "true_range", "true_xyz"), 5e-5),
    "scanner": 5e-4,
}
STEPS[".las"] |= STEPPED
STEPS[".e57"] |= STEPPED
STEPS[".laz"] = STEPS[".copc.laz"] = STEPS[".las"]
ROUNDING = 8e-6
"""Of angles and normals in single precision."""


@pytest.fixture(params=ENDINGS)
def ending(request) -> str:
    if request.param == ".e57":
        require("pye57")
    return request.param


def write(path: Path, *blocks: PointBlock, attributes=ATTRIBUTES, epsg: int | None = 25832, **more) -> CloudWriter:
    with open_writer(path, epsg, ORIGIN, SCALE, attributes, **more) as writer:
        for block in blocks:
            writer.write(block)
    return writer


def read(path: Path, size: int = 3_000) -> PointBlock:
    with open_cloud(path) as cloud:
        return concatenate(list(cloud.blocks(size)))


def assert_kept(found: PointBlock, given: PointBlock, ending: str, arrays: set[str] | None = None) -> None:
    assert len(found) == len(given)
    for name in arrays or set(given.attributes()):
        have, want = found.array(name), given.array(name)
        assert have.dtype == want.dtype, name
        error = np.abs(have.astype(np.float64) - want.astype(np.float64)).max() if want.size else 0.0
        step = STEPS[ending].get(name, 0.0)
        assert error <= step + (ROUNDING if step and name != "intensity" else 0.0), name


def test_round_trip_of_every_attribute(tmp_path: Path, points, ending: str) -> None:
    given_points = with_every_attribute(points)
    write(tmp_path / f"cloud{ending}", given_points)
    with open_cloud(tmp_path / f"cloud{ending}") as cloud:
        header = cloud.header
        assert (header.count, header.epsg, header.labelled, header.has_color) == (len(points), 25832, True, True)
        assert (header.intensity_scale, header.attributes, header.left_out) == (SCALE, ATTRIBUTES, ())
        assert header.scheme.rows == class_scheme("17").rows
        found = concatenate(list(cloud.blocks(3_000)))
        again = concatenate(list(cloud.blocks(9_999)))  # a reader can be run through more than once
    assert_kept(found, given_points, ending)
    for name, array in found.attributes().items():
        np.testing.assert_array_equal(again.array(name), array)


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    data=st.data(),
    count=st.integers(1, 60),
    wanted=st.sets(st.sampled_from(ATTRIBUTES)),
    cuts=st.lists(st.integers(0, 60), max_size=3),
    seed=st.integers(0, 2**32 - 1),
)
def test_any_points_in_any_blocks_round_trip(tmp_path: Path, data, count, wanted, cuts, seed) -> None:
    """Extremes included: empty blocks, no range, zero and full values, returns 0 to 15, unlabelled points."""
    suffix = data.draw(st.sampled_from(ENDINGS))
    if suffix == ".e57":
        require("pye57")
    rng = np.random.default_rng(seed)
    block = with_every_attribute(make_points(count, seed), seed)
    smallest = 1 if suffix == ".e57" else 0  # E57 counts returns from 0
    farthest = (-16_000.0, 16_000.0) if suffix == ".pcd" else (-99_999.0, 2e5)  # single precision
    block = replace(
        block,
        class_id=rng.choice(np.array([0, 5, 16, 254, 255], dtype=np.uint8), count),
        strip=rng.choice(np.array([0, 1, 65_534, 65_535], dtype=np.uint16), count),
        return_number=rng.integers(smallest, 16, count).astype(np.uint8),
        number_of_returns=rng.integers(0, 16, count).astype(np.uint8),
        intensity=rng.choice([0.0, 65535 / SCALE, 1e-6], count),
        range=rng.choice([0.0, 1e-4, 429_496.0], count),
        xyz=ORIGIN + rng.choice([0.0, 0.0005, *farthest, 1e-9], (count, 3)),
        scan_angle_deg=rng.choice(np.array([-180, 0, 180], dtype=np.float32), count),
    )
    block = replace(block, true_xyz=block.xyz, scanner=block.xyz)
    edges = sorted({0, count, *(min(cut, count) for cut in cuts)})
    parts = [block.select(slice(a, b)) for a, b in pairwise(edges)]
    path = tmp_path / f"cloud{suffix}"
    write(path, block.select(slice(0, 0)), *parts, attributes=tuple(wanted))
    arrays = {c.array for name in wanted for c in LAYERS[name].columns} | {
        *("xyz", "intensity", "rgb", "class_id", "instance_id", "return_number", "number_of_returns", "gps_time"),
        *("scan_angle_deg", "strip"),
    }
    found = read(path, size=data.draw(st.integers(1, 70)))
    assert_kept(found, block, suffix, arrays)
    missing = {"range": "range", "incidence": "incidence_deg"}
    assert all(np.isnan(getattr(found, array)).all() for name, array in missing.items() if name not in wanted)


def test_blocks_make_the_same_file_as_one(tmp_path: Path, points, ending: str) -> None:
    block = with_every_attribute(points)
    write(tmp_path / f"one{ending}", block)
    write(tmp_path / f"two{ending}", block.select(slice(0, 4321)), block.select(slice(4321, None)))
    assert (tmp_path / f"one{ending}").read_bytes() == (tmp_path / f"two{ending}").read_bytes()


def test_only_what_is_asked_for_is_stored(tmp_path: Path, points, ending: str) -> None:
    """And only the arrays that it needs have to be there."""
    bare = replace(points, range=np.full(len(points), np.nan), incidence_deg=np.full(len(points), np.nan, np.float32))
    write(tmp_path / f"bare{ending}", bare, attributes=())
    write(tmp_path / f"full{ending}", with_every_attribute(points))
    assert (tmp_path / f"bare{ending}").stat().st_size < 0.75 * (tmp_path / f"full{ending}").stat().st_size
    with open_cloud(tmp_path / f"bare{ending}") as cloud:
        assert cloud.header.attributes == ()
        assert next(cloud.blocks()).normal is None


def test_needs_names_arrays_of_points() -> None:
    assert set(LAYERS["noise_free"].types) == {"true_range", "true_xyz"}
    assert set(LAYERS["normal"].types) == {"normal"}
    assert set().union(*(layer.types for layer in LAYERS.values())) == set(layer_arrays())


def test_empty_cloud(tmp_path: Path, points, ending: str) -> None:
    write(tmp_path / f"cloud{ending}", points.select(slice(0, 0)), attributes=DEFAULT_ATTRIBUTES)
    with open_cloud(tmp_path / f"cloud{ending}") as cloud:
        assert cloud.header.count == 0
        assert list(cloud.blocks()) == []


def test_an_empty_block_needs_none_of_what_is_written_of_points(tmp_path: Path, points, ending: str) -> None:
    assert points.normal is None
    write(tmp_path / f"cloud{ending}", points.select(slice(0, 0)), attributes=("normal",))
    with open_cloud(tmp_path / f"cloud{ending}") as cloud:
        assert cloud.header.count == 0


def test_stopped_writing_leaves_nothing_and_spares_the_old_file(tmp_path: Path, points, ending: str) -> None:
    path = tmp_path / f"cloud{ending}"
    write(path, points, attributes=DEFAULT_ATTRIBUTES)
    old = path.read_bytes()

    def stopped() -> None:
        with open_writer(path, None, ORIGIN, SCALE) as writer:
            writer.write(points)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        stopped()
    assert [entry.name for entry in tmp_path.iterdir()] == [path.name]
    assert path.read_bytes() == old


def test_full_disk_is_one_error_and_leaves_nothing(tmp_path: Path, points, ending: str) -> None:
    many = concatenate([with_every_attribute(points)] * 8)
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, limits[1]))
    try:
        with pytest.raises(OutputError, match="cannot be written"):
            write(tmp_path / f"cloud{ending}", many)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert list(tmp_path.iterdir()) == []


def test_folders_that_are_not_there_are_made(tmp_path: Path, ending: str) -> None:
    path = tmp_path / "new" / "folder" / f"cloud{ending}"
    write(path)
    assert [*path.parent.iterdir()] == [path]


def test_a_file_in_the_place_of_the_folder_is_said(tmp_path: Path, ending: str) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(OutputError):
        write(tmp_path / "file" / f"cloud{ending}")


def test_not_a_number_is_refused(tmp_path: Path, points, ending: str) -> None:
    for name in ("xyz", "gps_time", "intensity", "range", "true_xyz"):
        block = with_every_attribute(points.select(slice(0, 100)))
        array = getattr(block, name).copy()
        array[50] = np.nan
        with pytest.raises(OutputError):
            write(tmp_path / f"cloud{ending}", replace(block, **{name: array}))
    assert list(tmp_path.iterdir()) == []


def test_a_number_beyond_the_fields_precision_is_kept_or_refused(tmp_path: Path, points, ending: str) -> None:
    """Single precision would make infinity of it, and the file couldn't be read again."""
    path = tmp_path / f"cloud{ending}"
    odd = replace(points, intensity=np.where(np.arange(len(points)) == 7, 1e300, points.intensity))
    if ending in (".ply", ".pcd", ".e57"):
        with pytest.raises(OutputError, match=r"is 1e\+300: intensity must be at most 3\.4e\+38, as the"):
            write(path, odd, attributes=())
        assert list(tmp_path.iterdir()) == []
        return
    writer = write(path, odd, attributes=())
    assert writer.clipped == (ending in (".las", ".laz", ".copc.laz"))
    assert ending != ".npz" or read(path).intensity[7] == 1e300


def test_truncated_files_are_refused(tmp_path: Path, points, ending: str) -> None:
    path = tmp_path / f"cloud{ending}"
    write(path, points, attributes=DEFAULT_ATTRIBUTES)
    data = path.read_bytes()
    for share in (0.001, 0.01, 0.3, 0.7, 0.999):
        path.write_bytes(data[: int(len(data) * share)])
        with pytest.raises(InputError, match=f"cloud{ending}"):
            open_cloud(path)  # before any point is read


def test_number_of_records_that_cannot_be(tmp_path: Path, points) -> None:
    """Four thousand million records in a header are refused at once, not looked for one by one."""
    path = tmp_path / "cloud.las"
    write(path, points, attributes=())
    data = bytearray(path.read_bytes())
    data[100:104] = bytes([255] * 4)
    path.write_bytes(data)
    with pytest.raises(InputError, match="its header is damaged"):
        open_cloud(path)


def test_what_is_no_cloud_is_refused(tmp_path: Path, ending: str) -> None:
    path = tmp_path / f"cloud{ending}"
    with pytest.raises(MissingFileError, match="no such file"):
        open_cloud(path)
    for content in (b"", b"not a cloud at all", bytes(10_000), b"LASF" + bytes(500), b"ply\n" + bytes(500)):
        path.write_bytes(content)
        with pytest.raises(InputError, match=f"cloud{ending}"):
            read(path)


@pytest.mark.parametrize("seed", range(12))
def test_damaged_files_never_end_in_a_traceback(tmp_path: Path, points, ending: str, seed: int) -> None:
    """Flipped bytes give points or one line, not another exception."""
    path = tmp_path / f"cloud{ending}"
    write(path, points.select(slice(0, 2_000)), attributes=DEFAULT_ATTRIBUTES)
    data = np.frombuffer(path.read_bytes(), dtype=np.uint8).copy()
    rng = np.random.default_rng(seed)
    reach = 3_000 if seed % 2 else len(data)
    data[rng.integers(0, min(reach, len(data)), 20)] ^= rng.integers(1, 256, 20).astype(np.uint8)
    path.write_bytes(data.tobytes())
    with suppress(InputError):
        read(path)


def test_unknown_ending(tmp_path: Path) -> None:
    with pytest.raises(
        InputError, match=r"must end in \.laz, \.las, \.copc\.laz, \.ply, \.pcd, \.e57, \.npz \(did you mean"
    ):
        open_cloud(tmp_path / "cloud.lax")
    with pytest.raises(InputError, match=r"must end in \.laz, \.las, \.copc\.laz, \.ply, \.pcd, \.e57, \.npz"):
        open_writer(tmp_path / "a.xyz", None, ORIGIN, 1.0)


def test_conversion_through_every_format_loses_nothing(tmp_path: Path, points) -> None:
    """A cloud with 8-bit colours and whole millimetres comes back to the byte."""
    require("pye57")
    block = with_every_attribute(points)
    block = replace(block, rgb=block.rgb // 257 * 257, true_xyz=block.xyz, scanner=block.xyz)
    write(tmp_path / "a.laz", block)
    steps = ["a.laz", "b.ply", "c.e57", "d.npz", "e.las", "f.laz"]
    for source, output in pairwise(steps):
        convert(tmp_path / source, tmp_path / output)
    assert (tmp_path / "f.laz").read_bytes() == (tmp_path / "a.laz").read_bytes()


def test_ply_is_read_by_an_independent_reader(tmp_path: Path, points) -> None:
    require("plyfile")
    import plyfile

    block = with_every_attribute(points)
    write(tmp_path / "cloud.ply", block)
    vertex = plyfile.PlyData.read(tmp_path / "cloud.ply")["vertex"]
    np.testing.assert_array_equal(np.stack([vertex["x"], vertex["y"], vertex["z"]], axis=1), block.xyz)
    np.testing.assert_array_equal(vertex["red"], block.rgb[:, 0] >> 8)
    np.testing.assert_array_equal(vertex["nx"], block.normal[:, 0])
    np.testing.assert_array_equal(vertex["scalar_instance_id"], block.instance_id)
    lines = (tmp_path / "cloud.ply").read_bytes().split(b"end_header")[0].splitlines()
    assert max(map(len, lines)) < 256


@pytest.mark.parametrize("count", [0, 1, 9, 10, 12_345])
def test_ply_header_is_right_for_any_number(tmp_path: Path, count: int) -> None:
    write(tmp_path / "cloud.ply", make_points(count), attributes=())
    assert f"element vertex {count}\n".encode() in (tmp_path / "cloud.ply").read_bytes()
    with open_cloud(tmp_path / "cloud.ply") as cloud:
        assert sum(len(block) for block in cloud.blocks()) == count


def test_foreign_ply(tmp_path: Path) -> None:
    require("plyfile")
    import plyfile

    kinds = [("x", "f4"), ("y", "f4"), ("z", "f4"), ("red", "u1"), ("green", "u1"), ("blue", "u1"), ("label", "u1")]
    record = np.zeros(5, dtype=[*kinds, ("curvature", "f4")])
    record["x"], record["red"], record["label"] = np.arange(5), 255, 6
    element = plyfile.PlyElement.describe(record, "vertex")
    plyfile.PlyData([element], byte_order="<").write(tmp_path / "cloud.ply")
    with open_cloud(tmp_path / "cloud.ply") as cloud:
        assert (cloud.header.labelled, cloud.header.left_out) == (False, ("curvature",))
        block = next(cloud.blocks())
    assert block.xyz[:, 0].tolist() == [0, 1, 2, 3, 4]
    assert (block.rgb[0, 0], block.class_id[0]) == (65535, 6)
    plyfile.PlyData([element], text=True).write(tmp_path / "text.ply")
    with pytest.raises(InputError, match="binary_little_endian"):
        open_cloud(tmp_path / "text.ply")


def test_e57_is_read_by_pye57_in_map_coordinates(tmp_path: Path, points) -> None:
    require("pye57")
    import pye57

    write(tmp_path / "cloud.e57", points, attributes=DEFAULT_ATTRIBUTES)
    with pye57.E57(str(tmp_path / "cloud.e57")) as file:
        assert file.get_header(0).point_count == len(points)
        plain = file.read_scan(0)
        scan = file.read_scan(0, intensity=True, colors=True)
        bounds = file.get_header(0)["cartesianBounds"]
        low = [bounds[f"{axis}Minimum"].value() for axis in "xyz"]
    found = np.stack([scan[f"cartesian{axis}"] for axis in "XYZ"], axis=1)
    assert np.abs(found - points.xyz).max() <= 5e-5 + 1e-9
    for name, values in plain.items():
        np.testing.assert_array_equal(values, scan[name])
    assert np.abs(low + np.floor(ORIGIN) - points.xyz.min(axis=0)).max() <= 5e-5 + 1e-9
    np.testing.assert_array_equal(scan["colorRed"], points.rgb[:, 0] >> 8)


def test_foreign_e57_with_a_turned_pose(tmp_path: Path) -> None:
    require("pye57")
    import pye57

    local = np.array([[1.0, 0.0, 0.0], [0.0, 2.0, 0.5]])
    data = {f"cartesian{axis}": local[:, i] for i, axis in enumerate("XYZ")}
    with pye57.E57(str(tmp_path / "cloud.e57"), mode="w") as file:
        quarter = np.array([np.sqrt(0.5), 0, 0, np.sqrt(0.5)])  # to the left
        for shift in (0.0, 100.0):  # two scans
            file.write_scan_raw(data, rotation=quarter, translation=np.array([10.0 + shift, 20, 30]))
    found = read(tmp_path / "cloud.e57")
    first = [[10, 21, 30], [8, 20, 30.5]]
    np.testing.assert_allclose(found.xyz, [*first, *([x + 100, y, z] for x, y, z in first)], atol=1e-6)


def test_npz_is_plain(tmp_path: Path, points) -> None:
    write(tmp_path / "cloud.npz", points, attributes=DEFAULT_ATTRIBUTES)
    with np.load(tmp_path / "cloud.npz") as arrays:
        for name, array in points.attributes().items():
            np.testing.assert_array_equal(arrays[name], array)


def test_npz_of_others_and_its_faults(tmp_path: Path) -> None:
    path = tmp_path / "cloud.npz"
    np.savez_compressed(path, xyz=np.arange(12.0).reshape(4, 3), strength=np.zeros(4))
    with open_cloud(path) as cloud:
        assert (cloud.header.count, cloud.header.left_out) == (4, ("strength",))
        assert next(cloud.blocks()).xyz[3, 2] == 11
    np.savez(path, points=np.zeros((4, 3)))
    with pytest.raises(InputError, match="has no array xyz"):
        open_cloud(path)
    np.savez(path, xyz=np.zeros((4, 3)), intensity=np.zeros(5))
    with pytest.raises(InputError, match=r"intensity is \(5,\): must be numbers of shape \(4,\)"):
        open_cloud(path)
    np.savez(path, xyz=np.zeros((4, 3)), intensity=np.array([None] * 4))
    with pytest.raises(InputError, match="intensity"):
        open_cloud(path)


def test_npz_dates_are_not_of_the_clock(tmp_path: Path, points) -> None:
    write(tmp_path / "cloud.npz", points, attributes=())
    with zipfile.ZipFile(tmp_path / "cloud.npz") as archive:
        assert {entry.date_time for entry in archive.infolist()} == {(1980, 1, 1, 0, 0, 0)}


@pytest.mark.parametrize(("version", "kind"), [("1.2", 3), ("1.2", 1), ("1.4", 6), ("1.4", 8)])
def test_plain_las_of_any_version(tmp_path: Path, version: str, kind: int) -> None:
    """Files of others have no class_id: it holds their LAS codes; unknown fields are named."""
    header = laspy.LasHeader(version=version, point_format=kind)
    header.offsets, header.scales = [100.0, 200.0, 0.0], [0.01] * 3
    header.add_extra_dim(laspy.ExtraBytesParams("tile", "uint16"))
    las = laspy.LasData(header)
    las.x, las.y, las.z = np.arange(6) + 100.25, np.arange(6) + 200.0, np.arange(6) * 0.5
    las.classification = np.array([2, 2, 5, 6, 1, 0])
    las.intensity = np.arange(6) * 100
    las.point_source_id = np.array([0, 1, 2, 3, 4, 65535])
    las.write(tmp_path / "cloud.laz")
    with open_cloud(tmp_path / "cloud.laz") as cloud:
        assert (cloud.header.labelled, cloud.header.intensity_scale, cloud.header.attributes) == (False, None, ())
        assert "tile" in cloud.header.left_out
        assert cloud.header.has_color == (kind in (3, 8))
        block = next(cloud.blocks())
    np.testing.assert_allclose(block.xyz[:, 0], np.arange(6) + 100.25)
    assert block.class_id.tolist() == [2, 2, 5, 6, 1, 0]
    assert block.intensity.tolist() == [0, 100, 200, 300, 400, 500]
    assert np.isnan(block.range).all()
    convert(tmp_path / "cloud.laz", tmp_path / "again.las")
    again = laspy.read(tmp_path / "again.las")
    assert again.classification.tolist() == [2, 2, 5, 6, 1, 0]
    assert again.point_source_id.tolist() == [0, 1, 2, 3, 4, 65535]
    assert again.intensity.tolist() == [0, 100, 200, 300, 400, 500]
