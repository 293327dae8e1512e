"""The add-on's preferences: what belongs to the machine and not to a scene.

Annotations are not postponed here: Blender reads the properties from them.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import get_args

import bpy

from ...scenario.scan import ScanScenario
from ...scenario.scenario import Scenario
from .wording import value_name

PACKAGE = str(__package__).removesuffix(".ui.fields")
"""The add-on's own name, under which Blender keeps its preferences."""
_CASTER = ScanScenario.model_fields["caster"]


@dataclass(frozen=True)
class Preferences:
    """Preferences of the extension.

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
        """Return the folder of the user's ``scenarios`` or ``devices``; it need not be there."""
        return Path(bpy.path.abspath(self.library_folder)).expanduser() / kind


def preferences() -> Preferences:
    """Return the preferences, or what they are at first where the add-on isn't among those enabled."""
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
    """Return a scenario that casts as the preferences say where it leaves that open itself."""
    chosen, scan = preferences(), scenario.scan
    caster = chosen.caster if scan.caster == "auto" else scan.caster
    update = {"threads": scan.threads or chosen.cores, "caster": caster}
    return scenario.model_copy(update={"scan": scan.model_copy(update=update)})


class SYNTHROADS_AP_preferences(bpy.types.AddonPreferences):
    """The add-on's entry in Blender's preferences."""

    bl_idname = PACKAGE

    cores: bpy.props.IntProperty(
        name="Cores", min=0, max=1024, default=0, description="Processor cores that a scan may use; 0 uses every core"
    )
    caster: bpy.props.EnumProperty(
        name="Ray Caster",
        items=[(name, value_name(name, _CASTER), "") for name in get_args(_CASTER.annotation)],
        default=Preferences.caster,
        description="How rays are cast, where a scenario leaves it open",
    )
    output_folder: bpy.props.StringProperty(
        name="Output Folder",
        subtype="DIR_PATH",
        default=Preferences.output_folder,
        description="Where files go unless the panel says otherwise; // is the folder of the .blend file",
        options={"PATH_SUPPORTS_BLEND_RELATIVE"},
    )
    library_folder: bpy.props.StringProperty(
        name="Library Folder",
        subtype="DIR_PATH",
        default="",
        description="Your own scenarios and devices, in folders of these names; the panel's menus list them",
    )

    def draw(self, context: bpy.types.Context) -> None:
        """Show them all."""
        layout = self.layout
        layout.use_property_split = True
        for name in ("cores", "caster", "output_folder"):
            layout.prop(self, name)
        layout.prop(self, "library_folder", placeholder=_usual_library())


def _usual_library() -> str:
    return str(Path(bpy.utils.user_resource("DATAFILES")) / "synthroads")
