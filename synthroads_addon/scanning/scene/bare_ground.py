"""Pavement and bare ground of a scene: on which faces, and how far from all else, a footprint meets one plane alone."""

from __future__ import annotations

import numpy as np

from ...base.arrays import Bool, Float, Float32, Index
from ...base.classes import class_id
from .height_grids import HeightGrids, PlanGrids
from .mesh import SceneMesh

CLASSES = ("ground", "road", "road_marking", "roadside")
"""Classes of pavements, of what is painted on them, and of the ground."""
CREASE = 0.005
"""Largest angle between two faces that count as one plane, rad."""
FINEST, MOST_CELLS = 0.02, 1 << 24
"""Least width of the grids' cells, m, and how many there may be in the finest grid."""
_CELL = 0.7
"""Width of the grids' cells by the footprints' radius: a footprint is then three of them wide, as grids allow."""
_STEEPEST = 0.5
"""Least vertical component of the normal of a face that counts as ground."""
_LEVEL = 0.06
"""Vertical component of a beam's direction up to which it isn't told whether it passes by everything."""
_LOWERED = 0.03
"""How far below its place the edge of a plane stands in a beam's way, m: what ends at the height of the plane is no
obstacle, but for where a footprint reaches it; what stands higher has faces of its own there."""
_BESIDE, _ABOVE = 1, 2
"""Kinds of edges in their grid: those beside a face, and those of what lies on pavement as thin as paint."""
_ROUNDING = 1e-4
"""How far from a triangle's sides a footprint stays that lies within it, m: corners are in single precision."""
_LONGEST_PIECE, _LONGEST_PLANT_PIECE, _PLANT_CELL = 0.2, 2.0, 0.25
"""Pieces of things and of plants that are drawn as boxes, m; and least width of the cells that plants are drawn in."""


