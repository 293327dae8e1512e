"""Markings of an exit or entry on a road that is there: what its lane and ramp have, and the edge line beside it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...road.objects import RoadObject, Side
from ...road.parameters import RoadParameters
from ...road.section import Arrow, Hatching, LineMarking, Turnout
from ...road.turnout_geometry import TurnoutShape
from ..markings import Painter, block_span
from ..placing.ranges import Range
from ..placing.site import PlacementSite
from .site import USUAL_FILM, carriageway_ids, free_ids

_SHORTEST_LINE = 1.0
"""Shorter rests of an edge line (m) are left out."""
_MEETING = 0.01
"""Stations that differ by less (m) are one."""


def with_markings(
    parameters: RoadParameters, site: PlacementSite, side: Side, name: str, turnout: Turnout
) -> dict[str, RoadObject]:
    """Return a road's objects with the markings of one more exit or entry; its edge line gives way to the block line.

    Args:
        parameters: the road, with the turnout.
        site: of it.
        side: of the carriageway.
        name, turnout: the turnout, as the site has it.
    """
    objects: dict[str, RoadObject] = dict(parameters.objects)
    if turnout.ramp is None:
        return objects
    carriageway = carriageway_ids(parameters)[side]
    lines = [line for line in parameters.of_type(LineMarking).values() if line.carriageway == carriageway]
    film = next((line.film_thickness for line in lines if line.color == "white"), USUAL_FILM)
    span = block_span(site.shape(turnout))
    for key, line in _edge_lines(objects, carriageway):
        if line.start_station < span[1] and line.end_station > span[0]:
            objects = _with_cut(objects, key, line, span)
    for key, marking in Painter(site, side, site.carriageways[side], film).turnout(name, turnout):
        update = {} if isinstance(marking, Hatching) else {"carriageway": carriageway}
        objects[free_ids(objects, key)] = marking.model_copy(update=update)
    return objects


def without_markings(
    parameters: RoadParameters, site: PlacementSite, side: Side, name: str, turnout: Turnout
) -> dict[str, RoadObject]:
    """Return a road's objects without the markings of an exit or entry; its edge line goes on where it was.

    Args:
        parameters: the road, still with the turnout.
        site: of it.
        side: of the carriageway.
        name, turnout: the turnout, as the site has it.
    """
    objects: dict[str, RoadObject] = dict(parameters.objects)
    if turnout.ramp is None:
        return objects
    carriageway, shape = carriageway_ids(parameters)[side], site.shape(turnout)
    span = block_span(shape)
    for key, item in parameters.objects.items():
        is_own = isinstance(item, LineMarking | Hatching) and item.turnout == name
        if isinstance(item, LineMarking) and item.kind == "block" and item.carriageway == carriageway:
            is_own = item.start_station < span[1] and item.end_station > span[0]
        if is_own or (isinstance(item, Arrow) and _is_on_lane(item, site, side, shape)):
            del objects[key]
    return _with_joined_line(objects, carriageway, span)


def _edge_lines(objects: Mapping[str, RoadObject], carriageway: str) -> list[tuple[str, LineMarking]]:
    """Return a carriageway's outer edge lines with their ids, in the order of their stations."""
    lines = [
        (key, item)
        for key, item in objects.items()
        if isinstance(item, LineMarking)
        and (item.carriageway, item.kind, item.color) == (carriageway, "outer_edge", "white")
    ]
    return sorted(lines, key=lambda pair: pair[1].start_station)


def _with_cut(objects: dict[str, RoadObject], key: str, line: LineMarking, span: Range) -> dict[str, RoadObject]:
    """Return objects with a line cut open between two stations (m); its first rest keeps the id."""
    rests = [(line.start_station, min(line.end_station, span[0])), (max(line.start_station, span[1]), line.end_station)]
    rests = [(start, end) for start, end in rests if end - start >= _SHORTEST_LINE]
    result: dict[str, RoadObject] = {}
    for other, item in objects.items():
        if other != key:
            result[other] = item
            continue
        for number, (start, end) in enumerate(rests):
            rest = line.model_copy(update={"start_station": start, "end_station": end})
            result[key if number == 0 else free_ids(objects | result, key)] = rest
    return result


def _with_joined_line(objects: dict[str, RoadObject], carriageway: str, span: Range) -> dict[str, RoadObject]:
    """Return objects with the edge line that was cut open between two stations (m) in one piece again."""
    lines = _edge_lines(objects, carriageway)
    before = next((pair for pair in lines if abs(pair[1].end_station - span[0]) < _MEETING + _SHORTEST_LINE), None)
    behind = next((pair for pair in lines if abs(pair[1].start_station - span[1]) < _MEETING + _SHORTEST_LINE), None)
    if before is not None:
        end = span[1] if behind is None else behind[1].end_station
        joined = objects | {before[0]: before[1].model_copy(update={"end_station": end})}
        return {key: item for key, item in joined.items() if behind is None or key != behind[0]}
    if behind is not None:
        return objects | {behind[0]: behind[1].model_copy(update={"start_station": span[0]})}
    return objects


def _is_on_lane(arrow: Arrow, site: PlacementSite, side: Side, shape: TurnoutShape) -> bool:
    """Return whether an arrow lies on a turnout's lane."""
    start, end = shape.turnout.start_station, shape.turnout.end_station
    sign = site.carriageways[side].sign
    if not start <= arrow.station <= end or sign * arrow.offset < 0.0:
        return False
    inner, outer = (
        float(edge[0]) for edge in site.sections[side].boundaries_of("turnout_lane", np.array([arrow.station]))
    )
    return inner < sign * arrow.offset < outer
