"""Clouds thinned out to be looked at: exact number, whatever the blocks, each point where and as it was."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from synthroads_addon.base.classes import class_scheme
from synthroads_addon.base.errors import Cancelled, InputError, MissingFileError
from synthroads_addon.cloud.formats.registry import ENDINGS, open_cloud, open_writer
from synthroads_addon.cloud.points import PointBlock, concatenate
from synthroads_addon.cloud.tools.display import chosen_points, drawing_order, height_colors, read_display
from tests.helpers.clouds.random_points import make_points

ORIGIN = np.array([294_000.0, 5_628_000.0, 180.0])


def write(path: Path, block: PointBlock, classes: str = "17") -> Path:
    with open_writer(path, 25832, ORIGIN, 65535 * 900.0, scheme=class_scheme(classes)) as writer:
        writer.write(block)
    return path


def stored(path: Path, shown: int) -> PointBlock:
    """Return the points of a file that are to be shown, in the drawing's order."""
    with open_cloud(path) as cloud:
        every = concatenate(list(cloud.blocks()))
    return every.select(chosen_points(len(every), shown)[np.argsort(drawing_order(min(shown, len(every))))])


@given(count=st.integers(0, 3000), budget=st.integers(1, 3000))
def test_one_of_each_run_stays(count: int, budget: int) -> None:
    chosen = chosen_points(count, budget)
    assert len(chosen) == min(count, budget)
    if count > budget:
        edges = [k * count // budget for k in range(budget + 1)]
        assert all(low <= one < high for low, one, high in zip(edges, chosen, edges[1:], strict=False))
    else:
        assert chosen.tolist() == list(range(count))


def test_a_choice_out_of_billions_does_not_overflow() -> None:
    chosen = chosen_points(10_000_000_000, 1_000_000)
    assert (np.diff(chosen) > 0).all()
    assert 9_999_980_000 < chosen[-1] < 10_000_000_000


def test_the_choice_has_no_rhythm() -> None:
    """Every n-th point of lines of n points would show one column of them."""
    chosen = chosen_points(1_000_000, 10_000)
    assert np.bincount(chosen % 100, minlength=100).std() < 20.0  # 10 by chance; every 100th point would give 995


@pytest.mark.parametrize("first", [1_000, 4_000])
def test_the_first_points_are_an_even_choice(tmp_path: Path, first: int) -> None:
    """Of the points along a line of 1000 m each tenth of it has about a tenth of the first that are drawn."""
    xyz = ORIGIN + np.stack([np.linspace(0.0, 999.99, 20_000), np.zeros(20_000), np.zeros(20_000)], axis=1)
    cloud = read_display(write(tmp_path / "a.npz", replace(make_points(20_000), xyz=xyz)), 10_000, ORIGIN)
    shares = np.bincount((cloud.xyz[:first, 0] // 100.0).astype(int), minlength=10) / first
    assert shares.min() > 0.07
    assert shares.max() < 0.13


@pytest.mark.parametrize("ending", ENDINGS)
def test_points_are_those_of_the_file(tmp_path: Path, ending: str) -> None:
    path = write(tmp_path / f"a{ending}", make_points(5_000))
    cloud, chosen = read_display(path, 1_000, ORIGIN), stored(path, 1_000)
    assert len(cloud) == 1_000
    assert np.abs(cloud.xyz - (chosen.xyz - ORIGIN)).max() < 5e-5
    assert cloud.class_id.tolist() == chosen.class_id.tolist()
    assert (cloud.rgb == chosen.rgb >> 8).all()
    assert np.allclose(cloud.brightness, chosen.intensity * chosen.range**2, rtol=1e-6)
    assert cloud.brightness_text.startswith("intensity x squared range")
    assert cloud.counts.tolist() == np.bincount(stored(path, 5_000).class_id, minlength=256).tolist()
    assert cloud.total == 5_000


@pytest.mark.parametrize("block", [1, 7, 333, 5_000])
def test_blocks_make_no_difference(tmp_path: Path, block: int) -> None:
    path = write(tmp_path / "a.npz", make_points(700))
    one, other = read_display(path, 50, ORIGIN), read_display(path, 50, ORIGIN, block=block)
    assert one.xyz.tobytes() == other.xyz.tobytes()
    assert one.counts.tolist() == other.counts.tolist()


def test_far_from_the_origin_less_than_a_millimetre_is_lost(tmp_path: Path) -> None:
    """Subtracting in 32 bits would lose half a metre at these map coordinates."""
    block = replace(make_points(200), xyz=make_points(200).xyz + [3_000.0, -2_000.0, 0.0])
    path = write(tmp_path / "a.laz", block)
    cloud, every = read_display(path, 200, ORIGIN), stored(path, 200)
    back = cloud.xyz.astype(np.float64) + ORIGIN
    assert np.abs(back - every.xyz).max() < 0.001


def test_without_an_origin_it_is_near_the_first_point(tmp_path: Path) -> None:
    cloud = read_display(write(tmp_path / "a.laz", make_points(100)), 100)
    assert np.abs(cloud.xyz).max(axis=1).min() <= 1.0
    assert (cloud.origin == np.floor(cloud.origin)).all()
    assert np.abs(cloud.origin - ORIGIN).max() < 400.0


def test_classes_have_their_schemes_colours(tmp_path: Path) -> None:
    path = write(tmp_path / "a.laz", make_points(2_000), "5")
    cloud, every = read_display(path, 2_000, ORIGIN), stored(path, 2_000)
    scheme = class_scheme("5")
    assert (cloud.colors("class")[:, :3] == scheme.colors()[every.class_id]).all()
    assert (cloud.colors("class")[:, 3] == 255).all()
    shown = {row.name: count for row, count in cloud.classes()}
    names = scheme.names()
    counted = {names[i]: int(n) for i, n in enumerate(np.bincount(every.class_id)) if n}
    assert shown == counted
    assert sum(shown.values()) == 2_000


def test_intensity_is_stretched_between_its_outer_half_percents(tmp_path: Path) -> None:
    block = replace(make_points(1_001), intensity=np.linspace(0, 1e-4, 1_001), range=np.full(1_001, 10.0))
    cloud = read_display(write(tmp_path / "a.npz", block), 1_001, ORIGIN)
    low, high = cloud.limits("intensity")
    assert (low, high) == (pytest.approx(0.005e-2, rel=0.01), pytest.approx(0.995e-2, rel=0.01))
    shades = cloud.colors("intensity")[drawing_order(1_001)]
    assert (shades[:, 0] == shades[:, 2]).all()
    assert (shades[0, 0], shades[-1, 0]) == (0, 255)
    assert (np.diff(shades[:, 0].astype(int)) >= 0).all()


def test_height_runs_from_dark_to_light(tmp_path: Path) -> None:
    xyz = ORIGIN + np.stack([np.zeros(101), np.zeros(101), np.arange(101.0)], axis=1)
    cloud = read_display(write(tmp_path / "a.npz", replace(make_points(101), xyz=xyz)), 101, ORIGIN)
    assert cloud.limits("height") == (pytest.approx(180.5), pytest.approx(279.5))
    colors = cloud.colors("height")[drawing_order(101), :3].astype(float)
    assert (np.diff(colors @ [0.2126, 0.7152, 0.0722]) >= -1e-9).all()
    assert colors[0].tolist() == height_colors()[0].tolist()
    assert colors[-1].tolist() == height_colors()[255].tolist()


def test_eight_bit_colours_are_not_black(tmp_path: Path) -> None:
    block = replace(make_points(50), rgb=np.full((50, 3), 200, np.uint16))
    assert (read_display(write(tmp_path / "a.npz", block), 50, ORIGIN).rgb == 200).all()


def test_memory_is_the_budgets(tmp_path: Path) -> None:
    few, many = (write(tmp_path / f"{n}.npz", make_points(n)) for n in (40_000, 400_000))

    def peak(path: Path) -> int:
        tracemalloc.start()
        read_display(path, 10_000, ORIGIN, block=5_000)
        result = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return result

    assert peak(many) < 1.3 * peak(few)


def test_reading_can_be_stopped(tmp_path: Path) -> None:
    path, shares = write(tmp_path / "a.npz", make_points(1_000)), []

    def progress(share: float) -> None:
        shares.append(share)
        if share > 0.5:
            raise Cancelled("stopped")

    with pytest.raises(Cancelled):
        read_display(path, 10, ORIGIN, progress, block=100)
    assert shares == pytest.approx([0.1, 0.2, 0.3, 0.4, 0.5, 0.6])


def test_what_cannot_be_shown_is_said(tmp_path: Path) -> None:
    with pytest.raises(MissingFileError, match="no such file"):
        read_display(tmp_path / "a.laz", 10)
    with pytest.raises(InputError, match="has no points"):
        read_display(write(tmp_path / "b.laz", make_points(0)), 10)
    with pytest.raises(InputError, match="points is 0: must be at least 1"):
        read_display(tmp_path / "a.laz", 0)
    path = write(tmp_path / "c.laz", make_points(1_000))
    path.write_bytes(path.read_bytes()[:-2_000])
    with pytest.raises(InputError, match="truncated"):
        read_display(path, 10)


def test_colours_are_kept_for_one_quantity_and_can_be_freed(tmp_path: Path) -> None:
    """Ten million points have 40 MB of colours for each quantity."""
    cloud = read_display(write(tmp_path / "a.npz", make_points(1_001)), 1_001)
    by_class = cloud.colors("class")
    assert cloud.colors("class") is by_class
    cloud.colors("height")
    again = cloud.colors("class")
    assert again is not by_class
    assert (again == by_class).all()
    cloud.forget_colors()
    assert cloud.colors("class") is not again
