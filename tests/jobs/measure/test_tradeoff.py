"""The trade-off measures each row in a process of its own and writes tables, JSON and plot."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from headless import commands
from headless.tradeoff_table import ROW_TITLES
from synthroads_addon.base.schema import canonical_json
from synthroads_addon.blender.cameras import HAS_RETURN_CAMERA
from synthroads_addon.blender.model.build import build_road
from synthroads_addon.blender.scene.evaluated import scanned_scene
from synthroads_addon.blender.things.model_builder import BuildRequest
from synthroads_addon.jobs.measure.rows import measure_row
from synthroads_addon.jobs.measure.tradeoff import KNOBS, SCENES, knob_rows, row_scenario
from synthroads_addon.road.damage import DAMAGES
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scanning.scene.height_errors import mesh_height_errors
from synthroads_addon.scenario.scenario import load_scenario
from tests.helpers.scenes.sparse_scanner import sparse_scanner

COLOURS = {"colour_median", "colour_95", "layers_rmse"}


def small_scenario(folder: Path, *more: str) -> Path:
    changes = ["road.length=50", "road.half_width=20", "scan.platform.lateral_offsets=[5]", "vegetation_detail=0.2"]
    changes += [f"scan.device={sparse_scanner(folder, 40.0)}", "scan.pulse_rate_khz=40", "scan.field_of_view_deg=60"]
    changes += ["colour.ground_sampling_distance=0.3", *more]
    path = folder / "small.json"
    path.write_text(canonical_json(load_scenario("rq31-600m-even", changes).to_dict()))
    return path


def row(folder: Path, knob: str, value: Any, *more: str) -> dict[str, Any]:
    return measure_row(str(small_scenario(folder, *more)), knob, value)


@pytest.mark.any_blender
def test_a_knob_is_measured(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scenario = str(small_scenario(tmp_path, "road.length=20"))
    words = ["--scenario", scenario, "--output", str(tmp_path / "out"), "--knobs", "caster"]
    pictures = ["--pictures", str(tmp_path / "pictures")]
    assert commands.command("tradeoff", [*words, *pictures]) == 0
    out = tmp_path / "out"
    assert sorted(p.name for p in out.iterdir()) == ["rows", "small.json", "small.md", "small.png"]
    assert (tmp_path / "pictures" / "tradeoff-small.png").exists()
    assert "| caster | embree |" in (out / "small.md").read_text()
    slow, fast = json.loads((out / "small.json").read_text())["rows"]
    assert (slow["value"], fast["value"]) == ("bvhtree", "embree")
    assert fast["rays_per_second"] > slow["rays_per_second"]
    for result in (slow, fast):
        assert result["errors"].keys() == ROW_TITLES.keys() - COLOURS - {"relief_mm"}
        assert 0 < result["errors"]["height_mm"] < 5
        assert result["errors"]["position_mm"] > 0
        assert result["images"] == 0
    # Both casters see the same scene.
    assert abs(slow["errors"]["position_mm"] - fast["errors"]["position_mm"]) < 0.05 * fast["errors"]["position_mm"]

    # What is there already is refused, or kept: also a row of which we only pretend that it was measured.
    assert commands.command("tradeoff", words) == 2
    file = out / "rows" / "small" / "caster-embree.json"
    data = json.loads(file.read_text())
    file.write_text(json.dumps(data | {"row": fast | {"seconds": 4711.0}}))
    assert commands.command("tradeoff", [*words, "--resume"]) == 0
    assert json.loads((out / "small.json").read_text())["rows"] == [slow, fast | {"seconds": 4711.0}]
    # A row of another job is measured again, and so is what another Blender couldn't measure.
    again = fast | {"seconds": 1.0}
    monkeypatch.setattr("headless.tradeoff._measured_once", lambda *asked: again)
    lacking = {"row": {"knob": "caster", "value": "embree", "left_out": "lacks it"}}
    for old in (lacking, {"job": "another", "row": fast | {"seconds": 4711.0}}):
        file.write_text(json.dumps(data | old))
        assert commands.command("tradeoff", [*words, "--resume"]) == 0
        kept, measured = json.loads((out / "small.json").read_text())["rows"]
        assert kept == slow
        assert measured.items() >= again.items()


@pytest.mark.any_blender
def test_a_document_gets_the_tables_of_which_all_knobs_are_measured(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another table in it stays as it is."""
    costs = dict.fromkeys(("seconds", "image_seconds", "peak_memory_mb"), 1.0) | {"shares": {}, "errors": {}}
    monkeypatch.setattr(
        "headless.tradeoff._measured_once", lambda scene, knob, value: costs | {"knob": knob, "value": value}
    )
    monkeypatch.setattr("headless.tradeoff_plot.plot", lambda rows, path: path.write_bytes(b""))
    document, other = (
        tmp_path / "page.md",
        "<!-- table: tradeoff rq31-600m-even points -->\nolder\n<!-- end of table -->\n",
    )
    document.write_text(other + "<!-- table: tradeoff rq31-600m-even light -->\n<!-- end of table -->\n")
    words = ["--scenario", "rq31-600m-even", "--output", str(tmp_path / "out"), "--knobs", "samples"]
    assert commands.command("tradeoff", [*words, "--document", str(document)]) == 0
    assert document.read_text().startswith(other)
    assert "--knobs samples --output DIR`" in document.read_text()
    assert "| samples | 64 | 1.0 | 1.0 | 1 |" in document.read_text()


