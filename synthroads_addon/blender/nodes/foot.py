"""SR Foot: points on the surface below something that runs along the road, and solids along them."""

from __future__ import annotations

from . import operations as op
from .axis import AxisInputs
from .backbone import first_station, height_on, last_station, look_up, raise_place, station_ribbon
from .builder import Operand, Tree, Value, makes_group
from .inputs import FAR, Inputs, backbone_socket, metres, socket
from .solids import loft, row_of_points


def foot_at(backbone: Value, surfaces: tuple[Value, Value], station: Value, offset: Operand) -> tuple[Value, Value]:
    """Add nodes for the surface points at stations and offsets (fields, m), and the unit vectors to the left.

    Args:
        backbone: geometry of the backbone.
        surfaces: objects of the road and of the terrain.
        station: stations.
        offset: offsets, positive to the left.
    """
    road, terrain = surfaces
    node = backbone.tree.call(
        foot_group(), backbone=backbone, road=road, terrain=terrain, station=station, offset=offset
    )
    return node["Foot"], node["Left"]


class Lengthwise(AxisInputs):
    """Inputs of a node group that puts something along the road.

    Attributes:
        road, terrain: objects that the thing stands on.
        start_station, end_station: stations of its ends.
        offset: offset of its axis.
    """

    road = socket("Object", "Surface that it stands on; else it is at the height of what it follows")
    terrain = socket("Object", "Surface beside the road")
    start_station = metres(0.0, (0.0, 1e6), "Beginning, terminal included")
    end_station = metres(0.0, (0.0, 1e6), "End, terminal included; 0 is the end of what it follows")
    offset = metres(0.0, (-100.0, 100.0), "Offset of its axis, positive to the left")

    def geometry(self) -> tuple[Value, tuple[Value, Value]]:
        """Add nodes for the backbone as geometry; return it and (road, terrain). An end of 0 becomes the last."""
        with self.tree.frame("Geometry, and the end"):
            axis = self.axis()
            end = self.end_station
            self.values["end_station"] = op.switch(end > 0.0, last_station(axis), end)
            return axis, (self.road, self.terrain)

    def rows(self, step: Operand) -> Value:
        """Add nodes for points at its stations, a `step` (m) apart, with ``station``, ``foot`` and ``left``.

        Points beyond an end of the backbone collapse onto that end.
        """
        axis, surfaces = self.geometry()
        tree = self.tree
        with tree.frame("Rows, at even distances"):
            start, end = self.start_station, self.end_station
            count = op.round_up(op.maximum(end - start, 0.01) / step - 1e-4) + 1
            station = op.minimum(start + op.index(tree) * step, end)
            clamped_station = op.minimum(op.maximum(station, first_station(axis)), last_station(axis))
            line = op.store(row_of_points(tree, count), "station", clamped_station)
            foot, left = foot_at(axis, surfaces, op.named_attribute(tree, "station"), self.offset)
            return op.store(op.store(line, "foot", foot), "left", left)


def sweep(
    line: Value, outline: list[tuple[float, float]], width: Operand, height: Operand, base_height: Operand
) -> Value:
    """Add nodes for a closed solid along the points of `Lengthwise.rows`.

    Args:
        line: the rows, with ``foot`` and ``left``.
        outline: x and z of the solid's corners, 0 to 1, clockwise as seen along the rows; x positive to the left.
        width, height: factors of x and z, m.
        base_height: height of z = 0 above the feet, m.
    """
    tree = line.tree

    def place(point: Value, row: Value) -> Value:
        foot = op.sample_index(line, op.named_attribute(tree, "foot", "FLOAT_VECTOR"), row)
        left = op.sample_index(line, op.named_attribute(tree, "left", "FLOAT_VECTOR"), row)
        above = op.component(point, "Z") * height + base_height
        return foot + left * (op.component(point, "X") * width) + op.vector(tree, 0.0, 0.0, above)

    corners = [(x, 0.0, z) for x, z in outline]
    body = loft(tree, lambda number: op.choose(number, corners), len(corners), op.point_count(line), place)
    return op.delete_degenerate(body)


class _Foot(Inputs):
    backbone = backbone_socket()
    road = socket("Object", "Surface of the road")
    terrain = socket("Object", "Surface beside the road")
    station = metres(0.0, (-1e3, 1e6), "Station")
    offset = metres(0.0, FAR, "Offset, positive to the left")


@makes_group("SR Foot")
def foot_group(tree: Tree) -> None:
    """The point on the surface at a station and an offset, both of which may be fields."""
    foot = _Foot(tree)
    ribbon = station_ribbon(foot.backbone)
    with tree.frame("Place in plan"):
        left = look_up(ribbon, "left", foot.station)
        place = look_up(ribbon, "axis", foot.station) + left * foot.offset
    with tree.frame("On the surface"):
        below = raise_place(place, height_on(foot.road, foot.terrain, place) - op.component(place, "Z"))
        tree.output("Foot", below, description="Point on the surface")
    tree.output("Left", left, description="Unit vector to the left")
