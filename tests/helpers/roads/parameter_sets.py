"""Random parameter sets as JSON data, built from the classes that declare them, for property-based tests."""

from __future__ import annotations

import types
from dataclasses import astuple
from functools import cache
from itertools import count
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import annotated_types
from hypothesis import strategies as st
from pydantic.fields import FieldInfo

from synthroads_addon.base.schema import Model
from synthroads_addon.road.objects import WidthPoint
from synthroads_addon.road.parameters import AnyObject, Metadata, StationEquation, Transform
from synthroads_addon.road.section import BAYS
from synthroads_addon.road.streets.street_side import LEAST_FOOTWAY
from synthroads_addon.road.surroundings import LONGEST, SPECIES, Environment, MaterialVariation

OBJECTS = {kind.model_fields["type"].default: kind for kind in get_args(get_args(AnyObject)[0])}
"""Type of object -> its class."""
STRUCTURES = frozenset({"Bridge", "Tunnel"})
"""Types of objects that only a road of two carriageways has; sets made here have none of them beside others."""
_NEEDED = {"CrossingRoad": ("Overpass",)} | dict.fromkeys(
    ("ConnectingRamp", "RampGuardrail", "RampVehicle"), ("CrossingRoad", "Overpass")
)
"""Type of object -> types of those that it names."""
VENDOR = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=4,
)
"""Any JSON: what a vendor may write."""


@cache
def road_data(*kinds: str) -> st.SearchStrategy[dict[str, Any]]:
    """Return sets with a carriageway, an alignment, an exit and an object of each of these types."""

    if len(kinds) > 1:  # a street side takes the place of turnouts, a tunnel that of crossing roads
        kinds = tuple(kind for kind in kinds if kind not in ("StreetSide", *STRUCTURES))
    needed = [kind for above in kinds for kind in _NEEDED.get(above, ()) if kind not in kinds]
    kinds = (*kinds, *dict.fromkeys(needed))

    @st.composite
    def build(draw: st.DrawFn) -> dict[str, Any]:
        objects = {"alignment": draw(model_data(OBJECTS["Alignment"]))}
        road = draw(model_data(OBJECTS["Carriageway"]))
        objects["road"] = road
        if STRUCTURES.intersection(kinds):  # they need both directions
            other = {"left": "right", "right": "left"}[road["side"]]
            objects["other"] = road | {"side": other, "inner_offset": 2.0}
            road["inner_offset"] = 2.0
        exit_ = OBJECTS["Turnout"]
        if "StreetSide" not in kinds:
            objects["exit"] = draw(model_data(exit_).filter(lambda turnout: turnout["kind"] not in BAYS))
        for kind in kinds:
            if kind not in ("Alignment", "Carriageway"):
                objects[f"a-{kind}"] = draw(model_data(OBJECTS[kind]))
        numbers = count(draw(st.integers(1, 2**32 - 100)))
        for item in objects.values():
            _refer(item, len(road["lanes"]))
            item["instance"] = next(numbers)
        return {
            "metadata": draw(model_data(Metadata)),
            "transform": draw(model_data(Transform)),
            "design_class": draw(st.sampled_from(["EKA1A", "EKA1B", "EKA2", "EKA3"])),
            "environment": draw(model_data(Environment)),
            "materials": draw(model_data(MaterialVariation)),
            "objects": objects,
        }

    return build()


@cache
def model_data(model: type[Model]) -> st.SearchStrategy[dict[str, Any]]:
    """Return valid JSON data of one class; references to other objects are any text."""
    required, optional = {}, {}
    for name, field in model.model_fields.items():
        into = required if field.is_required() or name in ("type", "kind") else optional
        into[name] = _values(field.annotation, field.metadata)
    whole = st.fixed_dictionaries(required, optional=optional)
    vendor = st.dictionaries(st.text(max_size=3).map(lambda key: f"+{key}"), VENDOR, max_size=1)
    return st.builds(lambda data, extra: _consistent(model, data) | extra, whole, vendor)


