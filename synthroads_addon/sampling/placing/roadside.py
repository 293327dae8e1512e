"""Fences, hedges, buildings with their yards, and power lines: what lies behind the roadside that rules ask for.

They stand in zones of their own, one behind the other: hedges, then fences, then, from 40 m off the pavement, where
the law allows buildings beside a motorway, yards with buildings, walls and parked vehicles. In each zone free stretches
of road are drawn from, so that nothing stands in another's place.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any, Literal

import numpy as np

from ...base.schema import round_value
from ...road.objects import RoadObject, Side, nominal_width
from ...road.side_roads.mouth import Mouth
from ...road.things.building import OVERHANG, Building
from ...road.things.fence import Fence
from ...road.things.hedge import Hedge
from ...road.things.overpass import Overpass
from ...road.things.parked_vehicle import ParkedVehicle
from ...road.things.power_line import PowerLine
from ...road.things.thing import Thing
from ...road.things.vehicles import COLORS, VEHICLE_TYPES
from ...road.things.wall import Wall
from .draw import draw, draw_between, pick
from .ranges import Range, Reservations, draw_start, free_ranges
from .site import PlacementSite

HEDGE_DISTANCE, FENCE_ZONE = 3.5, (7.5, 11.0)
"""Usual distance of a hedge's face, and distances of the axes of fences, from the verge's outer edge, m."""
BUILDING_DISTANCE = 40.0
"""From the pavement to buildings, m at least: FStrG, section 9."""
FARTHEST = 100.0
"""From the centreline to what stands at one place, m at most."""
_TURNOUT = 35.0  # m along the road beyond a turnout: its verge comes back to its place over 30 m
_SMALLEST = 5.0  # m, of a building's width and depth
_GAP = 2.0  # m along the road between what stands in one zone
_YARD = 5.0  # m before a building, for parked vehicles and a wall
_LONGEST_FENCE = 1000.0  # m from one gate to the next
_GATE = 6.0  # m
_EMBANKMENT = 8.0  # m of height that a bridge's embankment has, at most
_BUILDINGS: dict[str, tuple[tuple[float, float], tuple[float, float], tuple[float, float], tuple[float, float]]] = {
    "house": ((8.0, 13.0), (7.5, 10.0), (3.2, 6.2), (2.8, 4.8)),
    "brick_house": ((8.0, 14.0), (7.5, 10.0), (3.2, 6.2), (2.8, 4.8)),
    "barn": ((12.0, 22.0), (8.0, 11.0), (3.8, 5.2), (2.8, 4.5)),
    "hall": ((16.0, 30.0), (9.0, 12.0), (5.0, 7.5), (0.6, 1.2)),
}
"""Kind of building -> limits of its width, depth, height and roof's height, m."""
_FENCES: tuple[Literal["wildlife", "rails"], ...] = (*("wildlife",) * 6, "rails")
"""Kinds of fences as often as they occur."""
_MODELS = {
    "house": ("car", "estate", "car", "estate", "motorcycle"),
    "brick_house": ("car", "estate"),
    "barn": ("van", "estate", "truck"),
    "hall": ("car", "van", "truck", "semitrailer", "bus"),
}
_PYLON_DISTANCES = (90.0, 190.0)  # m from the axis


def place_roadside(site: PlacementSite, objects: Mapping[str, RoadObject]) -> Iterator[tuple[str, RoadObject]]:
    """Yield (id, object) of fences, hedges, buildings, walls, parked vehicles and a power line; all are of instance 1.

    Args:
        site: the road.
        objects: what stands on and beside it already.
    """
    crossing = Reservations(_crossings(site, objects))
    power_line = _power_line(site, objects)
    if power_line:
        yield "power-line", power_line
    for side in site.sections:
        zones = _Zones(site, side, objects, crossing, power_line)
        yield from _hedges(zones, site.stream("roadside", "hedges", side))
        yield from _fences(zones, site.stream("roadside", "fences", side))
        yield from _yards(zones, site.stream("roadside", "buildings", side))


