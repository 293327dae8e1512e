"""Rules for what stands beside the road: delineators, boards, phones; and that bodies stand where they can."""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from ...road.guidelines import DELINEATOR_SPACING, EMERGENCY_PHONE_SPACING, KILOMETRE_BOARD_SPACING
from ...road.objects import LineObject, PointObject
from ...road.other_roads.parts import CrossingRoad
from ...road.section import LineMarking
from ...road.surroundings import Vegetation, Vehicle
from ...road.things import delineator as sizes
from ...road.things.beacon import ConstructionBeacon
from ...road.things.cabinet import Cabinet
from ...road.things.delineator import Delineator
from ...road.things.kilometre_board import KilometreBoard
from ...road.things.shaft import Shaft
from .edges import Edges, Float
from .obstacles import Bodies, Bool
from .rule import TOLERANCE, Finding, Road, Rule, below
from .side_roads import mouth_spans

#: From the paved edge to a delineator's axis, m (HLB).
DELINEATOR_DISTANCE = 0.5
#: A delineator so near (m) to the main road's pavement marks its edge, though another road's be nearer. Chosen.
BESIDE_BOTH = 3.0
#: Posts, boards and phones may stand this much (m) farther apart: stations are rounded.
SPACING_ROOM = 1e-3
#: The kilometre that a board tells may be this far (m) from where it stands: boards have one decimal or more.
KILOMETRE_ROOM = 5.0
#: Bodies may reach this far (m) into each other: offsets are rounded.
OVERLAP_ROOM = 1e-3


def _posts(road: Road, edges: Edges) -> Float:
    """Return the sorted stations of the delineators on a carriageway's outer side, m, without those of other roads."""
    feet = np.array(list(road.bodies.of(Delineator, part="foot")), dtype=np.intp)
    of_others = np.array([road.bodies.names[i] in road.beside_others for i in feet], dtype=bool)
    index = feet[~of_others | (road.positions.nearest[feet] <= BESIDE_BOTH)]
    return np.sort(road.bodies.station[index[road.positions.outer[edges.name][index]]])


def _spacing(road: Road, borders: Float) -> Float:
    """Return the largest spacing (m) allowed between each two of N stations, by the tightest curvature between them."""
    stations = np.concatenate((road.starts[:-1], road.starts[1:]))
    curvature = np.abs(np.concatenate((road.k0, road.k1)))
    element = np.clip(np.searchsorted(road.starts, borders, side="right") - 1, 0, len(road.lengths) - 1)
    share = (borders - road.starts[element]) / np.where(road.lengths[element] > 0.0, road.lengths[element], 1.0)
    share = np.clip(share, 0.0, 1.0)
    curvature_at_borders = np.abs(road.k0[element] * (1.0 - share) + road.k1[element] * share)
    largest_curvature = np.maximum(curvature_at_borders[:-1], curvature_at_borders[1:])
    is_inside = (stations > borders[0]) & (stations < borders[-1])
    np.maximum.at(
        largest_curvature, np.searchsorted(borders, stations[is_inside], side="left") - 1, curvature[is_inside]
    )
    radii, spacings = np.array(DELINEATOR_SPACING).T
    return np.interp(1.0 / np.maximum(largest_curvature, 1e-9), radii, spacings)


def _delineator_missing(road: Road) -> Iterator[Finding]:
    """Yield a finding for each carriageway whose first delineator stands too far from the road's begin."""
    for name, edges in road.sides.items() if road.delineator_rule else ():
        posts = _posts(road, edges)
        first_station = float(posts[0]) if len(posts) else road.length
        first_station = min([first_station, *(start for start, _ in road.villages)])
        limit = float(_spacing(road, np.array([0.0, max(first_station, 0.0)]))[0]) / 2.0
        if first_station > limit + SPACING_ROOM:
            subject = (
                f"The first delineator stands at {first_station:.1f} m" if len(posts) else "There is no delineator"
            )
            text = f"{subject} on the outer side; one is needed within {limit:.1f} m of the beginning (HLB)."
            yield Finding(name, 0.0, first_station, limit, text)


def _delineator_spacing(road: Road) -> Iterator[Finding]:
    """Yield a finding for each gap between delineators that is too long for the curvature in it."""
    for name, edges in road.sides.items() if road.delineator_rule else ():
        posts = _posts(road, edges)
        if not len(posts):
            continue
        # There are none in villages, which end the row like the road's end.
        borders = np.append(posts, max(road.length, posts[-1]))
        borders = np.unique(np.concatenate([borders, np.ravel(road.villages)]))
        gap, limit = np.diff(borders), _spacing(road, borders)
        # In a side road's mouth and in a tunnel there can be none.
        for start, end in [*mouth_spans(road, name), *road.tunnels]:
            gap = gap - np.maximum(np.minimum(borders[1:], end) - np.maximum(borders[:-1], start), 0.0)
        for i in np.flatnonzero(gap > limit + SPACING_ROOM).tolist():
            if road.in_village(float(borders[i] + gap[i] / 2.0)):
                continue
            text = f"No delineator follows for {gap[i]:.1f} m; {limit[i]:.1f} m are allowed (HLB)."
            yield Finding(name, float(borders[i]), float(gap[i]), float(limit[i]), text)


