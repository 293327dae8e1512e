"""Limits of an interchange on a motorway."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from ..base.schema import ClosedModel
from ..road.things.limits import Interval, interval, share


class InterchangeLimits(ClosedModel):
    """An interchange of a motorway. No guideline's figures were found: these are chosen."""

    kind: Literal["none", "diamond"] = Field(
        "none", description="Form: none, or a diamond with four ramps to a road above the motorway."
    )
    design_speed: Interval = interval(40.0, 40.0, "km/h", "Design speed of the ramps, by which they curve.")
    radius: Interval = interval(70.0, 120.0, "m", "Radii of the ramps' curves behind the exit or before the entry.")
    grade: Interval = interval(3.0, 5.0, "%", "Grade of the crossing road on both sides of its bridge.")
    crest_radius: Interval = interval(1500.0, 2500.0, "m", "Radius of the crossing road's crests.", title="Crests")
    distance: Interval = interval(72.0, 90.0, "m", "Distance of the ramps' mouths from the motorway's centreline.")
    lane_width: Interval = interval(4.5, 5.5, "m", "Width of the ramps' lane.")
    corner_radius: Interval = interval(8.0, 14.0, "m", "Radii of the corners of the ramps' mouths.", title="Corners")
    clearance: Interval = interval(4.7, 5.4, "m", "Clearance under the crossing road.")
    stop_lines: float = share(0.3, "Probability that an exit's ramp ends at a stop line instead of one to give way.")
    lighting: float = share(0.3, "Probability that the ramps' mouths are lit.", title="Lit Mouths")
    vehicles_per_km: Interval = interval(
        4.0, 15.0, "1/km", "Vehicles on ramps and on each lane of the crossing road.", title="Vehicles"
    )
    waiting: float = share(0.5, "Probability that vehicles wait at the mouth of an exit's ramp.", title="Waiting")
