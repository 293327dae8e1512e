"""Side roads: what the parameter set says of one."""

from __future__ import annotations

from typing import ClassVar, Literal

from pydantic import Field

from ...base.schema import quantity
from ..objects import RoadObject

LEAST_ANGLE, LARGEST_ANGLE = 60.0, 120.0
"""Angles (degrees) between the road and its side road: chosen, no figure of a guideline was found."""


class SideRoad(RoadObject):
    """A road that joins the outer edge of a carriageway: its mouth with rounded corners, and its first stretch.

    Its axis is straight and begins on the pavement's edge at ``station``. The corners are arcs that touch both edges.
    At the edge its surface goes on in the main road's plane; over ``blend_length`` it turns to a roof of its own.
    """

    points_class: ClassVar = "road"
    type: Literal["SideRoad"] = "SideRoad"
    carriageway: str = Field(description="Id of the carriageway that it joins.")
    station: float = quantity(ge=0, unit="m", description="Station at which its axis meets the pavement's edge.")
    angle_deg: float = quantity(
        90.0,
        ge=LEAST_ANGLE,
        le=LARGEST_ANGLE,
        unit="deg",
        description="Between the direction of the stations and its axis, outwards; 90 is a right angle.",
    )
    lanes: int = quantity(2, ge=1, le=2, unit="1", description="Lanes: two for both directions, or one for both.")
    lane_width: float = quantity(2.75, ge=2, le=6, unit="m", description="Width of every lane.")
    edge_strip_width: float = quantity(0.25, ge=0, le=1, unit="m", description="Width of either edge strip.")
    length: float = quantity(
        60.0, ge=15, le=200, unit="m", description="Of its pavement from the edge on; the terrain's reach at most."
    )
    near_radius: float = quantity(
        10.0, ge=3, le=40, unit="m", description="Radius of the corner at its lower stations."
    )
    far_radius: float = quantity(
        10.0, ge=3, le=40, unit="m", description="Radius of the corner at its higher stations."
    )
    grade_percent: float = quantity(
        0.0, ge=-12, le=12, unit="%", description="Behind its mouth; positive where it rises away from the main road."
    )
    crossfall_percent: float = quantity(
        2.5, ge=0, le=7, unit="%", description="Of its roof, or of its plane with one lane, behind its mouth."
    )
    blend_length: float = quantity(
        12.0, ge=4, le=40, unit="m", description="From the edge to where its surface is its own."
    )
    priority: Literal["give_way", "stop", "none"] = Field(
        "give_way", description="Line before the main road: for giving way (341), for stopping (294), or none."
    )
    centre_line: bool = Field(True, strict=True, description="Whether a line parts its two lanes.")
    edge_lines: bool = Field(True, strict=True, description="Whether lines follow its edges and corners.")

    @property
    def half_width(self) -> float:
        """Return half the width of its pavement behind the mouth, m."""
        return self.lanes * self.lane_width / 2.0 + self.edge_strip_width
