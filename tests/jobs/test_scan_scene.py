"""`synthroads scan`: scenes that others made, their classes, paths, wrong inputs; and the scene stays as it was."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import bpy
import laspy
import numpy as np
import pytest

from headless.cli import main
from headless.commands import command
from synthroads_addon.base.classes import class_id
from synthroads_addon.base.remarks import collected_remarks
from synthroads_addon.blender.files import empty_file
from synthroads_addon.blender.model.build import build_road
from synthroads_addon.blender.model.store import remember
from synthroads_addon.blender.scene.evaluated import scene_mesh
from synthroads_addon.blender.scene.foreign import open_scene
from synthroads_addon.blender.things.model_builder import BuildRequest
from synthroads_addon.cloud.formats.registry import open_cloud
from synthroads_addon.jobs.open_scene import ForeignScene
from synthroads_addon.jobs.scan_scene import SceneScan, scan_scene
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scanning.platforms.over_scene import path_over
from synthroads_addon.scanning.platforms.tripod import Tripod, TripodPath
from synthroads_addon.scenario.scenario import Scenario, load_scenario
from tests.helpers.scenes.scene_hash import digest

ROOT = Path(__file__).parents[2]
DRAFT = ["--set", "scan.noise.range_sigma=0", "--set", "scan.lines_per_second=50", "--rays", "1"]
DRAFT += ["--set", "colour.source=material", "--set", 'outputs=["cloud"]']


def primitives() -> None:
    """Make a scene of a ground of 40 m x 20 m at z = 1 with three boxes: two pillars and one named after nothing."""
    bpy.ops.mesh.primitive_plane_add(size=1.0, location=(0.0, 0.0, 1.0))
    ground = bpy.context.object
    ground.name, ground.scale = "Floor", (40.0, 20.0, 1.0)
    tar = bpy.data.materials.new("Tar")
    if tar.node_tree is None:
        tar.use_nodes = True
    ground.data.materials.append(tar)
    for number, x in enumerate((-10.0, 10.0)):
        bpy.ops.mesh.primitive_cube_add(size=2.0, location=(x, 3.0, 3.0))
        bpy.context.object.name = f"Pillar.{number}"
    bpy.ops.mesh.primitive_cube_add(size=2.0, location=(0.0, -4.0, 2.0))
    bpy.context.object.name = "Thing"
    bpy.context.object.rotation_euler = (0.0, 0.0, 0.4)
    for item in bpy.data.objects:
        item.data.name = item.name  # some kinds of files keep only the meshes' names
    bpy.context.view_layer.update()


def write_scene(path: Path) -> Path:
    """Write the open scene to a file, by Blender's own exporter for its kind."""
    place = str(path)
    suffix = path.suffix
    if suffix in (".glb", ".gltf"):
        bpy.ops.export_scene.gltf(filepath=place, export_format="GLB" if suffix == ".glb" else "GLTF_SEPARATE")
    elif suffix == ".fbx":
        bpy.ops.export_scene.fbx(filepath=place)
    elif suffix == ".blend":
        bpy.ops.wm.save_as_mainfile(filepath=place, copy=True)
    else:
        operators = {".obj": "obj_export", ".ply": "ply_export", ".stl": "stl_export", ".usda": "usd_export"}
        getattr(bpy.ops.wm, operators[suffix])(filepath=place)
    return path


@pytest.fixture
def scene(tmp_path: Path) -> Callable[[str], Path]:
    """Return a function that writes the scene of primitives to a file of a kind."""

    def write(suffix: str) -> Path:
        primitives()
        return write_scene(tmp_path / f"yard{suffix}")

    return write


@pytest.fixture
def mapping(tmp_path: Path) -> Path:
    path = tmp_path / "classes.json"
    path.write_text(json.dumps({"objects": {"Pillar*": "pole", "Floor": "road"}, "materials": {"Nothing*": "bridge"}}))
    return path


def scan(scene: Path, output: Path, *arguments: str | Path) -> laspy.LasData:
    """Run the command in this process and return the cloud."""
    assert command("scan", [str(scene), "--output", str(output), *DRAFT, *map(str, arguments), "--quiet"]) == 0
    return laspy.read(output / "cloud.laz")


def report(output: Path) -> dict:
    return json.loads((output / "report.json").read_text())


# Kinds of files


