"""Jobs with cameras: by section, of foreign scenes, images alone, points coloured from them; and jobs without any."""

from __future__ import annotations

import json
from pathlib import Path

import bpy
import numpy as np
import pytest

from synthroads_addon.base.errors import InputError, OutputError
from synthroads_addon.blender.files import empty_file
from synthroads_addon.cloud.formats.registry import open_cloud
from synthroads_addon.cloud.points import PointBlock, concatenate
from synthroads_addon.jobs.generate import Job, generate
from synthroads_addon.jobs.images.reader import read_images
from synthroads_addon.jobs.scan_scene import SceneScan, scan_scene
from synthroads_addon.scenario.inputs import ScenarioInputs
from synthroads_addon.scenario.scenario import Scenario, load_scenario

pytestmark = pytest.mark.any_blender

RIG = {
    "title": "Two",
    "source": "Made up.",
    "cameras": [
        {"name": "front", "width": 96, "height": 64, "pixel_size_um": 20.0, "focal_length_mm": 1.0, "pitch_deg": -15.0},
        {"name": "back", "width": 96, "height": 64, "pixel_size_um": 20.0, "focal_length_mm": 1.0, "yaw_deg": 180.0}
        | {"pitch_deg": -15.0},
    ],
}
SMALL = ["fidelity=draft", "road.length=100", "road.half_width=20", "colour.source=material", "vegetation_detail=0"]
SMALL += ["scan.platform.kind=vehicle", "scan.platform.lateral_offsets=[-5]", "scan.platform.speed=20"]
SMALL += ["scan.cameras.spacing=40", "scan.cameras.samples=1", "scan.cameras.farthest=60"]


def job(folder: Path, *changes: str, **options) -> Job:
    """Return a small job with two cameras."""
    rig = folder / "rig.json"
    folder.mkdir(exist_ok=True)
    rig.write_text(json.dumps(RIG))
    return Job(
        load_scenario("rq31-600m-even", [*SMALL, f"scan.cameras.rig={rig}", *changes]), folder / "out", **options
    )


def points_of(folder: Path) -> PointBlock:
    """Return the points of a job's cloud."""
    with open_cloud(folder / "cloud.laz") as cloud:
        return concatenate(list(cloud.blocks()))


def test_images_by_section_are_those_of_the_whole_road(tmp_path: Path) -> None:
    # Where the road is cut for a section, it ends beyond all that its cameras see.
    outputs = 'outputs=["parameters"]'
    whole = generate(job(tmp_path / "whole", outputs))["counts"]
    parts = generate(job(tmp_path / "parts", outputs, "scan.section_length=40"))["counts"]
    assert parts["sections"] > 1
    assert whole["images"]["images"] == parts["images"]["images"] == 6
    for one, other in zip(
        *(read_images(tmp_path / name / "out" / "images") for name in ("whole", "parts")), strict=True
    ):
        assert (one.camera, one.exposure, one.time) == (other.camera, other.exposure, other.time)
        assert np.abs(one.position - other.position).max() < 1e-6
        depths = one.layer("depth"), other.layer("depth")
        assert np.mean(np.abs(depths[0] - depths[1]) < 2e-3) > 0.99
        assert np.mean(one.layer("instance") == other.layer("instance")) > 0.99


def test_images_alone_need_no_scan(tmp_path: Path) -> None:
    report = generate(job(tmp_path, "outputs=[]"))
    assert report["counts"]["pulses"] == 0
    assert "warnings" not in report
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"images", "report.json"}
    with pytest.raises(OutputError, match="already holds images"):
        generate(job(tmp_path, "outputs=[]"))


def test_points_take_the_colours_of_the_pixels_that_show_them(tmp_path: Path) -> None:
    changes = ['outputs=["cloud"]', "scan.cameras.noise=0", "scan.device=velodyne-vlp-32c"]
    exact = generate(job(tmp_path / "exact", *changes))
    report = generate(job(tmp_path / "seen", *changes, "scan.cameras.point_colours=images"))
    counts = report["counts"]["images"]["point_colours"]
    points, own = points_of(tmp_path / "seen" / "out"), points_of(tmp_path / "exact" / "out")
    assert np.array_equal(points.xyz, own.xyz)
    assert "point_colours" not in exact["counts"]["images"]
    assert counts["coloured"] + counts["unseen"] == len(points)
    assert 0 < counts["hidden"] < counts["coloured"]
    assert 0 < counts["other_instance"] < counts["coloured"]
    # Each coloured point has the colour of the pixel of some image of the nearest exposures.
    images = read_images(tmp_path / "seen" / "out" / "images")
    from_image = np.zeros(len(points), bool)
    for image in images:
        place, _ = image.project(points.xyz)
        rows = np.flatnonzero(~np.isnan(place[:, 0]))
        column, row = np.floor(place[rows]).astype(int).T
        seen = image.layer("rgb")[np.minimum(row, 63), np.minimum(column, 95)].astype(np.uint16) * 257
        from_image[rows] |= (seen == points.rgb[rows]).all(axis=1)
    changed = (points.rgb != own.rgb).any(axis=1)
    assert changed.mean() > 0.5
    assert from_image[changed].mean() > 0.999


def test_a_scene_of_others_has_images(tmp_path: Path) -> None:
    empty_file()
    bpy.ops.mesh.primitive_plane_add(size=80.0)
    bpy.ops.mesh.primitive_cube_add(size=4.0, location=(10.0, 3.0, 2.0))
    (tmp_path / "rig.json").write_text(json.dumps(RIG))
    changes = ["colour.source=material", f"scan.cameras.rig={tmp_path / 'rig.json'}", 'outputs=["cloud"]']
    changes += ["scan.platform.kind=tripod", "scan.platform.turn_seconds=1", "scan.device=velodyne-vlp-16"]
    scenario = load_scenario("rq31-600m-even", changes)
    report = scan_scene(SceneScan(scenario, tmp_path / "out", tripods=((0.0, 0.0),)))
    assert report["counts"]["images"]["images"] == 2
    (front, back) = read_images(tmp_path / "out" / "images")
    assert np.abs(front.position - [0.0, 0.0, 1.8]).max() < 1e-4
    numbers = front.layer("instance")
    assert len(np.unique(numbers)) == 3  # ground, cube and sky
    # The cube's near face is 8 m ahead.
    place, distance = front.project(np.array([[8.0, 2.0, 1.0]]))
    column, row = np.floor(place[0]).astype(int)
    assert front.layer("depth")[row, column] == pytest.approx(distance[0], rel=0.02)
    assert np.allclose(front.layer("normal")[row, column], [-1, 0, 0], atol=1e-3)
    assert len(np.unique(back.layer("instance"))) == 2


def test_a_scenario_without_cameras_says_nothing_of_them() -> None:
    text = Scenario().to_json()
    assert "cameras" not in text
    assert not Scenario.from_dict({"outputs": ["parameters"]}).scans


def test_wrong_cameras_are_named() -> None:
    with pytest.raises(InputError, match="layers must contain rgb"):
        load_scenario("rq31-600m", ['scan.cameras={"layers":["depth"],"point_colours":"images"}'])
    scenario = load_scenario("rq31-600m", ["scan.cameras.rig=ladybug"])
    with pytest.raises(InputError, match=r"scan\.cameras\.rig"):
        ScenarioInputs.read(scenario)
