"""A small builder of Geometry Nodes: a node group is a class of inputs and a function that reads top to bottom.

    class Lane(Inputs):
        width = metres(3.5, (2.0, 6.0), "Width of the lane")

    @makes_group("SR Lane")
    def lane_group(tree: Tree) -> None:
        lane = Lane(tree)
        with tree.frame("Pavement"):
            grid = tree.node("GeometryNodeMeshGrid", size_x=lane.width, size_y=2.0 * lane.width + 1.0)
        tree.output("Mesh", grid.value)

    group = lane_group()

Sockets are `Value`s: they can be added, multiplied, compared and linked to other nodes. Positions of nodes in the
editor follow from the frames and the links. A group that the open file has already, in the same version, is reused.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import cache, partial, wraps
from pathlib import Path
from typing import Any

import bpy

from ...base.files import PRESETS
from ...base.turns.stepper import yield_if_due
from .changes import Change, make_changes
from .kept_groups import KEY, note_made, take_kept_group
from .layout import arrange

MATERIALS = "synthroads_materials"
"""Custom property of a group: default entries of the material table for its material inputs, by the inputs' names."""
_TAGS = {"GEOMETRY": "GEOMETRY", "VECTOR": "VECTOR"}
"""Colours of groups by the kind of their first output, as Blender gives them to its own nodes; else ``CONVERTER``."""


def _operator_method(operation: str, reflected: bool = False) -> Callable[[Value, Operand], Value]:
    """Return the method of `Value` for an arithmetic operator, or for its reflected form (``__radd__`` ...)."""

    def calculate(value: Value, operand: Operand) -> Value:
        return value._math(operation, operand, value) if reflected else value._math(operation, value, operand)

    return calculate


def _comparison(operation: str) -> Callable[[Value, Operand], Value]:
    """Return the method of `Value` for a comparison operator."""

    def compare(value: Value, operand: Operand) -> Value:
        return value._compare(operation, operand)

    return compare


class Value:
    """An output socket in a node tree; arithmetic and comparisons with it add nodes, for vectors component-wise."""

    def __init__(self, tree: Tree, socket: bpy.types.NodeSocket | None, kind: str) -> None:
        self.tree = tree
        self.socket = socket
        self.kind = kind  # VALUE, INT, BOOLEAN, VECTOR, ROTATION, MATRIX, GEOMETRY, OBJECT, MATERIAL, STRING

    def source(self) -> bpy.types.NodeSocket:
        """Return the output socket to link from."""
        assert self.socket is not None
        return self.socket

    def _math(self, operation: str, *operands: Operand) -> Value:
        """Add a math node for vectors, integers or floats, as the operands' kinds require; return its output."""
        kinds = {_kind(operand) for operand in operands}
        if "VECTOR" in kinds:
            if operation == "MULTIPLY" and "VECTOR" not in {_kind(operands[1])}:
                return self.tree.node("ShaderNodeVectorMath", operands[0], scale=operands[1], operation="SCALE").value
            return self.tree.node("ShaderNodeVectorMath", *operands, operation=operation).value
        if kinds == {"INT"} and operation != "DIVIDE":
            return self.tree.node("FunctionNodeIntegerMath", *operands, operation=operation).value
        return self.tree.node("ShaderNodeMath", *operands, operation=operation).value

    def _compare(self, operation: str, operand: Operand) -> Value:
        """Add a comparison node, of integers or floats; return its output."""
        kind = "INT" if {_kind(self), _kind(operand)} == {"INT"} else "FLOAT"
        return self.tree.node("FunctionNodeCompare", self, operand, operation=operation, data_type=kind).value

    __add__ = _operator_method("ADD")
    __radd__ = _operator_method("ADD", reflected=True)
    __sub__ = _operator_method("SUBTRACT")
    __rsub__ = _operator_method("SUBTRACT", reflected=True)
    __truediv__ = _operator_method("DIVIDE")
    __rtruediv__ = _operator_method("DIVIDE", reflected=True)
    __floordiv__ = _operator_method("DIVIDE_FLOOR")
    __mod__ = _operator_method("FLOORED_MODULO")
    __lt__ = _comparison("LESS_THAN")
    __le__ = _comparison("LESS_EQUAL")
    __gt__ = _comparison("GREATER_THAN")
    __ge__ = _comparison("GREATER_EQUAL")

    def __mul__(self, operand: Operand) -> Value:
        if _kind(operand) == "VECTOR" and self.kind != "VECTOR":
            return self._math("MULTIPLY", operand, self)
        return self._math("MULTIPLY", self, operand)

    def __rmul__(self, operand: Operand) -> Value:
        return self * operand

    def __neg__(self) -> Value:
        return self._math("MULTIPLY", self, -1 if self.kind == "INT" else -1.0)

    def __and__(self, operand: Operand) -> Value:
        return self.tree.node("FunctionNodeBooleanMath", self, operand, operation="AND").value

    def __or__(self, operand: Operand) -> Value:
        return self.tree.node("FunctionNodeBooleanMath", self, operand, operation="OR").value

    def __invert__(self) -> Value:
        return self.tree.node("FunctionNodeBooleanMath", self, operation="NOT").value

    def equals(self, operand: Operand) -> Value:
        """Add a node that compares for equality (exact: for whole numbers); return its output."""
        return self._compare("EQUAL", operand)


