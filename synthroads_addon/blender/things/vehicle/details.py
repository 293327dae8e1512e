"""Parts of vehicles other than their bodies: wheels, boxes such as lights and plates, and round parts."""

from __future__ import annotations

import math
from collections.abc import Iterable

from ...nodes import operations as op
from ...nodes.builder import Tree, Value, makes_group
from ...nodes.inputs import Inputs, boolean, material_of, metres, socket
from ...nodes.solids import Point, box, move_geometry, paint_faces, put_on_points, row_of_points


class VehicleMaterials(Inputs):
    """Inputs for the materials of a vehicle's parts."""

    paint_material = material_of("paint, in the vehicle's colour", "car_paint")
    glass_material = material_of("windows", "glass")
    rubber_material = material_of("tyres", "rubber")
    chrome_material = material_of("rims and bright metal", "chrome")
    black_material = material_of("bumpers, frames and other dark parts", "plastic_black")
    white_light_material = material_of("headlights", "lamp_glass")
    red_light_material = material_of("tail lights", "lamp_red")
    plate_material = material_of("number plates", "number_plate")
    cover_material = material_of("tarpaulin or box of a truck", "tarpaulin")

    def __getitem__(self, name: str) -> Value:
        """Return the value of a material input by its short name, such as ``paint``."""
        return self.values[f"{name}_material"]


_SIDES = 16
# Cross-section of a wheel from the hub outside to the hub inside: radius as a share of the wheel's, and position along
# the axle as a share of its width from the middle.
_WHEEL = [(0.0, 0.30), (0.58, 0.30), (0.66, 0.46), (0.92, 0.5), (1.0, 0.38), (1.0, -0.38), (0.92, -0.5), (0.0, -0.4)]
_RIM_FACES = 2
_SHARP_ANGLE = math.radians(38.0)
"""Angle between faces, rad, from which on their edge is shaded sharp; chosen."""


def wheels(
    tree: Tree, materials: VehicleMaterials, radius: float, width: float, axles: Iterable[tuple[float, float]]
) -> Value:
    """Add nodes for wheels that stand on z = 0, their outer sides away from x = 0.

    Args:
        tree: the group.
        materials: materials of the vehicle's parts.
        radius, width: size of a wheel, m.
        axles: x of the middles of an axle's wheels, 0 for a single wheel, and y of the axle, m.
    """
    wheel = tree.call(
        _wheel_group(),
        radius=radius,
        wheel_width=width,
        rubber_material=materials.rubber_material,
        chrome_material=materials.chrome_material,
    ).value
    wheel_places = [(side * x, y, radius) for x, y in axles for side in ((-1.0, 1.0) if x else (1.0,))]
    points = row_of_points(tree, len(wheel_places))
    place = op.choose(op.index(tree), wheel_places)
    angle = op.switch(op.component(place, "X") < 0.0, math.pi, 0.0)
    return op.realize(put_on_points(points, wheel, place, rotation=op.turn(tree, z=angle)))


def boxes(
    tree: Tree, materials: VehicleMaterials, items: Iterable[tuple[str, Point, Point]], mirrored: bool = False
) -> Value:
    """Add nodes for boxes given by (material, middle, size), m; if mirrored, also on the other side of x = 0."""
    group = _box_group()
    parts = [
        tree.call(group, middle=middle, size=size, both_sides=mirrored, material=materials[material]).value
        for material, middle, size in items
    ]
    return op.join(*parts)


def rod(
    tree: Tree,
    materials: VehicleMaterials,
    material: str,
    start: Point,
    end: Point,
    radii: tuple[float, float],
    mirrored: bool = False,
) -> Value:
    """Add nodes for a round, tapered, closed rod between two places, m; if mirrored, also beyond x = 0."""
    radius, end_radius = radii
    return tree.call(
        _rod_group(),
        start=start,
        end=end,
        start_radius=radius,
        end_radius=end_radius,
        both_sides=mirrored,
        material=materials[material],
    ).value


def ball(tree: Tree, materials: VehicleMaterials, material: str, middle: Point, size: Point) -> Value:
    """Add nodes for an ellipsoid of half axes `size`, m, around its middle."""
    sphere = tree.node("GeometryNodeMeshUVSphere", segments=12, rings=8, radius=1.0).value
    return paint_faces(op.transform(sphere, translation=middle, scale=size), materials[material])


