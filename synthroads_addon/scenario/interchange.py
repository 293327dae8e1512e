"""Limits of an interchange on a motorway."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from ..base.schema import ClosedModel
from ..road.things.limits import Interval, interval, share


class InterchangeLimits(ClosedModel):
    """An interchange of a motorway. No guideline's figures were found: these are chosen."""

    kind: Literal["none", "diamond", "half_clover"] = Field(
        "none",
        description="Form: none, a diamond with four ramps, or a half clover with two loops and two other ramps.",
    )
    crossing: Literal["over", "under"] = Field(
        "over", description="Whether the crossing road is above the motorway, or below it under a bridge of its own."
    )
    loops: Literal["exits", "entries", "one_side"] = Field(
        "exits",
        description="Loops of a half clover: both exits, both entries, or one of each in the quadrants on one side.",
    )
    design_speed: Interval = interval(40.0, 40.0, "km/h", "Design speed of the ramps, by which they curve.")
    radius: Interval = interval(70.0, 120.0, "m", "Radii of the ramps' curves behind the exit or before the entry.")
    loop_radius: Interval = interval(46.0, 60.0, "m", "Radii of loops.", title="Loops' radii")
    grade: Interval = interval(3.0, 5.0, "%", "Grade of the crossing road on both sides of the motorway.")
    crest_radius: Interval = interval(
        1500.0, 2500.0, "m", "Radius of the crossing road's crests, or of its sags below.", title="Crests"
    )
    distance: Interval = interval(72.0, 90.0, "m", "Distance of a diamond's mouths from the motorway's centreline.")
    ramp_spacing: Interval = interval(
        24.0, 30.0, "m", "Distance of a half clover's parallel ramps at their mouths, from axis to axis."
    )
    lane_width: Interval = interval(4.5, 5.5, "m", "Width of the ramps' lane.")
    edge_strip_width: Interval = interval(0.5, 0.5, "m", "Width of the ramps' edge strips.", title="Edge strips")
    corner_radius: Interval = interval(8.0, 14.0, "m", "Radii of the corners of the ramps' mouths.", title="Corners")
    curve_crossfall: Interval = interval(4.0, 4.0, "%", "Crossfall of ramps in their curves, inwards.")
    loop_crossfall: Interval = interval(6.0, 6.0, "%", "Crossfall of loops, inwards.")
    clearance: Interval = interval(4.7, 5.4, "m", "Clearance under the crossing road, or under the motorway's bridge.")
    stop_lines: float = share(0.3, "Probability that an exit's ramp ends at a stop line instead of one to give way.")
    lighting: float = share(0.3, "Probability that the ramps' mouths are lit.", title="Lit Mouths")
    vehicles_per_km: Interval = interval(
        4.0, 15.0, "1/km", "Vehicles on ramps and on each lane of the crossing road.", title="Vehicles"
    )
    waiting: float = share(0.5, "Probability that vehicles wait at the mouth of an exit's ramp.", title="Waiting")