@pytest.mark.slow
@pytest.mark.any_blender
def test_plants_that_are_left_out_are_an_error(tmp_path: Path) -> None:
    """On a wide strip: beside the road itself hardly anything grows."""
    wide = ("road.half_width=60", "road.length=20")
    few, all_of_them = (row(tmp_path, "vegetation_detail", value, *wide)["errors"] for value in (0, 1))
    assert few["labels_percent"] > all_of_them["labels_percent"] + 1.0


@pytest.mark.slow
@pytest.mark.any_blender
def test_compiled_loops_leave_the_errors_as_they_are(tmp_path: Path) -> None:
    compiled, plain = (row(tmp_path, "kernels", value, "road.length=20") for value in ("auto", "off"))
    assert plain["kernels"].startswith("off: ")
    assert not compiled["kernels"].startswith("off: ")
    assert compiled["errors"].keys() == plain["errors"].keys() >= {"position_mm", "relief_mm", "colour_95"}
    assert plain["errors"]["position_mm"] > 0.0
    for name in ("position_mm", "intensity_percent", "relief_mm"):
        assert compiled["errors"][name] == pytest.approx(plain["errors"][name], rel=0.02, abs=1e-3), name


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--knobs", "castor"], "--knobs is 'castor': must be any of"),
        (["--resume", "--overwrite"], "--resume: can't be given with --overwrite"),
        (["--scenario", "rq31-60m"], "did you mean 'rq31-600m'"),
        (["--document", "nowhere.md"], "--document is 'nowhere.md': cannot be read"),
        (["--document", "page.md", "--knobs", "fidelity"], "the table of presets has between as well"),
    ],
)
def test_bad_input_is_refused_before_anything_is_measured(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: list[str], said: str
) -> None:
    assert commands.command("tradeoff", ["--output", str(tmp_path / "out"), *words]) == 2
    assert said in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_colours_of_images_are_nearer_to_the_truth_than_the_materials(tmp_path: Path) -> None:
    small = ("road.half_width=30", "road.length=30")
    material, images = (row(tmp_path, "colour_source", value, *small) for value in ("material", "images"))
    assert material["shares"] == {"material": 1.0}
    assert material["images"] == 0 < images["images"]
    assert images["shares"]["material"] < 0.02
    assert images["image_seconds"] > material["image_seconds"]
    for result in (material, images):
        assert result["errors"].keys() == COLOURS
        truth = "a pixel per return" if HAS_RETURN_CAMERA else "the materials' nodes"
        assert result["colour_truth"].startswith(truth)
    by_source = images["errors_by_source"]
    assert by_source.keys() == images["shares"].keys() >= {"image", "material"}
    assert by_source["image"]["colour_95"] < by_source["material"]["colour_95"]
    nodes = row(tmp_path, "colour_source", "nodes", "road.half_width=30")
    assert nodes["shares"] == {"nodes": 1.0}
    assert nodes["errors"]["colour_95"] < 0.1 * images["errors"]["colour_95"]
    assert nodes["errors"]["layers_rmse"] < 0.002
    for name in COLOURS - {"layers_rmse"}:
        assert 0.0 < images["errors"][name] < material["errors"][name]
    # A pixel of 25 cm hardly knows a material's variation better than its mean does: it is no worse, within chance.
    assert 0.0 < images["errors"]["layers_rmse"] < 1.05 * material["errors"]["layers_rmse"]