class _Zones:
    """The ground beside one carriageway, from the verge's edge to the terrain's end; none beside turnouts.

    Attributes:
        site, side: the road, and the carriageway's side.
        sign: of offsets there.
        paved, edge: largest distance of pavement and verge from the centreline where there is no turnout, m.
        reach: distance up to which something may stand, m.
    """

    def __init__(
        self,
        site: PlacementSite,
        side: Side,
        objects: Mapping[str, RoadObject],
        crossing: Reservations,
        power_line: PowerLine | None,
    ) -> None:
        section = site.sections[side]
        marks = np.unique([0.0, site.length, *section.kinks()])
        self.site, self.side = site, side
        self.sign = section.carriageway.sign
        self.paved = float(section.main_edge(marks).max())
        self.edge = self.paved + nominal_width(section.carriageway.verge_width)
        self.reach = min(site.terrain.half_width, FARTHEST) - 1.0
        things = [*objects.values(), *([power_line] if power_line else [])]
        self._blocks = [block for item in things if isinstance(item, Thing) for block in item.footprint()]
        turnouts = (shape.range() for shape in section.turnouts)
        mouths = [_side_road_stretch(mouth, self.reach) for mouth in site.mouths_of(side)]
        self._crossing = Reservations(
            [
                *crossing.stretches,
                *((a - _TURNOUT, b + _TURNOUT) for a, b in turnouts),
                *mouths,
                *site.bridged,
                *site.tunnelled,
                *_interchanges(site),
            ]
        )

    def free(self, nearest: float, farthest: float) -> list[Range]:
        """Return the stretches of road (m) on which nothing stands between two distances (m) from the centreline."""
        lowest_offset, highest_offset = sorted((self.sign * nearest, self.sign * farthest))
        taken_stretches = [
            (b.start - _GAP, b.end + _GAP) for b in self._blocks if b.low < highest_offset and b.high > lowest_offset
        ]
        return free_ranges(0.0, self.site.length, self._crossing, Reservations(taken_stretches))

    def count(self, per_km: float, rng: np.random.Generator) -> int:
        """Return a number of things along the road, from their number per km."""
        return int(per_km * self.site.length / 1000.0 + rng.random())


def _interchanges(site: PlacementSite) -> list[Range]:
    """Return the stretch of road (m) beside which an interchange's ramps lie, if there is one."""
    stretch = site.interchange_stretch
    return [] if stretch is None else [(stretch[0] - _TURNOUT, stretch[1] + _TURNOUT)]


def _side_road_stretch(mouth: Mouth, reach: float) -> Range:
    """Return the stretch of road (m) that a side road takes up to a distance (m) from the centreline."""
    slant = reach * abs(math.tan(math.radians(mouth.side_road.angle_deg - 90.0)))
    return mouth.low.start_station - _GAP - slant, mouth.high.start_station + _GAP + slant


def _crossings(site: PlacementSite, objects: Mapping[str, RoadObject], distance: float = FARTHEST) -> Iterator[Range]:
    """Yield the stretches of road that the embankments of bridges take up to a distance (m) from the centreline."""
    for item in objects.values():
        if isinstance(item, Overpass):
            skew = math.radians(item.rotation_deg)
            half_width = item.width / 2.0 + _EMBANKMENT * site.terrain.batter_slope
            half_length = half_width / math.cos(skew) + distance * abs(math.tan(skew))
            yield item.station - half_length, item.station + half_length


