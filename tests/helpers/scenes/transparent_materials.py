"""Materials that let light through in every way that people use, and what of a beam each of them must keep."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from synthroads_addon.materials.table import materials

Float = NDArray[np.float64]
GLASS = materials()["glass"].transmission
SIZE = 64
"""Pixels of a side of the images."""


def picture(alpha: Float, name: str = "Picture") -> bpy.types.Image:
    """Return a packed green image with this alpha (h, w), the lowest row first."""
    height, width = alpha.shape
    pixels = np.empty((height, width, 4), np.float32)
    pixels[..., :3], pixels[..., 3] = (0.1, 0.5, 0.1), alpha
    image = bpy.data.images.new(name, width, height, alpha=True)
    image.pixels.foreach_set(pixels.ravel())
    image.pack()
    return image


def half() -> Float:
    """Return an alpha that is 1 on the left half and 0 on the right one."""
    alpha = np.zeros((SIZE, SIZE))
    alpha[:, : SIZE // 2] = 1.0
    return alpha


def rising() -> Float:
    """Return an alpha that rises from left to right."""
    return np.tile((np.arange(SIZE) + 0.5) / SIZE, (SIZE, 1))


class Nodes:
    """Nodes of a new material, by few words."""

    def __init__(self, name: str = "Clear") -> None:
        self.item = bpy.data.materials.new(name)
        if self.item.node_tree is None:
            self.item.use_nodes = True
        self.tree = self.item.node_tree
        self.shader = next(node for node in self.tree.nodes if node.type == "BSDF_PRINCIPLED")
        self.end = next(node for node in self.tree.nodes if node.type == "OUTPUT_MATERIAL")

    def node(self, kind: str, *links: Any, **values: Any) -> Any:
        """Return a new node with its first inputs linked or set, and properties."""
        made = self.tree.nodes.new(kind)
        for name, value in values.items():
            setattr(made, name, value)
        for number, value in enumerate(links):
            self.feed(made.inputs[number], value)
        return made

    def feed(self, entry: Any, value: Any) -> None:
        """Link an output to an input, or set the input."""
        if isinstance(value, bpy.types.NodeSocket):
            self.tree.links.new(value, entry)
        elif value is not None:
            entry.default_value = value

    def image(self, alpha: Float, **values: Any) -> Any:
        """Return an image texture of an alpha."""
        return self.node("ShaderNodeTexImage", image=picture(alpha), **({"interpolation": "Closest"} | values))

    def alpha(self, value: Any) -> None:
        """Set or link the shader's alpha."""
        self.feed(self.shader.inputs["Alpha"], value)

    def surface(self, value: Any) -> None:
        """Link a shader to the output."""
        self.feed(self.end.inputs["Surface"], value)


@dataclass(frozen=True)
class Case:
    """A material, and what it must let through.

    Attributes:
        build: gives it its nodes.
        through: share of the light (N,) that goes on, by texture coordinates u and v (N,).
        edge: texture coordinates so near to a change aren't looked at.
        warning: what must be said of it; nothing if empty.
    """

    build: Callable[[Nodes], None]
    through: Callable[[Float, Float], Float | float]
    edge: float = 0.01
    warning: str = ""


def _linked_alpha(nodes: Nodes) -> None:
    nodes.alpha(nodes.image(half()).outputs["Alpha"])


def _clipped(operation: str, threshold: float) -> Callable[[Nodes], None]:
    def build(nodes: Nodes) -> None:
        alpha = nodes.image(rising(), interpolation="Linear", extension="EXTEND").outputs["Alpha"]
        nodes.alpha(nodes.node("ShaderNodeMath", alpha, threshold, operation=operation).outputs[0])

    return build


def _gltf_mask(nodes: Nodes) -> None:
    """1 - (alpha < cutoff), as the importer of glTF has it."""
    alpha = nodes.image(rising(), interpolation="Linear", extension="EXTEND").outputs["Alpha"]
    below = nodes.node("ShaderNodeMath", alpha, 0.3, operation="LESS_THAN")
    nodes.alpha(nodes.node("ShaderNodeMath", 1.0, below.outputs[0], operation="SUBTRACT").outputs[0])


def _mixed(factor: Callable[[Nodes], Any], transparent_first: bool = True) -> Callable[[Nodes], None]:
    def build(nodes: Nodes) -> None:
        clear, solid = nodes.node("ShaderNodeBsdfTransparent").outputs[0], nodes.shader.outputs[0]
        pair = (clear, solid) if transparent_first else (solid, clear)
        nodes.surface(nodes.node("ShaderNodeMixShader", factor(nodes), *pair).outputs[0])

    return build


