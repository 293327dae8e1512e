"""The backbone, a polyline along the axis with attributes for the nodes at each station, and the road's surface."""

from __future__ import annotations

import bpy
import numpy as np
from numpy.typing import NDArray

from ....base.turns.stepper import run_aside
from ....road.geometry import RoadGeometry, sections_of
from ....road.objects import nominal_width
from ....road.parameters import RoadParameters
from ....road.pavement.age import age_contrast, lane_contrasts
from ....road.section import Carriageway, LineMarking, Median
from ....road.streets.street_side import StreetSide
from ....road.turnout_geometry import STEP
from ...nodes.inputs import input_name
from ..meshes import attribute, fill, signed_instance
from ..model_builder import ModelBuilder
from ..registry import model_part
from ..structure import add_caps
from .layout import (
    aged_strips,
    brightness_field,
    detail_points,
    names_in_words,
    road_layout,
    side_of,
    strip_widths,
    varying_widths,
    width_field,
)
from .markings import LINE_FIELDS
from .road import road_group

Float = NDArray[np.float64]

ROUNDING = 1e-5
"""Distance (m) up to which two stations are one."""


@model_part("road", 10, on_the_road=True)
def build_surface(builder: ModelBuilder) -> None:
    """Add the road's surface to the model, with its backbone and damage details as hidden support objects."""
    station = builder.stations
    backbone = backbone_mesh(builder.geometry, station, builder.origin, builder.zero)
    builder.add("Backbone", backbone, support=True)
    materials: dict[str, str] = {
        input_name("pavement_material", side.title()): section.carriageway.pavement.kind
        for side, section in builder.geometry.sections.items()
    }
    materials |= _street_materials(builder.parameters)
    details = run_aside(lambda: detail_points(builder.geometry, station, builder.tolerance))
    for name, points in details.items():
        mesh = bpy.data.meshes.new("SR Detail")
        fill(mesh, np.column_stack([points.share, points.depth, 0.0 * points.share]))
        attribute(mesh, "share", points.share)
        attribute(mesh, "depth", points.depth)
        attribute(mesh, "damage", signed_instance(points.instance))
        builder.add(f"{name} Detail", mesh, support=True)
    inputs = {**materials, **_road_inputs(builder.parameters, builder.geometry, builder.zero)}
    add_caps(builder)
    builder.add("Road", None, road_group(road_layout(builder.parameters, builder.geometry.mesh_sections)), inputs)


def _street_materials(parameters: RoadParameters) -> dict[str, str]:
    """Return the names of the street sides' materials by the road group's inputs."""
    words_by_id, materials = names_in_words(parameters), {}
    for name, street in parameters.of_type(StreetSide).items():
        for part in ("gutter", "bay", "kerb", "footway"):
            words = f"{side_of(parameters, street)} {words_by_id[name]}"
            materials[input_name(f"{part}_material", words)] = str(getattr(street, f"{part}_material"))
    return materials


def _road_inputs(
    parameters: RoadParameters, geometry: RoadGeometry, zero: float = 0.0
) -> dict[str, float | int | bool]:
    """Return the road group's numeric inputs (widths, lines, turnouts, instances) by name, without objects, materials.

    Lengths are in m, slopes in m/m; an instance is the number by which points tell one part of the road from another.

    Args:
        parameters: the road, with only the objects on the stretch that is built.
        geometry: the whole road's geometry.
        zero: station that nodes' stations are relative to, m.
    """
    inputs: dict[str, float | int | bool] = {}
    words_by_id = names_in_words(parameters)

    def add_inputs(words_before: str, **values: float) -> None:
        """Add inputs given by their fields; `words_before` stand in front of each input's name."""
        inputs.update({input_name(field, words_before): value for field, value in values.items()})

    carriageways = parameters.of_type(Carriageway).values()
    for carriageway in carriageways:
        side = carriageway.side.title()
        # Widths that vary are shares of these inputs on the backbone (`varying_widths`).
        add_inputs(side, **{width_field(strip): nominal_width(width) for strip, width in strip_widths(carriageway)})
        add_inputs(
            side,
            verge_slope=carriageway.verge_slope_percent / 100.0,
            turns_about_inner_edge=carriageway.rotation_axis == "inner_edge",
            turns_about_axis=carriageway.rotation_axis == "centreline",
            instance=carriageway.instance,
            first_station=zero,
            slab_length=carriageway.pavement.slab_length,
            joint_depth=carriageway.pavement.joint_depth,
            wheel_track_depth=carriageway.pavement.wheel_track_depth,
        )
        add_inputs(side, **_age_inputs(carriageway, parameters.materials.asphalt_age))
    # The road group has a median's inputs only between two carriageways.
    if len(carriageways) == 2:
        for median in parameters.of_type(Median).values():
            add_inputs("Median", instance=median.instance)
    for section in sections_of(parameters).values():
        for shape in section.turnouts:
            turnout_id = next(key for key, item in parameters.objects.items() if item is shape.turnout)
            start, end = shape.range()
            turnout_words = f"{side_of(parameters, shape.turnout)} {words_by_id[turnout_id]}"
            add_inputs(
                turnout_words, start_station=start - zero, end_station=end - zero, instance=shape.turnout.instance
            )
    for name, street in parameters.of_type(StreetSide).items():
        add_inputs(
            f"{side_of(parameters, street)} {words_by_id[name]}",
            start_station=street.start_station - zero,
            end_station=street.end_station - zero,
            instance=street.instance,
        )
    for name, line in parameters.of_type(LineMarking).items():
        line_words = f"{side_of(parameters, line)} {words_by_id[name]}"
        values = {field: getattr(line, field) for field in LINE_FIELDS}
        stations = {"start_station": line.start_station - zero, "end_station": line.end_station - zero}
        add_inputs(line_words, **values | stations, instance=line.instance)
        add_inputs(line_words, first_dash_instance=_first_dash(name, line, geometry))
        if line.kind == "free":
            add_inputs(line_words, distance=nominal_width(line.offset))
    return inputs


