"""The panel "Calibration": its buttons do what the library does, and leave nothing behind."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

import synthroads_addon
from synthroads_addon.base.errors import Cancelled
from synthroads_addon.blender.materials import material
from synthroads_addon.blender.materials.image import base_color_image
from synthroads_addon.calibration.job import CalibrationJob, MaterialTarget, calibrate, save_fitted
from synthroads_addon.materials.table import materials
from synthroads_addon.ui.fields import room
from synthroads_addon.ui.panels import calibration
from tests.helpers.clouds.calibration_cloud import labelled, striped
from tests.helpers.scenes.fake_layout import drawn


@pytest.fixture(autouse=True)
def settings() -> Iterator[Any]:
    """Register the add-on for one test; return the panel's settings, with asphalt and paint to be compared."""
    synthroads_addon.register()
    for _ in range(2):
        bpy.ops.synthroads.add_calibration_class()
    yield bpy.context.scene.synthroads_calibration
    synthroads_addon.unregister()


def labels(settings: Any, cloud: Path) -> None:
    settings.real, settings.class_field = str(cloud), "label"
    settings.classes[0].told, settings.classes[1].told = "40", "60"
    settings.range_corrected, settings.decibels = True, 30.0


@pytest.mark.slow
@pytest.mark.any_blender
def test_buttons_fit_and_save_what_the_library_does(settings: Any, tmp_path: Path) -> None:
    cloud = labelled(tmp_path / "real.laz", 30.0, 40.0)
    labels(settings, cloud)
    settings.table, settings.angles = str(tmp_path / "panel.json"), "0 40"
    assert bpy.ops.synthroads.fit_materials() == {"FINISHED"}
    assert bpy.ops.synthroads.save_materials() == {"FINISHED"}
    job = CalibrationJob(
        (MaterialTarget("asphalt", "40"), MaterialTarget("paint_white", "60")),
        real=cloud,
        class_field="label",
        incidence_deg=(0.0, 40.0),
        range_corrected=True,
        decibels=30.0,
    )
    wanted = calibrate(job)
    save_fitted(wanted, tmp_path / "library.json")
    assert (tmp_path / "panel.json").read_bytes() == (tmp_path / "library.json").read_bytes()
    result = calibration.latest
    assert result.to_dict() == wanted.to_dict()
    lines = calibration.result_lines(result.compared[0])
    assert "50 of intensity 0 left out" in lines[1]
    assert lines[-1].startswith("90 %: ")
    image = bpy.data.images[calibration.PICTURE]
    pixels = np.empty(len(image.pixels), dtype=np.float32)
    image.pixels.foreach_get(pixels)
    assert len(np.unique(pixels)) > 20


def test_comparing_again_draws_anew_and_saves_nothing(settings: Any, tmp_path: Path) -> None:
    labels(settings, labelled(tmp_path / "real.laz", 30.0, 40.0))
    assert bpy.ops.synthroads.compare_intensities() == {"FINISHED"}
    before = {entry.target.material: entry.after for entry in calibration.latest.compared}
    assert before == {name: materials()[name] for name in ("asphalt", "paint_white")}
    assert not bpy.ops.synthroads.save_materials.poll()
    settings.real = ""
    assert bpy.ops.synthroads.compare_intensities() == {"FINISHED"}
    assert len([image for image in bpy.data.images if image.name.startswith(calibration.PICTURE)]) == 1
    assert calibration.latest.compared[0].real is None


def test_classes_beside_an_axis(settings: Any, tmp_path: Path) -> None:
    cloud, _ = striped(tmp_path / "road.laz", tmp_path / "axis.csv", 40.0)
    settings.real, settings.axis = str(cloud), str(tmp_path / "axis.csv")
    settings.paved, settings.lines, settings.line_width = "-6 0; 0.5 6", "3", 0.2
    settings.range_corrected, settings.decibels, settings.angles = True, 30.0, "0"
    settings.classes[0].told, settings.classes[1].told = "paved", "line"
    assert bpy.ops.synthroads.fit_materials() == {"FINISHED"}
    result = calibration.latest
    assert result.job.road.paved == ((-6.0, 0.0), (0.5, 6.0))
    assert all(np.abs(entry.errors()).max() < 0.05 for entry in result.compared)
    ratio = result.compared[1].after.reflectivity / result.compared[0].after.reflectivity
    # The paint's retro-reflection is part of what makes it bright.
    paint = result.compared[1].after
    assert ratio * (1.0 + paint.retroreflection / paint.reflectivity) > 1.5


def test_an_axis_changes_what_the_usual_materials_are_compared_with(settings: Any) -> None:
    def told() -> list[str]:
        return [row.told for row in settings.classes]

    assert told() == ["road", "road_marking"]
    settings.classes[1].told = "60"
    settings.axis = "axis.csv"
    assert told() == ["paved", "60"]
    bpy.ops.synthroads.add_calibration_class()
    assert told() == ["paved", "60", "line"]
    settings.axis = ""
    assert told() == ["road", "60", "road_marking"]


