"""A scan with a fitted table gives the intensities that the calibration expects of it."""

import json
from pathlib import Path

import bpy
import numpy as np
import pytest

from synthroads_addon.blender.files import empty_file
from synthroads_addon.blender.materials import constants, material
from synthroads_addon.jobs.generate import Job, generate
from synthroads_addon.jobs.scan_scene import SceneScan, scan_scene
from synthroads_addon.materials.table import materials, write_material_table
from synthroads_addon.scenario.scenario import Scenario
from tools.check_calibration import check_table

pytestmark = pytest.mark.any_blender

OWN = {
    "asphalt": {"specular": 0.21, "spread_below": 0.29, "spread_above": 0.2, "spread_wavelength": 0.25},
    "paint_white": {"specular": 0.02, "retroreflection": 0.65, "spread_below": 0.15, "spread_above": 0.15},
}


@pytest.fixture
def table(tmp_path: Path) -> Path:
    """A table of asphalt and paint as real ones are."""
    rows = {name: materials()[name].model_copy(update=values) for name, values in OWN.items()}
    write_material_table(tmp_path / "own.json", rows)
    return tmp_path / "own.json"


@pytest.mark.slow
def test_a_scan_gives_the_expected_percentiles(table: Path, tmp_path: Path) -> None:
    """Mixed footprints, ranges, angles and spread together; the markings' few points leave them a little uncertain."""
    asphalt, paint = check_table(table, tmp_path / "check", rays=19).compared
    for entry, allowed in ((asphalt, 0.02), (paint, 0.06)):
        errors = entry.errors()
        assert errors is not None
        assert np.abs(errors).max() < allowed, entry.target.material
    assert paint.real is not None
    assert len(paint.real.intensity) > 2000


def test_a_built_road_takes_and_keeps_the_table(table: Path, tmp_path: Path) -> None:
    changes = {
        "road": {"length": 60, "half_width": 20, "materials": {"asphalt_age": {"minimum": 0.5, "maximum": 0.5}}},
        "fidelity": "draft",
        "materials_table": str(table),
        "outputs": ["cloud"],
        "scan": {"platform": {"speed": 40}},
        "colour": {"source": "material"},
    }
    scenario = Scenario.from_dict(changes)
    generate(Job(scenario, tmp_path / "own", new_file=True))
    kept = constants(["asphalt"])["asphalt"]
    assert kept.spread_below == 0.29
    plain = Scenario.from_dict({name: value for name, value in changes.items() if name != "materials_table"})
    generate(Job(plain, tmp_path / "plain", new_file=True))
    assert constants(["asphalt"])["asphalt"].spread_below == 0.0
    clouds = [(tmp_path / name / "cloud.laz").read_bytes() for name in ("own", "plain")]
    assert clouds[0] != clouds[1]


def test_a_scan_with_a_table_leaves_the_scene_as_it_is(table: Path, tmp_path: Path) -> None:
    empty_file()
    bpy.ops.mesh.primitive_plane_add(size=60)
    item = bpy.context.object
    item["synthroads_class"] = "road"
    item.data.materials.append(material("asphalt"))
    before = json.loads(item.data.materials[0]["synthroads_mean"])
    reports = []
    for name, own in (("own", str(table)), ("plain", None)):
        scenario = Scenario.from_dict(
            {"fidelity": "draft", "materials_table": own, "outputs": ["cloud"], "colour": {"source": "material"}}
        )
        reports.append(scan_scene(SceneScan(scenario, tmp_path / name)))
        assert json.loads(item.data.materials[0]["synthroads_mean"]) == before
    assert reports[0]["counts"]["points"] == reports[1]["counts"]["points"]
    assert (tmp_path / "own" / "cloud.laz").read_bytes() != (tmp_path / "plain" / "cloud.laz").read_bytes()
