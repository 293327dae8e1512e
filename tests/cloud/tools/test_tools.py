"""Thinning out, figures, quantile mapping and pictures of clouds."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from PIL import Image

from synthroads_addon.base.classes import class_id, class_scheme
from synthroads_addon.base.errors import InputError
from synthroads_addon.cloud.formats.registry import open_cloud, open_writer
from synthroads_addon.cloud.points import PointBlock, concatenate
from synthroads_addon.cloud.tools.convert import draw_previews, map_intensity, subsample
from synthroads_addon.cloud.tools.picture import nice_step
from synthroads_addon.cloud.tools.previews import CrossSection, TopView
from synthroads_addon.cloud.tools.quantile_mapping import LEVELS, IntensityMapping, QuantileMap, ks_distance
from synthroads_addon.cloud.tools.statistics import Moments, cloud_statistics, luminance
from synthroads_addon.cloud.tools.subsample import GridSubsampler, keep_one_per_cell
from tests.helpers.clouds.random_points import make_points

SCALE = 65535 * 900.0
ORIGIN = np.array([294_000.0, 5_628_000.0, 180.0])
FREE = settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


def write(path: Path, block: PointBlock, scale: float = SCALE) -> Path:
    with open_writer(path, 25832, ORIGIN, scale) as writer:
        writer.write(block)
    return path


def thinned(blocks: list[PointBlock], cell: float, folder: Path) -> PointBlock:
    with GridSubsampler(cell, folder) as grid:
        for block in blocks:
            grid.add(block)
        result = list(grid.blocks())
    assert list(folder.iterdir()) == []
    return concatenate(result)


@FREE
@given(
    cell=st.sampled_from([0.03, 0.04, 0.25, 1.0, 7.0]),
    steps=hnp.arrays(np.int64, st.tuples(st.integers(1, 120), st.just(3)), elements=st.integers(-9, 9)),
    shift=st.sampled_from([0.0, 20.48, -0.5, 5_628_000.0]),
    seed=st.integers(0, 2**16),
)
def test_one_point_per_cell_whatever_the_order(tmp_path: Path, cell, steps, shift, seed) -> None:
    """On a lattice finer than the cells many distances tie; tiles' edges cut no cell in two."""
    rng = np.random.default_rng(seed)
    block = replace(make_points(len(steps), seed), xyz=steps * cell * rng.choice([0.25, 0.5, 100.0], 3) + shift)
    first = thinned([block], cell, tmp_path)
    mixed = block.select(rng.permutation(len(block)))
    half = len(mixed) // 2
    second = thinned([mixed.select(slice(0, half)), mixed.select(slice(half, None))], cell, tmp_path)
    cells = np.floor(first.xyz / cell)
    assert len(np.unique(cells, axis=0)) == len(first)
    assert len(first) == len(np.unique(np.floor(block.xyz / cell), axis=0))
    order, other = (np.lexsort((p.instance_id, p.gps_time, *p.xyz.T)) for p in (first, second))
    for name, array in first.attributes().items():
        np.testing.assert_array_equal(array[order], getattr(second, name)[other], err_msg=name)


def test_the_nearest_to_the_centre_stays() -> None:
    block = replace(make_points(3), xyz=np.array([[0.01, 0.01, 0.01], [0.021, 0.02, 0.019], [0.07, 0.0, 0.0]]))
    assert keep_one_per_cell(block, 0.04).tolist() == [1, 2]


@pytest.mark.parametrize("cell", [0.03, 0.04, 0.7])
def test_edges_of_tiles_cut_no_cell_in_two(tmp_path: Path, cell: float) -> None:
    """Two points in each cell along a line longer than several tiles."""
    number = np.repeat(np.arange(3_000), 2)
    x = (number + np.tile([0.1, 0.8], 3_000)) * cell
    block = replace(make_points(6_000), xyz=np.stack([x, x, np.zeros(6_000)], axis=1))
    first, second = (block.select(np.arange(6_000) % 2 == part) for part in (0, 1))
    assert len(thinned([first, second], cell, tmp_path)) == 3_000


