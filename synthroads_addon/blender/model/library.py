"""The asset library: node groups that users can use by hand, with catalogue, usual materials and picture."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import bpy

from ...base.files import PRESETS
from ..files import empty_file
from ..materials import material
from ..nodes import points
from ..nodes.builder import CATALOGUES, MATERIALS, usual_materials
from ..nodes.kept_groups import KEY
from ..things.registry import model_parts

LIBRARY_FOLDER = PRESETS / "node_groups"
"""Folder of the extension with the library and its catalogues."""
LIBRARY_NAME = "SynthRoads"
LIBRARY_FILE = "node_groups.blend"
_CATALOGUES_FILE = "blender_assets.cats.txt"
_DECLARING = (model_parts(), points)
"""Modules that register node groups when they are imported: things, and points along an axis."""


def write_library(path: Path, pictures: Path) -> list[str]:
    """Write the asset library of node groups to a .blend file, discarding the open file; return the groups' names.

    Args:
        path: path of the file.
        pictures: folder with a square PNG file for each group, named like the group.
    """
    empty_file()
    groups = {group: catalogue for catalogue, group in user_groups()}
    ids = catalogue_ids()
    for group, catalogue in groups.items():
        give_usual_materials(group)
        group.asset_mark()
        group.asset_data.catalog_id = ids[catalogue]
        group.asset_data.description = group.description
        group.asset_data.author = "SynthRoads"
        group.asset_data.license = "GPL-3.0-or-later"
        _give_picture(group, pictures / f"{group.name}.png")
    for group in bpy.data.node_groups:
        # Without these properties a build can't mistake a user's group for one of a road's.
        for name in {KEY, MATERIALS} & set(group.keys()):
            del group[name]
    bpy.data.libraries.write(str(path), set(groups), fake_user=True)
    return [group.name for group in groups]


def user_groups() -> Iterator[tuple[str, bpy.types.NodeTree]]:
    """Make all node groups for use by hand in the open file; yield (catalogue name, group)."""
    for catalogue in sorted(CATALOGUES):
        for name in sorted(CATALOGUES[catalogue]):
            yield catalogue, CATALOGUES[catalogue][name]()


def catalogue_ids() -> dict[str, str]:
    """Read the asset catalogues' ids (UUIDs) from the library's catalogue file, by the catalogues' last names."""
    lines = (LIBRARY_FOLDER / _CATALOGUES_FILE).read_text(encoding="utf-8").splitlines()
    rows = [line.split(":") for line in lines if line.count(":") == 2]
    return {path.rpartition("/")[2]: key for key, path, _ in rows}


def give_usual_materials(group: bpy.types.NodeTree) -> None:
    """Set the defaults of a node group's material inputs to their usual materials, in place."""
    usual = usual_materials(group)
    for item in group.interface.items_tree:
        if item.item_type == "SOCKET" and item.in_out == "INPUT" and item.name in usual:
            item.default_value = material(usual[item.name])


def _give_picture(group: bpy.types.NodeTree, file: Path) -> None:
    """Set a group's preview picture from an image file."""
    image = bpy.data.images.load(str(file))
    preview = group.preview_ensure()
    preview.image_size = tuple(image.size)
    preview.image_pixels_float = list(image.pixels)
    bpy.data.images.remove(image)
