"""Random fields by a compiled loop: byte for byte those of NumPy, at any place and scale."""

from __future__ import annotations

import platform

import numpy as np
import pytest

from synthroads_addon.base.arithmetic.noise import CHUNK, MAX_OCTAVES, noise_by, noise_field
from synthroads_addon.base.random_streams import stream
from synthroads_addon.scanning.kernels.library import load_kernel
from synthroads_addon.scanning.kernels.noise import CompiledNoise, usable_noise
from synthroads_addon.scanning.record import scan_blocks
from tests.helpers.scenes.scan_scenes import Standing, altered, plane, scan_of

pytestmark = pytest.mark.any_blender

ODD = [0.0, -0.0, 1.0, -1.0, 0.5, 1e-310, np.nan, np.inf, -np.inf, 2.0**50, -(2.0**51), 2.0**52 + 1, 1e17, -1e19, 1e300]


@pytest.fixture(params=["usual", "narrow"])
def kernel(request: pytest.FixtureRequest) -> CompiledNoise:
    """Return the kernel, and its version for processors without wide instructions."""
    found = usable_noise()
    assert isinstance(found, CompiledNoise), f"{found}: python tools/build_kernels.py"
    if request.param == "usual":
        return found
    if platform.machine().lower() not in ("x86_64", "amd64"):
        pytest.skip("one version for all processors")
    other, narrow = CompiledNoise(), load_kernel("noise").synthroads_noise_narrow
    narrow.restype, narrow.argtypes = found._fill.restype, found._fill.argtypes
    other._fill = narrow
    return other


def assert_same(kernel: CompiledNoise, *arguments: object) -> None:
    expected = noise_field(*arguments)  # type: ignore[arg-type]
    with noise_by(kernel):
        found = noise_field(*arguments)  # type: ignore[arg-type]
    np.testing.assert_array_equal(found, expected)
    number = ~np.isnan(expected)  # what isn't one has no sign either
    assert found[number].tobytes() == expected[number].tobytes()
    assert found.dtype == expected.dtype


@pytest.mark.parametrize("octaves", range(1, MAX_OCTAVES + 1))
@pytest.mark.parametrize("averaged", [False, True])
def test_any_octaves_places_and_patches(kernel: CompiledNoise, octaves: int, averaged: bool) -> None:
    random = stream(octaves, "places")
    place = random.normal(0.0, 10.0 ** random.integers(-2, 7), (2000, 3))
    patch = tuple(10.0 ** random.uniform(-6, 1, (2, 2000))) if averaged else None
    assert_same(kernel, place, 10.0 ** random.uniform(-2, 2, 2000), octaves, octaves, patch)
    assert_same(kernel, place, 0.1, octaves, octaves, patch)


@pytest.mark.parametrize("count", [0, 1, 2, 31, 32, 33, CHUNK + 5])
def test_any_number_of_places(kernel: CompiledNoise, count: int) -> None:
    assert_same(kernel, stream(count, "places").normal(0.0, 50.0, (count, 3)), 0.4, 7)


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_places_that_are_no_places(kernel: CompiledNoise) -> None:
    place = np.stack(np.meshgrid(ODD, ODD, ODD), axis=-1).reshape(-1, 3)
    assert_same(kernel, place, 2.0, 3, 4)
    assert_same(kernel, place, 2.0, 3, 1, (np.abs(place[:, 0]), np.abs(place[:, 1])))


@pytest.mark.parametrize("form", ["f4", "F", "strided"])
def test_places_in_any_form(kernel: CompiledNoise, form: str) -> None:
    place = stream(1, "places").normal(0.0, 50.0, (500, 6))
    forms = {"f4": place[:, :3].astype("f4"), "F": np.asfortranarray(place[:, :3]), "strided": place[::3, ::2]}
    assert_same(kernel, forms[form], 0.7, 7)


def test_arrays_that_do_not_match_are_refused(kernel: CompiledNoise) -> None:
    place = np.zeros((5, 3))
    with noise_by(kernel):
        with pytest.raises(ValueError, match="cells"):
            noise_field(place, np.ones(4), 1)
        with pytest.raises(ValueError, match="patches"):
            noise_field(place, 1.0, 1, 2, (np.zeros(4), np.zeros(5)))
        with pytest.raises(ValueError, match="places"):
            noise_field(place[:, :2], 1.0, 1)


def test_a_scan_works_fields_out_by_the_kernel_while_it_runs() -> None:
    used: list[object] = []

    class Counted(CompiledNoise):
        def fill(self, *arguments: object) -> np.ndarray:  # type: ignore[override]
            used.append(arguments)
            return super().fill(*arguments)  # type: ignore[arg-type]

    counted, plan = Counted(), scan_of(plane(), path=Standing())
    plan = altered(plan, chosen_blocks=((plan.path.strips[0], 0),))
    assert plan.noise_kernel is None  # its caster is no packets'
    vars(plan).update(noise_kernel=counted)
    for result in scan_blocks(plan):
        assert len(result.points)
        noise_field(np.zeros((1, 3)), 1.0, 1)
    assert len(used) == 1
    noise_field(np.zeros((1, 3)), 1.0, 1)
    assert len(used) == 1
