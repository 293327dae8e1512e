"""The laser equation against closed forms written with angles and tangents, and at its extremes."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from synthroads_addon.materials.reflectance import EDGE_ON, facet_slope, facet_terms, reflectivity, returned_share
from synthroads_addon.scanning.receiving.radiometry import NEAREST, received_intensity, saturate
from tests.helpers.laser_equation import intensity_of

RANGES = np.array([1.0, 1.7, 5.0, 20.0, 60.0, 123.4, 250.0, 500.0])
ANGLES = np.deg2rad(np.append(np.arange(0.0, 90.0, 2.5), [88.0, 89.0, 89.9, 89.999, 90.0]))
SLOPES = np.array([0.0, 1e-6, 0.05, 0.2, 0.5, 1.0])
ATTENUATIONS = [0.0, 1e-4, 0.01, 0.05, 0.2]


def closed_form(reflectance, angle, distance, slope, attenuation):
    """Return R cos t (A + B sin t tan t) / d^2 exp(-a d) in extended precision; 0 at 90 degrees."""
    angle, distance, slope = (np.asarray(value, dtype=np.longdouble) for value in (angle, distance, slope))
    variance = slope**2
    a = 1 - variance / (2 * (variance + np.longdouble("0.33")))
    b = np.longdouble("0.45") * variance / (variance + np.longdouble("0.09"))
    bright = np.cos(angle) * (a + b * np.sin(angle) * np.tan(angle))
    bright = np.where(angle >= np.longdouble(np.pi / 2), 0, bright)
    return reflectance * bright / distance**2 * np.exp(-np.longdouble(attenuation) * distance)


@pytest.mark.parametrize("attenuation", ATTENUATIONS)
def test_laser_equation_against_closed_form(attenuation) -> None:
    distance, angle, slope = np.meshgrid(RANGES, ANGLES, SLOPES, indexing="ij")
    expected = closed_form(0.37, angle, distance, slope, attenuation)
    got = intensity_of(0.37, np.cos(angle), distance, slope, attenuation)
    assert got.dtype == np.float64
    np.testing.assert_allclose(got, expected.astype(np.float64), rtol=1e-10)
    flat = closed_form(0.37, angle, distance, 0.0, attenuation)
    lambert = intensity_of(0.37, np.cos(angle), distance, attenuation=attenuation)
    np.testing.assert_allclose(lambert, flat.astype(np.float64), rtol=1e-10)


def test_oren_nayar_without_facets_is_lambert_to_the_bit() -> None:
    rng = np.random.default_rng(1)
    cosine, reflectance = rng.uniform(-1, 1, 10_000), rng.uniform(0, 1.5, 10_000)
    distance = rng.uniform(0, 500, 10_000)
    assert [float(term) for term in facet_terms(0.0)] == [1.0, 0.0]
    facets = returned_share(cosine, reflectance, np.ones(10_000), np.zeros(10_000))
    assert np.array_equal(facets, returned_share(cosine, reflectance))
    assert np.array_equal(facets, np.where(cosine > 0, cosine * reflectance, 0.0))
    flat = intensity_of(reflectance, cosine, distance, 0.0, 0.01)
    assert np.array_equal(intensity_of(reflectance, cosine, distance, np.zeros(10_000), 0.01), flat)


def test_rough_surfaces_are_darker_from_above_and_brighter_at_a_slant() -> None:
    smooth, rough = (intensity_of(1.0, np.cos([0.0, 1.4]), 1.0, slope) for slope in (0.05, 0.5))
    assert rough[0] < smooth[0]
    assert rough[1] > smooth[1]


def test_facets_of_a_roughness() -> None:
    """A renderer's roughness 1 is a Beckmann slope of 1 / sqrt 2 along each axis."""
    assert facet_slope(0.0) == 0.0
    assert math.tan(float(facet_slope(1.0))) == pytest.approx(1 / math.sqrt(2))
    assert math.tan(float(facet_slope(0.5))) == pytest.approx(0.25 / math.sqrt(2))


@pytest.mark.parametrize("slope", [0.0, 0.3, 1.0])
def test_back_faces_and_faces_on_edge_are_dark(slope) -> None:
    for cosine in (0.0, math.cos(math.pi / 2), EDGE_ON, -1e-9, -0.5, -1.0, math.nan):
        assert intensity_of(1.0, cosine, 10.0, slope) == 0.0
        assert returned_share(cosine, 1.0, *facet_terms(slope), retro=300.0, inverse_lobe_squared=1.0) == 0.0
    assert intensity_of(1.0, 1e-9, 10.0, slope) > 0.0


