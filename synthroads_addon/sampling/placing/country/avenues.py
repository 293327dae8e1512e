"""Avenues: trees in rows along a road's sides, behind a barrier, or older than the rules that ask for one."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ....base.schema import round_value
from ....road.things.tree import Tree
from ..draw import draw, draw_between, pick
from ..layout import SIGNPOST, Layout, Roadside
from ..ranges import Range, Reservations, draw_start

_MEASURES = {"maple": 0.35, "birch": 0.28, "poplar": 0.14, "spruce": 0.2, "pine": 0.25}
"""Species -> radius of a usual crown for a tree of height 1. Chosen near `presets/plants.json`."""
_BROADLEAVED = ("maple", "maple", "maple", "birch", "poplar")
"""Species as often as they are planted in avenues. Chosen."""
_BESIDE = 1.5
"""Distance along the road that trunks keep from other things, m. Chosen."""
_BESIDE_TURNOUT = 15.0
"""Distance that they keep from turnouts, m. Chosen: drivers who leave see past them."""
_BOTTOM, _LOWEST_CROWN = (0.22, 0.34), 4.6
"""Height of the crown's begin as a share of the tree's, and at least where it reaches over the road, m. Chosen."""
_OVER_ROAD = 1.3
"""From the pavement to where a crown reaches over the road, m: a little more than the limit."""
_WIDTHS = (0.85, 1.15)
"""Limits of a crown's width for its height, of the species' usual one. Chosen."""
_JITTER = 0.6
"""Distance, m, that a tree stands off its place in the row, at most. Chosen."""
_SHORTEST = 40.0
"""Shortest avenue, m. Chosen: some trees, or it is none."""
_LOWEST, _HIGHEST = 0.85, 1.1
"""Limits of a tree's height, of its avenue's. Chosen."""
_STEMS = (0.75, 1.2)
"""Limits of a trunk's diameter, of its avenue's. Chosen."""


@dataclass(frozen=True)
class AvenueRow:
    """The trees of one side of an avenue.

    Attributes:
        roadside: where it stands.
        items: its trees with the stations and distances that they have.
    """

    roadside: Roadside
    items: list[Tree]

    def trees(self) -> Iterator[tuple[str, Tree]]:
        """Yield (id, tree) of those in no entrance's, signpost's or barrier's place; all are of instance 1."""
        number = 0
        signposts = Reservations(
            (request.station - request.half, request.station + request.half)
            for request in self.roadside.requests
            if request.name == SIGNPOST
        )
        for tree in self.items:
            reach = tree.trunk_diameter / 2.0 + _BESIDE
            is_free = not any(
                start < tree.station + reach and end > tree.station - reach for start, end in self.roadside.openings
            )
            trunk = tree.trunk_diameter / 2.0
            is_free = is_free and signposts.is_free(tree.station - trunk, tree.station + trunk)
            # Along a taper a barrier stands straight, farther from the pavement than beside its widest part.
            if is_free and self.roadside.is_behind_barriers(tree.station, trunk, abs(tree.offset) - trunk):
                number += 1
                yield f"avenue-{self.roadside.side}-{number:03d}", tree


def plan_avenues(layout: Layout) -> list[AvenueRow]:
    """Return the rows of the drawn avenue, if there is one, and ask for barriers before those that need them."""
    limits, rng = layout.site.scenario.roadside, layout.site.stream("roadside", "avenue")
    if limits.avenues <= 0.0 or rng.random() >= limits.avenues:
        return []
    length = draw(rng, limits.avenue_length)
    start = draw_start(rng, [(0.0, layout.length)], min(length, layout.length)) or 0.0
    span = start, min(start + length, layout.length)
    sides = list(layout.sides.values())
    if rng.random() >= limits.both_sides:
        sides = [pick(rng, sides)]
    spacing, species = draw(rng, limits.avenue_spacing), pick(rng, _BROADLEAVED)
    measures = draw(rng, limits.avenue_distance), draw(rng, limits.avenue_height), draw(rng, limits.avenue_trunk)
    gaps, is_stock = draw(rng, limits.avenue_gaps), rng.random() < limits.avenue_unprotected
    rows = []
    for roadside in sides:
        seeds = layout.site.stream("roadside", "avenue", roadside.side)
        trees = list(_row(layout, roadside, span, seeds, (spacing, gaps), species, measures, is_stock))
        if not trees:
            continue
        rows.append(AvenueRow(roadside, trees))
        if not is_stock and measures[0] < layout.site.limits.obstacle_distance:
            roadside.protect(trees[0].station, trees[-1].station)
    return rows


def _row(
    layout: Layout,
    roadside: Roadside,
    span: Range,
    rng: np.random.Generator,
    places: tuple[float, float],
    species: str,
    measures: tuple[float, float, float],
    is_stock: bool,
) -> Iterator[Tree]:
    """Yield the trees of one side in order; all numbers of a tree are drawn, also where it was felled.

    Args:
        layout: what stands on the road.
        roadside: the side.
        span: stations of the avenue's ends, m.
        rng: its random numbers.
        places: distance of two trees, m, and share of those that were felled.
        species: of all of them.
        measures: of trunks from the pavement, of trees and of trunks, m.
        is_stock: whether they have stood since before the rules.
    """
    spacing, gaps = places
    distance, usual_height, usual_trunk = measures
    if span[1] - span[0] < _SHORTEST:
        return
    turnouts = Reservations((a - _BESIDE_TURNOUT, b + _BESIDE_TURNOUT) for a, b in roadside.turnouts.stretches)
    # A barrier before the trees must not meet a turnout or a village.
    restless = turnouts if is_stock else roadside.restless
    taken = (roadside.near, roadside.far, roadside.crossed, roadside.villages, restless)
    for place in np.arange(span[0] + spacing / 2.0, span[1], spacing).tolist():
        station = round_value(place + draw_between(rng, (-_JITTER, _JITTER)))
        height = round_value(usual_height * draw_between(rng, (_LOWEST, _HIGHEST)))
        trunk = round_value(usual_trunk * draw_between(rng, _STEMS))
        width, bottom = draw_between(rng, _WIDTHS), draw_between(rng, _BOTTOM)
        is_felled, seed = rng.random() < gaps, int(rng.integers(2**30))
        reach = trunk / 2.0 + _BESIDE
        is_on_road = trunk / 2.0 <= station <= layout.length - trunk / 2.0
        if is_felled or not is_on_road or not all(item.is_free(station - reach, station + reach) for item in taken):
            continue
        crown = 2.0 * _MEASURES[species] * height * width
        axis = distance + trunk / 2.0
        crown_bottom = bottom * height
        if crown / 2.0 > axis - _OVER_ROAD:
            crown_bottom = max(crown_bottom, _LOWEST_CROWN)
            if crown_bottom > 0.6 * height:  # too low a tree for a crown above the traffic
                crown_bottom, crown = bottom * height, 2.0 * max(axis - _OVER_ROAD, 0.3)
        paved = roadside.edge.largest_paved(station - 1.0, station + 1.0)
        yield Tree(
            instance=1,
            station=station,
            offset=round_value(roadside.sign * (paved + axis)),
            rotation_deg=roadside.facing,
            species=species,
            height=height,
            trunk_diameter=trunk,
            crown_diameter=round_value(crown),
            crown_bottom=round_value(crown_bottom),
            stock=is_stock,
            seed=seed,
        )