@pytest.mark.parametrize("suffix", [".blend", ".glb", ".gltf", ".obj", ".fbx", ".usda"])
def test_scenes_of_others_are_scanned_with_their_classes(
    suffix: str, scene: Callable[[str], Path], mapping: Path, tmp_path: Path
) -> None:
    file = scene(suffix)
    before = file.read_bytes()
    las = scan(file, tmp_path / "out", "--height", "30", "--classes", mapping)
    assert file.read_bytes() == before
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["classes.json", "cloud.laz", "report.json"]
    label, xyz = np.array(las.class_id), las.xyz
    assert set(np.unique(label)) == {class_id("road"), class_id("pole"), 255}
    floor = xyz[label == class_id("road")]
    assert np.abs(floor[:, 2] - 1.0).max() < 0.002
    assert np.allclose([floor.min(axis=0)[:2], floor.max(axis=0)[:2]], [[-20, -10], [20, 10]], atol=0.5)
    pillars = xyz[label == class_id("pole")]
    assert np.isclose(pillars[:, 2].max(), 4.0, atol=0.002)
    assert np.abs(np.abs(pillars[:, 0]) - 10.0).max() < 1.002
    thing = xyz[label == 255]
    assert np.linalg.norm(thing[:, :2] - [0.0, -4.0], axis=1).max() < np.sqrt(2.0) + 0.002
    open_classes = tmp_path / "out" / "classes.json"
    assert set(json.loads(open_classes.read_text())["objects"].values()) == {""}
    for kind in (floor, pillars, thing):
        assert len(kind) > 100
    assert len(np.unique(las.instance_id)) == 4
    remedy = f"fill in {open_classes} and scan with --classes {open_classes} --overwrite"
    assert report(tmp_path / "out")["warnings"] == [
        f"{mapping}: nothing in the scene is named as in materials: Nothing*",
        f"{len(thing):,} points have no class: {remedy}",
    ]