def _grouped(nodes: Nodes) -> None:
    """A group that mixes the transparent shader by a factor that comes from outside."""
    group = bpy.data.node_groups.new("Cut Out", "ShaderNodeTree")
    group.interface.new_socket("Factor", in_out="INPUT", socket_type="NodeSocketFloat")
    group.interface.new_socket("Solid", in_out="INPUT", socket_type="NodeSocketShader")
    group.interface.new_socket("Shader", in_out="OUTPUT", socket_type="NodeSocketShader")
    begin, end = group.nodes.new("NodeGroupInput"), group.nodes.new("NodeGroupOutput")
    mix, clear = group.nodes.new("ShaderNodeMixShader"), group.nodes.new("ShaderNodeBsdfTransparent")
    for source, target in ((begin.outputs[0], mix.inputs[0]), (clear.outputs[0], mix.inputs[1])):
        group.links.new(source, target)
    group.links.new(begin.outputs[1], mix.inputs[2])
    group.links.new(mix.outputs[0], end.inputs[0])
    outer = nodes.node("ShaderNodeGroup", node_tree=group)
    nodes.feed(outer.inputs[0], nodes.image(half()).outputs["Alpha"])
    nodes.feed(outer.inputs[1], nodes.shader.outputs[0])
    reroute = nodes.node("NodeReroute")
    nodes.feed(reroute.inputs[0], outer.outputs[0])
    nodes.surface(reroute.outputs[0])


def _mapped(kind: str, **values: tuple[float, float, float]) -> Callable[[Nodes], None]:
    def build(nodes: Nodes) -> None:
        place = nodes.node("ShaderNodeTexCoord").outputs["UV"]
        mapping = nodes.node("ShaderNodeMapping", place, vector_type=kind)
        for name, value in values.items():
            mapping.inputs[name].default_value = value
        image = nodes.image(half())
        nodes.feed(image.inputs["Vector"], mapping.outputs[0])
        nodes.alpha(image.outputs["Alpha"])

    return build


def _extended(extension: str) -> Callable[[Nodes], None]:
    """The image over the middle half of the card alone: what lies around it is the extension's."""

    def build(nodes: Nodes) -> None:
        place = nodes.node("ShaderNodeTexCoord").outputs["UV"]
        mapping = nodes.node("ShaderNodeMapping", place)
        mapping.inputs["Scale"].default_value, mapping.inputs["Location"].default_value = (2, 2, 1), (-0.5, -0.5, 0)
        image = nodes.image(half(), extension=extension)
        nodes.feed(image.inputs["Vector"], mapping.outputs[0])
        nodes.alpha(image.outputs["Alpha"])

    return build


def _second_map(nodes: Nodes) -> None:
    image = nodes.image(half())
    nodes.feed(image.inputs["Vector"], nodes.node("ShaderNodeUVMap", uv_map="Swapped").outputs[0])
    nodes.alpha(image.outputs["Alpha"])


def _vertex_alpha(nodes: Nodes) -> None:
    nodes.alpha(nodes.node("ShaderNodeVertexColor", layer_name="Fade").outputs["Alpha"])


def _grey_picture(nodes: Nodes) -> None:
    """A mask as a grey image, its colour linked to the alpha."""
    image = bpy.data.images.new("Mask", SIZE, SIZE, alpha=False, is_data=True)
    pixels = np.ones((SIZE, SIZE, 4), np.float32)
    pixels[..., :3] = half()[..., None]
    image.pixels.foreach_set(pixels.ravel())
    image.pack()
    nodes.alpha(nodes.node("ShaderNodeTexImage", image=image, interpolation="Closest").outputs["Color"])


def _ignored_alpha(nodes: Nodes) -> None:
    image = nodes.image(half())
    image.image.alpha_mode = "NONE"
    nodes.alpha(image.outputs["Alpha"])


def _ramp(nodes: Nodes) -> None:
    ramp = nodes.node("ShaderNodeValToRGB", nodes.image(rising(), interpolation="Linear").outputs["Alpha"])
    ramp.color_ramp.interpolation = "CONSTANT"
    ramp.color_ramp.elements[1].position = 0.6
    nodes.alpha(ramp.outputs["Color"])


