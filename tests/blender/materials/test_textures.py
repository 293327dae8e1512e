"""Materials whose layers images give: where they lie, what their means are, and what files keep of them."""

from __future__ import annotations

import shutil
from pathlib import Path

import bpy
import numpy as np
import pytest

from synthroads_addon.base.arrays import Float
from synthroads_addon.base.errors import InputError
from synthroads_addon.blender.cameras.stage import Passes, new_stage
from synthroads_addon.blender.files import empty_file, save_scene
from synthroads_addon.blender.materials import LOOK, RoadMaterials, constants
from synthroads_addon.blender.materials.calculable import material_needs
from synthroads_addon.blender.materials.inputs import POSITION, TRUE_NORMAL
from synthroads_addon.blender.materials.textures import SOURCE, packed_textures
from synthroads_addon.blender.model.build import build_road
from synthroads_addon.blender.things.model_builder import BuildRequest
from synthroads_addon.materials.table import materials
from synthroads_addon.materials.textures import texture_sets
from synthroads_addon.materials.variation import vary_material
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.surroundings import Environment, MaterialVariation
from tests.helpers.scenes.cycles import calculator
from tests.helpers.scenes.small_road import build_small, small_parameters
from tests.helpers.scenes.texture_folder import (
    BRIGHT,
    DARK,
    ROUGH,
    SMOOTH,
    checkerboard,
    fields_at,
    halves,
    linear,
    plain,
    write_set,
)

DRY = Environment()


def variation_of(folder: Path, **further: float) -> MaterialVariation:
    """Return a variation with the first set of each material in a folder of textures."""
    return MaterialVariation(textures=tuple(sets[0] for sets in texture_sets(str(folder)).values()), **further)


def material_of(folder: Path, name: str, **further: float) -> bpy.types.Material:
    """Return a material with the textures of a folder."""
    return RoadMaterials(variation_of(folder, **further), DRY).material(name)


def test_elsewhere_images_lie_by_the_place_in_the_world_on_each_side_of_a_box(tmp_path: Path) -> None:
    write_set(tmp_path / "bridge_concrete", 3.0, base_color=checkerboard(), roughness=halves())
    item = material_of(tmp_path, "bridge_concrete")
    assert material_needs(item).obstacles == ()
    rng = np.random.default_rng(5)
    place = rng.uniform(-20.0, 20.0, (6000, 3))
    normal = np.repeat(np.array([[0.2, 0.1, 0.9], [-0.8, 0.3, 0.1], [0.3, -0.7, 0.2]]), 2000, axis=0)
    feed = {POSITION: place, TRUE_NORMAL: normal}
    with calculator({0: item}, ("base_color", "roughness")) as work:
        asked = {what: np.zeros((len(place), 4), np.float32) for what in work.inputs_of(0)}
        for what, values in feed.items():
            asked[what][:, :3] = values
        found = work.calculate(np.zeros(len(place), np.intp), asked)
    across = np.concatenate([place[:2000, 0], place[2000:4000, 1], place[4000:, 0]])
    upwards = np.concatenate([place[:2000, 1], place[2000:, 2]])
    dark, smooth, certain = fields_at(across, upwards, 3.0)
    assert certain.mean() > 0.8
    expected = np.where(dark[:, None], linear(DARK), linear(BRIGHT))
    assert found["base_color"][certain] == pytest.approx(expected[certain], abs=2e-5)
    expected = np.where(smooth, SMOOTH, ROUGH) / 255.0
    assert found["roughness"][certain, 0] == pytest.approx(expected[certain], abs=2e-5)


def test_an_images_mean_takes_the_tables_place_and_age_changes_it_as_that(tmp_path: Path) -> None:
    write_set(tmp_path / "asphalt", base_color=plain(*BRIGHT), specular=plain(26, 26, 26), metallic=plain(51, 0, 0))
    item = material_of(tmp_path, "asphalt", asphalt_brightness=0.5)
    mean = constants(["asphalt"])["asphalt"]
    assert item.name == "SR asphalt"
    assert mean.base_color == pytest.approx(0.5 * linear(BRIGHT), abs=1e-3)
    assert (mean.specular, mean.metallic) == pytest.approx((0.5 * 26 / 255, 0.2), abs=1e-3)
    table = materials()["asphalt"]
    assert (mean.roughness, mean.facet_slope) == (table.roughness, table.facet_slope)
    worn = RoadMaterials(variation_of(tmp_path, paint_wear=0.9), DRY)
    worn.material("paint_white")
    bare = vary_material("paint_white", MaterialVariation(paint_wear=0.9), DRY)
    # Where the film is gone the pavement shows, as its image has it.
    assert constants(["paint_white"])["paint_white"].base_color[0] > bare.base_color[0] + 0.2


def test_changed_images_make_new_materials_and_those_no_road_uses_go(tmp_path: Path) -> None:
    write_set(tmp_path / "asphalt", base_color=plain(*DARK))
    road = small_parameters(20.0).model_copy(update={"materials": variation_of(tmp_path)})
    build_small(road, parts=("road",))
    first = bpy.data.materials["SR asphalt"][LOOK]
    build_small(road, parts=("road",))
    assert [image.name for image in bpy.data.images if SOURCE in image] == ["SR asphalt base_color"]
    assert bpy.data.materials["SR asphalt"][LOOK] == first
    write_set(tmp_path / "asphalt", base_color=checkerboard())
    build_small(road, parts=("road",))
    assert bpy.data.materials["SR asphalt"][LOOK] != first
    assert [tuple(image.size) for image in bpy.data.images if SOURCE in image] == [(64, 64)]
    build_small(road.model_copy(update={"materials": MaterialVariation()}), parts=("road",))
    assert not [image for image in bpy.data.images if SOURCE in image]


