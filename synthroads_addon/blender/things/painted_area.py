"""Areas on the pavement with outlines in stations and offsets: SR Painted Area, SR Damaged Area."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import chain
from typing import NamedTuple, TypeVar

import bpy
import numpy as np
from numpy.typing import NDArray

from ...base.classes import class_id
from ...base.turns.stepper import run_aside
from ...road.paint import cut_outline
from ...road.pavement.cover import MarkingFilms, painted_outlines
from ...road.pavement.field import (
    OPEN_CRACK,
    PAINT_AREA,
    PAINT_IN_LANE,
    PATCH,
    REMOVED_MARKING,
    SEALED_CRACK,
    damage_code,
    place_code,
)
from ...road.pavement.outlines import (
    CRACK_FILM,
    PATCH_FILM,
    REMOVED_FILM,
    crack_outlines,
    patch_outline,
    removed_outlines,
)
from ...road.pavement.places import pavement_places
from ...road.section import ASPHALTS, CONCRETES, Arrow, Carriageway, Crack, Hatching, Pavement, RemovedMarking
from ..nodes import operations as op
from ..nodes.backbone import height_on, look_up, station_ribbon
from ..nodes.builder import Tree, Value, makes_group
from ..nodes.inputs import Inputs, backbone_socket, material_of, socket
from ..nodes.solids import paint_faces
from .meshes import attribute, fill_polygons, signed_instance
from .model_builder import ModelBuilder
from .registry import model_part

T = TypeVar("T")
_LONGEST_PIECE = 1.0
"""Largest length of the pieces of an outline, m, so that they follow the road's curves and its crossfall; chosen."""
_MARGIN = 1.0
"""Distance along the road (m) by which an area may exceed its corners: more than a crack's band of at most 0.2 m."""


class _Outlines(Inputs):
    outlines = socket("Geometry", "Faces with x = station, y = offset")
    backbone = backbone_socket("Object")
    road = socket("Object", "Surface that they lie on")


class _Paint(Inputs):
    material = material_of("the paint", "paint_white")
    yellow_material = material_of("temporary paint", "paint_yellow")


@makes_group("SR Painted Area")
def painted_area_group(tree: Tree) -> None:
    """Faces given by stations and offsets, laid on the pavement.

    Their points carry ``film`` (m), ``instance``, ``yellow`` (0 or 1), and ``pavement`` and ``offset``, the place that
    the materials read.
    """
    outlines, paint = _Outlines(tree), _Paint(tree)
    mesh = _lay(outlines)
    with tree.frame("Labels"):
        mesh = op.label(mesh, class_id("road_marking"), op.named_attribute(tree, "instance", "INT"), paint.material)
        is_temporary = op.named_attribute(tree, "yellow") > 0.5
        mesh = paint_faces(mesh, paint.yellow_material, is_temporary)
    tree.output("Mesh", mesh, description="Paint whose faces look up")


_COURSES = (*ASPHALTS, *CONCRETES)
"""Pavements in the order of the attribute ``course``."""


class _Damage(Inputs):
    material = material_of("damage in asphalt concrete, and patches", "asphalt")
    stone_mastic_asphalt_material = material_of("damage in stone mastic asphalt", "stone_mastic_asphalt")
    porous_asphalt_material = material_of("damage in porous asphalt", "porous_asphalt")
    mastic_asphalt_material = material_of("damage in mastic asphalt", "mastic_asphalt")
    concrete_material = material_of("damage in concrete", "concrete")
    exposed_aggregate_concrete_material = material_of("damage in washed concrete", "exposed_aggregate_concrete")


@makes_group("SR Damaged Area")
def damaged_area_group(tree: Tree) -> None:
    """Patches, cracks and removed markings given by stations and offsets, laid on the pavement.

    Their points carry ``film`` (m), ``instance``, ``course`` (number of the pavement's kind), and ``pavement`` and
    ``offset``, the place that the materials read.
    """
    outlines, damage = _Outlines(tree), _Damage(tree)
    mesh = _lay(outlines)
    with tree.frame("Labels"):
        mesh = op.label(mesh, class_id("road"), op.named_attribute(tree, "instance", "INT"), damage.material)
        course = op.named_attribute(tree, "course")
        for number in range(1, len(_COURSES)):
            is_of_course = (course > number - 0.5) & (course < number + 0.5)
            mesh = paint_faces(mesh, damage.values[f"{_COURSES[number]}_material"], is_of_course)
    tree.output("Mesh", mesh, description="Pavement whose faces look up")


