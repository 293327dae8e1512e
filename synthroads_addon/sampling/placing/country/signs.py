"""Signs of country roads: before curves and in them, where towns begin and end, at bus stops."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ....base.schema import round_value
from ....road.guidelines import is_single
from ....road.things.sign import TrafficSign
from ..layout import Layout, PlacementRequest, Roadside
from ..ranges import nearest_free
from ..registry import small_thing
from ..signs import country_sign_fields, destination_values

DANGER_SIGN = 200.0
"""Distance before a curve at which its danger sign stands, m: in the middle of what the law allows."""
_LIMIT_BEHIND = 1.5
"""From the danger sign to the speed limit behind it, m. Chosen: one sees both at once."""
_ROOM = 45.0
"""Distance, m, that a danger sign may be moved: it stays where the law allows."""
_BOARD_ROOM = 3.0
_HALF = 0.5  # m that a small sign takes to either side along the road
BOARDS_OF_RADIUS, NEAREST_BOARDS, FARTHEST_BOARDS = 0.09, 10.0, 36.0
"""Distance of two boards of a curve as a share of its radius, and its limits, m. Chosen: three are seen at once."""
_TOWN = 25.0
"""From the road's end to the sign of the town there, m. Chosen."""
_STOP = 0.75
"""Where a bus stop's sign stands, as a share of the bay's full width, from where the traffic comes. Chosen: at the
bus's front."""


@small_thing("country signs", 5)
def plan_country_signs(layout: Layout, rng: np.random.Generator) -> None:
    """Place the signs of a country road by their rules; none on other roads, nor where signs stand at random."""
    scenario = layout.site.scenario
    if not is_single(layout.site.design_class) or not scenario.furniture.signs or scenario.placement != "rules":
        return
    for roadside in layout.sides.values():
        _bus_stops(layout, roadside)
    _towns(layout, rng)
    arcs = list(_signed_arcs(layout))
    for roadside in layout.sides.values():
        _before_curves(layout, roadside, arcs)
    for start, end, curvature in arcs:
        _curve_boards(layout, start, end, curvature)


def _signed_arcs(layout: Layout) -> Iterator[tuple[float, float, float]]:
    """Yield start, end (m) and curvature (1/m) of the arcs that are tight enough for signs."""
    start, radius = 0.0, layout.site.limits.signed_curve_radius
    for element in layout.site.alignment.horizontal:
        if radius and element.kind == "arc" and abs(element.curvature_start) > 1.0 / radius:
            yield start, start + element.length, element.curvature_start
        start += element.length


def _put(roadside: Roadside, code: str, station: float, room: float, **fields: float) -> float | None:
    """Request a sign at the free place nearest to a station; return where it stands, m, or None without room."""
    if not 0.0 <= station <= roadside.length:
        return None
    place = nearest_free(station, _HALF, room, roadside.length, roadside.near)
    if place is None:
        return None
    sign = country_sign_fields(code, {}) | fields
    roadside.put(PlacementRequest("sign", TrafficSign, place, _HALF, sign["width"], sign))
    return place


def _before_curves(layout: Layout, roadside: Roadside, arcs: list[tuple[float, float, float]]) -> None:
    """Place a danger sign before each curve, in the direction of traffic, and the speed limit behind it."""
    speed = layout.site.limits.signed_curve_speed
    for start, end, curvature in arcs:
        begin = start if roadside.traffic > 0 else end
        is_left = curvature * roadside.traffic > 0.0
        place = _put(roadside, f"103-{10 if is_left else 20}", roadside.ahead(begin, -DANGER_SIGN), _ROOM)
        if place is not None and speed:
            _put(roadside, f"274-{speed:.0f}", roadside.ahead(place, _LIMIT_BEHIND), _ROOM / 2.0)


def _curve_boards(layout: Layout, start: float, end: float, curvature: float) -> None:
    """Place the boards of a curve on its outer side, for the traffic of either direction in turn."""
    radius = 1.0 / abs(curvature)
    spacing = float(np.clip(BOARDS_OF_RADIUS * radius, NEAREST_BOARDS, FARTHEST_BOARDS))
    # A left curve's outer side is the right one.
    roadside = layout.sides["right" if curvature > 0.0 else "left"]
    count = max(2, int((end - start) / spacing))
    for index, station in enumerate(np.linspace(start, end, 2 * count + 1)[1::2].tolist()):
        for facing, along in ((roadside.facing, 0.0), (180.0 - roadside.facing, 1.2)):
            is_with_stations = facing == 0.0
            is_left = (curvature > 0.0) == is_with_stations
            at = min(station + along, layout.length)
            _put(roadside, f"625-{10 if is_left else 20}", at, _BOARD_ROOM if index else 0.0, rotation_deg=facing)


def _towns(layout: Layout, rng: np.random.Generator) -> None:
    """Place the signs of towns that begin where the road ends: their names, and behind them the next ones."""
    share = layout.site.scenario.furniture.town_signs
    for end in (0.0, layout.length):
        is_town, values = rng.random() < share, destination_values(rng, layout.site)
        if not is_town:
            continue
        station = abs(end - _TOWN)
        for roadside in layout.sides.values():
            is_entering = (roadside.traffic > 0) == (end > 0.0)
            fields = country_sign_fields("310" if is_entering else "311", values)
            place = nearest_free(station, _HALF, _TOWN / 2.0, layout.length, roadside.near)
            if place is not None:
                roadside.put(PlacementRequest("sign", TrafficSign, place, _HALF, fields["width"], fields))


def _bus_stops(layout: Layout, roadside: Roadside) -> None:
    """Place a sign at each bus bay."""
    for turnout in layout.site.turnouts_of(roadside.side).values():
        if turnout.kind == "bus_bay":
            begin = layout.site.begin(turnout)
            along = turnout.taper_in_length + _STOP * turnout.lane_length
            _put(roadside, "224", round_value(roadside.ahead(begin, along)), _HALF)
