"""Memory between the sections of a long road stays the same, where materials' nodes give the colours as well."""

from __future__ import annotations

import gc
import re
from typing import Any

import bpy
import numpy as np
import pytest

from synthroads_addon.base.machine import release_memory
from synthroads_addon.base.progress import StageTimer
from synthroads_addon.jobs.scan import by_section
from synthroads_addon.jobs.scan.plan import Site
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scanning.record import CollectedBlocks, record
from synthroads_addon.scenario.inputs import ScenarioInputs
from synthroads_addon.scenario.scenario import Scenario
from tests.helpers.process_memory import STATUS, memory_mb

SECTIONS, LENGTH = 16, 40.0
POINTS = 100_000
"""Points of each section at least: so many that pictures of them would show if they were left."""
GROWTH = 30.0
"""MB that may be held after the last four sections above what is held in the middle: with pictures left it was 50."""


def dense() -> Scenario:
    """Return a draft of a road in sections, whose materials are worked out at many returns."""
    data: dict[str, Any] = {
        "type": "Scenario", "version": "1.0", "seed": 4, "fidelity": "draft", "vegetation_detail": 0.0,
        "road": {"length": SECTIONS * LENGTH, "half_width": 30.0},
        "scan": {
            "section_length": LENGTH, "pulse_rate_khz": 100.0,
            "platform": {"speed": 5.0, "lateral_offsets": [0.0]},
        },
        "outputs": ["cloud"],
    }  # fmt: skip
    return Scenario.from_dict(data)


@pytest.mark.slow
@pytest.mark.any_blender
@pytest.mark.skipif(not STATUS.is_file(), reason="the system doesn't tell what is resident")
def test_sections_leave_nothing_behind(monkeypatch: pytest.MonkeyPatch) -> None:
    memory: list[float] = []
    blocks: list[dict[str, int]] = []

    def release_and_look() -> None:
        gc.collect()
        release_memory()
        memory.append(memory_mb())
        kinds = ("scenes", "objects", "meshes", "images", "cameras", "collections", "materials", "node_groups")
        blocks.append({kind: len(getattr(bpy.data, kind)) for kind in kinds})

    monkeypatch.setattr(by_section, "release_memory", release_and_look)
    scenario = dense()
    road = RoadGeometry(sample_road(scenario.road, scenario.seed, scenario.title))
    site = Site.of_road(scenario, road, ScenarioInputs.read(scenario))
    work, counts = by_section.SectionScan(site, road), []
    for plan in work.plans(StageTimer()):
        sink = CollectedBlocks()
        record(plan, sink)
        counts.append(sum(len(result.points) for result in sink.results))
        del plan, sink
    print(f"points {min(counts):,} to {max(counts):,}; held {[round(held) for held in memory]} MB; {blocks[-1]}")
    assert len(counts) == SECTIONS
    assert min(counts) > POINTS
    assert np.median(memory[-4:]) < np.median(memory[4:8]) + GROWTH
    for kind in ("scenes", "objects", "meshes", "images", "cameras", "collections"):
        assert len({found[kind] for found in blocks}) == 1, f"{kind}: {[found[kind] for found in blocks]}"
    # Materials and groups of what is seen for the first time stay, but no second copies of any.
    again = [item.name for item in (*bpy.data.materials, *bpy.data.node_groups) if re.search(r"\.\d{3}$", item.name)]
    assert not again, f"copies: {again}"
