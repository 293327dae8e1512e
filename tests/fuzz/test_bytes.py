"""Clouds, rasters, pictures and meshes that are cut or flipped: content or one line; no crash, no unbounded memory."""

from __future__ import annotations

import json
import resource
import struct
from dataclasses import replace
from pathlib import Path

import laspy
import numpy as np
import pytest

from synthroads_addon.base.errors import InputError
from synthroads_addon.calibration.expected import read_texture
from synthroads_addon.cloud.formats.las import open_to_copy
from synthroads_addon.cloud.formats.registry import open_cloud, open_writer
from synthroads_addon.cloud.layers import DEFAULT_ATTRIBUTES
from synthroads_addon.materials.table import materials
from synthroads_addon.road.ground.elevation_model import read_elevation_model
from synthroads_addon.scanning.scene.mesh_files import check_mesh_file
from tests.helpers.clouds.random_points import make_points
from tests.helpers.files.mutations import TOKENS, accepted, damaged, for_all, fuzz, limited
from tests.judges import require
from tests.road.test_elevation_model import EPSG, ascii_grid, centres, corridor, geotiff, plane

ORIGIN = np.array([294_000.0, 5_628_000.0, 180.0])
SHORT = [token for token in TOKENS if len(token) < 100]
PEAK_MB = 400
"""Largest time of reading a file of a few hundred kilobytes."""


def cloud(path: Path, count: int = 3000) -> Path:
    with open_writer(path, 25832, ORIGIN, 65535 * 900.0, DEFAULT_ATTRIBUTES) as writer:
        writer.write(make_points(count))
    return path


def foreign(path: Path, version: str, point_format: int) -> Path:
    """Write a cloud as others do: without notes of ours, and of an older version."""
    header = laspy.LasHeader(point_format=point_format, version=version)
    header.offsets, header.scales = ORIGIN, np.full(3, 0.001)
    las = laspy.LasData(header)
    rng = np.random.default_rng(1)
    las.x, las.y, las.z = (ORIGIN[axis] + rng.uniform(0.0, 50.0, 3000) for axis in range(3))
    las.intensity = rng.integers(0, 65536, 3000)
    las.write(path)
    return path


def use_cloud(path: Path) -> None:
    with open_cloud(path) as file:
        for block in file.blocks():
            assert np.isfinite(block.xyz).all()


def every_cloud(folder: Path, ending: str) -> list[bytes]:
    """Return sound clouds of a kind."""
    files = [cloud(folder / f"own{ending}").read_bytes()]
    if ending in (".las", ".laz"):
        files += [foreign(folder / f"{kind}{ending}", *kind).read_bytes() for kind in (("1.2", 3), ("1.4", 6))]
    return files


@fuzz(12, 800)
@pytest.mark.parametrize("ending", [".las", ".laz", ".ply", ".pcd", ".e57", ".npz"])
def test_clouds(tmp_path: Path, ending: str, count: int) -> None:
    path = tmp_path / f"cloud{ending}"

    def body(content: bytes) -> None:
        path.write_bytes(content)
        accepted(lambda: use_cloud(path))

    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    for_all(damaged(every_cloud(tmp_path, ending), SHORT, head=900), count, body)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3 < before + PEAK_MB


def rasters(folder: Path) -> dict[str, list[bytes]]:
    heights = plane(*centres(300, 260)).astype(np.float32)
    tiled = {"tiled": True, "blockxsize": 64, "blockysize": 64}
    files = [
        geotiff(folder / "plain.tif", heights),
        geotiff(folder / "deflate.tif", heights, compress="deflate", predictor=3, **tiled),
        geotiff(folder / "lzw.tif", heights.astype(np.int16), compress="lzw", BIGTIFF="YES"),
    ]
    return {
        ".tif": [file.read_bytes() for file in files],
        ".asc": [ascii_grid(folder / "plain.asc", heights[:60, :60]).read_bytes()],
    }


@fuzz(15, 800)
@pytest.mark.parametrize("ending", [".tif", ".asc"])
def test_elevation_models(tmp_path: Path, ending: str, count: int) -> None:
    path = tmp_path / f"dem{ending}"
    near = corridor(20.0, 60.0, -100.0) if ending == ".tif" else corridor(5.0, 20.0, -30.0)

    def body(content: bytes) -> None:
        path.write_bytes(content)
        accepted(lambda: read_elevation_model(path, EPSG, near))
        accepted(lambda: read_elevation_model(path, EPSG))

    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    for_all(damaged(rasters(tmp_path)[ending], SHORT), count, body)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3 < before + PEAK_MB