def test_results_name_their_percentiles(settings: Any, tmp_path: Path) -> None:
    labels(settings, labelled(tmp_path / "real.laz", 30.0, 40.0))
    assert bpy.ops.synthroads.compare_intensities() == {"FINISHED"}
    lines = calibration.result_lines(calibration.latest.compared[0])
    assert lines[2] == "Intensity in units of the cloud, by percentile:"
    assert [line.partition(":")[0] for line in lines[3:]] == ["25 %", "50 %", "75 %", "90 %"]
    assert all(word in lines[3] for word in ("real ", "expected ", "error ", "of the interquartile range"))


@pytest.mark.parametrize("width", [200.0, 300.0])
@pytest.mark.parametrize(("has_cloud", "decibels"), [(True, 30.0), (False, 30.0), (False, 0.0)])
def test_a_chart_compares_the_materials_medians(
    settings: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, width: float, has_cloud: bool, decibels: float
) -> None:
    labels(settings, labelled(tmp_path / "real.laz", 30.0, 40.0))
    settings.real, settings.decibels = settings.real if has_cloud else "", decibels
    assert bpy.ops.synthroads.compare_intensities() == {"FINISHED"}
    bars = calibration.chart_bars(calibration.latest)
    names = [("Asphalt", "Real"), ("Asphalt", "Expected"), ("Paint White", "Real"), ("Paint White", "Expected")]
    assert [bar[:2] for bar in bars] == [name for name in names if has_cloud or name[1] == "Expected"]
    longest = max(bars, key=lambda bar: bar.median)
    assert longest.share == 1.0
    ordered = sorted(bars, key=lambda bar: bar.median)
    assert [bar.share for bar in ordered] == sorted(bar.share for bar in bars)
    assert ordered[0].share > 0.0
    if ordered[0].median > 0.0:
        assert [bar.share for bar in bars] == pytest.approx([bar.median / longest.median for bar in bars])
    percentiles = calibration.latest.compared[0].to_dict()["expected"]
    assert bars[int(has_cloud)].median == pytest.approx(percentiles["50"], rel=1e-3)
    if has_cloud:
        assert bars[0].median == pytest.approx(calibration.latest.compared[0].to_dict()["real"]["50"], rel=1e-3)
    monkeypatch.setattr(room, "sidebar_width", lambda: width)
    layout = drawn(calibration.SYNTHROADS_PT_calibration, bpy.context)
    texts = layout.texts(room.row_width())
    assert [text for text, place, needed in texts if needed > place] == []
    shown = [text for text, _, _ in texts]
    assert all(f"{bar.source} {bar.median:.3g}" in shown for bar in bars)
    whose = "of the cloud" if has_cloud else "of the device"
    assert f"Median intensity, units {whose}" in " ".join(shown)


@pytest.mark.parametrize(("width", "kind"), [(300.0, "column"), (600.0, "row")], ids=["as at first", "wide"])
def test_what_is_fitted_is_not_cut_off(settings: Any, monkeypatch: pytest.MonkeyPatch, width: float, kind: str) -> None:
    """The names stand side by side only where there is room: in the sidebar as it is at first there isn't."""
    monkeypatch.setattr(room, "sidebar_width", lambda: width)
    settings.real = "real.laz"
    layout = drawn(calibration.SYNTHROADS_PT_calibration, bpy.context)
    assert layout.place_of("parts") == kind


def test_materials_of_the_scene_are_this_roads(settings: Any) -> None:
    material("asphalt")
    item = next(item for item in bpy.data.materials if item.get("synthroads_material") == "asphalt")
    own = materials()["asphalt"].model_copy(update={"specular": 0.4})
    item["synthroads_mean"] = own.to_json()
    assert bpy.ops.synthroads.compare_intensities() == {"FINISHED"}
    assert calibration.latest.compared[0].before == own