Operand = Value | float | int | bool | str | tuple[float, ...]


class GroupInput(Value):
    """An input of the group. Each frame gets a Group Input node of its own, so that links stay short."""

    def __init__(self, tree: Tree, name: str, kind: str) -> None:
        super().__init__(tree, None, kind)
        self.name = name

    def source(self) -> bpy.types.NodeSocket:
        """Return the input's socket on the current frame's Group Input node, added if there is none."""
        return self.tree.group_input_node().outputs[self.name]


class Node:
    """A node that has been added; its outputs by name, and the first of them as `value`."""

    def __init__(self, tree: Tree, raw: bpy.types.Node) -> None:
        self.tree = tree
        self.raw = raw

    def __getitem__(self, name: str) -> Value:
        socket = next(s for s in self.raw.outputs if s.enabled and s.name == name)
        return Value(self.tree, socket, socket.type)

    @property
    def value(self) -> Value:
        """Return the node's first enabled output as a value."""
        socket = next(s for s in self.raw.outputs if s.enabled)
        return Value(self.tree, socket, socket.type)


class Tree:
    """A node group under construction; links and values of inputs are collected, and made by `finish`.

    Attributes:
        group: Blender's node group.
        materials: default materials of material inputs, by the inputs' names.
        makes: kind of the group's first output.
    """

    def __init__(self, group: bpy.types.NodeTree) -> None:
        self.group = group
        self.materials: dict[str, str] = {}
        self.makes = ""
        self._frame: bpy.types.Node | None = None
        self._panel: Any = None
        self._inputs: dict[str, bpy.types.Node] = {}
        self._output: bpy.types.Node | None = None
        self._changes: list[Change] = []

    def finish(self) -> None:
        """Make all collected links, and set the collected values of inputs."""
        changes, self._changes = self._changes, []
        make_changes(changes)

    # Interface

    def number(
        self, name: str, default: float, limits: tuple[float, float], *, unit: str = "", description: str
    ) -> Value:
        """Declare a float input of the group, shown as its unit asks ("m", "rad", "share"); return its value."""
        socket = self._socket(name, "NodeSocketFloat", description + (f" ({unit})" if unit else ""))
        socket.subtype = {"m": "DISTANCE", "rad": "ANGLE", "share": "FACTOR"}.get(unit, "NONE")
        socket.default_value, (socket.min_value, socket.max_value) = default, limits
        return GroupInput(self, name, "VALUE")

    def integer(self, name: str, default: int, limits: tuple[int, int], *, description: str) -> Value:
        """Declare an integer input of the group; return its value."""
        socket = self._socket(name, "NodeSocketInt", description)
        socket.default_value, (socket.min_value, socket.max_value) = default, limits
        return GroupInput(self, name, "INT")

    def boolean(self, name: str, default: bool, *, description: str) -> Value:
        """Declare a boolean input of the group; return its value."""
        self._socket(name, "NodeSocketBool", description).default_value = default
        return GroupInput(self, name, "BOOLEAN")

    def input(self, name: str, kind: str, *, description: str) -> Value:
        """Declare an input of a socket kind (``Geometry``, ``Object``, ``Vector``, ...); return its value."""
        self._socket(name, f"NodeSocket{kind}", description)
        return GroupInput(self, name, kind.upper())

    def material(self, name: str, default: str = "", *, description: str) -> Value:
        """Declare a material input of the group; `default` is an entry of the material table; return its value."""
        if default:
            self.materials[name] = default
        return self.input(name, "Material", description=description)

    def output(self, name: str, value: Value, *, description: str = "") -> None:
        """Declare an output of the group and link a value to it."""
        kind = {"VALUE": "Float", "INT": "Int", "BOOLEAN": "Bool"}.get(value.kind, value.kind.title())
        socket = self.group.interface.new_socket(name, in_out="OUTPUT", socket_type=f"NodeSocket{kind}")
        socket.description = description
        self.makes = self.makes or value.kind
        if self._output is None:
            self._output = self.group.nodes.new("NodeGroupOutput")
        self.feed(self._output.inputs[name], value)

    @contextmanager
    def panel(self, name: str) -> Iterator[None]:
        """Context in which declared inputs are put into a panel of the modifier; panels nest."""
        interface, outer_panel = self.group.interface, self._panel
        self._panel = interface.new_panel(name, default_closed=True)
        if outer_panel is not None:
            interface.move_to_parent(self._panel, outer_panel, len(outer_panel.interface_items))
        yield
        self._panel = outer_panel

    def _socket(self, name: str, kind: str, description: str) -> Any:
        """Declare an input of the group with a socket type in the current panel; return it."""
        socket = self.group.interface.new_socket(name, in_out="INPUT", socket_type=kind, parent=self._panel)
        socket.description = description
        return socket

    def group_input_node(self) -> bpy.types.Node:
        """Return the current frame's Group Input node, added if there is none."""
        key = self._frame.name if self._frame else ""
        if key not in self._inputs:
            self._inputs[key] = self._new("NodeGroupInput")
        return self._inputs[key]

    # Nodes

    @contextmanager
    def frame(self, label: str) -> Iterator[None]:
        """Context in which added nodes are put into a labelled frame (63 bytes at most)."""
        outer_frame, self._frame = self._frame, self.group.nodes.new("NodeFrame")
        self._frame.label = label
        # Blender cuts labels after 63 bytes silently.
        assert self._frame.label == label, label
        yield
        self._frame = outer_frame

    def node(self, kind: str, *operands: Operand, **settings: Any) -> Node:
        """Add a node to the tree with its properties and inputs set or linked; return it.

        Args:
            kind: Blender's name of the node's class.
            operands: values of its inputs in order.
            settings: properties of the node (``operation="ADD"``), and inputs by name in snake case
                (``ray_length=5.0``).
        """
        raw = self._new(kind)
        inputs = {}
        for name, value in settings.items():
            if name in raw.bl_rna.properties and name not in bpy.types.Node.bl_rna.properties:
                setattr(raw, name, value)
            else:
                inputs[name.rstrip("_")] = value
        sockets = [socket for socket in raw.inputs if socket.enabled]
        for socket, operand in zip(sockets, operands, strict=False):
            self.feed(socket, operand)
        sockets_by_name = {socket.name.lower().replace(" ", "_"): socket for socket in sockets}
        for name, operand in inputs.items():
            self.feed(sockets_by_name[name], operand)
        return Node(self, raw)

    def call(self, group: bpy.types.NodeTree, **inputs: Operand) -> Node:
        """Add a node of another group, its inputs (names in snake case) set or linked; return it."""
        raw = self._new("GeometryNodeGroup")
        raw.node_tree = group
        sockets_by_name = {socket.name.lower().replace(" ", "_"): socket for socket in raw.inputs}
        for name, operand in inputs.items():
            self.feed(sockets_by_name[name.rstrip("_")], operand)
        return Node(self, raw)

    def link_all(self, socket: bpy.types.NodeSocket, values: list[Value]) -> None:
        """Link several values to a socket that takes more than one, in order."""
        # Blender puts the newest link of such a socket on top, that is first.
        for value in reversed(values):
            self.feed(socket, value)

    def feed(self, socket: bpy.types.NodeSocket, operand: Operand) -> None:
        """Link a value to an input, or set the input's value; both are done by `finish`."""
        if isinstance(operand, Value):
            self._changes.append(partial(self.group.links.new, operand.source(), socket))
            return
        if socket.type == "VECTOR" and isinstance(operand, int | float):
            operand = (operand, operand, operand)
        elif socket.type == "MENU" and isinstance(operand, str):  # a property of the node in older releases
            operand = operand.replace("_", " ").title()
        self._changes.append(partial(setattr, socket, "default_value", operand))

    def _new(self, kind: str) -> bpy.types.Node:
        """Add a node to the current frame; it lets other work run in between."""
        yield_if_due()  # a large group takes half a second: each node updates the whole tree
        raw = self.group.nodes.new(kind)
        raw.parent = self._frame
        return raw


