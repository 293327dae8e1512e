"""Road parameters -> scene: Python writes the backbone and the node groups' inputs, the nodes do the rest."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ..core.parameters.alignment import clip_offset
from ..core.parameters.geometry import RoadGeometry
from ..core.parameters.model import Delineator, Guardrail, RoadParameters, Terrain, Vegetation
from ..core.parameters.terrain import ground_elevation
from ..core.parameters.tessellation import sample_stations
from .compat import set_modifier_input
from .materials import material
from .nodes.delineator import delineator_group
from .nodes.grass import grass_group
from .nodes.guardrail import guardrail_group
from .nodes.road import MATERIALS, road_group, road_inputs, road_layout
from .nodes.terrain import terrain_group
from .nodes.tree import tree_group

COLLECTION = "SynthRoads"
ROLE = "synthroads_role"
"""Custom property of the objects that `build_road` makes: what they are in the model."""
SUPPORT = "synthroads_support"
"""Custom property of objects that only other objects need: they are hidden and never scanned."""
ORIGIN = "synthroads_origin"
"""Custom property of the collection: map coordinates of the local origin."""
PARTS = ("road", "terrain", "guardrails", "delineators", "vegetation")

_SPACER = {"left": 0.07, "right": 0.07, "both": 0.20}
"""Distance between posts and beam, m: a single rail's face stands 0.2 m from the posts' axis."""
_GROUND_MARGIN = 12.0
_ROADSIDE_SHARE = 0.8
"""Grass on verges and median, as a share of the density elsewhere."""

Float = NDArray[np.float64]


@dataclass(frozen=True)
class RoadModel:
    """A road in the scene.

    Attributes:
        collection: holds all of the model's objects.
        objects: by role: ``Backbone``, ``Road``, ``Ground``, ``Terrain``, ``Delineators``, and the parameter
            set's ids of guardrails and vegetation. Hidden helpers are among them.
        origin: (3,) map coordinates of the local origin.
    """

    collection: bpy.types.Collection
    objects: dict[str, bpy.types.Object]
    origin: Float


def build_road(
    parameters: RoadParameters,
    tolerance: float,
    vegetation_detail: float = 1.0,
    parts: Collection[str] | None = None,
) -> RoadModel:
    """Build the road in the current scene; a road built before is replaced, other objects stay as they are.

    Args:
        parameters: the road.
        tolerance: largest chord error of the road's surface, m.
        vegetation_detail: share of the vegetation's triangles, 0 to 1; 0 builds none.
        parts: which of `PARTS` are wanted; all if None. What they need from others is built hidden.

    Raises:
        ValueError: a part that there is none of.
    """
    wanted = set(PARTS if parts is None else parts)
    if wanted - set(PARTS):
        raise ValueError(f"parts: {sorted(wanted - set(PARTS))} are not among {PARTS}")
    remove_road()
    origin = np.array(parameters.transform.translate, dtype=np.float64)
    collection = bpy.data.collections.get(COLLECTION) or bpy.data.collections.new(COLLECTION)
    if COLLECTION not in bpy.context.scene.collection.children:
        bpy.context.scene.collection.children.link(collection)
    collection[ORIGIN] = [float(value) for value in origin]
    builder = _Builder(parameters, collection, tolerance, vegetation_detail)
    if "road" in wanted or wanted & {"terrain", "guardrails", "delineators", "vegetation"}:
        builder.road(hidden="road" not in wanted)
    if parameters.terrain and wanted & {"terrain", "vegetation"}:
        builder.terrain(parameters.terrain, hidden="terrain" not in wanted)
    if "guardrails" in wanted:
        builder.guardrails()
    if "delineators" in wanted:
        builder.delineators()
    if "vegetation" in wanted and vegetation_detail > 0.0:
        builder.vegetation()
    bpy.context.view_layer.update()
    return RoadModel(collection, builder.objects, origin)


def remove_road() -> None:
    """Remove the objects that `build_road` made, and its collection unless the user keeps something in it."""
    for item in [item for item in bpy.data.objects if ROLE in item]:
        mesh = item.data
        bpy.data.objects.remove(item)
        if mesh is not None and mesh.users == 0:
            bpy.data.meshes.remove(mesh)
    collection = bpy.data.collections.get(COLLECTION)
    if collection is not None and not collection.all_objects:
        bpy.data.collections.remove(collection)


class _Builder:
    """Makes the model's objects one by one."""

    def __init__(
        self, parameters: RoadParameters, collection: bpy.types.Collection, tolerance: float, detail: float
    ) -> None:
        self.parameters = parameters
        self.geometry = RoadGeometry(parameters)
        self.collection = collection
        self.tolerance = tolerance
        self.detail = detail
        self.objects: dict[str, bpy.types.Object] = {}

    def road(self, hidden: bool) -> None:
        """Make the backbone and the road's surface."""
        mesh = backbone_mesh(self.geometry, sample_stations(self.geometry, self.tolerance))
        self._add("Backbone", mesh, support=True)
        inputs: dict[str, Any] = {"Backbone": self.objects["Backbone"]}
        inputs |= {f"{name} Material": material(entry) for name, entry in MATERIALS.items()}
        inputs |= road_inputs(self.parameters)
        group = road_group(road_layout(self.parameters))
        self._add("Road", bpy.data.meshes.new("SR Road"), group, inputs, support=hidden)

    def terrain(self, terrain: Terrain, hidden: bool) -> None:
        """Make the ground as it was, and the terrain that joins it to the road."""
        self._add("Ground", ground_mesh(self.geometry, terrain, self.tolerance), support=True)
        inputs = {
            **{role: self.objects[role] for role in ("Backbone", "Road", "Ground")},
            "Half Width": terrain.half_width,
            "Batter Slope": terrain.batter_slope,
            "Columns": int(np.clip(terrain.half_width * 0.6, 12, 120)),
            "Instance": terrain.instance,
            "Material": material("grass_ground"),
        }
        self._add("Terrain", bpy.data.meshes.new("SR Terrain"), terrain_group(), inputs, support=hidden)

    def guardrails(self) -> None:
        """Make one object per guardrail."""
        bend = np.abs(self.geometry.alignment.curvature(np.linspace(0.0, self.geometry.length, 200))).max()
        step = float(np.clip(np.sqrt(8.0 * self.tolerance / max(bend, 1e-9)), 0.5, 4.0))
        for name, rail in self.parameters.of_type(Guardrail).items():
            inputs = {
                **self._surfaces("Backbone"),
                "Start Station": rail.start_station,
                "End Station": min(rail.end_station, self.geometry.length),
                "Offset": rail.offset,
                "Left Beam": rail.faces in ("left", "both"),
                "Right Beam": rail.faces in ("right", "both"),
                "Spacer": _SPACER[rail.faces],
                "Height": rail.height,
                "Post Spacing": rail.post_spacing,
                "Terminal Length": rail.terminal_length,
                "Beam Step": step,
                "Instance": rail.instance,
                "Material": material("galvanised_steel"),
            }
            self._add(name, bpy.data.meshes.new("SR Guardrail"), guardrail_group(), inputs)

    def delineators(self) -> None:
        """Make all delineator posts as one object."""
        posts = list(self.parameters.of_type(Delineator).values())
        if not posts:
            return
        inputs = {
            **self._surfaces(),
            "White Material": material("plastic_white"),
            "Black Material": material("plastic_black"),
            "Reflector Material": material("reflector"),
        }
        self._add("Delineators", delineator_mesh(self.geometry, posts), delineator_group(), inputs)

    def vegetation(self) -> None:
        """Make one object per stand of plants."""
        for name, plants in self.parameters.of_type(Vegetation).items():
            if "Terrain" not in self.objects:
                return
            inputs: dict[str, Any] = {
                **self._surfaces(),
                "Density": plants.density,
                "Band Start": plants.band_start,
                "Band End": plants.band_end,
                "Smallest Height": plants.height_min,
                "Largest Height": plants.height_max,
                "Seed": plants.seed % 2**30,
                "Detail": self.detail,
                "Instance": plants.instance,
            }
            if plants.kind == "grass":
                inputs |= {
                    "Roadside Density": plants.density * _ROADSIDE_SHARE,
                    "Material": material("grass"),
                }
                self._add(name, bpy.data.meshes.new("SR Grass"), grass_group(), inputs)
            else:
                inputs |= {"Bark Material": material("bark"), "Leaves Material": material("leaves")}
                self._add(name, bpy.data.meshes.new("SR Tree"), tree_group(), inputs)

    def _surfaces(self, *more: str) -> dict[str, bpy.types.Object]:
        roles = ("Road", "Terrain", *more)
        return {role: self.objects[role] for role in roles if role in self.objects}

    def _add(
        self,
        role: str,
        mesh: bpy.types.Mesh,
        group: bpy.types.NodeTree | None = None,
        inputs: Mapping[str, Any] | None = None,
        support: bool = False,
    ) -> None:
        """Add an object to the collection, with its modifier if it has a group."""
        item = bpy.data.objects.new(role, mesh)
        mesh.name = f"SR {role}"
        item[ROLE] = role
        if support:
            item[SUPPORT] = True
            item.hide_viewport = item.hide_render = True
        self.collection.objects.link(item)
        if group is not None:
            modifier = item.modifiers.new("SynthRoads", "NODES")
            modifier.node_group = group
            for name, value in (inputs or {}).items():
                # Instance numbers have 32 bits and no sign, the nodes' whole numbers have one.
                signed = int(np.uint32(value).astype(np.int32)) if name.endswith("Instance") else value
                set_modifier_input(modifier, name, signed)
        self.objects[role] = item


