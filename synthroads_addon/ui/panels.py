"""The sidebar panel in the 3D view."""

from __future__ import annotations

import bpy

from .operators import STORED, SYNTHROADS_OT_build, SYNTHROADS_OT_scan


class SYNTHROADS_PT_main(bpy.types.Panel):
    """The panel that holds the others."""

    bl_label = "SynthRoads"
    bl_category = "SynthRoads"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"

    def draw(self, context: bpy.types.Context) -> None:
        """Show what everything starts from."""
        layout, settings = self.layout, context.scene.synthroads
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.prop(settings, "preset")
        layout.prop(settings, "fidelity")


class _SubPanel:
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_parent_id = "SYNTHROADS_PT_main"


class SYNTHROADS_PT_road(_SubPanel, bpy.types.Panel):
    """What the road is."""

    bl_label = "Road"

    def draw(self, context: bpy.types.Context) -> None:
        """Show the road's settings and its button."""
        layout, settings = self.layout, context.scene.synthroads
        layout.use_property_split = True
        layout.use_property_decorate = False
        for name in ("seed", "cross_section", "length"):
            layout.prop(settings, name)
        layout.operator(SYNTHROADS_OT_build.bl_idname, icon="MOD_BUILD")


class SYNTHROADS_PT_scanner(_SubPanel, bpy.types.Panel):
    """How it is scanned."""

    bl_label = "Scanner"

    def draw(self, context: bpy.types.Context) -> None:
        """Show the scanner's settings and its button."""
        layout, settings = self.layout, context.scene.synthroads
        layout.use_property_split = True
        layout.use_property_decorate = False
        for name in ("device", "height", "speed", "output"):
            layout.prop(settings, name)
        row = layout.row()
        row.scale_y = 1.3
        row.operator(SYNTHROADS_OT_scan.bl_idname, icon="LIGHT_AREA")
        if not context.scene.get(STORED):
            layout.label(text="Build a road first", icon="INFO")


CLASSES = (SYNTHROADS_PT_main, SYNTHROADS_PT_road, SYNTHROADS_PT_scanner)
