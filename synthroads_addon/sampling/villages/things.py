"""Things in a village: houses with their front gardens, street lights, signs, crossing, parked vehicles.

Inside a village none of the open road's furniture stands, edge lines end, and the line between the directions has the
shorter dashes of built-up areas.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from ...base.schema import round_value
from ...road.guidelines import SHORTEST_BARRIER, SignRole
from ...road.objects import LineObject, PointObject, RoadObject, Side
from ...road.section import LineMarking
from ...road.things.building import OVERHANG, Building
from ...road.things.bus_shelter import OVERHANG as SHELTER_OVERHANG
from ...road.things.bus_shelter import BusShelter
from ...road.things.concrete_barrier import ConcreteBarrier
from ...road.things.delineator import Delineator
from ...road.things.fence import Fence
from ...road.things.gantry import Gantry
from ...road.things.guardrail import Guardrail
from ...road.things.hedge import Hedge
from ...road.things.noise_barrier import NoiseBarrier
from ...road.things.overpass import Overpass
from ...road.things.parked_vehicle import ParkedVehicle
from ...road.things.pole import Pole
from ...road.things.power_line import PowerLine
from ...road.things.shaft import Shaft
from ...road.things.sign import TrafficSign
from ...road.things.sign_catalogue import sign_catalogue, speed_limit_sign
from ...road.things.vehicles import COLORS, VEHICLE_TYPES
from ...road.things.wall import Wall
from ..placing.draw import draw, draw_between, pick
from ..placing.ranges import Range, Reservations, free_ranges
from ..placing.signs import country_sign_fields
from ..placing.site import PlacementSite
from ..placing.village_plan import BESIDE_VILLAGE, CROSSING_LENGTH, SHELTER_ROOM, STAND_LENGTH, Plot, Village
from .islands import island_markings, place_islands

_LEAST_PIECE = 12.0  # m, of what is cut at a village
_BARRIERS = (Guardrail, ConcreteBarrier, NoiseBarrier)
_SPANNING = (Overpass, Gantry, PowerLine)
BAR = 0.5
"""Width of the bars of a zebra crossing, and of the gaps between them, m (colliseum.eu, Fahrbahnmarkierung)."""
_DOUBLE = 2.0
"""Number of solid lines beside each other that stay as they are in a village."""
_SIGN_DISTANCE = 0.85  # m from the kerb's back to a sign's axis
_SLOW = 30.0  # km/h
_BEHIND_BEGIN = 6.0  # m from where a village begins to the sign of its speed limit
_SPEED_SIGN = 0.55  # m from the footway to the sign of a speed limit: between street lights and what bounds gardens
_BEFORE_CROSSING = 2.5  # m from the crossing's middle to its sign
_LIGHT_DISTANCE = 0.3  # m from the footway to a street light's axis
_LIGHT_DIAMETER, _LIGHT_ARMS = 0.14, (0.6, 1.0, 1.5)
_LIGHT_ROOM = 0.5  # m between a light and a drive
_BAY_LINE = 0.12  # m
_HOUSES: dict[str, tuple[tuple[float, float], tuple[float, float], tuple[float, float], tuple[float, float]]] = {
    "house": ((8.0, 13.0), (7.5, 10.0), (3.2, 6.2), (2.8, 4.8)),
    "brick_house": ((8.0, 14.0), (7.5, 10.0), (3.2, 6.2), (2.8, 4.8)),
    "barn": ((9.0, 16.0), (8.0, 11.0), (3.8, 5.2), (2.8, 4.5)),
}
_KINDS = ("house", "house", "house", "brick_house", "brick_house", "barn")
_SIDE_GAP = 1.5  # m between a house and the plot's end
_SMALLEST_HOUSE = 6.0  # m
_DRIVE_ROOM = 6.3  # m of the plot's length that its drive takes
_GARDEN = 1.6  # m: nearer houses stand at the street without a garden
_BESIDE_LANE = 0.05  # m between a parked vehicle and the lanes' pavement
_BETWEEN = 0.1  # m, half of what is left between two parked vehicles at least
_LONGEST = STAND_LENGTH - 2.0 * _BETWEEN
_MODELS = tuple(m for m in ("car", "car", "estate", "car", "van", "estate") if VEHICLE_TYPES[m].length < _LONGEST)
_SHELTER_WIDTH, _SHELTER_DEPTH, _SHELTER_HEIGHT = (2.6, 4.2), (1.3, 1.7), (2.4, 2.7)
"""Width, depth and height of bus shelters, m. Chosen."""
_BEHIND_FOOTWAY = 0.05  # m from the footway to a shelter's roof
_MANHOLE, _MANHOLES_EVERY = 0.66, 45.0
_GULLY, _GULLIES_EVERY = 0.3, 30.0


def outside_villages(site: PlacementSite, items: Iterable[tuple[str, RoadObject]]) -> Iterator[tuple[str, RoadObject]]:
    """Yield (id, object) of the open road's furniture and lines as far as it lies outside of villages."""
    for name, item in items:
        if not site.villages or isinstance(item, _SPANNING):
            yield name, item
        elif isinstance(item, LineObject):
            yield from _pieces(site, name, item, SHORTEST_BARRIER if isinstance(item, _BARRIERS) else _LEAST_PIECE)
        elif isinstance(item, LineMarking):
            yield from _lines(site, name, item)
        elif isinstance(item, PointObject):
            # Delineators go on up to the village, others keep clear of its first things.
            margin = 0.0 if isinstance(item, Delineator) else BESIDE_VILLAGE
            if not any(village.reaches(item.station - margin, item.station + margin) for village in site.villages):
                yield name, item
        else:
            yield name, item


