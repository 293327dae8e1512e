"""The nodes that groups use most, as functions: each adds nodes to its operands' tree and returns their output."""

from __future__ import annotations

from .builder import Operand, Tree, Value

SMALLEST_AREA = 1e-7
"""Faces smaller than this (m2) come from strips of no width or cut offset curves; damage has larger cells."""

_DATA_TYPES = {"VALUE": "FLOAT", "INT": "INT", "BOOLEAN": "BOOLEAN", "VECTOR": "FLOAT_VECTOR"}
_SOCKET_TYPES = {"VALUE": "FLOAT", "INT": "INT", "BOOLEAN": "BOOLEAN", "VECTOR": "VECTOR"}


def index(tree: Tree) -> Value:
    """Add a node for the element's index (a field)."""
    return tree.node("GeometryNodeInputIndex").value


def position(tree: Tree) -> Value:
    """Add a node for the point's position (a field), m."""
    return tree.node("GeometryNodeInputPosition").value


def named_attribute(tree: Tree, name: str, data_type: str = "FLOAT") -> Value:
    """Add a node for the attribute `name` of the geometry that the field is evaluated on."""
    return tree.node("GeometryNodeInputNamedAttribute", name, data_type=data_type).value


def attribute_or(default: Value, name: str) -> Value:
    """Add nodes for the attribute `name` of the type of `default`, and `default` where the attribute is missing."""
    kind = _DATA_TYPES[default.kind]
    node = default.tree.node("GeometryNodeInputNamedAttribute", name, data_type=kind)
    return switch(node["Exists"], default, node.value)


def minimum(a: Value, b: Operand) -> Value:
    """Add a node for the smaller of two numbers."""
    return a.tree.node("ShaderNodeMath", a, b, operation="MINIMUM").value


def maximum(a: Value, b: Operand) -> Value:
    """Add a node for the larger of two numbers."""
    return a.tree.node("ShaderNodeMath", a, b, operation="MAXIMUM").value


def clip(a: Value, lower_limit: Operand, upper_limit: Operand) -> Value:
    """Add nodes that clamp a number to `lower_limit` to `upper_limit`."""
    return minimum(maximum(a, lower_limit), upper_limit)


def unary(operation: str, a: Value) -> Value:
    """Add a math node of one number by its operation: ``ABSOLUTE``, ``CEIL``, ``FLOOR``, ``SQRT``, ``SINE``, ..."""
    return a.tree.node("ShaderNodeMath", a, operation=operation).value


def power(a: Value, exponent: Operand) -> Value:
    """Add a node for `a` to the power of `exponent`."""
    return a.tree.node("ShaderNodeMath", a, exponent, operation="POWER").value


def round_up(a: Value) -> Value:
    """Add a node that rounds a number up to an integer."""
    return a.tree.node("FunctionNodeFloatToInt", a, rounding_mode="CEILING").value


def dot(a: Value, b: Operand) -> Value:
    """Add a node for the dot product of two vectors."""
    return a.tree.node("ShaderNodeVectorMath", a, b, operation="DOT_PRODUCT").value


def length(a: Value) -> Value:
    """Add a node for the length of a vector."""
    return a.tree.node("ShaderNodeVectorMath", a, operation="LENGTH")["Value"]


def normalize(a: Value) -> Value:
    """Add a node for the vector scaled to length 1."""
    return a.tree.node("ShaderNodeVectorMath", a, operation="NORMALIZE").value


def upright(x_direction: Value) -> Value:
    """Add a node for the rotation whose z points up and whose x points along a vector in plan."""
    return x_direction.tree.node(
        "FunctionNodeAxesToRotation", (0.0, 0.0, 1.0), x_direction, primary_axis="Z", secondary_axis="X"
    ).value


def vector(tree: Tree, x: Operand = 0.0, y: Operand = 0.0, z: Operand = 0.0) -> Value:
    """Add a node for a vector from its components."""
    return tree.node("ShaderNodeCombineXYZ", x, y, z).value


def component(a: Value, axis: str) -> Value:
    """Add a node for the component "X", "Y" or "Z" of a vector."""
    return a.tree.node("ShaderNodeSeparateXYZ", a)[axis]


def switch(condition: Value, if_false: Operand, if_true: Operand) -> Value:
    """Add a switch node: `if_true` where the condition holds, else `if_false`."""
    kinds = [value.kind for value in (if_false, if_true) if isinstance(value, Value)]
    kind = _SOCKET_TYPES.get(kinds[0] if kinds else "VALUE", kinds[0] if kinds else "FLOAT")
    return condition.tree.node("GeometryNodeSwitch", condition, if_false, if_true, input_type=kind).value


def only_if(condition: Value, geometry: Value) -> Value:
    """Add a switch node: the geometry if the single condition holds, else an empty one."""
    return condition.tree.node("GeometryNodeSwitch", input_type="GEOMETRY", switch=condition, true=geometry).value


