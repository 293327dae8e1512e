"""Side roads drawn along the outer edges of a country road."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from ..base.random_streams import stream
from ..base.schema import round_value
from ..road.guidelines import LIMITS, is_single
from ..road.objects import Side
from ..road.parameters import AlignmentObject
from ..road.section import Carriageway
from ..road.section_geometry import CarriagewaySection
from ..road.side_roads.mouth import MARGIN
from ..road.side_roads.side_road import SideRoad
from ..scenario.road import RoadScenario
from .placing.draw import draw, pick
from .placing.ranges import Range, Reservations, draw_start, free_ranges

GRADE_SEPARATED = ("EKL1",)
"""Design classes whose junctions are grade-separated (RAL: BASt, 2013)."""
_BESIDE = 5.0
"""Length between the ground of two side roads at least, m."""
_LARGEST_SHARE = 2.0
"""A corner takes at most so many radii along the main road, at the sharpest angle; half the side road's width too."""


def may_have_side_roads(design_class: str) -> bool:
    """Return whether side roads may join roads of a class at grade: country roads but those of `GRADE_SEPARATED`."""
    return is_single(design_class) and design_class not in GRADE_SEPARATED


def sample_side_roads(
    scenario: RoadScenario,
    seed: int,
    axis: AlignmentObject,
    carriageways: Mapping[Side, Carriageway],
    taken: Mapping[Side, Iterable[Range]],
) -> dict[str, SideRoad]:
    """Return the side roads of a country road by id, all of instance 1; none where no road may join at grade.

    They keep clear of the road's ends, of each other on the same side, and of places where the road's width changes.

    Args:
        scenario, seed: limits, and the seed of everything drawn.
        axis, carriageways: the road.
        taken: by side, stations (m) between which there is a bay or a village.
    """
    limits = scenario.side_roads
    if limits.per_km.maximum <= 0.0 or not may_have_side_roads(scenario.design_class):
        return {}
    rng = stream(seed, "side roads")
    length = axis.length
    free = {
        side: Reservations((s - _BESIDE, s + _BESIDE) for s in CarriagewaySection(item).kinks())
        for side, item in carriageways.items()
    }
    for side in carriageways:
        for start, end in taken.get(side, ()):
            free[side].add(start - _BESIDE, end + _BESIDE)
    drawn: dict[str, SideRoad] = {}
    for _ in range(int(draw(rng, limits.per_km) * length / 1000.0 + rng.random())):
        side = pick(rng, list(carriageways))
        fields = _fields(scenario, rng)
        reach = MARGIN + _LARGEST_SHARE * (max(fields["near_radius"], fields["far_radius"]) + fields["lane_width"])
        begin = draw_start(rng, free_ranges(0.0, length, free[side]), 2.0 * reach)
        if begin is None:
            continue
        free[side].add(begin - _BESIDE, begin + 2.0 * reach + _BESIDE)
        item = SideRoad(instance=1, carriageway=f"carriageway-{side}", station=round_value(begin + reach), **fields)
        drawn[f"side-road-{len(drawn) + 1}"] = item
    return drawn


def _fields(scenario: RoadScenario, rng: np.random.Generator) -> dict[str, Any]:
    """Return the drawn fields of one side road, all but its place."""
    limits = scenario.side_roads
    names = ("angle_deg", "lane_width", "length", "near_radius", "far_radius", "grade_percent", "blend_length")
    sources = {"near_radius": limits.radius, "far_radius": limits.radius}
    fields: dict[str, Any] = {name: draw(rng, sources.get(name) or getattr(limits, name)) for name in names}
    track_width, is_track, stops = (
        draw(rng, limits.track_width),
        rng.random() < limits.tracks,
        rng.random() < limits.stop_lines,
    )
    if is_track:
        return fields | {
            "lanes": 1,
            "lane_width": track_width,
            "edge_strip_width": 0.0,
            "crossfall_percent": 2.5,
            "priority": "none",
            "centre_line": False,
            "edge_lines": False,
        }
    has_line = fields["lane_width"] >= LIMITS[scenario.design_class].narrowest_centre_line_lane
    return fields | {"priority": "stop" if stops else "give_way", "centre_line": has_line, "edge_lines": has_line}