def _kind(operand: Operand) -> str:
    """Return the kind of an operand's socket: a value's own, else that of a Python number or tuple."""
    if isinstance(operand, Value):
        return operand.kind
    if isinstance(operand, tuple):
        return "VECTOR"
    return "INT" if isinstance(operand, int) else "VALUE"


_SOURCES = (
    *("nodes/*.py", "things/**/*.py"),
    # The first has the name of the colour's attribute, the second groups of its own, built from the road's field.
    *("materials/looks.py", "materials/pavement.py", "../road/pavement/*.py"),
)
"""Patterns of the source files that node groups follow from, beside the table of vehicles and the typeface."""
TYPEFACE = PRESETS / "fonts" / "road.ttf"
"""Typeface of the signs."""


@cache
def _sources_digest() -> bytes:
    """Return a SHA-256 digest of the source files of all node groups: a change to any makes new groups; cached."""
    return files_digest(*source_files(_SOURCES), PRESETS / "vehicles.json", TYPEFACE)


def source_files(patterns: Iterable[str]) -> list[Path]:
    """Return the source files that patterns match, relative to the folder ``blender``; sorted."""
    blender = Path(__file__).parents[1]
    return sorted(path for pattern in patterns for path in blender.glob(pattern))


def files_digest(*files: Path) -> bytes:
    """Return a SHA-256 digest of files' contents; it differs once a file has changed."""
    digest = hashlib.sha256()
    for path in files:
        digest.update(path.read_bytes())
    return digest.digest()


