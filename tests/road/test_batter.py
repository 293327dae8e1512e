"""The shape of the ground beside the road: planes, crest, swale, roundings, as the documentation says."""

from __future__ import annotations

import numpy as np
import pytest

from synthroads_addon.base.arrays import Float
from synthroads_addon.road.surroundings import Terrain
from synthroads_addon.road.terrain import batter_height, ditch_share, foot_reach, swale_share

SLOPE, CREST, ROUNDING, WIDE, DEEP = 1.6, 0.8, 2.4, 2.0, 0.4


def terrain(**shape: float) -> Terrain:
    place = {"instance": 1, "half_width": 60.0, "embankment_height": 0.0, "undulation": 0.0, "wavelength": 60.0}
    return Terrain(seed=1, batter_slope=SLOPE, **place, **shape)


SHAPED = terrain(crest_length=CREST, rounding_length=ROUNDING, swale_width=WIDE, swale_depth=DEEP)


def heights(item: Terrain, distance: Float, above: float) -> Float:
    """Return the heights (N,) beside a road whose ground is level, so high above its edge (m)."""
    level = np.full(distance.shape, above)
    return batter_height(item, distance, level, level)


def test_without_a_shape_it_is_the_ground_between_two_planes() -> None:
    rng = np.random.default_rng(1)
    distance, ground, at_edge = rng.uniform(0.0, 20.0, 500), rng.normal(0.0, 4.0, 500), rng.normal(0.0, 4.0, 500)
    expected = np.clip(ground, -distance / SLOPE, distance / SLOPE)
    assert batter_height(terrain(), distance, ground, at_edge) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("above", [-6.0, -2.0, -0.4, 0.3, 0.6, 2.0, 6.0])
def test_it_begins_at_the_edge_ends_on_the_ground_and_has_no_kink(above: float) -> None:
    distance = np.linspace(0.0, 20.0, 20_001)
    found = heights(SHAPED, distance, above)
    assert found[0] == pytest.approx(0.0, abs=1e-12)
    assert found[-1] == above
    slopes = np.diff(found) / np.diff(distance)
    # Where a bank is too low for all of it, swale or crest meet the ground at an angle.
    assert np.abs(np.diff(slopes)).max() < 0.003 or abs(above) < 1.0
    # A fifth of its width deep, a swale is 63 % steep.
    assert np.abs(slopes).max() < max(1.0 / SLOPE, np.pi * DEEP / WIDE) + 0.35


def test_crest_batter_and_toe_of_an_embankment() -> None:
    at = np.array([CREST, 2.0 * CREST, 5.0])
    plane = -(at - CREST) / SLOPE
    plane[0] = -CREST / (4.0 * SLOPE)
    assert heights(SHAPED, at, -6.0) == pytest.approx(plane)
    toe = CREST + 6.0 * SLOPE
    around = heights(SHAPED, toe + np.array([-ROUNDING, 0.0, ROUNDING]), -6.0)
    # A parabola's middle is half its tangents' rise at the corner away from it, by half.
    assert around == pytest.approx([-6.0 + ROUNDING / SLOPE, -6.0 + ROUNDING / SLOPE / 4.0, -6.0])


def test_swale_batter_and_top_of_a_cutting() -> None:
    found = heights(SHAPED, np.array([0.0, WIDE / 4.0, WIDE / 2.0, WIDE, 5.0]), 6.0)
    foot = WIDE / (4.0 * SLOPE)
    assert found == pytest.approx([0.0, -DEEP / 2.0, -DEEP, foot, (5.0 - 0.75 * WIDE) / SLOPE])
    top = 0.75 * WIDE + 6.0 * SLOPE
    assert heights(SHAPED, np.array([top]), 6.0) == pytest.approx(6.0 - ROUNDING / SLOPE / 4.0)


def test_a_low_banks_rounding_is_shorter() -> None:
    low = terrain(rounding_length=ROUNDING)
    found = heights(low, np.array([0.5 * SLOPE]), -0.5)  # at the toe of half a metre
    assert found == pytest.approx(-0.5 + 0.5 / 4.0)


def test_a_swale_begins_with_the_cutting() -> None:
    middle = np.full(4, WIDE / 2.0)
    at_edge = np.array([-1.0, 0.2, 0.5, 0.8])
    assert swale_share(at_edge) == pytest.approx([0.0, 0.0, 0.5, 1.0])
    found = batter_height(terrain(swale_width=WIDE, swale_depth=DEEP), middle, np.full(4, 3.0), at_edge)
    assert found[1:] == pytest.approx([0.0, -DEEP / 2.0, -DEEP])


def test_a_ditch_lies_at_the_foot_of_an_embankment() -> None:
    item = terrain(crest_length=CREST, rounding_length=ROUNDING, ditch_width=WIDE, ditch_depth=DEEP)
    toe = CREST + 6.0 * SLOPE
    beyond = np.array([-1.0, 0.0, WIDE / 4.0, WIDE / 2.0, WIDE, WIDE + 1.0])
    found = heights(item, toe + beyond, -6.0)
    # The foot isn't rounded: the batter goes on into the ditch.
    assert found == pytest.approx([-6.0 + 1.0 / SLOPE, -6.0, -6.0 - DEEP / 2.0, -6.0 - DEEP, -6.0, -6.0])
    assert heights(item, toe + beyond, 6.0) == pytest.approx(
        heights(SHAPED.model_copy(update={"swale_width": 0.0}), toe + beyond, 6.0)
    )


@pytest.mark.parametrize(("above", "share"), [(-0.2, 0.0), (-0.5, 0.5), (-0.8, 1.0), (0.5, 0.0)])
def test_a_ditch_begins_with_the_embankment(above: float, share: float) -> None:
    item = terrain(ditch_width=WIDE, ditch_depth=DEEP)
    assert ditch_share(item, np.array([above]))[0] == pytest.approx(share)
    low = heights(item, np.linspace(0.0, 8.0, 8001), above).min()
    assert low == pytest.approx(min(above, 0.0) - share * DEEP, abs=1e-4)
    before, beyond = foot_reach(item, np.array([above]))
    assert (before[0], beyond[0]) == (0.0, pytest.approx(WIDE if share else 0.0))


@pytest.mark.parametrize("above", [-0.3, -0.5, -0.9, -4.0])
def test_beside_a_ditch_there_is_no_step(above: float) -> None:
    item = terrain(crest_length=CREST, rounding_length=ROUNDING, ditch_width=WIDE, ditch_depth=DEEP)
    distance = np.linspace(0.0, 20.0, 20_001)
    slopes = np.diff(heights(item, distance, above)) / np.diff(distance)
    assert np.abs(slopes).max() < max(1.0 / SLOPE, np.pi * DEEP / WIDE) + 0.05
