"""The road that a scene shows now: the parameter set that it was built from, updated with the user's edits.

Moves, turns, deletions and copies of parts, changes of their inputs, moves of the backbone's points and of the whole
road are read back exactly. A part with an edit that parameters can't describe is *edited by hand*: it isn't in the
parameter set, and a scan sees its object as a foreign body with its class.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ...base.errors import InputError
from ...fitting.fit import AxisFit
from ...road.geometry import RoadGeometry
from ...road.instances import InstanceNumbers
from ...road.objects import LineObject, PointObject, RoadObject
from ...road.parameters import RoadParameters
from ...road.section import Arrow, Hatching
from ...road.surroundings import Terrain, Vegetation, Vehicle
from ...road.tables.stated import StatedRoad, carry_stations
from ...road.things.asset import Asset
from ..things.field_entrance import CLEARING
from ..things.model_builder import ROLE
from .added import with_kept_things
from .axis_edits import EditedAxis, edited_axis, moved_alignment
from .edits import (
    POSTS,
    HandEdit,
    attribute_of,
    is_mirrored,
    mesh_edited,
    own_modifier,
    place_reason,
    shape_reason,
    turn_of,
)
from .places import (
    IN_A_FRAME,
    Lost,
    RoadAxes,
    part_update,
    point_places,
    point_update,
)
from .read_back import edited_object, edited_parameters, read_inputs
from .roads import BUILT_PARTS, ROAD, displacement, origin_of, parts_and_copies, root_above, world_matrix
from .store import recall_parameters, recall_stated, road_named

Float = NDArray[np.float64]

BY_HAND = "synthroads_by_hand"
"""Custom property of a former part, which was edited by hand before the road was rebuilt: part and reason, as JSON."""
_PAINT = "Painted Areas"
_SURFACE = ("Road", "Backbone")
"""Roles of the parts that a road can't do without."""


@dataclass(frozen=True)
class EditedRoad:
    """A road read back from its scene: parameters as edited, and what they can't describe.

    Attributes:
        parameters: the edited parameter set; that from before the edits if the road's surface was edited by hand.
        by_hand: parts that were edited by hand.
        lost: reason why the road as a whole can't be read back; empty if it can.
        stale: reasons why the road must be rebuilt for the scene to show the parameters exactly; empty if it does.
        axis: deviations of the backbone's moved points from the axis fitted to them; None if none were moved.
    """

    parameters: RoadParameters
    by_hand: tuple[HandEdit, ...] = ()
    lost: str = ""
    stale: tuple[str, ...] = ()
    axis: AxisFit | None = None

    def known(self) -> RoadParameters:
        """Return the edited parameter set; raise `InputError` if the road's surface was edited by hand."""
        if self.lost:
            raise InputError(
                "Road",
                None,
                f"its surface was edited by hand ({self.lost}): undo that, or build it again",
            )
        return self.parameters

    def to_dict(self) -> dict[str, Any]:
        """Return the parts edited by hand and the axis' fit as a report's JSON data; empty if there are none."""
        data: dict[str, Any] = {}
        if self.by_hand:
            data["edited_by_hand"] = [edit.to_dict() for edit in self.by_hand]
        if self.axis is not None:
            data["axis_fit"] = {"horizontal": self.axis.horizontal.to_dict(), "height": self.axis.height.to_dict()}
        return data


def read_road(root: bpy.types.Object, scene: bpy.types.Scene | None = None) -> EditedRoad:
    """Read a road back from its scene with all edits; nothing in the scene changes.

    Args:
        root: root object of the road.
        scene: scene that contains it; the current one if None.

    Raises:
        InputError: the stored parameter set is damaged, a value is outside its field's limits, or no road runs
            through the backbone's points.
    """
    reading = _Reading(root, scene or bpy.context.scene)
    return reading.result()


