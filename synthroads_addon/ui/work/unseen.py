"""A road that grows unseen: drawing it after each step takes far longer than building it."""

from collections.abc import Generator, Iterator
from contextlib import closing
from typing import TypeVar

import bpy

from ...blender.model.stage import STAGING

T = TypeVar("T")


def build_unseen(steps: Generator[float | None, None, T]) -> Generator[float | None, None, T]:
    """Pass on the steps of a build whose road is shown at the end; until then Blender evaluates it, but draws nothing.

    Args:
        steps: see `build_steps`.
    """
    hidden: set[int] = set()
    with closing(steps):
        while True:
            try:
                share = next(steps)
            except StopIteration as end:
                _show(hidden)
                return end.value
            hidden |= _hide()
            yield share


def _hide() -> set[int]:
    """Hide what is being built as the eye in the outliner does; return Blender's numbers of the collections."""
    found = [layer for layer in _layers() if STAGING in layer.collection and not layer.hide_viewport]
    for layer in found:
        layer.hide_viewport = True  # `hide_viewport` of the collection itself would also keep it from being evaluated
    return {layer.collection.session_uid for layer in found}


def _show(hidden: set[int]) -> None:
    """Show the collections that were hidden and have become the road's."""
    for layer in _layers():
        if layer.collection.session_uid in hidden:
            layer.hide_viewport = False


def _layers() -> Iterator[bpy.types.LayerCollection]:
    """Yield every collection of the view layer at work."""
    waiting = [bpy.context.view_layer.layer_collection]
    while waiting:
        layer = waiting.pop()
        yield layer
        waiting += layer.children