def test_far_apart_points_do_not_overflow() -> None:
    block = replace(make_points(3), xyz=np.array([[0.0, 0.0, 0.0], [1e7, 1e7, 1e7], [-1e7, -1e7, -1e7]]))
    assert sorted(keep_one_per_cell(block, 0.001).tolist()) == [0, 1, 2]


def test_grid_out_of_limits(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="grid is 0"):
        GridSubsampler(0.0, tmp_path)
    with pytest.raises(InputError, match="grid is nan"):
        GridSubsampler(float("nan"), tmp_path)


def plane(count: int, noise: float, seed: int = 0, tilt: float = 0.0) -> PointBlock:
    """Return a square of 30 m, tilted about the y axis; one half is of class 0, the other of class 1."""
    rng = np.random.default_rng(seed)
    u, v, w = rng.uniform(-15, 15, count), rng.uniform(-15, 15, count), rng.normal(0, noise, count)
    xyz = np.stack([u * np.cos(tilt) - w * np.sin(tilt), v, u * np.sin(tilt) + w * np.cos(tilt)], axis=1)
    return replace(make_points(count, seed), xyz=xyz + ORIGIN + 0.5, class_id=np.where(u < 0, 0, 1).astype(np.uint8))


def test_figures_of_a_noisy_plane(tmp_path: Path) -> None:
    """Variance s2 across, radius2 / 4 along each axis of a disc: l0 / (l0 + l1 + l2) is 2 s2 / radius2.

    An eighth of the points is so near the edge that part of the disc is missing, which adds some hundredths.
    """
    block = plane(60_000, 0.02, tilt=0.4)
    path = write(tmp_path / "cloud.npz", block)
    with open_cloud(path) as cloud:
        figures = cloud_statistics(cloud, radius=1.0)
    every = figures["all"]
    assert every["roughness"] == pytest.approx(2 * 0.02**2, rel=0.05)
    assert every["height_mean"] == pytest.approx(block.xyz[:, 2].mean(), abs=1e-9)
    assert every["height_std"] == pytest.approx(block.xyz[:, 2].std(), rel=1e-9)
    assert every["luminance_mean"] == pytest.approx(luminance(block.rgb).mean(), rel=1e-9)
    assert every["intensity_std"] == pytest.approx((block.intensity * SCALE / 65535).std(), rel=1e-9)
    occupied = len(np.unique(np.floor(block.xyz[:, :2]), axis=0))
    assert (every["area_m2"], every["density"]) == (occupied, len(block) / occupied)
    ground = figures["classes"]["ground"]
    assert ground["points"] == np.count_nonzero(block.class_id == 0)
    assert ground["height_mean"] == pytest.approx(block.xyz[block.class_id == 0, 2].mean(), abs=1e-9)


def test_roughness_is_that_of_a_tree_search(tmp_path: Path) -> None:
    spatial = pytest.importorskip("scipy.spatial")
    block = make_points(4_000)
    block = replace(block, xyz=ORIGIN + np.random.default_rng(5).normal(0, [2, 1, 0.2], (4_000, 3)))
    with open_cloud(write(tmp_path / "cloud.npz", block)) as cloud:
        found = cloud_statistics(cloud, radius=0.4, samples=10_000)["all"]
    tree, values, weights = spatial.cKDTree(block.xyz), {}, np.bincount(block.class_id, minlength=17)
    for at, neighbours in enumerate(tree.query_ball_point(block.xyz, 0.4)):
        if len(neighbours) >= 8:
            eigenvalues = np.linalg.eigvalsh(np.cov(block.xyz[neighbours].T))
            values.setdefault(int(block.class_id[at]), []).append(eigenvalues[0] / eigenvalues.sum())
    expected = np.average([np.mean(values[c]) for c in sorted(values)], weights=weights[sorted(values)])
    assert found["roughness"] == pytest.approx(expected, rel=1e-9)
    assert found["roughness_samples"] == sum(map(len, values.values()))


