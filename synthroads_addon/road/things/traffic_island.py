"""Traffic islands between the directions: a raised, paved area with a kerb and rounded ends."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from ...base.arrays import Float
from ...base.schema import quantity
from .body import BURIED, Body, Place
from .thing import Block, StandingThing, TwinTypes

PAVING_RISE = 0.005
"""Height of the paved area above its kerb's back, and how far its sides lean in, m. Chosen."""
_ROW, _NOSE_ROWS = 1.0, 8
"""Longest piece along the road, m, and pieces of a rounded end. Chosen."""
_NARROWEST = 0.04
"""Width of the first and the last section, m: a solid has no edge without a width."""
_ACROSS = np.array([-1.0, -0.5, 0.0, 0.5, 1.0])
"""Corners of the top across the road, as shares of half its width: the middle one where a roof has its ridge."""


class TrafficIsland(StandingThing):
    """A traffic island. Its station is that of its middle; it runs along the road and lies on the pavement."""

    points_class: ClassVar = "roadside"
    order: ClassVar = 149
    type: Literal["TrafficIsland"] = "TrafficIsland"
    length: float = quantity(8.0, "m", "Length along the road, its rounded ends included.", (1, 200))
    width: float = quantity(2.0, "m", "Width, its kerb included.", (0.5, 12))
    kerb_height: float = quantity(0.12, "m", "Height of its kerb above the pavement.", (0.02, 0.25))
    kerb_width: float = quantity(0.15, "m", "Width of its kerb, the face included.", (0.08, 0.4))
    kerb_batter: float = quantity(
        0.15, "m/m", "By how much its kerb's face leans back per metre of height.", (0.05, 0.5)
    )
    kerb_material: Literal["granite", "concrete"] = Field("granite", description="What its kerb is of.")
    surface: Literal["setts", "concrete_pavers", "asphalt", "concrete"] = Field(
        "setts", description="Surface of the area within its kerb."
    )
    curvature: float = quantity(
        0.0, "1/m", "Curvature of the road there, positive in a curve to the left.", (-0.1, 0.1)
    )

    def twin(self) -> TwinTypes:
        """Return its types in the twin formats: an island of the traffic space."""
        return TwinTypes("IfcElementAssembly.USERDEFINED.SITE", "trafficIsland.island", kind="traffic island")

    def bodies(self, place: Place) -> list[Body]:
        """Return the closed solids of the kerb and of the area within it, which follow the pavement, in its frame."""
        lean = self.kerb_batter * self.kerb_height
        kerb = self._block(place, 0.0, lean, self.kerb_height)
        paving = self._block(place, self.kerb_width, PAVING_RISE, self.kerb_height + PAVING_RISE)
        return [
            Body(kerb, self.kerb_material, "kerb", "IfcKerb.NOTDEFINED"),
            Body(paving, self.surface, "paving", "IfcPavement.NOTDEFINED"),
        ]

    def _block(self, place: Place, inset: float, lean: float, height: float) -> Float:
        """Return the sections of a block with rounded ends that lies by ``inset`` (m) within the outline.

        Args:
            place: the pavement around it.
            inset: from the island's outline to its own, m.
            lean: how far its sides lean in up to its top, m.
            height: its top above the pavement, m.
        """
        half_width, half_length = self.width / 2.0 - inset, self.length / 2.0 - inset
        radius = min(half_width, half_length)
        turns = np.linspace(0.0, np.pi / 2.0, _NOSE_ROWS + 1)
        straight = half_length - radius
        middle = np.linspace(-straight, straight, max(2, int(np.ceil(2.0 * straight / _ROW)) + 1))
        nose = straight + radius * np.sin(turns[1:])
        y = np.concatenate([-nose[::-1], middle, nose])
        nose_widths = half_width * np.cos(turns[1:])
        half = np.concatenate([nose_widths[::-1], np.full(len(middle), half_width), nose_widths])
        half = np.maximum(half, _NARROWEST / 2.0 + lean)
        top = (half - lean)[:, None] * _ACROSS
        x = np.concatenate([-half[:, None], top, half[:, None]], axis=1)
        # From the right to the left below: evenly, so that no corner lies twice at one place.
        x = np.concatenate([x, half[:, None] * np.linspace(1.0, -1.0, x.shape[1])], axis=1)
        heights = np.full(x.shape, -BURIED)
        heights[:, : len(_ACROSS) + 2] = [0.0, *[height] * len(_ACROSS), 0.0]
        y_grid = np.broadcast_to(y[:, None], x.shape)
        x = x - self.curvature * y_grid**2 / 2.0
        ground = place.ground(x.ravel(), y_grid.ravel()).reshape(x.shape)
        return np.stack([x, y_grid, ground + heights], axis=-1)

    def footprint(self) -> Iterator[Block]:
        """Yield the box around it, in which nothing else may stand."""
        s, d, z, half = self.station, self.offset, self.elevation, self.width / 2.0
        yield Block("island", s - self.length / 2.0, s + self.length / 2.0, d - half, d + half, z, z + self.kerb_height)
