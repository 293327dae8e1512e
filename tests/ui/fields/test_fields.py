"""The panel's settings: the schema with its limits, units and tooltips, and exactly the command line's scenario."""

import json
import types
from collections.abc import Iterator
from functools import cache
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import annotated_types
import bpy
import numpy as np
import pytest
from hypothesis import HealthCheck, assume, example, given, settings
from hypothesis import strategies as st
from pydantic import BaseModel, Field

import synthroads_addon
from synthroads_addon.base.errors import InputError
from synthroads_addon.base.schema import LARGEST, ClosedModel, quantity
from synthroads_addon.road.guidelines import SECTIONS_OF_CLASS, STANDARD_CROSS_SECTIONS
from synthroads_addon.road.things.limits import Interval, interval
from synthroads_addon.scanning.devices.device import device_names, load_device
from synthroads_addon.scanning.platforms.registry import PLATFORMS
from synthroads_addon.scenario.scan import MOST_POSSIBLE, ScanScenario
from synthroads_addon.scenario.scenario import FIDELITIES, Scenario, load_scenario, scenario_names
from synthroads_addon.ui.fields import fields as kinds
from synthroads_addon.ui.fields.groups import (
    BY_HAND,
    NOT_HERE,
    GroupField,
    leaves,
    make_fields,
    read_fields,
    write_fields,
)
from synthroads_addon.ui.fields.properties import FIELDS, PATHS
from synthroads_addon.ui.fields.wording import BLENDERS
from tests.helpers.relative_speed import quiet_seconds

PANELS_OUTPUTS = 'outputs=["parameters","cloud","centerline","previews"]'


@pytest.fixture(scope="module", autouse=True)
def _registered() -> Iterator[None]:
    synthroads_addon.register()
    yield
    synthroads_addon.unregister()


@pytest.fixture
def panel() -> Any:
    """The panel's settings, untouched."""
    return bpy.context.scene.synthroads


# --- any scenario: settings and back ---------------------------------------------------------------------------------


def bare(kind: Any) -> tuple[Any, list[Any]]:
    """Return a type without its annotations, and those."""
    notes: list[Any] = []
    while get_origin(kind) is Annotated:
        kind, *more = get_args(kind)
        notes += more
    return kind, notes


def limits(notes: list[Any]) -> tuple[float, float]:
    low, high = -1e15, 1e15
    for note in [part for n in notes for part in (getattr(n, "metadata", None) or [n])]:
        match note:
            case annotated_types.Ge(ge=x):
                low = max(low, x)
            case annotated_types.Gt(gt=x):
                low = max(low, float(np.nextafter(x, np.inf)) if isinstance(x, float) else x + 1e-9)
            case annotated_types.Le(le=x) | annotated_types.Lt(lt=x):
                high = min(high, x)
    return low, high


@cache
def of_model(model: type[BaseModel]) -> st.SearchStrategy[dict[str, Any]]:
    """Any JSON data of a model: few fields given, so that most fit together."""
    if model is Interval:
        pair = st.tuples(st.floats(-1e6, 1e6), st.floats(-1e6, 1e6))
        return pair.map(lambda ends: {"minimum": min(ends), "maximum": max(ends)})
    given_names = st.sets(st.sampled_from(sorted(model.model_fields)), max_size=6)

    def data(names: set[str]) -> st.SearchStrategy[dict[str, Any]]:
        needed = {name for name, info in model.model_fields.items() if info.is_required()}
        return st.fixed_dictionaries({n: of_field(model, n) for n in sorted(names | needed)})

    return given_names.flatmap(data)


def of_field(model: type[BaseModel], name: str) -> st.SearchStrategy[Any]:
    info = model.model_fields[name]
    if (model, name) == (Scenario, "seed"):
        return st.integers(0, 2**63 - 1)
    if name in ("device", "classes"):
        return st.sampled_from(device_names() if name == "device" else ["5", "17", "mine.json"])
    if name == "cross_section":
        return st.one_of(st.sampled_from(sorted(STANDARD_CROSS_SECTIONS)), of_type(info.annotation, []))
    return of_type(info.annotation, list(info.metadata))


