"""Ready-made scenarios and devices, built-in and of the user's own, and roads drawn at random.

Annotations are not postponed here: Blender reads the properties from them.
"""

from functools import lru_cache
from pathlib import Path
from typing import Any

import bpy

from ...base.errors import InputError
from ...base.files import output_folder
from ...base.random_streams import stream
from ...scanning.devices.device import device_names, load_device
from ...scenario.scenario import load_scenario, scenario_names
from ..fields.choices import device_of
from ..fields.numbers import LARGEST_INTEGER
from ..fields.preferences import preferences
from ..work.common import is_free, refuse


class _Undoable:
    """Base of operators that change settings."""

    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012 (Blender reads a plain set)
    report: Any


class SYNTHROADS_OT_choose_scenario(_Undoable, bpy.types.Operator):
    """Take over this scenario. The seed and the fidelity stay as they are, unless it is a file with its own"""

    bl_idname = "synthroads.choose_scenario"
    bl_label = "Choose Scenario"

    name: bpy.props.StringProperty(name="Scenario", description="A built-in scenario or a JSON file")

    @classmethod
    def description(cls, context: bpy.types.Context, properties: Any) -> str:
        """Say what is behind the menu's item."""
        return scenario_title(properties.name)

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Show its values."""
        try:
            context.scene.synthroads.take_preset(self.name)
        except InputError as error:
            return refuse(self, error)
        return {"FINISHED"}


class SYNTHROADS_OT_choose_device(_Undoable, bpy.types.Operator):
    """Scan with this device"""

    bl_idname = "synthroads.choose_device"
    bl_label = "Choose Device"

    name: bpy.props.StringProperty(name="Device", description="A built-in device or a JSON file")

    @classmethod
    def description(cls, context: bpy.types.Context, properties: Any) -> str:
        """Say what the device can do."""
        device = device_of(properties.name)
        if device is None:
            return "This file can't be read"
        rates = ", ".join(f"{mode.pulse_rate_khz:g}" for mode in device.modes)
        return f"{device.title}: {device.wavelength_nm:g} nm, {rates} kHz, {device.maximum_returns} returns at most"

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Choose it; one that is wrong is refused."""
        try:
            load_device(self.name)
        except InputError as error:
            return refuse(self, error)
        context.scene.synthroads.scan.device = self.name
        return {"FINISHED"}


class _File:
    """Base of operators that ask for a JSON file."""

    filepath: bpy.props.StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})
    filter_glob: bpy.props.StringProperty(default="*.json", options={"HIDDEN"})
    kind = ""

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Open the file browser in the library's folder."""
        if not self.filepath:
            folder = preferences().library(self.kind)
            self.filepath = str(folder if folder.is_dir() else folder.home()) + "/"
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}


class SYNTHROADS_OT_load_scenario(_File, _Undoable, bpy.types.Operator):
    """Take over a scenario from a JSON file, the same as the command line takes"""

    bl_idname = "synthroads.load_scenario"
    bl_label = "Load Scenario"
    kind = "scenarios"

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Show the file's values."""
        try:
            context.scene.synthroads.take_preset(self.filepath)
        except InputError as error:
            return refuse(self, error)
        return {"FINISHED"}


class SYNTHROADS_OT_load_device(_File, _Undoable, bpy.types.Operator):
    """Scan with a device from a JSON file"""

    bl_idname = "synthroads.load_device"
    bl_label = "Load Device"
    kind = "devices"

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Choose the file's device; one that is wrong is refused."""
        try:
            load_device(self.filepath)
        except InputError as error:
            return refuse(self, error)
        context.scene.synthroads.scan.device = self.filepath
        return {"FINISHED"}