def _pieces(site: PlacementSite, name: str, item: Any, least: float) -> Iterator[tuple[str, Any]]:
    """Yield the pieces of an object along the road outside of villages that are at least so long (m)."""
    villages = Reservations((village.start - BESIDE_VILLAGE, village.end + BESIDE_VILLAGE) for village in site.villages)
    if villages.is_free(item.start_station, item.end_station):
        yield name, item
        return
    ranges = free_ranges(item.start_station, item.end_station, villages)
    for number, (start, end) in enumerate((r for r in ranges if r[1] - r[0] >= least), 1):
        update = {"start_station": round_value(start), "end_station": round_value(end)}
        yield f"{name}-{number}" if number > 1 else name, item.model_copy(update=update)


def _lines(site: PlacementSite, name: str, line: LineMarking) -> Iterator[tuple[str, LineMarking]]:
    """Yield a line in pieces: as it is outside of villages; inside, a centre line has shorter dashes, others end."""
    villages = Reservations((village.start, village.end) for village in site.villages)
    stretches = [(span, False) for span in free_ranges(line.start_station, line.end_station, villages)]
    if line.kind == "free":
        inside = villages.within(line.start_station, line.end_station)
        stretches += [((max(a, line.start_station), min(b, line.end_station)), True) for a, b in inside]
    for number, ((start, end), is_inside) in enumerate(sorted(stretches), 1):
        update: dict[str, Any] = {"start_station": round_value(start), "end_station": round_value(end)}
        if is_inside and site.limits.town_dash and (line.dash_length or site.limits.solid_lines < _DOUBLE):
            update |= {"dash_length": site.limits.town_dash, "gap_length": site.limits.town_gap}
        yield f"{name}-{number}" if number > 1 else name, line.model_copy(update=update)


def village_markings(site: PlacementSite, film: float) -> Iterator[tuple[str, LineMarking]]:
    """Yield (id, marking) of crossings, a bar each, and of lines along parking bays, of films of a thickness (m)."""
    for village in site.villages:
        if village.crossing is not None:
            yield from _crossing(site, village.crossing, film)
        for side, street in village.streets.items():
            edge = float(site.sections[side].main_edge([street.start_station])[0]) - _BAY_LINE / 2.0
            for number, bay in enumerate(street.bays, 1):
                span = (bay.start_station, bay.end_station)
                yield f"bay-line-{side}-{number}", _free_line(f"carriageway-{side}", edge, _BAY_LINE, span, film)
    yield from island_markings(site, site.limits.solid_line_width or site.limits.narrow_line, film)


