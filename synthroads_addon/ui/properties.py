"""The panel's settings. Names, limits, units and tooltips come from the scenario's schema: one source of each.

Annotations are not postponed here: Blender reads the properties from them.
"""

import json
from collections.abc import Iterator
from operator import attrgetter
from pathlib import Path
from typing import Any

import annotated_types
import bpy
import numpy as np
from pydantic import BaseModel

from ..core.errors import InputError
from ..core.parameters.limits import STANDARD_CROSS_SECTIONS, design_class_of
from ..core.road_scenario import RoadScenario
from ..core.scan_scenario import Platform, ScanScenario
from ..core.scanning.devices import device_names, load_device
from ..core.scanning.path import USUAL
from ..core.scenario import FIDELITIES, Scenario, load_scenario, scenario_names
from ..core.schema import unit_of

ROAD_FIELDS = {
    "seed": "seed",
    "fidelity": "fidelity",
    "cross_section": "road.cross_section",
    "length": "road.length",
}
SCAN_FIELDS = {
    "device": "scan.device",
    "platform": "scan.platform.kind",
    "height": "scan.platform.height",
    "speed": "scan.platform.speed",
}
"""Settings and the fields of the scenario that they set: what the road is built from, and what it is scanned with."""

OUTPUTS = ("parameters", "cloud", "centerline", "previews")
"""What a scan from the panel writes; the scene itself is open already."""

PLATFORM_NAMES = {"uav": "UAV", "vehicle": "Vehicle", "tripod": "Tripod", "airborne": "Aircraft"}
_DEVICE_SETTINGS = ("pulse_rate_khz", "field_of_view_deg", "lines_per_second", "angle_step_deg")
_UNITS = {"m": "LENGTH", "m/s": "VELOCITY"}
_LARGEST_INTEGER = 2**31 - 1  # Blender's integers have 32 bits
_KEPT = ("seed", "fidelity")  # choosing a scenario leaves these as they are: they say which and how fine, not what


def number(model: type[BaseModel], name: str, default: float | None = None) -> Any:
    """Return a float or int property with the limits, default, unit and description of a field of the schema.

    Blender's limits are inclusive: a limit that the schema excludes is refused when the scenario is made.
    """
    field = model.model_fields[name]
    arguments: dict[str, Any] = {"name": name.replace("_", " ").title(), "description": tooltip(model, name)}
    arguments["default"] = field.default if default is None else default
    for limit in field.metadata:
        if isinstance(limit, annotated_types.Ge | annotated_types.Gt):
            arguments["min"] = getattr(limit, "ge", getattr(limit, "gt", None))
        if isinstance(limit, annotated_types.Le | annotated_types.Lt):
            arguments["max"] = getattr(limit, "le", getattr(limit, "lt", None))
    if field.annotation is int:
        arguments["max"] = min(arguments.get("max", _LARGEST_INTEGER), _LARGEST_INTEGER)
        return bpy.props.IntProperty(**arguments)
    return bpy.props.FloatProperty(**arguments, step=100, unit=_UNITS.get(unit_of(field), "NONE"))


def tooltip(model: type[BaseModel], name: str) -> str:
    """Return a field's description without its final stop: Blender adds one."""
    return (model.model_fields[name].description or "").removesuffix(".")


def _scenarios() -> Iterator[tuple[str, str, str]]:
    for name in scenario_names():
        yield name, name, load_scenario(name).title


def _fidelities() -> Iterator[tuple[str, str, str]]:
    for name, settings in FIDELITIES.items():
        rays = "1 ray" if settings.rays_per_pulse == 1 else f"{settings.rays_per_pulse} rays"
        model = f"{1000 * settings.tolerance:g} mm chord error, {settings.vegetation_detail:.0%} of the plants"
        yield name, name.title(), f"{model}, {rays} per pulse"


def _cross_sections() -> Iterator[tuple[str, str, str]]:
    for name, section in STANDARD_CROSS_SECTIONS.items():
        lanes = len(section.lanes)
        shoulder = f"hard shoulders of {section.hard_shoulder:g} m, median of {section.median:g} m"
        yield name, f"{name.replace('RQ', 'RQ ')}, 2 × {lanes} lanes", f"{lanes} lanes each way, {shoulder}"


def _devices() -> Iterator[tuple[str, str, str]]:
    for name in device_names():
        device = load_device(name)
        rates = ", ".join(f"{mode.pulse_rate_khz:g}" for mode in device.modes)
        yield name, device.title, f"{device.wavelength_nm:g} nm, {rates} kHz, {device.maximum_returns} returns at most"


