"""Rays are grouped into the returns that a receiver of a given resolution would see."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from synthroads_addon.scanning.returns import HitSignals, group_returns, number_returns

INF = np.inf


def group(ranges, resolution=0.6, behind=()):
    """Group rays (P, K); ``behind`` are (pulse, range) of hits behind permeable surfaces. All have the same energy."""
    ranges = np.array(ranges, dtype=float)
    share = np.full(ranges.T.shape, 1.0 / ranges.shape[1])
    energy = np.where(np.isfinite(ranges.T), share, 0.0)
    pulse, late = np.array([p for p, _ in behind], dtype=np.intp), np.array([r for _, r in behind], dtype=float)
    same = np.full(len(late), 1.0 / ranges.shape[1])
    return group_returns(HitSignals(ranges.T, share, energy), HitSignals(late, same, same), pulse, resolution)


def test_one_surface_is_one_return() -> None:
    echoes = group([[10.0, 10.2, 10.4]])
    assert echoes.pulse.tolist() == [0]
    assert echoes.range[0] == np.float64(10.2)


def test_step_edge_is_two_returns_with_their_shares() -> None:
    echoes = group([[10.0, 13.0, 10.1, 13.1]])
    np.testing.assert_allclose(echoes.range, [10.05, 13.05])
    np.testing.assert_allclose(echoes.intensity, [0.5, 0.5])
    assert echoes.hit[0] in (0, 2)  # of one pulse, so the ray's number
    assert echoes.hit[1] in (1, 3)


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
    distance = np.array([[10.0, 10.1, 10.2], [10.0, 20.0, 20.1]]).T
    energy = np.array([[0.1, 0.7, 0.2], [0.2, 0.1, 0.4]]).T
    none = HitSignals(np.empty(0), np.empty(0), np.empty(0))
    echoes = group_returns(HitSignals(distance, np.full((3, 2), 1 / 3), energy), none, np.empty(0, dtype=np.intp), 0.6)
    assert echoes.hit.tolist() == [2, 1, 5]  # ray 1 of pulse 0, rays 0 and 2 of pulse 1


def test_what_lies_behind_leaves_is_grouped_with_the_rest_of_its_pulse() -> None:
    """Whole pulses with hits behind permeable surfaces, by chance as many as there are rays, with one ray and three."""
    echoes = group([[5.0, 5.1, 5.2], [7.0, 7.0, 7.0]], behind=[(0, 9.0), (0, 9.1), (0, 9.2)])
    assert echoes.pulse.tolist() == [0, 0, 1]
    np.testing.assert_allclose(echoes.range, [5.1, 9.1, 7.0])
    echoes = group([[5.0], [6.0]], behind=[(0, 8.0), (1, 6.2)])
    assert echoes.pulse.tolist() == [0, 0, 1]
    np.testing.assert_allclose(echoes.range, [5.0, 8.0, 6.1])


@given(
    hnp.arrays(np.float64, (5, 7), elements=st.one_of(st.floats(1, 200), st.just(INF))),
    st.lists(st.tuples(st.integers(0, 4), st.floats(1, 200)), max_size=20),
    st.floats(0.01, 5.0),
)
def test_laws(ranges, behind, resolution) -> None:
    """Energy is kept, returns are in order, apart by more than the resolution, and within their rays."""
    echoes = group(ranges, resolution, behind)
    assert np.all(np.diff(echoes.pulse) >= 0)
    for pulse in range(len(ranges)):
        mine = echoes.pulse == pulse
        hits = np.concatenate([ranges[pulse][np.isfinite(ranges[pulse])], [r for p, r in behind if p == pulse]])
        np.testing.assert_allclose(echoes.intensity[mine].sum(), len(hits) / 7)
        assert np.all(np.diff(echoes.range[mine]) > resolution - 1e-9)
        if len(hits):
            mean = (echoes.range[mine] * echoes.intensity[mine]).sum() / echoes.intensity[mine].sum()
            np.testing.assert_allclose(mean, hits.mean(), rtol=1e-12)


def test_numbers_and_the_device_limit() -> None:
    keep, number, count = number_returns(np.array([0, 0, 0, 2, 3, 3]), maximum=2)
    assert keep.tolist() == [True, True, False, True, True, True]
    assert number.tolist() == [1, 2, 1, 1, 2]
    assert count.tolist() == [2, 2, 1, 2, 2]
    assert [len(a) for a in number_returns(np.empty(0, dtype=np.intp), 5)] == [0, 0, 0]
