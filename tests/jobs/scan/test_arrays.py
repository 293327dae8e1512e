"""A scan into arrays gives the points of the clouds that the same job writes, and writes nothing itself."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from synthroads_addon import Job, ScanArrays, SceneScan, generate, open_cloud, scan_scene, scan_to_arrays
from synthroads_addon.base.errors import InputError
from synthroads_addon.cloud.layers import ATTRIBUTES, LABELS, LAYERS
from synthroads_addon.cloud.points import POINT_TYPES, PointBlock, concatenate
from synthroads_addon.jobs.scan.arrays import ArraySink
from synthroads_addon.road.instances import InstanceNumbers
from synthroads_addon.road.parameters import read_parameters
from synthroads_addon.scenario.inputs import ScenarioInputs
from synthroads_addon.scenario.scenario import Scenario, load_scenario
from tests.helpers.scenes.scan_scenes import middle_pulses, plane, scan_of

SMALL = ("fidelity=draft", "road.length=60", "road.half_width=25", "scan.platform.lateral_offsets=[5]")
SMALL += ("scan.lines_per_second=50", "scan.platform.speed=24", "colour.source=material")
STEPS = {"xyz": 1e-3, "scan_angle_deg": 0.006} | {
    column.array: column.scale for layer in LAYERS.values() for column in layer.columns if column.scale
}
"""Steps in which LAZ stores arrays; the others are stored as they are."""


def scenario(*changes: str) -> Scenario:
    return load_scenario("rq31-600m-even", [*SMALL, *changes])


def read(path: Path) -> PointBlock:
    with open_cloud(path) as cloud:
        return concatenate(list(cloud.blocks()))


def assert_as_written(found: ScanArrays, folder: Path) -> None:
    """Assert that arrays are those of a folder's cloud.npz to the bit, and those of cloud.laz within its steps."""
    exact = np.load(folder / "cloud.npz")
    assert set(found.arrays) == set(exact) - {"notes"}
    for name, array in found.arrays.items():
        assert (array.dtype, array.shape) == (exact[name].dtype, exact[name].shape), name
        np.testing.assert_array_equal(array, exact[name], name)
    stored, scale = read(folder / "cloud.laz"), found.counts["intensity_scale"]
    for name, array in found.arrays.items():
        wanted, step = stored.array(name), STEPS.get(name)
        kept = np.minimum(array, 65535.0 / scale) if name == "intensity" else array
        step = 1.0 / scale if name == "intensity" else step
        if step is None:
            np.testing.assert_array_equal(array, wanted, name)
        else:
            distance = np.abs(np.asarray(kept, dtype=np.float64) - wanted).max()
            assert distance <= 0.5 * step * (1.0 + 1e-3) + 1e-6 * (name == "xyz"), name


def comparable(report: dict[str, Any]) -> dict[str, Any]:
    """Return what reports of the same job with and without files share."""
    left_out = {"seconds", "stages", "scenario", "remarks", "classes_to_fill_in", "warnings"}
    counts = {name: value for name, value in report["counts"].items() if name != "intensity_clipped"}
    return {name: value for name, value in report.items() if name not in left_out} | {"counts": counts}


@pytest.mark.parametrize(
    "changes",
    [
        pytest.param([f"cloud.attributes={json.dumps(ATTRIBUTES)}"], id="all attributes"),
        pytest.param(["cloud.attributes=[]", "cloud.classes=5", "scan.section_length=25"], id="by section"),
        pytest.param(["cloud.point_spacing=0.5"], id="thinned out"),
    ],
)
def test_arrays_are_those_of_the_cloud_of_the_same_scenario(changes: list[str], tmp_path: Path) -> None:
    asked = scenario(*changes, 'cloud.formats=["laz","npz"]', 'outputs=["cloud","parameters"]')
    told = generate(Job(asked, tmp_path))
    found = scan_to_arrays(asked)
    assert len(found) == told["counts"]["points"] > 1000
    assert_as_written(found, tmp_path)
    assert comparable(dict(found.report)) == comparable(told)
    assert found.counts["points"] == len(found)
    assert found.epsg == asked.road.epsg
    assert found.classes == asked.cloud.scheme().names()
    numbers = InstanceNumbers(read_parameters(tmp_path / "parameters.json"))
    names = {number: numbers.name_of(number) for number in np.unique(found["instance_id"]).tolist()}
    assert found.instances == {number: name for number, name in names.items() if name}
    assert len(found.instances) > 3


