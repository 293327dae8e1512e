"""Traffic lights: lamps one above the other with visors, before a dark board, on a post (SR Traffic Light)."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ...base.classes import class_id
from ...road.parameters import TrafficLight
from ...road.things.body_shapes import TRAFFIC_LIGHT_POST
from ..materials import material
from ..nodes import operations as op
from ..nodes.builder import Tree, Value, makes_group
from ..nodes.solids import box, loft, move_geometry, paint_faces, put_on_points, row_of_points
from ..nodes.standing import BURIED, declare_standing, put_on
from ..nodes.tubes import cone, tube
from .model_builder import ModelBuilder

# In diameters of a light: a chamber of the housing, and the board behind it.
_CHAMBER = (1.3, 0.7, 1.25)
_BOARD_WIDTH = 1.9
_MARGIN = 0.05  # m of the board above and below the housing
_RIM = 0.018  # m of white around the board
_VISOR_STEPS = 9
_VISOR_THICKNESS = 0.004  # m


@dataclass(frozen=True)
class _Light:
    height: Value
    count: Value
    diameter: Value
    steel: Value
    housing: Value
    rim: Value
    lamps: tuple[Value, Value, Value]

    def level(self, number: Value) -> Value:
        """Return the height of a light's middle above the surface, 0 being the uppermost."""
        return self.height - _MARGIN - (number + 0.5) * self.diameter * _CHAMBER[2]


def _declare(tree: Tree) -> _Light:
    def metres(name: str, default: float, limits: tuple[float, float], description: str) -> Value:
        return tree.number(name, default, limits, unit="m", description=description)

    def finish(name: str, of: str) -> Value:
        return tree.input(f"{name} Material", "Material", description=f"Material of {of}")

    return _Light(
        height=metres("Height", 3.2, (1.0, 10.0), "Top above the surface"),
        count=tree.integer("Lights", 3, (1, 4), description="Number of lights"),
        diameter=metres("Light Diameter", 0.2, (0.05, 0.5), "Diameter of a light"),
        steel=finish("Post", "the post"),
        housing=finish("Housing", "housing, visors and board"),
        rim=finish("Rim", "the board's rim"),
        lamps=(
            finish("Red", "the red light"),
            finish("Yellow", "yellow lights"),
            finish("Green", "the green light"),
        ),
    )


@makes_group("SR Traffic Light")
def traffic_light_group(tree: Tree) -> None:
    """A traffic light, seen by those who drive along +y; points carry ``heading`` (rad) and ``elevation`` (m)."""
    standing = declare_standing(tree)
    light = _declare(tree)

    with tree.frame("Post"):
        tall = light.height + (BURIED - 0.03)
        parts = [paint_faces(move_geometry(tube(tree, TRAFFIC_LIGHT_POST / 2, tall), (0.0, 0.0, -BURIED)), light.steel)]
    with tree.frame("Board with its rim, and housing"):
        parts += _housing(tree, light)
    with tree.frame("Lights by their number from above: red, yellow, green, yellow"):
        parts.append(_lamps(tree, light))
    with tree.frame("Visors"):
        number = op.index(tree)
        place = op.vector(tree, 0.0, _front(light), light.level(number))
        visors = put_on_points(row_of_points(tree, light.count), _visor(tree, light.diameter), place)
        parts.append(paint_faces(visors, light.housing))
    with tree.frame("Put onto the points"):
        mesh = standing.labelled(put_on(standing.places(), op.join(*parts)), class_id("traffic_light"))
    tree.output("Mesh", mesh, description="Traffic light with its post")


def _front(light: _Light) -> Value:
    """Return the y of the housing's front."""
    return light.diameter * -_CHAMBER[1] - (TRAFFIC_LIGHT_POST / 2 + 0.01)


def _housing(tree: Tree, light: _Light) -> list[Value]:
    tall = light.diameter * _CHAMBER[2] * light.count
    middle = light.height - _MARGIN - tall * 0.5
    wide, back = light.diameter * _BOARD_WIDTH, -TRAFFIC_LIGHT_POST / 2 - 0.005
    rim = box(tree, op.vector(tree, wide, 0.004, tall + 2 * _MARGIN), op.vector(tree, 0.0, back, middle))
    size = op.vector(tree, wide - 2 * _RIM, 0.008, tall + 2 * (_MARGIN - _RIM))
    board = box(tree, size, op.vector(tree, 0.0, back - 0.001, middle))
    depth = light.diameter * _CHAMBER[1]
    chamber = op.vector(tree, light.diameter * _CHAMBER[0], depth, light.diameter * (_CHAMBER[2] - 0.02))
    level = light.level(op.index(tree))
    chambers = put_on_points(
        row_of_points(tree, light.count), box(tree, chamber), op.vector(tree, 0.0, depth * -0.5 - 0.055, level)
    )
    return [paint_faces(rim, light.rim), paint_faces(op.join(board, chambers), light.housing)]


def _lamps(tree: Tree, light: _Light) -> Value:
    """Return the domed glasses."""
    wide = light.diameter
    dome = cone(tree, wide * 0.5, wide * 0.22, wide * 0.12)
    dome = op.transform(dome, rotation=(math.pi / 2, 0.0, 0.0))
    number = op.index(tree)
    points = op.store(row_of_points(tree, light.count), "number", number)
    lamps = op.realize(put_on_points(points, dome, op.vector(tree, 0.0, _front(light), light.level(number))))
    number = op.named_attribute(tree, "number", "INT")
    red, yellow, green = light.lamps
    is_green = (number > 0) & number.equals(op.rounded_up(op.minimum(light.count, 3.0)) - 1)
    for glass, chosen in ((yellow, True), (red, number.equals(0)), (green, is_green)):
        lamps = paint_faces(lamps, glass, chosen)
    return lamps


def _visor(tree: Tree, diameter: Value) -> Value:
    """Return a sheet bent over a light, open below, that reaches forward; the light's middle is the origin."""
    turns = [math.radians(-35.0 + 250.0 * i / (_VISOR_STEPS - 1)) for i in range(_VISOR_STEPS)]
    # Clockwise as seen along -y, from outside over the top and back inside.
    outer = [(math.cos(t), 0.0, math.sin(t)) for t in turns]
    inner = [(math.cos(t), 1.0, math.sin(t)) for t in reversed(turns)]

    def outline(number: Value) -> Value:
        point = op.choose(number, outer + inner)
        radius = diameter * 0.56 - op.component(point, "Y") * _VISOR_THICKNESS
        flat = point * (1.0, 0.0, 1.0)
        return flat * radius

    def place(point: Value, row: Value) -> Value:
        # The upper part reaches farther forward than the ends.
        reach = diameter * 0.55 + op.maximum(op.component(point, "Z"), 0.0) * 0.5
        return point - op.vector(tree, 0.0, reach * row)

    return loft(tree, outline, 2 * _VISOR_STEPS, 2, place)


def build_traffic_lights(builder: ModelBuilder) -> None:
    """Make one object per traffic light."""
    for name, light in builder.parameters.of_type(TrafficLight).items():
        inputs = {
            **builder.surfaces(),
            "Height": light.height,
            "Lights": light.lights,
            "Light Diameter": light.light_diameter,
            "Instance": light.instance,
            "Post Material": material("galvanised_steel"),
            "Housing Material": material("plastic_black"),
            "Rim Material": material("sheeting_white"),
            "Red Material": material("lamp_red"),
            "Yellow Material": material("lamp_yellow"),
            "Green Material": material("lamp_green"),
        }
        builder.add(name, builder.points(name, [light], {}), traffic_light_group(), inputs)
