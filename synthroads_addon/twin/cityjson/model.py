"""City objects as CityJSON 2.0 knows them, with geometry in local float64 coordinates, and how they become a file."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain
from pathlib import Path
from typing import Any, Literal, TextIO

import numpy as np
from numpy.typing import NDArray

from ...base.schema import compact_json
from ..faces import Faces, Float, Int, drop_collapsed, drop_polygons, polygon_areas
from ..trace import Trace

SCALE = 1e-4
"""Step of the vertices' whole numbers, m: rounding moves a vertex by 0.05 mm at most along each axis."""

SLIVER = 1e-6
"""Area, m2, below which a polygon of a surface is left out; those of bodies stay, which would be open without."""
_LINE = 20_000  # polygons and vertices turned into text at a time

GeometryType = Literal[
    "MultiPoint", "MultiLineString", "MultiSurface", "CompositeSurface", "Solid", "MultiSolid", "GeometryInstance"
]


@dataclass(frozen=True)
class CityGeometry:
    """One geometry of a city object, in local float64 coordinates.

    Attributes:
        type: CityJSON's name.
        lod: level of detail.
        parts: the surfaces of a MultiSurface or CompositeSurface (one part), the bodies of a Solid (one) or MultiSolid;
            lines and points are "polygons" of one part.
        semantics: what the polygons can be, with their attributes; only a MultiSurface's here.
        values: (F,) index of each polygon into the semantics.
        template: of a GeometryInstance, whose one part is the point where it stands: number of its template.
        scale: factors on that.
    """

    type: GeometryType
    lod: str
    parts: tuple[Faces, ...]
    semantics: tuple[dict[str, Any], ...] = ()
    values: Int | None = None
    template: int = 0
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)


@dataclass(frozen=True)
class CityObject:
    """A city object of CityJSON 2.0 with its attributes, geometries and relatives.

    Attributes:
        id: as in the parameter set; parts of a bridge have the bridge's, a slash and a name.
        type: CityJSON's name of its class.
        attributes: JSON data.
        geometry: its geometries; empty ones are left out.
        parent, children: ids.
    """

    id: str
    type: str
    attributes: dict[str, Any]
    geometry: tuple[CityGeometry, ...] = ()
    parent: str | None = None
    children: tuple[str, ...] = ()


@dataclass
class _Shell:
    """Polygons (or lines, or points) of one part of a geometry, as indices into the model's vertices.

    Attributes:
        corners: (C,) vertex indices, polygon by polygon.
        sizes: (F,) number of corners of each polygon.
        kept: mask over the polygons that the part had at first: False for those dropped when vertices were merged.
    """

    corners: Int
    sizes: Int
    kept: NDArray[np.bool_] = field(default_factory=lambda: np.empty(0, dtype=bool))


