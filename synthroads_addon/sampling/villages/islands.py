"""Traffic islands where villages begin: lanes moved outwards, the island with its signs, the lines around it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ...base.schema import round_value
from ...road.objects import RoadObject, Side, SignedWidthPoint, WidthPoint
from ...road.section import Carriageway, LineMarking
from ...road.section_geometry import CarriagewaySection
from ...road.things.sign import TrafficSign
from ...road.things.sign_catalogue import sign_catalogue
from ...road.things.traffic_island import TrafficIsland
from ..overtaking_lanes import area_stripes
from ..placing.draw import pick
from ..placing.site import PlacementSite
from ..placing.village_plan import EntranceIsland, Village

_SIGN_FROM_NOSE = 0.9  # m, from the island's end to its sign
_LINES_APART = 0.03
"""Gap between the two lines where they begin beside each other, m. Chosen."""
_NARROWEST_BAR = 0.5
"""Width of the strip between the directions from which on there are stripes before an island, m. Chosen."""
_KERBS = ("granite", "concrete")
_SURFACES = ("setts", "setts", "concrete_pavers", "asphalt")


def widen_at_islands(villages: tuple[Village, ...], carriageways: dict[Side, Carriageway]) -> dict[Side, Carriageway]:
    """Return the carriageways with strips between the directions where their villages have traffic islands."""
    islands = [island for village in villages for island in village.islands]
    result = dict(carriageways)
    for side, carriageway in carriageways.items():
        points: list[WidthPoint] = []
        for island in sorted(islands, key=lambda item: item.start):
            widths = (0.0, island.shifts[side], island.shifts[side], 0.0)
            stations = (island.start, island.first, island.last, island.end)
            points += [WidthPoint(station=s, width=w) for s, w in zip(stations, widths, strict=True)]
        if any(point.width for point in points):
            result[side] = carriageway.model_copy(update={"inner_edge_strip_width": tuple(points)})
    return result


def islands_of(site: PlacementSite) -> Iterator[tuple[Village, EntranceIsland]]:
    """Yield the traffic islands of a road, each with its village."""
    yield from ((village, island) for village in site.villages for island in village.islands)


def place_islands(site: PlacementSite) -> Iterator[tuple[str, RoadObject]]:
    """Yield (id, object) of the traffic islands and of the signs on both ends of each; all are of instance 1."""
    alignment = site.geometry.alignment
    code = site.guideline.sign_roles["island"] if any(islands_of(site)) else ""
    for number, (village, island) in enumerate(islands_of(site), 1):
        rng = site.stream("village", "island", number)
        left, right = (island.shifts.get(side, 0.0) for side in ("left", "right"))
        street = next(iter(village.streets.values()))
        station, offset = (island.first + island.last) / 2.0, round_value((left - right) / 2.0)
        body = TrafficIsland(
            instance=1,
            station=round_value(station),
            offset=offset,
            length=island.length,
            width=island.width,
            kerb_height=street.kerb_height,
            kerb_material=pick(rng, _KERBS),
            surface=pick(rng, _SURFACES),
            curvature=round_value(float(alignment.curvature(np.array([station]))[0]), 9),
        )
        yield f"island-{number}", body
        sign = sign_catalogue().signs[code]
        for end, carriageway in enumerate(site.carriageways.values(), 1):
            place = station - carriageway.traffic * (island.length / 2.0 - _SIGN_FROM_NOSE)
            yield (
                f"island-{number}-sign-{end}",
                TrafficSign(
                    instance=1,
                    station=round_value(place),
                    offset=offset,
                    elevation=body.kerb_height,
                    rotation_deg=0.0 if carriageway.traffic > 0 else 180.0,
                    code=code,
                    text=sign.text,
                    **sign.fields(),
                ),
            )


def line_gaps(site: PlacementSite, line_width: float) -> Iterator[tuple[float, float]]:
    """Yield the stations (m) between which lines of a width (m) beside an island take the place of the middle one.

    They begin where the strip between the directions has room for both.
    """
    least = line_width + _LINES_APART
    for _, island in islands_of(site):
        share = min(least / sum(island.shifts.values()), 1.0)
        yield (
            round_value(island.start + share * (island.first - island.start)),
            round_value(island.end - share * (island.end - island.last)),
        )


def island_markings(site: PlacementSite, line_width: float, film: float) -> Iterator[tuple[str, LineMarking]]:
    """Yield (id, marking) of the lines and the stripes around islands, of a width and films of a thickness (m)."""
    colour = site.guideline.centre_line_color
    for number, ((_, island), (start, end)) in enumerate(
        zip(islands_of(site), line_gaps(site, line_width), strict=True), 1
    ):
        for side, carriageway in site.carriageways.items():
            shift, name = island.shifts[side], f"carriageway-{side}"
            marks = [start, island.first, island.last, end]
            widths = np.interp(marks, [island.start, island.first, island.last, island.end], [0.0, shift, shift, 0.0])
            base: dict[str, Any] = {"instance": 1, "carriageway": name, "kind": "free", "film_thickness": film}
            base |= {"dash_length": 0.0, "gap_length": 0.0, "color": colour}
            offset = _points(marks, widths.tolist()) if shift else 0.0
            yield (
                f"island-{number}-line-{side}",
                LineMarking(**base, offset=offset, width=line_width, start_station=start, end_station=end),
            )
            middle, half = (island.first + island.last) / 2.0, island.length / 2.0
            stretches = [(island.start, middle - half), (middle + half, island.end)]
            stripes = area_stripes(carriageway, CarriagewaySection(carriageway), stretches, _NARROWEST_BAR)
            for stripe_number, stripe in enumerate(stripes, 1):
                yield (
                    f"island-{number}-stripe-{side}-{stripe_number}",
                    LineMarking(
                        **base,
                        offset=_points(stripe.stations, stripe.distances),
                        width=stripe.width,
                        start_station=stripe.stations[0],
                        end_station=stripe.stations[1],
                    ),
                )


def _points(stations: Any, widths: Any) -> tuple[SignedWidthPoint, ...]:
    """Return distances (m) at stations (m) as points of an offset."""
    return tuple(SignedWidthPoint(station=s, width=round_value(w)) for s, w in zip(stations, widths, strict=True))
