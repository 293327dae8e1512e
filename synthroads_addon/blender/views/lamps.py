"""Lamps of pictures at dusk and by night: the driver's and other vehicles' headlights, and street lights.

They are added around what the model has: light comes from where a vehicle or a mast shows the glass of a lamp.
Intensities are real ones (cd), over `LUX`. Scans ignore all of it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import bpy
import numpy as np
from mathutils import Matrix, Vector

from ...base.arrays import Float
from ...materials.table import entry_of
from ...road.parameters import RoadParameters
from ...road.surroundings import Vehicle
from ...road.things.pole import Pole
from ...scanning.scene.mesh import SceneMesh
from ..scene.evaluated import scene_mesh
from ..things.model_builder import ROLE, SUPPORT

LAMP = "synthroads_lamp"
"""Custom property of the lamps made here: what kind of lamp it is."""
LIT_BELOW = 2.0
"""Elevation of the sun, deg, below which lamps are switched on. Chosen: a little before sunset."""
LUX = 4700.0
"""Illuminance (lx) of an irradiance of 1 in Blender's unit. Chosen: so that level ground has as much light at sunset as
in `twilight.level_illuminance`."""
HEADLIGHTS = "headlights"
DRIVER_LAMP = (0.0, -0.55, -1.9)
"""Place of the driver's headlights, as one lamp, in the camera's coordinates (right, up, back), m; chosen for a car."""
BEAM = 24_000.0
"""Largest intensity of a vehicle's two dipped headlights together, cd (UN Regulation 149 requires at least 10,100 cd
of each at 50 m; lamps in use have more)."""
_STREET_LIGHT = 2500.0
"""Intensity of a street light downwards, cd: some 9,000 lm over its cone; chosen."""
_STREET_CONE = math.radians(140.0)
"""Full angle of a street light's cone, rad; chosen."""
_BEAM_CONE = math.radians(110.0)
"""Full angle of the cone within which headlights shine, rad; chosen."""
_RADIUS = 0.07
"""Radius of lamps, m: softens their shadows; chosen."""
_WHITE, _WARM = (1.0, 0.93, 0.82), (1.0, 0.82, 0.6)
"""Linear red, green and blue of headlights and of street lights of 4000 K; chosen."""
_GLASS, _BEAM_GROUP = "lamp_glass", "SR Dipped Beam"
_OFF_GLASS = 0.03
"""Distance of a lamp in front of its glass, m: the glass casts no shadow then; chosen."""


def add_lamps(
    scene: bpy.types.Scene, parameters: RoadParameters, matrix: Matrix, camera: bpy.types.Object
) -> bpy.types.Object:
    """Add headlights, and street lights where masts have them, to a scene; return the driver's headlights.

    Args:
        scene: scene that shows the road, built.
        parameters: the road.
        matrix: matrix from the road's local coordinates to the scene's.
        camera: the driver's camera, which carries the driver's headlights.
    """
    remove_lamps(scene)
    beam = _beam("SR Headlights")
    driver_lamp = _lamp("SR Headlights", beam, HEADLIGHTS, scene)
    driver_lamp.parent = camera
    driver_lamp.location = DRIVER_LAMP
    # The beam is level, whatever the camera's pitch.
    pitch = math.asin(min(max(-(camera.matrix_basis.to_3x3() @ Vector((0.0, 0.0, 1.0))).z, -1.0), 1.0))
    driver_lamp.rotation_euler = (-pitch, 0.0, 0.0)
    for front, direction in _vehicle_lamps(scene, parameters):
        item = _lamp("SR Headlights", beam, "vehicle", scene)
        item.location = front
        item.rotation_euler = Vector(direction.tolist()).to_track_quat("-Z", "Y").to_euler()
    places = list(_street_lights(scene, parameters))
    street_light = _street_light("SR Street Light") if places else None
    for place in places:
        item = _lamp("SR Street Light", street_light, "street", scene)
        item.location = place
    return driver_lamp


def remove_lamps(scene: bpy.types.Scene) -> None:
    """Remove the lamps that `add_lamps` added to a scene, with their data."""
    items = [item for item in scene.objects if LAMP in item]
    data = {item.data for item in items}
    bpy.data.batch_remove(items)
    bpy.data.batch_remove([block for block in data if not block.users])


def power_of(intensity: float) -> float:
    """Return the power (W) of a point or spot lamp of Blender that has an intensity (cd): 4 pi I, over `LUX`."""
    return 4.0 * math.pi * intensity / LUX


