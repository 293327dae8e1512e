"""Builder of the parts of a model."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ...base.turns.stepper import run_aside, yield_if_due, yield_now
from ...materials.table import Material
from ...road.geometry import RoadGeometry
from ...road.network.network import network_of
from ...road.objects import LineObject, PointObject, RoadObject
from ...road.parameters import RoadParameters
from ...road.stretches import cut_stretch, frame_of
from ...road.tessellation import sample_stations
from ..compat import set_modifier_input
from ..materials import RoadMaterials
from ..nodes.builder import usual_materials
from ..nodes.inputs import input_name
from .meshes import ObjectFrame, foot_frame, frame_piece_start, line_frame, points_mesh, signed_instance

ROLE = "synthroads_role"
"""Custom property of the objects that `build_road` makes: their role in the model."""
AHEAD = "synthroads_ahead"
"""Custom property of a part whose own x axis points along the road; of earlier versions' parts it is the y axis."""
SUPPORT = "synthroads_support"
"""Custom property of objects that only other objects need: they are hidden and never scanned."""

_ROOM = 5.0
"""Width beyond the verges that is reserved for edits, m; chosen."""
_RENAMED = {"Smallest Height": "height_min", "Largest Height": "height_max"}
"""Fields of inputs that have another name."""
NO_SURFACES: dict[str, Any] = {"Road": None, "Terrain": None}
"""Inputs of what stands on a surface that is neither the road's nor the terrain's."""
_KINDS: dict[str, tuple[type, ...]] = {
    "NodeSocketFloat": (float,),
    "NodeSocketInt": (int,),
    "NodeSocketBool": (bool,),
}
"""Types of fields that set inputs, by the socket's type."""


@dataclass(frozen=True)
class BuildRequest:
    """Request for the model of a road.

    Attributes:
        parameters: the road.
        tolerance: largest chord error of the road's surface, m.
        vegetation_detail: share of the vegetation's triangles, 0 to 1; 0 builds none.
        parts: names of the `model_parts` to build; all if None. Other parts that these need are built hidden.
        stretch: stations (m) between which the road is built, moved to the nearest rows of the whole road's surface,
            with an origin of its own (see `road.stretches`); the whole road if None.
        geometry: geometry of the parameters, if it exists already.
        user_table: materials that replace those of the shipped table, by name.
    """

    parameters: RoadParameters
    tolerance: float
    vegetation_detail: float = 1.0
    parts: Collection[str] | None = None
    stretch: tuple[float, float] | None = None
    geometry: RoadGeometry | None = None
    user_table: Mapping[str, Material] | None = None


