"""Forest edges beside a sampled road: a mantle of shrubs along the front, and a closed stand of trees behind it."""

from __future__ import annotations

from collections.abc import Iterator

from ..base.schema import round_value
from ..road.objects import Side
from ..road.surroundings import Vegetation
from .placing.draw import draw, draw_between, pick
from .placing.ranges import Reservations, draw_start, free_ranges
from .placing.site import PlacementSite

MANTLE = 4.0
"""Width of the mantle of shrubs, m."""
NEAREST = 8.0
"""From the verge to a forest's edge, m at least."""
STAND_BACK = 12.0
"""Farther than the nearest that it may lie back, m at most."""
SHALLOWEST = 5.0
"""Depth of ground that is needed for a forest, m at least."""
TREES, SHRUBS = 0.035, 0.12
"""Plants of stand and mantle for each m2."""
_GAP = 15.0  # m along the road between two forests


def sample_forest_edges(site: PlacementSite, room: float, first_tree: float) -> Iterator[tuple[str, Vegetation]]:
    """Yield (id, stand) of the mantle and of the trees of each forest edge; their instance numbers are 1.

    Args:
        site: the road.
        room: width of ground behind the verge, m.
        first_tree: distance from the verge from which on trees may stand, m.
    """
    for side in site.sections:
        yield from _beside(site, side, room, max(NEAREST, first_tree))


def _beside(site: PlacementSite, side: Side, room: float, nearest_distance: float) -> Iterator[tuple[str, Vegetation]]:
    """Yield (id, stand) of the forest edges on one side: for each the shrubs of its mantle, then its trees.

    All numbers of an edge are drawn before it is known whether there is room, so that one edge more or less doesn't
    change the others.
    """
    limits, rng = site.scenario.vegetation, site.stream("forest edges", side)
    taken_stretches, number = Reservations(), 0
    for _ in range(int(draw(rng, limits.forest_edges_per_km) * site.length / 1000.0 + rng.random())):
        length, depth = draw(rng, limits.forest_edge_length), draw(rng, limits.forest_depth)
        begin = nearest_distance + draw_between(rng, (0.0, STAND_BACK))
        least_height, largest_height = sorted((draw(rng, limits.forest_height), draw(rng, limits.forest_height)))
        tree, shrub = pick(rng, limits.trees), pick(rng, limits.shrubs)
        seeds = rng.integers(2**31, size=2).tolist()
        length = min(length, site.length)
        start = draw_start(rng, free_ranges(0.0, site.length, taken_stretches), length)
        end = round_value(min(begin + depth, room))
        if start is None or end - begin < SHALLOWEST:
            continue
        number += 1
        taken_stretches.add(start - _GAP, start + length + _GAP)
        stretch_fields = {"side": side, "start_station": round_value(start), "end_station": round_value(start + length)}
        mantle_start, stand_start = round_value(begin), round_value(begin + MANTLE / 2.0)
        yield (
            f"forest-{side}-{number}-{shrub}",
            Vegetation(
                instance=1,
                kind="shrub",
                species=shrub,
                density=SHRUBS,
                band_start=mantle_start,
                band_end=round_value(begin + MANTLE),
                height_min=1.0,
                height_max=3.5,
                seed=seeds[0],
                **stretch_fields,
            ),
        )
        yield (
            f"forest-{side}-{number}-{tree}",
            Vegetation(
                instance=1,
                kind="tree",
                species=tree,
                density=TREES,
                band_start=stand_start,
                band_end=end,
                height_min=least_height,
                height_max=largest_height,
                seed=seeds[1],
                **stretch_fields,
            ),
        )