def of_type(kind: Any, notes: list[Any]) -> st.SearchStrategy[Any]:
    kind, more = bare(kind)
    notes = notes + more
    if get_origin(kind) in (Union, types.UnionType):
        parts = [part for part in get_args(kind) if part is not type(None)]
        return st.one_of(*(of_type(part, notes) for part in parts if bare(part)[0] is not str or len(parts) == 1))
    if get_origin(kind) is Literal:
        return st.sampled_from(get_args(kind))
    if get_origin(kind) is tuple:
        member = get_args(kind)[0]
        if get_args(kind)[-1] is not Ellipsis:
            return st.tuples(*(of_type(part, []) for part in get_args(kind))).map(list)
        unique = get_origin(bare(member)[0]) is Literal
        return st.lists(of_type(member, []), min_size=1, max_size=5, unique=unique)
    low, high = limits(notes)
    if kind is bool:
        return st.booleans()
    if kind is int:
        return st.integers(int(np.ceil(low)), int(min(high, 2**40)))
    if kind is float:
        return st.floats(low, high, allow_subnormal=False)
    if kind is str:
        return st.text(st.characters(codec="utf-8", exclude_characters="\0/", exclude_categories=["Cs"]), min_size=1)
    return of_model(kind)


@given(data=of_model(Scenario))
@example(data={"scan": {"platform": {"file": "0", "height": 1.0, "lateral_offsets": [-0.0]}}})
@settings(max_examples=70, suppress_health_check=[HealthCheck.filter_too_much, HealthCheck.too_slow])
def test_any_scenario_comes_back_to_the_last_digit(data: dict[str, Any]) -> None:
    try:
        scenario = Scenario.from_dict({key: value for key, value in data.items() if key not in NOT_HERE})
    except InputError:
        assume(False)
    panel = bpy.context.scene.synthroads
    panel.show_scenario(scenario)
    assert panel.scenario() == scenario
    assert json.dumps(panel.scenario().to_dict()) == json.dumps(scenario.to_dict())


@pytest.mark.parametrize("name", NOT_HERE)
def test_what_the_panel_lacks_is_refused_not_ignored(name: str) -> None:
    panel = bpy.context.scene.synthroads
    before = panel.scenario()
    scenario = Scenario.from_dict({"tolerance": {"height": "5mm"}} if name == "tolerance" else {"time_budget": "60s"})
    with pytest.raises(InputError, match=f"^{name} .*only synthroads generate uses"):
        panel.show_scenario(scenario)
    assert panel.scenario() == before


@given(data=of_model(Scenario))
@settings(max_examples=40, suppress_health_check=[HealthCheck.filter_too_much, HealthCheck.too_slow])
def test_without_the_loaded_text_numbers_are_the_nearest_of_32_bits(data: dict[str, Any]) -> None:
    """As if typed in: every number is within half a step of 32 bits, all else is the same."""
    try:
        scenario = Scenario.from_dict({key: value for key, value in data.items() if key not in ("seed", *NOT_HERE)})
    except InputError:
        assume(False)
    panel = bpy.context.scene.synthroads
    panel.show_scenario(scenario)
    panel.loaded = ""
    near(read_fields(FIELDS, panel, None), json.loads(scenario.to_json()))


def near(got: Any, wanted: Any) -> None:
    if isinstance(wanted, dict):
        constants = {"type", "version"}
        assert set(got) == set(wanted) - constants
        for key in got:
            near(got[key], wanted[key])
    elif isinstance(wanted, int | float) and isinstance(got, int | float):
        assert np.float32(got) == np.float32(wanted)
    else:
        assert got == wanted or sorted(got) == sorted(wanted)


