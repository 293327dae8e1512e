"""Any evaluated scene as triangles with class, instance and material."""

from __future__ import annotations

from collections.abc import Callable, Collection, Generator, Hashable, Iterator, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from itertools import chain, count
from typing import Any, NamedTuple, TypeAlias

import bpy
import numpy as np
from numpy.typing import NDArray

from ...base.class_mapping import ClassMapping
from ...base.errors import InputError
from ...road.geometry import RoadGeometry
from ...road.instances import PassNumbers
from ...scanning.scene.mesh import SceneMesh
from ...scanning.scene.motion import (
    BodyMotion,
    LaneMotion,
    LinearMotion,
    MovingMesh,
    ScannedScene,
    checked_factor,
    lane_motions,
)
from ..labels import Label, Labels, velocity_of
from ..model.places import PLACED, STILL
from ..model.roads import origin_of, parts_and_copies, road_of_id, world_matrix
from ..things.model_builder import AHEAD, SUPPORT
from .changes import Changes
from .left_out import LeftOut
from .reading import MeshCopy, MeshPart, Places, SceneTables, copy_mesh, join_parts, slot_names
from .render_state import Visible, is_seen, shown_as
from .units import scene_unit
from .values import ObjectValues, inputs_by_material, object_values, random_number

Float = NDArray[np.float64]
Source: TypeAlias = bpy.types.Depsgraph | bpy.types.Scene | None

_FARTHEST_FROM_MOTION = 100.0
"""Distance (m) of a vehicle's vertices from its place on its lane beyond which it is another road's; chosen."""
_ROUNDINGS = 4.0 * float(np.finfo(np.float32).eps)
"""Rounding of an object's place, as a share of its coordinates: it has 32 bits, and is multiplied once. Chosen."""
_ATTEMPTS = 4
"""Number of attempts to read a scene that the user changes meanwhile; the last attempt is one step; chosen."""


def scene_mesh(
    source: Source = None,
    objects: Collection[bpy.types.Object] | None = None,
    classes: ClassMapping | None = None,
    number_objects: bool = False,
    class_ids: Mapping[str, int] | None = None,
    road: str = "",
    *,
    visible: Visible = "render",
) -> SceneMesh:
    """Return all visible faces of the evaluated scene as labelled triangles in its local frame, m.

    The scene's unit scale applies; in a scene with a road of this package, which is in metres, the unit is a metre.

    A face's class is its attribute ``class_id``, else its object's custom property ``synthroads_class``, else the class
    that a collection of the object is named after, else unlabelled; names can have classes as well, see `ClassMapping`.
    Its instance likewise is the attribute ``instance_id`` or the property ``synthroads_instance``, else 0. Triangles
    without area are left out. Nothing in the scene changes.

    Args:
        source: a depsgraph, or a scene (its first view layer); the current scene if None.
        objects: objects to read, with what they instance; all if None.
        classes: classes by name.
        number_objects: whether to number the objects without an instance number (an object that shows a collection is
            one), in the order of their names, with the free numbers from 1 on.
        class_ids: ``class_id`` by the names of classes; that of the full table if None, see `ClassScheme.source_ids`.
        road: id of the road that gives the scene's place on the map; the scene's current road if empty.
        visible: whether the scene is read as renders or as the viewport shows it; a depsgraph is read as it is.

    Raises:
        InputError: an object's vertices aren't finite, or a custom property has a wrong value; names the object.
    """
    with _shown(source, visible):
        depsgraph = _depsgraph(source)
        root = road_of_id(depsgraph.scene, road)
        as_shown = None if isinstance(source, bpy.types.Depsgraph) else visible
        walk = _SceneWalk(depsgraph, objects, classes, class_ids, root, visible=as_shown)
        walk.copy_all()
    tables = walk.tables(_origin(root), number_objects)
    return join_parts(walk.pairs(None), tables)