@given(st.floats(0, math.pi / 2 - 1e-6), st.floats(0, 1000), st.floats(0.1, 2.0))
def test_retroreflection_adds_a_gaussian_of_the_entrance_angle(angle, retro, lobe) -> None:
    plain = returned_share(math.cos(angle), 0.5)
    both = returned_share(math.cos(angle), 0.5, retro=retro, inverse_lobe_squared=1 / lobe**2)
    assert both[0] - plain[0] == pytest.approx(retro * math.exp(-((angle / lobe) ** 2)), rel=1e-6, abs=1e-9)


def test_only_what_retroreflects_gets_brighter() -> None:
    cosine = np.full(5, 0.8)
    retro = np.array([0.0, 300.0, 0.0, 1.0, 0.0])
    got = returned_share(cosine, 0.5, retro=retro, inverse_lobe_squared=np.full(5, 2.0))
    assert ((got > 0.4) == (retro > 0)).all()
    assert np.array_equal(got[retro == 0], returned_share(cosine, 0.5)[retro == 0])


any_float = st.floats(allow_nan=True, allow_infinity=True)


@given(
    cosine=st.one_of(st.floats(-1, 1), st.sampled_from([0.0, -0.0, 1e-300, 1e-16, math.nan])),
    distance=st.one_of(any_float, st.sampled_from([0.0, 5e-324, 1e-300, 1e300, math.inf])),
    slope=st.one_of(st.floats(0, 1e308), st.sampled_from([0.0, 1e-300, math.pi / 2, math.inf])),
    attenuation=st.sampled_from([0.0, 1e-300, 0.2, 1.0, 1e6]),
    retro=st.floats(0, 1e4),
    inverse_lobe_squared=st.floats(0, 1e12),
)
def test_nothing_is_infinite_or_undefined(cosine, distance, slope, attenuation, retro, inverse_lobe_squared) -> None:
    with np.errstate(divide="raise", invalid="raise"):
        share = returned_share(cosine, 1.5, *facet_terms(slope), retro, inverse_lobe_squared)
        intensity = received_intensity(share, distance, attenuation)
    for value in (share, intensity, intensity_of(1.5, cosine, distance, 0.0, attenuation)):
        assert np.isfinite(value).all()
        assert (value >= 0.0).all()
    if not distance > 0.0 or distance == math.inf:
        assert intensity == 0.0


def test_extremes_raise_no_floating_point_error() -> None:
    distance = np.array([0.0, 1e-300, 1e-9, 1.0, 1e3, 1e6, 1e300, np.inf])
    with np.errstate(all="raise"):
        got = intensity_of(1.0, 1.0, distance, attenuation=0.2)
        assert received_intensity(np.array([1.0]), np.array([3600.0]), 0.2) < 1e-300
    assert got[[0, 5, 6, 7]].tolist() == [0.0] * 4
    assert got[[1, 2]] == pytest.approx(NEAREST**-2, rel=1e-3)
    assert (np.diff(got[2:]) <= 0.0).all()


def test_the_light_is_not_stronger_nearer_than_a_millimetre() -> None:
    assert received_intensity(1.0, NEAREST / 1e6) == received_intensity(1.0, NEAREST)
    assert received_intensity(1.0, NEAREST) == pytest.approx(1e6)


def test_a_white_target_at_one_metre_is_1() -> None:
    assert intensity_of(1.0, 1.0, 1.0) == 1.0
    assert intensity_of(1.0, 1.0, 2.0, attenuation=0.5) == pytest.approx(0.25 / math.e)


def test_the_detector_clips_and_counts() -> None:
    intensity = np.array([0.5, 2.0, 3.0, 2.0])
    clipped, count = saturate(intensity, 2.0)
    assert clipped.tolist() == [0.5, 2.0, 2.0, 2.0]
    assert count == 1
    assert intensity[2] == 3.0
    assert saturate(intensity, math.inf)[1] == 0
    assert saturate(np.empty(0), 1.0)[1] == 0


def test_reflectivity_formula() -> None:
    color = [0.2, 0.5, 0.1]
    luminance = 0.3 * 0.2 + 0.59 * 0.5 + 0.11 * 0.1
    assert reflectivity(color, 0.0, 0.04) == pytest.approx(0.04 + luminance / 2)
    assert reflectivity(color, 1.0, 0.04) == pytest.approx(luminance)
    assert reflectivity([1.0, 1.0, 1.0], 0.25, 0.1) == pytest.approx(0.75 * 0.6 + 0.25)
