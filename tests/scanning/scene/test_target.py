"""Places on bodies that move go back to where the scene has them at time 0, and all others stay."""

from __future__ import annotations

import numpy as np

from synthroads_addon.scanning.scene.motion import LinearMotion, MovingMesh
from tests.helpers.scenes.kernel_scenes import planned, soup
from tests.scanning.kernels.test_moving import Turning


def test_places_on_bodies_go_back_to_where_these_are_at_time_zero() -> None:
    """One of two bodies turns as it drives: p(t) = R(t) q + x(t), so p(0) = R(0) R(t)^T (p(t) - x(t)) + x(0)."""
    motions = [Turning((4.0, -3.0, 1.0)), LinearMotion((25.0, -2.0, 0.0), (-6.0, 8.0, 0.5))]
    target = planned(soup(50), moving=[MovingMesh(soup(30, 5), motion) for motion in motions]).target
    rng = np.random.default_rng(2)
    times = rng.uniform(0.1, 0.9, 90)
    in_body, vectors_in_body = rng.uniform(-2.0, 2.0, (2, 90, 3))
    faces = np.concatenate([rng.integers(0, 50, 30), rng.integers(50, 80, 30), rng.integers(80, 110, 30)])

    def moved(at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return places and vectors (90, 3) at the given times; the first 30 lie on what stands still."""
        places, vectors = in_body.copy(), vectors_in_body.copy()
        for motion, rows in zip(motions, (slice(30, 60), slice(60, 90)), strict=True):
            rotation, position, _ = motion.pose(at[rows])
            places[rows] = np.einsum("nij,nj->ni", rotation, in_body[rows]) + position
            vectors[rows] = np.einsum("nij,nj->ni", rotation, vectors_in_body[rows])
        return places, vectors

    places, vectors = moved(times)
    expected, expected_vectors = moved(np.zeros(90))
    tracks = target.motions(0.0, 1.0, 1e-3)
    found, found_vectors = target.at_time_zero(faces, places.T, times, tracks, (vectors.T,))
    np.testing.assert_allclose(found.T, expected, atol=1e-4)
    np.testing.assert_allclose(found_vectors.T, expected_vectors, atol=1e-4)
    assert np.abs(places[30:] - expected[30:]).max() > 5.0
    np.testing.assert_array_equal(found.T[:30], in_body[:30])
