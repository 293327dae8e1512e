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
    """Base of both tasks' augmentation options."""

    mirror: float = quantity(0.0, ge=0, le=1, unit="1", description="Probability that left and right are swapped.")
    dropout: float = quantity(0.0, ge=0, lt=1, unit="1", description="Largest share of the points that is removed.")
    color_drop: float = quantity(0.0, ge=0, le=1, unit="1", description="Probability that the colours are removed.")

    def kept_points(self, count: int, random: np.random.Generator) -> Bool:
        """Return a random mask (count,) of the points to keep: a share drawn up to `dropout` is False."""
        return random.random(count) >= self.dropout * random.random()


def point_effect_field(name: str, value: float) -> Any:
    """Return the pydantic field `name` of `PointEffects` with another default."""
    return FieldInfo.merge_field_infos(PointEffects.model_fields[name], default=value)


@effect("segmentation", "centerline", order=50)
def drop_colors(sample: Sample, effects: PointEffects, random: np.random.Generator) -> None:
    """Remove the sample's colours with probability `color_drop`, in place."""
    if random.random() < effects.color_drop:
        sample.color = None
