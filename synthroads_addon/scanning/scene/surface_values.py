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
        """Return where triangles (N,) of the scene's mesh are, part by part; some may be on none."""
        number = faces if self.kept is None else np.take(self.kept, faces).astype(np.intp)
        # Meshes may be many: only those are looked at that the triangles are of.
        owner, result = np.searchsorted(self._firsts, number, side="right") - 1, list[PlacesOnPart]()
        for at in np.flatnonzero(np.bincount(owner + 1)[1:]).tolist():
            part = self.parts[at]
            mine = np.flatnonzero((owner == at) & (number < part.first + len(part.corners) * part.uses))
            if len(mine):
                place = np.take(number, mine) - part.first
                use = place // len(part.corners)  # several times as fast as what gives the remainder as well
                result.append(PlacesOnPart(part, mine, use, place - use * len(part.corners)))
        return result

    def read(
        self, what: SurfaceInput, located: list[PlacesOnPart], shares: Float, place: Float, normal: Float | None
    ) -> tuple[Float32, Bool]:
        """Return an input's values (N, 4) on triangles, and a mask (N,) of those that have it; zeros elsewhere.

        Args:
            what: the input.
            located: where the triangles are, see `locate`.
            shares: (N, 3) weights of their corners.
            place: (N, 3) on the triangles, in the mesh's frame, m.
            normal: (N, 3) unit normals there; None if the input is none.
        """
        result, mask = np.zeros((len(place), 4), np.float32), np.zeros(len(place), bool)
        for part, mine, use, triangle in located:
            if what.kind == "object":
                values = _in_frame(part, use, place[mine])
            else:
                if _interpolate_into(result, part, what, (mine, use, triangle), shares):
                    mask[mine] = True
                    continue
                values = _interpolate(part, what, use, triangle, take_rows(shares, mine))
                if values is not None and what.kind in NORMALS:
                    assert normal is not None
                    values[:, :3] = _oriented_normals(part, use, values[:, :3], normal[mine], what.kind == "normal")
            if values is not None:
                result[mine], mask[mine] = values, True
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
    """Return unit normals (H, 3) of the part, flipped to the side that ``towards`` (H, 3), in the mesh's frame, points.

    Args:
        part: the part.
        use: (H,) places of it.
        normal: (H, 3) in its own frame.
        towards: (H, 3).
        into_mesh: return them in the mesh's frame; else in its own.
    """
    assert part.frames is not None
    inverse = np.linalg.inv(part.frames[:, :3, :3])[use]
    turned = np.einsum("nji,nj->ni", inverse, normal)
    sign = np.where(np.einsum("ij,ij->i", turned, towards) < 0.0, -1.0, 1.0)
    result = turned if into_mesh else normal.astype(np.float64)
    return np.asarray(result * (sign / np.maximum(np.linalg.norm(result, axis=1), 1e-12))[:, None])


def _interpolate_into(
    result: Float32, part: PartValues, what: SurfaceInput, places: tuple[Index, Index, Index], shares: Float
) -> bool:
    """Interpolate an input's values in a part's triangles by compiled loops, see `_interpolate`; return whether it was.

    Args:
        result: (N, 4) where they go.
        part: the part.
        what: the input; no normals, which are turned afterwards.
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
    """Return an input's values (H, 4), interpolated in the part's triangles; None if the part lacks it."""
    entry = part.values.get(what)
    if entry is None:
        return None
    if entry.domain in ("object", "face"):
        return take_rows(entry.values, use if entry.domain == "object" else triangle)
    numbers = take_rows(part.corners if entry.domain == "corner" else part.points, triangle)
    turned = part.mirrored[use]
    if turned.any():
        shares = np.where(turned[:, None], shares[:, ::-1], shares)
    # From the first corner on: what all three have alike stays exactly that.
    first = take_rows(entry.values, numbers[:, 0]).astype(np.float64)
    result = first.copy()
    for corner in (1, 2):
        result += shares[:, corner, None] * (take_rows(entry.values, numbers[:, corner]) - first)
    return result.astype(np.float32)


def corner_shares(corners: Float, place: Float) -> Float:
    """Return the barycentric weights (N, 3) of places (N, 3) in triangles (N, 3, 3); outside ones are moved inside."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    u, v, w = b - a, c - a, place - a
    (uu, uv, vv), (wu, wv) = (_dot(u, u), _dot(u, v), _dot(v, v)), (_dot(w, u), _dot(w, v))
    with np.errstate(divide="ignore", invalid="ignore"):
        below = uu * vv - uv * uv
        second, third = (vv * wu - uv * wv) / below, (uu * wv - uv * wu) / below
    shares = np.stack([1.0 - second - third, second, third], axis=1)
    shares = np.clip(np.nan_to_num(shares, nan=1.0 / 3.0), 0.0, None)
    return np.asarray(shares / np.maximum(shares.sum(axis=1, keepdims=True), 1e-30))


def _dot(one: Float, other: Float) -> Float:
    """Return the dot products (N,) of vectors (N, 3), in an order of their own: einsum's depends on the processor."""
    return np.asarray(one[:, 0] * other[:, 0] + one[:, 2] * other[:, 2] + one[:, 1] * other[:, 1])


@dataclass
class ValuesBuilder:
    """Collector of the surface values of parts while a scene's mesh is put together."""

    parts: list[PartValues] = field(default_factory=list)

    def table(self, kept: Bool | None) -> SurfaceValues | None:
        """Return the values gathered, with triangles renumbered by the mask ``kept``; None if there are none."""
        if not self.parts:
            return None
        number = None if kept is None else np.flatnonzero(kept).astype(np.int32)
        return SurfaceValues(tuple(self.parts), number)
