"""A fast caster: Embree 4 through `embreex`, ray by ray. It lets go of Python's lock, so threads run side by side."""

from __future__ import annotations

import logging
import os
from contextlib import suppress

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import NDArray

from ...base.arrays import Float32
from ...scanning.scene.mesh import SceneMesh

_AT_ONCE = 20_000
"""Triangles handed over in one call where other threads wait: no other thread runs during the call; chosen."""


_SPREAD = 1.5
"""Largest ratio of vertices in a run to corners of triangles at which the run is handed over whole; chosen."""


class _NativeErrors(logging.Handler):
    """Handler that writes to the system's standard error, where a command holds back what precedes a crash."""

    def emit(self, record: logging.LogRecord) -> None:
        """Write a record's message in a line."""
        with suppress(OSError):  # there is no standard error
            os.write(2, f"{record.getMessage()}\n".encode(errors="backslashreplace"))


_log = logging.getLogger("embreex")
if not _log.handlers:
    # embreex logs Embree's errors; without a handler Python would write them to `sys.stderr`.
    _log.addHandler(_NativeErrors())
    _log.propagate = False


class EmbreeCaster:
    """Ray caster on Embree 4, which releases Python's lock while casting.

    Args:
        mesh: triangles that rays hit.
        robust: whether no ray may slip through an edge that two faces share; a little slower.
        in_pieces: whether to hand the mesh over in pieces, so that other threads run in between; casting is slower.
        kernels: reason why rays aren't cast in packets, for the report.
    """

    name = "embree"
    main_thread_only = False

    def __init__(
        self,
        mesh: SceneMesh,
        robust: bool = True,
        in_pieces: bool = False,
        kernels: str = "off: rays are cast one by one",
    ) -> None:
        self.kernels = kernels
        self._scene = EmbreeScene(robust=robust)
        self._meshes: list[TriangleMesh] = []
        piece_size = _AT_ONCE if in_pieces else max(1, len(mesh.triangles))
        first_triangles = range(0, len(mesh.triangles), piece_size)
        for first_triangle in first_triangles:
            triangles = mesh.triangles[first_triangle : first_triangle + piece_size]
            self._meshes.append(TriangleMesh(self._scene, *_used_vertices(mesh.vertices, triangles)))
        self._firsts = np.array([*first_triangles, 0], np.int32)
        "Index of each piece's first face. Embree numbers a miss (-1, -1): the last entry, 0, makes it face -1."
        if self._meshes:
            # The tree is built by the first ray: cast one here, before threads do.
            self._scene.run(np.zeros((1, 3), np.float32), np.array([[0, 0, 1]], np.float32))

    def cast(
        self, origins: NDArray[np.float32], directions: NDArray[np.float32], maximum_range: float
    ) -> NDArray[np.int32]:
        """Return the index (N,) of the first face that each ray hits within the range (m), -1 for none."""
        if not self._meshes or len(origins) == 0:
            return np.full(len(origins), -1, dtype=np.int32)
        limit = np.full(len(origins), maximum_range, dtype=np.float32)
        if len(self._meshes) == 1:
            return np.asarray(self._scene.run(origins, directions, dists=limit))
        hits = self._scene.run(origins, directions, dists=limit, output=1)
        return np.asarray(np.take(self._firsts, hits["geomID"]) + hits["primID"])

    def occluded(
        self,
        origins: NDArray[np.float32],
        directions: NDArray[np.float32],
        maximum_range: float | NDArray[np.float32],
    ) -> NDArray[np.bool_]:
        """Return a mask (N,) of the rays that hit anything within their range (m); half the work of `cast`."""
        if not self._meshes or len(origins) == 0:
            return np.zeros(len(origins), bool)
        limit = np.array(np.broadcast_to(maximum_range, len(origins)), np.float32)
        return np.asarray(self._scene.run(origins, directions, dists=limit, query="OCCLUDED") == 0)


def _used_vertices(vertices: Float32, triangles: NDArray[np.int32]) -> tuple[Float32, NDArray[np.int32]]:
    """Return the vertices (U, 3) that some triangles (N, 3) of a mesh use, and the triangles as indices of these."""
    lowest_index, highest_index = int(triangles.min()), int(triangles.max())
    if (
        highest_index - lowest_index < _SPREAD * triangles.size
    ):  # nearly every vertex of the run is used: parts built together have neighbouring vertices
        return vertices[lowest_index : highest_index + 1], triangles - np.int32(lowest_index)
    vertex_indices, corners = np.unique(triangles, return_inverse=True)
    return vertices[vertex_indices], corners.reshape(triangles.shape).astype(np.int32)
