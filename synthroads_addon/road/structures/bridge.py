"""Bridges that carry the road: what the parameter set says of one."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from ...base.arrays import Float
from ...base.schema import quantity
from ..things.body import Body, Course
from ..things.thing import Block, LengthwiseThing, TwinTypes
from .bridge_bodies import bridge_bodies
from .caps import CAP_RAMP
from .kerbed import kerb_bodies

SHORTEST_BRIDGE = 2.0
"""Clear span from which a structure counts as a bridge, m (B: ASB-ING)."""


class Bridge(LengthwiseThing):
    """A stretch of the road on a structure, from the joint at one end of its deck to that at the other.

    Its pavement is the road's own. Caps of concrete with a kerb take the place of the verges and the median, as wide
    as those are; they begin and end with the wing walls, where they come to their height over `CAP_RAMP`.
    """

    points_class: ClassVar = "bridge"
    order: ClassVar = 125
    offset: ClassVar[float] = 0.0  # type: ignore[misc]  # it follows the road
    type: Literal["Bridge"] = "Bridge"
    start_station: float = quantity(ge=0, unit="m", description="Station of the joint at which its deck begins.")
    end_station: float = quantity(ge=0, unit="m", description="Station of the joint at which its deck ends.")
    superstructure: Literal["slab", "beams", "box"] = Field(
        "slab", description="Cross-section of its deck: a solid slab, T-beams, or a box below each carriageway."
    )
    deck_depth: float = quantity(
        1.2, ge=0.4, le=8, unit="m", description="From the pavement to the underside of its deck."
    )
    pier_stations: tuple[Annotated[float, Field(strict=True, ge=0)], ...] = Field(
        (), max_length=100, description="Stations of its piers, in order."
    )
    pier_width: float = quantity(1.0, ge=0.3, le=6, unit="m", description="Thickness of its piers along the road.")
    kerb_height: float = quantity(0.075, ge=0.02, le=0.25, unit="m", description="Caps above the pavement's edge.")
    railing_height: float = quantity(
        1.0, ge=0, le=2, unit="m", description="Railings at its edges above the caps; 0 for none."
    )
    barrier: Literal["none", "h2", "h4b"] = Field(
        "none",
        description="Barriers of its own on the outer caps: a guardrail (H2), or one with a box beam above (H4b).",
    )
    joint: Literal["asphalt", "lamella", "none"] = Field(
        "asphalt", description="Expansion joints across the pavement at both ends: a band of asphalt, or of steel."
    )
    joint_width: float = quantity(0.5, ge=0.1, le=1.5, unit="m", description="Width of these along the road.")
    wing_length: float = quantity(
        6.0, ge=1, le=30, unit="m", description="Length of its wing walls, from the joint outwards along the road."
    )
    approach_slab_length: float = quantity(
        5.0, ge=0, le=15, unit="m", description="Length of the slabs below the pavement before its ends; 0 for none."
    )
    drain_spacing: float = quantity(
        15.0, ge=0, le=200, unit="m", description="Distance between its gullies along either edge; 0 for none."
    )
    valley_depth: float = quantity(
        8.0, ge=0, le=200, unit="m", description="Depth of the generated ground below the road in its middle."
    )

    @model_validator(mode="after")
    def _piers_between_ends(self) -> Bridge:
        """Return the bridge unchanged; ValueError for stations out of order, or piers that aren't between its ends."""
        if self.end_station - self.start_station < SHORTEST_BRIDGE:
            raise ValueError(f"end_station must be at least {SHORTEST_BRIDGE:g} m after start_station")
        if any(not self.start_station < station < self.end_station for station in self.pier_stations):
            raise ValueError("pier_stations must lie between start_station and end_station")
        if any(b <= a for a, b in pairwise(self.pier_stations)):
            raise ValueError("pier_stations must increase")
        return self

    @property
    def cap_start(self) -> float:
        """Return the station at which its caps and wing walls begin, m."""
        return self.start_station - self.wing_length

    @property
    def cap_end(self) -> float:
        """Return the station at which its caps and wing walls end, m."""
        return self.end_station + self.wing_length

    @property
    def stations(self) -> Float:
        """Return the stations (4,) at which its caps begin and end, and have their full height, m."""
        return np.array([self.cap_start, self.cap_start + CAP_RAMP, self.cap_end - CAP_RAMP, self.cap_end])

    def twin(self) -> TwinTypes:
        """Return its types in the twin formats: a bridge; OpenDRIVE has an element of its own for it."""
        return TwinTypes("IfcBridge.GIRDER", "", "Bridge", "BridgeConstructiveElement")

    def reach(self) -> tuple[float, float]:
        """Return 0, 0: how far it reaches is the road's width."""
        return 0.0, 0.0

    def bodies(self, course: Course) -> list[Body]:
        """Return the closed solids of all its parts in local coordinates."""
        return [*kerb_bodies(self, course), *bridge_bodies(self, course)]

    def footprint(self) -> Iterator[Block]:
        """Yield nothing: what stands beside the road may stand on its caps."""
        return iter(())