def _crossing(site: PlacementSite, station: float, film: float) -> Iterator[tuple[str, LineMarking]]:
    """Yield the bars of a zebra crossing at a station (m), which run with the road, from one edge to the other."""
    span = (station - CROSSING_LENGTH / 2.0, station + CROSSING_LENGTH / 2.0)
    edges = {side: float(section.main_edge([station])[0]) for side, section in site.sections.items()}
    width = math.fsum(edges.values())
    count = int((width + BAR) / (2.0 * BAR) + 1e-9)
    first = -edges.get("right", 0.0) + (width - (2 * count - 1) * BAR) / 2.0 + BAR / 2.0
    for number in range(count):
        offset = first + 2.0 * BAR * number
        side: Side = "left" if offset > 0.0 else "right"
        yield f"crossing-{number + 1}", _free_line(f"carriageway-{side}", abs(offset), BAR, span, film)


def _free_line(carriageway: str, distance: float, width: float, span: Range, film: float) -> LineMarking:
    """Return a solid line at a distance from the centreline between two stations, all m."""
    return LineMarking(
        instance=1,
        carriageway=carriageway,
        kind="free",
        offset=round_value(distance),
        width=width,
        dash_length=0.0,
        gap_length=0.0,
        start_station=round_value(span[0]),
        end_station=round_value(span[1]),
        film_thickness=film,
    )


def place_villages(site: PlacementSite) -> Iterator[tuple[str, RoadObject]]:
    """Yield (id, object) of everything that stands in the road's villages; all are of instance 1."""
    for village in site.villages:
        rng = site.stream("village", "things")
        lit_side = pick(rng, list(village.streets))
        for side in village.streets:
            edge = _StreetEdge(site, village, side)
            yield from _plots(edge, site.stream("village", "plots", side))
            yield from _parked(edge, site.stream("village", "parked", side))
            yield from _signs(edge, site.stream("village", "signs", side))
            yield from _speed_limit(edge)
            yield from _shelter(edge, site.stream("village", "shelter", side))
            yield from _covers(edge, site.stream("village", "covers", side))
        yield from _lights(_StreetEdge(site, village, lit_side), site.stream("village", "lights"))
    yield from place_islands(site)


class _StreetEdge:
    """One side of a village while it is furnished.

    Attributes:
        site, village, side, street: what it is a side of.
        sign: of offsets there.
        facing: rotation (deg) of things that face this side's traffic.
        gutter, kerb, back: distances from the centreline of the bay's inner edge, the kerb's outer edge (no bays),
            and the footway's outer edge, m, where no island moves the lanes.
    """

    def __init__(self, site: PlacementSite, village: Village, side: Side) -> None:
        self.site, self.village, self.side = site, village, side
        self.street, section = village.streets[side], site.sections[side]
        carriageway = section.carriageway
        self.sign, self.traffic = carriageway.sign, carriageway.traffic
        self.facing = 0.0 if carriageway.traffic > 0 else 180.0
        self.gutter = float(section.main_edge([village.start])[0]) + self.street.gutter_width
        self.kerb = self.gutter + self.street.kerb_width
        self.back = self.kerb + self.street.footway_width
        self.no_lights = Reservations((level.start_station, level.end_station) for level in self.street.kerb_levels)
        behind_begin = (village.start if self.traffic > 0 else village.end) + self.traffic * _BEHIND_BEGIN
        self.no_lights.add(behind_begin, behind_begin)  # a sign of a speed limit may stand there
        if side in village.shelters:
            middle = village.shelters[side]
            self.no_lights.add(middle - SHELTER_ROOM / 2.0, middle + SHELTER_ROOM / 2.0)

    @property
    def behind(self) -> float:
        """Return the distance of the verge's outer edge from the centreline, m."""
        return self.back + self.street.verge_width

    def place(self, station: float, distance: float) -> dict[str, float]:
        """Return the fields of a place at a distance (m) from the centreline, as it were without an island."""
        moved = distance + self._moved(station)
        return {"station": round_value(station), "offset": round_value(self.sign * moved)}

    def kerb_distance(self, station: float) -> float:
        """Return the distance of the kerb's outer edge from the centreline at a station, bays included, m."""
        return float(self.site.sections[self.side].boundaries_of("kerb", [station])[1][0]) - self._moved(station)

    def _moved(self, station: float) -> float:
        """Return by how much an island moves the pavement's edge outwards at a station, m."""
        edges = self.site.sections[self.side].main_edge([self.village.start, station])
        return float(edges[1] - edges[0])


