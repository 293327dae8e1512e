"""Registering the add-on: nothing of it is left over afterwards."""

import bpy

import synthroads_addon
from tests.helpers.scenes.panel_road import settings

__all__ = ["settings"]


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
