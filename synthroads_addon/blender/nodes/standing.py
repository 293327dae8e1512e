"""Objects that stand at a point: points moved onto the surface, and bodies placed on them."""

from __future__ import annotations

from . import operations as op
from .backbone import height_on, raise_place
from .builder import Operand, Value
from .inputs import Inputs, instance_number, socket


class OnSurface(Inputs):
    """Inputs of a node group that puts things on points of the surface.

    Attributes:
        points: places in plan, with ``heading`` (rad, the turn about z) and ``elevation`` (m above the surface).
        road, terrain: objects whose surfaces things stand on.
    """

    points = socket("Geometry", "Places; heading (rad) and elevation (m) as attributes")
    road = socket("Object", "Surface that it stands on; else it is at the height of the points")
    terrain = socket("Object", "Surface beside the road")

    def places(self) -> Value:
        """Add nodes for the points moved onto the surfaces of road or terrain."""
        return on_surface(self.points, self.road, self.terrain)


class Standing(OnSurface):
    """Inputs of a node group that puts one thing, with its instance number, on points of the surface.

    Attributes:
        instance: instance number of the faces.
    """

    instance = instance_number()

    def put_labelled(self, parts: list[Value], class_id: int) -> Value:
        """Add nodes for the joined parts on every point of the surface, labelled with class and instance."""
        places = self.places()
        return self.label(put_on(places, op.join(*parts)), class_id)

    def label(self, mesh: Value, class_id: int) -> Value:
        """Add nodes that store class and instance number on all faces; return the geometry."""
        return op.label(mesh, class_id, self.instance)


def on_surface(points: Value, road: Value, terrain: Value) -> Value:
    """Add nodes that move points onto the surface of road or terrain (objects), plus ``elevation``; return them."""
    tree = points.tree
    place = op.position(tree)
    height = height_on(road, terrain, place)
    plan_position = place * (1.0, 1.0, 0.0)
    return op.set_position(points, raise_place(plan_position, height + op.named_attribute(tree, "elevation")))


def put_on(points: Value, body: Value, scale: Operand = 1.0) -> Value:
    """Add nodes for a realized copy of the body on every point, turned by its ``heading``, with its attributes."""
    tree = points.tree
    turn = op.turn(tree, z=op.named_attribute(tree, "heading"))
    return op.realize(
        tree.node("GeometryNodeInstanceOnPoints", points, instance=body, rotation=turn, scale=scale).value
    )