def backbone_mesh(geometry: RoadGeometry, station: Float) -> bpy.types.Mesh:
    """Return a polyline with one vertex per station (N,) and the attributes that `nodes.backbone` lists."""
    position, heading, curvature = geometry.alignment.frame(station)
    elevation = geometry.profile.elevation(station)
    values = {"station": station, "curvature": curvature}
    for side in ("left", "right"):
        carriageway = geometry.parameters.carriageway(side)
        values[f"crossfall_{side}"] = (
            geometry.crossfall(carriageway, station) if carriageway else 0.0 * station
        )
    mesh = bpy.data.meshes.new("SR Backbone")
    first = np.arange(len(station) - 1)
    _fill(mesh, np.column_stack([position, elevation]), edges=np.column_stack([first, first + 1]))
    left = np.column_stack([-np.sin(heading), np.cos(heading), np.zeros(len(station))])
    _attribute(mesh, "left", left, "FLOAT_VECTOR")
    for name, value in values.items():
        _attribute(mesh, name, value)
    return mesh


def ground_mesh(geometry: RoadGeometry, terrain: Terrain, tolerance: float) -> bpy.types.Mesh:
    """Return the ground before the road was built: a grid of stations and offsets, wider than the terrain."""
    bend = terrain.undulation * (2.0 * np.pi / terrain.wavelength) ** 2
    spacing = float(np.clip(np.sqrt(8.0 * tolerance / max(bend, 1e-9)), 1.5, 4.0))

    def steps(low: float, high: float) -> Float:
        return np.linspace(low, high, int(np.ceil((high - low) / spacing)) + 1)

    station = steps(-_GROUND_MARGIN, geometry.length + _GROUND_MARGIN)
    reach = terrain.half_width + _GROUND_MARGIN
    offset = steps(-reach, reach)
    position, heading, curvature = geometry.alignment.frame(station)
    offsets = clip_offset(offset[None, :], curvature[:, None])
    left = np.stack([-np.sin(heading), np.cos(heading)], axis=-1)
    plan = position[:, None, :] + offsets[:, :, None] * left[:, None, :]
    stations = np.repeat(station, len(offset))
    height = ground_elevation(geometry, terrain, stations, offsets.ravel())
    corner = np.arange(len(station) - 1)[:, None] * len(offset) + np.arange(len(offset) - 1)
    # Offsets grow to the left: forwards along the stations, then right, is seen from above against the clock.
    faces = np.stack([corner, corner + len(offset), corner + len(offset) + 1, corner + 1], axis=-1)
    mesh = bpy.data.meshes.new("SR Ground")
    _fill(mesh, np.column_stack([plan.reshape(-1, 2), height]), faces=faces.reshape(-1, 4))
    return mesh