class ModelBuilder:
    """Builder that adds a road model's objects one by one, with the data of the road that they need.

    Attributes:
        parameters: the road, with only the objects on the stretch.
        geometry: the whole road's analytic geometry.
        materials: the road's materials.
        stretch: stations (m) between which the road is built; both are rows of the whole road's surface.
        stations: (N,) stations of the surface's rows, m.
        origin: (3,) local coordinates of the scene's origin, m: near the stretch, as the scene has float32.
        zero: station (m) that nodes' stations are relative to, for the same reason; a whole number.
        tolerance: largest chord error of the road's surface, m.
        detail: share of the vegetation's triangles, 0 to 1.
        hidden: whether objects are added hidden, as only other parts need them.
        objects: the added objects by role.
        at_once: number of objects that may be added before the caller evaluates them.
    """

    def __init__(
        self, request: BuildRequest, collection: bpy.types.Collection, root: bpy.types.Object | None = None
    ) -> None:
        self.geometry = request.geometry or RoadGeometry(request.parameters)
        self._requested_stretch = request.stretch or (0.0, self.geometry.length)
        self.stations: NDArray[np.float64] = np.zeros(0)
        self.stretch = self._requested_stretch
        self._is_whole_road = request.stretch is None
        self.parameters, self.materials = request.parameters, RoadMaterials.of(request.parameters, request.user_table)
        self._uncut_parameters = request.parameters
        self.origin, self.zero = np.zeros(3), 0
        self.tolerance = request.tolerance
        self.detail = request.vegetation_detail
        self.hidden = False
        self.objects: dict[str, bpy.types.Object] = {}
        self.at_once = 1
        self._unevaluated = 0
        self._collection, self._root = collection, root

    def lay_out(self) -> None:
        """Compute the surface's rows and cut the parameters to the stretch; must be called before anything is added."""
        self.stations = run_aside(lambda: sample_stations(self.geometry, self.tolerance, *self._requested_stretch))
        if not self._is_whole_road:
            self.stretch = (float(self.stations[0]), float(self.stations[-1]))
            self.parameters = cut_stretch(self.parameters, *self.stretch)
            self.origin, self.zero = frame_of(self.geometry, *self.stretch)

    @cached_property
    def step(self) -> float:
        """Longest straight piece (m) of things along the road that keeps the tolerance in its curves; cached.

        It is 4 m, halved as often as the whole road's curves require, so that pieces of a stretch are the whole road's.
        """
        curvatures = [max(abs(e.curvature_start), abs(e.curvature_end)) for e in self.geometry.alignment.elements]
        # Chord error of an arc: s = l^2 k / 8.
        chord_length = np.sqrt(8.0 * self.tolerance / max(*curvatures, 1e-9))
        return float(2.0 ** np.floor(np.log2(np.clip(chord_length, 0.5, 4.0))))

    @cached_property
    def widest(self) -> float:
        """Distance from the axis (m) beyond all of the road's verges, with 5 m to spare for edits; cached."""
        sections, length = self.geometry.sections.values(), self.geometry.length
        edges = [section.road_edge([0.0, *section.kinks(), length]).max() for section in sections]
        return float(np.ceil(max(edges)) + _ROOM)

    def along(self, station: float) -> float:
        """Return a station, m, relative to `zero`, as nodes have it."""
        return station - self.zero

    def points(
        self, name: str, items: Sequence[PointObject], attributes: Mapping[str, NDArray[Any]] | None = None
    ) -> bpy.types.Mesh:
        """Create a mesh with one vertex per point object, its heading, elevation, instance and given attributes.

        It is in the frame that `frame` returns for them.
        """
        return points_mesh(name, self.geometry, items, attributes or {}, self._local_frame(self._first_of(items)))

    def frame(self, *items: PointObject | LineObject) -> ObjectFrame:
        """Return the frame of an object in the scene: at a thing's foot or its beginning, with x along the road.

        Several point objects of one type have the frame of the first of them: see `FRAME_SPACING` for a stretch.
        """
        frame = self._local_frame(items[0] if len(items) == 1 else self._first_of(items))
        return ObjectFrame(frame.origin - self.origin, frame.turn)

    def _first_of(self, items: Sequence[Any]) -> Any:
        """Return the first of all the road's objects of a type that lie in the frames' piece of the stretch."""
        if self._is_whole_road or len(items) == 1:
            return items[0]
        every_item = self._uncut_parameters.of_type(type(items[0])).values()
        piece_start = frame_piece_start(self.stretch[0])
        return next((item for item in every_item if item.station >= piece_start), items[0])

    def _local_frame(self, item: PointObject | LineObject) -> ObjectFrame:
        """Return a thing's frame as `frame` does, but in the whole road's local coordinates."""
        if isinstance(item, LineObject):
            return line_frame(self.geometry, item, self.stretch)
        return foot_frame(self.geometry, item)

    def on_others(self, item: RoadObject) -> bool:
        """Return whether a thing stands on the surface of a ramp or a crossing road: there it stays where it is put."""
        if not isinstance(item, PointObject) or not self.geometry.crossing_roads:
            return False
        place = self.geometry.alignment.place(np.array([item.station]), np.array([item.offset]))
        return bool(network_of(self.geometry).covers(place)[0])

    def add_thing(
        self,
        name: str,
        item: RoadObject,
        group: bpy.types.NodeTree,
        mesh: bpy.types.Mesh | None = None,
        **inputs: Any,
    ) -> None:
        """Add a thing of the road as an object with its node group, inputs set from the fields of the same names.

        Its origin is at its foot, or at the beginning of what runs along the road, see `frame`.

        Args:
            name: the thing's id.
            item: the thing.
            group: its node group.
            mesh: of the object, in its frame; if None, a vertex at a point object's foot, and nothing for other things.
            inputs: the group's other inputs, by their fields in its class of inputs, see `add`.
        """
        if mesh is None and isinstance(item, PointObject):
            mesh = self.points(name, [item])
        values = {label: getattr(item, field) for label, field in named_fields(item, group).items()}
        values = {label: value - self.zero if label.endswith("Station") else value for label, value in values.items()}
        values |= {input_name(field): value for field, value in inputs.items()}
        if self.on_others(item):
            values |= NO_SURFACES
        frame = self.frame(item) if isinstance(item, PointObject | LineObject) else None
        self.add(name, mesh, group, values, frame=frame)

    def add(
        self,
        role: str,
        mesh: bpy.types.Mesh | None = None,
        group: bpy.types.NodeTree | None = None,
        inputs: Mapping[str, Any] | None = None,
        support: bool = False,
        frame: ObjectFrame | None = None,
    ) -> None:
        """Add an object with a mesh to the model, and a Geometry Nodes modifier if a group is given.

        Args:
            role: the object's role in the model.
            mesh: of the object; one without anything if None.
            group: of its modifier.
            inputs: the modifier's inputs by name; materials by their names in the table; None leaves one as it is.
                Inputs named like an object of the model (``Road``, ``Terrain``) and materials with a default may be
                left out.
            support: whether only other objects need the object: it is hidden then.
            frame: frame of the object; the road's own if None.
        """
        mesh = mesh or bpy.data.meshes.new("SR")
        item = bpy.data.objects.new(role, mesh)
        mesh.name = f"SR {role}"
        item[ROLE], item.parent = role, self._root
        if frame is not None:
            item[AHEAD] = True
            item.location = frame.origin.tolist()
            item.rotation_euler = (0.0, 0.0, frame.turn)
        if support or self.hidden:
            item[SUPPORT] = True
            item.hide_viewport = item.hide_render = True
        self._collection.objects.link(item)
        if group is not None:
            modifier = item.modifiers.new("SynthRoads", "NODES")
            modifier.node_group = group
            kinds = {socket.name: socket.socket_type for socket in group_inputs(group)}
            objects = {
                name: self.objects[name]
                for name, kind in kinds.items()
                if kind == "NodeSocketObject" and name in self.objects
            }
            for name, value in {**usual_materials(group), **objects, **(inputs or {})}.items():
                if value is None:
                    continue
                set_modifier_input(modifier, name, self._to_input(name, kinds.get(name, ""), value))
        self._added(role, item)

    def add_instance(self, role: str, collection: bpy.types.Collection) -> bpy.types.Object:
        """Add an empty that instances a collection to the model; return it."""
        item = bpy.data.objects.new(role, None)
        item[ROLE], item.parent = role, self._root
        item.instance_type, item.instance_collection = "COLLECTION", collection
        self._collection.objects.link(item)
        self._added(role, item)
        return item

    def _to_input(self, name: str, kind: str, value: Any) -> Any:
        """Return a value converted for a modifier's input: signed instance numbers, materials by their table names."""
        if name.endswith("Instance"):
            return int(signed_instance([value])[0])
        return self.materials.material(value) if kind == "NodeSocketMaterial" else value

    def _added(self, role: str, item: bpy.types.Object) -> None:
        """Note an added object, and let the caller evaluate objects after every `at_once` of them."""
        self.objects[role] = item
        self._unevaluated += 1
        if self._unevaluated >= self.at_once:
            self._unevaluated = 0
            yield_now()  # the caller evaluates the new objects before the next are added
        yield_if_due()


def group_inputs(group: bpy.types.NodeTree) -> Iterator[bpy.types.NodeTreeInterfaceSocket]:
    """Yield the interface sockets of a node group's inputs."""
    for item in group.interface.items_tree:
        if item.item_type == "SOCKET" and item.in_out == "INPUT":
            yield item


def named_fields(item: RoadObject, group: bpy.types.NodeTree) -> dict[str, str]:
    """Return the numeric and boolean fields of a thing by the names of the group's inputs that match them."""
    fields = {}
    for socket in group_inputs(group):
        field = _RENAMED.get(socket.name, socket.name.lower().replace(" ", "_"))
        if field in type(item).model_fields and type(getattr(item, field)) in _KINDS.get(socket.socket_type, ()):
            fields[socket.name] = field
    return fields
