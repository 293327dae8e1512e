"""Faces by the columns towards the sun that they lie in: most places are told to be in the sun without casting a ray.

Seen from the sun, faces lie side by side in the cells of a grid. A place from which a ray goes to the sun can be shaded
by faces of its own cell alone, and of these only by such as lie between it and the sun: which have their planes there,
and the place within their edges. Where few faces lie in a cell, as on open ground, looking at each of them takes less
time than a ray.
"""

from __future__ import annotations

from threading import Lock

import numpy as np

from ...base.arithmetic.loops import ColumnGrid, Faces, PointLoops, point_loops
from ...base.arrays import Bool, Float
from .caster import FacePlanes
from .mesh import SceneMesh

_CELL, _MOST_CELLS = 0.25, 1 << 20
"""Width of the cells, m, and how many there may be; of a larger scene they are wider."""
_MOST_FACES = 8
"""Faces of a cell that are looked at; of places where there are more nothing is told."""
_MARGIN, _ABOVE, _ROUNDING = 0.01, 1e-4, 2.0**-22
"""By how much faces are wider than they are, and how far places must lie from planes, m; besides, so much of the
scene's size: rays and casters round to float32."""


class SunColumns:
    """Columns of a mesh's faces towards the sun, made once so many places are asked about that it pays.

    Args:
        mesh: that stands.
        planes: of its faces.
    """

    def __init__(self, mesh: SceneMesh, planes: FacePlanes) -> None:
        self._mesh, self._faces = mesh, Faces(mesh.vertices, mesh.triangles, planes.planes)
        self._making, self._asked = Lock(), 0
        self._made: _Columns | None = None

    def clear(self, places: Float, direction: Float) -> Bool | None:
        """Return a mask (N,) of the places (3, N), m, that surely nothing shades from a direction (3,), a unit vector.

        None where the columns can't tell: for directions other than the first one, without compiled loops, and until as
        many places have been asked about as there are faces.
        """
        loops = point_loops()
        if loops is None or not len(self._mesh):
            return None
        columns = self._columns(loops, places.shape[1], direction)
        if columns is None or not np.array_equal(columns.grid.direction, direction):
            return None
        return loops.clear_places(places, self._faces, columns.grid, columns.listed)

    def _columns(self, loops: PointLoops, place_count: int, direction: Float) -> _Columns | None:
        """Return the columns; None while another thread makes them, or too few places have been asked about.

        Args:
            loops: that make them.
            place_count: places that are asked about now.
            direction: (3,) unit vector towards the sun.
        """
        if self._made is not None or not self._making.acquire(blocking=False):
            return self._made
        try:
            self._asked += place_count
            if self._asked >= len(self._mesh):
                self._made = _Columns(self._mesh, self._faces, direction, loops)
        finally:
            self._making.release()
        return self._made


class _Columns:
    """The columns of a mesh's faces.

    Args:
        mesh: with faces.
        faces: its faces.
        direction: (3,) unit vector towards the sun.
        loops: that make them.

    Attributes:
        grid: of the columns.
        listed: faces of each column, see `PointLoops.face_columns`.
    """

    def __init__(self, mesh: SceneMesh, faces: Faces, direction: Float, loops: PointLoops) -> None:
        bounds = mesh.vertex_bounds()
        assert bounds is not None
        size = float(np.abs(bounds).max() + (bounds[1] - bounds[0]).max())
        # The scene's box seen from the sun: its corners (8, 3), projected onto two axes (2, 8).
        axes = _axes_across(direction)
        corners = np.array([[bounds[bit >> axis & 1, axis] for axis in range(3)] for bit in range(8)])
        projected = axes @ corners.T
        margin, clearance = _MARGIN + _ROUNDING * size, _ABOVE + _ROUNDING * size
        corner, extent = projected.min(axis=1) - margin, np.ptp(projected, axis=1) + 2.0 * margin
        cell = max(_CELL, float((extent[0] * extent[1] / _MOST_CELLS) ** 0.5), float(extent.max()) / _MOST_CELLS)
        count = np.floor(extent / cell).astype(np.int64) + 1
        cells = (int(count[0]), int(count[1]))
        # Lengths across are in units of a cell.
        self.grid = ColumnGrid(axes / cell, corner / cell, cells, margin / cell, direction, clearance)
        self.listed = loops.face_columns(faces, self.grid, _MOST_FACES)


def _axes_across(direction: Float) -> Float:
    """Return two unit vectors (2, 3) at right angles to a direction (3,) and to each other."""
    first_axis = np.cross(direction, np.eye(3)[int(np.abs(direction).argmin())])
    first_axis /= np.linalg.norm(first_axis)
    return np.array([first_axis, np.cross(direction, first_axis)])