@fuzz(10, 400)
@pytest.mark.parametrize("ending", [".png", ".jpg", ".tif"])
def test_pictures_of_materials(tmp_path: Path, ending: str, count: int) -> None:
    from PIL import Image

    Image.fromarray(np.random.default_rng(1).integers(0, 256, (40, 60, 3), np.uint8)).save(tmp_path / f"sound{ending}")
    path, asphalt = tmp_path / f"picture{ending}", materials()["asphalt"]

    def body(content: bytes) -> None:
        path.write_bytes(content)
        accepted(lambda: read_texture(path, 1.0, asphalt))

    for_all(damaged([(tmp_path / f"sound{ending}").read_bytes()], SHORT), count, body)


# --- what headers claim ---------------------------------------------------------------------------------------------


def changed(path: Path, at: int, number: int, size: int) -> Path:
    data = bytearray(path.read_bytes())
    data[at : at + size] = number.to_bytes(size, "little")
    path.write_bytes(bytes(data))
    return path


@pytest.mark.parametrize("ending", [".las", ".laz"])
def test_a_number_of_points_beyond_the_file(tmp_path: Path, ending: str) -> None:
    path = changed(cloud(tmp_path / f"cloud{ending}"), 247, 10**12, 8)  # LAS 1.4: number of point records
    with pytest.raises(InputError, match=r"truncated|points"):
        use_cloud(path)


def test_a_number_of_records_behind_the_points_beyond_the_file(tmp_path: Path) -> None:
    """laspy would make an empty record for each of them."""
    path = changed(cloud(tmp_path / "cloud.las"), 243, 2**32 - 1, 4)
    with limited(), pytest.raises(InputError, match="records behind its points reach beyond its end"):
        open_to_copy(path)


def test_an_attribute_without_bytes_isn_t_copied(tmp_path: Path) -> None:
    """laspy divides by its size where it writes such a header."""
    las = laspy.read(foreign(path := tmp_path / "cloud.las", "1.4", 6))
    las.add_extra_dim(laspy.ExtraBytesParams("amplitude", "uint8"))
    las.write(path)
    kind = path.read_bytes().index(b"amplitude") - 2  # LAS 1.4: data type and options of an extra bytes record
    with pytest.raises(InputError, match="its attribute 'amplitude' has no bytes"):
        open_to_copy(changed(path, kind, 0, 2))


def chunk_table(path: Path) -> int:
    """Return where the table of chunks of a LAZ file begins."""
    data = path.read_bytes()
    start = int.from_bytes(data[96:100], "little")
    return int.from_bytes(data[start : start + 8], "little")


def test_a_number_of_chunks_beyond_the_file(tmp_path: Path) -> None:
    """The decompressor would make room for all of them first, and end the process where there is none."""
    path = cloud(tmp_path / "cloud.laz")
    path = changed(path, chunk_table(path) + 4, 2**32 - 1, 4)
    with pytest.raises(InputError, match="its table of chunks"):
        open_cloud(path)


def test_an_elevation_model_larger_than_any_map(tmp_path: Path) -> None:
    """Its header alone would ask for a table of tiles of hundreds of terabytes."""
    path = ascii_grid(tmp_path / "dem.asc", np.ones((4, 4), np.float32))
    text = path.read_text()
    path.write_text(text.replace("ncols 4", "ncols 2000000000").replace("nrows 4", "nrows 2000000000"))
    with pytest.raises(InputError, match=r"dem\.asc"):
        read_elevation_model(path, EPSG)
    with pytest.raises(InputError, match="sides of a cell"):
        read_elevation_model(ascii_grid(tmp_path / "fine.asc", np.ones((4, 4), np.float32), cell=1e-9), EPSG)


def test_an_elevation_model_much_finer_than_needed_is_refused_at_once(tmp_path: Path) -> None:
    """Before each of its cells along the road is looked for."""
    path = geotiff(tmp_path / "dem.tif", np.ones((300, 300), np.float32), transform=_centimetres())
    with pytest.raises(InputError, match="size: at most 134 million cells"):
        read_elevation_model(path, EPSG, corridor(200.0))


