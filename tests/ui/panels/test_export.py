"""Export from the panel: the same bytes as the library's, the edited road, and messages for what can't be written."""

import os
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import bpy
import pytest

import synthroads_addon
from synthroads_addon.base.errors import InputError
from synthroads_addon.blender.compat import set_modifier_input
from synthroads_addon.blender.model.read_back import edited_parameters
from synthroads_addon.blender.model.store import find_road, objects_of, recall_parameters
from synthroads_addon.cloud.formats import registry
from synthroads_addon.cloud.formats.registry import ENDINGS
from synthroads_addon.cloud.tools.convert import convert, subsample
from synthroads_addon.twin import formats as twin
from synthroads_addon.twin import geojson
from synthroads_addon.twin.formats import twin_file_names, write_twin
from synthroads_addon.ui.fields import room
from synthroads_addon.ui.panels import export, panels
from tests.helpers.clouds.random_points import make_points
from tests.helpers.scenes.fake_layout import FakeLayout, drawn
from tests.ui.panels.test_cloud_view import write

pytestmark = pytest.mark.any_blender


@pytest.fixture(autouse=True)
def settings() -> Iterator[Any]:
    """Register the add-on for one test; return the panel's settings."""
    synthroads_addon.register()
    yield bpy.context.scene.synthroads
    synthroads_addon.unregister()


def road() -> Any:
    collection = find_road(bpy.context.scene)
    assert collection
    return edited_parameters(recall_parameters(collection), objects_of(collection))


def build(settings: Any) -> None:
    settings.road.length, settings.seed = 120.0, 3
    bpy.ops.synthroads.build()
    set_modifier_input(bpy.data.objects["Road"].modifiers[0], "Right Lane 1 Width", 4.5)


@pytest.mark.parametrize("ending", ENDINGS)
@pytest.mark.parametrize("classes", ["own", "5"])
def test_a_converted_cloud_has_the_librarys_bytes(tmp_path: Path, ending: str, classes: str) -> None:
    source = write(tmp_path / "a.laz", make_points(120_000 if ending == ".laz" else 2_000))  # several blocks
    mine, theirs = (tmp_path / folder / f"cloud{ending}" for folder in ("mine", "theirs"))
    for path in (mine, theirs):
        path.parent.mkdir()
    assert bpy.ops.synthroads.export_cloud(source=str(source), filepath=str(mine), classes=classes) == {"FINISHED"}
    convert(source, theirs, None if classes == "own" else classes)
    assert mine.read_bytes() == theirs.read_bytes()


def test_a_thinned_cloud_has_the_librarys_bytes(tmp_path: Path) -> None:
    source = write(tmp_path / "a.laz", make_points(20_000))
    mine, theirs = tmp_path / "mine.laz", tmp_path / "theirs.laz"
    bpy.ops.synthroads.export_cloud(source=str(source), filepath=str(mine), classes="5", spacing=7.3)
    done = subsample(source, theirs, 7.3, "5")
    assert mine.read_bytes() == theirs.read_bytes()
    assert done["class_scheme"] == "5"
    assert 0 < done["points"] < 20_000


def test_without_a_source_it_is_the_last_scans(settings: Any, tmp_path: Path) -> None:
    settings.output = str(tmp_path)
    with pytest.raises(RuntimeError, match="scan first, or choose a cloud"):
        bpy.ops.synthroads.export_cloud(filepath=str(tmp_path / "b.ply"))
    write(tmp_path / "cloud.laz", make_points(100))
    bpy.ops.synthroads.export_cloud(filepath=str(tmp_path / "b.ply"))
    assert (tmp_path / "b.ply").read_bytes()[:3] == b"ply"


@pytest.mark.parametrize(
    ("source", "output", "message"),
    [
        ("missing.laz", "b.ply", "no such file"),
        ("a.laz", "b.txt", "b.txt"),
        ("a.laz", "a.laz", "must be another file than the input"),
        ("a.laz", "nowhere/b.ply", "there is no folder"),
        ("bad.laz", "b.ply", "is not a LAS file"),
    ],
)
def test_what_cannot_be_exported_is_a_message(tmp_path: Path, source: str, output: str, message: str) -> None:
    write(tmp_path / "a.laz", make_points(100))
    (tmp_path / "bad.laz").write_bytes(b"nothing" * 100)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    with pytest.raises(RuntimeError, match=message) as caught:
        bpy.ops.synthroads.export_cloud(source=str(tmp_path / source), filepath=str(tmp_path / output))
    assert "Traceback" not in str(caught.value)
    assert "--output" not in str(caught.value)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_the_model_is_of_the_edited_road(settings: Any, tmp_path: Path) -> None:
    build(settings)
    mine, theirs = tmp_path / "mine", tmp_path / "theirs"
    formats = {"cityjson", "opendrive", "geojson"}
    assert bpy.ops.synthroads.export_twin(directory=str(mine), formats=formats, tolerance=0.02) == {"FINISHED"}
    theirs.mkdir()
    write_twin(road(), theirs, sorted(formats), 0.02)
    assert road().carriageway("right").lanes[0].width == 4.5
    written = {path.name: path.read_text() for path in mine.iterdir()}
    assert written == {path.name: path.read_text() for path in theirs.iterdir()}
    assert sorted(written) == sorted(twin_file_names(formats))