def test_figures_do_not_depend_on_order_and_blocks(tmp_path: Path, monkeypatch) -> None:
    from synthroads_addon.cloud.tools import statistics

    block = plane(5_000, 0.05)
    mixed = block.select(np.random.default_rng(1).permutation(len(block)))
    with open_cloud(write(tmp_path / "a.npz", block)) as cloud:
        first = cloud_statistics(cloud, 1.0, 200)
    monkeypatch.setattr(statistics, "_PAIRS_AT_ONCE", 1_000)
    with open_cloud(write(tmp_path / "b.npz", mixed)) as cloud:
        whole = cloud.blocks
        cloud.blocks = lambda size=700: whole(700)  # type: ignore[method-assign]
        second = cloud_statistics(cloud, 1.0, 200)
    assert second["all"] == pytest.approx(first["all"], rel=1e-9)


def test_figures_of_nothing(tmp_path: Path) -> None:
    with open_cloud(write(tmp_path / "cloud.laz", make_points(0))) as cloud:
        assert cloud_statistics(cloud)["all"] is None


@FREE
@given(hnp.arrays(np.float64, st.integers(1, 50), elements=st.floats(-1e6, 1e6)), st.integers(1, 10))
def test_moments_in_parts_are_those_of_all(values, cut) -> None:
    label = (np.arange(len(values)) % 3).astype(np.uint8)
    moments = Moments(1)
    for part in np.array_split(np.arange(len(values)), cut):
        moments.add(label[part], [values[part] + 5e6])
    present = np.unique(label).tolist()
    mean, deviation = moments.mean_and_deviation(0, present)
    assert mean == pytest.approx((values + 5e6).mean(), rel=1e-12)
    assert deviation == pytest.approx(values.std(), rel=1e-6, abs=1e-3)


@FREE
@given(
    source=hnp.arrays(np.int64, st.integers(1, 3_000), elements=st.integers(0, LEVELS - 1)),
    target=hnp.arrays(np.int64, st.integers(1, 3_000), elements=st.integers(0, LEVELS - 1)),
    ties=st.integers(0, 3),
    cuts=st.integers(1, 5),
)
def test_mapping_meets_the_target_and_keeps_the_order(source, target, ties, cuts) -> None:
    """However many ties: the gap is at most that of an even spread over each tie's share."""
    source = np.concatenate([source, *[np.full(len(source), source[0])] * ties])
    histogram, wanted = (np.bincount(levels, minlength=LEVELS) for levels in (source, target))
    table = QuantileMap(histogram, wanted)
    mapped = np.concatenate([table.map(part) for part in np.array_split(source, cuts)])
    np.testing.assert_array_equal(QuantileMap(histogram, wanted).map(source), mapped)
    assert np.isin(mapped, target).all()
    # Discrepancy of the golden section's multiples is below 2 ln(n) / n; an even tie adds to it no more than once.
    count = len(source)
    assert ks_distance(table.mapped, wanted) <= (2 * np.log(count + 1) + 2) / count
    order = np.lexsort((mapped, source))
    assert (np.diff(mapped[order])[np.diff(source[order]) > 0] >= 0).all()


@pytest.mark.parametrize("ending", [".laz", ".ply"])
def test_map_intensity_of_files(tmp_path: Path, ending: str) -> None:
    rng = np.random.default_rng(3)
    block = make_points(20_000)
    block = replace(block, intensity=rng.choice([1e-5, 2e-5, 5e-5], 20_000, p=[0.6, 0.3, 0.1]))
    other = replace(make_points(15_000, 1), intensity=np.clip(rng.normal(0.3, 0.1, 15_000), 0.0, 1.0))
    write(tmp_path / f"a{ending}", block)
    write(tmp_path / f"b{ending}", other, scale=65535.0)
    done = map_intensity(tmp_path / f"a{ending}", tmp_path / f"b{ending}", tmp_path / f"c{ending}")
    assert done["distance_before"] > 0.5
    assert done["distance_after"] < 0.01
    with open_cloud(tmp_path / f"c{ending}") as cloud:
        assert cloud.header.intensity_scale == 65535.0
        found = concatenate(list(cloud.blocks()))
    assert found.intensity.mean() == pytest.approx(0.3, abs=0.005)
    assert found.intensity[block.intensity == 1e-5].max() <= found.intensity[block.intensity == 2e-5].min()
    np.testing.assert_array_equal(found.class_id, block.class_id)