def read_as_stated(root: bpy.types.Object, scene: bpy.types.Scene, stated: StatedRoad) -> RoadParameters:
    """Return the parameter set that a road has once its axis and carriageways are as stated, in the root's own frame.

    Raises:
        InputError: as `read_road`, or what is stated doesn't fit the rest of the road.
    """
    return _Reading(root, scene, stating=stated).result().known()


@dataclass(frozen=True)
class OpenRoad:
    """Name, id and edited state of a road in the open scene.

    Attributes:
        name: name of the road's root.
        road_id: the road's id.
        edited: the road as the scene shows it.
    """

    name: str
    road_id: str
    edited: EditedRoad


def open_road(name: str | None = None) -> OpenRoad | None:
    """Read the open scene's road of a name, or its current road if None; None if the scene has no road.

    Raises:
        InputError: no road has this name; or as `read_road`.
    """
    root = road_named(bpy.context.scene, name)
    return OpenRoad(root.name, str(root[ROAD]), read_road(root)) if root else None


@dataclass
class _Reading:
    """A reading of a road from its scene, with lists that grow as it is read.

    Attributes:
        stating: axis and carriageways that the road is about to get; None to read those that the scene shows.
        by_hand: parts that turned out to be edited by hand.
        stale: reasons why the scene doesn't show the parameters exactly.
    """

    root: bpy.types.Object
    scene: bpy.types.Scene
    stating: StatedRoad | None = None
    by_hand: list[HandEdit] = field(default_factory=list)
    stale: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._built = recall_parameters(self.root)
        self._stated = recall_stated(self.root)
        self._parts, self._copies = parts_and_copies(self.root, self.scene)
        self._base = with_kept_things(self._built, self._parts)
        self._into = np.linalg.inv(world_matrix(self.root))
        self._ids = {"Terrain": next(iter(self._base.of_type(Terrain)), "")}

    def result(self) -> EditedRoad:
        """Return the road with all edits read back."""
        self.by_hand += _released(self.root, self.scene)
        if lost := self._lost_reason():
            self.by_hand.append(HandEdit("Road", self.root.name, lost))
            return EditedRoad(self._base, tuple(self.by_hand), lost)
        # Parts that parameters still describe; others are added to `by_hand`.
        visible_parts = {role: item for role, item in self._parts.items() if role not in (*_SURFACE, "Ground")}
        described_parts = {role: item for role, item in visible_parts.items() if self._is_fine(role, item)}
        described_parts |= {role: self._parts[role] for role in _SURFACE if role in self._parts}
        shown_base = self._base
        if self._stated is not None:
            shown_base = self._stated.with_stated_surface(shown_base)
        parameters = edited_parameters(shown_base, described_parts)
        if self._stated is not None:
            parameters = self._stated.with_built_lines(parameters, self._base)
        built_geometry = RoadGeometry(self._base)
        parameters, axis = self._on_present_axis(parameters, built_geometry)
        is_moved = axis is not None or parameters.alignment != self._base.alignment
        if is_moved:
            self.stale.append("its axis was changed")
        axes = RoadAxes(built_geometry, RoadGeometry(parameters) if is_moved else built_geometry)
        moved_objects = dict(self._moved(parameters, axes, described_parts))
        objects = {name: moved_objects[name] for name in parameters.objects if name in moved_objects}
        objects |= self._read_copies(parameters, objects, axes)
        data = parameters.to_dict() | {"objects": {name: item.to_dict() for name, item in objects.items()}}
        placed_parameters = RoadParameters.from_dict(data)
        if self.stating is None:
            placed_parameters = self._placed(placed_parameters)
        if not self.stale and InstanceNumbers(placed_parameters).parts != _kept_numbers(self._built, placed_parameters):
            self.stale.append("numbers of dashes and plants depend on the objects that the road has")
        return EditedRoad(placed_parameters, tuple(self.by_hand), "", tuple(self.stale), axis.fit if axis else None)

    def _on_present_axis(
        self, parameters: RoadParameters, built_geometry: RoadGeometry
    ) -> tuple[RoadParameters, EditedAxis | None]:
        """Return the road on its stated axis, then on the one that its backbone was moved to, if it was."""
        stated = self.stating or self._stated
        if stated is not None:
            parameters = stated.applied(parameters, keeps_carriageways=self.stating is None)
        backbone = self._parts.get("Backbone")
        if backbone is None or self.stating is not None:
            return parameters, None
        shown_geometry = RoadGeometry(parameters) if stated is not None else built_geometry
        axis = edited_axis(shown_geometry, backbone, self._place(backbone))
        return (parameters, None) if axis is None else (_on_axis(parameters, axis), axis)

    def _place(self, item: bpy.types.Object) -> Float:
        """Return an object's matrix (4, 4) in the road's frame; exactly the identity if it nearly is."""
        place = self._into @ world_matrix(item)
        return np.eye(4) if np.allclose(place, np.eye(4), rtol=0.0, atol=1e-9) else place

    def _lost_reason(self) -> str:
        """Return the reason, in words, why the road as a whole can't be read back; empty if it can."""
        if reason := place_reason(displacement(self.root)):
            return reason
        for role in _SURFACE:
            if role in self._parts:
                if reason := self._reason(role, self._parts[role]):
                    return f"{role}: {reason}"
            elif role in self._built_roles():
                return f"{role} was deleted"
        details = (role for role in self._built_roles() if role.endswith(" Detail"))
        for role in details:
            if role not in self._parts:
                return f"{role} was deleted"
            if reason := self._reason(role, self._parts[role]):
                return f"{role}: {reason}"
        return ""

    def _built_roles(self) -> list[str]:
        """Return the roles of all parts as built, as kept by the root; empty if that is damaged."""
        try:
            return [str(role) for role in json.loads(self.root.get(BUILT_PARTS, "[]"))]
        except (TypeError, ValueError):
            return []

    def _is_fine(self, role: str, item: bpy.types.Object) -> bool:
        """Return whether parameters still describe a part; else add it to `by_hand`."""
        reason = self._reason(role, item)
        if not reason and role == "Terrain" and "Ground" in self._built_roles():
            ground = self._parts.get("Ground")
            reason = "its ground was deleted" if ground is None else self._reason("Ground", ground)
        if reason:
            self.by_hand.append(HandEdit(role, item.name, reason))
        return not reason

    def _reason(self, role: str, item: bpy.types.Object) -> str:
        """Return the reason, in words, why no parameters describe a part; empty if they do."""
        thing = self._base.objects.get(role)
        modifier = own_modifier(item)
        read_names = read_inputs(self._base, role, modifier) if modifier is not None else frozenset()
        is_bare = role in ("Backbone", "Ground", CLEARING) or role.endswith(" Detail")
        has_group = item.type == "MESH" and not is_bare
        is_vertex = role in POSTS or isinstance(thing, Vehicle) or _on_a_vertex(thing)
        reason = shape_reason(item, read_names, not is_vertex and role != "Backbone", has_group)
        if not reason and not has_group and role != "Backbone" and mesh_edited(item):
            reason = "its mesh was edited"
        if not reason and is_vertex and role not in POSTS and len(item.data.vertices) != 1:
            reason = "its mesh was edited"
        placed = role in POSTS or isinstance(thing, PointObject | LineObject | Vehicle)
        return reason or place_reason(self._place(item), isinstance(thing, Asset), placed)

    def _moved(
        self, parameters: RoadParameters, axes: RoadAxes, fine: dict[str, bpy.types.Object]
    ) -> Iterator[tuple[str, RoadObject]]:
        """Yield (id, object) of the parameter set's objects that still exist, with their current places."""
        removed_ids = self._gone_ids(fine)
        for name, item in parameters.objects.items():
            if name in removed_ids:
                continue
            role = next((role for role, thing_id in self._ids.items() if thing_id == name), name)
            if role in fine:
                updated_thing = self._updated(item, self._base.objects[name], fine[role], axes)
                if updated_thing is None:
                    continue
                yield name, updated_thing
            else:
                yield name, item
        for role, kind in POSTS.items():
            if role in fine:
                yield from self._vertex_things(parameters, axes, fine[role], kind)

    def _gone_ids(self, fine: dict[str, bpy.types.Object]) -> set[str]:
        """Return the ids of objects deleted or edited by hand, and of those that depend on them."""
        roles = {role for role in (*self._built_roles(), *self._parts) if role not in fine}
        gone = {self._ids.get(role, role) for role in roles} & set(self._base.objects)
        if self._ids["Terrain"] in gone:
            gone |= set(self._base.of_type(Vegetation))
            self.stale.append("the ground is gone")
        if _PAINT in roles:
            gone |= set(self._base.of_type(Hatching)) | set(self._base.of_type(Arrow))
        for role, kind in POSTS.items():
            if role in self._built_roles() or role in self._parts:
                # Those that are there come back with their vertices, or have an object of their own.
                gone |= set(self._base.of_type(kind)) - set(self._parts)
        return gone | self._without_face(fine, gone)

    def _without_face(self, fine: dict[str, bpy.types.Object], gone: set[str]) -> set[str]:
        """Return the ids of gantries with a deleted or edited sign face, adding each to `by_hand`."""
        ids: set[str] = set()
        for role in [*self._built_roles(), *self._parts]:
            owner = role.partition("/")[0]
            if "/" in role and role not in fine and owner in fine and owner not in gone | ids:
                ids.add(owner)
                edit_word = "edited" if role in self._parts else "deleted"
                self.by_hand.append(HandEdit(owner, fine[owner].name, f"{role} was {edit_word}"))
        return ids

    def _updated(
        self, item: RoadObject, before: RoadObject, part: bpy.types.Object, axes: RoadAxes
    ) -> RoadObject | None:
        """Return an object with its part's current place; None, added to `by_hand`, if no parameters describe it."""
        place = self._place(part)
        try:
            update, needs_rebuild = part_update(item, before, part, place, axes)
        except Lost as lost:
            self.by_hand.append(HandEdit(role_of(part), part.name, str(lost)))
            return None
        if is_mirrored(place):
            self.stale.append(f"{part.name} is mirrored")
        elif update and needs_rebuild:
            self.stale.append(f"{part.name} was moved")
        return item.model_copy(update=update) if update else item

    def _vertex_things(
        self, parameters: RoadParameters, axes: RoadAxes, part: bpy.types.Object, kind: type[PointObject]
    ) -> Iterator[tuple[str, RoadObject]]:
        """Yield (id, thing) of each vertex of one object that holds many things, with their present places."""
        known = {item.instance: name for name, item in self._base.of_type(kind).items()}
        place = self._place(part)
        if is_mirrored(place):
            self.stale.append(f"{part.name} is mirrored")
        numbers = attribute_of(part.data, "instance", -1).astype(np.int64) % 2**32
        seen: set[str] = set()
        for there, number in zip(point_places(part, place), numbers.tolist(), strict=True):
            name = known.get(number)
            if name is None or name in seen:
                self.by_hand.append(HandEdit(name or role_of(part), part.name, "a vertex was added"))
                continue
            seen.add(name)
            if name not in parameters.objects:  # it stood on an element that was deleted from the table
                continue
            item, before = parameters.objects[name], self._base.objects[name]
            assert isinstance(before, PointObject)
            try:
                yield name, item.model_copy(update=point_update(axes, before, there))
            except Lost as lost:
                self.by_hand.append(HandEdit(name, part.name, str(lost)))

    def _read_copies(
        self, parameters: RoadParameters, objects: dict[str, RoadObject], axes: RoadAxes
    ) -> dict[str, RoadObject]:
        """Return the user's copies of parts as new road objects by new ids, with new instance numbers."""
        copies: dict[str, RoadObject] = {}
        largest_number = max(item.instance for item in self._base.objects.values())
        for copy in sorted(self._copies, key=lambda item: item.name_full):
            role = role_of(copy)
            built_thing = self._base.objects.get(role)
            if built_thing is None or isinstance(built_thing, Vegetation | Terrain):
                self.by_hand.append(HandEdit(role, copy.name, "it is a copy of a part of which a road has only one"))
                continue
            if reason := self._reason(role, copy):
                self.by_hand.append(HandEdit(role, copy.name, reason))
                continue
            item = parameters.objects.get(role, built_thing)
            if (modifier := own_modifier(copy)) is not None:
                item = edited_object(item, modifier)
            updated_thing = self._updated(item, built_thing, copy, axes)
            if updated_thing is None:
                continue
            name = _free_name(role, {*self._base.objects, *copies})
            copies[name] = updated_thing.model_copy(update={"instance": largest_number + 1 + len(copies)})
            self.stale.append(f"{copy.name} is a copy")
        return copies

    def _placed(self, parameters: RoadParameters) -> RoadParameters:
        """Return the parameter set with the transform and alignment moved and turned as the user moved its root."""
        moved = displacement(self.root)
        if np.array_equal(moved, np.eye(4)):
            return parameters
        world = world_matrix(self.root)
        place = np.eye(4)
        place[:2, :2] = world[:2, :2]
        update: dict[str, Any] = {}
        terrain = parameters.terrain
        if abs(turn_of(place)) > 1e-9:
            name = next(name for name, item in parameters.objects.items() if item is parameters.alignment)
            update["objects"] = parameters.objects | {name: moved_alignment(parameters.alignment, place)}
            if terrain is not None:
                self.stale.append("it was turned, and the ground doesn't turn with it")
        if terrain is not None and terrain.elevation_model is not None:
            self.stale.append("it was moved, and the ground of an elevation model stays where it is")
        translate = tuple(round(float(value), 6) for value in origin_of(self.root) + world[:3, 3])
        update["transform"] = parameters.transform.model_copy(update={"translate": translate})
        return RoadParameters.from_dict(parameters.model_copy(update=update).to_dict())


