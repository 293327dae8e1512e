"""Reading CityJSON files back without the code that wrote them, and what a schema can't say about them."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import RoadParameters

SURFACES = ("MultiSurface", "CompositeSurface")


@dataclass(frozen=True)
class City:
    """A file's JSON data, and its vertices (V, 3) in map coordinates."""

    data: dict[str, Any]
    vertices: np.ndarray

    @property
    def objects(self) -> dict[str, Any]:
        return self.data["CityObjects"]

    def geometries(self) -> Iterator[tuple[str, dict[str, Any]]]:
        for name, item in self.objects.items():
            yield from ((name, shape) for shape in item.get("geometry", ()))

    def surfaces(self, *types: str) -> Iterator[tuple[str, dict[str, Any], list[np.ndarray]]]:
        """Yield (id, semantic surface, rings of (K, 3) map coordinates), of some types or all."""
        for name, shape in self.geometries():
            if "semantics" not in shape:
                continue
            rings: dict[int, list[np.ndarray]] = {}
            for polygon, value in zip(shape["boundaries"], shape["semantics"]["values"], strict=True):
                rings.setdefault(value, []).append(self.vertices[polygon[0]])
            for value, found in rings.items():
                about = shape["semantics"]["surfaces"][value]
                if not types or about["type"] in types:
                    yield name, about, found

    def rings(self, entity: dict[str, Any]) -> list[np.ndarray]:
        """Return the outer rings (K, 3) of what a report tells of an object, or of one of its surfaces."""
        found: list[np.ndarray] = []
        for shape in self.objects[entity["object"]].get("geometry", ()):
            if shape["type"] == "GeometryInstance":
                found += self._instanced(shape)
            elif shape["type"] in (*SURFACES, "Solid", "MultiSolid"):
                boundaries = shape["boundaries"]
                if "surface" in entity:
                    values = shape["semantics"]["values"]
                    boundaries = [b for b, v in zip(boundaries, values, strict=True) if v == entity["surface"]]
                found += [self.vertices[ring] for ring in _rings_in(boundaries)]
        return found

    def _instanced(self, shape: dict[str, Any]) -> list[np.ndarray]:
        templates = self.data["geometry-templates"]
        vertices = np.column_stack([templates["vertices-templates"], np.ones(len(templates["vertices-templates"]))])
        moved = vertices @ np.array(shape["transformationMatrix"]).reshape(4, 4).T
        placed = moved[:, :3] + self.vertices[shape["boundaries"][0]]
        return [placed[ring] for ring in _rings_in(templates["templates"][shape["template"]]["boundaries"])]

    def instances(self) -> set[int]:
        """Return every instance number in the file."""
        found = {item["attributes"]["instance"] for item in self.objects.values()}
        return found | {about["instance"] for _, about, _ in self.surfaces() if "instance" in about}


def _rings_in(boundaries: list[Any]) -> Iterator[list[int]]:
    """Yield the rings of nested boundaries."""
    if boundaries and isinstance(boundaries[0], int):
        yield boundaries
    else:
        for inner in boundaries:
            yield from _rings_in(inner)


def triangles_of_rings(rings: list[np.ndarray]) -> np.ndarray:
    """Return triangles (T, 3, 3) of convex rings."""
    fans = [np.stack([ring[[0] * (len(ring) - 2)], ring[1:-1], ring[2:]], axis=1) for ring in rings]
    return np.concatenate(fans) if fans else np.empty((0, 3, 3))


def read_city(path: Path) -> City:
    data = json.loads(path.read_text(encoding="utf-8"))
    numbers = np.array(data["vertices"], dtype=np.int64).reshape(-1, 3)
    transform = data["transform"]
    return City(data, numbers * np.array(transform["scale"]) + np.array(transform["translate"]))


def width_at(road: RoadParameters, rings: list[np.ndarray], station: float) -> float:
    """Return how wide in plan, along the normal of the centreline at a station, polygons are together."""
    position, heading, _ = RoadGeometry(road).alignment.frame(np.array([station]))
    along = np.array([np.cos(heading[0]), np.sin(heading[0])])
    left = np.array([-along[1], along[0]])
    crossed = []
    for ring in rings:
        local = ring[:, :2] - np.array(road.transform.translate[:2]) - position[0]
        s, o = local @ along, local @ left
        for i in range(len(ring)):
            if (s[i - 1] < 0.0) != (s[i] < 0.0) and abs(o[i]) < 60.0:
                share = s[i - 1] / (s[i - 1] - s[i])
                crossed.append(o[i - 1] + share * (o[i] - o[i - 1]))
    return max(crossed) - min(crossed)


@dataclass(frozen=True)
class Rings:
    """All rings of a geometry: corners (C,), sizes (R,), and the body (R,) that each belongs to."""

    corners: np.ndarray
    sizes: np.ndarray
    body: np.ndarray

    @property
    def following(self) -> np.ndarray:
        """Return the corner (C,) that follows each round its ring."""
        index = np.arange(1, len(self.corners) + 1)
        ends = np.cumsum(self.sizes)
        index[ends - 1] = ends - self.sizes
        return self.corners[index]

    def of_size(self, size: int) -> np.ndarray:
        """Return the rings (R, size) with so many corners."""
        starts = (np.cumsum(self.sizes) - self.sizes)[self.sizes == size]
        return self.corners[starts[:, None] + np.arange(size)]


