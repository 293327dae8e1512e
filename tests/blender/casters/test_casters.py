"""Ray casters: they agree with each other, let no ray through, and a wrong one is noticed."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace

import bpy
import numpy as np
import pytest

from studies.costs.casters import bare_mesh
from studies.costs.raycast_nodes import RaycastNodesCaster
from synthroads_addon.base.errors import InputError
from synthroads_addon.base.random_streams import stream
from synthroads_addon.blender import casters
from synthroads_addon.blender.casters import NAMES, make_caster
from synthroads_addon.blender.casters.bvhtree import BVHTreeCaster
from synthroads_addon.blender.casters.embree import EmbreeCaster
from synthroads_addon.blender.casters.measure import agreement, bare_rate
from synthroads_addon.scanning.kernels.library import NoKernelError
from synthroads_addon.scanning.kernels.packets import Packets, usable_packets
from synthroads_addon.scanning.scene.mesh import SceneMesh

RANGE = 60.0
FAST = {"embree": EmbreeCaster, "raycast nodes": RaycastNodesCaster}


def waves(cells: int = 60, size: float = 40.0) -> SceneMesh:
    """Return a closed wavy surface of 2 x cells x cells triangles around the origin."""
    x = np.linspace(-size / 2, size / 2, cells + 1)
    grid = np.stack(np.meshgrid(x, x), axis=-1).reshape(-1, 2)
    vertices = np.column_stack([grid, 0.4 * np.sin(grid[:, 0]) * np.cos(grid[:, 1])]).astype(np.float32)
    corner = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    up = cells + 1
    pairs = [corner, corner + 1, corner + up + 1, corner, corner + up + 1, corner + up]
    return bare_mesh(vertices, np.stack(pairs, axis=-1).reshape(-1, 3).astype(np.int32))


def soup(count: int = 4000) -> SceneMesh:
    """Return small triangles here and there, many of which cross each other."""
    random = stream(1, "soup")
    middle = random.uniform(-15, 15, (count, 1, 3)) * [1, 1, 0.1]
    vertices = (middle + random.normal(0, 0.6, (count, 3, 3))).reshape(-1, 3).astype(np.float32)
    return bare_mesh(vertices, np.arange(3 * count, dtype=np.int32).reshape(-1, 3))


def rays(count: int = 60_000, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Return rays from 30 m above towards places all over the scene, and some that miss it."""
    random = stream(seed, "rays")
    origins = np.column_stack([random.uniform(-15, 15, (count, 2)), np.full(count, 30.0)])
    directions = random.uniform(-22, 22, (count, 3)) * [1, 1, 0.02] - origins
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    return origins.astype(np.float32), directions.astype(np.float32)


SCENES = {"waves": waves, "soup": soup}


@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("name", FAST)
def test_finds_the_reference_casters_faces(name: str, scene: str) -> None:
    mesh, (origins, directions) = SCENES[scene](), rays()
    expected = BVHTreeCaster(mesh).cast(origins, directions, RANGE)
    assert 0.3 < (expected >= 0).mean() < 1.0
    result = agreement(mesh, origins, directions, FAST[name](mesh).cast(origins, directions, RANGE), expected)
    assert result.same >= 0.9999
    assert result.gap < 1e-4


@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("name", FAST)
def test_something_is_in_the_way_where_something_is_hit(name: str, scene: str) -> None:
    mesh, (origins, directions) = SCENES[scene](), rays(20_000)
    hit = BVHTreeCaster(mesh).cast(origins, directions, RANGE) >= 0
    assert 0.3 < hit.mean() < 1.0
    assert np.mean(FAST[name](mesh).occluded(origins, directions, RANGE) == hit) >= 0.9999
    assert not FAST[name](mesh).occluded(origins, directions, 5.0).any(), "nothing is as near as that"


def _neighbour(mesh: SceneMesh, faces: np.ndarray, ray: int) -> np.ndarray:
    return np.where(np.arange(len(faces)) == ray, (faces + 2) % len(mesh), faces)


