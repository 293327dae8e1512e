"""SR Carriageway: pavement and verge of one side from their widths, and the heights of what lies on it."""

from __future__ import annotations

from functools import partial

import bpy

from ....base.classes import class_id
from ....road.pavement.field import CODES, HALF_UNIT
from ....road.pavement.places import strip_lanes
from ...nodes import operations as op
from ...nodes.axis import rows_along
from ...nodes.builder import Node, Operand, Tree, Value, makes_group, node_group, offer_group
from ...nodes.inputs import (
    Input,
    Inputs,
    backbone_socket,
    boolean,
    inputs_class,
    instance_number,
    integer,
    material_of,
    metres,
    number,
    socket,
)
from ...nodes.strip import StripFaces, strip_group
from .layout import STREET_NAMES, TURNOUT_NAMES, aged_strips, brightness_field, detail_field, strips_of, width_field
from .section import CROSSFALL, FAR_FROM_AXIS, RAMP_FIELDS, Ramp, Section, height_group
from .streets import StreetInputs, field_of

_UNPAVED = ("Verge", "Island")
_WIDTHS = {"Inner Edge Strip": 0.5, "Outer Edge Strip": 0.5, "Hard Shoulder": 2.5, "Verge": 1.5}
_LANE = 3.5
"""Default width of a lane, m."""
_CONTRAST = (-1.0, 4.0)
"""Limits of the brightness by age, as a share."""


class _CarriagewayStrip(Inputs):
    backbone = backbone_socket()
    inner_distance = metres(5.0, FAR_FROM_AXIS, "Distance of its inner edge from the axis")
    outer_distance = metres(9.0, FAR_FROM_AXIS, "Distance of its outer edge from the axis")


@makes_group("SR Carriageway Strip")
def carriageway_strip_group(tree: Tree) -> None:
    """A strip of a carriageway between two distances from the axis, which may be fields on the backbone's points."""
    strip, section, faces = _CarriagewayStrip(tree), Section(tree), StripFaces(tree)
    with tree.frame("Both edges: outwards is to the left on the left side"):
        inner_distance, outer_distance = strip.inner_distance, strip.outer_distance
        left_edge = tree.call(
            height_group(), **section.values, distance=op.switch(section.left_side, inner_distance, outer_distance)
        )
        right_edge = tree.call(
            height_group(), **section.values, distance=op.switch(section.left_side, outer_distance, inner_distance)
        )
    with tree.frame("Strip"):
        mesh = tree.call(
            strip_group(),
            backbone=strip.backbone,
            left_offset=left_edge["Offset"],
            right_offset=right_edge["Offset"],
            left_height=left_edge["Height"],
            right_height=right_edge["Height"],
            **faces.values,
        ).value
    tree.output("Mesh", mesh, description="Ribbon whose faces look up")


class _PavementPlace(Inputs):
    strip = socket("Geometry", "A strip of the pavement")
    backbone = backbone_socket()
    inner_distance = metres(
        5.0, FAR_FROM_AXIS, "Distance from the axis of the inner edge of the lane that it was paved with"
    )
    outer_distance = metres(9.0, FAR_FROM_AXIS, "Distance of that lane's outer edge")
    kind = integer(0, (0, 64), "What the strip is: 1 the outermost lane, 9 the hard shoulder; 32 more on the left")
    first_station = metres(0.0, (-1e6, 1e6), "Station that the backbone's stations count from")
    slab_length = metres(5.0, (2.0, 20.0), "Distance of a concrete pavement's joints")
    joint_depth = metres(0.002, (0.0, 0.05), "Depth of joints below the pavement")
    wheel_track_depth = metres(0.003, (0.0, 0.02), "Depth of the outermost lane's wheel tracks")
    brightness = number(0.0, _CONTRAST, "By how much it is brighter for its age than its material, as a share")


