"""Helpers that panels and operators share: layout, conditions under which an operator may run, error messages."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from functools import wraps
from types import MappingProxyType
from typing import Any

import bpy

from ...base.errors import InputError, MissingPackageError
from ...blender.model.store import find_road
from ..fields.sheets import with_panel_labels
from ..translations.blender import said
from .job import running_job

RUNS_AS_EXTENSION = str(__package__).startswith("bl_ext.")
"""Whether Blender has installed this as an extension, which brings its packages with it: there is no pip."""
IN_BLENDER = {
    "twin": "needs the extension SynthRoads IFC: Output > Export installs its zip, which is beside this extension's",
    "e57": "can't be used in the extension: the command synthroads cloud convert converts it to LAZ, and LAZ to it",
    "maps": "can't be read in Blender: the command synthroads road makes a parameter set of it, for Load Set",
    "changes": "can only be used by the command synthroads changes, outside of Blender",
    "cluster": "can only be used by the command synthroads dataset, outside of Blender",
}
"""Sentences in Blender about a package that is missing, by the extra that brings it elsewhere."""


class Sidebar:
    """Mixin of panels that places them in the 3D view's sidebar."""

    bl_category = "SynthRoads"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"


def column(panel: bpy.types.Panel) -> bpy.types.UILayout:
    """Return a panel's layout, set to draw names to the left of values."""
    layout = panel.layout
    layout.use_property_split = True
    layout.use_property_decorate = False
    return layout


def large_button(layout: bpy.types.UILayout) -> bpy.types.UILayout:
    """Return a new row with a taller button, for a panel's main action."""
    row = layout.row()
    row.scale_y = 1.4
    return row


def right_label(layout: bpy.types.UILayout, text: str) -> None:
    """Draw a text aligned to the right in the rest of a row."""
    row = layout.row()
    row.alignment = "RIGHT"
    row.label(text=text)


def is_free(operator: type[bpy.types.Operator], context: bpy.types.Context) -> bool:
    """Return whether long work may begin, for an operator's `poll`; else set its tooltip to the reason."""
    job = running_job()
    if job is not None:
        operator.poll_message_set(said(f"{job.title} is still running"))
        return False
    if context.mode != "OBJECT":
        operator.poll_message_set(said("Switch to Object Mode first"))
        return False
    return True


def has_road(operator: type[bpy.types.Operator], context: bpy.types.Context) -> bool:
    """Return whether the scene has a road, for an operator's `poll`; else set its tooltip to the reason."""
    if find_road(context.scene) is None:
        operator.poll_message_set(said("Build a road first"))
    return find_road(context.scene) is not None


Execute = Callable[[Any, bpy.types.Context], set[str]]
"""An operator's `execute`."""


def refusing(execute: Callable[[Any, bpy.types.Context], None]) -> Execute:
    """Decorate an operator's `execute` to return FINISHED, or to report an `InputError` and return CANCELLED."""

    @wraps(execute)
    def execute_or_refuse(self: bpy.types.Operator, context: bpy.types.Context) -> set[str]:
        try:
            execute(self, context)
        except InputError as error:
            return refuse(self, error)
        return {"FINISHED"}

    return execute_or_refuse


def refuse(operator: bpy.types.Operator, error: InputError) -> set[str]:
    """Report an error in the panel's words, see `panel_words`; return CANCELLED."""
    operator.report({"ERROR"}, panel_message(error, getattr(operator, "option_labels", {})))
    return {"CANCELLED"}


def panel_message(error: InputError, labels: Mapping[str, str] = MappingProxyType({})) -> str:
    """Return an input error's message in the window's language and the panel's words.

    Labels of the panel stand instead of paths and of the command's options.

    Args:
        error: the error.
        labels: what an option is called where that isn't its own name with capitals.
    """
    if isinstance(error, MissingPackageError) and RUNS_AS_EXTENSION:
        error = InputError(error.field, error.value, IN_BLENDER[error.extra])
    return with_panel_labels(panel_words(_said_error(error), labels))


def _said_error(error: InputError) -> str:
    """Return an input error's message in the window's language; field and value stay."""
    message = str(error)
    if not message.endswith(f": {error.allowed}"):
        return said(message)
    head = message.removesuffix(f": {error.allowed}")
    if error.value is not None and (start := head.find(" is ")) > 0:
        head = f"{head[:start]} {said('is')} {head[start + 4 :]}"
    return f"{said(head)}: {said(error.allowed)}"


def panel_words(message: str, labels: Mapping[str, str] = MappingProxyType({})) -> str:
    """Return an error's message with the command line's options replaced by what the panel calls them.

    Args:
        message: one line.
        labels: what an option is called where that isn't its own name with capitals.
    """
    message = message.replace("--overwrite replaces it", said("tick Replace Files, or choose another folder"))

    def label(option: re.Match[str]) -> str:
        return said(labels.get(option[0]) or option[1].replace("-", " ").title())

    message = re.sub(r"(?<![\w-])--(?!allow-large)([a-z][a-z-]*)", label, message)
    return message.replace("--allow-large", said("the command's --allow-large"))


def redraw_sidebars(context: bpy.types.Context) -> None:
    """Tag the sidebars of all 3D views for redraw."""
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            for region in area.regions:
                if area.type == "VIEW_3D" and region.type == "UI":
                    region.tag_redraw()
