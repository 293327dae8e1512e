"""Signs of country roads: before curves and in them, where towns begin and end, at bus stops."""

from __future__ import annotations

import numpy as np

from ....base.schema import round_value
from ....road.guidelines import SignRole, is_single
from ....road.things.sign import TrafficSign
from ....road.things.sign_catalogue import speed_limit_sign
from ..layout import Layout, PlacementRequest, Roadside
from ..ranges import nearest_free
from ..registry import small_thing
from ..signs import country_sign_fields, destination_values

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
    """Place the signs of a country road by their rules; none on other roads, nor where signs stand at random.

    They are those of the guideline's country: what it has no sign for isn't signed.
    """
    scenario = layout.site.scenario
    if not is_single(layout.site.design_class) or not scenario.furniture.signs or scenario.placement != "rules":
        return
    for roadside in layout.sides.values():
        _bus_stops(layout, roadside)
    _towns(layout, rng)
    arcs = layout.signed_arcs
    for roadside in layout.sides.values():
        _before_curves(layout, roadside, arcs)
    for start, end, curvature in arcs:
        _curve_boards(layout, start, end, curvature)


def _code(layout: Layout, role: SignRole) -> str | None:
    """Return the code of the country's sign for a purpose, or None if the guideline names none."""
    return layout.site.guideline.sign_roles.get(role)


def put_country_sign(
    roadside: Roadside, code: str | None, station: float, room: float, **fields: float
) -> float | None:
    """Request a sign at the free place nearest to a station; return where it stands, m; None without room or code."""
    if code is None or not 0.0 <= station <= roadside.length:
        return None
    place = nearest_free(station, _HALF, room, roadside.length, roadside.near)
    if place is None:
        return None
    sign = country_sign_fields(code, {}) | fields
    roadside.put(PlacementRequest("sign", TrafficSign, place, _HALF, sign["width"], sign))
    return place


def _before_curves(layout: Layout, roadside: Roadside, arcs: list[tuple[float, float, float]]) -> None:
    """Place a danger sign before each curve, in the direction of traffic, and the speed limit behind it.

    It stands in the middle of where the guideline wants it; none where that doesn't say.
    """
    limits, country = layout.site.limits, layout.site.guideline.country
    if not limits.danger_sign_nearest:
        return
    distance = (limits.danger_sign_nearest + limits.danger_sign_farthest) / 2.0
    limit_sign = speed_limit_sign(country, limits.signed_curve_speed)
    for start, end, curvature in arcs:
        begin = start if roadside.traffic > 0 else end
        is_left = curvature * roadside.traffic > 0.0
        code = _code(layout, "curve_left" if is_left else "curve_right")
        place = put_country_sign(roadside, code, roadside.ahead(begin, -distance), _ROOM)
        if place is not None:
            put_country_sign(roadside, limit_sign, roadside.ahead(place, _LIMIT_BEHIND), _ROOM / 2.0)


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
            code = _code(layout, "curve_board_left" if is_left else "curve_board_right")
            put_country_sign(roadside, code, at, _BOARD_ROOM if index else 0.0, rotation_deg=facing)


def _towns(layout: Layout, rng: np.random.Generator) -> None:
    """Place the signs of towns that begin where the road ends: their names, and behind them the next ones.

    A road through a village has its signs alone.
    """
    share = layout.site.scenario.furniture.town_signs
    for end in (0.0, layout.length):
        is_town, values = rng.random() < share, destination_values(rng, layout.site)
        if not is_town or layout.site.villages:
            continue
        station = abs(end - _TOWN)
        for roadside in layout.sides.values():
            is_entering = (roadside.traffic > 0) == (end > 0.0)
            code = _code(layout, "town_begin" if is_entering else "town_end")
            if code is None:
                continue
            fields = country_sign_fields(code, values)
            place = nearest_free(station, _HALF, _TOWN / 2.0, layout.length, roadside.near)
            if place is not None:
                roadside.put(PlacementRequest("sign", TrafficSign, place, _HALF, fields["width"], fields))


def _bus_stops(layout: Layout, roadside: Roadside) -> None:
    """Place a sign at each bus bay."""
    for turnout in layout.site.turnouts_of(roadside.side).values():
        if turnout.kind == "bus_bay":
            begin = layout.site.begin(turnout)
            along = turnout.taper_in_length + _STOP * turnout.lane_length
            put_country_sign(roadside, _code(layout, "bus_stop"), round_value(roadside.ahead(begin, along)), _HALF)
