"""Spared footprints give the returns of full ones, and whatever is near a footprint is cast in full."""

from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from synthroads_addon.base.classes import class_id
from synthroads_addon.materials.surfaces import surfaces_of
from synthroads_addon.materials.table import materials
from synthroads_addon.scanning.beam import RINGS, outer_radii
from synthroads_addon.scanning.plan import ScanPlan
from synthroads_addon.scanning.scan import BlockResult
from synthroads_addon.scanning.scene.bare_ground import BareGround
from synthroads_addon.scanning.scene.mesh import SceneMesh
from synthroads_addon.scanning.weather.registry import WEATHERS
from tests.helpers.scenes.scan_scenes import Standing, altered, mesh_of, plane, scan_of, scan_pulses

PULSES = 400
"""Of a line, around the nadir: 72 degrees."""
Part = tuple[Sequence[tuple[float, float, float]], str, str]
"""Corners of a flat convex face, its class and its material."""


def scene(*parts: Part) -> SceneMesh:
    """Return a scene of flat faces."""
    names = sorted({material for _, _, material in parts})
    vertices: list[tuple[float, float, float]] = []
    triangles, labels, numbers = [], [], []
    for corners, label, material in parts:
        first = len(vertices)
        vertices += corners
        triangles += [(first, first + i, first + i + 1) for i in range(1, len(corners) - 1)]
        labels += [class_id(label)] * (len(corners) - 2)
        numbers += [names.index(material)] * (len(corners) - 2)
    return replace(
        mesh_of(vertices, triangles),
        class_id=np.array(labels, np.uint8),
        material=np.array(numbers, np.uint16),
        materials=tuple(names),
    )


def rectangle(x: float, y: float, width: float, depth: float, z: float = 0.0, slope: float = 0.0) -> list:
    """Return the corners of a rectangle about a place, which rises along y."""
    half = width / 2.0, depth / 2.0
    signs = ((-1, -1), (1, -1), (1, 1), (-1, 1))
    return [(x + a * half[0], y + b * half[1], z + slope * (y + b * half[1])) for a, b in signs]


def upright(x: float, y: float, width: float, height: float) -> list:
    """Return the corners of a rectangle that stands across y, from its foot on the right at x."""
    return [(x, y, 0.0), (x + width, y, 0.0), (x + width, y, height), (x, y, height)]


ROAD: Part = (rectangle(0, 0, 130, 130), "road", "asphalt")
DIVERGENCE = (4e-3, 2e-3)


def both(mesh: SceneMesh, rays: int = 7, **changes) -> tuple[BlockResult, BlockResult, ScanPlan]:
    """Return what a line gives with footprints in full and where needed, and the plan of the latter."""
    named = {name: changes.pop(name) for name in ("beam", "surfaces", "path") if name in changes}
    scan = scan_of(mesh, rays, named.pop("path", None), divergence=DIVERGENCE, **changes)
    scan = altered(scan, **named)
    ground = BareGround(mesh, scan.reflection.surfaces.pervious, 60.0 * max(outer_radii(RINGS[rays], DIVERGENCE)))
    spared = altered(scan, ground=ground)
    strip, first = scan.path.strips[0], 500 - PULSES // 2
    return *(scan_pulses(one, strip, first, PULSES) for one in (scan, spared)), spared


def assert_same(full: BlockResult, spared: BlockResult, tolerance: float = 1e-9) -> None:
    """Check that both have the same returns."""
    a, b = full.points, spared.points
    for name in ("gps_time", "return_number", "number_of_returns", "class_id", "instance_id"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name), err_msg=name)
    np.testing.assert_allclose(b.range, a.range, atol=tolerance, rtol=0.0)
    np.testing.assert_allclose(b.intensity, a.intensity, rtol=max(tolerance, 1e-8))
    np.testing.assert_allclose(b.xyz, a.xyz, atol=2.0 * tolerance, rtol=0.0)
    np.testing.assert_array_equal(a.incidence_deg, b.incidence_deg)