def remove_unused_groups() -> None:
    """Remove the project's unused node groups from the file, and groups that only they used."""
    while unused := [group for group in bpy.data.node_groups if KEY in group and not group.users]:
        for group in unused:
            bpy.data.node_groups.remove(group)


def node_group(
    name: str,
    build: Callable[..., None],
    *arguments: object,
    description: str = "",
    kind: str = "GeometryNodeTree",
) -> bpy.types.NodeTree:
    """Return the node group of a name and arguments: from the open file, else from the file of kept groups, else built.

    Args:
        name: the group's name in Blender; a group of an older version with this name is renamed.
        build: function that declares inputs, adds nodes and declares outputs; called with the tree and the arguments.
        arguments: values that `build` depends on apart from its source (a number of lanes, say).
        description: the group's tooltip; the first line of the docstring of `build` if empty.
        kind: Blender's name of the tree's class.
    """
    key = hashlib.sha256(_sources_digest() + repr((name, arguments)).encode()).hexdigest()[:16]
    for group in bpy.data.node_groups:
        if group.get(KEY) == key:
            return group
    if (older_group := bpy.data.node_groups.get(name)) and KEY in older_group:
        older_group.name = f"{name} (older)"
    if (kept_group := take_kept_group(key)) is not None:
        return kept_group
    note_made()
    group = bpy.data.node_groups.new(name, kind)
    group[KEY] = key
    group.description = description or (build.__doc__ or "").strip().partition("\n")[0]
    tree = Tree(group)
    build(tree, *arguments)
    if tree.materials:
        group[MATERIALS] = tree.materials
    if kind == "GeometryNodeTree":
        group.is_modifier = tree.makes == "GEOMETRY"
    group.color_tag = _TAGS.get(tree.makes, "CONVERTER")
    tree.finish()
    arrange(group)
    return group


Make = Callable[[], bpy.types.NodeTree]
CATALOGUES: dict[str, dict[str, Make]] = {}
"""Functions that make the groups for use by hand: by catalogue of the asset library, then by name."""


def usual_materials(group: bpy.types.NodeTree) -> dict[str, str]:
    """Return the default material-table entries of a group's material inputs, by the inputs' names."""
    return dict(group.get(MATERIALS, {}))


def offer_group(catalogue: str, name: str, make: Make) -> None:
    """Register a function that makes a node group, so that users find it in the asset library's catalogue."""
    CATALOGUES.setdefault(catalogue, {})[name] = make


def makes_group(name: str, catalogue: str = "") -> Callable[[Callable[[Tree], None]], Make]:
    """Return a decorator that turns a building function into one that returns the node group `name`, reused or built.

    Args:
        name: name of the group.
        catalogue: the asset library's catalogue in which users find it; empty for a group that only other groups use.
    """

    def decorate(build: Callable[[Tree], None]) -> Make:
        @wraps(build)
        def make() -> bpy.types.NodeTree:
            return node_group(name, build)

        if catalogue:
            offer_group(catalogue, name, make)
        return make

    return decorate