def _lay(area: _Outlines) -> Value:
    """Add nodes that lay outlines in station and offset on the road, each point its ``film`` (m) above it."""
    tree = area.tree
    with tree.frame("Place in plan"):
        ribbon = station_ribbon(op.object_geometry(area.backbone))
        station, offset = (op.component(op.position(tree), axis) for axis in ("X", "Y"))
        plan = look_up(ribbon, "axis", station) + look_up(ribbon, "left", station) * offset
    with tree.frame("On the pavement"):
        height = height_on(area.road, None, plan) + op.named_attribute(tree, "film")
        plan_place = plan * (1.0, 1.0, 0.0)
        return op.set_position(area.outlines, plan_place + op.vector(tree, 0.0, 0.0, height))


@model_part("painted_areas", 30, on_the_road=True)
def build_painted_areas(builder: ModelBuilder) -> None:
    """Add all hatchings and arrows to the model as one object; none if there are none."""
    outlines = run_aside(lambda: list(_outlines(builder)))
    if not outlines:
        return
    mesh, sizes = _polygons_mesh("SR Painted Areas", [polygon for polygon, _ in outlines], builder.zero)
    items = [item for _, item in outlines]
    attribute(mesh, "film", np.repeat([item.film_thickness for item in items], sizes))
    attribute(mesh, "yellow", np.repeat([float(item.color == "yellow") for item in items], sizes))
    attribute(mesh, "instance", np.repeat(signed_instance([item.instance for item in items]), sizes))
    attribute(mesh, "pavement", run_aside(lambda: _painted_places(builder, outlines)))
    builder.add("Painted Areas", mesh, painted_area_group())


def _painted_places(
    builder: ModelBuilder, outlines: list[tuple[NDArray[np.float64], Hatching | Arrow]]
) -> NDArray[np.float64]:
    """Return the attribute ``pavement`` (N, 3) at the corners of painted areas, one outline after the other."""
    road, result = builder.geometry.parameters, []
    for outline, item in outlines:
        carriageway = road.carriageway_of(item)
        section = builder.geometry.sections[carriageway.side]
        lane_distance = pavement_places(section, outline[:, 0], outline[:, 1]).across
        kind = PAINT_IN_LANE if isinstance(item, Arrow) else PAINT_AREA
        # A quarter is added, so that rounding can't change the code's whole part.
        code = place_code(kind, int(carriageway.side == "left")) + 0.25
        result.append(np.column_stack([outline[:, 0], lane_distance, np.full(len(outline), code)]))
    return np.concatenate(result)


@model_part("damaged_areas", 31, on_the_road=True)
def build_damaged_areas(builder: ModelBuilder) -> None:
    """Add patches, cracks and removed markings of the pavement to the model as one object; none if there are none."""
    areas = run_aside(lambda: list(_damaged(builder)))
    if not areas:
        return
    mesh, sizes = _polygons_mesh("SR Damaged Areas", [area.outline for area in areas], builder.zero)
    attribute(mesh, "film", np.repeat([area.film for area in areas], sizes))
    attribute(mesh, "course", np.repeat([float(area.course) for area in areas], sizes))
    attribute(mesh, "instance", np.repeat(signed_instance([area.instance for area in areas]), sizes))
    station = np.concatenate([area.outline[:, 0] for area in areas])
    code = np.repeat([area.code for area in areas], sizes)
    attribute(mesh, "pavement", np.column_stack([station, np.zeros(len(station)), code]))
    builder.add("Damaged Areas", mesh, damaged_area_group())


class _Area(NamedTuple):
    """A face of damage: outline (K, 2) in station and offset, film (m), instance, damage code, number of the course."""

    outline: NDArray[np.float64]
    film: float
    instance: int
    code: float
    course: int


