"""Blender's materials: they have the table's values, and those of foreign materials are read."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from synthroads_addon.blender.materials import PROPERTY, constants, material
from synthroads_addon.materials.table import materials
from synthroads_addon.scanning.scene.surface_values import SurfaceInput
from tests.helpers.scenes.cycles import calculator

PLACES = 4000
WEATHERED = (
    *("galvanised_steel", "gantry_steel", "barrier_concrete", "soil", "grass", "maple_bark", "maple_leaves"),
    *("sheeting_white", "sheeting_blue", "car_paint", "cabinet_grey"),
)
BLACK = ("rubber", "plastic_black", "sheeting_black")
"""Weathered ones whose specular is small, and varies in proportion."""
CLEAN = ("chrome", "lamp_red", "glass")
"""Materials whose roughness, specular and metallic are the table's everywhere."""


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


def test_layers_vary_around_the_tables_values() -> None:
    rng = np.random.default_rng(3)
    place = np.column_stack([rng.uniform(-40.0, 40.0, (PLACES, 3)), np.ones(PLACES)]).astype(np.float32)
    ones = np.ones((PLACES, 4), np.float32)
    names = dict(enumerate((*WEATHERED, *BLACK, *CLEAN)))
    with calculator({i: material(name) for i, name in names.items()}, ("roughness", "specular", "metallic")) as work:
        for i, name in names.items():
            feed = {what: place if what == SurfaceInput("position") else ones for what in work.inputs_of(i)}
            found = work.calculate(np.full(PLACES, i), feed)
            for layer, values in found.items():
                mean = getattr(materials()[name], layer)
                assert values.mean() == pytest.approx(mean, abs=0.01), (name, layer)
                varies = name not in CLEAN and (layer != "metallic" or 0.0 < mean < 1.0)
                least = 0.05 * mean if name in BLACK and layer == "specular" else 0.02
                assert (least if varies else 0.0) <= values.std() < (0.08 if varies else 1e-6), (name, layer)


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