def choose(index: Value, items: list[tuple[float, float, float]]) -> Value:
    """Add an index switch node for the vector at `index` in the table `items`."""
    node = index.tree.node("GeometryNodeIndexSwitch", data_type="VECTOR")
    for _ in items[2:]:
        node.raw.index_switch_items.new()
    sockets = [socket for socket in node.raw.inputs if socket.enabled and socket.type == "VECTOR"]
    for socket, item in zip(sockets, items, strict=True):
        index.tree.feed(socket, item)
    index.tree.feed(node.raw.inputs[0], index)
    return node.value


def random(tree: Tree, minimum: Operand, maximum: Operand, seed: Operand, identifier: Value | None = None) -> Value:
    """Add a node for a uniform random number (or vector, if `minimum` is one) per element, by seed and identifier."""
    kind = "FLOAT_VECTOR" if isinstance(minimum, tuple) else "FLOAT"
    settings: dict[str, Operand] = {"min": minimum, "max": maximum, "seed": seed}
    if identifier is not None:
        settings["id"] = identifier
    return tree.node("FunctionNodeRandomValue", data_type=kind, **settings).value


def point_count(geometry: Value) -> Value:
    """Add a node for the number of points of a mesh."""
    return geometry.tree.node("GeometryNodeAttributeDomainSize", geometry, component="MESH")["Point Count"]


def face_count(geometry: Value) -> Value:
    """Add a node for the number of faces of a mesh."""
    return geometry.tree.node("GeometryNodeAttributeDomainSize", geometry, component="MESH")["Face Count"]


def sample_index(geometry: Value, value: Value, index: Operand) -> Value:
    """Add a node for `value` evaluated on another geometry's point `index`, clamped to its points."""
    kind = _DATA_TYPES[value.kind]
    return geometry.tree.node("GeometryNodeSampleIndex", geometry, value, index, data_type=kind, clamp=True).value


def sample_surface(mesh: Value, value: Value, place: Value) -> Value:
    """Add a node for `value` interpolated at the point of a mesh's surface nearest to `place`."""
    kind = _DATA_TYPES[value.kind]
    return mesh.tree.node(
        "GeometryNodeSampleNearestSurface", data_type=kind, mesh=mesh, value=value, sample_position=place
    ).value


def object_geometry(item: Value) -> Value:
    """Add a node for an object's evaluated geometry, in the space of the modified object."""
    return item.tree.node("GeometryNodeObjectInfo", item, transform_space="RELATIVE")["Geometry"]


class TargetFrame:
    """Nodes that look at an object's evaluated geometry where it lies, from the space of the modified object.

    The geometry isn't brought into that space: all modifiers that look at it share one copy and its search tree.

    Attributes:
        geometry: the object's geometry in its own space.
    """

    def __init__(self, item: Value) -> None:
        """Add the nodes for an object."""
        tree = item.tree
        self.geometry = tree.node("GeometryNodeObjectInfo", item, transform_space="ORIGINAL")["Geometry"]
        self._outwards = tree.node("GeometryNodeObjectInfo", item, transform_space="RELATIVE")["Transform"]
        self._inwards = tree.node("FunctionNodeInvertMatrix", self._outwards)["Matrix"]

    def point_in(self, place: Value) -> Value:
        """Add a node for a place of the modified object's space in the geometry's space."""
        return place.tree.node("FunctionNodeTransformPoint", place, self._inwards).value

    def direction_in(self, direction: Operand) -> Value:
        """Add a node for a direction of the modified object's space in the geometry's space."""
        return self._inwards.tree.node("FunctionNodeTransformDirection", direction, self._inwards).value

    def point_out(self, place: Value) -> Value:
        """Add a node for a place of the geometry's space in the modified object's space."""
        return place.tree.node("FunctionNodeTransformPoint", place, self._outwards).value


def object_geometry_across(item: Value) -> Value:
    """Add nodes for an object's geometry as `object_geometry`, with x to the right and y along the road.

    The modified object has x along the road; `along` turns what is made back into its frame.
    """
    return across(object_geometry(item))


def across(geometry: Value) -> Value:
    """Add nodes that turn a geometry from x along the road to y along it, exactly: (x, y) becomes (-y, x)."""
    place = position(geometry.tree)
    x, y, z = (component(place, axis) for axis in "XYZ")
    return set_position(geometry, vector(geometry.tree, y * -1.0, x, z))


def along(geometry: Value) -> Value:
    """Add nodes that turn a geometry from y along the road to x along it, exactly: (x, y) becomes (y, -x)."""
    place = position(geometry.tree)
    x, y, z = (component(place, axis) for axis in "XYZ")
    return set_position(geometry, vector(geometry.tree, y, x * -1.0, z))


def grid(tree: Tree, columns: Operand, rows: Operand) -> tuple[Value, Value, Value]:
    """Add nodes for a mesh of columns x rows vertices, and the fields of their column and row numbers.

    Column 0 is the left one for an observer who looks from row 0 along the rows; then its faces look up.
    """
    mesh = tree.node("GeometryNodeMeshGrid", vertices_x=columns, vertices_y=rows).value
    number = index(tree)
    if isinstance(rows, int):
        rows = tree.node("FunctionNodeInputInt", integer=rows).value
    assert isinstance(rows, Value)
    return mesh, number // rows, number % rows