class SYNTHROADS_OT_save_scenario(_File, bpy.types.Operator):
    """Save these settings as a scenario's JSON file. Files in the library's folder are listed in the menu"""

    bl_idname = "synthroads.save_scenario"
    bl_label = "Save Scenario"
    kind = "scenarios"

    check_existing: bpy.props.BoolProperty(default=True, options={"HIDDEN"})

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Open the file browser in the library's folder, which is made if need be."""
        folder = preferences().library(self.kind)
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError:  # the browser then opens elsewhere
            folder = folder.home()
        self.filepath = str(folder / "scenario.json")
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Write the file; the browser has asked whether to replace one that is there."""
        target = Path(self.filepath).with_suffix(".json").absolute()
        try:
            scenario = context.scene.synthroads.scenario()
            with output_folder(target.parent, [target.name], overwrite=True) as folder:
                (folder / target.name).write_text(scenario.to_json(), encoding="utf-8")
        except InputError as error:
            return refuse(self, error)
        self.report({"INFO"}, f"Saved {target}")
        return {"FINISHED"}


class SYNTHROADS_OT_random_road(bpy.types.Operator):
    """Draw another seed, and build its road within the limits. The same seed is always followed by the same"""

    bl_idname = "synthroads.random_road"
    bl_label = "Random Road"
    bl_options = {"UNDO"}  # noqa: RUF012 (Repeat Last would build at once, and block the window)

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """As building."""
        return is_free(cls, context)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Build as the button does."""
        return self._build(context, "INVOKE_DEFAULT")

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Build to the end."""
        return self._build(context, "EXEC_DEFAULT")

    def _build(self, context: bpy.types.Context, how: str) -> set[str]:
        settings = context.scene.synthroads
        before = settings.seed
        settings.seed = next_seed(settings.exact_seed())
        try:
            result: set[str] = bpy.ops.synthroads.build(how)
        except RuntimeError as error:
            settings.seed = before
            self.report({"ERROR"}, str(error).removeprefix("Error: ").strip())
            return {"CANCELLED"}
        return {"CANCELLED"} if result == {"CANCELLED"} else {"FINISHED"}


class SYNTHROADS_MT_scenarios(bpy.types.Menu):
    """Ready-made scenarios, built-in and your own"""

    bl_idname = "SYNTHROADS_MT_scenarios"
    bl_label = "Scenarios"

    def draw(self, context: bpy.types.Context) -> None:
        """List them, then loading and saving."""
        layout = self.layout
        _list(layout, SYNTHROADS_OT_choose_scenario.bl_idname, scenario_names(), scenario_title)
        _list(layout, SYNTHROADS_OT_choose_scenario.bl_idname, own_files("scenarios"), scenario_title)
        layout.operator(SYNTHROADS_OT_load_scenario.bl_idname, text="Load Scenario...", icon="FILE_FOLDER")
        layout.operator(SYNTHROADS_OT_save_scenario.bl_idname, text="Save Scenario...", icon="FILE_TICK")


class SYNTHROADS_MT_devices(bpy.types.Menu):
    """Laser scanners, built-in and your own"""

    bl_idname = "SYNTHROADS_MT_devices"
    bl_label = "Devices"

    def draw(self, context: bpy.types.Context) -> None:
        """List them, then loading."""
        layout = self.layout
        _list(layout, SYNTHROADS_OT_choose_device.bl_idname, device_names(), device_title)
        _list(layout, SYNTHROADS_OT_choose_device.bl_idname, own_files("devices"), device_title)
        layout.operator(SYNTHROADS_OT_load_device.bl_idname, text="Load Device...", icon="FILE_FOLDER")


def next_seed(seed: int) -> int:
    """Return the seed that Random Road draws after this one: always the same."""
    return int(stream(seed, "random road").integers(1, LARGEST_INTEGER))


def own_files(kind: str) -> list[str]:
    """Return the JSON files of the library's ``scenarios`` or ``devices``."""
    return sorted(str(path) for path in preferences().library(kind).glob("*.json"))


def device_title(name: str) -> str:
    """Return what a device is called."""
    device = device_of(name)
    return device.title if device else f"{Path(name).name}?"


def scenario_title(name: str) -> str:
    """Return what a scenario is called: a file by its name, as a title may be anything."""
    return _built_in_title(name) if name in scenario_names() else Path(name).stem


@lru_cache
def _built_in_title(name: str) -> str:
    return load_scenario(name).title


def _list(layout: bpy.types.UILayout, operator: str, names: list[str], title: Any) -> None:
    for name in names:
        layout.operator(operator, text=title(name)).name = name
    if names:
        layout.separator()


CLASSES = (
    SYNTHROADS_OT_choose_scenario,
    SYNTHROADS_OT_choose_device,
    SYNTHROADS_OT_load_scenario,
    SYNTHROADS_OT_load_device,
    SYNTHROADS_OT_save_scenario,
    SYNTHROADS_OT_random_road,
    SYNTHROADS_MT_scenarios,
    SYNTHROADS_MT_devices,
)