def test_a_given_road_is_scanned_and_nothing_is_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    generate(Job(scenario("road.length=30", 'outputs=["parameters"]'), tmp_path / "road"))
    (tmp_path / "empty").mkdir()
    monkeypatch.chdir(tmp_path / "empty")
    asked = scenario("road.length=500", 'outputs=["cloud","previews","parameters"]', 'twin=["geojson"]')
    job = Job(asked, tmp_path / "not-there", parameters=tmp_path / "road" / "parameters.json", new_file=True)
    found = scan_to_arrays(job)
    assert np.ptp(found.xyz, axis=0)[:2].max() < 120.0, "the given road's length counts"
    assert list((tmp_path / "empty").iterdir()) == []
    assert {path.name for path in tmp_path.iterdir()} == {"empty", "road"}


def test_a_scene_of_others_is_scanned_into_the_same_arrays(tmp_path: Path) -> None:
    bpy.ops.mesh.primitive_plane_add(size=40.0)
    bpy.context.object.name = "Yard"
    asked = scenario('cloud.formats=["laz","npz"]', 'outputs=["cloud"]')
    told = scan_scene(SceneScan(asked, tmp_path / "files", epsg=25832, origin=(5e5, 5.6e6, 100.0)))
    found = scan_to_arrays(SceneScan(asked, epsg=25832, origin=(5e5, 5.6e6, 100.0)))
    assert_as_written(found, tmp_path / "files")
    assert comparable(dict(found.report)) == comparable(told)
    assert abs(found.xyz[:, 0] - 5e5).max() < 25.0
    assert (found.epsg, dict(found.instances)) == (25832, {})
    assert found.crs
    assert any("points have no class" in text for text in found.remarks)
    assert [path.name for path in tmp_path.iterdir()] == ["files"]


def test_a_scan_without_points_has_empty_arrays_and_a_remark() -> None:
    found = scan_to_arrays(scenario("road.length=20", "scan.attenuation=1"))
    assert found.xyz.shape == (0, 3)
    assert {name: len(array) for name, array in found.arrays.items()} == dict.fromkeys(found.arrays, 0)
    assert "no pulse came back" in found.remarks[0]


def test_jobs_that_write_files_ask_for_a_folder() -> None:
    for run in (lambda: generate(Job(scenario())), lambda: scan_scene(SceneScan(scenario()))):
        with pytest.raises(InputError, match=r"output.*must be a folder"):
            run()


def sink_of(asked: Scenario) -> ArraySink:
    return ArraySink(asked, ScenarioInputs.read(asked), Path(), 60.0)


def test_arrays_have_names_types_and_units() -> None:
    asked = Scenario.from_dict({"cloud": {"attributes": ["range", "scanner", "power"]}})
    found = sink_of(asked).result({"counts": {"points": 0}, "remarks": []}, None, None, lambda number: None)
    assert set(found.arrays) == {*POINT_TYPES, "range", "scanner", "power_db"} >= {row.array for row in LABELS}
    assert [found.units[name] for name in ("xyz", "range", "scanner", "power_db", "class_id")] == [
        *("m", "m", "m", "dB", "1")
    ]
    assert set(found.units) == set(found.arrays)
    with pytest.raises(InputError, match=r"array is .normal.: must be one of xyz"):
        found["normal"]


def test_points_without_an_array_that_is_asked_for_are_refused() -> None:
    sink = sink_of(Scenario.from_dict({"cloud": {"attributes": ["damage"]}}))
    with sink.open(), pytest.raises(InputError, match=r"damage.: is in cloud.attributes, but the points"):
        sink.write(middle_pulses(scan_of(plane()), 10))
