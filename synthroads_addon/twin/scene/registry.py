"""The files that a built scene is written to, by name, beside Blender's own."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Literal, get_args

from .labelled import LabelledScene

SceneFormat = Literal["blend", "usd", "gltf", "3dtiles"]
SCENE_FORMATS: tuple[SceneFormat, ...] = get_args(SceneFormat)


@dataclass(frozen=True)
class SceneEntry:
    """A format of scenes.

    Attributes:
        label: for people.
        file: name of the file or folder that it writes.
        writer: module beside this one, and function in it; None of Blender's own file.
        holds, loses: what of the built scene is in it, and what isn't, in words.
    """

    label: str
    file: str
    writer: tuple[str, str] | None
    holds: str
    loses: str


ENTRIES: dict[str, SceneEntry] = {
    "blend": SceneEntry(
        "Blender File",
        "scene.blend",
        None,
        "everything: node groups, materials with their nodes, labels, light",
        "nothing",
    ),
    "usd": SceneEntry(
        "USD",
        "scene.usda",
        ("usd", "write_usd"),
        "class and instance of every face, name and stations of objects, shared meshes, materials by name with mean "
        "colours; z up, metres",
        "textures and nodes of materials, how vehicles move, light",
    ),
    "gltf": SceneEntry(
        "glTF",
        "scene.glb",
        ("gltf", "write_glb"),
        "class, instance, name and stations of every object, shared meshes, materials by name with mean colours; y up, "
        "metres",
        "textures and nodes of materials, how vehicles move, light; objects of several classes become several",
    ),
    "3dtiles": SceneEntry(
        "3D Tiles",
        "tiles",
        ("tiles", "write_tiles"),
        "as glTF, by tiles of the road, placed on the globe",
        "as glTF",
    ),
}
"""Every format of scenes by its name."""


def scene_file_names(formats: tuple[str, ...]) -> tuple[str, ...]:
    """Return the names of the files and folders that formats are written to."""
    return tuple(ENTRIES[name].file for name in formats)


def write_scene(scene: LabelledScene, name: str, folder: Path) -> None:
    """Write a scene in a format other than Blender's own into a folder that is there."""
    entry = ENTRIES[name]
    assert entry.writer is not None
    module, function = entry.writer
    getattr(import_module(f".{module}", __package__), function)(scene, folder / entry.file)