def set_position(geometry: Value, place: Value) -> Value:
    """Add a node that sets all points' positions to `place`; return the geometry."""
    return geometry.tree.node("GeometryNodeSetPosition", geometry, position=place).value


def store(geometry: Value, name: str, value: Operand, domain: str = "POINT") -> Value:
    """Add a node that stores a named attribute of the value's type; return the geometry."""
    kind = _DATA_TYPES[value.kind] if isinstance(value, Value) else ("INT" if isinstance(value, int) else "FLOAT")
    return geometry.tree.node(
        "GeometryNodeStoreNamedAttribute", geometry, data_type=kind, domain=domain, name=name, value=value
    ).value


def capture(geometry: Value, **values: Value) -> tuple[Value, dict[str, Value]]:
    """Add a node that evaluates fields on the points before these move; return the geometry, and the values by name."""
    node = geometry.tree.node("GeometryNodeCaptureAttribute", geometry)
    for name, value in values.items():
        node.raw.capture_items.new(_SOCKET_TYPES[value.kind], name)
        geometry.tree.feed(next(socket for socket in node.raw.inputs if socket.name == name), value)
    return node["Geometry"], {name: node[name] for name in values}


def one_on_each(points: Value, bodies: Value, number_name: str) -> Value:
    """Add nodes that put one of some instances on each point, as its attributes say; return the instances.

    Args:
        points: points with ``size`` (a vector), ``turn`` about the vertical (rad) and the number of their body.
        bodies: the instances to choose from.
        number_name: name of the attribute with the number of the body.
    """
    tree = points.tree
    return tree.node(
        "GeometryNodeInstanceOnPoints",
        points,
        instance=bodies,
        pick_instance=True,
        instance_index=named_attribute(tree, number_name, "INT"),
        rotation=turn(tree, z=named_attribute(tree, "turn")),
        scale=named_attribute(tree, "size", "FLOAT_VECTOR"),
    ).value


def delete_faces(geometry: Value, selection: Value) -> Value:
    """Add a node that deletes the selected faces and the points that only they used; return the geometry."""
    return geometry.tree.node("GeometryNodeDeleteGeometry", geometry, selection, domain="FACE", mode="ALL").value


def delete_points(geometry: Value, selection: Value) -> Value:
    """Add a node that deletes the selected points; return the geometry."""
    return geometry.tree.node("GeometryNodeDeleteGeometry", geometry, selection, domain="POINT", mode="ALL").value


def separate(geometry: Value, selection: Value, domain: str = "POINT") -> Value:
    """Add a node for the selected part of a geometry."""
    return geometry.tree.node("GeometryNodeSeparateGeometry", geometry, selection, domain=domain)["Selection"]


def delete_degenerate(geometry: Value) -> Value:
    """Add nodes that delete faces smaller than 1e-7 m2; return the geometry."""
    area = geometry.tree.node("GeometryNodeInputMeshFaceArea").value
    return delete_faces(geometry, area < SMALLEST_AREA)


def join(*geometries: Value) -> Value:
    """Add a node that joins geometries in the given order; return the geometry."""
    tree = geometries[0].tree
    node = tree.node("GeometryNodeJoinGeometry")
    tree.link_all(node.raw.inputs[0], list(geometries))
    return node.value


def label(geometry: Value, class_id: Operand, instance: Operand, material: Value | None = None) -> Value:
    """Add nodes that store class and instance on all faces and set the material, if given; return the geometry."""
    labelled_mesh = store(geometry, "class_id", class_id, "FACE")
    labelled_mesh = store(labelled_mesh, "instance_id", instance, "FACE")
    if material is None:
        return labelled_mesh
    return geometry.tree.node("GeometryNodeSetMaterial", labelled_mesh, material=material).value


def transform(geometry: Value, **changes: Operand) -> Value:
    """Add a node that transforms a whole geometry by ``scale``, ``rotation`` and ``translation``."""
    return geometry.tree.node("GeometryNodeTransform", geometry, **changes).value


def realize(geometry: Value) -> Value:
    """Add a node that realizes instances, with their attributes; return the geometry."""
    return geometry.tree.node("GeometryNodeRealizeInstances", geometry).value


def turn(tree: Tree, x: Operand = 0.0, y: Operand = 0.0, z: Operand = 0.0) -> Value:
    """Add nodes for the rotation about x, then y, then z (rad)."""
    return tree.node("FunctionNodeEulerToRotation", vector(tree, x, y, z)).value


def random_turn(
    tree: Tree, minimum: tuple[float, float, float], maximum: tuple[float, float, float], seed: Operand
) -> Value:
    """Add nodes for a random rotation per element whose Euler angles (rad) lie between `minimum` and `maximum`."""
    return tree.node("FunctionNodeEulerToRotation", random(tree, minimum, maximum, seed)).value
