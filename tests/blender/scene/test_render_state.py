"""The state that renders show is read, the viewport's on request, and the user's scene is left as it was."""

from __future__ import annotations

import bpy
import pytest

from synthroads_addon.blender.scene.evaluated import scanned_scene, scanned_scene_steps, scene_mesh
from synthroads_addon.blender.scene.foreign import open_scene
from synthroads_addon.blender.scene.render_state import shown_as
from tests.helpers.scenes.render_states import CASES, cube
from tests.helpers.scenes.scene_hash import changes, lines


@pytest.fixture(autouse=True)
def empty() -> None:
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)


@pytest.mark.any_blender
@pytest.mark.parametrize("name", CASES)
def test_what_renders_show_is_read_and_nothing_changes(name: str) -> None:
    case = CASES[name]
    case.build()
    bpy.context.view_layer.update()
    before = lines()
    scene = scanned_scene()
    assert changes(before) == []
    assert len(scene.static) == case.rendered
    assert len(scanned_scene(visible="viewport").static) == case.shown
    assert len(scene_mesh()) == case.rendered
    assert len(scene_mesh(visible="viewport")) == case.shown
    assert changes(before) == []
    if case.warning:
        assert any(case.warning in text for text in scene.warnings), scene.warnings
    else:
        assert scene.warnings == ()


@pytest.mark.parametrize("name", ["particles in part", "eye", "driven", "nodes that ask for the viewport"])
def test_a_file_is_read_as_it_was_saved(name: str, tmp_path) -> None:
    CASES[name].build()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    open_scene(tmp_path / "scene.blend")
    assert len(scene_mesh()) == CASES[name].rendered


def test_linked_objects_are_read_and_left_as_they_were(tmp_path) -> None:
    """Linked data can't be saved with the file, but is changed and put back like all else."""
    CASES["levels of a subdivision"].build()
    bpy.data.objects["Box"].hide_viewport = True
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "library.blend"))
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    with bpy.data.libraries.load(str(tmp_path / "library.blend"), link=True) as (_, wanted):
        wanted.objects = ["Box"]
    bpy.context.scene.collection.objects.link(wanted.objects[0])
    bpy.context.view_layer.update()
    before = lines()
    assert len(scene_mesh()) == CASES["levels of a subdivision"].rendered
    assert changes(before) == []


@pytest.mark.parametrize("name", ["eye", "particles in part", "animated", "collection's eye"])
def test_all_is_put_back_after_an_error(name: str) -> None:
    CASES[name].build()
    bpy.context.view_layer.update()
    before = lines()

    def fail() -> None:
        with shown_as("render", bpy.context.scene, bpy.context.view_layer) as differs:
            assert differs
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fail()
    assert changes(before) == []


def test_a_reading_that_is_given_up_leaves_nothing() -> None:
    """Between the steps of a reading, when a user may look, save or cancel, the scene is as he made it."""
    CASES["levels of a subdivision"].build()
    cube("Another").hide_set(True)
    bpy.context.view_layer.update()
    before = lines()
    steps = scanned_scene_steps()
    for _ in steps:
        assert changes(before) == []
    steps = scanned_scene_steps()
    next(steps, None)
    steps.close()
    assert changes(before) == []


def test_where_nothing_differs_each_mesh_is_read_in_a_step_of_its_own() -> None:
    for number in range(5):
        cube(f"Box {number}")
    bpy.context.view_layer.update()
    assert len(list(scanned_scene_steps())) == 5
    bpy.data.objects["Box 0"].hide_set(True)
    assert len(list(scanned_scene_steps())) == 0


_FBX = """; FBX 7.4.0 project file
FBXHeaderExtension:  {
	FBXVersion: 7400
}
Objects:  {
	Geometry: 1001, "Geometry::A", "Mesh" {
		Vertices: *12 {
			a: -1,-1,0,1,-1,0,1,1,0,-1,1,0
		}
		PolygonVertexIndex: *4 {
			a: 0,1,2,-4
		}
	}
	Model: 2001, "Model::Shown", "Mesh" {
	}
	Model: 2002, "Model::Hidden", "Mesh" {
		Properties70:  {
			P: "Visibility", "Visibility", "", "A",0
		}
	}
}
Connections:  {
	C: "OO",2001,0
	C: "OO",2002,0
	C: "OO",1001,2001
	C: "OO",1001,2002
}
"""
_USD = """#usda 1.0
(
    defaultPrim = "Root"
    upAxis = "Z"
)
def Xform "Root"
{
    def Cube "Shown"
    {
    }
    def Cube "Hidden"
    {
        token visibility = "invisible"
    }
    def Cube "Guide"
    {
        uniform token purpose = "guide"
    }
}
"""


@pytest.mark.any_blender
@pytest.mark.parametrize(("name", "text", "triangles"), [("hidden.fbx", _FBX, 2), ("hidden.usda", _USD, 12)])
def test_what_a_file_hides_is_not_read(name: str, text: str, triangles: int, tmp_path) -> None:
    """These kinds know one state alone: importers set that of the viewport, or leave out what is hidden."""
    (tmp_path / name).write_text(text)
    open_scene(tmp_path / name)
    assert len(scene_mesh()) == triangles
