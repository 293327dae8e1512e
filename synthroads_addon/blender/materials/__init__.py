"""Blender materials from the material table; their means are equal to the table's."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from functools import cache, partial
from typing import Self

import bpy

from ...base.errors import InputError, nearest_name
from ...base.random_streams import stream
from ...materials.table import UNKNOWN, Material, entry_of, materials
from ...materials.variation import vary_material
from ...road.parameters import RoadParameters
from ...road.pavement.field import Wear
from ...road.surroundings import Environment, MaterialVariation
from ..nodes.builder import files_digest, source_files
from .looks import is_worn, vary_color
from .shading import shade
from .surface_layers import PROPERTY, layer_expressions, mean_value
from .texture_nodes import texture_values
from .textures import NORMAL_IMAGE, Texture, load_texture, remove_unused_images
from .transparency import glass_weight

MEAN = "synthroads_mean"
"""Custom property of a Blender material: its mean properties, as JSON."""
LOOK = "synthroads_look"
"""Custom property of a Blender material: digest of all that its nodes follow from, to find the same material again."""
_SOURCES = ("materials/*.py", "nodes/builder.py", "../road/pavement/*.py")
"""Patterns of the source files that materials' nodes follow from."""


class RoadMaterials:
    """The Blender materials of one road: the table's entries as its variation, its weather and its seed make them.

    Roads that look alike share materials. A material that the file has already is reused, and one that it lacks is
    made; existing materials are never changed, as they may be another road's or the user's.

    Args:
        variation: how the road's materials differ from the table: age, wetness, textures, ...
        environment: the road's weather and daylight.
        offset: shift of the random fields on its pavement, a whole number from 0 to 65535.
        user_table: entries that replace those of the shipped table, by name.

    Raises:
        InputError: textures are given for a material that the table lacks.
    """

    def __init__(
        self,
        variation: MaterialVariation,
        environment: Environment,
        offset: float = 0.0,
        user_table: Mapping[str, Material] | None = None,
    ) -> None:
        self._variation, self._environment, self._user_table = variation, environment, user_table
        self._wear = Wear(
            variation.wheel_track_polish, offset, variation.paint_renewed, variation.paint_dirt, variation.paint_rubber
        )
        self._looks: dict[str, tuple[Material, str]] = {}
        self._textures: dict[str, Texture] = {}
        self._made_numbers: set[int] = set()
        for name in (texture.material for texture in variation.textures):
            if name not in materials():
                text = f"must be a material of the table{nearest_name(name, materials())}"
                raise InputError("materials.textures.material", name, text)

    @classmethod
    def of(cls, parameters: RoadParameters, user_table: Mapping[str, Material] | None = None) -> Self:
        """Return the materials of a road, with `user_table` in place of the shipped table's."""
        offset = float(stream(parameters.metadata.seed, "pavement look").integers(1 << 16))
        return cls(parameters.materials, parameters.environment, offset, user_table)

    def material(self, name: str) -> bpy.types.Material:
        """Return the Blender material of a table entry: the file's if it has one that looks so, else a new one.

        Raises:
            KeyError: the table has no such entry.
            InputError: an image of its textures can't be read, see `textures.load_texture`.
        """
        if name not in materials():
            raise KeyError(f"no material '{name}'{nearest_name(name, materials())}")
        texture = self._texture(name)
        if name not in self._looks:
            mean = vary_material(name, self._variation, self._environment, self._entries(name))
            self._looks[name] = mean, _look(name, mean, self._wear if is_worn(name) else None, texture)
        mean, look = self._looks[name]
        for file_material in bpy.data.materials:
            if file_material.get(LOOK) == look and file_material.library is None:
                return file_material
        new_material = bpy.data.materials.new(_usual_name(name))
        new_material[PROPERTY], new_material[MEAN], new_material[LOOK] = name, mean.to_json(), look
        images = None
        if texture is not None:
            images = partial(texture_values, texture=texture, factors=texture.factors(self._table(name), mean))
            if "normal" in texture.images:
                new_material[NORMAL_IMAGE] = [texture.tile, float(texture.along)]
        shade(new_material, mean, partial(vary_color, name, self._wear), images)
        self._made_numbers.add(new_material.session_uid)
        return new_material

    def _texture(self, name: str) -> Texture | None:
        """Return the images of a material's texture, loaded once; None if the road gives none."""
        texture = self._variation.texture(name)
        if texture is not None and name not in self._textures:
            self._textures[name] = load_texture(texture, is_worn(name))
        return self._textures.get(name)

    def _table(self, name: str) -> Material:
        """Return a material's entry in the user's table, else in the shipped one."""
        return (self._user_table or {}).get(name) or materials()[name]

    def _entries(self, name: str) -> dict[str, Material]:
        """Return the entries that replace those of the shipped table: the user's, and means of textures' images.

        Beside the material's own images only asphalt's are needed: asphalt shows where a marking is worn.
        """
        textures = {entry: texture for entry in (name, "asphalt") if (texture := self._texture(entry))}
        image_entries = {entry: texture.entry(self._table(entry)) for entry, texture in textures.items()}
        return {**(self._user_table or {}), **image_entries}

    def take_usual_names(self) -> None:
        """Rename the materials that were made here to their usual names, which removed materials have freed."""
        for item in [item for item in bpy.data.materials if item.session_uid in self._made_numbers]:
            item.name = _usual_name(str(item[PROPERTY]))


