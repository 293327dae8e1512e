"""Materials' nodes at the very returns: they get what the renderer gives them, and what stands in the way is named."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Literal

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from synthroads_addon.blender.cameras import HAS_RETURN_CAMERA, MaterialSnapshot, layer_source
from synthroads_addon.blender.cameras.nodes import NodeLayers
from synthroads_addon.blender.materials.calculable import asked_inputs, material_needs
from synthroads_addon.blender.scene.evaluated import scene_mesh
from synthroads_addon.scanning.colour.colour import FROM_MATERIAL, FROM_NODES, FROM_RETURN, LayerValues, SeenPoints
from synthroads_addon.scanning.scene.mesh import SceneMesh
from tests.helpers.scenes.checkered_scene import APART, add_vertex_colored, mirror
from tests.helpers.scenes.coded_scene import job

BASE = frozenset({"base_color"})


def points_of(mesh: SceneMesh, count: int, seed: int = 3) -> SeenPoints:
    """Return points all over a mesh, seen from above or from where their faces look to."""
    random = np.random.default_rng(seed)
    areas = mesh.areas()
    face = random.choice(len(mesh), count, p=areas / areas.sum())
    share = random.dirichlet((1.0, 1.0, 1.0), count)
    place = np.einsum("nc,nck->nk", share, mesh.vertices[mesh.triangles[face]].astype(np.float64))
    normal = mesh.normals()[face]
    return SeenPoints(
        position=place,
        scanner=place + 5.0 * normal + random.uniform(-2.0, 2.0, (count, 3)),
        normal=normal,
        material=mesh.material[face],
        time=np.zeros(count),
        face=face,
    )


def base_colors(mesh: SceneMesh, points: SeenPoints, source: str = "nodes") -> tuple[LayerValues, dict[str, object]]:
    with layer_source(job(mesh, set(BASE), source=source)) as layers:
        return layers.sample(points, BASE), layers.report


def new_material(name: str) -> tuple[bpy.types.Material, bpy.types.Node]:
    """Return a material and its shader."""
    item = bpy.data.materials.new(name)
    if item.node_tree is None:
        item.use_nodes = True
    return item, next(node for node in item.node_tree.nodes if node.type == "BSDF_PRINCIPLED")


@pytest.mark.parametrize("mixed", [False, True])
def test_vertex_colours_and_mixed_shaders(mixed: bool) -> None:
    board = add_vertex_colored(0, mixed)
    mirror(board)
    bpy.context.view_layer.update()
    mesh = scene_mesh()
    points = points_of(mesh, 500)
    values, _ = base_colors(mesh, points)
    x, y = -points.position[:, 0], points.position[:, 1]
    expected = np.stack([0.5 + x / 10.0, 0.5 + y / 10.0, 0.25 + 0.0 * x], axis=1)
    if mixed:
        expected = 0.75 * expected + 0.25 * 0.5
    assert (values.source == FROM_NODES).all()
    np.testing.assert_allclose(values.arrays["base_color"], expected, atol=2e-6)


def test_what_is_worked_out_later_is_read_from_the_same_images_where_it_fits_them() -> None:
    add_vertex_colored(0, mixed=False)
    bpy.context.view_layer.update()
    mesh = scene_mesh()
    made, others = [], set(bpy.data.images)
    with layer_source(replace(job(mesh, set(BASE), source="nodes"), kernels="off")) as layers:
        for count in (140_000, 135_000, 180_000, 300_000, 3_000, 140_000):
            points = points_of(mesh, count)
            colour = layers.sample(points, BASE).arrays["base_color"]
            x, y = points.position[:, 0], points.position[:, 1]
            np.testing.assert_allclose(colour, np.stack([0.5 + x / 10.0, 0.5 + y / 10.0, 0.25 + 0.0 * x], 1), atol=2e-6)
            made.append({(image.name, *image.size) for image in bpy.data.images if image not in others})
    assert made[0]
    assert made[0] == made[1] == made[2]
    heights = [max(height for _, _, height in images) for images in made]
    assert heights[3] > heights[0] > heights[4]


def test_groups_are_gone_into() -> None:
    """The shader is in a group, and so is the place that it asks for; another board has the same group."""
    item, _ = new_material("Outer")
    inner = bpy.data.node_groups.new("Inner", "ShaderNodeTree")
    inner.interface.new_socket("Scale", in_out="INPUT", socket_type="NodeSocketFloat")
    inner.interface.new_socket("Shader", in_out="OUTPUT", socket_type="NodeSocketShader")
    nodes, links = inner.nodes, inner.links
    begin, end = nodes.new("NodeGroupInput"), nodes.new("NodeGroupOutput")
    place, scaled = nodes.new("ShaderNodeNewGeometry"), nodes.new("ShaderNodeVectorMath")
    scaled.operation = "SCALE"
    shader = nodes.new("ShaderNodeBsdfPrincipled")
    links.new(place.outputs["Position"], scaled.inputs[0])
    links.new(begin.outputs["Scale"], scaled.inputs["Scale"])
    links.new(scaled.outputs[0], shader.inputs["Base Color"])
    links.new(shader.outputs[0], end.inputs["Shader"])
    tree = item.node_tree
    group = tree.nodes.new("ShaderNodeGroup")
    group.node_tree = inner
    group.inputs["Scale"].default_value = 0.125
    tree.links.new(
        group.outputs["Shader"], next(n for n in tree.nodes if n.type == "OUTPUT_MATERIAL").inputs["Surface"]
    )
    bpy.ops.mesh.primitive_cube_add(size=2.0, location=(2.0, 2.0, 2.0))
    bpy.context.object.data.materials.append(item)
    bpy.context.view_layer.update()
    mesh = scene_mesh()
    points = points_of(mesh, 200)
    sockets = len(inner.interface.items_tree), len(bpy.data.node_groups)
    for source in ("nodes", *(("returns",) if HAS_RETURN_CAMERA else ())):
        values, _ = base_colors(mesh, points, source)
        np.testing.assert_allclose(values.arrays["base_color"], 0.125 * points.position, atol=1e-5)
    assert (len(inner.interface.items_tree), len(bpy.data.node_groups)) == sockets


@pytest.mark.parametrize("count", [1, 20, 150])
def test_few_points_have_their_layers_too(count: int) -> None:
    """Their image has fewer rows than any that Blender renders."""
    add_vertex_colored(0)
    bpy.context.view_layer.update()
    mesh = scene_mesh()
    points = points_of(mesh, count)
    x, y = points.position[:, 0], points.position[:, 1]
    expected = np.stack([0.5 + x / 10.0, 0.5 + y / 10.0, 0.25 + 0.0 * x], axis=1)
    np.testing.assert_allclose(base_colors(mesh, points)[0].arrays["base_color"], expected, atol=2e-6)


FRAME, BETWEEN, EARLIER = 8, 0.5, 1
"""Frame of the scene that is scanned, on the way to the next, and one at which its materials look otherwise."""
AT_FRAME = (0.84375, 0.85, 8.0 / 30.0)
"""Colour of the animated plane there: by keys (smooth), by a driver, and by an image of a sequence."""


def animated_plane(folder: Path) -> None:
    """Add a plane whose colour changes all the time, and show it after `FRAME`."""
    item, shader = new_material("Animated")
    tree = item.node_tree
    keyed, driven = tree.nodes.new("ShaderNodeValue"), tree.nodes.new("ShaderNodeValue")
    for frame, value in ((1, 0.0), (11, 1.0)):
        keyed.outputs[0].default_value = value
        keyed.outputs[0].keyframe_insert("default_value", frame=frame)
    cause = bpy.data.objects.new("Cause", None)
    cause["amount"] = 0.1
    bpy.context.scene.collection.objects.link(cause)
    driver = driven.outputs[0].driver_add("default_value").driver
    amount = driver.variables.new()
    amount.name, amount.targets[0].id, amount.targets[0].data_path = "amount", cause, '["amount"]'
    driver.expression = "amount * frame"
    sequence = tree.nodes.new("ShaderNodeTexImage")
    sequence.image = _image_sequence(folder)
    sequence.image_user.frame_duration, sequence.image_user.use_auto_refresh = 10, True
    parts, split = tree.nodes.new("ShaderNodeCombineXYZ"), tree.nodes.new("ShaderNodeSeparateColor")
    tree.links.new(sequence.outputs["Color"], split.inputs[0])
    for number, socket in enumerate((keyed.outputs[0], driven.outputs[0], split.outputs[2])):
        tree.links.new(socket, parts.inputs[number])
    tree.links.new(parts.outputs[0], shader.inputs["Base Color"])
    bpy.ops.mesh.primitive_plane_add(size=4.0)
    bpy.context.object.data.materials.append(item)
    bpy.context.scene.frame_set(FRAME, subframe=BETWEEN)


def _image_sequence(folder: Path) -> bpy.types.Image:
    """Return an image of ten frames, the n-th of which has a blue of `n / 30`."""
    for number in range(1, 11):
        image = bpy.data.images.new("Frame", 8, 8, is_data=True, float_buffer=True)
        image.pixels.foreach_set(np.tile(np.float32([0.0, 0.0, number / 30.0, 1.0]), 64))
        image.filepath_raw, image.file_format = str(folder / f"frame_{number:04d}.exr"), "OPEN_EXR"
        image.save()
        bpy.data.images.remove(image)
    sequence = bpy.data.images.load(str(folder / "frame_0001.exr"))
    sequence.source, sequence.colorspace_settings.name = "SEQUENCE", "Non-Color"
    return sequence


def test_what_is_animated_is_as_at_the_scenes_frame(tmp_path: Path) -> None:
    animated_plane(tmp_path)
    mesh = scene_mesh()
    points = points_of(mesh, 20)
    for source in ("nodes", *(("returns",) if HAS_RETURN_CAMERA else ())):
        values, _ = base_colors(mesh, points, source)
        np.testing.assert_allclose(values.arrays["base_color"], np.tile(AT_FRAME, (20, 1)), atol=1e-3, err_msg=source)


@pytest.mark.parametrize("kernels", ["auto", "off"])
def test_a_snapshot_keeps_the_frame(tmp_path: Path, kernels: Literal["auto", "off"]) -> None:
    """Another frame is shown later, and nothing comes into the file with the materials, such as what drives them."""
    animated_plane(tmp_path)
    snapshot = MaterialSnapshot(scene_mesh().materials, {0}, tmp_path, kernels)
    bpy.context.scene.frame_set(EARLIER)
    blocks = len(bpy.data.objects), len(bpy.data.actions)
    (work,) = snapshot.work({0}, ("base_color",)).calculators
    assert work.main_thread  # an image sequence is left to Cycles
    with snapshot.loaded([0]):
        assert (len(bpy.data.objects), len(bpy.data.actions)) == blocks
    inputs = {what: np.full((5, 4), 0.5, np.float32) for what in work.inputs_of(0)}
    found = work.calculate(np.zeros(5, np.intp), inputs)["base_color"]
    np.testing.assert_allclose(found, np.tile(AT_FRAME, (5, 1)), atol=1e-3)


def test_what_stands_in_the_way_is_named_and_left_to_others() -> None:
    item, shader = new_material("Hidden Corners")
    shader.inputs["Base Color"].default_value = (0.2, 0.3, 0.4, 1.0)
    corner = item.node_tree.nodes.new("ShaderNodeAmbientOcclusion")
    item.node_tree.links.new(corner.outputs["Color"], shader.inputs["Base Color"])
    bpy.ops.mesh.primitive_plane_add(size=4.0, location=(APART, 0.0, 0.0))
    bpy.context.object.data.materials.append(item)
    add_vertex_colored(0)
    bpy.context.view_layer.update()
    mesh = scene_mesh()
    points = points_of(mesh, 300)
    values, report = base_colors(mesh, points)
    corners = points.material == mesh.materials.index("Hidden Corners")
    assert report["left_out"] == {
        "Hidden Corners": {"because_of": ["Ambient Occlusion: Color"], "points": int(corners.sum())}
    }
    assert (values.source[corners] == (FROM_RETURN if HAS_RETURN_CAMERA else FROM_MATERIAL)).all()
    assert (values.source[~corners] == FROM_NODES).all()
    assert 0 < corners.sum() < 300


@pytest.mark.any_blender
@pytest.mark.parametrize(
    ("kind", "output", "properties"),
    [
        ("ShaderNodeBevel", "Normal", {}),
        ("ShaderNodeNewGeometry", "Pointiness", {}),
        ("ShaderNodeNewGeometry", "Random Per Island", {}),
        ("ShaderNodeCameraData", "View Z Depth", {}),
        ("ShaderNodeLightPath", "Ray Length", {}),
        ("ShaderNodeTexCoord", "Camera", {}),
        ("ShaderNodeTexCoord", "Reflection", {}),
        ("ShaderNodeFresnel", "", {}),
        ("ShaderNodeNormalMap", "Normal", {}),
        ("ShaderNodeTexImage", "Color", {"projection": "BOX"}),
        ("ShaderNodeAttribute", "Color", {"attribute_type": "INSTANCER", "attribute_name": "a"}),
        ("ShaderNodeUVMap", "UV", {"from_instancer": True}),
    ],
)
def test_what_no_values_can_stand_for_is_told(kind: str, output: str, properties: dict[str, object]) -> None:
    item, shader = new_material("Asking")
    node = item.node_tree.nodes.new(kind)
    for key, value in properties.items():
        setattr(node, key, value)
    if kind == "ShaderNodeTexImage":  # one without an image gives way to the socket's own value
        node.image = bpy.data.images.new("Image", 4, 4)
    item.node_tree.links.new(node.outputs[output] if output else node.outputs[0], shader.inputs["Roughness"])
    needs = material_needs(item)
    assert len(needs.obstacles) == 1
    assert node.bl_rna.name in needs.obstacles[0]
    assert asked_inputs(item) == frozenset()


INPUTS: dict[str, tuple[str, str, dict[str, object]]] = {
    "random": ("ShaderNodeObjectInfo", "Random", {}),
    "location": ("ShaderNodeObjectInfo", "Location", {}),
    "object colour": ("ShaderNodeObjectInfo", "Color", {}),
    "object": ("ShaderNodeTexCoord", "Object", {}),
    "generated": ("ShaderNodeTexCoord", "Generated", {}),
    "object normal": ("ShaderNodeTexCoord", "Normal", {}),
    "normal": ("ShaderNodeNewGeometry", "Normal", {}),
    "true normal": ("ShaderNodeNewGeometry", "True Normal", {}),
    "incoming": ("ShaderNodeNewGeometry", "Incoming", {}),
    "uv": ("ShaderNodeTexCoord", "UV", {}),
    "property": ("ShaderNodeAttribute", "Color", {"attribute_type": "OBJECT", "attribute_name": "tint"}),
    "byte colour": ("ShaderNodeAttribute", "Color", {"attribute_name": "Bytes"}),
    "face number": ("ShaderNodeAttribute", "Fac", {"attribute_name": "number"}),
    "nothing": ("ShaderNodeAttribute", "Color", {"attribute_name": "absent"}),
    "noise": ("ShaderNodeTexNoise", "Color", {}),
}
"""Inputs of materials: node, output, and its properties."""


def _asking(name: str) -> bpy.types.Material:
    """Return a material whose base colour is a half plus a fifth of an input."""
    kind, output, properties = INPUTS[name]
    item, shader = new_material(name)
    tree = item.node_tree
    node, scaled = tree.nodes.new(kind), tree.nodes.new("ShaderNodeVectorMath")
    for key, value in properties.items():
        setattr(node, key, value)
    scaled.operation = "MULTIPLY_ADD"
    scaled.inputs[1].default_value, scaled.inputs[2].default_value = (0.2,) * 3, (0.5,) * 3
    tree.links.new(
        next(one for one in node.outputs if one.name in (output, "Factor" if output == "Fac" else output)),
        scaled.inputs[0],
    )
    tree.links.new(scaled.outputs[0], shader.inputs["Base Color"])
    return item


def _ball(place: tuple[float, float, float], item: bpy.types.Material) -> bpy.types.Object:
    bpy.ops.mesh.primitive_uv_sphere_add(segments=12, ring_count=8, radius=1.0)
    ball = bpy.context.object
    mesh = ball.data
    mesh.materials.append(item)
    mesh.polygons.foreach_set("use_smooth", [True] * len(mesh.polygons))
    colors = mesh.color_attributes.new("Bytes", "BYTE_COLOR", "CORNER")
    for number, entry in enumerate(colors.data):
        entry.color = (number % 7 / 7.0, number % 5 / 5.0, number % 3 / 3.0, 1.0)
    numbers = mesh.attributes.new("number", "INT", "FACE")
    numbers.data.foreach_set("value", np.arange(len(mesh.polygons), dtype=np.int32) % 4)
    ball.color, ball["tint"] = (0.1, 0.6, 0.9, 1.0), [0.3, 0.2, 0.7]
    ball.matrix_world = (
        Matrix.Translation(place)
        @ Matrix.Rotation(0.7, 4, "Z")
        @ Matrix.Rotation(0.3, 4, "X")
        @ Matrix.Diagonal((-1.5, 1.0, 0.8, 1.0))
    )
    return ball


@pytest.mark.skipif(not HAS_RETURN_CAMERA, reason="Blender < 5")
def test_inputs_are_what_the_renderer_gives() -> None:
    for number, name in enumerate(INPUTS):
        _ball((5.0 * number, 3.0, 1.0), _asking(name))
    bpy.context.view_layer.update()
    mesh = scene_mesh()
    points = points_of(mesh, 6000)
    values, report = base_colors(mesh, points)
    truth, _ = base_colors(mesh, points, "returns")
    assert "left_out" not in report
    seen = truth.source == FROM_RETURN
    assert seen.mean() > 0.98
    error = np.abs(values.arrays["base_color"] - truth.arrays["base_color"]).max(axis=1)
    for number, name in enumerate(mesh.materials):
        mine = seen & (points.material == number)
        assert mine.sum() > 100
        # Whether smooth normals are mixed before a scaling of the object or after it is the renderer's choice.
        assert np.quantile(error[mine], 0.99) < (1e-2 if name in ("normal", "object normal") else 5e-4), name


def test_a_mirrored_smooth_ball_is_worked_out_in_every_blender() -> None:
    """A few of the inputs are known by formula."""
    expected: dict[str, Callable[[SeenPoints, bpy.types.Object], np.ndarray]] = {
        "location": lambda points, ball: np.tile(np.array(ball.location), (len(points), 1)),
        "object": lambda points, ball: (
            (points.position - np.array(ball.location)) @ np.linalg.inv(np.array(ball.matrix_world)[:3, :3]).T
        ),
        "property": lambda points, ball: np.tile([0.3, 0.2, 0.7], (len(points), 1)),
        "nothing": lambda points, ball: np.zeros((len(points), 3)),
        "true normal": lambda points, ball: points.normal,
    }
    balls = {name: _ball((5.0 * number, 3.0, 1.0), _asking(name)) for number, name in enumerate(expected)}
    bpy.context.view_layer.update()
    mesh = scene_mesh()
    points = points_of(mesh, 1000)
    with layer_source(job(mesh, set(BASE), source="nodes")) as layers:
        assert isinstance(layers, NodeLayers)
        found = layers.sample(points, BASE).arrays["base_color"]
    for number, name in enumerate(mesh.materials):
        mine = np.flatnonzero(points.material == number)
        wanted = 0.5 + 0.2 * expected[name](points.select(mine), balls[name])
        np.testing.assert_allclose(found[mine], wanted, atol=1e-5, err_msg=name)