def copied_parts(
    *, class_ids: Mapping[str, int] | None = None, road: str = "", visible: Visible = "render"
) -> tuple[list[tuple[str, MeshPart, Places]], SceneTables]:
    """Return the meshes of the current scene, each with an object's name and its places, and their tables.

    Nothing moves, and nothing is joined: a mesh that stands at many places is there once. Arguments as `scene_mesh`.
    """
    with _shown(None, visible):
        depsgraph = _depsgraph(None)
        root = road_of_id(depsgraph.scene, road)
        walk = _SceneWalk(depsgraph, None, None, class_ids, root, visible=visible)
        walk.copy_all()
    names = walk.names()
    tables = walk.tables(_origin(root), False)
    return [(name, *pair) for name, pair in zip(names, walk.pairs(None), strict=True)], tables


def scanned_scene(
    source: Source = None,
    classes: ClassMapping | None = None,
    geometry: RoadGeometry | None = None,
    speed_factor: float = 1.0,
    *,
    number_objects: bool = False,
    class_ids: Mapping[str, int] | None = None,
    road: str = "",
    visible: Visible = "render",
) -> ScannedScene:
    """Return the evaluated scene as labelled triangles: one mesh of what stands, and moving bodies with their motions.

    Vehicles of the road's model move along their lanes, see `LaneMotion`; those with a speed of 0 stand. A vehicle that
    the user moved starts at its current place at time 0, and keeps its offset from its lane. Any other object moves
    along a straight line if it, or one of its parents, has the custom property ``synthroads_velocity``: (vx, vy, vz),
    m/s; its children and the collection that it shows move with it as one body.

    Args:
        source, classes, number_objects, class_ids, road, visible: see `scene_mesh`.
        geometry: geometry of the road that the scene was built from; if None its vehicles stand.
        speed_factor: factor of all speeds, >= 0; with 0 everything stands.

    Raises:
        InputError: as `scene_mesh`; a velocity isn't three numbers, the factor is negative, or the geometry is that of
            another road.
    """
    options: dict[str, Any] = {"number_objects": number_objects, "class_ids": class_ids, "road": road}
    options["visible"] = visible
    steps = scanned_scene_steps(source, classes, geometry, speed_factor, **options)
    while True:
        try:
            next(steps)
        except StopIteration as end:
            scene_copy: CopiedScene = end.value
            return scene_copy.put_together()


def scanned_scene_steps(
    source: Source = None,
    classes: ClassMapping | None = None,
    geometry: RoadGeometry | None = None,
    speed_factor: float = 1.0,
    *,
    number_objects: bool = False,
    class_ids: Mapping[str, int] | None = None,
    road: str = "",
    visible: Visible = "render",
) -> Generator[float, None, CopiedScene]:
    """Generator that copies the evaluated scene in short steps on the main thread, and returns the copy.

    Each mesh is copied in a step of its own; but all in one step if renders and the viewport differ, as settings are
    changed within that step only. If the user changes something between steps, reading begins again; after several
    attempts all is read in one step. After an undo, or when another file was opened, the generator must be closed.

    Yields:
        the share of the copying that is done, 0 to 1.

    Returns:
        the copy of the scene.
    """
    checked_factor(speed_factor)
    as_shown = None if isinstance(source, bpy.types.Depsgraph) else visible
    walk: _SceneWalk | None = None
    attempt_count = 0
    with Changes() as changes:
        while walk is None or not walk.complete:
            attempt_count += 1
            with _shown(source, visible) as is_changed:
                depsgraph = _depsgraph(source)
                changes.forget()
                root = road_of_id(depsgraph.scene, road)
                origin = _origin(root)
                lanes: dict[str, LaneMotion] = {}
                if geometry is not None:
                    map_shift = origin - np.array(geometry.parameters.transform.translate)
                    lanes = lane_motions(geometry, speed_factor, map_shift)
                walk = _SceneWalk(depsgraph, None, classes, class_ids, root, lanes, speed_factor, as_shown)
                if attempt_count == _ATTEMPTS or is_changed:
                    walk.copy_all()
            for share in walk.copies():
                yield share
                if changes.seen:
                    break
    complete_walk = walk
    return CopiedScene(complete_walk.materials, lambda: _put_together(complete_walk, origin, number_objects))


