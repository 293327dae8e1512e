"""Traffic lights."""

from __future__ import annotations

from ...road.parameters import TrafficLight
from ..materials import material
from ..things.model_builder import ModelBuilder
from ..things.traffic_light import traffic_light_group


def build_traffic_lights(builder: ModelBuilder) -> None:
    """Make one object per traffic light."""
    for name, light in builder.parameters.of_type(TrafficLight).items():
        inputs = {
            **builder.surfaces(),
            "Height": light.height,
            "Lights": light.lights,
            "Light Diameter": light.light_diameter,
            "Instance": light.instance,
            "Post Material": material("galvanised_steel"),
            "Housing Material": material("plastic_black"),
            "Rim Material": material("sheeting_white"),
            "Red Material": material("lamp_red"),
            "Yellow Material": material("lamp_yellow"),
            "Green Material": material("lamp_green"),
        }
        builder.add(name, builder.points(name, [light], {}), traffic_light_group(), inputs)
