"""Surfaces of a scene as its materials ask for them: values at the places where points were seen."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from ...base.arithmetic.loops import point_loops
from ...base.arrays import Float, Float32, Index, take_rows
from ..scene.mesh import SceneMesh
from ..scene.motion import MovingMesh
from ..scene.surface_values import NORMALS, SurfaceInput, corner_shares
from .colour import SeenPoints


class SceneSurfaces:
    """Values that a scene's surfaces hold for their materials, such as UV and attributes, with all at time 0.

    Args:
        static: what stands.
        moving: what moves.
    """

    def __init__(self, static: SceneMesh, moving: Sequence[MovingMesh] = ()) -> None:
        self._meshes = [static, *(part.mesh for part in moving)]
        self._poses = [(np.eye(3), np.zeros(3)), *(_initial_pose(part) for part in moving)]
        self._firsts = np.cumsum([0, *(len(mesh) for mesh in self._meshes)])

    def read(self, inputs: Iterable[SurfaceInput], points: SeenPoints, rows: Index) -> dict[SurfaceInput, Float32]:
        """Return each surface input's values (K, 4) at rows (K,) of points; 0 where the surface lacks it."""
        if points.face is None:
            return {what: np.zeros((len(rows), 4), np.float32) for what in sorted(inputs)}
        input_list = list(inputs)
        normal = take_rows(points.normal, rows) if any(what.kind in NORMALS for what in input_list) else None
        return self.read_places(input_list, take_rows(points.face, rows), take_rows(points.position, rows), normal)

    def read_places(
        self, inputs: Iterable[SurfaceInput], face: Index, place: Float, normal: NDArray[np.floating] | None = None
    ) -> dict[SurfaceInput, Float32]:
        """Return each surface input's values (N, 4) at N places; 0 where the surface lacks it.

        Args:
            inputs: no normals where none are given.
            face: (N,) triangles of the scene, those that move after those that stand.
            place: (N, 3) on them in the scene at time 0, local, m.
            normal: (N, 3) unit normals there, towards the scanner; None if no input needs them.
        """
        result = {what: np.zeros((len(face), 4), np.float32) for what in sorted(inputs)}
        if not result:
            return result
        for number, mesh in enumerate(self._meshes):
            first_face, end_face = self._firsts[number], self._firsts[number + 1]
            rows = np.flatnonzero((face >= first_face) & (face < end_face))
            if len(rows) == len(face):
                return self._read_mesh(number, mesh, (face, place, normal), list(result))
            if len(rows):
                towards = None if normal is None else take_rows(normal, rows)
                places = (take_rows(face, rows), take_rows(place, rows), towards)
                for what, values in self._read_mesh(number, mesh, places, list(result)).items():
                    result[what][rows] = values
        return result

    def _read_mesh(
        self,
        number: int,
        mesh: SceneMesh,
        places: tuple[Index, Float, NDArray[np.floating] | None],
        inputs: Sequence[SurfaceInput],
    ) -> dict[SurfaceInput, Float32]:
        """Return the surface inputs' values (N, 4), by input, at places on one of the meshes.

        Args:
            number: of the mesh.
            mesh: the mesh.
            places: faces (N,) of the scene, places (N, 3) in the scene at time 0, local, m, and unit normals (N, 3)
                there or None.
            inputs: that are read.
        """
        faces, place, towards = places[0] - self._firsts[number], places[1], places[2]
        rotation, begin = self._poses[number]
        normal = None if towards is None else np.asarray(towards, np.float64)
        if number:  # what stands is in the scene's own frame
            place = (place - begin) @ rotation
            normal = None if normal is None else normal @ rotation
        if (loops := point_loops()) is not None:
            shares = loops.corner_shares(mesh.vertices, mesh.triangles, faces, place)
        else:
            corners = take_rows(mesh.vertices, take_rows(mesh.triangles, faces))
            shares = corner_shares(corners.astype(np.float64), place)
        located = None if mesh.surface is None else mesh.surface.locate(faces)
        result: dict[SurfaceInput, Float32] = {}
        for what in inputs:
            values, is_known = np.zeros((len(faces), 4), np.float32), np.zeros(len(faces), bool)
            if mesh.surface is not None and located is not None:
                values, is_known = mesh.surface.read(what, located, shares, place, normal)
            if what.kind == "normal" and towards is not None:
                # Where the shading isn't smooth it is the face's own.
                values[is_known, :3] = values[is_known, :3] @ rotation.T
                values[~is_known, :3] = towards[~is_known]
            result[what] = values
        return result


def _initial_pose(part: MovingMesh) -> tuple[Float, Float]:
    """Return a moving part's rotation (3, 3) and position (3,), m, at time 0."""
    rotation, place, _ = part.motion.pose(np.zeros(1))
    return rotation[0], place[0]
