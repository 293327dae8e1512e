"""Parts of an open scene that aren't scanned as declared, as sentences: hair, displacement, missing images."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import bpy

from ..materials import scene_name
from ..materials.image import nodes_without_image, trees_below
from ..materials.surface_layers import PROPERTY, material_output
from ..materials.transparency import read_transparency

_KINDS = {
    "CURVES": "hair curves",
    "POINTCLOUD": "points",
    "VOLUME": "a volume",
    "GREASEPENCIL": "Grease Pencil",
    "GPENCIL": "Grease Pencil",
}
"""Kinds of evaluated objects that renders show although they have no faces, in words."""
_MOST_NAMES = 5
"""Largest number of names that a sentence lists."""


class LeftOut:
    """Collector, while a scene is read, of things that renders show but scans don't.

    Attributes:
        users: names of the objects that have each material, by the material's name in the scene.
    """

    def __init__(self) -> None:
        self.users: dict[str, set[str]] = {}
        self._without_faces: dict[str, set[str]] = {}
        self._holdouts: set[str] = set()

    def see_kind(self, item: bpy.types.Object) -> None:
        """Note an evaluated object that isn't a mesh."""
        if item.type in _KINDS:
            self._without_faces.setdefault(_KINDS[item.type], set()).add(item.original.name)

    def see_object(self, item: bpy.types.Object, slots: Collection[str]) -> None:
        """Note an object that is scanned, with the names of its materials in the scene."""
        for name in slots:
            self.users.setdefault(name, set()).add(item.name)
        if item.is_holdout:
            self._holdouts.add(item.name)

    def see_hair(self, depsgraph: bpy.types.Depsgraph) -> None:
        """Note the hair in an evaluated scene that particle systems draw as strands."""
        for item in depsgraph.objects:
            systems = [modifier for modifier in item.modifiers if modifier.type == "PARTICLE_SYSTEM"]
            for modifier in systems:
                settings = modifier.particle_system.settings
                if modifier.show_viewport and settings.type == "HAIR" and settings.render_type == "PATH":
                    self._without_faces.setdefault("hair", set()).add(item.original.name)

    def warnings(self, layer: bpy.types.ViewLayer) -> tuple[str, ...]:
        """Return sentences about all that was noted, and about features of materials that scans don't show."""
        sentences = [
            f"{names_of(names)}: {kind} can't be scanned, as there are no faces"
            for kind, names in sorted(self._without_faces.items())
        ]
        if self._holdouts:
            sentences.append(f"{names_of(self._holdouts)}: is a holdout, and is scanned as the solid that it is")
        if layer.material_override is not None:
            sentences.append(f"the view layer's material override {layer.material_override.name!r} isn't looked at")
        return (*sentences, *material_warnings(self.users))


def material_warnings(users: Mapping[str, Collection[str]]) -> list[str]:
    """Return sentences about users' materials: features that scans don't show, and assumptions that were made.

    Args:
        users: names of the objects that have each material, by the material's name in the scene.
    """
    warnings: list[str] = []
    used_materials = {name: item for item in bpy.data.materials if (name := scene_name(item)) in users}
    missing: dict[str, set[str]] = {}
    for name, item in sorted(used_materials.items()):
        if item.node_tree is None or PROPERTY in item:
            continue
        if obstacle := read_transparency(item).obstacle:
            text = f"the transparency of the material {name!r} can't be worked out ({obstacle}): it is scanned as solid"
            warnings.append(text)
        if _is_displaced(item):
            text = f"the material {name!r} displaces the surface when it is rendered: it is scanned where its mesh is"
            warnings.append(f"{names_of(users[name])}: {text}" if users[name] else text)
        for node in (node for tree in trees_below(item.node_tree) for node in nodes_without_image(tree)):
            if any(output.is_linked for output in node.outputs):
                image = "an image texture's image"
                if node.image:
                    image = f"the image {node.image.filepath or node.image.name!r}"
                missing.setdefault(image, set()).add(name)
    for image, names in sorted(missing.items()):
        text = "is missing or can't be read as a picture: what stands in the socket that it feeds takes its place"
        warnings.append(f"{image} of the material {names_of(names)} {text}")
    return warnings


def _is_displaced(item: bpy.types.Material) -> bool:
    """Return whether a material's output displaces the surface when it is rendered."""
    output_node = material_output(item.node_tree)
    methods = ("DISPLACEMENT", "BOTH")
    return (
        output_node is not None and output_node.inputs["Displacement"].is_linked and item.displacement_method in methods
    )


def names_of(names: Collection[str]) -> str:
    """Return some names as a list in a sentence, shortened if there are many."""
    sorted_names = sorted(names)
    further_count = len(sorted_names) - _MOST_NAMES
    return ", ".join(sorted_names[:_MOST_NAMES]) + (f" and {further_count} more" if further_count > 0 else "")
