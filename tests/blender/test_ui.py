"""The panel: properties that are the schema's, buttons that do what the library does, messages, nothing left over."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from pydantic import BaseModel

import synthroads_addon
from synthroads_addon.blender.compat import set_modifier_input
from synthroads_addon.blender.model_builder import ROLE
from synthroads_addon.core.errors import Cancelled, InputError
from synthroads_addon.core.parameters.limits import STANDARD_CROSS_SECTIONS
from synthroads_addon.core.parameters.model import read_parameters
from synthroads_addon.core.road_scenario import RoadScenario
from synthroads_addon.core.scan_scenario import Platform
from synthroads_addon.core.scanning.devices import device_names
from synthroads_addon.core.scanning.path import USUAL
from synthroads_addon.core.scenario import FIDELITIES, Scenario, load_scenario, scenario_names
from synthroads_addon.pipeline import FILES, Job, generate
from synthroads_addon.ui import operators, properties, scan_job

NUMBERS: dict[str, tuple[type[BaseModel], str]] = {
    "seed": (Scenario, "seed"),
    "length": (RoadScenario, "length"),
    "height": (Platform, "height"),
    "speed": (Platform, "speed"),
}
CHEAP = ["road.half_width=20", "scan.lines_per_second=50", "scan.platform.lateral_offsets=[0]"]  # not in the panel
CHEAP += ["colour.source=material"]
SMALL = {"length": 120.0, "speed": 40.0, "seed": 3}
SAME = ["fidelity=draft", "road.length=120", "scan.platform.speed=40", "seed=3", *CHEAP]
WRITTEN = sorted([n for o in ("parameters", "cloud", "centerline", "previews") for n in FILES[o]] + ["report.json"])


@pytest.fixture(autouse=True)
def settings() -> Iterator[Any]:
    """Register the add-on for one test; return the panel's settings."""
    synthroads_addon.register()
    yield bpy.context.scene.synthroads
    synthroads_addon.unregister()


@pytest.fixture
def cheap(settings: Any, monkeypatch: pytest.MonkeyPatch) -> Any:
    """The panel's settings, with the scenario behind them made small."""
    monkeypatch.setattr(properties, "load_scenario", lambda name, changes=(): load_scenario(name, [*CHEAP, *changes]))
    choose(settings, **SMALL)
    return settings


@pytest.fixture(scope="module")
def road_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A file with a small road, built from the panel and saved."""
    file = tmp_path_factory.mktemp("road") / "road.blend"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(properties, "load_scenario", lambda name, changes=(): load_scenario(name, [*CHEAP, *changes]))
        synthroads_addon.register()
        choose(bpy.context.scene.synthroads, **SMALL)
        bpy.ops.synthroads.build()
        bpy.ops.wm.save_as_mainfile(filepath=str(file))
        synthroads_addon.unregister()
    return file


@pytest.fixture
def road(road_file: Path, cheap: Any, tmp_path: Path) -> Any:
    """Open that file; return its panel's settings, with a folder for the output."""
    bpy.ops.wm.open_mainfile(filepath=str(road_file))
    settings = bpy.context.scene.synthroads
    settings.output = str(tmp_path / "out")
    return settings


def choose(settings: Any, **values: Any) -> None:
    for name, value in values.items():
        setattr(settings, name, value)


def fingerprint(item: bpy.types.Object) -> tuple:
    """Return all of a mesh object that a user would miss."""
    corners = np.empty(3 * len(item.data.vertices), np.float32)
    item.data.vertices.foreach_get("co", corners)
    return (
        item.name,
        tuple(map(tuple, item.matrix_world)),
        item.data.name,
        corners.tobytes(),
        [slot.name for slot in item.material_slots],
        [modifier.type for modifier in item.modifiers],
        [collection.name for collection in item.users_collection],
        dict(item.items()),
        (item.hide_get(), item.hide_viewport, item.select_get()),
    )


