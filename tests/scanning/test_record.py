"""How a scan's blocks are shared out: what the threads that do them keep from beginning threads of their own."""

from __future__ import annotations

import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from synthroads_addon.scanning.record import scan_blocks
from tests.helpers.scenes.scan_scenes import Standing, plane, scan_of


def linear_algebra_threads() -> set[int]:
    """Return how many threads the libraries of linear algebra that are loaded take."""
    return {library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"}


pytestmark = pytest.mark.skipif(not linear_algebra_threads(), reason="NumPy's linear algebra has no threads to limit")


def test_linear_algebra_keeps_to_the_threads_that_scan_and_has_its_own_again_afterwards() -> None:
    with threadpool_limits(2, user_api="blas"):
        assert linear_algebra_threads() == {2}
        results = scan_blocks(scan_of(plane(50.0), 1, Standing(10.0)))
        meanwhile = [linear_algebra_threads() for _ in results]
        assert meanwhile
        assert all(threads == {1} for threads in meanwhile)
        assert linear_algebra_threads() == {2}


def test_the_threads_come_back_when_the_last_of_several_scans_ends_or_is_given_up() -> None:
    plan = scan_of(plane(50.0), 1, Standing(10.0))
    with threadpool_limits(2, user_api="blas"):
        given_up, other = scan_blocks(plan), scan_blocks(plan)
        next(given_up), next(other)
        given_up.close()
        assert linear_algebra_threads() == {1}
        other.close()
        assert linear_algebra_threads() == {2}
