"""Rays in packets meet the faces of single rays; where they can't be used, or wouldn't, that is found out and said."""

from __future__ import annotations

import ctypes
import gc
import logging
import shutil
import weakref
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene

from synthroads_addon.base.random_streams import stream
from synthroads_addon.scanning.kernels import library, packets
from synthroads_addon.scanning.kernels.library import FOLDER, NoKernelError, load_kernel
from synthroads_addon.scanning.kernels.packets import COHERENT, Packets, PacketScene, Packing, usable_packets

pytestmark = pytest.mark.any_blender

Mesh = tuple[np.ndarray, np.ndarray]
RANGE = 80.0
ALL_TOGETHER = Packing(flags=0, least_cosine=-2.0, widest=np.inf, most_changes=1.0)
"""All rays in packets, followed each by itself."""


@pytest.fixture
def usable() -> Packets:
    """Return the libraries; `make` and tools/build_kernels.py put them where they are found."""
    found = usable_packets()
    assert isinstance(found, Packets), f"{found}: python tools/build_kernels.py"
    return found


def hills(cells: int = 60) -> Mesh:
    """Return a closed wavy surface of 40 m x 40 m."""
    x = np.linspace(-20.0, 20.0, cells + 1)
    grid = np.stack(np.meshgrid(x, x), axis=-1).reshape(-1, 2)
    vertices = np.column_stack([grid, 0.4 * np.sin(grid[:, 0]) * np.cos(grid[:, 1])]).astype(np.float32)
    corner = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    up = cells + 1
    pairs = [corner, corner + 1, corner + up + 1, corner, corner + up + 1, corner + up]
    return vertices, np.stack(pairs, axis=-1).reshape(-1, 3).astype(np.int32)


def leaves() -> Mesh:
    """Return 4,000 small triangles here and there, many of which cross each other."""
    random = stream(1, "soup")
    middle = random.uniform(-15, 15, (4000, 1, 3)) * [1, 1, 0.1]
    vertices = (middle + random.normal(0, 0.6, (4000, 3, 3))).reshape(-1, 3).astype(np.float32)
    return vertices, np.arange(len(vertices), dtype=np.int32).reshape(-1, 3)


def walls() -> Mesh:
    """Return upright walls behind one another, long and thin, on a floor of two triangles."""
    y = np.arange(-15.0, 15.0, 0.5).tolist()
    corners = [(x, one, z) for one in y for x, z in ((-20.0, 0.0), (20.0, 0.0), (20.0, 0.05), (-20.0, 0.05))]
    vertices = np.array([*corners, (-20, -20, 0), (20, -20, 0), (20, 20, 0), (-20, 20, 0)], np.float32)
    first = 4 * np.arange(len(y) + 1)[:, None]
    return vertices, np.concatenate([first + [0, 1, 2], first + [0, 2, 3]]).astype(np.int32)


MESHES: dict[str, Callable[[], Mesh]] = {"hills": hills, "leaves": leaves, "walls": walls}


def scan_lines(per_pulse: int = 7, lines: int = 30) -> tuple[np.ndarray, np.ndarray]:
    """Return rays in the order of a flight 30 m above: lines across, each pulse a narrow cone; some miss everything."""
    angle = np.deg2rad(np.arange(-45.0, 45.0, 0.18))
    turn = np.linspace(0.0, 2.0 * np.pi, per_pulse, endpoint=False)
    across = (angle[:, None] + 4e-4 * np.cos(turn)) + np.zeros((lines, 1, 1))
    along = 1e-4 * np.sin(turn) + 0.0 * across
    directions = np.stack([along, np.sin(across), -np.cos(across)], axis=-1)
    directions /= np.linalg.norm(directions, axis=-1)[..., None]
    origins = np.zeros_like(directions) + [0.0, 0.3, 30.0]
    origins[..., 0] += np.linspace(-12.0, 12.0, lines)[:, None, None]
    return origins.reshape(-1, 3).astype(np.float32), directions.reshape(-1, 3).astype(np.float32)


