"""Export from the panel: the same bytes as the library's, the edited road, and messages for what can't be written."""

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import bpy
import pytest

import synthroads_addon
from synthroads_addon.base.errors import Cancelled, InputError
from synthroads_addon.blender.compat import set_modifier_input
from synthroads_addon.blender.model.read_back import edited_parameters
from synthroads_addon.blender.model.store import find_road, objects_of, recall_parameters
from synthroads_addon.cloud.formats import registry
from synthroads_addon.cloud.formats.registry import ENDINGS
from synthroads_addon.cloud.tools.convert import convert, subsample
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.road import RoadScenario
from synthroads_addon.twin import formats as twin
from synthroads_addon.twin import geojson
from synthroads_addon.twin.formats import IfcSettings, twin_file_names, write_twin
from synthroads_addon.ui.fields import room
from synthroads_addon.ui.panels import export, panels
from synthroads_addon.ui.work import common
from tests.helpers.clouds.random_points import make_points
from tests.helpers.scenes.fake_layout import FakeLayout, drawn
from tests.judges.registry import require
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
    settings.road.length, settings.road.half_width, settings.seed = 60.0, 20.0, 3
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
        ("a.laz", "bad.laz/b.ply", "cannot be written"),
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


def test_a_model_of_ifc_tells_how_far_it_is_and_is_cancelled_in_the_middle(tmp_path: Path) -> None:
    require("ifcopenshell")
    long = sample_road(RoadScenario(length=300.0), 1)
    wanted = (["geojson", "ifc"], 0.02, IfcSettings(), False, False)
    shares: list[float] = []
    assert export.export_twin(long, tmp_path / "all", *wanted, shares.append) == twin_file_names(["geojson", "ifc"])
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    assert len({round(share, 3) for share in shares}) > 30

    def stop(share: float) -> None:
        if share > 0.5:
            raise Cancelled("Export was cancelled")

    with pytest.raises(Cancelled):
        export.export_twin(long, tmp_path / "none", *wanted, stop)
    assert not (tmp_path / "none").exists()


def test_opendrive_may_have_a_projection_about_the_site(settings: Any, tmp_path: Path) -> None:
    build(settings)
    mine, theirs = tmp_path / "mine", tmp_path / "theirs"
    words = {"directory": str(mine), "formats": {"opendrive"}, "local_projection": True}
    assert bpy.ops.synthroads.export_twin(**words) == {"FINISHED"}
    theirs.mkdir()
    write_twin(road(), theirs, ["opendrive"], local_projection=True)
    assert (mine / "twin.xodr").read_text() == (theirs / "twin.xodr").read_text()
    assert "<offset" not in (mine / "twin.xodr").read_text()


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
    monkeypatch.setattr(common, "RUNS_AS_EXTENSION", True)
    layout = FakeLayout()
    export._draw_missing_packages(layout, {"IFC": "ifcopenshell"})
    text = " ".join(layout.lines)
    assert "pip" not in text
    assert "synthroads.install_ifc" in text
    (tmp_path / "other.zip").write_bytes(b"zip")
    with pytest.raises(RuntimeError, match=r"choose the zip of SynthRoads IFC"):
        bpy.ops.synthroads.install_ifc(filepath=str(tmp_path / "other.zip"))


# --- packages that the extension doesn't bring ------------------------------------------------------------------------

SOURCE = Path(synthroads_addon.__file__).parent
REGISTERED_WITHOUT_E57 = """
import os, sys
sys.modules["pye57"] = None
import bpy
import synthroads_addon
synthroads_addon.register()
from synthroads_addon.ui.panels import cloud_view, file_menus
chosen = bpy.ops.synthroads.export_cloud.get_rna_type().properties
found = bpy.ops.synthroads.road_from_scan.get_rna_type().properties
shown = cloud_view.SYNTHROADS_PG_cloud_view.bl_rna.properties["file"].description
dropped = file_menus.SYNTHROADS_FH_cloud.bl_file_extensions
print("\\nOFFERED", chosen["format"].enum_items.keys(), chosen["filter_glob"].default, found["filter_glob"].default)
print("OFFERED", shown, dropped, flush=True)
os._exit(0)  # without Blender's teardown, in which a process can hang
"""


