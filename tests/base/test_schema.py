"""Strict models: faults are told in one line by their place; the published JSON Schema says the same as the library."""

from __future__ import annotations

import copy
import json
import re
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from hypothesis import strategies as st

from synthroads_addon.base.errors import InputError
from synthroads_addon.base.schema import Model, read_json
from synthroads_addon.road.parameters import RoadParameters, parameters_schema
from synthroads_addon.road.things.noise_barrier import NoiseBarrier
from synthroads_addon.scenario.scenario import Scenario
from tests.helpers.files.mutations import cases, for_all
from tests.helpers.roads.parameter_sets import LIBRARY_ONLY, OBJECTS, POINTS, SMALL_ROAD, model_data, road_data

SCHEMA = parameters_schema()
VALIDATOR = jsonschema.Draft202012Validator(SCHEMA)


def fault(data: object, model: type[Model] = RoadParameters) -> str:
    """Return what the library says against the data, or an empty string."""
    try:
        model.from_dict(data)
    except InputError as error:
        return str(error)
    return ""


def at(data: Any, path: tuple) -> Any:
    for key in path:
        data = data[key]
    return data


def changed(place: str, value: Any) -> dict:
    """Return the small road with a value at a dotted path; None takes it away."""
    data = copy.deepcopy(SMALL_ROAD)
    *parents, last = [int(part) if part.isdigit() else part for part in place.split(".")]
    target = at(data, tuple(parents))
    if value is None:
        del target[last]
    else:
        target[last] = value
    return data


# --- the schema and the library ------------------------------------------------------------------------------------


def signed_zeros(data: Any) -> Any:
    """Return JSON data with -0.0 for each of its zeros, but for what a vendor wrote."""
    if isinstance(data, dict):
        return {key: value if key.startswith("+") else signed_zeros(value) for key, value in data.items()}
    if isinstance(data, list):
        return [signed_zeros(value) for value in data]
    return -0.0 if type(data) in (int, float) and data == 0 else data


@cases(6, 100)
def test_what_is_written_fits_the_schema_and_is_read_to_the_same_bytes_whatever_the_signs_of_zeros(count: int) -> None:
    def check(data: dict) -> None:
        road, other = RoadParameters.from_dict(data), RoadParameters.from_dict(signed_zeros(data))
        text = road.to_json()
        VALIDATOR.validate(json.loads(text))
        assert RoadParameters.from_dict(json.loads(text)).to_json() == text
        assert other == road
        assert other.to_json() == text

    for_all(road_data(*OBJECTS), count, check)


def numbers_of(schema: Any) -> set[float]:
    """Return the limits that a schema names."""
    if isinstance(schema, dict):
        own = {v for k, v in schema.items() if k in ("minimum", "maximum", "exclusiveMinimum") and v is not None}
        return own.union(*map(numbers_of, schema.values()))
    return set().union(*map(numbers_of, schema)) if isinstance(schema, list) else set()


def words_of(schema: Any) -> set[str]:
    """Return the words that a schema allows somewhere."""
    if isinstance(schema, dict):
        own = set(schema.get("enum", [])) | {schema.get("const")}
        return {word for word in own if isinstance(word, str)}.union(*map(words_of, schema.values()))
    return set().union(*map(words_of, schema)) if isinstance(schema, list) else set()


LIMITS = sorted(numbers_of(SCHEMA))
NUMBERS = st.builds(
    lambda limit, change: change(limit),
    st.sampled_from(LIMITS),
    st.sampled_from(
        [float, lambda v: v + 1, lambda v: v - 1, lambda v: v + 1e-9 * abs(v), lambda v: v - 1e-9 * abs(v), round]
    ),
)
STRANGE = st.sampled_from(
    [None, True, False, "", "3", [], {}, [None], {"station": 1.0}, 0, -0.0, 1, 1.0, 2.5, -1, 1e300, 10**40, "x" * 65]
)
VALUES = NUMBERS | STRANGE | st.sampled_from(sorted(words_of(SCHEMA))) | st.text(max_size=20)
IDS = st.sampled_from(["", "a b", "ä", "x" * 65, "x" * 64, "A.b-C_9", "a/b", "+a"])


