"""Noise barriers."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar, Literal

from pydantic import Field

from ...base.schema import quantity
from .thing import Block, LengthwiseThing


class NoiseBarrier(LengthwiseThing):
    """A noise barrier: panels between posts. Its offset is that of the panels' middle."""

    points_class: ClassVar = "noise_barrier"
    order: ClassVar = 30
    type: Literal["NoiseBarrier"] = "NoiseBarrier"
    height: float = quantity(4.0, ge=1, le=12, unit="m", description="Top above the surface.")
    panel: Literal["aluminium", "concrete", "wood", "glass"] = Field("aluminium", description="Kind of its panels.")
    thickness: float = quantity(0.15, ge=0.02, le=0.6, unit="m", description="Thickness of the panels.")
    post_spacing: float = quantity(4.0, ge=1, le=10, unit="m", description="Distance between posts.")
    post_width: float = quantity(0.16, ge=0.05, le=0.5, unit="m", description="Width of a post (HEA profile).")

    def footprint(self) -> Iterator[Block]:
        """Yield the box around panels and posts."""
        half = max(self.thickness, self.post_width) / 2.0
        yield self.strip(half, half, self.height)
