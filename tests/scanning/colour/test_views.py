"""Where cameras look: the places that a scene extends over."""

import numpy as np

from synthroads_addon.scanning.colour.views import scene_sample
from tests.helpers.scenes.scan_scenes import mesh_of


def test_places_are_spread_evenly_over_a_meshs_faces() -> None:
    """A square of two triangles, and beside it one of a hundredth of the area that has as many."""
    corners = [(0, 0, 0), (10, 0, 0), (10, 10, 0), (0, 10, 0), (20, 0, 5), (21, 0, 5), (21, 1, 5), (20, 1, 5)]
    mesh = mesh_of(corners, [(0, 1, 2), (0, 2, 3), (4, 5, 6), (4, 6, 7)])
    places = scene_sample(mesh)[len(corners) :]
    assert len(places) > 10_000
    on_small = places[:, 2] == 5.0
    assert abs(on_small.mean() - 1.0 / 101.0) < 1e-3
    x, y = places[~on_small, :2].T
    counts = np.histogram2d(x, y, bins=10, range=((0, 10), (0, 10)))[0]
    assert counts.sum() == len(x)
    assert counts.min() > 0.9 * counts.mean()
    assert counts.max() < 1.1 * counts.mean()


def test_a_scene_without_faces_has_no_places() -> None:
    assert scene_sample(mesh_of(np.empty((0, 3)), [])).shape == (0, 3)