def random_rays(count: int = 20_000) -> tuple[np.ndarray, np.ndarray]:
    """Return rays from all over towards all sides."""
    random = stream(0, "rays")
    origins = random.uniform(-20, 20, (count, 3)) * [1, 1, 0.2] + [0, 0, 6]
    directions = random.normal(size=(count, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    return origins.astype(np.float32), directions.astype(np.float32)


RAYS = {"scan lines": scan_lines, "all sides": random_rays}


def single_rays(mesh: Mesh, origins: np.ndarray, directions: np.ndarray, limits: np.ndarray, query: str) -> np.ndarray:
    """Return what embreex itself says of rays, which knows no packets."""
    scene = EmbreeScene(robust=True)
    kept = TriangleMesh(scene, *mesh)
    found = np.asarray(scene.run(origins, directions, dists=limits.copy(), query=query))
    del kept
    return found


@pytest.mark.parametrize("rays", RAYS)
@pytest.mark.parametrize("name", MESHES)
def test_without_the_flag_packets_say_bit_for_bit_what_single_rays_say(usable: Packets, name: str, rays: str) -> None:
    mesh, (origins, directions) = MESHES[name](), RAYS[rays]()
    limits = stream(0, "limits").uniform(5.0, RANGE, len(origins)).astype(np.float32)
    expected = single_rays(mesh, origins, directions, limits, "INTERSECT")
    hidden = single_rays(mesh, origins, directions, limits, "OCCLUDED") == 0
    assert 0.02 < hidden.mean() < 0.98
    alone = Packing(least_cosine=2.0)
    for packing in (ALL_TOGETHER, replace(ALL_TOGETHER, width=4), alone):
        scene = PacketScene(usable, *mesh, packing=packing)
        np.testing.assert_array_equal(scene.cast(origins, directions, limits), expected)
        np.testing.assert_array_equal(scene.occluded(origins, directions, limits), hidden)


@pytest.mark.parametrize("per_pulse", [1, 7, 19])
@pytest.mark.parametrize("name", MESHES)
def test_rays_that_run_together_differ_at_most_where_faces_share_an_edge(
    usable: Packets, name: str, per_pulse: int
) -> None:
    mesh, (origins, directions) = MESHES[name](), scan_lines(per_pulse, lines=60)
    expected = single_rays(mesh, origins, directions, np.full(len(origins), RANGE, np.float32), "INTERSECT")
    found = PacketScene(usable, *mesh).cast(origins, directions, RANGE)
    other = np.flatnonzero(found != expected)
    assert len(other) <= 1e-4 * len(found)
    assert_ties(mesh, origins[other], directions[other], found[other], expected[other])


@pytest.mark.parametrize("width", [4, 8, 16])
@pytest.mark.parametrize("largest", [1e-3, 1e-17, 2e-18, 1e-19, 1e-40])
def test_components_as_good_as_zero_lose_no_face(usable: Packets, width: int, largest: float) -> None:
    """A flight along an axis without errors: of directions across, a component is the rounded sine of half a turn."""
    if width > usable.width:
        pytest.skip("narrower packets alone")
    angle = np.deg2rad(0.18 * np.arange(-160, 160))
    along = -largest * np.tile(np.linspace(0.0, 1.0, 16), 20)
    directions = np.stack([along, np.sin(angle), -np.cos(angle)], axis=-1).astype(np.float32)
    moved = np.array([-88.0, 0.0, 0.0], np.float32)
    mesh = hills()[0] + moved, hills()[1]
    origins = np.zeros_like(directions) + moved + np.array([0.0, 0.3, 30.0], np.float32)
    found = PacketScene(usable, *mesh, packing=Packing(width=width)).cast(origins, directions, RANGE)
    limits = np.full(len(origins), RANGE, np.float32)
    expected = single_rays(mesh, origins, directions, limits, "INTERSECT")
    assert (found >= 0).sum() == (expected >= 0).sum() > 250


def test_rays_at_edges_choose_one_of_the_two_faces_and_none_slips_through(usable: Packets) -> None:
    mesh, random = hills(), stream(0, "edges")
    corners = mesh[0][mesh[1][np.arange(6000) % len(mesh[1])]].astype(np.float64)
    share = random.uniform(0.01, 0.99, (len(corners), 1))
    goals = share * corners[:, 0] + (1.0 - share) * corners[:, 1]
    goals = np.repeat(goals[np.abs(goals[:, :2]).max(axis=1) < 19.0], 8, axis=0)
    origins = np.broadcast_to([1.7, -2.3, 60.0], goals.shape)
    directions = goals - origins
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    rays = origins.astype(np.float32), directions.astype(np.float32)
    found = PacketScene(usable, *mesh).cast(*rays, RANGE)
    expected = single_rays(mesh, *rays, np.full(len(found), RANGE, np.float32), "INTERSECT")
    assert found.min() >= 0
    other = np.flatnonzero(found != expected)
    assert len(other) > 0  # the rays do run together, and here that shows
    assert_ties(mesh, rays[0][other], rays[1][other], found[other], expected[other])


def assert_ties(mesh: Mesh, origins: np.ndarray, directions: np.ndarray, *faces: np.ndarray) -> None:
    """Fail unless each ray meets the planes of its two faces at the same range, within 0.1 mm."""
    ranges = []
    for face in faces:
        assert (face >= 0).all()
        a, b, c = np.moveaxis(mesh[0][mesh[1][face]].astype(np.float64), 1, 0)
        normal = np.cross(b - a, c - a)
        away = np.einsum("ij,ij->i", normal, a - origins)
        ranges.append(away / np.einsum("ij,ij->i", normal, directions.astype(np.float64)))
    np.testing.assert_allclose(ranges[0], ranges[1], atol=1e-4)


@pytest.fixture
def calls(usable: Packets, monkeypatch: pytest.MonkeyPatch) -> Iterator[Counter[str]]:
    """Yield how often Embree is called for one ray, and for a packet of them, from here on."""
    count: Counter[str] = Counter()
    one_type = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 3)
    many_type = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 4)
    original, kept = packets._functions, []

    def counted(kind: str, made: type, address: int | None) -> int | None:
        inner = made(address)

        def call(*arguments: int) -> None:
            count[kind] += 1
            inner(*arguments)

        kept.append(made(call))
        return ctypes.cast(kept[-1], ctypes.c_void_p).value

    def functions(*arguments: object, **named: object) -> tuple[int | None, int | None]:
        one, packet = original(*arguments, **named)
        return counted("one", one_type, one), counted("packet", many_type, packet)

    monkeypatch.setattr(packets, "_functions", functions)
    yield count
    assert kept