def _power_line(site: PlacementSite, objects: Mapping[str, RoadObject]) -> PowerLine | None:
    """Return the drawn power line across the road, or None; its pylons stand clear of everything else."""
    limits, rng = site.scenario.roadside, site.stream("roadside", "power line")
    height = draw(rng, limits.pylon_height)
    left_distance, right_distance = draw_between(rng, _PYLON_DISTANCES), draw_between(rng, _PYLON_DISTANCES)
    turn, sag, chance = draw_between(rng, (-25.0, 25.0)), draw_between(rng, (3.0, 7.0)), rng.random()
    line = PowerLine(
        instance=1,
        station=0.0,
        offset=0.0,
        rotation_deg=turn,
        left_distance=left_distance,
        right_distance=right_distance,
        height=height,
        sag=round_value(min(sag, 0.2 * height)),
    )
    reservations = Reservations(_crossings(site, objects))
    for pylon in line.footprint():
        for crossing_start, crossing_end in _crossings(site, objects, _PYLON_DISTANCES[1]):
            reservations.add(crossing_start - pylon.end, crossing_end - pylon.start)
    start = draw_start(rng, free_ranges(0.0, site.length, reservations), 10.0)
    if chance >= limits.power_line or start is None:
        return None
    return line.model_copy(update={"station": round_value(start + 5.0)})


def _hedges(zones: _Zones, rng: np.random.Generator) -> Iterator[tuple[str, Hedge]]:
    """Yield (id, hedge) of one side's hedges; all numbers of a hedge are drawn, also where it finds no room."""
    limits, number = zones.site.scenario.roadside, 0
    reservations = Reservations()
    for _ in range(zones.count(draw(rng, limits.hedges_per_km), rng)):
        length, height, width = (draw(rng, getattr(limits, f"hedge_{name}")) for name in ("length", "height", "width"))
        distance = zones.edge + draw(rng, limits.hedge_distance) + width / 2.0
        nearest, farthest = distance - width / 2.0 - 0.5, distance + width / 2.0 + 0.5
        ranges = [r for start, end in zones.free(nearest, farthest) for r in free_ranges(start, end, reservations)]
        start, seed = draw_start(rng, ranges, length), int(rng.integers(2**31))
        if start is None or farthest > zones.reach:
            continue
        number += 1
        reservations.add(start - _GAP, start + length + _GAP)
        hedge = Hedge(
            instance=1,
            start_station=round_value(start),
            end_station=round_value(start + length),
            offset=round_value(zones.sign * distance),
            height=height,
            width=width,
            seed=seed,
        )
        yield f"hedge-{zones.side}-{number}", hedge


def _fences(zones: _Zones, rng: np.random.Generator) -> Iterator[tuple[str, Fence]]:
    """Yield the fence all along the side, with gaps where something is in its way."""
    limits = zones.site.scenario.roadside
    height, distance = draw(rng, limits.fence_height), zones.edge + draw_between(rng, FENCE_ZONE)
    # Behind hedges, however wide they are.
    distance += limits.hedge_width.maximum if limits.hedges_per_km.maximum > 0.0 else 0.0
    spacing, kind, is_present = pick(rng, (4.0, 5.0, 6.0)), pick(rng, _FENCES), rng.random() < limits.fences
    if not is_present or distance + 1.0 > zones.reach:
        return
    number = 0
    for start, end in zones.free(distance - 0.5, distance + 0.5):
        for piece in np.arange(start, end, _LONGEST_FENCE).tolist():
            piece_end = min(piece + _LONGEST_FENCE - _GATE, end)
            if piece_end - piece < spacing:
                continue
            number += 1
            fence = Fence(
                instance=1,
                start_station=round_value(piece),
                end_station=round_value(piece_end),
                offset=round_value(zones.sign * distance),
                kind=kind,
                height=height,
                post_spacing=spacing,
            )
            yield f"fence-{zones.side}-{number}", fence