def test_the_panel_knows_every_format() -> None:
    items = bpy.ops.synthroads.export_twin.get_rna_type().properties["formats"].enum_items
    assert [(item.identifier, item.name) for item in items] == [
        (name, entry.label) for name, entry in twin.FORMATS.items()
    ]


def test_models_are_replaced_only_if_asked_for(settings: Any, tmp_path: Path) -> None:
    build(settings)
    (tmp_path / "twin.xodr").write_text("mine")
    both = {"cityjson", "opendrive"}
    with pytest.raises(RuntimeError, match=r"already holds twin\.xodr; tick Replace Files"):
        bpy.ops.synthroads.export_twin(directory=str(tmp_path), formats=both)
    assert [path.name for path in tmp_path.iterdir()] == ["twin.xodr"]
    bpy.ops.synthroads.export_twin(directory=str(tmp_path), formats=both, overwrite=True)
    assert (tmp_path / "twin.xodr").read_text() != "mine"


def test_what_a_model_lacks_is_a_message(settings: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(twin.FORMATS, "ifc", replace(twin.FORMATS["ifc"], package="no_such_package"))
    with pytest.raises(RuntimeError, match="Build a road first"):
        bpy.ops.synthroads.export_twin(directory=str(tmp_path))
    build(settings)
    for arguments, message in (
        ({"formats": {"ifc"}, "directory": str(tmp_path)}, "needs the package no_such_package"),
        ({"formats": set(), "directory": str(tmp_path)}, "Formats: choose at least one"),
        ({"directory": " "}, "Folder: choose a folder"),
    ):
        with pytest.raises(RuntimeError, match=message) as caught:
            bpy.ops.synthroads.export_twin(**arguments)
        assert "Traceback" not in str(caught.value)
    assert list(tmp_path.iterdir()) == []


def test_the_model_goes_where_the_cloud_is(settings: Any, tmp_path: Path) -> None:
    there = f"{tmp_path}{os.sep}"
    for output, expected in ((tmp_path, there), (tmp_path / "new/er", there), (" ", "")):
        settings.output = str(output)
        operator = SimpleNamespace(directory="")
        export.SYNTHROADS_OT_export_twin.suggest(operator, bpy.context)
        assert operator.directory == expected
    export.SYNTHROADS_OT_export_twin.suggest(chosen := SimpleNamespace(directory="/mine/"), bpy.context)
    assert chosen.directory == "/mine/"
    settings.twin = {"ifc", "geojson"}
    export.SYNTHROADS_OT_export_twin.suggest(chosen, bpy.context)
    assert chosen.formats == {"ifc", "geojson"}


def test_a_format_that_fails_leaves_no_other(settings: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    build(settings)

    def fail(*arguments: Any) -> None:
        raise InputError("road", None, "cannot be said in GeoJSON")

    monkeypatch.setattr(geojson, "write_geojson", fail)
    with pytest.raises(RuntimeError, match="cannot be said in GeoJSON"):
        bpy.ops.synthroads.export_twin(directory=str(tmp_path), formats={"cityjson", "geojson"})
    assert list(tmp_path.iterdir()) == []


def test_the_panel_has_its_buttons() -> None:
    lines = "\n".join(drawn(export.SYNTHROADS_PT_export, bpy.context).lines)
    assert "synthroads.export_cloud" in lines
    assert "synthroads.export_twin" in lines


def test_formats_that_cannot_be_written_say_what_they_need(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(twin.FORMATS, "ifc", replace(twin.FORMATS["ifc"], package="no_such_package"))
    layout, known = FakeLayout(), bpy.ops.synthroads.export_twin.get_rna_type()
    export._draw_formats(layout, SimpleNamespace(bl_rna=known, formats={"geojson"}))
    text = " ".join(layout.lines)
    assert "[x] 'GeoJSON'" in text
    assert "[ ] 'CityJSON'" in text
    assert "no_such_package" in text
    assert "OpenDRIVE needs" not in text


def test_the_output_panel_says_what_chosen_formats_need(settings: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(twin.FORMATS, "ifc", replace(twin.FORMATS["ifc"], package="no_such_package"))
    monkeypatch.setattr(registry, "_PACKAGES", {".e57": "nor_this"})
    settings.twin, settings.cloud.formats = {"cityjson", "ifc"}, {"laz", "e57"}
    panel = next(one for one in panels.CLASSES if one.bl_idname == "SYNTHROADS_PT_output")
    monkeypatch.setattr(room, "sidebar_width", lambda: 600.0)
    said = "\n".join(drawn(panel, bpy.context).lines)
    assert "E57 needs the package nor_this:" in said
    assert "IFC needs the package no_such_package:" in said
    settings.twin, settings.cloud.formats = {"cityjson"}, {"laz"}
    assert "needs the package" not in "\n".join(drawn(panel, bpy.context).lines)


def test_as_an_extension_ifc_comes_by_one_of_its_own(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Where Blender has installed this as an extension nobody is asked for pip: a button takes SynthRoads IFC's zip."""
    monkeypatch.setattr(export, "RUNS_AS_EXTENSION", True)
    layout = FakeLayout()
    export._draw_missing_packages(layout, {"IFC": "ifcopenshell"})
    text = " ".join(layout.lines)
    assert "pip" not in text
    assert "synthroads.install_ifc" in text
    (tmp_path / "other.zip").write_bytes(b"zip")
    with pytest.raises(RuntimeError, match=r"choose the zip of SynthRoads IFC"):
        bpy.ops.synthroads.install_ifc(filepath=str(tmp_path / "other.zip"))