def _hole(mesh: SceneMesh, faces: np.ndarray, ray: int) -> np.ndarray:
    return np.where(np.arange(len(faces)) == ray, -1, faces)


def _all_shifted(mesh: SceneMesh, faces: np.ndarray, ray: int) -> np.ndarray:
    return np.where(faces >= 0, (faces + 1) % len(mesh), faces)


@pytest.mark.parametrize("fault", [_neighbour, _hole, _all_shifted])
def test_a_wrong_caster_is_noticed(fault: Callable[[SceneMesh, np.ndarray, int], np.ndarray]) -> None:
    mesh, (origins, directions) = waves(), rays()
    expected = BVHTreeCaster(mesh).cast(origins, directions, RANGE)
    middles = mesh.vertices[mesh.triangles].mean(axis=1)[expected]
    # One ray alone is enough, unless it runs along an edge.
    off = np.linalg.norm(np.cross(middles - origins, directions), axis=1)
    ray = int(np.argmin(np.where(expected >= 0, off, np.inf)))
    result = agreement(mesh, origins, directions, fault(mesh, expected, ray), expected)
    assert result.same < 1.0
    assert result.gap > 1e-2


def test_a_caster_that_sees_through_the_first_surface_is_noticed() -> None:
    mesh, (origins, directions) = soup(), rays()
    caster = EmbreeCaster(mesh)
    expected = caster.cast(origins, directions, RANGE)
    upside_down = caster.cast(origins + 60.0 * directions, -directions, RANGE)
    result = agreement(mesh, origins, directions, upside_down, expected)
    assert result.same < 0.9
    assert result.gap > 0.1


@pytest.mark.parametrize("name", NAMES)
def test_no_ray_slips_through_an_edge(name: str) -> None:
    mesh, random = waves(), stream(0, "edges")
    corners = mesh.vertices[mesh.triangles[random.integers(0, len(mesh), 50_000)]].astype(np.float64)
    share = random.uniform(0.01, 0.99, (len(corners), 1))
    goals = share * corners[:, 0] + (1.0 - share) * corners[:, 1]
    goals = goals[np.abs(goals[:, :2]).max(axis=1) < 19.0]
    origins = (goals * [0.3, 0.4, 0.0] + [1.7, -2.3, 30.0]).astype(np.float32)
    directions = goals - origins
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    assert (make_caster(name, mesh).cast(origins, directions.astype(np.float32), RANGE) >= 0).all()


def test_a_mesh_in_pieces_has_the_faces_of_a_whole_one() -> None:
    """Also where the pieces' vertices lie all over the mesh, which are sorted out then."""
    mesh, (origins, directions) = waves(160), rays()
    order = stream(0, "order").permutation(len(mesh))
    for triangles in (mesh.triangles, mesh.triangles[order]):
        one = replace(mesh, triangles=triangles)
        whole, pieces = (EmbreeCaster(one, in_pieces=kind).cast(origins, directions, RANGE) for kind in (False, True))
        assert whole.max() > 2 * 20_000  # several pieces
        np.testing.assert_array_equal(pieces, whole)


@pytest.mark.parametrize("name", NAMES)
def test_nothing_is_hit_beyond_the_range(name: str) -> None:
    mesh, (origins, directions) = waves(), rays(20_000)
    caster = make_caster(name, mesh)
    near, far = caster.cast(origins, directions, 31.0), caster.cast(origins, directions, RANGE)
    from synthroads_addon.scanning.scene.caster import FacePlanes

    found = far >= 0
    ranges = np.full(len(far), np.inf)
    ranges[found] = FacePlanes(mesh).intersect(
        far[found], origins[found].T.astype(np.float64), directions[found].T.astype(np.float64)
    )[0]
    clear = np.abs(ranges - 31.0) > 1e-4
    assert np.array_equal(near[clear], np.where(ranges < 31.0, far, -1)[clear])
    assert 0.05 < (near >= 0).mean() < (far >= 0).mean() - 0.05