def _put_together(walk: _SceneWalk, origin: Float, number_objects: bool) -> ScannedScene:
    """Return the scene of a complete walk, as meshes; works without Blender, in any thread."""
    tables = walk.tables(origin, number_objects)
    moving = tuple(_moving(walk, carrier, motion, tables) for carrier, motion in walk.motions.items())
    unmatched = walk.labels.by_name.unmatched_patterns()
    return ScannedScene(join_parts(walk.pairs(None), tables), moving, unmatched, walk.warnings)


@dataclass(frozen=True)
class CopiedScene:
    """Copy of an evaluated scene, ready to be put together without Blender.

    Attributes:
        materials: names of the scene's materials, in the order of their indices in the meshes.
        put_together: function that returns the scene; call it once. It uses no data of Blender: any thread may call it.
    """

    materials: tuple[str, ...]
    put_together: Callable[[], ScannedScene]


def _moving(walk: _SceneWalk, carrier: Hashable, motion: BodyMotion, tables: SceneTables) -> MovingMesh:
    """Return the mesh that one carrier moves, in the motion's own frame, with the motion and pass numbers."""
    rotation, translation, _ = motion.pose(np.zeros(1))
    to_body = np.eye(4)
    to_body[:3, :3] = rotation[0].T
    to_body[:3, 3] = -rotation[0].T @ translation[0]
    mesh = join_parts(walk.pairs(carrier), tables, to_body)
    if len(mesh) and isinstance(motion, LaneMotion):
        farthest = float(np.abs(mesh.vertices).max())
        if farthest > _FARTHEST_FROM_MOTION:
            raise _other_geometry(farthest)
    return MovingMesh(mesh, motion, walk.pass_numbers.get(carrier))


def _other_geometry(distance: float) -> InputError:
    """Return the error for a vehicle that is a distance (m) from its place on the lane of a road's geometry."""
    return InputError(
        "geometry", None, f"must be that of the road in the scene: a vehicle is {distance:.0f} m off its lane"
    )


class _LaneVehicle(NamedTuple):
    """Vehicle of the road's model, as the scene holds it.

    Attributes:
        role: its id in the parameter set.
        motion: its motion along its lane, without the user's moves.
        has_origin_below: whether its object has its origin below its middle; in files of earlier versions an object
            has that of the road.
        is_as_built: whether its object is where it was built; never in files of earlier versions.
    """

    role: str
    motion: LaneMotion
    has_origin_below: bool
    is_as_built: bool


@dataclass(frozen=True)
class _MeshUse:
    """Part, label and motion that all uses of one mesh by one object have in common.

    Attributes:
        part: key of the mesh's part.
        label: index of the label.
        lane: vehicle of the road's model that the mesh belongs to; None for anything else.
        velocity: key of the moving object, and its velocity, m/s, of anything else that moves.
        values: reader of the object's values that its materials read; None if they read none.
    """

    part: tuple[Hashable, ...]
    label: int
    lane: _LaneVehicle | None
    velocity: tuple[Hashable, Float] | None
    values: ObjectValues | None


@dataclass(frozen=True)
class _QueuedMesh:
    """An object's evaluated mesh that is queued to be copied.

    Attributes:
        name: the object's name for messages.
        item: name of the object, and file path of its library.
        slots: names of its materials.
        undeformed: whether the object has no modifiers.
    """

    name: str
    item: tuple[str, str | None]
    slots: list[str]
    undeformed: bool


