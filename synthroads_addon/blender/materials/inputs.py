"""Inputs that a material's nodes read at the place that is seen: search for them, and their replacement by images.

A node that is in none of the tables here reads something that an image of values can't replace. It is an obstacle:
its material can't be evaluated from values.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

import bpy

from ...scanning.scene.surface_values import POSITION, SurfaceInput

NORMAL, TRUE_NORMAL, INCOMING = (SurfaceInput(kind) for kind in ("normal", "true_normal", "incoming"))
POINT_INPUTS = (POSITION, TRUE_NORMAL, INCOMING)
"""Inputs that are known from each point alone; all others are read from the surfaces."""

_OUTPUTS: dict[tuple[str, str], SurfaceInput] = {
    ("ShaderNodeNewGeometry", "Position"): POSITION,
    ("ShaderNodeNewGeometry", "Normal"): NORMAL,
    ("ShaderNodeNewGeometry", "True Normal"): TRUE_NORMAL,
    ("ShaderNodeNewGeometry", "Incoming"): INCOMING,
    ("ShaderNodeTexCoord", "Normal"): SurfaceInput("object_normal"),
    ("ShaderNodeTexCoord", "Generated"): SurfaceInput("generated"),
    ("ShaderNodeTexCoord", "UV"): SurfaceInput("uv"),
    ("ShaderNodeTexCoord", "Object"): SurfaceInput("object"),
    ("ShaderNodeObjectInfo", "Location"): SurfaceInput("location"),
    ("ShaderNodeObjectInfo", "Color"): SurfaceInput("object_color"),
    ("ShaderNodeObjectInfo", "Alpha"): SurfaceInput("object_color"),
    ("ShaderNodeObjectInfo", "Object Index"): SurfaceInput("object_index"),
    ("ShaderNodeObjectInfo", "Random"): SurfaceInput("random"),
}
"""Inputs by the node's type and its output's name."""
_NAMED = {
    "ShaderNodeUVMap": ("uv", "uv_map"),
    "ShaderNodeVertexColor": ("color", "layer_name"),
}
"""Nodes that read one UV map or attribute: kind of the input, and the node's property that names the map."""

_DEFAULTS = {
    "ShaderNodeTexImage": SurfaceInput("uv"),
    **dict.fromkeys(
        (
            f"ShaderNodeTex{name}"
            for name in ("Noise", "Voronoi", "Wave", "Magic", "Checker", "Brick", "Gradient", "Musgrave", "Gabor")
        ),
        SurfaceInput("generated"),
    ),
}
"""Coordinates that a texture uses if its vector isn't linked, by the texture node's type."""

_PURE = frozenset(
    [
        *_DEFAULTS,
        *(f"ShaderNode{name}" for name in ("Math", "VectorMath", "Mix", "MixRGB", "ValToRGB", "RGBCurve")),
        *(f"ShaderNode{name}" for name in ("VectorCurve", "FloatCurve", "Mapping", "RGB", "Value", "SeparateXYZ")),
        *(f"ShaderNode{name}" for name in ("CombineXYZ", "SeparateColor", "CombineColor", "SeparateRGB", "CombineRGB")),
        *(f"ShaderNode{name}" for name in ("SeparateHSV", "CombineHSV", "MapRange", "Clamp", "HueSaturation")),
        *(f"ShaderNode{name}" for name in ("Gamma", "BrightContrast", "Invert", "RGBToBW", "Blackbody", "Wavelength")),
        *(f"ShaderNode{name}" for name in ("TexWhiteNoise", "Normal", "VectorRotate")),
        "NodeReroute",
    ]
)
"""Nodes whose result follows from their inputs alone."""


@dataclass(frozen=True)
class InputSite:
    """A place in a node tree at which an input is read.

    Attributes:
        surface_input: the input.
        tree: the node tree.
        output: output socket that gives the input; None if a texture reads it because its vector isn't linked.
        vector: that texture's vector socket; None if an output gives the input.
    """

    surface_input: SurfaceInput
    tree: bpy.types.NodeTree
    output: bpy.types.NodeSocket | None = None
    vector: bpy.types.NodeSocket | None = None


