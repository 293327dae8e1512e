"""Rays are grouped into the returns that a receiver of a given resolution would see."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from synthroads_addon.core.scanning.returns import group_returns, number_returns

INF = np.inf


def group(ranges, resolution=0.6):
    ranges = np.array(ranges, dtype=float)
    weights = np.full(ranges.shape, 1.0 / ranges.shape[1])
    return group_returns(ranges, weights, np.where(np.isfinite(ranges), weights, 0.0), resolution)


def test_one_surface_is_one_return() -> None:
    echoes = group([[10.0, 10.2, 10.4]])
    assert echoes.pulse.tolist() == [0]
    assert echoes.range[0] == np.float64(10.2)


def test_step_edge_is_two_returns_with_their_shares() -> None:
    echoes = group([[10.0, 13.0, 10.1, 13.1]])
    np.testing.assert_allclose(echoes.range, [10.05, 13.05])
    np.testing.assert_allclose(echoes.intensity, [0.5, 0.5])
    assert set(echoes.ray.tolist()) <= {0, 2, 1, 3}


def test_a_long_slope_stays_connected() -> None:
    """A tilted plane whose rays follow each other within the resolution is one surface."""
    assert len(group([np.linspace(10, 13, 7)], resolution=0.6).pulse) == 1


def test_misses_are_no_returns() -> None:
    echoes = group([[INF, INF], [5.0, INF], [INF, INF]])
    assert echoes.pulse.tolist() == [1]
    np.testing.assert_allclose(echoes.intensity, [0.5])


def test_nothing_hit_and_no_pulse_at_all() -> None:
    assert len(group([[INF, INF]]).pulse) == 0
    assert len(group(np.empty((0, 3))).pulse) == 0


def test_label_is_of_the_strongest_ray() -> None:
    echoes = group_returns(
        np.array([[10.0, 10.1, 10.2], [10.0, 20.0, 20.1]]),
        np.full((2, 3), 1 / 3),
        np.array([[0.1, 0.7, 0.2], [0.2, 0.1, 0.4]]),
        0.6,
    )
    assert echoes.ray.tolist() == [1, 3, 5]


@given(
    hnp.arrays(np.float64, (5, 7), elements=st.one_of(st.floats(1, 200), st.just(INF))),
    st.floats(0.01, 5.0),
)
def test_laws(ranges, resolution) -> None:
    """Energy is kept, returns are in order, apart by more than the resolution, and within their rays."""
    weights = np.full(ranges.shape, 1 / 7)
    energy = np.where(np.isfinite(ranges), weights, 0.0)
    echoes = group_returns(ranges, weights, energy, resolution)
    for pulse in range(len(ranges)):
        mine = echoes.pulse == pulse
        np.testing.assert_allclose(echoes.intensity[mine].sum(), energy[pulse].sum())
        assert np.all(np.diff(echoes.range[mine]) > resolution - 1e-9)
        hits = ranges[pulse][np.isfinite(ranges[pulse])]
        if len(hits):
            mean = (echoes.range[mine] * echoes.intensity[mine]).sum() / echoes.intensity[mine].sum()
            np.testing.assert_allclose(mean, hits.mean(), rtol=1e-12)


def test_numbers_and_the_device_limit() -> None:
    keep, number, count = number_returns(np.array([0, 0, 0, 2, 3, 3]), maximum=2)
    assert keep.tolist() == [True, True, False, True, True, True]
    assert number.tolist() == [1, 2, 1, 1, 2]
    assert count.tolist() == [2, 2, 1, 2, 2]
    assert [len(a) for a in number_returns(np.empty(0, dtype=np.intp), 5)] == [0, 0, 0]