def test_scan_lines_are_cast_in_packets_and_what_runs_apart_ray_by_ray(usable: Packets, calls: Counter[str]) -> None:
    scene, width = PacketScene(usable, *hills()), usable.width
    origins, directions = (array[:7000] for array in scan_lines())
    scene.cast(origins, directions, RANGE)
    assert calls["packet"] > 0.99 * len(origins) / width
    assert calls["one"] < 0.01 * len(origins)
    calls.clear()
    scene.occluded(*random_rays(1000), RANGE)
    assert calls["one"] > 990
    calls.clear()
    scene.cast(origins[: 3 * width + 3], directions[: 3 * width + 3], RANGE)
    assert calls == {"packet": 4}  # the last of 3 rays
    calls.clear()
    scene.cast(origins[: width + 1], directions[: width + 1], RANGE)
    assert calls == {"packet": 1, "one": 1}


def test_where_each_ray_meets_a_face_of_its_own_rays_are_cast_one_by_one(usable: Packets, calls: Counter[str]) -> None:
    origins, directions = (array[:7000] for array in scan_lines(per_pulse=1))
    PacketScene(usable, *hills(600)).cast(origins, directions, RANGE)
    assert calls["one"] > 0.7 * len(origins)
    calls.clear()
    PacketScene(usable, *hills(10)).cast(origins, directions, RANGE)
    assert calls["one"] < 0.05 * len(origins)