@dataclass
class CityModel:
    """A CityJSON file in the making: city objects whose vertices are quantized to `SCALE` and shared.

    Attributes:
        translate: map coordinates of the local origin, m: what is added to a vertex times `SCALE`.
        trace: it is told which numbers became which objects and surfaces.
    """

    translate: tuple[float, float, float]
    trace: Trace

    def __post_init__(self) -> None:
        self._templates: dict[Hashable, tuple[int, CityGeometry]] = {}
        self._objects: list[tuple[CityObject, list[list[_Shell]]]] = []
        self._vertices: list[Int] = []
        self._count = 0

    def add(self, item: CityObject) -> None:
        """Add a city object; its points are quantized to multiples of `SCALE` and not kept otherwise."""
        shells = [[self._shell(part) for part in geometry.parts] for geometry in item.geometry]
        emptied_geometries = tuple(replace(geometry, parts=()) for geometry in item.geometry)
        self._objects.append((replace(item, geometry=emptied_geometries), shells))

    def template_index(self, key: Hashable, make: Callable[[], CityGeometry]) -> int:
        """Return the index of the geometry template for a key; `make` is called once per key to create it."""
        if key not in self._templates:
            self._templates[key] = (len(self._templates), make())
        return self._templates[key][0]

    def _shell(self, faces: Faces) -> _Shell:
        """Append the polygons' quantized points to the model's vertices; return the polygons with their indices."""
        shell = _Shell(faces.corners + self._count, faces.sizes)
        self._vertices.append(np.rint(faces.points / SCALE).astype(np.int64))
        self._count += len(faces.points)
        return shell

    def write(self, path: Path, metadata: dict[str, Any]) -> None:
        """Write the CityJSON file and record its entities in the trace; same objects, same bytes.

        Args:
            path: its name.
            metadata: CityJSON's, without the extent.
        """
        vertices = self._merge_vertices()
        extent = self._extent(vertices)
        members = {
            "type": "CityJSON",
            "version": "2.0",
            "metadata": metadata | {"geographicalExtent": extent},
            "transform": {"scale": [SCALE] * 3, "translate": list(self.translate)},
        }
        with path.open("w", encoding="utf-8", newline="\n") as file:
            file.write(compact_json(members)[:-1] + ',\n"CityObjects":{')
            separator = "\n"
            for item, shapes in self._objects:
                file.write(f"{separator}{compact_json(item.id)}:")
                _write_object(file, item, shapes, self.trace)
                separator = ",\n"
            file.write('},\n"vertices":[')
            for begin in range(0, len(vertices), _LINE):
                file.write("," * bool(begin) + "\n" + compact_json(vertices[begin : begin + _LINE].tolist())[1:-1])
            file.write("]")
            if self._templates:
                file.write(',\n"geometry-templates":')
                _write_templates(file, [shape for _, shape in self._templates.values()])
            file.write("}\n")

    def _merge_vertices(self) -> Int:
        """Merge equal vertices in place, drop collapsed polygons and unused vertices; return the vertices (V, 3)."""
        vertices = np.concatenate(self._vertices) if self._vertices else np.empty((0, 3), np.int64)
        self._vertices = []
        canonical = _first_equal(vertices)
        is_used = np.zeros(len(vertices), dtype=bool)
        for shell, has_rings, is_solid in self._shells():
            corners = canonical[shell.corners]
            if has_rings:
                shell.corners, shell.sizes, shell.kept = drop_collapsed(corners, shell.sizes)
                if not is_solid:
                    _drop_slivers(shell, vertices)
            else:
                shell.corners, shell.kept = corners, np.ones(len(shell.sizes), dtype=bool)
            is_used[shell.corners] = True
        new_index = np.cumsum(is_used) - 1
        for shell, _, _ in self._shells():
            shell.corners = new_index[shell.corners]
        return vertices[is_used]

    def _shells(self) -> Iterator[tuple[_Shell, bool, bool]]:
        """Yield every shell with whether its corners are rings of polygons, not points or lines, and bound a body."""
        for item, shapes in self._objects:
            for shape, shells in zip(item.geometry, shapes, strict=True):
                is_solid = "Solid" in shape.type
                yield from ((shell, "Surface" in shape.type or is_solid, is_solid) for shell in shells)

    def _extent(self, vertices: Int) -> list[float]:
        """Return the bounding box of quantized vertices (V, 3) in map coordinates: three minima, three maxima, m."""
        ends = [vertices.min(axis=0), vertices.max(axis=0)] if len(vertices) else [np.zeros(3), np.zeros(3)]
        return [round(float(v) * SCALE + t, 4) for end in ends for v, t in zip(end, self.translate, strict=True)]


def _drop_slivers(shell: _Shell, vertices: Int) -> None:
    """Drop a surface's polygons smaller than `SLIVER`, in place: no reader can tell which way they look."""
    areas = polygon_areas(vertices * SCALE, shell.corners, shell.sizes)
    keep_mask = areas >= SLIVER
    if not keep_mask.all():
        shell.corners, shell.sizes = drop_polygons(shell.corners, shell.sizes, keep_mask)
        kept_of_all = shell.kept.copy()
        kept_of_all[shell.kept] = keep_mask
        shell.kept = kept_of_all


def _first_equal(vertices: Int) -> Int:
    """Return for each vertex (V, 3) the index (V,) of the first vertex equal to it."""
    order = np.lexsort((np.arange(len(vertices)), vertices[:, 2], vertices[:, 1], vertices[:, 0]))
    sorted_vertices = vertices[order]
    starts_run = np.ones(len(vertices), dtype=bool)
    starts_run[1:] = np.any(sorted_vertices[1:] != sorted_vertices[:-1], axis=1)
    first_index = np.empty(len(vertices), dtype=np.int64)
    first_index[order] = order[starts_run][np.cumsum(starts_run) - 1]
    return first_index


# --- text -------------------------------------------------------------------------------------------------------


def _write_object(file: TextIO, item: CityObject, shapes: list[list[_Shell]], trace: Trace) -> None:
    """Write a city object as JSON without its id, and record the object and its semantic surfaces in the trace."""
    members: dict[str, Any] = {"type": item.type, "attributes": item.attributes}
    if item.parent:
        members["parents"] = [item.parent]
    if item.children or item.type == "CityObjectGroup":  # a group must say its members, also where it has none
        members["children"] = list(item.children)
    nonempty = [
        (shape, shells)
        for shape, shells in zip(item.geometry, shapes, strict=True)
        if any(len(shell.sizes) for shell in shells)
    ]
    trace.record_entity(item.attributes["instance"], object=item.id)
    if not nonempty:
        file.write(compact_json(members))
        return
    file.write(compact_json(members)[:-1] + ',"geometry":[')
    for number, (shape, shells) in enumerate(nonempty):
        file.write("," * bool(number))
        surfaces = _write_geometry(file, shape, [shell for shell in shells if len(shell.sizes)])
        for index, surface in enumerate(surfaces):
            trace.record_entity(surface["instance"], object=item.id, surface=index)
    file.write("]}")


