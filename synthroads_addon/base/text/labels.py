"""Texts beside one another on a picture: moved apart where they would cover each other."""

from __future__ import annotations

from collections.abc import Sequence


def apart(places: Sequence[tuple[float, float]], sizes: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return the lower left corners of texts, each moved up until it covers none of those before it.

    Args:
        places: (x, y) of their lower left corners.
        sizes: their widths and heights.

    Example:
        >>> apart([(0.0, 0.0), (5.0, 1.0), (40.0, 0.0)], [(10.0, 4.0)] * 3)
        [(0.0, 0.0), (5.0, 4.0), (40.0, 0.0)]
    """
    free: list[tuple[float, float]] = []
    boxes: list[tuple[float, float, float, float]] = []
    for (x, y), (width, height) in zip(places, sizes, strict=True):
        at = y
        for low, high in sorted((b, t) for left, right, b, t in boxes if left < x + width and right > x):
            if low < at + height and high > at:
                at = high
        free.append((x, at))
        boxes.append((x, x + width, at, at + height))
    return free
