"""Lighting and surveillance poles."""

from __future__ import annotations

from ...road.parameters import Pole
from ..materials import material
from ..things.model_builder import ModelBuilder
from ..things.pole import pole_group


def build_poles(builder: ModelBuilder) -> None:
    """Make one object per pole."""
    for name, pole in builder.parameters.of_type(Pole).items():
        inputs = {
            **builder.surfaces(),
            "Surveillance": pole.kind == "surveillance",
            "Height": pole.height,
            "Diameter": pole.diameter,
            "Arm Length": pole.arm_length,
            "Instance": pole.instance,
            "Steel Material": material("galvanised_steel"),
            "Housing Material": material("cabinet_grey"),
            "Glass Material": material("lamp_glass" if pole.kind == "lighting" else "display"),
        }
        builder.add(name, builder.points(name, [pole], {}), pole_group(), inputs)
