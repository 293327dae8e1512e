"""Roughness adjustment: what moves, by how much, and what must not change; and what real asphalt measures."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from studies.surfaces.surface_variation import plane_residuals, surface_variation
from synthroads_addon.base.arithmetic.noise import mean_deviation, noise_field
from synthroads_addon.base.errors import InputError
from synthroads_addon.cloud.points import PointBlock, concatenate
from synthroads_addon.materials.table import Material, materials
from synthroads_addon.scanning.relief.micro_relief import (
    ASPHALT,
    MAX_STRENGTH,
    RELIEF,
    BeamEnds,
    MicroRelief,
    micro_relief,
    relief_of_roughness,
    shift_by_relief,
)
from tests.helpers.clouds.random_points import make_points
from tests.helpers.relative_speed import quiet_seconds

REAL = sorted((Path(__file__).resolve().parents[3].parent / "shared" / "real").glob("als_*.laz"))
ORIGIN = np.array([294_000.0, 5_628_000.0, 180.0])
ROAD = ("asphalt", "paint_white", "verge", "grass_ground", "car_paint")


def relief_of(*names: str) -> MicroRelief:
    return micro_relief(names, [materials()[name] for name in names])


def patch(name: str, count: int, size: float, strength: float, noise: float = 0.0, octaves: int = 4) -> np.ndarray:
    """Return points of one surface on a level square, seen from straight above, adjusted."""
    rng = np.random.default_rng(count)
    position = np.column_stack([rng.uniform(0, size, (count, 2)), np.zeros(count)])
    points = scanned(position, np.zeros(count, np.uint16), np.array([0.0, 0.0, 1.0]), rng)
    points, above = replace(points, incidence_deg=np.zeros(count, np.float32)), np.tile([0.0, 0.0, 1.0], (count, 1))
    result = shift_by_relief(points, BeamEnds(position, above), relief_of(name), strength, 1, octaves).xyz - ORIGIN
    result[:, 2] += rng.normal(0, noise, count)
    return result


def scanned(position: np.ndarray, material: np.ndarray, normal: np.ndarray, rng: np.random.Generator) -> PointBlock:
    """Return points as measured from scanners at random places above the surface; everything consistent."""
    count = len(position)
    normal = np.broadcast_to(normal / np.linalg.norm(normal), (count, 3))
    beam = rng.normal(size=(count, 3))
    beam /= np.linalg.norm(beam, axis=1)[:, None]
    beam *= np.sign(np.einsum("ij,ij->i", beam, normal))[:, None]
    distance = rng.uniform(2, 120, count)
    cosine = np.einsum("ij,ij->i", beam, normal)
    return replace(
        make_points(count),
        xyz=position + ORIGIN,
        true_xyz=position + ORIGIN,
        range=distance,
        true_range=distance.copy(),
        scanner=position + ORIGIN + beam * distance[:, None],
        incidence_deg=np.degrees(np.arccos(cosine)).astype(np.float32),
        normal=normal.astype(np.float32),
        material=material,
    )


def beams(points: PointBlock) -> np.ndarray:
    """Return the unit vectors (N, 3) from points to their scanners."""
    beam = points.scanner - points.xyz
    return beam / np.linalg.norm(beam, axis=1)[:, None]


def scene(count: int = 20_000, seed: int = 0) -> tuple[PointBlock, np.ndarray]:
    """Return points of `ROAD`'s materials on a tilted plane, and their local positions."""
    rng = np.random.default_rng(seed)
    plan = rng.uniform(-50, 50, (count, 2))
    position = np.column_stack([plan, 0.3 * plan[:, 0]])
    return scanned(position, rng.integers(0, len(ROAD), count).astype(np.uint16), np.array([-0.3, 0, 1]), rng), position


def test_strength_0_returns_the_very_same_points() -> None:
    points, position = scene()
    assert shift_by_relief(points, BeamEnds(position, beams(points)), relief_of(*ROAD), 0.0, 1) is points


