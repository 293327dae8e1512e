"""Values of a scene's surfaces beside their place: attributes, texture coordinates, and what is the same on an object.

Kept by mesh and not by triangle: a mesh that stands in a thousand places has its values once.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ...base.arithmetic.loops import point_loops
from ...base.arrays import AnyArray, Bool, Float, Float32, Index, take_rows


class SurfaceInput(NamedTuple):
    """A quantity that a material reads of the surface it is on, such as a UV map, an attribute or a normal.

    Attributes:
        kind: what it is, such as ``attribute`` or ``uv``; see `blender.materials.inputs`.
        name: of the attribute, the map; empty for the object's active one.
    """

    kind: str
    name: str = ""


POSITION, ALONG = SurfaceInput("position"), SurfaceInput("along")
"""The place itself, m; and n . d of the face's normal and the ray that meets it."""


@dataclass(frozen=True)
class MeshValues:
    """Values of one surface input on one mesh, and the mesh elements that they belong to.

    Attributes:
        values: (n, 4) float32: x, y, z or red, green, blue, and alpha.
        domain: ``corner``, ``point``, ``face`` (of triangles), or ``object``: a row for each place it stands at.
    """

    values: Float32
    domain: str


@dataclass(frozen=True)
class PartValues:
    """Values of surface inputs on one mesh, at all the places where a scene's mesh has it.

    Attributes:
        first: its first triangle there, before triangles without area were left out.
        corners: (T, 3) corners of its triangles.
        points: (T, 3) vertices of its triangles.
        uses: places that it stands at, one after the other.
        mirrored: (U,) whether a place mirrors it: its triangles' corners are in reverse order there.
        frames: (U, 4, 4) from its own frame to the scene mesh's; None where nothing asks for it.
        values: by input.
    """

    first: int
    corners: AnyArray
    points: AnyArray
    uses: int
    mirrored: Bool
    frames: Float | None
    values: Mapping[SurfaceInput, MeshValues]


NORMALS = ("normal", "object_normal")
"""Kinds of inputs that are normals of the shading: in the scene mesh's frame, and in the part's own."""


class PlacesOnPart(NamedTuple):
    """Places on triangles of a part.

    Attributes:
        part: the part.
        rows: (H,) of the places among others.
        use: (H,) at which of the places that the part stands at each is.
        triangle: (H,) of the part.
    """

    part: PartValues
    rows: Index
    use: Index
    triangle: Index


@dataclass(frozen=True)
class SurfaceValues:
    """Values of surface inputs on a scene's mesh, kept once for each of the meshes that it is made of.

    Attributes:
        parts: those that have any, in the order of their first triangles.
        kept: (T,) of each triangle its number before those without area were left out; None if all have one.
    """

    parts: tuple[PartValues, ...] = ()
    kept: AnyArray | None = None

    @cached_property
    def _firsts(self) -> AnyArray:
        """Return the first triangle (P,) of each part; cached."""
        return np.array([part.first for part in self.parts], np.int64)

    def locate(self, faces: Index) -> list[PlacesOnPart]:
        """Return, part by part, which of the triangles (N,) of the scene's mesh are on it; some may be on none."""
        number = faces if self.kept is None else np.take(self.kept, faces).astype(np.intp)
        # The last part that begins at or before each triangle; -1 if none does. Of many parts only these are looked at.
        part_number = np.searchsorted(self._firsts, number, side="right") - 1
        located: list[PlacesOnPart] = []
        for candidate in np.flatnonzero(np.bincount(part_number + 1)[1:]).tolist():
            part = self.parts[candidate]
            end = part.first + len(part.corners) * part.uses
            rows = np.flatnonzero((part_number == candidate) & (number < end))
            if len(rows):
                number_in_part = np.take(number, rows) - part.first
                use = number_in_part // len(part.corners)  # several times as fast as what gives the remainder as well
                located.append(PlacesOnPart(part, rows, use, number_in_part - use * len(part.corners)))
        return located

    def read(
        self, what: SurfaceInput, located: list[PlacesOnPart], shares: Float, place: Float, normal: Float | None
    ) -> tuple[Float32, Bool]:
        """Return an input's values (N, 4) at places on triangles, and a mask (N,) of those whose part has it.

        Where the part lacks the input the values are 0.

        Args:
            what: the input.
            located: where the triangles are, see `locate`.
            shares: (N, 3) weights of their corners.
            place: (N, 3) on the triangles, in the mesh's frame, m.
            normal: (N, 3) unit normals there; None if the input is no normal.
        """
        result, mask = np.zeros((len(place), 4), np.float32), np.zeros(len(place), bool)
        for part, rows, use, triangle in located:
            if what.kind == "object":
                values = _in_frame(part, use, place[rows])
            else:
                if _interpolate_into(result, part, what, (rows, use, triangle), shares):
                    mask[rows] = True
                    continue
                values = _interpolate(part, what, use, triangle, take_rows(shares, rows))
                if values is not None and what.kind in NORMALS:
                    assert normal is not None
                    values[:, :3] = _oriented_normals(part, use, values[:, :3], normal[rows], what.kind == "normal")
            if values is not None:
                result[rows], mask[rows] = values, True
        return result, mask


