"""Data of a road, stored with its root object, so that it is undone and deleted with the road."""

from __future__ import annotations

import json
from typing import Any

import bpy

from ...base.errors import InputError
from ...road.parameters import RoadParameters
from ...road.tables.stated import StatedRoad
from ...scenario.scenario import Scenario
from .older_files import PARAMETERS, adopt_older_roads
from .roads import has_parts, parts_and_copies, renew_ids, road_meant, roots

SCENARIO = "synthroads_scenario"
"""Custom property of a road's root: its scenario as JSON."""
BUILT_FROM = "synthroads_built_from"
"""Custom property of a road's root: text of the settings that it was built from."""
FOUND = "synthroads_found"
"""Custom property of a road's root: how it was reconstructed from a cloud, as JSON."""
STATED = "synthroads_stated"
"""Custom property of a road's root: axis and carriageways as stated in its tables since it was built, as JSON."""
EPOCHS = "synthroads_epochs"
"""Custom property of a road's root: the set before, its changes, which epoch is shown and which change is chosen."""


def roads(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """Return the roots of a scene's roads with a stored parameter set and at least one part left, by name."""
    return [root for root in roots(scene) if PARAMETERS in root and has_parts(root, scene)]


def find_road(scene: bpy.types.Scene) -> bpy.types.Object | None:
    """Return the root of the scene's current road; None if there is no road or no part of it is left.

    It is the one that the active object belongs to, else the scene's only one, else the chosen one (`choose_road`).
    """
    root = road_meant(scene)
    if root is None or PARAMETERS not in root:
        return None
    return root if has_parts(root, scene) else None


def road_named(scene: bpy.types.Scene, name: str | None) -> bpy.types.Object | None:
    """Return the root of a scene's road by name, of the current road if None; older roads get roots, copies new ids.

    Raises:
        InputError: no road has this name.
    """
    adopt_older_roads()
    renew_ids()
    if name is None:
        return find_road(scene)
    roots_by_name = {root.name: root for root in roads(scene)}
    if name not in roots_by_name:
        raise InputError(
            "--road", name, f"must be one of {', '.join(roots_by_name)}" if roots_by_name else "the scene has no road"
        )
    return roots_by_name[name]


def remember(
    root: bpy.types.Object, parameters: RoadParameters, scenario: Scenario, built_from: str, reconstruction: str = ""
) -> None:
    """Store a road's data in its root.

    Args:
        root: the root object.
        parameters: the road's parameter set.
        scenario: limits of the road, and the model's fidelity.
        built_from: text of the settings that it was built from.
        reconstruction: how it was reconstructed from a cloud, as JSON; empty if it wasn't.
    """
    root[PARAMETERS] = parameters.to_json()
    root[SCENARIO] = scenario.to_json()
    root[BUILT_FROM] = built_from
    for of_the_road_before in (STATED, EPOCHS):
        if of_the_road_before in root:
            del root[of_the_road_before]
    if reconstruction:
        root[FOUND] = reconstruction
    elif FOUND in root:
        del root[FOUND]


def objects_of(root: bpy.types.Object, scene: bpy.types.Scene | None = None) -> dict[str, bpy.types.Object]:
    """Return a road's parts by role in a scene, the current one if None."""
    return parts_and_copies(root, scene or bpy.context.scene)[0]


def recall(root: bpy.types.Object) -> tuple[RoadParameters, Scenario]:
    """Return the parameter set and scenario stored in a road's root; raise `InputError` if they are damaged."""
    return recall_parameters(root), Scenario.from_dict(_stored(root, SCENARIO), "Road")


def recall_parameters(root: bpy.types.Object) -> RoadParameters:
    """Return the parameter set stored in a road's root; raise `InputError` if it is damaged."""
    return RoadParameters.from_dict(_stored(root, PARAMETERS), "Road")


def recall_stated(root: bpy.types.Object) -> StatedRoad | None:
    """Return what the road's tables state since it was built; None if nothing. InputError if that is damaged."""
    return StatedRoad.from_json(str(root[STATED])) if STATED in root else None


def refuse_stated_axis(root: bpy.types.Object) -> None:
    """Raise `InputError` if the road's axis was stated anew since it was built: its things stand on the old one."""
    stated = recall_stated(root)
    if stated is not None and stated.alignment != recall_parameters(root).alignment:
        raise InputError(
            "Road", None, "its axis was changed in Alignment: press Build as Edited first (at the top of Road)"
        )


def _stored(root: bpy.types.Object, key: str) -> Any:
    """Return the JSON data in a custom property of a road's root."""
    try:
        return json.loads(root[key])
    except (KeyError, TypeError, ValueError):
        raise InputError("Road", None, "its parameter set in the file is damaged; build it again") from None
