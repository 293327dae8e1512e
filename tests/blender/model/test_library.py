"""The asset library: what stands in it, and that its bytes depend on nothing but the source."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import bpy
import pytest

from synthroads_addon.blender.model.library import catalogue_ids, user_groups
from synthroads_addon.blender.nodes.builder import CATALOGUES
from synthroads_addon.materials.table import materials
from tools.asset_library import PICTURES

ROOT = Path(__file__).resolve().parents[3]


def test_every_group_for_users_has_a_catalogue_a_picture_and_known_materials() -> None:
    names = {name for groups in CATALOGUES.values() for name in groups}
    assert len(names) > 25
    assert set(CATALOGUES) | {"SynthRoads"} == set(catalogue_ids())
    assert {path.stem for path in PICTURES.glob("*.png")} == names


@pytest.mark.slow
def test_usual_materials_are_in_the_table_and_all_are_given() -> None:
    for _, group in user_groups():
        usual = group.get("synthroads_materials", {})
        assert set(dict(usual).values()) <= set(materials()), group.name
        sockets = {
            item.name
            for item in group.interface.items_tree
            if item.item_type == "SOCKET" and item.socket_type == "NodeSocketMaterial"
        }
        assert group.name == "SR Strip" or sockets == set(dict(usual)), group.name


@pytest.mark.slow
def test_the_library_is_the_same_each_time_and_has_all_groups_as_assets(tmp_path: Path) -> None:
    files = [tmp_path / "first.blend", tmp_path / "second.blend"]
    for file in files:
        subprocess.run([sys.executable, ROOT / "tools" / "asset_library.py", file], check=True, capture_output=True)
    assert files[0].read_bytes() == files[1].read_bytes()
    with bpy.data.libraries.load(str(files[0]), assets_only=True) as (there, here):
        here.node_groups = list(there.node_groups)
    groups = here.node_groups
    assert {group.name for group in groups} == {name for names in CATALOGUES.values() for name in names}
    for group in groups:
        assert group.asset_data.catalog_id in catalogue_ids().values()
        assert tuple(group.preview.image_size) == (128, 128)
        assert not group.keys(), f"{group.name} would be taken for a group of a road that is built"
    rail = next(group for group in groups if group.name == "SR Guardrail")
    material = next(item for item in rail.interface.items_tree if item.name == "Material")
    assert material.default_value.name == "SR galvanised_steel"
