"""Roads in a file: each has a root object, an empty, which is the parent of its parts.

A road's root has a unique id as a custom property, and all data that is stored of the road. It may be renamed, moved,
put into any collection, linked to other scenes, appended from other files; a copy of it is another road. Collections
don't matter. A part is a child of its root, or of an object of the user's; then its id says which road it belongs to.
"""

from __future__ import annotations

from itertools import count

import bpy
import numpy as np
from mathutils import Matrix
from numpy.typing import NDArray

from ..things.model_builder import ROLE

ROAD = "synthroads_road"
"""Custom property of a road's root: its id."""
OF_ROAD = "synthroads_of_road"
"""Custom property of a road's parts: the road's id."""
NAME = "synthroads_name"
"""Custom property of a road's parts: the name that the object was given; copies of it have another name."""
ORIGIN = "synthroads_origin"
"""Custom property of a road's root: map coordinates of the scene's own origin, m."""
FRAME = "synthroads_frame"
"""Custom property of a road's root: map coordinates of the root's place when the road was built, m."""
CHOSEN = "synthroads_chosen_road"
"""Property of a scene: root of its current road if the active object belongs to none."""
BUILT_PARTS = "synthroads_built_parts"
"""Custom property of a road's root: roles of all parts that were built, as JSON."""
ROOT_NAME = "SynthRoads Road"
_SIZE = 5.0
"""Size of the empty in the view, m."""
_FARTHEST = 20_000.0
"""Largest distance from the scene's origin, m, at which a new road shares this origin with the other roads; chosen."""


def new_id() -> str:
    """Return a road id that no object of the file has."""
    used_ids = {item[ROAD] for item in bpy.data.objects if ROAD in item}
    return next(name for number in count(1) if (name := f"road-{number}") not in used_ids)


def new_root() -> bpy.types.Object:
    """Make a road's root object, an empty with a new id, in no collection yet."""
    root = bpy.data.objects.new(ROOT_NAME, None)
    root.empty_display_type, root.empty_display_size = "ARROWS", _SIZE
    root[ROAD] = new_id()
    return root


def is_root(item: bpy.types.Object) -> bool:
    """Return whether an object is a road's root."""
    return ROAD in item and item.type == "EMPTY"


