"""How both tasks tell results: figures over seeds as text, and pictures as files."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from PIL import Image

_COLORS = 256


@dataclass(frozen=True)
class Spread:
    """A figure over several seeds: mean, standard deviation (ddof 1; NaN for one seed), number of seeds."""

    mean: float
    std: float
    count: int

    @classmethod
    def over(cls, values: Sequence[float]) -> Spread:
        """Return the spread of values; NaN without any, and where one of them is NaN."""
        known = np.asarray(values, dtype=np.float64)
        std = float(known.std(ddof=1)) if len(known) > 1 else math.nan
        return cls(float(known.mean()) if len(known) else math.nan, std, len(known))

    def text(self, decimals: int, missing: str, factor: float = 1.0) -> str:
        """Return ``mean (std)`` times a factor; the mean alone where there is no deviation, else what is missing."""
        if math.isnan(self.mean):
            return missing
        mean = f"{factor * self.mean:,.{decimals}f}"
        return mean if math.isnan(self.std) else f"{mean} ({factor * self.std:,.{decimals}f})"


def defined(values: Sequence[float | None]) -> list[float]:
    """Return those of some values that are finite numbers."""
    return [float(value) for value in values if value is not None and math.isfinite(value)]


def small_png(figure: Any, dpi: float | None = None) -> bytes:
    """Return a Matplotlib figure as a PNG of at most 256 colours; with all of them points make it four times as large.

    Args:
        figure: is drawn.
        dpi: pixels per inch; the figure's own if not given.
    """
    drawn, content = io.BytesIO(), io.BytesIO()
    figure.savefig(drawn, format="png", dpi=dpi or figure.dpi)
    image = Image.open(drawn).convert("RGB").quantize(_COLORS, dither=Image.Dither.NONE)
    image.save(content, format="png", optimize=True)
    return content.getvalue()