def _delineator_distance(road: Road) -> Iterator[Finding]:
    """Yield a finding for each delineator that stands too near to the paved edge."""
    posts, clearance = road.of(Delineator), road.positions.nearest
    for i in np.flatnonzero((clearance >= 0.0) & (clearance < DELINEATOR_DISTANCE)).tolist():
        name, distance = road.bodies.names[i], float(clearance[i]) + sizes.REACH
        if name in posts and below(distance, DELINEATOR_DISTANCE):
            text = (
                f"The delineator stands {distance:.2f} m from the paved edge; {DELINEATOR_DISTANCE} m are needed (HLB)."
            )
            yield Finding(name, posts[name].station, distance, DELINEATOR_DISTANCE, text)


def _by_side(road: Road, items: dict[str, KilometreBoard] | dict[str, Cabinet]) -> Iterator[list[tuple[str, float]]]:
    """Yield for either side of the centreline the (id, station) of objects there, by station."""
    for sign in (1.0, -1.0):
        places = [(name, item.station) for name, item in items.items() if sign * item.offset > 0.0]
        yield sorted(places, key=lambda pair: pair[1])


def _apart(road: Road, items: dict[str, KilometreBoard] | dict[str, Cabinet], limit: float) -> Iterator[Finding]:
    """Yield a finding for each object whose next one on the same side is farther away than the limit (m)."""
    for places in _by_side(road, items):
        for (name, station), (_, next_station) in pairwise(places):
            if next_station - station > limit + SPACING_ROOM:
                text = f"The next one on this side stands {next_station - station:.1f} m on; {limit:.0f} m are allowed."
                yield Finding(name, station, next_station - station, limit, text)


def _kilometre_spacing(road: Road) -> Iterator[Finding]:
    """Yield a finding for each gap between kilometre boards that is too long."""
    yield from _apart(road, road.of(KilometreBoard), KILOMETRE_BOARD_SPACING)


def _phone_spacing(road: Road) -> Iterator[Finding]:
    """Yield a finding for each gap between emergency phones that is too long."""
    phones = {name: item for name, item in road.of(Cabinet).items() if item.kind == "emergency_phone"}
    yield from _apart(road, phones, EMERGENCY_PHONE_SPACING)


def _kilometre_text(road: Road) -> Iterator[Finding]:
    """Yield findings for boards that don't fit the others: kilometres rise or fall with the stations."""
    boards = road.of(KilometreBoard)
    if not boards:
        return
    names, station = list(boards), np.array([board.station for board in boards.values()])
    kilometre = np.array([_metres(board.text) for board in boards.values()])
    is_known = np.isfinite(kilometre)
    begins = [kilometre - station, kilometre + station] if is_known.any() else [kilometre]
    errors = min(
        (_kilometre_errors(beginning, is_known) for beginning in begins),
        key=lambda distances: int(np.sum(distances > KILOMETRE_ROOM)),
    )
    for i in np.flatnonzero(~(errors <= KILOMETRE_ROOM)).tolist():
        board = boards[names[i]]
        value = float(np.nan_to_num(errors[i], nan=road.length))
        text = f"The board's '{board.text}' is {value:.0f} m from the kilometre that the other boards give its place."
        yield Finding(names[i], board.station, value, KILOMETRE_ROOM, text)


