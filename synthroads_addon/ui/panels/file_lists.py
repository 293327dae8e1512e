"""Buttons that lengthen and shorten a list of files.

Annotations are not postponed here: Blender reads the properties from them.
"""

import bpy

from ..fields.drawing import ADD_FILE, REMOVE_FILE, owner_of


class SYNTHROADS_OT_add_file(bpy.types.Operator):
    """Add a file to the list"""

    bl_idname = ADD_FILE
    bl_label = "Add File..."
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012 (Blender reads a plain set)

    path: bpy.props.StringProperty(options={"HIDDEN"})
    filepath: bpy.props.StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})
    filter_glob: bpy.props.StringProperty(default="*.json", options={"HIDDEN"})

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Open the file browser."""
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Add the file."""
        settings = context.scene.synthroads
        getattr(owner_of(settings, self.path), self.path.rpartition(".")[2]).add().file = self.filepath
        return {"FINISHED"}


class SYNTHROADS_OT_remove_file(bpy.types.Operator):
    """Take this file off the list; the file itself stays"""

    bl_idname = REMOVE_FILE
    bl_label = "Remove File"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012

    path: bpy.props.StringProperty(options={"HIDDEN"})
    number: bpy.props.IntProperty(options={"HIDDEN"})

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Remove it."""
        settings = context.scene.synthroads
        getattr(owner_of(settings, self.path), self.path.rpartition(".")[2]).remove(self.number)
        return {"FINISHED"}


CLASSES = (SYNTHROADS_OT_add_file, SYNTHROADS_OT_remove_file)