def test_every_missing_package_has_its_words_in_blender() -> None:
    """No other message than these names pip, and each of their extras has a sentence for the extension."""
    texts = {path.relative_to(SOURCE).as_posix(): path.read_text(encoding="utf-8") for path in SOURCE.rglob("*.py")}
    naming = {name for name, text in texts.items() if "pip install" in text}
    assert naming == {"base/errors.py", "ui/panels/export.py"}
    extras = {extra for text in texts.values() for extra in re.findall(r'MissingPackageError\([^)]*"(\w+)"\)', text)}
    assert extras == {"twin", "e57", "maps", "cluster", "changes"}
    assert set(common.IN_BLENDER) == extras


def test_in_the_extension_no_message_names_pip(settings: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    settings.road.length, settings.road.half_width, settings.output = 40.0, 20.0, str(tmp_path / "out")
    settings.scan.own_lines_per_second, settings.scan.lines_per_second = True, 20.0
    bpy.ops.synthroads.build()
    laz, e57 = write(tmp_path / "a.laz", make_points(2_000)), write(tmp_path / "b.e57", make_points(2_000))
    (tmp_path / "map.osm.pbf").write_bytes(b"\x00\x00\x00\x0e\x0a\x09OSMHeader\x18\x00")
    for package in ("pye57", "ifcopenshell", "osmium"):
        monkeypatch.setitem(sys.modules, package, None)
    bpy.ops.synthroads.add_calibration_class()
    bpy.context.scene.synthroads_calibration.real = str(e57)
    settings.cloud.formats = {"laz", "e57"}
    calls = {
        "show_cloud": ("e57", {"filepath": str(e57)}),
        "road_from_scan": ("e57", {"filepath": str(e57)}),
        "export_cloud": ("e57", {"source": str(laz), "filepath": str(tmp_path / "c.e57")}),
        "compare_intensities": ("e57", {}),
        "fit_materials": ("e57", {}),
        "export_twin": ("twin", {"directory": str(tmp_path), "formats": {"ifc"}}),
        "scan": ("e57", {}),
        "load_axis": ("maps", {"filepath": str(tmp_path / "map.osm.pbf")}),
    }
    for installed, words in ((False, "pip install 'synthroads"), (True, "")):
        monkeypatch.setattr(common, "RUNS_AS_EXTENSION", installed)
        for name, (extra, arguments) in calls.items():
            with pytest.raises(RuntimeError) as caught:
                getattr(bpy.ops.synthroads, name)(**arguments)
            text = str(caught.value).strip()
            assert (words or common.IN_BLENDER[extra]) in text, (name, text)
            assert "\n" not in text, name
            assert ("pip" in text) != installed, (name, text)
        assert not (tmp_path / "out").exists(), "a scan is refused before it begins"
    settings.cloud.formats, settings.twin = {"laz"}, {"ifc"}
    with pytest.raises(RuntimeError, match=re.escape(common.IN_BLENDER["twin"])):
        bpy.ops.synthroads.scan()
    settings.cloud.formats = {"laz", "e57"}
    monkeypatch.setattr(room, "sidebar_width", lambda: 900.0)
    for panel in panels.CLASSES:
        assert "pip install" not in "\n".join(drawn(panel, bpy.context).lines), panel


def test_a_format_whose_package_is_missing_is_not_offered(settings: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    panel = next(one for one in panels.CLASSES if one.bl_idname == "SYNTHROADS_PT_output")
    assert "'E57'" in "\n".join(drawn(panel, bpy.context).lines)
    monkeypatch.setitem(sys.modules, "pye57", None)
    assert "'E57'" not in "\n".join(drawn(panel, bpy.context).lines)
    settings.cloud.formats = {"laz", "e57"}
    assert "[x] 'E57'" in "\n".join(drawn(panel, bpy.context).lines), "what is chosen is shown, to be taken away"


def test_without_its_package_no_file_dialog_offers_e57() -> None:
    command = [sys.executable, "-c", REGISTERED_WITHOUT_E57]
    answer = subprocess.run(command, cwd=SOURCE.parent, capture_output=True, text=True, check=False)
    offered = [line for line in answer.stdout.splitlines() if line.startswith("OFFERED")]
    assert len(offered) == 2, answer.stderr
    assert all(".laz" in line and "e57" not in line.lower() for line in offered)
