"""The parameter set of a model after a user's changes of its modifiers' inputs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import bpy
import numpy as np

from ...road.geometry import sections_of
from ...road.objects import AnyWidth, RoadObject, nominal_width
from ...road.parameters import RoadParameters
from ...road.section import Carriageway, LineMarking, Pavement
from ...road.section_geometry import CarriagewaySection
from ...road.things.guardrail import Guardrail
from ...road.things.overpass import Overpass
from ...road.things.thing import Thing
from ..compat import modifier_input
from ..nodes.inputs import input_name
from ..things.model_builder import named_fields
from ..things.road.layout import names_in_words, side_of, strip_widths, width_field
from ..things.road.markings import LINE_FIELDS
from .older_files import rename_inputs

_ROLES = {"Terrain": "terrain"}
"""Ids of the objects whose role isn't their id, by role."""
_BEAM_OF_SIDE = ("Left Beam", "Right Beam")
_BEAMS = frozenset(_BEAM_OF_SIDE)
_ROTATION = {"turns_about_axis": "centreline", "turns_about_inner_edge": "inner_edge"}
"""Rotation axis by the carriageway's switch that chooses it; the first that is on counts, without one its own axis."""


def edited_parameters(parameters: RoadParameters, objects: Mapping[str, bpy.types.Object]) -> RoadParameters:
    """Return the parameter set updated with the modifier inputs that were edited since the model was built.

    Inputs are 32-bit floats: a value that differs from its input only by rounding stays as it is.

    Args:
        parameters: parameter set that the model was built from.
        objects: the model's objects by role.

    Raises:
        InputError: a value is outside the limits of its field.
    """
    rename_inputs(parameters, objects)
    edited_objects: dict[str, RoadObject] = {}
    for role, item in objects.items():
        name = _ROLES.get(role, role)
        if role == "Road":
            edited_objects |= dict(_edited_road_objects(parameters, item.modifiers[0]))
        elif name in parameters.objects and item.modifiers:
            edited_objects[name] = edited_object(parameters.objects[name], item.modifiers[0])
    data = parameters.to_dict()
    for name, item in edited_objects.items():
        data["objects"][name] = item.to_dict()
    return RoadParameters.from_dict(data)


def carried_inputs(parameters: RoadParameters, role: str, modifier: bpy.types.NodesModifier) -> frozenset[str]:
    """Return the names of a part's modifier inputs whose values are read back into the parameter set."""
    if role == "Road":
        return frozenset(_road_inputs(parameters))
    item = parameters.objects.get(_ROLES.get(role, role))
    if item is None:
        return frozenset()
    return frozenset(_number_fields(item, modifier)) | (_BEAMS if isinstance(item, Guardrail) else frozenset())


def read_inputs(parameters: RoadParameters, role: str, modifier: bpy.types.NodesModifier) -> frozenset[str]:
    """Return the names of a part's inputs that are read back, integers and switches such as the instance included."""
    item = parameters.objects.get(_ROLES.get(role, role))
    whole_fields = _whole_fields(item, modifier) if item is not None else {}
    return carried_inputs(parameters, role, modifier) | frozenset(whole_fields)


def _road_inputs(parameters: RoadParameters) -> Iterator[str]:
    """Yield the names of the inputs of the part Road that are read back."""
    for carriageway in parameters.of_type(Carriageway).values():
        side = carriageway.side.title()
        fields = [width_field(strip) for strip, _ in strip_widths(carriageway)]
        yield from (input_name(field, side) for field in (*fields, "verge_slope", *_ROTATION))
    words = names_in_words(parameters)
    for name, line in parameters.of_type(LineMarking).items():
        yield from (input_name(field, f"{side_of(parameters, line)} {words[name]}") for field in LINE_FIELDS)


def _number_fields(item: RoadObject, modifier: bpy.types.NodesModifier) -> dict[str, str]:
    """Return the float fields of a road object by the names of the modifier inputs that hold them."""
    fields = named_fields(item, modifier.node_group)
    return {name: field for name, field in fields.items() if isinstance(getattr(item, field), float)}


def _field_value(item: RoadObject, field: str, modifier: bpy.types.NodesModifier, name: str) -> float:
    """Return a field's value read from its input; an overpass' abutment inputs count from its middle."""
    built_value = float(getattr(item, field))
    middle = item.offset if isinstance(item, Overpass) and field in ("left_abutment", "right_abutment") else 0.0
    input_value = _input_value(built_value - middle, modifier, name)
    return built_value if input_value == built_value - middle else round(input_value + middle, 6)


def _whole_fields(item: RoadObject, modifier: bpy.types.NodesModifier) -> dict[str, str]:
    """Return the integer and boolean fields of a thing by their inputs' names; empty if it is no `Thing`."""
    if not isinstance(item, Thing):
        return {}
    fields = named_fields(item, modifier.node_group)
    return {name: field for name, field in fields.items() if isinstance(getattr(item, field), int)}


