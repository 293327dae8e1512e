"""The panels as they are laid out: snapshots, every field in its place, menus of presets, preferences, file dialogs."""

import json
import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
import pytest
from pydantic import BaseModel

import synthroads_addon
from synthroads_addon.base.schema import note_of
from synthroads_addon.blender.model.build import build_road
from synthroads_addon.blender.model.store import find_road, remember
from synthroads_addon.blender.things.model_builder import BuildRequest
from synthroads_addon.road.things.limits import Interval
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scanning.devices.device import DEVICES, device_names
from synthroads_addon.scanning.platforms.registry import PLATFORMS
from synthroads_addon.scanning.weather.registry import WEATHERS
from synthroads_addon.scenario.scenario import Scenario, load_scenario, scenario_names
from synthroads_addon.ui.fields import preferences, room
from synthroads_addon.ui.fields.choices import BY_HAND
from synthroads_addon.ui.fields.inherited import SOURCES
from synthroads_addon.ui.fields.properties import PATHS
from synthroads_addon.ui.fields.sheets import SHEETS, fields_of
from synthroads_addon.ui.panels import panels, presets
from synthroads_addon.ui.work import build
from tests.helpers.scenes.fake_layout import drawn

SNAPSHOTS = Path(__file__).parent / "snapshots"
WRITE = "SYNTHROADS_WRITE_SNAPSHOTS"
EXCEPTIONS = {
    "type": "says what kind of file it is",
    "version": "says which form the file has",
    "tolerance": "the panel builds the road before it is scanned, with knobs that are seen and set",
    "time_budget": "likewise",
}
"""Fields of the scenario that no panel shows, and why."""
OF_ROAD = ("title", "seed", "fidelity", "geometric_tolerance", "vegetation_detail", "road")
"""Parts of the scenario that a road is built from."""