def _in_frame(part: PartValues, use: Index, place: Float) -> Float32 | None:
    """Return places (H, 3), m, in the part's own frame as (H, 4), the last 0; None if its frames aren't kept."""
    if part.frames is None:
        return None
    result = np.zeros((len(use), 4), np.float32)
    inverse = np.linalg.inv(part.frames[:, :3, :3])[use]
    result[:, :3] = np.einsum("nij,nj->ni", inverse, place - part.frames[use, :3, 3])
    return result


def _oriented_normals(part: PartValues, use: Index, normal: Float32, towards: Float, into_mesh: bool) -> Float:
    """Return unit normals (H, 3) of a part, flipped to the side that vectors ``towards`` point to.

    Args:
        part: the part.
        use: (H,) places of it.
        normal: (H, 3) in its own frame.
        towards: (H, 3) in the mesh's frame.
        into_mesh: return them in the mesh's frame; else in its own.
    """
    assert part.frames is not None
    inverse = np.linalg.inv(part.frames[:, :3, :3])[use]
    mesh_normal = np.einsum("nji,nj->ni", inverse, normal)
    sign = np.where(np.einsum("ij,ij->i", mesh_normal, towards) < 0.0, -1.0, 1.0)
    result = mesh_normal if into_mesh else normal.astype(np.float64)
    return np.asarray(result * (sign / np.maximum(np.linalg.norm(result, axis=1), 1e-12))[:, None])


def _interpolate_into(
    result: Float32, part: PartValues, what: SurfaceInput, places: tuple[Index, Index, Index], shares: Float
) -> bool:
    """Write an input's values, interpolated in a part's triangles, by compiled loops; return False where these can't.

    They can't where none are in use, where the part lacks the input, and for values of objects and faces and for
    normals: `_interpolate` does what is left.

    Args:
        result: (N, 4) where they go.
        part: the part.
        what: the input.
        places: rows of the result (H,), places that the part stands at, and its triangles.
        shares: (N, 3) weights of the corners.
    """
    loops, entry = point_loops(), part.values.get(what)
    if loops is None or entry is None or entry.domain in ("object", "face") or what.kind in NORMALS:
        return False
    rows, use, triangle = places
    elements = part.corners if entry.domain == "corner" else part.points
    return loops.interpolate(rows, use, triangle, elements, part.mirrored, shares, entry.values, result)


def _interpolate(part: PartValues, what: SurfaceInput, use: Index, triangle: Index, shares: Float) -> Float32 | None:
    """Return an input's values (H, 4), interpolated in a part's triangles; None if the part lacks it.

    Args:
        part: the part.
        what: the input.
        use: (H,) at which of the places that the part stands at the triangles are.
        triangle: (H,) of the part.
        shares: (H, 3) weights of the corners.
    """
    entry = part.values.get(what)
    if entry is None:
        return None
    if entry.domain in ("object", "face"):
        return take_rows(entry.values, use if entry.domain == "object" else triangle)
    numbers = take_rows(part.corners if entry.domain == "corner" else part.points, triangle)
    is_mirrored = part.mirrored[use]
    if is_mirrored.any():
        shares = np.where(is_mirrored[:, None], shares[:, ::-1], shares)
    # From the first corner on: what all three have alike stays exactly that.
    first_values = take_rows(entry.values, numbers[:, 0]).astype(np.float64)
    result = first_values.copy()
    for corner in (1, 2):
        result += shares[:, corner, None] * (take_rows(entry.values, numbers[:, corner]) - first_values)
    return result.astype(np.float32)


def corner_shares(corners: Float, place: Float) -> Float:
    """Return the barycentric weights (N, 3) of places (N, 3) in triangles (N, 3, 3); outside ones are moved inside.

    With sides u = b - a, v = c - a and w = place - a, the weights of b and c solve the normal equations of
    s u + t v = w (Cramer's rule); the weight of a is the rest. In triangles without area each corner has a third.
    """
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    u, v, w = b - a, c - a, place - a
    uu, uv, vv, wu, wv = _dot(u, u), _dot(u, v), _dot(v, v), _dot(w, u), _dot(w, v)
    with np.errstate(divide="ignore", invalid="ignore"):
        determinant = uu * vv - uv * uv
        share_b, share_c = (vv * wu - uv * wv) / determinant, (uu * wv - uv * wu) / determinant
    shares = np.stack([1.0 - share_b - share_c, share_b, share_c], axis=1)
    shares = np.clip(np.nan_to_num(shares, nan=1.0 / 3.0), 0.0, None)
    return np.asarray(shares / np.maximum(shares.sum(axis=1, keepdims=True), 1e-30))


def _dot(a: Float, b: Float) -> Float:
    """Return the dot products (N,) of vectors (N, 3), summed in a fixed order: einsum's depends on the processor."""
    return np.asarray(a[:, 0] * b[:, 0] + a[:, 2] * b[:, 2] + a[:, 1] * b[:, 1])


@dataclass
class ValuesBuilder:
    """Collector of the surface values of parts while a scene's mesh is put together."""

    parts: list[PartValues] = field(default_factory=list)

    def table(self, keep_mask: Bool | None) -> SurfaceValues | None:
        """Return the values gathered, with triangles renumbered by the mask ``keep_mask``; None if there are none."""
        if not self.parts:
            return None
        number = None if keep_mask is None else np.flatnonzero(keep_mask).astype(np.int32)
        return SurfaceValues(tuple(self.parts), number)