def edited_object(item: RoadObject, modifier: bpy.types.NodesModifier) -> RoadObject:
    """Return a road object with its fields read from the modifier inputs named like them."""
    update: dict[str, Any] = {
        field: _field_value(item, field, modifier, name) for name, field in _number_fields(item, modifier).items()
    }
    for name, field in _whole_fields(item, modifier).items():
        kind, value = type(getattr(item, field)), modifier_input(modifier, name)
        update[field] = value % 2**32 if field == "instance" else kind(value)
    if isinstance(item, Guardrail):
        left, right = (bool(modifier_input(modifier, name)) for name in _BEAM_OF_SIDE)
        update["faces"] = {(True, False): "left", (False, True): "right"}.get((left, right), "both")
    return item.model_copy(update=update)


def _edited_road_objects(
    parameters: RoadParameters, modifier: bpy.types.NodesModifier
) -> Iterator[tuple[str, RoadObject]]:
    """Yield (id, object) of carriageways and line markings, with the values of the part Road's inputs."""
    sections = sections_of(parameters)
    for name, carriageway in parameters.of_type(Carriageway).items():
        shown_carriageway = edited_carriageway(carriageway, modifier)
        turnouts = [shape.turnout for shape in sections[carriageway.side].turnouts]
        pavement = _fit_damage(sections[carriageway.side], CarriagewaySection(shown_carriageway, turnouts))
        yield name, shown_carriageway.model_copy(update={"pavement": pavement})
    words = names_in_words(parameters)
    for name, line in parameters.of_type(LineMarking).items():
        line_name = f"{side_of(parameters, line)} {words[name]}"
        fields = {
            field: _input_value(getattr(line, field), modifier, input_name(field, line_name)) for field in LINE_FIELDS
        }
        yield name, line.model_copy(update=fields)


def edited_carriageway(carriageway: Carriageway, modifier: bpy.types.NodesModifier) -> Carriageway:
    """Return a carriageway with the values of the part Road's inputs."""
    side = carriageway.side.title()
    widths = {
        strip: _scale_width(width, _input_value(nominal_width(width), modifier, input_name(width_field(strip), side)))
        for strip, width in strip_widths(carriageway)
    }
    lanes = tuple(
        lane.model_copy(update={"width": widths[f"Lane {number}"]}) for number, lane in enumerate(carriageway.lanes, 1)
    )
    slope = carriageway.verge_slope_percent / 100.0
    input_slope = _input_value(slope, modifier, input_name("verge_slope", side))
    rotation_axes = [axis for name, axis in _ROTATION.items() if _is_on(modifier, input_name(name, side))]
    return carriageway.model_copy(
        update={
            "inner_offset": widths["Inner Offset"],
            "inner_edge_strip_width": widths["Inner Edge Strip"],
            "lanes": lanes,
            "outer_edge_strip_width": widths["Outer Edge Strip"],
            "hard_shoulder_width": widths["Hard Shoulder"],
            "verge_width": widths["Verge"],
            "verge_slope_percent": carriageway.verge_slope_percent if input_slope == slope else 100.0 * input_slope,
            "rotation_axis": rotation_axes[0] if rotation_axes else "carriageway_axis",
        }
    )


def _is_on(modifier: bpy.types.NodesModifier, name: str) -> bool:
    """Return whether a switch is on; False if the model, of an older version, lacks it."""
    try:
        return bool(modifier_input(modifier, name))
    except KeyError:
        return False


def _fit_damage(old_section: CarriagewaySection, new_section: CarriagewaySection) -> Pavement:
    """Return the pavement with ruts and potholes moved and widened along with the strips that they lie in."""
    pavement, sign = old_section.carriageway.pavement, old_section.carriageway.sign
    ruts = []
    for rut in pavement.ruts:
        lanes = (old_section.carriageway.lanes[rut.lane], new_section.carriageway.lanes[rut.lane])
        old_width, new_width = (nominal_width(lane.width) for lane in lanes)
        update = {}
        if new_width != old_width:
            update = {"width": rut.width * new_width / old_width, "track": rut.track * new_width / old_width}
        ruts.append(rut.model_copy(update=update))
    potholes = []
    for hole in pavement.potholes:
        # Distances of all strips' edges from the axis: the hole's edges keep their places within the strips.
        old_edges, new_edges = old_section.distances(hole.station)[0], new_section.distances(hole.station)[0]
        if np.array_equal(old_edges, new_edges):
            potholes.append(hole)
            continue
        hole_edges = sign * hole.offset + np.array([-0.5, 0.5]) * hole.width
        inner_edge, outer_edge = np.interp(hole_edges, old_edges, new_edges)
        potholes.append(
            hole.model_copy(update={"offset": sign * (inner_edge + outer_edge) / 2.0, "width": outer_edge - inner_edge})
        )
    return pavement.model_copy(update={"ruts": tuple(ruts), "potholes": tuple(potholes)})


def _scale_width(width: AnyWidth, nominal: float) -> AnyWidth:
    """Return a width scaled so that its largest value along the road is `nominal`, m."""
    if not isinstance(width, tuple):
        return nominal
    old_width = nominal_width(width)
    if nominal == old_width:
        return width
    return tuple(point.model_copy(update={"width": nominal * point.width / (old_width or 1e-9)}) for point in width)


def _input_value(built_value: float, modifier: bpy.types.NodesModifier, name: str) -> float:
    """Return an input's value: `built_value` if both are equal as 32-bit floats, else its shortest decimal number."""
    input_value = np.float32(modifier_input(modifier, name))
    return built_value if input_value == np.float32(built_value) else float(str(input_value))
