"""Means of a scene's materials, and the layers that vary on them."""

from __future__ import annotations

from collections.abc import Callable

import bpy
import numpy as np
import pytest

from synthroads_addon.blender.cameras.surfaces import scene_constants
from synthroads_addon.blender.files import empty_file
from synthroads_addon.blender.materials import surface_layers
from synthroads_addon.blender.services import BlenderServices

GREYS = (0.2, 0.5, 0.8)


def textured(grey: float) -> str:
    """Make a material whose base colour is an image of one grey; return its name."""
    image = bpy.data.images.new("Grey", 4, 4, float_buffer=True)
    image.pixels.foreach_set(np.tile(np.array([grey, grey, grey, 1.0], np.float32), 16))
    item = bpy.data.materials.new("Textured")
    item.use_nodes = True
    nodes, links = item.node_tree.nodes, item.node_tree.links
    node = nodes.new("ShaderNodeTexImage")
    node.image = image
    shader = next(node for node in nodes if node.type == "BSDF_PRINCIPLED")
    links.new(node.outputs["Color"], shader.inputs["Base Color"])
    return str(item.name)


def test_the_mean_of_each_image_is_taken_once_however_many_materials_there_are(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    empty_file()
    names, taken = [textured(grey) for grey in GREYS], list[bpy.types.Node]()
    mean: Callable[[bpy.types.Node], tuple[float, float, float] | None] = surface_layers.mean_color

    def counted(node: bpy.types.Node) -> tuple[float, float, float] | None:
        taken.append(node)
        return mean(node)

    monkeypatch.setattr(surface_layers, "mean_color", counted)
    found = scene_constants(names)
    assert len(taken) == len(names)
    np.testing.assert_allclose(found.values["base_color"], np.repeat(np.array(GREYS)[:, None], 3, axis=1), atol=1e-6)
    assert {name: mask.tolist() for name, mask in found.varies.items()} == {
        **dict.fromkeys(("roughness", "metallic", "specular"), [False] * 3),
        "base_color": [True] * 3,
    }
    assert BlenderServices().reflectance_varies(names) is True
    assert len(taken) == len(names)  # what varies is told by the nodes alone


def test_what_is_plain_does_not_vary() -> None:
    empty_file()
    item = bpy.data.materials.new("Plain")
    item.use_nodes = True
    assert BlenderServices().reflectance_varies([item.name]) is False