class BareGround:
    """Pavement and ground of a mesh, with the edges at which their planes end, and all that stands on them.

    Args:
        mesh: a scene's.
        permeable: (M,) which of its materials let light through.
        footprint: usual radius of the footprints that it will be asked about, m.
        most_cells: of its finest grid; many are worth their while for many pulses only.

    Attributes:
        face: (F,) whether a face of the mesh is pavement or ground; then its normal points upward.
    """

    def __init__(self, mesh: SceneMesh, permeable: Bool, footprint: float, most_cells: int = MOST_CELLS) -> None:
        kinds = np.isin(mesh.class_id, [class_id(name) for name in CLASSES])
        ground = np.flatnonzero(kinds & ~permeable[mesh.material])
        normal = _normals(mesh, ground)
        flat = normal[:, 2] >= _STEEPEST
        ground, normal = ground[flat], normal[flat]
        self.face: Bool = np.zeros(len(mesh), bool)
        self.face[ground] = True
        if not len(ground):
            return
        turned = self._turn_vertices(mesh, ground)
        bounds = np.array([turned.min(axis=1), turned.max(axis=1)], np.float64)
        self._corner, self._size = bounds[0], bounds[1] - bounds[0]
        turned -= turned.min(axis=1)[:, None]
        self._faces, self._corners = ground, turned[:2, mesh.triangles[ground]]
        area = float(np.prod(bounds[1, :2] - bounds[0, :2]))
        cell = max(FINEST, _CELL * footprint, (area / most_cells) ** 0.5)
        self._edges = PlanGrids(bounds[1, :2] - bounds[0, :2], cell, np.uint8, 0)
        self._things = HeightGrids(bounds, cell)
        for edges, kind in zip(_plane_edges(mesh, ground, normal), (_BESIDE, _ABOVE), strict=True):
            self._draw_edges(turned, edges, cell, kind)
        plant = mesh.class_id == class_id("vegetation")
        self._things.draw_triangles(turned, mesh.triangles[~self.face & ~plant], _LONGEST_PIECE)
        self._things.draw_triangles(turned, mesh.triangles[plant], _LONGEST_PLANT_PIECE, _PLANT_CELL)
        self._edges.finish()
        self._things.finish()

    def _turn_vertices(self, mesh: SceneMesh, ground: Index) -> Float32:
        """Return the vertices (3, V), m, turned about the vertical so that the ground's longer side lies along x."""
        x, y = mesh.vertices[np.unique(mesh.triangles[ground]), :2].T.astype(np.float64)
        spread = np.cov(x, y)
        angle = 0.5 * np.arctan2(2.0 * spread[0, 1], spread[0, 0] - spread[1, 1])
        self._cosine, self._sine = float(np.cos(angle)), float(np.sin(angle))
        x, y, z = mesh.vertices.T
        return np.array(self._turn(x, y) + (z,), np.float32)

    def _turn(self, x: Float, y: Float) -> tuple[Float, Float]:
        return self._cosine * x + self._sine * y, self._cosine * y - self._sine * x

    def _draw_edges(self, vertices: Float32, edges: Index, cell: float, kind: int) -> None:
        """Draw edges (E, 2) of a kind, the vertices' numbers, cut into pieces no longer than a cell."""
        begins, ends = vertices[:, edges[:, 0]], vertices[:, edges[:, 1]]
        length = np.hypot(*(ends - begins)[:2])
        count = np.maximum(np.ceil(length / cell), 1.0).astype(np.intp)
        edge = np.repeat(np.arange(len(count)), count)
        place = (np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count)).astype(np.float32)
        way = ((ends - begins) / count.astype(np.float32))[:, edge]
        one = begins[:, edge] + place * way
        other = one + way
        low, high = np.minimum(one, other), np.maximum(one, other)
        self._edges.draw(0, low[:2], high[:2], kind)
        high[2] -= np.float32(_LOWERED)
        self._things.draw_boxes(low, high)

    def check_footprints(
        self, face: Index, place: Float, spans: tuple[Float, Float], towards: Float
    ) -> tuple[Bool, Bool]:
        """Return which footprints (N,) lie on one plane, and which of these beams surely meet nothing before it.

        Args:
            face: (N,) that the footprints' middles are on.
            place: (3, N) middle of the footprints, local, m.
            spans: (3, N) each, half the footprints' axes on the plane that they are on, m.
            towards: (3, N) unit vectors back to the scanner; the third component is positive.
        """
        if not place.shape[1]:
            return np.zeros(0, bool), np.zeros(0, bool)
        one, other = ((*self._turn(span[0], span[1]), span[2]) for span in spans)
        half = [np.sqrt(a * a + b * b) for a, b in zip(one, other, strict=True)]
        middle = (*self._turn(place[0], place[1]), place[2])
        corner = np.array([m - h - c for m, h, c in zip(middle, half, self._corner, strict=True)])
        width = 2.0 * np.maximum(half[0], half[1])
        level, last = self._edges.level_of(width), len(self._edges.cells) - 1
        nearest = self._edges.largest(np.minimum(level, last), corner[0], corner[1])
        whole = (level <= last) & (nearest == 0)
        beside = np.flatnonzero((level <= last) & (nearest == _BESIDE))
        half_axes = [np.array(axis[:2])[:, beside] for axis in (one, other)]
        whole[beside] = self._within_faces(face[beside], np.array(middle[:2])[:, beside], *half_axes)
        rows = np.flatnonzero(whole)
        back = np.array([*self._turn(towards[0, rows], towards[1, rows]), towards[2, rows]])
        alone = np.zeros(len(whole), bool)
        alone[rows] = self._things.passed_by(corner[:, rows], width[rows], back)
        return whole, alone

    def _within_faces(self, face: Index, middle: Float, one: Float, other: Float) -> Bool:
        """Return which footprints (N,), ellipses in plan with half axes (2, N), lie within the face of their middle."""
        corners = self._corners[:, np.searchsorted(self._faces, face)] + self._corner[:2, None, None]
        within = np.ones(len(face), bool)
        for i in range(3):
            a, b, c = (corners[:, :, (i + step) % 3] for step in range(3))
            inward = np.array([a[1] - b[1], b[0] - a[0]])
            inward *= np.sign((inward * (c - a)).sum(axis=0)) / np.maximum(np.hypot(*inward), _ROUNDING)
            reach = np.hypot((inward * one).sum(axis=0), (inward * other).sum(axis=0))
            within &= (inward * (middle - a)).sum(axis=0) >= reach + _ROUNDING
        return within

    def passed_by(self, origins: Float, directions: Float, spread: float) -> Bool:
        """Return a mask (N,) of the beams that surely pass by all of the scene, of those whose axis meets nothing.

        Args:
            origins: (3, N) where they begin, local, m; those that begin beside the scene aren't known to.
            directions: (3, N) unit vectors of their axes.
            spread: radius of the beam, m per metre of range.
        """
        result = np.zeros(origins.shape[1], bool)
        if not self.face.any() or not len(result):
            return result
        x, y = self._turn(origins[0], origins[1])
        begin = np.array([x - self._corner[0], y - self._corner[1], origins[2] - self._corner[2]])
        ahead, aside = self._turn(directions[0], directions[1])
        rise, size = directions[2], self._size
        inside = (begin[0] >= 0.0) & (begin[0] <= size[0]) & (begin[1] >= 0.0) & (begin[1] <= size[1])
        steep = np.where(np.abs(rise) > _LEVEL, rise, _LEVEL)
        # Up to where they leave the scene's sides, or its highest or lowest place.
        length = np.where(steep > 0.0, np.maximum(size[2] - begin[2], 0.0), -begin[2]) / steep
        for speed, place, side in ((ahead, begin[0], size[0]), (aside, begin[1], size[1])):
            with np.errstate(divide="ignore"):
                np.minimum(length, np.where(speed > 0.0, side - place, -place) / speed, where=speed != 0.0, out=length)
        rows = np.flatnonzero(inside & (np.abs(rise) > _LEVEL) & (length >= 0.0))
        up, radius = rise[rows] > 0.0, spread * length[rows]
        back = np.array([ahead[rows], aside[rows], rise[rows]])
        lowest = begin[:, rows] + np.where(up, 0.0, length[rows]) * back - radius
        result[rows] = self._things.passed_by(lowest, 2.0 * radius, back * np.where(up, 1.0, -1.0))
        return result