def _plots(edge: _StreetEdge, rng: np.random.Generator) -> Iterator[tuple[str, RoadObject]]:
    """Yield the house of each plot, its wall, fence or hedge towards the street, and a vehicle in its drive."""
    limits, side = edge.site.scenario.villages, edge.side
    reach = edge.site.terrain.half_width - 2.0
    for number, plot in enumerate(edge.village.plots[side], 1):
        kind, distance = pick(rng, _KINDS), draw(rng, limits.house_distance)
        width, depth, height, roof = (draw_between(rng, sizes) for sizes in _HOUSES[kind])
        turn, chance, garden = draw_between(rng, (-2.0, 2.0)), rng.random(), pick(rng, ("wall", "fence", "hedge", ""))
        start = plot.start + (_DRIVE_ROOM if plot.drive is not None else _SIDE_GAP)
        room = plot.end - _SIDE_GAP - start - 2.0 * OVERHANG
        width = round_value(min(width, room))
        middle = start + OVERHANG + width / 2.0 + max(room - width, 0.0) / 2.0
        offset = edge.behind + distance + OVERHANG + depth / 2.0
        if width >= _SMALLEST_HOUSE and offset + depth / 2.0 + OVERHANG < reach:
            rotation = (90.0 if edge.sign > 0 else -90.0) + turn
            sizes = {"width": width, "depth": depth, "height": height, "roof_height": roof, "at_street": True}
            yield (
                f"house-{side}-{number}",
                Building(instance=1, kind=kind, rotation_deg=rotation, **edge.place(middle, offset), **sizes),
            )
        if distance >= _GARDEN:
            yield from _garden(edge, rng, plot, number, garden)
        car = pick(rng, _MODELS)
        if plot.drive is not None and chance < 0.5 and distance > 1.0:
            far = edge.behind + max(distance, 1.0) + VEHICLE_TYPES[car].length / 2.0
            fields = {"model": car, "color": _color(rng), "rotation_deg": pick(rng, (90.0, -90.0))}
            yield f"drive-{side}-{number}", ParkedVehicle(instance=1, **edge.place(plot.drive, far), **fields)


def _garden(
    edge: _StreetEdge, rng: np.random.Generator, plot: Plot, number: int, kind: str
) -> Iterator[tuple[str, RoadObject]]:
    """Yield what bounds a plot's front garden towards the street: a wall, a fence, a hedge, or nothing."""
    start = plot.start + (_DRIVE_ROOM - 0.4 if plot.drive is not None else 0.2)
    fields: dict[str, Any] = {"start_station": round_value(start), "end_station": round_value(plot.end - 0.2)}
    height, look = draw_between(rng, (0.6, 1.3)), pick(rng, ("plaster", "brick", "concrete"))
    seed = int(rng.integers(2**31))
    if plot.end - start < 4.0 or not kind:
        return
    name = f"garden-{edge.side}-{number}"
    if kind == "wall":
        offset = round_value(edge.sign * (edge.behind + 0.3))
        yield name, Wall(instance=1, offset=offset, kind=look, height=height, **fields)
    elif kind == "fence":
        offset = round_value(edge.sign * (edge.behind + 0.2))
        yield name, Fence(instance=1, offset=offset, kind="rails", height=height, post_spacing=2.0, **fields)
    else:
        offset = round_value(edge.sign * (edge.behind + 0.5))
        yield name, Hedge(instance=1, offset=offset, height=round_value(height + 0.3), width=0.8, seed=seed, **fields)


