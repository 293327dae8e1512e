"""SR Foot: where something that runs along the road stands on the surface."""

from __future__ import annotations

from . import operations as op
from .backbone import height_on, look_up, raise_place, station_ribbon
from .builder import Operand, Tree, Value, makes_group

FAR = (-1000.0, 1000.0)


def foot_at(backbone: Value, surfaces: tuple[Value, Value], station: Value, offset: Operand) -> tuple[Value, Value]:
    """Return the point on the surface at stations and offsets (fields), and the vector to the left.

    Args:
        backbone: geometry of the backbone.
        surfaces: geometry of the road and of the terrain.
    """
    road, terrain = surfaces
    node = backbone.tree.call(
        foot_group(), backbone=backbone, road=road, terrain=terrain, station=station, offset=offset
    )
    return node["Foot"], node["Left"]


@makes_group("SR Foot")
def foot_group(tree: Tree) -> None:
    """The point on the surface at a station and an offset, both of which may be fields."""
    backbone = tree.input("Backbone", "Geometry", description="Polyline along the axis with its attributes")
    road = tree.input("Road", "Geometry", description="Surface of the road")
    terrain = tree.input("Terrain", "Geometry", description="Surface beside the road")
    station = tree.number("Station", 0.0, (-1e3, 1e6), unit="m", description="Station")
    offset = tree.number("Offset", 0.0, FAR, unit="m", description="Offset, positive to the left")
    ribbon = station_ribbon(backbone)
    with tree.frame("Place in plan"):
        left = look_up(ribbon, "left", station)
        place = look_up(ribbon, "axis", station) + left * offset
    with tree.frame("On the surface"):
        foot = raise_place(place, height_on(road, terrain, place) - op.component(place, "Z"))
        tree.output("Foot", foot, description="Point on the surface")
    tree.output("Left", left, description="Unit vector to the left")
