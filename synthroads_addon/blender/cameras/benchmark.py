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
        request: the scan whose images are rendered, whatever source of colours it names.
        count: number of images, roughly: views are taken at equal steps of the list.
    """
    request = replace(request, settings=replace(request.settings, source="images"))
    all_views = image_views(request)
    views = all_views[:: max(1, len(all_views) // count)]
    stamps: list[float] = []

    def pick_views(_: list[View]) -> list[View]:
        return [views[0], *views]

    def record_time(_: float) -> None:
        stamps.append(time.perf_counter())

    with layer_source(replace(request, pick=pick_views), progress=record_time):
        layer_seconds = stamps[-1] - stamps[0]
    pixels = sum(view.pixels for view in views) / 1e6
    rates = {"ours": pixels / layer_seconds, "floor": pixels / _bare_seconds(request, views)}
    return {"name": "rendering, all layers; Cycles, the picture alone", "unit": "million samples/s", **rates}


def _bare_seconds(request: LayerRequest, views: list[View]) -> float:
    """Render the picture alone of some views; return the wall-clock seconds it takes."""
    with daylight(request.environment, True) as day:
        passes = Passes((), lit=True)
        with stage(bpy.context.scene, (), passes, (day.sun,), None) as bare_stage:
            aim(bare_stage.camera, views[0])
            bare_stage.render(16, 16)  # the tree is built by the first image
            seconds = 0.0
            for view in views:
                aim(bare_stage.camera, view)
                seconds += seconds_of(partial(_render_picture, bare_stage, view))
    return seconds


def _render_picture(bare_stage: RenderStage, view: View) -> None:
    """Render one view without reading the picture back."""
    render = bare_stage.scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = *view.size, 100
    bpy.ops.render.render(scene=bare_stage.scene.name)
