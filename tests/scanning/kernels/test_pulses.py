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
from synthroads_addon.scanning.colour.surfaces import SceneSurfaces
from synthroads_addon.scanning.colour.transparency import SeeThrough, Transparency
from synthroads_addon.scanning.kernels.library import NoKernelError, load_kernel
from synthroads_addon.scanning.kernels.packets import USUAL, Packets, PacketScene, usable_packets
from synthroads_addon.scanning.kernels.pulses import PulseKernel, TracedPulses, _load
from synthroads_addon.scanning.multipath import Multipath
from synthroads_addon.scanning.plan import ScanPlan
from synthroads_addon.scanning.pulses import Pulses
from synthroads_addon.scanning.returns import Echoes
from synthroads_addon.scanning.scan import BlockScan
from synthroads_addon.scanning.scene.bare_ground import BareGround
from synthroads_addon.scanning.scene.caster import FacePlanes
from synthroads_addon.scanning.scene.mesh import SceneMesh
from synthroads_addon.scanning.scene.motion import LinearMotion, MovingMesh, ScannedScene
from synthroads_addon.scanning.scene.target import Target
from synthroads_addon.scanning.sparing import Traced
from tests.helpers.scenes.scan_scenes import Standing, mesh_of, plane, scan_of

pytestmark = pytest.mark.any_blender

STRIP = Standing.strips[0]


class Cast(PacketScene):
    """A caster of packets, without Blender."""

    name = "embree"
    main_thread_only = False
    kernels = "packets"

    def __init__(self, mesh: SceneMesh, **packing: Any) -> None:
        packets = usable_packets()
        assert isinstance(packets, Packets), f"{packets}: python tools/build_kernels.py"
        super().__init__(packets, mesh.vertices, mesh.triangles, packing=replace(USUAL, **packing))


def planned(mesh: SceneMesh, rays: int = 7, packing: dict[str, Any] | None = None, **changes: Any) -> ScanPlan:
    """Return the plan of a scan of a mesh by packets, with everything of its materials that light meets."""
    plan = scan_of(mesh, rays)
    of_setting = [name for name in changes if hasattr(plan.setting, name)]
    setting = replace(plan.setting, **{name: changes.pop(name) for name in of_setting})
    target = Target(ScannedScene(mesh, ()), lambda one: Cast(one, **(packing or {})))
    surfaces = surfaces_of((materials()[name] for name in mesh.materials), "oren_nayar")
    return replace(plan, target=target, surfaces=surfaces, setting=setting, **changes)


def by_numpy(plan: ScanPlan) -> ScanPlan:
    """Return the plan, carried out by NumPy."""
    result = replace(plan)
    vars(result)["pulse_kernel"] = NoKernelError("compared with")
    return result


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
NAMES = ("asphalt", "leaves", "sheeting_white", "birch_leaves", "glass", "paint_white", "wire_mesh", "reflector")


def soup(count: int = 3000, seed: int = 1, spread: float = 12.0) -> SceneMesh:
    """Return triangles here and there, of all kinds of materials: leaves, panes, reflectors."""
    random = stream(seed, "soup")
    middle = random.uniform(-spread, spread, (count, 1, 3)) * [1, 1, 0.5]
    vertices = (middle + random.normal(0, 0.7, (count, 3, 3))).reshape(-1, 3)
    mesh = mesh_of(vertices, np.arange(3 * count).reshape(-1, 3))
    return replace(mesh, material=random.integers(0, len(NAMES), count).astype(np.uint16), materials=NAMES)


def stack(leaves: int, material: str = "leaves") -> SceneMesh:
    """Return level squares of what lets light through, one below the other, above a floor."""
    heights = [*np.linspace(5.0, 0.5, leaves).tolist(), 0.0]
    corners = [(x, y, z) for z in heights for x, y in ((-20, -20), (20, -20), (20, 20), (-20, 20))]
    first = 4 * np.arange(len(heights))[:, None]
    triangles = np.stack([first + [0, 1, 2], first + [0, 2, 3]], axis=1).reshape(-1, 3)
    numbers = np.repeat((np.arange(len(heights)) < leaves).astype(np.uint16), 2)
    return replace(mesh_of(corners, triangles), material=numbers, materials=("asphalt", material))


def downwards(count: int, seed: int = 2, height: float = 30.0, width: float = 15.0) -> Pulses:
    """Return pulses from above, in lines."""
    random = stream(seed, "pulses")
    origin = np.zeros((3, count))
    origin[0], origin[2] = np.linspace(-width, width, count), height
    target = np.stack([origin[0], width * np.sin(np.arange(count) * 0.05), random.normal(0, 1, count)])
    direction = target - origin
    return pulses_of(origin, direction / np.linalg.norm(direction, axis=0))


