"""Interface of ray casters, and what every caster shares: the range from the face's plane in float64."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ...base.arrays import Bool, Float, Float32, Index
from .mesh import SceneMesh


class Caster(Protocol):
    """Interface of ray casters, which find the first face that each ray meets.

    Attributes:
        name: as `scan.caster` in a scenario.
        main_thread_only: whether `cast` must be called from Blender's main thread; else any threads may, side by side.
        kernels: how the rays are cast, as a scan's report says it: in packets of how many, or why not.
    """

    name: str
    main_thread_only: bool
    kernels: str

    def cast(self, origins: Float32, directions: Float32, maximum_range: float) -> NDArray[np.int32]:
        """Return the (N,) indices of the faces hit; -1 where nothing is hit within ``maximum_range`` (m).

        Args:
            origins: (N, 3) C-contiguous, local coordinates, m.
            directions: (N, 3) C-contiguous unit vectors.
            maximum_range: no hit lies farther away, m.
        """
        ...

    def occluded(self, origins: Float32, directions: Float32, maximum_range: float | Float32) -> Bool:
        """Return a mask (N,) of the rays that hit anything within ``maximum_range`` (m), that of all or each ray's."""
        ...


class FacePlanes:
    """The planes of a mesh's faces in float64: n . x = c.

    Attributes:
        planes: (T, 4) unit normals and c, a face's side by side; the normal of a face without area is 0.
    """

    def __init__(self, mesh: SceneMesh) -> None:
        self.planes: Float = np.empty((len(mesh.triangles), 4))
        for start in range(0, len(mesh.triangles), _BLOCK):
            self._fill(mesh, slice(start, start + _BLOCK))

    def _fill(self, mesh: SceneMesh, block: slice) -> None:
        """Work out the planes of a block of faces: unit normals n, from the cross product of two sides, and n . a."""
        a, b, c = (mesh.vertices[mesh.triangles[block, i]].T.astype(np.float64) for i in range(3))
        b -= a
        c -= a
        normal = np.empty_like(a)
        for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            normal[i] = b[j] * c[k] - b[k] * c[j]
        length = np.sqrt(np.einsum("ij,ij->j", normal, normal))
        normal /= np.where(length > 0.0, length, 1.0)
        self.planes[block, :3] = normal.T
        self.planes[block, 3] = np.einsum("ij,ij->j", normal, a)

    def intersect(self, faces: Index, origins: Float, directions: Float) -> tuple[Float, Float]:
        """Return the ranges (m) at which rays meet the planes of faces, and the cosines n . d at which they do.

        A ray o + t d meets the plane n . x = c at t = (c - n . o) / (n . d).

        Args:
            faces: (...); where negative the result has no meaning.
            origins: (3, ...) in float64; of the faces' shape, or one that spreads to it.
            directions: (3, ...) unit vectors in float64; of the faces' shape.

        Returns:
            (...) range, not finite for a ray in the plane or a face without area; (...) n . d, negative where the ray
            meets the side that the normal points to.
        """
        # Clipped, indices needn't be checked one by one before.
        plane, product = np.take(self.planes, faces, axis=0, mode="clip"), np.empty(faces.shape)
        ranges = plane[..., 3].copy()  # c, then c - n . o, then the range
        cosine = plane[..., 0] * directions[0]
        ranges -= np.multiply(plane[..., 0], origins[0], out=product)
        for i in (1, 2):
            cosine += np.multiply(plane[..., i], directions[i], out=product)
            ranges -= np.multiply(plane[..., i], origins[i], out=product)
        with np.errstate(divide="ignore", invalid="ignore"):
            ranges /= cosine
        return ranges, cosine

    def normals(self, faces: Index, cosine: Float) -> Float:
        """Return the unit normals (3, H) of faces, on the side that rays came from; for the face -1 any normal.

        Args:
            faces: (H,).
            cosine: (H,) n . d of the faces' normals and the rays that met them.
        """
        result = np.ascontiguousarray(np.take(self.planes, faces, axis=0, mode="clip")[:, :3].T)
        result *= np.where(cosine > 0.0, -1.0, 1.0)
        return result


def as_rows(vectors: Float) -> Float32:
    """Return vectors (3, ...) as float32 rows (..., 3), the layout that casters take."""
    result = np.empty((*vectors.shape[1:], 3), dtype=np.float32)
    for i in range(3):
        result[..., i] = vectors[i]
    return result


_BLOCK = 1 << 16