def test_what_has_no_class_is_said_before_the_scan_with_a_file_to_fill_in(
    scene: Callable[[str], Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    file, output = scene(".blend"), tmp_path / "out"
    words = ["scan", str(file), "--output", str(output), *DRAFT, "--height", "30"]

    def stopped(*_: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(ForeignScene, "scan", stopped)
        assert main(words) == 130
    said = capsys.readouterr().err
    assert "warning: 4 of 4 objects have no class, and their points will have none: " in said
    assert "objects Floor, Pillar.*, Thing; materials Tar" in said
    assert f"Fill in {output / 'classes.json'} and scan with --classes {output / 'classes.json'} --overwrite" in said
    classes = json.loads((output / "classes.json").read_text())
    assert classes == {
        "objects": {"Floor": "", "Pillar.*": "", "Thing": ""},
        "materials": {"Tar": ""},
        "collections": {},
    }
    classes["objects"] |= {"Floor": "road", "Pillar.*": "pole"}  # one is left open
    (output / "classes.json").write_text(json.dumps(classes))
    assert main([*words, "--classes", str(output / "classes.json")]) == 0
    said = capsys.readouterr().err
    assert "warning: 1 of 4 objects have no class" in said
    assert "none: objects Thing. Fill in " in said
    las = laspy.read(output / "cloud.laz")
    assert set(np.unique(np.array(las.class_id))) == {class_id("road"), class_id("pole"), 255}
    assert json.loads((output / "classes.json").read_text()) == classes, "what was filled in stays"
    classes["objects"]["Thing"] = "utility"
    (output / "classes.json").write_text(json.dumps(classes))
    assert main([*words, "--classes", str(output / "classes.json"), "--overwrite"]) == 0
    assert "no class" not in "".join(capsys.readouterr())


@pytest.mark.parametrize("suffix", [".ply", ".stl"])
def test_single_meshes_are_scanned(suffix: str, scene: Callable[[str], Path], tmp_path: Path) -> None:
    las = scan(scene(suffix), tmp_path / "out", "--height", "30")
    assert np.isclose(np.median(las.z), 1.0, atol=0.002)
    assert np.isclose(las.z.max(), 4.0, atol=0.002)


def labelled_ply(path: Path, kind: str, names: tuple[str, str]) -> Path:
    """Write two squares of class 3 and 5 at heights 0 and 4, their labels being properties of the vertices."""
    rows = np.zeros(8, dtype=[(axis, "<f4") for axis in "xyz"] + [(names[0], kind), (names[1], "<i4")])
    for number, (x, label, instance) in enumerate(((-6.0, 3, 70), (6.0, 5, 80))):
        square = rows[4 * number : 4 * number + 4]
        square["x"], square["y"] = x + np.array([-4, 4, 4, -4]), [-4, -4, 4, 4]
        square["z"], square[names[0]], square[names[1]] = 4 * number, label, instance
    words = {"<f4": "float", "u1": "uchar", "<i4": "int"}
    head = ["ply", "format binary_little_endian 1.0", "element vertex 8", *(f"property float {axis}" for axis in "xyz")]
    head += [f"property {words[kind]} {names[0]}", f"property int {names[1]}", "element face 2"]
    head += ["property list uchar int vertex_indices", "end_header", ""]
    faces = np.array([(4, (0, 1, 2, 3)), (4, (4, 5, 6, 7))], dtype=[("n", "u1"), ("of", "<i4", 4)])
    path.write_bytes("\n".join(head).encode() + rows.tobytes() + faces.tobytes())
    return path


@pytest.mark.parametrize("kind", ["u1", "<i4", "<f4"])
@pytest.mark.parametrize("prefix", ["", "scalar_"])
def test_labels_of_a_ply_meshs_vertices_are_those_of_its_faces(tmp_path: Path, prefix: str, kind: str) -> None:
    open_scene(labelled_ply(tmp_path / "a.ply", kind, (f"{prefix}class_id", f"{prefix}instance_id")))
    mesh = scene_mesh()
    height = mesh.vertices[mesh.triangles[:, 0], 2] + mesh.origin[2]
    assert set(mesh.class_id[height < 2]) == {3}
    assert set(mesh.class_id[height > 2]) == {5}
    assert set(mesh.instance_id[height > 2]) == {80}


@pytest.mark.parametrize("suffix", [".glb", ".gltf"])
@pytest.mark.parametrize("name", ["_CLASS_ID", "_class_id"])
@pytest.mark.parametrize("kind", ["INT", "FLOAT"])
def test_labels_of_gltf_are_read(tmp_path: Path, name: str, kind: str, suffix: str) -> None:
    primitives()
    for item in bpy.data.objects:
        attribute = item.data.attributes.new(name, kind, "POINT")
        attribute.data.foreach_set("value", [7 if "Pillar" in item.name else 1] * len(item.data.vertices))
    path = tmp_path / f"yard{suffix}"
    form = "GLB" if suffix == ".glb" else "GLTF_SEPARATE"
    bpy.ops.export_scene.gltf(filepath=str(path), export_format=form, export_attributes=True)
    open_scene(path)
    mesh = scene_mesh()
    east = np.abs((mesh.vertices[mesh.triangles[:, 0]] + mesh.origin)[:, 0])
    assert set(mesh.class_id) == {1, 7}
    assert (mesh.class_id[(east > 8.5) & (east < 11.5)] == 7).all()


def test_a_face_between_classes_is_told(tmp_path: Path) -> None:
    path = labelled_ply(tmp_path / "a.ply", "u1", ("class_id", "instance_id"))
    data = bytearray(path.read_bytes())
    data[data.index(b"end_header") + 11 + 12] = 9  # the first vertex's class
    path.write_bytes(bytes(data))
    open_scene(path)
    with collected_remarks() as remarks:
        mesh = scene_mesh()
    assert set(mesh.class_id) == {9, 5}
    assert remarks == ["a: 1 faces have vertices of several class_id: the first vertex's is taken"]


@pytest.mark.parametrize(("up", "flat"), [("y", False), ("z", True), (None, False)])
def test_what_points_up_can_be_said(up: str | None, flat: bool, tmp_path: Path) -> None:
    file = tmp_path / "floor.obj"
    file.write_text("v -9 -5 0\nv 9 -5 0\nv 9 5 0\nv -9 5 0\nf 1 2 3 4\n")
    open_scene(file, up)
    bpy.context.view_layer.update()
    assert (np.ptp(scene_mesh().vertices[:, 2]) < 1e-5) == flat


def test_pictures_come_with_the_cloud_and_colours_are_rendered(
    scene: Callable[[str], Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("synthroads_addon.cloud.tools.previews.WIDTH", 300)
    coarse = ("--set", "colour.image_spacing=60", "--set", "colour.ground_sampling_distance=0.5")
    usual = ("--set", 'outputs=["cloud","previews"]', "--set", "colour.source=images", *coarse)
    las = scan(scene(".blend"), tmp_path / "out", "--height", "30", *usual)
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == [
        "classes.json", "cloud.laz", "preview_class.png", "preview_intensity.png", "preview_rgb.png", "report.json"
    ]  # fmt: skip
    assert report(tmp_path / "out")["counts"]["rendered"]["images"] > 0
    assert las.red.std() > 0


# Where the scanner is


@pytest.mark.any_blender
def test_one_strip_leads_straight_over_the_middle(scene: Callable[[str], Path], tmp_path: Path) -> None:
    las = scan(scene(".blend"), tmp_path / "out", "--height", "30", "--speed", "5")
    assert set(np.array(las.point_source_id)) == {1}
    assert np.ptp(las.gps_time) == pytest.approx(40.0 / 5.0, abs=0.1)
    below = np.abs(las.scan_angle * 0.006) < 0.2
    assert np.abs(las.y[below]).max() < 0.3
    assert np.ptp(las.x[below]) == pytest.approx(40.0, abs=0.5)
    # Under the path the range is the height above the floor, where half of the scene's area lies.
    counts = report(tmp_path / "out")["counts"]
    assert counts["intensity_scale"] == pytest.approx(65535 * 15.0**2)


@pytest.mark.any_blender
def test_lateral_offsets_give_their_strips(scene: Callable[[str], Path], tmp_path: Path) -> None:
    offsets = ("--height", "30", "--set", "scan.platform.lateral_offsets=[4,0,-4]")
    las = scan(scene(".blend"), tmp_path / "out", *offsets)
    assert set(np.array(las.point_source_id)) == {1, 2, 3}


def epsg_of_file(folder: Path) -> int | None:
    with open_cloud(folder / "cloud.laz") as cloud:
        return cloud.header.epsg


@pytest.mark.any_blender
def test_a_path_is_followed_in_map_coordinates(scene: Callable[[str], Path], tmp_path: Path) -> None:
    line = tmp_path / "line.csv"
    line.write_text("x,y,z\n500005,5600090,101\n500005,5600110,101\n")
    where = ("--origin", "500000,5600100,100", "--epsg", "25832", "--path", line, "--height", "25")
    las = scan(scene(".glb"), tmp_path / "out", *where)
    assert epsg_of_file(tmp_path / "out") == 25832
    below = np.abs(las.scan_angle * 0.006) < 0.2
    assert np.abs(las.x[below] - 500_005.0).max() < 0.3
    assert np.isclose(np.median(las.z), 101.0, atol=0.002)
    assert np.ptp(las.y) == pytest.approx(20.0, abs=0.5)


@pytest.mark.any_blender
def test_a_trajectory_is_flown(scene: Callable[[str], Path], tmp_path: Path) -> None:
    file = tmp_path / "flight.csv"
    file.write_text("time,x,y,z,roll,pitch,heading\n0,-15,2,21,0,0,90\n4,15,2,21,0,0,90\n")
    las = scan(scene(".blend"), tmp_path / "out", "--trajectory", file)
    assert np.ptp(las.gps_time) == pytest.approx(4.0, abs=0.05)
    below = (np.abs(las.scan_angle * 0.006) < 0.2) & (las.z < 1.1)
    assert np.abs(las.y[below] - 2.0).max() < 0.3


@pytest.mark.any_blender
def test_tripods_stand_on_the_surface_or_where_they_are_put(scene: Callable[[str], Path], tmp_path: Path) -> None:
    where = ("--tripod=-15,-5", "--tripod", "5,5,2.5", "--set", "scan.platform.turn_seconds=2")
    las = scan(scene(".blend"), tmp_path / "out", *where)
    assert set(np.array(las.point_source_id)) == {1, 2}
    for strip in (1, 2):
        assert np.ptp(las.gps_time[np.array(las.point_source_id) == strip]) == pytest.approx(2.0, abs=0.05)
    high = path_over(Tripod(height=1.5), scene_mesh(), places=((-15, -5), (10.5, 3.5)))
    assert isinstance(high, TripodPath)
    assert np.allclose(high.positions, [[-15, -5, 2.5], [10.5, 3.5, 5.5]])
    usual = path_over(Tripod(), scene_mesh(), places=((-15, -5, 2.8), (-15, -5)))
    assert isinstance(usual, TripodPath)
    assert np.allclose(usual.positions, [[-15, -5, 2.8], [-15, -5, 1.0 + Tripod.usual["height"]]])


@pytest.mark.any_blender
def test_a_scene_with_a_vertex_astray_is_scanned_where_it_is(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its path and previews are those of the scene without it; one that lies on no map is refused."""
    ground = "".join(f"v {x} {y} 0\n" for x in range(-12, 13, 3) for y in range(-12, 13, 3))
    corners = [9 * i + j + 1 for i in range(8) for j in range(8)]
    faces = "".join(f"f {at} {at + 9} {at + 10} {at + 1}\n" for at in corners)
    points = []
    for name, far in (("plain", ""), ("stray", "v 5e5 0 0\nf 1 2 82\n")):
        (tmp_path / f"{name}.obj").write_text(ground + faces + far)
        las = scan(tmp_path / f"{name}.obj", tmp_path / name, "--up", "z", "--height", "30", "--speed", "30")
        points.append(len(las))
    assert points[1] == pytest.approx(points[0], rel=0.1)
    report = json.loads((tmp_path / "stray" / "report.json").read_text())
    assert report["warnings"][0] == "1 vertices are far from all others: the path and the previews ignore them"
    (tmp_path / "far.obj").write_text(ground + faces + "v 4e8 0 0\nf 1 2 82\n")
    capsys.readouterr()
    words = [str(tmp_path / "far.obj"), "--up", "z", "--output", str(tmp_path / "out"), "--quiet"]
    assert command("scan", words) == 2
    assert "must lie within 1e+08 m of the scene's origin" in capsys.readouterr().err


@pytest.mark.any_blender
def test_a_scan_larger_than_anyone_can_have_meant_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A yard of 1 km in millimetres."""
    (tmp_path / "yard.obj").write_text("v -5e5 -20 0\nv 5e5 -20 0\nv 5e5 20 0\nv -5e5 20 0\nf 1 2 3 4\n")
    words = [str(tmp_path / "yard.obj"), "--up", "z", "--output", str(tmp_path / "out"), "--quiet", "--height", "30"]
    assert command("scan", words) == 2
    told = capsys.readouterr().err
    assert "scan.most_pulses is 5000000000: " in told
    assert "--allow-large" in told
    assert len(told.splitlines()) == 1
    (tmp_path / "yard.obj").write_text("v -5 -5 0\nv 5 -5 0\nv 5 5 0\nv -5 5 0\nf 1 2 3 4\n")
    assert command("scan", [*words, *DRAFT, "--set", "scan.most_pulses=10"]) == 2
    assert "scan.most_pulses is 10: " in capsys.readouterr().err
    assert command("scan", [*words, *DRAFT, "--allow-large"]) == 0


@pytest.mark.any_blender
def test_a_scan_without_a_point_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """As of a tripod that stands in the plane of the only wall."""
    wall = "v 5 -5 -5\nv 5 5 -5\nv 5 5 5\nv 5 -5 5\nf 1 2 3 4\n"
    (tmp_path / "wall.obj").write_text(wall)
    words = [str(tmp_path / "wall.obj"), "--up", "z", "--output", str(tmp_path / "out"), *DRAFT, "--tripod", "5,8,0"]
    words += ["--set", "scan.platform.turn_seconds=0.2"]
    assert command("scan", words) == 0
    told = capsys.readouterr().out
    assert "warning: no pulse came back" in told
    assert "no pulse came back" in json.loads((tmp_path / "out" / "report.json").read_text())["warnings"][0]


@pytest.fixture
def road_scene(tmp_path: Path) -> tuple[Path, RoadGeometry]:
    """Return a .blend that holds a road of ours with the set that it was built from, and its geometry."""
    scenario = load_scenario("rq31-600m-even", ["road.length=60", "road.half_width=25", "fidelity=draft"])
    parameters = sample_road(scenario.road, scenario.seed)
    model = build_road(BuildRequest(parameters, 0.02, 0.0))
    remember(model.root, parameters, scenario, "")
    return write_scene(tmp_path / "road.blend"), RoadGeometry(parameters)


def test_a_road_of_ours_is_followed(road_scene: tuple[Path, RoadGeometry], tmp_path: Path) -> None:
    file, geometry = road_scene
    las = scan(file, tmp_path / "out", "--set", "scan.platform.lateral_offsets=[0]", "--height", "30")
    below = np.abs(las.scan_angle * 0.006) < 0.2
    origin = np.array(geometry.parameters.transform.translate)
    station, offset = geometry.alignment.project(las.xyz[below, :2] - origin[:2])
    assert np.abs(offset).max() < 0.3
    assert np.ptp(station) > 55.0
    assert class_id("road_marking") in np.array(las.class_id)
    assert epsg_of_file(tmp_path / "out") == geometry.parameters.metadata.epsg


# The scene stays as it was


def furnish() -> None:
    """Add to the scene of primitives what a scan might be tempted to touch."""
    primitives()
    thing = bpy.data.objects["Thing"]
    modifier = thing.modifiers.new("Bevel", "BEVEL")
    modifier.width = 0.1
    thing["synthroads_class"] = "bridge"
    thing["note"] = {"kept": [1, 2, 3]}
    thing.parent = bpy.data.objects["Pillar.0"]
    extra = bpy.data.collections.new("Extra")
    bpy.context.scene.collection.children.link(extra)
    hidden = bpy.data.objects.new("Hidden", bpy.data.objects["Floor"].data)
    extra.objects.link(hidden)
    hidden.hide_viewport = True
    curve = bpy.data.curves.new("Cable", "CURVE")
    curve.bevel_depth = 0.1
    curve.splines.new("POLY").points.add(2)
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("Cable", curve))
    bpy.data.worlds.new("Sky")
    bpy.data.scenes.new("Other")


CHANGES: dict[str, Callable[[], object]] = {
    "an object moves": lambda: setattr(bpy.data.objects["Floor"], "location", (0.0, 0.0, 1.001)),
    "a vertex moves": lambda: setattr(bpy.data.meshes[0].vertices[0], "co", (0.1, 0.0, 0.0)),
    "a face's attribute comes": lambda: bpy.data.meshes[0].attributes.new("class_id", "INT", "FACE"),
    "a face's material": lambda: setattr(bpy.data.meshes["Floor"].polygons[0], "material_index", 1),
    "a colour": lambda: setattr(bpy.data.materials["Tar"], "roughness", 0.11),
    "a node's input": lambda: setattr(
        next(n for n in bpy.data.materials["Tar"].node_tree.nodes if n.type == "BSDF_PRINCIPLED").inputs[2],
        "default_value",
        0.123,
    ),
    "a custom property": lambda: bpy.data.objects["Thing"].__setitem__("note", {"kept": [1, 2, 4]}),
    "a custom property comes": lambda: bpy.data.scenes[0].__setitem__("synthroads", 1),
    "a modifier's value": lambda: setattr(bpy.data.objects["Thing"].modifiers[0], "width", 0.2),
    "a modifier goes": lambda: bpy.data.objects["Thing"].modifiers.remove(bpy.data.objects["Thing"].modifiers[0]),
    "a modifier is hidden": lambda: setattr(bpy.data.objects["Thing"].modifiers[0], "show_viewport", False),
    "an object is shown": lambda: setattr(bpy.data.objects["Hidden"], "hide_viewport", False),
    "an object is selected": lambda: bpy.data.objects["Floor"].select_set(True),
    "an object leaves its collection": lambda: bpy.data.collections["Extra"].objects.unlink(bpy.data.objects["Hidden"]),
    "a parent": lambda: setattr(bpy.data.objects["Thing"], "parent", None),
    "a name": lambda: setattr(bpy.data.objects["Cable"], "name", "Rope"),
    "a curve": lambda: setattr(bpy.data.curves["Cable"], "bevel_depth", 0.11),
    "the frame": lambda: bpy.context.scene.frame_set(7),
    "a render setting": lambda: setattr(bpy.data.scenes["Other"].render, "resolution_x", 77),
    "a data block comes": lambda: bpy.data.meshes.new("left behind"),
    "a data block goes": lambda: bpy.data.worlds.remove(bpy.data.worlds["Sky"]),
}


@pytest.mark.parametrize("change", CHANGES)
def test_the_digest_remarks(change: str) -> None:
    furnish()
    before = digest()
    assert digest() == before
    CHANGES[change]()
    assert digest() != before


@pytest.mark.parametrize("caster", ["embree", "bvhtree"])
def test_a_scan_leaves_the_open_scene_as_it_was(caster: str, tmp_path: Path, mapping: Path) -> None:
    furnish()
    before = digest()
    changes = {"device": "riegl-minivux-3uav", "rays_per_pulse": 1, "caster": caster, "lines_per_second": 10.0}
    scenario = Scenario.from_dict({"scan": {**changes, "platform": {"height": 30.0, "speed": 20.0}}})
    result = scan_scene(SceneScan(scenario, tmp_path / "out", classes=mapping))
    assert result["counts"]["points"] > 1000
    assert result["counts"]["points_by_class"]["bridge"] > 10
    assert digest() == before


@pytest.mark.any_blender
def test_a_scan_leaves_a_road_of_ours_as_it_was(road_scene: tuple[Path, RoadGeometry], tmp_path: Path) -> None:
    before = digest()
    thin = {"lines_per_second": 20.0, "platform": {"height": 30.0, "speed": 30.0}}
    scenario = Scenario.from_dict({"fidelity": "draft", "scan": thin, "outputs": ["cloud"]})
    assert scan_scene(SceneScan(scenario, tmp_path / "out"))["counts"]["points"] > 1000
    assert digest() == before


# Wrong inputs

BROKEN = {"broken.glb": b"glTF\x02\x00\x00\x00junk", "broken.blend": b"hello", "broken.ply": b"hello", "a.txt": b""}
BROKEN |= {"empty.obj": b"# nothing\n", "points.obj": b"v 0 0 0\nv 1 0 0\nv 1 1 0\n", "broken.gltf": b'{"asset":'}
_SPARSE = b'"accessors":[{"componentType":5126,"count":1,"type":"VEC3","sparse":{}}]'
BROKEN |= {"nodes.gltf": b'{"asset":{"version":"2.0"},' + _SPARSE + b"}"}
BROKEN |= {"flat.obj": b"v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", "cut.stl": b"solid x\nfacet normal 0 0"}


@pytest.mark.parametrize(
    ("name", "arguments", "says"),
    [
        ("missing.blend", [], "SCENE is '{place}': no such file"),
        ("missing.glb", [], "SCENE is '{place}': no such file"),
        ("a.txt", [], "SCENE is '{place}': must end in one of .blend, .glb"),
        ("broken.glb", [], "{place}: is damaged ("),
        ("broken.gltf", [], "{place}: is damaged ("),
        ("nodes.gltf", [], "SCENE is '{place}': can't be read by Blender: Couldn't parse glTF"),
        ("broken.blend", [], "SCENE is '{place}': can't be read by Blender: "),
        ("broken.ply", [], "{place}: is damaged ("),
        ("cut.stl", [], "SCENE is '{place}': can't be read by Blender: "),
        ("empty.obj", [], "{place}: holds nothing visible with faces"),
        ("points.obj", [], "{place}: holds nothing visible with faces"),
        ("flat.obj", [], "{place}: holds nothing visible with faces"),
        ("yard.glb", ["--up", "z"], "--up is 'z': must be left out: a .glb file says itself which axis points up"),
        ("yard.obj", ["--device", "riegl-minivux-4uav"], "scan.device is 'riegl-minivux-4uav'"),
        ("yard.obj", ["--epsg", "1"], "epsg is 1"),
        ("yard.obj", ["--rays", "8"], "scan.rays_per_pulse is 8"),
        ("yard.obj", ["--seed", "-1"], "seed is -1"),
        ("yard.obj", ["--height", "-3"], "scan.platform.height is -3"),
        ("yard.obj", ["--set", "scan.platfrom.height=3"], "scan: unknown key 'platfrom' (did you mean 'platform'?)"),
        ("yard.obj", ["--set", 'outputs=["scene"]'], "outputs is ['scene']: must name at least one of cloud, previews"),
        ("yard.obj", ["--path", "nowhere.csv"], "nowhere.csv: must be a readable axis file"),
        ("yard.obj", ["--trajectory", "nowhere.csv"], "nowhere.csv: a trajectory file is needed here"),
        (
            "yard.obj",
            ["--trajectory", "nowhere.csv", "--speed", "3"],
            "--speed is 3.0: can't be given with --trajectory",
        ),
        ("yard.obj", ["--tripod", "99,99"], "--tripod is '99,99': there is no surface below"),
        ("yard.obj", ["--tripod", "1,1", "--speed", "3"], "--speed is 3.0: can't be given with --tripod"),
        ("yard.obj", ["--tripod", "1,1,3", "--height", "3"], "--height is 3.0: can't be given with a tripod"),
        ("yard.obj", ["--classes", "nowhere.json"], "nowhere.json: no such file"),
        ("yard.obj", ["--classes", "{wrong}"], "objects.Floor is 'rode': must be one of ground, road,"),
        ("yard.obj", ["--classes", "{unknown}"], "unknown key 'object' (did you mean 'objects'?)"),
    ],
)
def test_wrong_inputs_are_one_line_and_leave_nothing(
    name: str, arguments: list[str], says: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    for file, content in BROKEN.items():
        (tmp_path / file).write_bytes(content)
    (tmp_path / "wrong.json").write_text('{"objects": {"Floor": "rode"}}')
    (tmp_path / "unknown.json").write_text('{"object": "x"}')
    if name.startswith("yard"):
        primitives()
        write_scene(tmp_path / name)
    files = {"wrong": tmp_path / "wrong.json", "unknown": tmp_path / "unknown.json"}
    before = sorted(tmp_path.iterdir())
    capfd.readouterr()
    place = tmp_path / name
    given = [argument.format(**files) if "{" in argument[:1] else argument for argument in arguments]
    assert command("scan", [str(place), "--output", str(tmp_path / "out"), *DRAFT, *given]) == 2
    err = capfd.readouterr().err.splitlines()
    assert len(err) == 1
    assert err[0].startswith("error: ")
    assert says.format(place=place) in err[0]
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.any_blender
@pytest.mark.parametrize("given", [["--path", "a", "--trajectory", "b"], ["--tripod", "1,2", "--path", "a"]])
def test_only_one_way_to_say_where_the_scanner_is(given: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        command("scan", ["x.blend", "--output", "out", *given])
    assert stop.value.code == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1
    assert "not allowed with argument" in lines[0]


@pytest.mark.any_blender
@pytest.mark.parametrize("text", ["1", "1,2,3,4", "a,b", "nan,1", "1,1e10"])
def test_positions_must_be_coordinates(text: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        command("scan", ["x.blend", "--output", "out", "--tripod", text])
    assert stop.value.code == 2
    assert capsys.readouterr().err.splitlines() == [
        f"synthroads scan: argument --tripod: is '{text}': must be X,Y or X,Y,Z in metres"
    ]


@pytest.mark.any_blender
def test_output_is_not_replaced_unasked(
    scene: Callable[[str], Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, output = scene(".obj"), tmp_path / "out"
    output.mkdir()
    (output / "cloud.laz").write_text("mine")
    assert command("scan", [str(file), "--output", str(output), *DRAFT]) == 2
    assert "--overwrite replaces it" in capsys.readouterr().err
    assert [path.name for path in output.iterdir()] == ["cloud.laz"]
    scan(file, output, "--overwrite", "--height", "30")


AS_BLENDER = "import runpy, sys; sys.argv[0] = 'blender'; runpy.run_path('headless/scan.py', run_name='__main__')"
"""Runs the equivalent of ``blender -b -P headless/scan.py -- ...``."""


@pytest.mark.any_blender
@pytest.mark.parametrize("words", [["-m", "headless.scan"], ["-c", AS_BLENDER, "-b", "-P", "headless/scan.py", "--"]])
def test_it_is_a_command_of_its_own(words: list[str], scene: Callable[[str], Path], tmp_path: Path) -> None:
    arguments = [scene(".glb"), "--output", tmp_path / "out", "--height", "30", *DRAFT, "--json"]
    command_line = [sys.executable, *words, *map(str, arguments)]
    done = subprocess.run(command_line, cwd=ROOT, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["counts"] == report(tmp_path / "out")["counts"]


def in_units(path: Path, unit: float, system: str = "METRIC", spread: float | None = None) -> Path:
    """Write a floor of 40 m by 20 m, one slanted side of a card above it and a box that drives, in units of a length.

    Bands of the floor are bright by the place in the world, those of the card clear by that of the object.

    Args:
        path: of the .blend file.
        unit: its unit, m.
        system: of units.
        spread: how many of its units a metre is; those that the unit says if None.
    """
    size = 1.0 / unit if spread is None else spread
    empty_file()
    bpy.context.scene.unit_settings.system, bpy.context.scene.unit_settings.scale_length = system, unit
    bpy.ops.mesh.primitive_plane_add(size=size)
    floor = bpy.context.object
    floor.scale = (40.0, 20.0, 1.0)
    banded(floor, "ShaderNodeNewGeometry", "Position", 1.0 / size, "Base Color")
    bpy.ops.mesh.primitive_plane_add(size=1.0, location=(0.0, 6.0 * size, 3.0 * size), rotation=(0.3, 0.0, 0.0))
    card = bpy.context.object
    card.scale = (8.0 * size, 4.0 * size, 1.0)
    banded(card, "ShaderNodeTexCoord", "Object", 8.0, "Alpha")
    bpy.ops.mesh.primitive_cube_add(size=size, location=(-10.0 * size, -5.0 * size, 1.0 * size), scale=(2.0, 2.0, 1.0))
    bpy.context.object["synthroads_velocity"] = (1.0, 0.0, 0.0)
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


def banded(item: bpy.types.Object, node: str, output: str, per_unit: float, socket: str) -> None:
    """Give an object a material of which an input is 1 in every other metre along x, else 0, by a node's place."""
    material = bpy.data.materials.new(item.name)
    material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    source, parts = nodes.new(node), nodes.new("ShaderNodeSeparateXYZ")
    share, dark = nodes.new("ShaderNodeMath"), nodes.new("ShaderNodeMath")
    scaled, share.operation, dark.operation = nodes.new("ShaderNodeMath"), "PINGPONG", "GREATER_THAN"
    scaled.operation = "MULTIPLY"
    scaled.inputs[1].default_value, share.inputs[1].default_value, dark.inputs[1].default_value = per_unit, 1.0, 0.5
    links.new(source.outputs[output], parts.inputs[0])
    links.new(parts.outputs[0], scaled.inputs[0])
    links.new(scaled.outputs[0], share.inputs[0])
    links.new(share.outputs[0], dark.inputs[0])
    links.new(dark.outputs[0], nodes["Principled BSDF"].inputs[socket])
    item.data.materials.append(material)


@pytest.mark.parametrize("unit", [0.01, 0.3048, 1000.0])
def test_a_unit_that_a_file_declares_is_used(unit: float, tmp_path: Path) -> None:
    """The cloud of the scene in metres comes back: places, colours and transparency by place, what drives."""
    clouds = {}
    for name, one in (("metres", 1.0), ("units", unit)):
        file = in_units(tmp_path / f"{name}.blend", one)
        clouds[name] = scan(file, tmp_path / name, "--height", "30", "--set", "colour.source=nodes")
    metres, units = clouds["metres"], clouds["units"]
    assert np.ptp(metres.x) > 39.0
    assert abs(len(metres.points) - len(units.points)) < 0.001 * len(metres.points)
    same, apart = np.intersect1d(*(np.asarray(cloud.gps_time) for cloud in (metres, units)), return_indices=True)[1:]
    assert len(same) > 0.99 * len(metres.points)
    assert np.percentile(np.abs(metres.xyz[same] - units.xyz[apart]), 99.9) < 0.005
    bright, found = (np.asarray(cloud.red) > 20_000 for cloud in (metres, units))
    assert 0.2 < bright.mean() < 0.8
    assert (bright[same] == found[apart]).mean() > 0.99
    driven = {name: cloud.xyz[(cloud.z > 0.1) & (cloud.y < -3.0)] for name, cloud in clouds.items()}
    assert len(driven["metres"]) > 5
    assert driven["units"].mean(axis=0) == pytest.approx(driven["metres"].mean(axis=0), abs=0.05)
    high = {name: ((cloud.z > 1.7) & (cloud.y > 3.0)).sum() for name, cloud in clouds.items()}
    assert high["metres"] > 50
    assert high["units"] == pytest.approx(high["metres"], abs=2)


def test_without_a_system_of_units_a_unit_is_a_metre(tmp_path: Path) -> None:
    las = scan(in_units(tmp_path / "none.blend", 0.01, "NONE", 1.0), tmp_path / "out", "--height", "30")
    assert np.ptp(las.x) > 39.0


def test_a_scene_in_other_units_is_not_rendered(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = in_units(tmp_path / "small.blend", 0.01)
    words = [str(file), "--output", str(tmp_path / "out"), "--height", "30", "--fidelity", "draft", "--quiet"]
    assert command("scan", [*words, "--set", "colour.source=images"]) == 2
    assert "colour.source is 'images': can't render a scene whose unit is 0.01 m: take nodes" in capsys.readouterr().err
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["classes.json"]
