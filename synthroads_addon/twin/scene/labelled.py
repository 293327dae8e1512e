"""`LabelledScene`: meshes of a scene with class, instance and material of each face, and where each stands."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...base.arrays import Float, Float32, Index
from ...base.classes import UNLABELLED

CLASS, INSTANCE, NAME, STATION = "synthroads_class", "synthroads_instance", "synthroads_name", "synthroads_station"
"""Properties of objects: name of the class, instance number, id in the parameter set, stations from and to, m. A scan
of the file reads the first two."""
_PROBES = 200
"""Vertices of a mesh that its stations are taken from at most. Chosen."""


class SceneMaterial(NamedTuple):
    """Mean properties of a material.

    Attributes:
        name: as the scan reads it.
        color: linear red, green, blue, 0 to 1.
        roughness, metallic: 0 to 1.
        alpha: 0 to 1.
    """

    name: str
    color: tuple[float, float, float]
    roughness: float = 0.5
    metallic: float = 0.0
    alpha: float = 1.0


@dataclass(frozen=True)
class LabelledMesh:
    """A mesh, and the places where it stands.

    Attributes:
        name: of the object that it is of.
        vertices: (V, 3) float32, m.
        triangles: (T, 3) int32, against the clock seen from outside.
        material: (T,) uint16 indices into the scene's materials.
        class_id: (T,) uint8.
        instance_id: (T,) uint32; None if each place has a number.
        matrices: (N, 4, 4) from the mesh's frame to the scene's.
        numbers: (N,) uint32 instance numbers of the places; without meaning where faces have theirs.
    """

    name: str
    vertices: NDArray[np.float32]
    triangles: NDArray[np.int32]
    material: NDArray[np.uint16]
    class_id: NDArray[np.uint8]
    instance_id: NDArray[np.uint32] | None
    matrices: Float
    numbers: NDArray[np.uint32]

    def parts(self) -> Iterator[LabelledPart]:
        """Yield the mesh's faces by class and instance number, each with the vertices that it needs, in order."""
        numbers = np.zeros(len(self.triangles), np.uint64) if self.instance_id is None else self.instance_id
        keys = (numbers.astype(np.uint64) << np.uint64(8)) | self.class_id
        order = np.lexsort((self.material, keys))
        starts = np.flatnonzero(np.r_[True, np.diff(keys[order]) != 0]) if len(order) else np.zeros(0, int)
        for rows in np.split(order, starts[1:]):
            if not len(rows):
                continue
            key = int(keys[rows[0]])
            used, index = np.unique(self.triangles[rows], return_inverse=True)
            material = self.material[rows]
            cuts = np.flatnonzero(np.r_[True, np.diff(material) != 0])
            triangles = index.reshape(-1, 3)
            by_material = {
                int(material[cut]): piece for cut, piece in zip(cuts, np.split(triangles, cuts[1:]), strict=True)
            }
            instance = None if self.instance_id is None else key >> 8
            yield LabelledPart(key & 255, instance, self.vertices[used], by_material)


class LabelledPart(NamedTuple):
    """Faces of a mesh that have one class and instance number.

    Attributes:
        class_id: of all of them.
        instance: number of all of them; None if each place of the mesh has its own.
        vertices: (V, 3) float32, m.
        triangles: (T, 3) indices into the vertices, by index of the material.
    """

    class_id: int
    instance: int | None
    vertices: NDArray[np.float32]
    triangles: dict[int, Index]


@dataclass(frozen=True)
class LabelledScene:
    """Meshes of a scene with their labels; z is up, lengths are in metres.

    Attributes:
        meshes: what stands in it.
        materials: that the meshes' faces name by index.
        class_names: of the classes by ``class_id``.
        origin: (3,) map coordinates of the scene's origin, m.
        epsg: map coordinate system.
        title: for people.
        generator: program and version.
        name_of: id in the parameter set by instance number; None where there is none.
        stations: function from map points (N, 2), m, less the origin, to stations (N,), m; None without a road.
        height_epsg: vertical coordinate system; None if it isn't named.
    """

    meshes: tuple[LabelledMesh, ...]
    materials: tuple[SceneMaterial, ...]
    class_names: Mapping[int, str]
    origin: Float
    epsg: int
    title: str = ""
    generator: str = ""
    name_of: Callable[[int], str | None] = field(default=lambda number: None)
    stations: Callable[[Float], Float] | None = None
    height_epsg: int | None = None

    def about(self) -> dict[str, Any]:
        """Return what the scene says of itself as JSON data: unit, axes and place."""
        return {
            "synthroads_unit": "metre",
            "synthroads_origin": np.asarray(self.origin).tolist(),
            "synthroads_epsg": self.epsg,
            "synthroads_title": self.title,
        }

    def properties(self, class_id: int, instance: int, vertices: Float32, matrix: Float) -> dict[str, Any]:
        """Return the properties of an object as JSON data: class, instance, name and stations.

        Args:
            class_id, instance: of the object; without a class or number they are left out.
            vertices: (V, 3) in the mesh's frame, m.
            matrix: (4, 4) from that to the scene's.
        """
        properties: dict[str, Any] = {}
        if class_id != UNLABELLED and class_id in self.class_names:
            properties[CLASS] = self.class_names[class_id]
        if instance:
            properties[INSTANCE] = instance if instance < 2**31 else instance - 2**32
            if name := self.name_of(instance):
                properties[NAME] = name
        if self.stations is not None and len(vertices):
            step = -(-len(vertices) // _PROBES)
            plan = vertices[::step].astype(np.float64) @ matrix[:2, :3].T + matrix[:2, 3]
            along = self.stations(plan)
            properties[STATION] = [round(float(along.min()), 2), round(float(along.max()), 2)]
        return properties
