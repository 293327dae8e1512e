"""Roads beside and above the main one: what the parameter set says of them."""

from __future__ import annotations

import math
from typing import ClassVar, Literal

from pydantic import Field

from ...base.schema import quantity
from ..objects import RoadObject
from ..section import CrossfallPoint
from .axis import HorizontalElement, VerticalPoint


class OwnAxis(RoadObject):
    """Base of roads with an axis and a profile of their own, whose stations begin at 0 at its start."""

    points_class: ClassVar = "road"
    start_x: float = quantity(unit="m", description="Local x of its axis at its begin.")
    start_y: float = quantity(unit="m", description="Local y of its axis at its begin.")
    start_heading_deg: float = quantity(
        ge=-720, le=720, unit="deg", description="Direction of its axis there, counter-clockwise from east."
    )
    horizontal: tuple[HorizontalElement, ...] = Field(min_length=1, description="Elements of its axis, in order.")
    vertical: tuple[VerticalPoint, ...] = Field(min_length=1, description="Intersection points of its profile.")
    lane_width: float = quantity(3.5, ge=2.5, le=6, unit="m", description="Width of its lanes, or of its one lane.")
    edge_strip_width: float = quantity(0.5, ge=0, le=2, unit="m", description="Width of either edge strip.")
    verge_width: float = quantity(1.5, ge=0.5, le=4, unit="m", description="Width of either verge.")
    verge_slope_percent: float = quantity(8.0, ge=0, le=15, unit="%", description="Fall of its verges, outwards.")

    @property
    def length(self) -> float:
        """Return the length of its axis, m."""
        return math.fsum(element.length for element in self.horizontal)


class CrossingRoad(OwnAxis):
    """A road of two lanes that crosses above the main road, or below a bridge of it; ramps join it.

    Its axis is straight and crosses at right angles. Above, its profile is level on the bridge that carries it.
    """

    type: Literal["CrossingRoad"] = "CrossingRoad"
    station: float = quantity(ge=0, unit="m", description="Station of the main road that it crosses at.")
    bridge: str = Field(description="Id of the Overpass that carries it, or of the Bridge that it passes below.")
    crossfall_percent: float = quantity(2.5, ge=0, le=7, unit="%", description="Fall of both its sides, a roof.")

    @property
    def half_width(self) -> float:
        """Return half the width of its pavement, m."""
        return self.lane_width + self.edge_strip_width


class ConnectingRamp(OwnAxis):
    """A ramp of one lane from the end of an exit's or entry's ramp on to the mouth at which it joins a crossing road.

    Its axis runs away from the main road, an entry's too, and ends where the mouth's straight stretch begins.
    """

    type: Literal["ConnectingRamp"] = "ConnectingRamp"
    turnout: str = Field(description="Id of the exit or entry that it goes on from.")
    crossing_road: str = Field(description="Id of the crossing road that it joins.")
    crossfall: tuple[CrossfallPoint, ...] = Field(min_length=1, description="Crossfall by its own station.")
    mouth_station: float = quantity(ge=0, unit="m", description="Station of the crossing road that it joins at.")
    mouth_side: Literal["left", "right"] = Field(description="Side of the crossing road that it joins.")
    mouth_length: float = quantity(
        26.0, ge=15, le=80, unit="m", description="Length of the straight stretch before the crossing road's edge."
    )
    mouth_grade_percent: float = quantity(
        0.0, ge=-8, le=8, unit="%", description="Grade there, positive where it rises away from the crossing road."
    )
    near_radius: float = quantity(10.0, ge=3, le=40, unit="m", description="Radius of the corner at lower stations.")
    far_radius: float = quantity(10.0, ge=3, le=40, unit="m", description="Radius of the corner at higher stations.")
    design_speed: float = quantity(
        40.0, ge=20, le=100, unit="km/h", description="Speed that its radii and its lines of sight are made for."
    )
    priority: Literal["give_way", "stop", "none"] = Field(
        "give_way", description="Line before the crossing road: for giving way (341), for stopping (294), or none."
    )

    @property
    def half_width(self) -> float:
        """Return half the width of its pavement, m."""
        return self.lane_width / 2.0 + self.edge_strip_width
