"""Construction zones: beacons that close the outermost lane, movable barriers behind them, yellow lines before them."""

import math
from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ...base.arrays import Float
from ...base.schema import round_value
from ...road.guidelines import CONSTRUCTION_LANE_WIDTH
from ...road.objects import RoadObject, Side, SignedWidthPoint, width_kinks
from ...road.section import Carriageway, LineMarking
from ...road.things.beacon import ConstructionBeacon
from ...road.things.temporary_barrier import TemporaryBarrier
from .draw import draw, pick
from .layout import Layout, Roadside
from .ranges import Range, Reservations, draw_start, free_ranges

TAPERS_IN, TAPER_OUT = (60.0, 70.0, 80.0), 20.0
"""Lengths over which the lane is closed and opened again, m."""
SHORTEST_ALONG = 30.0
"""Shortest length between both tapers, m."""
SPACING, SPACING_TAPER = 16.0, 8.0
"""Largest spacing of beacons by stations, m: a little less than the limits, which hold on a curve's outer side too."""
BEACON_DISTANCE, LINE_DISTANCE, BARRIER_DISTANCE = 0.55, 0.2, 1.35
"""Into the closed lane, from its inner boundary to beacons, yellow line and movable barrier, m."""
EDGE_DISTANCE = 0.4
"""From the paved edge to the first and last beacon, m."""
LINE_WIDTH, FARTHEST_LINE = 0.15, 50.0
"""Width of the yellow line, and the distance from the centreline that a parameter set allows it, m."""
SHORTEST_TEMPORARY_BARRIER, BARRIER_SETBACK = 40.0, 10.0
"""Shortest movable barrier, and how far from the tapers it stands, m."""
_CLOSED_LANE = 2.0  # m; what is narrower is a lane that begins or ends
TURNOUT_ROOM = 20.0
"""Along the road between a construction zone and a turnout, m."""


class Zone(NamedTuple):
    """Stations and distances of a construction zone beside one carriageway.

    Attributes:
        stations: (4,) where its tapers begin and end, in the order of stations, m.
        boundary: distance of the closed lane's inner boundary from the centreline, m.
        edge: distance of the paved edge, m.
    """

    stations: tuple[float, float, float, float]
    boundary: float
    edge: float

    def distance(self, station: Float, depth: float) -> Float:
        """Return a line's distances (N,) from the centreline, ``depth`` (m) into the closed lane, and in the tapers."""
        outer_distance, inner_distance = self.edge - EDGE_DISTANCE - (BEACON_DISTANCE - depth), self.boundary + depth
        return np.interp(station, self.stations, (outer_distance, inner_distance, inner_distance, outer_distance))


def construction_zones(layout: Layout, rng: np.random.Generator) -> tuple[dict[Side, Range], dict[str, RoadObject]]:
    """Return the zones' (lowest, highest) stations, m, by carriageway, and what stands in them by id."""
    limits = layout.site.scenario.furniture
    zones: dict[Side, Range] = {}
    objects: dict[str, RoadObject] = {}
    for side, roadside in layout.sides.items():
        if rng.random() >= limits.construction_zone:
            continue
        zone = _draw_zone(layout, roadside, rng)
        if zone:
            zones[side] = zone.stations[0], zone.stations[3]
            objects |= dict(_equipment(layout, roadside, zone, rng))
    return zones, objects


def _draw_zone(layout: Layout, roadside: Roadside, rng: np.random.Generator) -> Zone | None:
    """Return a drawn zone where the carriageway is wide, has no turnouts and keeps its widths; None without room."""
    limits, length = layout.site.scenario.furniture.construction_length, roadside.length
    section = layout.site.sections[roadside.side]
    turnouts = ((start - TURNOUT_ROOM, end + TURNOUT_ROOM) for start, end in roadside.turnouts.stretches)
    free_stretches = free_ranges(0.0, length, Reservations(turnouts), Reservations(_width_changes(section.carriageway)))
    longest_stretch = max((end - start for start, end in free_stretches), default=0.0)
    least_length = max(TAPERS_IN[0] + SHORTEST_ALONG + TAPER_OUT, limits.minimum)
    largest_length = min(longest_stretch, limits.maximum)
    if largest_length < least_length:
        return None
    zone_length = round_value(least_length + (largest_length - least_length) * rng.random())
    start = draw_start(rng, free_stretches, zone_length)
    if start is None:
        return None
    boundaries = section.lane_boundaries(start + zone_length / 2.0)[0].tolist()
    widths = [outer - inner for outer, inner in pairwise(boundaries)]
    lane = next((i for i, width in enumerate(widths) if width >= _CLOSED_LANE), len(widths))
    edge = roadside.edge.largest_main(start, start)
    if max(widths[lane + 1 :], default=0.0) < CONSTRUCTION_LANE_WIDTH or edge > FARTHEST_LINE:
        return None
    taper = min(pick(rng, TAPERS_IN), zone_length - SHORTEST_ALONG - TAPER_OUT)
    tapers = (taper, TAPER_OUT) if roadside.traffic > 0 else (TAPER_OUT, taper)
    end = start + zone_length
    stations = (start, start + tapers[0], end - tapers[1], end)
    return Zone(stations, boundaries[lane + 1], edge)