def test_rays_that_are_no_numbers_meet_nothing_and_leave_the_others_alone(usable: Packets) -> None:
    scene = PacketScene(usable, *hills())
    origins, directions = (array[:64].copy() for array in scan_lines())
    expected = scene.cast(origins, directions, RANGE)
    directions[5], origins[21] = np.nan, np.inf
    found = scene.cast(origins, directions, RANGE)
    assert found[5] == found[21] == -1
    others = np.delete(np.arange(64), [5, 21])
    np.testing.assert_array_equal(found[others], expected[others])


def test_threads_change_nothing(usable: Packets) -> None:
    scene, (origins, directions) = PacketScene(usable, *leaves()), scan_lines()
    parts = [slice(first, first + 1001) for first in range(0, len(origins), 1001)]
    expected = [scene.cast(origins[part], directions[part], RANGE) for part in parts]
    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(lambda part: scene.cast(origins[part], directions[part], RANGE), parts))
    np.testing.assert_array_equal(np.concatenate(found), np.concatenate(expected))


def test_a_scene_keeps_its_mesh_and_gives_it_back(usable: Packets) -> None:
    mesh, (origins, directions) = hills(200), scan_lines()
    expected = PacketScene(usable, *mesh).cast(origins, directions, RANGE)
    vertices, triangles = (array.copy() for array in mesh)
    scene, given = PacketScene(usable, vertices, triangles), weakref.ref(triangles)
    del vertices, triangles
    gc.collect()
    scrap = [np.full((len(mesh[1]), 3), 7, np.int32) for _ in range(20)]  # takes the room of what was let go
    np.testing.assert_array_equal(scene.cast(origins, directions, RANGE), expected)
    assert given() is not None
    del scene, scrap
    gc.collect()
    assert given() is None


@pytest.mark.parametrize(
    ("origins", "directions", "limits"),
    [
        (np.zeros((4, 3)), np.zeros((3, 3)), 1.0),
        (np.zeros((4, 2)), np.zeros((4, 2)), 1.0),
        (np.zeros((4, 3)), np.zeros((4, 3)), np.ones(3)),
    ],
)
def test_rays_of_another_shape_are_refused(
    usable: Packets, origins: np.ndarray, directions: np.ndarray, limits: np.ndarray | float
) -> None:
    with pytest.raises(ValueError, match=r"\(N, 3\), \(N, 3\), 1 or N"):
        PacketScene(usable, *hills(4)).cast(origins, directions, limits)


def test_a_mesh_without_triangles_is_never_met(usable: Packets) -> None:
    scene = PacketScene(usable, np.empty((0, 3), np.float32), np.empty((0, 3), np.int32))
    origins, directions = random_rays(5)
    assert scene.cast(origins, directions, RANGE).tolist() == [-1] * 5
    assert scene.occluded(origins, directions, RANGE).tolist() == [False] * 5


@pytest.fixture
def anew() -> Iterator[None]:
    """Have what this machine can do found out anew within a test, and after it."""
    usable_packets.cache_clear()
    yield
    usable_packets.cache_clear()


