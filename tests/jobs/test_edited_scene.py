"""Scans of .blend files whose roads were edited, by command: the road that is named, as it stands in the scene."""

from __future__ import annotations

from pathlib import Path

import bpy
import laspy
import numpy as np
import pytest
from mathutils import Vector

from synthroads_addon.base.errors import InputError
from synthroads_addon.blender.model.build import BuildTarget
from synthroads_addon.jobs.scan_scene import SceneScan, scan_scene
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.scenario.scenario import Scenario, load_scenario
from tests.helpers.scenes.small_road import build_small, small_parameters
from tests.helpers.scenes.sparse_scanner import sparse_scanner

pytestmark = pytest.mark.any_blender


def scenario(folder: Path) -> Scenario:
    """Return a scan with few pulses and without noise."""
    changes = [f'scan.device="{sparse_scanner(folder, 40.0)}"', "scan.rays_per_pulse=1", "scan.relief=0"]
    changes += [
        "scan.traffic_speed_factor=0",
        "scan.platform.lateral_offsets=[0]",
        'outputs=["cloud"]',
        "fidelity=draft",
    ]
    return load_scenario("rq31-600m-even", [*changes, 'colour.source="material"'])


def test_a_scan_by_command_is_of_the_edited_road_that_is_named(tmp_path: Path) -> None:
    file = tmp_path / "two.blend"
    build_small(small_parameters(40.0), parts=("road",))
    model = build_small(place=BuildTarget(beside=True))
    model.root.name = "Ramp"
    rail = small_parameters().objects["rail-right"]
    model.objects["rail-right"].location += Vector((0.7, 1.2, 0.0))  # shows nothing until it is built again
    model.objects["sign"].scale = (1.0, 1.0, 1.3)
    bpy.data.objects.remove(model.objects["rail-left"])
    bpy.context.view_layer.objects.active = None
    bpy.ops.wm.save_as_mainfile(filepath=str(file))
    report = scan_scene(SceneScan(scenario(tmp_path), tmp_path / "out", file, road="Ramp"))
    assert report["road"] == "Ramp"
    assert [entry["object"] for entry in report["edited_by_hand"]] == ["sign"]
    assert any(warning.startswith("sign was edited by hand") for warning in report["warnings"])
    cloud = laspy.read(tmp_path / "out" / "cloud.laz")
    points = cloud.xyz[np.asarray(cloud["instance_id"]) == rail.instance]
    geometry = RoadGeometry(small_parameters())
    _, offset = geometry.alignment.project(points[:, :2] - np.array(small_parameters().transform.translate)[:2])
    assert len(points) > 20
    assert offset.mean() > -14.9 + 0.5  # 1.05 m to the left of where it was built
    with pytest.raises(InputError, match=r"--road.*Ramp"):
        scan_scene(SceneScan(scenario(tmp_path), tmp_path / "none", file, road="Elsewhere"))