def material(name: str) -> bpy.types.Material:
    """Return the Blender material of a table entry with the table's means; KeyError for other names."""
    return RoadMaterials(MaterialVariation(), Environment()).material(name)


def used_materials() -> set[int]:
    """Return Blender's session numbers of the table's materials that something in the file uses."""
    return {item.session_uid for item in bpy.data.materials if PROPERTY in item and item.users}


def remove_unused_materials(numbers: set[int]) -> None:
    """Remove the unused among some materials, given by session numbers; keep those that the user has renamed.

    Images of textures that nothing uses are removed too.
    """
    unused = [
        item
        for item in bpy.data.materials
        if item.session_uid in numbers and not item.users and _is_usual_name(item.name, str(item.get(PROPERTY, "")))
    ]
    bpy.data.batch_remove(unused)
    remove_unused_images()


@cache
def _sources_digest() -> bytes:
    """Return a digest of the source files of all materials: a change to any makes new materials; cached."""
    return files_digest(*source_files(_SOURCES))


def _look(name: str, mean: Material, wear: Wear | None, texture: Texture | None) -> str:
    """Return the digest of all that the look of a material follows from; see `LOOK`."""
    text = repr((name, mean.to_json(), None if wear is None else tuple(wear), texture and texture.key))
    return hashlib.sha256(_sources_digest() + text.encode()).hexdigest()[:16]


def _usual_name(entry: str) -> str:
    """Return the name of a table entry's Blender material."""
    return f"SR {entry}"


def _is_usual_name(name: str, entry: str) -> bool:
    """Return whether a material has its usual name, or that with the number that Blender appends to duplicates."""
    base, _, number = name.rpartition(".")
    usual = _usual_name(entry)
    return name == usual or (base == usual and number.isdigit())


def scene_name(item: bpy.types.Material | None) -> str:
    """Return the unique name that a material has in a scanned scene.

    It is the table's entry, such as ``asphalt``. If different roads have several materials of one entry, Blender's
    name follows for all but one: ``asphalt (SR asphalt.001)``, see `materials.table.entry_of`. Users' materials keep
    their Blender names.
    """
    if item is None:
        return UNKNOWN
    if PROPERTY not in item:
        return str(item.name)
    entry = str(item[PROPERTY])
    return entry if item.name_full == _usual_name(entry) else f"{entry} ({item.name_full})"


def constants(names: Iterable[str]) -> dict[str, Material]:
    """Return materials' mean properties by scene names: as they were made, else those of their Principled BSDF."""
    table = materials()
    stored_means = {scene_name(item): item[MEAN] for item in bpy.data.materials if PROPERTY in item and MEAN in item}

    def mean(name: str) -> Material:
        return Material.from_dict(json.loads(stored_means[name])) if name in stored_means else table[entry_of(name)]

    return {name: mean(name) if entry_of(name) in table else _principled(name) for name in names}


def _principled(name: str) -> Material:
    """Return the mean properties of a user's material: of its shaders' layers, else of its viewport settings."""
    item = bpy.data.materials.get(name)
    if item is None:
        return materials()[UNKNOWN]
    means = {layer: mean_value(expression) for layer, expression in layer_expressions(item).items()}
    nodes = item.node_tree.nodes if item.node_tree else ()
    node = next((node for node in nodes if node.type == "BSDF_PRINCIPLED"), None)
    red, green, blue = (share(part) for part in means.get("base_color", item.diffuse_color[:3]))
    # A renderer's default specular of 0.5 would drown the contrast of the base colours.
    specular = min(0.2, float(node.inputs["Specular IOR Level"].default_value)) if node else 0.2
    glass = glass_weight(item)
    if glass:  # a pane's colour tints the light that passes, it isn't the colour that the pane reflects
        pane = materials()["glass"]
        red, green, blue = (
            part + glass * (pane_color - part)
            for part, pane_color in zip((red, green, blue), pane.base_color, strict=True)
        )
        specular += glass * (pane.specular - specular)
    return Material(
        base_color=(red, green, blue),
        roughness=share(means["roughness"][0] if "roughness" in means else item.roughness),
        metallic=share(means["metallic"][0] if "metallic" in means else item.metallic),
        specular=share(specular),
    )


def share(value: float) -> float:
    """Return a value between 0 and 1."""
    return min(1.0, max(0.0, float(value)))