def rings_of(shape: dict[str, Any]) -> Rings:
    """Return the rings of a geometry of surfaces or bodies, none of which has holes."""
    kind, boundaries = shape["type"], shape["boundaries"]
    bodies = [[boundaries]] if kind in SURFACES else [boundaries] if kind == "Solid" else boundaries
    rings, body = [], []
    for number, (shell,) in enumerate(bodies):
        for (ring,) in shell:
            rings.append(ring)
            body.append(number)
    sizes = np.array([len(ring) for ring in rings])
    return Rings(np.array([index for ring in rings for index in ring]), sizes, np.array(body))


def faults_of(city: City) -> list[str]:
    """Return what is wrong with indices, semantics, references, rings and bodies."""
    found = [*_vertex_faults(city), *_reference_faults(city)]
    for name, shape in city.geometries():
        found += [f"{name}: {fault}" for fault in _semantics_faults(shape)]
        if shape["type"] in (*SURFACES, "Solid", "MultiSolid"):
            rings = rings_of(shape)
            found += [f"{name}: {fault}" for fault in _ring_faults(city, rings)]
            if shape["type"] not in SURFACES:
                found += [f"{name}: {fault}" for fault in _body_faults(city, rings)]
    return found


def _vertex_faults(city: City) -> Iterator[str]:
    raw = city.data["vertices"]
    if not all(type(value) is int for vertex in raw for value in vertex):
        yield "a vertex isn't of whole numbers"
    if (twice := len(raw) - len({tuple(vertex) for vertex in raw})) > 0:
        yield f"{twice} vertices are there twice"
    used = {index for _, shape in city.geometries() for index in _indices(shape["boundaries"])}
    if any(type(index) is not int for index in used):
        yield "an index isn't a whole number"
    if used and (min(used) < 0 or max(used) >= len(raw)):
        yield "an index names no vertex"
    if len(used) < len(raw):
        yield f"{len(raw) - len(used)} vertices are of no use"


def _indices(boundaries: list[Any]) -> Iterator[int]:
    for item in boundaries:
        if isinstance(item, list):
            yield from _indices(item)
        else:
            yield item


def _reference_faults(city: City) -> Iterator[str]:
    for name, item in city.objects.items():
        for child in item.get("children", ()):
            if name not in city.objects.get(child, {}).get("parents", ()):
                yield f"{name}: its child {child} doesn't name it"
        for parent in item.get("parents", ()):
            if name not in city.objects.get(parent, {}).get("children", ()):
                yield f"{name}: its parent {parent} doesn't name it"


def _semantics_faults(shape: dict[str, Any]) -> Iterator[str]:
    if "semantics" not in shape:
        return
    values, surfaces = shape["semantics"]["values"], shape["semantics"]["surfaces"]
    if len(values) != len(shape["boundaries"]):
        yield f"{len(values)} semantic values of {len(shape['boundaries'])} polygons"
    if set(values) != set(range(len(surfaces))):
        yield "semantic values don't name every semantic surface"


def _ring_faults(city: City, rings: Rings, flat: float = 0.0015) -> Iterator[str]:
    """Yield rings that are too short, pass a vertex twice, or lie in no plane (1 mm, and the vertices' rounding)."""
    if len(rings.sizes) and rings.sizes.min() < 3:
        yield "a ring has less than three corners"
    for size in np.unique(rings.sizes[rings.sizes >= 3]).tolist():
        found = rings.of_size(size)
        if np.any(np.diff(np.sort(found, axis=1), axis=1) == 0):
            yield "a ring passes a vertex twice"
        points = city.vertices[found]
        centred = points - points.mean(axis=1, keepdims=True)
        normal = np.linalg.svd(centred, full_matrices=False)[2][:, 2]
        away = np.abs(np.einsum("rki,ri->rk", centred, normal)).max()
        if away > flat:
            yield f"a ring is {away * 1000:.2f} mm off its plane"


def _body_faults(city: City, rings: Rings) -> Iterator[str]:
    """Yield what keeps bodies from being closed with their faces outwards."""
    body = np.repeat(rings.body, rings.sizes)
    forth = np.stack([body, rings.corners, rings.following], axis=1)
    edges, counts = np.unique(forth, axis=0, return_counts=True)
    if counts.max() > 1:
        yield "an edge of a body is passed twice in one direction"
    if len(np.unique(np.concatenate([forth, forth[:, [0, 2, 1]]]), axis=0)) != len(edges):
        yield "a body isn't closed"
    if volumes_of(city, rings).min() <= 0.0:
        yield "a body's faces look inwards"


def volumes_of(city: City, rings: Rings) -> np.ndarray:
    """Return the volume (B,) of each body, m3, by the divergence theorem."""
    firsts = rings.corners[np.cumsum(rings.sizes) - rings.sizes]
    _, begin = np.unique(rings.body, return_index=True)
    origin = np.repeat(city.vertices[firsts[begin]][rings.body], rings.sizes, axis=0)
    first = city.vertices[np.repeat(firsts, rings.sizes)] - origin
    here, after = city.vertices[rings.corners] - origin, city.vertices[rings.following] - origin
    parts = np.einsum("ij,ij->i", first, np.cross(here, after)) / 6.0
    return np.bincount(np.repeat(rings.body, rings.sizes), weights=parts)
