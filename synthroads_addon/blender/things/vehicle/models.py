"""SR Car, SR Estate, ... SR Motorcycle: one vehicle each, its wheels on z = 0, facing along +y.

They are described in `presets/vehicles.json`: a model is a list of frames of nodes, a frame is a list of parts (joined
at once if it is marked so), and a part is a function of this package with its arguments, in metres.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from typing import Any

import bpy

from ....base.files import PRESETS
from ....base.schema import read_json
from ....road.things.vehicles import CHASSIS
from ...nodes import operations as op
from ...nodes.builder import Tree, Value, node_group, offer_group
from .details import VehicleMaterials, ball, boxes, rod, smooth, wheels
from .hull import hull

_PARTS: dict[str, Callable[..., Value]] = {"hull": hull, "wheels": wheels, "boxes": boxes, "rod": rod, "ball": ball}


def model_group(model: str) -> bpy.types.NodeTree:
    """Return the node group of one vehicle of a model, e.g. SR Car."""
    description = f"A {model}, its wheels on the ground, facing along +y"
    return node_group(f"SR {model.title()}", _build, model, description=description)


def _build(tree: Tree, model: str) -> None:
    """Build the node group of a vehicle's model from the preset."""
    materials, parts = VehicleMaterials(tree), []
    for frame in _models()[model]:
        with tree.frame(frame["frame"]):
            frame_parts = [_PARTS[part["part"]](tree, materials, **_settings(part)) for part in frame["parts"]]
            parts += [op.join(*frame_parts)] if frame.get("joined") else frame_parts
    vehicle = op.join(*parts)
    with tree.frame("Shading"):
        vehicle = smooth(vehicle)
    tree.output("Mesh", vehicle, description="The vehicle")


@cache
def _models() -> dict[str, list[dict[str, Any]]]:
    """Return the preset's models: the frames of each by its name; cached."""
    models: dict[str, list[dict[str, Any]]] = read_json(PRESETS / "vehicles.json")
    return models


def plates_of(model: str) -> list[tuple[tuple[float, float, float], tuple[float, float, float]]]:
    """Return the middle and size of each of a model's number plates, m."""
    parts = [part for frame in _models()[model] for part in frame["parts"] if part["part"] == "boxes"]
    items = [item for part in parts for item in part["items"] if item[0] == "plate"]
    return [(_as_tuples(middle), _as_tuples(size)) for _, middle, size in items]


def _settings(part: dict[str, Any]) -> dict[str, Any]:
    """Return a preset part's arguments without its "part", lists as tuples as nodes take vectors."""
    return {name: _as_tuples(value) for name, value in part.items() if name != "part"}


def _as_tuples(value: Any) -> Any:
    """Return a JSON value with its lists as tuples."""
    return tuple(_as_tuples(item) for item in value) if isinstance(value, list) else value


for _model in CHASSIS:
    offer_group("Vehicles", f"SR {_model.title()}", partial(model_group, _model))
