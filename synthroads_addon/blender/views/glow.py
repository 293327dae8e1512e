"""Materials in pictures by night: what sends headlights' light back to the driver, and what shines itself.

Cycles has no retro-reflecting shader. Seen from the driver's camera, which carries the headlights, retro-reflection is
a light that the surface gives off: its luminance is L = R E, with the coefficient of retro-reflection R (cd/lx/m2) of
the road's material table, and the illuminance E (lx) normal to the headlights' light, which the pattern of their beam
and the distance give. From other cameras, which have no headlights, nothing is sent back. Shadows of the beam are left
out: what the driver sees, headlights 0.55 m below reach too.
"""

from __future__ import annotations

import json
import math

import bpy

from ...materials.table import Material
from ..materials import MEAN
from ..materials.surface_layers import PROPERTY
from .lamps import BEAM, LUX, beam_group, number

GLOW = "synthroads_glow"
"""Custom property of materials that were made to glow here."""
_GROUP = "SR Headlight Return"
_NODE = "SR Glow"
LUMINANCES = {
    "lamp_glass": 20_000.0,
    "lamp_red": 400.0,
    "lamp_yellow": 3000.0,
    "led_white": 400.0,
    "led_red": 400.0,
}
"""Material -> its luminance where it is brightest, cd/m2. Chosen: headlights and street lights as seen from beside
their beams; signal lights; displays by night within class L3 of EN 12966."""
_PRISM_ANGLE = math.radians(0.7)
"""Observation angle by which prisms and sheetings send back 1/e, rad: 95 cd/lx/m2 give 71, 59, 5.4 at 0.2, 0.33 and 2
degrees; class RA1 of EN 12899-1 has 70, 50, 5."""
_BEAD_ANGLE, _BEAD_START = math.radians(3.0), math.radians(1.05)
"""Observation angle by which beads send back 1/e, beyond that of EN 1436's geometry, rad; the first chosen."""
_BEAD_LOBE = 90.0
"""Entrance angle (deg) from which on a material's lobe is that of beads."""
_SAME_CAMERA = 0.005
"""Distance (m) by which a place may lie elsewhere in the camera's frame and in that of the headlights; chosen."""


def add_glow(headlights: bpy.types.Object) -> None:
    """Let the file's road materials glow: lamps and displays, and what sends the driver's headlights' light back."""
    remove_glow()
    group = _return_group(headlights)
    for item in [item for item in bpy.data.materials if PROPERTY in item and MEAN in item and item.library is None]:
        mean = Material.from_dict(json.loads(item[MEAN]))
        luminance = LUMINANCES.get(str(item[PROPERTY]), 0.0)
        if luminance or mean.retroreflection:
            _let_glow(item, mean, luminance, group)


def remove_glow() -> None:
    """Undo `add_glow`: materials give off no light, as they were made."""
    for item in [item for item in bpy.data.materials if GLOW in item]:
        tree = item.node_tree
        for node in [node for node in tree.nodes if node.name.startswith(_NODE)]:
            tree.nodes.remove(node)
        surface = _principled(item)
        if surface is not None:
            surface.inputs["Emission Strength"].default_value = 0.0
            surface.inputs["Emission Color"].default_value = (1.0, 1.0, 1.0, 1.0)
            for link in list(surface.inputs["Emission Color"].links):
                tree.links.remove(link)
        item.cycles.emission_sampling = "AUTO"
        del item[GLOW]
    group = bpy.data.node_groups.get(_GROUP)
    if group is not None and not group.users:
        bpy.data.node_groups.remove(group)


def _principled(item: bpy.types.Material) -> bpy.types.ShaderNodeBsdfPrincipled | None:
    """Return a material's Principled BSDF; None if the user has removed it."""
    return next((node for node in item.node_tree.nodes if node.type == "BSDF_PRINCIPLED"), None)


def _let_glow(item: bpy.types.Material, mean: Material, luminance: float, group: bpy.types.NodeTree) -> None:
    """Let a material give off light of its base colour: a luminance (cd/m2), or what it sends back."""
    surface = _principled(item)
    if surface is None:
        return
    tree, color = item.node_tree, surface.inputs["Base Color"]
    if color.is_linked:
        tree.links.new(color.links[0].from_socket, surface.inputs["Emission Color"])
    else:
        surface.inputs["Emission Color"].default_value = color.default_value
    brightest = max(mean.base_color)
    if luminance:
        surface.inputs["Emission Strength"].default_value = luminance / LUX / brightest
    else:
        returned = tree.nodes.new("ShaderNodeGroup")
        returned.name, returned.node_tree = _NODE, group
        returned.location = surface.location[0] - 250.0, surface.location[1] - 400.0
        is_bead = mean.retro_lobe_deg >= _BEAD_LOBE
        # The table has pi times the coefficient of retro-reflection.
        returned.inputs["Coefficient"].default_value = mean.retroreflection / math.pi / brightest
        returned.inputs["Lobe"].default_value = math.radians(mean.retro_lobe_deg)
        returned.inputs["Angle"].default_value = _BEAD_ANGLE if is_bead else _PRISM_ANGLE
        returned.inputs["Start"].default_value = _BEAD_START if is_bead else 0.0
        tree.links.new(returned.outputs[0], surface.inputs["Emission Strength"])
    # Cycles would take each face that gives off light for a lamp: lamps light the scene already, in `lamps`.
    item.cycles.emission_sampling = "NONE"
    item[GLOW] = True


