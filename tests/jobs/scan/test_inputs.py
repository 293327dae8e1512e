"""A job reads each file that it is given once, so that what it makes is of one state of it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import bpy
import laspy
import numpy as np
import pytest

from synthroads_addon.blender.files import empty_file
from synthroads_addon.blender.materials import material
from synthroads_addon.dataset.layouts import layout_descriptions
from synthroads_addon.dataset.recipe import Recipe, scene_jobs
from synthroads_addon.jobs.dataset.processes import scene_task
from synthroads_addon.jobs.dataset.scene import make_scene
from synthroads_addon.jobs.dataset.scene_files import FILES
from synthroads_addon.jobs.generate import Job, generate
from synthroads_addon.jobs.scan_arrays import scan_to_arrays
from synthroads_addon.jobs.scan_scene import SceneScan, scan_scene
from synthroads_addon.materials.table import materials, write_material_table
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.road import RoadScenario
from synthroads_addon.scenario.scenario import Scenario
from tests.helpers.files.opened_files import opened_files
from tests.helpers.scenes.sparse_scanner import sparse_scanner

LENGTH = 20.0
CLASSES = [{"id": 1, "name": "paved", "las": 11, "color": [90, 90, 90], "of": ["road"]}]


def given(folder: Path, **changes: Any) -> dict[str, Any]:
    """Write a device, a class scheme, a material table; return the data of a small job that names them."""
    (folder / "classes.json").write_text(json.dumps({"classes": CLASSES}))
    write_material_table(folder / "table.json", {"asphalt": materials()["asphalt"]})
    return {
        "fidelity": "draft",
        "materials_table": str(folder / "table.json"),
        "road": {"length": LENGTH, "half_width": 20},
        "scan": {"device": sparse_scanner(folder, 20.0), "platform": {"speed": 20.0}},
        "cloud": {"classes": str(folder / "classes.json")},
        "colour": {"source": "material"},
        "outputs": ["cloud", "previews"],
    } | changes


def elevations(path: Path) -> str:
    """Write a level ground of 180 m about the map's origin as an ASCII grid; return its name."""
    east, north = RoadScenario().map_origin[:2]
    head = f"ncols 60\nnrows 60\nxllcorner {east - 150}\nyllcorner {north - 150}\ncellsize 5\n"
    path.write_text(head + "\n".join([" ".join(["180"] * 60)] * 60) + "\n")
    return str(path)


def trajectory(path: Path) -> str:
    """Write a flight of 20 m along x, 40 m above the origin; return the file's name."""
    rows = [f"{0.5 * i},{5.0 * i - 10.0},0,40,0,0,90" for i in range(5)]
    path.write_text("\n".join(["time,x,y,z,roll,pitch,heading", *rows]) + "\n")
    return str(path)


def openings(folder: Path, counts: dict[Path, int]) -> dict[str, int]:
    """Return how often each file directly in a folder was opened; the outputs lie in folders of it."""
    return {path.name: counts.get(path, 0) for path in sorted(folder.iterdir()) if path.is_file()}


def test_a_generated_road_opens_each_file_once(tmp_path: Path) -> None:
    data = given(tmp_path)
    data["road"]["elevation_model"] = elevations(tmp_path / "ground.asc")
    data["outputs"] = ["parameters", "centerline", *data["outputs"]]
    with opened_files() as counts:
        generate(Job(Scenario.from_dict(data), tmp_path / "out", new_file=True))
    assert openings(tmp_path, counts) == {"classes.json": 1, "ground.asc": 1, "sparse-20.json": 1, "table.json": 1}


def test_a_given_road_and_trajectory_are_opened_once(tmp_path: Path) -> None:
    data = given(tmp_path)
    road = sample_road(RoadScenario(length=LENGTH, map_origin=(0.0, 0.0, 0.0)), 1)
    (tmp_path / "road.json").write_text(road.to_json())
    data["scan"]["platform"] = {"kind": "trajectory", "file": trajectory(tmp_path / "flight.csv")}
    with opened_files() as counts:
        arrays = scan_to_arrays(Job(Scenario.from_dict(data), parameters=tmp_path / "road.json", new_file=True))
    assert len(arrays)
    assert set(openings(tmp_path, counts).values()) == {1}


