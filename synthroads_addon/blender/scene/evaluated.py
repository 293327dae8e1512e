"""Evaluated scene -> triangles with class, instance and material. Any scene, not only ours."""

from __future__ import annotations

from collections.abc import Callable, Collection, Generator, Hashable, Iterator, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from itertools import chain, count
from typing import Any, TypeAlias

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
from ..model.roads import origin_of, parts_and_copies, road_of_id, world_matrix
from ..things.model_builder import SUPPORT
from .changes import Changes
from .left_out import LeftOut
from .reading import MeshCopy, MeshPart, Places, SceneTables, copy_mesh, join_parts, slot_names
from .render_state import Visible, is_seen, shown_as
from .units import scene_unit
from .values import ObjectValues, asked_by_material, object_values, random_number

Float = NDArray[np.float64]
Source: TypeAlias = bpy.types.Depsgraph | bpy.types.Scene | None

_FARTHEST_FROM_MOTION = 100.0
"""A vehicle whose vertices are farther (m) than this from where it should be is one of another road."""
_ATTEMPTS = 4
"""How often a scene is read that changes meanwhile: the last time in one step."""


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

    A unit of the scene is what its unit scale says; beside a road of ours, which are built in metres, a metre.

    A face's class is its attribute ``class_id``, else its object's custom property ``synthroads_class``, else the class
    that a collection of the object is named after, else unlabelled; names can have classes as well, see `ClassMapping`.
    Its instance likewise is the attribute ``instance_id`` or the property ``synthroads_instance``, else 0. Triangles
    without area are left out. Nothing in the scene changes.

    Args:
        source: a depsgraph, or a scene (its first view layer); the current scene if None.
        objects: only these and what they instance; all if None.
        classes: classes by name.
        number_objects: each object (one that shows a collection is one) without a number gets one, in the order of
            their names, from 1 on past those that are taken.
        class_ids: ``class_id`` by the names of classes; that of the full table if None, see `ClassScheme.source_ids`.
        road: id of the road that says where on the map the scene is; that of the one that is meant if empty.
        visible: whose state is read, a render's or the viewport's; of a depsgraph always its own.

    Raises:
        InputError: an object's vertices aren't finite, or a custom property isn't what it must be; names the object.
    """
    with _shown(source, visible):
        depsgraph = _depsgraph(source)
        root = road_of_id(depsgraph.scene, road)
        as_shown = None if isinstance(source, bpy.types.Depsgraph) else visible
        reading = _SceneWalk(depsgraph, objects, classes, class_ids, root, visible=as_shown)
        reading.copy_all()
    tables = reading.tables(_origin(root), number_objects)
    return join_parts(reading.pairs(None), tables)


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
    """Return the evaluated scene as labelled triangles: standing ones as one mesh, moving bodies each with its motion.

    Vehicles of the road's model move along their lanes, see `LaneMotion`; those with a speed of 0 stand. One that the
    user moved is at the time 0 where he put it, and drives on from there as far beside its lane as it is now. Anything
    else moves straight on if it, or what it is parented to, has the custom property ``synthroads_velocity``:
    (vx, vy, vz), m/s; what such an object shows or carries moves with it as one body.

    Args:
        source, classes, number_objects, class_ids, road, visible: see `scene_mesh`.
        geometry: the road that the scene was built from; if None its vehicles stand.
        speed_factor: share of all speeds that they have in the scan, >= 0; with 0 everything stands.

    Raises:
        InputError: as `scene_mesh`; a velocity isn't three numbers, the factor is negative, or the geometry is that of
            another road.
    """
    further: dict[str, Any] = {"number_objects": number_objects, "class_ids": class_ids, "road": road}
    further["visible"] = visible
    steps = scanned_scene_steps(source, classes, geometry, speed_factor, **further)
    while True:
        try:
            next(steps)
        except StopIteration as end:
            copied: CopiedScene = end.value
            return copied.put_together()


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
    """Generator that copies the evaluated scene in short main-thread steps; its value is the copy.

    Each mesh is copied in a step of its own, but all in one where a render shows the scene otherwise than the viewport:
    its settings are changed within that step alone. If the user changes something meanwhile, it begins again; if he
    goes on changing things, all is read in one step. After an undo, or when another file was opened, it must be closed.

    Yields:
        the share that is done, 0 to 1.

    Returns:
        what was read.
    """
    checked_factor(speed_factor)
    as_shown = None if isinstance(source, bpy.types.Depsgraph) else visible
    reading: _SceneWalk | None = None
    attempt = 0
    with Changes() as changes:
        while reading is None or not reading.complete:
            attempt += 1
            with _shown(source, visible) as differs:
                depsgraph = _depsgraph(source)
                changes.forget()
                root = road_of_id(depsgraph.scene, road)
                origin = _origin(root)
                lanes: dict[str, LaneMotion] = {}
                if geometry is not None:
                    begin = origin - np.array(geometry.parameters.transform.translate)
                    lanes = lane_motions(geometry, speed_factor, begin)
                reading = _SceneWalk(depsgraph, None, classes, class_ids, root, lanes, speed_factor, as_shown)
                if attempt == _ATTEMPTS or differs:
                    reading.copy_all()
            for share in reading.copies():
                yield share
                if changes.seen:
                    break
    done = reading
    return CopiedScene(done.materials, lambda: _put_together(done, origin, number_objects))


def _put_together(reading: _SceneWalk, origin: Float, number_objects: bool) -> ScannedScene:
    tables = reading.tables(origin, number_objects)
    moving = tuple(_moving(reading, carrier, motion, tables) for carrier, motion in reading.motions.items())
    unmatched = reading.labels.by_name.unmatched_patterns()
    return ScannedScene(join_parts(reading.pairs(None), tables), moving, unmatched, reading.warnings)


@dataclass(frozen=True)
class CopiedScene:
    """Copy of an evaluated scene, ready to be put together without Blender.

    Attributes:
        materials: the scene's, in the order of the indices in its meshes.
        put_together: returns the scene; to be called once. It touches no data of Blender: a thread may call it.
    """

    materials: tuple[str, ...]
    put_together: Callable[[], ScannedScene]


def _moving(reading: _SceneWalk, carrier: Hashable, motion: BodyMotion, tables: SceneTables) -> MovingMesh:
    """Return the mesh that one carrier moves, in the motion's own frame, with the motion and pass numbers."""
    rotation, translation, _ = motion.pose(np.zeros(1))
    into = np.eye(4)
    into[:3, :3] = rotation[0].T
    into[:3, 3] = -rotation[0].T @ translation[0]
    mesh = join_parts(reading.pairs(carrier), tables, into)
    if len(mesh) and isinstance(motion, LaneMotion):
        far = float(np.abs(mesh.vertices).max())
        if far > _FARTHEST_FROM_MOTION:
            wrong = f"must be that of the road in the scene: a vehicle is {far:.0f} m off its lane"
            raise InputError("geometry", None, wrong)
    return MovingMesh(mesh, motion, reading.again.get(carrier))


