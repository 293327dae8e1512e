"""Painted areas: hatching of gores, and arrows."""

from __future__ import annotations

from collections.abc import Iterator

import bpy
import numpy as np
from numpy.typing import NDArray

from ...base.stepper import aside
from ...road.paint import arrow_outlines, hatching_outlines, pieces
from ...road.parameters import Arrow, Hatching
from ..materials import material
from ..things.meshes import attribute, fill_polygons, signed
from ..things.model_builder import ModelBuilder
from ..things.painted_area import painted_area_group

_LONGEST = 1.0
"""Outlines are cut into pieces no longer than this (m), so that they follow the road's curves and its crossfall."""


def build_painted_areas(builder: ModelBuilder) -> None:
    """Make all painted areas as one object."""
    outlines = aside(lambda: list(_outlines(builder)))
    if not outlines:
        return
    polygons = [polygon for polygon, _ in outlines]
    sizes = [len(polygon) for polygon in polygons]
    mesh = bpy.data.meshes.new("SR Painted Areas")
    corners = np.concatenate(polygons)
    fill_polygons(mesh, np.column_stack([corners - [builder.zero, 0.0], np.zeros(len(corners))]), sizes)
    items = [item for _, item in outlines]
    attribute(mesh, "film", np.repeat([item.film_thickness for item in items], sizes))
    attribute(mesh, "yellow", np.repeat([float(item.color == "yellow") for item in items], sizes))
    attribute(mesh, "instance", np.repeat(signed([item.instance for item in items]), sizes))
    inputs = {
        "Backbone": builder.objects["Backbone"],
        "Road": builder.objects["Road"],
        "Material": material("paint_white"),
        "Yellow Material": material("paint_yellow"),
    }
    builder.add("Painted Areas", mesh, painted_area_group(), inputs)


def _outlines(builder: ModelBuilder) -> Iterator[tuple[NDArray[np.float64], Hatching | Arrow]]:
    # Of the whole road, as an area may reach over the end of the stretch.
    road = builder.geometry.parameters
    for hatching in road.of_type(Hatching).values():
        for outline in hatching_outlines(builder.geometry, hatching):
            yield from ((piece, hatching) for piece in _pieces(outline, *builder.stretch))
    for arrow in road.of_type(Arrow).values():
        for outline in arrow_outlines(arrow):
            yield from ((piece, arrow) for piece in _pieces(outline, *builder.stretch))


def _pieces(outline: NDArray[np.float64], start: float, end: float) -> Iterator[NDArray[np.float64]]:
    """Cut a convex outline (K, 2) into pieces that are short along the road; yield what of them is on a stretch."""
    low, high = outline[:, 0].min(), outline[:, 0].max()
    if low < high and low < end and high > start:
        borders = np.linspace(low, high, int(np.ceil((high - low) / _LONGEST)) + 1)
        # Its two ends are borders as well: all other pieces are those of the whole outline.
        inside = borders[(borders > start) & (borders < end)]
        yield from pieces(outline, np.array([max(low, start), *inside, min(high, end)]))
