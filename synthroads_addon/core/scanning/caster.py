"""What a ray caster is, and what every caster shares: the range from the face's plane in float64."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..scene_mesh import SceneMesh

Float = NDArray[np.float64]


class Caster(Protocol):
    """Finds the first face that each ray meets. Safe to call from several threads at once."""

    name: str

    def cast(
        self, origins: NDArray[np.float32], directions: NDArray[np.float32], maximum_range: float
    ) -> NDArray[np.int32]:
        """Return the (N,) indices of the faces hit; -1 where nothing is hit within ``maximum_range`` (m).

        Args:
            origins: (N, 3) C-contiguous, local coordinates, m.
            directions: (N, 3) C-contiguous unit vectors.
            maximum_range: no hit lies farther away, m.
        """
        ...


class FacePlanes:
    """The planes of a mesh's faces in float64: n . x = c.

    Attributes:
        planes: (T, 4) unit normal and c; the normal of a face without area is 0.
    """

    def __init__(self, mesh: SceneMesh) -> None:
        corner = mesh.vertices[mesh.triangles[:, 0]].astype(np.float64)
        normals = mesh.normals()
        self.planes: Float = np.column_stack([normals, np.einsum("ij,ij->i", normals, corner)])

    def ranges(self, faces: NDArray[np.int32], origins: Float, directions: Float) -> tuple[Float, Float, Float]:
        """Return range, cosine of incidence and unit normals towards the scanner of rays that hit ``faces``.

        Args:
            faces: (N,) faces hit; all >= 0.
            origins: (N, 3) in float64.
            directions: (N, 3) unit vectors in float64.

        Returns:
            (N,) range in m, (N,) cosine of the incidence angle in 0 to 1 (surfaces have two sides), (N, 3) normals.
        """
        plane = self.planes[faces]
        normal = plane[:, :3]
        along = np.einsum("ij,ij->i", normal, directions)
        height = plane[:, 3] - np.einsum("ij,ij->i", normal, origins)
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = height / along
        facing = np.where(along[:, None] > 0.0, -normal, normal)
        return distance, np.minimum(np.abs(along), 1.0), facing