def test_untouched_settings_are_the_demo_at_draft_fidelity(panel: Any) -> None:
    assert panel.scenario() == load_scenario("rq31-600m", ["fidelity=draft", PANELS_OUTPUTS])


@pytest.mark.parametrize("name", scenario_names())
def test_a_built_in_scenario_keeps_seed_and_fidelity(panel: Any, name: str) -> None:
    panel.seed, panel.fidelity = 99, "high"
    panel.show_preset(name)
    assert panel.scenario() == load_scenario(name, ["fidelity=high", "seed=99", PANELS_OUTPUTS])


@pytest.mark.parametrize("value", [0.1, 59.999, 123.456, 8.3, 1999.9])
def test_a_number_typed_in_is_that_number(panel: Any, value: float) -> None:
    panel.scan.platform.speed, panel.scan.platform.height = min(value, 99.9), max(value, 2.1)
    platform = panel.scenario().scan.platform
    assert (platform.speed, platform.height) == (min(value, 99.9), max(value, 2.1))


@pytest.mark.parametrize(("text", "offsets"), [("10, -10", (10, -10)), (" 1.25;3 ", (1.25, 3)), ("", None)])
def test_numbers_are_written_one_after_the_other(panel: Any, text: str, offsets: Any) -> None:
    panel.scan.platform.lateral_offsets = text
    assert panel.scenario().scan.platform.lateral_offsets == offsets


def test_what_is_no_number_is_refused_by_name(panel: Any) -> None:
    panel.scan.platform.lateral_offsets = "10, left"
    with pytest.raises(InputError, match=r"scan\.platform\.lateral_offsets is '10, left': must be numbers"):
        panel.scenario()


def test_a_map_origin_is_exact(panel: Any) -> None:
    panel.road.map_origin = "294123.4567, 5628000.123, 180"
    assert panel.scenario().road.map_origin == (294123.4567, 5628000.123, 180.0)


def test_files_beside_the_blend_file_are_named_in_full(panel: Any, tmp_path: Any) -> None:
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    panel = bpy.context.scene.synthroads
    panel.road.elevation_model = "//ground.asc"
    panel.road.assets.add().file = "//mine.json"
    road = panel.scenario().road
    assert (road.elevation_model, road.assets) == (str(tmp_path / "ground.asc"), (str(tmp_path / "mine.json"),))


# --- the schema in Blender -------------------------------------------------------------------------------------------

SCHEMA = Scenario.model_json_schema()


def schema_of(path: str) -> dict[str, Any]:
    """Return what the published JSON Schema says of a field."""
    node: dict[str, Any] = SCHEMA
    for part in path.split("."):
        kinds_of_node = map(resolved, node.get("oneOf", [node]))
        node = resolved(next(kind["properties"][part] for kind in kinds_of_node if part in kind["properties"]))
    return node


def resolved(node: dict[str, Any]) -> dict[str, Any]:
    if "$ref" in node:
        return SCHEMA["$defs"][node["$ref"].rpartition("/")[2]] | {k: v for k, v in node.items() if k != "$ref"}
    choices = [part for part in node.get("anyOf", ()) if part.get("type") != "null"]
    return (resolved(choices[0]) | node) if len(choices) == 1 else node


NUMBERS = sorted(path for path, field in PATHS.items() if type(field) is kinds.NumberField)


def test_there_are_numbers_to_be_tested() -> None:
    assert len(NUMBERS) > 50