def _damaged(builder: ModelBuilder) -> Iterator[_Area]:
    """Yield the faces of patches, cracks and removed markings on the stretch that is built."""
    geometry = builder.geometry
    # Of the whole road, as an area may reach over the end of the stretch.
    for name, carriageway in geometry.parameters.of_type(Carriageway).items():
        pavement = carriageway.pavement
        first_part, course = len(pavement.ruts) + len(pavement.potholes), _COURSES.index(pavement.kind)
        for part, patch in _on_stretch(builder, pavement.patches, first_part, lambda patch: patch.outline):
            instance, code = geometry.numbers.part(name, part)[1], damage_code(PATCH, patch.age)
            for piece in _pieces(patch_outline(patch), *builder.stretch):
                yield _Area(piece, PATCH_FILM, instance, code, 0)  # patches are asphalt, the first of `_COURSES`
        first_part += len(pavement.patches)
        films = MarkingFilms(geometry, carriageway.side)
        for part, crack in _on_stretch(
            builder, pavement.cracks, first_part, lambda crack: chain.from_iterable(crack.lines)
        ):
            instance, code = (
                geometry.numbers.part(name, part)[1],
                damage_code(SEALED_CRACK if crack.sealed else OPEN_CRACK),
            )
            legs = [piece for outline in crack_outlines(crack) for piece in _pieces(outline, *builder.stretch)]
            for piece, film in films.cut(legs):
                yield _Area(piece, film + CRACK_FILM, instance, code, _crack_course(crack, pavement))
        first_part += len(pavement.cracks)
        for part, marking in _on_stretch(builder, pavement.removed_markings, first_part, _ends):
            instance, code = geometry.numbers.part(name, part)[1], damage_code(REMOVED_MARKING)
            for outline in removed_outlines(marking, pavement, geometry.length):
                for piece in _pieces(outline, *builder.stretch):
                    yield _Area(piece, REMOVED_FILM, instance, code, course)


def _on_stretch(
    builder: ModelBuilder, items: Sequence[T], first_part: int, corners: Callable[[T], Iterable[tuple[float, float]]]
) -> Iterator[tuple[int, T]]:
    """Yield damages that can reach into the stretch that is built, each with its part's number.

    A long road has thousands of damages: without this choice each section would compute all of their outlines.

    Args:
        builder: builder of the stretch.
        items: the damages.
        first_part: number of the first one's part.
        corners: function from a damage to the stations and offsets, m, of its corners.
    """
    start, end = builder.stretch
    for part, item in enumerate(items, first_part):
        stations = [station for station, _ in corners(item)]
        if min(stations) < end + _MARGIN and max(stations) > start - _MARGIN:
            yield part, item


def _ends(marking: RemovedMarking) -> list[tuple[float, float]]:
    """Return the two ends of a removed marking, stations and offsets, m."""
    return [(marking.start_station, marking.offset), (marking.end_station, marking.offset)]


def _crack_course(crack: Crack, pavement: Pavement) -> int:
    """Return the number of a crack's course: asphalt for a sealed crack in concrete, else the pavement's own."""
    return 0 if crack.sealed and pavement.is_concrete else _COURSES.index(pavement.kind)


def _polygons_mesh(name: str, polygons: list[NDArray[np.float64]], zero: float) -> tuple[bpy.types.Mesh, list[int]]:
    """Create a mesh of outlines (K, 2) in station minus `zero` and offset, m; return it and the outlines' sizes.

    Its points keep the offset as an attribute.
    """
    sizes, corners = [len(polygon) for polygon in polygons], np.concatenate(polygons)
    mesh = bpy.data.meshes.new(name)
    fill_polygons(mesh, np.column_stack([corners - [zero, 0.0], np.zeros(len(corners))]), sizes)
    attribute(mesh, "offset", corners[:, 1])
    return mesh, sizes


def _outlines(builder: ModelBuilder) -> Iterator[tuple[NDArray[np.float64], Hatching | Arrow]]:
    """Yield (outline, item) of the pieces of hatchings and arrows on the stretch that is built."""
    # Of the whole road, as an area may reach over the end of the stretch.
    road = builder.geometry.parameters
    items: list[Hatching | Arrow] = [*road.of_type(Hatching).values(), *road.of_type(Arrow).values()]
    for item in items:
        for outline in painted_outlines(builder.geometry, item):
            yield from ((piece, item) for piece in _pieces(outline, *builder.stretch))


def _pieces(outline: NDArray[np.float64], start: float, end: float) -> Iterator[NDArray[np.float64]]:
    """Yield the pieces, 1 m long at most, of a convex outline (K, 2) between two stations, m."""
    if len(outline) < 3:  # a patch with collinear corners
        return
    first_station, last_station = outline[:, 0].min(), outline[:, 0].max()
    if first_station < last_station and first_station < end and last_station > start:
        borders = np.linspace(
            first_station, last_station, int(np.ceil((last_station - first_station) / _LONGEST_PIECE)) + 1
        )
        # Borders depend on the whole outline only, so that neighbouring stretches have the same pieces.
        inner_borders = borders[(borders > start) & (borders < end)]
        yield from cut_outline(outline, np.array([max(first_station, start), *inner_borders, min(last_station, end)]))
