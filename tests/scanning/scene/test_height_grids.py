"""Grids of largest heights: a beam that passes above them touches nothing that was drawn."""

import numpy as np
import pytest

from synthroads_addon.base.random_streams import stream
from synthroads_addon.scanning.scene.height_grids import WINDOW, HeightGrids, PlanGrids

SIZE = np.array([40.0, 25.0])
CELL = 0.1


def crosses(low, high, corner, size, towards):
    """Return for which beams (N,) a box of that corner and size, moved along its beam, crosses any of boxes (3, M)."""
    result = np.zeros(corner.shape[1], bool)
    for i in range(corner.shape[1]):
        # The boxes grown by the beam's, and a ray from its corner: slabs.
        begin, end = low - size[:, i, None], high
        with np.errstate(divide="ignore", invalid="ignore"):
            one, other = ((side - corner[:, i, None]) / towards[:, i, None] for side in (begin, end))
        first, last = np.fmin(one, other).max(axis=0), np.fmax(one, other).min(axis=0)
        result[i] = ((first < last - 1e-9) & (last > 0.0)).any()
    return result


@pytest.fixture(scope="module")
def drawn():
    """Boxes (3, M), low and high, of all sizes on the ground, and the grids that they were drawn in."""
    random = stream(1, "boxes")
    low = np.concatenate([random.uniform(0.0, SIZE, (60, 2)), np.zeros((60, 1))], axis=1).T
    high = low + random.uniform(0.02, 1.0, (3, 60)) ** 3 * [[4.0], [4.0], [3.0]]
    grids = HeightGrids(np.array([[0.0, 0.0, 0.0], [*SIZE + 4.0, 3.0]]), CELL)
    grids.draw_boxes(low.astype(np.float32), high.astype(np.float32))
    grids.finish()
    return low, high, grids


def beams(count: int):
    """Return corners (3, N), sizes (3, N) and directions (3, N) of beams back from the ground at all angles."""
    random = stream(2, "beams")
    corner = np.concatenate([random.uniform(-2.0, SIZE + 2.0, (count, 2)), np.full((count, 1), 0.01)], axis=1).T
    size = random.uniform(0.01, 1.0, (3, count)) ** 2 * [[0.6], [0.6], [0.0]]
    around, up = random.uniform(0.0, 2.0 * np.pi, count), random.uniform(0.06, 1.0, count)
    level = np.sqrt(1.0 - up**2)
    return corner, size, np.array([level * np.cos(around), level * np.sin(around), up])


def test_what_passes_above_the_grids_meets_nothing(drawn) -> None:
    low, high, grids = drawn
    corner, size, towards = beams(2500)
    passes = grids.passed_by(corner, np.maximum(size[0], size[1]), towards)
    touched = crosses(low, high, corner, size, towards)
    assert 150 < touched.sum() < 2300
    assert not (passes & touched).any()
    assert (passes & ~touched).sum() > 0.4 * (~touched).sum()


def test_straight_down_only_what_is_near_is_in_the_way(drawn) -> None:
    low, high, grids = drawn
    corner, size, _ = beams(3000)
    towards = np.tile([[0.0], [0.0], [1.0]], 3000)
    passes = grids.passed_by(corner, np.maximum(size[0], size[1]), towards)
    assert not (passes & crosses(low, high, corner, size, towards)).any()
    reach = 4.0 * np.maximum(np.maximum(size[0], size[1]), CELL)  # a box of the grid that it was asked of
    far = corner - [reach, reach, np.zeros(3000)]
    wide = np.array([size[0] + 2.0 * reach, size[1] + 2.0 * reach, size[2]])
    lonely = ~crosses(low - CELL * 2.0, high + CELL * 2.0, far, wide, towards)
    assert lonely.sum() > 500
    assert (passes[lonely]).mean() > 0.8


def test_nothing_is_in_the_way_where_nothing_was_drawn() -> None:
    grids = HeightGrids(np.array([[0.0, 0.0, 0.0], [10.0, 10.0, 2.0]]), CELL)
    grids.finish()
    corner, size, towards = beams(100)
    passes = grids.passed_by(corner, np.maximum(size[0], size[1]), towards)
    assert passes.all()


def test_a_box_wider_than_all_is_never_free() -> None:
    grids = PlanGrids(np.array([2.0, 1.0]), 0.5, np.uint8, 0)
    assert grids.level_of(np.array([0.1, 1.5, 1.6, 99.0])).tolist() == [0, 0, 1, len(grids.cells)]


def test_boxes_find_the_largest_value_that_they_touch() -> None:
    random = stream(3, "values")
    grids = PlanGrids(SIZE, CELL, np.int16, -1)
    places, values = random.uniform(0.0, SIZE, (300, 2)).T.astype(np.float32), random.integers(0, 999, 300)
    grids.draw(0, places[:, :150], places[:, :150], values[:150].astype(np.int16))
    grids.draw(3, places[:, 150:], places[:, 150:], values[150:].astype(np.int16))
    grids.finish()
    level = random.integers(0, len(grids.cells) - 1, 500)
    width = WINDOW * grids.cells[level] * random.uniform(0.1, 1.0, 500)
    x, y = random.uniform(0.0, SIZE, (500, 2)).T
    found = grids.largest(level, x, y)
    inside = (np.abs(places[0] - x[:, None] - width[:, None] / 2) <= width[:, None] / 2) & (
        np.abs(places[1] - y[:, None] - width[:, None] / 2) <= width[:, None] / 2
    )
    assert (found >= np.where(inside, values, -1).max(axis=1)).all()


def test_long_triangles_stand_where_they_are() -> None:
    """A thin wire across the area leaves what is two cells beside it free."""
    wire = np.array([[0.0, 5.0, 1.0], [20.0, 15.0, 1.0], [20.0, 15.01, 1.0]], np.float32)
    grids = HeightGrids(np.array([[0.0, 0.0, 0.0], [40.0, 25.0, 1.0]]), CELL)
    grids.draw_triangles(wire.T.copy(), np.array([[0, 1, 2]], np.int32), 0.2)
    grids.finish()
    along = np.linspace(0.5, 19.5, 400)
    down = np.tile([[0.0], [0.0], [1.0]], 400)
    for aside, free in ((0.0, False), (-0.9, True), (0.9, True)):
        corner = np.array([along, 5.0 + along / 2.0 + aside, np.zeros(400)])
        assert (grids.passed_by(corner, np.zeros(400), down) == free).all()