@makes_group("SR Pavement Place")
def pavement_place_group(tree: Tree) -> None:
    """A strip of pavement whose points know where they lie on it, for the materials.

    The attribute ``pavement`` is the station, the distance from the lane's middle, a code of strip and lane's width;
    ``pavement_shape`` the slabs' length, the depths of joints and of wheel tracks; ``pavement_age`` by how much it is
    brighter for its age.
    """
    lane = _PavementPlace(tree)
    with tree.frame("Middle and half width of the lane at each row"):
        row_number = op.named_attribute(tree, "row", "INT")
        inner_edge, outer_edge = (
            op.sample_index(lane.backbone, value, row_number) for value in (lane.inner_distance, lane.outer_distance)
        )
        lane_distance = op.unary("ABSOLUTE", op.named_attribute(tree, "offset")) - (inner_edge + outer_edge) * 0.5
        code = (outer_edge - inner_edge) * (0.5 / HALF_UNIT) + lane.kind
    with tree.frame("Attributes that the materials read"):
        station = op.named_attribute(tree, "station") + lane.first_station
        mesh = op.store(lane.strip, "pavement", op.vector(tree, station, lane_distance, code))
        shape = op.vector(tree, lane.slab_length, lane.joint_depth, lane.wheel_track_depth)
        mesh = op.store(mesh, "pavement_shape", shape)
        mesh = op.store(mesh, "pavement_age", lane.brightness)
    tree.output("Mesh", mesh, description="The strip")


def carriageway_group(lanes: int, turnouts: bool = False, streets: int = 0) -> bpy.types.NodeTree:
    """Return the node group SR Carriageway for a number of lanes, with the strips of turnouts or of street sides."""
    name = f"SR Carriageway {lanes} Lane{'s' if lanes > 1 else ''}{' and Turnouts' if turnouts else ''}"
    if streets:
        name += f" and {streets} Street Side{'s' if streets > 1 else ''}"
        description = "Pavement, footway and verge of one side, live from their widths"
        return node_group(name, _build, lanes, turnouts, streets, description=description)
    description = "Pavement and verge of one side, live from their widths, which may be fields on the backbone's points"
    return node_group(name, _build, lanes, turnouts, description=description)


def width_fields(
    lanes: int, turnouts: bool = False, varying: tuple[str, ...] = (), streets: bool = False
) -> dict[str, Input]:
    """Return the input fields of a carriageway's strip widths, from the inner offset outwards, by field name."""
    inner_text = "Distance of the inner paved edge from the axis"
    texts = {"Inner Offset": inner_text} | {
        strip: f"Width of the {strip.lower()}" for strip in strips_of(lanes, turnouts, streets)
    }
    texts["Lane 1"] += "; 1 is the outermost lane"
    texts |= {strip: f"{texts[strip]}; the backbone says where there is less of it" for strip in varying}
    defaults_and_maxima = {strip: (_WIDTHS.get(strip, _LANE), 6.0) for strip in texts}
    defaults_and_maxima |= {"Inner Offset": (2.0, 50.0), **dict.fromkeys((*TURNOUT_NAMES, *STREET_NAMES), (0.0, 50.0))}
    minima = {"Inner Offset": -50.0}
    return {
        width_field(strip): metres(
            defaults_and_maxima[strip][0], (minima.get(strip, 0.0), defaults_and_maxima[strip][1]), text
        )
        for strip, text in texts.items()
    }


class SideInputs(Inputs):
    """Inputs of a carriageway other than its widths: slope, rotation axis, instance, pavement, stations."""

    verge_slope = number(0.08, (0.0, 0.15), "Fall of the verge away from the pavement (m/m)")
    turns_about_inner_edge = boolean(
        False, "The inner edge keeps the axis's height while the crossfall changes, else the middle of the pavement"
    )
    turns_about_axis = boolean(False, "The axis itself keeps its height while the crossfall changes")
    instance = instance_number()
    pavement_material = material_of("the pavement", "asphalt")
    first_station = metres(0.0, (-1e6, 1e6), "Station that the backbone's stations count from")
    slab_length = metres(5.0, (2.0, 20.0), "Distance of a concrete pavement's joints")
    joint_depth = metres(0.002, (0.0, 0.05), "Depth of joints below the pavement")
    wheel_track_depth = metres(0.003, (0.0, 0.02), "Depth of the outermost lane's wheel tracks")