def shares(result: BlockResult) -> tuple[float, float]:
    """Return which shares of the pulses that met something were one ray, and were looked along."""
    assert result.footprints is not None
    met, one, checked = result.footprints.sum(axis=1)
    return one / met, checked / met


@pytest.mark.parametrize("rays", [7, 19])
@pytest.mark.parametrize("beam", ["conical", "cylindrical"])
@pytest.mark.parametrize("slope", [(0.0, 0.0), (0.3, -0.6)])
def test_a_plane_is_one_ray_and_gives_the_full_footprints_returns(slope, beam, rays) -> None:
    full, spared, _ = both(plane(60.0, slope), rays, beam=beam)
    assert_same(full, spared)
    one, checked = shares(spared)
    assert one > (0.7 if any(slope) else 0.999)  # not all beams along a slope are known to pass what is farther up
    assert checked == 0.0
    assert full.rays == full.pulses * rays
    assert spared.rays <= full.rays - round(one * spared.footprints[0].sum()) * (rays - 1)


def test_rough_and_retroreflective_surfaces_are_as_bright() -> None:
    paint = materials()["paint_white"].model_copy(
        update={"facet_slope": 0.5, "retroreflection": 2.0, "retro_lobe_deg": 20.0}
    )
    full, spared, _ = both(plane(60.0, (0.2, 0.1)), surfaces=surfaces_of([paint], "oren_nayar"))
    assert_same(full, spared)
    assert shares(spared)[0] > 0.9