def test_a_saved_road_keeps_its_images_and_is_built_anew_with_them(tmp_path: Path) -> None:
    """As a job saves it: without the folder."""
    write_set(tmp_path / "textures" / "asphalt", base_color=checkerboard())
    road = small_parameters(20.0).model_copy(update={"materials": variation_of(tmp_path / "textures")})
    build_small(road, parts=("road",))
    image = bpy.data.images["SR asphalt base_color"]
    with packed_textures():
        save_scene(tmp_path / "scene.blend")
    assert image.packed_file is None
    shutil.rmtree(tmp_path / "textures")
    empty_file()
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "scene.blend"))
    kept = bpy.data.materials["SR asphalt"][LOOK]
    node = next(node for node in bpy.data.materials["SR asphalt"].node_tree.nodes if node.type == "TEX_IMAGE")
    assert linear(DARK) == pytest.approx(np.array(node.image.pixels[:3]) ** 2.2, abs=0.02)
    build_small(road, parts=("road",))
    assert bpy.data.materials["SR asphalt"][LOOK] == kept
    empty_file()
    with pytest.raises(InputError, match="a folder of textures is needed here"):
        build_small(road, parts=("road",))


def test_damaged_images_and_unknown_materials_leave_the_file_as_it_was(tmp_path: Path) -> None:
    write_set(tmp_path / "asphalt", base_color=plain(*DARK))
    image = tmp_path / "asphalt" / "base_color.png"
    image.write_bytes(image.read_bytes()[:20])
    road = small_parameters(20.0).model_copy(update={"materials": variation_of(tmp_path)})
    with pytest.raises(InputError, match=r"base_color.png: cannot be read as an image"):
        build_small(road, parts=("road",))
    assert not bpy.data.images
    texture = road.materials.textures[0].model_copy(update={"material": "ashpalt"})
    with pytest.raises(InputError, match=r"material is 'ashpalt': must be a material of the table \(did you mean 'asp"):
        RoadMaterials(MaterialVariation(textures=(texture,)), DRY)


@pytest.mark.parametrize("name", ["asphalt", "terrain"])
def test_a_normal_image_turns_the_surface_along_its_sides(tmp_path: Path, name: str) -> None:
    """Its red leans along the road, its green to the left; elsewhere to the east and to the north."""
    lean = np.array([0.4, -0.2, np.sqrt(1.0 - 0.4**2 - 0.2**2)])
    material = "asphalt" if name == "asphalt" else "grass_ground"
    write_set(tmp_path / material, normal=plain(*np.round((lean + 1.0) / 2.0 * 255.0).astype(int)))
    road = small_parameters(60.0).model_copy(update={"materials": variation_of(tmp_path)})
    data = road.to_dict()
    data["objects"]["right"]["pavement"] = {"joint_depth": 0.0, "wheel_track_depth": 0.0}
    road = type(road).from_dict(data)
    model = build_road(BuildRequest(road, 0.005, 0.0, ("road",) if name == "asphalt" else ("road", "terrain")))
    item = bpy.data.materials[f"SR {material}"]
    shown = next(node for node in item.node_tree.nodes if node.type == "BSDF_PRINCIPLED").inputs["Normal"]
    output = next(node for node in item.node_tree.nodes if node.type == "OUTPUT_AOV" and node.aov_name == "base_color")
    item.node_tree.links.new(shown.links[0].from_socket, output.inputs["Color"])
    geometry = RoadGeometry(road)
    station, offset = np.array([30.0]), np.array([-8.0 if name == "asphalt" else -40.0])
    middle = geometry.alignment.place(station, offset)[0] + road.transform.translate[:2] - model.origin[:2]
    thing = model.objects["Road" if name == "asphalt" else "Terrain"]
    seen = _seen_from_above(tmp_path, thing, middle)
    _, heading, _ = geometry.alignment.frame(station)
    turn = float(heading[0]) if name == "asphalt" else 0.0
    forwards, left = np.array([np.cos(turn), np.sin(turn)]), np.array([-np.sin(turn), np.cos(turn)])
    normal = item.node_tree.nodes.new("ShaderNodeNewGeometry").outputs["Normal"]
    item.node_tree.links.new(normal, output.inputs["Color"])
    flat = _seen_from_above(tmp_path, thing, middle)
    leaning = (seen - flat)[:, :2]
    found = np.array([np.median(leaning @ forwards), np.median(leaning @ left)])
    assert flat[:, 2].min() > 0.9
    assert found == pytest.approx(lean[:2], abs=0.06)


def _seen_from_above(folder: Path, item: bpy.types.Object, middle: Float) -> Float:
    """Return the layer of the base colour (N, 3) of half a metre of an object around a place in plan (2,), m."""
    with new_stage(Passes(("base_color",), lit=False), folder, [item]) as stage:
        stage.camera.data.type, stage.camera.data.ortho_scale = "ORTHO", 0.5
        stage.camera.data.clip_end, stage.camera.location = 1000.0, (*middle, 100.0)
        return stage.render(8, 8).layers["base_color"].reshape(-1, 3).astype(np.float64)