def age_fields(lanes: int) -> dict[str, Input]:
    """Return the input fields of how bright a carriageway's lanes and shoulder are for their age, by field name."""
    text = "By how much it is brighter for its age than its material, as a share"
    return {brightness_field(strip): number(0.0, _CONTRAST, text) for strip in aged_strips(lanes)}


class _Place(Inputs):
    backbone = backbone_socket()
    left_side = boolean(False, "On the left of the axis, else on its right")
    crossfall = number(0.025, (-0.12, 0.12), CROSSFALL)


class _Turnouts(Ramp):
    whole_hard_shoulder_width = metres(2.5, (0.0, 6.0), "Width that the hard shoulder has where there is no turnout")
    verge_extra_width = metres(0.0, (0.0, 50.0), "Width that the verge has in addition behind a ramp")
    turnout_instance = instance_number()


def _build(tree: Tree, lanes: int, turnouts: bool, street_count: int = 0) -> None:
    """Build the node group of one side: its inputs, strips, and the boundaries and edges as outputs."""
    place = _Place(tree)
    widths = inputs_class("Widths", width_fields(lanes, turnouts, streets=bool(street_count)))(tree)
    side = SideInputs(tree)
    ages = inputs_class("Ages", age_fields(lanes))(tree).values
    verge = tree.material("Verge Material", "verge", description="Material of the verge")
    turnout_inputs = _Turnouts(tree) if turnouts else None
    streets = StreetInputs(tree, street_count) if street_count else None
    strips = strips_of(lanes, turnouts, bool(streets))
    details = _details(tree, strips)
    with tree.frame("Boundaries: distances from the axis"):
        backbone = rows_along(place.backbone)
        distances, plane, pivot = _boundaries(strips, widths, side, turnout_inputs or streets)
    section: dict[str, Operand] = {
        "left_side": place.left_side,
        "crossfall": place.crossfall,
        "paved_edge": plane,
        "pivot": pivot,
        "verge_slope": side.verge_slope,
    }
    section |= {field: turnout_inputs.values[field] for field in RAMP_FIELDS} if turnout_inputs else {}
    street_section = section | {"verge_slope": 0.0}
    edge_lift = streets.edge_lift(distances, side.verge_slope) if streets else 0.0
    with tree.frame("Pavement and verge"):
        parts = []
        side_code = op.switch(place.left_side, 0, CODES)
        strip_kinds = strip_lanes(
            tuple("lane" if strip.startswith("Lane") else field_of(strip) for strip in strips), lanes
        )
        for strip_number, strip in enumerate(strips):
            if streets and strip in (*STREET_NAMES, "Verge"):
                about = street_section | {"backbone": backbone, "instance": side.instance, "material": verge}
                parts.append(streets.mesh(strips, strip_number, about, distances, edge_lift))
                continue
            is_paved = strip not in _UNPAVED
            mesh = tree.call(
                carriageway_strip_group(),
                backbone=backbone,
                inner_distance=distances[strip_number],
                outer_distance=distances[strip_number + 1],
                **section,
                class_=class_id("road" if is_paved else "roadside"),
                instance=turnout_inputs.turnout_instance
                if turnout_inputs and strip in TURNOUT_NAMES
                else side.instance,
                material=side.pavement_material if is_paved else verge,
                **{"detail": details.values[detail_field(strip)]} if strip != "Verge" else {},
            ).value
            if is_paved:
                kind, lane = strip_kinds[strip_number]
                mesh = tree.call(
                    pavement_place_group(),
                    strip=mesh,
                    backbone=backbone,
                    inner_distance=distances[lane],
                    outer_distance=distances[lane + 1],
                    kind=side_code + kind,
                    first_station=side.first_station,
                    slab_length=side.slab_length,
                    joint_depth=side.joint_depth,
                    wheel_track_depth=side.wheel_track_depth,
                    brightness=ages.get(brightness_field(strips[lane]), 0.0),
                ).value
            parts.append(mesh)
        outer_distance = op.sample_index(backbone, distances[-1], op.named_attribute(tree, "row", "INT"))
        edge_distance = op.unary("ABSOLUTE", op.named_attribute(tree, "offset")) - outer_distance
        parts[-1] = op.store(parts[-1], "distance", edge_distance)
        mesh = op.join(*parts)
    with tree.frame("Inner and outer edge"):
        of_edges = ((0, section), (-1, street_section if streets else section))
        edges = [tree.call(height_group(), **of_edge, distance=distances[end]) for end, of_edge in of_edges]
    tree.output("Mesh", mesh, description="Pavement and verge; every face has class_id and instance_id")
    _output_lines(tree, distances, (plane, pivot), [(edges[0], 0.0), (edges[1], edge_lift)])


