"""Traffic signs: before exits, in gores, after entries, before tight curves and construction zones."""

from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import numpy as np

from ...base.schema import round_value
from ...road.guidelines import (
    BARRIER_DISTANCE,
    EXIT_SEQUENCE,
    EXIT_SIGN_ROOM,
    GORE_SIGN,
    OBSTACLE_POST,
    SIGN_DISTANCE,
    SignRole,
)
from ...road.objects import Side
from ...road.section import Turnout
from ...road.things.sign import TrafficSign
from ...road.things.sign_catalogue import sign_catalogue
from ...road.turnout_geometry import NOSE_ROUND, STEP, TurnoutShape
from .edge import island_begin, ramp_station
from .layout import MEDIAN_BARRIER_HALF, MEDIAN_OBSTACLE, Layout, PlacementRequest, Roadside
from .ranges import Range, nearest_free
from .site import PlacementSite

CURVE_SIGNS = (400.0, 200.0)
"""Distances before a tight curve at which its danger sign stands, m."""
SECOND_CURVE = 300.0
"""A tight curve the other way that follows within this distance makes a double curve, m."""
CONSTRUCTION_SIGNS = {400.0: "123", 300.0: "274-100", 200.0: "121-10", 100.0: "274-80"}
"""Distance before a construction zone (m) -> code of the sign there."""
CONSTRUCTION_END = 30.0
"""Behind a construction zone's end the sign "282" stands, m."""
URBAN_LIMITS = ("274-80", "274-100")
"""Speed limits of urban motorways (EKA 3)."""
LIMIT_BEHIND_BEGIN, LIMIT_BEHIND_ENTRY, TABLE_BEHIND_ENTRY = 30.0, 60.0, 250.0
"""Where speed limits and distance tables stand behind the road's begin and behind entries, m."""
_CURVE_ROLES: dict[tuple[bool, bool], SignRole] = {
    (False, True): "curve_left",
    (False, False): "curve_right",
    (True, True): "double_curve_left",
    (True, False): "double_curve_right",
}
"""Whether two curves follow each other, and whether the first turns left -> what the sign is for."""
_ROOM = 20.0  # m: signs whose distance doesn't matter much may be moved so far
_HALF, _LARGE_HALF = 0.5, 1.0  # m that small signs and large boards take to either side along the road
_GORE_MARGIN = 0.1  # m beyond `SIGN_DISTANCE`: the ramp's edge runs aslant
_NARROWEST_GORE_SIGN = 0.1  # m


def plan_gore_signs(layout: Layout) -> None:
    """Place the exit boards onto the islands behind the noses, on thin posts, smaller where there is little room."""
    if sign_catalogue().signs[GORE_SIGN].country != layout.site.guideline.country:
        return
    for side, roadside in layout.sides.items():
        for turnout in layout.site.turnouts_of_kind(side, "exit"):
            plan_gore_sign(layout, roadside, turnout)


def plan_gore_sign(layout: Layout, roadside: Roadside, turnout: Turnout) -> None:
    """Place the exit board onto the island behind one exit's nose; none where the island is too narrow."""
    sign, section = sign_catalogue().signs[GORE_SIGN], layout.site.sections[roadside.side]
    station = _gore_station(layout.site.shape(turnout), sign.width)
    if not 0.0 <= station <= layout.length:
        return
    island_start, island_end = (float(edge[0]) for edge in section.boundaries_of("island", station))
    width = min(sign.width, island_end - island_start - 2.0 * (SIGN_DISTANCE + _GORE_MARGIN))
    if width < _NARROWEST_GORE_SIGN:
        return
    fields = sign.fields() | {"width": round_value(width), "code": GORE_SIGN, "text": sign.text}
    middle = (island_start + island_end) / 2.0
    roadside.put(PlacementRequest("sign-gore", TrafficSign, station, _LARGE_HALF, width, fields, distance=middle))


def plan_exit_signs(layout: Layout, rng: np.random.Generator) -> None:
    """Place the signs that announce exits; those that fall before the road's begin are left out."""
    for side, roadside in layout.sides.items():
        for turnout in layout.site.turnouts_of_kind(side, "exit"):
            plan_signs_before_exit(layout, roadside, turnout, rng)


def plan_signs_before_exit(layout: Layout, roadside: Roadside, turnout: Turnout, rng: np.random.Generator) -> None:
    """Place the signs that announce one exit; those that fall before the road's begin are left out."""
    number, names = str(rng.integers(1, 100)), _names(rng, 3)
    values = {"number": number, "exit": names[0], "near": names[1], "middle": names[1], "far": names[2]}
    values["motorway"] = motorway_number(layout.site)
    for distance, code in EXIT_SEQUENCE.items():
        station = roadside.ahead(layout.site.begin(turnout), -distance)
        place_sign(roadside, code, station, EXIT_SIGN_ROOM, values)


