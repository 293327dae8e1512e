"""Effects between tracing and returns: echoes that they add become points, and nothing changes without them."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
import pytest

from synthroads_addon.base.classes import UNLABELLED
from synthroads_addon.cloud.points import NO_MATERIAL, PointBlock
from synthroads_addon.materials.surfaces import surfaces_of
from synthroads_addon.materials.table import materials
from synthroads_addon.scanning.colour.colour import MaterialLayers, surface_constants
from synthroads_addon.scanning.effects import EchoChanges, PulseHits
from synthroads_addon.scanning.finish import Finish
from synthroads_addon.scanning.plan import ScanPlan
from synthroads_addon.scanning.relief.micro_relief import micro_relief
from synthroads_addon.scanning.scan import BlockResult
from synthroads_addon.scanning.scene.mesh import SceneMesh, empty_scene_mesh
from tests.helpers.scenes.scan_scenes import ORIGIN, Standing, altered, mesh_of, plane, scan_block, scan_of, scan_pulses

HEIGHT = 60.0
FULL_LINE = 1000  # pulses of the device's line, from left to right
EDGE = 59.0  # deg from the nadir, beyond which a pulse misses the ground


@dataclass(frozen=True)
class HalfRange:
    """Echoes at half the range of a tenth of the pulses; at 25 m where nothing is met."""

    name: str = "half range"
    share: float = 0.1
    brightness: float = 0.5

    def change_echoes(self, hits: PulseHits, random: np.random.Generator) -> EchoChanges:
        """Return the echoes, each of the pulse's first ray."""
        pulse = np.flatnonzero(random.random(len(hits.time)) < self.share)
        met = hits.distance[0, pulse]
        distance = np.where(met < np.inf, 0.5 * met, 25.0)
        ray, brightness = np.zeros(len(pulse), dtype=np.intp), np.full(len(pulse), self.brightness)
        return EchoChanges(pulse, ray, distance, brightness)


@dataclass(frozen=True)
class Curtain:
    """Half of the light is lost on the way, all of it in every second pulse."""

    name: str = "curtain"

    def change_echoes(self, hits: PulseHits, random: np.random.Generator) -> EchoChanges:
        """Return the transmission."""
        every_second = np.arange(hits.distance.shape[1]) % 2
        return EchoChanges(transmission=np.broadcast_to(0.5 * every_second, hits.distance.shape))


def everything(points: PointBlock) -> bytes:
    """Return all that points have."""
    return b"".join(array.tobytes() for array in points.attributes().values())


def scan_with(*effects: object, mesh: SceneMesh | None = None, rays: int = 1, **changes: object) -> ScanPlan:
    """Return a scan of a plane with effects, its points told where they were seen."""
    scan = scan_of(plane(100.0) if mesh is None else mesh, rays)
    layers = scan.layers.measured | {"material"}
    return altered(scan, effects=effects, seen_points=True, measured=layers, **changes)


def line(scan: ScanPlan, key: int = 0) -> BlockResult:
    """Scan the first line, from the horizon over the ground to the horizon."""
    return scan_pulses(scan, scan.path.strips[0], 0, FULL_LINE, key)


@pytest.mark.parametrize("rays", [1, 7])
def test_echoes_of_an_effect_become_points_in_the_air(rays: int) -> None:
    scan = scan_with(HalfRange(), rays=rays)
    result, plain = line(scan), line(scan_with(rays=rays))
    points, air = result.points, result.points.class_id == UNLABELLED
    assert 50 < air.sum() < 150
    # The others are the points of a scan without effects, but for the numbers of returns.
    ground = points.select(~air)
    for name in ("xyz", "intensity", "gps_time", "class_id", "instance_id", "normal", "material"):
        np.testing.assert_allclose(getattr(ground, name), getattr(plain.points, name), rtol=1e-15, err_msg=name)
    np.testing.assert_array_equal(points.instance_id[air], 0)
    np.testing.assert_array_equal(points.material[air], NO_MATERIAL)
    np.testing.assert_array_equal(result.seen.material[air], NO_MATERIAL)
    np.testing.assert_array_equal(points.incidence_deg[air], 0.0)
    towards = points.scanner[air] - points.xyz[air]
    towards /= np.linalg.norm(towards, axis=1)[:, None]
    np.testing.assert_allclose(np.einsum("ij,ij->i", points.normal[air], towards), 1.0, atol=1e-4)