def places(data: Any, path: tuple = ()) -> list[tuple]:
    """Return the path of every value in JSON data."""
    inner = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    return [path, *(place for key, value in inner for place in places(value, (*path, key)))]


def mutated(draw: st.DrawFn, data: dict, depth: int = 9) -> dict:
    """Return the data with one thing changed, at any place down to a depth."""
    data = copy.deepcopy(data)
    path = draw(st.sampled_from([place for place in places(data) if 0 < len(place) <= depth]))
    parent, key = at(data, path[:-1]), path[-1]
    value = parent[key]
    changes = ["other"] * 4 + ["missing"]
    changes += ["unknown", "vendor", "renamed"] if isinstance(value, dict) else []
    changes += ["empty", "longer", "shorter", "turned"] if isinstance(value, list) else []
    changes += ["real"] * 4 if isinstance(value, int) and not isinstance(value, bool) else []
    change = draw(st.sampled_from(changes))
    if change == "other":
        parent[key] = draw(VALUES)
    elif change == "missing":
        del parent[key]
    elif change == "unknown":
        value[draw(st.sampled_from(["widht", "Kind", "", "a+"]))] = draw(VALUES)
    elif change == "vendor":
        value[f"+{draw(st.text(max_size=3))}"] = draw(VALUES)
    elif change == "renamed" and value:
        value[draw(IDS)] = value.pop(draw(st.sampled_from(sorted(value))))
    elif change == "longer":
        parent[key] = (value or [draw(VALUES)]) * draw(st.integers(2, 20))
    elif change == "shorter":
        parent[key] = value[:-1]
    elif change in ("empty", "turned"):
        parent[key] = [] if change == "empty" else value[::-1]
    elif change == "real":
        parent[key] = float(value)
    return data


def agree(data: dict, model: type[Model], validator: Any) -> None:
    """Assert that library and schema both accept the data or both refuse it, but for the conditions listed."""
    said, fits = fault(data, model), validator.is_valid(data)
    assert "\n" not in said
    if fits and said:
        assert any(re.search(words, said) for words in LIBRARY_ONLY.values()), said
    else:
        assert fits == (not said), next(validator.iter_errors(data)).message
    if not said:
        text = model.from_dict(data).to_json()
        validator.validate(json.loads(text))
        assert model.from_dict(json.loads(text)).to_json() == text


@cases(10, 200)
def test_schema_and_library_refuse_the_same_sets(count: int) -> None:
    def check(data: st.DataObject) -> None:
        whole = data.draw(road_data(data.draw(st.sampled_from(sorted(OBJECTS)))))
        written = RoadParameters.from_dict(whole).to_dict()
        for start in (whole, written) * 5:
            agree(mutated(data.draw, start, depth=3), RoadParameters, VALIDATOR)

    for_all(st.data(), count, check)


@pytest.mark.parametrize("kind", OBJECTS)
@cases(6, 60)
def test_schema_and_library_refuse_the_same_objects(kind: str, count: int) -> None:
    model = OBJECTS[kind]
    validator = VALIDATOR.evolve(schema={"$defs": SCHEMA["$defs"], "$ref": f"#/$defs/{model.__name__}"})

    def check(data: st.DataObject) -> None:
        item = data.draw(model_data(model)) | {"type": kind}
        for start in (item, model.from_dict(item).to_dict()) * 15:
            changed = mutated(data.draw, start)
            if "type" in changed:  # which only the set needs, to tell its objects apart
                agree(changed, model, validator)

    for_all(st.data(), count, check)


RAIL = SMALL_ROAD["objects"]["rail"] | {"instance": 99}


@pytest.mark.parametrize(
    ("place", "value"),
    [
        ("objects.alignment", None),
        ("objects.road", None),
        ("objects.rail.type", None),
        *((f"objects.{name}", RAIL) for name in ("", "a b", "ä", "a/b", "+a", "x" * 65)),
        ("objects.alignment.horizontal.0.curvature_start", 0.001),
    ],
)
def test_schema_and_library_refuse(place: str, value: Any) -> None:
    assert fault(changed(place, value))
    assert not VALIDATOR.is_valid(changed(place, value))