def plan_other_signs(layout: Layout, rng: np.random.Generator, zones: dict[Side, Range]) -> None:
    """Place all other signs: speed limits, and those behind entries and before curves and construction zones.

    Args:
        layout: what stands already.
        rng: the signs' random numbers.
        zones: the construction zone of a carriageway, by side: the lowest and highest station, m.
    """
    is_urban = layout.site.design_class == "EKA3"
    for side, roadside in layout.sides.items():
        if side in zones:
            _announce_construction(layout, roadside, zones[side])
        limit = URBAN_LIMITS[int(rng.integers(len(URBAN_LIMITS)))]
        begin = 0.0 if roadside.traffic > 0 else layout.length
        if is_urban:
            place_sign(roadside, limit, roadside.ahead(begin, LIMIT_BEHIND_BEGIN), _ROOM)
        for turnout in layout.site.turnouts_of_kind(side, "entry"):
            plan_signs_behind_entry(layout, roadside, turnout, limit if is_urban else None, rng)
        for code, station in _curve_signs(layout, roadside):
            place_sign_on_both_sides(layout, roadside, code, station)


def place_sign(
    roadside: Roadside, code: str, station: float, room: float, values: dict[str, str] | None = None, shift: float = 0.0
) -> bool:
    """Request a sign as near as possible to a station; return whether there is room for it.

    Args:
        roadside: where.
        code: number in the catalogue.
        station: where it belongs, m; nothing is put beyond the road's ends, and no sign of another country.
        room: how far it may be moved, m.
        values: what is filled into its text.
        shift: how much farther out than it has to it stands, m.
    """
    sign = sign_catalogue().signs[code]
    if not 0.0 <= station <= roadside.length or sign.country != roadside.country:
        return False
    is_large = sign.post_diameter > OBSTACLE_POST  # so thick a post needs a barrier
    zones = (roadside.near, roadside.far, roadside.crossed) if is_large else (roadside.near,)
    half_length = _LARGE_HALF if is_large else _HALF
    place = nearest_free(station, half_length, room, roadside.length, *zones)
    if place is None:
        return False
    text = tuple(line.format(**values) for line in sign.text) if values else sign.text
    fields = sign.fields() | {"code": code, "text": text}
    roadside.put(
        PlacementRequest("sign", TrafficSign, place, half_length, sign.width, fields, shift, obstacle=is_large)
    )
    if is_large:
        roadside.far.add(place - half_length, place + half_length)
    return True


def place_sign_on_both_sides(layout: Layout, roadside: Roadside, code: str, station: float) -> None:
    """Place a sign beside a carriageway's outer edge, and one into the median where that has room for it."""
    if not place_sign(roadside, code, station, _ROOM):
        return
    sign, median = sign_catalogue().signs[code], layout.median
    if median.has_obstacles or not layout.site.scenario.barriers.median:
        edge, offset = (MEDIAN_OBSTACLE if median.has_obstacles else BARRIER_DISTANCE), 0.0
        fits = sign.width / 2.0 <= median.half_width - edge
    else:
        offset = MEDIAN_BARRIER_HALF + sign.width / 2.0
        fits = offset + sign.width / 2.0 <= median.half_width - SIGN_DISTANCE
    place = nearest_free(station, _HALF, _ROOM, layout.length, median.taken)
    if len(median.inner) < 2 or not fits or place is None:
        return
    median.taken.add(place - _HALF, place + _HALF)
    axis = {"station": round_value(place), "offset": round_value(roadside.sign * offset)}
    fields: dict[str, Any] = {**axis, "rotation_deg": roadside.facing, "code": code, "text": sign.text, **sign.fields()}
    median.signs.append(TrafficSign(instance=1, **fields))


def motorway_number(site: PlacementSite) -> str:
    """Return the number of a road, such as "A 44", the same on all of its signs."""
    return f"A {int(site.stream('motorway number').integers(1, 100))}"


