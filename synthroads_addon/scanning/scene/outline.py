"""Coarse boxes that hold all of a scene: most beams that meet nothing pass them all by, which one quick ray tells."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...base.arrays import Bool, Float, Float32, Index
from .caster import Caster, as_rows
from .height_grids import PlanGrids, extremes
from .mesh import SceneMesh

_CELL, _MOST_CELLS = 4.0, 1 << 14
"""Width of the boxes in plan, m, and how many there may be; in a larger scene they are wider."""
_AT_ONCE = 1 << 16
"""Triangles that are drawn together: their arrays stay in the processor's cache."""
_ROUNDING = 1e-5
"""How much larger boxes are for the rounding of places and rays, by the extent of the scene."""
_PROBED, _WORTH_ASKING = 16, 0.1
"""Of so many beams one is asked first, and the others only if this share of them passes the scene by."""
_SIDES = (
    *((0, 2, 1), (1, 2, 3), (4, 5, 6), (5, 7, 6), (0, 1, 4), (1, 5, 4)),
    *((2, 6, 3), (3, 6, 7), (0, 4, 2), (2, 4, 6), (1, 3, 5), (3, 7, 5)),
)
"""Triangles of a box, by the numbers of its corners: x, y and z are high where the bits 4, 2 and 1 are set."""


class Outline:
    """The boxes over the cells of a grid in plan, each as low and as high as what is there.

    Args:
        mesh: a scene's; with triangles.
        make_caster: gives a caster of a mesh.
        margin: radius of the widest beam that will be asked about, at its farthest, m.
    """

    def __init__(self, mesh: SceneMesh, make_caster: Callable[[SceneMesh], Caster], margin: float) -> None:
        self._caster = make_caster(_box_mesh(*_boxes(mesh, margin), mesh.origin))

    def passed_by(self, origins: Float, directions: Float, reach: float) -> Bool:
        """Return a mask (N,) of the beams that surely pass by all of the scene.

        Where few beams of a sample do, the others aren't cast and the mask is False for all.

        Args:
            origins: (3, N) where they begin, local, m.
            directions: (3, N) unit vectors of their axes.
            reach: how far they go, m.
        """
        probe_passes = self._free(origins[:, ::_PROBED], directions[:, ::_PROBED], reach)
        if np.count_nonzero(probe_passes) <= _WORTH_ASKING * len(probe_passes):
            return np.zeros(origins.shape[1], bool)
        return self._free(origins, directions, reach)

    def _free(self, origins: Float, directions: Float, reach: float) -> Bool:
        """Return a mask (N,) of the rays (3, N) that meet none of the boxes within their reach (m)."""
        return ~self._caster.occluded(as_rows(origins), as_rows(directions), reach)


def _boxes(mesh: SceneMesh, margin: float) -> tuple[Float, Float]:
    """Return the lowest and highest corners (3, B) of boxes that hold all of a mesh and a margin (m) around it."""
    bounds = mesh.vertex_bounds()
    assert bounds is not None
    size = bounds[1] - bounds[0]
    cell = max(_CELL, float((size[0] * size[1] / _MOST_CELLS) ** 0.5), float(size[:2].max()) / _MOST_CELLS)
    # Both grids keep largest values: the one of heights, the other of heights with the opposite sign.
    tops, bottoms = (PlanGrids(size[:2], cell, np.float32, -np.inf) for _ in range(2))
    origin = bounds[0, :2].astype(np.float32)[:, None]
    for start in range(0, len(mesh.triangles), _AT_ONCE):
        lowest_places, highest_places = extremes(mesh.vertices.T[:, mesh.triangles[start : start + _AT_ONCE].T])
        begin, end = lowest_places[:2] - origin, highest_places[:2] - origin
        triangle_levels = np.searchsorted(2.0 * tops.cells[:-1], (end - begin).max(axis=0))
        for level in np.unique(triangle_levels).tolist():
            rows = np.flatnonzero(triangle_levels == level)
            tops.draw(level, begin[:, rows], end[:, rows], highest_places[2, rows])
            bottoms.draw(level, begin[:, rows], end[:, rows], -lowest_places[2, rows])
    top_heights, negative_bottom = tops.spread(), bottoms.spread()
    cells = np.array(np.nonzero(top_heights > -np.inf))
    margin += _ROUNDING * float(np.abs(bounds).max() + size.max())
    cell_begin = bounds[0, :2, None] + cell * cells
    lowest_corners = np.array([*(cell_begin - margin), -negative_bottom[*cells] - margin], np.float64)
    highest_corners = np.array([*(cell_begin + cell + margin), top_heights[*cells] + margin], np.float64)
    return lowest_corners, highest_corners


def _box_mesh(lowest_corners: Float, highest_corners: Float, origin: Float) -> SceneMesh:
    """Return boxes between corners (3, B), m, as a mesh of unlabelled triangles."""
    corner_numbers: Index = np.arange(8)
    # (8, B) of each coordinate: which of both corners it is taken from, a bit of the corner's number tells.
    coordinates: list[Float32] = [
        np.where(corner_numbers[:, None] & bit, highest_corners[axis], lowest_corners[axis]).astype(np.float32)
        for axis, bit in enumerate((4, 2, 1))
    ]
    boxes = lowest_corners.shape[1]
    # The vertices are ordered by corner, then by box.
    triangles = (np.array(_SIDES, np.int32)[:, :, None] * boxes + np.arange(boxes, dtype=np.int32)).transpose(2, 0, 1)
    count = boxes * len(_SIDES)
    return SceneMesh(
        vertices=np.stack(coordinates, axis=-1).reshape(-1, 3),
        triangles=np.ascontiguousarray(triangles.reshape(-1, 3)),
        class_id=np.zeros(count, np.uint8),
        instance_id=np.zeros(count, np.uint32),
        material=np.zeros(count, np.uint16),
        materials=("",),
        origin=origin,
    )