@pytest.mark.parametrize("name", ["a", "x" * 64, "A_b-9"])
def test_schema_and_library_accept_ids(name: str) -> None:
    agree(changed(f"objects.{name}", RAIL), RoadParameters, VALIDATOR)
    assert not fault(changed(f"objects.{name}", RAIL))


def _object(name: str, **fields: Any) -> dict[str, Any]:
    return {f"{name}-again": SMALL_ROAD["objects"].get(name, {}) | {"instance": 99} | fields}


PLANTS = {"type": "Vegetation", "kind": "tree", "species": "maple", "density": 0.01, "seed": 1}
PLANTS |= {"band_start": 5.0, "band_end": 20.0, "height_min": 2.0, "height_max": 8.0}
PLACE = {"station": 0.0, "offset": 0.0}
BRIDGE = {"type": "Bridge", "start_station": 40.0, "end_station": 60.0}
OTHER_SIDE = {"other": SMALL_ROAD["objects"]["road"] | {"side": "left", "instance": 98}}
CROSSING: dict[str, Any] = {
    "type": "CrossingRoad", "station": 5.0, "bridge": "over", "start_x": 0.0, "start_y": 0.0, "start_heading_deg": 0.0,
    "horizontal": SMALL_ROAD["objects"]["alignment"]["horizontal"],
    "vertical": SMALL_ROAD["objects"]["alignment"]["vertical"],
}  # fmt: skip
OVERPASS = {"type": "Overpass", "instance": 97, "left_abutment": 22.0, "right_abutment": -20.0, **PLACE}
STREET = {"type": "StreetSide", "carriageway": "road", "start_station": 0.0, "end_station": 20.0}
BROKEN = {
    "instance numbers are unique": _object("rail", instance=4),
    "one Alignment at most": _object("alignment"),
    "one Median and one Terrain at most": _object("", type="Median") | {"median": {"type": "Median", "instance": 98}},
    "one Carriageway per side at most": _object("road"),
    "ids name objects that are there": _object("line", carriageway="rail"),
    "lanes and lane boundaries are there": _object("line", boundary=3),
    "stations of a width's points increase": _object("road", side="left", verge_width=POINTS[::-1]),
    "the alignment is at most 1000 km long": {
        "alignment": SMALL_ROAD["objects"]["alignment"]
        | {"horizontal": [{"kind": "line", "length": 6e5, "curvature_start": 0.0, "curvature_end": 0.0}] * 2}
    },
    "an arc's curvatures are equal, a clothoid's differ": {
        "alignment": SMALL_ROAD["objects"]["alignment"]
        | {"horizontal": [{"kind": "arc", "length": 1.0, "curvature_start": 0.0, "curvature_end": 0.0}]}
    },
    "a vegetation's band, heights and stretch end after they begin": _object("", **PLANTS | {"band_end": 4.0}),
    "a gantry's left end lies left of its right end": _object(
        "", type="Gantry", kind="one_sided", left_offset=-5.0, right_offset=5.0, **PLACE
    ),
    "parts of a street side lie in order between its transitions, which fit its length": _object(
        "", **STREET | {"end_station": 9.0}
    ),
    "a street side's bays leave a footway, and its kerb is wider than its face leans back": _object(
        "", **STREET | {"kerb_width": 0.08, "kerb_batter": 0.5, "kerb_height": 0.25}
    ),
    "street sides neither overlap nor share a carriageway with turnouts": {
        "near": STREET | {"instance": 97},
        "far": STREET | {"instance": 98},
    },
    "traffic keeps to one side of the road": {
        "road": SMALL_ROAD["objects"]["road"] | {"traffic_side": "left"},
        "other": SMALL_ROAD["objects"]["road"] | {"side": "left", "instance": 99},
    },
    "an alignment's station equations are in the order of their stations": {
        "alignment": SMALL_ROAD["objects"]["alignment"]
        | {"equations": [{"station": 20.0, "ahead": 0.0}, {"station": 10.0, "ahead": 0.0}]}
    },
    "a bridge or tunnel ends after it begins, its piers between them in order": (
        OTHER_SIDE | _object("", **BRIDGE, pier_stations=[55.0, 50.0])
    ),
    "a road with bridges or tunnels has two carriageways": _object("", **BRIDGE),
    "a road with tunnels has no crossing roads": (
        OTHER_SIDE
        | {"over": OVERPASS, "crossing": CROSSING | {"instance": 96}}
        | _object("", **BRIDGE | {"type": "Tunnel"})
    ),
    "forest and meadow are at most all of the land": _object(
        "", type="Landscape", seed=1, forest_share=0.6, meadow_share=0.5
    ),
}
"""Condition -> objects that break it and nothing else."""
TEXTURE = {"material": "asphalt", "folder": "asphalt"}
BROKEN_SET = {"a material has one set of textures at most": {"materials": {"textures": [TEXTURE, TEXTURE]}}}
"""The same for what is no object's."""


