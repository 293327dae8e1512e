"""Emergency phones and utility cabinets."""

from collections.abc import Iterator
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from ...base.arrays import Float
from ...base.schema import quantity
from .body import BURIED, Body, Place, box
from .limits import Interval, Limits, interval
from .thing import Block, StandingThing, TwinTypes

PLINTH, LID = 0.12, 0.03
"""Height of a cabinet's plinth above the highest ground below it, and of its lid, m."""
CORNERS = ((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5))
"""Corners of a cabinet, or of the pad around it, as shares of its width and depth: its level plinth reaches from the
highest ground below them to `BURIED` below the lowest."""
PAD_RISE = 0.03
"""Height of a levelled pad above the highest ground below it, m."""
STEEPEST = 1.5
"""Run of a usual batter per metre of height: by so much a cabinet stands higher than the ground at its middle."""
OVERHANG, DOOR = 0.02, 0.012
"""Overhang of the lid beyond the body, and depth by which doors stand out, m."""
PHONE_CORNER, PHONE_STEPS = 0.16, 4
"""Radius of a phone's edges as a share of half its width, and the points of each."""
PHONE_PLINTH = ((-BURIED, 0.97), (0.05, 0.97))
PHONE_WIDTH = 0.92
PHONE_BODY = ((0.05, PHONE_WIDTH), (0.93, PHONE_WIDTH), (0.97, 0.8), (1.0, 0.4))
PHONE_BAND = ((0.46, 1.0), (0.52, 1.0))
"""Heights (a share; below the surface m) and widths (a share) that a phone's solids go through."""


def phone_outline() -> Float:
    """Return a square of side 1 with rounded corners (16, 2), anticlockwise from above."""
    inner_half, radius = (1.0 - PHONE_CORNER) / 2.0, PHONE_CORNER / 2.0
    start_angles = np.deg2rad([-90.0, 0.0, 90.0, 180.0])
    angles = start_angles[:, None] + np.pi / 2.0 * np.arange(PHONE_STEPS) / (PHONE_STEPS - 1.0)
    corners = np.array([(1.0, -1.0), (1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0)]) * inner_half
    return (corners[:, None] + radius * np.stack([np.cos(angles), np.sin(angles)], axis=2)).reshape(-1, 2)


class CabinetLimits(Limits):
    """Limits of emergency phones and cabinets."""

    place: ClassVar = 70
    allowed: ClassVar = {"cabinets_per_km": (0.0, 1e3)}

    emergency_phones: bool = Field(True, description="Emergency phones every 2 km.")
    cabinets_per_km: Interval = interval(0.0, 3.0, "1/km", "Utility cabinets per km.", title="Cabinets (per km)")


class Cabinet(StandingThing):
    """An emergency phone or a utility cabinet."""

    points_class: ClassVar = "utility"
    order: ClassVar = 110
    limits: ClassVar = CabinetLimits
    type: Literal["Cabinet"] = "Cabinet"
    kind: Literal["emergency_phone", "utility"] = Field(description="What it is.")
    width: float = quantity(0.3, ge=0.1, le=3, unit="m", description="Width, seen by the traffic beside it.")
    depth: float = quantity(0.3, ge=0.1, le=3, unit="m", description="Depth.")
    height: float = quantity(
        1.6,
        ge=0.4,
        le=3,
        unit="m",
        description="Top above the surface; a utility cabinet's above its pad, or else the highest ground below it.",
    )
    pad_margin: float = quantity(
        0.0, ge=0, le=2, unit="m", description="Reach of the levelled, paved pad around a utility cabinet; 0 for none."
    )

    def twin(self) -> TwinTypes:
        """Return its types in the twin formats: an emergency phone or a distribution board."""
        phone = self.kind == "emergency_phone"
        entity = "IfcCommunicationsAppliance.USERDEFINED" if phone else "IfcDistributionBoard.DISTRIBUTIONBOARD"
        return TwinTypes(entity, f"obstacle.{self.kind}", kind=self.kind)

    def bodies(self, place: Place) -> list[Body]:
        """Return the closed solids of pad, body, plinth and lid or band in its frame; doors and panel are details."""
        return self._phone() if self.kind == "emergency_phone" else self._cabinet(place)

    def _cabinet(self, place: Place) -> list[Body]:
        """Return the bodies of a utility cabinet: it stands level on the highest ground below its corners."""
        pad = self.pad_margin
        corner_x, corner_y = np.array(CORNERS).T * [[self.width + 2.0 * pad], [self.depth + 2.0 * pad]]
        ground = np.append(place.ground(corner_x, corner_y), 0.0)
        foot, bottom = float(ground.max()) + (PAD_RISE if pad else 0.0), float(ground.min()) - BURIED
        top, body_top = foot + self.height, foot + self.height - LID
        walls = self._block(OVERHANG, foot + PLINTH, body_top)
        lid, plinth = self._block(0.0, body_top, top), self._block(2.0 * OVERHANG, bottom, foot + PLINTH)
        door_height = body_top - foot
        doors = box((self.width, OVERHANG, door_height), (0.0, (OVERHANG - self.depth) / 2.0, foot + door_height / 2.0))
        pads = [Body(self._block(-pad, bottom, foot), "concrete", "pad", "IfcSlab.PAVING")] if pad else []
        return [
            *pads,
            Body(walls, "cabinet_grey"),
            Body(lid, "cabinet_grey"),
            Body(plinth, "concrete"),
            Body(doors, "cabinet_grey", "doors", detail=OVERHANG),
        ]

    def _block(self, inset: float, bottom: float, top: float) -> Float:
        """Return the sections of a box between two heights, on all sides by ``inset`` smaller than the cabinet, m."""
        size = (self.width - 2.0 * inset, self.depth - 2.0 * inset, top - bottom)
        return box(size, (0.0, 0.0, (top + bottom) / 2.0))

    def _phone(self) -> list[Body]:
        """Return the bodies of an emergency phone: its pillar, plinth and band, and the panel as a detail."""
        solids = ((PHONE_BODY, "plastic_orange"), (PHONE_PLINTH, "concrete"), (PHONE_BAND, "sheeting_white"))
        panel = box((self.width, self.depth, self.height * 0.4), (0.0, 0.0, self.height * 0.74))
        bodies = [Body(self._pillar(rows), material) for rows, material in solids]
        return [*bodies, Body(panel, "plastic_black", "panel", detail=0.01)]

    def _pillar(self, rows: tuple[tuple[float, float], ...]) -> Float:
        """Return the sections (R, K, 3) of a solid through rows of height and width.

        Args:
            rows: heights (a share of the phone's; below the surface m), and widths as a share of the phone's.
        """
        outline = phone_outline() * (self.width, self.depth)
        return np.stack(
            [
                np.column_stack([outline * share, np.full(len(outline), z if z < 0.0 else z * self.height)])
                for z, share in rows
            ]
        )

    def footprint(self) -> Iterator[Block]:
        """Yield the box that holds it, however it is turned, on a batter too; nothing else may stand there."""
        radius = max(self.width, self.depth) / 2.0 + (self.pad_margin if self.kind == "utility" else 0.0)
        rise_on_slope = radius / STEEPEST if self.kind == "utility" else 0.0
        yield self.upright(radius, self.height + rise_on_slope)