def _glass(weight: float = 1.0, metallic: float = 0.0, color: float = 1.0) -> Callable[[Nodes], None]:
    def build(nodes: Nodes) -> None:
        nodes.shader.inputs["Transmission Weight"].default_value = weight
        nodes.shader.inputs["Metallic"].default_value = metallic
        nodes.shader.inputs["Base Color"].default_value = (color, color, color, 1.0)

    return build


def _glass_with_alpha(nodes: Nodes) -> None:
    _glass()(nodes)
    nodes.alpha(nodes.image(half()).outputs["Alpha"])


def _glass_shader(kind: str) -> Callable[[Nodes], None]:
    def build(nodes: Nodes) -> None:
        made = nodes.node(kind)
        made.inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)
        nodes.surface(made.outputs[0])

    return build


def _tinted(nodes: Nodes) -> None:
    clear = nodes.node("ShaderNodeBsdfTransparent")
    clear.inputs[0].default_value = (0.9, 0.6, 0.3, 1.0)
    nodes.surface(clear.outputs[0])


def _glow(nodes: Nodes) -> None:
    parts = [nodes.node(f"ShaderNode{kind}").outputs[0] for kind in ("Emission", "BsdfTransparent")]
    nodes.surface(nodes.node("ShaderNodeAddShader", *parts).outputs[0])


def _shadow_trick(nodes: Nodes) -> None:
    """Glass that throws no shadow: transparent to rays of shadow alone."""
    _mixed(lambda nodes: nodes.node("ShaderNodeLightPath").outputs["Is Shadow Ray"], transparent_first=False)(nodes)


def _one_sided(nodes: Nodes) -> None:
    back = nodes.node("ShaderNodeNewGeometry").outputs["Backfacing"]
    nodes.alpha(nodes.node("ShaderNodeMath", 1.0, back, operation="SUBTRACT").outputs[0])


def _muted(nodes: Nodes) -> None:
    """A muted threshold passes its first input on."""
    alpha = nodes.image(half()).outputs["Alpha"]
    clip = nodes.node("ShaderNodeMath", alpha, 2.0, operation="GREATER_THAN")
    clip.mute = True
    nodes.alpha(clip.outputs[0])


def _noise(nodes: Nodes) -> None:
    nodes.alpha(nodes.node("ShaderNodeTexNoise").outputs[0])


def _noise_between_solids(nodes: Nodes) -> None:
    matt = nodes.node("ShaderNodeBsdfDiffuse").outputs[0]
    noise = nodes.node("ShaderNodeTexNoise").outputs[0]
    nodes.surface(nodes.node("ShaderNodeMixShader", noise, matt, nodes.shader.outputs[0]).outputs[0])


def _missing(nodes: Nodes) -> None:
    image = bpy.data.images.new("Gone", 4, 4)
    image.source, image.filepath = "FILE", "//nowhere/gone.png"
    nodes.alpha(nodes.node("ShaderNodeTexImage", image=image).outputs["Alpha"])


def _tiled(nodes: Nodes) -> None:
    image = nodes.image(half())
    image.image.source = "TILED"
    nodes.alpha(image.outputs["Alpha"])


def _right(u: Float, v: Float) -> Float:
    return (u > 0.5).astype(np.float64)


def _none(u: Float, v: Float) -> float:
    return 0.0


