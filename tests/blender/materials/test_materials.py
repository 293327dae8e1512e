"""Blender's materials: they have the table's values, and those of foreign materials are read."""

from __future__ import annotations

import bpy
import pytest

from synthroads_addon.blender.materials import PROPERTY, constants, material
from synthroads_addon.materials.table import materials


def test_blender_materials_have_the_tables_values() -> None:
    for name, row in materials().items():
        item = material(name)
        assert material(name) == item
        assert item[PROPERTY] == name
        node = next(node for node in item.node_tree.nodes if node.type == "BSDF_PRINCIPLED")
        assert node.inputs["Roughness"].default_value == pytest.approx(row.roughness)
        assert node.inputs["Metallic"].default_value == pytest.approx(row.metallic)
        assert node.inputs["Specular IOR Level"].default_value == pytest.approx(row.specular)
        assert tuple(item.diffuse_color)[:3] == pytest.approx(row.base_color)


def test_constants_of_foreign_materials_are_read_from_their_shader() -> None:
    item = bpy.data.materials.new("Car")
    if item.node_tree is None:
        item.use_nodes = True
    node = next(node for node in item.node_tree.nodes if node.type == "BSDF_PRINCIPLED")
    node.inputs["Base Color"].default_value = (0.5, 0.25, 0.125, 1.0)
    node.inputs["Metallic"].default_value = 1.0
    found = constants(["Car", "asphalt", "nobody's"])
    assert found["Car"].base_color == pytest.approx((0.5, 0.25, 0.125))
    assert found["Car"].metallic == 1.0
    assert found["asphalt"] == materials()["asphalt"]
    assert found["nobody's"] == materials()["unknown"]


def test_an_unknown_name_is_refused_with_the_nearest() -> None:
    with pytest.raises(KeyError, match="asphalt"):
        material("ashpalt")
