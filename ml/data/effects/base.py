"""Fields that the effects of both tasks have, and what is alike of both."""

from typing import Any

import numpy as np
from pydantic.fields import FieldInfo

from synthroads_addon.base.arrays import Bool
from synthroads_addon.base.schema import quantity

from ...configuration import Part
from ...registry import effect
from ..samples import Sample


class PointEffects(Part):
    """Base of the tasks' options."""

    mirror: float = quantity(0.0, ge=0, le=1, unit="1", description="Probability of left and right being swapped.")
    dropout: float = quantity(0.0, ge=0, lt=1, unit="1", description="Largest share of the points that is left out.")
    color_drop: float = quantity(0.0, ge=0, le=1, unit="1", description="Probability of the colours being left out.")

    def kept_points(self, count: int, random: np.random.Generator) -> Bool:
        """Return which points (count,) are not left out."""
        return random.random(count) >= self.dropout * random.random()


def usually(name: str, value: float) -> Any:
    """Return a field of `PointEffects` with another default."""
    return FieldInfo.merge_field_infos(PointEffects.model_fields[name], default=value)


@effect("segmentation", "centerline", order=50)
def leave_out_colors(sample: Sample, effects: PointEffects, random: np.random.Generator) -> None:
    """Leave out the colours."""
    if random.random() < effects.color_drop:
        sample.color = None
