"""SR Guardrail: a steel W-beam on posts, on one side of them or on both, ramped into the ground at its ends."""

from __future__ import annotations

import bpy

from ...core.cloud.labels import class_id
from . import operations as op
from .backbone import height_on, look_up, station_ribbon
from .builder import Operand, Tree, Value, node_group
from .strip import INSTANCES

# The A profile of 0.31 m as a polyline (m): depth towards traffic, 0, height under the top edge.
_SHEET = [
    (0.010, 0.000), (0.040, -0.006), (0.074, -0.030), (0.081, -0.052), (0.074, -0.080), (0.012, -0.124), (0.003, -0.140),
    (0.003, -0.170), (0.012, -0.186), (0.074, -0.230), (0.081, -0.258), (0.074, -0.280), (0.040, -0.304), (0.010, -0.310),
]  # fmt: skip
_THICKNESS = 0.003
BEAM_PROFILE = [(x, 0.0, z) for x, z in _SHEET] + [(x - _THICKNESS, 0.0, z) for x, z in reversed(_SHEET)]
BEAM_PROFILE.append(BEAM_PROFILE[0])

# A post of 100 x 55 mm: across the road, along it.
_POST = [(0.05, -0.010), (0.05, 0.0275), (-0.05, 0.0275), (-0.05, -0.0275), (0.05, -0.0275)]
POST_DEPTH = 0.05
"""From a post's axis to the back of a beam that is bolted to it, m."""
BURIED = 0.35
"""Depth to which posts are modelled below the surface, m."""
TIP = -0.02
"""Top of the beam at its very ends above the surface, m."""
_POST_TOP = 0.03
_LOWEST_POST = 0.15


def guardrail_group() -> bpy.types.NodeTree:
    """Return the group SR Guardrail."""
    return node_group("SR Guardrail", _build)


def _build(tree: Tree) -> None:
    """A steel guardrail along the road: W-beams, posts and spacers, with ramped terminals."""
    backbone = tree.input("Backbone", "Object", description="Polyline along the axis with its attributes")
    road = tree.input("Road", "Object", description="Surface that the guardrail stands on")
    terrain = tree.input("Terrain", "Object", description="Surface beside the road")
    first = tree.number("Start Station", 0.0, (0.0, 1e6), unit="m", description="Beginning, terminal included")
    last = tree.number("End Station", 100.0, (0.0, 1e6), unit="m", description="End, terminal included")
    offset = tree.number("Offset", 0.0, (-100.0, 100.0), unit="m", description="Offset of the posts' axis")
    beams = {
        1.0: tree.boolean("Left Beam", True, description="A beam on the left of the posts"),
        -1.0: tree.boolean("Right Beam", True, description="A beam on the right of the posts"),
    }
    spacer = tree.number("Spacer", 0.0, (0.0, 0.5), unit="m", description="Distance between posts and beam")
    height = tree.number("Height", 0.75, (0.3, 1.5), unit="m", description="Top of the beam above the surface")
    spacing = tree.number("Post Spacing", 4.0, (0.5, 10.0), unit="m", description="Distance between posts")
    terminal = tree.number("Terminal Length", 12.0, (0.0, 50.0), unit="m", description="Length of the ramp at each end")
    step = tree.number("Beam Step", 2.0, (0.1, 8.0), unit="m", description="Largest length of a straight piece of beam")
    instance = tree.integer("Instance", 0, INSTANCES, description="Instance number of the faces")
    material = tree.input("Material", "Material", description="Material of beams and posts")

    with tree.frame("Geometry"):
        axis = op.object_geometry(backbone)
        surfaces = op.object_geometry(road), op.object_geometry(terrain)
    ribbon = station_ribbon(axis)
    ramp = op.minimum(terminal, (last - first) * 0.5)

    def top_at(station: Value) -> Value:
        inside = op.minimum(station - first, last - station) / op.maximum(ramp, 1e-3)
        share = op.switch(ramp > 1e-3, 1.0, op.minimum(inside, 1.0))
        return height * share + TIP * (1.0 - share)

    def foot_at(station: Value) -> tuple[Value, Value]:
        left = look_up(ribbon, "left", station)
        place = look_up(ribbon, "axis", station) + left * offset
        rise = height_on(*surfaces, place) - op.component(place, "Z")
        return place + op.vector(tree, 0.0, 0.0, rise), left

    with tree.frame("Rows of the beams: terminal, middle, terminal"):
        line = _rows(tree, first, last, ramp, step)
    with tree.frame("Line of the beams' top edge"):
        station = op.named(tree, "station")
        foot, left = foot_at(station)
        line = op.store(op.store(line, "left", left), "top", foot + op.vector(tree, 0.0, 0.0, top_at(station)))
    parts = []
    for side, wanted in beams.items():
        with tree.frame(f"{'Left' if side > 0 else 'Right'} beam"):
            parts.append(op.only_if(wanted, _beam(tree, line, side, spacer)))
    with tree.frame("Posts every Post Spacing from the start, where the beam is high enough"):
        count = tree.node("FunctionNodeFloatToInt", (last - first) / spacing + 1e-4, rounding_mode="FLOOR").value + 1
        posts = tree.node("GeometryNodeMeshLine", count=count).value
        posts = op.store(posts, "station", first + op.index(tree) * spacing)
        station = op.named(tree, "station")
        foot, left = foot_at(station)
        posts = op.store(op.store(posts, "left", left), "tall", top_at(station))
        posts = op.delete_points(op.set_position(posts, foot), op.named(tree, "tall") < _LOWEST_POST)
        parts += _instances(tree, posts, spacer, beams)
    with tree.frame("Labels"):
        mesh = op.label(op.realize(op.join(*parts)), class_id("guardrail"), instance, material)
    tree.output("Mesh", mesh, description="Beams, posts and spacers")


