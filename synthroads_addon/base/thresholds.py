"""Thresholds that part values in two."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def otsu(values: NDArray[np.float64]) -> float:
    """Return Otsu's threshold (1979): the one with the largest variance between those below and those above it."""
    count, edges = np.histogram(values, bins=256)
    middle = (edges[:-1] + edges[1:]) / 2.0
    below, moment = np.cumsum(count)[:-1], np.cumsum(count * middle)[:-1]
    above = count.sum() - below
    with np.errstate(divide="ignore", invalid="ignore"):
        apart = (float((count * middle).sum()) - moment) / above - moment / below
        between = np.where((below > 0) & (above > 0), below * above * apart**2, 0.0)
    return float(edges[1:-1][np.argmax(between)])