@pytest.fixture(autouse=True)
def panel(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """Register the add-on for one test, in a wide sidebar; return the panel's settings."""
    monkeypatch.setattr(room, "sidebar_width", lambda: 450.0)
    synthroads_addon.register()
    yield bpy.context.scene.synthroads
    synthroads_addon.unregister()


@pytest.fixture
def library(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A library folder of the user's own."""
    monkeypatch.setattr(preferences, "_usual_library", lambda: str(tmp_path / "library"))
    for kind in ("scenarios", "devices"):
        (tmp_path / "library" / kind).mkdir(parents=True)
    return tmp_path / "library"


def layout(name: str) -> str:
    """Return all of a top panel and those within it, as they are laid out."""
    cls = next(c for c in panels.CLASSES if c.bl_idname == f"SYNTHROADS_PT_{name}")
    inner = [sheet.name for sheet in SHEETS if sheet.parent == name and name != "main"]
    state = "closed" if "DEFAULT_CLOSED" in cls.bl_options else "open"
    text = f"== {cls.bl_label} ({cls.bl_order}, {state}) ==\n" + "\n".join(drawn(cls, bpy.context).lines) + "\n"
    return text + "".join(layout(child) for child in inner)


# --- snapshots -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", [sheet.name for sheet in SHEETS if sheet.parent in ("", "main")])
def test_layout(name: str, library: Path) -> None:
    """Blender 4.5 and 5.2 draw the same."""
    file = SNAPSHOTS / f"panel {name}.txt"
    text = layout(name).replace(str(library), "LIBRARY")
    if os.environ.get(WRITE):
        file.write_text(text, encoding="utf-8")
    assert text == file.read_text(encoding="utf-8"), f"set {WRITE}=1 to write what is drawn now"


def test_the_road_panel_says_what_the_road_was_built_from(panel: Any) -> None:
    scenario = load_scenario("rq31-600m", ["road.length=20"])
    parameters = sample_road(scenario.road, 1)
    road = build_road(BuildRequest(parameters, 0.02, 0.0)).root
    for built_from, said in (
        ("", ["label 'Built by a command, not from these settings' <FILE>"]),
        ('["file", "mine.json"]', ["label 'Built from mine.json' <FILE>"]),
        ("[]", ["label 'Changed since it was built' <INFO>"]),
        (panel.road_values(), []),
    ):
        remember(road, parameters, scenario, built_from)
        lines = layout("road").splitlines()
        assert [line for line in lines if line.startswith(("label 'Built", "label 'Changed"))] == said


def road_properties(group: Any, path: str = "") -> Iterator[tuple[Any, str, str]]:
    """Yield (property group, name, path) of all properties that a road is built from, by Blender's own list of them."""
    for prop in group.bl_rna.properties:
        below = f"{path}.{prop.identifier}".lstrip(".")
        if prop.identifier in ("rna_type", "name"):
            continue
        if not path and below.removeprefix("own_") not in OF_ROAD:
            continue
        if prop.type == "POINTER":
            yield from road_properties(getattr(group, prop.identifier), below)
        else:
            yield group, prop.identifier, below


def set_another_value(group: Any, name: str) -> None:
    """Set a property to a value that it doesn't have, as a user may."""
    prop, value = group.bl_rna.properties[name], getattr(group, name)
    if prop.type == "BOOLEAN":
        setattr(group, name, not value)
    elif prop.type == "ENUM":
        items = prop.enum_items.keys()
        setattr(group, name, value ^ {items[0]} if prop.is_enum_flag else next(item for item in items if item != value))
    elif prop.type == "STRING":
        setattr(group, name, value + "1")
    elif prop.type == "COLLECTION":
        value.add().file = "mine.json"
    else:
        setattr(group, name, prop.hard_max if value != prop.hard_max else prop.hard_min)


def says_changed() -> bool:
    """Return whether the panel of the road says that its settings have changed."""
    return "label 'Changed since it was built' <INFO>" in layout("road").splitlines()


def test_every_setting_that_is_shown_says_that_the_road_has_changed(panel: Any) -> None:
    scenario = load_scenario("rq31-600m", ["road.length=20"])
    parameters = sample_road(scenario.road, 1)
    road = build_road(BuildRequest(parameters, 0.02, 0.0)).root
    panel.road.cross_section = BY_HAND
    for group, name, _ in road_properties(panel):
        if name.startswith("own_"):
            setattr(group, name, True)
    seen = set()
    for group, name, path in road_properties(panel):
        remember(road, parameters, scenario, panel.road_values())
        assert not says_changed(), f"before {path}"
        set_another_value(group, name)
        assert says_changed(), path
        if name == "cross_section":
            group.cross_section = BY_HAND
        if name.startswith("own_"):
            setattr(group, name, True)
        seen.add(path)
    wanted = [path for path in PATHS if path.partition(".")[0] in OF_ROAD]
    missing = [path for path in wanted if not {path, f"{path}_minimum"} & seen]
    assert missing == []


def test_what_is_not_given_is_no_change(panel: Any) -> None:
    panel.road.own_radius = False
    before = panel.road_values()
    panel.road.radius_minimum += 1.0
    panel.road.cross_section_by_hand.median += 1.0
    assert panel.road_values() == before


def test_building_clears_what_has_changed(panel: Any) -> None:
    panel.road.length, panel.road.half_width, panel.seed = 40.0, 20.0, 5
    bpy.ops.synthroads.build()
    assert not says_changed()
    panel.road.grass_density += 0.1
    assert says_changed()
    bpy.ops.synthroads.build()
    assert not says_changed()


def test_panels_stand_in_their_order() -> None:
    tops = sorted((sheet.order, sheet.title) for sheet in SHEETS if sheet.parent == "main")
    assert [title for _, title in tops] == ["Road", "Objects", "Environment", "Scanner", "Colour", "Output"]
    for cls in panels.CLASSES:
        assert bpy.types.Panel.bl_rna_get_subclass_py(cls.bl_idname) is cls


def test_few_fields_are_open_at_first() -> None:
    """A newcomer sees no more than a dozen rows before having built a road."""
    closed = {sheet.name for sheet in SHEETS if sheet.closed}
    seen = [sheet for sheet in SHEETS if not sheet.closed and sheet.parent not in closed]
    assert sum(len(fields_of(sheet)) for sheet in seen) <= 12


# --- every field of the scenario -------------------------------------------------------------------------------------


def schema_paths(model: type[BaseModel], prefix: str = "") -> Iterator[str]:
    """Yield every field of the scenario by walking its values, the first of each kind: not the panel's own way."""
    schema = model.model_json_schema()

    def walk(node: dict[str, Any], path: str) -> Iterator[str]:
        if "$ref" in node:
            node = schema["$defs"][node["$ref"].rpartition("/")[2]]
        choices = [kind for part in node.get("anyOf", [node]) for kind in part.get("oneOf", [part])]
        inner = [part for part in choices if "$ref" in part or "properties" in part]
        if node.get("title") == Interval.__name__ or not inner:
            yield path
            return
        for part in inner:
            target = schema["$defs"][part["$ref"].rpartition("/")[2]] if "$ref" in part else part
            if target.get("title") == Interval.__name__:
                yield path
                continue
            for name, child in target["properties"].items():
                if not child.get("deprecated"):  # of earlier versions: read, and left out
                    yield from walk(child, f"{path}.{name}" if path else name)

    yield from walk(schema, prefix)


def states(settings: Any) -> Iterator[None]:
    """Set the panel to one state after the other that together give every field a meaning."""
    chosen = [("uav", "smoothed", "snow", "angles"), ("uav", "zigzag", "snow", "time")]
    chosen += [(kind, "direct", "snow", "angles") for kind in PLATFORMS]
    chosen += [("uav", "direct", condition, "angles") for condition in WEATHERS]
    for kind, path, condition, sun_place in chosen:
        settings.show_scenario(Scenario())
        settings.scan.platform.kind, settings.scan.platform.path = kind, path
        settings.road.cross_section = BY_HAND
        for field in PATHS.values():
            if field.optional and hasattr(field, "checkbox_name") and field.path not in ("scan.attenuation",):
                owner = settings
                for part in field.path.split(".")[:-1]:
                    owner = getattr(owner, part)
                if hasattr(owner, field.checkbox_name):
                    setattr(owner, field.checkbox_name, True)
        settings.scan.weather.condition, settings.road.environment.sun_place = condition, sun_place
        settings.colour.source, settings.colour.lighting = "images", "path"
        settings.scan.cameras.trigger = "time" if path == "zigzag" else "distance"
        yield


def test_every_field_is_in_some_panel(panel: Any) -> None:
    used: set[str] = set()
    for _ in states(panel):
        for cls in panels.CLASSES:
            for data, name in drawn(cls, bpy.context).used:
                part = repr(data.path_from_id()) if data != panel else "synthroads"
                part = part.strip("'\"").removeprefix("synthroads").removeprefix(".")
                used.add(f"{part}.{name}".lstrip("."))
    wanted = [path for path in schema_paths(Scenario) if path.partition(".")[0] not in EXCEPTIONS]
    missing = [path for path in wanted if not _seen(path, used)]
    assert missing == ["scan.device"], "the device has a menu of its own, all others are drawn"
    assert {field.path for sheet in SHEETS for field in fields_of(sheet)} == set(PATHS), "each has its place"
    assert set(EXCEPTIONS) <= set(Scenario.model_fields)


def _seen(path: str, used: set[str]) -> bool:
    by_hand = path.replace("road.cross_section.", "road.cross_section_by_hand.")
    head, _, name = by_hand.rpartition(".")
    dot = f"{head}." if head else ""
    names = (by_hand, f"{by_hand}_minimum", f"{dot}own_{name}")
    if path == "road.assets":
        return True  # its buttons: `test_assets_are_a_list_of_files`
    return any(one in used for one in names)


def test_notes_of_the_schema_name_what_is_there(panel: Any) -> None:
    for _ in states(panel):
        for path, field in PATHS.items():
            info, model = field.declared(panel)
            if info is not None:
                assert set(note_of(info, "only_with") or {}) <= set(model.model_fields), path
                assert (note_of(info, "inherits") or "device.").partition(".")[0] in SOURCES, path


def test_sheets_name_fields_that_are_there() -> None:
    for sheet in SHEETS:
        for row in sheet.rows.split():
            assert row.endswith("*") or row in PATHS, row
            assert fields_of(sheet)


def test_no_field_stands_in_two_panels() -> None:
    shown = [field.path for sheet in SHEETS for field in fields_of(sheet)]
    assert sorted(shown) == sorted(set(shown))


def test_assets_are_a_list_of_files(panel: Any) -> None:
    cls = next(c for c in panels.CLASSES if c.bl_idname == "SYNTHROADS_PT_assets")
    assert bpy.ops.synthroads.add_file(path="road.assets", filepath="/a.json") == {"FINISHED"}
    assert bpy.ops.synthroads.add_file(path="road.assets", filepath="/b.json") == {"FINISHED"}
    assert sum("string file" in line for line in drawn(cls, bpy.context).lines) == 2
    bpy.ops.synthroads.remove_file(path="road.assets", number=0)
    assert panel.scenario().road.assets == ("/b.json",)


# --- presets ---------------------------------------------------------------------------------------------------------


def buttons(menu: type) -> list[str]:
    return [line for line in drawn(menu, bpy.context).lines if line.startswith("button")]


def test_menus_list_what_is_built_in_and_the_library(panel: Any, library: Path) -> None:
    shutil.copy(DEVICES / "livox-mid-70.json", library / "devices" / "mine.json")
    (library / "scenarios" / "my-road.json").write_text(Scenario(seed=7).to_json())
    assert len(buttons(presets.SYNTHROADS_MT_devices)) == len(device_names()) + 2
    listed = buttons(presets.SYNTHROADS_MT_scenarios)
    assert len(listed) == len(scenario_names()) + 3
    assert "button 'my-road' synthroads.choose_scenario" in listed


@pytest.mark.parametrize("name", scenario_names())
def test_choosing_a_scenario_shows_its_values(panel: Any, name: str) -> None:
    panel.road.length, panel.seed = 77.0, 9
    assert bpy.ops.synthroads.choose_scenario(name=name) == {"FINISHED"}
    wanted = load_scenario(name, ["seed=9", "fidelity=draft"])
    assert panel.scenario().road == wanted.road
    assert panel.scenario().scan == wanted.scan
    assert (panel.scenario().seed, panel.preset) == (9, name)


def test_a_saved_scenario_is_the_same_when_loaded(panel: Any, library: Path) -> None:
    panel.road.length, panel.seed, panel.fidelity = 123.4, 11, "high"
    before = panel.scenario()
    file = library / "scenarios" / "mine.json"
    assert bpy.ops.synthroads.save_scenario(filepath=str(file)) == {"FINISHED"}
    assert load_scenario(str(file)) == before
    assert [path.name for path in file.parent.iterdir()] == ["mine.json"]
    bpy.ops.synthroads.choose_scenario(name="tripod-200m")
    assert panel.scenario() != before
    assert bpy.ops.synthroads.load_scenario(filepath=str(file)) == {"FINISHED"}
    assert panel.scenario() == before


def test_a_wrong_file_is_refused_and_changes_nothing(panel: Any, tmp_path: Path) -> None:
    before = panel.scenario()
    (tmp_path / "bad.json").write_text('{"road": {"lenght": 5}}')
    with pytest.raises(RuntimeError, match=r"unknown key 'lenght'.*length"):
        bpy.ops.synthroads.load_scenario(filepath=str(tmp_path / "bad.json"))
    with pytest.raises(RuntimeError, match="no such file"):
        bpy.ops.synthroads.load_device(filepath=str(tmp_path / "none.json"))
    with pytest.raises(RuntimeError, match="unknown key 'road'"):
        bpy.ops.synthroads.load_device(filepath=str(tmp_path / "bad.json"))
    assert panel.scenario() == before


def test_a_device_of_ones_own_is_scanned_with(panel: Any, library: Path) -> None:
    file = library / "devices" / "mine.json"
    device = json.loads((DEVICES / "velodyne-vlp-16.json").read_text()) | {"title": "My Own"}
    file.write_text(json.dumps(device))
    assert bpy.ops.synthroads.choose_device(name=str(file)) == {"FINISHED"}
    assert panel.scenario().scan.device == str(file)
    scanner = next(c for c in panels.CLASSES if c.bl_idname == "SYNTHROADS_PT_scanner")
    assert any("menu 'My Own'" in line for line in drawn(scanner, bpy.context).lines)


def test_random_road_draws_the_next_seed_and_builds_it(panel: Any) -> None:
    panel.road.length, panel.road.half_width, panel.seed = 60.0, 20.0, 5
    assert bpy.ops.synthroads.random_road() == {"FINISHED"}
    first = panel.seed
    assert first == build.next_seed(5) != 5
    road = find_road(bpy.context.scene)
    scenario = panel.scenario()
    expected = sample_road(scenario.road, first, scenario.title).to_json()
    assert road["synthroads_parameters"] == expected
    panel.seed = 5
    bpy.ops.synthroads.random_road()
    assert panel.seed == first


def test_a_random_road_that_cannot_be_leaves_the_seed(panel: Any) -> None:
    panel.road.own_radius = True
    panel.road.radius_minimum = panel.road.radius_maximum = 10.0
    panel.seed = 5
    with pytest.raises(RuntimeError, match="Radius, smallest value"):
        bpy.ops.synthroads.random_road()
    assert panel.seed == 5


def test_a_menu_of_a_thousand_seeds_repeats_none() -> None:
    seed, seen = 1, set()
    for _ in range(1000):
        seed = build.next_seed(seed)
        seen.add(seed)
    assert len(seen) == 1000


# --- preferences -----------------------------------------------------------------------------------------------------


@pytest.fixture
def entry() -> Iterator[Any]:
    """The add-on's entry in the preferences, as when it is installed."""
    addon = bpy.context.preferences.addons.new()
    addon.module = "synthroads_addon"
    yield addon.preferences
    bpy.context.preferences.addons.remove(addon)


def test_without_an_entry_preferences_are_as_at_first() -> None:
    chosen = preferences.preferences()
    assert (chosen.cores, chosen.caster, chosen.output_folder) == (0, "auto", "//synthroads")
    assert Path(chosen.library_folder).name == "synthroads"


def test_preferences_are_read_from_their_entry(entry: Any, tmp_path: Path, panel: Any) -> None:
    assert entry.bl_rna.identifier == "SYNTHROADS_AP_preferences"
    assert preferences.PACKAGE == "synthroads_addon"
    entry.cores, entry.caster = 3, "bvhtree"
    entry.output_folder, entry.library_folder = str(tmp_path / "out"), str(tmp_path / "mine")
    chosen = preferences.preferences()
    assert chosen == preferences.Preferences(3, "bvhtree", str(tmp_path / "out"), str(tmp_path / "mine"))
    assert chosen.library("devices") == tmp_path / "mine" / "devices"
    assert panel.folder() == tmp_path / "out"
    panel.output = str(tmp_path / "other")
    assert panel.folder() == tmp_path / "other"


def test_a_scenario_casts_as_the_preferences_say_unless_it_says_so_itself(entry: Any) -> None:
    entry.cores, entry.caster = 3, "bvhtree"
    open_one = preferences.with_preferences(Scenario()).scan
    assert (open_one.threads, open_one.caster) == (3, "bvhtree")
    said = load_scenario("rq31-600m", ["scan.threads=1", "scan.caster=embree"])
    assert preferences.with_preferences(said) == said
