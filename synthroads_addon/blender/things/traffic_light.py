"""Traffic lights: lamps one above the other with visors, before a dark board, on a post (SR Traffic Light)."""

from __future__ import annotations

import math

from ...base.classes import class_id
from ...road.things import traffic_light as sizes
from ...road.things.body import BURIED
from ...road.things.traffic_light import TrafficLight
from ..nodes import operations as op
from ..nodes.builder import Tree, Value, makes_group
from ..nodes.inputs import integer, material_of, metres
from ..nodes.solids import box, cone, loft, move_geometry, paint_faces, put_on_points, row_of_points, tube
from ..nodes.standing import Standing
from .model_builder import ModelBuilder
from .registry import model_part


class _Light(Standing):
    height = metres(3.2, (1.0, 10.0), "Top above the surface")
    lights = integer(3, (1, 4), "Number of lights")
    light_diameter = metres(0.2, (0.05, 0.5), "Diameter of a light")
    post_material = material_of("the post", "galvanised_steel")
    housing_material = material_of("housing, visors and board", "plastic_black")
    rim_material = material_of("the board's rim", "sheeting_white")
    red_material = material_of("the red light", "lamp_red")
    yellow_material = material_of("yellow lights", "lamp_yellow")
    green_material = material_of("the green light", "lamp_green")

    def level(self, number: Value) -> Value:
        """Add nodes for the height (m) of a light's middle above the surface; number 0 is the uppermost."""
        return self.height - sizes.MARGIN - (number + 0.5) * self.light_diameter * sizes.CHAMBER[2]


@makes_group("SR Traffic Light", catalogue="Roadside")
def traffic_light_group(tree: Tree) -> None:
    """A traffic light, seen by those who drive along +y; points carry ``heading`` (rad) and ``elevation`` (m)."""
    light = _Light(tree)

    with tree.frame("Post"):
        post_height = light.height + (BURIED - 0.03)
        parts = [
            paint_faces(
                move_geometry(tube(tree, sizes.POST / 2, post_height), (0.0, 0.0, -BURIED)),
                light.post_material,
            )
        ]
    with tree.frame("Board with its rim, and housing"):
        parts += _housing(tree, light)
    with tree.frame("Lights by their number from above: red, yellow, green, yellow"):
        parts.append(_lamps(tree, light))
    with tree.frame("Visors"):
        light_index = op.index(tree)
        place = op.vector(tree, 0.0, _front(light), light.level(light_index))
        visors = put_on_points(row_of_points(tree, light.lights), _visor(tree, light.light_diameter), place)
        parts.append(paint_faces(visors, light.housing_material))
    with tree.frame("Put onto the points"):
        mesh = light.put_labelled(parts, class_id(TrafficLight.points_class))
    tree.output("Mesh", mesh, description="Traffic light with its post")


def _front(light: _Light) -> Value:
    """Add nodes for the y (m) of the housing's front."""
    return light.light_diameter * -sizes.CHAMBER[1] - (sizes.POST / 2 + 0.01)


def _housing(tree: Tree, light: _Light) -> list[Value]:
    """Add nodes for the dark board with its rim, and for the lights' chambers; return [rim, board and chambers]."""
    # All chambers together; the board exceeds them by a margin.
    chambers_height = light.light_diameter * sizes.CHAMBER[2] * light.lights
    middle_z = light.height - sizes.MARGIN - chambers_height * 0.5
    rim_width, rim_y = light.light_diameter * sizes.BOARD, -sizes.POST / 2 - sizes.BEHIND
    rim_size = op.vector(tree, rim_width, sizes.RIM, chambers_height + 2 * sizes.MARGIN)
    rim = box(tree, rim_size, op.vector(tree, 0.0, rim_y, middle_z))
    # The board lies in front of the rim and leaves its edges free.
    board_thickness, board_distance = sizes.PANEL
    board_width = rim_width - 2 * sizes.EDGE
    board_height = chambers_height + 2 * (sizes.MARGIN - sizes.EDGE)
    board_size = op.vector(tree, board_width, board_thickness, board_height)
    board = box(tree, board_size, op.vector(tree, 0.0, rim_y - board_distance, middle_z))
    chamber_depth = light.light_diameter * sizes.CHAMBER[1]
    chamber_size = op.vector(
        tree,
        light.light_diameter * sizes.CHAMBER[0],
        chamber_depth,
        light.light_diameter * (sizes.CHAMBER[2] - sizes.JOINT),
    )
    level = light.level(op.index(tree))
    points, chamber = row_of_points(tree, light.lights), box(tree, chamber_size)
    chambers = put_on_points(points, chamber, op.vector(tree, 0.0, chamber_depth * -0.5 - 0.055, level))
    return [paint_faces(rim, light.rim_material), paint_faces(op.join(board, chambers), light.housing_material)]


def _lamps(tree: Tree, light: _Light) -> Value:
    """Add nodes for the lights' domed glasses: red on top, then yellow, green, yellow."""
    diameter = light.light_diameter
    dome = cone(tree, diameter * 0.5, diameter * 0.22, diameter * 0.12)
    dome = op.transform(dome, rotation=(math.pi / 2, 0.0, 0.0))
    light_index = op.index(tree)
    points = op.store(row_of_points(tree, light.lights), "number", light_index)
    lamps = op.realize(put_on_points(points, dome, op.vector(tree, 0.0, _front(light), light.level(light_index))))
    light_index = op.named_attribute(tree, "number", "INT")
    # Green is the lowest of up to three lights; a single light is red. Rounding up only makes the number an integer.
    is_green = (light_index > 0) & light_index.equals(op.round_up(op.minimum(light.lights, 3.0)) - 1)
    for glass, selection in (
        (light.yellow_material, True),
        (light.red_material, light_index.equals(0)),
        (light.green_material, is_green),
    ):
        lamps = paint_faces(lamps, glass, selection)
    return lamps


def _visor(tree: Tree, diameter: Value) -> Value:
    """Add nodes for a light's visor, a bent sheet open below that reaches forward; the light's middle is the origin."""
    radius_share, thickness, reach_share, extra_reach = sizes.VISOR
    # Clockwise as seen along -y, from outside over the top and back inside.
    outer_points = [(math.cos(t), 0.0, math.sin(t)) for t in sizes.VISOR_TURNS]
    inner_points = [(math.cos(t), 1.0, math.sin(t)) for t in reversed(sizes.VISOR_TURNS)]

    def outline(number: Value) -> Value:
        point = op.choose(number, outer_points + inner_points)
        radius = diameter * radius_share - op.component(point, "Y") * thickness
        direction = point * (1.0, 0.0, 1.0)
        return direction * radius

    def place(point: Value, row: Value) -> Value:
        # The upper part reaches farther forward than the ends.
        reach = diameter * reach_share + op.maximum(op.component(point, "Z"), 0.0) * extra_reach
        return point - op.vector(tree, 0.0, reach * row)

    return loft(tree, outline, 2 * len(sizes.VISOR_TURNS), 2, place)


@model_part("traffic_lights", 140)
def build_traffic_lights(builder: ModelBuilder) -> None:
    """Add one object per traffic light to the model."""
    for name, light in builder.parameters.of_type(TrafficLight).items():
        builder.add_thing(name, light, traffic_light_group())
