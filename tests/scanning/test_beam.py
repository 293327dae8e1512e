"""The rays of a pulse have the moments of the Gaussian beam that they stand for, as a cone and as a cylinder."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from synthroads_addon.base.errors import InputError
from synthroads_addon.scanning.beam import RINGS, beam_pattern, beam_radii, conical_directions, cylindrical_offsets

MINIVUX = (1.6e-3, 0.5e-3)
ring_counts = st.lists(st.integers(3, 30), min_size=0, max_size=6).map(tuple)


def frames(count: int, seed: int = 0):
    """Return axis, in-plane and across vectors (3, P) at right angles, in random directions."""
    turns = np.linalg.qr(np.random.default_rng(seed).normal(size=(count, 3, 3)))[0]
    return tuple(np.ascontiguousarray(turns[:, :, i].T) for i in range(3))


def gaussian_moment(order: int) -> float:
    """Return the mean of x^order over exp(-2 x^2), the beam of radius 1 at 1/e^2."""
    return 0.0 if order % 2 else math.prod(range(1, order, 2)) * 0.25 ** (order // 2)


def moment_error(rings: tuple[int, ...], degree: int) -> float:
    """Return the largest error of a moment of one total degree, in units of the mean of r^degree."""
    pattern = beam_pattern(rings)
    x, y = pattern.across.T
    errors = [
        abs(pattern.weights @ (x**i * y ** (degree - i)) - gaussian_moment(i) * gaussian_moment(degree - i))
        for i in range(degree + 1)
    ]
    return max(errors) / max(pattern.weights @ np.hypot(x, y) ** degree, 1e-300)


@pytest.mark.parametrize(("rays", "rings"), RINGS.items())
def test_counts_and_energy(rays: int, rings: tuple[int, ...]) -> None:
    pattern = beam_pattern(rings)
    assert len(pattern) == rays
    assert pattern.across.shape == (rays, 2)
    assert pattern.across[0].tolist() == [0.0, 0.0]
    assert pattern.weights.min() > 0
    assert pattern.weights.sum() == pytest.approx(1.0, abs=1e-14)


@given(ring_counts)
def test_moments_are_gaussian_up_to_the_stated_degree(rings) -> None:
    pattern = beam_pattern(rings)
    assert len(pattern) == 1 + sum(rings)
    assert pattern.weights.sum() == pytest.approx(1.0, abs=1e-14)
    exact = min(4 * len(rings) + 1, min(rings, default=2) - 1)
    assert max(moment_error(rings, degree) for degree in range(exact + 1)) < 1e-12


@given(st.lists(st.integers(3, 12), min_size=1, max_size=6).map(tuple))
def test_radial_moments_are_exact_whatever_the_rays(rings) -> None:
    pattern = beam_pattern(rings)
    u = 2.0 * (pattern.across**2).sum(axis=1)
    for degree in range(2 * len(rings) + 1):
        assert pattern.weights @ u**degree == pytest.approx(math.factorial(degree), rel=1e-9)


def test_like_rings_are_turned_so_that_their_errors_cancel() -> None:
    """Two rings of 4 cancel wholly, two of 6 in part; rings of 5 and 7 cannot."""
    assert moment_error((4, 4), 4) < 1e-12
    assert moment_error((5, 7), 5) > 1e-2
    assert moment_error((6, 6), 6) < 0.2 * moment_error((6,), 6)


def test_many_rings_stay_sound() -> None:
    pattern = beam_pattern((12,) * 40)
    assert np.isfinite(pattern.across).all()
    assert pattern.weights.min() >= 0
    assert pattern.weights.sum() == pytest.approx(1.0, abs=1e-14)
    assert pattern.weights @ pattern.across[:, 0] ** 2 == pytest.approx(0.25, abs=1e-12)


def test_patterns_are_shared_and_cannot_be_changed() -> None:
    with pytest.raises(ValueError, match="read-only"):
        beam_pattern((6,)).weights[0] = 0.5


@pytest.mark.parametrize("rings", [(2,), (6, 0), (6, -1)])
def test_rings_without_a_middle_are_refused(rings) -> None:
    with pytest.raises(InputError, match="beam rings"):
        beam_pattern(rings)


@pytest.mark.parametrize("rays", [7, 19, 37, 61])
def test_footprint_of_the_minivux_at_100_m(rays: int) -> None:
    """Its data sheet: 160 x 50 mm at 100 m. Four standard deviations of a Gaussian are its width at 1/e^2."""
    axis, in_plane, across = (np.eye(3)[i][:, None] for i in range(3))
    pattern = beam_pattern(RINGS[rays])
    rays_out = conical_directions(axis, in_plane, across, pattern, MINIVUX)[:, :, 0]
    on_plane = rays_out / rays_out[0] * 100.0
    width, height = 4.0 * np.sqrt((pattern.weights * on_plane[1:] ** 2).sum(axis=1))
    assert width == pytest.approx(0.160, abs=1e-6)
    assert height == pytest.approx(0.050, abs=1e-6)


@given(st.integers(1, 5), st.floats(0, 0.1), st.floats(0, 0.1))
def test_cone_ray_by_ray(pulses, first, second) -> None:
    """Unit vectors along axis + tan(D / 2) deflection, pulse by pulse, from no divergence to 100 mrad."""
    axis, in_plane, across = frames(pulses)
    pattern = beam_pattern((6, 12))
    got = conical_directions(axis, in_plane, across, pattern, (first, second))
    assert got.shape == (3, 19, pulses)
    np.testing.assert_allclose(np.linalg.norm(got, axis=0), 1.0, atol=1e-14)
    for pulse in range(pulses):
        for ray, (x, y) in enumerate(pattern.across):
            to = axis[:, pulse] + math.tan(first / 2) * x * in_plane[:, pulse]
            to = to + math.tan(second / 2) * y * across[:, pulse]
            np.testing.assert_allclose(got[:, ray, pulse], to / np.linalg.norm(to), atol=1e-14)


def test_without_divergence_or_with_one_ray_all_is_the_axis() -> None:
    axis, in_plane, across = frames(4)
    for rings, divergence in (((6, 12), (0.0, 0.0)), ((), (0.1, 0.1))):
        pattern = beam_pattern(rings)
        got = conical_directions(axis, in_plane, across, pattern, divergence)
        assert np.array_equal(got, np.repeat(axis[:, None], len(pattern), axis=1))
        assert not cylindrical_offsets(in_plane, across, pattern, divergence, np.full(4, 50.0)).any()


def test_a_pulses_rays_do_not_depend_on_its_neighbours() -> None:
    axis, in_plane, across = frames(1001)
    pattern, distance = beam_pattern((6, 12)), np.linspace(1.0, 150.0, 1001)
    cone = conical_directions(axis, in_plane, across, pattern, MINIVUX)
    cylinder = cylindrical_offsets(in_plane, across, pattern, MINIVUX, distance)
    for part in (slice(0, 1), slice(17, 18), slice(333, 1000)):
        own = [np.ascontiguousarray(vectors[:, part]) for vectors in (axis, in_plane, across)]
        assert np.array_equal(conical_directions(*own, pattern, MINIVUX), cone[:, :, part])
        assert np.array_equal(cylindrical_offsets(*own[1:], pattern, MINIVUX, distance[part]), cylinder[:, :, part])


@given(st.floats(0.5, 500.0), st.floats(1e-5, 0.1))
def test_cone_and_cylinder_agree_at_the_first_hit_only(distance, divergence) -> None:
    """A step behind the first hit: the cone's footprint has grown with the distance, the cylinder's has not."""
    axis, in_plane, across = frames(1)
    pattern = beam_pattern((6,))
    cone = conical_directions(axis, in_plane, across, pattern, (divergence, divergence / 2))[:, :, 0]
    reach = np.array([distance])
    cylinder = cylindrical_offsets(in_plane, across, pattern, (divergence, divergence / 2), reach)[:, :, 0]
    along = axis[:, 0] @ cone

    def spread(reach: float):
        return cone / along * reach - axis * reach

    np.testing.assert_allclose(axis[:, 0] @ cylinder, 0.0, atol=1e-12 * distance)
    np.testing.assert_allclose(cylinder, spread(distance), atol=1e-13 * distance)
    np.testing.assert_allclose(2.0 * cylinder, spread(2.0 * distance), atol=1e-13 * distance)


def test_pulses_without_a_first_hit_have_no_width() -> None:
    _, in_plane, across = frames(5)
    distance = np.array([np.inf, np.nan, 0.0, -3.0, 10.0])
    offsets = cylindrical_offsets(in_plane, across, beam_pattern((6,)), (0.01, 0.01), distance)
    assert not offsets[:, :, :4].any()
    largest = np.linalg.norm(offsets[:, :, 4], axis=0).max()
    assert largest == pytest.approx(10.0 * beam_radii((0.01, 0.01))[0] * np.linalg.norm(beam_pattern((6,)).across[1]))
