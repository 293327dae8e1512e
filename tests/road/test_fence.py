"""Fences: posts only as far as there is a road."""

from __future__ import annotations

import numpy as np

from synthroads_addon.road.things.fence import Fence


def fence(end_station: float) -> Fence:
    return Fence(instance=1, start_station=3.0, end_station=end_station, offset=20.0, post_spacing=5.0)


def test_a_fence_that_goes_on_beyond_the_road_has_posts_up_to_its_end() -> None:
    """Without making any beyond: to a station of 1e15 m they would fill petabytes."""
    assert np.array_equal(fence(1e15).posts(48.0), [*np.arange(3.0, 48.0, 5.0), 48.0])
    assert np.array_equal(fence(1e15).posts(3.0), [3.0])


def test_the_last_post_stands_at_the_fences_end() -> None:
    assert np.array_equal(fence(21.0).posts(21.0), [3.0, 8.0, 13.0, 18.0, 21.0])
    assert np.array_equal(fence(23.0).posts(23.0), [3.0, 8.0, 13.0, 18.0, 23.0])