@pytest.mark.parametrize("path", NUMBERS)
def test_numbers_are_the_schemas(panel: Any, path: str) -> None:
    schema, field = schema_of(path), PATHS[path]
    shown = PATHS[path].owner(panel).bl_rna.properties[field.name]
    low = schema.get("minimum", schema.get("exclusiveMinimum"))
    high = schema.get("maximum", schema.get("exclusiveMaximum"))
    assert shown.hard_min == (np.float32(low) if shown.type == "FLOAT" else low)
    assert shown.hard_max == np.float32(high) or (shown.type == "INT" and shown.hard_max == min(high, 2**31 - 1))
    description, _, hint = shown.description.partition(". Allowed: ")
    assert description.partition(", e.g. ")[0] == schema["description"].removesuffix(".")
    for limit in (low, high):
        if limit is not None and abs(limit) < LARGEST:
            assert f"{limit:g}" in hint
    large = field.optional and high > 2**31 - 1
    assert shown.type == ("INT" if "integer" in json.dumps(schema) and not large else "FLOAT")
    assert shown.unit == BLENDERS.get(schema["unit"], "NONE")
    said = schema["unit"] in ("1", "px", *BLENDERS) or "(" in shown.name or "per" in shown.name.lower()
    assert said, f"{shown.name} says no unit"


def test_every_field_has_a_tooltip(panel: Any) -> None:
    for path, field in PATHS.items():
        for name in field.properties({}):
            shown = PATHS[path].owner(panel).bl_rna.properties[name]
            assert path == "title" or len(shown.description) > 3, path


def test_choices_are_the_schemas(panel: Any) -> None:
    shown = {
        path: PATHS[path].owner(panel).bl_rna.properties[PATHS[path].name].enum_items.keys()
        for path in ("fidelity", "scan.platform.kind", "road.design_class", "road.cross_section", "scan.rays_per_pulse")
    }
    assert shown["fidelity"] == list(FIDELITIES)
    assert shown["scan.platform.kind"] == list(PLATFORMS)
    assert shown["road.design_class"] == list(SECTIONS_OF_CLASS)
    assert shown["road.cross_section"] == [*STANDARD_CROSS_SECTIONS, BY_HAND]
    assert shown["scan.rays_per_pulse"] == [kinds.AUTOMATIC, "1", "7", "19", "37", "61"]


def test_labels_are_for_people() -> None:
    assert PATHS["scan.field_of_view_deg"].label == "Field of View (°)"
    assert PATHS["scan.pulse_rate_khz"].label == "Pulse Rate (kHz)"
    assert PATHS["road.turnouts.lane_length"].label == "Lane Length"
    assert PATHS["scan.relief"].label == ScanScenario.model_fields["relief"].title == "Micro-Relief"
    raw = [field.label for field in PATHS.values() if "_" in field.label or field.label != field.label.strip()]
    assert raw == []


class New(ClosedModel):
    """A part of the schema that isn't there yet."""

    height: float = quantity(2.0, ge=1, le=3, unit="m", description="Height.")
    count: int | None = quantity(None, ge=1, le=9, unit="1", description="Count.")
    wanted: bool = Field(True, description="Whether.")
    kind: Literal["big", "small"] = Field("big", description="Kind.")
    colours: tuple[Literal["red", "blue"], ...] = Field(("red",), description="Colours.")
    width: Interval = interval(1.0, 2.0, "m", "Width.")
    places: tuple[float, ...] | None = Field(None, description="Places, m.")
    names: tuple[str, ...] = Field((), description="Names of files.")
    note: str = Field("", description="Note.")
    file: str | None = Field(None, description="File.")
    table: dict[str, float] = Field({}, description="Anything else.")
    constant: Literal["x"] = "x"


EXPECTED = {
    "height": kinds.NumberField,
    "count": kinds.NumberField,
    "wanted": kinds.FlagField,
    "kind": kinds.ChoiceField,
    "colours": kinds.ChoicesField,
    "width": kinds.IntervalField,
    "places": kinds.NumbersField,
    "names": kinds.FilesField,
    "note": kinds.TextField,
    "file": kinds.TextField,
    "table": kinds.JsonField,
}