@pytest.fixture
def users_own() -> bpy.types.Object:
    """An object of the user's own, in a collection of its own, with a material and a modifier."""
    bpy.ops.mesh.primitive_cube_add(location=(500.0, 500.0, 0.0))
    item = bpy.context.object
    item.modifiers.new("Bevel", "BEVEL")
    item.data.materials.append(bpy.data.materials.new("Mine"))
    item["note"] = "keep"
    mine = bpy.data.collections.new("Mine")
    bpy.context.scene.collection.children.link(mine)
    mine.objects.link(item)
    return item


def traces() -> tuple[set[str], list[str], bool]:
    names = {name for name in dir(bpy.types) if "synthroads" in name.lower()}
    return names, dir(bpy.ops.synthroads), hasattr(bpy.types.Scene, "synthroads")


def test_registering_twice_leaves_no_trace() -> None:
    synthroads_addon.unregister()
    assert traces() == (set(), [], False)
    for _ in range(2):
        synthroads_addon.register()
        assert traces()[2]
        assert traces()[1] == ["build", "cancel_scan", "scan"]
        synthroads_addon.unregister()
        assert traces() == (set(), [], False)
    synthroads_addon.register()


@pytest.mark.parametrize("name", NUMBERS)
def test_numbers_are_the_schemas(settings: Any, name: str) -> None:
    model, field = NUMBERS[name]
    schema = model.model_json_schema()["properties"][field]
    schema |= schema.get("anyOf", [{}])[0]  # a field that may be left out
    shown = settings.bl_rna.properties[name]
    usual = getattr(USUAL["uav"], name, None)
    assert shown.default == (schema["default"] if usual is None else usual)
    assert shown.hard_min == np.float32(schema["minimum"])
    assert shown.hard_max == np.float32(schema["maximum"]) or shown.hard_max == 2**31 - 1 < schema["maximum"]
    assert shown.description == schema["description"].removesuffix(".")
    assert (shown.type, shown.unit) == {
        "1": ("INT", "NONE"),
        "m": ("FLOAT", "LENGTH"),
        "m/s": ("FLOAT", "VELOCITY"),
    }[schema["unit"]]


def test_choices_are_the_schemas(settings: Any) -> None:
    names = ("preset", "fidelity", "cross_section", "device", "platform")
    shown = {name: settings.bl_rna.properties[name] for name in names}
    choices = {name: [item.identifier for item in entry.enum_items] for name, entry in shown.items()}
    assert choices["preset"] == scenario_names()
    assert choices["fidelity"] == list(FIDELITIES)
    assert choices["device"] == device_names()
    assert choices["platform"] == list(USUAL)
    assert shown["platform"].default == Scenario().scan.platform.kind
    for name in choices["cross_section"]:
        choose(settings, cross_section=name)
        assert settings.scenario().road.cross_section == name
    assert len(choices["cross_section"]) == len(STANDARD_CROSS_SECTIONS)
    assert shown["cross_section"].default == RoadScenario().cross_section
    assert shown["device"].default == Scenario().scan.device
    assert shown["fidelity"].default == "draft"
    every = {p.identifier for p in settings.bl_rna.properties} - {"rna_type", "name", "output", "overwrite"}
    assert every == {*NUMBERS, *shown}  # a new property needs a test


def test_untouched_settings_are_the_demo_at_draft_fidelity(settings: Any) -> None:
    demo = load_scenario("rq31-600m", ["fidelity=draft", 'outputs=["parameters","cloud","centerline","previews"]'])
    assert settings.scenario() == demo


@pytest.mark.parametrize("value", [0.1, 59.999, 123.456, 8.3, 1999.9])
def test_a_number_typed_in_is_that_number(settings: Any, value: float) -> None:
    choose(settings, speed=min(value, 99.9), height=max(value, 2.1))
    platform = settings.scenario().scan.platform
    assert (platform.speed, platform.height) == (min(value, 99.9), max(value, 2.1))


def test_choosing_a_scenario_shows_its_values(settings: Any) -> None:
    choose(settings, length=77.0, height=33.0, cross_section="RQ36", seed=9, fidelity="high")
    settings.preset = settings.preset
    assert (settings.length, settings.height, settings.cross_section) == (600.0, 60.0, "RQ31")
    assert (settings.seed, settings.fidelity) == (9, "high")


