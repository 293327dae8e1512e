"""Ready-made scenarios and devices, built-in and of the user's own, lists of files, and roads drawn at random.

Annotations are not postponed here: Blender reads the properties from them.
"""

from functools import lru_cache
from pathlib import Path
from typing import Any

import bpy

from ...base.errors import InputError
from ...base.files import output_folder
from ...scanning.devices.device import device_names, load_device
from ...scenario.scenario import load_scenario, scenario_names
from ..fields.choices import device_of
from ..fields.fields import ADD_FILE, REMOVE_FILE, FilesField
from ..fields.preferences import preferences
from ..fields.properties import PATHS
from ..translations.blender import said
from ..work.build import next_seed
from ..work.common import is_free, refusing
from ..work.long_operator import FileChooser


class _Undoable:
    """Base of operators that change settings and can be undone."""

    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012 (Blender reads a plain set)
    report: Any


def _set_device(context: bpy.types.Context, name_or_file: str) -> None:
    """Set the scenario's device by name or file; raises an InputError if it can't be read."""
    load_device(name_or_file)
    context.scene.synthroads.scan.device = name_or_file


class SYNTHROADS_OT_choose_scenario(_Undoable, bpy.types.Operator):
    """Use this scenario. Seed and fidelity stay as they are, unless the scenario is a file that sets them"""

    bl_idname = "synthroads.choose_scenario"
    bl_label = "Choose Scenario"

    name: bpy.props.StringProperty(name="Scenario", description="A built-in scenario or a JSON file")

    @classmethod
    def description(cls, context: bpy.types.Context, properties: Any) -> str:
        """Return the tooltip of a menu item: the scenario's title."""
        return scenario_title(properties.name)

    @refusing
    def execute(self, context: bpy.types.Context) -> None:
        """Set the panel to the scenario `name`."""
        context.scene.synthroads.show_preset(self.name)


class SYNTHROADS_OT_choose_device(_Undoable, bpy.types.Operator):
    """Scan with this device"""

    bl_idname = "synthroads.choose_device"
    bl_label = "Choose Device"

    name: bpy.props.StringProperty(name="Device", description="A built-in device or a JSON file")

    @classmethod
    def description(cls, context: bpy.types.Context, properties: Any) -> str:
        """Return the tooltip of a menu item: title, wavelength, pulse rates, number of returns."""
        device = device_of(properties.name)
        if device is None:
            return "This file can't be read"
        rates = ", ".join(f"{mode.pulse_rate_khz:g}" for mode in device.modes)
        return f"{device.title}: {device.wavelength_nm:g} nm, {rates} kHz, {device.maximum_returns} returns at most"

    @refusing
    def execute(self, context: bpy.types.Context) -> None:
        """Set the panel's device to `name`; one that can't be read is refused."""
        _set_device(context, self.name)


class JsonFileChooser(FileChooser):
    """Base of operators that ask for a JSON file in a file browser."""

    filepath: bpy.props.StringProperty(
        name="File", description="File that is read or written", subtype="FILE_PATH", options={"SKIP_SAVE"}
    )
    filter_glob: bpy.props.StringProperty(default="*.json", options={"HIDDEN"})


class _LibraryFile(JsonFileChooser):
    """Base of operators that ask for a scenario or device file, starting in the user's library folder."""

    kind = ""

    def suggest(self, context: bpy.types.Context) -> None:
        """Set the file browser's path, if empty, to the library folder, or home if there is none."""
        if not self.filepath:
            folder = preferences().library(self.kind)
            self.filepath = str(folder if folder.is_dir() else folder.home()) + "/"


class SYNTHROADS_OT_load_scenario(_LibraryFile, _Undoable, bpy.types.Operator):
    """Use a scenario from a JSON file, as the command line does"""

    bl_idname = "synthroads.load_scenario"
    bl_label = "Load Scenario"
    kind = "scenarios"

    @refusing
    def execute(self, context: bpy.types.Context) -> None:
        """Set the panel to the scenario in the chosen file."""
        context.scene.synthroads.show_preset(str(self.chosen_file()))


class SYNTHROADS_OT_load_device(_LibraryFile, _Undoable, bpy.types.Operator):
    """Scan with a device from a JSON file"""

    bl_idname = "synthroads.load_device"
    bl_label = "Load Device"
    kind = "devices"

    @refusing
    def execute(self, context: bpy.types.Context) -> None:
        """Set the panel's device to the chosen file; one that can't be read is refused."""
        _set_device(context, str(self.chosen_file()))


class SYNTHROADS_OT_save_scenario(_LibraryFile, bpy.types.Operator):
    """Save these settings as a scenario's JSON file. Files in the library's folder are listed in the menu"""

    bl_idname = "synthroads.save_scenario"
    bl_label = "Save Scenario"
    kind = "scenarios"

    check_existing: bpy.props.BoolProperty(default=True, options={"HIDDEN"})

    def suggest(self, context: bpy.types.Context) -> None:
        """Set the path to `scenario.json` in the library folder, which is created if missing."""
        folder = preferences().library(self.kind)
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError:  # the browser then opens elsewhere
            folder = folder.home()
        self.filepath = str(folder / "scenario.json")

    @refusing
    def execute(self, context: bpy.types.Context) -> None:
        """Write the panel's scenario as JSON; an existing file is replaced."""
        target = self.chosen_file().with_suffix(".json").absolute()
        scenario = context.scene.synthroads.scenario()
        with output_folder(target.parent, [target.name], overwrite=True) as folder:
            (folder / target.name).write_text(scenario.to_json(), encoding="utf-8")
        self.report({"INFO"}, said(f"Saved {target}"))