def pulses_of(origin: np.ndarray, direction: np.ndarray) -> Pulses:
    """Return pulses by their axes."""
    count = origin.shape[1]
    with np.errstate(all="ignore"):
        in_plane = np.cross(direction, [[1.0], [0.0], [0.0]], axis=0)
        in_plane /= np.linalg.norm(in_plane, axis=0)
        across = np.cross(direction, in_plane, axis=0)
    time, channel = np.arange(count) * 1e-5, np.zeros(count, np.uint8)
    return Pulses(time, np.zeros(count), channel, origin, direction, in_plane, across, origin, direction)


def assert_same(plan: ScanPlan, pulses: Pulses) -> Echoes:
    """Assert that both ways give the same bytes, and return the echoes."""
    assert isinstance(plan.pulse_kernel, PulseKernel)
    found, expected = (BlockScan(one).traced_echoes(STRIP, pulses, [], 0) for one in (plan, by_numpy(plan)))
    assert isinstance(found[0], TracedPulses) == (len(pulses.time) > 1)
    assert found[2] == expected[2]
    for name in ("pulse", "range", "intensity", "weight"):
        assert_bytes(getattr(found[1], name), getattr(expected[1], name))
    for mine, theirs in zip(known(found[0], found[1].hit), known(expected[0], expected[1].hit), strict=True):
        assert_bytes(mine, theirs)
    return found[1]


def known(traced: Traced, hit: np.ndarray) -> list[np.ndarray]:
    """Return all that is asked of hits."""
    picked = [traced.pick(name, hit) for name in ("face", "material", "along")]
    return [*picked, *traced.ends(hit), traced.directions(hit), traced.times(hit)]


def assert_bytes(found: np.ndarray, expected: np.ndarray) -> None:
    assert found.dtype == expected.dtype
    assert found.shape == expected.shape
    np.testing.assert_array_equal(found, expected)
    assert np.ascontiguousarray(found).tobytes() == np.ascontiguousarray(expected).tobytes()


@pytest.mark.parametrize("rays", RINGS)
@pytest.mark.parametrize("attenuation", [0.0, 0.02])
def test_leaves_panes_and_reflectors_send_back_the_same_bytes(rays: int, attenuation: float) -> None:
    plan = planned(soup(), rays, attenuation=attenuation)
    assert plan.surfaces.permeable
    assert plan.surfaces.retroreflective
    assert plan.surfaces.rough
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
    forced = replace(plan, target=Target(ScannedScene(replace(mesh, vertices=vertices), ()), Forced))
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
    usual, narrow = kernel.trace(pulses)[1], SimpleNamespace()
    for name in ("first", "behind", "group", "describe"):
        function = getattr(load_kernel("pulses"), f"synthroads_{name}{'' if name == 'describe' else '_narrow'}")
        known = getattr(_load(), f"synthroads_{name}")
        function.restype, function.argtypes = known.restype, known.argtypes
        setattr(narrow, f"synthroads_{name}", function)
    monkeypatch.setattr(kernel, "_kernel", narrow)
    other = kernel.trace(pulses)[1]
    for name in ("pulse", "range", "intensity", "weight"):
        assert_bytes(getattr(other, name), getattr(usual, name))


def test_what_is_left_to_numpy_is_said() -> None:
    plan = planned(soup(50), 7)
    clear = SeeThrough(SceneSurfaces(soup(50)), {0: Transparency(frozenset(), lambda _: np.ones(1))})
    driving = MovingMesh(soup(9), LinearMotion((1.0, 0.0, 0.0)))
    rain: Any = SimpleNamespace(name="rain")
    cases: dict[str, ScanPlan] = {
        "footprints are spared": replace(plan, ground=object.__new__(BareGround)),
        "the air sends echoes": replace(plan, effects=(rain,)),
        "surfaces mirror": replace(plan, multipath=object.__new__(Multipath)),
        "the beam is cylindrical": replace(plan, beam="cylindrical"),
        "materials are clear in places": replace(plan, transparency=clear),
        "things move": replace(plan, target=Target(ScannedScene(soup(9), (driving,)), Cast)),
        "no rays are cast in packets": scan_of(plane(), 7),
        "faces are of materials that aren't there": replace(plan, surfaces=surfaces_of([materials()["asphalt"]])),
    }
    for reason, one in cases.items():
        assert str(one.pulse_kernel) == reason
        assert isinstance(one.pulse_kernel, NoKernelError)
    assert isinstance(plan.pulse_kernel, PulseKernel)
    assert isinstance(replace(plan, beam="cylindrical", rings=()).pulse_kernel, PulseKernel)


@pytest.mark.parametrize("name", ["origin", "direction", "in_plane", "across"])
def test_pulses_without_all_their_vectors_are_refused(name: str) -> None:
    plan, pulses = planned(soup(50), 7), downwards(20)
    assert isinstance(plan.pulse_kernel, PulseKernel)
    for wrong in (getattr(pulses, name)[:, :5], getattr(pulses, name)[:2], None):
        with pytest.raises(ValueError, match=r"vectors of pulses .*: 4 of \(3, 20\)"):
            plan.pulse_kernel.trace(replace(pulses, **{name: wrong}))
