"""Panes, spared footprints, parallel rays, drops and mirrors, compiled: byte for byte what NumPy makes of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest

from synthroads_addon.base.classes import class_id
from synthroads_addon.base.random_streams import stream
from synthroads_addon.materials.surfaces import surfaces_of
from synthroads_addon.materials.table import materials
from synthroads_addon.scanning.beam import RINGS, outer_radii
from synthroads_addon.scanning.colour.surfaces import SceneSurfaces
from synthroads_addon.scanning.colour.transparency import SeeThrough, Transparency
from synthroads_addon.scanning.effects import EchoChanges, PulseHits
from synthroads_addon.scanning.kernels.pulses import PulseKernel
from synthroads_addon.scanning.multipath import Mirrors, Multipath
from synthroads_addon.scanning.plan import ScanPlan
from synthroads_addon.scanning.scan import BlockScan
from synthroads_addon.scanning.scene.bare_ground import BareGround
from synthroads_addon.scanning.scene.mesh import SceneMesh
from synthroads_addon.scanning.scene.motion import LinearMotion, MovingMesh
from synthroads_addon.scanning.scene.surface_values import ALONG, POSITION, SurfaceInput
from synthroads_addon.scanning.trace import CLEAR_LAYERS, Hits
from tests.helpers.scenes.kernel_scenes import NAMES, assert_bytes, assert_same, downwards, planned, soup, stack
from tests.helpers.scenes.scan_scenes import altered, mesh_of

pytestmark = pytest.mark.any_blender

WIDE = (0.02, 0.01)
"""Divergence, rad."""


def here_and_there(values: Mapping[SurfaceInput, np.ndarray]) -> np.ndarray:
    """Return shares that differ from place to place: open, half open, solid."""
    x, y, z, _ = values[POSITION].T
    return np.round(np.sin(3.0 * x + y) + 0.5 * np.cos(7.0 * z) + 0.5 * np.abs(values[ALONG][:, 0]), 1)


def with_panes(plan: ScanPlan, mesh: SceneMesh, clear: tuple[int, ...]) -> ScanPlan:
    """Return the plan with materials that are clear in places."""
    see = SeeThrough(
        SceneSurfaces(mesh), dict.fromkeys(clear, Transparency(frozenset({POSITION, ALONG}), here_and_there))
    )
    surfaces = surfaces_of((materials()[name] for name in mesh.materials), "oren_nayar", clear=clear)
    return altered(plan, surfaces=surfaces, transparency=see)


class Drops:
    """An effect that adds echoes to many rays, some of which miss everything, and weakens the others."""

    name = "drops"

    def change_echoes(self, hits: PulseHits, random: np.random.Generator) -> EchoChanges:
        """Return drops, by what is met and how bright it is."""
        rays, pulses = hits.distance.shape
        count = rays * pulses // 3
        distance = random.uniform(1.0, 60.0, count)
        dim = np.where(hits.brightness > 0.4, 0.0, random.uniform(0.2, 1.0, hits.distance.shape))
        ray, pulse = random.integers(0, rays, count), random.integers(0, pulses, count)
        return EchoChanges(pulse, ray, distance, random.uniform(0.0, 0.5, count), dim)


def mirrors() -> Multipath:
    """Return mirrors of nearly all materials."""
    count = len(NAMES)
    return Multipath(Mirrors(np.linspace(0.0, 0.6, count), np.linspace(0.002, 0.05, count)), 3.0)


def driving() -> list[MovingMesh]:
    """Return two bodies that drive through the scene."""
    return [
        MovingMesh(soup(80, 5, 2.0), LinearMotion((30.0, 0.0, 0.0), (-4.0, 1.0, 5.0))),
        MovingMesh(soup(80, 6, 2.0), LinearMotion((-30.0, 1.0, 0.0), (5.0, -2.0, 3.0))),
    ]


@pytest.mark.parametrize("rays", RINGS)
@pytest.mark.parametrize("moving", [False, True])
def test_materials_that_are_clear_in_places(rays: int, moving: bool) -> None:
    mesh = soup(2500)
    plan = planned(
        mesh, rays, moving=driving() if moving else (), divergence=WIDE, frame_origin=np.array([3e5, 7.0, 1.0])
    )
    echoes = assert_same(with_panes(plan, mesh, (0, 3, 4)), downwards(2001))
    solid = assert_same(plan, downwards(2001))
    assert not np.array_equal(echoes.pulse, solid.pulse) or (echoes.range > solid.range + 0.1).any()


@pytest.mark.parametrize("name", ["asphalt", "glass"])
def test_more_panes_than_a_ray_passes(name: str) -> None:
    """Open ones take nothing: a ray passes hundreds, of which two lie nearer than it goes on behind one."""
    mesh = stack(2 * CLEAR_LAYERS, "glass")
    mesh = replace(mesh, materials=("asphalt", name))
    mesh.vertices[4:8, 2] = mesh.vertices[0:4, 2] - 2e-4
    plan = with_panes(planned(mesh, 7), mesh, (1,))
    whole = Transparency(frozenset({POSITION}), lambda _: np.ones(1))
    assert plan.reflection.transparency is not None
    assert_same(altered(plan, transparency=replace(plan.reflection.transparency, materials={1: whole})), downwards(200))
    assert_same(plan, downwards(500))


def test_panes_that_rounding_puts_before_themselves() -> None:
    """Kilometres from the origin rays begin again before the very pane that they have passed."""
    mesh, away = stack(9, "glass"), np.array([3e4, 0.0, 0.0])
    mesh = with_vertices(mesh, mesh.vertices.astype(np.float64) + away)
    pulses = downwards(3000)
    plan = with_panes(planned(mesh, 7), mesh, (1,))
    assert_same(plan, replace(pulses, origin=pulses.origin + away[:, None]))


def with_vertices(mesh: SceneMesh, vertices: np.ndarray) -> SceneMesh:
    """Return a mesh with other vertices, which are tilted so that they lie between numbers of single precision."""
    tilted = vertices + np.stack(
        [np.zeros(len(vertices)), np.zeros(len(vertices)), 0.3 * (vertices[:, 0] - 3e4)], axis=1
    )
    return replace(mesh, vertices=tilted.astype(np.float32))


@pytest.mark.parametrize("rays", RINGS)
@pytest.mark.parametrize("changes", [{}, {"attenuation": 0.02}, {"range_resolution": 3.0}])
def test_parallel_rays(rays: int, changes: dict[str, Any]) -> None:
    plan = planned(soup(2500), rays, divergence=WIDE, **changes)
    parallel = altered(plan, beam="cylindrical")
    first, other = assert_same(parallel, downwards(2001)), assert_same(plan, downwards(2001))
    assert (len(first.pulse) == len(other.pulse)) == (rays == 1)


def test_parallel_rays_over_things_that_move() -> None:
    plan = altered(planned(soup(1000), 19, moving=driving(), divergence=(0.2, 0.1)), beam="cylindrical")
    assert_same(plan, downwards(3001))


def street() -> SceneMesh:
    """Return level road with leaves and things over it here and there."""
    things, corner = soup(40), 60.0
    square = [(-corner, -corner, 0.0), (corner, -corner, 0.0), (corner, corner, 0.0), (-corner, corner, 0.0)]
    vertices = np.concatenate([square, things.vertices + [0.0, 0.0, 4.0]])
    mesh = mesh_of(vertices, np.concatenate([[[0, 1, 2], [0, 2, 3]], things.triangles + 4]))
    labels = np.full(len(mesh), class_id("road_sign"), np.uint8)
    labels[:2] = class_id("road")
    number = np.concatenate([[0, 0], things.material]).astype(np.uint16)
    return replace(mesh, class_id=labels, material=number, materials=NAMES)


@pytest.mark.parametrize("rays", [rays for rays in RINGS if rays > 1])
@pytest.mark.parametrize("beam", ["conical", "cylindrical"])
@pytest.mark.parametrize("moving", [False, True])
def test_spared_footprints(rays: int, beam: Any, moving: bool) -> None:
    mesh, divergence = street(), (4e-3, 2e-3)
    plan = planned(mesh, rays, moving=driving() if moving else (), divergence=divergence, attenuation=0.01)
    ground = BareGround(mesh, plan.reflection.surfaces.pervious, 30.0 * max(outer_radii(RINGS[rays], divergence)))
    plan = altered(plan, ground=ground, beam=beam)
    assert plan.spares
    echoes = assert_same(plan, downwards(2001))
    assert np.count_nonzero(echoes.intensity) > 1000


@pytest.mark.parametrize("count", [1, 2, 3, 5, 17])
def test_few_pulses_whose_footprints_are_cast(count: int) -> None:
    mesh = street()
    plan = planned(mesh, 7, divergence=(4e-3, 2e-3))
    plan = altered(plan, ground=BareGround(mesh, plan.reflection.surfaces.pervious, 0.1))
    for seed in range(6):
        assert_same(plan, downwards(count, seed))


@pytest.mark.parametrize("rays", RINGS)
@pytest.mark.parametrize("what", ["drops", "mirrors", "both"])
@pytest.mark.parametrize("attenuation", [0.0, 0.02])
def test_drops_and_mirrors(rays: int, what: str, attenuation: float) -> None:
    plan = planned(soup(2500), rays, divergence=WIDE, attenuation=attenuation, threshold=1e-9)
    changed = altered(
        plan,
        effects=(Drops(), Drops()) if what != "mirrors" else (),
        multipath=mirrors() if what != "drops" else None,
    )
    echoes = assert_same(changed, downwards(2001))
    assert len(echoes.pulse) > len(assert_same(plan, downwards(2001)).pulse)


def test_all_that_rays_meet_is_known_as_numpy_knows_it() -> None:
    """Effects and mirrors, which change echoes before they are grouped, get the hits of all rays."""
    plan, pulses = planned(soup(2500), 7, moving=driving(), divergence=WIDE, attenuation=0.01), downwards(2001)
    kernel, motions = plan.pulse_kernel, plan.target.motions(0.0, 0.1, 0.01)
    assert isinstance(kernel, PulseKernel)
    numpys = BlockScan(plan).tracer
    expected = numpys.trace_rays(pulses, motions)
    (found, signals), theirs = kernel.follow(pulses, motions), numpys.signals(expected)
    assert_bytes(found.ray, expected.ray)
    assert_bytes(found.rays.share, expected.rays.share)
    for mine, other in ((found.first, expected.first), (found.behind, expected.behind)):
        met = other.face >= 0
        for field in fields(Hits):
            assert_bytes(*(np.broadcast_to(getattr(one, field.name), met.shape)[met] for one in (mine, other)))
    for mine, other in zip(signals, theirs, strict=True):
        assert_bytes(mine.distance, other.distance)
        assert_bytes(mine.intensity, other.intensity)
    rows = np.arange(0, found.count, 7)
    rows = rows[np.isfinite(expected.pick("distance", rows))]
    for mine, other in zip(found.ends(rows), expected.ends(rows), strict=True):
        assert_bytes(mine, other)
    assert_bytes(found.directions(rows), expected.directions(rows))
    assert_bytes(found.times(rows), expected.times(rows))


@pytest.mark.parametrize("seed", range(8))
def test_all_at_once(seed: int) -> None:
    random, mesh = stream(seed, "all"), soup(900, seed)
    rays = int(random.choice(list(RINGS)))
    plan = planned(mesh, rays, moving=driving(), divergence=tuple(random.uniform(0.0, 0.1, 2)), threshold=1e-9)
    plan = altered(plan, beam=random.choice(["conical", "cylindrical"]), attenuation=float(random.choice([0.0, 0.03])))
    if random.random() < 0.5:
        plan = with_panes(plan, mesh, (2, 4))
    assert_same(altered(plan, effects=(Drops(),), multipath=mirrors()), downwards(int(random.integers(2, 1500)), seed))
