"""A scene as a render shows it, in place of how its viewport does: settings that differ are changed for a moment.

Blender evaluates for renders only inside of a render engine. So what the viewport shows otherwise (modifiers and levels
for renders only, particles shown in part, objects hidden here and not there) is set as the render has it, the scene is
read, and all is put back.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal, TypeAlias

import bpy

from ..things.model_builder import SUPPORT

Visible = Literal["render", "viewport"]
"""Whose state of a scene is scanned."""

_Setting: TypeAlias = tuple[Any, str, Any]
"""Owner, name of a property, and the value that renders have."""


@contextmanager
def shown_as(visible: Visible, scene: bpy.types.Scene, layer: bpy.types.ViewLayer) -> Iterator[bool]:
    """Context in which a scene's viewport shows what renders do; afterwards it is as it was, whatever happens.

    Args:
        visible: with ``viewport`` nothing is changed.
        scene, layer: the scene and its view layer.

    Yields:
        whether anything had to be changed.
    """
    changes = _Changed()
    try:
        if visible == "render":
            changes.show(scene, layer)
        yield bool(changes.undo)
    finally:
        changes.put_back()
        if changes.undo_done:
            layer.update()


def is_seen(visible: Visible, item: bpy.types.Object, layer: bpy.types.ViewLayer) -> bool:
    """Return whether an object that is evaluated for a view layer is seen there: by cameras, or in the viewport."""
    if visible == "viewport":  # a collection's eye hides from the eye alone
        return bool(item.visible_get(view_layer=layer))
    return bool(item.visible_camera) and not item.indirect_only_get(view_layer=layer)


class _Changed:
    """Settings that were changed, and how each is put back.

    Attributes:
        undo: functions that put one back, in the order of the changes.
        undo_done: whether anything was put back.
    """

    def __init__(self) -> None:
        self.undo: list[Callable[[], None]] = []
        self.undo_done = False

    def show(self, scene: bpy.types.Scene, layer: bpy.types.ViewLayer) -> None:
        """Have a scene's viewport show what renders do."""
        for setting in _settings(scene):
            self._set(*setting)
        if layer.layer_collection is None:  # in Blender 5.2, of a scene that a script has made and nobody looked at
            layer.update()
        for below in _layers(layer.layer_collection):
            self._set(below, "hide_viewport", False)
        for item in layer.objects:
            if SUPPORT not in item and item.hide_get(view_layer=layer):
                item.hide_set(False, view_layer=layer)
                self.undo.append(_Hidden(item.name, item.library, layer).hide)
        if self.undo:
            layer.update()

    def _set(self, owner: Any, name: str, value: Any) -> None:
        before = getattr(owner, name)
        if before == value:
            return
        for curve in _curves(owner, name):
            _assign(curve, "mute", True)
            self.undo.append(partial(_assign, curve, "mute", False))
        _assign(owner, name, value)
        self.undo.append(partial(_assign, owner, name, before))

    def put_back(self) -> None:
        """Put all back as it was."""
        while self.undo:
            self.undo.pop()()
            self.undo_done = True


def _assign(owner: Any, name: str, value: Any) -> None:
    """Set a property, and have what depends on it evaluated anew: not all of them see to that by themselves."""
    setattr(owner, name, value)
    owner.id_data.update_tag()


@dataclass(frozen=True)
class _Hidden:
    """An object that a view layer's eye hides."""

    name: str
    library: bpy.types.Library | None
    layer: bpy.types.ViewLayer

    def hide(self) -> None:
        """Hide it again."""
        item = self.layer.objects.get(self.name)
        if item is not None and item.library != self.library:
            item = next(
                (one for one in self.layer.objects if (one.name, one.library) == (self.name, self.library)), None
            )
        if item is not None:
            item.hide_set(True, view_layer=self.layer)


def _settings(scene: bpy.types.Scene) -> Iterator[_Setting]:
    """Yield the settings of the viewport that stand for others of renders."""
    if scene.render.use_simplify:
        yield scene.render, "simplify_subdivision", scene.render.simplify_subdivision_render
        yield scene.render, "simplify_child_particles", scene.render.simplify_child_particles_render
    for collection in bpy.data.collections:
        yield collection, "hide_viewport", collection.hide_render
    for item in bpy.data.objects:
        if SUPPORT not in item:
            yield from _of_object(item)
    yield from _of_data()


def _of_object(item: bpy.types.Object) -> Iterator[_Setting]:
    yield item, "hide_viewport", item.hide_render
    yield item, "show_instancer_for_viewport", item.show_instancer_for_render
    for modifier in item.modifiers:
        yield modifier, "show_viewport", modifier.show_render
        if modifier.type in _OF_RENDERS:
            here, there = _OF_RENDERS[modifier.type]
            yield modifier, here, getattr(modifier, there)


def _of_data() -> Iterator[_Setting]:
    """Yield the settings of what objects share."""
    for particles in bpy.data.particles:
        yield particles, "display_percentage", 100
        yield particles, "child_percent", particles.rendered_child_count
        yield particles, "display_step", particles.render_step
        yield particles, "display_method", "RENDER"
    for curve in bpy.data.curves:
        yield from _of_curve(curve)
    for ball in bpy.data.metaballs:
        yield ball, "resolution", ball.render_resolution
    for group in bpy.data.node_groups:
        if group.bl_idname == "GeometryNodeTree":
            # Without an input of its own the node says no where it is muted.
            yield from ((node, "mute", True) for node in group.nodes if node.bl_idname == "GeometryNodeIsViewport")


_OF_RENDERS = {"SUBSURF": ("levels", "render_levels"), "MULTIRES": ("levels", "render_levels")}
_OF_RENDERS |= {"SCREW": ("steps", "render_steps"), "OCEAN": ("viewport_resolution", "resolution")}
"""Modifiers' settings for the viewport and for renders, by type."""


def _of_curve(curve: bpy.types.Curve) -> Iterator[_Setting]:
    """Yield the resolutions of a curve, a surface or a text; its own for renders is 0 where there is none."""
    if not isinstance(curve, bpy.types.Curve):
        return
    for along in ("u", "v"):
        if finer := getattr(curve, f"render_resolution_{along}"):
            for spline in curve.splines:
                yield spline, f"resolution_{along}", finer
            if isinstance(curve, bpy.types.TextCurve):
                yield curve, f"resolution_{along}", finer


def _layers(layer: bpy.types.LayerCollection) -> Iterator[bpy.types.LayerCollection]:
    for child in layer.children:
        yield child
        yield from _layers(child)


def _curves(owner: Any, name: str) -> Iterator[Any]:
    """Yield the unmuted drivers and animation curves of a property, which would set it again."""
    animation = getattr(owner.id_data, "animation_data", None)
    if animation is None:
        return
    path = name if isinstance(owner, bpy.types.ID) else f"{owner.path_from_id()}.{name}"
    curves = list(animation.drivers)
    if animation.action is not None:
        curves += list(_action_curves(animation.action))
    yield from (curve for curve in curves if curve.data_path == path and not curve.mute)


def _action_curves(action: bpy.types.Action) -> Iterator[Any]:
    """Yield an action's curves, which since Blender 5.0 are found in its layers alone."""
    if hasattr(action, "fcurves"):
        yield from action.fcurves
        return
    for layer in action.layers:
        for strip in layer.strips:
            for bag in strip.channelbags:
                yield from bag.fcurves