def test_the_edge_of_a_marking_is_cast_in_full() -> None:
    marking: Part = (rectangle(0, 5.0, 130, 3.0, 0.003), "road_marking", "paint_white")
    full, spared, plan = both(scene(ROAD, marking))
    assert_same(full, spared)
    mixed = np.abs(np.abs(full.points.xyz[:, 1] - plan.target.origin[1] - 5.0) - 1.5) < 0.05
    assert mixed.any()
    one, checked = shares(spared)
    assert checked == 0.0
    assert 0.9 < one < 1.0
    # What the edge does to a return is more than what is tolerated: had it been spared, it would show.
    with_edges_lost = altered(plan, ground=without_edges(plan))
    lost = scan_pulses(with_edges_lost, plan.path.strips[0], 500 - PULSES // 2, PULSES)
    assert np.abs(lost.points.intensity / full.points.intensity - 1.0).max() > 0.05


def without_edges(plan: ScanPlan) -> BareGround:
    """Return a plan's ground as if its planes ended nowhere."""
    wrong = BareGround(scene(ROAD), np.zeros(1, bool), 0.1)
    wrong.face = plan.emission.ground.face
    return wrong


def test_a_crease_is_cast_in_full_and_a_slight_one_is_none() -> None:
    for angle, least, most in ((0.1, 0.9, 0.999), (0.002, 1.0, 1.0)):
        vertices = [(x, y, -abs(y) * angle / 2) for y in (-60.0, 0.0, 60.0) for x in (-60.0, 60.0)]
        mesh = mesh_of(vertices, [(0, 1, 3), (0, 3, 2), (2, 3, 5), (2, 5, 4)])
        full, spared, _ = both(mesh)
        assert_same(full, spared, 5e-5)
        one, checked = shares(spared)
        assert least <= one + checked <= most


@pytest.mark.parametrize("thing", ["post", "wire", "sign", "leaf"])
def test_what_stands_in_a_beam_is_met(thing: str) -> None:
    """Within the footprint, or on the way, or both: no return is lost."""
    faces: dict[str, Part] = {
        "post": (upright(0.03, 12.0, 0.06, 4.0), "warning_post", "plastic_white"),
        "wire": (rectangle(0.0, -12.0, 120.0, 0.15, 6.0), "utility", "rubber"),
        "sign": (upright(0.03, -20.0, 2.0, 5.0), "road_sign", "sheeting_white"),
        "leaf": (rectangle(0.05, 15.0, 0.15, 0.3, 2.0), "vegetation", "maple_leaves"),
    }
    full, spared, plan = both(scene(ROAD, faces[thing]))
    assert_same(full, spared)
    label = class_id(faces[thing][1])
    assert (full.points.class_id == label).any() or (full.points.number_of_returns > 1).any()
    one, checked = shares(spared)
    assert one > 0.85
    assert one + checked < 1.0
    # Where nothing but the ground is known, the pulses at the thing lose it.
    blind = altered(plan, ground=without_edges(plan))
    lost = scan_pulses(blind, plan.path.strips[0], 500 - PULSES // 2, PULSES)
    assert len(lost.points) < len(full.points) or not np.allclose(lost.points.intensity, full.points.intensity)


def test_ground_beside_grass_is_looked_at_along_every_ray() -> None:
    """Blades stand too densely to be told from the ground by their height: rays that only ask for anything tell."""
    random = np.random.default_rng(4)
    blades: list[Part] = [
        (upright(-0.02, y, 0.04, height)[:3], "vegetation", "leaves")
        for y, height in zip(np.arange(5.0, 25.0, 0.35), random.uniform(0.1, 0.4, 58), strict=True)
    ]
    full, spared, _ = both(scene(ROAD, *blades))
    assert_same(full, spared)
    one, checked = shares(spared)
    assert checked > 0.05
    assert one > 0.5


def test_beyond_the_devices_reach_and_at_grazing_angles_footprints_are_full() -> None:
    """Of a footprint at the end of the range a part gives a return, and a grazing one gives several."""
    mesh = plane(60.0)
    for changes in ({"maximum_range": 61.0}, {"minimum_range": 61.0}, {"range_resolution": 0.05}):
        full, spared, _ = both(mesh, **changes)
        assert_same(full, spared)
        assert 0.05 < shares(spared)[0] < 1.0
    low = Standing(height=0.6)
    full, spared, _ = both(mesh, path=low)
    assert_same(full, spared)


def test_pulses_that_pass_by_everything_are_one_ray() -> None:
    """Beside a narrow road, from above and below; not where a tree's crown is in the beam."""
    strip: Part = (rectangle(0, 0, 40, 40), "road", "asphalt")
    crown: Part = (rectangle(0.05, 19.0, 0.3, 4.0, 9.0), "vegetation", "maple_leaves")
    full, spared, plan = both(scene(strip, crown))
    assert_same(full, spared)
    met = int(spared.footprints[0].sum())
    assert met < PULSES / 1.5
    assert spared.rays < full.rays / 4
    blind = altered(plan, ground=without_things(plan))
    lost = scan_pulses(blind, plan.path.strips[0], 500 - PULSES // 2, PULSES)
    assert len(lost.points) < len(full.points)


def without_things(plan: ScanPlan) -> BareGround:
    """Return a plan's ground as if nothing stood on it."""
    wrong = object.__new__(BareGround)
    wrong.__dict__ |= plan.emission.ground.__dict__ | {
        "_things": SimpleNamespace(passed_by=lambda corner, *_: corner[0] < 1e9)
    }
    return wrong


def test_nothing_is_spared_of_one_ray_nor_where_the_air_sends_echoes() -> None:
    mesh = plane(60.0)
    scan = scan_of(mesh, 7)
    ground = BareGround(mesh, scan.reflection.surfaces.pervious, 0.1)
    assert altered(scan, ground=ground).spares
    assert not altered(scan, ground=ground, rings=()).spares
    assert not altered(
        scan, ground=ground, effects=WEATHERS["fog"](condition="fog", visibility=100.0, echoes=True).effects()
    ).spares


def test_a_scene_without_ground_has_nothing_to_spare() -> None:
    mesh = scene((rectangle(0, 0, 130, 130), "vehicle", "car_paint"))
    full, spared, _ = both(mesh)
    assert_same(full, spared)
    assert shares(spared) == (0.0, 0.0)
