"""Pulses over scenes of all that light meets, and the check that compiled loops make of them what NumPy does."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from synthroads_addon.base.random_streams import stream
from synthroads_addon.materials.surfaces import surfaces_of
from synthroads_addon.materials.table import materials
from synthroads_addon.scanning.kernels.hits import TracedPulses
from synthroads_addon.scanning.kernels.library import NoKernelError
from synthroads_addon.scanning.kernels.packets import USUAL, Packets, PacketScene, usable_packets
from synthroads_addon.scanning.kernels.pulses import PulseKernel
from synthroads_addon.scanning.plan import ScanPlan
from synthroads_addon.scanning.pulses import Pulses
from synthroads_addon.scanning.returns import Echoes
from synthroads_addon.scanning.scan import BlockScan
from synthroads_addon.scanning.scene.mesh import SceneMesh
from synthroads_addon.scanning.scene.motion import MovingMesh, ScannedScene
from synthroads_addon.scanning.scene.target import Target
from synthroads_addon.scanning.sparing import Traced
from tests.helpers.scenes.scan_scenes import Standing, altered, mesh_of, scan_of

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


def planned(
    mesh: SceneMesh,
    rays: int = 7,
    packing: dict[str, Any] | None = None,
    moving: Sequence[MovingMesh] = (),
    **changes: Any,
) -> ScanPlan:
    """Return the plan of a scan of a mesh by packets, with everything of its materials that light meets.

    Args:
        packing: of the rays.
        moving: what moves.
        changes: of the plan or of the scanner's setting.
    """
    plan = scan_of(mesh, rays)
    of_setting = [name for name in changes if hasattr(plan.setting, name)]
    setting = replace(plan.setting, **{name: changes.pop(name) for name in of_setting})
    target = Target(ScannedScene(mesh, tuple(moving)), lambda one: Cast(one, **(packing or {})))
    surfaces = surfaces_of((materials()[name] for name in mesh.materials), "oren_nayar")
    return altered(plan, target=target, surfaces=surfaces, setting=setting, **changes)


def by_numpy(plan: ScanPlan) -> ScanPlan:
    """Return the plan, carried out by NumPy."""
    result = replace(plan)
    vars(result)["pulse_kernel"] = NoKernelError("compared with")
    return result


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
    end = float(pulses.time.max(initial=0.0))
    found, expected = (
        BlockScan(one).tracer.traced_echoes(STRIP, pulses, one.target.motions(0.0, end, 0.01), 0)
        for one in (plan, by_numpy(plan))
    )
    whole = not (plan.atmosphere.effects or plan.reflection.multipath or plan.spares)
    assert isinstance(found[0], TracedPulses) == (whole and len(pulses.time) > 1)
    assert isinstance(expected[0], TracedPulses) is False
    assert found[2].rays == expected[2].rays
    np.testing.assert_array_equal(found[2].footprints, expected[2].footprints)
    for name in ("pulse", "range", "intensity", "weight"):
        assert_bytes(getattr(found[1], name), getattr(expected[1], name))
    for mine, theirs in zip(known(found[0], found[1].hit), known(expected[0], expected[1].hit), strict=True):
        assert_bytes(mine, theirs)
    return found[1]


def known(traced: Traced, hit: np.ndarray) -> list[np.ndarray]:
    """Return all that is asked of hits."""
    picked = [traced.pick(name, hit) for name in ("face", "material", "cosine")]
    return [*picked, *traced.ends(hit), traced.directions(hit), traced.times(hit)]


def assert_bytes(found: np.ndarray, expected: np.ndarray) -> None:
    assert found.dtype == expected.dtype
    assert found.shape == expected.shape
    np.testing.assert_array_equal(found, expected)
    assert np.ascontiguousarray(found).tobytes() == np.ascontiguousarray(expected).tobytes()
