"""A long road stretch by stretch: memory stays flat."""

from __future__ import annotations

import gc

import bpy
import pytest

from synthroads_addon.blender.model.build import build_road
from synthroads_addon.blender.scene.evaluated import scene_mesh
from synthroads_addon.blender.things.model_builder import BuildRequest
from synthroads_addon.road.stretches import stretches
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.road import RoadScenario
from tests.helpers.process_memory import STATUS, memory_mb


@pytest.mark.slow
@pytest.mark.skipif(not STATUS.exists(), reason="resident memory is read from /proc")
def test_memory_stays_flat_over_20_km() -> None:
    parameters = sample_road(RoadScenario(length=20_000.0), 4)
    peaks = []
    for stretch in stretches(20_000.0):
        build_road(BuildRequest(parameters, 0.02, 0.3, stretch=stretch))
        triangles = len(scene_mesh().triangles)
        gc.collect()
        peaks.append(memory_mb())
        print(f"{stretch[0]:7.0f} m: {peaks[-1]:6.0f} MB, {triangles:,} triangles, {len(bpy.data.node_groups)} groups")
    # The first ones fill Blender's caches; what later ones take depends on what stands there.
    assert max(peaks[-4:]) < 1.10 * max(peaks[1:5])
