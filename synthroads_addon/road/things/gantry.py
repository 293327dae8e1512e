"""Shield gantries and the boards on them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar, Literal

from pydantic import Field, model_validator

from ...base.schema import Model, quantity
from ..objects import Side
from .thing import Block, StandingThing

GANTRY_HANGER = 0.18
"""Distance between a gantry's beam and its boards, m."""
GANTRY_BOARD, GANTRY_DISPLAY = 0.05, 0.28
"""Depth of a painted board and of a display, m."""
GANTRY_OVERHANG = 0.3
"""Share of what a board is higher than a gantry's beam that hangs below it."""


class GantrySign(Model):
    """A sign or display on a gantry."""

    offset: float = quantity(ge=-100, le=100, unit="m", description="Offset of its middle.")
    width: float = quantity(gt=0, le=12, unit="m", description="Width of the face.")
    height: float = quantity(gt=0, le=8, unit="m", description="Height of the face.")
    kind: Literal["destination", "display"] = Field("destination", description="Painted sign, or variable display.")
    text: tuple[str, ...] = Field((), max_length=6, description="Lines of writing on its face.")

    @property
    def depth(self) -> float:
        """Return the depth of its body along the road, m."""
        return GANTRY_DISPLAY if self.kind == "display" else GANTRY_BOARD

    @property
    def facing(self) -> float:
        """Return 1 for a sign that faces traffic with the stations: on the right of the centreline; else -1."""
        return 1.0 if self.offset < 0.0 else -1.0


class Gantry(StandingThing):
    """A shield gantry across one carriageway (one_sided), across both (two_sided), or on one post (cantilever).

    Station and offset are those of the middle of its beam, which reaches from ``left_offset`` to ``right_offset``. A
    cantilever has its post at the end named by ``post_side``, the others have posts at both ends, a two-sided one also
    in the median. Its signs face the traffic of the carriageway that they hang over.
    """

    points_class: ClassVar = "shield_gantry"
    order: ClassVar = 70
    obstacle: ClassVar = "gantry's post"
    type: Literal["Gantry"] = "Gantry"
    kind: Literal["one_sided", "two_sided", "cantilever"] = Field(description="What it spans.")
    left_offset: float = quantity(ge=-100, le=100, unit="m", description="Offset of its left end.")
    right_offset: float = quantity(ge=-100, le=100, unit="m", description="Offset of its right end.")
    post_side: Side = Field("right", description="End that a cantilever's post stands at.")
    clearance: float = quantity(
        5.2, ge=3, le=10, unit="m", description="Lowest part above the pavement's highest point below it."
    )
    beam: Literal["box", "truss", "tube"] = Field("box", description="Shape of the beam.")
    beam_height: float = quantity(0.8, ge=0.2, le=3, unit="m", description="Height of the beam.")
    beam_depth: float = quantity(0.6, ge=0.2, le=3, unit="m", description="Depth of the beam along the road.")
    post_width: float = quantity(0.5, ge=0.1, le=1.5, unit="m", description="Width of a post.")
    shade: float = quantity(
        0.5, ge=0.05, le=1, unit="1", description="Base colour of the steel: dark paint to bright zinc."
    )
    signs: tuple[GantrySign, ...] = Field((), max_length=16, description="Signs and displays on it.")

    @model_validator(mode="after")
    def _spans(self) -> Gantry:
        if self.left_offset <= self.right_offset:
            raise ValueError("left_offset must be greater than right_offset")
        return self

    def reach(self, facing: float) -> float:
        """Return how far the beam, and the signs on one side of it (1 or -1), reach along the road from its middle."""
        signs = [GANTRY_HANGER + sign.depth for sign in self.signs if sign.facing == facing]
        return self.beam_depth / 2.0 + max(signs, default=0.0)

    def beam_bottom(self, low: float) -> float:
        """Return the height (m) of the beam's lower edge, from that of the lowest part: taller signs hang below it."""
        tallest = max((sign.height for sign in self.signs), default=0.0)
        return low + max(tallest - self.beam_height, 0.0) * GANTRY_OVERHANG

    def ends_in_beam(self, sign: GantrySign, low: float) -> bool:
        """Return whether a sign whose lower edge is at the lowest part (m) would end below the beam's top."""
        return low + sign.height < self.beam_bottom(low) + self.beam_height

    def post_offsets(self) -> list[float]:
        """Return the offsets of its posts, m."""
        if self.kind == "cantilever":
            return [self.left_offset if self.post_side == "left" else self.right_offset]
        return [self.left_offset, self.right_offset, *([0.0] if self.kind == "two_sided" else [])]

    def footprint(self) -> Iterator[Block]:
        """Yield the boxes of its posts, then that of its beam."""
        half, s, top = self.post_width / 2.0, self.station, self.clearance + self.beam_height
        for d in self.post_offsets():
            yield Block("foot", s - half, s + half, d - half, d + half, 0.0, top)
        deep = self.beam_depth / 2.0
        yield Block("beam", s - deep, s + deep, self.right_offset, self.left_offset, self.clearance, top)
