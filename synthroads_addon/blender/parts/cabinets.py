"""Emergency phones and utility cabinets."""

from __future__ import annotations

from ...road.parameters import Cabinet
from ..materials import material
from ..things.cabinet import cabinet_group
from ..things.emergency_phone import emergency_phone_group
from ..things.model_builder import ModelBuilder

_MATERIALS = {
    "emergency_phone": {
        "Body": "plastic_orange",
        "Plinth": "concrete",
        "Band": "sheeting_white",
        "Writing": "sheeting_white",
        "Panel": "plastic_black",
    },
    "utility": {"Body": "cabinet_grey", "Plinth": "concrete", "Fitting": "plastic_black"},
}


def build_cabinets(builder: ModelBuilder) -> None:
    """Make one object per emergency phone and utility cabinet."""
    for name, cabinet in builder.parameters.of_type(Cabinet).items():
        group = emergency_phone_group() if cabinet.kind == "emergency_phone" else cabinet_group()
        inputs = {
            **builder.surfaces(),
            "Width": cabinet.width,
            "Depth": cabinet.depth,
            "Height": cabinet.height,
            "Instance": cabinet.instance,
            **{f"{part} Material": material(entry) for part, entry in _MATERIALS[cabinet.kind].items()},
        }
        builder.add(name, builder.points(name, [cabinet], {}), group, inputs)
