"""Pictures of a segmentation: truth, prediction and errors from above."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from synthroads_addon.base.classes import class_scheme

from ...results import small_png
from ..data.classes import IGNORED
from ..data.tiles import CloudTile

_PIXELS = 490
"""Of a view's longer side: as many as it has in the picture, so that none is lost."""
_OUTSIDE = (0.5, 99.5)
"""Percentiles of x and of y that a view goes from and to: a sweep's few far points would make all others tiny."""
_UNKNOWN = (0.07, 0.07, 0.09)
"""Dark, as road markings are drawn white."""
_WRONG = np.array([[0.75, 0.75, 0.75], [0.9, 0.1, 0.1]])


def comparison(tile: CloudTile, predicted: NDArray[np.int16], names: Sequence[str]) -> bytes:
    """Return a PNG: a tile from above by its truth, by the classes predicted, and where the two differ.

    Args:
        tile: with its truth.
        predicted: (N,) classes.
        names: of the classes.
    """
    from matplotlib.figure import Figure  # takes half a second, which only pictures need
    from matplotlib.patches import Patch

    colors = class_colors(names)
    wrong = np.where(tile.segment == IGNORED, IGNORED, (predicted != tile.segment).astype(np.int16))
    shown = ((tile.segment, colors, "truth"), (predicted, colors, "predicted"), (wrong, _WRONG, "wrong"))
    known = tile.coord[tile.segment != IGNORED, :2] if (tile.segment != IGNORED).any() else tile.coord[:, :2]
    extent = np.percentile(known, _OUTSIDE, axis=0)
    views = [top_view(tile.coord, labels, table, extent) for labels, table, _ in shown]
    figure = Figure(figsize=(15, 0.8 + 4.9 * views[0].shape[0] / _PIXELS), dpi=100, layout="constrained")
    for axes, view, (_, _, title) in zip(figure.subplots(1, 3), views, shown, strict=True):
        axes.imshow(view, origin="lower", interpolation="nearest")
        axes.set(title=title, xticks=[], yticks=[])
    patches = [Patch(facecolor=color, edgecolor="0.5", label=name) for name, color in zip(names, colors, strict=True)]
    figure.legend(handles=patches, loc="outside lower center", ncols=min(len(patches), 9), frameon=False)
    return small_png(figure)


def class_colors(names: Sequence[str]) -> NDArray[np.float64]:
    """Return the previews' colours of classes (C, 3), from 0 to 1; a group's that isn't a class is grey."""
    known = {row.name: row.color for scheme in ("17", "5") for row in class_scheme(scheme).rows}
    return np.array([known.get(name, (150, 150, 150)) for name in names]) / 255.0


def top_view(
    coord: NDArray[np.float32], labels: NDArray[np.int16], colors: NDArray[np.float64], extent: NDArray[np.floating]
) -> NDArray[np.float64]:
    """Return an image (H, W, 3), north up in row order: of each pixel the highest point's colour.

    Args:
        coord: (N, 3) m.
        labels: (N,) rows of ``colors``; those of `IGNORED` aren't drawn.
        colors: (C, 3).
        extent: (2, 2) smallest and largest x and y shown, m.
    """
    low, high = extent
    cell = max(float((high - low).max()) / _PIXELS, 0.05)
    size = np.floor((high - low) / cell).astype(int) + 1
    image = np.full((size[1], size[0], 3), _UNKNOWN, dtype=np.float64)
    order = np.argsort(coord[:, 2], kind="stable")
    inside = ((coord[:, :2] >= low) & (coord[:, :2] <= high)).all(axis=1)
    order = order[inside[order] & (labels[order] != IGNORED)]
    column, row = np.floor((coord[order, :2] - low) / cell).astype(int).T
    image[row, column] = colors[labels[order]]
    return image
