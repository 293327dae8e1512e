"""Kind and ages of carriageways' surface courses, and the lines that were ground off them, from a seed."""

from typing import Any

from ..base.random_streams import stream
from ..base.schema import round_value
from ..road.guidelines import is_single
from ..road.objects import Side
from ..road.section import RemovedMarking, SurfaceCourse
from ..scenario.road import RoadScenario
from .pavement_damage import draw_materials
from .placing.draw import draw_between, pick

_OTHER_KIND = 0.25
"""Probability that one carriageway was renewed with another kind of asphalt or concrete than the other one."""
_MOVED = (0.25, 1.2)
"""Distance of a former lane line from today's boundary, m: where traffic was led closer to one side."""
_REMOVED_WIDTH, _REMOVED_DEPTH = 0.03, (0.0005, 0.003)
"""By how much more than the line was ground off, and how deep, m."""
_LINE, _DASH, _GAP = 0.15, 6.0, 12.0
"""Width, dash and gap of lane lines (RMS), m."""
_SHORTEST = 60.0


class SurfaceCourses:
    """Draws the surface courses of a road's carriageways.

    Args:
        scenario: the road's limits.
        seed: of the road.
        length: of the road, m.
    """

    def __init__(self, scenario: RoadScenario, seed: int, length: float) -> None:
        limits = scenario.pavement
        concrete = stream(seed, "pavement").random() < limits.concrete
        self._kinds: tuple[SurfaceCourse, ...] = limits.concretes if concrete else limits.asphalts
        self._first_kind = pick(stream(seed, "surface course"), self._kinds)
        self._age = draw_materials(scenario.materials, seed)["asphalt_age"]
        self._other_kind = 0.0 if is_single(scenario.design_class) else _OTHER_KIND
        self._scenario, self._seed, self._length = scenario, seed, length

    def draw(self, side: Side, lanes: int) -> dict[str, Any]:
        """Return the kind and ages of a carriageway with a number of lanes, as fields of its pavement."""
        rng = stream(self._seed, "surface course", side)
        kind = pick(rng, self._kinds) if side == "left" and rng.random() < self._other_kind else self._first_kind
        fields: dict[str, Any] = {"kind": kind}
        if rng.random() >= self._scenario.pavement.renewed:
            return fields
        renewed_age = draw_between(rng, (0.0, 0.7 * self._age))
        renewed_part = pick(rng, ("outer lane", "lanes", "shoulder"))
        if renewed_part == "shoulder":
            return fields | {"shoulder_age": renewed_age}
        return fields | {"lane_ages": (renewed_age,) * (lanes if renewed_part == "lanes" else 1)}

    def removed_markings(self, side: Side, edges: tuple[float, ...]) -> tuple[RemovedMarking, ...]:
        """Return drawn lines that were ground off a carriageway: those between its lanes as they were for a while.

        Args:
            side: of the carriageway.
            edges: distances (m) of the lanes' boundaries from the centreline, outermost first.
        """
        rng = stream(self._seed, "removed markings", side)
        if len(edges) < 3 or self._length < _SHORTEST or rng.random() >= self._scenario.markings.removed:
            return ()
        sign = 1.0 if side == "left" else -1.0
        line_shift = draw_between(rng, _MOVED) * pick(rng, (-1.0, 1.0))
        length = draw_between(rng, (_SHORTEST, self._length))
        start = round_value((self._length - length) * rng.random())
        depth = draw_between(rng, _REMOVED_DEPTH)
        return tuple(
            RemovedMarking(
                offset=round_value(sign * (edge + line_shift)),
                width=_LINE + _REMOVED_WIDTH,
                dash_length=_DASH,
                gap_length=_GAP,
                start_station=start,
                end_station=round_value(min(start + length, self._length)),
                depth=depth,
            )
            for edge in edges[1:-1]
        )
