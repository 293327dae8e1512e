"""Movable barriers of construction zones: elements in a line or along the road (SR Temporary Barrier)."""

from __future__ import annotations

from dataclasses import dataclass

import bpy

from ...base.classes import class_id
from ...road.parameters import TemporaryBarrier
from ...road.things.body_shapes import LONGEST_PLASTIC, SHORTEST_ELEMENT, TEMPORARY_FLANKS, TEMPORARY_GAP
from ..materials import material
from ..nodes import operations as op
from ..nodes.backbone import first_station, last_station
from ..nodes.builder import Tree, Value, makes_group
from ..nodes.foot import foot_at
from ..nodes.solids import box, loft, paint_faces, put_on_points, row_of_points
from ..nodes.strip import INSTANCES
from .model_builder import ModelBuilder

_STEEL, _PLASTIC = TEMPORARY_FLANKS["steel"], TEMPORARY_FLANKS["plastic"]
_REFLECTOR = (0.12, 0.02, 0.06)


@dataclass(frozen=True)
class _TemporaryBarrier:
    first: Value
    last: Value
    offset: Value
    end_offset: Value
    height: Value
    width: Value
    length: Value
    plastic: Value


def _declare(tree: Tree) -> _TemporaryBarrier:
    def metres(name: str, default: float, limits: tuple[float, float], description: str) -> Value:
        return tree.number(name, default, limits, unit="m", description=description)

    return _TemporaryBarrier(
        first=metres("Start Station", 0.0, (0.0, 1e6), "Beginning of the first element"),
        last=metres("End Station", 100.0, (0.0, 1e6), "End of the last element"),
        offset=metres("Offset", 0.0, (-100.0, 100.0), "Offset of its axis at the beginning"),
        end_offset=metres("End Offset", 0.0, (-100.0, 100.0), "Offset of its axis at the end"),
        height=metres("Height", 0.55, (0.2, 1.2), "Top above the surface"),
        width=metres("Base Width", 0.4, (0.1, 1.0), "Width of its foot"),
        length=metres("Segment Length", 4.0, (1.0, 12.0), "Length of one element along the road"),
        plastic=tree.boolean("Plastic", False, description="Hollow plastic elements, else steel ones"),
    )


@makes_group("SR Temporary Barrier")
def temporary_barrier_group(tree: Tree) -> None:
    """Movable barrier elements along the road, from one offset to another, every second one in another colour."""
    backbone = tree.input("Backbone", "Object", description="Polyline along the axis with its attributes")
    road = tree.input("Road", "Object", description="Surface that the elements stand on")
    terrain = tree.input("Terrain", "Object", description="Surface beside the road")
    barrier = _declare(tree)
    instance = tree.integer("Instance", 0, INSTANCES, description="Instance number of the faces")
    first = tree.input("Material", "Material", description="Material of the first, third, ... element")
    second = tree.input("Second Material", "Material", description="Material of the second, fourth, ... element")
    glass = tree.input("Reflector Material", "Material", description="Material of the reflectors on steel elements")

    with tree.frame("Geometry"):
        axis = op.object_geometry(backbone)
        surfaces = op.object_geometry(road), op.object_geometry(terrain)
    with tree.frame("Elements, cut where the backbone ends"):
        points = _elements(tree, barrier, first_station(axis), last_station(axis))
    with tree.frame("Both ends on the surface"):
        for end in ("from", "to"):
            station = op.named_attribute(tree, end)
            foot, _ = foot_at(axis, surfaces, station, _offset(barrier, station))
            points = op.store(points, f"{end}_foot", foot)
    with tree.frame("Element of length 1"):
        body = _body(tree, barrier)
        marks = op.only_if(~barrier.plastic, paint_faces(_reflectors(tree, barrier), glass))
    with tree.frame("Elements from foot to foot"):
        parts = []
        for parity, finish in enumerate((first, second)):
            chosen = op.separate(points, (op.named_attribute(tree, "number", "INT") % 2).equals(parity))
            parts.append(_put_on_elements(tree, chosen, paint_faces(body, finish), True))
            parts.append(_put_on_elements(tree, chosen, marks, False))
    with tree.frame("Labels"):
        mesh = op.realize(op.join(*parts))
        mesh = op.store(mesh, "class_id", class_id("construction_barrier"), "FACE")
        mesh = op.store(mesh, "instance_id", instance, "FACE")
    tree.output("Mesh", mesh, description="Elements")