def test_smooth_materials_return_the_very_same_points() -> None:
    points, position = scene()
    smooth = replace(points, material=np.full(len(points), 4, np.uint16))
    assert shift_by_relief(smooth, BeamEnds(position, beams(smooth)), relief_of(*ROAD), 1.0, 1) is smooth
    assert shift_by_relief(points, BeamEnds(position, beams(points)), relief_of(*["car_paint"] * 5), 1.0, 1) is points


def test_points_move_along_their_beams_to_the_height_and_nothing_else_changes() -> None:
    points, position = scene()
    result = shift_by_relief(points, BeamEnds(position, beams(points)), relief_of(*ROAD), 2.0, 1)
    shift, relief = result.xyz - points.xyz, relief_of(*ROAD)
    nearer = np.einsum("ij,ij->i", shift, beams(points))
    # Float64 has steps of 1e-9 at 5.6e6 m.
    assert np.abs(shift - nearer[:, None] * beams(points)).max() < 1e-8
    wavelength = relief.wavelength[points.material]
    expected = 2.0 * relief.amplitude[points.material] * noise_field(position, wavelength, 1)
    height = np.einsum("ij,ij->i", shift, points.normal)
    cosine = np.cos(np.deg2rad(points.incidence_deg.astype(np.float64)))
    sine = np.sqrt(1.0 - cosine**2)
    grazing = np.abs(expected) * sine > 0.5 * wavelength * cosine
    assert 0 < grazing.mean() < 0.1
    assert height[~grazing] == pytest.approx(expected[~grazing], abs=1e-6)
    assert np.abs(nearer * sine)[grazing] == pytest.approx(0.5 * wavelength[grazing])
    assert (np.sign(nearer[grazing]) == np.sign(expected[grazing])).all()
    assert (result.xyz[points.material == 4] == points.xyz[points.material == 4]).all()
    for name, array in points.attributes().items():
        if name not in ("xyz", "range"):
            assert getattr(result, name) is array


def test_range_is_the_distance_to_the_shifted_point() -> None:
    points, position = scene()
    result = shift_by_relief(points, BeamEnds(position, beams(points)), relief_of(*ROAD), 5.0, 1)
    assert np.abs(result.range - points.range).max() > 0.05
    assert result.range == pytest.approx(np.linalg.norm(result.xyz - points.scanner, axis=1), abs=1e-6)
    assert (result.range[points.material == 4] == points.range[points.material == 4]).all()


def test_one_laser_s_line_on_rough_ground_is_as_flat_as_on_smooth_ground() -> None:
    """Points of one laser of a head lie on the cone that it sweeps, however rough the road is."""
    azimuth = np.linspace(-0.02, 0.02, 200)
    position = 10.0 * np.column_stack([np.cos(azimuth), np.sin(azimuth), np.zeros(200)])
    points = scanned(position, np.zeros(200, np.uint16), np.array([0.0, 0.0, 1.0]), np.random.default_rng(1))
    scanner = position * 0.0 + [0.0, 0.0, 1.73]
    beam = scanner - position
    distance = np.linalg.norm(beam, axis=1)
    incidence = np.degrees(np.arccos(1.73 / distance))
    points = replace(points, scanner=scanner + ORIGIN, range=distance, incidence_deg=incidence)
    moved = shift_by_relief(points, BeamEnds(position, beams(points)), relief_of("asphalt"), 3.0, 1)
    slope = np.linalg.norm(moved.xyz[:, :2] - ORIGIN[:2], axis=1) / (1.73 - moved.xyz[:, 2] + ORIGIN[2])
    assert np.ptp(moved.xyz[:, 2]) > 2e-3
    assert slope == pytest.approx(10.0 / 1.73, abs=1e-6)


def test_the_given_points_are_not_written_to() -> None:
    points, position = scene(2000)
    before = {name: array.copy() for name, array in points.attributes().items()}
    shift_by_relief(points, BeamEnds(position, beams(points)), relief_of(*ROAD), 1.0, 1)
    for name, array in points.attributes().items():
        np.testing.assert_array_equal(array, before[name])


