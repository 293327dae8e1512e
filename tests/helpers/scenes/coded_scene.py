"""A small scene whose colours and layers are known functions of the place, and a path over it."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np

from synthroads_addon.blender.scene.evaluated import scene_mesh
from synthroads_addon.road.surroundings import Environment
from synthroads_addon.scanning.colour.request import LayerRequest
from synthroads_addon.scanning.scene.mesh import SceneMesh
from synthroads_addon.scenario.colour import ColourScenario

SIDE = 12.0
"""Half the ground's side, m."""
CELL = 2.0
"""Side of the checkerboard's cells, m."""
PLATE = (3.0, 7.0, 5.0)
"""A plate over the road, all across in x: from y, to y, at height z, m."""
DARK, BRIGHT, RED, GREY = 0.1, 0.7, (0.9, 0.05, 0.05), (0.3, 0.4, 0.5)
ENVIRONMENT = Environment(sun_azimuth_deg=180.0, sun_elevation_deg=60.0)


def ground_values(place: np.ndarray) -> dict[str, np.ndarray]:
    """Return base colour, roughness and metallic of the ground at places (N, 3)."""
    x, y = place[:, 0], place[:, 1]
    even = (np.floor(x / CELL) + np.floor(y / CELL)) % 2 == 0
    color = np.where(even, BRIGHT, DARK)
    return {
        "base_color": np.stack([color, 0.5 + x / 40.0, 0.5 + y / 40.0], axis=1),
        "roughness": 0.5 + x / 40.0,
        "metallic": 0.4 + y / 40.0,
    }


def edge_distance(place: np.ndarray) -> np.ndarray:
    """Return the distances (N,) of places on the ground from the checkerboard's nearest edge."""
    beside = np.abs(place[:, :2] / CELL - np.round(place[:, :2] / CELL)) * CELL
    return beside.min(axis=1)


def _math(nodes: bpy.types.Nodes, links: bpy.types.NodeLinks, operation: str, a: object, b: float) -> object:
    node = nodes.new("ShaderNodeMath")
    node.operation = operation
    links.new(a, node.inputs[0])
    node.inputs[1].default_value = b
    return node.outputs[0]


def coded_material() -> bpy.types.Material:
    """Return the ground's material, without outputs for layers."""
    item = bpy.data.materials.new("Coded")
    if item.node_tree is None:
        item.use_nodes = True
    nodes, links = item.node_tree.nodes, item.node_tree.links
    shader = next(node for node in nodes if node.type == "BSDF_PRINCIPLED")
    place = nodes.new("ShaderNodeNewGeometry").outputs["Position"]
    parts = nodes.new("ShaderNodeSeparateXYZ")
    links.new(place, parts.inputs[0])
    linear = {
        axis: _math(nodes, links, "ADD", _math(nodes, links, "DIVIDE", parts.outputs[axis], 40.0), 0.5) for axis in "XY"
    }
    cells = [_math(nodes, links, "FLOOR", _math(nodes, links, "DIVIDE", parts.outputs[a], CELL), 0.0) for a in "XY"]
    total = nodes.new("ShaderNodeMath")
    links.new(cells[0], total.inputs[0])
    links.new(cells[1], total.inputs[1])
    odd = _math(nodes, links, "FLOORED_MODULO", total.outputs[0], 2.0)
    checker = _math(nodes, links, "ADD", _math(nodes, links, "MULTIPLY", odd, DARK - BRIGHT), BRIGHT)
    color = nodes.new("ShaderNodeCombineXYZ")
    for number, socket in enumerate((checker, linear["X"], linear["Y"])):
        links.new(socket, color.inputs[number])
    links.new(color.outputs[0], shader.inputs["Base Color"])
    links.new(linear["X"], shader.inputs["Roughness"])
    links.new(_math(nodes, links, "ADD", linear["Y"], -0.1), shader.inputs["Metallic"])
    return item


def plain_material(name: str, color: tuple[float, float, float]) -> bpy.types.Material:
    """Return a material of one colour."""
    item = bpy.data.materials.new(name)
    if item.node_tree is None:
        item.use_nodes = True
    shader = next(node for node in item.node_tree.nodes if node.type == "BSDF_PRINCIPLED")
    shader.inputs["Base Color"].default_value = (*color, 1.0)
    shader.inputs["Specular IOR Level"].default_value = 0.0
    return item


def quad(name: str, corners: list[tuple[float, float, float]], material: bpy.types.Material) -> bpy.types.Object:
    """Add a rectangle to the scene."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(corners, [], [(0, 1, 2, 3)])
    mesh.materials.append(material)
    item = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(item)
    return item


def build_coded_scene(plate: bool = True, matt: bool = False) -> SceneMesh:
    """Build ground and plate in the current scene; return what a scanner sees of it.

    Args:
        plate: whether there is one.
        matt: the ground is of the constant colour `GREY`, in place of the coded ones.
    """
    s, (y0, y1, z) = SIDE, PLATE
    ground = plain_material("Matt", GREY) if matt else coded_material()
    quad("Ground", [(-s, -s, 0), (s, -s, 0), (s, s, 0), (-s, s, 0)], ground)
    if plate:
        quad("Plate", [(-s, y0, z), (s, y0, z), (s, y1, z), (-s, y1, z)], plain_material("Plate", RED))
    bpy.context.view_layer.update()
    return scene_mesh()


@dataclass(frozen=True)
class Pass:
    """A strip of the path."""

    index: int
    start_time: float
    duration: float


class OverPath:
    """A path along x at 30 m above the ground: from -10 to 10 m in 4 s."""

    strips = (Pass(0, 0.0, 4.0),)
    typical_range = 30.0

    def pose(self, strip: Pass, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return positions and rotations at times."""
        position = np.stack([5.0 * (time - strip.start_time) - 10.0, 0 * time, 0 * time + 30.0], axis=1)
        return position, np.broadcast_to(np.eye(3), (len(time), 3, 3))


def job(mesh: SceneMesh, wanted: set[str], environment: Environment = ENVIRONMENT, **scenario: object) -> LayerRequest:
    """Return a request for colours and layers of a mesh."""
    settings: dict[str, object] = {"image_spacing": 5.0, "ground_sampling_distance": 0.05}
    return LayerRequest(
        ColourScenario.from_dict(settings | scenario).settings("standard", OverPath.typical_range),
        frozenset(wanted),
        mesh,
        environment,
        OverPath(),
        np.deg2rad(80.0),
    )


def points_on(
    mesh: SceneMesh, count: int, low: tuple[float, ...], high: tuple[float, ...], material: str
) -> dict[str, np.ndarray]:
    """Return points on level ground within limits, seen by the scanner from above at the same x."""
    place = np.random.default_rng(7).uniform(low, high, (count, 3))
    return {
        "position": place,
        "scanner": np.stack([place[:, 0], 0 * place[:, 0], 0 * place[:, 0] + 30.0], axis=1),
        "normal": np.tile([0.0, 0.0, 1.0], (count, 1)),
        "material": np.full(count, mesh.materials.index(material), np.uint16),
        "time": (place[:, 0] + 10.0) / 5.0,
    }
