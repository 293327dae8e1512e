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
        is_flat = normal[:, 2] >= _STEEPEST
        ground, normal = ground[is_flat], normal[is_flat]
        self.face: Bool = np.zeros(len(mesh), bool)
        self.face[ground] = True
        if not len(ground):
            return
        turned_vertices = self._turn_vertices(mesh, ground)
        bounds = np.array([turned_vertices.min(axis=1), turned_vertices.max(axis=1)], np.float64)
        self._corner, self._size = bounds[0], bounds[1] - bounds[0]
        turned_vertices -= turned_vertices.min(axis=1)[:, None]
        self._faces, self._corners = ground, turned_vertices[:2, mesh.triangles[ground]]
        area = float(np.prod(bounds[1, :2] - bounds[0, :2]))
        cell = max(FINEST, _CELL * footprint, (area / most_cells) ** 0.5)
        self._edges = PlanGrids(bounds[1, :2] - bounds[0, :2], cell, np.uint8, 0)
        self._things = HeightGrids(bounds, cell)
        for edges, kind in zip(_plane_edges(mesh, ground, normal), (_BESIDE, _ABOVE), strict=True):
            self._draw_edges(turned_vertices, edges, cell, kind)
        plant = mesh.class_id == class_id("vegetation")
        self._things.draw_triangles(turned_vertices, mesh.triangles[~self.face & ~plant], _LONGEST_PIECE)
        self._things.draw_triangles(turned_vertices, mesh.triangles[plant], _LONGEST_PLANT_PIECE, _PLANT_CELL)
        self._edges.finish()
        self._things.finish()

    def _turn_vertices(self, mesh: SceneMesh, ground: Index) -> Float32:
        """Return the vertices (3, V), m, turned about the vertical so that the ground's longer side lies along x.

        It keeps the cosine and sine of the turn for `_turn`. The longer side is the principal axis of the ground's
        vertices in plan, at the angle 1/2 atan2(2 c_xy, c_xx - c_yy) for their covariance c.
        """
        x, y = mesh.vertices[np.unique(mesh.triangles[ground]), :2].T.astype(np.float64)
        covariance = np.cov(x, y)
        angle = 0.5 * np.arctan2(2.0 * covariance[0, 1], covariance[0, 0] - covariance[1, 1])
        self._cosine, self._sine = float(np.cos(angle)), float(np.sin(angle))
        x, y, z = mesh.vertices.T
        return np.array(self._turn(x, y) + (z,), np.float32)

    def _turn(self, x: Float, y: Float) -> tuple[Float, Float]:
        """Return the coordinates x and y (N,) of places in the frame of the grids, before its origin is subtracted."""
        return self._cosine * x + self._sine * y, self._cosine * y - self._sine * x

    def _draw_edges(self, vertices: Float32, edges: Index, cell: float, kind: int) -> None:
        """Draw edges into the grids of edges and of things, cut into pieces no longer than a cell.

        Args:
            vertices: (3, V) m.
            edges: (E, 2) numbers of the vertices at their ends.
            cell: width of the finest grid's cells, m.
            kind: `_BESIDE` or `_ABOVE`.
        """
        begins, ends = vertices[:, edges[:, 0]], vertices[:, edges[:, 1]]
        length = np.hypot(*(ends - begins)[:2])
        count = np.maximum(np.ceil(length / cell), 1.0).astype(np.intp)
        # Of each piece: the edge that it is of, and its number on that.
        edge = np.repeat(np.arange(len(count)), count)
        number = (np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count)).astype(np.float32)
        step = ((ends - begins) / count.astype(np.float32))[:, edge]
        piece_begins = begins[:, edge] + number * step
        piece_ends = piece_begins + step
        lowest_corners, highest_corners = np.minimum(piece_begins, piece_ends), np.maximum(piece_begins, piece_ends)
        self._edges.draw(0, lowest_corners[:2], highest_corners[:2], kind)
        highest_corners[2] -= np.float32(_LOWERED)
        self._things.draw_boxes(lowest_corners, highest_corners)

    def check_footprints(
        self, face: Index, place: Float, half_axes: tuple[Float, Float], towards: Float
    ) -> tuple[Bool, Bool]:
        """Return which footprints (N,) lie on one plane, and which of these beams surely meet nothing before it.

        Args:
            face: (N,) that the footprints' middles are on.
            place: (3, N) middle of the footprints, local, m.
            half_axes: (3, N) each, half axes of the footprints, ellipses on the planes of their faces, m.
            towards: (3, N) unit vectors back to the scanner; the third component is positive.
        """
        if not place.shape[1]:
            return np.zeros(0, bool), np.zeros(0, bool)
        # In the grids' frame: half axes, and the boxes around the footprints, whose half size along an axis is the
        # root of the summed squares of both half axes' components.
        axis_a, axis_b = ((*self._turn(axis[0], axis[1]), axis[2]) for axis in half_axes)
        middle = (*self._turn(place[0], place[1]), place[2])
        half_size = [np.sqrt(a * a + b * b) for a, b in zip(axis_a, axis_b, strict=True)]
        corner = np.array([middle[i] - half_size[i] - self._corner[i] for i in range(3)])
        width = 2.0 * np.maximum(half_size[0], half_size[1])
        # One plane: no edge of a plane near the footprint, or the footprint within the face despite edges beside it.
        level, coarsest_level = self._edges.level_of(width), len(self._edges.cells) - 1
        fits_grid = level <= coarsest_level
        edge_kind = self._edges.largest(np.minimum(level, coarsest_level), corner[0], corner[1])
        one_plane = fits_grid & (edge_kind == 0)
        near_edge = np.flatnonzero(fits_grid & (edge_kind == _BESIDE))
        plan_axes = [np.array(axis[:2])[:, near_edge] for axis in (axis_a, axis_b)]
        one_plane[near_edge] = self._within_faces(face[near_edge], np.array(middle[:2])[:, near_edge], *plan_axes)
        rows = np.flatnonzero(one_plane)
        direction_back = np.array([*self._turn(towards[0, rows], towards[1, rows]), towards[2, rows]])
        unblocked = np.zeros(len(one_plane), bool)
        unblocked[rows] = self._things.passed_by(corner[:, rows], width[rows], direction_back)
        return one_plane, unblocked

    def _within_faces(self, face: Index, middle: Float, axis_a: Float, axis_b: Float) -> Bool:
        """Return a mask (N,) of the footprints that lie within the face of their middle, in plan.

        Args:
            face: (N,) of their middles.
            middle: (2, N) in the grids' frame before its origin is subtracted, m.
            axis_a, axis_b: (2, N) half axes of the footprints, which are ellipses in plan, m.
        """
        corners = self._corners[:, np.searchsorted(self._faces, face)] + self._corner[:2, None, None]
        is_within = np.ones(len(face), bool)
        for i in range(3):
            # The side from a to b, with a unit vector at a right angle to it that points to the third corner c.
            a, b, c = (corners[:, :, (i + step) % 3] for step in range(3))
            inward = np.array([a[1] - b[1], b[0] - a[0]])
            inward *= np.sign((inward * (c - a)).sum(axis=0)) / np.maximum(np.hypot(*inward), _ROUNDING)
            # Half the width of an ellipse along a unit vector: the root of the summed squares of its half axes'
            # products.
            half_width = np.hypot((inward * axis_a).sum(axis=0), (inward * axis_b).sum(axis=0))
            is_within &= (inward * (middle - a)).sum(axis=0) >= half_width + _ROUNDING
        return is_within

    def passed_by(self, origins: Float, directions: Float, spread: float) -> Bool:
        """Return a mask (N,) of the beams that surely pass by all of the scene, of those whose axis meets nothing.

        Args:
            origins: (3, N) where they begin, local, m; of beams that begin beside the scene the mask is False.
            directions: (3, N) unit vectors of their axes.
            spread: radius of the beam, m per metre of range.
        """
        result = np.zeros(origins.shape[1], bool)
        if not self.face.any() or not len(result):
            return result
        x, y = self._turn(origins[0], origins[1])
        begin = np.array([x - self._corner[0], y - self._corner[1], origins[2] - self._corner[2]])
        direction_x, direction_y = self._turn(directions[0], directions[1])
        rise, size = directions[2], self._size
        starts_inside = (begin[0] >= 0.0) & (begin[0] <= size[0]) & (begin[1] >= 0.0) & (begin[1] <= size[1])
        # Range at which they leave the scene's box: first by its top or bottom, then by its sides if that is nearer.
        slope = np.where(np.abs(rise) > _LEVEL, rise, _LEVEL)
        length = np.where(slope > 0.0, np.maximum(size[2] - begin[2], 0.0), -begin[2]) / slope
        for speed, place, side in ((direction_x, begin[0], size[0]), (direction_y, begin[1], size[1])):
            with np.errstate(divide="ignore"):
                np.minimum(length, np.where(speed > 0.0, side - place, -place) / speed, where=speed != 0.0, out=length)
        rows = np.flatnonzero(starts_inside & (np.abs(rise) > _LEVEL) & (length >= 0.0))
        # A beam that goes up is followed from its beginning, one that goes down back from where it leaves the box:
        # either from its lowest place to its highest.
        goes_up, radius = rise[rows] > 0.0, spread * length[rows]
        direction = np.array([direction_x[rows], direction_y[rows], rise[rows]])
        lowest_place = begin[:, rows] + np.where(goes_up, 0.0, length[rows]) * direction - radius
        result[rows] = self._things.passed_by(lowest_place, 2.0 * radius, direction * np.where(goes_up, 1.0, -1.0))
        return result


