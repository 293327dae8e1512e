"""Edits of a road's parts that parameters can't describe, found by comparison with each part's state when it was built.

A part is an object with one modifier, a node group, on a mesh that Python made. Moves, turns about the vertical and
changes of its inputs are read back as parameters. A part with any other edit (further or applied modifiers, another
mesh, a scale, a tilt, inputs that aren't fields) is *edited by hand*.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ...road.objects import PointObject
from ...road.things.beacon import ConstructionBeacon
from ...road.things.delineator import Delineator
from ..compat import identified_input

Float = NDArray[np.float64]

POSTS: dict[str, type[PointObject]] = {"Delineators": Delineator, "Beacons": ConstructionBeacon}
"""Parts with many things, one per vertex: type of the things by role."""
BUILT = "synthroads_built"
"""Custom property of a part: its mesh's digest and its inputs as built, as JSON."""
UPRIGHT = 1e-5
"""Largest tilt, deviation of a scale from 1, or shear that counts as none; chosen."""
_KINDS = ("NodeSocketFloat", "NodeSocketInt", "NodeSocketBool")


@dataclass(frozen=True)
class HandEdit:
    """A part that was edited by hand, so that no parameters describe it, with the reason.

    Attributes:
        part: the part's role in the road.
        name: name of its object now.
        reason: the edit, in words.
    """

    part: str
    name: str
    reason: str

    def to_dict(self) -> dict[str, str]:
        """Return part, object and reason as JSON data."""
        return {"part": self.part, "object": self.name, "reason": self.reason}


def keep_built(item: bpy.types.Object) -> None:
    """Store a part's mesh digest and modifier inputs in a custom property, to find edits later."""
    modifier = own_modifier(item)
    inputs = {} if modifier is None else dict(_numbers(modifier))
    item[BUILT] = json.dumps({"mesh": mesh_digest(item), "inputs": inputs})


def own_modifier(item: bpy.types.Object) -> bpy.types.NodesModifier | None:
    """Return an object's only modifier if it is a Geometry Nodes modifier with a group, else None."""
    if len(item.modifiers) != 1:
        return None
    modifier = item.modifiers[0]
    return modifier if modifier.type == "NODES" and modifier.node_group is not None else None


def mesh_digest(item: bpy.types.Object) -> str:
    """Return a checksum text of an object's unevaluated mesh (counts and places); empty for an object without one."""
    if not isinstance(item.data, bpy.types.Mesh):
        return ""
    places = vertices_of(item.data).astype(np.float32)
    return f"{len(places)}:{len(item.data.polygons)}:{zlib.crc32(places.tobytes())}"


def vertices_of(mesh: bpy.types.Mesh) -> Float:
    """Return a mesh's vertices (V, 3), float64, m, in the object's frame."""
    coordinates = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", coordinates)
    return coordinates.reshape(-1, 3).astype(np.float64)


def attribute_of(mesh: bpy.types.Mesh, name: str, default: float = 0.0) -> NDArray[Any]:
    """Return a float or integer point attribute (V,); filled with the default if the mesh has no such attribute."""
    attribute = mesh.attributes.get(name)
    if attribute is None or attribute.domain != "POINT" or attribute.data_type not in ("FLOAT", "INT"):
        return np.full(len(mesh.vertices), default)
    values = np.empty(len(mesh.vertices), np.int32 if attribute.data_type == "INT" else np.float32)
    attribute.data.foreach_get("value", values)
    return values


def _numbers(modifier: bpy.types.NodesModifier) -> Iterator[tuple[str, float]]:
    """Yield (name, value) of a modifier's inputs that are numbers or switches."""
    for socket in modifier.node_group.interface.items_tree:
        if socket.item_type == "SOCKET" and socket.in_out == "INPUT" and socket.socket_type in _KINDS:
            yield socket.name, identified_input(modifier, socket.identifier)


def built_state(item: bpy.types.Object) -> dict[str, Any]:
    """Return the mesh digest and inputs stored by `keep_built`; an empty dictionary if missing or damaged."""
    try:
        state = json.loads(item.get(BUILT, "{}"))
    except (TypeError, ValueError):
        return {}
    return state if isinstance(state, dict) else {}


def mesh_edited(item: bpy.types.Object) -> bool:
    """Return whether a part's unevaluated mesh differs from the one that was built; False if that isn't known."""
    return built_state(item).get("mesh", "") not in ("", mesh_digest(item))


def shape_reason(item: bpy.types.Object, carried: Collection[str], keeps_mesh: bool, grouped: bool = True) -> str:
    """Return the reason, in words, why no parameters describe a part's shape any more; empty if they do.

    Args:
        item: the part.
        carried: names of its inputs that are read back.
        keeps_mesh: whether its mesh must be the one that was built.
        grouped: whether it was built with a modifier with a node group.
    """
    if not grouped:
        return "it has modifiers" if item.modifiers else ""
    if not item.modifiers:
        return "its modifier was applied or removed"
    modifier = own_modifier(item)
    if modifier is None:
        return "it has other modifiers: " + ", ".join(other.name for other in item.modifiers)
    if not (modifier.show_viewport and modifier.show_render):
        return "its modifier is switched off"
    if keeps_mesh and mesh_edited(item):
        return "its mesh was edited"
    built_inputs = built_state(item).get("inputs", {})
    changed_names = [
        name for name, value in _numbers(modifier) if name not in carried and built_inputs.get(name, value) != value
    ]
    return f"its inputs {', '.join(changed_names)} are no fields of the parameter set" if changed_names else ""


def place_reason(place: Float, scalable: bool = False, mirrorable: bool = False) -> str:
    """Return the reason, in words, why no parameters describe a part's transform (4, 4); empty if they do.

    Args:
        place: in its road's frame.
        scalable: it may be larger or smaller as a whole.
        mirrorable: it may be mirrored in a vertical plane: parameters say where it stands then.
    """
    turn = place[:3, :3]
    size = np.linalg.norm(turn, axis=0)
    if not np.isfinite(place).all() or size.min() < 1e-6:
        return "it is scaled to nothing"
    if scalable:
        turn, size = turn / size.mean(), size / size.mean()
    if np.abs(size - 1.0).max() > UPRIGHT or np.abs(turn.T @ turn - np.eye(3)).max() > 2.0 * UPRIGHT:
        shown = " × ".join(f"{value:.4g}" for value in np.linalg.norm(place[:3, :3], axis=0))
        return f"it is scaled ({shown})"
    if abs(turn[2, 2] - 1.0) > UPRIGHT or np.abs(turn[2, :2]).max() > UPRIGHT:
        return "it is mirrored" if is_mirrored(place) else "it is tilted"
    return "it is mirrored" if is_mirrored(place) and not mirrorable else ""


def is_mirrored(place: Float) -> bool:
    """Return whether a matrix (4, 4) mirrors."""
    return bool(np.linalg.det(place[:3, :3]) < 0.0)


def course_of(place: Float, turn: float = 0.0) -> float:
    """Return where a direction of an object's own frame points to in the road's frame, rad, even if it is mirrored.

    Args:
        place: (4, 4) of the object, upright.
        turn: of the direction from the object's own x axis, rad.
    """
    x, y = place[:2, :2] @ [np.cos(turn), np.sin(turn)]
    return float(np.arctan2(y, x))


def turn_of(place: Float) -> float:
    """Return the rotation about the vertical, rad, of an upright matrix (4, 4)."""
    return float(np.arctan2(place[1, 0], place[0, 0]))
