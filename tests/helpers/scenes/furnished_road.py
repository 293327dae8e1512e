"""A hand-made road with some objects on it, built and measured: what the tests of barriers and structures share."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import bpy
import numpy as np
from mathutils.bvhtree import BVHTree
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from synthroads_addon.base.classes import class_id
from synthroads_addon.blender.compat import set_modifier_input
from synthroads_addon.blender.model.build import build_road
from synthroads_addon.blender.scene.evaluated import scene_mesh
from synthroads_addon.blender.things.model_builder import BuildRequest
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.scanning.scene.mesh import SceneMesh
from tests.helpers.roads.furnished_data import Data, road_data

Float = NDArray[np.float64]
MEASURE = 0.005
"""Difference that sizes on the built mesh may have from the parameters, m."""


class FurnishedRoad:
    """A built road beside its analytic geometry.

    Attributes:
        parameters, geometry: of the whole road.
        model: what was built.
        origin: (3,) local coordinates of the scene's origin.
    """

    def __init__(
        self,
        objects: Data,
        parts: Collection[str],
        stretch: tuple[float, float] | None = None,
        detail: float = 0.0,
        **road: Any,
    ) -> None:
        self.parameters = RoadParameters.from_dict(road_data(objects, **road))
        self.geometry = RoadGeometry(self.parameters)
        self.model = build_road(BuildRequest(self.parameters, 0.005, detail, {"road", "terrain", *parts}, stretch))
        self.origin = self.model.origin - np.array(self.parameters.transform.translate)
        self._surface: tuple[BVHTree, BVHTree] | None = None
        self._meshes: dict[tuple[str, ...], SceneMesh] = {}

    def instance(self, name: str) -> int:
        """Return an object's number."""
        return self.parameters.objects[name].instance

    def mesh(self, *roles: str) -> SceneMesh:
        """Return the triangles of some of its objects, read once until `edit` or `update`."""
        if roles not in self._meshes:
            self._meshes[roles] = scene_mesh(objects=[self.model.objects[role] for role in roles])
        return self._meshes[roles]

    def located(self, vertices: NDArray[Any]) -> tuple[Float, Float]:
        """Return station and offset of scene points (N, 3)."""
        return self.geometry.alignment.project(vertices[:, :2].astype(np.float64) + self.origin[:2])

    def point(self, station: float, offset: float) -> Float:
        """Return the scene's point (3,) on the surface at a station and offset."""
        position, heading, _ = self.geometry.alignment.frame(np.array([station]))
        left = np.array([-np.sin(heading[0]), np.cos(heading[0])])
        plan = position[0] + offset * left - self.origin[:2]
        return np.array([*plan, self.surface(plan[None])[0]])

    def surface(self, plan: NDArray[Any]) -> Float:
        """Return z (N,) of the built road or, beside it, the terrain below points in plan (N, 2); NaN beyond."""
        if self._surface is None:
            self._surface = tree_of(self.mesh("Road")), tree_of(self.mesh("Terrain"))
        road, ground = (cast_down(tree, plan) for tree in self._surface)
        return np.where(np.isnan(road), ground, road)

    def edit(self, role: str, name: str, value: Any) -> SceneMesh:
        """Set an input of an object's modifier; return its mesh afterwards."""
        set_modifier_input(self.model.objects[role].modifiers[0], name, value)
        self.update()
        return self.mesh(role)

    def update(self) -> None:
        """Have Blender evaluate what was changed by other ways than `edit`."""
        bpy.context.view_layer.update()
        self._meshes.clear()


def corners(mesh: SceneMesh, chosen: NDArray[np.bool_] | slice = slice(None)) -> Float:
    """Return the corners (T, 3, 3) of triangles."""
    return mesh.vertices[mesh.triangles[chosen]].astype(np.float64)


def of_material(mesh: SceneMesh, *names: str) -> NDArray[np.bool_]:
    """Return which triangles (T,) have one of these materials."""
    return np.isin(mesh.material, [mesh.materials.index(name) for name in names if name in mesh.materials])


def normals(mesh: SceneMesh, chosen: NDArray[np.bool_] | slice = slice(None)) -> Float:
    """Return the unit normals (T, 3)."""
    a, b, c = np.moveaxis(corners(mesh, chosen), 1, 0)
    cross = np.cross(b - a, c - a)
    return cross / np.linalg.norm(cross, axis=1)[:, None]


def pieces(mesh: SceneMesh, chosen: NDArray[np.bool_] | slice = slice(None)) -> list[Float]:
    """Return the triangles (T, 3, 3) of each piece that holds together; places 0.1 mm apart are one."""
    triangles = corners(mesh, chosen)
    _, index = np.unique(np.round(triangles.reshape(-1, 3), 4), axis=0, return_inverse=True)
    index = index.reshape(-1, 3)
    edges = np.concatenate([index[:, :2], index[:, 1:]])
    graph = coo_matrix((np.ones(len(edges)), edges.T), shape=(index.max() + 1,) * 2)
    label = connected_components(graph, directed=False)[1][index[:, 0]]
    ends = np.cumsum(np.unique(label, return_counts=True)[1])
    return np.split(triangles[np.argsort(label, kind="stable")], ends[:-1])


def volume(triangles: Float) -> float:
    """Return the volume (m3) that triangles (T, 3, 3) enclose; negative if they look inwards."""
    a, b, c = np.moveaxis(triangles - triangles.mean(axis=(0, 1)), 1, 0)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)


def open_edges(triangles: Float) -> int:
    """Return how many edges of triangles (T, 3, 3) have no other one that runs the opposite way."""
    _, index = np.unique(np.round(triangles.reshape(-1, 3), 4), axis=0, return_inverse=True)
    a, b, c = index.reshape(-1, 3).T
    start, end = np.concatenate([a, b, c]), np.concatenate([b, c, a])
    there, back = start.astype(np.int64) << 32 | end, end.astype(np.int64) << 32 | start
    keys, counts = np.unique(np.concatenate([there, back]), return_counts=True)
    forward = dict(zip(*np.unique(there, return_counts=True), strict=True))
    return sum(1 for key, count in zip(keys, counts, strict=True) if 2 * forward.get(key, 0) != count)


def tree_of(mesh: SceneMesh, class_name: str | None = None) -> BVHTree:
    """Return a mesh's triangles, or those of a class, to be cast on."""
    chosen = mesh.triangles if class_name is None else mesh.triangles[mesh.class_id == class_id(class_name)]
    return BVHTree.FromPolygons(mesh.vertices.tolist(), chosen.tolist())


def cast_down(tree: BVHTree, plan: NDArray[Any]) -> Float:
    """Return z (N,) of what lies below points in plan (N, 2); NaN where there is nothing."""

    def below(x: float, y: float) -> float:
        # A ray that meets an edge may pass between the triangles: another one beside it doesn't.
        for aside in (0.0, 1e-4):
            hit = tree.ray_cast((x + aside, y + 0.7 * aside, 1000.0), (0.0, 0.0, -1.0))[0]
            if hit is not None:
                return float(hit.z)
        return np.nan

    return np.array([below(float(x), float(y)) for x, y in plan])