@settings(max_examples=20, deadline=None)
@given(cuts=st.lists(st.integers(0, 3000), max_size=4), seed=st.integers(0, 2**31), order=st.integers(0, 99))
def test_blocks_and_order_do_not_matter(cuts: list[int], seed: int, order: int) -> None:
    points, position = scene(3000)
    whole = shift_by_relief(points, BeamEnds(position, beams(points)), relief_of(*ROAD), 1.5, seed)
    shuffle = np.random.default_rng(order).permutation(3000)
    parts = [(rows, points.select(rows)) for rows in np.split(shuffle, sorted(cuts))]
    blocks = [
        shift_by_relief(part, BeamEnds(position[rows], beams(part)), relief_of(*ROAD), 1.5, seed)
        for rows, part in parts
    ]
    joined = concatenate(blocks)
    assert (joined.xyz == whole.xyz[shuffle]).all()
    assert (joined.range == whole.range[shuffle]).all()


def test_the_same_place_has_the_same_height_in_every_strip() -> None:
    position = scene(2000)[1]
    material, normal = np.zeros(2000, np.uint16), np.array([-0.3, 0, 1])
    there, back = (scanned(position, material, normal, np.random.default_rng(seed)) for seed in (1, 2))
    assert (there.range != back.range).all()
    heights = [
        (shift_by_relief(points, BeamEnds(position, beams(points)), relief_of("asphalt"), 1.0, 3).xyz - points.xyz)
        @ normal
        for points in (there, back)
    ]
    steep = np.minimum(*(np.cos(np.deg2rad(points.incidence_deg)) for points in (there, back))) > 0.1
    assert heights[0][steep] == pytest.approx(heights[1][steep], abs=1e-8)


def test_neighbours_have_like_heights() -> None:
    rng = np.random.default_rng(0)
    position = rng.uniform(-50, 50, (50_000, 3)) * np.array([1, 1, 0])
    here, near, far = (
        noise_field(position + np.array([step, 0, 0]), RELIEF["soil"].wavelength, 1) for step in (0, 0.02, 2.0)
    )
    assert np.mean(here * near) > 0.8
    assert abs(np.mean(here * far)) < 0.02


@pytest.mark.parametrize("noise", [0.0, 0.010])
def test_roughness_of_asphalt_rises_with_strength(noise: float) -> None:
    clouds = [patch("asphalt", 30_000, 40.0, strength, noise) for strength in (0, 1, 3, 10, 30)]
    inside = np.random.default_rng(0).choice(30_000, 800, replace=False)
    for values in (
        [np.median(plane_residuals(cloud, 1.0)[0]) for cloud in clouds],
        [np.median(surface_variation(cloud, 1.0, inside)) for cloud in clouds],
    ):
        assert (np.diff(values) > 0).all()


def test_standard_deviation_is_the_table_s() -> None:
    for name in ("asphalt", "paint_white", "verge", "grass_ground"):
        rms = np.sqrt(np.mean(plane_residuals(patch(name, 40_000, 30.0, 1.0), 3.0)[0] ** 2))
        assert rms == pytest.approx(RELIEF[name].amplitude, rel=0.05)


@pytest.mark.parametrize("strength", [1.0, 5.0])
def test_paint_is_flatter_than_asphalt_and_grass_rougher(strength: float) -> None:
    rough = [
        np.median(plane_residuals(patch(name, 20_000, 30.0, strength), 1.0)[0])
        for name in ("paint_white", "asphalt", "verge", "grass_ground")
    ]
    assert (np.diff(rough) > 0).all()
    assert rough[1] > 2 * rough[0]
    assert rough[3] > 10 * rough[1]