def _centimetres() -> object:
    from rasterio.transform import Affine

    return Affine(0.01, 0.0, 294_000.0, 0.0, -0.01, 5_628_400.0)


# --- numbers that are none ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("value", [np.nan, np.inf])
@pytest.mark.parametrize("ending", [".ply", ".npz"])
def test_points_that_are_not_finite_are_refused_by_name(tmp_path: Path, ending: str, value: float, monkeypatch) -> None:
    points = make_points(100)
    points = replace(points, xyz=np.where(np.arange(300).reshape(100, 3) == 31, value, points.xyz))
    from synthroads_addon.cloud.formats import writer as writing

    monkeypatch.setattr(writing.CloudWriter, "check_finite", lambda self, values, *_: values)
    path = tmp_path / f"cloud{ending}"
    with open_writer(path, None, ORIGIN, 1.0, ()) as writer:
        writer.write(points)
    with pytest.raises(InputError, match=rf"cloud{ending}: y of point 10 is (nan|inf): must be finite"):
        use_cloud(path)


def test_points_of_e57_that_are_not_finite_are_refused_by_name(tmp_path: Path, monkeypatch) -> None:
    """pye57 writes no NaN, but others do: here the scan's pose is the one."""
    require("pye57")
    from synthroads_addon.cloud.formats import e57

    monkeypatch.setattr(e57, "_pose", lambda scan: (np.eye(3), np.array([0.0, 0.0, np.nan])))
    with pytest.raises(InputError, match=r"cloud\.e57: z of point 0 is nan: must be finite"):
        use_cloud(cloud(tmp_path / "cloud.e57"))


@pytest.mark.parametrize("at", [131, 155])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_scales_and_offsets_of_las_that_are_no_numbers_are_refused(tmp_path: Path, at: int, value: float) -> None:
    path = cloud(tmp_path / "cloud.las")
    changed(path, at, int.from_bytes(np.float64(value).tobytes(), "little"), 8)
    with pytest.raises(
        InputError, match=r"cloud\.las: scales and offsets is \[.*must be finite numbers, the scales not 0"
    ):
        open_cloud(path)


NOTES = [{"intensity_scale": None}, {"intensity_scale": 0.0}, {"intensity_scale": 10**400}, {}]


@pytest.mark.parametrize(
    ("ending", "notes"),
    [
        *((ending, notes) for ending in (".laz", ".ply", ".npz") for notes in NOTES),
        *((".laz", notes) for notes in ([1], "x")),  # the other writers put theirs beside those of the cloud
    ],
)
def test_notes_that_are_none_of_ours(tmp_path: Path, ending: str, notes: object, monkeypatch) -> None:
    from synthroads_addon.cloud.formats import writer as writing

    path = tmp_path / f"cloud{ending}"
    writer = open_writer(path, None, ORIGIN, 1.0, ())
    monkeypatch.setattr(type(writer), "notes", lambda self: notes)
    monkeypatch.setattr(writing.CloudWriter, "notes", lambda self: notes)
    with writer:
        writer.write(make_points(10))
    accepted(lambda: use_cloud(path))


# --- meshes ---------------------------------------------------------------------------------------------------------

CORNERS = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], "<f4")


def mesh_file(path: Path) -> Path:
    """Write a square of two triangles (in PLY a triangle and a square)."""
    if path.suffix == ".stl":
        triangle = np.zeros(2, [("numbers", "<f4", 12), ("attribute", "<u2")])
        triangle["numbers"][:, 3:] = CORNERS[[[0, 1, 2], [0, 2, 3]]].reshape(2, 9)
        path.write_bytes(bytes(80) + (2).to_bytes(4, "little") + triangle.tobytes())
    elif path.suffix == ".ply":
        head = "ply\nformat binary_little_endian 1.0\nelement vertex 4\n"
        head += "".join(f"property float {axis}\n" for axis in "xyz")
        head += "element face 2\nproperty list uchar uint vertex_indices\nend_header\n"
        faces = b"\x03" + np.array([0, 1, 2], "<u4").tobytes() + b"\x04" + np.array([0, 1, 2, 3], "<u4").tobytes()
        path.write_bytes(head.encode() + CORNERS.tobytes() + faces)
    else:
        binary = CORNERS.tobytes() + np.array([0, 1, 2, 0, 2, 3], "<u2").tobytes()
        path.write_bytes(glb({}, binary))
    return path