def _details(tree: Tree, strips: list[str]) -> Inputs:
    """Declare the inputs of the points that make the strips finer, but the verge and those of street sides."""
    fields = {
        detail_field(strip): socket("Geometry", f"Points that make the {strip.lower()} finer, see SR Strip")
        for strip in strips[:-1]
        if strip not in STREET_NAMES
    }
    with tree.panel("Detail"):
        return inputs_class("Details", fields)(tree)


def _output_lines(
    tree: Tree, distances: list[Value], plane_and_pivot: tuple[Value, Value], edges: list[tuple[Node, Operand]]
) -> None:
    """Declare the outputs of one side's lines: boundaries, the plane's end and pivot, both edges with their lift."""
    plane, pivot = plane_and_pivot
    for strip_number, distance in enumerate(distances):
        text = "Distance of a boundary from the axis, per row; counted from the median (m)"
        tree.output(f"Boundary {strip_number}", distance, description=text)
    tree.output("Paved Edge", plane, description="Where the pavement's plane ends, per row (m)")
    tree.output("Pivot", pivot, description="Line that keeps the axis's height, per row (m)")
    for name, (edge, lift) in zip(("Inner", "Outer"), edges, strict=True):
        tree.output(f"{name} Edge Offset", edge["Offset"], description=f"{name} edge, to the left, per row (m)")
        height = edge["Height"] + lift if isinstance(lift, Value) else edge["Height"]
        tree.output(f"{name} Edge Height", height, description=f"{name} edge above the axis, per row (m)")


def _boundaries(
    strips: list[str], widths: Inputs, side: SideInputs, beside: _Turnouts | StreetInputs | None
) -> tuple[list[Value], Value, Value]:
    """Add nodes for distances from the axis, m: the strips' boundaries, the end of the pavement's plane, its pivot."""
    turnouts = beside if isinstance(beside, _Turnouts) else None
    streets = beside if isinstance(beside, StreetInputs) else None
    inner_edge = main_edge = widths.values["inner_offset"]
    distances = [inner_edge]
    for strip in strips:
        width = widths.values[width_field(strip)]
        if turnouts and strip == "Verge":
            width = width + turnouts.verge_extra_width
        if streets and strip == "Verge":
            width = width + streets.values["verge_extra_width"]
        distances.append(distances[-1] + width)
        if turnouts and strip not in ("Verge", *TURNOUT_NAMES):
            # Beside turnouts, too, the crossfall turns about the middle of the main road alone.
            main_edge = main_edge + (turnouts.whole_hard_shoulder_width if strip == "Hard Shoulder" else width)
    plane_end = distances[-2]
    if streets:
        gutter = strips.index("Gutter")
        main_edge, plane_end = distances[gutter], distances[gutter + 1]
    else:
        main_edge = main_edge if turnouts else plane_end
    plane_end = plane_end + turnouts.verge_extra_width if turnouts else plane_end
    pavement_pivot = op.switch(side.turns_about_inner_edge, (inner_edge + main_edge) * 0.5, inner_edge)
    return distances, plane_end, op.switch(side.turns_about_axis, pavement_pivot, 0.0)


offer_group("Road", "SR Carriageway 3 Lanes", partial(carriageway_group, 3))