def smooth(vehicle: Value) -> Value:
    """Add nodes that shade a vehicle smoothly but for edges sharper than 38 degrees; return the vehicle."""
    tree = vehicle.tree
    angle = tree.node("GeometryNodeInputMeshEdgeAngle")["Unsigned Angle"]
    smooth_vehicle = tree.node("GeometryNodeSetShadeSmooth", vehicle, shade_smooth=True).value
    return tree.node("GeometryNodeSetShadeSmooth", smooth_vehicle, angle > _SHARP_ANGLE, False, domain="EDGE").value


class _Wheel(Inputs):
    radius = metres(0.32, (0.05, 2.0), "Radius of the tyre")
    wheel_width = metres(0.21, (0.02, 2.0), "Width of the tyre")
    rubber_material = material_of("the tyre")
    chrome_material = material_of("the rim")


@makes_group("SR Wheel")
def _wheel_group(tree: Tree) -> None:
    """A wheel around the origin, its axle along x, whose outer side looks to -x."""
    inputs = _Wheel(tree)
    with tree.frame("Profile, turned around the axle"):
        mesh, column, row = op.grid(tree, _SIDES + 1, len(_WHEEL))
        profile = op.choose(row, [(share, x, 0.0) for share, x in _WHEEL])
        # The lowest point of the tread is a corner of the polygon.
        angle = (column % _SIDES) * (2.0 * math.pi / _SIDES) + 0.5 * math.pi
        radius = op.component(profile, "X") * inputs.radius
        x = op.component(profile, "Y") * inputs.wheel_width
        place = op.vector(tree, -x, op.unary("COSINE", angle) * radius, op.unary("SINE", angle) * radius)
        wheel = op.delete_degenerate(op.set_position(mesh, place))
    with tree.frame("Tyre and rim"):
        wheel = paint_faces(wheel, inputs.rubber_material)
        rim = (op.index(tree) % (len(_WHEEL) - 1)) < _RIM_FACES
        wheel = paint_faces(wheel, inputs.chrome_material, rim)
    tree.output("Mesh", wheel, description="The wheel")


class _Sides(Inputs):
    both_sides = boolean(False, "Another one stands on the other side of x = 0")
    material = material_of("the faces")


class _Box(Inputs):
    middle = socket("Vector", "Middle of the box (m)")
    size = socket("Vector", "Its size (m)")


@makes_group("SR Vehicle Box")
def _box_group(tree: Tree) -> None:
    """A box, or one on each side of a vehicle."""
    inputs, sides = _Box(tree), _Sides(tree)
    middle, size, material = inputs.middle, inputs.size, sides.material
    with tree.frame("Box"):
        body = paint_faces(move_geometry(box(tree, size), middle), material)
    with tree.frame("On the other side"):
        other_box = move_geometry(box(tree, size), _mirror(middle))
        body = op.join(body, op.only_if(sides.both_sides, paint_faces(other_box, material)))
    tree.output("Mesh", body, description="The box")


class _Rod(Inputs):
    start = socket("Vector", "Middle of its first end (m)")
    end = socket("Vector", "Middle of its other end (m)")
    start_radius = metres(0.05, (0.001, 5.0), "Radius at the first end")
    end_radius = metres(0.05, (0.001, 5.0), "Radius at the other end")


@makes_group("SR Vehicle Rod")
def _rod_group(tree: Tree) -> None:
    """A round, tapered rod between two places, or one on each side of a vehicle."""
    inputs, sides = _Rod(tree), _Sides(tree)
    start, end = inputs.start, inputs.end

    def rod_between(rod_start: Value, rod_end: Value) -> Value:
        """Add nodes for a rod between two places."""
        direction = rod_end - rod_start
        length = op.length(direction)
        cone = tree.node(
            "GeometryNodeMeshCone",
            fill_type="NGON",
            vertices=8,
            radius_bottom=inputs.start_radius,
            radius_top=inputs.end_radius,
            depth=length,
        ).value
        rotation = tree.node("FunctionNodeAlignRotationToVector", vector=direction, axis="Z").value
        body = op.transform(cone, translation=rod_start, rotation=rotation)
        return paint_faces(body, sides.material)

    with tree.frame("Rod"):
        body = rod_between(start, end)
    with tree.frame("On the other side"):
        body = op.join(body, op.only_if(sides.both_sides, rod_between(_mirror(start), _mirror(end))))
    tree.output("Mesh", body, description="The rod")


def _mirror(place: Value) -> Value:
    """Add nodes for a place mirrored at x = 0."""
    return place * (-1.0, 1.0, 1.0)
