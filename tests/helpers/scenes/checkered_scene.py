"""A scene as others make them: image textures by turned and second UV maps, vertex colours, mixed shaders, a mirror."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix

FIELDS = 8
"""Fields of the checkerboard in each direction of an image; neighbours differ in all colours."""
SIDE = 6.0
"""Side of a board, m; they lie side by side along x, 10 m from middle to middle."""
APART = 10.0
TURN = np.deg2rad(30.0)
_PIXELS = 16
"""Pixels of a field."""


def field_color(column: np.ndarray, row: np.ndarray) -> np.ndarray:
    """Return the linear colours (N, 3) of fields, which are as bytes exactly what they are as numbers."""
    even = (column + row) % 2 == 0
    colors = np.stack([40 + 20 * column, 230 - 20 * row, np.where(even, 200, 60)], axis=-1) / 255.0
    return np.where(colors <= 0.04045, colors / 12.92, ((colors + 0.055) / 1.055) ** 2.4)


def _image(folder: Path) -> bpy.types.Image:
    """Return a packed image of fields; its lowest row is the first."""
    size = FIELDS * _PIXELS
    column, row = np.meshgrid(np.arange(size) // _PIXELS, np.arange(size) // _PIXELS)
    even = (column + row) % 2 == 0
    pixels = np.ones((size, size, 4), np.float32)
    pixels[..., :3] = np.stack([40 + 20 * column, 230 - 20 * row, np.where(even, 200, 60)], axis=-1) / 255.0
    image = bpy.data.images.new("Fields", size, size)
    image.pixels.foreach_set(pixels.ravel())
    image.filepath_raw, image.file_format = str(folder / "fields.png"), "PNG"
    image.save()
    image.pack()
    return image


def _board(
    name: str, number: int, maps: dict[str, np.ndarray], item: bpy.types.Material, count: int = 2
) -> bpy.types.Object:
    """Add a board of faces, so many in each direction, with UV maps: (2, 3) from places (x, y, 1) of it to u and v."""
    half, row = SIDE / 2.0, count + 1
    steps = np.linspace(-half, half, row)
    corners = [(x, y, 0.0) for y in steps for x in steps]
    faces = [(i, i + 1, i + row + 1, i + row) for y in range(count) for i in range(y * row, y * row + count)]
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(corners, [], faces)
    for key, matrix in maps.items():
        layer = mesh.uv_layers.new(name=key)
        for loop in mesh.loops:
            x, y, _ = corners[loop.vertex_index]
            layer.data[loop.index].uv = matrix @ [x, y, 1.0]
    mesh.materials.append(item)
    board = bpy.data.objects.new(name, mesh)
    board.location = (number * APART, 0.0, 0.0)
    bpy.context.scene.collection.objects.link(board)
    return board


STRAIGHT = np.array([[1.0 / SIDE, 0.0, 0.5], [0.0, 1.0 / SIDE, 0.5]])
_COS, _SIN = np.cos(TURN), np.sin(TURN)
TURNED = np.array([[_COS / SIDE, -_SIN / SIDE, 0.5], [_SIN / SIDE, _COS / SIDE, 0.5]])
SMALL = np.array([[2.0 / SIDE, 0.0, 0.0], [0.0, 2.0 / SIDE, 0.0]])
"""From places of a board to UV: straight, turned by 30 degrees, and twice in each direction."""


def textured(name: str, image: bpy.types.Image, uv: str = "", linear: bool = False) -> bpy.types.Material:
    """Return a material whose base colour is an image."""
    item = bpy.data.materials.new(name)
    if item.node_tree is None:
        item.use_nodes = True
    nodes, links = item.node_tree.nodes, item.node_tree.links
    shader = next(node for node in nodes if node.type == "BSDF_PRINCIPLED")
    shader.inputs["Specular IOR Level"].default_value = 0.0
    texture = nodes.new("ShaderNodeTexImage")
    texture.image, texture.interpolation = image, "Linear" if linear else "Closest"
    links.new(texture.outputs["Color"], shader.inputs["Base Color"])
    if uv:
        source = nodes.new("ShaderNodeUVMap")
        source.uv_map = uv
        links.new(source.outputs["UV"], texture.inputs["Vector"])
    return item


def _painted_material() -> bpy.types.Material:
    """Return a material whose base colour is an attribute."""
    item = bpy.data.materials.new("Painted")
    if item.node_tree is None:
        item.use_nodes = True
    nodes, links = item.node_tree.nodes, item.node_tree.links
    shader = next(node for node in nodes if node.type == "BSDF_PRINCIPLED")
    source = nodes.new("ShaderNodeVertexColor")
    source.layer_name = "Paint"
    links.new(source.outputs["Color"], shader.inputs["Base Color"])
    shader.inputs["Specular IOR Level"].default_value = 0.0
    return item


def build_checkered_scene(folder: Path) -> None:
    """Build four boards: UV turned by 30 degrees; by the second map; mirrored; and colours of the faces' corners."""
    image = _image(folder)
    _board("Turned", 0, {"UVMap": TURNED}, textured("Turned", image))
    _board("Second", 1, {"UVMap": STRAIGHT, "Other": SMALL}, textured("Second", image, "Other"))
    mirrored = _board("Mirrored", 2, {"UVMap": TURNED}, textured("Mirrored", image))
    mirrored.scale = (-1.0, 1.0, 1.0)
    item = _painted_material()
    painted = _board("Painted", 3, {}, item, FIELDS)
    colors = painted.data.color_attributes.new("Paint", "FLOAT_COLOR", "CORNER")
    for face in painted.data.polygons:
        color = field_color(*np.array([face.index % FIELDS, face.index // FIELDS])[:, None])[0]
        for corner in face.loop_indices:
            colors.data[corner].color = (*color, 1.0)


def expected_colors(place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the linear colours (N, 3) of places on the boards, and how far (N,) a field's edge is, in fields."""
    number = np.clip(np.round(place[:, 0] / APART), 0, 3).astype(int)
    local = np.column_stack([place[:, 0] - APART * number, place[:, 1], np.ones(len(place))])
    local[number == 2, 0] *= -1.0
    matrices = np.array([TURNED, SMALL, TURNED, STRAIGHT])
    uv = np.einsum("nij,nj->ni", matrices[number], local)
    scaled = uv % 1.0 * FIELDS
    column, row = np.floor(scaled).astype(int).T % FIELDS
    edge = np.abs(scaled - np.round(scaled)).min(axis=1)
    return field_color(column, row), edge


def add_vertex_colored(number: int, mixed: bool = False) -> bpy.types.Object:
    """Add a board whose colour rises along x in red and along y in green, by an attribute; or with grey mixed in."""
    item = _painted_material()
    nodes, links = item.node_tree.nodes, item.node_tree.links
    shader = next(node for node in nodes if node.type == "BSDF_PRINCIPLED")
    if mixed:
        end = next(node for node in nodes if node.type == "OUTPUT_MATERIAL")
        other, mix = nodes.new("ShaderNodeBsdfDiffuse"), nodes.new("ShaderNodeMixShader")
        other.inputs["Color"].default_value = (0.5, 0.5, 0.5, 1.0)
        mix.inputs[0].default_value = 0.25
        links.new(shader.outputs[0], mix.inputs[1])
        links.new(other.outputs[0], mix.inputs[2])
        links.new(mix.outputs[0], end.inputs["Surface"])
    board = _board("Painted", number, {}, item)
    colors = board.data.color_attributes.new("Paint", "FLOAT_COLOR", "POINT")
    for vertex, entry in zip(board.data.vertices, colors.data, strict=True):
        entry.color = (0.5 + vertex.co.x / 10.0, 0.5 + vertex.co.y / 10.0, 0.25, 1.0)
    return board


def mirror(item: bpy.types.Object) -> None:
    """Mirror an object along its own x."""
    item.matrix_world = item.matrix_world @ Matrix.Diagonal((-1.0, 1.0, 1.0, 1.0))
