"""Measurement of the benchmark in Blender: rendering beside bare rendering."""

from __future__ import annotations

import time
from dataclasses import replace
from functools import partial
from typing import Any

import bpy

from ...scanning.colour.request import LayerRequest
from ...scanning.colour.views import View
from ..model.measure import seconds_of
from . import image_views, layer_source
from .images import aim
from .light import daylight
from .stage import Passes, RenderStage, stage


def measure_rendering(request: LayerRequest, count: int) -> dict[str, Any]:
    """Render some images with all layers and with the picture alone; return both rates, million samples per second.

    Both are without what the first image costs, which brings the scene into the renderer.

    Args:
        request: whose images are rendered, whatever its colours come from.
        count: about so many of them.
    """
    request = replace(request, settings=replace(request.settings, source="images"))
    every = image_views(request)
    views = every[:: max(1, len(every) // count)]
    stamps: list[float] = []

    def pick(_: list[View]) -> list[View]:
        return [views[0], *views]

    def stamp(_: float) -> None:
        stamps.append(time.perf_counter())

    with layer_source(replace(request, pick=pick), progress=stamp):
        ours = stamps[-1] - stamps[0]
    pixels = sum(view.pixels for view in views) / 1e6
    rates = {"ours": pixels / ours, "floor": pixels / _bare_seconds(request, views)}
    return {"name": "rendering, all layers; Cycles, the picture alone", "unit": "million samples/s", **rates}


def _bare_seconds(request: LayerRequest, views: list[View]) -> float:
    """Render the picture alone of some views; return the wall-clock seconds it takes."""
    with daylight(request.environment, True) as day:
        passes = Passes((), lit=True)
        with stage(bpy.context.scene, (), passes, (day.sun,), None) as bare:
            aim(bare.camera, views[0])
            bare.render(16, 16)  # the tree is built by the first image
            seconds = 0.0
            for view in views:
                aim(bare.camera, view)
                seconds += seconds_of(partial(_render_picture, bare, view))
    return seconds


def _render_picture(bare: RenderStage, view: View) -> None:
    render = bare.scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = *view.size, 100
    bpy.ops.render.render(scene=bare.scene.name)
