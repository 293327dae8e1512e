"""The reference caster: Blender's own `mathutils.bvhtree`, one ray at a time."""

from __future__ import annotations

import numpy as np
from mathutils import Vector
from mathutils.bvhtree import BVHTree
from numpy.typing import NDArray

from ...scanning.scene.mesh import SceneMesh


class BVHTreeCaster:
    """Ray caster on Blender's bounding volume tree, one ray at a time: always available, slow."""

    name = "bvhtree"
    main_thread_only = False
    kernels = "none: rays are cast one by one"

    def __init__(self, mesh: SceneMesh) -> None:
        self._tree = BVHTree.FromPolygons(mesh.vertices, mesh.triangles, all_triangles=True)

    def cast(
        self, origins: NDArray[np.float32], directions: NDArray[np.float32], maximum_range: float | NDArray[np.float32]
    ) -> NDArray[np.int32]:
        """Return the index (N,) of the first face that each ray hits within its range (m), -1 for none."""
        ray_cast = self._tree.ray_cast
        faces = np.full(len(origins), -1, dtype=np.int32)
        limits = np.broadcast_to(maximum_range, len(origins)).tolist()
        rays = zip(origins.tolist(), directions.tolist(), limits, strict=True)
        for i, (origin, direction, limit) in enumerate(rays):
            # The result is (place, normal, index of the face, distance).
            face = ray_cast(Vector(origin), Vector(direction), limit)[2]
            if face is not None:
                faces[i] = face
        return faces

    def occluded(
        self, origins: NDArray[np.float32], directions: NDArray[np.float32], maximum_range: float | NDArray[np.float32]
    ) -> NDArray[np.bool_]:
        """Return a mask (N,) of the rays that hit anything within their range (m)."""
        return self.cast(origins, directions, maximum_range) >= 0