def _values(kind: Any, metadata: list[Any]) -> st.SearchStrategy[Any]:
    """Return JSON values of a type with the limits that pydantic keeps beside it."""
    origin, arguments = get_origin(kind), get_args(kind)
    if origin is Annotated:
        limits = [m for item in arguments[1:] for m in (item.metadata if isinstance(item, FieldInfo) else [item])]
        return _values(arguments[0], limits)
    if origin is Literal:
        return st.sampled_from(arguments)
    if origin in (Union, types.UnionType):
        return st.one_of([_values(member, metadata) for member in arguments])
    if origin is tuple and arguments[-1] is not Ellipsis:
        return st.tuples(*(_values(member, []) for member in arguments)).map(list)
    if origin is tuple:
        least = _limit(metadata, annotated_types.MinLen, 0)
        most = min(_limit(metadata, annotated_types.MaxLen, 100), least + 2)
        if isinstance(arguments[0], type) and issubclass(arguments[0], WidthPoint | StationEquation):
            item = model_data(arguments[0])
            points = st.lists(item, min_size=least, max_size=most, unique_by=lambda p: p["station"])
            return points.map(lambda points: sorted(points, key=lambda p: p["station"]))
        return st.lists(_values(arguments[0], []), min_size=least, max_size=most)
    if isinstance(kind, type) and issubclass(kind, Model):
        return model_data(kind)
    return _scalars(kind, metadata)


def _scalars(kind: Any, metadata: list[Any]) -> st.SearchStrategy[Any]:
    if kind in (int, float):
        above, below = (_limit(metadata, limit, None) for limit in (annotated_types.Gt, annotated_types.Lt))
        low, high = (_limit(metadata, limit, None) for limit in (annotated_types.Ge, annotated_types.Le))
        if kind is int:
            return st.integers(low, high)
        return st.floats(
            low if above is None else above,
            high if below is None else below,
            exclude_min=above is not None,
            exclude_max=below is not None,
        )
    if kind is str:
        pattern = next((item.pattern for item in metadata if getattr(item, "pattern", None)), None)
        if pattern:
            return st.from_regex(pattern.strip("^$"), fullmatch=True)
        least = _limit(metadata, annotated_types.MinLen, 0)
        return st.text(min_size=least, max_size=_limit(metadata, annotated_types.MaxLen, 5))
    return {type(None): st.none(), bool: st.booleans()}[kind]


def _limit(metadata: list[Any], kind: type, otherwise: Any) -> Any:
    """Return the one value of a limit, e.g. that of ``Ge(ge=0)``."""
    return next((astuple(item)[0] for item in metadata if isinstance(item, kind)), otherwise)


def _consistent(model: type[Model], data: dict[str, Any]) -> dict[str, Any]:
    """Return the data with what several fields must keep together."""
    return data | _RULES.get(model.__name__, lambda data: {})(data)


def _element(data: dict[str, Any]) -> dict[str, Any]:
    start, end = data["curvature_start"], data["curvature_end"]
    return {
        "line": {"curvature_start": 0.0, "curvature_end": 0.0},
        "arc": {"curvature_start": start or 0.01, "curvature_end": start or 0.01},
        "clothoid": {"curvature_end": end if end != start else 0.0 if start else 0.01},
    }[data["kind"]]


def _axis(data: dict[str, Any]) -> dict[str, Any]:
    share = min(1.0, 9e5 / sum(element["length"] for element in data["horizontal"]))
    return {"horizontal": [{**element, "length": element["length"] * share} for element in data["horizontal"]]}


def _dashes(data: dict[str, Any]) -> dict[str, Any]:
    lengths = {name: data.get(name, 0.0) for name in ("dash_length", "gap_length")}
    if 0 in lengths.values():
        return dict.fromkeys(lengths, 0.0)
    return {name: max(value, 0.05) for name, value in lengths.items()}


def _line(data: dict[str, Any]) -> dict[str, Any]:
    turnout = data["kind"] in ("turnout_edge", "gore_edge")
    return _dashes(data) | {"turnout": "exit" if turnout else None}


def _shares(data: dict[str, Any]) -> dict[str, Any]:
    together = sum(data.get(name, 0.5) for name in ("forest_share", "meadow_share"))
    return {"forest_share": 0.5, "meadow_share": 0.25} if together > 1.0 else {}


