"""What the benchmark needs of Blender: time spent rendering, bare rendering, and the time that an edit takes."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any

import bpy

from ..core.colour_views import View
from ..core.parameters.model import RoadParameters, Vegetation
from .cameras.images import aim
from .cameras.light import daylight
from .cameras.stage import Passes, Stage, stage
from .compat import modifier_input, set_modifier_input
from .model import RoadModel

REPEATS = 3
"""Times that something is measured; the fastest counts, as other work on the machine only slows."""


def seconds_of(work: Callable[[], object]) -> float:
    """Return how long something takes, s."""
    begin = time.perf_counter()
    work()
    return time.perf_counter() - begin


class RenderClock:
    """Counts what is rendered, and the time that it takes, while it is entered."""

    def __init__(self) -> None:
        self.seconds, self.pixels = 0.0, 0

    def __enter__(self) -> RenderClock:
        self._render = Stage.render
        clock = self

        def timed(self: Stage, width: int, height: int) -> Any:
            begin = time.perf_counter()
            try:
                return clock._render(self, width, height)
            finally:
                clock.seconds += time.perf_counter() - begin
                clock.pixels += width * height

        Stage.render = timed  # type: ignore[method-assign]
        return self

    def __exit__(self, *_: object) -> None:
        Stage.render = self._render  # type: ignore[method-assign]


def rendering(clock: RenderClock, views: list[View], parameters: RoadParameters) -> dict[str, Any]:
    """Return the rendering of all layers beside that of nothing but the picture, of some of the same images."""
    with daylight(parameters.environment, True) as day:
        passes = Passes((), lit=True)
        with stage(bpy.context.scene, (), passes, (day.sun,), None) as bare:
            aim(bare.camera, views[0])
            bare.render(16, 16)  # the tree is built by the first image
            seconds = pixels = 0.0
            for view in views:
                aim(bare.camera, view)
                seconds += seconds_of(partial(_rendered, bare, view))
                pixels += view.pixels
    rates = {"ours": clock.pixels / clock.seconds / 1e6, "floor": pixels / seconds / 1e6}
    return {"name": "rendering, all layers; Cycles, the picture alone", "unit": "million samples/s", **rates, "rays": 0}


def _rendered(bare: Stage, view: View) -> None:
    render = bare.scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = *view.size, 100
    bpy.ops.render.render(scene=bare.scene.name)


def panel_edit(model: RoadModel, parameters: RoadParameters) -> float:
    """Return the seconds from a changed width to the updated view, vegetation hidden."""
    for name in parameters.of_type(Vegetation):
        if name in model.objects:
            model.objects[name].hide_viewport = True
    bpy.context.view_layer.update()
    road = model.objects["Road"]
    modifier = road.modifiers[0]
    side = "Left" if parameters.carriageway("left") else "Right"
    name, runs = f"{side} Lane 1 Width", []
    for change in (0.05, -0.05) * REPEATS:
        set_modifier_input(modifier, name, modifier_input(modifier, name) + change)
        road.update_tag()
        runs.append(seconds_of(bpy.context.view_layer.update))
    return sorted(runs)[len(runs) // 2]