CASES: dict[str, Case] = {
    "solid": Case(lambda nodes: None, _none),
    "alpha of an image": Case(_linked_alpha, _right),
    "alpha of 0.3": Case(lambda nodes: nodes.alpha(0.3), lambda u, v: 0.7),
    "alpha of 0": Case(lambda nodes: nodes.alpha(0.0), lambda u, v: 1.0),
    "blend of an image": Case(
        lambda nodes: nodes.alpha(nodes.image(rising(), interpolation="Linear").outputs["Alpha"]), lambda u, v: 1.0 - u
    ),
    "greater than": Case(_clipped("GREATER_THAN", 0.7), lambda u, v: (u <= 0.7) * 1.0),
    "less than": Case(_clipped("LESS_THAN", 0.2), lambda u, v: (u >= 0.2) * 1.0),
    "rounded": Case(_clipped("ROUND", 0.0), lambda u, v: (u < 0.5) * 1.0),
    "glTF's mask": Case(_gltf_mask, lambda u, v: (u < 0.3) * 1.0),
    "mixed by a texture": Case(_mixed(lambda nodes: nodes.image(half()).outputs["Alpha"]), _right),
    "mixed by a number": Case(_mixed(lambda nodes: 0.25), lambda u, v: 0.75),
    "mixed, transparent last": Case(_mixed(lambda nodes: 0.25, transparent_first=False), lambda u, v: 0.25),
    "in a group, by a reroute": Case(_grouped, _right),
    "moved": Case(_mapped("POINT", Location=(0.25, 0, 0)), lambda u, v: ((u > 0.25) & (u < 0.75)) * 1.0),
    "scaled": Case(_mapped("POINT", Scale=(2, 1, 1)), lambda u, v: ((2 * u) % 1.0 > 0.5) * 1.0),
    "turned": Case(_mapped("POINT", Rotation=(0, 0, np.pi / 2)), lambda u, v: (v < 0.5) * 1.0),
    "texture mapping": Case(_mapped("TEXTURE", Scale=(2, 1, 1)), _none),
    "clip": Case(_extended("CLIP"), lambda u, v: 1.0 - ((u > 0.25) & (u < 0.5) & (np.abs(v - 0.5) < 0.25))),
    "extend": Case(_extended("EXTEND"), _right),
    "mirror": Case(_extended("MIRROR"), _right),
    "another map": Case(_second_map, lambda u, v: (v > 0.5) * 1.0),
    "vertices' alpha": Case(_vertex_alpha, lambda u, v: 1.0 - u),
    "grey image": Case(_grey_picture, _right),
    "image without its alpha": Case(_ignored_alpha, _none),
    "ramp": Case(_ramp, lambda u, v: (u < 0.6) * 1.0, edge=0.02),
    "glass": Case(_glass(), lambda u, v: GLASS),
    "half glass": Case(_glass(0.5), lambda u, v: 0.5 * GLASS),
    "dark glass": Case(_glass(color=0.25), lambda u, v: 0.25 * GLASS),
    "metal is no glass": Case(_glass(metallic=1.0), _none),
    "glass in a frame": Case(_glass_with_alpha, lambda u, v: np.where(u > 0.5, 1.0, GLASS)),
    "glass shader": Case(_glass_shader("ShaderNodeBsdfGlass"), lambda u, v: GLASS),
    "refraction shader": Case(_glass_shader("ShaderNodeBsdfRefraction"), lambda u, v: GLASS),
    "translucent shader": Case(_glass_shader("ShaderNodeBsdfTranslucent"), _none),
    "tinted": Case(_tinted, lambda u, v: 0.6),
    "a glow": Case(_glow, lambda u, v: 1.0),
    "no shadow": Case(_shadow_trick, _none),
    "one side": Case(_one_sided, _none),
    "muted": Case(_muted, _right),
    "noise": Case(_noise, _none, warning="can't be worked out (Noise Texture"),
    "noise between solids": Case(_noise_between_solids, _none),
    "missing image": Case(_missing, _none, warning="gone.png' of the material Clear is missing or can't be read"),
    "tiles": Case(_tiled, _none, warning="can't be worked out (Image Texture: Tiled)"),
}
"""Materials by what they are."""


def add_card(item: bpy.types.Material | None, size: float = 4.0, height: float = 3.0) -> bpy.types.Object:
    """Add a level square with texture coordinates from 0 to 1, a map with u and v swapped, and fading colours."""
    place = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * size / 2.0
    mesh = bpy.data.meshes.new("Card")
    mesh.from_pydata([(x, y, height) for x, y in place.tolist()], [], [(0, 1, 2, 3)])
    maps = (place / size + 0.5).astype(np.float32)
    for name, values in (("UVMap", maps), ("Swapped", maps[:, ::-1])):
        mesh.uv_layers.new(name=name).data.foreach_set("uv", np.ascontiguousarray(values).ravel())
    fade = np.ones((4, 4), np.float32)
    fade[:, 3] = maps[:, 0]
    mesh.color_attributes.new("Fade", "FLOAT_COLOR", "CORNER").data.foreach_set("color", fade.ravel())
    if item is not None:
        mesh.materials.append(item)
    made = bpy.data.objects.new("Card", mesh)
    bpy.context.scene.collection.objects.link(made)
    return made


def add_ground(size: float = 40.0) -> bpy.types.Object:
    """Add a level square at 0 without a material."""
    half_size = size / 2.0
    mesh = bpy.data.meshes.new("Ground")
    corners = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]) * half_size
    mesh.from_pydata(corners.tolist(), [], [(0, 1, 2, 3)])
    made = bpy.data.objects.new("Ground", mesh)
    bpy.context.scene.collection.objects.link(made)
    return made
