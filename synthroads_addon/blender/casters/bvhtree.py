"""The reference caster: Blender's own `mathutils.bvhtree`, one ray at a time."""

from __future__ import annotations

import numpy as np
from mathutils import Vector
from mathutils.bvhtree import BVHTree
from numpy.typing import NDArray

from ...scanning.scene.mesh import SceneMesh


class BVHTreeCaster:
    """Casts rays with Blender's bounding volume tree; always there, and slow."""

    name = "bvhtree"
    main_thread_only = False

    def __init__(self, mesh: SceneMesh) -> None:
        self._tree = BVHTree.FromPolygons(mesh.vertices, mesh.triangles, all_triangles=True)

    def cast(
        self, origins: NDArray[np.float32], directions: NDArray[np.float32], maximum_range: float
    ) -> NDArray[np.int32]:
        """Return the (N,) indices of the faces hit, -1 for none; see `Caster.cast`."""
        cast = self._tree.ray_cast
        faces = np.full(len(origins), -1, dtype=np.int32)
        for i, (origin, direction) in enumerate(zip(origins.tolist(), directions.tolist(), strict=True)):
            face = cast(Vector(origin), Vector(direction), maximum_range)[2]
            if face is not None:
                faces[i] = face
        return faces

    def occluded(
        self, origins: NDArray[np.float32], directions: NDArray[np.float32], maximum_range: float
    ) -> NDArray[np.bool_]:
        """Return whether (N,) something is hit, see `Caster.occluded`."""
        return self.cast(origins, directions, maximum_range) >= 0
