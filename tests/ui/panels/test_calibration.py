"""The panel "Calibration": its buttons do what the library does, and leave nothing behind."""

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
from synthroads_addon.ui.panels import calibration
from tests.helpers.clouds.calibration_cloud import labelled, striped


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
    assert "50 zeros left out" in lines[1]
    assert lines[-1].startswith("Error / IQR: ")
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
        ("angles", "0 x", "Incidence"),
        ("angles", "95", "--incidence-deg"),
        ("ranges", "", "--range"),
        ("real", "/nowhere/none.laz", "none.laz"),
    ],
)
def test_what_is_wrong_is_said(settings: Any, name: str, value: str, message: str) -> None:
    setattr(settings, name, value)
    for row in settings.classes:
        row.told = "1"
    with pytest.raises(RuntimeError, match=message):
        bpy.ops.synthroads.compare_intensities()


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
