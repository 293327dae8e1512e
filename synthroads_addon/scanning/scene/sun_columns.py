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
        """Return a mask of places (3, N) that surely nothing shades from this direction (3,); None where none is told.

        Only of the direction that is asked for first anything is told, and only where compiled loops are in use.
        """
        loops = point_loops()
        if loops is None or not len(self._mesh) or (made := self._columns(loops, places.shape[1], direction)) is None:
            return None
        if not np.array_equal(made.grid.direction, direction):
            return None
        return loops.clear_places(places, self._faces, made.grid, made.listed)

    def _columns(self, loops: PointLoops, asked: int, direction: Float) -> _Columns | None:
        """Return the columns; None while another thread makes them, or too few places have been asked about."""
        if self._made is not None or not self._making.acquire(blocking=False):
            return self._made
        try:
            self._asked += asked
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
        axes = _axes_across(direction)
        corners = np.array([[bounds[bit >> axis & 1, axis] for axis in range(3)] for bit in range(8)])
        seen = axes @ corners.T
        margin = _MARGIN + _ROUNDING * size
        low, extent = seen.min(axis=1) - margin, np.ptp(seen, axis=1) + 2.0 * margin
        cell = max(_CELL, float((extent[0] * extent[1] / _MOST_CELLS) ** 0.5), float(extent.max()) / _MOST_CELLS)
        count = np.floor(extent / cell).astype(np.int64) + 1
        above = _ABOVE + _ROUNDING * size
        self.grid = ColumnGrid(axes / cell, low / cell, (int(count[0]), int(count[1])), margin / cell, direction, above)
        self.listed = loops.face_columns(faces, self.grid, _MOST_FACES)


def _axes_across(direction: Float) -> Float:
    """Return two unit vectors (2, 3) at right angles to a direction (3,) and to each other."""
    first = np.cross(direction, np.eye(3)[int(np.abs(direction).argmin())])
    first /= np.linalg.norm(first)
    return np.array([first, np.cross(direction, first)])