def destination_values(rng: np.random.Generator, site: PlacementSite) -> dict[str, str]:
    """Return drawn values for the texts of boards: a number, a name, and names with growing distances."""
    names = _names(rng, 4, site.guideline.destinations)
    distances = np.cumsum(rng.integers(3, 60, 3)).tolist()
    near_text, middle_text, far_text = (
        f"{name} {distance} km" for name, distance in zip(names[1:], distances, strict=True)
    )
    values = {
        "number": str(rng.integers(1, 100)),
        "exit": names[0],
        "near": near_text,
        "middle": middle_text,
        "far": far_text,
    }
    return values | {"motorway": motorway_number(site)}


COUNTRY_SIZES = {"triangle": 0.9 / 1.26, "triangle_down": 0.9 / 1.26, "round": 0.8}
"""Size of signs beside country roads (size 2) as a share of that on motorways (size 3), by shape (VwV-StVO)."""
_ONE_SIZE = ("224",)


def country_sign_fields(code: str, values: dict[str, str]) -> dict[str, Any]:
    """Return the fields of a sign at the size that country roads have, all but its place.

    Args:
        code: number in the catalogue.
        values: what is filled into its text.
    """
    sign = sign_catalogue().signs[code]
    size = 1.0 if code in _ONE_SIZE else COUNTRY_SIZES.get(sign.shape, 1.0)
    fields = sign.fields() | {"code": code, "text": tuple(line.format(**values) for line in sign.text)}
    return fields | {name: round_value(fields[name] * size) for name in ("width", "height")}


def median_signs(layout: Layout) -> Iterator[tuple[str, TrafficSign]]:
    """Yield (id, sign) of the signs in the median."""
    for number, sign in enumerate(layout.median.signs, start=1):
        yield f"sign-median-{number:03d}", sign


def _gore_station(shape: TurnoutShape, width: float) -> float:
    """Return the station (m) at which the island is wide enough for a sign, or else the last one on it."""
    ramp = shape.turnout.ramp
    assert ramp is not None
    wide_enough_from = island_begin(shape, ramp, width + 2.0 * (SIGN_DISTANCE + _GORE_MARGIN))
    return ramp_station(shape, min(max(wide_enough_from, shape.nose + NOSE_ROUND[-1]), ramp.length - STEP))


def plan_signs_behind_entry(
    layout: Layout, roadside: Roadside, turnout: Turnout, limit: str | None, rng: np.random.Generator
) -> None:
    """Place the signs behind an entry: the speed limit, if there is one, and the table of destinations."""
    end = roadside.ahead(layout.site.begin(turnout), turnout.length)
    if limit:
        place_sign(roadside, limit, roadside.ahead(end, LIMIT_BEHIND_ENTRY), _ROOM)
    values = destination_values(rng, layout.site)
    place_sign(roadside, "453", roadside.ahead(end, TABLE_BEHIND_ENTRY), _ROOM, values)


def _announce_construction(layout: Layout, roadside: Roadside, zone: Range) -> None:
    """Place the signs before a construction zone (stations, m) and the one behind it, on both sides."""
    zone_begin, zone_end = zone if roadside.traffic > 0 else (zone[1], zone[0])
    for distance, code in CONSTRUCTION_SIGNS.items():
        place_sign_on_both_sides(layout, roadside, code, roadside.ahead(zone_begin, -distance))
    place_sign_on_both_sides(layout, roadside, "282", roadside.ahead(zone_end, CONSTRUCTION_END))


def _curve_signs(layout: Layout, roadside: Roadside) -> Iterator[tuple[str, float]]:
    """Yield code and station (m) of the danger signs before tight curves, in the direction of traffic.

    None where the guideline says how far before the curve one stands: `country.signs` places that one.
    """
    if layout.site.limits.danger_sign_nearest:
        return
    traffic, codes = roadside.traffic, layout.site.guideline.sign_roles
    arcs = sorted(
        (min(traffic * start, traffic * end), max(traffic * start, traffic * end), traffic * curvature > 0.0)
        for start, end, curvature in layout.signed_arcs
    )
    last_end = -np.inf
    for (begin, end, is_left), (next_begin, _, is_next_left) in pairwise([*arcs, (np.inf, np.inf, False)]):
        if begin - last_end >= SECOND_CURVE:
            is_double = is_next_left != is_left and next_begin - end < SECOND_CURVE
            code = codes.get(_CURVE_ROLES[is_double, is_left])
            if code:
                yield from ((code, traffic * (begin - distance)) for distance in CURVE_SIGNS)
        last_end = end


def _names(rng: np.random.Generator, count: int, choice: tuple[str, ...] = ()) -> list[str]:
    """Return drawn names of places for boards, all different: of a choice, or of the catalogue's without one."""
    names = choice or sign_catalogue().destinations
    return [names[i] for i in rng.choice(len(names), count, replace=False)]
