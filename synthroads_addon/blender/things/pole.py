"""Lighting and surveillance poles: masts with an arm, and at its end a street light, or cameras (SR Pole).

Dimensions (m) and shares without a name here are chosen.
"""

from __future__ import annotations

import math

from ...base.classes import class_id
from ...road.things import pole as sizes
from ...road.things.body import BURIED
from ...road.things.pole import Pole
from ..nodes import operations as op
from ..nodes.builder import Tree, Value, makes_group
from ..nodes.inputs import boolean, material_of, metres
from ..nodes.solids import box, cone, move_geometry, paint_faces, prism, row_of_points, tube
from ..nodes.standing import Standing, put_on
from .model_builder import ModelBuilder
from .registry import model_part

_GLASS = [(-0.16, -0.1), (-0.16, 0.1), (-0.56, 0.1), (-0.56, -0.1)]
"""Outline of the glass under a luminaire: x from its mount, and y, m; chosen."""


class _Pole(Standing):
    surveillance = boolean(False, "Carries cameras instead of a street light")
    height = metres(12.0, (1.0, 40.0), "Top above the surface")
    diameter = metres(0.18, (0.03, 1.0), "Diameter at the foot (m)")
    arm_length = metres(1.5, (0.0, 10.0), "Length of the arm; 0 for none")
    steel_material = material_of("mast and arm", "galvanised_steel")
    housing_material = material_of("luminaire and housings", "cabinet_grey")
    glass_material = material_of("lamps and lenses", "lamp_glass")

    def rise(self) -> Value:
        """Add nodes for the rise (m) of the arm from the mast to its end."""
        return self.arm_length * sizes.ARM_RISE


@makes_group("SR Pole", catalogue="Roadside")
def pole_group(tree: Tree) -> None:
    """A pole, its arm to the left of those who drive along +y; points carry ``heading`` (rad) and ``elevation`` (m)."""
    pole = _Pole(tree)

    with tree.frame("Street light"):
        mount = pole.height - sizes.LUMINAIRE_DEPTH * 0.5
        light = op.join(_mast(tree, pole, mount - pole.rise()), _arm(tree, pole, mount), _luminaire(tree, pole))
    with tree.frame("Surveillance"):
        mount = pole.height - sizes.CAMERA_MOUNT
        watch = op.join(_mast(tree, pole, pole.height), _arm(tree, pole, mount), _cameras(tree, pole, mount))
    with tree.frame("Put onto the points"):
        body = op.switch(pole.surveillance, light, watch)
        mesh = pole.label(put_on(pole.places(), body), class_id(Pole.points_class))
    tree.output("Mesh", mesh, description="Pole with what it carries")


def _mast(tree: Tree, pole: _Pole, top: Value) -> Value:
    """Add nodes for the mast up to `top` (m), with its buried foot and a door for the cables."""
    radius = pole.diameter * 0.5
    mast = cone(tree, radius, radius * sizes.MAST_TAPER, top, sizes.MAST_SIDES)
    foot = move_geometry(tube(tree, radius, BURIED, sizes.MAST_SIDES), (0.0, 0.0, -BURIED))
    door = box(tree, op.vector(tree, radius * 0.9, 0.02, 0.35), op.vector(tree, 0.0, radius * -0.93, 0.8))
    return paint_faces(op.join(mast, foot, door), pole.steel_material)


def _arm(tree: Tree, pole: _Pole, end: Value) -> Value:
    """Add nodes for the arm: a quarter of an ellipse from the mast to the left, up to the height `end` (m)."""
    line = row_of_points(tree, sizes.ARM_POINTS)
    angle = op.index(tree) * (math.pi / 2.0 / (sizes.ARM_POINTS - 1))
    x = (op.unary("COSINE", angle) - 1.0) * pole.arm_length
    z = end - pole.rise() * (1.0 - op.unary("SINE", angle))
    line = op.set_position(line, op.vector(tree, x, 0.0, z))
    profile = tree.node("GeometryNodeCurvePrimitiveCircle", resolution=sizes.ARM_SIDES, radius=sizes.ARM_RADIUS).value
    curve = tree.node("GeometryNodeMeshToCurve", line).value
    pipe = tree.node("GeometryNodeCurveToMesh", curve, profile_curve=profile, fill_caps=True).value
    pipe = tree.node("GeometryNodeSetShadeSmooth", pipe).value
    return op.only_if(pole.arm_length > sizes.SHORTEST_ARM, paint_faces(pipe, pole.steel_material))