def _file_list(context: bpy.types.Context, path: str) -> Any:
    """Return the Blender collection of files that belongs to the scenario field at a path; InputError without one."""
    field = PATHS.get(path)
    if not isinstance(field, FilesField):
        lists = ", ".join(known for known, other in PATHS.items() if isinstance(other, FilesField))
        raise InputError("path", path, f"must be a field of the scenario that lists files: {lists}")
    return getattr(field.owner(context.scene.synthroads), field.name)


class SYNTHROADS_OT_add_file(JsonFileChooser, _Undoable, bpy.types.Operator):
    """Add a file to the list"""

    bl_idname = ADD_FILE
    bl_label = "Add File..."

    path: bpy.props.StringProperty(name="Field", options={"HIDDEN"})

    @refusing
    def execute(self, context: bpy.types.Context) -> None:
        """Append the chosen file, as it was written, to the list of the field `path`."""
        files = _file_list(context, self.path)
        self.chosen_file()
        files.add().file = self.filepath


class SYNTHROADS_OT_remove_file(_Undoable, bpy.types.Operator):
    """Remove this file from the list; the file itself stays"""

    bl_idname = REMOVE_FILE
    bl_label = "Remove File"

    path: bpy.props.StringProperty(name="Field", options={"HIDDEN"})
    number: bpy.props.IntProperty(name="Place in the List", options={"HIDDEN"})

    @refusing
    def execute(self, context: bpy.types.Context) -> None:
        """Remove entry `number` from the list of the field `path`."""
        files = _file_list(context, self.path)
        if not 0 <= self.number < len(files):
            raise InputError("number", self.number, f"the list has {len(files)} files, counted from 0")
        files.remove(self.number)


class SYNTHROADS_OT_random_road(bpy.types.Operator):
    """Draw another seed, and build its road within the limits. After a given seed, the next is always the same"""

    bl_idname = "synthroads.random_road"
    bl_label = "Random Road"
    bl_options = {"UNDO"}  # noqa: RUF012 (Repeat Last would build at once, and block the window)

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether nothing else is at work."""
        return is_free(cls, context)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Set the next seed and build the road in the background, as the build button does."""
        return self._build(context, "INVOKE_DEFAULT")

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Set the next seed and build the road, blocking until it is built."""
        return self._build(context, "EXEC_DEFAULT")

    def _build(self, context: bpy.types.Context, how: str) -> set[str]:
        settings = context.scene.synthroads
        before = settings.seed
        settings.seed = next_seed(settings.exact_seed())
        try:
            result: set[str] = bpy.ops.synthroads.build(how)
        except RuntimeError as error:
            settings.seed = before
            self.report({"ERROR"}, said(str(error).removeprefix("Error: ").strip()))
            return {"CANCELLED"}
        return {"CANCELLED"} if result == {"CANCELLED"} else {"FINISHED"}


class SYNTHROADS_MT_scenarios(bpy.types.Menu):
    """Ready-made scenarios, built-in and your own"""

    bl_idname = "SYNTHROADS_MT_scenarios"
    bl_label = "Scenarios"

    def draw(self, context: bpy.types.Context) -> None:
        """Draw menu items for built-in scenarios, the library's, and loading and saving."""
        layout = self.layout
        _list(layout, SYNTHROADS_OT_choose_scenario.bl_idname, scenario_names(), scenario_title)
        _list(layout, SYNTHROADS_OT_choose_scenario.bl_idname, library_files("scenarios"), scenario_title)
        layout.operator(SYNTHROADS_OT_load_scenario.bl_idname, text="Load Scenario...", icon="FILE_FOLDER")
        layout.operator(SYNTHROADS_OT_save_scenario.bl_idname, text="Save Scenario...", icon="FILE_TICK")


class SYNTHROADS_MT_devices(bpy.types.Menu):
    """Laser scanners, built-in and your own"""

    bl_idname = "SYNTHROADS_MT_devices"
    bl_label = "Devices"

    def draw(self, context: bpy.types.Context) -> None:
        """Draw menu items for built-in devices, the library's, and loading."""
        layout = self.layout
        _list(layout, SYNTHROADS_OT_choose_device.bl_idname, device_names(), device_title)
        _list(layout, SYNTHROADS_OT_choose_device.bl_idname, library_files("devices"), device_title)
        layout.operator(SYNTHROADS_OT_load_device.bl_idname, text="Load Device...", icon="FILE_FOLDER")


def library_files(kind: str) -> list[str]:
    """Return the sorted paths of JSON files in the library's folder ``scenarios`` or ``devices``."""
    return sorted(str(path) for path in preferences().library(kind).glob("*.json"))


def device_title(name: str) -> str:
    """Return a device's title, or its file name with a question mark if it can't be read."""
    device = device_of(name)
    return device.title if device else f"{Path(name).name}?"


def scenario_title(name: str) -> str:
    """Return a built-in scenario's title, or a file's stem."""
    return _built_in_title(name) if name in scenario_names() else Path(name).stem


@lru_cache
def _built_in_title(name: str) -> str:
    return load_scenario(name).title


def _list(layout: bpy.types.UILayout, operator: str, names: list[str], title: Any) -> None:
    for name in names:
        layout.operator(operator, text=title(name)).name = name
    if names:
        layout.separator()
