"""The panel's settings: the whole scenario, made from its schema, and where the files go.

A setting stands where its field stands in the scenario: ``settings.road.turnouts.exits``. Annotations are not postponed
here: Blender reads the properties from them.
"""

import json
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

import bpy

from ...base.errors import InputError
from ...road.guidelines import GUIDELINES, STANDARD_CROSS_SECTIONS, is_single
from ...scenario.road import RoadScenario
from ...scenario.scenario import Scenario, load_scenario
from .fields import Field, SYNTHROADS_PG_file
from .groups import NOT_HERE, GroupField, leaves, make_fields, read_fields, shown_state, write_fields
from .hooks import HOOKS
from .preferences import preferences

FIRST = "rq31-600m"
"""The built-in scenario that the settings are at first."""
_PANELS_OWN = {"fidelity": "draft", "outputs": ["parameters", "cloud", "centerline", "previews"]}
"""Defaults of the panel where the scenario has others: the first road and scan come fast, the scene is open already."""
_KEPT = ("seed", "fidelity", "outputs")
"""Choosing a built-in scenario leaves these as they are: they say which, how fine and where, not what."""
_OF_ROAD = ("title", "seed", "fidelity", "geometric_tolerance", "vegetation_detail", "road")
"""Fields that a road is built from."""

FIRST_DATA = load_scenario(FIRST).to_dict() | _PANELS_OWN


def _change_class(road: Any, context: Any) -> None:
    """Set what follows from a new design class: the cross-section, and another guideline's defaults of the road."""
    former_section = STANDARD_CROSS_SECTIONS.get(road.cross_section)
    HOOKS["road.design_class"](road, context)
    if former_section is not None and former_section.single != is_single(road.design_class):
        _take_over_defaults(road)


def _change_section(road: Any, context: Any) -> None:
    """Set what follows from a new cross-section: the design class, and another guideline's defaults of the road."""
    former_class = road.design_class
    HOOKS["road.cross_section"](road, context)
    if is_single(former_class) != is_single(road.design_class):
        _take_over_defaults(road)


def _take_over_defaults(road: Any) -> None:
    """Set what guidelines have defaults for to those of the road's design class, or of a scenario without any."""
    usual = RoadScenario.from_dict({"design_class": road.design_class}).to_dict()
    field = FIELDS["road"]
    assert isinstance(field, GroupField)
    for guideline in GUIDELINES.values():
        _write_parts(field.fields, road, guideline.defaults, usual)


def _write_parts(fields: Mapping[str, Field], owner: Any, names: Mapping[str, Any], values: Mapping[str, Any]) -> None:
    """Set those properties of a group, and of groups in it, that are named to values; of unnamed ones none."""
    for name, part in names.items():
        field = fields[name]
        if isinstance(field, GroupField):
            _write_parts(field.fields, getattr(owner, name), part, values[name])
        else:
            field.write(owner, values[name])


_HOOKS = HOOKS | {"road.design_class": _change_class, "road.cross_section": _change_section}
FIELDS = make_fields(Scenario, FIRST_DATA, "", _HOOKS)
"""The scenario's fields by name."""
_Generated: Any = type(
    "_Generated",
    (),
    {"__annotations__": {name: p for field in FIELDS.values() for name, p in field.properties(_HOOKS).items()}},
)


class SYNTHROADS_PG_settings(_Generated, bpy.types.PropertyGroup):
    """The panel's settings, convertible to and from a `Scenario`."""

    preset: bpy.props.StringProperty(
        name="Scenario", default=FIRST, description="Scenario that these settings come from, built-in or a file"
    )
    loaded: bpy.props.StringProperty(
        name="Loaded Scenario",
        options={"HIDDEN"},
        description="That scenario as JSON: its numbers have more digits than Blender's",
    )
    output: bpy.props.StringProperty(
        name="Folder",
        subtype="DIR_PATH",
        default="",
        description="Folder for the files; // is the folder of the .blend file; if empty, the preferences' folder",
        options={"PATH_SUPPORTS_BLEND_RELATIVE"},
    )
    overwrite: bpy.props.BoolProperty(
        name="Replace Files", default=False, description="Replace the files of an earlier scan in this folder"
    )

    def scenario(self) -> Scenario:
        """Return the scenario that the settings describe; InputError if a value is invalid."""
        return Scenario.from_dict(read_fields(FIELDS, self, self._base()))

    def exact_seed(self) -> int:
        """Return the scenario's seed, which may exceed the 32 bits that Blender shows."""
        return int(FIELDS["seed"].read(self, self._base()["seed"]))

    def show_scenario(self, scenario: Scenario) -> None:
        """Set all settings to a scenario, without losing digits; InputError if it uses fields the panel lacks."""
        data = scenario.to_dict()
        for name in NOT_HERE:
            if name in data:
                text = "only synthroads generate uses it; remove it from the scenario, and set the values here"
                raise InputError(name, data[name], text)
        write_fields(FIELDS, self, data)
        self.loaded = json.dumps(data)

    def show_preset(self, name: str) -> None:
        """Set all settings to a built-in scenario, keeping seed, fidelity and outputs, or to a file.

        Raises:
            InputError: there is no such scenario, or it is wrong.
        """
        scenario = load_scenario(name)
        if Path(name).suffix != ".json":
            values = read_fields({key: FIELDS[key] for key in _KEPT}, self, None)
            scenario = Scenario.from_dict(scenario.to_dict() | values)
        self.show_scenario(scenario)
        self.preset = name

    def _base(self) -> dict[str, Any]:
        """Return the JSON data of the scenario loaded last, whose exact numbers replace unchanged ones."""
        return _data(self.loaded) if self.loaded else FIRST_DATA

    def road_values(self) -> str:
        """Return a text of all settings that a road is built from, to detect changes."""
        return json.dumps(shown_state({name: FIELDS[name] for name in _OF_ROAD}, self))

    def chosen_folder(self) -> str:
        """Return the output folder as written in the panel, or the preferences' if it is empty."""
        return str(self.output) or preferences().output_folder

    def needs_saved_file(self) -> bool:
        """Return whether the output folder is relative to a .blend file not saved yet."""
        return self.chosen_folder().startswith("//") and not bpy.data.filepath

    def folder_to_open(self) -> Path | None:
        """Return the output folder or its nearest existing parent; None without a usable folder."""
        if not self.chosen_folder().strip() or self.needs_saved_file():
            return None
        folder = self.folder()
        return next((place for place in (folder, *folder.parents) if place.is_dir()), None)

    def folder(self) -> Path:
        """Return the absolute output folder; InputError if it is empty or relative to an unsaved file."""
        chosen = self.chosen_folder()
        if not chosen.strip():
            raise InputError("Output", None, "choose a folder for the files")
        if self.needs_saved_file():
            raise InputError("Output", chosen, "save the file first, or choose a folder in the panel Output")
        return Path(bpy.path.abspath(chosen)).expanduser().absolute()


@lru_cache(maxsize=4)
def _data(text: str) -> dict[str, Any]:
    return json.loads(text)


CLASSES = (SYNTHROADS_PG_file, *(cls for field in FIELDS.values() for cls in field.classes()), SYNTHROADS_PG_settings)
PATHS = {field.path: field for field in leaves(FIELDS)}
"""Every field that is set by itself, by its path in the scenario."""
ATTACHED = (bpy.types.Scene, "synthroads", SYNTHROADS_PG_settings)