def _normals(mesh: SceneMesh, faces: Index) -> Float:
    """Return the unit normals (N, 3) of faces; of those without area 0."""
    a, b, c = (mesh.vertices[mesh.triangles[faces, i]].astype(np.float64) for i in range(3))
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=1)
    return np.asarray(normal / np.where(length > 0.0, length, 1.0)[:, None])


def _plane_edges(mesh: SceneMesh, faces: Index, normal: Float) -> tuple[Index, Index]:
    """Return the vertices (E, 2) of the edges at which a plane of ground ends, in two parts.

    That is between two faces of which one is of another material, or at an angle of more than `CREASE`, and where a
    face has no neighbour. The second part is where pavement or what is painted on it has none: it may lie on another.
    """
    triangles = mesh.triangles[faces]
    sides = np.sort(np.concatenate([triangles[:, [i, (i + 1) % 3]] for i in range(3)]), axis=1).astype(np.intp)
    owner = np.tile(np.arange(len(faces)), 3)
    key = sides[:, 0] * len(mesh.vertices) + sides[:, 1]
    order = np.argsort(key, kind="stable")
    key, owner = key[order], owner[order]
    starts = np.flatnonzero(np.diff(key, prepend=-1))
    count = np.diff(starts, append=len(key))
    first, second = owner[starts], owner[starts + (count > 1)]
    material = mesh.material[faces]
    level = np.linalg.norm(np.cross(normal[first], normal[second]), axis=1) <= np.sin(CREASE)
    ends = ~((count == 2) & level & (material[first] == material[second]))
    thin = np.isin(mesh.class_id[faces[first]], [class_id("road"), class_id("road_marking")]) & (count != 2)
    return sides[order[starts[ends & ~thin]]], sides[order[starts[ends & thin]]]
