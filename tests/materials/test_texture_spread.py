"""The spread of a material's brightness: its distribution, and what the scan makes of it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from synthroads_addon.base.arithmetic.noise import noise_field
from synthroads_addon.materials import surfaces as module
from synthroads_addon.materials.surfaces import OCTAVES, mean_over_median, spread_factors, surfaces_of
from synthroads_addon.materials.table import Material, materials
from tests.helpers.scenes.scan_scenes import Standing, altered, middle_pulses, plane, scan_of

UNEVEN = materials()["asphalt"].model_copy(update={"spread_below": 0.4, "spread_above": 0.2, "spread_wavelength": 2.0})


def uneven_scan(material: Material = UNEVEN, rays: int = 1, path: Standing | None = None, **changes):
    scan = scan_of(plane(), rays, path, **changes)
    return altered(scan, surfaces=surfaces_of([material]))


@given(st.floats(0.0, 1.5), st.floats(0.0, 1.5))
def test_the_mean_is_one_whatever_the_spreads(below: float, above: float) -> None:
    # Gauss and Hermite's rule on either side: the kink at 0 is what makes this slow to converge, so many nodes.
    z = (np.arange(200_000) + 0.5) / 200_000 * 24.0 - 12.0
    weight = np.exp(-0.5 * z * z)
    mean = (np.exp(z * np.where(z < 0.0, below, above)) * weight).sum() / weight.sum()
    assert mean == pytest.approx(float(mean_over_median(below, above)), rel=1e-6)


def test_logarithms_are_normal_on_either_side(monkeypatch: pytest.MonkeyPatch) -> None:
    z = np.array([-2.0, -1.0, 0.0, 1.0, 2.0])
    monkeypatch.setattr(module, "noise_field", lambda *_: z)
    factors = spread_factors(surfaces_of([UNEVEN]), np.zeros(len(z), dtype=np.intp), np.zeros((len(z), 3)), 1)
    assert np.diff(np.log(factors)) == pytest.approx([0.4, 0.4, 0.2, 0.2])
    assert factors[2] == pytest.approx(1.0 / float(mean_over_median(0.4, 0.2)))


def test_the_field_of_three_octaves_is_nearly_normal() -> None:
    rng = np.random.default_rng(0)
    place = np.column_stack([rng.random((100_000, 2)) * 2000.0, np.zeros(100_000)])
    values = noise_field(place, 1.0, 5, OCTAVES)
    assert np.quantile(values, (0.05, 0.25, 0.5, 0.75, 0.9)) == pytest.approx(
        (-1.645, -0.674, 0.0, 0.674, 1.282), abs=0.045
    )


def test_a_scan_is_as_bright_as_its_places() -> None:
    even, uneven = middle_pulses(scan_of(plane())), middle_pulses(uneven_scan())
    ratio = uneven.points.intensity / even.points.intensity
    place = uneven.points.true_xyz - scan_of(plane()).target.origin
    wanted = spread_factors(surfaces_of([UNEVEN]), np.zeros(len(place), dtype=np.intp), place, 3)
    assert ratio == pytest.approx(wanted, rel=1e-6)
    assert ratio.std() > 0.05
    for name in ("xyz", "range", "class_id"):
        assert np.array_equal(getattr(even.points, name), getattr(uneven.points, name))


def test_a_place_is_as_bright_from_elsewhere() -> None:
    """The pulse nearest to the nadir meets places some centimetres apart from two heights: far less than 2 m."""
    low, high = (middle_pulses(uneven_scan(path=Standing(height)), 1).points for height in (40.0, 80.0))
    assert np.abs(low.true_xyz - high.true_xyz).max() < 0.1
    assert low.intensity / high.intensity == pytest.approx(4.0, rel=0.03)


def test_every_ray_of_a_pulse_shares_its_factor() -> None:
    one, many = (middle_pulses(uneven_scan(rays=rays), 1).points.intensity for rays in (1, 19))
    assert one == pytest.approx(many, rel=2e-2)


def test_dark_places_fall_below_the_threshold() -> None:
    bright = middle_pulses(scan_of(plane())).points.intensity
    between = float(bright.min()) * 0.9
    assert middle_pulses(scan_of(plane(), threshold=between)).below_threshold == 0
    assert middle_pulses(uneven_scan(threshold=between)).below_threshold > 0


def test_without_spread_nothing_is_computed(monkeypatch: pytest.MonkeyPatch) -> None:
    from synthroads_addon.scanning.stages import echoes as module

    def fail(*_: object) -> None:
        raise AssertionError("computed")

    monkeypatch.setattr(module, "spread_factors", fail)
    assert len(middle_pulses(scan_of(plane())).points)
    with pytest.raises(AssertionError, match="computed"):
        middle_pulses(uneven_scan())
    off = altered(scan_of(plane()), surfaces=surfaces_of([UNEVEN], spread=False))
    assert len(middle_pulses(off).points)