def _luminaire(tree: Tree, pole: _Pole) -> Value:
    """Add nodes for the street light at the end of the arm; its top is the pole's height."""
    body = paint_faces(prism(tree, list(sizes.LUMINAIRE), (1.0, 1.0, sizes.LUMINAIRE_DEPTH)), pole.housing_material)
    glass = paint_faces(prism(tree, _GLASS, (1.0, 1.0, 0.01)), pole.glass_material)
    parts = op.join(body, move_geometry(glass, (0.0, 0.0, -0.01)))
    return move_geometry(parts, op.vector(tree, -pole.arm_length, 0.0, pole.height - sizes.LUMINAIRE_DEPTH))


def _cameras(tree: Tree, pole: _Pole, mount: Value) -> Value:
    """Add nodes for a camera along the road either way, a dome camera at the arm's end, and a cabinet on the mast."""
    front_camera = move_geometry(_camera(tree, pole), op.vector(tree, 0.0, (pole.diameter + sizes.CAMERA[1]) * -0.5))
    rear_camera = op.transform(front_camera, rotation=(0.0, 0.0, math.pi))
    pair = move_geometry(op.join(front_camera, rear_camera), op.vector(tree, 0.0, 0.0, mount - sizes.CAMERA_BELOW))
    radius, cap_height, cap_depth, ball_depth = sizes.CAMERA_DOME
    cap = paint_faces(move_geometry(tube(tree, radius, cap_height), (0.0, 0.0, -cap_depth)), pole.housing_material)
    ball = tree.node("GeometryNodeMeshUVSphere", segments=12, rings=6, radius=radius * 0.9).value
    ball = tree.node("GeometryNodeSetShadeSmooth", ball).value
    dome = op.join(cap, paint_faces(move_geometry(ball, (0.0, 0.0, -ball_depth)), pole.glass_material))
    dome = op.only_if(
        pole.arm_length > sizes.SHORTEST_ARM, move_geometry(dome, op.vector(tree, -pole.arm_length, 0.0, mount))
    )
    *size, cabinet_z = sizes.POLE_CABINET
    cabinet = box(tree, tuple(size), op.vector(tree, 0.0, pole.diameter * 0.5 + 0.1, cabinet_z))
    return op.join(pair, dome, paint_faces(cabinet, pole.housing_material))


def _camera(tree: Tree, pole: _Pole) -> Value:
    """Add nodes for a camera under its sunshield around the origin, looking along -y and down."""
    (width, length, height), (extra_width, extra_length, thickness) = sizes.CAMERA, sizes.CAMERA_SHIELD
    shield = box(tree, (width + extra_width, length + extra_length, thickness), (0.0, -0.03, height / 2 + 0.012))
    lens = tube(tree, 0.045, 0.02)
    lens = op.transform(lens, translation=(0.0, 0.01 - length / 2, 0.0), rotation=(math.pi / 2, 0.0, 0.0))
    camera = op.join(
        paint_faces(op.join(box(tree, sizes.CAMERA), shield), pole.housing_material),
        paint_faces(lens, pole.glass_material),
    )
    return op.transform(camera, rotation=(math.radians(sizes.CAMERA_TILT), 0.0, 0.0))


@model_part("poles", 130)
def build_poles(builder: ModelBuilder) -> None:
    """Add one object per pole to the model."""
    for name, pole in builder.parameters.of_type(Pole).items():
        builder.add_thing(
            name,
            pole,
            pole_group(),
            surveillance=pole.kind == "surveillance",
            glass_material="lamp_glass" if pole.kind == "lighting" else "display",
        )