def test_a_new_field_has_its_properties_by_itself() -> None:
    whole = type("Whole", (ClosedModel,), {"__annotations__": {"new": New}, "new": Field(New(), description="New.")})
    made = make_fields(whole, {"new": json.loads(New().to_json())}, "", {})
    part = made["new"]
    assert isinstance(part, GroupField)
    assert {name: type(field) for name, field in part.fields.items()} == EXPECTED
    assert [field.path for field in leaves(made)] == [f"new.{name}" for name in EXPECTED]
    bpy.utils.register_class(part.group)
    bpy.types.Scene.synthroads_new = bpy.props.PointerProperty(type=part.group)
    try:
        values = {"height": 1.5, "count": 3, "wanted": False, "kind": "small", "colours": ["red", "blue"]}
        values |= {"width": {"minimum": 0.25, "maximum": 0.5}, "places": [1.25, 3], "names": ["a.json"]}
        values |= {"note": "n", "file": "f.csv", "table": {"a": 1.5}}
        owner = bpy.context.scene.synthroads_new
        write_fields(part.fields, owner, values)
        assert read_fields(part.fields, owner, None) == values
        write_fields(part.fields, owner, {**values, "count": None, "places": None, "file": None})
        assert {"count", "places", "file"}.isdisjoint(read_fields(part.fields, owner, None))
    finally:
        del bpy.types.Scene.synthroads_new
        bpy.utils.unregister_class(part.group)


def test_registering_is_quick() -> None:
    synthroads_addon.unregister()
    assert quiet_seconds(synthroads_addon.register) < 0.1


# --- what follows from a change --------------------------------------------------------------------------------------


def test_another_device_takes_its_own_setting(panel: Any) -> None:
    assert panel.scenario().scan.pulse_rate_khz == 200.0
    panel.scan.device = "velodyne-vlp-16"
    scan = panel.scenario().scan
    own = (scan.pulse_rate_khz, scan.field_of_view_deg, scan.lines_per_second, scan.angle_step_deg)
    assert own == (None, None, None, None)
    assert PATHS["scan.pulse_rate_khz"].inherited(panel) == load_device("velodyne-vlp-16").modes[0].pulse_rate_khz


def test_another_platform_takes_its_usual_path(panel: Any) -> None:
    panel.scan.platform.kind = "vehicle"
    platform = panel.scenario().scan.platform
    assert (platform.height, platform.speed, platform.lateral_offsets) == (None, None, None)
    assert PATHS["scan.platform.height"].inherited(panel) == PLATFORMS["vehicle"].usual["height"]


@pytest.mark.parametrize("kind", PLATFORMS)
def test_another_platform_begins_with_the_values_of_its_fields(panel: Any, kind: str) -> None:
    panel.scan.platform.kind = kind
    if kind == "trajectory":
        panel.scan.platform.file = "flight.csv"
    got, first = panel.scenario().scan.platform.to_dict(), PLATFORMS[kind].model_fields
    wanted = {name: first[name].default for name in got if name != "file"}
    assert {name: got[name] for name in wanted} == pytest.approx(wanted)


def test_section_and_class_go_together(panel: Any) -> None:
    for name in STANDARD_CROSS_SECTIONS:
        panel.road.cross_section = name
        assert panel.scenario().road.cross_section == name
    for name, allowed in SECTIONS_OF_CLASS.items():
        panel.road.design_class = name
        assert panel.scenario().road.cross_section in allowed
    for changed, value, phones in (
        ("design_class", "EKA1A", True),
        ("design_class", "EKL3", False),
        ("cross_section", "RQ31", True),
        ("cross_section", "RQ9", False),
    ):
        setattr(panel.road, changed, value)
        assert panel.road.furniture.emergency_phones is phones
        assert panel.scenario().road.turnouts.exits == pytest.approx(0.3 if phones else 0.0)
    panel.road.cross_section = BY_HAND
    panel.road.design_class = "EKA3"
    assert panel.scenario().road.cross_section.lanes == (3.75, 3.75)