def test_a_road_by_sections_opens_each_file_once(tmp_path: Path) -> None:
    data = given(tmp_path)
    data["road"] |= {"length": 60.0}
    data["scan"]["section_length"] = 20.0
    with opened_files() as counts:
        report = generate(Job(Scenario.from_dict(data), tmp_path / "out", new_file=True))
    assert report["counts"]["sections"] > 1
    assert set(openings(tmp_path, counts).values()) == {1}


@pytest.mark.slow
def test_a_choice_of_settings_opens_each_file_once(tmp_path: Path) -> None:
    data = given(tmp_path, time_budget=600.0)
    with opened_files() as counts:
        report = generate(Job(Scenario.from_dict(data), tmp_path / "out", new_file=True))
    assert report["choice"]["chosen"]
    assert set(openings(tmp_path, counts).values()) == {1}


def test_a_scan_of_a_scene_opens_each_file_once(tmp_path: Path) -> None:
    empty_file()
    bpy.ops.mesh.primitive_plane_add(size=60)
    bpy.context.object.data.materials.append(material("asphalt"))
    bpy.context.object.name = "Yard"
    (tmp_path / "names.json").write_text(json.dumps({"objects": {"Yard": "road"}}))
    (tmp_path / "line.csv").write_text("x,y,z\n-10,0,0\n10,0,0\n")
    data = given(tmp_path)
    job = SceneScan(
        Scenario.from_dict(data), tmp_path / "out", path=tmp_path / "line.csv", classes=tmp_path / "names.json"
    )
    with opened_files() as counts:
        report = scan_scene(job)
    assert report["counts"]["points_by_class"].keys() == {"road"}
    assert set(openings(tmp_path, counts).values()) == {1}


def test_a_scene_of_a_data_set_opens_each_file_once(tmp_path: Path) -> None:
    data = given(tmp_path, outputs=["parameters", "cloud"])
    (tmp_path / "scenario.json").write_text(json.dumps(data))
    about = {"title": "Tiny", "scenario": str(tmp_path / "scenario.json"), "groups": [{"name": "a", "scenes": 3}]}
    recipe = Recipe.from_dict(about | {"layouts": ["pointcept", "semantickitti"], "smallest_tile": 1})
    with opened_files() as counts:
        jobs = scene_jobs(recipe)
    assert openings(tmp_path, counts)["scenario.json"] == 1
    (tmp_path / "work").mkdir()
    with opened_files() as counts:
        make_scene(scene_task(jobs[0], recipe), tmp_path / "work", 1)
    assert (tmp_path / "work" / FILES / "scenes").is_dir()
    assert openings(tmp_path, counts) == {"classes.json": 1, "scenario.json": 0, "sparse-20.json": 1, "table.json": 1}
    with opened_files() as counts:
        layout_descriptions(recipe, jobs)
    assert openings(tmp_path, counts)["classes.json"] == 1


def test_a_device_that_is_edited_meanwhile_changes_nothing_of_the_job(tmp_path: Path) -> None:
    data = given(tmp_path, outputs=["cloud"])
    device, scenario = Path(data["scan"]["device"]), Scenario.from_dict(data)
    before = device.read_text()
    wanted = generate(Job(scenario, tmp_path / "calm", new_file=True))
    other = json.loads(before)
    other["modes"][0] |= {"pulse_rate_khz": 5.0, "maximum_range": 100.0}
    other["receiver"] = {"response": "range_compensated"}

    def edit(stage: str, share: float) -> None:
        device.write_text(json.dumps(other) if stage == "model" else device.read_text())

    found = generate(Job(scenario, tmp_path / "edited", new_file=True), edit)
    assert json.loads(device.read_text()) == other
    assert found["counts"] == wanted["counts"]
    clouds = [laspy.read(tmp_path / name / "cloud.laz") for name in ("calm", "edited")]
    np.testing.assert_array_equal(clouds[0].points.array, clouds[1].points.array)
