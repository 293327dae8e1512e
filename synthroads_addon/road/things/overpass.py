"""Bridges over the road."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, ClassVar, Literal

from pydantic import Field

from ...base.schema import quantity
from .thing import Block, StandingThing

BRIDGE_DECK = ((0.18, 0.6), (0.24, 0.0), (0.52, 0.0), (0.6, 0.62), (0.985, 0.78), (0.985, 1.0))
"""Half of a deck's section, from the middle of the lower side to the top: shares of half its width, of its height."""
BRIDGE_SEAT = 0.9
"""Depth of an abutment's bearing seat, m."""
BRIDGE_ABUTMENT = 1.5
"""Depth of an abutment, m."""
BRIDGE_BEARING = 0.1
"""Height of a bridge's bearings, m."""
BRIDGE_PIER_LENGTH = 0.5
"""Length of a pier as a share of the deck's width."""
BRIDGE_BURIED = 0.8
"""Depth of a bridge's walls and piers below the ground, m."""
_FAR = 1000.0
"""How far abutments reach, m: their embankments go on to the ground."""


class Overpass(StandingThing):
    """A bridge that crosses over the road. Station and offset are those of its middle.

    At rotation 0 it crosses at right angles. Piers stand at ``pier_offsets``; it ends at abutments at both
    ``abutment`` offsets, from which its embankments fall to the ground.
    """

    points_class: ClassVar = "bridge"
    order: ClassVar = 130
    obstacle: ClassVar = "pier"
    type: Literal["Overpass"] = "Overpass"
    width: float = quantity(10.0, ge=2, le=60, unit="m", description="Width of its deck along the road.")
    left_abutment: float = quantity(ge=5, le=200, unit="m", description="Offset of the left abutment's face.")
    right_abutment: float = quantity(ge=-200, le=-5, unit="m", description="Offset of the right abutment's face.")
    clearance: float = quantity(
        4.9, ge=3, le=20, unit="m", description="Its underside above the pavement's highest point below it."
    )
    deck_thickness: float = quantity(1.2, ge=0.3, le=5, unit="m", description="Height of its deck.")
    parapet_height: float = quantity(1.1, ge=0, le=3, unit="m", description="Height of its parapets above the deck.")
    pier_offsets: tuple[Annotated[float, Field(strict=True, ge=-100, le=100)], ...] = Field(
        (0.0,), max_length=8, description="Offsets of its piers."
    )
    pier_width: float = quantity(1.0, ge=0.2, le=4, unit="m", description="Width of a pier across the road.")

    def footprint(self) -> Iterator[Block]:
        """Yield the boxes of its piers, its deck, and what lies behind its abutments."""
        start, end, half = self.station - self.width / 2.0, self.station + self.width / 2.0, self.pier_width / 2.0
        for d in self.pier_offsets:
            yield Block("foot", start, end, d - half, d + half, 0.0, self.clearance)
        left, right, top = self.left_abutment, self.right_abutment, self.clearance + self.deck_thickness
        yield Block("beam", start, end, right, left, self.clearance, top)
        yield Block("wall", start, end, left, _FAR, 0.0, top)
        yield Block("wall", start, end, -_FAR, right, 0.0, top)
