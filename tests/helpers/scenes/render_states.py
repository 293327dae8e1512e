"""Scenes that a render shows otherwise than the viewport: how many faces each has there, and what can't be scanned."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import bpy


@dataclass(frozen=True)
class Case:
    """A scene.

    Attributes:
        build: makes it in an empty file.
        rendered, shown: triangles that a render and the viewport show.
        warning: what must be said of it; nothing if empty.
    """

    build: Callable[[], None]
    rendered: int
    shown: int
    warning: str = ""


def cube(name: str = "Box", collection: bpy.types.Collection | None = None) -> bpy.types.Object:
    """Add a cube of 12 triangles."""
    corners = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(corners, [], faces)
    item = bpy.data.objects.new(name, mesh)
    (collection or bpy.context.scene.collection).objects.link(item)
    return item


def collection(name: str, linked: bool = True) -> bpy.types.Collection:
    """Add a collection, to the scene if asked."""
    made = bpy.data.collections.new(name)
    if linked:
        bpy.context.scene.collection.children.link(made)
    return made


def layer(name: str) -> bpy.types.LayerCollection:
    """Return a collection in the view layer."""
    return bpy.context.view_layer.layer_collection.children[name]


def instance(of: bpy.types.Collection) -> bpy.types.Object:
    """Add an empty that shows a collection."""
    item = bpy.data.objects.new("Shows", None)
    item.instance_type, item.instance_collection = "COLLECTION", of
    bpy.context.scene.collection.objects.link(item)
    return item


def modifier(kind: str, show: tuple[bool, bool] = (True, True), **values: Any) -> Callable[[], None]:
    """Return what adds a cube with a modifier, shown in the viewport and in renders or not."""

    def build() -> None:
        made = cube().modifiers.new("Changes", kind)
        for name, value in values.items():
            setattr(made, name, value)
        made.show_viewport, made.show_render = show

    return build


def _screw() -> None:
    """A segment that is turned about z, once."""
    mesh = bpy.data.meshes.new("Segment")
    mesh.from_pydata([(1.0, 0.0, 0.0), (2.0, 0.0, 0.0)], [(0, 1)], [])
    item = bpy.data.objects.new("Segment", mesh)
    bpy.context.scene.collection.objects.link(item)
    made = item.modifiers.new("Changes", "SCREW")
    made.steps, made.render_steps = 4, 8


def _cutter() -> None:
    wall, cutter = cube("Wall"), cube("Cutter")
    cutter.location, cutter.scale = (0.0, 0.0, 1.0), (0.5, 0.5, 0.5)
    cutter.hide_render, cutter.display_type = True, "WIRE"
    made = wall.modifiers.new("Cut", "BOOLEAN")
    made.object, made.operation = cutter, "DIFFERENCE"
    bpy.context.view_layer.update()


def _eye() -> None:
    cube("Rendered").hide_set(True)
    cube("Both")


def _object(name: str, value: bool = True) -> Callable[[], None]:
    def build() -> None:
        setattr(cube("Changed"), name, value)
        cube("Both")

    return build


def _collection(name: str) -> Callable[[], None]:
    def build() -> None:
        made = collection("Part")
        cube("Changed", made)
        setattr(made, name, True)
        cube("Both")

    return build


def _layer(name: str) -> Callable[[], None]:
    def build() -> None:
        cube("Changed", collection("Part"))
        setattr(layer("Part"), name, True)
        cube("Both")

    return build


def _in_both() -> None:
    """In a collection that renders don't show, and in one that they do."""
    hidden, shown = collection("Hidden"), collection("Shown")
    hidden.hide_render = True
    item = cube("Changed", hidden)
    shown.objects.link(item)


def _instanced() -> None:
    """An instanced collection with a helper that renders don't show, and a part that the viewport doesn't."""
    library = collection("Library", linked=False)
    cube("Seen", library)
    cube("Helper", library).hide_render = True
    cube("Heavy", library).hide_viewport = True
    cube("Third", library).hide_viewport = True
    instance(library)


def _instanced_excluded() -> None:
    """A collection that is left out of the layer, and is shown all the same where it is instanced."""
    library = collection("Library")
    cube("Seen", library)
    layer("Library").exclude = True
    instance(library)


def _hidden_child() -> None:
    outer = collection("Outer")
    inner = bpy.data.collections.new("Inner")
    outer.children.link(inner)
    cube("Changed", inner)
    outer.hide_render = True
    cube("Both")


def _instancer() -> None:
    """An object that is drawn in the viewport and shows only what it has on its vertices when it is rendered."""
    parent, child = cube("Parent"), cube("Child")
    child.parent, parent.instance_type = parent, "VERTS"
    parent.show_instancer_for_render = False


def _particles(**values: Any) -> Callable[[], None]:
    def build() -> None:
        tuft = cube("Tuft")
        tuft.location.x = 100.0
        ground = cube("Ground")
        settings = ground.modifiers.new("Grass", "PARTICLE_SYSTEM").particle_system.settings
        settings.type, settings.count, settings.render_type = "HAIR", 100, "OBJECT"
        settings.instance_object, settings.use_advanced_hair = tuft, True
        for name, value in values.items():
            setattr(settings, name, value)

    return build


def _hair() -> None:
    settings = cube("Meadow").modifiers.new("Grass", "PARTICLE_SYSTEM").particle_system.settings
    settings.type, settings.count, settings.render_type = "HAIR", 10, "PATH"


def _hair_curves() -> None:
    curves = bpy.data.hair_curves.new("Fur")
    curves.add_curves([3, 4])
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("Fur", curves))
    cube()


