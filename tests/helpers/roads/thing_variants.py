"""Variants of every thing of the registry: each choice that it has, and its measures moved towards their limits."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Literal, get_args, get_origin

from synthroads_addon.road.things.registry import THINGS
from synthroads_addon.road.things.thing import LengthwiseThing, StandingThing, Thing

Data = dict[str, Any]

PLACE = {"instance", "station", "offset", "elevation", "rotation_deg", "start_station", "end_station", "type"}
GIVEN: dict[str, Data] = {
    "TrafficSign": {"code": "274-120", "width": 0.75, "height": 0.8},
    "KilometreBoard": {"text": "123,5"},
    "Asset": {"library": "roadside", "name": "transformer_station", "class_name": "utility"},
    "TemporaryBarrier": {"end_offset": -8.0},
    "Gantry": {
        "left_offset": 0.0,
        "right_offset": -17.0,
        "signs": [
            {"offset": -4.6, "width": 3.4, "height": 2.5, "text": ["A"]},
            {"offset": -9.0, "width": 1.35, "height": 1.35, "kind": "display", "text": ["80"]},
            {"offset": -13.0, "width": 1.2, "height": 0.5, "kind": "display"},
        ],
    },
    "Overpass": {"left_abutment": 22.0, "right_abutment": -20.0},
}
"""Fields that have no default."""
LENGTH = 300.0
"""Length of the road that they stand on, m."""
FURTHER: dict[str, list[Data]] = {
    "TrafficSign": [
        {"shape": "rectangle", "width": 4.0, "height": 3.0, "posts": 2, "post_diameter": 0.2, "code": "449"},
        {"shape": "rectangle", "width": 2.0, "height": 1.0, "posts": 3, "elevation": 0.3},
    ],
    "TemporaryBarrier": [{"segment_length": 2.0, "end_offset": -6.5}],
    "Gantry": [{"kind": "cantilever", "post_side": "left", "beam": "truss", "beam_height": 1.4, "beam_depth": 1.0}],
    "Overpass": [{"rotation_deg": 25.0, "pier_offsets": [0.0, 18.5, -18.5], "width": 7.0}, {"parapet_height": 0.0}],
    "NoiseBarrier": [{"thickness": 0.3, "panel": "wood"}, {"thickness": 0.3, "panel": "glass"}],
    "Building": [{"roof_height": 0.0}, {"kind": "hall", "roof_height": 0.8}],
    "Cabinet": [{"kind": "utility", "pad_margin": 0.3}],
    "Pole": [{"arm_length": 0.0}, {"kind": "surveillance", "arm_length": 0.0}],
}
"""Variants that the choices alone don't show."""


def variants(kind: str) -> Iterator[Data]:
    """Yield the fields of variants of a type of thing but its place, the usual one first."""
    model = THINGS[kind]
    choices = {
        name: get_args(field.annotation)
        for name, field in model.model_fields.items()
        if get_origin(field.annotation) is Literal and name not in PLACE
    }
    usual = {"type": kind} | {name: values[0] for name, values in choices.items()} | GIVEN.get(kind, {})
    yield usual
    for name, values in choices.items():
        yield from (usual | {name: value} for value in values[1:])
    for share in (0.15, -0.15):
        yield usual | _moved_measures(model, usual, share)
    yield from (usual | more for more in FURTHER.get(kind, []))


def _moved_measures(model: type[Thing], usual: Data, share: float) -> Data:
    """Return a model's measures, moved by a share of the way to their upper limits, or of minus that to the lower."""
    moved = {}
    for name, field in model.model_fields.items():
        value = usual.get(name, field.default)
        if name in PLACE or not isinstance(value, float):
            continue
        low = next((item.ge for item in field.metadata if getattr(item, "ge", None) is not None), 0.0)
        high = next((item.le for item in field.metadata if getattr(item, "le", None) is not None), value)
        if "offset" not in name and "abutment" not in name:
            moved[name] = round(value + abs(share) * ((high if share > 0.0 else low) - value), 3)
    return moved


def placed(kinds: list[str] | None = None, most: int = 100) -> dict[str, Data]:
    """Return variants of types of things by id, standing along a road of 300 m, none in another's way."""
    found: dict[str, Data] = {}
    for kind in THINGS if kinds is None else kinds:
        for number, fields in enumerate(variants(kind)):
            if number < most:
                found[f"{kind.lower()}-{number}"] = fields
    station = 10.0
    for number, (name, fields) in enumerate(found.items()):
        model = THINGS[fields["type"]]
        if issubclass(model, LengthwiseThing):
            found[name] = {"start_station": 20.0, "end_station": 53.0, "offset": -6.0 - 0.5 * number, **fields}
        elif issubclass(model, StandingThing):
            place = {
                "station": round(station, 3),
                "offset": -15.0 - 0.37 * (number % 5),
                "elevation": 0.05 * (number % 3),
            }
            if fields["type"] in ("Gantry", "Overpass"):
                place = {"station": round(station, 3), "offset": -8.5 if fields["type"] == "Gantry" else 0.0}
            else:
                place["rotation_deg"] = (0.0, 180.0, 30.0)[number % 3]
            found[name] = place | fields
            station += 3.1
    return found


def straight_road(objects: dict[str, Data]) -> Data:
    """Return a straight road that rises, on level ground, with these objects: chords of its surface are exact."""
    line = {"kind": "line", "length": LENGTH, "curvature_start": 0.0, "curvature_end": 0.0}
    axis = {"type": "Alignment", "start_x": 0.0, "start_y": 0.0, "start_heading_deg": 30.0, "horizontal": [line]}
    axis["vertical"] = [{"station": 0.0, "elevation": 0.0}, {"station": LENGTH, "elevation": 0.03 * LENGTH}]
    ground = {"type": "Terrain", "half_width": 60.0, "embankment_height": 2.0, "undulation": 0.0, "wavelength": 60.0}
    return {"axis": axis, "terrain": ground | {"seed": 1}, **objects}