@pytest.mark.parametrize("name", NAMES)
def test_scenes_without_triangles_and_calls_without_rays(name: str) -> None:
    empty = bare_mesh(np.empty((0, 3), np.float32), np.empty((0, 3), np.int32))
    origins, directions = rays(5)
    assert make_caster(name, empty).cast(origins, directions, RANGE).tolist() == [-1] * 5
    assert make_caster(name, waves()).cast(origins[:0], directions[:0], RANGE).shape == (0,)


def test_threads_and_chunks_change_nothing() -> None:
    mesh, (origins, directions) = waves(), rays()
    caster = EmbreeCaster(mesh)
    expected = caster.cast(origins, directions, RANGE)
    parts: dict[int, np.ndarray] = {}

    class Recorder:
        name, main_thread_only, kernels = "recorder", False, "none"

        def cast(self, origins: np.ndarray, directions: np.ndarray, maximum_range: float) -> np.ndarray:
            faces = caster.cast(origins, directions, maximum_range)
            parts[(origins.__array_interface__["data"][0])] = faces
            return faces

        def occluded(self, origins: np.ndarray, directions: np.ndarray, maximum_range: float) -> np.ndarray:
            return caster.occluded(origins, directions, maximum_range)

    rate = bare_rate(Recorder(), origins, directions, RANGE, threads=3, chunk=7000, repeats=1)
    assert np.array_equal(np.concatenate([parts[key] for key in sorted(parts)]), expected)
    assert 0.0 < rate.rays_per_second < np.inf
    assert 0.0 < rate.rays_per_processor_second < np.inf


def test_raycast_nodes_leave_nothing_behind() -> None:
    def names() -> list[str]:
        kinds = ("scenes", "objects", "meshes", "node_groups", "collections")
        return [f"{kind} {item.name}" for kind in kinds for item in getattr(bpy.data, kind)]

    before = names()
    caster = RaycastNodesCaster(waves(4))
    origins, directions = rays(10)
    caster.cast(origins, directions, RANGE)
    caster.cast(origins[:3], directions[:3], RANGE)
    assert names() != before
    caster.close()
    assert names() == before


def test_unknown_casters_are_refused() -> None:
    with pytest.raises(InputError, match=r"scan\.caster is 'optix': must be auto or one of embree, bvhtree"):
        make_caster("optix", waves(2))


def test_without_embree_the_reference_steps_in_and_embree_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "synthroads_addon.blender.casters.embree", None)
    assert make_caster("auto", waves(2)).name == "bvhtree"
    with pytest.raises(InputError, match=r"scan\.caster is 'embree': needs the package embreex"):
        make_caster("embree", waves(2))


def test_embree_casts_packets_unless_they_are_turned_off_or_the_machine_has_none(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    mesh, (origins, directions) = waves(), rays(2000)
    usable = usable_packets()
    assert isinstance(usable, Packets), f"{usable}: python tools/build_kernels.py"
    packed, off = make_caster("auto", mesh), make_caster("auto", mesh, "off")
    assert (packed.name, packed.kernels) == ("embree", f"packets of {usable.width} rays")
    assert (off.name, off.kernels) == ("embree", "off: rays are cast one by one")
    monkeypatch.setattr(casters, "usable_packets", lambda: NoKernelError("packets-amiga-m68k.so isn't installed"))
    alone = make_caster("embree", mesh)
    assert alone.kernels == "none: rays are cast one by one, as packets-amiga-m68k.so isn't installed"
    assert {type(caster) for caster in (off, alone)} == {EmbreeCaster}
    expected = off.cast(origins, directions, RANGE)
    for caster in (packed, alone):
        np.testing.assert_array_equal(caster.cast(origins, directions, RANGE), expected)
    assert make_caster("bvhtree", mesh).kernels.startswith("none")
