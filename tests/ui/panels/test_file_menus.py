"""Files of roads in Blender's own menus, and dropped onto a 3D view."""

from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import bpy
import pytest

import synthroads_addon
from synthroads_addon.blender.model.store import find_road, recall_parameters
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.ui.panels import file_menus
from synthroads_addon.ui.work.job import running_job
from tests.helpers.roads.furnished_data import road_data
from tests.helpers.scenes.fake_layout import FakeLayout
from tests.helpers.scenes.panel_road import wait_for_end


@pytest.fixture(autouse=True)
def add_on() -> Iterator[None]:
    """Register the add-on for one test."""
    synthroads_addon.register()
    yield
    synthroads_addon.unregister()


def drawn(draw: Any) -> str:
    layout = FakeLayout()
    draw(SimpleNamespace(layout=layout), bpy.context)
    return "\n".join(layout.lines)


def test_the_menus_have_the_files() -> None:
    assert "synthroads.load_road" in drawn(file_menus._draw_import)
    assert "synthroads.load_axis" in drawn(file_menus._draw_import)
    for name in ("save_road", "export_twin", "export_cloud"):
        assert f"synthroads.{name}" in drawn(file_menus._draw_export)
    names = [function.__name__ for function in bpy.types.TOPBAR_MT_file_import._dyn_ui_initialize()]
    assert names.count("_draw_import") == 1


@pytest.mark.parametrize(
    ("handler", "ending"),
    [("SYNTHROADS_FH_parameters", ".json"), ("SYNTHROADS_FH_axis", ".geojson"), ("SYNTHROADS_FH_cloud", ".laz")],
)
def test_blender_knows_who_takes_a_dropped_file(handler: str, ending: str) -> None:
    known = bpy.types.FileHandler.bl_rna_get_subclass_py(handler)
    assert ending in known.bl_file_extensions.split(";")
    module, name = known.bl_import_operator.split(".")
    properties = getattr(getattr(bpy.ops, module), name).get_rna_type().properties
    assert "filepath" in properties
    area = next(area for area in bpy.context.screen.areas if area.type == "VIEW_3D")
    with bpy.context.temp_override(area=area):
        assert known.poll_drop(bpy.context)


def test_a_dropped_parameter_set_is_built_at_once(tmp_path: Path) -> None:
    """Blender runs this operator of its own for files that are dropped onto a 3D view."""
    road = RoadParameters.from_dict(road_data({}, 30.0))
    (tmp_path / "parameters.json").write_text(road.to_json(), encoding="utf-8")
    area = next(area for area in bpy.context.screen.areas if area.type == "VIEW_3D")
    with bpy.context.temp_override(area=area):
        bpy.ops.wm.drop_import_file("INVOKE_DEFAULT", directory=f"{tmp_path}/", files=[{"name": "parameters.json"}])
    if (job := running_job()) is not None:
        wait_for_end(job)
    root = find_road(bpy.context.scene)
    assert root is not None
    assert recall_parameters(root) == road


def test_a_cloud_is_imported_as_a_road() -> None:
    assert "synthroads.road_from_scan" in drawn(file_menus._draw_import)
