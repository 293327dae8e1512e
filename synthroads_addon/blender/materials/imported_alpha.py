"""Transparency of imported materials as their files mean it, where Blender's importers ignore a part of it.

An OBJ's mask (``map_d``) is either a grey image or one with an alpha, and its ``Tr`` is ``1 - d``; Blender's importer
always takes the alpha, and ignores ``Tr``. An FBX's transparency is often the alpha of the image that gives the colour;
the importer takes the image's colour instead.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

import bpy

from ...scanning.scene.mesh_files import material_libraries
from .image import alpha_plane, is_missing


def mend_imported_alpha(path: Path, items: Iterable[bpy.types.Material]) -> None:
    """Make materials that were imported from an .obj or .fbx as transparent as the file says.

    Args:
        path: the file, which has passed `check_mesh_file`; materials of other kinds of files aren't changed.
        items: the materials that were imported from it.
    """
    suffix = path.suffix.lower()
    if suffix not in (".obj", ".fbx"):
        return
    transparency = dict(_transparencies(path)) if suffix == ".obj" else {}
    for item in items:
        shaders = [node for node in item.node_tree.nodes if node.type == "BSDF_PRINCIPLED"] if item.node_tree else []
        for shader in shaders:
            alpha = shader.inputs["Alpha"]
            share = transparency.get(item.name, transparency.get(item.name.rpartition(".")[0]))
            if share is not None and not alpha.is_linked:
                alpha.default_value = 1.0 - share
            _choose_output(item.node_tree, alpha)


def _choose_output(tree: bpy.types.NodeTree, alpha: bpy.types.NodeSocket) -> None:
    """Link an alpha that an image texture gives to the image's alpha if that varies, else to the image's colour."""
    node = alpha.links[0].from_node if alpha.is_linked else None
    if node is None or node.type != "TEX_IMAGE" or is_missing(node.image):
        return
    has_alpha = float(alpha_plane(node.image).values.min()) < 1.0
    tree.links.new(node.outputs["Alpha" if has_alpha else "Color"], alpha)


def _transparencies(path: Path) -> Iterator[tuple[str, float]]:
    """Yield (material, ``Tr``) of an .obj's materials that have a ``Tr``, 0 to 1, and no ``d``."""
    for name in material_libraries(path):
        try:
            lines = (path.parent / name.replace("\\", "/")).read_text(encoding="utf-8", errors="replace").splitlines()
        except OSError:
            continue
        material, shares, materials_with_d = "", dict[str, float](), set[str]()
        for words in (line.split() for line in lines):
            if len(words) < 2:
                continue
            if words[0] == "newmtl":
                material = " ".join(words[1:])
            elif words[0] == "d":
                materials_with_d.add(material)
            elif words[0] == "Tr":
                try:
                    shares[material] = min(1.0, max(0.0, float(words[1])))
                except ValueError:
                    continue
        yield from ((name, share) for name, share in shares.items() if name not in materials_with_d)
