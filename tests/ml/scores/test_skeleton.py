"""The baseline on masks whose middle is known."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from skimage.morphology import skeletonize

from ml.scores.baselines import SkeletonSettings, average_along, crossings, prune_skeleton, skeleton_centers
from synthroads_addon.base.random_streams import stream

Float = NDArray[np.float64]


def strip(left: float, right: float, length: float = 300.0, radius: float = 2000.0, density: float = 18.0) -> Float:
    """Return points (N, 2) strewn over a strip along an arc that begins at 0, 0 eastward, between two offsets."""
    random = stream(3, f"strip {left} {right}")
    count = int(length * (left - right) * density)
    station, offset = random.uniform(0.0, length, count), random.uniform(right, left, count)
    turn = station / radius
    return np.column_stack([(radius - offset) * np.sin(turn), radius - (radius - offset) * np.cos(turn)])


def frames(length: float = 300.0, radius: float = 2000.0, aside: float = 2.0) -> tuple[Float, Float]:
    """Return origins (M, 2) and directions (M,) each metre along the arc, off it by some metres, turned a little."""
    random = stream(4, "frames")
    station = np.arange(0.5, length, 1.0)
    turn = station / radius
    offset = random.uniform(-aside, aside, len(station))
    origin = np.column_stack([(radius - offset) * np.sin(turn), radius - (radius - offset) * np.cos(turn)])
    return origin, turn + random.uniform(-0.03, 0.03, len(station))


def errors(y: Float, origin: Float, direction: Float, radius: float = 2000.0) -> Float:
    """Return the offsets (M,) from the arc of predicted centres."""
    points = origin + y[:, None] * np.column_stack([-np.sin(direction), np.cos(direction)])
    return radius - np.hypot(points[:, 0], points[:, 1] - radius)


def test_the_middle_of_a_strip_is_found_whatever_the_frames() -> None:
    origin, direction = frames()
    y = skeleton_centers(strip(6.0, -4.0), None, origin, direction)
    off = errors(y, origin, direction)
    assert np.isfinite(y).mean() > 0.9, "only the ends are missing"
    # Thinning goes to one side of an even number of pixels: half a pixel of bias is the method's own.
    assert np.nanmean(off) == pytest.approx(1.0, abs=0.5)
    assert np.nanstd(off) < 0.5
    finer = skeleton_centers(strip(6.0, -4.0), None, origin, direction, SkeletonSettings(raster=0.5))
    assert np.nanmean(errors(finer, origin, direction)) == pytest.approx(1.0, abs=0.25)


def test_two_carriageways_give_the_line_between_them() -> None:
    origin, direction = frames()
    xy = np.vstack([strip(13.0, 3.0), strip(-3.0, -13.0)])
    off = errors(skeleton_centers(xy, None, origin, direction), origin, direction)
    assert np.nanmedian(np.abs(off)) < 0.5, "near the ends one of the two can be alone"


def test_two_carriageways_across_the_raster_are_both_in_every_bin() -> None:
    """Across the raster a metre holds a pixel of the one or the other: bins of some metres hold both."""
    turn = np.array([[np.cos(0.5), np.sin(0.5)], [-np.sin(0.5), np.cos(0.5)]])
    origin, direction = frames()
    xy = np.vstack([strip(13.0, 3.0), strip(-3.0, -13.0)]) @ turn
    found = {
        width: skeleton_centers(xy, None, origin @ turn, direction + 0.5, SkeletonSettings(bin=width))
        for width in (1.0, 5.0)
    }
    shares = {width: np.isfinite(y).mean() for width, y in found.items()}
    assert shares[1.0] < 0.7
    assert shares[5.0] > 0.85
    assert np.nanmedian(np.abs(errors(found[5.0], origin, direction))) < 1.0


def test_dark_ground_is_asphalt() -> None:
    origin, direction = frames()
    road, grass = strip(4.0, -4.0), np.vstack([strip(12.0, 4.0), strip(-4.0, -6.0)])
    xy = np.vstack([road, grass])
    intensity = np.concatenate([np.full(len(road), 0.2), np.full(len(grass), 0.6)])
    intensity += stream(5, "intensity").normal(0.0, 0.05, len(xy))
    by_mask = {
        mask: errors(skeleton_centers(xy, intensity, origin, direction, SkeletonSettings(mask=mask)), origin, direction)
        for mask in ("dark", "ground")
    }
    assert np.nanmean(np.abs(by_mask["dark"])) < 0.4
    assert np.nanmean(by_mask["ground"]) == pytest.approx(3.0, abs=0.4)


def comb(tooth: int, every: int = 20, length: int = 110) -> NDArray[np.bool_]:
    """Return a line with teeth of some pixels' length to one side, beginning and ending with the line alone."""
    image = np.zeros((length + 2, tooth + 6), dtype=bool)
    image[1:-1, 2] = True
    image[every::every, 3 : 3 + tooth] = True
    return image


