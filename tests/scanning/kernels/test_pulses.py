"""Pulses followed by compiled loops: byte for byte what NumPy makes of the same rays, whatever they meet."""

from __future__ import annotations

import ctypes
import platform
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from synthroads_addon.base.random_streams import stream
from synthroads_addon.materials.surfaces import surfaces_of
from synthroads_addon.materials.table import materials
from synthroads_addon.scanning.beam import RINGS
from synthroads_addon.scanning.kernels.library import NoKernelError, load_kernel
from synthroads_addon.scanning.kernels.packets import USUAL
from synthroads_addon.scanning.kernels.pulses import PulseKernel, _load
from synthroads_addon.scanning.plan import ScanPlan
from synthroads_addon.scanning.scene.caster import FacePlanes
from synthroads_addon.scanning.scene.mesh import SceneMesh
from synthroads_addon.scanning.scene.motion import LinearMotion, MovingMesh, ScannedScene
from synthroads_addon.scanning.scene.target import Target
from tests.helpers.scenes.kernel_scenes import (
    Cast,
    assert_bytes,
    assert_same,
    downwards,
    planned,
    pulses_of,
    soup,
    stack,
)
from tests.helpers.scenes.scan_scenes import BruteForce, altered, mesh_of, plane, scan_of

pytestmark = pytest.mark.any_blender


class Forced(Cast):
    """A caster that says that rays meet faces which have nothing to do with them; numbers by their directions."""

    def __init__(self, mesh: SceneMesh) -> None:
        super().__init__(mesh)
        self._count = len(mesh.triangles)
        self._called = _CALLED(self._answer)

    def cast(self, origins: np.ndarray, directions: np.ndarray, maximum_range: Any) -> np.ndarray:
        """Return any faces, or none."""
        return (np.abs(directions @ [1e5, 2e4, 3e3]).astype(np.int32) % (self._count + 1) - 1).astype(np.int32)

    @property
    def native(self) -> tuple[int, int]:
        """Return the address of what answers the kernel."""
        address = ctypes.cast(self._called, ctypes.c_void_p).value
        assert address
        return address, 0

    def _answer(self, casts: int, scene: int, count: int, rays: int, found: int) -> None:
        direction = ctypes.cast(rays, ctypes.POINTER(ctypes.c_void_p))[1]
        rows = np.frombuffer((ctypes.c_float * (3 * count)).from_address(direction), np.float32).reshape(-1, 3)
        np.frombuffer((ctypes.c_int32 * count).from_address(found), np.int32)[:] = self.cast(rows, rows, 0.0)


_CALLED = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 2, ctypes.c_int64, *[ctypes.c_void_p] * 2)


@pytest.mark.parametrize("rays", RINGS)
@pytest.mark.parametrize("attenuation", [0.0, 0.02])
def test_leaves_panes_and_reflectors_send_back_the_same_bytes(rays: int, attenuation: float) -> None:
    plan = planned(soup(), rays, attenuation=attenuation)
    assert plan.reflection.surfaces.permeable
    assert plan.reflection.surfaces.retroreflective
    assert plan.reflection.surfaces.rough
    assert plan.gaps is not None
    echoes = assert_same(plan, downwards(3001))
    assert len(np.unique(echoes.pulse)) < len(echoes.pulse)


@pytest.mark.parametrize("flags", [0, USUAL.flags])
@pytest.mark.parametrize("width", [4, None])
def test_rays_are_packed_alike(flags: int, width: int | None) -> None:
    assert_same(planned(soup(600), 7, {"flags": flags, "width": width, "most_changes": 0.3}), downwards(4099))


@pytest.mark.parametrize("seed", range(12))
def test_random_settings_and_lengths_of_blocks(seed: int) -> None:
    random = stream(seed, "settings")
    rays = int(random.choice(list(RINGS)))
    plan = planned(
        soup(int(random.integers(1, 800)), seed, random.uniform(2.0, 30.0)),
        rays,
        attenuation=float(random.choice([0.0, 1e-4, 0.3])),
        divergence=tuple(random.uniform(0.0, 0.02, 2)),
        minimum_range=float(random.choice([0.0, 10.0, 29.0])),
        maximum_range=float(random.choice([28.0, 35.0, 500.0])),
        range_resolution=float(random.choice([0.0, 0.1, 3.0, 1e6])),
        frame_origin=random.normal(0.0, 10.0 ** random.integers(0, 7), 3),
    )
    assert_same(plan, downwards(int(random.integers(2, 700)), seed))


@pytest.mark.parametrize("material", ["leaves", "wire_mesh"])
@pytest.mark.parametrize("resolution", [0.01, 9.0])
def test_canopies_deeper_than_a_ray_reaches(material: str, resolution: float) -> None:
    """Of wire mesh a ray passes as many layers as it may, and a return has more hits than NumPy adds at once."""
    plan = planned(stack(60, material), 61, divergence=(0.05, 0.05), range_resolution=resolution)
    echoes = assert_same(plan, downwards(40, width=8.0))
    assert len(np.unique(echoes.pulse)) == 40
    assert (len(echoes.pulse) > 40) == (resolution < 1.0)


