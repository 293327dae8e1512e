"""Attributes that keep an object's parameters in a format without classes of its own for roads."""

from __future__ import annotations

from typing import Any

from ..road.objects import RoadObject
from ..road.parameters import Asset

CLASSES = {
    "Guardrail": "guardrail",
    "ConcreteBarrier": "barrier",
    "NoiseBarrier": "noise_barrier",
    "TemporaryBarrier": "construction_barrier",
    "Delineator": "warning_post",
    "TrafficSign": "road_sign",
    "Gantry": "shield_gantry",
    "Pole": "pole",
    "TrafficLight": "traffic_light",
    "KilometreBoard": "road_sign",
    "Cabinet": "utility",
    "ConstructionBeacon": "construction_barrier",
    "Overpass": "bridge",
}
"""Type of object -> class of its points."""


def attributes_of(item: RoadObject) -> dict[str, Any]:
    """Return an object's parameters as JSON data, ``instance`` first; its type is ``object_type``."""
    data = item.model_dump(mode="json", by_alias=True, exclude_none=True)
    kind = data.pop("type")
    attributes = {"instance": data.pop("instance"), "object_type": kind}
    if kind in CLASSES or isinstance(item, Asset):
        attributes["class"] = data.pop("class_name") if isinstance(item, Asset) else CLASSES[kind]
    return attributes | data