def test_ranges_are_exact_and_returns_are_numbered() -> None:
    points = line(scan_with(HalfRange())).points
    air = points.class_id == UNLABELLED
    level = np.cos(np.deg2rad(points.scan_angle_deg.astype(float)))
    low = air & (np.abs(points.scan_angle_deg) < EDGE)
    np.testing.assert_allclose(points.range[low], 0.5 * HEIGHT / level[low], rtol=1e-6)
    np.testing.assert_array_equal(points.true_range[air], points.range[air])
    np.testing.assert_allclose(np.linalg.norm(points.xyz - points.scanner, axis=1), points.range, atol=1e-6)
    np.testing.assert_allclose(points.intensity[air], 0.5 / points.range[air] ** 2)
    both = np.isin(points.gps_time, points.gps_time[low])
    np.testing.assert_array_equal(points.return_number[both], np.tile([1, 2], low.sum()))
    np.testing.assert_array_equal(points.number_of_returns[both], 2)
    np.testing.assert_array_equal(air[both], np.tile([True, False], low.sum()))


def test_pulses_that_meet_nothing_have_echoes_too() -> None:
    points = line(scan_with(HalfRange())).points
    up = np.abs(points.scan_angle_deg) > EDGE + 0.1
    assert 20 < up.sum() < 60
    np.testing.assert_array_equal(points.range[up], 25.0)
    np.testing.assert_array_equal(points.class_id[up], UNLABELLED)
    np.testing.assert_array_equal(points.number_of_returns[up], 1)
    assert len(line(scan_with(HalfRange(), mesh=empty_scene_mesh(ORIGIN))).points) == 0


def test_the_order_of_blocks_and_other_effects_change_nothing() -> None:
    scan = scan_with(HalfRange())
    strip = scan.path.strips[0]
    forward = [everything(scan_block(scan, strip, block).points) for block in (0, 1, 2)]
    backward = [everything(scan_block(scan, strip, block).points) for block in (2, 1, 0)]
    assert forward == backward[::-1]
    first, second = (line(scan, key).points for key in (0, 1))
    assert set(first.gps_time[first.class_id == UNLABELLED]) != set(second.gps_time[second.class_id == UNLABELLED])
    other = line(scan_with(HalfRange("another name"))).points
    assert everything(other) != everything(first)


def test_an_effect_without_changes_and_none_at_all_are_the_same() -> None:
    for rays in (1, 7):
        assert everything(line(scan_with(HalfRange(share=0.0), rays=rays)).points) == everything(
            line(scan_with(rays=rays)).points
        )


def test_an_effect_weakens_what_is_met() -> None:
    dim, plain = line(scan_with(Curtain(), rays=7)).points, line(scan_with(rays=7)).points
    kept = plain.select(np.isin(plain.gps_time, dim.gps_time))
    assert len(dim) == pytest.approx(len(plain) / 2, abs=1)
    np.testing.assert_allclose(dim.range, kept.range)
    np.testing.assert_allclose(dim.intensity, 0.5 * kept.intensity)
    # Each effect sees what those before it have left: here nothing, so that echoes are 25 m away.
    both = line(scan_with(Curtain(), HalfRange(share=1.0))).points
    lost = ~np.isin(both.gps_time, dim.gps_time)
    np.testing.assert_array_equal(both.range[lost], 25.0)