def _parked(edge: _StreetEdge, rng: np.random.Generator) -> Iterator[tuple[str, ParkedVehicle]]:
    """Yield the vehicles on the stands of the parking bays, which look with the traffic."""
    number = 0
    for bay in edge.street.bays:
        first = bay.start_station + bay.taper_length
        stands = round((bay.end_station - bay.taper_length - first) / STAND_LENGTH)
        for stand in range(stands):
            chance, model, color = rng.random(), pick(rng, _MODELS), _color(rng)
            room = (STAND_LENGTH - VEHICLE_TYPES[model].length) / 2.0 - _BETWEEN
            shift, aside = draw_between(rng, (-room, room)), draw_between(rng, (-0.08, 0.08))
            if chance >= edge.site.scenario.villages.occupied:
                continue
            number += 1
            pavement = edge.gutter - edge.street.gutter_width
            nearest = pavement + VEHICLE_TYPES[model].width / 2.0 + _BESIDE_LANE
            distance = max(edge.gutter + bay.width / 2.0 + aside, nearest)
            place = edge.place(first + (stand + 0.5) * STAND_LENGTH + shift, distance)
            turn = 0.0 if edge.traffic > 0 else 180.0
            vehicle = ParkedVehicle(instance=1, **place, rotation_deg=turn, model=model, color=color)
            yield f"stand-{edge.side}-{number}", vehicle


def _color(rng: np.random.Generator) -> tuple[float, float, float]:
    """Return the colour of a vehicle, as often as it occurs."""
    shares = np.array(list(COLORS.values()))
    return list(COLORS)[int(rng.choice(len(COLORS), p=shares / shares.sum()))]


def _signs(edge: _StreetEdge, rng: np.random.Generator) -> Iterator[tuple[str, TrafficSign]]:
    """Yield the signs on one side: where the town begins and ends, at the crossing, at the bus stop."""
    village, traffic = edge.village, edge.traffic
    begin, end = (village.start, village.end) if traffic > 0 else (village.end, village.start)
    towns = edge.site.guideline.destinations or sign_catalogue().destinations
    town, next_town = (pick(rng, towns) for _ in range(2))
    names = {"exit": town, "near": next_town}
    beside = edge.back + 0.9
    places: list[tuple[SignRole, float, float]] = [
        ("town_begin", begin - traffic * 1.0, beside),
        ("town_end", end + traffic * 1.0, beside),
    ]
    if village.crossing is not None:
        station = village.crossing - traffic * _BEFORE_CROSSING
        places.append(("crossing", station, edge.kerb_distance(station) + _SIGN_DISTANCE))
    if edge.side in village.stops:
        station = village.stops[edge.side] + traffic * 5.0
        places.append(("bus_stop", station, edge.kerb_distance(station) + _SIGN_DISTANCE))
    places.append(("town_speed", begin + traffic * _BEHIND_BEGIN, edge.back + _SPEED_SIGN))
    for number, (role, station, distance) in enumerate(places, 1):
        code = edge.site.guideline.sign_roles.get(role)
        if code is None:
            continue
        sign = sign_catalogue().signs[code]
        text = tuple(line.format(**{"number": "", "middle": "", "far": ""} | names) for line in sign.text)
        yield (
            f"village-sign-{edge.side}-{number}",
            TrafficSign(
                instance=1,
                rotation_deg=edge.facing,
                code=code,
                text=text,
                **edge.place(station, distance),
                **sign.fields(),
            ),
        )


def _speed_limit(edge: _StreetEdge) -> Iterator[tuple[str, TrafficSign]]:
    """Yield the sign for a slow village on one side, behind where it begins; none where its country has none."""
    site, village = edge.site, edge.village
    code = speed_limit_sign(site.guideline.country, _SLOW)
    if code is None or site.stream("village", "slow").random() >= site.scenario.villages.slow:
        return
    begin = village.start if edge.traffic > 0 else village.end
    place = edge.place(begin + edge.traffic * _BEHIND_BEGIN, edge.back + _SPEED_SIGN)
    yield (
        f"village-speed-{edge.side}",
        TrafficSign(instance=1, rotation_deg=edge.facing, **place, **country_sign_fields(code, {})),
    )