def test_what_excludes_each_other_is_never_given_together(panel: Any) -> None:
    scan = panel.scan
    scan.own_attenuation = True
    scan.own_weather = True
    assert panel.scenario().scan.attenuation is None
    scan.own_attenuation = True
    assert panel.scenario().scan.weather is None
    scan.own_weather = True
    scan.weather.condition = "rain"
    scan.weather.own_visibility = True
    scan.weather.own_rate_mm_h = True
    scan.weather.rate_mm_h = 5.0
    assert panel.scenario().scan.weather.visibility is None
    scan.weather.condition = "fog"
    assert panel.scenario().scan.weather.to_dict() == {"condition": "fog", "echoes": False}
    scan.rays_per_pulse = "19"
    scan.beam_rings = "6, 12"
    assert (panel.scenario().scan.rays_per_pulse, panel.scenario().scan.beam_rings) == (None, (6, 12))
    scan.rays_per_pulse = "7"
    assert (panel.scenario().scan.rays_per_pulse, panel.scenario().scan.beam_rings) == (7, None)
    panel.colour.lighting = "path"
    panel.colour.own_samples = True
    panel.colour.samples = 9
    panel.colour.lighting = "direct"
    assert panel.scenario().colour.samples is None


def test_an_interval_stays_in_order(panel: Any) -> None:
    turnouts = panel.road.turnouts
    turnouts.lane_length_minimum = 400.0
    assert panel.scenario().road.turnouts.lane_length == Interval(minimum=400.0, maximum=400.0)
    turnouts.lane_length_maximum = 200.0
    assert panel.scenario().road.turnouts.lane_length == Interval(minimum=200.0, maximum=200.0)


OWN = sorted(
    path
    for path, field in PATHS.items()
    if isinstance(field, kinds.NumberField | kinds.IntervalField) and field.optional
)


@pytest.mark.parametrize("path", OWN)
def test_a_value_of_ones_own_begins_with_what_was_shown(panel: Any, path: str) -> None:
    panel.show_scenario(Scenario())
    if path == "scan.weather.visibility":
        panel.scan.own_weather = True
    field = PATHS[path]
    owner, value, shown = field.owner(panel), field.inherited(panel), field.inherited_text(panel)
    assert shown not in ("", "Automatic"), "says nothing of what it has while it isn't given"
    setattr(owner, field.checkbox_name, True)
    if value is not None:
        got = field.read(owner, None)
        got = tuple(got.values()) if isinstance(got, dict) else got
        assert got == pytest.approx(value, rel=1e-6)
        assert panel.scenario()


def test_what_is_inherited_is_what_the_scenario_has(panel: Any) -> None:
    panel.show_scenario(Scenario(fidelity="high"))
    scenario = panel.scenario()
    numbers, colour = scenario.settings(), scenario.colour.settings("high")
    assert PATHS["geometric_tolerance"].inherited(panel) == numbers.tolerance
    assert PATHS["scan.rays_per_pulse"].inherited(panel) == numbers.rays_per_pulse
    assert PATHS["colour.image_spacing"].inherited(panel) == colour.image_spacing
    assert PATHS["colour.samples"].inherited(panel) == colour.samples


@pytest.mark.parametrize("pulses", [7, 5_000_000_000, 40_000_000_001, MOST_POSSIBLE])
def test_a_scan_may_have_more_pulses_than_fit_into_32_bits(panel: Any, pulses: int) -> None:
    panel.show_scenario(Scenario.from_dict({"scan": {"most_pulses": pulses}}))
    assert panel.scenario().scan.most_pulses == pulses


def test_a_limit_of_pulses_begins_where_it_refuses_nothing(panel: Any) -> None:
    panel.scan.own_most_pulses = True
    assert panel.scenario().scan.most_pulses == MOST_POSSIBLE
    panel.scan.most_pulses = 3e10
    assert panel.scenario().scan.most_pulses == 30_000_000_000


def test_a_seed_too_long_for_blender_is_kept_until_another_is_given(panel: Any) -> None:
    panel.show_scenario(Scenario(seed=10**15))
    assert (panel.scenario().seed, panel.exact_seed()) == (10**15, 10**15)
    panel.seed = 5
    assert (panel.scenario().seed, panel.exact_seed()) == (5, 5)