def test_echoes_that_the_scanner_does_not_record_are_left_out() -> None:
    @dataclass(frozen=True)
    class OutOfReach(HalfRange):
        def change_echoes(self, hits: PulseHits, random: np.random.Generator) -> EchoChanges:
            far = hits.setting.maximum_range + 1.0
            near = hits.setting.minimum_range - 0.1
            return EchoChanges(np.array([5, 5]), np.array([0, 0]), np.array([near, far]), np.ones(2))

    assert everything(line(scan_with(OutOfReach())).points) == everything(line(scan_with()).points)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"pulse": np.array([FULL_LINE])}, "pulse of the added echoes must be 0 to 999 .*, but is 1000 to 1000"),
        ({"ray": np.array([-1])}, "ray of the added echoes must be 0 to 0"),
        ({"distance": np.array([np.nan])}, "distance of the added echoes must be finite"),
        ({"brightness": np.empty(0)}, "must have one value for each added echo, but have 1, 1, 1, 0 values"),
    ],
)
def test_wrong_echoes_are_refused(wrong: dict[str, np.ndarray], message: str) -> None:
    class Wrong(HalfRange):
        def change_echoes(self, hits: PulseHits, random: np.random.Generator) -> EchoChanges:
            none = np.zeros(1, dtype=np.intp)
            return replace(EchoChanges(none, none, np.ones(1), np.ones(1)), **wrong)

    with pytest.raises(ValueError, match=f"effect half range: .*{message}"):
        line(scan_with(Wrong()))


@pytest.mark.parametrize("by_layers", [False, True])
def test_points_in_the_air_go_through_colours_and_relief(by_layers: bool) -> None:
    """On plain, retro-reflective, permeable and rough ground: black, of no layer, as bright as they were."""
    for name in ("asphalt", "sheeting_white", "birch_leaves", "grass_ground"):
        mesh = mesh_of(plane(100.0).vertices, plane().triangles, name)
        rows = [materials()[name]]
        varying = surfaces_of(rows, spread=not by_layers)
        scan = scan_with(HalfRange(), mesh=mesh, surfaces=varying, after_layers=by_layers, seed=3)
        scan = altered(
            scan,
            coloured=frozenset({"rgb", "roughness"}),
            kept=frozenset({"material", "color_source", "true_range", "roughness"}),
            means=surfaces_of(rows),
            micro=micro_relief([name], rows),
            strength=1.0,
            octaves=2,
        )
        points = Finish(scan, MaterialLayers(surface_constants(rows))).finish_block(line(scan)).points
        air = points.material == NO_MATERIAL
        assert 50 < air.sum() < 150
        assert not points.rgb[air].any()
        assert not points.roughness[air].any()
        assert points.rgb[~air].any()
        np.testing.assert_allclose(points.intensity[air], 0.5 / points.true_range[air] ** 2)
        np.testing.assert_array_equal(points.range[air], points.true_range[air])


def test_all_arrays_of_hits_fit_together() -> None:
    seen: list[PulseHits] = []

    class Watching(HalfRange):
        def change_echoes(self, hits: PulseHits, random: np.random.Generator) -> EchoChanges:
            seen.append(hits)
            return super().change_echoes(hits, random)

    scan = scan_with(Watching(), Watching("second"), rays=7, path=Standing(), attenuation=1e-2)
    line(scan)
    first, second = seen
    assert first.distance.shape == first.brightness.shape == (7, FULL_LINE)
    assert first.origin.shape == first.direction.shape == (3, FULL_LINE)
    assert first.share.sum() == pytest.approx(1.0)
    met = first.distance < np.inf
    assert not first.brightness[~met].any()
    down = np.abs(first.direction[2])
    ray = np.flatnonzero(met.all(axis=0) & (down > 0.9))
    reflectivity = scan.reflection.surfaces.reflectivity[0]
    np.testing.assert_allclose(first.brightness[:, ray].sum(axis=0), reflectivity * down[ray], rtol=1e-3)
    assert len(first.behind_pulse) == 0
    assert 50 < len(second.behind_pulse) < 150
    np.testing.assert_allclose(second.behind_brightness, 0.5)
    assert {len(getattr(second, f.name)) for f in fields(PulseHits) if f.name.startswith("behind")} == {
        len(second.behind_pulse)
    }
