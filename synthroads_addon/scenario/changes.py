"""`ChangeLimits`: what may happen to a road between two epochs, and how often: limits of what is drawn, by kind.

Rates that no guideline or statistic gives are choices of ours, and their descriptions call them so.
"""

from __future__ import annotations

from typing import Literal, get_args

from pydantic import Field

from ..base.schema import ClosedModel, notes, quantity
from ..road.changes.change import Kind
from ..road.things.limits import Interval, interval, share

DrawnKind = Literal[tuple(kind for kind in get_args(Kind) if kind != "altered")]  # type: ignore[valid-type]
DRAWN_KINDS: tuple[str, ...] = get_args(DrawnKind)


class ChangeLimits(ClosedModel):
    """Changes of a road from one epoch to the next. Without kinds there are none."""

    list_of: str | None = Field(
        None,
        title="List of Your Own",
        description="JSON file with the changes to make (changes.json); nothing is drawn then.",
        json_schema_extra=notes(unset="Drawn"),
    )
    kinds: tuple[DrawnKind, ...] = Field(  # type: ignore[valid-type]
        DRAWN_KINDS, title="Kinds of Changes", description="Kinds that are drawn; with none the road stays as it is."
    )
    years: float = quantity(2.0, "1", "Years from one epoch to the next.", (0, 50))
    unchanged_below: float = quantity(
        0.0005, "m", "Distance between the epochs' surfaces below which a point is unchanged.", (0, 1)
    )
    things_per_km: Interval = interval(
        0.5, 2.0, "1/km", "Posts and signs added, removed or moved, each, per km and year (chosen).", "Things (per km)"
    )
    move_distance: Interval = interval(0.1, 1.5, "m", "How far posts and signs are moved (chosen).")
    hits_per_km: Interval = interval(
        0.2, 1.0, "1/km", "Rails, posts, signs and panels hit, each kind, per km and year (chosen).", "Hits (per km)"
    )
    dent_depth: Interval = interval(0.1, 0.6, "m", "Depth of dents in rails (chosen).")
    lean_deg: Interval = interval(4.0, 25.0, "deg", "Angle by which hit posts lean (chosen).", "Leaning")
    turn_deg: Interval = interval(8.0, 50.0, "deg", "Angle by which hit signs are turned (chosen).", "Turned")
    paint_wear: Interval = interval(
        0.03, 0.1, "1", "Share of the markings' film that a year wears off (chosen).", "Wear of Paint"
    )
    worn_lines: float = share(0.2, "Probability that a line's film wears off faster than the others (chosen).")
    line_wear: Interval = interval(
        0.2, 0.6, "1", "Share of its film that such a line loses (chosen).", "Wear of a Line"
    )
    growth: Interval = interval(0.3, 0.8, "m", "Growth of trees and shrubs in a year.")
    cut_back: float = share(0.3, "Probability that a stand of shrubs is cut back.", title="Cutting Back")
    cut_height: Interval = interval(0.2, 0.6, "1", "Share of the height that is left of shrubs that are cut (chosen).")
    rut_growth: Interval = interval(0.0005, 0.002, "m", "Growth of ruts in a year.")
    settlements: float = share(0.4, "Probability of a settlement on a carriageway (chosen).")
    settlement_depth: Interval = interval(0.005, 0.04, "m", "Depth of settlements.")
    settlement_length: Interval = interval(8.0, 40.0, "m", "Length of settlements (chosen).")
    cracks_per_km: Interval = interval(
        2.0, 10.0, "1/km", "Cracks that extend or begin, per km and year (chosen).", "Cracks (per km)"
    )
    crack_growth: Interval = interval(0.3, 1.5, "m", "Length that a crack gains in a year (chosen).")
    patches_per_km: Interval = interval(1.0, 6.0, "1/km", "New patches per km and year (chosen).", "Patches (per km)")
    overlays: float = share(0.3, "Probability of a stretch with a new course on a carriageway (chosen).")
    overlay_thickness: Interval = interval(0.02, 0.04, "m", "Thickness of a new course of asphalt.")
    overlay_length: Interval = interval(30.0, 120.0, "m", "Length of a stretch with a new course (chosen).")
    marked_anew: float = share(0.3, "Probability that a broken line is painted anew (chosen).")
    construction_zones: float = share(
        0.15, "Probability that a construction zone is set up on a carriageway; one that is there is taken away."
    )
    parked_per_km: Interval = interval(0.5, 3.0, "1/km", "Vehicles that stand there in one epoch (chosen).", "Parked")
