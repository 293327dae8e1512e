"""Tunnels that lead the road through the ground: what the parameter set says of one."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from ...base.arrays import Float
from ...base.schema import quantity
from ..things.body import Body, Course
from ..things.thing import Block, LengthwiseThing, TwinTypes
from .caps import CAP_RAMP
from .kerbed import kerb_bodies
from .tunnel_bodies import tunnel_bodies

SHORTEST_TUNNEL = 4.0
"""Shortest tunnel, m: its walkways come to their height over a metre at either end."""


class Tunnel(LengthwiseThing):
    """A stretch of the road in a tube, from the front of one portal to that of the other.

    Its pavement is the road's own. Emergency walkways with a kerb take the place of the verges, as wide as those are;
    the walls stand behind them. Where the median is wide enough, each carriageway has a tube of its own.
    """

    points_class: ClassVar = "bridge"
    order: ClassVar = 126
    offset: ClassVar[float] = 0.0  # type: ignore[misc]  # it follows the road
    type: Literal["Tunnel"] = "Tunnel"
    start_station: float = quantity(ge=0, unit="m", description="Station of the front of its first portal.")
    end_station: float = quantity(ge=0, unit="m", description="Station of the front of its last portal.")
    section: Literal["rectangle", "vault"] = Field("rectangle", description="Shape of its cross-section.")
    height: float = quantity(
        6.0,
        ge=4.2,
        le=15,
        unit="m",
        description="From the higher edge of the pavement to the ceiling, a vault's crown.",
    )
    wall_thickness: float = quantity(0.8, ge=0.3, le=3, unit="m", description="Thickness of its walls and its roof.")
    kerb_height: float = quantity(0.07, ge=0.02, le=0.25, unit="m", description="Walkways above the pavement's edge.")
    lining_height: float = quantity(
        3.0, ge=0, le=4, unit="m", description="Height of the light lining of its walls above the walkways; 0 for none."
    )
    lamp_spacing: float = quantity(
        8.0, ge=0, le=100, unit="m", description="Distance between lamps in each of two rows; 0 for none."
    )
    phone_spacing: float = quantity(
        150.0, ge=0, le=1000, unit="m", description="Distance between emergency call points, at most; 0 for none."
    )
    exit_spacing: float = quantity(
        300.0, ge=0, le=2000, unit="m", description="Distance between doors of emergency exits, at most; 0 for none."
    )
    fan_spacing: float = quantity(
        90.0, ge=0, le=1000, unit="m", description="Distance between pairs of jet fans; 0 for none."
    )
    cover: float = quantity(
        3.0, ge=0.5, le=300, unit="m", description="Height of the generated ground above its roof in its middle."
    )

    @model_validator(mode="after")
    def _long_enough(self) -> Tunnel:
        """Return the tunnel unchanged; ValueError for stations out of order."""
        if self.end_station - self.start_station < SHORTEST_TUNNEL:
            raise ValueError(f"end_station must be at least {SHORTEST_TUNNEL:g} m after start_station")
        return self

    @property
    def cap_start(self) -> float:
        """Return the station at which its walkways begin, m."""
        return self.start_station

    @property
    def cap_end(self) -> float:
        """Return the station at which its walkways end, m."""
        return self.end_station

    @property
    def stations(self) -> Float:
        """Return the stations (4,) at which its walkways begin and end, and have their full height, m."""
        return np.array([self.cap_start, self.cap_start + CAP_RAMP, self.cap_end - CAP_RAMP, self.cap_end])

    def twin(self) -> TwinTypes:
        """Return its types in the twin formats: an assembly in IFC 4.3, which has no tunnels, and a tunnel."""
        return TwinTypes(
            "IfcElementAssembly.USERDEFINED.SITE", "", "Tunnel", "TunnelConstructiveElement", kind="TUNNEL"
        )

    def reach(self) -> tuple[float, float]:
        """Return 0, 0: how far it reaches is the road's width."""
        return 0.0, 0.0

    def bodies(self, course: Course) -> list[Body]:
        """Return the closed solids of all its parts in local coordinates."""
        return [*kerb_bodies(self, course), *tunnel_bodies(self, course)]

    def footprint(self) -> Iterator[Block]:
        """Yield nothing: a rule of its own says that nothing stands on its walkways."""
        return iter(())
