"""Painted areas, hatching and arrows: outlines in stations and offsets, laid on the pavement (SR Painted Area)."""

from __future__ import annotations

from collections.abc import Iterator

import bpy
import numpy as np
from numpy.typing import NDArray

from ...base.classes import class_id
from ...base.stepper import run_aside
from ...road.paint import arrow_outlines, hatching_outlines, pieces
from ...road.section import Arrow, Hatching
from ..nodes import operations as op
from ..nodes.backbone import height_on, look_up, station_ribbon
from ..nodes.builder import Tree, makes_group
from ..nodes.inputs import Inputs, backbone_socket, material_of, socket
from ..nodes.solids import paint_faces
from .meshes import attribute, fill_polygons, signed_instance
from .model_builder import ModelBuilder
from .registry import model_part

_LONGEST = 1.0
"""Outlines are cut into pieces no longer than this (m), so that they follow the road's curves and its crossfall."""


class _PaintedArea(Inputs):
    outlines = socket("Geometry", "Faces with x = station, y = offset")
    backbone = backbone_socket("Object")
    road = socket("Object", "Surface that is painted")
    material = material_of("the paint", "paint_white")
    yellow_material = material_of("temporary paint", "paint_yellow")


@makes_group("SR Painted Area")
def painted_area_group(tree: Tree) -> None:
    """Faces given by stations and offsets, laid on the pavement.

    Their points carry ``film`` (m), ``instance`` and ``yellow`` (0 or 1).
    """
    area = _PaintedArea(tree)

    with tree.frame("Place in plan"):
        ribbon = station_ribbon(op.object_geometry(area.backbone))
        station, offset = (op.component(op.position(tree), axis) for axis in ("X", "Y"))
        plan = look_up(ribbon, "axis", station) + look_up(ribbon, "left", station) * offset
    with tree.frame("On the pavement"):
        surface = op.object_geometry(area.road)
        height = height_on(surface, surface, plan) + op.named_attribute(tree, "film")
        flat = plan * (1.0, 1.0, 0.0)
        mesh = op.set_position(area.outlines, flat + op.vector(tree, 0.0, 0.0, height))
    with tree.frame("Labels"):
        mesh = op.label(mesh, class_id("road_marking"), op.named_attribute(tree, "instance", "INT"), area.material)
        temporary = op.named_attribute(tree, "yellow") > 0.5
        mesh = paint_faces(mesh, area.yellow_material, temporary)
    tree.output("Mesh", mesh, description="Paint whose faces look up")


@model_part("painted_areas", 30, on_the_road=True)
def build_painted_areas(builder: ModelBuilder) -> None:
    """Make all painted areas as one object."""
    outlines = run_aside(lambda: list(_outlines(builder)))
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
    attribute(mesh, "instance", np.repeat(signed_instance([item.instance for item in items]), sizes))
    builder.add("Painted Areas", mesh, painted_area_group())


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
