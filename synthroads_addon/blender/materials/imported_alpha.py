"""Transparency of imported materials as their files mean it, where Blender's importers leave something of it aside.

An OBJ's mask (``map_d``) is a grey image as often as one with an alpha, and its ``Tr`` is ``1 - d``; the importer takes
the alpha always, and no ``Tr``. An FBX's transparency is often the alpha of the very image that gives the colour; the
importer takes its colour.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

import bpy

from ...scanning.scene.mesh_files import material_libraries
from .image import alpha_plane, is_missing


def mend_imported_alpha(path: Path, items: Iterable[bpy.types.Material]) -> None:
    """Have materials that were imported from an .obj or .fbx be as transparent as the file says.

    Args:
        path: the file, which `check_mesh_file` has seen; of other kinds nothing is changed.
        items: its materials.
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
    """Have an alpha that an image gives be the image's alpha where it has one, else its colour."""
    node = alpha.links[0].from_node if alpha.is_linked else None
    if node is None or node.type != "TEX_IMAGE" or is_missing(node.image):
        return
    cut_out = float(alpha_plane(node.image).values.min()) < 1.0
    tree.links.new(node.outputs["Alpha" if cut_out else "Color"], alpha)


def _transparencies(path: Path) -> Iterator[tuple[str, float]]:
    """Yield (material, ``Tr``) of those materials of an .obj that say so and have no ``d``."""
    for name in material_libraries(path):
        try:
            lines = (path.parent / name.replace("\\", "/")).read_text(encoding="utf-8", errors="replace").splitlines()
        except OSError:
            continue
        material, shares, solid = "", dict[str, float](), set[str]()
        for words in (line.split() for line in lines):
            if len(words) < 2:
                continue
            if words[0] == "newmtl":
                material = " ".join(words[1:])
            elif words[0] == "d":
                solid.add(material)
            elif words[0] == "Tr":
                try:
                    shares[material] = min(1.0, max(0.0, float(words[1])))
                except ValueError:
                    continue
        yield from ((name, share) for name, share in shares.items() if name not in solid)
