"""The laser equation against its closed form, and at its extremes."""

import numpy as np
import pytest

from synthroads_addon.core.scanning.radiometry import lambert_intensity, lit_color, reflectivity


def test_reflectivity_formula() -> None:
    color = [0.2, 0.5, 0.1]
    luminance = 0.3 * 0.2 + 0.59 * 0.5 + 0.11 * 0.1
    assert reflectivity(color, 0.0, 0.04) == pytest.approx(0.04 + luminance / 2)
    assert reflectivity(color, 1.0, 0.04) == pytest.approx(luminance)
    assert reflectivity([1.0, 1.0, 1.0], 0.25, 0.1) == pytest.approx(0.75 * 0.6 + 0.25)


def test_lambert_against_closed_form() -> None:
    d, t = np.meshgrid(np.linspace(1, 500, 50), np.deg2rad(np.linspace(0, 90, 46)))
    for attenuation in (0.0, 0.01, 0.2):
        got = lambert_intensity(0.5, np.cos(t), d, attenuation, emitted=3.0)
        expected = 3.0 * 0.5 * np.cos(t) / d**2 * np.exp(-attenuation * d)
        np.testing.assert_allclose(got, expected, rtol=1e-12)


def test_extremes_are_finite() -> None:
    distance = np.array([0.0, 1e-300, 1e-9, 1.0, 1e6, np.inf])
    with np.errstate(all="raise", under="ignore", over="ignore"):
        got = lambert_intensity(1.0, 1.0, distance, attenuation=0.2)
    assert got[0] == 0.0
    assert got[-1] == 0.0
    assert got[-2] == 0.0
    assert not np.isnan(got).any()
    assert lambert_intensity(1.0, -0.5, 10.0) == 0.0
    assert lambert_intensity(1.0, 0.0, 10.0) == 0.0


def test_colour_is_srgb_of_the_linear_base() -> None:
    from synthroads_addon.core.scanning.radiometry import SUN

    color = lit_color(np.array([[0.0, 0.5, 1.0]]), SUN[None, :])
    assert color[0, 0] == 0
    assert color[0, 2] == 65535
    assert color[0, 1] / 65535 == pytest.approx(0.7354, abs=1e-3)