@dataclass(frozen=True)
class _MeshUse:
    """Part, label and motion that all uses of one mesh by one object have in common.

    Attributes:
        part: key of the mesh's part.
        label: number of the label.
        lane: motion of a vehicle of the model, before it was moved.
        velocity: of anything else that moves, m/s, with the key of what moves it.
        values: what its materials ask of the object; None if that is nothing.
    """

    part: tuple[Hashable, ...]
    label: int
    lane: tuple[str, LaneMotion] | None
    velocity: tuple[Hashable, Float] | None
    values: ObjectValues | None


@dataclass(frozen=True)
class _QueuedMesh:
    """An object's evaluated mesh that is queued to be copied.

    Attributes:
        name: of the object, for messages.
        item: the object's name and its library's.
        slots: names of its materials.
        undeformed: whether no modifier has changed it.
    """

    name: str
    item: tuple[str, str | None]
    slots: list[str]
    undeformed: bool


class _SceneWalk:
    """Reader of an evaluated scene: walks its instances, queues their meshes and copies them.

    What the walk finds is looked at at once. Objects' own meshes are found again at any time, and are copied
    afterwards, one by one, by `copies`.

    Attributes:
        labels: of its objects.
        motions: of what moves, by carrier.
        again: numbers of later passes of the road's vehicles, by carrier.
        warnings: what isn't scanned as it is declared.
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
        self.again: dict[Hashable, PassNumbers] = {}
        self._chosen = None if objects is None else {item.original for item in objects}
        self._lanes = lanes or {}
        self._speed_factor = speed_factor
        self._materials: dict[str, int] = {}
        self._queued: dict[tuple[Hashable, ...], _QueuedMesh] = {}
        self._copied: dict[tuple[Hashable, ...], MeshCopy] = {}
        self._parts: dict[tuple[Hashable, ...], MeshPart] = {}
        self._labels: list[Label] = []
        self._nameless: dict[int, tuple[str, tuple[Hashable, ...]]] = {}
        self._uses: dict[Hashable, dict[tuple[Hashable, ...], Places]] = {}
        self._depsgraph = depsgraph
        self._asked = asked_by_material()
        self._root = np.eye(4) if root is None else world_matrix(root)
        parts = parts_and_copies(root, depsgraph.scene)[0] if root is not None and self._lanes else {}
        self._drivers = {item: role for role, item in parts.items() if role in self._lanes}
        self._visible, self._layer, self._left_out = visible, depsgraph.view_layer, LeftOut()
        self._walk(depsgraph)
        self._left_out.see_hair(depsgraph)
        self.warnings = self._left_out.warnings(depsgraph.view_layer)

    def copies(self) -> Iterator[float]:
        """Copy the queued meshes one by one, yielding the share done after each.

        It ends early where a mesh is no longer what it was.
        """
        total = max(1, len(self._queued))
        while self._queued:
            key, queued = next(iter(self._queued.items()))
            item = bpy.data.objects.get(queued.item)
            mesh = item.evaluated_get(self._depsgraph).data if item is not None else None
            if not isinstance(mesh, bpy.types.Mesh) or mesh.as_pointer() != key[0]:
                return  # the user has changed it
            self._copy(key, queued.name, mesh, queued.slots, queued.undeformed)
            del self._queued[key]
            yield 1.0 - len(self._queued) / total

    @property
    def materials(self) -> tuple[str, ...]:
        """Return the scene's material names in the order of their indices."""
        return tuple(self._materials)

    @property
    def complete(self) -> bool:
        """Return whether all queued meshes are copied."""
        return not self._queued

    def copy_all(self) -> None:
        """Copy all queued meshes at once, as far as they are unchanged."""
        for _ in self.copies():
            pass

    def _copy(
        self, key: tuple[Hashable, ...], name: str, mesh: bpy.types.Mesh, slots: list[str], undeformed: bool
    ) -> None:
        asked = frozenset().union(*(self._asked.get(slot, frozenset()) for slot in slots))
        self._copied[key] = copy_mesh(name, mesh, slots, self._materials, self.labels.by_name, asked, undeformed)

    def pairs(self, carrier: Hashable) -> list[tuple[MeshPart, Places]]:
        """Return and forget the mesh parts that a carrier moves (that stand, for None), with their places."""
        pairs = [(self._part(key), places) for key, places in self._uses.pop(carrier, {}).items()]
        if not self._uses:
            self._parts.clear()  # what is placed needn't be held twice
        return pairs

    def _part(self, key: tuple[Hashable, ...]) -> MeshPart:
        if key in self._copied:
            self._parts[key] = self._copied.pop(key).part()
        return self._parts[key]

    def tables(self, origin: Float, number_objects: bool) -> SceneTables:
        """Return the scene's labels, materials and origin (3,), m; with numbers for unnumbered objects if asked."""
        labels = self._numbered() if number_objects else self._labels
        return SceneTables(labels, self.materials, origin, self.labels.reserved, self._unit)

    def _walk(self, depsgraph: bpy.types.Depsgraph) -> None:
        known: dict[tuple[int, int, int], _MeshUse | None] = {}
        for use in depsgraph.object_instances:
            # Curves, texts, surfaces and metaballs come a second time as the mesh that they make.
            item = use.object
            if item.type != "MESH":
                self._left_out.see_kind(item)
                continue
            owner = use.parent if use.is_instance else item
            # A million uses may share one mesh: what they have in common is found once.
            key = (item.data.as_pointer(), item.original.as_pointer(), owner.as_pointer())
            if key not in known:
                known[key] = self._use_mesh(item, owner)
            about = known[key]
            if about is None:
                continue
            matrix = list(chain.from_iterable(use.matrix_world))
            carrier = self._carrier(about, matrix) if about.lane or about.velocity else None
            places = self._uses.setdefault(carrier, {}).setdefault(about.part, Places())
            places.matrices.fromlist(matrix)
            places.labels.append(about.label)
            if about.values is not None:
                places.objects.append(about.values.rows(random_number(use), (matrix[3], matrix[7], matrix[11])))

    def _use_mesh(self, item: bpy.types.Object, owner: bpy.types.Object) -> _MeshUse | None:
        """Queue or copy an evaluated object's mesh; return its part, label and motion, None if it isn't scanned."""
        original, shown_by = item.original, owner.original
        if not len(item.data.polygons) or SUPPORT in shown_by:
            return None
        if self._chosen is not None and shown_by not in self._chosen:
            return None
        if self._visible is not None and not (
            is_seen(self._visible, shown_by, self._layer) and (self._visible == "viewport" or original.visible_camera)
        ):
            return None
        slots = slot_names(item)
        self._left_out.see_object(shown_by, slots)
        # Materials may be linked to the object, so that the same mesh can look different.
        part = (item.data.as_pointer(), *slots)
        if part not in self._queued and part not in self._copied:
            for name in slots:
                self._materials.setdefault(name, len(self._materials))
            place = (original.name, original.library.filepath if original.library else None)
            is_own_mesh = original.evaluated_get(self._depsgraph).data == item.data
            if is_own_mesh and bpy.data.objects.get(place) == original:
                self._queued[part] = _QueuedMesh(item.name, place, slots, not original.modifiers)
            else:  # of a geometry's instance, or of a curve: only seen in passing
                self._copy(part, item.name, item.data, slots, False)
        label = self.labels.label_of(original, shown_by)
        self._labels.append(label)
        if label.instance < 0:
            self._nameless[len(self._labels) - 1] = (shown_by.name_full, part)
        role = self._drivers.get(original, self._drivers.get(shown_by))
        lane = (role, self._lanes[role]) if role is not None else None
        values = object_values(original, slots, self._asked)
        return _MeshUse(part, len(self._labels) - 1, lane, self._velocity(original, shown_by), values)

    def _velocity(self, item: bpy.types.Object, owner: bpy.types.Object) -> tuple[Hashable, Float] | None:
        """Return (key of the moving object, velocity (3,), m/s) of an original object; None if nothing moves it."""
        inside = velocity_of(item) if item != owner else None
        moved = inside or velocity_of(owner)
        if not moved or not self._speed_factor or not moved[1].any():
            return None
        # What moves inside of a collection does so wherever the collection is shown.
        return (moved[0].name_full, owner.name_full if inside else ""), moved[1] * self._speed_factor

    def _carrier(self, known: _MeshUse, matrix: list[float]) -> Hashable:
        """Return the key in `motions` of the motion of a mesh's use, added if new; its own velocity counts first."""
        if known.velocity is not None:
            key, velocity = known.velocity
            if key not in self.motions:
                self.motions[key] = LinearMotion(velocity, [self._unit * value for value in matrix[3:12:4]])
            return key
        assert known.lane is not None
        role, motion = known.lane
        key = (role, *matrix)
        if key not in self.motions:
            place = np.array(matrix).reshape(4, 4)
            if not np.array_equal(place, self._root):
                place = place @ np.linalg.inv(self._root)
                middle = motion.pose(np.zeros(1))[1][0]
                motion = motion.from_elsewhere(place[:3, :3] @ middle + place[:3, 3])
            self.motions[key] = motion
            self.again[key] = motion.line.geometry.numbers.passes[role]
        return key

    def _numbered(self) -> list[Label]:
        """Return a copy of the labels with a free instance number for each unnumbered object, in order of names."""
        taken = {label.instance for label in self._labels}
        for copied in self._copied.values():
            if copied.instance_id is not None:
                taken |= set(np.unique(copied.instance_id.view(np.uint32)).tolist())
        free = (number for number in count(1) if number not in taken)
        nameless = {i: name for i, (name, key) in self._nameless.items() if self._copied[key].instance_id is None}
        numbers = {name: next(free) for name in sorted(set(nameless.values()))}
        labels = list(self._labels)
        for index, name in nameless.items():
            labels[index] = replace(labels[index], instance=numbers[name])
        return labels


def _shown(source: Source, visible: Visible) -> AbstractContextManager[bool]:
    """Return the context in which a scene is shown as it is to be read."""
    if isinstance(source, bpy.types.Depsgraph):
        return nullcontext(False)
    scene = source or bpy.context.scene
    layer = bpy.context.view_layer if scene == bpy.context.scene else scene.view_layers[0]
    return shown_as(visible, scene, layer)


def _origin(root: bpy.types.Object | None) -> Float:
    return np.zeros(3) if root is None else origin_of(root)


def _depsgraph(source: Source) -> bpy.types.Depsgraph:
    if isinstance(source, bpy.types.Depsgraph):
        return source
    if source is None or source == bpy.context.scene:
        return bpy.context.evaluated_depsgraph_get()
    layer = source.view_layers[0]
    layer.update()
    return layer.depsgraph
