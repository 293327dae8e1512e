"""Pictures of a segmentation: truth, prediction and errors from above."""

from __future__ import annotations

import io
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from synthroads_addon.core.cloud.labels import class_scheme

from .metrics import IGNORED
from .tiles import Tile

_PIXELS = 700
_UNKNOWN = (1.0, 1.0, 1.0)


def comparison(tile: Tile, predicted: NDArray[np.int16], names: Sequence[str]) -> bytes:
    """Return a PNG: a tile from above by its truth, by the classes predicted, and where the two differ.

    Args:
        tile: with its truth.
        predicted: (N,) classes.
        names: of the classes.
    """
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

    colors = class_colors(names)
    figure = Figure(figsize=(15, 5.6), layout="constrained")
    axes = figure.subplots(1, 3)
    wrong = np.where(tile.segment == IGNORED, IGNORED, (predicted != tile.segment).astype(np.int16))
    shown = ((tile.segment, colors, "truth"), (predicted, colors, "predicted"))
    for place, (labels, table, title) in enumerate((*shown, (wrong, np.array([[0.8] * 3, [0.85, 0.1, 0.1]]), "wrong"))):
        axes[place].imshow(top_view(tile.coord, labels, table), origin="lower", interpolation="nearest")
        axes[place].set(title=title, xticks=[], yticks=[])
    patches = [Patch(color=color, label=name) for name, color in zip(names, colors, strict=True)]
    figure.legend(handles=patches, loc="outside lower center", ncols=min(len(patches), 9), frameon=False)
    content = io.BytesIO()
    figure.savefig(content, format="png", dpi=100)
    return content.getvalue()


def class_colors(names: Sequence[str]) -> NDArray[np.float64]:
    """Return the previews' colours of classes (C, 3), from 0 to 1; a group's that isn't a class is grey."""
    known = {row.name: row.color for scheme in ("17", "5") for row in class_scheme(scheme).rows}
    return np.array([known.get(name, (150, 150, 150)) for name in names]) / 255.0


def top_view(coord: NDArray[np.float32], labels: NDArray[np.int16], colors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return an image (H, W, 3), north up in row order: of each pixel the highest point's colour.

    Args:
        coord: (N, 3) m.
        labels: (N,) rows of ``colors``; those of `IGNORED` aren't drawn.
        colors: (C, 3).
    """
    low, high = coord[:, :2].min(axis=0), coord[:, :2].max(axis=0)
    cell = max(float((high - low).max()) / _PIXELS, 0.05)
    size = np.floor((high - low) / cell).astype(int) + 1
    image = np.full((size[1], size[0], 3), _UNKNOWN, dtype=np.float64)
    order = np.argsort(coord[:, 2], kind="stable")
    order = order[labels[order] != IGNORED]
    column, row = np.floor((coord[order, :2] - low) / cell).astype(int).T
    image[row, column] = colors[labels[order]]
    return image
