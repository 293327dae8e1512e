"""Drainage: gutters in the median where a carriageway falls towards it, and shafts beside the road (RAS-Ew, REwS)."""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from ...base.schema import round_value
from ...road.objects import width_at
from ...road.section import Carriageway
from ...road.things.gutter import Gutter
from ...road.things.shaft import Shaft
from .draw import draw
from .layout import FAR_ZONE, SMALL_ZONE, Layout, PlacementRequest, Roadside
from .ranges import Range, Reservations, free_ranges, nearest_free
from .registry import small_thing

GUTTER = 0.4
"""Width of gutters, m."""
_SHORTEST = 20.0
"""Least length of a gutter, m."""
_HALF, _ROOM = 0.5, 10.0
"""Room of a shaft to either side along the road, and how far it may be moved for what stands there, m."""
_DEEP = -1.0
"""Mean height of the road above the ground, m, up to which its shafts lie in the swale."""


@small_thing("drainage")
def plan_shafts(layout: Layout, rng: np.random.Generator) -> None:
    """Put shafts at even distances beside the road: inlets in the swale of a cutting, else manholes."""
    furniture, terrain = layout.site.scenario.furniture, layout.site.terrain
    if not furniture.shafts:
        return
    swale = terrain.swale_width if terrain.embankment_height <= _DEEP else 0.0
    for roadside in layout.sides.values():
        spacing, size = draw(rng, furniture.shaft_spacing), draw(rng, furniture.shaft_size)
        for multiple in np.arange(spacing * rng.random(), layout.length, spacing).tolist():
            station = nearest_free(multiple, _HALF, _ROOM, layout.length, roadside.near, roadside.turnouts)
            if station is not None:
                roadside.put(_shaft(layout, roadside, round_value(station), size, swale))


def _shaft(layout: Layout, roadside: Roadside, station: float, size: float, swale: float) -> PlacementRequest:
    """Return the request of a shaft of a size beside a road with a swale of a width (all m), 0 for none."""
    shaft = Shaft(instance=1, station=station, offset=0.0, kind="inlet" if swale else "manhole", size=size)
    (block,) = shaft.footprint()
    room = block.high - block.low
    verge = width_at(layout.site.carriageways[roadside.side].verge_width, station)
    # To the middle of the swale, or behind a barrier that stands where that would be.
    shift = max(0.0, float(verge) + swale / 2.0 - SMALL_ZONE - room / 2.0) if swale else 0.0
    if not roadside.far.is_free(station - _HALF, station + _HALF):
        # A noise barrier stands in the swale's far part.
        shift = min(shift, max(0.0, FAR_ZONE - SMALL_ZONE - room))
    fields = {"kind": shaft.kind, "size": size}
    return PlacementRequest("shaft", Shaft, station, _HALF, room, fields, shift)


def gutters(layout: Layout) -> Iterator[tuple[str, Gutter]]:
    """Yield (id, gutter) beside the inner edges of carriageways where they fall towards the median."""
    if not layout.site.scenario.furniture.gutters or len(layout.sides) < 2:
        return
    for side, carriageway in layout.site.carriageways.items():
        inner_offset = carriageway.inner_offset
        if isinstance(inner_offset, tuple) or inner_offset < GUTTER:
            continue
        # On bridges and in tunnels the median has a cap.
        structures = Reservations([*layout.site.bridged, *layout.site.tunnelled])
        stretches = [
            span
            for stretch in inward_stretches(carriageway, layout.length)
            for span in free_ranges(*stretch, structures)
            if span[1] - span[0] >= _SHORTEST
        ]
        for number, (start, end) in enumerate(stretches, 1):
            yield (
                f"gutter-{side}-{number}",
                Gutter(
                    instance=1,
                    start_station=start,
                    end_station=end,
                    offset=round_value(carriageway.sign * (inner_offset - GUTTER / 2.0)),
                    kerb_side="right" if side == "left" else "left",
                    width=GUTTER,
                ),
            )


def inward_stretches(carriageway: Carriageway, length: float) -> list[Range]:
    """Return the stretches (m) of a road of a length (m) on which a carriageway falls towards the median."""
    points = [(point.station, carriageway.sign * point.crossfall_percent) for point in carriageway.crossfall]
    points = [(min(0.0, points[0][0]), points[0][1]), *points, (max(length, points[-1][0]), points[-1][1])]
    stretches: list[Range] = []
    for (s0, fall_0), (s1, fall_1) in pairwise(points):
        if max(fall_0, fall_1) <= 0.0 or s1 <= s0:
            continue
        # Where it passes through 0 between them.
        start = s0 if fall_0 > 0.0 else s0 + (s1 - s0) * -fall_0 / (fall_1 - fall_0)
        end = s1 if fall_1 > 0.0 else s0 + (s1 - s0) * fall_0 / (fall_0 - fall_1)
        start, end = round_value(max(start, 0.0)), round_value(min(end, length))
        if stretches and start <= stretches[-1][1]:
            stretches[-1] = stretches[-1][0], end
        elif end > start:
            stretches.append((start, end))
    return stretches