def _write_geometry(file: TextIO, shape: CityGeometry, shells: list[_Shell]) -> list[dict[str, Any]]:
    """Write a geometry as JSON; return its semantic surfaces, empty if it has none."""
    if shape.type == "GeometryInstance":
        _write_instance(file, shape, shells[0])
        return []
    surfaces: list[dict[str, Any]] = []
    file.write(compact_json({"type": shape.type, "lod": shape.lod})[:-1] + ',"boundaries":')
    if shape.type == "MultiSolid":
        file.write("[")
        for number, shell in enumerate(shells):
            file.write(("," * bool(number)) + "[" + compact_json(_rings(shell, 0, len(shell.sizes), True)) + "]")
        file.write("]")
    elif shape.type == "Solid":
        file.write("[" + compact_json(_rings(shells[0], 0, len(shells[0].sizes), True)) + "]")
    elif shape.type == "MultiPoint":
        file.write(compact_json(shells[0].corners.tolist()))
    else:
        _write_many(file, shells[0], shape.type != "MultiLineString")
    if shape.values is not None:
        values = shape.values[shells[0].kept]
        used_indices, numbers = np.unique(values, return_inverse=True)
        surfaces = [shape.semantics[index] for index in used_indices.tolist()]
        file.write(',"semantics":' + compact_json({"surfaces": surfaces, "values": numbers.tolist()}))
    file.write("}")
    return surfaces


def _write_instance(file: TextIO, shape: CityGeometry, shell: _Shell) -> None:
    """Write a GeometryInstance as JSON: its template, the vertex at its foot, and a 4 x 4 scaling matrix by rows."""
    x, y, z = (round(factor, 6) for factor in shape.scale)
    matrix = [x, 0, 0, 0, 0, y, 0, 0, 0, 0, z, 0, 0, 0, 0, 1]
    members = {"type": shape.type, "template": shape.template, "boundaries": shell.corners.tolist()}
    file.write(compact_json(members | {"transformationMatrix": matrix}))


def _write_templates(file: TextIO, shapes: Sequence[CityGeometry]) -> None:
    """Write the `geometry-templates` member: templates and the vertices they share."""
    vertices: list[list[float]] = []
    file.write('{"templates":[')
    for number, shape in enumerate(shapes):
        shells = []
        for part in shape.parts:
            shells.append(_Shell(part.corners + len(vertices), part.sizes))
            vertices += (np.round(part.points, 6) + 0.0).tolist()
        file.write("," * bool(number))
        _write_geometry(file, shape, shells)
    file.write('],"vertices-templates":' + compact_json(vertices) + "}")


def _write_many(file: TextIO, shell: _Shell, as_polygons: bool) -> None:
    """Write the rings of polygons, or lines, as JSON in blocks of `_LINE`, to save memory."""
    file.write("[")
    for begin in range(0, len(shell.sizes), _LINE):
        text = compact_json(_rings(shell, begin, begin + _LINE, as_polygons))[1:-1]
        file.write("," * bool(begin) + text)
    file.write("]")


def _rings(shell: _Shell, begin: int, end: int, as_polygons: bool) -> list[Any]:
    """Return polygons number `begin` to `end` - 1 as CityJSON boundaries: a list of vertex indices for each ring.

    With `as_polygons` every ring is in a list of its own, as the exterior ring of a polygon without holes.
    """
    sizes = shell.sizes[begin:end]
    start = int(shell.sizes[:begin].sum())
    ends = (start + np.cumsum(sizes)).tolist()
    corners = shell.corners[start : ends[-1] if ends else start].tolist()
    rings = [corners[a - start : b - start] for a, b in zip([start, *ends[:-1]], ends, strict=True)]
    return [[ring] for ring in rings] if as_polygons else rings


def line_faces(polylines: Iterable[Float]) -> Faces:
    """Return polylines, (K, 3) points each, as the single part of a MultiLineString."""
    lines = list(polylines)
    sizes = np.array([len(line) for line in lines], dtype=np.int64)
    return Faces(np.concatenate(lines), np.arange(int(sizes.sum())), sizes)


def solid_geometry(bodies: Iterable[Faces], lod: str) -> tuple[CityGeometry, ...]:
    """Return closed bodies as one Solid or MultiSolid geometry in a tuple, empty if there are no bodies."""
    parts = tuple(chain(bodies))
    if not parts:
        return ()
    return (CityGeometry("Solid" if len(parts) == 1 else "MultiSolid", lod, parts),)