def _volume() -> None:
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("Fog", bpy.data.volumes.new("Fog")))
    cube()


def _displaced() -> None:
    item = bpy.data.materials.new("Rough")
    if item.node_tree is None:
        item.use_nodes = True
    tree = item.node_tree
    end = next(node for node in tree.nodes if node.type == "OUTPUT_MATERIAL")
    tree.links.new(tree.nodes.new("ShaderNodeDisplacement").outputs[0], end.inputs["Displacement"])
    item.displacement_method = "DISPLACEMENT"
    cube("Rock").data.materials.append(item)


def _only_bumped() -> None:
    _displaced()
    bpy.data.materials["Rough"].displacement_method = "BUMP"


def _curve() -> None:
    """A tube of two points along a circle, finer when it is rendered."""
    curve = bpy.data.curves.new("Tube", "CURVE")
    curve.dimensions, curve.bevel_depth, curve.bevel_resolution = "3D", 0.1, 0
    spline = curve.splines.new("BEZIER")
    spline.bezier_points.add(1)
    spline.bezier_points[1].co = (1.0, 0.0, 0.0)
    spline.resolution_u, curve.render_resolution_u = 2, 6
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("Tube", curve))


def _is_viewport() -> None:
    """Nodes that make nothing in the viewport."""
    group = bpy.data.node_groups.new("Quick", "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        group.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    nodes = {kind: group.nodes.new(kind) for kind in ("NodeGroupInput", "NodeGroupOutput", "GeometryNodeSwitch")}
    asks = group.nodes.new("GeometryNodeIsViewport")
    switch = nodes["GeometryNodeSwitch"]
    switch.input_type = "GEOMETRY"
    group.links.new(asks.outputs[0], switch.inputs["Switch"])
    group.links.new(nodes["NodeGroupInput"].outputs[0], switch.inputs["False"])
    group.links.new(switch.outputs[0], nodes["NodeGroupOutput"].inputs[0])
    cube().modifiers.new("Quick", "NODES").node_group = group


def _simplified() -> None:
    modifier("SUBSURF", levels=2, render_levels=2)()
    render = bpy.context.scene.render
    render.use_simplify, render.simplify_subdivision, render.simplify_subdivision_render = True, 0, 1


def _animated() -> None:
    """Visibility that is animated for the viewport alone."""
    item = cube("Changed")
    item.hide_viewport = True
    item.keyframe_insert("hide_viewport", frame=1)
    cube("Both")


def _driven() -> None:
    """A modifier that a driver switches off in the viewport."""
    made = cube().modifiers.new("Changes", "ARRAY")
    made.count = 3
    made.driver_add("show_viewport").driver.expression = "0"


def _holdout() -> None:
    cube("Hole").is_holdout = True


def _unseen_by_cameras() -> None:
    cube("Blocker").visible_camera = False
    cube("Both")


def _override() -> None:
    bpy.context.view_layer.material_override = bpy.data.materials.new("Clay")
    cube()


CASES: dict[str, Case] = {
    "cutter": Case(_cutter, 28, 40),
    "array in renders alone": Case(modifier("ARRAY", (False, True), count=5), 60, 12),
    "array in the viewport alone": Case(modifier("ARRAY", (True, False), count=5), 12, 60),
    "levels of a subdivision": Case(modifier("SUBSURF", levels=0, render_levels=2), 192, 12),
    "steps of a screw": Case(_screw, 16, 8),
    "simplified": Case(_simplified, 48, 12),
    "eye": Case(_eye, 24, 12),
    "screen": Case(_object("hide_viewport"), 24, 12),
    "hidden from renders": Case(_object("hide_render"), 12, 24),
    "collection's screen": Case(_collection("hide_viewport"), 24, 12),
    "collection hidden from renders": Case(_collection("hide_render"), 12, 24),
    "collection's eye": Case(_layer("hide_viewport"), 24, 12),
    "excluded collection": Case(_layer("exclude"), 12, 12),
    "collection for indirect light": Case(_layer("indirect_only"), 12, 24),
    "in two collections": Case(_in_both, 12, 12),
    "collection in one that is hidden": Case(_hidden_child, 12, 24),
    "instanced collection": Case(_instanced, 36, 24),
    "instance of an excluded collection": Case(_instanced_excluded, 12, 12),
    "instancer": Case(_instancer, 108, 120),
    "particles in part": Case(_particles(display_percentage=0), 1224, 24),
    "particles not drawn": Case(_particles(display_method="NONE"), 1224, 24),
    "curve's resolution": Case(_curve, 48, 16),
    "nodes that ask for the viewport": Case(_is_viewport, 12, 0),
    "animated": Case(_animated, 24, 12),
    "driven": Case(_driven, 36, 12),
    "unseen by cameras": Case(_unseen_by_cameras, 12, 24),
    "hair": Case(_hair, 12, 12, "Meadow: hair can't be scanned"),
    "hair curves": Case(_hair_curves, 12, 12, "Fur: hair curves can't be scanned"),
    "volume": Case(_volume, 12, 12, "Fog: a volume can't be scanned"),
    "displacement": Case(_displaced, 12, 12, "Rock: the material 'Rough' displaces the surface"),
    "bump": Case(_only_bumped, 12, 12),
    "holdout": Case(_holdout, 12, 12, "Hole: is a holdout"),
    "material override": Case(_override, 12, 12, "material override 'Clay' isn't looked at"),
}
"""Scenes by what differs in them."""