def glb(changes: dict, binary: bytes) -> bytes:
    """Return a binary glTF of a square."""
    content = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "children": [1]}, {"name": "below"}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]},
            {"bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 48},
            {"buffer": 0, "byteOffset": 48, "byteLength": 12},
        ],
        "buffers": [{"byteLength": len(binary)}],
        **changes,
    }
    text = json.dumps(content).encode()
    text += b" " * (-len(text) % 4)
    length = 12 + 8 + len(text) + 8 + len(binary)
    head = struct.pack("<5I", 0x46546C67, 2, length, len(text), 0x4E4F534A)
    return head + text + struct.pack("<2I", len(binary), 0x004E4942) + binary


@fuzz(30, 1500)
@pytest.mark.parametrize("ending", [".ply", ".stl", ".glb"])
def test_meshes(tmp_path: Path, ending: str, count: int) -> None:
    sound = mesh_file(tmp_path / f"sound{ending}")
    check_mesh_file(sound)
    path = tmp_path / f"mesh{ending}"

    def body(content: bytes) -> None:
        path.write_bytes(content)
        accepted(lambda: check_mesh_file(path))

    for_all(damaged([sound.read_bytes()], SHORT), count, body)


BINARY = CORNERS.tobytes() + np.array([0, 1, 2, 0, 2, 3], "<u2").tobytes()
LOOP = [{"mesh": 0}, {"children": [2]}, {"children": [1]}]
HUGE = [{"componentType": 5126, "count": 4_000_000_000, "type": "VEC3"}]
BEYOND = [{"bufferView": 0, "componentType": 5126, "count": 400, "type": "VEC3"}]


@pytest.mark.parametrize(
    ("content", "ending", "said"),
    [
        (glb({"accessors": HUGE}, BINARY), ".glb", "an accessor claims 4,000,000,000 values"),
        (glb({"accessors": BEYOND}, BINARY), ".glb", "an accessor claims 400 values"),
        (glb({"bufferViews": [{"buffer": 0, "byteLength": 61}] * 2}, BINARY), ".glb", "a view lies beyond its buffer"),
        (glb({"buffers": [{"byteLength": 10**9}]}, BINARY), ".glb", "its buffer has 60 bytes of 1,000,000,000"),
        (glb({"nodes": LOOP}, BINARY), ".glb", "node [12] lies below itself"),
        (glb({}, BINARY)[:-20], ".glb", "bytes are left of"),
        (b"glTF", ".glb", "is damaged"),
        (b"\0" * 80 + (10**9).to_bytes(4, "little"), ".stl", "84 bytes are less than its triangles take"),
    ],
)
def test_what_meshes_claim_is_held_against_the_file(tmp_path: Path, content: bytes, ending: str, said: str) -> None:
    (tmp_path / f"mesh{ending}").write_bytes(content)
    with pytest.raises(InputError, match=said):
        check_mesh_file(tmp_path / f"mesh{ending}")


@pytest.mark.parametrize("text", [False, True])
def test_a_face_that_names_no_vertex(tmp_path: Path, text: bool) -> None:
    """Blender's importer ends the process at it."""
    path = mesh_file(tmp_path / "mesh.ply")
    data = path.read_bytes()
    if text:
        head, rows = (
            data.split(b"end_header\n")[0].replace(b"binary_little_endian", b"ascii"),
            "0 0 0\n1 0 0\n1 1 0\n0 1 0\n",
        )
        path.write_bytes(head + b"end_header\n" + f"{rows}3 0 1 2\n4 0 1 2 3\n".encode())
        check_mesh_file(path)
        path.write_bytes(head + b"end_header\n" + f"{rows}3 0 1 2\n4 0 1 2 4\n".encode())
    else:
        path.write_bytes(data[:-4] + (4).to_bytes(4, "little"))
    with pytest.raises(InputError, match="a face names a vertex that is none of its 4"):
        check_mesh_file(path)
    path.write_bytes(data[:-2] if not text else path.read_bytes().rsplit(b"\n", 2)[0] + b"\n")
    with pytest.raises(InputError, match="it ends before its elements do"):
        check_mesh_file(path)