def _shelter(edge: _StreetEdge, rng: np.random.Generator) -> Iterator[tuple[str, BusShelter]]:
    """Yield the shelter of a side's bus stop, which stands behind the footway with its open side to the road."""
    station = edge.village.shelters.get(edge.side)
    if station is None:
        return
    kind = pick(rng, ("glass", "glass", "glass", "wood", "brick"))
    width, depth = draw_between(rng, _SHELTER_WIDTH), draw_between(rng, _SHELTER_DEPTH)
    fields = {"kind": kind, "width": width, "depth": depth, "height": draw_between(rng, _SHELTER_HEIGHT)}
    place = edge.place(station, edge.back + SHELTER_OVERHANG + depth / 2.0 + _BEHIND_FOOTWAY)
    rotation = 90.0 if edge.sign > 0 else -90.0
    yield f"shelter-{edge.side}", BusShelter(instance=1, rotation_deg=rotation, **place, **fields)


def _lights(edge: _StreetEdge, rng: np.random.Generator) -> Iterator[tuple[str, Pole]]:
    """Yield the street lights behind the footway of one side, beside drives."""
    limits, village = edge.site.scenario.villages, edge.village
    spacing, height = draw(rng, limits.light_spacing), draw(rng, limits.light_height)
    arm, first = pick(rng, _LIGHT_ARMS), village.start + 3.0
    places = np.arange(first, village.end - 3.0, spacing).tolist()
    if village.crossing is not None:  # it must be lit
        places = sorted([*(p for p in places if abs(p - village.crossing) > spacing / 2.0), village.crossing + 3.5])
    for number, station in enumerate(places, 1):
        taken = edge.no_lights.within(station - _LIGHT_ROOM, station + _LIGHT_ROOM)
        place = edge.place(
            max(end for _, end in taken) + _LIGHT_ROOM if taken else station, edge.back + _LIGHT_DISTANCE
        )
        fields = {"kind": "lighting", "height": height, "diameter": _LIGHT_DIAMETER, "arm_length": arm}
        yield (
            f"street-light-{number}",
            Pole(instance=1, rotation_deg=0.0 if edge.sign < 0 else 180.0, **place, **fields),
        )


def _covers(edge: _StreetEdge, rng: np.random.Generator) -> Iterator[tuple[str, Shaft]]:
    """Yield manholes in the lane and gullies in the gutter, flush with the surface."""
    village, lane = edge.village, edge.site.sections[edge.side].lane_boundaries([edge.village.start])[0]
    middle = float(lane[0] + lane[1]) / 2.0
    offset = middle + draw_between(rng, (-0.4, 0.4))
    start, end = village.start + 6.0, village.end - 6.0
    if edge.side == "right":
        for number, station in enumerate(np.arange(start + _MANHOLES_EVERY * rng.random(), end, _MANHOLES_EVERY), 1):
            fields = {"kind": "manhole", "size": _MANHOLE, "height": 0.0}
            yield f"manhole-{number}", Shaft(instance=1, **edge.place(float(station), offset), **fields)
    if edge.street.gutter_width >= _GULLY:
        distance = edge.gutter - edge.street.gutter_width / 2.0
        bays = Reservations((bay.start_station - _GULLY, bay.end_station + _GULLY) for bay in edge.street.bays)
        for number, station in enumerate(np.arange(start + _GULLIES_EVERY * rng.random(), end, _GULLIES_EVERY), 1):
            fields = {"kind": "inlet", "size": _GULLY, "height": 0.0}
            if not bays.is_free(float(station), float(station)):
                continue
            yield f"gully-{edge.side}-{number}", Shaft(instance=1, **edge.place(float(station), distance), **fields)