def roots(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """Return the root objects of a scene's completely built roads, sorted by name."""
    items = [item for item in scene.objects if is_root(item) and FRAME in item]
    return sorted(items, key=lambda item: item.name_full)


def library_of(root: bpy.types.Object) -> str:
    """Return the path of the file that a root is linked or overridden from; empty for one of this file."""
    override = root.override_library
    library = root.library if override is None else override.reference.library
    return "" if library is None else bpy.path.abspath(library.filepath)


def root_above(item: bpy.types.Object | None) -> bpy.types.Object | None:
    """Return the road's root that an object is or descends from as a child; None if there is none."""
    while item is not None and not is_root(item):
        item = item.parent
    return item


def root_of(item: bpy.types.Object, scene: bpy.types.Scene) -> bpy.types.Object | None:
    """Return the root of the complete road that an object belongs to, as child or by id; None if to none."""
    parent_root = root_above(item)
    if parent_root is not None or OF_ROAD not in item:
        return parent_root if parent_root is None or FRAME in parent_root else None
    return next((root for root in roots(scene) if root[ROAD] == item[OF_ROAD]), None)


def parts_and_copies(
    root: bpy.types.Object, scene: bpy.types.Scene
) -> tuple[dict[str, bpy.types.Object], list[bpy.types.Object]]:
    """Return a road's parts in a scene by role, and the list of the user's copies of parts."""
    by_role: dict[str, list[bpy.types.Object]] = {}
    scene_roots = roots(scene)
    for item in scene.objects:
        if ROLE in item and OF_ROAD in item and _belongs(item, root, scene_roots):
            by_role.setdefault(str(item[ROLE]), []).append(item)
    parts, copies = {}, []
    for role, items in by_role.items():
        original, *item_copies = sorted(items, key=_originality)
        parts[role] = original
        copies += item_copies
    return parts, copies


def has_parts(root: bpy.types.Object, scene: bpy.types.Scene) -> bool:
    """Return whether a road still has any part in a scene; stops at the first, as panels ask at each drawing."""
    road_roots = roots(scene)
    return any(ROLE in item and OF_ROAD in item and _belongs(item, root, road_roots) for item in scene.objects)


def _belongs(item: bpy.types.Object, root: bpy.types.Object, scene_roots: list[bpy.types.Object]) -> bool:
    """Return whether a part belongs to a road: as a descendant of its root, else by the road's id."""
    part_root = root_above(item)
    if part_root is None:
        part_root = next((candidate for candidate in scene_roots if candidate[ROAD] == item[OF_ROAD]), None)
    return part_root == root


def _originality(item: bpy.types.Object) -> tuple[bool, str]:
    """Return a sort key that puts an original before its copies, whose names differ from the stored one."""
    return item.name != item.get(NAME), item.name


def road_meant(scene: bpy.types.Scene) -> bpy.types.Object | None:
    """Return the root of the scene's current road; None if it has no road.

    It is the scene's only road; of several the active object's; else the chosen one, see `choose_road`; else the first
    by name.
    """
    road_roots = roots(scene)
    if len(road_roots) < 2:
        return road_roots[0] if road_roots else None
    layer = bpy.context.view_layer if scene == bpy.context.scene else scene.view_layers[0]
    active_item = layer.objects.active
    active_root = root_of(active_item, scene) if active_item is not None else None
    chosen_root = scene.get(CHOSEN)
    return next((root for root in (active_root, chosen_root) if root in road_roots), road_roots[0])


def road_of_id(scene: bpy.types.Scene, road: str) -> bpy.types.Object | None:
    """Return the root of a scene's road by its id, None if there is none; of the current road for an empty id."""
    if not road:
        return road_meant(scene)
    return next((root for root in roots(scene) if root[ROAD] == road), None)


def choose_road(scene: bpy.types.Scene, root: bpy.types.Object) -> None:
    """Make a road the scene's current one while no object of another road is active."""
    scene[CHOSEN] = root


def renew_ids() -> None:
    """Give roads whose id is taken (copies, appended ones) new ids, in place, with the parts below their roots."""
    used_ids: set[str] = set()
    for root in sorted((item for item in bpy.data.objects if is_root(item)), key=_originality):
        if root[ROAD] in used_ids and root.library is None:
            root[ROAD] = new_id()
            for item in root.children_recursive:
                if OF_ROAD in item and root_above(item) == root and item.library is None:
                    item[OF_ROAD] = root[ROAD]
        used_ids.add(root[ROAD])


def origin_of(root: bpy.types.Object) -> NDArray[np.float64]:
    """Return the map coordinates (3,), m, of the scene's origin, as kept by a road's root."""
    return np.array(root[ORIGIN], dtype=np.float64)


def scene_origin(scene: bpy.types.Scene) -> NDArray[np.float64] | None:
    """Return the map coordinates (3,), m, of the scene's origin, as its current road says; None without a road."""
    root = road_meant(scene)
    return None if root is None else origin_of(root)


def place_root(root: bpy.types.Object, frame: NDArray[np.float64], scene: bpy.types.Scene, keep: bool = True) -> None:
    """Move a road's root to where its frame lies on the map, and store its frame and the scene's origin in it.

    The scene's origin is that of its other roads, if they are not too far away, else the frame's.

    Args:
        root: the root.
        frame: (3,) map coordinates, m, of the origin that the parts were built around.
        scene: scene that contains the root.
        keep: whether a displacement by the user stays; else it is undone.
    """
    user_transform = displacement(root)
    other_origins = [origin_of(other_root) for other_root in roots(scene) if other_root != root]
    shared_origin = next((origin for origin in other_origins if np.abs(frame - origin).max() <= _FARTHEST), None)
    origin = frame if shared_origin is None else shared_origin
    root[ORIGIN], root[FRAME] = [float(value) for value in origin], [float(value) for value in frame]
    place = np.eye(4)
    place[:3, 3] = frame - origin
    matrix = user_transform @ place if keep else place
    if not np.array_equal(matrix, np.array(root.matrix_world)):
        root.matrix_world = Matrix(matrix.tolist())  # Blender would take plain lists' rows for columns


def displacement(root: bpy.types.Object) -> NDArray[np.float64]:
    """Return the transform (4, 4) by which the user moved a road since it was built; identity if not, or unbuilt."""
    if FRAME not in root:
        return np.eye(4)
    built_matrix = np.eye(4)
    built_matrix[:3, 3] = np.float32(np.array(root[FRAME]) - np.array(root[ORIGIN]))
    current_matrix = world_matrix(root)
    return np.eye(4) if np.array_equal(current_matrix, built_matrix) else current_matrix @ np.linalg.inv(built_matrix)


def world_matrix(item: bpy.types.Object) -> NDArray[np.float64]:
    """Return an object's world matrix (4, 4), computed from its properties even if not evaluated yet."""
    deltas = (*item.delta_location, *item.delta_rotation_euler, *(factor - 1.0 for factor in item.delta_scale))
    if item.constraints or any(deltas) or (item.parent is not None and item.parent_type != "OBJECT"):
        return np.array(item.matrix_world, dtype=np.float64)
    basis = np.array(item.matrix_basis, dtype=np.float64)
    if item.parent is None:
        return basis
    return world_matrix(item.parent) @ np.array(item.matrix_parent_inverse, dtype=np.float64) @ basis