def test_short_branches_are_cut_and_long_ones_stay() -> None:
    image = comb(6)
    without = prune_skeleton(skeletonize(image), 10.0)
    assert without[:, 4:].sum() == 0, "at most the junctions' pixels stay"
    assert without[25:75, 2:4].any(axis=1).all()
    assert prune_skeleton(skeletonize(image), 4.0)[:, 3:].sum() >= 5 * 4


def test_branches_of_branches_go_in_later_rounds() -> None:
    image = np.zeros((101, 60), dtype=bool)
    image[:, 5] = True
    image[50, 5:18] = True  # a branch of 12 pixels ...
    image[46:55, 17] = True  # ... with a fork at its end, whose arms are short
    assert prune_skeleton(skeletonize(image), 10.0)[:, 7:].sum() >= 9, "the arms go, the branch stays"
    assert prune_skeleton(skeletonize(image), 14.0)[:, 8:].sum() == 0, "then it ends freely and goes as well"


def test_steps_in_a_line_are_no_junctions() -> None:
    row, column = np.arange(200), np.round(np.arange(200) * 0.37 + 3 * np.sin(np.arange(200) / 9.0)).astype(int) + 5
    image = np.zeros((202, column.max() + 5), dtype=bool)
    for width in (0, 1):
        image[row + 1, column + width] = True
    thin = skeletonize(image)
    assert (prune_skeleton(thin, 15.0) == thin).all()


def test_stairs_are_no_junctions_either() -> None:
    image = np.zeros((60, 40), dtype=bool)
    image[2:10, 5] = True
    for step in range(20):
        image[10 + step, 4 + step : 6 + step] = True
    image[30:38, 24] = True
    assert (prune_skeleton(image, 12.0) == image).all(), "the straight ends are no branches"


def test_diagonal_branches_are_longer_than_their_pixels() -> None:
    image = np.zeros((101, 60), dtype=bool)
    image[:, 5] = True
    image[50 + np.arange(12), 6 + np.arange(12)] = True
    assert prune_skeleton(skeletonize(image), 14.0)[:, 8:].sum() >= 8
    assert prune_skeleton(skeletonize(image), 18.0)[:, 8:].sum() == 0


def test_specks_go_and_an_empty_skeleton_stays_empty() -> None:
    image = np.zeros((100, 40), dtype=bool)
    image[5:95, 5] = True
    image[20:25, 30] = True
    found = prune_skeleton(image, 15.0)
    assert found[:, 5].sum() == 90
    assert found[:, 30].sum() == 0
    assert prune_skeleton(np.zeros((10, 10), dtype=bool), 5.0).sum() == 0


def test_averages_follow_the_principal_axis() -> None:
    along = np.arange(0.0, 50.0, 0.25)
    two = np.vstack([np.column_stack([along, along + side]) for side in (-3.0, 3.0)]) + 5e5
    chain = average_along(two, 1.0, np.array([np.pi / 4]))
    assert len(chain) >= 65
    assert (np.diff(chain.sum(axis=1)) > 0).all()
    back = average_along(two, 1.0, np.array([-3 * np.pi / 4]))
    assert (np.diff(back.sum(axis=1)) < 0).all(), "in the path's order"
    inner = chain[5:-5] - 5e5
    assert np.abs(inner[:, 1] - inner[:, 0]).max() < 0.6
    assert len(average_along(two[:1], 1.0, np.zeros(1))) == 0


def test_a_chain_is_crossed_between_its_points_and_not_in_its_gaps() -> None:
    chain = np.array([[0.0, 1.0], [2.0, 2.0], [20.0, 2.0], [22.0, 2.0]])
    origin = np.array([[1.0, 0.0], [10.0, 0.0], [21.0, 3.0], [30.0, 0.0]])
    assert crossings(chain, origin, np.zeros(4)) == pytest.approx([1.5, np.nan, -1.0, np.nan], nan_ok=True)
    turned = crossings(chain, np.array([[1.0, 0.0]]), np.array([np.pi]))
    assert turned == pytest.approx([-1.5]), "left of a frame that looks back is the other side"


def test_no_points_give_no_line() -> None:
    origin, direction = frames(50.0)
    assert np.isnan(skeleton_centers(np.empty((0, 2)), None, origin, direction)).all()
    assert np.isnan(skeleton_centers(np.zeros((1, 2)), None, origin, direction)).all()
    assert len(skeleton_centers(strip(6.0, -4.0), None, np.empty((0, 2)), np.empty(0))) == 0
