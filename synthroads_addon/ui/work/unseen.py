"""Building with the new road hidden until it is complete: to draw it after each step takes longer."""

from collections.abc import Generator, Iterator
from contextlib import closing
from typing import TypeVar

import bpy

from ...blender.model.stage import STAGING

T = TypeVar("T")


def build_unseen(steps: Generator[float | None, None, T]) -> Generator[float | None, None, T]:
    """Generator that runs a build's steps with its road evaluated but not drawn, and shows it at the end.

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
    """Hide the staging collections as the outliner's eye does; return their session numbers."""
    layers = [layer for layer in _layers() if STAGING in layer.collection and not layer.hide_viewport]
    for layer in layers:
        layer.hide_viewport = True  # `hide_viewport` of the collection itself would also keep it from being evaluated
    return {layer.collection.session_uid for layer in layers}


def _show(hidden: set[int]) -> None:
    """Show the collections of these session numbers again."""
    for layer in _layers():
        if layer.collection.session_uid in hidden:
            layer.hide_viewport = False


def _layers() -> Iterator[bpy.types.LayerCollection]:
    """Yield all layer collections of the current view layer."""
    waiting = [bpy.context.view_layer.layer_collection]
    while waiting:
        layer = waiting.pop()
        yield layer
        waiting += layer.children