@pytest.mark.parametrize("name", LIBRARY_ONLY)
def test_the_library_refuses_what_the_schema_cannot(name: str) -> None:
    whole = BROKEN_SET.get(name)
    data = SMALL_ROAD | (whole or {"objects": SMALL_ROAD["objects"] | BROKEN[name]})
    assert VALIDATOR.is_valid(data)
    assert re.search(LIBRARY_ONLY[name], fault(data))


def test_whole_numbers_may_be_written_as_reals() -> None:
    assert RoadParameters.from_dict(changed("objects.rail.instance", 9.0)).objects["rail"].instance == 9
    assert "instance is 9.5: must be a whole number" in fault(changed("objects.rail.instance", 9.5))


# --- faults ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("place", "value", "said"),
    [
        ("objects.road.lanes.0.width.1.station", "x", "objects.road.lanes.0.width.1.station is 'x': must be a number"),
        ("objects.road.lanes.0.width.1.wdith", 3, "lanes.0.width.1: unknown key 'wdith' (did you mean 'width'?)"),
        ("objects.road.lanes.0.width.1.width", None, "objects.road.lanes.0.width.1.width: is required"),
        ("objects.road.lanes.0.width.1", 3.5, "objects.road.lanes.0.width.1 is 3.5: must be a JSON object"),
        ("objects.road.lanes.0.width", POINTS[:1], "objects.road.lanes.0.width is [{"),
        ("objects.road.lanes.0.width", [], "objects.road.lanes.0.width is []: must have at least 2 items, not 0"),
        ("objects.road.lanes.0.width", POINTS[::-1], "width: station 0.0 must be greater than the one before, 100"),
        ("objects.road.lanes.0.width", 1.0, "objects.road.lanes.0.width is 1.0: must be greater than or equal to 2"),
        ("objects.road.lanes.0.width", "wide", "width is 'wide': must be a number or points {station, width}"),
        ("objects.road.lanes.0.width", True, "width is True: must be a number or points {station, width}"),
        ("objects.road.lanes.0.width", {}, "width is {}: must be a number or points {station, width}"),
        ("objects.road.lanes", 2, "objects.road.lanes is 2: must be a list"),
        ("objects.line.colour", "white", "objects.line: unknown key 'colour' (did you mean 'color'?)"),
        ("objects.line.film_thicknes", 0.003, "unknown key 'film_thicknes' (did you mean 'film_thickness'?)"),
        ("objects.line.boundry", 1, "objects.line: unknown key 'boundry' (did you mean 'boundary'?)"),
        ("objects.rail.type", "Gardrail", "objects.rail.type is 'Gardrail': must be one of Alignment, Carriageway"),
        ("objects.rail.type", None, "must be a JSON object that names its type"),
        ("objects.rail.faces", "up", "objects.rail.faces is 'up': must be 'left', 'right' or 'both'"),
        ("objects.rail.height", float("inf"), "objects.rail.height is inf: must be a finite number"),
        ("objects.rail.start_station", 1e300, "start_station is 1e+300: must be less than or equal to 1"),
        ("objects.a\nb", {}, "objects.'a\\nb' is {}: must be a JSON object that names its type"),
        ("objects.road.a\nb", 1, "objects.road: unknown key 'a\\nb'"),
        ("metadata.referenceSystem", "EPSG:25832", "metadata.referenceSystem is 'EPSG:25832': must match pattern"),
    ],
)
def test_faults_are_told_by_their_place(place: str, value: Any, said: str) -> None:
    assert said in fault(changed(place, value))
    assert "\n" not in fault(changed(place, value))