def _elements(tree: Tree, barrier: _TemporaryBarrier, begin: Value, end: Value) -> Value:
    """Return one point per element with its number and the stations that it lies between."""
    whole = (barrier.last - barrier.first) / barrier.length - SHORTEST_ELEMENT
    count = op.rounded_up(op.maximum(whole, 1.0))
    points = op.store(row_of_points(tree, count), "number", op.index(tree))
    start = barrier.first + op.index(tree) * barrier.length
    stop = op.switch(op.index(tree) < count - 1, barrier.last, start + barrier.length)
    for name, station in {"from": start + TEMPORARY_GAP / 2, "to": stop - TEMPORARY_GAP / 2}.items():
        points = op.store(points, name, op.minimum(op.maximum(station, begin), end))
    return op.delete_points(points, op.named_attribute(tree, "to") - op.named_attribute(tree, "from") < 0.05)


def _offset(barrier: _TemporaryBarrier, station: Value) -> Value:
    """Return the offset at a station."""
    share = (station - barrier.first) / op.maximum(barrier.last - barrier.first, 1e-3)
    return barrier.offset + (barrier.end_offset - barrier.offset) * share


def _body(tree: Tree, barrier: _TemporaryBarrier) -> Value:
    """Return an element from x = 0 to 1."""
    outlines = [
        [(0.0, x, z) for x, z in flank] + [(0.0, -x, z) for x, z in reversed(flank)] for flank in (_STEEL, _PLASTIC)
    ]

    def outline(number: Value) -> Value:
        steel, plastic = (op.choose(number, points) for points in outlines)
        return op.switch(barrier.plastic, steel, plastic)

    def place(point: Value, row: Value) -> Value:
        across, up = op.component(point, "Y") * barrier.width * 0.5, op.component(point, "Z") * barrier.height
        return op.vector(tree, row, across, up)

    return loft(tree, outline, len(outlines[0]), 2, place)


def _reflectors(tree: Tree, barrier: _TemporaryBarrier) -> Value:
    """Return a reflector on either flank, around x = 0."""
    beside = barrier.width * (0.5 * _STEEL[5][0]) + _REFLECTOR[1] * 0.25
    up = barrier.height * 0.82
    sides = [box(tree, _REFLECTOR, op.vector(tree, 0.0, beside * side, up)) for side in (1.0, -1.0)]
    return op.join(*sides)


def _put_on_elements(tree: Tree, points: Value, body: Value, whole: bool) -> Value:
    """Put a body on every element: along the whole of it, or in its middle."""
    start, end = (op.named_attribute(tree, f"{name}_foot", "FLOAT_VECTOR") for name in ("from", "to"))
    turned = tree.node("FunctionNodeAxesToRotation", end - start, (0.0, 0.0, 1.0), primary_axis="X", secondary_axis="Z")
    if not whole:
        return put_on_points(points, body, (start + end) * 0.5, 1.0, turned.value)
    length = op.length(end - start)
    return put_on_points(points, body, start, op.vector(tree, length, 1.0, 1.0), turned.value)


def build_temporary_barriers(builder: ModelBuilder) -> None:
    """Make one object per movable barrier."""
    for name, barrier in builder.parameters.of_type(TemporaryBarrier).items():
        plastic = barrier.segment_length <= LONGEST_PLASTIC
        inputs = {
            **builder.surfaces("Backbone"),
            "Start Station": builder.along(barrier.start_station),
            "End Station": builder.along(barrier.end_station),
            "Offset": barrier.offset,
            "End Offset": barrier.end_offset,
            "Height": barrier.height,
            "Base Width": barrier.base_width,
            "Segment Length": barrier.segment_length,
            "Plastic": plastic,
            "Instance": barrier.instance,
            "Material": material("plastic_red" if plastic else "galvanised_steel"),
            "Second Material": material("plastic_white" if plastic else "galvanised_steel"),
            "Reflector Material": material("reflector"),
        }
        builder.add(name, bpy.data.meshes.new("SR Temporary Barrier"), temporary_barrier_group(), inputs)
