"""Movable barriers of construction zones: elements in a line or along the road (SR Temporary Barrier)."""

from __future__ import annotations

from ...base.classes import class_id
from ...road.things import temporary_barrier as sizes
from ...road.things.temporary_barrier import TemporaryBarrier
from ...road.things.thing import SHORTEST_ELEMENT
from ..nodes import operations as op
from ..nodes.backbone import first_station, last_station
from ..nodes.builder import Tree, Value, makes_group
from ..nodes.foot import Lengthwise, foot_at
from ..nodes.inputs import boolean, instance_number, material_of, metres
from ..nodes.solids import box, loft, paint_faces, put_on_points, row_of_points
from .model_builder import ModelBuilder
from .registry import model_part

_STEEL, _PLASTIC = sizes.FLANKS["steel"], sizes.FLANKS["plastic"]


class _TemporaryBarrier(Lengthwise):
    start_station = metres(0.0, (0.0, 1e6), "Beginning of the first element")
    end_station = metres(0.0, (0.0, 1e6), "End of the last element; 0 is that of what it follows")
    offset = metres(0.0, (-100.0, 100.0), "Offset of its axis at the beginning")
    end_offset = metres(0.0, (-100.0, 100.0), "Offset of its axis at the end")
    height = metres(0.55, (0.2, 1.2), "Top above the surface")
    base_width = metres(0.4, (0.1, 1.0), "Width of its foot")
    segment_length = metres(4.0, (1.0, 12.0), "Length of one element along the road")
    plastic = boolean(False, "Hollow plastic elements, else steel ones")
    instance = instance_number()
    material = material_of("the first, third, ... element", "galvanised_steel")
    second_material = material_of("the second, fourth, ... element", "galvanised_steel")
    reflector_material = material_of("the reflectors on steel elements", "reflector")


@makes_group("SR Temporary Barrier", catalogue="Barriers")
def temporary_barrier_group(tree: Tree) -> None:
    """Movable barrier elements along the road, from one offset to another, every second one in another colour."""
    barrier = _TemporaryBarrier(tree)
    axis, surfaces = barrier.geometry()
    with tree.frame("Elements, cut where the backbone ends"):
        points = _elements(tree, barrier, first_station(axis), last_station(axis))
    with tree.frame("Both ends on the surface"):
        for end in ("from", "to"):
            station = op.named_attribute(tree, end)
            foot, _ = foot_at(axis, surfaces, station, _offset(barrier, station))
            points = op.store(points, f"{end}_foot", foot)
    with tree.frame("Element of length 1"):
        body = _body(tree, barrier)
        marks = op.only_if(~barrier.plastic, paint_faces(_reflectors(tree, barrier), barrier.reflector_material))
    with tree.frame("Elements from foot to foot"):
        parts = []
        for parity, finish in enumerate((barrier.material, barrier.second_material)):
            parity_points = op.separate(points, (op.named_attribute(tree, "number", "INT") % 2).equals(parity))
            parts.append(_put_on_elements(tree, parity_points, paint_faces(body, finish), True))
            parts.append(_put_on_elements(tree, parity_points, marks, False))
    with tree.frame("Labels"):
        mesh = op.label(op.realize(op.join(*parts)), class_id(TemporaryBarrier.points_class), barrier.instance)
    tree.output("Mesh", mesh, description="Elements")


def _elements(tree: Tree, barrier: _TemporaryBarrier, backbone_start: Value, backbone_end: Value) -> Value:
    """Add nodes for one point per element with its ``number`` and the stations ``from`` and ``to``."""
    element_count = (barrier.end_station - barrier.start_station) / barrier.segment_length - SHORTEST_ELEMENT
    count = op.round_up(op.maximum(element_count, 1.0))
    points = op.store(row_of_points(tree, count), "number", op.index(tree))
    element_start = barrier.start_station + op.index(tree) * barrier.segment_length
    element_end = op.switch(op.index(tree) < count - 1, barrier.end_station, element_start + barrier.segment_length)
    for name, station in {"from": element_start + sizes.GAP / 2, "to": element_end - sizes.GAP / 2}.items():
        points = op.store(points, name, op.minimum(op.maximum(station, backbone_start), backbone_end))
    return op.delete_points(points, op.named_attribute(tree, "to") - op.named_attribute(tree, "from") < 0.05)


def _offset(barrier: _TemporaryBarrier, station: Value) -> Value:
    """Add nodes for the barrier's offset (m) at a station, linear from its beginning to its end."""
    share = (station - barrier.start_station) / op.maximum(barrier.end_station - barrier.start_station, 1e-3)
    return barrier.offset + (barrier.end_offset - barrier.offset) * share


def _body(tree: Tree, barrier: _TemporaryBarrier) -> Value:
    """Add nodes for an element's body from x = 0 to 1, of steel or plastic profile."""
    outlines = [
        [(0.0, x, z) for x, z in flank] + [(0.0, -x, z) for x, z in reversed(flank)] for flank in (_STEEL, _PLASTIC)
    ]

    def outline(number: Value) -> Value:
        steel, plastic = (op.choose(number, points) for points in outlines)
        return op.switch(barrier.plastic, steel, plastic)

    def place(point: Value, row: Value) -> Value:
        y, z = op.component(point, "Y") * barrier.base_width * 0.5, op.component(point, "Z") * barrier.height
        return op.vector(tree, row, y, z)

    return loft(tree, outline, len(outlines[0]), 2, place)


def _reflectors(tree: Tree, barrier: _TemporaryBarrier) -> Value:
    """Add nodes for a reflector on either flank, around x = 0."""
    y = barrier.base_width * (0.5 * _STEEL[5][0]) + sizes.REFLECTOR[1] * 0.25
    z = barrier.height * 0.82
    sides = [box(tree, sizes.REFLECTOR, op.vector(tree, 0.0, y * side, z)) for side in (1.0, -1.0)]
    return op.join(*sides)


def _put_on_elements(tree: Tree, points: Value, body: Value, is_stretched: bool) -> Value:
    """Add nodes for an instance of a body on every element: stretched along it, or in its middle."""
    start, end = (op.named_attribute(tree, f"{name}_foot", "FLOAT_VECTOR") for name in ("from", "to"))
    rotation = tree.node(
        "FunctionNodeAxesToRotation", end - start, (0.0, 0.0, 1.0), primary_axis="X", secondary_axis="Z"
    )
    if not is_stretched:
        return put_on_points(points, body, (start + end) * 0.5, 1.0, rotation.value)
    length = op.length(end - start)
    return put_on_points(points, body, start, op.vector(tree, length, 1.0, 1.0), rotation.value)


@model_part("temporary_barriers", 70)
def build_temporary_barriers(builder: ModelBuilder) -> None:
    """Add one object per movable barrier to the model."""
    for name, barrier in builder.parameters.of_type(TemporaryBarrier).items():
        plastic = barrier.plastic
        builder.add_thing(
            name,
            barrier,
            temporary_barrier_group(),
            plastic=plastic,
            material="plastic_red" if plastic else "galvanised_steel",
            second_material="plastic_white" if plastic else "galvanised_steel",
        )