def test_ranges_that_one_key_can_not_tell_apart() -> None:
    heights = 5.0 + np.arange(12) * 1e-9
    mesh = stack(12)
    vertices = mesh.vertices.copy()
    vertices[:48, 2] = np.repeat(heights[::-1], 4)
    far = np.array([[-5e4, -5e4, -3e6], [5e4, -5e4, -3e6], [0.0, 9e4, -3e6]])
    triangles = np.concatenate([mesh.triangles, [[52, 53, 54]]]).astype(np.int32)
    mesh = mesh_of(np.concatenate([vertices, far]), triangles)
    mesh = replace(mesh, material=np.full(len(triangles), 1, np.uint16), materials=("asphalt", "leaves"))
    plan = planned(mesh, 7, maximum_range=1e7, range_resolution=1e-10)
    assert_same(plan, downwards(5000, width=10.0))


@pytest.mark.parametrize("count", [0, 1, 2, 15, 16, 17, 513])
@pytest.mark.parametrize("rays", [1, 19])
def test_blocks_of_any_length(count: int, rays: int) -> None:
    assert_same(planned(soup(500), rays), downwards(count))


def test_pulses_that_meet_nothing() -> None:
    pulses = downwards(100)
    up = pulses_of(pulses.origin, -pulses.direction)
    assert not len(assert_same(planned(soup(50), 7), up).pulse)


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 0.0, 1e-310, 1e30, 1e300])
@pytest.mark.parametrize("what", ["origin", "direction"])
def test_pulses_that_are_no_pulses(what: str, value: float) -> None:
    pulses = downwards(300)
    array = getattr(pulses, what).copy()
    array[:, ::7] = value
    array[1, ::11] = value
    assert_same(planned(soup(400), 7), replace(pulses, **{what: array}))


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("value", [np.nan, np.inf, 1e19, -1e19, 1e300])
def test_gaps_at_places_beyond_all_whole_numbers(value: float) -> None:
    plan = planned(soup(400), 7, frame_origin=np.array([value, 1e17, -5.0]))
    assert_same(plan, downwards(300))


@pytest.mark.parametrize("rays", [1, 7])
def test_faces_without_area_and_edge_on(rays: int) -> None:
    mesh = soup(300)
    vertices, pulses = mesh.vertices.copy(), downwards(900)
    vertices[1::9] = vertices[::9]
    vertices[300:600, 0] = 1.5
    direction = pulses.direction.copy()
    direction[0, ::2] = 0.0
    level = pulses_of(pulses.origin, direction / np.linalg.norm(direction, axis=0))
    plan = planned(replace(mesh, vertices=vertices), rays)
    forced = altered(plan, target=Target(ScannedScene(replace(mesh, vertices=vertices), ()), Forced))
    faces = forced.target.caster.cast(*(array.T.astype(np.float32) for array in (level.origin, level.direction)), 500.0)
    ranges, along = FacePlanes(replace(mesh, vertices=vertices)).intersect(faces, level.origin, level.direction)
    assert (along[faces >= 0] == 0.0).any()
    assert (~np.isfinite(ranges[faces >= 0])).any()
    assert (ranges[faces >= 0] < 0.0).any()
    assert_same(forced, level)


@pytest.mark.skipif(platform.machine().lower() not in ("x86_64", "amd64"), reason="one version for all processors")
def test_processors_without_wide_instructions_agree(monkeypatch: pytest.MonkeyPatch) -> None:
    plan, pulses = planned(soup(), 19, attenuation=0.01), downwards(2000)
    kernel = plan.pulse_kernel
    assert isinstance(kernel, PulseKernel)
    usual, narrow = kernel.trace(pulses, [])[1], SimpleNamespace()
    for name in ("first", "cast_behind", "weigh_behind", "group", "describe"):
        function = getattr(load_kernel("pulses"), f"synthroads_{name}{'' if name == 'describe' else '_narrow'}")
        known = getattr(_load(), f"synthroads_{name}")
        function.restype, function.argtypes = known.restype, known.argtypes
        setattr(narrow, f"synthroads_{name}", function)
    monkeypatch.setattr(kernel, "_kernel", narrow)
    other = kernel.trace(pulses, [])[1]
    for name in ("pulse", "range", "intensity", "weight"):
        assert_bytes(getattr(other, name), getattr(usual, name))


def test_why_numpy_does_all_is_said() -> None:
    plan = planned(soup(50), 7)
    driving = MovingMesh(soup(9), LinearMotion((1.0, 0.0, 0.0)))
    mixed = Target(ScannedScene(soup(9), (driving,)), lambda one: (Cast if len(one.triangles) > 9 else BruteForce)(one))
    half = Target(ScannedScene(soup(10), (driving,)), lambda one: (Cast if len(one.triangles) > 9 else BruteForce)(one))
    cases: dict[str, ScanPlan] = {
        "no rays are cast in packets": altered(plan, target=mixed),
        "no rays are cast in packets at what moves": altered(plan, target=half),
        "faces are of materials that aren't there": altered(plan, surfaces=surfaces_of([materials()["asphalt"]])),
    }
    assert str(scan_of(plane(), 7).pulse_kernel) == "no rays are cast in packets"
    for reason, one in cases.items():
        assert str(one.pulse_kernel) == reason
        assert isinstance(one.pulse_kernel, NoKernelError)
    assert isinstance(plan.pulse_kernel, PulseKernel)


@pytest.mark.parametrize("name", ["origin", "direction", "in_plane", "across"])
def test_pulses_without_all_their_vectors_are_refused(name: str) -> None:
    plan, pulses = planned(soup(50), 7), downwards(20)
    assert isinstance(plan.pulse_kernel, PulseKernel)
    for wrong in (getattr(pulses, name)[:, :5], getattr(pulses, name)[:2], None):
        with pytest.raises(ValueError, match=r"vectors of pulses must each have the shape \(3, 20\)"):
            plan.pulse_kernel.trace(replace(pulses, **{name: wrong}), [])