def _platforms() -> Iterator[tuple[str, str, str]]:
    for kind, usual in USUAL.items():
        yield kind, PLATFORM_NAMES[kind], f"Usually {usual.height:g} m up, at {usual.speed:g} m/s"


def _take_usual(settings: "SYNTHROADS_PG_settings", context: bpy.types.Context) -> None:
    """Show what is usual for the chosen platform."""
    settings.height, settings.speed = USUAL[settings.platform].height, USUAL[settings.platform].speed


def _take_over(settings: "SYNTHROADS_PG_settings", context: bpy.types.Context) -> None:
    """Show the chosen scenario's own values."""
    scenario = load_scenario(settings.preset)
    for name, path in (ROAD_FIELDS | SCAN_FIELDS).items():
        value = attrgetter(path)(scenario)
        if name not in _KEPT and value is not None:  # a height or speed that isn't given came with the platform
            setattr(settings, name, value)


class SYNTHROADS_PG_settings(bpy.types.PropertyGroup):
    """What the panel shows; `scenario` turns it into the same description of a job that the command line takes."""

    preset: bpy.props.EnumProperty(
        name="Scenario",
        items=list(_scenarios()),
        default="rq31-600m",
        description="Ready-made scenario that everything else starts from",
        update=_take_over,
    )
    fidelity: bpy.props.EnumProperty(
        name="Fidelity",
        items=list(_fidelities()),
        default="draft",  # the first road and scan are to come fast
        description=tooltip(Scenario, "fidelity"),
    )
    seed: number(Scenario, "seed")
    cross_section: bpy.props.EnumProperty(
        name="Cross-Section",
        items=list(_cross_sections()),
        default=RoadScenario.model_fields["cross_section"].default,
        description=tooltip(RoadScenario, "cross_section"),
    )
    length: number(RoadScenario, "length")
    device: bpy.props.EnumProperty(
        name="Device",
        items=list(_devices()),
        default=ScanScenario.model_fields["device"].default,
        description="Laser scanner",
    )
    platform: bpy.props.EnumProperty(
        name="Platform",
        items=list(_platforms()),
        default=Platform.model_fields["kind"].default,
        description=tooltip(Platform, "kind"),
        update=_take_usual,
    )
    height: number(Platform, "height", USUAL["uav"].height)
    speed: number(Platform, "speed", USUAL["uav"].speed)
    output: bpy.props.StringProperty(
        name="Output",
        subtype="DIR_PATH",
        default="//synthroads",
        description="Folder for the files; // is the folder of the .blend file",
        options={"PATH_SUPPORTS_BLEND_RELATIVE"},
    )
    overwrite: bpy.props.BoolProperty(
        name="Replace Files", default=False, description="Replace the files of an earlier scan in this folder"
    )

    def scenario(self) -> Scenario:
        """Return the job that the panel describes; raise `InputError` where a value is refused."""
        changes = [f"{path}={_plain(getattr(self, name))}" for name, path in (ROAD_FIELDS | SCAN_FIELDS).items()]
        # The panel asks for the cross-section only: the design class follows where the scenario's doesn't have it.
        preset = load_scenario(self.preset)
        design_class = design_class_of(self.cross_section, preset.road.design_class)
        if self.device != preset.scan.device:  # the scenario's pulse rate and angles are those of its own device
            changes += [f"scan.{name}=null" for name in _DEVICE_SETTINGS]
        if self.platform != preset.scan.platform.kind:  # and its strips those of its own platform
            changes.append("scan.platform.lateral_offsets=null")
        changes += [f'road.design_class="{design_class}"', f"outputs={json.dumps(OUTPUTS)}"]
        return load_scenario(self.preset, changes)

    def road_values(self) -> str:
        """Return what a road is built from, to tell whether it has changed."""
        return json.dumps([self.preset, *(_plain(getattr(self, name)) for name in ROAD_FIELDS)])

    def needs_saved_file(self) -> bool:
        """Return whether the output folder is given relative to a file that has no place yet."""
        return self.output.startswith("//") and not bpy.data.filepath

    def folder(self) -> Path:
        """Return the output folder; raise `InputError` if there is none."""
        if not self.output.strip():
            raise InputError("Output", None, "choose a folder for the files")
        if self.needs_saved_file():
            raise InputError("Output", self.output, "save the file first, or choose a folder")
        return Path(bpy.path.abspath(self.output)).expanduser().absolute()


def _plain(value: float | str) -> str:
    """Return a value as JSON; a number of Blender's 32 bits as the shortest decimal that it stands for (0.1)."""
    return json.dumps(float(str(np.float32(value))) if isinstance(value, float) else value)


CLASSES = (SYNTHROADS_PG_settings,)