def _kilometre_errors(beginnings: Float, is_known: Bool) -> Float:
    """Return the distances (N,), m, of the road's beginnings that boards tell from the middle one of those known."""
    median_begin = np.sort(beginnings[is_known])[np.sum(is_known) // 2] if is_known.any() else np.nan
    return np.abs(beginnings - median_begin)


def _metres(text: str) -> float:
    """Return the kilometre that a board tells in m, or NaN where its text is no number."""
    whole_part, _, fraction_part = text.strip().replace(",", ".").partition(".")
    digits = whole_part + fraction_part
    return (
        float(f"{whole_part}.{fraction_part}0") * 1000.0
        if whole_part.isascii() and digits.isascii() and digits.isdigit()
        else np.nan
    )


def _object_range(road: Road) -> Iterator[Finding]:
    """Yield a finding for each object that ends before it begins, or beyond the road's end."""
    for name, start, end in _ranges(road):
        if end < start:
            yield Finding(name, end, end, start, f"The object ends at {end:.3f} m before it begins at {start:.3f} m.")
        elif end > road.length * (1.0 + TOLERANCE):
            text = f"The object reaches {end:.3f} m; the road ends at {road.length:.3f} m."
            yield Finding(name, end, end, road.length, text)


def _ranges(road: Road) -> Iterator[tuple[str, float, float]]:
    """Yield (id, start m, end m) of all that lies along the road, damage of the pavement included."""
    for name, item in road.each(PointObject, Vehicle):
        yield name, item.station, item.station
    for name, item in road.each(LineObject, LineMarking):
        yield name, item.start_station, item.end_station
    for name, edges in road.sides.items():
        for rut in edges.carriageway.pavement.ruts:
            yield name, rut.start_station, rut.end_station
        for pothole in edges.carriageway.pavement.potholes:
            yield name, pothole.station, pothole.station


def _object_on_pavement(road: Road) -> Iterator[Finding]:
    """Yield a finding for each object, or stand of plants, that reaches over the pavement."""
    # Covers that lie flush in the pavement of villages are part of it.
    covers = (name for name, shaft in road.of(Shaft).items() if shaft.height == 0.0 and road.in_village(shaft.station))
    # Islands and their signs have a rule of their own.
    allowed_objects = {*road.of(ConstructionBeacon), *covers, *road.on_islands}
    clearance, stations = road.positions.nearest, road.positions.where
    worst_places: dict[str, tuple[float, float]] = {}
    for i in np.flatnonzero(clearance < -TOLERANCE).tolist():
        name = road.bodies.names[i]
        if road.bodies.items[i].part in ("foot", "barrier", "wall") and name not in allowed_objects:
            worst_places[name] = min(worst_places.get(name, (0.0, 0.0)), (float(clearance[i]), float(stations[i])))
    places = [(name, station, distance) for name, (distance, station) in worst_places.items()]
    for name, plants in road.of(Vegetation).items():
        verge = min(edges.verge for edges in road.sides.values())
        if plants.density > 0.0 and verge + plants.band_start < -TOLERANCE:
            places.append((name, 0.0, verge + plants.band_start))
    for name, station, distance in places:
        yield Finding(name, station, distance, 0.0, f"The object reaches {-distance:.2f} m over the pavement.")


def _object_overlap(road: Road) -> Iterator[Finding]:
    """Yield a finding for each pair of objects whose boxes reach into each other."""
    bodies = road.bodies
    first_body, second_body = _near_pairs(bodies)
    depth = np.full(len(first_body), np.inf)
    for lower, upper in ((bodies.start, bodies.end), (bodies.low, bodies.high), (bodies.bottom, bodies.top)):
        depth = np.minimum(
            depth, np.minimum(upper[first_body], upper[second_body]) - np.maximum(lower[first_body], lower[second_body])
        )
    reported_pairs = set()
    for i in np.flatnonzero(depth > OVERLAP_ROOM).tolist():
        pair = (bodies.names[first_body[i]], bodies.names[second_body[i]])
        if pair[0] == pair[1] or pair in reported_pairs or _is_on_crossing(road, pair):
            continue
        reported_pairs.add(pair)
        text = f"The object and {pair[0]} reach {depth[i]:.2f} m into each other."
        yield Finding(
            pair[1], float(max(bodies.start[first_body[i]], bodies.start[second_body[i]])), float(depth[i]), 0.0, text
        )


def _is_on_crossing(road: Road, pair: tuple[str, str]) -> bool:
    """Return whether of two things one is a crossing road's bridge, and the other stands beside that road."""
    bridges = {item.bridge for item in road.of(CrossingRoad).values()}
    return any(one in bridges and other in road.beside_others for one, other in (pair, pair[::-1]))


def _near_pairs(bodies: Bodies) -> tuple[np.ndarray, np.ndarray]:
    """Return the indices (P,), (P,) of all pairs of bodies whose stations overlap, of each pair the lower one first."""
    order = np.argsort(bodies.start, kind="stable")
    end_position = np.searchsorted(bodies.start[order], bodies.end[order], side="left")
    count = np.maximum(end_position - np.arange(len(order)) - 1, 0)
    first_position = np.repeat(np.arange(len(order)), count)
    second_position = first_position + 1 + np.arange(len(first_position)) - np.repeat(np.cumsum(count) - count, count)
    first_position, second_position = order[first_position], order[second_position]
    return np.minimum(first_position, second_position), np.maximum(first_position, second_position)


RULES = (
    Rule("delineator-missing", "Delineators begin at the beginning", "m", "HLB", "derived", _delineator_missing),
    Rule("delineator-spacing", "Spacing of delineators", "m", "HLB", "confirmed", _delineator_spacing),
    Rule("delineator-distance", "Delineators keep off the pavement", "m", "HLB", "confirmed", _delineator_distance),
    Rule("kilometre-spacing", "Spacing of kilometre boards", "m", "", "confirmed", _kilometre_spacing),
    Rule("kilometre-text", "Kilometre boards tell their place", "m", "", "definition", _kilometre_text),
    Rule("phone-spacing", "Spacing of emergency phones", "m", "", "confirmed", _phone_spacing),
    Rule("object-range", "Objects lie on the road's length", "m", "", "definition", _object_range),
    Rule("object-on-pavement", "Nothing stands on the pavement", "m", "", "definition", _object_on_pavement),
    Rule("object-overlap", "No two objects stand at one place", "m", "", "definition", _object_overlap),
)
