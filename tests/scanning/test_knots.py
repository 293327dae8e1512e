"""Poses that are kept for other blocks are those that a block by itself would work out."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from synthroads_addon.scanning.knots import PoseCache, Track
from tests.helpers.scenes.scan_scenes import upright

Float = NDArray[np.float64]


class Waltz:
    """A body that turns on its way, and is away for a third of the time; counts how often it is asked."""

    def __init__(self) -> None:
        self.asked = 0

    def pose(self, time: Float) -> tuple[Float, Float, NDArray[np.bool_]]:
        self.asked += 1
        place = np.stack([20.0 * time, np.sin(time), np.zeros_like(time)], axis=1)
        return upright(time), place, np.mod(time, 3.0) < 2.0


def assert_same(found: Track, expected: Track) -> None:
    assert (found.begin, found.spacing) == (expected.begin, expected.spacing)
    for name in ("rotation", "position", "present"):
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name))


@settings(max_examples=200, deadline=None)
@given(
    begin=st.floats(-1e4, 1e6),
    duration=st.sampled_from([0.0, 1e-6, 0.3, 2.56, 7.0]),
    spacing=st.sampled_from([0.01, 0.0025, 0.1]),
)
def test_kept_poses_are_the_track_s(begin: float, duration: float, spacing: float) -> None:
    kept = PoseCache(Waltz().pose)
    for shift in (0.0, 0.37, -0.2, 0.0):
        times = (begin + shift, begin + shift + duration, spacing)
        assert_same(kept.track(*times), Track.between(Waltz().pose, *times))


def test_blocks_side_by_side_share_what_is_worked_out() -> None:
    body = Waltz()
    kept = PoseCache(body.pose)
    blocks = [(0.31 * number, 0.31 * (number + 1), 0.01) for number in range(50)]
    kept.track(0.0, 15.5, 0.01)
    assert body.asked == 2  # 1,550 knots, 1,024 at once
    with ThreadPoolExecutor(4) as pool:
        for found, block in zip(pool.map(lambda block: kept.track(*block), blocks), blocks, strict=True):
            assert_same(found, Track.between(Waltz().pose, *block))
    assert body.asked == 2