def _yards(zones: _Zones, rng: np.random.Generator) -> Iterator[tuple[str, RoadObject]]:
    """Yield buildings, each with its wall and the vehicles parked before it."""
    limits = zones.site.scenario.roadside
    nearest_distance = max(
        zones.paved + BUILDING_DISTANCE, zones.edge + FENCE_ZONE[1] + limits.hedge_width.maximum + 2.0
    )
    reservations, number = Reservations(), 0
    for _ in range(zones.count(draw(rng, limits.buildings_per_km), rng)):
        kind = pick(rng, list(_BUILDINGS))
        width, depth, height, roof = (draw_between(rng, sizes) for sizes in _BUILDINGS[kind])
        turn = draw_between(rng, (-12.0, 12.0)) + pick(rng, (90.0, 0.0))
        width, depth = _fit(width, depth, zones.reach - nearest_distance - _YARD)
        plot_radius = math.hypot(width, depth) / 2.0 + OVERHANG
        parked_count, has_wall = draw(rng, limits.parked_per_building), rng.random() < limits.walls
        wall_height, wall_kind = draw(rng, limits.wall_height), pick(rng, ("plaster", "brick", "concrete"))
        nearest, farthest = nearest_distance, nearest_distance + _YARD + 2.0 * plot_radius
        ranges = [r for start, end in zones.free(nearest, farthest) for r in free_ranges(start, end, reservations)]
        start = draw_start(rng, ranges, 2.0 * plot_radius)
        if start is None or min(width, depth) < _SMALLEST:
            continue
        number += 1
        reservations.add(start - 4.0 * _GAP, start + 2.0 * plot_radius + 4.0 * _GAP)
        facing = 90.0 if zones.sign > 0 else -90.0
        middle, distance = start + plot_radius, nearest_distance + _YARD + plot_radius
        building = {"kind": kind, "width": width, "depth": depth, "height": height, "roof_height": roof}
        yield (
            f"building-{zones.side}-{number}",
            Building(
                instance=1,
                station=round_value(middle),
                offset=round_value(zones.sign * distance),
                rotation_deg=round_value((facing + turn + 180.0) % 360.0 - 180.0),
                **building,
            ),
        )
        if has_wall:
            span = (start, start + 2.0 * plot_radius)
            fields: dict[str, Any] = {"kind": wall_kind, "height": wall_height}
            yield f"wall-{zones.side}-{number}", _wall(span, zones.sign * (nearest_distance + 0.5), fields)
        for place, vehicle in enumerate(
            _parked(rng, zones, (start, 2.0 * plot_radius), nearest_distance + _YARD - 2.0, kind, parked_count), 1
        ):
            yield f"parked-{zones.side}-{number}-{place}", vehicle


def _fit(width: float, depth: float, room: float) -> tuple[float, float]:
    """Return a building's width and depth (m), smaller where its plot, however it is turned, exceeds the room (m)."""
    share = min(1.0, (room / 2.0 - OVERHANG - 0.1) / (math.hypot(width, depth) / 2.0))
    return round_value(width * share), round_value(depth * share)


def _wall(span: Range, offset: float, fields: Mapping[str, Any]) -> Wall:
    """Return a wall along a range of stations, with rounded lengths."""
    return Wall(
        instance=1,
        start_station=round_value(span[0]),
        end_station=round_value(span[1]),
        offset=round_value(offset),
        **fields,
    )


def _parked(
    rng: np.random.Generator, zones: _Zones, plot: tuple[float, float], distance: float, kind: str, mean_count: float
) -> Iterator[ParkedVehicle]:
    """Yield vehicles in a row along the road before a building, as many as were drawn and as there is room for."""
    shares = np.array(list(COLORS.values()))
    position, end = plot[0], plot[0] + plot[1]
    for _ in range(int(mean_count + rng.random())):
        model = pick(rng, _MODELS[kind])
        color = list(COLORS)[int(rng.choice(len(COLORS), p=shares / shares.sum()))]
        length, turn = VEHICLE_TYPES[model].length, pick(rng, (0.0, 180.0))
        gap = draw_between(rng, (0.8, 2.5))
        if position + gap + length > end:
            return
        yield ParkedVehicle(
            instance=1,
            station=round_value(position + gap + length / 2.0),
            offset=round_value(zones.sign * distance),
            rotation_deg=turn,
            model=model,
            color=color,
        )
        position += gap + length
