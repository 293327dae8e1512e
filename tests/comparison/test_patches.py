"""Statistics of patches: their values on clouds that are known, and what they must not depend on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from synthroads_addon.base.errors import InputError
from synthroads_addon.cloud.selection.classes import RealCloud
from synthroads_addon.cloud.selection.patches import (
    EDGE,
    FEATURES,
    GROUPS,
    make_patches,
    match_density,
    with_points_beside,
)
from tests.helpers.clouds.pavement_points import pavement

PER_POINT = ("place", "intensity", "distance", "incidence", "returns")

RANDOM, LATTICE = "random", "lattice"


def median(name: str, **changes: object) -> float:
    """Return the median of a statistic over the patches of made-up pavement."""
    return float(np.median(make_patches(pavement(**changes), "x").values[:, FEATURES.index(name)]))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("name", "changes", "expected"),
    [
        ("clark_evans", {}, pytest.approx(1.0, abs=0.06)),
        ("clark_evans", {"pattern": LATTICE}, pytest.approx(2.0, abs=0.06)),
        # Of points at random the distance to the nearest is Rayleigh distributed: sqrt(4 / pi - 1).
        ("spacing_variation", {}, pytest.approx(0.523, abs=0.03)),
        ("spacing_variation", {"pattern": LATTICE}, pytest.approx(0.0, abs=1e-6)),
        ("residual_mm", {"height_noise": 0.01}, pytest.approx(10.0, abs=0.5)),
        ("residual_kurtosis", {}, pytest.approx(2.9, abs=0.2)),
        ("curvature", {"curvature": 0.02, "height_noise": 1e-5}, pytest.approx(0.02, abs=1e-4)),
        # The quartiles of a normal distribution lie 1.349 standard deviations apart.
        ("intensity_iqr_db", {"spread_db": 1.0}, pytest.approx(1.349, abs=0.1)),
        ("short_semivariance", {}, pytest.approx(1.0, abs=0.06)),
        ("height_correlation", {"brighter_by_height": 80.0}, pytest.approx(0.62, abs=0.05)),
    ],
)
def test_known_clouds_have_known_statistics(name: str, changes: dict[str, object], expected: float) -> None:
    assert median(name, **changes) == expected


def test_gain_and_place_don_t_matter() -> None:
    road = pavement()
    moved = pavement(gain=37.0, shift=(294_000.0, 5_628_000.0, 180.0))
    one, other = make_patches(road, "x"), make_patches(moved, "x")
    assert len(one) == len(other)
    np.testing.assert_allclose(other.values, one.values, atol=2e-4)


def test_patches_that_something_cuts_off_are_left_out() -> None:
    road = make_patches(pavement(), "x")
    cut = make_patches(pavement(strip=0.8 * EDGE), "x")
    assert (np.abs(cut.place[:, 1]) > 1e-9).all()
    assert len(cut) == len(road) - np.sum(road.place[:, 1] == 0.0)


def test_too_thin_a_cloud_is_refused_by_name() -> None:
    with pytest.raises(InputError, match=r"thin.laz.*has no 1.5 m of pavement with 20 points or more"):
        make_patches(pavement(density=3.0), "thin.laz")


def test_patches_are_matched_by_density() -> None:
    one = make_patches(pavement(density=30.0), "x")
    other = make_patches(pavement(density=24.0, seed=2), "x")
    first, second = match_density(one, other, 1, 1000)
    assert np.median(one.density) > 1.2 * np.median(other.density)
    assert np.median(first.density) == pytest.approx(np.median(second.density), rel=0.05)
    assert len(match_density(one, other, 1, 10)[0]) == 10


def test_points_are_spread_alike_wherever_the_pavement_ends() -> None:
    """A strip of it, cut out between markings, has the spacing of the whole; without the points beside it hasn't."""
    whole = pavement(density=20.0)
    inside = (whole.place[:, 1] >= 0.0) & (whole.place[:, 1] < EDGE)
    strip = replace(whole, **{name: getattr(whole, name)[inside] for name in PER_POINT})
    others = whole.place[~inside]
    above = whole.place + [0.0, 0.0, 2.0]  # a vehicle's, of no surface of ours
    nothing = np.zeros(0)
    places = np.concatenate([strip.place, others, above])
    cloud = RealCloud(places, nothing, nothing.astype(int), None, nothing, nothing, nothing.astype(np.uint8))
    beside = with_points_beside(cloud, strip)
    assert beside.beside is not None
    assert 0 < len(beside.beside) < len(others)
    pattern = [FEATURES.index(name) for name in GROUPS["pattern"]]
    wanted, found = make_patches(whole, "x"), make_patches(beside, "x")
    row = wanted.place[:, 1] == 0.0
    np.testing.assert_allclose(found.place, wanted.place[row])
    np.testing.assert_allclose(found.values[:, pattern], wanted.values[row][:, pattern], rtol=1e-9)
    last = FEATURES.index("eighth_neighbour")
    assert np.median(make_patches(strip, "x").values[:, last]) > 1.05 * np.median(found.values[:, last])