def _age_inputs(carriageway: Carriageway, road_age: float) -> dict[str, float]:
    """Return the brightness of a carriageway's lanes and shoulder by age, as shares of the road's, by input field."""
    pavement, lanes = carriageway.pavement, len(carriageway.lanes)
    contrasts = lane_contrasts(pavement, lanes, road_age)
    contrasts = [*contrasts[::-1], age_contrast(pavement, pavement.shoulder_age, road_age)]
    return {brightness_field(strip): value for strip, value in zip(aged_strips(lanes), contrasts, strict=True)}


def _first_dash(name: str, line: LineMarking, geometry: RoadGeometry) -> int:
    """Return the instance number of a line's first dash on the stretch, counted along the whole road."""
    whole_line = geometry.parameters.objects[name]
    assert isinstance(whole_line, LineMarking)
    period = line.dash_length + line.gap_length
    dashes_before = round((line.start_station - whole_line.start_station) / period) if period else 0
    return geometry.numbers.parts[name].first + dashes_before


def _openings(geometry: RoadGeometry, station: Float) -> dict[str, Float]:
    """Return 1 at stations (N,) of side roads and structures, by attribute.

    It is ``opening`` of the verge, in structures of the median too; and ``mouth`` of the ground.
    """
    values: dict[str, Float] = {}
    for start, end in geometry.capped:
        within = (station >= start - ROUNDING) & (station <= end + ROUNDING)
        for name in ("opening_left", "opening_right", "opening_median", "mouth_left", "mouth_right"):
            values[name] = values.get(name, np.zeros(len(station))) + within
    for mouth in geometry.mouths.values():
        side = mouth.section.carriageway.side
        low, high = mouth.low.start_station, mouth.high.start_station
        for name, start, end in (("opening", low, high), ("mouth", mouth.start, mouth.end)):
            within = (station >= start - ROUNDING) & (station <= end + ROUNDING)
            values[f"{name}_{side}"] = values.get(f"{name}_{side}", np.zeros(len(station))) + within
    for side, section in geometry.sections.items():
        for shape in section.turnouts:
            if shape.joined:
                end = shape.ramp_end()
                step = sorted((end, end + STEP if shape.leaves_forward() else end - STEP))
                within = (station >= step[0] - ROUNDING) & (station <= step[1] + ROUNDING)
                for name in ("opening", "step"):
                    values[f"{name}_{side}"] = values.get(f"{name}_{side}", np.zeros(len(station))) + within
    if geometry.crossing_roads:
        # The ground between several roads is one mesh.
        values |= {f"mouth_{side}": np.ones(len(station)) for side in ("left", "right")}
    return values


def backbone_mesh(geometry: RoadGeometry, station: Float, origin: Float, zero: float = 0.0) -> bpy.types.Mesh:
    """Create the backbone's polyline mesh: a vertex per station (N,), with the attributes that `nodes.backbone` lists.

    Args:
        geometry: the road.
        station: (N,) m.
        origin: (3,) local coordinates of the scene's origin, m.
        zero: station (m) that nodes' stations are relative to: as float32 they are exact near it only.
    """
    position, heading, curvature = geometry.alignment.frame(station)
    elevation = geometry.profile.elevation(station)
    values = {"station": station - zero, "curvature": curvature}
    for side in ("left", "right"):
        carriageway = geometry.parameters.carriageway(side)
        values[f"crossfall_{side}"] = geometry.crossfall(carriageway, station) if carriageway else 0.0 * station
    values |= varying_widths(geometry, station)
    values |= _openings(geometry, station)
    mesh = bpy.data.meshes.new("SR Backbone")
    first_vertices = np.arange(len(station) - 1)
    fill(
        mesh,
        np.column_stack([position, elevation]) - origin,
        edges=np.column_stack([first_vertices, first_vertices + 1]),
    )
    left_vectors = np.column_stack([-np.sin(heading), np.cos(heading), np.zeros(len(station))])
    attribute(mesh, "left", left_vectors)
    for name, value in values.items():
        attribute(mesh, name, value)
    return mesh