def _width_changes(carriageway: Carriageway) -> Iterator[Range]:
    """Yield the stretches (m) along which a width of the carriageway changes."""
    widths = (carriageway.inner_offset, carriageway.inner_edge_strip_width, *(lane.width for lane in carriageway.lanes))
    for width in (*widths, carriageway.outer_edge_strip_width, carriageway.hard_shoulder_width):
        marks = width_kinks(width)
        if marks:
            yield min(marks), max(marks)


def _equipment(
    layout: Layout, roadside: Roadside, zone: Zone, rng: np.random.Generator
) -> Iterator[tuple[str, RoadObject]]:
    """Yield (id, object) of a zone's beacons, movable barrier and yellow line."""
    film_thickness = draw(rng, layout.site.scenario.markings.film_thickness)
    yield from zone_equipment(roadside.side, roadside.facing, zone, film_thickness)


def zone_equipment(side: Side, facing: float, zone: Zone, film_thickness: float) -> Iterator[tuple[str, RoadObject]]:
    """Yield (id, object) of a zone's beacons, movable barrier and yellow line, all with the instance number 1.

    Args:
        side: of the carriageway.
        facing: rotation (deg) of what faces its traffic.
        zone: where it is.
        film_thickness: of the line, m.
    """
    sign, marks = (1 if side == "left" else -1), zone.stations
    stations = _beacon_stations(marks)
    places = zip(stations.tolist(), zone.distance(stations, BEACON_DISTANCE).tolist(), strict=True)
    for number, (station, distance) in enumerate(places, start=1):
        beacon = ConstructionBeacon(
            instance=1,
            station=round_value(station),
            offset=round_value(sign * distance),
            rotation_deg=facing,
            pass_side="left" if sign < 0 else "right",
        )
        yield f"beacon-{side}-{number:03d}", beacon
    if marks[2] - marks[1] >= SHORTEST_TEMPORARY_BARRIER + 2.0 * BARRIER_SETBACK:
        offset = round_value(sign * (zone.boundary + BARRIER_DISTANCE))
        barrier_start, barrier_end = round_value(marks[1] + BARRIER_SETBACK), round_value(marks[2] - BARRIER_SETBACK)
        barrier = TemporaryBarrier(
            instance=1, start_station=barrier_start, end_station=barrier_end, offset=offset, end_offset=offset
        )
        yield f"temporary-barrier-{side}", barrier
    yield f"marking-construction-{side}", _line(side, zone, film_thickness)


def _beacon_stations(marks: tuple[float, float, float, float]) -> Float:
    """Return the stations (N,) of a zone's beacons, m, one at each end of the tapers."""
    spans = zip(pairwise(marks), (SPACING_TAPER, SPACING, SPACING_TAPER), strict=True)
    parts = [np.linspace(*span, math.ceil((span[1] - span[0]) / step), endpoint=False) for span, step in spans]
    return np.append(np.concatenate(parts), marks[3])


def _line(side: Side, zone: Zone, film_thickness: float) -> LineMarking:
    """Return the yellow line marking along a zone's beacons."""
    distances = zone.distance(np.array(zone.stations), LINE_DISTANCE).tolist()
    places = zip(zone.stations, distances, strict=True)
    points = [SignedWidthPoint(station=round_value(station), width=round_value(width)) for station, width in places]
    return LineMarking(
        instance=1,
        carriageway=f"carriageway-{side}",
        kind="free",
        offset=tuple(points),
        width=LINE_WIDTH,
        color="yellow",
        film_thickness=film_thickness,
        dash_length=0.0,
        gap_length=0.0,
        start_station=points[0].station,
        end_station=points[-1].station,
    )
