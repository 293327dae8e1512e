"""Content of the pictures of a segmentation."""

from __future__ import annotations

import io

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ml.data.classes import IGNORED
from ml.data.tiles import CloudTile
from ml.scores.pictures import class_colors, comparison

Floats = NDArray[np.float32]
Classes = NDArray[np.int16]


def brown(coord: Floats, segment: Classes) -> float:
    """Return the share of the picture that has the ground's colour."""
    tile = CloudTile("a", np.zeros(3), coord, None, None, segment)
    content = comparison(tile, np.zeros(len(coord), dtype=np.int16), ["ground", "road"])
    image = np.asarray(Image.open(io.BytesIO(content)).convert("RGB")).astype(int)
    ground = (255 * class_colors(["ground"])[0]).round()
    return float((np.abs(image - ground).max(axis=2) < 12).mean())


def test_a_view_shows_where_the_labelled_points_are() -> None:
    """A sweep's far points, and those without a class, don't make the others tiny; without any class nothing fails."""
    x, y = np.meshgrid(np.linspace(-20.0, 20.0, 400), np.linspace(-15.0, 15.0, 300))
    near = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)]).astype(np.float32)
    far = np.array([[900.0, 0.0, 0.0], [0.0, 900.0, 0.0]], dtype=np.float32)
    coord = np.concatenate([near, far, 50.0 * near[:1000]])
    segment = np.zeros(len(coord), dtype=np.int16)
    segment[len(near) + len(far) :] = IGNORED
    alone = brown(near, np.zeros(len(near), dtype=np.int16))
    assert alone > 0.3
    assert brown(coord, segment) > 0.98 * alone
    assert 0.0 < brown(near, np.full(len(near), IGNORED, dtype=np.int16)) < 0.5 * alone, "predicted, but no truth"


def test_names_of_classes_may_hold_what_matplotlib_takes_for_formulas() -> None:
    coord = np.random.default_rng(1).uniform(0.0, 20.0, (500, 3)).astype(np.float32)
    tile = CloudTile("a", np.zeros(3), coord, None, None, np.zeros(500, dtype=np.int16))
    assert comparison(tile, np.zeros(500, dtype=np.int16), ["$^_$", "_road"]).startswith(b"\x89PNG")