@pytest.mark.usefixtures("anew")
@pytest.mark.parametrize("field", ["cast", "occluded"])
def test_packets_that_differ_from_single_rays_are_left_alone_with_a_warning(
    field: str, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    original = getattr(PacketScene, field)

    def wrong(self: PacketScene, *arguments: np.ndarray) -> np.ndarray:
        """One ray in 72 is wrong."""
        found = original(self, *arguments)
        found[50] = not found[50] if found.dtype == bool else found[50] + 1
        return found

    monkeypatch.setattr(PacketScene, field, wrong)
    with caplog.at_level(logging.WARNING, "synthroads"):
        answer = usable_packets()
    assert isinstance(answer, NoKernelError)
    assert str(answer) == "packets differ from single rays"
    assert [record.getMessage() for record in caplog.records] == [
        "Embree's packets of rays don't agree with its single rays on this machine: rays are cast one by one"
    ]
    usable_packets()
    assert len(caplog.records) == 1


@pytest.mark.usefixtures("anew")
def test_another_version_of_embree_is_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(packets, "_EMBREE", 405)
    answer = usable_packets()
    assert isinstance(answer, NoKernelError)
    assert str(answer).endswith("and not 405xx")


@pytest.mark.usefixtures("anew")
def test_a_library_that_lacks_a_function_is_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(packets._SIGNATURES, "rtcIntersect1M", (None, []))  # Embree 3 had it
    answer = usable_packets()
    assert isinstance(answer, NoKernelError)
    assert "rtcIntersect1M" in str(answer)


@pytest.mark.usefixtures("anew")
def test_without_embrees_library_packets_are_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(packets, "_LIBRARIES", ("no/such*",))
    assert "has no library of Embree" in str(usable_packets())


def test_the_comparison_casts_packets_and_single_rays(calls: Counter[str], usable: Packets) -> None:
    assert packets._same_as_embreex(usable)
    assert calls["packet"] >= 2 * 72 // usable.width  # faces, and whether there is one
    assert calls["one"] >= 2 * 72 - 2 * usable.width


def test_a_kernel_of_another_source_or_platform_is_refused(
    usable: Packets, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for source in ("packets.c", "kernel.h"):
        folder = tmp_path / source  # another each time: the library of the one before is in use
        folder.mkdir()
        for path in (*FOLDER.glob("packets*"), *FOLDER.glob("*.h")):
            shutil.copy(path, folder)
        assert load_kernel("packets", folder)
        changed = folder / source
        changed.write_text(changed.read_text(encoding="utf-8") + "\n", encoding="utf-8")
        with pytest.raises(NoKernelError, match="is of another version: install SynthRoads again"):
            load_kernel("packets", folder)
    name = Path(usable.kernel._name).name
    with pytest.raises(NoKernelError, match=f"{name} isn't installed"):
        load_kernel("packets", tmp_path / "elsewhere")
    (tmp_path / "broken").mkdir()
    (tmp_path / "broken" / name).write_bytes(b"not a library")
    with pytest.raises(NoKernelError, match=f"{name} can't be loaded"):
        load_kernel("packets", tmp_path / "broken")
    monkeypatch.setattr(library.platform, "machine", lambda: "riscv64")
    with pytest.raises(NoKernelError, match=r"packets-\w+-riscv64\.\w+ isn't installed"):
        load_kernel("packets", tmp_path)


def test_the_flag_is_embrees() -> None:
    assert Packing().flags == COHERENT == 65536


def test_calls_that_belong_together_go_on_where_the_last_one_ended(usable: Packets) -> None:
    """Rays that meet a face each are cast one by one after the first packet, in whatever calls they come."""
    scene, calls = PacketScene(usable, *hills()), Counter[str]()
    faces = iter(range(10_000))

    def answer(rays: int, width: int) -> None:
        numbers = (ctypes.c_uint32 * (21 * width)).from_address(rays)
        for lane in range(width):
            numbers[17 * width + lane], numbers[18 * width + lane] = next(faces), 0

    def one(scene: int, rays: int, arguments: int) -> None:
        calls["one"] += 1
        answer(rays, 1)

    def packet(valid: int, scene: int, rays: int, arguments: int) -> None:
        calls["packet"] += 1
        answer(rays, usable.width)

    pointers = [ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * size)(called) for size, called in ((3, one), (4, packet))]
    origins, found = np.zeros((usable.width, 3), np.float32), np.zeros(usable.width, np.int32)
    directions, limit = origins - np.float32([0.0, 0.0, 1.0]), np.array([50.0], np.float32)
    rays = packets._Rays(origins.ctypes.data, directions.ctypes.data, limit.ctypes.data, 0)
    casts: Any = scene.casting()
    casts.one, casts.packet = (ctypes.cast(pointer, ctypes.c_void_p).value for pointer in pointers)
    for expected in ({"packet": 1}, {"packet": 1, "one": usable.width}):
        usable.kernel.synthroads_cast(ctypes.byref(casts), None, len(origins), ctypes.byref(rays), found.ctypes.data)
        assert calls == expected