def test_a_pixel_per_return_is_the_truth_or_says_what_it_needs(tmp_path: Path) -> None:
    result = row(tmp_path, "colour_source", "returns")
    if HAS_RETURN_CAMERA:
        assert result["shares"]["return"] > 0.99
        assert max(result["errors"].values()) == pytest.approx(0.0, abs=1e-6)
    else:
        assert "Blender 5.0" in result["left_out"]


@pytest.mark.slow
@pytest.mark.any_blender
def test_relief_and_spacing_leave_their_errors(tmp_path: Path) -> None:
    bare = ("road.length=20", "vegetation_detail=0")
    none, full = (row(tmp_path, "roughness_adjustment", value, *bare)["errors"]["relief_mm"] for value in (0, 1))
    assert none > 3.0
    assert full < 0.5 * none
    spacings = (row(tmp_path, "point_spacing", value, *bare) for value in ("none", 0.2))
    whole, thin = (found["errors"]["density_percent"] for found in spacings)
    assert abs(whole) < 2.0
    assert 20.0 < thin < 100.0


@pytest.mark.any_blender
def test_heights_are_within_the_tolerance_but_where_the_pavement_changes_at_once() -> None:
    scenario = load_scenario("airborne-1000m-even", ["road.half_width=40"])
    parameters = sample_road(scenario.road, scenario.seed)
    geometry = RoadGeometry(parameters)
    steps = [step for section in geometry.sections.values() for step in section.steps()]
    assert len(steps) == 4, "the noses and ends of an exit and an entry"
    for low, high in steps:
        assert high - low == pytest.approx(0.05)
        before, behind = geometry.offsets(np.array([low - 1e-6, high + 1e-6]))
        assert np.abs(before - behind).max() > 0.4
    build_road(BuildRequest(parameters, 0.005, 0.0, ("road",)))
    errors = np.abs(mesh_height_errors(scanned_scene(geometry=geometry).static, geometry))
    assert 0.001 < errors.max() < 0.005


@pytest.mark.slow
@pytest.mark.any_blender
def test_what_lies_on_the_pavement_is_no_error_of_its_height() -> None:
    """Patches and cracks are thin faces on it, here raised by a centimetre."""
    scenario = load_scenario("every-class-1500m", ["road.length=200", "road.half_width=25", "road.pavement.concrete=0"])
    parameters = sample_road(scenario.road, scenario.seed)
    geometry = RoadGeometry(parameters)
    build_road(BuildRequest(parameters, 0.005, 0.0))
    mesh = scanned_scene(geometry=geometry).static
    laid_on = [number for number, kind in geometry.numbers.damages().items() if kind >= DAMAGES.index("patch")]
    corners = np.unique(mesh.triangles[np.isin(mesh.instance_id, laid_on)])
    assert len(corners) > 50
    mesh.vertices[corners, 2] += 0.01
    assert np.abs(mesh_height_errors(mesh, geometry)).max() < 0.005


def test_every_row_is_a_scenario() -> None:
    for scene in SCENES:
        for knob, value in knob_rows(KNOBS):
            row_scenario(scene, knob, value)
