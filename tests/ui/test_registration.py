"""Registering the add-on: nothing of it is left over afterwards."""

import bpy

import synthroads_addon
from synthroads_addon.ui.translations import blender as translations
from tests.helpers.scenes.panel_road import settings

__all__ = ["settings"]

OF_FILE_BROWSER = {"filter_glob", "filter_folder", "check_existing"}
"""Hidden properties that Blender's file browser reads, by its own identifiers."""


def traces() -> tuple[set[str], list[str], bool]:
    names = {name for name in dir(bpy.types) if "synthroads" in name.lower()}
    owners = (bpy.types.Scene, bpy.types.WindowManager)
    return names, dir(bpy.ops.synthroads), any("synthroads" in name for owner in owners for name in dir(owner))


def test_registering_twice_leaves_no_trace() -> None:
    synthroads_addon.unregister()
    assert traces() == (set(), [], False)
    for _ in range(2):
        synthroads_addon.register()
        assert traces()[2]
        assert {"build", "cancel", "scan", "compare_intensities", "check_rules", "show_cloud"} <= set(traces()[1])
        synthroads_addon.unregister()
        assert traces() == (set(), [], False)
    synthroads_addon.register()


def test_every_property_has_a_name() -> None:
    """Blender shows a property's identifier where it has no name: in tooltips, keymaps, drivers and animation."""
    nameless = []
    for cls in translations._classes():
        is_operator = issubclass(cls, bpy.types.Operator)
        operator = getattr(bpy.ops.synthroads, cls.__name__.partition("_OT_")[2]) if is_operator else None
        rna = operator.get_rna_type() if operator else cls.bl_rna
        for name, item in rna.properties.items():
            if translations._annotated(cls, name) and name not in OF_FILE_BROWSER:
                # A type of thing that is one word, as Gantry, is its own name.
                nameless += [f"{cls.__name__}.{name}"] if not item.name[:1].isupper() or "_" in item.name else []
    assert nameless == []
    for owner in (bpy.types.Scene, bpy.types.WindowManager):
        names = [item.name for name, item in owner.bl_rna.properties.items() if name.startswith("synthroads")]
        assert names
        assert [name for name in names if not name.startswith("SynthRoads")] == []