def delineator_mesh(geometry: RoadGeometry, posts: list[Delineator]) -> bpy.types.Mesh:
    """Return one vertex per post, exact in plan, with heading, height and instance as attributes."""
    station = np.array([post.station for post in posts])
    offset = np.array([post.offset for post in posts])
    position, heading, _ = geometry.alignment.frame(station)
    left = np.stack([-np.sin(heading), np.cos(heading)], axis=-1)
    plan = position + offset[:, None] * left
    mesh = bpy.data.meshes.new("SR Delineators")
    _fill(mesh, np.column_stack([plan, geometry.profile.elevation(station)]))
    turn = heading - np.pi / 2.0 + np.deg2rad([post.rotation_deg for post in posts])
    _attribute(mesh, "heading", np.arctan2(np.sin(turn), np.cos(turn)))
    _attribute(mesh, "height", np.array([post.height for post in posts]))
    _attribute(
        mesh, "instance", np.array([post.instance for post in posts], np.uint32).astype(np.int32), "INT"
    )
    return mesh


def _fill(
    mesh: bpy.types.Mesh,
    vertices: Float,
    edges: NDArray[np.intp] | None = None,
    faces: NDArray[np.intp] | None = None,
) -> None:
    """Give an empty mesh its vertices (V, 3) and edges (E, 2) or faces (F, 4)."""
    mesh.vertices.add(len(vertices))
    mesh.vertices.foreach_set("co", vertices.astype(np.float32).ravel())
    if edges is not None:
        mesh.edges.add(len(edges))
        mesh.edges.foreach_set("vertices", edges.astype(np.int32).ravel())
    if faces is not None:
        mesh.loops.add(faces.size)
        mesh.loops.foreach_set("vertex_index", faces.astype(np.int32).ravel())
        mesh.polygons.add(len(faces))
        mesh.polygons.foreach_set("loop_start", np.arange(0, faces.size, faces.shape[1], dtype=np.int32))
        mesh.update(calc_edges=True)


def _attribute(mesh: bpy.types.Mesh, name: str, values: NDArray[Any], kind: str = "FLOAT") -> None:
    attribute = mesh.attributes.new(name, kind, "POINT")
    dtype = np.int32 if kind == "INT" else np.float32
    attribute.data.foreach_set("vector" if kind == "FLOAT_VECTOR" else "value", values.astype(dtype).ravel())