def _turnout(data: dict[str, Any]) -> dict[str, Any]:
    ramp = data.get("ramp") or {"length": 100.0}
    return {
        "taper_in_length": 0.0 if data["kind"] == "entry" else data.get("taper_in_length") or 30.0,
        "taper_out_length": 0.0 if data["kind"] == "exit" else data.get("taper_out_length") or 30.0,
        "ramp": None if data["kind"] in BAYS else ramp,
    }


def _street(data: dict[str, Any]) -> dict[str, Any]:
    start, transition = data["start_station"], data.get("transition_length", 5.0)
    first = start + transition
    widest = 0.5 * (data.get("footway_width", 2.5) - LEAST_FOOTWAY)
    bay = {"start_station": first + 1.0, "end_station": first + 30.0, "width": widest, "taper_length": 2.0}
    return {
        "end_station": first + 40.0 + transition,
        "bays": [bay] if data.get("bays") and widest >= 1.0 else [],
        "kerb_levels": [{"station": first + 20.0, "length": 4.0, "height": 0.03}] if data.get("kerb_levels") else [],
        "kerb_width": 0.4,
        "kerb_batter": min(data.get("kerb_batter", 0.15), 0.4),
    }


def _plants(data: dict[str, Any]) -> dict[str, Any]:
    species = SPECIES[data["kind"]]
    start, end = sorted((data.get("start_station", 0.0), data.get("end_station", LONGEST)))
    grass = data["kind"] == "grass"
    return {
        "species": data["species"] if data["species"] in species else species[0],
        "side": "both" if grass else data.get("side", "both"),
        "start_station": 0.0 if grass else start,
        "end_station": LONGEST if grass else end,
        "band_end": max(data["band_start"], data["band_end"]),
        "height_max": max(data["height_min"], data["height_max"]),
    }


def _gantry(data: dict[str, Any]) -> dict[str, Any]:
    right, left = sorted((data["left_offset"], data["right_offset"]))
    return {"left_offset": left, "right_offset": right} if right < left else {"left_offset": 10.0, "right_offset": 0.0}


def _bridge(data: dict[str, Any]) -> dict[str, Any]:
    start = min(data["start_station"], LONGEST)
    piers = [start + 10.0 * (number + 1) for number, _ in enumerate(data.get("pier_stations", ()))]
    return {"start_station": start, "end_station": start + 10.0 * (len(piers) + 1), "pier_stations": piers}


def _tunnel(data: dict[str, Any]) -> dict[str, Any]:
    start = min(data["start_station"], LONGEST)
    return {"start_station": start, "end_station": start + 10.0}


def _materials(data: dict[str, Any]) -> dict[str, Any]:
    textures = {texture["material"]: texture for texture in data.get("textures", ())}
    return {"textures": list(textures.values())}


def _reflectors(data: dict[str, Any]) -> dict[str, Any]:
    spacing = data.get("reflector_spacing", 50.0)
    return {"reflector_spacing": 1.0 if 0.0 < spacing < 1.0 else spacing}


_RULES = {
    "AlignmentObject": _axis,
    "Bridge": _bridge,
    "Tunnel": _tunnel,
    "HorizontalElement": _element,
    "LineMarking": _line,
    "RemovedMarking": _dashes,
    "Guardrail": _reflectors,
    "Landscape": _shares,
    "StreetSide": _street,
    "Turnout": _turnout,
    "Vegetation": _plants,
    "Gantry": _gantry,
    "MaterialVariation": _materials,
}


def _refer(item: dict[str, Any], lanes: int) -> None:
    """Let an object's references name objects that are there."""
    if "carriageway" in item:
        item["carriageway"] = "a-CrossingRoad" if item["type"] == "RampVehicle" else "road"
    if item["type"] == "RampGuardrail":
        item["road"] = "a-CrossingRoad"
    if "boundary" in item:
        item["boundary"] = min(item["boundary"], lanes)
    if "lane" in item:
        item["lane"] = min(item["lane"], lanes - 1)
    if item["type"] in ("Hatching", "ConnectingRamp"):
        item["turnout"] = "exit"
    if item["type"] == "ConnectingRamp":
        item["crossing_road"] = "a-CrossingRoad"
    if item["type"] == "CrossingRoad":
        item["bridge"] = "a-Overpass"


