"""The panel's settings: the whole scenario, made from its schema, and where the files go.

A setting stands where its field stands in the scenario: ``settings.road.turnouts.exits``. Annotations are not postponed
here: Blender reads the properties from them.
"""

import json
from functools import lru_cache
from pathlib import Path
from typing import Any

import bpy

from ...base.errors import InputError
from ...scenario.scenario import Scenario, load_scenario
from .fields import SYNTHROADS_PG_file
from .groups import NOT_HERE, leaves, make_fields, read_fields, shown_state, write_fields
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
FIELDS = make_fields(Scenario, FIRST_DATA, "", HOOKS)
"""The scenario's fields by name."""
_Generated: Any = type(
    "_Generated",
    (),
    {"__annotations__": {name: p for field in FIELDS.values() for name, p in field.properties(HOOKS).items()}},
)


class SYNTHROADS_PG_settings(_Generated, bpy.types.PropertyGroup):
    """State of the panel; `scenario` turns it into the same description of a job that the command line takes."""

    preset: bpy.props.StringProperty(
        name="Scenario", default=FIRST, description="Scenario that these settings were taken from, built-in or a file"
    )
    loaded: bpy.props.StringProperty(
        options={"HIDDEN"}, description="That scenario as JSON: its numbers have more digits than Blender's"
    )
    output: bpy.props.StringProperty(
        name="Folder",
        subtype="DIR_PATH",
        default="",
        description="Folder for the files; // is the folder of the .blend file, nothing the folder of the preferences",
        options={"PATH_SUPPORTS_BLEND_RELATIVE"},
    )
    overwrite: bpy.props.BoolProperty(
        name="Replace Files", default=False, description="Replace the files of an earlier scan in this folder"
    )

    def scenario(self) -> Scenario:
        """Return the job that the panel describes; raise `InputError` where a value is refused."""
        return Scenario.from_dict(read_fields(FIELDS, self, self._base()))

    def exact_seed(self) -> int:
        """Return the seed, which Blender's whole numbers may be too short to show."""
        return int(FIELDS["seed"].read(self, self._base()["seed"]))

    def take(self, scenario: Scenario) -> None:
        """Show a scenario, to the last digit; raise `InputError` if it has what the panel lacks."""
        data = scenario.to_dict()
        for name in NOT_HERE:
            if name in data:
                text = "only synthroads generate chooses by it; take it out of the scenario, and set the knobs here"
                raise InputError(name, data[name], text)
        write_fields(FIELDS, self, data)
        self.loaded = json.dumps(data)

    def take_preset(self, name: str) -> None:
        """Show a built-in scenario with this seed and fidelity, or a file's with its own.

        Raises:
            InputError: there is no such scenario, or it is wrong.
        """
        scenario = load_scenario(name)
        if Path(name).suffix != ".json":
            kept = read_fields({key: FIELDS[key] for key in _KEPT}, self, None)
            scenario = Scenario.from_dict(scenario.to_dict() | kept)
        self.take(scenario)
        self.preset = name

    def _base(self) -> dict[str, Any]:
        """Return the scenario that was loaded last: where a property still shows its value, that is meant."""
        return _data(self.loaded) if self.loaded else FIRST_DATA

    def road_values(self) -> str:
        """Return what a road is built from, to tell whether it has changed."""
        return json.dumps(shown_state({name: FIELDS[name] for name in _OF_ROAD}, self))

    def chosen_folder(self) -> str:
        """Return the folder as it is written here or else in the preferences."""
        return str(self.output) or preferences().output_folder

    def needs_saved_file(self) -> bool:
        """Return whether the output folder is given relative to a file that has no place yet."""
        return self.chosen_folder().startswith("//") and not bpy.data.filepath

    def folder_to_open(self) -> Path | None:
        """Return where a file browser is best opened: the output folder, or the nearest above it that is there."""
        if not self.chosen_folder().strip() or self.needs_saved_file():
            return None
        folder = self.folder()
        return next((place for place in (folder, *folder.parents) if place.is_dir()), None)

    def folder(self) -> Path:
        """Return the output folder; raise `InputError` if there is none."""
        chosen = self.chosen_folder()
        if not chosen.strip():
            raise InputError("Output", None, "choose a folder for the files")
        if self.needs_saved_file():
            raise InputError("Output", chosen, "save the file first, or choose a folder")
        return Path(bpy.path.abspath(chosen)).expanduser().absolute()


@lru_cache(maxsize=4)
def _data(text: str) -> dict[str, Any]:
    return json.loads(text)


CLASSES = (SYNTHROADS_PG_file, *(cls for field in FIELDS.values() for cls in field.classes()), SYNTHROADS_PG_settings)
PATHS = {field.path: field for field in leaves(FIELDS)}
"""Every field that is set by itself, by its path in the scenario."""
ATTACHED = (bpy.types.Scene, "synthroads", SYNTHROADS_PG_settings)