def _return_group(headlights: bpy.types.Object) -> bpy.types.NodeTree:
    """Return a new node group of the light that a surface sends back to the driver, in Blender's unit of radiance."""
    group = bpy.data.node_groups.new(_GROUP, "ShaderNodeTree")
    for name in ("Coefficient", "Lobe", "Angle", "Start"):
        group.interface.new_socket(name, in_out="INPUT", socket_type="NodeSocketFloat")
    group.interface.new_socket("Strength", in_out="OUTPUT", socket_type="NodeSocketFloat")
    nodes, links = group.nodes, group.links
    start, end = nodes.new("NodeGroupInput"), nodes.new("NodeGroupOutput")
    place = nodes.new("ShaderNodeTexCoord")
    place.object = headlights
    lamp_place = place.outputs["Object"]
    distance = _vector(group, "LENGTH", lamp_place)
    beam = nodes.new("ShaderNodeGroup")
    beam.node_tree = beam_group()
    links.new(lamp_place, beam.inputs[0])
    # Illuminance of a lamp of intensity I at a distance d, normal to its light: E = I / d^2.
    illuminance = number(
        group,
        "DIVIDE",
        number(group, "MULTIPLY", beam.outputs[0], BEAM / LUX),
        number(group, "MULTIPLY", distance, distance),
    )
    # Observation angle, between the ways to the lamp and to the eye: atan2(|a x b|, a . b).
    eye = _eye_in_lamp_frame(headlights)
    to_eye, to_lamp = _vector(group, "SUBTRACT", eye, lamp_place), _vector(group, "SCALE", lamp_place, -1.0)
    sine = _vector(group, "LENGTH", _vector(group, "CROSS_PRODUCT", to_eye, to_lamp))
    observation = number(group, "ARCTAN2", sine, _vector(group, "DOT_PRODUCT", to_eye, to_lamp))
    beyond = number(group, "MAXIMUM", number(group, "SUBTRACT", observation, start.outputs["Start"]), 0.0)
    observed = number(
        group, "EXPONENT", number(group, "DIVIDE", number(group, "MULTIPLY", beyond, -1.0), start.outputs["Angle"])
    )
    # Entrance angle, between the surface's normal and the lamp: as for lasers, exp(-t^2 / l^2).
    geometry = nodes.new("ShaderNodeNewGeometry")
    cosine = number(
        group, "MINIMUM", _vector(group, "DOT_PRODUCT", geometry.outputs["Normal"], geometry.outputs["Incoming"]), 1.0
    )
    entrance = number(group, "DIVIDE", number(group, "ARCCOSINE", cosine), start.outputs["Lobe"])
    entered = number(group, "EXPONENT", number(group, "MULTIPLY", number(group, "MULTIPLY", entrance, entrance), -1.0))
    strength = number(group, "MULTIPLY", start.outputs["Coefficient"], illuminance)
    for share in (observed, entered, _seen_by_driver(group, to_eye, headlights)):
        strength = number(group, "MULTIPLY", strength, share)
    links.new(strength, end.inputs[0])
    return group


def _eye_in_lamp_frame(headlights: bpy.types.Object) -> tuple[float, float, float]:
    """Return the camera's place (3,) in the frame of the headlights that it carries, m."""
    x, y, z = headlights.matrix_basis.inverted().translation
    return float(x), float(y), float(z)


def _seen_by_driver(
    group: bpy.types.NodeTree, to_eye: bpy.types.NodeSocket, headlights: bpy.types.Object
) -> bpy.types.NodeSocket:
    """Return a socket of 1 for rays of the driver's camera, else 0.

    A place has the same coordinates in the frame of that camera and, turned, in that of its headlights.
    """
    geometry, path = group.nodes.new("ShaderNodeNewGeometry"), group.nodes.new("ShaderNodeLightPath")
    transform = group.nodes.new("ShaderNodeVectorTransform")
    transform.vector_type, transform.convert_from, transform.convert_to = "POINT", "WORLD", "CAMERA"
    group.links.new(geometry.outputs["Position"], transform.inputs[0])
    # Rows of the headlights' rotation against the camera's, applied to the way from the eye; depth counts forward.
    rotation = headlights.matrix_basis.to_3x3()
    rows = [_vector(group, "DOT_PRODUCT", to_eye, tuple(-part for part in row)) for row in rotation]
    expected = group.nodes.new("ShaderNodeCombineXYZ")
    for row, socket, sign in zip(rows, expected.inputs, (1.0, 1.0, -1.0), strict=True):
        group.links.new(number(group, "MULTIPLY", row, sign), socket)
    gap = _vector(group, "LENGTH", _vector(group, "SUBTRACT", transform.outputs[0], expected.outputs[0]))
    near = number(group, "LESS_THAN", gap, _SAME_CAMERA)
    return number(group, "MULTIPLY", near, path.outputs["Is Camera Ray"])


def _vector(
    tree: bpy.types.NodeTree,
    operation: str,
    operand: bpy.types.NodeSocket | tuple[float, float, float],
    other_operand: bpy.types.NodeSocket | tuple[float, ...] | float | None = None,
) -> bpy.types.NodeSocket:
    """Add a vector math node of sockets and constants; return its output, a number for lengths and dot products."""
    node = tree.nodes.new("ShaderNodeVectorMath")
    node.operation = operation
    if operation == "SCALE":
        node.inputs["Scale"].default_value = other_operand
        other_operand = None
    for socket, value in zip(node.inputs, (operand, other_operand), strict=False):
        if isinstance(value, bpy.types.NodeSocket):
            tree.links.new(value, socket)
        elif value is not None:
            socket.default_value = value
    return node.outputs["Value" if operation in ("LENGTH", "DOT_PRODUCT") else "Vector"]