@dataclass
class InputSearch:
    """Search for the inputs that sockets of a material depend on.

    Attributes:
        sites: places at which inputs are read.
        obstacles: names of nodes that values can't replace.
    """

    sites: list[InputSite] = field(default_factory=list)
    obstacles: list[str] = field(default_factory=list)
    _visited: set[tuple[object, ...]] = field(default_factory=set)
    _sources: dict[int, dict[int, list[bpy.types.NodeSocket]]] = field(default_factory=dict)

    def visit(self, socket: bpy.types.NodeSocket, path: tuple[bpy.types.Node, ...] = ()) -> None:
        """Add the sites and obstacles that an output socket depends on.

        Args:
            socket: the output.
            path: the group nodes around it, outermost first.
        """
        node = socket.node
        key = (*(outer.as_pointer() for outer in path), node.as_pointer(), socket.identifier)
        if key in self._visited:
            return
        self._visited.add(key)
        kind, tree = node.bl_idname, socket.id_data
        if kind == "ShaderNodeGroup":
            self._enter_group(node, socket, path)
        elif kind == "NodeGroupInput":
            self._leave_group(socket, path)
        elif (surface_input := input_of(node, socket)) is not None:
            self.sites.append(InputSite(surface_input, tree, output=socket))
        elif kind in _PURE and not _reads_normal(node):
            for input_socket in node.inputs:
                self._visit_links(input_socket, path)
            default_input = _DEFAULTS.get(kind)
            vector = node.inputs.get("Vector")
            if default_input is not None and vector is not None and vector.enabled and not vector.is_linked:
                self.sites.append(InputSite(default_input, tree, vector=vector))
        else:
            self._add_obstacle(node, socket)

    def _visit_links(self, input_socket: bpy.types.NodeSocket, path: tuple[bpy.types.Node, ...]) -> None:
        """Visit the outputs that are linked to an input socket."""
        tree = input_socket.id_data
        # `NodeSocket.links` searches all links of the tree at each access, which is slow: they are stored here.
        if (sources := self._sources.get(tree.as_pointer())) is None:
            sources = self._sources[tree.as_pointer()] = {}
            for link in tree.links:
                sources.setdefault(link.to_socket.as_pointer(), []).append(link.from_socket)
        for source in sources.get(input_socket.as_pointer(), ()):
            self.visit(source, path)

    def _enter_group(
        self, node: bpy.types.Node, socket: bpy.types.NodeSocket, path: tuple[bpy.types.Node, ...]
    ) -> None:
        """Visit the links inside a group that give the group node's output `socket`."""
        if node.node_tree is None:
            return
        if (output := group_output(node.node_tree)) is not None:
            for input_socket in output.inputs:
                if input_socket.identifier == socket.identifier:
                    self._visit_links(input_socket, (*path, node))

    def _leave_group(self, socket: bpy.types.NodeSocket, path: tuple[bpy.types.Node, ...]) -> None:
        """Visit the links outside a group that give `socket`, an output of the group's input node."""
        if not path:
            return
        for input_socket in path[-1].inputs:
            if input_socket.identifier == socket.identifier:
                self._visit_links(input_socket, path[:-1])

    def _add_obstacle(self, node: bpy.types.Node, socket: bpy.types.NodeSocket) -> None:
        """Add a node, with its output's name if it has several, to the obstacles."""
        label = f"{node.bl_rna.name}: {socket.name}" if len(node.outputs) > 1 else node.bl_rna.name
        if label not in self.obstacles:
            self.obstacles.append(label)


def input_of(node: bpy.types.Node, socket: bpy.types.NodeSocket) -> SurfaceInput | None:
    """Return the input that an output socket gives; None if it gives none, or one that values can't replace."""
    kind = node.bl_idname
    if getattr(node, "from_instancer", False) or (kind == "ShaderNodeTexCoord" and node.object is not None):
        return None
    if kind in _NAMED:
        input_kind, property_name = _NAMED[kind]
        return SurfaceInput(input_kind, getattr(node, property_name))
    if kind == "ShaderNodeAttribute" and node.attribute_type in ("GEOMETRY", "OBJECT"):
        input_kind = "attribute" if node.attribute_type == "GEOMETRY" else "object_attribute"
        return SurfaceInput(input_kind + ("_fac" if socket.name in ("Fac", "Factor") else ""), node.attribute_name)
    return _OUTPUTS.get((kind, socket.name))


def copy_groups(tree: bpy.types.NodeTree) -> list[bpy.types.NodeTree]:
    """Give every group node below a tree its own copy of its group; return the copies."""
    copies: list[bpy.types.NodeTree] = []
    for node in tree.nodes:
        if node.bl_idname == "ShaderNodeGroup" and node.node_tree is not None:
            node.node_tree = node.node_tree.copy()
            copies += [node.node_tree, *copy_groups(node.node_tree)]
    return copies


def group_output(tree: bpy.types.NodeTree) -> bpy.types.Node | None:
    """Return a group's active output node; None if it has none."""
    output_nodes = [node for node in tree.nodes if node.bl_idname == "NodeGroupOutput"]
    return next((node for node in output_nodes if node.is_active_output), output_nodes[0] if output_nodes else None)


def identified_socket(sockets: Iterable[bpy.types.NodeSocket], identifier: str) -> bpy.types.NodeSocket | None:
    """Return the socket with an identifier; None if there is none."""
    return next((socket for socket in sockets if socket.identifier == identifier), None)


def _reads_normal(node: bpy.types.Node) -> bool:
    """Return whether a texture uses the surface's normal beside its coordinates: an image with box projection."""
    return node.bl_idname == "ShaderNodeTexImage" and node.projection == "BOX"


def replace_inputs(sites: Iterable[InputSite]) -> Iterator[tuple[SurfaceInput, bpy.types.Node]]:
    """Make sites read images instead; yield each site's input with the image texture node that must get its image."""
    for site in list(sites):
        image = site.tree.nodes.new("ShaderNodeTexImage")
        image.interpolation, image.extension = "Closest", "EXTEND"
        if site.vector is not None:
            site.tree.links.new(image.outputs["Color"], site.vector)
        else:
            assert site.output is not None
            color = image.outputs["Alpha" if site.output.name == "Alpha" else "Color"]
            for target in [link.to_socket for link in site.output.links]:
                site.tree.links.new(color, target)
        yield site.surface_input, image