def _normals(mesh: SceneMesh, faces: Index) -> Float:
    """Return the unit normals (N, 3) of faces; of those without area 0."""
    a, b, c = (mesh.vertices[mesh.triangles[faces, i]].astype(np.float64) for i in range(3))
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=1)
    return np.asarray(normal / np.where(length > 0.0, length, 1.0)[:, None])


def _plane_edges(mesh: SceneMesh, faces: Index, normal: Float) -> tuple[Index, Index]:
    """Return the edges at which a plane of ground ends, as numbers (E, 2) of their vertices, in two parts.

    A plane ends between two faces of different materials or at an angle of more than `CREASE`, and where a face has no
    neighbour or several. The second part are such edges without one neighbour that pavement or paint on it has: it may
    lie on another face.

    Args:
        mesh: the scene's.
        faces: (N,) of the ground.
        normal: (N, 3) their unit normals.
    """
    triangles = mesh.triangles[faces]
    sides = np.sort(np.concatenate([triangles[:, [i, (i + 1) % 3]] for i in range(3)]), axis=1).astype(np.intp)
    owner = np.tile(np.arange(len(faces)), 3)
    # Sides of the same two vertices have one key; sorted by key, those of one edge follow on each other.
    key = sides[:, 0] * len(mesh.vertices) + sides[:, 1]
    order = np.argsort(key, kind="stable")
    key, owner = key[order], owner[order]
    starts = np.flatnonzero(np.diff(key, prepend=-1))
    face_count = np.diff(starts, append=len(key))
    face_a, face_b = owner[starts], owner[starts + (face_count > 1)]
    material = mesh.material[faces]
    # The length of two unit normals' cross product is the sine of the angle between them.
    is_flat = np.linalg.norm(np.cross(normal[face_a], normal[face_b]), axis=1) <= np.sin(CREASE)
    ends_plane = ~((face_count == 2) & is_flat & (material[face_a] == material[face_b]))
    paved = np.isin(mesh.class_id[faces[face_a]], [class_id("road"), class_id("road_marking")])
    is_thin = paved & (face_count != 2)
    return sides[order[starts[ends_plane & ~is_thin]]], sides[order[starts[ends_plane & is_thin]]]