def test_a_materials_image_is_its_texture(settings: Any) -> None:
    image = bpy.data.images.new("grains", 16, 8)
    image.pixels.foreach_set(np.tile([0.2, 0.2, 0.2, 1.0, 0.8, 0.8, 0.8, 1.0], 64).astype(np.float32))
    mine = bpy.data.materials.new("Mine")
    mine.use_nodes = True
    node = mine.node_tree.nodes.new("ShaderNodeTexImage")
    node.image = image
    shader = next(node for node in mine.node_tree.nodes if node.type == "BSDF_PRINCIPLED")
    mine.node_tree.links.new(node.outputs["Color"], shader.inputs["Base Color"])
    pixels = base_color_image(mine)
    assert pixels.shape == (8, 16, 3)
    assert np.unique(pixels.round(4)) == pytest.approx([0.0331, 0.6038], abs=2e-3)
    settings.classes[0].material = "Mine"
    settings.classes[0].texture = True
    settings.classes.remove(1)
    settings.angles = "0"
    assert bpy.ops.synthroads.compare_intensities() == {"FINISHED"}
    entry = calibration.latest.compared[0]
    assert entry.after.base_color[0] == pytest.approx(pixels.mean(), abs=1e-4)
    assert len(np.unique(entry.expected.round(9))) == 2


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("angles", "0 x", "Incidence is '0 x': must be numbers"),
        ("angles", "95", r"Incidence is \[95.0\]: must be 0 to below 90 degrees"),
        ("ranges", "", r"Ranges is \[\]: must be above 0"),
        ("real", "/nowhere/none.laz", "none.laz: no such file"),
        ("real", "text.laz", "text.laz: is not a LAS file"),
        ("real", "notes.txt", "must end in .laz"),
        ("real", ".", "is a folder, not a cloud|must end in .laz"),
    ],
)
@pytest.mark.parametrize("button", ["compare_intensities", "fit_materials"])
def test_what_is_wrong_is_said(settings: Any, tmp_path: Path, button: str, name: str, value: str, message: str) -> None:
    for file in ("text.laz", "notes.txt"):
        (tmp_path / file).write_text("no cloud")
    settings.real = str(labelled(tmp_path / "real.laz", 30.0, 40.0))
    setattr(settings, name, str(tmp_path / value) if name == "real" else value)
    for row in settings.classes:
        row.told = "1"
    assert re.search(message, refusal(button))


@pytest.mark.parametrize("button", ["compare_intensities", "fit_materials"])
@pytest.mark.parametrize(
    ("chosen", "message"),
    [
        ({"class_field": "nothing"}, "nothing"),
        ({"class_field": ""}, "Material asphalt is 40: no point has it"),
        ({"told": "99"}, "99"),
        ({"told": "no_such_class"}, "no_such_class"),
        ({"told": ""}, "Material asphalt is '': must be a number: the attribute has no names"),
        ({"material": "unobtainium"}, "must be a material of the table"),
        ({"material": "paint_white"}, "each material once"),
        ({"axis": "none.csv", "told": "paved"}, "none.csv"),
        ({"axis": "text.laz", "told": "paved"}, "text.laz"),
        ({"axis": "far.csv", "told": "paved"}, "0 points have an intensity, at least 200 are needed"),
        ({"axis": "far.csv", "told": "40"}, "must be paved or line beside an axis"),
        ({"axis": "far.csv", "paved": "1"}, "must be pairs FROM TO"),
        ({"axis": "far.csv", "lines": "x"}, "Lines is 'x': must be numbers"),
        ({"table": "text.laz"}, "text.laz"),
        ({"decibels": 0.5}, "Decibels is 0.5: must be 1 to 200 dB"),
    ],
)
def test_wrong_clouds_and_classes_are_a_sentence(
    settings: Any, tmp_path: Path, button: str, chosen: dict[str, Any], message: str
) -> None:
    labels(settings, labelled(tmp_path / "real.laz", 30.0, 40.0))
    (tmp_path / "text.laz").write_text("no cloud")
    (tmp_path / "far.csv").write_text("x,y,z\n90000,0,0\n90100,0,0\n90200,0,0\n")
    for name, value in chosen.items():
        owner = settings.classes[0] if name in ("told", "material") else settings
        setattr(owner, name, str(tmp_path / value) if name in ("axis", "table") else value)
    if chosen.get("told") == "paved":
        settings.classes[1].told = "line"
    assert message in refusal(button)
    assert calibration.latest is None


def refusal(button: str) -> str:
    """Return what a button refuses with: one sentence without options of the command line."""
    with pytest.raises(RuntimeError) as caught:
        getattr(bpy.ops.synthroads, button)()
    text = str(caught.value).strip()
    assert text.startswith("Error: "), text
    assert "\n" not in text, text
    assert "--" not in text, text
    return text


def test_a_texture_needs_an_image(settings: Any) -> None:
    settings.classes[0].texture = True
    with pytest.raises(RuntimeError, match="no image"):
        bpy.ops.synthroads.compare_intensities()


def test_it_can_be_stopped(settings: Any, tmp_path: Path) -> None:
    labels(settings, labelled(tmp_path / "real.laz", 30.0, 40.0))
    job = calibration.panel_job(settings.job(True))
    job.start()
    job.stop(wait=True)
    assert not job.running
    assert isinstance(job.error, Cancelled)


def test_buttons_say_what_they_need(settings: Any) -> None:
    assert not bpy.ops.synthroads.fit_materials.poll()
    assert bpy.ops.synthroads.compare_intensities.poll()
    settings.classes.clear()
    assert not bpy.ops.synthroads.compare_intensities.poll()


def test_nothing_is_left_when_unregistered(settings: Any) -> None:
    assert hasattr(bpy.types.Scene, "synthroads_calibration")
    synthroads_addon.unregister()
    assert not hasattr(bpy.types.Scene, "synthroads_calibration")
    synthroads_addon.register()
