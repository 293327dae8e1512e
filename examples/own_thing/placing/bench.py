"""Benches at random stations of a sampled road."""

from __future__ import annotations

import numpy as np

from synthroads_addon.road.things.bench import Bench, BenchLimits
from synthroads_addon.sampling.placing.draw import draw, pick
from synthroads_addon.sampling.placing.layout import Layout, PlacementRequest
from synthroads_addon.sampling.placing.ranges import draw_start, free_ranges
from synthroads_addon.sampling.placing.registry import small_thing

HALF = 1.5  # m that a bench takes to either side along the road


@small_thing("benches")
def plan_benches(layout: Layout, rng: np.random.Generator) -> None:
    """Put benches at random stations, as many per km as drawn."""
    limits: BenchLimits = layout.site.scenario.furniture
    number = draw(rng, limits.benches_per_km) * layout.length / 1000.0
    for _ in range(int(number + rng.random())):
        roadside = pick(rng, list(layout.sides.values()))
        width = draw(rng, limits.bench_width)
        start = draw_start(rng, free_ranges(0.0, layout.length, roadside.near), 2.0 * HALF)
        if start is not None:
            roadside.put(PlacementRequest("bench", Bench, start + HALF, HALF, width, {"width": width}))
