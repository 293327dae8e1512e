"""Leaves and gaps that faces stand for: what narrow and wide beams meet of them, and that nothing else decides it."""

from dataclasses import replace

import numpy as np
import pytest

from synthroads_addon.materials.surfaces import Surfaces, surfaces_of
from synthroads_addon.materials.table import materials
from synthroads_addon.scanning.plan import ScanPlan
from synthroads_addon.scanning.scene.gaps import LeafGaps
from tests.helpers.scenes.scan_scenes import Standing, altered, mesh_of, scan_of, scan_pulses

OPEN, SIZE = 0.4, 0.1


def leaf_surfaces(size: float = SIZE, transmission: float = OPEN) -> Surfaces:
    leaves = materials()["leaves"].model_copy(update={"transmission": transmission, "gap_size": size})
    return surfaces_of([materials()["asphalt"], leaves])


def canopy(rays: int = 1, heights: tuple[float, ...] = (10.03,), **changes) -> ScanPlan:
    """Return a scan of layers of leaves above asphalt, each in the midst of cells, from 60 m up."""
    corners = [(x, y, z) for z in (0.0, *heights) for x, y in ((-90, -90), (90, -90), (90, 90), (-90, 90))]
    firsts = range(0, len(corners), 4)
    mesh = mesh_of(corners, [(n + a, n + b, n + c) for n in firsts for a, b, c in ((0, 1, 2), (0, 2, 3))])
    material = np.array([0, 0] + [1, 1] * len(heights), np.uint16)
    mesh = replace(mesh, material=material, materials=("asphalt", "leaves"))
    scan = scan_of(mesh, rays, Standing(60.0, 20.0), **changes)
    return altered(scan, surfaces=leaf_surfaces())


def scanned(scan: ScanPlan, first: int = 0, count: int = 3000):
    return scan_pulses(scan, scan.path.strips[0], first, count).points


def transmitted(gaps: LeafGaps, place: np.ndarray, share: float = 1.0, distance: float = 50.0) -> np.ndarray:
    count = place.shape[1]
    surfaces, ones = leaf_surfaces(), np.ones(count)
    return gaps.transmitted(surfaces, np.ones(count, np.intp), place, distance * ones, share * ones)


def places(count: int = 8_000) -> np.ndarray:
    return np.random.default_rng(1).uniform(-50.0, 50.0, (3, count))


def test_a_narrow_beam_meets_a_leaf_or_passes() -> None:
    points = scanned(canopy(divergence=(1e-9, 1e-9)))
    assert set(points.number_of_returns) == {1}
    height = points.xyz[:, 2] - points.xyz[:, 2].min()
    assert float((height < 5.0).mean()) == pytest.approx(OPEN, abs=0.03)


def test_each_of_several_layers_has_its_own_gaps() -> None:
    points = scanned(canopy(heights=(10.03, 14.03, 18.03), divergence=(1e-9, 1e-9)))
    assert set(points.number_of_returns) == {1}
    assert points.intensity.min() > 0.0
    height = points.xyz[:, 2] - points.xyz[:, 2].min()
    shares = [float((height > level).mean()) for level in (16.0, 12.0, 8.0)]
    assert shares == pytest.approx([1.0 - OPEN, 1.0 - OPEN**2, 1.0 - OPEN**3], abs=0.03)


def test_a_wide_beam_meets_both_and_keeps_the_mean() -> None:
    narrow, wide = (LeafGaps(angle, 7) for angle in (1e-20, 1e-5))
    some = transmitted(wide, places(), distance=100.0)
    assert set(np.unique(some)) == {0.0, 0.25, 0.5, 0.75, 1.0}
    assert set(np.unique(transmitted(narrow, places()))) == {0.0, 1.0}
    for gaps in (narrow, wide):
        assert transmitted(gaps, places()).mean() == pytest.approx(OPEN, abs=0.02)
    assert some.std() == pytest.approx(np.sqrt(OPEN * (1.0 - OPEN) / 4.0), rel=0.1)
    returns = scanned(canopy(divergence=(4e-3, 4e-3))).number_of_returns
    assert set(returns) == {1, 2}


def test_a_ray_of_many_stands_for_its_part_of_the_beam() -> None:
    beam = LeafGaps(1e-5, 7)
    whole, part = (transmitted(beam, places(), share) for share in (1.0, 1e-4))
    assert np.isin(part, (0.0, 1.0)).mean() > 0.95
    assert np.isin(whole, (0.0, 1.0)).mean() < 0.5


def test_what_is_met_is_of_place_and_seed_alone() -> None:
    place, gaps = places(), LeafGaps(1e-5, 7)
    found = transmitted(gaps, place)
    halves = [transmitted(gaps, part) for part in np.array_split(place, 3, axis=1)]
    np.testing.assert_array_equal(np.concatenate(halves), found)
    moved = replace(gaps, frame_origin=np.array([3.0, -40.0, 7.5]))
    same = transmitted(moved, place - moved.frame_origin[:, None])
    assert (same == found).mean() > 0.999  # but where a place is on the edge of a cell
    assert (transmitted(replace(gaps, key=8), place) == found).mean() < 0.6


def test_leaves_are_where_they_were_when_a_place_is_scanned_again() -> None:
    scan = canopy(divergence=(1e-9, 1e-9))
    np.testing.assert_array_equal(scanned(scan).xyz, scanned(scan).xyz)
    on_leaf = scanned(scan).xyz[:, 2] > 185.0
    other_survey, other_road = (altered(scan, **{name: 5}) for name in ("seed", "surface_seed"))
    np.testing.assert_array_equal(scanned(other_survey).xyz[:, 2] > 185.0, on_leaf)
    assert not np.array_equal(scanned(other_road).xyz[:, 2] > 185.0, on_leaf)


def test_nothing_is_looked_up_where_no_material_has_gaps() -> None:
    scan = canopy()
    assert scan.gaps is not None
    assert altered(scan, surfaces=leaf_surfaces(0.0)).gaps is None
    assert altered(scan, surfaces=leaf_surfaces(transmission=0.0)).gaps is None


def test_light_is_neither_lost_nor_made() -> None:
    """A beam of many rays: of the pulse's energy the leaves take what they don't let through, the ground the rest."""
    points = scanned(canopy(19, divergence=(2e-3, 2e-3)), 350, 300)
    bright = leaf_surfaces().reflectivity
    cosine = np.cos(np.deg2rad(points.incidence_deg.astype(float)))
    on_leaf = points.xyz[:, 2] - points.xyz[:, 2].min() > 5.0
    energy = points.intensity * points.range**2 / (cosine * np.where(on_leaf, bright[1], bright[0]))
    pulse = np.unique(points.gps_time, return_inverse=True)[1]
    np.testing.assert_allclose(np.bincount(pulse, energy), 1.0, rtol=2e-3)