def test_buttons_give_the_same_bytes_as_the_library(cheap: Any, tmp_path: Path) -> None:
    cheap.output = str(tmp_path / "panel")
    assert bpy.ops.synthroads.build() == {"FINISHED"}
    assert bpy.ops.synthroads.scan() == {"FINISHED"}
    assert sorted(path.name for path in (tmp_path / "panel").iterdir()) == WRITTEN
    scenario = load_scenario("rq31-600m", SAME)
    report = generate(Job(scenario, tmp_path / "library", new_file=True))
    for name in set(WRITTEN) - {"report.json"}:
        assert (tmp_path / "panel" / name).read_bytes() == (tmp_path / "library" / name).read_bytes(), name
    written = json.loads((tmp_path / "panel" / "report.json").read_text())
    assert written["counts"] == json.loads(json.dumps(report["counts"]))
    assert written["counts"]["points"] > 10_000


def test_scan_is_of_the_road_that_was_built(road: Any, tmp_path: Path) -> None:
    choose(road, length=90.0, seed=4, speed=50.0)
    bpy.ops.synthroads.scan()
    scenario = json.loads((tmp_path / "out" / "report.json").read_text())["scenario"]
    assert (scenario["road"]["length"], scenario["seed"], scenario["scan"]["platform"]["speed"]) == (120.0, 3, 50.0)
    assert json.loads((tmp_path / "out" / "parameters.json").read_text())["metadata"]["seed"] == 3


def test_a_scan_writes_the_parameters_of_the_edited_road(road: Any, tmp_path: Path) -> None:
    set_modifier_input(bpy.data.objects["Road"].modifiers[0], "Right Lane 1 Width", 4.5)
    road.output = str(tmp_path / "edited")
    assert bpy.ops.synthroads.scan() == {"FINISHED"}
    written = read_parameters(tmp_path / "edited" / "parameters.json")
    assert written.carriageway("right").lanes[0].width == 4.5
    assert written.carriageway("left").lanes[0].width != 4.5


def test_building_and_scanning_leave_the_users_objects_alone(
    cheap: Any, users_own: bpy.types.Object, tmp_path: Path
) -> None:
    before = fingerprint(users_own)
    cheap.output = str(tmp_path)
    bpy.ops.synthroads.build()
    bpy.ops.synthroads.build()  # takes the place of the first road
    built = {item.name: len(item.modifiers) for item in bpy.data.objects}
    bpy.ops.synthroads.scan()
    assert fingerprint(users_own) == before
    assert {item.name: len(item.modifiers) for item in bpy.data.objects} == built
    assert [item.name for item in bpy.data.objects if ROLE not in item] == [users_own.name]


def test_scan_needs_a_road_that_is_still_there(cheap: Any) -> None:
    with pytest.raises(RuntimeError, match="Build a road first"):
        bpy.ops.synthroads.scan()
    bpy.ops.synthroads.build()
    with pytest.raises(RuntimeError, match="Output is '//synthroads': save the file first"):
        bpy.ops.synthroads.scan()
    assert bpy.ops.synthroads.scan.poll()
    for item in [item for item in bpy.data.objects if ROLE in item]:
        bpy.data.objects.remove(item)
    assert not bpy.ops.synthroads.scan.poll()


def test_buttons_wait_for_object_mode(settings: Any, users_own: bpy.types.Object) -> None:
    bpy.context.view_layer.objects.active = users_own
    bpy.ops.object.mode_set(mode="EDIT")
    with pytest.raises(RuntimeError, match="object mode"):
        bpy.ops.synthroads.build()
    bpy.ops.object.mode_set(mode="OBJECT")


def _file_in_the_way(road: Any, folder: Path) -> None:
    (folder / "file").write_text("mine")
    road.output = str(folder / "file" / "out")


def _earlier_scan(road: Any, folder: Path) -> None:
    (folder / "cloud.laz").write_text("mine")
    road.output = str(folder)


def _hide_all(road: Any, folder: Path) -> None:
    bpy.context.view_layer.layer_collection.children["SynthRoads"].exclude = True