def _rows(tree: Tree, first: Value, last: Value, ramp: Value, step: Value) -> Value:
    """Return points with their station, so many that no piece is longer than `step`, the ramps' ends among them."""
    outer = op.rounded_up(ramp / step - 1e-4)
    middle = op.maximum(op.rounded_up((last - first - ramp * 2.0) / step - 1e-4), 0)
    middle = tree.node("FunctionNodeFloatToInt", middle, rounding_mode="ROUND").value
    line = tree.node("GeometryNodeMeshLine", count=outer * 2 + middle + 1).value
    number = op.index(tree)
    into = op.minimum(number / op.maximum(outer, 1), 1.0)
    along = op.minimum(op.maximum((number - outer) / op.maximum(middle, 1), 0.0), 1.0)
    out_of = op.maximum((number - outer - middle) / op.maximum(outer, 1), 0.0)
    # Without a ramp `into` is 0 in row 0 and 1 after it, and the ramp's length is 0: both are the start.
    station = first + ramp * (into + out_of) + (last - first - ramp * 2.0) * along
    return op.store(line, "station", op.minimum(station, last))


def _beam(tree: Tree, line: Value, side: float, spacer: Value) -> Value:
    """Sweep the beam's profile along the line of its top edge."""
    mesh, column, number = op.grid(tree, len(BEAM_PROFILE), op.point_count(line))
    profile = op.choose(column, BEAM_PROFILE)
    top = op.sample_index(line, op.named(tree, "top", "FLOAT_VECTOR"), number)
    left = op.sample_index(line, op.named(tree, "left", "FLOAT_VECTOR"), number)
    depth = (op.component(profile, "X") + spacer + POST_DEPTH) * side
    place = top + left * depth + op.vector(tree, 0.0, 0.0, op.component(profile, "Z"))
    mesh = op.set_position(mesh, place)
    # Seen along the rows the profile runs round clockwise on the right side: there its faces look outwards.
    return tree.node("GeometryNodeFlipFaces", mesh).value if side > 0 else mesh


def _instances(tree: Tree, posts: Value, spacer: Value, beams: dict[float, Value]) -> list[Value]:
    """Put a post on every point, and beside it the spacers of the beams that there are."""
    left, tall = op.named(tree, "left", "FLOAT_VECTOR"), op.named(tree, "tall")
    upright = tree.node(
        "FunctionNodeAxesToRotation", (0.0, 0.0, 1.0), left, primary_axis="Z", secondary_axis="X"
    ).value

    def on_posts(body: Value, height: Operand, scale: Operand) -> Value:
        points = tree.node("GeometryNodeSetPosition", posts, offset=op.vector(tree, 0.0, 0.0, height)).value
        return tree.node("GeometryNodeInstanceOnPoints", points, instance=body, rotation=upright, scale=scale).value

    parts = [on_posts(_post(tree), -BURIED, op.vector(tree, 1.0, 1.0, tall + (BURIED - _POST_TOP)))]
    for side, wanted in beams.items():
        box = tree.node("GeometryNodeMeshCube", size=(1.0, 0.1, 0.22)).value
        middle = op.vector(tree, (spacer * 0.5 + POST_DEPTH) * side, 0.0, -0.155)
        body = tree.node(
            "GeometryNodeTransform", box, translation=middle, scale=op.vector(tree, spacer, 1.0, 1.0)
        ).value
        parts.append(op.only_if(wanted & (spacer > 1e-3), on_posts(body, tall, 1.0)))
    return parts


def _post(tree: Tree) -> Value:
    """Return a post of height 1; x is across the road, y along it."""
    mesh, column, number = op.grid(tree, len(_POST), 2)
    section = op.choose(column, [(x, y, 0.0) for x, y in _POST])
    return op.set_position(mesh, section + op.vector(tree, 0.0, 0.0, number))
