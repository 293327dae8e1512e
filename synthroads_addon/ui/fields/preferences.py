"""The add-on's preferences: what belongs to the machine and not to a scene.

Annotations are not postponed here: Blender reads the properties from them.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import get_args

import bpy

from ...blender.model.library import LIBRARY_FILE, LIBRARY_FOLDER, LIBRARY_NAME
from ...scenario.scan import ScanScenario
from ...scenario.scenario import Scenario
from ..translations.blender import said
from .wording import value_name

PACKAGE = str(__package__).removesuffix(".ui.fields")
"""The add-on's own name, under which Blender keeps its preferences."""
_CASTER = ScanScenario.model_fields["caster"]


@dataclass(frozen=True)
class Preferences:
    """The extension's preferences as plain values.

    Attributes:
        cores: threads that a scan uses where its scenario doesn't say; 0 for every core.
        caster: how rays are cast where the scenario doesn't say: ``auto``, ``embree`` or ``bvhtree``.
        output_folder: where files go where the panel doesn't say; ``//`` is the folder of the .blend file.
        library_folder: holds the user's own ``scenarios`` and ``devices``; not empty.
    """

    cores: int = 0
    caster: str = "auto"
    output_folder: str = "//synthroads"
    library_folder: str = ""

    def library(self, kind: str) -> Path:
        """Return the user's library folder for ``scenarios`` or ``devices``, which need not exist."""
        return Path(bpy.path.abspath(self.library_folder)).expanduser() / kind


def preferences() -> Preferences:
    """Return the add-on's current preferences, or the defaults if the add-on isn't enabled."""
    entry = bpy.context.preferences.addons.get(PACKAGE)
    chosen = entry.preferences if entry else None
    if chosen is None:
        return Preferences(library_folder=_usual_library())
    return Preferences(
        cores=chosen.cores,
        caster=chosen.caster,
        output_folder=chosen.output_folder,
        library_folder=chosen.library_folder.strip() or _usual_library(),
    )


def with_preferences(scenario: Scenario) -> Scenario:
    """Return a copy of a scenario with threads and ray caster from the preferences where it leaves them open."""
    chosen, scan = preferences(), scenario.scan
    caster = chosen.caster if scan.caster == "auto" else scan.caster
    update = {"threads": scan.threads or chosen.cores, "caster": caster}
    return scenario.model_copy(update={"scan": scan.model_copy(update=update)})


class SYNTHROADS_OT_add_asset_library(bpy.types.Operator):
    """Show SynthRoads' node groups in Blender's asset browser: guardrails, signs and roads along your own curves"""

    bl_idname = "synthroads.add_asset_library"
    bl_label = "Add Asset Library"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return whether the library file exists and Blender doesn't have it yet."""
        if not (LIBRARY_FOLDER / LIBRARY_FILE).exists():
            cls.poll_message_set(said("The library comes only with the installed extension"))
            return False
        if _has_asset_library(context):
            cls.poll_message_set(said("Blender already has the library"))
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Add the folder to the asset libraries in Blender's preferences."""
        context.preferences.filepaths.asset_libraries.new(name=LIBRARY_NAME, directory=str(LIBRARY_FOLDER))
        self.report({"INFO"}, said(f"The asset browser now has the library {LIBRARY_NAME}"))
        return {"FINISHED"}


def _has_asset_library(context: bpy.types.Context) -> bool:
    libraries = context.preferences.filepaths.asset_libraries
    return any(library.path and Path(library.path).resolve() == LIBRARY_FOLDER.resolve() for library in libraries)


class SYNTHROADS_AP_preferences(bpy.types.AddonPreferences):
    """The add-on's preferences in Blender."""

    bl_idname = PACKAGE

    cores: bpy.props.IntProperty(
        name="Cores", min=0, max=1024, default=0, description="Processor cores that a scan may use; 0 uses every core"
    )
    caster: bpy.props.EnumProperty(
        name="Ray Caster",
        items=[(name, value_name(name, _CASTER), "") for name in get_args(_CASTER.annotation)],
        default=Preferences.caster,
        description="Ray caster to use where the scenario names none",
    )
    output_folder: bpy.props.StringProperty(
        name="Output Folder",
        subtype="DIR_PATH",
        default=Preferences.output_folder,
        description="Folder for files unless the panel names another; // is the folder of the .blend file",
        options={"PATH_SUPPORTS_BLEND_RELATIVE"},
    )
    library_folder: bpy.props.StringProperty(
        name="Library Folder",
        subtype="DIR_PATH",
        default="",
        description="Folder with the subfolders scenarios and devices; the panel's menus list your files in them",
    )

    def draw(self, context: bpy.types.Context) -> None:
        """Draw all preferences and the button for the asset library."""
        layout = self.layout
        layout.use_property_split = True
        for name in ("cores", "caster", "output_folder"):
            layout.prop(self, name)
        layout.prop(self, "library_folder", placeholder=_usual_library())
        layout.operator(SYNTHROADS_OT_add_asset_library.bl_idname, icon="ASSET_MANAGER")


def _usual_library() -> str:
    return str(Path(bpy.utils.user_resource("DATAFILES")) / "synthroads")