def test_the_nearest_type_is_suggested() -> None:
    assert fault(changed("objects.rail.type", "Gardrail")).endswith("Landscape (did you mean 'Guardrail'?)")


@pytest.mark.parametrize(
    ("section", "said"),
    [
        (3, "road.cross_section is 3: must be a standard cross-section's name or a JSON object with lanes"),
        ({"lanes": [3.5, 1.0]}, "road.cross_section.lanes.1 is 1.0: must be greater than or equal to 2"),
        ({}, "road.cross_section.lanes: is required"),
        ({"lanes": [3.5], "shoulder": 1}, "road.cross_section: unknown key 'shoulder' (did you mean 'hard_shoulder'?)"),
    ],
)
def test_faults_of_a_cross_section_by_hand(section: Any, said: str) -> None:
    assert said in fault({"road": {"cross_section": section}}, Scenario)


def test_the_small_road_is_sound() -> None:
    assert fault(SMALL_ROAD) == ""
    assert VALIDATOR.is_valid(SMALL_ROAD)


# --- files -----------------------------------------------------------------------------------------------------------


def test_a_vendors_keys_are_kept_as_they_are() -> None:
    own = {"+a": None, "+b": {"c": None, "d": [None, 1, 1.0, -0.0, "ü"]}}
    data = changed("objects.rail", SMALL_ROAD["objects"]["rail"] | own)
    assert '"+a": null' in RoadParameters.from_dict(data).to_json()
    assert {k: v for k, v in RoadParameters.from_dict(data).to_dict()["objects"]["rail"].items() if k[0] == "+"} == own


@pytest.mark.parametrize(
    "text", ['{"+a": 1e400}', '{"+a": NaN}', '{"+a": "\\ud800"}', '{"+\\udfff": 1}', "[" * 100_000, "1" * 5000]
)
def test_what_no_file_can_hold_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "a.json").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match="must be valid JSON"):
        read_json(tmp_path / "a.json")


def test_every_choice_of_types_says_which_it_takes() -> None:
    """A plain union's faults name its members, in their order; a discriminator tells only the fitting one's."""

    def unions(schema: Any) -> list[dict]:
        found = [schema] if isinstance(schema, dict) and schema.get("type") == "union" else []
        inner = schema.values() if isinstance(schema, dict) else schema if isinstance(schema, list | tuple) else ()
        return found + [union for part in inner for union in unions(part)]

    assert unions(RoadParameters.__pydantic_core_schema__) + unions(Scenario.__pydantic_core_schema__) == []


def test_numbers_of_numpy_are_shown_as_numbers() -> None:
    """NumPy 2 calls them np.float64(1.5)."""
    assert str(InputError("x", np.float64(1.5), "must be less")) == "x is 1.5: must be less"
    assert str(InputError("x", np.int32(7), "must be less")) == "x is 7: must be less"
    assert str(InputError("x", [1, 2], "must be less")) == "x is [1, 2]: must be less"


def test_whole_numbers_within_lists_may_have_a_point() -> None:
    """JSON doesn't tell 2.0 from 2, and the schema allows both."""
    place = {"type": "NoiseBarrier", "instance": 1, "start_station": 0.0, "end_station": 20.0, "offset": 0.0}
    assert NoiseBarrier.from_dict(place | {"missing_panels": [-0.0, 2.0]}).missing_panels == (0, 2)
    with pytest.raises(InputError, match=r"missing_panels.0 is 0.5: must be a whole number"):
        NoiseBarrier.from_dict(place | {"missing_panels": [0.5]})