def beam_group() -> bpy.types.NodeTree:
    """Return the node group of a dipped beam: its share of the largest intensity in a direction of the lamp's frame.

    The beam is as wide as 20 degrees to either side (one standard deviation) and has its cut-off 1 % below level; below
    it the intensity falls so that near ground isn't lit much more than far ground, and above 3 % of it is left (chosen,
    after dipped headlights in use).
    """
    group = bpy.data.node_groups.get(_BEAM_GROUP)
    if group is not None:
        return group
    group = bpy.data.node_groups.new(_BEAM_GROUP, "ShaderNodeTree")
    group.interface.new_socket("Direction", in_out="INPUT", socket_type="NodeSocketVector")
    group.interface.new_socket("Share", in_out="OUTPUT", socket_type="NodeSocketFloat")
    start, end = group.nodes.new("NodeGroupInput"), group.nodes.new("NodeGroupOutput")
    parts = group.nodes.new("ShaderNodeSeparateXYZ")
    group.links.new(start.outputs[0], parts.inputs[0])
    x, y, z = parts.outputs
    forward = number(group, "MAXIMUM", number(group, "MULTIPLY", z, -1.0), 1e-4)
    across, up = number(group, "DIVIDE", x, forward), number(group, "DIVIDE", y, forward)
    wide = number(group, "DIVIDE", across, math.tan(math.radians(20.0)))
    width_share = number(group, "EXPONENT", number(group, "MULTIPLY", number(group, "MULTIPLY", wide, wide), -0.5))
    depth = number(group, "DIVIDE", number(group, "ADD", up, 0.02), 0.03)
    depth = number(group, "MINIMUM", depth, 0.0)
    near_share = number(group, "DIVIDE", 1.0, number(group, "ADD", number(group, "MULTIPLY", depth, depth), 1.0))
    cut_off = group.nodes.new("ShaderNodeMapRange")
    cut_off.interpolation_type = "SMOOTHSTEP"
    for name, value in {"From Min": -0.02, "From Max": -0.004, "To Min": 1.0, "To Max": 0.03}.items():
        cut_off.inputs[name].default_value = value
    group.links.new(up, cut_off.inputs["Value"])
    share = number(group, "MULTIPLY", number(group, "MULTIPLY", width_share, near_share), cut_off.outputs[0])
    in_front = number(group, "LESS_THAN", z, 0.0)
    group.links.new(number(group, "MULTIPLY", share, in_front), end.inputs[0])
    return group


def number(
    tree: bpy.types.NodeTree,
    operation: str,
    operand: bpy.types.NodeSocket | float,
    other_operand: bpy.types.NodeSocket | float | None = None,
) -> bpy.types.NodeSocket:
    """Add a math node of sockets and numbers to a shader's tree; return its output."""
    node = tree.nodes.new("ShaderNodeMath")
    node.operation = operation
    for socket, value in zip(node.inputs, (operand, other_operand), strict=False):
        if isinstance(value, bpy.types.NodeSocket):
            tree.links.new(value, socket)
        elif value is not None:
            socket.default_value = value
    return node.outputs[0]


def _lamp(name: str, data: bpy.types.Light | None, kind: str, scene: bpy.types.Scene) -> bpy.types.Object:
    """Return a new lamp object in a scene."""
    item = bpy.data.objects.new(name, data)
    item[LAMP], item[SUPPORT] = kind, True
    scene.collection.objects.link(item)
    return item


def _beam(name: str) -> bpy.types.Light:
    """Return the light of dipped headlights: with Cycles their beam's pattern, with EEVEE a soft cone."""
    light = bpy.data.lights.new(name, "SPOT")
    light.energy, light.color, light.shadow_soft_size = power_of(BEAM), _WHITE, _RADIUS
    light.spot_size, light.spot_blend = _BEAM_CONE, 1.0
    if light.node_tree is None:
        light.use_nodes = True
    nodes, links = light.node_tree.nodes, light.node_tree.links
    nodes.clear()
    place, pattern = nodes.new("ShaderNodeTexCoord"), nodes.new("ShaderNodeGroup")
    emission, output = nodes.new("ShaderNodeEmission"), nodes.new("ShaderNodeOutputLight")
    pattern.node_tree = beam_group()
    links.new(place.outputs["Normal"], pattern.inputs[0])
    links.new(pattern.outputs[0], emission.inputs["Strength"])
    links.new(emission.outputs[0], output.inputs[0])
    return light


def _street_light(name: str) -> bpy.types.Light:
    """Return the light of a street light, downwards."""
    light = bpy.data.lights.new(name, "SPOT")
    light.energy, light.color, light.shadow_soft_size = power_of(_STREET_LIGHT), _WARM, 2.0 * _RADIUS
    light.spot_size, light.spot_blend = _STREET_CONE, 0.6
    return light


def _vehicle_lamps(scene: bpy.types.Scene, parameters: RoadParameters) -> Iterator[tuple[Float, Float]]:
    """Yield place (3,) of each driving vehicle's headlights, and the direction (3,) that it heads to."""
    for item in _objects(scene, parameters, Vehicle):
        mesh = scene_mesh(scene, [item])
        white, red = (_middle(mesh, name) for name in (_GLASS, "lamp_red"))
        if white is None or red is None:
            continue
        direction = (white - red) * (1.0, 1.0, 0.0)
        direction /= np.linalg.norm(direction)
        yield white + direction * 5.0 * _OFF_GLASS, direction


def _street_lights(scene: bpy.types.Scene, parameters: RoadParameters) -> Iterator[Float]:
    """Yield the place (3,) below each street light's glass."""
    for item in _objects(scene, parameters, Pole):
        place = _middle(scene_mesh(scene, [item]), _GLASS)
        if place is not None:
            yield place - (0.0, 0.0, _OFF_GLASS)


def _objects(scene: bpy.types.Scene, parameters: RoadParameters, kind: type) -> list[bpy.types.Object]:
    """Return the objects of a scene that show a road's things of a kind."""
    names = set(parameters.of_type(kind))
    return [item for item in scene.objects if item.get(ROLE) in names]


def _middle(mesh: SceneMesh, entry: str) -> Float | None:
    """Return the middle (3,) of a mesh's faces of a material by its entry in the table, m; None if it has none."""
    numbers = [number for number, name in enumerate(mesh.materials) if entry_of(name) == entry]
    faces = mesh.triangles[np.isin(mesh.material, numbers)]
    if not len(faces):
        return None
    corners = mesh.vertices[faces].reshape(-1, 3).astype(np.float64)
    return np.asarray((corners.min(axis=0) + corners.max(axis=0)) / 2.0)
