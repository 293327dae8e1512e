"""Poses by a compiled loop: byte for byte those of NumPy."""

from __future__ import annotations

import platform

import numpy as np
import pytest

from synthroads_addon.base.random_streams import stream
from synthroads_addon.scanning.devices.shots import Columns
from synthroads_addon.scanning.kernels.library import load_kernel
from synthroads_addon.scanning.kernels.poses import CompiledPoses, usable_poses
from synthroads_addon.scanning.knots import Track
from synthroads_addon.scanning.pulses import turned_vectors

pytestmark = pytest.mark.any_blender


@pytest.fixture(params=["usual", "narrow"])
def kernel(request: pytest.FixtureRequest) -> CompiledPoses:
    """Return the kernel, and its version for processors without wide instructions."""
    found = usable_poses()
    assert isinstance(found, CompiledPoses), f"{found}: python tools/build_kernels.py"
    if request.param == "usual":
        return found
    if platform.machine().lower() not in ("x86_64", "amd64"):
        pytest.skip("one version for all processors")
    other, narrow = CompiledPoses(), load_kernel("poses").synthroads_turn_narrow
    narrow.restype, narrow.argtypes = found._turn.restype, found._turn.argtypes
    other._turn = narrow
    return other


def track(knots: int, seed: int = 1, begin: float = 3.0, spacing: float = 0.005) -> Track:
    random = stream(seed, "track")
    rotation, position = random.normal(0, 1, (9, knots)), random.normal(0, 1e5, (3, knots))
    return Track(begin, spacing, rotation, position, np.ones(knots, bool))


@pytest.mark.parametrize("knots", [2, 3, 60])
@pytest.mark.parametrize("sets", [0, 1, 3])
@pytest.mark.parametrize("count", [0, 1, 5, 4000])
def test_poses_and_vectors(kernel: CompiledPoses, knots: int, sets: int, count: int) -> None:
    random, path = stream(count, "times"), track(knots)
    end = path.begin + path.spacing * (knots - 1)
    times = random.uniform(path.begin, end, count)
    # At the knots, at the ends and a rounding beyond them as well.
    edges = [
        path.begin,
        end,
        *np.nextafter([path.begin, end], [0.0, 9.0]),
        *(path.begin + path.spacing * np.arange(knots)),
    ]
    times[: len(edges)] = edges[:count]
    vectors = [random.normal(0, 1, (3, count)) for _ in range(sets)]
    found, expected = kernel.turned_vectors(path, times, vectors), turned_vectors(path, times, vectors)
    assert len(found[1]) == sets
    for mine, theirs in zip([found[0], *found[1]], [expected[0], *expected[1]], strict=True):
        np.testing.assert_array_equal(mine, theirs)
        assert mine.tobytes() == theirs.tobytes()


@pytest.mark.parametrize("columns", [1, 7, 5000])
@pytest.mark.parametrize("first", [0, 3, 4999])
@pytest.mark.parametrize("every", [None, 1, 13])
def test_columns_of_tables_that_repeat(kernel: CompiledPoses, columns: int, first: int, every: int | None) -> None:
    random, path, count = stream(columns, "table"), track(9), 3000
    tables, first = [random.normal(0, 1, (3, columns)) for _ in range(2)], first % columns
    rows = None if every is None else np.sort(random.integers(0, every * count, count))
    run = np.arange(count) if rows is None else rows
    times = random.uniform(path.begin, path.begin + 8 * path.spacing, count)
    alone = kernel.turned_vectors(path, times, [table[:, (first + run) % columns] for table in tables])
    for way in (kernel.turned_vectors, turned_vectors):
        place, turned = way(path, times, tables, Columns(first, rows))
        assert place.tobytes() == alone[0].tobytes()
        assert [one.tobytes() for one in turned] == [one.tobytes() for one in alone[1]]


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_vectors_and_poses_that_are_none(kernel: CompiledPoses) -> None:
    path, odd = track(9), np.array([np.nan, np.inf, -np.inf, 1e308, 1e-310, -0.0])
    path.position[:, 3] = np.inf
    times = np.full(len(odd), path.begin + 2.5 * path.spacing)
    found, expected = (one(path, times, [np.stack([odd] * 3)]) for one in (kernel.turned_vectors, turned_vectors))
    np.testing.assert_array_equal(found[0], expected[0])
    np.testing.assert_array_equal(found[1][0], expected[1][0])


def test_arrays_that_do_not_match_are_refused(kernel: CompiledPoses) -> None:
    times = np.full(4, 3.001)
    with pytest.raises(ValueError, match=r"3 arrays of shape \(3, 4\) at most, but have the shapes \[\(3, 5\)\]"):
        kernel.turned_vectors(track(4), times, [np.zeros((3, 5))])
    with pytest.raises(ValueError, match="at most"):
        kernel.turned_vectors(track(4), times, [np.zeros((3, 4))] * 4)
    for columns in (Columns(-1), Columns(0, np.arange(3)), Columns(0, np.array([0, 1, -1, 2]))):
        with pytest.raises(ValueError, match="have 4 rows, none below 0"):
            kernel.turned_vectors(track(4), times, [np.zeros((3, 4))], columns)
    with pytest.raises(ValueError, match="begin at 0 of 0"):
        kernel.turned_vectors(track(4), times, [np.zeros((3, 0))], Columns(0))
