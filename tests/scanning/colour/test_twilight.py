"""Light at dusk: steady in the sun's height, as bright as measured, and none of the sun from below the horizon."""

import numpy as np
import pytest

from synthroads_addon.scanning.colour.twilight import level_illuminance, sky_share, sky_tint, sun_share

HEIGHTS = np.arange(-90.0, 90.0, 0.1)


def test_light_fades_steadily_into_the_night() -> None:
    levels = np.array([level_illuminance(height) for height in HEIGHTS])
    assert (np.diff(levels) > -1e-3 * levels[1:]).all()
    assert (np.abs(np.diff(np.log10(levels))) < 0.05).all()  # no step between the pieces of the table


@pytest.mark.parametrize(("height", "lux"), [(60.0, 103_000.0), (0.0, 760.0), (-6.0, 3.4), (-12.0, 0.008)])
def test_levels_are_those_of_the_tables(height: float, lux: float) -> None:
    assert level_illuminance(height) == pytest.approx(lux, rel=0.02)


def test_sun_reddens_sets_and_stays_below() -> None:
    assert (sun_share(5.0) == 1.0).all()
    shares = np.array([sun_share(height) for height in HEIGHTS])
    assert (np.diff(shares, axis=0) >= 0.0).all()
    red, green, blue = sun_share(2.0)
    assert 1.0 > red > green > blue > 0.0
    assert (sun_share(-0.3) == 0.0).all()
    assert np.abs(sun_share(4.999) - 1.0).max() < 1e-3


def test_sky_turns_blue_and_dark() -> None:
    assert (sky_share(1.0), sky_share(50.0)) == (1.0, 1.0)
    assert sky_share(-6.0) == pytest.approx(3.41 / 1268.0, rel=0.01)
    assert (sky_tint(1.0) == 1.0).all()
    red, _, blue = sky_tint(-6.0)
    assert blue > 2.0 * red
    assert (sky_tint(-50.0) == sky_tint(-6.0)).all()
