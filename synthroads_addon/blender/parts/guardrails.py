"""Steel guardrails."""

from __future__ import annotations

import bpy

from ...road.parameters import Guardrail
from ...road.things.body_shapes import GUARDRAIL_SPACER
from ..materials import material
from ..things.guardrail import guardrail_group
from ..things.model_builder import ModelBuilder


def build_guardrails(builder: ModelBuilder) -> None:
    """Make one object per guardrail."""
    for name, rail in builder.parameters.of_type(Guardrail).items():
        inputs = {
            **builder.surfaces("Backbone"),
            "Start Station": builder.along(rail.start_station),
            "End Station": builder.along(min(rail.end_station, builder.geometry.length)),
            "Offset": rail.offset,
            "Left Beam": rail.faces in ("left", "both"),
            "Right Beam": rail.faces in ("right", "both"),
            "Spacer": GUARDRAIL_SPACER[rail.faces],
            "Height": rail.height,
            "Post Spacing": rail.post_spacing,
            "Terminal Length": rail.terminal_length,
            "Beam Step": builder.step,
            "Instance": rail.instance,
            "Material": material("galvanised_steel"),
        }
        builder.add(name, bpy.data.meshes.new("SR Guardrail"), guardrail_group(), inputs)
