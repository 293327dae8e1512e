"""Types of arrays by what they hold, and a threshold that parts their values in two."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Bool = NDArray[np.bool_]
Float = NDArray[np.float64]
Index = NDArray[np.intp]
Int = NDArray[np.int64]


def otsu(values: Float) -> float:
    """Return Otsu's threshold (1979): the one with the largest variance between those below and those above it."""
    count, edges = np.histogram(values, bins=256)
    middle = (edges[:-1] + edges[1:]) / 2.0
    below, moment = np.cumsum(count)[:-1], np.cumsum(count * middle)[:-1]
    above = count.sum() - below
    with np.errstate(divide="ignore", invalid="ignore"):
        apart = (float((count * middle).sum()) - moment) / above - moment / below
        between = np.where((below > 0) & (above > 0), below * above * apart**2, 0.0)
    return float(edges[1:-1][np.argmax(between)])
