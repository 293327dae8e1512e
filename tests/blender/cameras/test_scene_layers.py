"""Layers of roads by the materials' nodes: those of a pixel per return, and the same in every Blender."""

from __future__ import annotations

import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from studies.costs.layers import compare_sources
from synthroads_addon.blender.cameras import HAS_RETURN_CAMERA, layer_source
from synthroads_addon.blender.files import empty_file
from synthroads_addon.jobs.open_scene import RoadScene
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scanning.colour.colour import MATERIAL_LAYERS, sample_points
from synthroads_addon.scanning.platforms.stretches import spread_stretches
from synthroads_addon.scanning.record import record_as_measured
from synthroads_addon.scanning.scan import join_results
from synthroads_addon.scenario.scenario import load_scenario
from tests.helpers.scenes.scan_scenes import altered

WORST_LAYER, WORST_COLOUR = 0.002, 1.0
"""Largest RMSE of a layer, and largest 95th percentile of CIEDE2000 of lit colours."""
RECORD = Path(__file__).parent / "layers_of_a_road.json"
WRITE = "SYNTHROADS_WRITE_SNAPSHOTS"
"""Environment variable that has the record written anew."""
COUNT = 300
ROAD = ["road.length=30", "road.half_width=18", "vegetation_detail=0.2", "scan.lines_per_second=20"]
LAYERS = ("base_color", "roughness", "metallic", "specular")


@pytest.mark.slow
@pytest.mark.skipif(not HAS_RETURN_CAMERA, reason="Blender < 5")
@pytest.mark.parametrize("scenario", ["rq31-600m-even", "mobile-mapping-300m-even", "tripod-200m-even"])
def test_they_are_those_of_a_pixel_per_return(scenario: str) -> None:
    # For a pixel per return shadows of what drives stay where they were when the scan began: here nothing does.
    standing = "scan.traffic_speed_factor=0"
    found = compare_sources(scenario, 60.0, 8, 0.1, standing)
    assert found["points"] > 10_000
    assert {layer: found[layer] for layer in MATERIAL_LAYERS if found[layer] >= WORST_LAYER} == {}
    assert found["colour 95 %"] < WORST_COLOUR


def test_every_blender_gives_the_same() -> None:
    """The record is of one Blender, and all are compared with it."""
    empty_file()
    scenario = load_scenario("rq31-600m-even", [*ROAD, 'outputs=["cloud"]'])
    shown = RoadScene.of(scenario, RoadGeometry(sample_road(scenario.road, scenario.seed)))
    shown.build()
    plan = shown.plan()
    seen = join_results(record_as_measured(altered(plan, path=spread_stretches(plan.path, 4, 0.02)))).seen
    assert seen is not None
    assert plan.layers.request is not None
    seen = seen.select(np.linspace(0, len(seen) - 1, COUNT).astype(np.intp))
    request = replace(plan.layers.request, names=frozenset(LAYERS))
    with layer_source(request) as layers:
        values = sample_points(layers, seen, request.names)
    found = {"position": seen.position} | {name: np.asarray(values.arrays[name], np.float64) for name in LAYERS}
    if WRITE in os.environ:
        RECORD.write_text(json.dumps({name: np.round(array, 6).tolist() for name, array in found.items()}) + "\n")
    recorded = {name: np.array(rows) for name, rows in json.loads(RECORD.read_text()).items()}
    np.testing.assert_allclose(found["position"], recorded["position"], atol=1e-4)
    for name in LAYERS:
        assert np.ptp(recorded[name]) > 0.01
        assert np.sqrt(np.mean((found[name] - recorded[name]) ** 2)) < WORST_LAYER, name