def test_mapping_by_class(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    names = ("road", "vegetation")
    labels = np.array([class_id(name) for name in names], dtype=np.uint8)
    label = labels[rng.integers(0, 2, 20_000)]
    block = replace(make_points(20_000), class_id=label.copy())
    other = replace(make_points(20_000, 1), class_id=label, intensity=np.where(label == labels[0], 0.2, 0.6) + 0.0)
    other = replace(other, intensity=other.intensity + rng.uniform(-0.1, 0.1, 20_000))
    block.class_id[:5] = class_id("pole")
    write(tmp_path / "a.laz", block)
    write(tmp_path / "b.laz", other, scale=65535.0)
    done = map_intensity(tmp_path / "a.laz", tmp_path / "b.laz", tmp_path / "c.laz", per_class=True)
    assert set(done["class_distances"]) == set(names)
    assert max(done["class_distances"].values()) < 0.01
    assert done["classes_mapped_together"] == ["pole"]
    with open_cloud(tmp_path / "c.laz") as cloud:
        found = next(cloud.blocks())
    assert found.intensity[found.class_id == labels[0]].max() <= 0.3 + 1e-4


def test_mapping_of_or_on_nothing(tmp_path: Path) -> None:
    write(tmp_path / "a.laz", make_points(10))
    write(tmp_path / "b.laz", make_points(0))
    with open_cloud(tmp_path / "a.laz") as a, open_cloud(tmp_path / "b.laz") as b:
        for source, target in ((a, b), (b, a)):
            with pytest.raises(InputError, match="has no points"):
                IntensityMapping(source, target)


def test_subsample_of_a_file_keeps_its_description(tmp_path: Path) -> None:
    write(tmp_path / "a.laz", plane(20_000, 0.0))
    done = subsample(tmp_path / "a.laz", tmp_path / "b.laz", 1.0)
    with open_cloud(tmp_path / "a.laz") as a, open_cloud(tmp_path / "b.laz") as b:
        every = concatenate(list(a.blocks()))
        assert b.header.count == len(np.unique(np.floor(every.xyz), axis=0)) == done["points"] < 3_000
        assert (b.header.crs_text, b.header.intensity_scale) == (a.header.crs_text, a.header.intensity_scale)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.laz", "b.laz"]


def dots(path: Path, color: tuple[int, int, int], rows: slice = slice(None)) -> np.ndarray:
    """Return the places (K, 2), column and row, of a colour in a picture."""
    pixels = np.asarray(Image.open(path).convert("RGB"))[rows]
    return np.argwhere((pixels == color).all(axis=2))[:, ::-1]


def test_top_view_shows_classes_where_they_are(tmp_path: Path) -> None:
    """A barrier over pavement is seen, wherever the blocks end; left of the line is up."""
    rng = np.random.default_rng(0)
    count = 60_000
    xyz = np.stack([rng.uniform(0, 100, count), rng.uniform(-10, 10, count), np.zeros(count)], axis=1) + ORIGIN
    barrier = xyz[:, 1] > ORIGIN[1] + 8
    block = replace(
        make_points(count),
        xyz=np.concatenate([xyz, xyz[barrier] + [0, 0, 1]])[:count],
        class_id=np.full(count, class_id("road"), dtype=np.uint8),
    )
    top = replace(block.select(barrier), xyz=xyz[barrier] + [0, 0, 1])
    top = replace(top, class_id=np.full(len(top), class_id("barrier"), dtype=np.uint8))
    pictures = []
    for order in ([block, top], [top, block]):
        view = TopView(ORIGIN[:2], ORIGIN[:2] + [100, 0], -12, 12)
        for part in order:
            view.add(part)
        folder = tmp_path / str(len(pictures))
        folder.mkdir()
        paths = view.save(folder, 25832)
        assert [path.name for path in paths] == ["preview_class.png", "preview_intensity.png", "preview_rgb.png"]
        pictures.append(paths[0].read_bytes())
    assert pictures[0] == pictures[1]
    colors = class_scheme("17").colors()
    area = slice(0, 14 + view.raster.height)
    found = dots(paths[0], tuple(colors[class_id("barrier")]), area)
    road = dots(paths[0], tuple(colors[class_id("road")]), area)
    assert len(found) > 10_000
    assert found[:, 1].max() < road[:, 1].min() + 12 / view.raster.axes.across


def test_cross_section_is_to_scale(tmp_path: Path) -> None:
    """A pole of 6 m, 10 m to the right of the middle, is where the axes say."""
    pole = np.stack([np.full(400, 10.0), np.zeros(400), np.linspace(0, 6, 400)], axis=1)
    ground = np.stack([np.linspace(-19.9, 19.9, 2_000), np.zeros(2_000), np.zeros(2_000)], axis=1)
    away = ground + [0, 5.0, 3.0]  # beside the slab
    block = replace(
        make_points(4_400),
        xyz=np.concatenate([pole, ground, away]) + ORIGIN,
        class_id=np.repeat([class_id("pole"), class_id("ground"), class_id("barrier")], [400, 2_000, 2_000]).astype(
            np.uint8
        ),
    )
    section = CrossSection(ORIGIN[:2], np.array([1.0, 0.0]), 20.0, 1.0, (ORIGIN[2], ORIGIN[2] + 6))
    section.add(block)
    section.save(tmp_path / "section.png")
    raster, colors = section.raster, class_scheme("17").colors()
    found = dots(tmp_path / "section.png", tuple(colors[class_id("pole")]), slice(0, 14 + raster.height))
    assert raster.count.sum() == 2_400
    left = found[:, 0].mean() - 66  # the margin and the heights beside the picture
    assert raster.axes.left + left * raster.axes.across == pytest.approx(10.0, abs=0.1)
    height = (found[:, 1].max() - found[:, 1].min()) * raster.axes.up
    assert height == pytest.approx(6.0, abs=0.2)
    assert len(dots(tmp_path / "section.png", tuple(colors[class_id("barrier")]), slice(0, 14 + raster.height))) == 0


def test_previews_of_a_file(tmp_path: Path) -> None:
    square = plane(20_000, 0.01)
    oblong = replace(square, xyz=(square.xyz - ORIGIN) * [2, 0.4, 1] + ORIGIN)  # 60 m by 12 m
    write(tmp_path / "cloud.laz", oblong)
    done = draw_previews(tmp_path / "cloud.laz", tmp_path / "out", station=10.0)
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == sorted(done["pictures"])
    assert done["points"] == 20_000
    assert done["section_points"] == pytest.approx(20_000 / 60, rel=0.2)
    x, y = ORIGIN[:2]
    line = (x - 10, y + 3, x + 10, y + 3)
    cut = draw_previews(tmp_path / "cloud.laz", tmp_path / "out", line=line, depth=0.5, overwrite=True)
    assert cut["section_points"] == pytest.approx(20_000 * 0.5 / 12, rel=0.2)
    with pytest.raises(InputError, match=r"--station is 10000.0: must be 0 to"):
        draw_previews(tmp_path / "cloud.laz", tmp_path / "else", station=1e4)
    with pytest.raises(InputError, match="meets no points"):
        draw_previews(tmp_path / "cloud.laz", tmp_path / "else", line=(0, 0, 1, 1))
    assert not (tmp_path / "else").exists()


@given(st.floats(1e-6, 1e9))
def test_nice_step(reach: float) -> None:
    step = nice_step(reach)
    assert step <= reach * (1 + 1e-8)
    assert reach < 2.5 * step * (1 + 1e-8)
    assert f"{step:.0e}"[0] in "125"