POINTS = [{"station": 0.0, "width": 3.5}, {"station": 100.0, "width": 0.0}]
SMALL_ROAD = {
    "metadata": {
        "identifier": "road",
        "generator": "by hand",
        "referenceSystem": "https://www.opengis.net/def/crs/EPSG/0/25832",
    },
    "transform": {"translate": [0.0, 0.0, 0.0]},
    "design_class": "EKA1A",
    "objects": {
        "alignment": {
            "type": "Alignment",
            "instance": 1,
            "start_x": 0.0,
            "start_y": 0.0,
            "start_heading_deg": 0.0,
            "horizontal": [{"kind": "line", "length": 100.0, "curvature_start": 0.0, "curvature_end": 0.0}],
            "vertical": [{"station": 0.0, "elevation": 0.0}],
        },
        "road": {
            "type": "Carriageway",
            "instance": 2,
            "side": "right",
            "inner_offset": 2.0,
            "hard_shoulder_width": 2.5,
            "outer_edge_strip_width": 0.5,
            "lanes": [{"width": POINTS}, {"width": 3.5}],
            "inner_edge_strip_width": 0.5,
            "verge_width": 1.5,
            "crossfall": [{"station": 0.0, "crossfall_percent": 2.5}],
        },
        "line": {
            "type": "LineMarking",
            "instance": 3,
            "carriageway": "road",
            "kind": "lane",
            "boundary": 1,
            "width": 0.15,
            "dash_length": 6.0,
            "gap_length": 12.0,
            "start_station": 0.0,
            "end_station": 100.0,
        },
        "rail": {
            "type": "Guardrail",
            "instance": 4,
            "start_station": 0.0,
            "end_station": 100.0,
            "offset": -15.0,
            "faces": "left",
        },
    },
}
"""A straight of 100 m with one carriageway of two lanes, of which the outer one ends; as JSON data."""

LIBRARY_ONLY = {
    "instance numbers are unique": "two objects have the same instance number",
    "one Alignment at most": "exactly one Alignment",
    "one Median and one Terrain at most": "may contain one (Median|Terrain) at most",
    "one Carriageway per side at most": "one Carriageway per side",
    "ids name objects that are there": "must name (a Carriageway|an exit or entry|an Overpass or|a CrossingRoad)",
    "lanes and lane boundaries are there": "must name a lane boundary|must be less than the number of lanes",
    "stations of a width's points increase": "must be greater than the one before",
    "the alignment is at most 1000 km long": "must be at most 1e\\+06 m long together",
    "an arc's curvatures are equal, a clothoid's differ": "kind '(arc|clothoid)' contradicts",
    "a vegetation's band, heights and stretch end after they begin": "must not be less than band_start, height_min",
    "a gantry's left end lies left of its right end": "left_offset must be greater than right_offset",
    "parts of a street side lie in order between its transitions, which fit its length": (
        "two transition_lengths after start_station|must lie between the transitions|in order and must not overlap"
    ),
    "a street side's bays leave a footway, and its kerb is wider than its face leans back": (
        "bays must leave at least|kerb_width must be at least"
    ),
    "street sides neither overlap nor share a carriageway with turnouts": "two StreetSides|a StreetSide and a Turnout",
    "traffic keeps to one side of the road": "traffic_side must be the same",
    "a material has one set of textures at most": "textures has '.*' twice",
    "an alignment's station equations are in the order of their stations": "must be in the order of their stations",
    "a bridge or tunnel ends after it begins, its piers between them in order": (
        r"end_station must be at least \d+ m after start_station|pier_stations must (lie between|increase)"
    ),
    "a road with bridges or tunnels has two carriageways": "a (Bridge|Tunnel) needs a Carriageway on both sides",
    "a road with tunnels has no crossing roads": "a road has tunnels, or crossing",
    "forest and meadow are at most all of the land": "forest_share and meadow_share must not be more than 1",
}
"""Conditions that JSON Schema can't express -> what the library says. docs/parameters.md lists them."""