def role_of(part: bpy.types.Object) -> str:
    """Return a part's role in its road; empty if it has none."""
    return str(part.get(ROLE, ""))


def _on_a_vertex(item: RoadObject | None) -> bool:
    """Return whether a thing is modelled as one vertex at its place, from which nodes make its shape."""
    return isinstance(item, PointObject) and not isinstance(item, (Asset, Arrow, *IN_A_FRAME))


def _on_axis(parameters: RoadParameters, axis: EditedAxis) -> RoadParameters:
    """Return the road on an edited axis: all stations are mapped to it, offsets stay."""
    data = parameters.to_dict()
    for name, item in data["objects"].items():
        if item["type"] == "Alignment":
            data["objects"][name] = axis.alignment.to_dict()
        else:
            carry_stations(item, axis.station, axis.alignment.length)
    return RoadParameters.from_dict(data)


def _released(root: bpy.types.Object, scene: bpy.types.Scene) -> Iterator[HandEdit]:
    """Yield the hand edits kept by objects that were parts until the road was rebuilt without them."""
    for item in scene.objects:
        if BY_HAND in item and root_above(item) == root:
            try:
                part, reason = json.loads(item[BY_HAND])
            except (TypeError, ValueError):
                continue
            yield HandEdit(str(part), item.name, str(reason))


def _kept_numbers(before: RoadParameters, now: RoadParameters) -> dict[str, Any]:
    """Return the instance numbers of parts as built, of the objects that are still in the road."""
    return {name: parts for name, parts in InstanceNumbers(before).parts.items() if name in now.objects}


def _free_name(role: str, used_names: set[str]) -> str:
    """Return a name for a copy of a part: its role, shortened to 60 characters, with a free number from 2 on."""
    number = 2
    while f"{role[:60]}-{number}" in used_names:
        number += 1
    return f"{role[:60]}-{number}"
