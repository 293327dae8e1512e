"""The panel's settings. Names, limits, units and tooltips come from the scenario's schema: one source of each.

Annotations are not postponed here: Blender reads the properties from them.
"""

from typing import Any

import annotated_types
import bpy
from pydantic import BaseModel

from ..core.parameters.limits import STANDARD_CROSS_SECTIONS
from ..core.scanning.devices import device_names
from ..core.scenario import Platform, RoadScenario, Scenario, load_scenario, scenario_names
from ..core.schema import unit_of

_SUBTYPES = {"m": "LENGTH", "m/s": "VELOCITY"}


def number(model: type[BaseModel], name: str, default: float | None = None) -> Any:
    """Return a float or int property with the limits, unit and description of a field of the schema.

    Args:
        model: the class that declares the field.
        name: the field.
        default: the property's default where it isn't the field's own.
    """
    field = model.model_fields[name]
    value = field.default if default is None else default
    arguments: dict[str, Any] = {"name": name.replace("_", " ").capitalize(), "default": value}
    arguments["description"] = f"{field.description} ({unit_of(field)})"
    for limit in field.metadata:
        if isinstance(limit, annotated_types.Ge):
            arguments["min"] = limit.ge
        if isinstance(limit, annotated_types.Le):
            arguments["max"] = limit.le
    if field.annotation is int:
        # Blender's integers have 32 bits.
        arguments["max"] = min(arguments.get("max", 2**31 - 1), 2**31 - 1)
        return bpy.props.IntProperty(**arguments)
    return bpy.props.FloatProperty(**arguments, unit=_SUBTYPES.get(unit_of(field), "NONE"))


def _names(values: Any) -> list[tuple[str, str, str]]:
    return [(value, value, "") for value in values]


_DEMO = load_scenario("rq31-600m")


class SYNTHROADS_PG_settings(bpy.types.PropertyGroup):
    """What the panel shows; `scenario` turns it into the same description of a job that the command line takes."""

    preset: bpy.props.EnumProperty(
        name="Scenario", items=_names(scenario_names()), description="Ready-made scenario that the rest starts from"
    )
    seed: number(Scenario, "seed")
    fidelity: bpy.props.EnumProperty(
        name="Fidelity",
        items=_names(["draft", "standard", "high"]),
        default="draft",
        description=Scenario.model_fields["fidelity"].description or "",
    )
    cross_section: bpy.props.EnumProperty(
        name="Cross-section",
        items=_names(STANDARD_CROSS_SECTIONS),
        default=_DEMO.road.cross_section,
        description=RoadScenario.model_fields["cross_section"].description or "",
    )
    length: number(RoadScenario, "length")
    device: bpy.props.EnumProperty(name="Device", items=_names(device_names()), description="Laser scanner")
    height: number(Platform, "height")
    speed: number(Platform, "speed")
    output: bpy.props.StringProperty(
        name="Output", subtype="DIR_PATH", default="//synthroads", description="Folder for the files"
    )

    def scenario(self) -> Scenario:
        """Return the job that the panel describes; raise `InputError` where a value is refused."""
        changes = {
            "seed": self.seed,
            "fidelity": f'"{self.fidelity}"',
            "road.cross_section": f'"{self.cross_section}"',
            "road.length": round(self.length, 6),
            "scan.device": f'"{self.device}"',
            "scan.platform.height": round(self.height, 6),
            "scan.platform.speed": round(self.speed, 6),
            "outputs": '["parameters", "cloud", "centerline", "previews"]',
        }
        return load_scenario(self.preset, [f"{path}={value}" for path, value in changes.items()])


CLASSES = (SYNTHROADS_PG_settings,)
