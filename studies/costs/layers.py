"""Measure layers by the materials' nodes at the returns beside those of a pixel per return: Blender 5.0 or newer.

    python studies/costs/layers.py --scenarios rq31-600m-even tripod-200m-even

The points are those of short stretches spread over the path, on the first metres of each road. It prints, by scenario,
the RMSE of each layer over the 99.9 % of the points that differ least, the median and the 95th percentile of CIEDE2000
of the lit colours, and the processor seconds that a million points take by each source.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from synthroads_addon.blender.cameras import layer_source
from synthroads_addon.blender.files import empty_file
from synthroads_addon.jobs.open_scene import RoadScene
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scanning.colour.colour import (
    FROM_RETURN,
    MATERIAL_LAYERS,
    ColourSource,
    LayerValues,
    SeenPoints,
    sample_points,
)
from synthroads_addon.scanning.colour.difference import colour_difference, squared_error
from synthroads_addon.scanning.colour.request import LayerRequest
from synthroads_addon.scanning.platforms.stretches import spread_stretches
from synthroads_addon.scanning.record import record_as_measured
from synthroads_addon.scanning.scan import join_results
from synthroads_addon.scenario.scenario import load_scenario

SCENARIOS = ("rq31-600m-even", "mobile-mapping-300m-even", "tripod-200m-even", "airborne-1000m-even")
LAYERS = frozenset({"rgb", *MATERIAL_LAYERS})
KEPT = 0.999
"""Share of the points, those that differ least, whose RMSE is said."""
FEW = 64
"""Points that bring the scene into the renderer, before the time is taken."""


def compare_sources(name: str, length: float, stretches: int, seconds: float, *changes: str) -> dict[str, float]:
    """Return differences between both sources on a scenario's points, and the processor seconds per million points.

    Args:
        name: scenario.
        length: of its road, m.
        stretches: of each strip, spread evenly over it.
        seconds: duration of each.
        changes: further ones of the scenario.
    """
    empty_file()
    scenario = load_scenario(name, [f"road.length={length}", 'outputs=["cloud"]', *changes])
    scene = RoadScene.of(scenario, RoadGeometry(sample_road(scenario.road, scenario.seed)))
    scene.build()
    plan = scene.plan()
    assert plan.layers.request is not None
    emission = replace(plan.emission, path=spread_stretches(plan.path, stretches, seconds))
    points = join_results(record_as_measured(replace(plan, emission=emission))).seen
    assert points is not None
    request = replace(plan.layers.request, names=LAYERS)
    nodes, nodes_seconds = sampled(request, points, "nodes")
    truth, truth_seconds = sampled(request, points, "returns")
    rows = truth.source == FROM_RETURN
    count = int(rows.sum())
    figures: dict[str, float] = {"points": count}
    for layer in MATERIAL_LAYERS:
        squares = np.sort(squared_error(layer, nodes, truth, rows).mean(axis=1))
        figures[layer] = float(np.sqrt(squares[: int(KEPT * count)].mean()))
    difference = colour_difference(nodes, truth, rows)
    figures |= {"colour median": float(np.median(difference)), "colour 95 %": float(np.quantile(difference, 0.95))}
    return figures | {"s/M nodes": 1e6 * nodes_seconds / len(points), "s/M returns": 1e6 * truth_seconds / len(points)}


def sampled(request: LayerRequest, points: SeenPoints, source: ColourSource) -> tuple[LayerValues, float]:
    """Return the layers of points by a source, and the processor seconds that they take once the scene is known."""
    with layer_source(replace(request, settings=replace(request.settings, source=source))) as layers:
        sample_points(layers, points.select(slice(0, FEW)), LAYERS)
        start = time.process_time()
        values = sample_points(layers, points, LAYERS)
        return values, time.process_time() - start


def main() -> int:
    """Measure the scenarios that are asked for, and print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenarios", nargs="+", default=SCENARIOS)
    parser.add_argument("--length", type=float, default=100.0, help="of the roads, m")
    parser.add_argument("--stretches", type=int, default=16, help="of each strip")
    parser.add_argument("--seconds", type=float, default=0.2, help="duration of each stretch, s")
    options = parser.parse_args()
    for name in options.scenarios:
        figures = compare_sources(name, options.length, options.stretches, options.seconds)
        print(name, " ".join(f"{key}: {value:.6g};" for key, value in figures.items()), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