def _damage(road: Any, folder: Path) -> None:
    bpy.data.collections["SynthRoads"]["synthroads_parameters"] = "{"


def _wrong_seed(road: Any, folder: Path) -> None:
    stored = json.loads(bpy.data.collections["SynthRoads"]["synthroads_scenario"])
    bpy.data.collections["SynthRoads"]["synthroads_scenario"] = json.dumps(stored | {"seed": -1})


WRONG = {
    "no folder": (lambda road, folder: setattr(road, "output", " "), "Output: choose a folder"),
    "file in the way": (_file_in_the_way, "Output is .*cannot be written"),
    "files already there": (_earlier_scan, "already holds cloud.laz; tick Replace Files"),
    "nothing visible": (_hide_all, "nothing that could be scanned is visible"),
    "damaged set": (_damage, "Road: its parameter set in the file is damaged"),
    "damaged scenario": (_wrong_seed, "Road: seed is -1"),
}
"""How to do something wrong after a road was built, and what the message says."""


@pytest.mark.parametrize("name", WRONG)
def test_what_is_wrong_is_said_and_nothing_written(road: Any, tmp_path: Path, name: str) -> None:
    do_it, message = WRONG[name]
    do_it(road, tmp_path)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    with pytest.raises(RuntimeError, match=message) as caught:
        bpy.ops.synthroads.scan()
    assert "Traceback" not in str(caught.value)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_a_refused_setting_leaves_the_built_road(road: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*arguments: Any) -> None:
        raise InputError("road.radius", 1, "is too small")

    before = sorted(item.name for item in bpy.data.objects)
    monkeypatch.setattr(operators, "sample_road", refuse)
    with pytest.raises(RuntimeError, match=r"Error: road\.radius is 1: is too small"):
        bpy.ops.synthroads.build()
    assert sorted(item.name for item in bpy.data.objects) == before


def test_replacing_files_is_the_users_choice(road: Any, tmp_path: Path) -> None:
    (tmp_path / "cloud.laz").write_text("old")
    (tmp_path / "notes.txt").write_text("mine")
    choose(road, output=str(tmp_path), overwrite=True)
    bpy.ops.synthroads.scan()
    assert (tmp_path / "cloud.laz").read_bytes()[:4] == b"LASF"
    assert (tmp_path / "notes.txt").read_text() == "mine"


def test_output_beside_a_saved_file(road: Any, road_file: Path) -> None:
    road.output = "//synthroads"
    assert road.folder() == road_file.parent / "synthroads"
    assert not road.needs_saved_file()


def test_a_scan_beside_the_window_gives_the_same_bytes(road: Any, tmp_path: Path) -> None:
    job = operators._scan_of(bpy.context)
    job.start()
    job._thread.join()
    assert (job.error, job.share) == (None, 1.0)
    road.output = str(tmp_path / "again")
    bpy.ops.synthroads.scan()
    for name in WRITTEN:
        assert (tmp_path / "out" / name).read_bytes() == (tmp_path / "again" / name).read_bytes(), name


@pytest.mark.parametrize("blocks", [0, 1])
def test_a_stopped_scan_leaves_nothing(road: Any, tmp_path: Path, blocks: int) -> None:
    job = operators._scan_of(bpy.context)
    for _ in range(blocks):
        next(job._steps)
    job.stop()
    job.start()
    job._thread.join()
    assert isinstance(job.error, Cancelled)
    assert job.points is None
    assert not (tmp_path / "out").exists()


def test_a_defect_in_the_thread_is_kept_and_leaves_nothing(
    road: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    job = operators._scan_of(bpy.context)
    monkeypatch.setattr(scan_job, "make_scan", lambda *arguments: 1 / 0)
    job.start()
    job._thread.join()
    assert isinstance(job.error, ZeroDivisionError)
    assert not (tmp_path / "out").exists()


def test_unregistering_stops_a_scan(road: Any, tmp_path: Path) -> None:
    scan_job.latest = operators._scan_of(bpy.context)
    scan_job.latest.start()
    synthroads_addon.unregister()
    assert not scan_job.scanning()
    assert not (tmp_path / "out").exists()
    synthroads_addon.register()
