"""From the network's points back to all points: pieces with overlap, and voxels' classes carried to the full cloud."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any, Protocol

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from synthroads_addon.base.random_streams import stream

from ...cells import thin
from ..data.classes import IGNORED
from ..data.crops import CropSettings, Item, item
from ..data.effects import crop_of
from ..data.tiles import CloudTile, Scaling

EDGE = 24.0
"""Edge of the pieces that are predicted at a time, m: about as wide as a crop of training."""
MARGIN = 4.0
"""Width that is seen around a piece, m."""
LARGEST = 100_000
"""Points of a piece, margin included; what has more is cut in four, down to `_SMALLEST_EDGE`."""
_SMALLEST_EDGE = 1.5


class Classifier(Protocol):
    """Function that turns a batch of one item into the scores of its points."""

    def __call__(self, batch: Item) -> torch.Tensor: ...


def pieces(
    plan: NDArray[np.floating[Any]],
    own: NDArray[np.bool_] | None = None,
    edge: float = EDGE,
    margin: float = MARGIN,
    largest: int = LARGEST,
) -> Iterator[tuple[NDArray[np.intp], NDArray[np.intp]]]:
    """Yield pieces: the indices of their own points, and of all points that they see, own ones included.

    Every point that is to be in a piece is in exactly one.

    Args:
        plan: (N, 2) m.
        own: (N,) which points are to be in a piece, the others being seen only; all if not given.
        edge: of the squares, m.
        margin: seen around them, m.
        largest: points seen; squares with more are cut in four.
    """
    wanted = np.arange(len(plan)) if own is None else np.flatnonzero(own)
    if len(wanted) == 0:
        return
    position = np.asarray(plan, dtype=np.float64)
    yield from _cut_squares(position, wanted, np.arange(len(plan)), position[wanted].min(axis=0), edge, margin, largest)


def _cut_squares(
    position: NDArray[np.float64],
    own: NDArray[np.intp],
    seen: NDArray[np.intp],
    low: NDArray[np.float64],
    edge: float,
    margin: float,
    largest: int,
) -> Iterator[tuple[NDArray[np.intp], NDArray[np.intp]]]:
    """Cut points into squares counted from ``low``; ``seen`` holds all that the squares may see."""
    cells = np.floor((position[own] - low) / edge).astype(np.int64)
    for cell in np.unique(cells, axis=0):
        inside = own[np.all(cells == cell, axis=1)]
        corner = low + cell * edge
        near = position[seen]
        around = seen[np.all((near >= corner - margin) & (near < corner + edge + margin), axis=1)]
        if len(around) > largest and edge / 2 >= _SMALLEST_EDGE:
            yield from _cut_squares(position, inside, around, corner, edge / 2, min(margin, edge / 2), largest)
        else:
            yield inside, around


def label_tile(
    tile: CloudTile,
    scaling: Scaling,
    classifier: Classifier,
    settings: CropSettings,
    core: NDArray[np.bool_] | None = None,
    seed: int = 0,
) -> NDArray[np.int16]:
    """Return the class of each point of a tile: thinned out, predicted piece by piece, carried back.

    Args:
        tile: N points of any density; its labels aren't looked at.
        scaling: of its intensities.
        classifier: scores (n, C) of a batch.
        settings: voxel and features.
        core: (N,) the points whose class is wanted, in their order; all if not given.
        seed: of the noise that stands for missing features.
    """
    keep = thin(tile.coord, settings.voxel)
    small = tile.select(keep)
    own = _needed_points(small.coord, tile.coord, core, settings.voxel)
    strength = None if small.strength is None else scaling.apply(small.strength)
    whole = replace(crop_of(small, strength), segment=np.full(len(small), IGNORED, dtype=np.int16))
    labels = np.zeros(len(small), dtype=np.int16)
    for number, (inside, seen) in enumerate(pieces(small.coord[:, :2], own)):
        batch = item(whole.select(seen), settings, stream(seed, "missing features", number))
        best = classifier(batch).argmax(dim=1).cpu().numpy()
        labels[inside] = best[np.searchsorted(seen, inside)]
    return carry(small.coord[own], labels[own], tile.coord if core is None else tile.coord[core])


def _needed_points(
    small: NDArray[np.float32], full: NDArray[np.float32], core: NDArray[np.bool_] | None, voxel: float
) -> NDArray[np.bool_]:
    """Return which of the thinned points are needed for the classes of the core: those within two cells of it."""
    if core is None:
        return np.ones(len(small), dtype=bool)
    low, high = full[core][:, :2].min(axis=0) - 2 * voxel, full[core][:, :2].max(axis=0) + 2 * voxel
    return np.asarray(np.all((small[:, :2] >= low) & (small[:, :2] <= high), axis=1))


def carry(known: NDArray[np.float32], labels: NDArray[np.int16], points: NDArray[np.float32]) -> NDArray[np.int16]:
    """Return for each point (M,) the label of the nearest known point.

    Args:
        known: (N, 3) m, at least one.
        labels: (N,).
        points: (M, 3) m.
    """
    if len(points) == 0:
        return np.zeros(0, dtype=np.int16)
    _, nearest = cKDTree(known).query(points)
    return labels[nearest]
