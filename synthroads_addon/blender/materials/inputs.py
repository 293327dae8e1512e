"""Inputs that a material's nodes take from the place that is seen: found, and replaced by images of their values.

A node that is in neither table here asks for something that no image of values can stand for: it is named, and its
material is left to other means.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

import bpy

from ...scanning.scene.surface_values import POSITION, SurfaceInput

NORMAL, TRUE_NORMAL, INCOMING = (SurfaceInput(kind) for kind in ("normal", "true_normal", "incoming"))
OF_POINT = (POSITION, TRUE_NORMAL, INCOMING)
"""Inputs that every point has by itself; all others are read from the surfaces."""

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
_NAMED = {
    "ShaderNodeUVMap": ("uv", "uv_map"),
    "ShaderNodeVertexColor": ("color", "layer_name"),
}
"""Nodes of one map or attribute: kind, and the property that names it."""

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
"""Textures, and the coordinates that they take where none are given."""

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
        what: the input.
        tree: the node tree.
        output: socket that gives it; None where a texture takes it by itself.
        into: that texture's socket.
    """

    what: SurfaceInput
    tree: bpy.types.NodeTree
    output: bpy.types.NodeSocket | None = None
    into: bpy.types.NodeSocket | None = None


@dataclass
class InputSearch:
    """Search for what sockets of a material depend on.

    Attributes:
        sites: where inputs are read.
        obstacles: names of nodes that no values can stand for.
    """

    sites: list[InputSite] = field(default_factory=list)
    obstacles: list[str] = field(default_factory=list)
    _seen: set[tuple[object, ...]] = field(default_factory=set)
    _sources: dict[int, dict[int, list[bpy.types.NodeSocket]]] = field(default_factory=dict)

    def visit(self, socket: bpy.types.NodeSocket, path: tuple[bpy.types.Node, ...] = ()) -> None:
        """Look at an output socket, and at all that it depends on.

        Args:
            socket: the output.
            path: the group nodes around it, outermost first.
        """
        node = socket.node
        key = (*(outer.as_pointer() for outer in path), node.as_pointer(), socket.identifier)
        if key in self._seen:
            return
        self._seen.add(key)
        kind, tree = node.bl_idname, socket.id_data
        if kind == "ShaderNodeGroup":
            self._enter(node, socket, path)
        elif kind == "NodeGroupInput":
            self._leave(socket, path)
        elif (what := input_of(node, socket)) is not None:
            self.sites.append(InputSite(what, tree, output=socket))
        elif kind in _PURE and not _turns_with_surface(node):
            for entry in node.inputs:
                self._follow(entry, path)
            default = _DEFAULTS.get(kind)
            vector = node.inputs.get("Vector")
            if default is not None and vector is not None and vector.enabled and not vector.is_linked:
                self.sites.append(InputSite(default, tree, into=vector))
        else:
            self._refuse(node, socket)

    def _follow(self, entry: bpy.types.NodeSocket, path: tuple[bpy.types.Node, ...]) -> None:
        tree = entry.id_data
        # A socket looks for its links among all those of its tree each time, which made this the dearest of a scene.
        if (sources := self._sources.get(tree.as_pointer())) is None:
            sources = self._sources[tree.as_pointer()] = {}
            for link in tree.links:
                sources.setdefault(link.to_socket.as_pointer(), []).append(link.from_socket)
        for source in sources.get(entry.as_pointer(), ()):
            self.visit(source, path)

    def _enter(self, node: bpy.types.Node, socket: bpy.types.NodeSocket, path: tuple[bpy.types.Node, ...]) -> None:
        if node.node_tree is None:
            return
        if (output := group_output(node.node_tree)) is not None:
            for entry in output.inputs:
                if entry.identifier == socket.identifier:
                    self._follow(entry, (*path, node))

    def _leave(self, socket: bpy.types.NodeSocket, path: tuple[bpy.types.Node, ...]) -> None:
        if not path:
            return
        for entry in path[-1].inputs:
            if entry.identifier == socket.identifier:
                self._follow(entry, path[:-1])

    def _refuse(self, node: bpy.types.Node, socket: bpy.types.NodeSocket) -> None:
        label = f"{node.bl_rna.name}: {socket.name}" if len(node.outputs) > 1 else node.bl_rna.name
        if label not in self.obstacles:
            self.obstacles.append(label)


def input_of(node: bpy.types.Node, socket: bpy.types.NodeSocket) -> SurfaceInput | None:
    """Return the input that an output gives; None if it gives none, or one that no values can stand for."""
    kind = node.bl_idname
    if getattr(node, "from_instancer", False) or (kind == "ShaderNodeTexCoord" and node.object is not None):
        return None
    if kind in _NAMED:
        feed, name = _NAMED[kind]
        return SurfaceInput(feed, getattr(node, name))
    if kind == "ShaderNodeAttribute" and node.attribute_type in ("GEOMETRY", "OBJECT"):
        feed = "attribute" if node.attribute_type == "GEOMETRY" else "object_attribute"
        return SurfaceInput(feed + ("_fac" if socket.name in ("Fac", "Factor") else ""), node.attribute_name)
    return _OUTPUTS.get((kind, socket.name))


def copy_groups(tree: bpy.types.NodeTree) -> list[bpy.types.NodeTree]:
    """Give every group node below a tree a group of its own; return these."""
    copies: list[bpy.types.NodeTree] = []
    for node in tree.nodes:
        if node.bl_idname == "ShaderNodeGroup" and node.node_tree is not None:
            node.node_tree = node.node_tree.copy()
            copies += [node.node_tree, *copy_groups(node.node_tree)]
    return copies


def group_output(tree: bpy.types.NodeTree) -> bpy.types.Node | None:
    """Return the node that gives a group's results; None if it has none."""
    ends = [node for node in tree.nodes if node.bl_idname == "NodeGroupOutput"]
    return next((node for node in ends if node.is_active_output), ends[0] if ends else None)


def _turns_with_surface(node: bpy.types.Node) -> bool:
    """Return whether a texture looks at the surface's own slope beside its coordinates."""
    return node.bl_idname == "ShaderNodeTexImage" and node.projection == "BOX"


def replace_inputs(sites: Iterable[InputSite]) -> Iterator[tuple[SurfaceInput, bpy.types.Node]]:
    """Have sites read images instead; yield each input with the node that is to get its image."""
    for site in list(sites):
        image = site.tree.nodes.new("ShaderNodeTexImage")
        image.interpolation, image.extension = "Closest", "EXTEND"
        if site.into is not None:
            site.tree.links.new(image.outputs["Color"], site.into)
        else:
            assert site.output is not None
            result = image.outputs["Alpha" if site.output.name == "Alpha" else "Color"]
            for target in [link.to_socket for link in site.output.links]:
                site.tree.links.new(result, target)
        yield site.what, image
