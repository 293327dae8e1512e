"""A scene as renders show it: settings of the viewport that differ from those of renders are changed for a moment.

Blender evaluates a scene for renders only inside of a render engine. So settings of the viewport (modifiers and levels
for renders only, shares of particles, hidden objects) are set to those of renders, the scene is read, and all settings
are restored.
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
"""Which state of a scene is scanned."""

_Setting: TypeAlias = tuple[Any, str, Any]
"""Owner, name of a property, and the value that renders have."""


@contextmanager
def shown_as(visible: Visible, scene: bpy.types.Scene, layer: bpy.types.ViewLayer) -> Iterator[bool]:
    """Context in which a scene's viewport shows what renders show; all settings are restored on exit.

    Args:
        visible: with ``viewport`` nothing is changed.
        scene, layer: the scene and its view layer.

    Yields:
        whether anything had to be changed.
    """
    changes = _ChangedSettings()
    try:
        if visible == "render":
            changes.show(scene, layer)
        yield bool(changes.undo)
    finally:
        changes.restore()
        if changes.is_restored:
            layer.update()


def is_seen(visible: Visible, item: bpy.types.Object, layer: bpy.types.ViewLayer) -> bool:
    """Return whether an object that is evaluated for a view layer is seen there: by cameras, or in the viewport."""
    if visible == "viewport":  # a collection's eye hides from the eye alone
        return bool(item.visible_get(view_layer=layer))
    return bool(item.visible_camera) and not item.indirect_only_get(view_layer=layer)


class _ChangedSettings:
    """Settings that were changed, with functions that restore them.

    Attributes:
        undo: functions that restore one setting each, in the order of the changes.
        is_restored: whether any setting was restored.
    """

    def __init__(self) -> None:
        self.undo: list[Callable[[], None]] = []
        self.is_restored = False

    def show(self, scene: bpy.types.Scene, layer: bpy.types.ViewLayer) -> None:
        """Change settings so that a scene's viewport shows what renders show."""
        for setting in _settings(scene):
            self._set(*setting)
        if layer.layer_collection is None:  # so it is in Blender 5.2 for a new scene of a script
            layer.update()
        for layer_collection in _layers(layer.layer_collection):
            self._set(layer_collection, "hide_viewport", False)
        for item in layer.objects:
            if SUPPORT not in item and item.hide_get(view_layer=layer):
                item.hide_set(False, view_layer=layer)
                self.undo.append(_Hidden(item.name, item.library, layer).hide)
        if self.undo:
            layer.update()

    def _set(self, owner: Any, name: str, value: Any) -> None:
        """Change a property; mute what animates it, which would set it again; note how to restore both."""
        original = getattr(owner, name)
        if original == value:
            return
        for curve in _curves(owner, name):
            _assign(curve, "mute", True)
            self.undo.append(partial(_assign, curve, "mute", False))
        _assign(owner, name, value)
        self.undo.append(partial(_assign, owner, name, original))

    def restore(self) -> None:
        """Restore all settings, the latest change first."""
        while self.undo:
            self.undo.pop()()
            self.is_restored = True


def _assign(owner: Any, name: str, value: Any) -> None:
    """Set a property, and tag its owner for evaluation, which Blender doesn't do for all properties itself."""
    setattr(owner, name, value)
    owner.id_data.update_tag()


@dataclass(frozen=True)
class _Hidden:
    """An object that a view layer's eye hides."""

    name: str
    library: bpy.types.Library | None
    layer: bpy.types.ViewLayer

    def hide(self) -> None:
        """Hide the object again, if it still exists."""
        item = self.layer.objects.get(self.name)
        if item is not None and item.library != self.library:
            item = next(
                (other for other in self.layer.objects if (other.name, other.library) == (self.name, self.library)),
                None,
            )
        if item is not None:
            item.hide_set(True, view_layer=self.layer)


def _settings(scene: bpy.types.Scene) -> Iterator[_Setting]:
    """Yield the viewport's settings that correspond to settings of renders."""
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
    """Yield the settings of an object and its modifiers."""
    yield item, "hide_viewport", item.hide_render
    yield item, "show_instancer_for_viewport", item.show_instancer_for_render
    for modifier in item.modifiers:
        yield modifier, "show_viewport", modifier.show_render
        if modifier.type in _OF_RENDERS:
            viewport_name, render_name = _OF_RENDERS[modifier.type]
            yield modifier, viewport_name, getattr(modifier, render_name)


def _of_data() -> Iterator[_Setting]:
    """Yield the settings of data that objects share: particles, curves, metaballs, node groups."""
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
            # A muted node "Is Viewport" gives no, as in renders.
            yield from ((node, "mute", True) for node in group.nodes if node.bl_idname == "GeometryNodeIsViewport")


_OF_RENDERS = {"SUBSURF": ("levels", "render_levels"), "MULTIRES": ("levels", "render_levels")}
_OF_RENDERS |= {"SCREW": ("steps", "render_steps"), "OCEAN": ("viewport_resolution", "resolution")}
"""Modifiers' settings for the viewport and for renders, by type."""


def _of_curve(curve: bpy.types.Curve) -> Iterator[_Setting]:
    """Yield the resolutions of a curve, a surface or a text; 0 for renders means the viewport's resolution."""
    if not isinstance(curve, bpy.types.Curve):
        return
    for direction in ("u", "v"):
        if render_resolution := getattr(curve, f"render_resolution_{direction}"):
            for spline in curve.splines:
                yield spline, f"resolution_{direction}", render_resolution
            if isinstance(curve, bpy.types.TextCurve):
                yield curve, f"resolution_{direction}", render_resolution


def _layers(layer: bpy.types.LayerCollection) -> Iterator[bpy.types.LayerCollection]:
    """Yield all collections below a view layer's collection."""
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