class _SceneWalk:
    """Reader of an evaluated scene: walks its instances, queues their meshes and copies them.

    The constructor walks over all instances. Meshes of objects can be found again later, and are copied one by one by
    `copies`; meshes that exist only during the walk are copied at once.

    Attributes:
        labels: lookup of the objects' labels.
        motions: motion of each moving body, by the key of its carrier.
        pass_numbers: numbers of later passes of the road's vehicles, by carrier.
        warnings: sentences about parts that aren't scanned as declared.
    """

    def __init__(
        self,
        depsgraph: bpy.types.Depsgraph,
        objects: Collection[bpy.types.Object] | None,
        classes: ClassMapping | None,
        class_ids: Mapping[str, int] | None = None,
        root: bpy.types.Object | None = None,
        lanes: Mapping[str, LaneMotion] | None = None,
        speed_factor: float = 0.0,
        visible: Visible | None = None,
    ) -> None:
        self._unit = 1.0 if root is not None else scene_unit(depsgraph.scene)
        self.labels = Labels(depsgraph.scene, classes, class_ids)
        self.motions: dict[Hashable, BodyMotion] = {}
        self.pass_numbers: dict[Hashable, PassNumbers] = {}
        self._objects = None if objects is None else {item.original for item in objects}
        self._lanes = lanes or {}
        self._speed_factor = speed_factor
        # Indices of materials by name; then, by the key of a mesh's part (its data and its materials' names): meshes to
        # be copied, copies, and parts converted from copies.
        self._materials: dict[str, int] = {}
        self._queue: dict[tuple[Hashable, ...], _QueuedMesh] = {}
        self._copied: dict[tuple[Hashable, ...], MeshCopy] = {}
        self._parts: dict[tuple[Hashable, ...], MeshPart] = {}
        # Label of each use of a mesh; object and part of each label without an instance number, by the label's index;
        # places of the parts, by carrier.
        self._labels: list[Label] = []
        self._unnumbered: dict[int, tuple[str, tuple[Hashable, ...]]] = {}
        self._uses: dict[Hashable, dict[tuple[Hashable, ...], Places]] = {}
        self._depsgraph = depsgraph
        self._material_inputs = inputs_by_material()
        self._root = np.eye(4) if root is None else world_matrix(root)
        parts = parts_and_copies(root, depsgraph.scene)[0] if root is not None and self._lanes else {}
        self._vehicle_roles = {item: role for role, item in parts.items() if role in self._lanes}
        self._visible, self._layer, self._left_out = visible, depsgraph.view_layer, LeftOut()
        self._walk(depsgraph)
        self._left_out.see_hair(depsgraph)
        self.warnings = self._left_out.warnings(depsgraph.view_layer)

    def copies(self) -> Iterator[float]:
        """Copy the queued meshes one by one, yielding the share that is done after each.

        It ends early if the user has changed a mesh.
        """
        total = max(1, len(self._queue))
        while self._queue:
            key, queued = next(iter(self._queue.items()))
            item = bpy.data.objects.get(queued.item)
            mesh = item.evaluated_get(self._depsgraph).data if item is not None else None
            if not isinstance(mesh, bpy.types.Mesh) or mesh.as_pointer() != key[0]:
                return  # the user has changed the mesh: the walk stays incomplete
            self._copy(key, queued.name, mesh, queued.slots, queued.undeformed)
            del self._queue[key]
            yield 1.0 - len(self._queue) / total

    @property
    def materials(self) -> tuple[str, ...]:
        """Return the scene's material names in the order of their indices."""
        return tuple(self._materials)

    @property
    def complete(self) -> bool:
        """Return whether all queued meshes are copied."""
        return not self._queue

    def copy_all(self) -> None:
        """Copy all queued meshes in one step."""
        for _ in self.copies():
            pass

    def _copy(
        self, key: tuple[Hashable, ...], name: str, mesh: bpy.types.Mesh, slots: list[str], undeformed: bool
    ) -> None:
        """Copy a mesh with the values that its materials read."""
        inputs = frozenset().union(*(self._material_inputs.get(slot, frozenset()) for slot in slots))
        self._copied[key] = copy_mesh(name, mesh, slots, self._materials, self.labels.by_name, inputs, undeformed)

    def names(self) -> list[str]:
        """Return the names of the objects whose meshes `pairs` returns for what stands, in the same order."""
        return [self._copied[key].name for key in self._uses.get(None, {})]

    def pairs(self, carrier: Hashable) -> list[tuple[MeshPart, Places]]:
        """Return the mesh parts that a carrier moves (None: those that stand) with their places, and forget them."""
        pairs = [(self._part(key), places) for key, places in self._uses.pop(carrier, {}).items()]
        if not self._uses:
            self._parts.clear()  # all parts have been returned: free their memory
        return pairs

    def _part(self, key: tuple[Hashable, ...]) -> MeshPart:
        """Return a mesh part by its key, converted from its copy once."""
        if key in self._copied:
            self._parts[key] = self._copied.pop(key).part()
        return self._parts[key]

    def tables(self, origin: Float, number_objects: bool) -> SceneTables:
        """Return the scene's labels, materials and origin (3,), m; with numbers for unnumbered objects if chosen."""
        labels = self._numbered() if number_objects else self._labels
        return SceneTables(labels, self.materials, origin, self.labels.reserved, self._unit)

    def _walk(self, depsgraph: bpy.types.Depsgraph) -> None:
        """Walk over all instances of the scene; store each mesh's places by carrier and part."""
        mesh_uses: dict[tuple[int, int, int], _MeshUse | None] = {}
        for use in depsgraph.object_instances:
            # Curves, texts, surfaces and metaballs are listed a second time, as meshes.
            item = use.object
            if item.type != "MESH":
                self._left_out.see_kind(item)
                continue
            owner = use.parent if use.is_instance else item
            # A million instances may share one mesh: what they have in common is determined once.
            key = (item.data.as_pointer(), item.original.as_pointer(), owner.as_pointer())
            if key not in mesh_uses:
                mesh_uses[key] = self._use_mesh(item, owner)
            mesh_use = mesh_uses[key]
            if mesh_use is None:
                continue
            matrix = list(chain.from_iterable(use.matrix_world))
            carrier = self._carrier(mesh_use, matrix) if mesh_use.lane or mesh_use.velocity else None
            places = self._uses.setdefault(carrier, {}).setdefault(mesh_use.part, Places())
            places.matrices.fromlist(matrix)
            places.labels.append(mesh_use.label)
            if mesh_use.values is not None:
                places.objects.append(mesh_use.values.rows(random_number(use), (matrix[3], matrix[7], matrix[11])))

    def _use_mesh(self, item: bpy.types.Object, owner: bpy.types.Object) -> _MeshUse | None:
        """Queue or copy an evaluated object's mesh; return its part, label and motion, None if it isn't scanned."""
        original, owner_original = item.original, owner.original
        if not len(item.data.polygons) or SUPPORT in owner_original:
            return None
        if self._objects is not None and owner_original not in self._objects:
            return None
        if self._visible is not None and not (
            is_seen(self._visible, owner_original, self._layer)
            and (self._visible == "viewport" or original.visible_camera)
        ):
            return None
        slots = slot_names(item)
        self._left_out.see_object(owner_original, slots)
        # Materials may be linked to the object, so that the same mesh can look different.
        part_key = (item.data.as_pointer(), *slots)
        if part_key not in self._queue and part_key not in self._copied:
            for name in slots:
                self._materials.setdefault(name, len(self._materials))
            item_key = (original.name, original.library.filepath if original.library else None)
            is_own_mesh = original.evaluated_get(self._depsgraph).data == item.data
            if is_own_mesh and bpy.data.objects.get(item_key) == original:
                self._queue[part_key] = _QueuedMesh(item.name, item_key, slots, not original.modifiers)
            else:  # a mesh of a geometry's instance, or of a curve, exists only during the walk
                self._copy(part_key, item.name, item.data, slots, False)
        label = self.labels.label_of(original, owner_original)
        self._labels.append(label)
        if label.instance < 0:
            self._unnumbered[len(self._labels) - 1] = (owner_original.name_full, part_key)
        role = self._vehicle_roles.get(original, self._vehicle_roles.get(owner_original))
        vehicle = None
        if role is not None:
            item = original if original in self._vehicle_roles else owner_original
            is_as_built = PLACED in item and np.allclose(item.location[:2], item[PLACED], rtol=0.0, atol=STILL)
            vehicle = _LaneVehicle(role, self._lanes[role], AHEAD in item, bool(is_as_built))
        values = object_values(original, slots, self._material_inputs)
        return _MeshUse(part_key, len(self._labels) - 1, vehicle, self._velocity(original, owner_original), values)

    def _velocity(self, item: bpy.types.Object, owner: bpy.types.Object) -> tuple[Hashable, Float] | None:
        """Return (key of the moving object, velocity (3,), m/s) of an original object; None if nothing moves it."""
        inner_velocity = velocity_of(item) if item != owner else None
        item_velocity = inner_velocity or velocity_of(owner)
        if not item_velocity or not self._speed_factor or not item_velocity[1].any():
            return None
        # An object that moves within a collection moves wherever the collection is shown: once per owner.
        return (item_velocity[0].name_full, owner.name_full if inner_velocity else ""), item_velocity[
            1
        ] * self._speed_factor

    def _carrier(self, mesh_use: _MeshUse, matrix: list[float]) -> Hashable:
        """Return the key in `motions` of the motion of a mesh's use, added if new; its own velocity counts first."""
        if mesh_use.velocity is not None:
            key, velocity = mesh_use.velocity
            if key not in self.motions:
                self.motions[key] = LinearMotion(velocity, [self._unit * value for value in matrix[3:12:4]])
            return key
        assert mesh_use.lane is not None
        role, motion, has_origin_below, is_as_built = mesh_use.lane
        key = (role, *matrix)
        if key not in self.motions:
            place = np.array(matrix).reshape(4, 4)
            built_middle = motion.pose(np.zeros(1))[1][0]
            if has_origin_below:
                middle = (np.linalg.inv(self._root) @ place)[:3, 3]
                rounding = _ROUNDINGS * float(np.abs(place[:2, 3]).max())
                distance = float(np.hypot(*(middle - built_middle)[:2]))
                is_moved = distance > max(STILL, rounding)
                if is_moved and is_as_built:
                    raise _other_geometry(distance)
            else:
                move = place @ np.linalg.inv(self._root)
                middle = move[:3, :3] @ built_middle + move[:3, 3]
                is_moved = not np.array_equal(place, self._root)
            self.motions[key] = motion.from_elsewhere(middle) if is_moved else motion
            self.pass_numbers[key] = motion.line.main.numbers.passes[role]
        return key

    def _numbered(self) -> list[Label]:
        """Return a copy of the labels with a free instance number for each unnumbered object, in order of names."""
        used_numbers = {label.instance for label in self._labels}
        for mesh_copy in self._copied.values():
            if mesh_copy.instance_id is not None:
                used_numbers |= set(np.unique(mesh_copy.instance_id.view(np.uint32)).tolist())
        free_numbers = (number for number in count(1) if number not in used_numbers)
        names_by_label = {
            i: name for i, (name, key) in self._unnumbered.items() if self._copied[key].instance_id is None
        }
        numbers = {name: next(free_numbers) for name in sorted(set(names_by_label.values()))}
        labels = list(self._labels)
        for index, name in names_by_label.items():
            labels[index] = replace(labels[index], instance=numbers[name])
        return labels


def _shown(source: Source, visible: Visible) -> AbstractContextManager[bool]:
    """Context in which a scene's viewport shows what is to be read; yields whether anything had to be changed."""
    if isinstance(source, bpy.types.Depsgraph):
        return nullcontext(False)
    scene = source or bpy.context.scene
    layer = bpy.context.view_layer if scene == bpy.context.scene else scene.view_layers[0]
    return shown_as(visible, scene, layer)


def _origin(root: bpy.types.Object | None) -> Float:
    """Return the map coordinates (3,), m, of the scene's origin: those of its road, else 0."""
    return np.zeros(3) if root is None else origin_of(root)


def _depsgraph(source: Source) -> bpy.types.Depsgraph:
    """Return a scene's evaluated depsgraph, of its first view layer unless it is the current scene."""
    if isinstance(source, bpy.types.Depsgraph):
        return source
    if source is None or source == bpy.context.scene:
        return bpy.context.evaluated_depsgraph_get()
    layer = source.view_layers[0]
    layer.update()
    return layer.depsgraph