@pytest.mark.parametrize(
    ("name", "size", "side"), [("asphalt", 1.0, 20.0), ("paint_white", 1.0, 20.0), ("grass_ground", 20.0, 100.0)]
)
def test_the_mean_surface_stays(name: str, size: float, side: float) -> None:
    """Means over squares of 1 m (paved) and 20 m (ground); points so dense that all of the texture is seen."""
    number = round(side / size)
    step = RELIEF[name].wavelength / 4
    axis = np.arange(step / 2, side, step)
    position = np.stack(np.meshgrid(axis, axis, [0.0], indexing="ij"), axis=-1).reshape(-1, 3)
    amplitude, wavelength = (np.full(len(position), value) for value in RELIEF[name])
    height = amplitude * noise_field(position, wavelength, 2)
    cell = np.minimum((position[:, :2] // size).astype(int), number - 1) @ [number, 1]
    means = np.bincount(cell, height) / np.bincount(cell)
    assert np.sqrt(np.mean(means**2)) < 0.0002
    assert abs(means.mean()) < 0.0002


def profile_depth(name: str) -> float:
    """Return the mean profile depth by ISO 13473-1, m: baselines of 100 mm, a sample per millimetre, slope removed."""
    rng = np.random.default_rng(0)
    along, turn = np.arange(100) * 0.001, rng.uniform(0, 2 * np.pi, 300)
    direction = np.column_stack([np.cos(turn), np.sin(turn), np.zeros(300)])
    lines = along[:, None] * direction[:, None] + rng.uniform(-300, 300, (300, 1, 3))
    amplitude, wavelength = (np.full(30_000, value) for value in RELIEF[name])
    z = (amplitude * noise_field(lines.reshape(-1, 3), wavelength, 1, 6)).reshape(300, 100).T
    z = z - along[:, None] * np.polyfit(along, z, 1)[0] - np.polyfit(along, z, 1)[1]
    return float((z[:50].max(axis=0) + z[50:].max(axis=0)).mean() / 2)


@pytest.mark.parametrize(
    ("name", "millimetres"),
    [
        *(("asphalt", 0.85), ("stone_mastic_asphalt", 1.0), ("porous_asphalt", 1.6), ("mastic_asphalt", 0.55)),
        *(("concrete", 0.75), ("exposed_aggregate_concrete", 0.9)),
    ],
)
def test_mean_profile_depth_is_that_of_pavements(name: str, millimetres: float) -> None:
    """The depths that docs/roughness.md names with the sources of each kind's range."""
    assert 1000.0 * profile_depth(name) == pytest.approx(millimetres, rel=0.05)
    assert profile_depth("paint_white") < 0.0004


@pytest.mark.skipif(not REAL, reason="real clouds are not here")
@pytest.mark.parametrize("file", REAL, ids=lambda path: path.stem)
def test_reaches_the_roughness_of_real_asphalt(file: Path) -> None:
    """Real asphalt in airborne scans is far rougher than its texture: noise. Strength as well as noise gets there.

    Asphalt is the darkest two fifths of a cloud by intensity: the strips were cut about the road's axis.
    """
    laspy = pytest.importorskip("laspy")
    las = laspy.read(file)
    xyz, intensity = np.array(las.xyz), np.asarray(las.intensity, dtype=float)
    real = plane_residuals(xyz[(intensity > 0) & (intensity < np.quantile(intensity, 0.4))], 1.0)[0]
    target = np.median(real)
    assert target > 10 * ASPHALT.amplitude
    by_strength = plane_residuals(patch("asphalt", 30_000, 40.0, target / ASPHALT.amplitude), 1.0)[0]
    by_noise = plane_residuals(patch("asphalt", 30_000, 40.0, 1.0, target), 1.0)[0]
    assert target / ASPHALT.amplitude < MAX_STRENGTH
    assert np.median(by_strength) == pytest.approx(target, rel=0.05)
    assert np.median(by_noise) == pytest.approx(target, rel=0.05)


@pytest.mark.parametrize("strength", [-0.1, MAX_STRENGTH * 1.01, np.nan, np.inf])
def test_strength_out_of_range(strength: float) -> None:
    points, position = scene(10)
    with pytest.raises(InputError, match="roughness strength"):
        shift_by_relief(points, BeamEnds(position, beams(points)), relief_of(*ROAD), strength, 1)


@pytest.mark.parametrize("missing", ["normal", "material"])
def test_normals_and_materials_are_needed(missing: str) -> None:
    points, position = scene(10)
    with pytest.raises(ValueError, match="normals and materials"):
        shift_by_relief(replace(points, **{missing: None}), BeamEnds(position, beams(points)), relief_of(*ROAD), 1.0, 1)


def test_no_points() -> None:
    points, position = scene(10)
    none = points.select(np.zeros(10, bool))
    assert len(shift_by_relief(none, BeamEnds(position[:0], beams(none)), relief_of(*ROAD), 1.0, 1)) == 0


def test_every_material_of_the_table_has_a_stated_relief() -> None:
    """Names in `RELIEF` are of the table, so that a renamed material doesn't silently become smooth."""
    last_words = {name.rpartition("_")[2] for name in materials()}
    assert set(RELIEF) <= set(materials()) | last_words
    relief = relief_of("birch_bark", "birch_leaves", "galvanised_steel", "sheeting_white", "rubber", "grass")
    assert relief.amplitude.tolist() == [RELIEF["bark"].amplitude, 0, 0, 0, 0, 0]


def foreign(**values: float) -> Material:
    return Material(base_color=(0.2, 0.2, 0.2), specular=0.2, **{"roughness": 0.85, **values})


def test_foreign_materials_have_the_relief_of_their_roughness() -> None:
    table = micro_relief(["Material.001"], [foreign()])
    assert table.amplitude[0] == pytest.approx(ASPHALT.amplitude)
    amplitudes = [relief_of_roughness(foreign(roughness=r)).amplitude for r in (0.0, 0.5, 0.6, 0.8, 1.0)]
    assert amplitudes[:2] == [0.0, 0.0]
    assert (np.diff(amplitudes[1:]) > 0).all()
    assert relief_of_roughness(foreign(metallic=1.0)).amplitude == 0.0
    assert relief_of_roughness(foreign(transmission=0.3)).amplitude == 0.0


def test_a_million_points_in_a_second() -> None:
    """15 million in 15 s of one quiet core; measured is a fifth of that."""
    points, position = scene(100_000)
    points = replace(points, material=np.zeros(100_000, np.uint16))
    ends, relief = BeamEnds(position, beams(points)), relief_of("asphalt")
    assert quiet_seconds(lambda: shift_by_relief(points, ends, relief, 1.0, 1), rounds=3) < 0.1


def test_a_wide_beam_sees_a_flatter_relief() -> None:
    """Of asphalt at 10 m, at a right angle and slanting: as the means over footprints deviate."""
    rng = np.random.default_rng(2)
    position = np.column_stack([rng.uniform(0, 200, (20_000, 2)), np.zeros(20_000)])
    points = scanned(position, np.zeros(20_000, np.uint16), np.array([0.0, 0.0, 1.0]), rng)
    incidence = np.where(np.arange(20_000) % 2, 0.0, 80.0).astype(np.float32)
    points = replace(points, range=np.full(20_000, 10.0), incidence_deg=incidence)
    towards = np.stack([np.sin(np.deg2rad(incidence)), 0.0 * incidence, np.cos(np.deg2rad(incidence))], axis=1)
    moved = shift_by_relief(points, BeamEnds(position, towards, 2e-3), relief_of("asphalt"), 1.0, 1, 1)
    height = moved.xyz[:, 2] - ORIGIN[2]
    for slant, angle in ((height[1::2], 0.0), (height[::2], 80.0)):
        across = 10.0 * 2e-3 / 4.0 / 0.05  # in cells of half the wavelength
        stated = mean_deviation(np.array([across / np.cos(np.deg2rad(angle))]), np.array([across]))[0]
        assert slant.std() == pytest.approx(0.0008 * stated, rel=0.03)
