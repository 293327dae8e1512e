"""Effects on training data that both tasks have: their fields, and what is drawn by them from a sample's own stream."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic.fields import FieldInfo

from synthroads_addon.base.schema import quantity

from ...configuration import Part


class PointEffects(Part):
    """Base of the tasks' effects."""

    mirror: float = quantity(0.0, ge=0, le=1, unit="1", description="Probability of left and right being swapped.")
    dropout: float = quantity(0.0, ge=0, lt=1, unit="1", description="Largest share of the points that is left out.")
    color_drop: float = quantity(0.0, ge=0, le=1, unit="1", description="Probability of the colours being left out.")

    def kept_points(self, count: int, rng: np.random.Generator) -> NDArray[np.bool_]:
        """Return which points (count,) are not left out."""
        return rng.random(count) >= self.dropout * rng.random()

    def loses_colors(self, rng: np.random.Generator) -> bool:
        """Return whether a sample's colours are left out."""
        return bool(rng.random() < self.color_drop)


def usually(name: str, value: float) -> Any:
    """Return a field of `PointEffects` with another default."""
    return FieldInfo.merge_field_infos(PointEffects.model_fields[name], default=value)
